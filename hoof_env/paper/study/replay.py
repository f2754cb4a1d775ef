"""One motion, many grounds: on a fixed trunk the ground changes forces only, so a cycle needs to move once.

`exact_cycle` and `euler_cycle` give a cycle, `replay` puts it on another ground, raised by any amount, with
the simulator's own contact kernel; nothing of the law is written twice.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from hoof_env._jit import kernel
from hoof_env.dynamics.result import Result
from hoof_env.dynamics.trace import new_trace, record
from hoof_env.errors import HoofEnvError
from hoof_env.ground.contact import HEEL, TOE, Ground, new_contacts, touch
from hoof_env.paper.measure import Stance, measure_stance
from hoof_env.paper.published import CONDITIONS, Published
from hoof_env.paper.reproduce import ENVIRONMENT, GAITS, run_cycle
from hoof_env.paper.rows import compare

Trace = NDArray[np.void]
Cycles = dict[str, Trace]
"""One cycle by gait."""

BESIDE = "resultant_N", "resultant_%"
"""Readings of a row that are rows of their own here: `id` + ".resultant"."""


@dataclass(frozen=True)
class EulerCycle:
    """One cycle of the paper's solver.

    Attributes:
        trace: as `run_cycle` gives it, on elastic ground.
        closure: largest constraint error, in m (or rad in the angle lock and the driver), at every 50th part
            of the cycle.
    """

    trace: Trace
    closure: NDArray[np.float64]


@lru_cache(maxsize=16)
def exact_cycle(gait: str, preset: str | None, step: float = 1e-4) -> Trace:
    """One cycle of the closed form on elastic ground, sampled every `step` [s]; do not write to it."""
    trace = run_cycle(gait, "exact", sim_dt=step, **_settings(preset))
    trace.flags.writeable = False
    return trace


@lru_cache(maxsize=128)
def euler_cycle(gait: str, preset: str | None, steps: int, beta: float) -> EulerCycle:
    """One cycle of Eq. 8 in explicit Euler with `steps` steps to the second and Baumgarte's `beta` [1/s].

    Raises:
        HoofEnvError: the integration failed before the end.
    """
    step = 1 / steps
    env: Any = gymnasium.make(
        ENVIRONMENT, gait=gait, solver="paper", sim_dt=step, dt=step, baumgarte_beta=beta, **_settings(preset)
    ).unwrapped
    engine, command = env.engine, env.gait.to_array()
    parts, closure = [engine.reset(env.gait)], []
    for chunk in np.array_split(np.arange(steps), 50):
        parts.append(new_trace(len(chunk)))
        if engine.advance(command, parts[-1]) is not Result.OK:
            raise HoofEnvError(f"{gait} in {steps} Euler steps a second with beta {beta:g}: it diverged")
        closure.append(float(np.abs(engine.closure().error).max()))
    env.close()
    trace = np.concatenate(parts)
    trace.flags.writeable = False
    return EulerCycle(trace, np.array(closure))


def _settings(preset: str | None) -> dict[str, Any]:
    return {} if preset is None else {"preset": preset}


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
