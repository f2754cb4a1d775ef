"""One motion, many grounds: on a fixed trunk the ground changes forces only, so a cycle needs to move once.

`exact_cycle` and `euler_cycle` give a cycle, `replay` puts it on another ground, raised by any amount, with
the simulator's own contact kernel; nothing of the law is written twice.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env._jit import kernel
from hoof_env.dynamics.trace import new_trace, record
from hoof_env.errors import HoofEnvError
from hoof_env.gait.parameters import GaitParameters, load_gait
from hoof_env.ground.contact import HEEL, TOE, Ground, new_contacts, touch
from hoof_env.ground.preset import load_ground
from hoof_env.identify.drift import DriftCycle, drift_cycle
from hoof_env.leg.geometry import Geometry, load_geometry
from hoof_env.paper.measure import POINTS, Stance, measure_stance
from hoof_env.paper.published import CONDITIONS, Published
from hoof_env.paper.reproduce import GAITS, run_cycle
from hoof_env.paper.rows import compare

Trace = NDArray[np.void]
Cycles = dict[str, Trace]
"""One cycle by gait."""

BESIDE = "resultant_N", "resultant_%"
"""Readings of a row that are rows of their own here: `id` + ".resultant"."""


@lru_cache(maxsize=16)
def exact_cycle(gait: str, preset: str | None, step: float = 1e-4) -> Trace:
    """One cycle of the closed form on elastic ground, sampled every `step` [s]; do not write to it."""
    settings: dict[str, Any] = {} if preset is None else {"preset": preset}
    trace = run_cycle(gait, "exact", sim_dt=step, **settings)
    trace.flags.writeable = False
    return trace


@lru_cache(maxsize=64)
def euler_cycle(gait: str, preset: str | None, steps: int, beta: float) -> Trace:
    """One cycle of Eq. 8 in explicit Euler, `steps` steps to the second, Baumgarte's `beta` [1/s].

    Only what the ground needs is filled in, and forces not before `replay`: the rest is NaN.

    Raises:
        HoofEnvError: the integration failed before the end.
    """
    motion = _drift(gait, preset, steps, beta, steps)
    trace = new_trace(steps + 1)
    for name in trace.dtype.names or ():
        trace[name] = np.nan
    trace["t"] = motion.t
    trace["trunk_x"], trace["trunk_vx"], trace["trunk_vy"] = 0.0, 0.0, 0.0
    trace["trunk_y"] = height = _leg(preset)[0].hip_height
    for name in POINTS:
        at, velocity = getattr(motion, name), getattr(motion, f"{name}_velocity")
        trace[f"{name}_x"], trace[f"{name}_vx"] = at.real, velocity.real
        trace[f"{name}_penetration"], trace[f"{name}_rate"] = -(at.imag + height), -velocity.imag
    trace.flags.writeable = False
    return trace


def closure_error(gait: str, preset: str | None, steps: int, beta: float) -> float:
    """Largest constraint error of `euler_cycle`, at 20 instants of the cycle [m; rad in lock and driver]."""
    parts = (steps * part // 20 for part in range(1, 21))
    return max(_drift(gait, preset, steps, beta, part).closure_error for part in parts)


def _drift(gait: str, preset: str | None, steps: int, beta: float, until: int) -> DriftCycle:
    geometry, gaits, _ = _leg(preset)
    motion = drift_cycle(geometry, gaits[gait], sim_dt=1 / steps, steps=until, beta=beta)
    if not motion.finite:
        raise HoofEnvError(f"{gait} in {steps} Euler steps a second with beta {beta:g}: it diverged")
    return motion


@lru_cache(maxsize=8)
def _leg(preset: str | None) -> tuple[Geometry, dict[str, GaitParameters], Ground]:
    source = () if preset is None else (preset,)
    gaits = {gait: load_gait(gait, *source) for gait in GAITS}
    return load_geometry(*source), gaits, load_ground(*source)


def ground_of(preset: str | None, **changes: Any) -> Ground:
    """The ground of a preset (the environment's default if None), with changes to its attributes.

    Unchanged it is elastic, with the approach speed at the interpolated touch-down.
    """
    return replace(_leg(preset)[2], **changes)


def replay(trace: Trace, ground: Ground, rise: float = 0.0) -> Trace:
    """The cycle on another ground, which lies higher by `rise` [m]: the trunk stands lower by as much.

    Contact state, forces and the trunk's height are made anew; drive torques and powers become NaN.
    """
    result = trace.copy()
    _replay(result, new_contacts(), ground.to_record(), rise)
    return result


@kernel
def _replay(trace, contacts, ground, rise):  # type: ignore[no-untyped-def]
    for k in range(trace.shape[0]):
        row = trace[k]
        trunk, velocity = complex(row.trunk_x, row.trunk_y - rise), complex(row.trunk_vx, row.trunk_vy)
        toe = complex(row.toe_x, -row.toe_penetration - rise)
        heel = complex(row.heel_x, -row.heel_penetration - rise)
        touch(contacts[TOE], toe, complex(row.toe_vx, -row.toe_rate), ground)
        touch(contacts[HEEL], heel, complex(row.heel_vx, -row.heel_rate), ground)
        record(row, row.t, row, trunk, velocity, contacts, toe, heel, np.nan, np.nan)


def at_speed(trace: Trace, factor: float) -> Trace:
    """The motion of a cycle at `factor` times its speed: every position is the same, only earlier.

    Forces are stale until `replay`.
    """
    result = trace.copy()
    result["t"] /= factor
    for name in result.dtype.names or ():
        if name.endswith(("_rate", "_vx", "_vy")):
            result[name] *= factor
        elif name.endswith("_acc"):
            result[name] *= factor**2
    return result


def stances_on(cycles: Cycles, ground: Ground, rise: float = 0.0) -> dict[tuple[str, str], Stance]:
    """The paper's four conditions on a ground, whose own restitution does not count."""
    return {
        (gait, condition): measure_stance(replay(cycles[gait], replace(ground, restitution=cr), rise))
        for gait in GAITS
        for condition, cr in CONDITIONS.items()
    }


def row_values(published: Published, stances: dict[tuple[str, str], Stance]) -> dict[str, float]:
    """Every published row by id, and the peaks and reductions of the resultant as "id.resultant".

    A row without a value (no double support) is NaN.
    """
    values: dict[str, float] = {}
    for row in compare(published, stances, ""):
        values[row["id"]] = _number(row["simulated"])
        for name in BESIDE:
            if name in row["beside"]:
                values[f"{row['id']}.resultant"] = _number(row["beside"][name])
    return values


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
