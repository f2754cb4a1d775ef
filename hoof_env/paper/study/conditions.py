"""How well each published row is conditioned: what it does when step, beta or ground level move a little.

A row of the paper's solver has no derivative: its loop samples the approach speed at the first step inside
the ground, so the row jumps whenever touch-down passes from one step to the next. And a row that hangs on a
grazing touch-down may have a slope of zero on top of a spike. So three figures stand for each row: the slope
of a line through values close by, the scatter about that line, and the extremes in a window.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.ground.contact import Ground
from hoof_env.paper.published import Published, load_published
from hoof_env.paper.reproduce import GAITS
from hoof_env.paper.solvers import EULER, EXACT, betas
from hoof_env.paper.study.replay import Cycles, euler_cycle, exact_cycle, ground_of, row_values, stances_on
from hoof_env.paper.study.section import for_json

STEPS = 1000
"""The paper's steps to the second."""

PART, POINTS = 0.1, 41
"""Step and beta vary by this part to either side, in this many values; the line goes through all of them."""

LEVEL_LINE, LEVEL_WINDOW = 1e-4, 1e-3
"""How far the ground moves to either side for the line and for the window of the extremes [m]."""

Values = dict[str, float]


def conditions(
    preset: str | None = None, progress: Callable[[str], None] = lambda line: None
) -> dict[str, dict[str, Any]]:
    """How each published row answers to time step, beta and ground level.

    Args:
        preset: leg and gaits; the environment's default if None.
        progress: called with a line now and then.

    Returns:
        By row id a dictionary: "unit", and one dictionary for each solver, the exact one (ground) and the
        paper's (step, beta, ground). It has "value", the row, and for each parameter

        relative: relative change of the row per relative change of the parameter (ground: of the hip height).
        slope: change of the row in its unit per ms (step), per 1/s (beta), per mm that the ground rises.
        scatter: rms deviation from the line, in the row's unit.
        low, high: extremes in the window: 10 % of step and beta, 1 mm of ground, to either side.

        They are None where the row has no value throughout (no double support).
    """
    published = load_published()
    exact = {gait: exact_cycle(gait, preset) for gait in GAITS}
    progress("condition of each row, exact solver")
    answers = {EXACT: _ground(published, exact, ground_of(preset))}
    for solver, name in EULER.items():
        progress(f"condition of each row, paper's solver with the {name} beta")
        answers[solver] = _euler(published, preset, betas(published)[name])
    result: dict[str, dict[str, Any]] = for_json(
        {
            row.id: {"unit": row.unit, **{solver: answer[row.id] for solver, answer in answers.items()}}
            for row in published.rows
        }
    )
    return result


def euler_rows(published: Published, preset: str | None, steps: int, beta: float) -> Values:
    """Every row of the paper's solver with `steps` steps to the second."""
    cycles = {gait: euler_cycle(gait, preset, steps, beta) for gait in GAITS}
    return row_values(published, stances_on(cycles, ground_of(preset, approach="sampled")))


def _euler(published: Published, preset: str | None, beta: float) -> dict[str, dict[str, Any]]:
    cycles = {gait: euler_cycle(gait, preset, STEPS, beta) for gait in GAITS}
    answers = _ground(published, cycles, ground_of(preset, approach="sampled"))
    steps = np.unique(np.round(STEPS / np.linspace(1 - PART, 1 + PART, POINTS))).astype(int)
    rows = [euler_rows(published, preset, int(n), beta) for n in steps]
    _add(answers, "step", 1e3 / steps, 1e3 / STEPS, rows)
    around = beta * np.linspace(1 - PART, 1 + PART, POINTS)
    _add(answers, "beta", around, beta, [euler_rows(published, preset, STEPS, float(b)) for b in around])
    return answers


def _ground(published: Published, cycles: Cycles, ground: Ground) -> dict[str, dict[str, Any]]:
    """The rows, and what they do as the ground moves."""

    def rows(span: float) -> tuple[NDArray[np.float64], list[Values]]:
        rises = np.linspace(-span, span, POINTS)
        return rises, [row_values(published, stances_on(cycles, ground, float(rise))) for rise in rises]

    rises, near = rows(LEVEL_LINE)
    far = rows(LEVEL_WINDOW)[1]
    answers: dict[str, dict[str, Any]] = {name: {"value": value} for name, value in near[POINTS // 2].items()}
    height = float(cycles[GAITS[0]]["trunk_y"][0])
    _add(
        answers, "ground", 1e3 * rises, -1e3 * height, near, far
    )  # the hip is lower by what the ground rises
    return answers


def _add(
    answers: dict[str, dict[str, Any]],
    name: str,
    x: NDArray[np.float64],
    size: float,
    near: list[Values],
    far: list[Values] | None = None,
) -> None:
    """Fit a line to every row over parameter `name` at `x`; `size` makes its changes relative."""
    for row, answer in answers.items():
        y = np.array([values[row] for values in near])
        slope, offset = np.polyfit(x, y, 1) if np.isfinite(y).all() else (math.nan, math.nan)
        window = [values[row] for values in far or near]
        answer[name] = {
            "relative": float(slope * size / answer["value"]),
            "slope": float(slope),
            "scatter": float(np.sqrt(np.mean((y - offset - slope * x) ** 2))),
            "low": float(np.min(window)),
            "high": float(np.max(window)),
        }
