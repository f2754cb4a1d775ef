"""One motion, many ground levels: on a fixed trunk the ground changes forces only, so the leg moves once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.trace import record
from hoof_env.ground.contact import HEEL, TOE, Ground, new_contacts, touch
from hoof_env.simd.compile import kernel


def replay(trace: NDArray[np.void], ground: Ground, rise: float = 0.0) -> NDArray[np.void]:
    """The cycle on another ground, which lies higher by `rise` [m]: the trunk stands lower by as much.

    Contact state, forces and the trunk's height are computed anew by the simulator's contact kernel; drive
    torques and powers become NaN.

    Args:
        trace: dtype `hoof_env.dynamics.trace.TRACE`, one cycle on a fixed trunk.
        ground: the other ground.
        rise: how much higher it lies [m].
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
