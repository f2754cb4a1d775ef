"""Agents beside the paper's run at matched speed: forces and costs of gaits of other speeds say little.

Two ways to match:

 - Agents are slowed down to the run. Some are trained for that: the default reward, but progress beyond
   `MATCHED_SPEED` is taken back, so that they look for the softest and cheapest gait of that speed. Those of
   HorseLegSpeed-v0 are merely told to keep it.
 - The run is sped up to the agents of the default reward: its crank speed and the amplitude of its swing are
   scaled by constants, over all that the actions allow.

An agent dominates where it is at least as fast, and its peak forces and cost of transport are lower, all
intervals apart. The weight that the leg bears stands beside them, for bearing less is a way to be soft.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from agents import runs
from agents.baselines_plan import CURVE_SEEDS, FINAL_SEEDS, LEG, MATCHED, MATCHED_SPEED, figures
from agents.baselines_results import Reference, Row, reference
from agents.baselines_stats import Interval, over_seeds
from agents.score import score_vector
from hoof_env.gait.parameters import LIMITS, GaitParameters

SPEED = "hoof_env/HorseLegSpeed-v0"
LOWER = ("peak_grf_n", "stance_peak_n", "cost_of_transport")
"""Figures that dominance is about; less is better."""

COLUMNS: Mapping[str, tuple[str, int, float]] = {
    "speed_m_s": ("speed m/s", 2, 1.0),
    "peak_grf_n": ("highest GRF kN", 2, 1e-3),
    "stance_peak_n": ("stance peak kN", 2, 1e-3),
    "cost_of_transport": ("cost of transport", 2, 1.0),
    "weight_share": ("weight share", 2, 1.0),
    "return": ("return", 1, 1.0),
}
"""Title, digits and factor of what the tables show."""

SCALES = 25
"""Of the crank speed and of the amplitude that are tried, each."""


@dataclass(frozen=True)
class Compared:
    """A line of the comparison: figures with their intervals, over seeds or, without learning, episodes."""

    name: str
    intervals: Mapping[str, Interval]

    def cells(self) -> list[str]:
        """Of a table."""
        return [self.intervals[key].text(digits, by) for key, (_, digits, by) in COLUMNS.items()]


def of_row(name: str, row: Row) -> Compared:
    """An entry as it was scored."""
    return Compared(name, row.intervals)


def of_reference(name: str, found: Reference) -> Compared:
    """A policy that learns nothing."""
    return Compared(name, found.intervals)


def told_speed(row: Row, speed: float) -> Compared:
    """Agents of HorseLegSpeed-v0 that are told one speed and no other."""
    kwargs: dict[str, Any] = {"target_speed": [speed, speed]}
    each = [figures(score_vector(str(one.folder), SPEED, FINAL_SEEDS, **kwargs)) for one in row.results]
    name = f"{row.title} of HorseLegSpeed-v0, told {speed:g} m/s"
    return Compared(name, over_seeds(each))


def scaled_runs() -> tuple[list[tuple[float, float]], np.ndarray]:
    """Factors of (crank speed, swing amplitude) from 1 to as much as the actions allow, and the actions."""
    env = runs.make_env(LEG)
    leg: Any = env.unwrapped
    gait: GaitParameters = leg.gaits["run"]
    crank = LIMITS["crank_speed"][1] / gait.crank_speed
    swing = min(
        max(bound / value for bound in LIMITS[name])
        for name, value in (("swing_sin", gait.swing_sin), ("swing_cos", gait.swing_cos))
    )
    factors = [(c, s) for c in np.linspace(1, crank, SCALES) for s in np.linspace(1, swing, SCALES)]
    scaled = np.array(factors)[:, [0, 0, 1, 1]]
    scaled[:, 1] = 1.0  # the swing's middle stays
    actions = leg.action_for(scaled * gait.to_array())
    env.close()
    return factors, actions


def sped_up(speed: float) -> list[Compared]:
    """The scaled runs that are as fast as `speed` [m/s] with the lowest stance peak and with the lowest cost
    of transport, chosen on the episodes of the learning curves; the fastest if none is as fast."""
    factors, actions = scaled_runs()
    few = CURVE_SEEDS[:5]
    episodes = score_vector(np.repeat(actions, len(few), axis=0), LEG, list(few) * len(actions))
    found = [figures(episodes[k : k + len(few)]) for k in range(0, len(episodes), len(few))]
    fast = [k for k, one in enumerate(found) if one["speed_m_s"] >= speed]
    chosen: dict[int, list[str]] = {}
    if not fast:
        chosen[int(np.argmax([one["speed_m_s"] for one in found]))] = ["the fastest"]
    else:
        for words, key in (("softest", "stance_peak_n"), ("cheapest", "cost_of_transport")):
            chosen.setdefault(min(fast, key=lambda k: found[k][key]), []).append(words)
    return [
        of_reference(
            f"run, crank × {factors[k][0]:.2f}, swing × {factors[k][1]:.2f} ({' and '.join(words)})",
            reference("", actions[k], LEG, {}),
        )
        for k, words in chosen.items()
    ]


def dominates(agent: Compared, other: Compared) -> bool:
    """Whether the agent is at least as fast, in the mean, and lower in all of `LOWER`, intervals apart."""
    fast = agent.intervals["speed_m_s"].mean >= other.intervals["speed_m_s"].mean
    return fast and all(other.intervals[key].above(agent.intervals[key]) for key in LOWER)


def reduction(agent: Compared, other: Compared) -> str:
    """How much lower the agent is in each of `LOWER`, in words."""
    said = []
    for key in LOWER:
        share = 1 - agent.intervals[key].mean / other.intervals[key].mean
        said.append(f"{COLUMNS[key][0].rpartition(' k')[0] or COLUMNS[key][0]} {100 * share:.0f} %")
    return ", ".join(said)


def compare(rows: Sequence[Row], best: Row | None, gaits: Mapping[str, Reference]) -> tuple[str, str]:
    """The comparison as a table, and what it says of the trained-for-it agents in a word and its reason.

    Args:
        rows: of the plan, those that are done.
        best: the best agents of HorseLeg-v0.
        gaits: references of HorseLeg-v0.
    """
    paper = of_reference("run of the paper", gaits["run"])
    groups: list[tuple[Compared, list[Compared]]] = [(paper, [])]
    verdict = "not trained yet"
    for row in rows:
        if row.entry.env_id == LEG and row.entry.label == MATCHED:
            slowed = of_row(f"{row.entry.algo.upper()}, paid up to {MATCHED_SPEED:g} m/s", row)
            groups[0][1].append(slowed)
            word = "met" if dominates(slowed, paper) else "not met"
            verdict = f"{word}: lower by {reduction(slowed, paper)}"
        elif row.entry.env_id == SPEED:
            groups[0][1].append(told_speed(row, MATCHED_SPEED))
    if best is not None:
        fast = of_row(f"{best.title} of HorseLeg-v0, as fast as it likes", best)
        groups += [(one, [fast]) for one in sped_up(fast.intervals["speed_m_s"].mean)]
    lines = [
        f"| | {' | '.join(title for title, *_ in COLUMNS.values())} | dominates |",
        "|---|" + "---|" * (len(COLUMNS) + 1),
    ]
    for other, agents in groups:
        lines.append(f"| {other.name} | {' | '.join(other.cells())} | |")
        lines += [
            f"| {one.name} | {' | '.join(one.cells())} | {'yes' if dominates(one, other) else 'no'} |"
            for one in agents
        ]
    return "\n".join(lines), verdict
