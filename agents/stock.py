"""Learning curves of stock algorithms with their library's own defaults: one environment, no wrapper.

    python -m agents.stock                                 all trainings that the table lacks, hours
    python -m agents.stock --env-id hoof_env/HorseLeg-v0 --algo ppo --seeds 3 --steps 100000 --out runs/stock
    python -m agents.stock --draw                          table and picture alone

PPO, SAC and TD3 are Stable-Baselines3's, TQC is sb3-contrib's, made as `PPO("MlpPolicy", env)` makes them. A
policy is scored without its noise on 100 starts that no training meets. A training is one set of rows in
curves.csv, written when it is through: after an interruption the same command goes on with those that are
missing. Beside the curves stand what needs no learning: the zero action, which keeps the gait that an episode
starts in, the scripted gait, and the best gait of `agents.open_loop`.
"""

from __future__ import annotations

import csv
import multiprocessing
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.command import run
from agents.score import FINAL_SEEDS, find_policy, make_rows, play_rows
from agents.settings import FOLDER, load_settings
from agents.statistics import iqm
from agents.train import Args as TrainArgs
from agents.train import make_model
from hoof_env._output import check_folder, markdown_table, staged
from hoof_env.errors import DataFileError, ParameterError, check_choice, check_number
from hoof_env.saved_policy import ALGORITHMS, algorithm_class

OUT = Path(__file__).parents[1] / "docs" / "evidence" / "stock"
"""Where the published curves are."""

COLUMNS = ("env_id", "algo", "seed", "steps", "return", "train_seconds")
"""Of curves.csv: a line for each score; the seconds are those of learning alone, so far."""

ANCHORS = ("zero action", "scripted gait", "best open loop")
"""What stands beside the curves."""


@dataclass(frozen=True)
class Curves:
    """Trainings of one algorithm on one id."""

    env_id: str
    algo: str
    seeds: int
    steps: int
    every: int  # steps between two scores


TUNED: Final = "ppo_flat"
"""The one learner that is not stock, for comparison: its settings are those of agents/hyperparams."""

LEG, RAIL, SPEED, TERRAIN, FIXED, HORSE = (
    f"hoof_env/{name}-v0"
    for name in ("HorseLeg", "HorseLegRail", "HorseLegSpeed", "HorseLegTerrain", "HorseLegFixed", "Horse")
)
OTHERS = (RAIL, SPEED, TERRAIN, HORSE, FIXED)

PLAN = (
    Curves(LEG, "ppo", 10, 400_000, 20_480),
    Curves(LEG, "sac", 10, 60_000, 6_000),
    *(Curves(env_id, "ppo", 5, 300_000, 20_480) for env_id in OTHERS),
    Curves(LEG, "td3", 5, 60_000, 6_000),
    Curves(LEG, "tqc", 5, 60_000, 6_000),
    Curves(LEG, TUNED, 10, 3_000_000, 40_960),
    *(Curves(env_id, "sac", 3, 60_000, 6_000) for env_id in OTHERS),
)
"""The published table, in the order in which it is trained."""


@dataclass(frozen=True)
class Args:
    env_id: str | None = None
    """only this id"""
    algo: str | None = None
    """only this algorithm: ppo, sac, td3, tqc, or ppo_flat with the settings of agents/hyperparams"""
    seeds: int | None = None
    """trainings of each, from seed 0 on; otherwise those of the table"""
    steps: int | None = None
    """of each training; otherwise those of the table"""
    workers: int = 1
    """trainings side by side, each on one thread"""
    out: Path = OUT
    """folder of curves.csv, README.md and stock.png"""
    draw: bool = False
    """train nothing; write table and picture from what is there"""


@dataclass(frozen=True)
class Job:
    """One training."""

    curves: Curves
    seed: int

    @property
    def key(self) -> tuple[str, str, int]:
        """By which its rows are found."""
        return self.curves.env_id, self.curves.algo, self.seed


def jobs(args: Args) -> list[Job]:
    """The trainings that some arguments ask for.

    Raises:
        ParameterError: an unknown id or algorithm, or a count out of range.
    """
    if args.algo is not None:
        check_choice("algo", args.algo, (*ALGORITHMS, TUNED))
    for name in ("seeds", "steps", "workers"):
        if getattr(args, name) is not None:
            check_number(name, getattr(args, name), low=1, high=1e9)
    chosen = [
        curves for curves in PLAN if args.env_id in (None, curves.env_id) and args.algo in (None, curves.algo)
    ]
    if not chosen:
        known = ", ".join(dict.fromkeys(f"{curves.algo} on {curves.env_id}" for curves in PLAN))
        raise ParameterError(f"expected one of {known}; got {args.algo} on {args.env_id}")
    found = []
    for curves in chosen:
        steps = args.steps or curves.steps
        own = Curves(curves.env_id, curves.algo, args.seeds or curves.seeds, steps, min(curves.every, steps))
        found += [Job(own, seed) for seed in range(own.seeds)]
    return found


def mean_return(policy: Any, envs: Any) -> float:
    """Mean return of a policy on the starts of the final scores."""
    return float(np.mean([one["return"] for one in play_rows(envs, policy, FINAL_SEEDS)]))


def train(job: Job) -> list[dict[str, Any]]:
    """Train as a newcomer would; returns the rows of its curve."""
    import torch
    from stable_baselines3.common.callbacks import BaseCallback

    torch.set_num_threads(1)
    curves = job.curves
    envs = make_rows(curves.env_id, len(FINAL_SEEDS))
    rows: list[dict[str, Any]] = []

    class Curve(BaseCallback):
        """Scores the policy every so many steps."""

        began = time.monotonic()
        scored = 0.0  # seconds that scores took

        def _on_step(self) -> bool:
            if self.num_timesteps % curves.every == 0 or self.num_timesteps == curves.steps:
                here = time.monotonic()
                spent = here - self.began - self.scored
                add(self.model, self.num_timesteps, spent)
                self.scored += time.monotonic() - here
            return True

    def add(model: Any, steps: int, seconds: float) -> None:
        figures = (steps, round(mean_return(model, envs), 2), round(seconds, 1))
        rows.append(dict(zip(COLUMNS, (*job.key, *figures), strict=True)))

    model = tuned_model(job) if curves.algo == TUNED else stock_model(job)
    add(model, 0, 0.0)
    model.learn(curves.steps, callback=Curve())
    model.env.close()
    return rows


def stock_model(job: Job) -> Any:
    """The learner as its library makes it."""
    env = runs.make_env(job.curves.env_id)
    return algorithm_class(job.curves.algo)("MlpPolicy", env, seed=job.seed, device="cpu")


def tuned_model(job: Job) -> Any:
    """The learner with the settings of agents/hyperparams, for as many steps."""
    curves = job.curves
    settings = load_settings(FOLDER / f"{curves.algo}.yml", curves.env_id) | {"n_timesteps": curves.steps}
    many = runs.make_vec_env(curves.env_id, settings["n_envs"])
    return make_model(TrainArgs(env_id=curves.env_id, algo=TUNED, seed=job.seed), settings, many)


def trained(pending: Sequence[Job], workers: int) -> Iterator[list[dict[str, Any]]]:
    """The rows of each training as it is through."""
    if workers == 1:
        yield from map(train, pending)
        return
    with multiprocessing.get_context("spawn").Pool(workers, maxtasksperchild=1) as pool:
        yield from pool.imap_unordered(train, pending)


def read_curves(folder: Path) -> list[dict[str, Any]]:
    """The rows of curves.csv; none where there is no such file.

    Raises:
        DataFileError: it cannot be read.
    """
    path = folder / "curves.csv"
    if not path.is_file():
        return []
    try:
        with path.open(encoding="utf-8", newline="") as file:
            return [
                {
                    "env_id": row["env_id"],
                    "algo": row["algo"],
                    "seed": int(row["seed"]),
                    "steps": int(row["steps"]),
                    "return": float(row["return"]),
                    "train_seconds": float(row["train_seconds"]),
                }
                for row in csv.DictReader(file)
            ]
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise DataFileError(f"{path}: expected columns {', '.join(COLUMNS)}: {error!r}") from None


def has_run(rows: Sequence[dict[str, Any]], job: Job) -> bool:
    """Say if a training's rows are there, up to its last step."""
    steps = [row["steps"] for row in rows if (row["env_id"], row["algo"], row["seed"]) == job.key]
    return max(steps, default=-1) >= job.curves.steps


def anchors(env_id: str) -> dict[str, float]:
    """Returns of what needs no learning, by name, those that an id has."""
    envs = make_rows(env_id, len(FINAL_SEEDS))
    assert envs is not None
    zero = np.zeros((len(FINAL_SEEDS), *(envs.single_action_space.shape or ())), np.float32)

    class Zero:
        """The zero action."""

        def predict(self, *args: Any, **kwargs: Any) -> tuple[NDArray[np.float32], None]:
            return zero, None

    found = {"zero action": mean_return(Zero(), envs)}
    with runs.make_env(env_id) as env:
        if envs.action_form == "rates":
            for title, name in (("scripted gait", envs.task.reference), ("best open loop", "open-loop")):
                found[title] = mean_return(find_policy(name, env, env_id), envs)
    return found


# Tables and picture

AT_STEPS = (20_480, 61_440, 204_800, 400_000, 3_000_000)
AT_SECONDS = (5.0, 20.0, 60.0, 180.0, 600.0)
"""Where learners of HorseLeg-v0 are compared."""


def at(rows: Sequence[dict[str, Any]], steps: int) -> list[float]:
    """The returns of all seeds at the last score up to so many steps."""
    latest: dict[int, dict[str, Any]] = {}
    for row in rows:
        if row["steps"] <= steps and row["steps"] >= latest.get(row["seed"], row)["steps"]:
            latest[row["seed"]] = row
    return [row["return"] for row in latest.values()]


def table(rows: Sequence[dict[str, Any]], beside: dict[str, dict[str, float]]) -> str:
    """A line for each algorithm and id: interquartile mean, lowest and highest seed in the middle and at the
    end, and what needs no learning."""
    lines = []
    for curves in PLAN:
        own = [row for row in rows if (row["env_id"], row["algo"]) == (curves.env_id, curves.algo)]
        if not own:
            continue
        last = max(row["steps"] for row in own)
        cells = []
        for steps in (last // 2, last):
            values = at(own, steps)
            cells.append(f"{float(iqm(values)[0]):.1f} ({min(values):.1f} to {max(values):.1f})")
        seconds = np.median([row["train_seconds"] for row in own if row["steps"] == last])
        known = beside[curves.env_id]
        references = [f"{known[name]:.1f}" if name in known else "" for name in ANCHORS]
        seeds = str(len({row["seed"] for row in own}))
        name = curves.env_id.rpartition("/")[2].removesuffix("-v0")
        own_cells = [name, curves.algo.upper(), seeds, *cells, f"{last:,}", f"{seconds:.0f}"]
        lines.append(own_cells + references)
    head = (
        "id", "algorithm", "seeds", "return at half the steps", "return at the end", "steps", "seconds",
        *ANCHORS,
    )  # fmt: skip
    return markdown_table(head, lines)


def compared(rows: Sequence[dict[str, Any]], column: str, places: Sequence[float]) -> str:
    """A line for each learner of HorseLeg-v0: the interquartile mean of its last returns up to so many steps,
    or so many seconds of learning; nothing where its trainings do not go so far."""
    lines = []
    for algo in dict.fromkeys(curves.algo for curves in PLAN if curves.env_id == LEG):
        own = [row for row in rows if (row["env_id"], row["algo"]) == (LEG, algo)]
        if not own:
            continue
        ends: dict[int, float] = {}
        for row in own:
            ends[row["seed"]] = max(row[column], ends.get(row["seed"], 0.0))
        cells = []
        for place in places:
            latest: dict[int, dict[str, Any]] = {}
            for row in own:
                if row[column] <= place and row["steps"] >= latest.get(row["seed"], row)["steps"]:
                    latest[row["seed"]] = row
            is_reached = all(end >= 0.9 * place for end in ends.values())
            values = [row["return"] for row in latest.values()]
            cells.append(f"{float(iqm(values)[0]):.1f}" if is_reached else "")
        lines.append([title(algo), *cells])
    return markdown_table(("learner", *(f"{place:,.0f}" for place in places)), lines)


def title(algo: str) -> str:
    """Name of a learner for people, with what its settings are."""
    return "ppo_flat, tuned, 16 environments" if algo == TUNED else f"{algo.upper()}, stock"


def draw(rows: Sequence[dict[str, Any]], beside: dict[str, dict[str, float]], path: Path) -> None:
    """A panel for each id: the median of all seeds and their range against steps, and lines for what needs no
    learning."""
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.ticker import EngFormatter

    from hoof_env._plotting import BLUE, GREEN, GREY, ORANGE, PURPLE, STYLE

    colours = {"ppo": BLUE, "sac": ORANGE, "td3": GREEN, "tqc": PURPLE}
    styles = dict(zip(ANCHORS, (":", "--", "-"), strict=True))
    ids = [env_id for env_id in (LEG, *OTHERS) if any(row["env_id"] == env_id for row in rows)]
    with matplotlib.rc_context(STYLE):
        across = min(3, len(ids))
        down = -(-len(ids) // across)
        figure = Figure(figsize=(3.4 * across, 2.6 * down), layout="constrained")
        panels = figure.subplots(down, across, squeeze=False).ravel()
        for panel, env_id in zip(panels, ids, strict=False):
            for algo, colour in colours.items():
                own = [row for row in rows if (row["env_id"], row["algo"]) == (env_id, algo)]
                steps = sorted({row["steps"] for row in own})
                if not steps:
                    continue
                values = [[row["return"] for row in own if row["steps"] == step] for step in steps]
                panel.plot(steps, [np.median(each) for each in values], color=colour, label=algo.upper())
                panel.fill_between(
                    steps, [min(each) for each in values], [max(each) for each in values], color=colour,
                    alpha=0.2, linewidth=0,
                )  # fmt: skip
            for name, value in beside[env_id].items():
                panel.axhline(value, color=GREY, linewidth=0.8, linestyle=styles[name], label=name)
            panel.set_title(env_id.rpartition("/")[2])
            panel.set_xlabel("environment steps")
            panel.set_ylabel("return")
            panel.xaxis.set_major_formatter(EngFormatter(sep=""))
        for panel in panels[len(ids) :]:
            panel.set_axis_off()
        panels[0].legend(loc="lower right")
        figure.savefig(path, metadata={"Software": None})


PAGE = """# Stock learners

Learning curves of Stable-Baselines3's PPO, SAC and TD3 and of sb3-contrib's TQC with their library's own
defaults: one environment, no wrapper. Written by `python -m agents.stock`, which trains what is missing in
[curves.csv](curves.csv). Returns are those of the policy without its noise on {starts} starts that no
training meets: the interquartile mean over seeds, and the lowest and highest seed. Seconds are those of
learning on one thread, with other work on the other core.

![Return against environment steps](stock.png)

{table}

## Compared at equal steps and equal seconds

`HorseLeg-v0`, the interquartile mean over seeds. `ppo_flat` has the settings of agents/hyperparams and 16
environments; the others have none, and no settings that were tuned for them are known to be better.

Returns after so many steps:

{by_steps}

Returns after so many seconds of learning on one thread:

{by_seconds}
"""


def write(out: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Write table and picture of the curves that are there."""
    beside = {env_id: anchors(env_id) for env_id in dict.fromkeys(row["env_id"] for row in rows)}
    with staged(out) as stage:
        draw(rows, beside, stage / "stock.png")
        text = PAGE.format(
            starts=len(FINAL_SEEDS),
            table=table([row for row in rows if row["algo"] != TUNED], beside),
            by_steps=compared(rows, "steps", AT_STEPS),
            by_seconds=compared(rows, "train_seconds", AT_SECONDS),
        )
        (stage / "README.md").write_text(text, encoding="utf-8")


def stock(args: Args) -> list[dict[str, Any]]:
    """Train what is missing, then write table and picture; returns all rows.

    Raises:
        ParameterError: an unknown id or algorithm, or a count out of range.
        DataFileError: the folder's curves.csv cannot be read.
        OutputError: the folder cannot be written.
    """
    wanted = jobs(args)
    check_folder(args.out)
    args.out.mkdir(parents=True, exist_ok=True)
    rows = read_curves(args.out)
    pending = [] if args.draw else [job for job in wanted if not has_run(rows, job)]
    for done, new in enumerate(trained(pending, args.workers), 1):
        key = tuple(new[0][name] for name in ("env_id", "algo", "seed"))
        rows = [row for row in rows if (row["env_id"], row["algo"], row["seed"]) != key] + new
        rows.sort(key=lambda row: (row["env_id"], row["algo"], row["seed"], row["steps"]))
        runs.write_csv(args.out / "curves.csv", COLUMNS, rows)
        env_id, algo, seed = key
        returns = " ".join(f"{row['return']:.0f}" for row in new)
        print(f"{done} of {len(pending)}: {algo} on {env_id}, seed {seed}: {returns}", flush=True)
    if rows:
        write(args.out, rows)
    return rows


def main(argv: list[str] | None = None) -> None:
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.stock", description=__doc__)
    stock(args)
    print(f"written: {args.out / 'README.md'}")


if __name__ == "__main__":
    run(main)
