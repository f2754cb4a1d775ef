"""Agents beside the paper's run at matched speed: forces and costs of gaits of other speeds say little.

Two ways to match:

 - Agents are slowed down to the run. Some are trained for that: the default reward, but progress beyond
   `MATCHED_SPEED` is taken back, so that they look for the softest and cheapest gait of that speed. Others
   are paid for bearing weight, too (`BEARING_WEIGHTS`), for else they lean on the suspension. Those of
   HorseLegSpeed-v0 are merely told to keep the speed.
 - The run is sped up to the agents of the default reward: its crank speed and the amplitude of its swing are
   scaled by constants, over all that the actions allow.

An agent dominates where it is at least as fast, and its peak forces and cost of transport are lower, all
intervals apart. The weight that the leg bears stands beside them, for bearing less is a way to be soft.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from agents import runs
from agents.baselines_plan import (
    BEARING,
    BEARING_SPEED,
    CURVE_SEEDS,
    FINAL_SEEDS,
    LEG,
    MATCHED,
    MATCHED_SPEED,
    figures,
)
from agents.baselines_results import Reference, Row, reference
from agents.baselines_stats import Interval, over_seeds
from agents.open_loop import GAITS
from agents.score import score_vector
from hoof_env.gait.gait import LIMITS, GaitParameters

SPEED = "hoof_env/HorseLegSpeed-v0"
LOWER = ("peak_grf_n", "stance_peak_n", "cost_of_transport")
"""Figures that dominance is about; less is better."""

ASKED = {
    MATCHED: "at matched speed it is softer and cheaper than the paper's run, intervals apart",
    BEARING: "the same, bearing no less of the weight than the run",
}
PAID = {
    MATCHED: f"paid up to {MATCHED_SPEED:g} m/s",
    BEARING: f"paid up to {BEARING_SPEED:g} m/s and for bearing weight",
}
"""What is asked of the agents of a label, and what sets them apart."""

COLUMNS: Mapping[str, tuple[str, int, float]] = {
    "speed_m_s": ("speed m/s", 2, 1.0),
    "peak_grf_n": ("highest GRF kN", 2, 1e-3),
    "stance_peak_n": ("stance peak kN", 2, 1e-3),
    "cost_of_transport": ("cost of transport", 2, 1.0),
    "weight_share": ("weight share", 2, 1.0),
}
"""Title, digits and factor of what the tables show."""

SCALES = 25
"""Of the crank speed and of the amplitude that are tried, each."""

SLOWER = 0.05
"""By so much of its speed a scaled run may be slower than the agents it stands beside."""


@dataclass(frozen=True)
class Compared:
    """A line of the comparison: figures with their intervals, over seeds or, without learning, episodes; and
    those of each seed."""

    name: str
    intervals: Mapping[str, Interval]
    seeds: Sequence[Mapping[str, float]] = ()

    def cells(self) -> list[str]:
        """Of a table."""
        return [self.intervals[key].text(digits, by) for key, (_, digits, by) in COLUMNS.items()]


def of_row(name: str, row: Row) -> Compared:
    """An entry as it was scored."""
    return Compared(name, row.intervals, [one.figures for one in row.results])


def of_reference(name: str, found: Reference) -> Compared:
    """A policy that learns nothing."""
    return Compared(name, found.intervals)


def told_speed(row: Row, speed: float) -> Compared:
    """Agents of HorseLegSpeed-v0 that are told one speed and no other."""
    kwargs: dict[str, Any] = {"target_speed": [speed, speed]}
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", UserWarning
        )  # that they were trained with other speeds, which is meant
        each = [figures(score_vector(str(one.folder), SPEED, FINAL_SEEDS, **kwargs)) for one in row.results]
    name = f"{row.title} of HorseLegSpeed-v0, told {speed:g} m/s"
    return Compared(name, over_seeds(each), each)


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
    """The scaled runs that go at `speed` [m/s], or by `SLOWER` less at most, with the lowest stance peak and
    with the lowest cost of transport, chosen on the episodes of the learning curves; where none goes so
    fast, the fastest."""
    factors, actions = scaled_runs()
    few = CURVE_SEEDS[:5]
    episodes = score_vector(np.repeat(actions, len(few), axis=0), LEG, list(few) * len(actions))
    found = [figures(episodes[k : k + len(few)]) for k in range(0, len(episodes), len(few))]
    near = [k for k, one in enumerate(found) if (1 - SLOWER) * speed <= one["speed_m_s"] <= speed]
    if near:
        softest, cheapest = (
            min(near, key=[one[key] for one in found].__getitem__)
            for key in ("stance_peak_n", "cost_of_transport")
        )
        chosen = {softest: "softest", cheapest: "cheapest"}
        if softest == cheapest:
            chosen = {softest: "softest and cheapest"}
    else:
        chosen = {int(np.argmax([one["speed_m_s"] for one in found])): "fastest"}
    return [
        of_reference(
            f"run, crank × {factors[k][0]:.2f}, swing × {factors[k][1]:.2f} ({word})",
            reference("", actions[k], LEG, {}),
        )
        for k, word in chosen.items()
    ]


def dominates(agent: Compared, other: Compared) -> bool:
    """Whether the agent is at least as fast, in the mean, and lower in all of `LOWER`, intervals apart."""
    fast = agent.intervals["speed_m_s"].mean >= other.intervals["speed_m_s"].mean
    return fast and all(other.intervals[key].above(agent.intervals[key]) for key in LOWER)


def seeds_that_dominate(agent: Compared, other: Compared) -> str:
    """How many seeds are at least as fast and lower in all of `LOWER`, each by its own mean; no interval."""
    means = {key: interval.mean for key, interval in other.intervals.items()}
    count = sum(
        one["speed_m_s"] >= means["speed_m_s"] and all(one[key] < means[key] for key in LOWER)
        for one in agent.seeds
    )
    return f"{count}/{len(agent.seeds)}" if agent.seeds else ""


def told(agent: Compared, other: Compared) -> str:
    """Whether the agent dominates, and whether it bears less of the weight then, in words."""
    if not dominates(agent, other):
        return "no"
    shares = (one.intervals["weight_share"] for one in (other, agent))
    return "yes, bearing less of the weight" if next(shares).above(next(shares)) else "yes"


def versus(agent: Compared, other: Compared) -> str:
    """Both speeds, and how much lower the agent is in each of `LOWER`, in words."""
    fast, slow = (one.intervals["speed_m_s"].text(2) for one in (agent, other))
    titles = {key: COLUMNS[key][0].removesuffix(" kN") for key in LOWER}
    lower = [
        f"{title} {100 * (1 - agent.intervals[key].mean / other.intervals[key].mean):.0f} %"
        for key, title in titles.items()
    ]
    return f"{fast} m/s beside {slow}, lower by {', '.join(lower)}"


def compare(
    rows: Sequence[Row], best: Row | None, gaits: Mapping[str, Reference]
) -> tuple[str, dict[str, str]]:
    """The comparison as a table, and of the agents that were trained for it what was asked, met or not.

    Args:
        rows: of the plan, those that are done.
        best: the best agents of HorseLeg-v0.
        gaits: references of HorseLeg-v0.
    """
    paper = of_reference("run of the paper", gaits["run"])
    groups: list[tuple[Compared, list[Compared]]] = [(paper, [])]
    bars = dict.fromkeys(ASKED.values(), "not trained yet")
    for row in rows:
        if row.entry.env_id == LEG and row.entry.label in ASKED:
            slowed = of_row(f"{row.entry.algo.upper()}, {PAID[row.entry.label]}", row)
            groups[0][1].append(slowed)
            said = told(slowed, paper)
            met = said == "yes" or (said != "no" and row.entry.label == MATCHED)
            word = "not met" if not met else "met" if said == "yes" else "met, bearing less of the weight"
            count = seeds_that_dominate(slowed, paper)
            bars[ASKED[row.entry.label]] = f"{word}: {versus(slowed, paper)}; seed by seed in {count}"
        elif row.entry.env_id == SPEED:
            groups[0][1].append(told_speed(row, MATCHED_SPEED))
    for path in sorted(GAITS.glob("HorseLeg-v0-*-2.json")):  # found for 2 m/s or more
        groups[0][1].append(of_reference(f"open-loop, {path.stem}", reference("", str(path), LEG, {})))
    if best is not None:
        fast = of_row(f"{best.title} of HorseLeg-v0, as fast as it likes", best)
        groups += [(one, [fast]) for one in sped_up(fast.intervals["speed_m_s"].mean)]
    titles = [*(title for title, *_ in COLUMNS.values()), "dominates", "seeds that do, by their means"]
    lines = [f"| | {' | '.join(titles)} |", "|---|" + "---|" * len(titles)]
    for other, agents in groups:
        lines.append(f"| {other.name} | {' | '.join(other.cells())} | | |")
        for one in agents:
            said = f"{told(one, other)} | {seeds_that_dominate(one, other)}"
            lines.append(f"| {one.name} | {' | '.join(one.cells())} | {said} |")
    return "\n".join(lines), bars
