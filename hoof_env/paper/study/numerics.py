"""Part 1: what explicit Euler at the paper's step does to its numbers, with either reading of beta."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from hoof_env.errors import HoofEnvError
from hoof_env.ground.contact import Ground
from hoof_env.paper.measure import hoof_error, measure_stance
from hoof_env.paper.published import CONDITIONS, Published, load_published
from hoof_env.paper.reproduce import GAITS
from hoof_env.paper.solvers import betas
from hoof_env.paper.study import figures_numerics as figures
from hoof_env.paper.study.conditions import (
    LEVEL_WINDOW,
    STEPS,
    conditions,
    euler_rows,
)
from hoof_env.paper.study.numerics_text import numerics_text
from hoof_env.paper.study.replay import (
    Trace,
    closure_error,
    euler_cycle,
    exact_cycle,
    ground_of,
    replay,
    row_values,
    stances_on,
)
from hoof_env.paper.study.section import Section, for_json

LADDER = (1000, 2000, 4000, 8000)
"""Steps to the second at which the order is observed."""

BETA_SWEEP = np.linspace(0, 40, 161)
"""Baumgarte's beta [1/s] of the sweep."""

STEP_SWEEP = np.unique(np.round(np.geomspace(500, 4000, 161)).astype(int))
"""Steps to the second of the sweep."""


def examine_numerics(preset: str | None, progress: Callable[[str], None]) -> Section:
    """Part 1 of the study.

    Args:
        preset: leg and gaits; the environment's default if None.
        progress: called with a line now and then.

    Raises:
        HoofEnvError: a preset that is unknown or does not walk and run.
    """
    published = load_published()
    by_name = betas(published)
    exact = {gait: exact_cycle(gait, preset) for gait in GAITS}
    truth = row_values(published, stances_on(exact, ground_of(preset)))
    progress("distance of Euler from the exact motion")
    drift = {name: [_drift(preset, n, beta) for n in LADDER] for name, beta in by_name.items()}
    rows = {
        name: {str(n): euler_rows(published, preset, n, beta) for n in LADDER}
        for name, beta in by_name.items()
    }
    data = {
        "betas": by_name,
        "alpha": published.parameters["baumgarte_alpha"],
        "ladder": list(LADDER),
        "drift": drift,
        "rows": {
            row.id: {
                "exact": truth[row.id],
                **{name: [rows[name][str(n)][row.id] for n in LADDER] for name in by_name},
            }
            for row in published.rows
        },
        "causes": _causes(preset, by_name),
        "conditions": conditions(preset, progress),
    }
    progress("sweep of beta, of the step and of the ground level")
    data["beta_sweep"] = _beta_sweep(preset, truth)
    data["step_sweep"] = _step_sweep(preset, by_name)
    data["level_sweep"] = _level_sweep(preset, by_name)
    data = for_json(data)
    return Section(
        "Time step and Baumgarte stabilisation",
        numerics_text(published, data),
        data,
        {
            "numerics_drift": partial(figures.draw_drift, data, _errors_over_time(preset, by_name)),
            "numerics_beta": partial(figures.draw_beta, data),
            "numerics_step": partial(figures.draw_step_and_level, data),
            "numerics_forces": partial(figures.draw_forces, data, *_forces(preset, published, by_name)),
            "numerics_conditions": partial(figures.draw_conditions, published, data),
        },
    )


def _drift(preset: str | None, steps: int, beta: float) -> dict[str, Any]:
    """Errors of one solver setting: hoof over the cycle and in the exact stance, closure [mm], by gait."""
    result: dict[str, Any] = {}
    for gait in GAITS:
        exact = exact_cycle(gait, preset, 1 / steps)
        error = 1e3 * hoof_error(euler_cycle(gait, preset, steps, beta), exact)
        stance = measure_stance(exact)
        inside = (exact["t"] >= stance.start) & (exact["t"] <= stance.end)
        result[gait] = {
            "cycle_mm": float(error.max()),
            "stance_mm": float(error[inside].max()),
            "closure_mm": 1e3 * closure_error(gait, preset, steps, beta),
        }
    return result


def _causes(preset: str | None, by_name: dict[str, float]) -> dict[str, Any]:
    """Inelastic peaks [N] by gait, motion and how the approach speed is taken, all at the paper's step."""
    result: dict[str, Any] = {}
    for gait in GAITS:
        motions = {"exact": exact_cycle(gait, preset, 1 / STEPS)}
        motions |= {name: euler_cycle(gait, preset, STEPS, beta) for name, beta in by_name.items()}
        result[gait] = {
            motion: {
                approach: _peak(trace, _grounds(preset, approach)["inelastic"])
                for approach in ("interpolated", "sampled")
            }
            for motion, trace in motions.items()
        }
    return result


def _peak(trace: Trace, ground: Ground, rise: float = 0.0) -> float:
    return float(replay(trace, ground, rise)["normal"].max())


def _grounds(preset: str | None, approach: str) -> dict[str, Ground]:
    return {name: ground_of(preset, approach=approach, restitution=cr) for name, cr in CONDITIONS.items()}


def _beta_sweep(preset: str | None, truth: dict[str, float]) -> dict[str, Any]:
    """Hoof error [mm] by gait and peak over exact peak [-] by gait and condition, over beta at 1 ms."""
    result: dict[str, Any] = {"beta": BETA_SWEEP.tolist(), "hoof_mm": {}, "peak_ratio": {}}
    for gait in GAITS:
        exact = exact_cycle(gait, preset, 1 / STEPS)
        cycles = [euler_cycle(gait, preset, STEPS, float(beta)) for beta in BETA_SWEEP]
        result["hoof_mm"][gait] = [1e3 * float(hoof_error(trace, exact).max()) for trace in cycles]
        for condition, ground in _grounds(preset, "sampled").items():
            peak = truth[f"{gait}.peak_{condition}"]
            result["peak_ratio"][f"{gait}.{condition}"] = [_peak(trace, ground) / peak for trace in cycles]
    return result


def _step_sweep(preset: str | None, by_name: dict[str, float]) -> dict[str, Any]:
    """Inelastic peaks [N] by gait and beta over the step, NaN where the integration fails."""
    ground = _grounds(preset, "sampled")["inelastic"]

    def peak(gait: str, steps: int, beta: float) -> float:
        try:
            return _peak(euler_cycle(gait, preset, steps, beta), ground)
        except HoofEnvError:
            return math.nan

    return {
        "step_ms": (1e3 / STEP_SWEEP).tolist(),
        "peaks": {
            gait: {name: [peak(gait, int(n), beta) for n in STEP_SWEEP] for name, beta in by_name.items()}
            for gait in GAITS
        },
        "exact": {
            gait: _peak(exact_cycle(gait, preset), _grounds(preset, "interpolated")["inelastic"])
            for gait in GAITS
        },
    }


def _level_sweep(preset: str | None, by_name: dict[str, float]) -> dict[str, Any]:
    """Inelastic peaks [N] by gait and solver over the rise of the ground."""
    rises = 3 * LEVEL_WINDOW * np.linspace(-1, 1, 121)
    peaks: dict[str, Any] = {}
    for gait in GAITS:
        exact, ground = exact_cycle(gait, preset), _grounds(preset, "interpolated")["inelastic"]
        peaks[gait] = {"exact": [_peak(exact, ground, float(rise)) for rise in rises]}
        for name, beta in by_name.items():
            trace, sampled = euler_cycle(gait, preset, STEPS, beta), _grounds(preset, "sampled")["inelastic"]
            peaks[gait][name] = [_peak(trace, sampled, float(rise)) for rise in rises]
    return {"rise_mm": (1e3 * rises).tolist(), "peaks": peaks}


def _errors_over_time(preset: str | None, by_name: dict[str, float]) -> dict[tuple[str, str], Any]:
    """Curves for the figure: time [s] and hoof error [mm] by gait and beta, at the paper's step."""
    curves: dict[tuple[str, str], Any] = {}
    for gait in GAITS:
        exact = exact_cycle(gait, preset, 1 / STEPS)
        for name, beta in by_name.items():
            curves[gait, name] = exact["t"], 1e3 * hoof_error(euler_cycle(gait, preset, STEPS, beta), exact)
    return curves


def _forces(preset: str | None, published: Published, by_name: dict[str, float]) -> tuple[Any, Any]:
    """Curves for the figure: time [s] and inelastic normal force [N] by gait and solver; published peaks."""
    curves: dict[tuple[str, str], Any] = {}
    inelastic = _grounds(preset, "sampled")["inelastic"]
    for gait in GAITS:
        trace = replay(exact_cycle(gait, preset), _grounds(preset, "interpolated")["inelastic"])
        curves[gait, "exact"] = trace["t"], trace["normal"]
        for name, beta in by_name.items():
            trace = replay(euler_cycle(gait, preset, STEPS, beta), inelastic)
            curves[gait, name] = trace["t"], trace["normal"]
    return curves, {gait: published.row(f"{gait}.peak_inelastic").value for gait in GAITS}
