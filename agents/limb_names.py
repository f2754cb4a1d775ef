"""Which legs of a found gait are called left: those that land in the order of a living horse.

In the plane left and right are names: a lead of half a stride more swaps those of the fore pair, and forces
are the same. A search does not see them, so that what it finds may be a walk in diagonal sequence or a pace.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from agents.gait_rig import Rig
from hoof_env.simd.threads import limit_threads

Floats = NDArray[np.float64]

LANDS = {"walk": 0.25, "trot": 0.5}
"""Landing of a horse's left fore hoof after its left hind hoof [strides]: a walk is in lateral sequence, left
hind, left fore, right hind, right fore, and at a trot diagonal legs land together (Hildebrand 1965, Science
150:701)."""
STARTS = 16  # that are played


def named(kind: str, gait: Floats, speed: float) -> Floats:
    """Return a walk or trot, shape (16,), with the names of its fore legs, or the other ones, that land as on
    a horse, at a commanded speed [m/s]."""
    rig = Rig(STARTS, num_threads=limit_threads(2))
    lands = float(rig.play(gait[None], speed, 10**7, STARTS)["touch_left_fore"][0])
    off = abs((lands - LANDS[kind] + 0.5) % 1 - 0.5)
    if off <= 0.25:
        return gait
    other = gait.copy()
    other[1] = round(other[1] - np.copysign(0.5, other[1]), 5)  # in the box of searches
    return other


def within_quarter(gaits: Floats) -> Floats:
    """Return gaits, shape (n, 16), with the lead within a quarter of a stride, by other names of the fore
    legs: a search from there does not meet the end of its box."""
    moved = gaits.copy()
    moved[:, 1] -= np.round(2 * moved[:, 1]) / 2
    return moved
