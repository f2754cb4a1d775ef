"""Open-loop gaits optimised by CMA-ES: the strongest policies that need no learning and see nothing.

    python -m agents.open_loop                                             mean return on hoof_env/HorseLeg-v0
    python -m agents.open_loop --env-id hoof_env/HorseLegRail-v0 --family clocked
    python -m agents.open_loop --objective peak --speed 3                  least force at 3 m/s or more
    python -m agents.evaluate --policy run runs/open_loop/HorseLeg-v0-constant.json

Families: "constant", the paper's gaits, four numbers that are held; "clocked", each of the four actions with
a first harmonic of one clock beside it, thirteen numbers. The clock starts with the episode, wherever the
crank is.

The best of several searches is chosen by starts that none has met and scored with yet others, the episodes
of agents.evaluate. The file is written after every search; searches that are in it are not made again, and
Ctrl-C keeps the best so far.
"""

from __future__ import annotations

import json
import math
import time
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np

from agents import runs
from agents.command import parse_pairs, run
from agents.evaluate import estimate
from agents.open_loop_search import ROWS, TEST_SEED, Episodes, Objective, decode, search
from hoof_env._output import check_folder
from hoof_env.envs.policies import stored
from hoof_env.errors import DataFileError, HoofEnvError, ParameterError, check_number
from hoof_env.gait.parameters import PARAMETERS

EPISODES = {"constant": 10_240, "clocked": 30_720}
"""Of a search, by family."""

KEPT = (
    "return", "speed_m_s", "stance_peak_n", "cost_of_transport", "peak_grf_n", "weight_share", "stances",
    "failed",
)  # fmt: skip
"""Figures of an episode whose means are kept."""


@dataclass(frozen=True)
class Args:
    env_id: str = "hoof_env/HorseLeg-v0"
    """registered environment of this package with many at once"""
    env_kwargs: tuple[str, ...] = ()
    """its arguments: key=value ..., or one JSON object; with reward_weights returns weigh otherwise"""
    family: Literal["constant", "clocked"] = "constant"
    """of gaits"""
    objective: Literal["return", "peak", "transport"] = "return"
    """highest mean return; or, at --speed or more, least mean peak force of a stance or cost of transport"""
    speed: float | None = None
    """mean speed that "peak" and "transport" ask for [m/s]"""
    weight_share: float | None = None
    """mean part of the weight that they ask the leg to bear"""
    restarts: int = 5
    """searches, of seeds 0, 1, ..."""
    episodes: int | None = None
    """of each search; otherwise 10240, or 30720 for "clocked\""""
    test_episodes: int = 512
    """of the final score, from seed 1000 on"""
    start: Path | None = None
    """file of a gait whose constants every second search begins with"""
    out: Path | None = None
    """file; otherwise runs/open_loop/ENV-FAMILY[-OBJECTIVE-SPEED[-share-SHARE]].json"""


def optimise(args: Args) -> dict[str, Any]:
    """Search, and write the file after every search; returns what it holds.

    Raises:
        HoofEnvError: no CMA-ES is installed. ParameterError: an argument does not fit. DataFileError,
            OutputError: the file is of something else, or cannot be written. KeyboardInterrupt: Ctrl-C; what
            was found is in the file.
    """
    episodes = check(args)
    from tqdm import tqdm

    path = args.out or Path("runs/open_loop", file_name(args))
    about: dict[str, Any] = {
        "env_id": args.env_id, "env_kwargs": parse_pairs("--env-kwargs", args.env_kwargs),
        "family": args.family, "objective": args.objective,
        "speed": args.speed, "weight_share": args.weight_share,
        "episodes_of_a_search": episodes, "test_episodes": args.test_episodes,
        "start": stored(args.start)["parameters"]["constant"] if args.start else None,
    }  # fmt: skip
    restarts = earlier(path, about)
    check_folder(path.parent)
    objective = Objective(
        args.env_id, about["env_kwargs"], args.family, args.objective, args.speed, args.weight_share
    )
    left = [seed for seed in range(args.restarts) if seed not in [one["seed"] for one in restarts]]
    content: dict[str, Any] = {}
    with tqdm(total=episodes * len(left), unit=" episodes", leave=False, disable=None) as bar:
        for k, seed in enumerate(left):
            bar.set_description(f"{path.stem}, search {seed}")
            restarts.append(search_once(objective, seed, about, bar))
            content = write(path, about, objective, restarts, content)
            if restarts[-1].get("interrupted"):
                raise KeyboardInterrupt
            bar.n = (k + 1) * episodes  # a search may have converged before
    return content or write(path, about, objective, restarts, {})


def check(args: Args) -> int:
    """Refuse what does not fit; returns the episodes of a search."""
    try:
        import cma  # noqa: F401
        import tqdm  # noqa: F401
    except ModuleNotFoundError as error:
        raise HoofEnvError(
            f'agents.open_loop needs {error.name}: pip install "hoof-env[train,identify]"'
        ) from None
    check_number("restarts", args.restarts, low=1, high=1000)
    check_number("test_episodes", args.test_episodes, low=2, high=1e6)
    episodes = args.episodes or EPISODES[args.family]
    check_number("episodes", episodes, low=3 * ROWS, high=1e7)
    if (args.objective == "return") != (args.speed is None):
        raise ParameterError(f"speed: expected one for 'peak' and 'transport' alone, got {args.speed!r}")
    if args.objective == "return" and args.weight_share is not None:
        raise ParameterError("weight_share: expected none for 'return', which has no conditions")
    for name, high in (("speed", 20), ("weight_share", 1)):
        if getattr(args, name) is not None:
            check_number(name, getattr(args, name), low=0, high=high)
    return episodes


def search_once(objective: Objective, seed: int, about: dict[str, Any], bar: Any) -> dict[str, Any]:
    """One search, as the file keeps it."""
    began, used, objective.spent = time.monotonic(), time.process_time(), 0

    def tick(count: int, lowest: float) -> None:
        bar.update(count)
        bar.set_postfix(cost=f"{lowest:.3f}")

    start = about["start"] if seed % 2 else None
    x, cost, interrupted = search(objective, seed, about["episodes_of_a_search"], tick, start)
    parameters = {key: value.tolist() for key, value in decode(objective.family, x).items()}
    return {
        "seed": seed,
        "cost": cost,
        "parameters": parameters,
        "episodes": objective.spent,
        "wall_s": round(time.monotonic() - began, 1),
        "cpu_s": round(time.process_time() - used, 1),
        "mean": means(objective.test(parameters, about["test_episodes"])),
        **({"interrupted": True} if interrupted else {}),
    }


def means(episodes: Episodes) -> dict[str, float | None]:
    """Of the figures that are kept; None for an infinite one."""
    figures = {key: float(np.mean([one[key] for one in episodes])) for key in KEPT}
    return {key: value if math.isfinite(value) else None for key, value in figures.items()}


def write(
    path: Path,
    about: dict[str, Any],
    objective: Objective,
    restarts: list[dict[str, Any]],
    before: dict[str, Any],
) -> dict[str, Any]:
    """Write the best of the searches, scored, and all of them; returns what the file holds.

    Args:
        path, about: the file, and what was asked for.
        objective: what scores a gait.
        restarts: the searches.
        before: what the file held, or nothing.
    """
    best = min(restarts, key=lambda one: one["cost"])
    score = before.get("score")
    if before.get("parameters") != best["parameters"]:
        episodes = objective.test(best["parameters"], about["test_episodes"])
        score = {"first_seed": TEST_SEED, "mean": means(episodes), "interval95": {}}
        for key, mean in score["mean"].items():
            interval = estimate([one[key] for one in episodes]) if mean is not None else None
            score["interval95"][key] = [interval.low, interval.high] if interval else None
    gait = objective.leg.command_of(np.array(best["parameters"]["constant"])).tolist()
    content = {
        **about,
        "parameters": best["parameters"],
        "gait": dict(zip(PARAMETERS, gait, strict=True)),
        "dt": objective.leg.dt,
        "score": score,
        "episodes": sum(one["episodes"] for one in restarts),
        **{key: round(sum(one[key] for one in restarts), 1) for key in ("wall_s", "cpu_s")},
        "command": runs.command(),
        "versions": {**runs.versions(), "cma": version("cma")},
        "restarts": restarts,
    }
    runs.write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")
    return content


def earlier(path: Path, about: dict[str, Any]) -> list[dict[str, Any]]:
    """The searches of a file that were not interrupted; none if there is no file.

    Raises:
        DataFileError: the file is of something else.
    """
    if not path.is_file():
        return []
    with suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
        content = json.loads(path.read_text(encoding="utf-8"))
        if all(content.get(key) == value for key, value in about.items()):
            return [one for one in content["restarts"] if not one.get("interrupted")]
    raise DataFileError(f"{path}: expected searches with {about} to go on with; name another --out")


def file_name(args: Args) -> str:
    """What the file of a search is called."""
    asked = "" if args.objective == "return" else f"-{args.objective}-{args.speed:g}"
    asked += "" if args.weight_share is None else f"-share-{args.weight_share:g}"
    return f"{args.env_id.rpartition('/')[2]}-{args.family}{asked}.json"


def main(argv: list[str] | None = None) -> None:
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.open_loop", description=__doc__)
    content = optimise(args)
    for one in content["restarts"]:
        print(
            f"search {one['seed']}: cost {one['cost']:.3f}, {one['episodes']} episodes, {one['wall_s']:.0f} s"
        )
    for key, mean in content["score"]["mean"].items():
        bounds = content["score"]["interval95"][key]
        print(f"{key:18} " + (f"{mean:.3f} [{bounds[0]:.3f}, {bounds[1]:.3f}]" if bounds else "infinite"))
    print(f"written: {args.out or Path('runs/open_loop', file_name(args))}")


if __name__ == "__main__":
    run(main)
