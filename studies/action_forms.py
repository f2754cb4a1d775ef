"""Compare forms of the actions of HorseLeg-v0: positions of the gait in its box, in a narrow box, and rates.

    python -m agents.action_forms             all trainings that the table lacks, hours; can be interrupted
    python -m agents.action_forms --ranges    parts of each parameter's range that the shipped agent uses
    python -m agents.action_forms --table     the table alone

Stock PPO and SAC train on one environment each, as in `agents.stock`, whose curves are those of the rates. A
position is reached as fast as the filters of the commands allow. The narrow box is the one that the shipped
agent uses: an agent that is not known yet has no such box.
"""

from __future__ import annotations

import statistics
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import hoof_env
from agents import runs
from agents.command import run
from agents.stock import OUT as STOCK
from agents.stock import Job, has_run, train
from agents.stock_plan import COLUMNS, LEG, Curves, read_curves
from hoof_env._output import check_folder, markdown_table
from hoof_env.envs.policies import start_of
from hoof_env.evaluation.episodes import make_rows
from hoof_env.gait import LIMITS, FilterSettings
from hoof_env.tasks.one_leg import lead_of, reach_per_rate
from hoof_env.tasks.settings import Settings

OUT = STOCK.with_name("actions")

FILTERS = FilterSettings()
FASTEST: dict[str, Any] = {"crank_rate": FILTERS.crank_rate, "swing_rate": FILTERS.swing_rate}
"""Settings with which an action of 1 changes the gait as fast as its filters allow."""

USUAL = Settings()
SUBSTEP = 1e-3
"""Substep of the id's engine [s], which its ground asks for."""

LEAD = lead_of(FILTERS, USUAL.dt)
REACH = reach_per_rate(FILTERS, USUAL.dt, SUBSTEP)

NARROW = ((0.105, 0.715), (0.627, 0.780), (0.067, 0.309), (0.246, 0.511))
"""Ranges of crank speed, swing offset, sine and cosine that the shipped agent is in for 95 % of its steps, in
`LIMITS` from 0 to 1; `--ranges` prints them."""


def box(parts: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Return middle and half range of each parameter for a part of its limits."""
    found = []
    for (low, high), (begin, end) in zip(LIMITS.values(), parts, strict=True):
        middle = low + 0.5 * (begin + end) * (high - low)
        found.append((middle, 0.5 * (end - begin) * (high - low)))
    return tuple(found)


def positions_in(parts: tuple[tuple[float, float], ...]) -> Any:
    """Return a function from positions in a box to rates, for an `ActionMap`."""
    crank, offset, sine, cosine = box(parts)
    crank_reach = REACH * FILTERS.crank_rate
    swing_reach = REACH * FILTERS.swing_rate
    lead = LEAD

    def rates(action, scene):  # type: ignore[no-untyped-def]
        gait = scene.leg.state.gait
        rate = scene.leg.state.gait_rate
        return (
            (crank[0] + crank[1] * action[0] - gait[0] - lead * rate[0]) / crank_reach,
            (offset[0] + offset[1] * action[1] - gait[1] - lead * rate[1]) / swing_reach,
            (sine[0] + sine[1] * action[2] - gait[2] - lead * rate[2]) / swing_reach,
            (cosine[0] + cosine[1] * action[3] - gait[3] - lead * rate[3]) / swing_reach,
        )

    return rates


WHOLE = ((0.0, 1.0),) * 4
"""Ranges of a box as wide as the limits."""

NAMES = {name: f"{name.replace('_', ' ')} at the upper end of its box" for name in LIMITS}
FORMS = {
    "positions": ("study/HorseLegPositions-v0", WHOLE),
    "positions in a narrow box": ("study/HorseLegNarrow-v0", NARROW),
}
"""Id and box by the name of the form."""

for form, (env_id, parts) in FORMS.items():
    hoof_env.register(
        env_id, base="leg", action_map=hoof_env.ActionMap(form, NAMES, positions_in(parts)), **FASTEST
    )

PLAN = tuple(
    Curves(env_id, algo, seeds, steps, every)
    for algo, seeds, steps, every in (("ppo", 5, 204_800, 20_480), ("sac", 3, 60_000, 6_000))
    for env_id, _ in FORMS.values()
)


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    ranges: bool = False
    """print the parts of the ranges that the shipped agent uses, and train nothing"""
    table: bool = False
    """print the table of what is there, and train nothing"""
    out: Path = OUT
    """folder of curves.csv"""


def ranges(seeds: range = range(20)) -> list[tuple[float, float]]:
    """Return 2.5th and 97.5th percentile of each gait parameter over episodes of the shipped agent, in its
    limits from 0 to 1."""
    envs = make_rows(LEG, len(seeds))
    assert envs is not None
    policy = hoof_env.load_policy(LEG)
    observation, _ = envs.reset(seed=list(seeds), options=start_of(policy))
    gaits = []
    for _ in range(round(USUAL.episode_seconds / USUAL.dt) - 1):
        observation, *_ = envs.step(policy.predict(observation, deterministic=True)[0])
        state = envs.engine.state
        gaits.append([state[name][0] for name in LIMITS])
    low, high = np.transpose(list(LIMITS.values()))
    parts = (np.percentile(gaits, (2.5, 97.5), axis=(0, 2)) - low) / (high - low)
    return [(float(begin), float(end)) for begin, end in parts.T]


def table(out: Path) -> str:
    """Return the table of returns at the end, with those of the rates from `agents.stock`."""
    rows = read_curves(out)
    rates = read_curves(STOCK)
    lines = []
    for algo, steps in (("ppo", 204_800), ("sac", 60_000)):
        for form, env_id in (*((form, env_id) for form, (env_id, _) in FORMS.items()), ("rates", LEG)):
            seeds = {
                row["seed"]: row["return"]
                for row in (rates if env_id == LEG else rows)
                if (row["env_id"], row["algo"], row["steps"]) == (env_id, algo, steps)
            }
            if seeds:
                each = " ".join(f"{value:.0f}" for _, value in sorted(seeds.items()))
                middle = statistics.median(seeds.values())
                lines.append([algo.upper(), f"{steps:,}", form, f"{middle:.0f}", each])
    return markdown_table(["learner", "steps", "actions", "median return", "each seed"], lines)


def main(argv: list[str] | None = None) -> None:
    """Train what is missing and print the table."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.action_forms", description=__doc__)
    if args.ranges:
        for name, (begin, end) in zip(LIMITS, ranges(), strict=True):
            print(f"{name}: {begin:.3f} to {end:.3f}")
        return
    check_folder(args.out)
    args.out.mkdir(parents=True, exist_ok=True)
    rows = read_curves(args.out)
    jobs = [Job(curves, seed) for curves in PLAN for seed in range(curves.seeds)]
    for job in [] if args.table else jobs:
        if has_run(rows, job):
            continue
        print(f"{job.curves.algo} on {job.curves.env_id}, seed {job.seed}", file=sys.stderr, flush=True)
        rows += train(job)
        rows.sort(key=lambda row: (row["env_id"], row["algo"], row["seed"], row["steps"]))
        runs.write_csv(args.out / "curves.csv", COLUMNS, rows)
    print(table(args.out))


if __name__ == "__main__":
    run(main)
