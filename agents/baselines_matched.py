"""Agents beside the paper's run at matched speed: forces and costs of gaits of other speeds say little.

Two ways to match:

 - Agents are slowed down to the run. Those with a label in agents/plans are trained for that: the default
   reward, but progress beyond a speed is taken back, so that they look for the softest and cheapest gait of
   that speed; some are paid for bearing weight, too, for else they lean on the suspension. Those of
   HorseLegSpeed-v0 are commanded to keep the speed.
 - The run is sped up to the agents of the default reward: its crank speed and the amplitude of its swing are
   scaled by constants, over all that the actions allow.

An agent dominates where it is at least as fast, and its peak forces and cost of transport are lower, all
intervals apart. The weight that the leg bears stands beside them, for bearing less is a way to be soft.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from agents import runs
from agents.baselines_results import Row, Scored, over_seeds, reference
from agents.baselines_run import LEG
from agents.score import CURVE_SEEDS, FINAL_SEEDS, mean_figures, score_vector
from hoof_env._output import markdown_table
from hoof_env.envs.policies import GAITS, open_loop
from hoof_env.gait.gait import LIMITS, GaitParameters

SPEED = "hoof_env/HorseLegSpeed-v0"
MATCHED_SPEED = 2.1
"""Speed [m/s] that agents of `SPEED` are commanded, and that of the label "matched" in agents/plans."""

LOWER = ("peak_grf_n", "stance_peak_n", "cost_of_transport")
"""Figures that dominance is about; less is better."""

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


def cells(one: Scored) -> list[str]:
    known = one.intervals
    return [known[key].text(digits, by) if key in known else "" for key, (_, digits, by) in COLUMNS.items()]


def commanded_speed(row: Row, speed: float) -> Scored:
    """Agents of HorseLegSpeed-v0 that are commanded one speed and no other."""
    kwargs: dict[str, Any] = {"target_speed": [speed, speed]}
    with warnings.catch_warnings():
        # That they were trained with other speeds, which is meant
        warnings.simplefilter("ignore", UserWarning)
        each = [
            mean_figures(score_vector(str(one.folder), SPEED, FINAL_SEEDS, **kwargs)) for one in row.results
        ]
    return Scored(f"{row.title} of HorseLegSpeed-v0, told {speed:g} m/s", over_seeds(each), each)


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


def held(actions: np.ndarray) -> Any:
    """The policy that holds actions, shape (4,), or (n, 4) for n environments."""
    return open_loop({"constant": actions}, dt=1.0)  # of a clock that is not there


def sped_up(speed: float) -> list[Scored]:
    """The scaled runs that go at `speed` [m/s], or by `SLOWER` less at most, with the lowest stance peak and
    with the lowest cost of transport, chosen on the episodes of the learning curves; where none goes so
    fast, the fastest."""
    factors, actions = scaled_runs()
    episodes = [score_vector(held(actions), LEG, [seed] * len(actions)) for seed in CURVE_SEEDS[:5]]
    means = [mean_figures(each) for each in zip(*episodes, strict=True)]
    near = [k for k, one in enumerate(means) if (1 - SLOWER) * speed <= one["speed_m_s"] <= speed]
    words: dict[int, list[str]] = {}
    if near:
        for key, word in (("stance_peak_n", "softest"), ("cost_of_transport", "cheapest")):
            words.setdefault(min(near, key=lambda k: means[k][key]), []).append(word)
    else:
        words[int(np.argmax([one["speed_m_s"] for one in means]))] = ["fastest"]
    return [
        reference(
            f"run, crank × {factors[k][0]:.2f}, swing × {factors[k][1]:.2f} ({' and '.join(chosen)})",
            held(actions[k]),
            LEG,
        )
        for k, chosen in words.items()
    ]


def dominates(agent: Scored, other: Scored) -> bool:
    """Whether the agent is at least as fast, in the mean, and lower in all of `LOWER`, intervals apart."""
    is_fast = agent.intervals["speed_m_s"].mean >= other.intervals["speed_m_s"].mean
    return is_fast and all(other.intervals[key].above(agent.intervals[key]) for key in LOWER)


def bears_less(agent: Scored, other: Scored) -> bool:
    return other.intervals["weight_share"].above(agent.intervals["weight_share"])


def verdict(agent: Scored, other: Scored) -> str:
    if not dominates(agent, other):
        return "no"
    return "yes, bearing less of the weight" if bears_less(agent, other) else "yes"


def seeds_that_dominate(agent: Scored, other: Scored) -> str:
    """How many seeds are at least as fast and lower in all of `LOWER`, each by its own mean; no interval."""
    means = {key: interval.mean for key, interval in other.intervals.items()}
    count = sum(
        one["speed_m_s"] >= means["speed_m_s"] and all(one[key] < means[key] for key in LOWER)
        for one in agent.seeds
    )
    return f"{count}/{len(agent.seeds)}" if agent.seeds else ""


def compare(rows: Sequence[Row], best: Row | None, run: Scored) -> str:
    """The comparison as a table: each version of the paper's `run`, and below it what is held against it: the
    plan's rows that are done, and the best agents of HorseLeg-v0."""
    agents = []
    for row in rows:
        if row.entry.env_id == LEG and row.entry.label:
            title = f"{row.entry.algo.upper()}, {row.entry.paid}"
            agents.append(Scored(title, row.scored.intervals, row.scored.seeds))
        elif row.entry.env_id == SPEED:
            agents.append(commanded_speed(row, MATCHED_SPEED))
    agents += [
        reference(f"open-loop, {path.stem}", str(path), LEG)
        for path in sorted(GAITS.glob("HorseLeg-v0-*-2.json"))  # found for 2 m/s or more
    ]
    groups = [(Scored("run of the paper", run.intervals), agents)]
    if best is not None:
        title = f"{best.title} of HorseLeg-v0, as fast as it likes"
        fast = Scored(title, best.scored.intervals, best.scored.seeds)
        groups += [(one, [fast]) for one in sped_up(fast.intervals["speed_m_s"].mean)]
    lines = []
    for other, beside in groups:
        lines.append([other.name, *cells(other)])
        lines += [
            [one.name, *cells(one), verdict(one, other), seeds_that_dominate(one, other)] for one in beside
        ]
    titles = [title for title, *_ in COLUMNS.values()]
    return markdown_table(["", *titles, "dominates", "seeds that do, by their means"], lines)
