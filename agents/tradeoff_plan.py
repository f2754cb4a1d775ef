"""The trade-off as data: which rewards PPO is trained with, and what its policies are asked afterwards."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from agents.baselines_plan import BEARING_WEIGHTS, CURVE_SEEDS, LEG, Entry

SPEED = "hoof_env/HorseLegSpeed-v0"

CHANGED: Mapping[str, tuple[float, ...]] = {
    "peak": (0.0, 0.1, 1.0, 2.0),
    "energy": (0.3, 0.5, 1.0, 2.0, 4.0),
    "progress": (0.7, 0.5, 0.35, 0.25),
}
"""Weights of the reward, one of them changed, the others as by default: 0.3 [1/kN], 0.1 [1/kJ], 1 [1/m].
A lower pay for progress makes all costs dearer."""

SPEEDS = (2.0, 3.0, 4.0)
"""Speeds [m/s] up to which progress is paid, what goes beyond being taken back, so that a front gets points
at chosen speeds."""

AT_SPEED: Mapping[str, Mapping[str, float]] = {
    "soft": {"progress": 3.0, "peak": 1.0},
    "cheap": {"progress": 3.0, "peak": 0.0, "energy": 1.0},
    "bearing": BEARING_WEIGHTS,
}
"""Weights at a chosen speed: peaks cost more, only work costs, or bearing weight pays, and a metre pays
enough that none is given up."""

DEFAULT, SLOW = "default", "bearing-2"
"""Labels of the default reward, and of the one whose gaits are about as fast as the paper's run and bear as
much of the weight."""

STEPS, SEEDS = 3_000_000, 3
"""Environment steps and trainings of each reward."""


def told(weights: Mapping[str, float], speed: float | None = None) -> tuple[str, ...]:
    """Arguments of the environment as `agents.train` takes them."""
    kwargs = (f"target_speed={json.dumps([speed, speed])}",) if speed is not None else ()
    return (*kwargs, *((f"reward_weights={json.dumps(dict(weights))}",) if weights else ()))


def sweep(seeds: int, steps: int) -> tuple[Entry, ...]:
    """One entry for each reward."""
    rewards = {DEFAULT: told({})}
    rewards |= {f"{name}-{x:g}": told({name: x}) for name, some in CHANGED.items() for x in some}
    rewards |= {
        f"{name}-{speed:g}": told(weights, speed) for speed in SPEEDS for name, weights in AT_SPEED.items()
    }
    return tuple(
        Entry("ppo", LEG, seeds, steps=steps, points=10, env_kwargs=kwargs, label=label)
        for label, kwargs in rewards.items()
    )


@dataclass(frozen=True)
class Plan:
    """What is trained, asked and written.

    Attributes:
        entries: trainings of `HorseLeg-v0`, one for each reward.
        commanded: training of `HorseLegSpeed-v0`.
        folder: of the trainings.
        page: with its data and pictures in a folder beside it of the same name.
        speeds: that policies of `HorseLegSpeed-v0` are told [m/s].
        factors: of the ground's stiffness at which policies of the default reward are played.
        episodes: of each policy, speed and stiffness, substep by substep.
    """

    entries: tuple[Entry, ...]
    commanded: Entry
    folder: Path
    page: Path
    speeds: tuple[float, ...]
    factors: tuple[float, ...]
    episodes: int

    @property
    def seeds(self) -> range:
        """Of the episodes that are looked at substep by substep."""
        return CURVE_SEEDS[: self.episodes]

    def entry(self, label: str) -> Entry:
        """The entry of a reward."""
        return next(entry for entry in self.entries if entry.label == label)


QUICK_LABELS = (DEFAULT, SLOW, "cheap-4")

FULL = Plan(
    sweep(SEEDS, STEPS),
    Entry("ppo", SPEED, SEEDS, points=10),
    Path("runs/tradeoff"),
    Path("docs/tradeoff.md"),
    speeds=(0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5),
    factors=(0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0),
    episodes=5,
)
QUICK = Plan(
    tuple(entry for entry in sweep(1, 100_000) if entry.label in QUICK_LABELS),
    Entry("ppo", SPEED, 1, steps=100_000, points=2),
    Path("runs/tradeoff-quick"),
    Path("runs/tradeoff-quick/tradeoff.md"),
    speeds=(1.0, 3.0),
    factors=(0.5, 1.0, 2.0),
    episodes=1,
)
"""The published one, and one that runs in minutes."""
