"""What a leg's strides cost and bring: stances, peak forces, work and load; see `lanes`.

A stance opens when the normal force on the hoof rises above a threshold, as on a force plate. It closes when
the force falls below it (lift-off), or after one crank revolution, whichever comes first, so that a hoof that
never lifts has a peak every revolution. While it is open its peak is the highest resultant ground reaction
force of any step; the increases of a stance's running peak add up to that peak.
"""

from __future__ import annotations

import math

from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics.lanes_ground import HEEL, TOE
from hoof_env.dynamics.lanes_report import feel_drives
from hoof_env.dynamics.vectors import vector
from hoof_env.simd import choose, dot, larger, root
from hoof_env.simd.compile import inlined

REVOLUTION = 2 * math.pi


@inlined
def forget_sums(limb):  # type: ignore[no-untyped-def]
    """Sums are those of one call of the engine."""
    for k in range(len(b.STRIDE_SUMS)):
        limb[b.STRIDE_SUM + k] = 0.0


@inlined
def count_stride(trunk, limb, h):  # type: ignore[no-untyped-def]
    """Add a whole step of `h` [s] that ends here."""
    feel_drives(trunk, limb)
    push, load = vector(limb, b.PUSH), limb[TOE + b.NORMAL] + limb[HEEL + b.NORMAL]
    force, loaded = root(dot(push, push)), load > limb[b.LIFT_OFF]
    was_open = (limb[b.STANCE_OPEN] > 0.0) & (limb[b.THETA] - limb[b.STANCE_BEGAN] < REVOLUTION)
    goes_on = loaded & was_open
    begins = choose(loaded, 1.0, 0.0) - choose(goes_on, 1.0, 0.0)
    peak = choose(goes_on, limb[b.STANCE_PEAK], 0.0)
    higher = choose(loaded, larger(peak, force), 0.0)
    limb[b.STANCE_OPEN] = choose(loaded, 1.0, 0.0)
    limb[b.STANCE_BEGAN] = choose(begins > 0.0, limb[b.THETA], limb[b.STANCE_BEGAN])
    limb[b.STANCE_PEAK] = higher
    limb[b.STANCES] = limb[b.STANCES] + begins
    limb[b.PEAK_INCREASE] = limb[b.PEAK_INCREASE] + (higher - peak)
    limb[b.HIGHEST] = larger(limb[b.HIGHEST], force)
    work = larger(limb[b.CRANK_POWER], 0.0) + larger(limb[b.SWING_POWER], 0.0)
    limb[b.POSITIVE_WORK] = limb[b.POSITIVE_WORK] + h * work
    limb[b.LOAD_IMPULSE] = limb[b.LOAD_IMPULSE] + h * load
    down = load > 0.0
    limb[b.LOADED_TIME] = limb[b.LOADED_TIME] + choose(down, h, 0.0)
    slid = limb[TOE + b.NORMAL] * limb[TOE + b.SLIDE] + limb[HEEL + b.NORMAL] * limb[HEEL + b.SLIDE]
    limb[b.TRAVEL] = limb[b.TRAVEL] - choose(down, h * slid / choose(down, load, 1.0), 0.0)
