"""Part 3: how each published number answers to ground, friction, crank speed and ground level.

All with the exact solver. A row answers to a parameter by its central difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from hoof_env.errors import ParameterError
from hoof_env.ground.contact import Ground
from hoof_env.paper.measure import measure_stance
from hoof_env.paper.published import CONDITIONS, Published, PublishedRow, load_published
from hoof_env.paper.reproduce import GAITS
from hoof_env.paper.study import figures_sensitivity as figures
from hoof_env.paper.study.by_construction import GROUND_PARAMETERS, confirm
from hoof_env.paper.study.replay import (
    Cycles,
    at_speed,
    exact_cycle,
    ground_of,
    replay,
    row_values,
    stances_on,
)
from hoof_env.paper.study.section import Section, for_json
from hoof_env.paper.study.sensitivity_text import sensitivity_text

PARAMETERS = (*GROUND_PARAMETERS, "crank_speed", "ground_level")

PART, RISE = 1e-2, 1e-4
"""Parameters vary by this part to either side, the ground level by this much [m]."""

STIFFER = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0)
"""Stiffness over the preset's [-]."""

LEVELS = np.linspace(-20e-3, 20e-3, 201)
"""Rise of the ground in the sweep [m]."""

FRICTIONS = np.linspace(0, 1, 41)
FAST = np.geomspace(2e-3, 10, 41)
"""Friction coefficients [-] and upper thresholds [m/s] of the sweeps."""

SPEEDS = (0.5, 2.0)
"""Crank speeds over the paper's that are tried [-]."""


def examine_sensitivity(preset: str | None, progress: Callable[[str], None]) -> Section:
    """Part 3 of the study.

    Args:
        preset: leg and gaits; the environment's default if None.
        progress: called with a line now and then.

    Raises:
        HoofEnvError: a preset that is unknown or does not walk and run.
    """
    published = load_published()
    cycles = {gait: exact_cycle(gait, preset) for gait in GAITS}
    ground = ground_of(preset)
    progress("answer of every row to every parameter")
    rows = answers(published, cycles, ground)
    data: dict[str, Any] = {
        "parameters": {name: getattr(ground, name) for name in GROUND_PARAMETERS},
        "part": PART,
        "rows": rows,
        "laws": confirm(rows),
    }
    progress("sweeps of stiffness, friction, crank speed and ground level")
    data["stiffness"] = _stiffer(published, cycles, ground)
    data["friction"] = _friction(cycles, ground)
    data["speed"] = {f"{factor:g}": _speed(published, cycles, ground, factor) for factor in SPEEDS}
    data["level"] = _levels(published, cycles, ground)
    data = for_json(data)
    return Section(
        "Sensitivity of the published numbers",
        sensitivity_text(published, data),
        data,
        {
            "sensitivity_map": partial(figures.draw_map, published, data),
            "sensitivity_sweeps": partial(figures.draw_sweeps, published, data),
        },
    )


def of(published: Published, row_id: str) -> PublishedRow:
    """The published row of an id or of its resultant."""
    return published.row(row_id.removesuffix(".resultant"))


def answers(published: Published, cycles: Cycles, ground: Ground) -> dict[str, dict[str, Any]]:
    """How every row and its resultant answer.

    Returns:
        By row id "value", "unit" and for each parameter a dictionary: "elasticity", the relative change of
        the row per relative change of the parameter (None for the ground level); "change", of the row in the
        measure of its bar (forces: % of the row) as the parameter grows by 1 % or the ground rises by 1 mm;
        "bars", the same in bars, None where the row has none.
    """
    base = row_values(published, stances_on(cycles, ground))
    rows: dict[str, dict[str, Any]] = {
        row: {"value": value, "unit": of(published, row).unit} for row, value in base.items()
    }
    for parameter in PARAMETERS:
        low, high = (_moved(published, cycles, ground, parameter, sign) for sign in (-1, 1))
        steps = 2e3 * RISE if parameter == "ground_level" else 2e2 * PART  # mm or %
        for row, entry in rows.items():
            bar = of(published, row).bar
            change = bar.error(base[row] + (high[row] - low[row]) / steps, base[row])
            entry[parameter] = {
                "elasticity": None if parameter == "ground_level" else _elasticity(low[row], high[row]),
                "change": change,
                "bars": None if bar.limit is None else change / bar.limit,
            }
    return rows


def _elasticity(low: float, high: float) -> float:
    """Slope in logarithms between the two ends; NaN across zero."""
    return math.log(high / low) / math.log((1 + PART) / (1 - PART)) if low * high > 0 else math.nan


def _moved(
    published: Published, cycles: Cycles, ground: Ground, parameter: str, sign: int
) -> dict[str, float]:
    """All rows with one parameter a little lower or higher."""
    factor = 1 + sign * PART
    if parameter == "ground_level":
        return row_values(published, stances_on(cycles, ground, sign * RISE))
    if parameter == "crank_speed":
        faster = {gait: at_speed(cycle, factor) for gait, cycle in cycles.items()}
        return row_values(published, stances_on(faster, ground))
    moved = replace(ground, **{parameter: factor * getattr(ground, parameter)})
    return row_values(published, stances_on(cycles, moved))


def _stiffer(published: Published, cycles: Cycles, ground: Ground) -> list[dict[str, Any]]:
    """Stiffer grounds, each at the level at which the elastic walking peak is the published one."""
    walk, target = cycles["walk"], published.row("walk.peak_elastic").value
    deepest = max(float(walk[f"{name}_penetration"].max()) for name in ("toe", "heel"))
    rises = np.linspace(-0.98 * deepest, deepest, 401)
    peaks = [float(replay(walk, ground, float(rise))["normal"].max()) for rise in rises]
    result = []
    for factor in STIFFER:
        rise = float(np.interp(target / factor, peaks, rises))
        stiff = replace(ground, stiffness=factor * ground.stiffness)
        try:
            rows = row_values(published, stances_on(cycles, stiff, rise))
        except ParameterError:  # a gait no longer reaches the ground
            rows = {}
        barred = [row for row in published.rows if row.bar.limit is not None]
        result.append(
            {
                "factor": factor,
                "stiffness": stiff.stiffness,
                "rise_mm": 1e3 * rise,
                "rows": rows,
                "within": sum(
                    bool(row.bar.holds(row.bar.error(rows.get(row.id, math.nan), row.value)))
                    for row in barred
                ),
                "barred": len(barred),
            }
        )
    return result


def _friction(cycles: Cycles, ground: Ground) -> dict[str, Any]:
    """Elastic peak of the resultant over that of the normal force, over mu and the upper threshold."""

    def ratios(grounds: list[Ground]) -> dict[str, list[float]]:
        result = {}
        for gait, cycle in cycles.items():
            stances = [measure_stance(replay(cycle, each)) for each in grounds]
            result[gait] = [stance.peak_resultant / stance.peak for stance in stances]
        return result

    return {
        "friction": FRICTIONS,
        "by_friction": ratios([replace(ground, friction=float(mu)) for mu in FRICTIONS]),
        "fast": FAST,
        "by_fast": ratios([replace(ground, friction_fast=float(fast)) for fast in FAST]),
    }


def _speed(published: Published, cycles: Cycles, ground: Ground, factor: float) -> dict[str, Any]:
    """Largest relative change of normal force rows and of resultant rows at another crank speed [-]."""
    base = row_values(published, stances_on(cycles, ground))
    faster = {gait: at_speed(cycle, factor) for gait, cycle in cycles.items()}
    rows = row_values(published, stances_on(faster, ground))
    changes = {row: abs(rows[row] / base[row] - 1) for row in base if "peak" in row or "mean" in row}
    return {
        "normal": max(change for row, change in changes.items() if not row.endswith(".resultant")),
        "resultant": max(change for row, change in changes.items() if row.endswith(".resultant")),
    }


def _levels(published: Published, cycles: Cycles, ground: Ground) -> dict[str, Any]:
    """Peaks over the published ones [-] by gait and condition, over the rise of the ground."""
    return {
        "rise_mm": 1e3 * LEVELS,
        "peaks": {
            f"{gait}.{condition}": [
                float(replay(cycles[gait], replace(ground, restitution=cr), float(rise))["normal"].max())
                / published.row(f"{gait}.peak_{condition}").value
                for rise in LEVELS
            ]
            for gait in GAITS
            for condition, cr in CONDITIONS.items()
        },
    }
