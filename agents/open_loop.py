"""Open-loop gaits optimised by CMA-ES: the strongest policies that need no learning and see nothing.

    python -m agents.open_loop                                             mean return on hoof_env/HorseLeg-v0
    python -m agents.open_loop --env-id hoof_env/HorseLegRail-v0 --family clocked
    hoof-env evaluate run runs/open_loop/HorseLeg-v0-constant.json

Families: "constant", the paper's gaits, four gait parameters that are held; "clocked", each of the four with
a first harmonic of one clock as well, which starts with the episode, thirteen numbers. An episode starts in a
gait of its own, and goes from there to the one that was found as fast as is allowed. The best of several
searches is chosen by starts that none has met and scored with yet others, those of `hoof-env evaluate`.
The file is written after every search; searches that are in it are not made again. `agents.horse_gaits` finds
the gaits of the horse.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.command import parse_pairs, run
from agents.evolution import generations, make_strategy, mean_costs, require
from hoof_env._output import check_folder
from hoof_env.envs.policies import FORM, open_loop, open_loop_record
from hoof_env.errors import DataFileError, ParameterError, check_number, parse_json
from hoof_env.evaluation.episodes import make_rows, play_rows
from hoof_env.evaluation.statistics import estimate
from hoof_env.gait import PARAMETERS
from hoof_env.tasks.observation import HALF_RANGE, MIDDLE

Floats = NDArray[np.float64]
Episodes = list[dict[str, float]]

SIZES = {"constant": 4, "clocked": 13}  # numbers of a gait, by family
# Frequencies of the clock [Hz]; the crank turns at 2 Hz at most
SLOWEST = 0.2
FASTEST = 4.0
# Candidates of a generation and random starts that each meets
POPULATION = 16
STARTS = 16
ROWS = POPULATION * STARTS
FINALISTS = 4  # candidates of a search that meet more starts at its end

STEP = 0.3
HARMONIC = 0.3
"""First standard deviation, and largest first harmonic of the screening; the box of every number is 2
wide."""

TEST_SEED = 1000
SEARCH_SEED = 10_000_000
"""First seeds of the final score, those of `hoof-env evaluate`, and of the searches."""

TOLERANCES = {"tolx": 1e-3, "tolfun": 0, "tolfunhist": 0, "tolstagnation": 10**9}
"""Options of CMA-ES that end a search when its steps are small, and for no other reason."""

EPISODES = {"constant": 10_240, "clocked": 30_720}  # episodes of a search, by family

KEPT = (
    "return",
    "speed_m_s",
    "stance_peak_n",
    "loading_rate_n_s",
    "cost_of_transport",
    "highest_grf_n",
    "weight_share",
    "stances",
    "failed",
)
"""Figures of an episode that the file has the means of."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    env_id: str = "hoof_env/HorseLeg-v0"
    """registered environment of this package with many at once"""
    env_kwargs: tuple[str, ...] = ()
    """its arguments: key=value ..., or one JSON object; with reward_weights returns weigh otherwise"""
    family: Literal["constant", "clocked"] = "constant"
    """of gaits"""
    restarts: int = 5
    """searches, of seeds 0, 1, ..."""
    episodes: int | None = None
    """of each search; otherwise 10240, or 30720 for "clocked\""""
    test_episodes: int = 512
    """of the final score, from seed 1000 on"""
    start: Path | None = None
    """file of a gait; every second search begins with its constants"""
    out: Path | None = None
    """file; otherwise runs/open_loop/ENV-FAMILY.json"""


class Box(NamedTuple):
    """Middle and half range of the gait parameters, shape (4,); those of the published leg by default."""

    middle: Floats = MIDDLE
    half: Floats = HALF_RANGE


PUBLISHED = Box()


def decode(family: str, x: Floats, box: Box = PUBLISHED) -> dict[str, Floats]:
    """Convert points of [-1, 1], shape (..., SIZES[family]), to parameters of `open_loop`: the `box` is the
    range of the gait parameters, and the unit of a harmonic is half of it."""
    constant = box.middle + box.half * x[..., :4]
    if family == "constant":
        return {"constant": constant}
    frequency = SLOWEST * (FASTEST / SLOWEST) ** ((x[..., 12] + 1) / 2)
    sine = box.half * x[..., 4:8]
    cosine = box.half * x[..., 8:12]
    return {"constant": constant, "sin": sine, "cos": cosine, "frequency_hz": frequency}


def encode(constant: Sequence[float], box: Box = PUBLISHED) -> Floats:
    """Convert a constant gait, shape (4,), to a point within the box; the inverse of `decode`."""
    return np.clip((np.asarray(constant, float) - box.middle) / box.half, -1.0, 1.0)


class Objective:
    """Costs of candidates of a family, from episodes in the rows of one vector environment.

    Attributes:
        leg: a single environment with the same settings.
        envs: the vector environment.
        spent: episodes so far.

    Raises:
        ParameterError: there is no such environment, it has no native vector environment, or it is not of one
            leg.
    """

    def __init__(self, env_id: str, env_kwargs: dict[str, Any], family: str) -> None:
        self.leg: Any = runs.make_env(env_id, **env_kwargs).unwrapped
        # Before many are made, whose kernels would have to be compiled
        if hasattr(self.leg, "action_form") and self.leg.action_form != "rates":
            raise ParameterError(f"env_id: expected an id of one leg, got {env_id!r}")
        envs = make_rows(env_id, ROWS, **env_kwargs)
        if envs is None:
            raise ParameterError(f"env_id: expected an id of this package with many at once, got {env_id!r}")
        self.envs = envs
        self.spent = 0
        self.family = family
        body: Any = envs.batch.body
        self.box = Box(body.middle, body.half)

    def decode(self, x: Floats) -> dict[str, Floats]:
        """See `decode`, for this leg."""
        return decode(self.family, x, self.box)

    def costs(self, x: Floats, seeds: Sequence[int]) -> list[float]:
        """Return minus the mean returns of candidates, shape (n, size), that meet the same starts; n *
        len(seeds) is `ROWS`."""
        episodes = self._play(self.decode(np.repeat(x, len(seeds), axis=0)), [*seeds] * len(x))
        return mean_costs(np.array([episode["return"] for episode in episodes]), len(seeds))

    def test(self, parameters: dict[str, Any], count: int) -> Episodes:
        """Return `count` episodes of the final score."""
        episodes: Episodes = []
        while len(episodes) < count:
            first = TEST_SEED + len(episodes)
            episodes += self._play(parameters, range(first, first + ROWS))
        return episodes[:count]

    def _play(self, parameters: dict[str, Any], seeds: Sequence[int]) -> Episodes:
        """Play an episode for each seed."""
        self.spent += len(seeds)
        return play_rows(self.envs, open_loop(parameters, self.leg), seeds)


def search(
    objective: Objective,
    seed: int,
    episodes: int,
    tick: Callable[[int, float], Any],
    start: Sequence[float] | None = None,
) -> tuple[Floats, float, bool]:
    """Search by CMA-ES from the best of random points, or from the constant gait `start`; return the best
    point, its cost over starts that the search had not met, and True if Ctrl-C ended it.

    Candidates of a generation meet the same starts, those of the next and other searches others. At the end
    the mean of the distribution, the luckiest candidate and the best of the last generation meet more.

    Args:
        objective: costs of candidates.
        seed: seed of the search and of its starts.
        episodes: episodes that it takes, about.
        tick: called with a number of episodes and the lowest cost in them.
        start: constant gait, shape (4,).

    Raises:
        KeyboardInterrupt: Ctrl-C came before anything was found.
    """
    generator = np.random.default_rng([seed, 6])
    fresh = SEARCH_SEED * (seed + 1)

    def costs(x: Any, starts: int) -> list[float]:
        nonlocal fresh
        values = objective.costs(np.array(x), range(fresh, fresh + starts))
        fresh += starts
        tick(ROWS, min(values))
        return values

    size = SIZES[objective.family]
    step = STEP
    if start is not None:
        first = np.array([*encode(start, objective.box), *[0.0] * (size - len(start))])
        # A start that was found before needs a search around it only
        step = STEP / 3
    else:
        # A quarter of the starts for each point: many poor points are told from good ones by few episodes
        screened = generator.uniform(-1, 1, (ROWS // 4, size))
        screened[:, 4:12] *= HARMONIC
        first = screened[np.argmin(costs(screened, 4))]
    strategy = make_strategy(first, step, POPULATION, int(generator.integers(1, 2**31)), **TOLERANCES)
    best = [first]
    interrupted = False
    try:
        count = episodes // ROWS - 2  # the screening and the finalists take the other two
        for candidates, values in generations(strategy, lambda points: costs(points, STARTS), count):
            lowest = [candidates[k] for k in np.argsort(values)[: FINALISTS - 2]]
            best = [strategy.result.xfavorite, strategy.result.xbest, *lowest]
            if strategy.stop():
                break
    except KeyboardInterrupt:
        interrupted = True
    # Rounded before the last score, so that the score is that of the numbers in the file
    finalists = np.clip(np.round((best * FINALISTS)[:FINALISTS], 5), -1.0, 1.0)
    final = costs(finalists, ROWS // FINALISTS)
    return finalists[np.argmin(final)], min(final), interrupted


def optimise(args: Args) -> dict[str, Any]:
    """Search, and write the file after every search; return its content.

    Raises:
        HoofEnvError: no CMA-ES is installed.
        DataFileError: the file is of something else.
        KeyboardInterrupt: Ctrl-C; the results so far are in the file.
    """
    episodes = check(args)
    from tqdm import tqdm

    path = place(args)
    about: dict[str, Any] = {
        "env_id": args.env_id,
        "env_kwargs": parse_pairs("--env-kwargs", args.env_kwargs),
        "form": FORM,
        "family": args.family,
        "objective": "return",
        "episodes_of_a_search": episodes,
        "test_episodes": args.test_episodes,
        "start": open_loop_record(args.start)["parameters"]["constant"] if args.start else None,
    }
    restarts = earlier(path, about)
    check_folder(path.parent)
    objective = Objective(args.env_id, about["env_kwargs"], args.family)
    done = {restart["seed"] for restart in restarts}
    left = [seed for seed in range(args.restarts) if seed not in done]
    with tqdm(total=episodes * len(left), unit=" episodes", leave=False, disable=None) as bar:
        for k, seed in enumerate(left):
            bar.set_description(f"{path.stem}, search {seed}")
            restarts.append(search_once(objective, seed, about, bar))
            write(path, about, objective, restarts)
            if restarts[-1].get("interrupted"):
                raise KeyboardInterrupt
            bar.n = (k + 1) * episodes  # a search may have converged before
    return write(path, about, objective, restarts)


def check(args: Args) -> int:
    """Check the arguments and return the episodes of a search."""
    require("agents.open_loop", "cma", "tqdm")
    check_number("restarts", args.restarts, low=1, high=1000)
    check_number("test_episodes", args.test_episodes, low=2, high=1e6)
    episodes = args.episodes or EPISODES[args.family]
    check_number("episodes", episodes, low=3 * ROWS, high=1e7)
    return episodes


def search_once(objective: Objective, seed: int, about: dict[str, Any], bar: Any) -> dict[str, Any]:
    """Search with one seed and return its entry of the file."""
    began = time.monotonic()
    used = time.process_time()
    objective.spent = 0

    def tick(count: int, lowest: float) -> None:
        bar.update(count)
        bar.set_postfix(cost=f"{lowest:.3f}")

    # Every second one: a start may lie in a valley without the best gait
    start = about["start"] if seed % 2 else None
    x, cost, interrupted = search(objective, seed, about["episodes_of_a_search"], tick, start)
    parameters = {key: value.tolist() for key, value in objective.decode(x).items()}
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
    """Return the means of `KEPT`, None for one that is infinite."""
    figures = {key: float(np.mean([episode[key] for episode in episodes])) for key in KEPT}
    return {key: value if math.isfinite(value) else None for key, value in figures.items()}


def write(
    path: Path, about: dict[str, Any], objective: Objective, restarts: list[dict[str, Any]]
) -> dict[str, Any]:
    """Write the best of the searches, scored, and all of them; return the content of the file."""
    best = min(restarts, key=lambda restart: restart["cost"])
    episodes = objective.test(best["parameters"], about["test_episodes"])
    score: dict[str, Any] = {"first_seed": TEST_SEED, "mean": means(episodes), "interval95": {}}
    for key, mean in score["mean"].items():
        interval = estimate([restart[key] for restart in episodes]) if mean is not None else None
        score["interval95"][key] = [interval.low, interval.high] if interval else None
    content = {
        **about,
        "parameters": best["parameters"],
        "gait": dict(zip(PARAMETERS, best["parameters"]["constant"], strict=True)),
        "dt": objective.leg.dt,
        "score": score,
        "episodes": sum(restart["episodes"] for restart in restarts),
        **{key: round(sum(restart[key] for restart in restarts), 1) for key in ("wall_s", "cpu_s")},
        "command": runs.command(),
        "versions": {**runs.versions(), "cma": version("cma")},
        "restarts": restarts,
    }
    runs.write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")
    return content


def earlier(path: Path, about: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the searches of a file that were not interrupted, an empty list if there is no file;
    `DataFileError` if the file is of something else."""
    if not path.is_file():
        return []
    with suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
        content = parse_json(path.read_text(encoding="utf-8"))
        if all(content.get(key) == value for key, value in about.items()):
            return [restart for restart in content["restarts"] if not restart.get("interrupted")]
    raise DataFileError(f"{path}: expected searches with {about} to go on with; name another --out")


def place(args: Args) -> Path:
    """Return the path of the file."""
    name = f"{args.env_id.rpartition('/')[2]}-{args.family}.json"
    return args.out or Path("runs/open_loop", name)


def main(argv: list[str] | None = None) -> None:
    """Search, and print the searches and the score."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.open_loop", description=__doc__)
    content = optimise(args)
    for restart in content["restarts"]:
        spent = f"{restart['episodes']} episodes, {restart['wall_s']:.0f} s"
        print(f"search {restart['seed']}: cost {restart['cost']:.3f}, {spent}")
    for key, mean in content["score"]["mean"].items():
        bounds = content["score"]["interval95"][key]
        print(f"{key:18} " + (f"{mean:.3f} [{bounds[0]:.3f}, {bounds[1]:.3f}]" if bounds else "infinite"))
    print(f"written: {place(args)}")


if __name__ == "__main__":
    run(main)
