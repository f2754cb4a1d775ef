"""The baselines as data: which algorithm learns which id, with how many seeds, and what is measured."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

import numpy as np

CURVE_SEEDS = range(1000, 1020)
"""Episodes of the learning curves; training starts its own from other seeds."""

FINAL_SEEDS = range(1_000_000, 1_000_100)
"""Episodes of the final scores, on which nothing else is played: no training, curve, tuning or search."""

LEG = "hoof_env/HorseLeg-v0"
OTHERS = tuple(f"hoof_env/HorseLeg{name}-v0" for name in ("Fixed", "Rail", "Speed", "Terrain"))

MATCHED = "matched"
MATCHED_SPEED = 2.1
"""Speed [m/s] up to which progress is paid to the agents that are compared with the paper's run at its own
speed. A little above the run's, so that they need not be the slower ones."""

BEARING = "bearing"
BEARING_SPEED = 2.4
BEARING_WEIGHTS = {"progress": 2.0, "peak": 0.5, "support": 4.0}
"""The same for agents that are to bear as much of the weight as the run, too: they are paid for it. Who bears
more is slower, so that progress is paid better, and up to a higher speed."""


@dataclass(frozen=True)
class Entry:
    """One row of the table.

    Attributes:
        algo, env_id: of `agents.train`.
        seeds: trainings, from seed 0 on.
        steps: of each; None: n_timesteps of the hyperparameter file.
        points: of the learning curve, the untrained policy's aside.
        env_kwargs: arguments of the environment, as `agents.train` takes them.
        label: tells entries of the same algorithm and id apart.
    """

    algo: str
    env_id: str
    seeds: int
    steps: int | None = None
    points: int = 30
    env_kwargs: tuple[str, ...] = ()
    label: str = ""

    @property
    def name(self) -> str:
        """For folders and tables."""
        return "-".join(filter(None, (self.algo, self.env_id.rpartition("/")[2], self.label)))


@dataclass(frozen=True)
class Run:
    """One training of an entry."""

    entry: Entry
    seed: int

    @property
    def name(self) -> str:
        """Of its folder."""
        return f"{self.entry.name}-s{self.seed}"

    def command(self, folder: Path) -> list[str]:
        """Arguments of `python -m agents.baselines_run` that train it."""
        entry, told = self.entry, ["--algo", self.entry.algo, "--env-id", self.entry.env_id]
        told += ["--seed", str(self.seed), "--points", str(entry.points), "--out", str(folder / self.name)]
        told += ["--steps", str(entry.steps)] if entry.steps is not None else []
        return told + (["--env-kwargs", *entry.env_kwargs] if entry.env_kwargs else [])


MATCHED_KWARGS = (f"target_speed=[{MATCHED_SPEED}, {MATCHED_SPEED}]",)
BEARING_KWARGS = (
    f"target_speed=[{BEARING_SPEED}, {BEARING_SPEED}]",
    f"reward_weights={json.dumps(BEARING_WEIGHTS)}",
)

PLANS: Mapping[str, tuple[Entry, ...]] = {
    "full": (
        *(Entry(algo, LEG, 10) for algo in ("ppo", "sac", "td3", "tqc")),
        *(Entry("ppo", env_id, 5) for env_id in OTHERS),
        Entry("ppo", LEG, 10, env_kwargs=MATCHED_KWARGS, label=MATCHED),
        Entry("ppo", LEG, 10, env_kwargs=BEARING_KWARGS, label=BEARING),
    ),
    "nightly": (
        Entry("ppo", LEG, 3, steps=200_000, points=5),
        *(Entry(algo, LEG, 2, steps=10_000, points=2) for algo in ("sac", "td3", "tqc")),
        *(Entry("ppo", env_id, 2, steps=100_000, points=2) for env_id in OTHERS),
        Entry("ppo", LEG, 2, steps=200_000, points=2, env_kwargs=MATCHED_KWARGS, label=MATCHED),
        Entry("ppo", LEG, 2, steps=200_000, points=2, env_kwargs=BEARING_KWARGS, label=BEARING),
    ),
}
"""By the name that --subset takes: the published table, and a small one that runs in minutes."""


FOLDERS = {"full": Path("runs/baselines"), "nightly": Path("runs/baselines-nightly")}
"""Of the trainings."""

PAGES = {"full": Path("docs/baselines.md"), "nightly": FOLDERS["nightly"] / "baselines.md"}
"""What is written about them."""


def runs_of(plan: Sequence[Entry]) -> Iterator[Run]:
    """All trainings of a plan, first seeds first: a table of whatever is done is fair at any time."""
    for row in zip_longest(*([Run(entry, seed) for seed in range(entry.seeds)] for entry in plan)):
        yield from filter(None, row)


FIGURES = (
    "return",
    "speed_m_s",
    "peak_grf_n",
    "stance_peak_n",
    "cost_of_transport",
    "weight_share",
    "failed",
)
"""What is kept of episodes, those of them that an id has."""

TRANSPORT = ("distance_m", "drive_work_j", "mean_grf_n", "weight_share")
"""What a cost of transport over several episodes is made of; the force by the share is the weight."""


def figures(episodes: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Means over episodes of `FIGURES`; the cost of transport is that of the distance and work of all of
    them, NaN if they do not get forward."""
    found = {name: float(np.mean([one[name] for one in episodes])) for name in FIGURES if name in episodes[0]}
    if "cost_of_transport" in found:
        distance, work, force, share = (sum(one[name] for one in episodes) for name in TRANSPORT)
        done = share and distance > 0
        found["cost_of_transport"] = work * share / (force * distance) if done else float("nan")
    return found
