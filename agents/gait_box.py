"""Box of the numbers of gaits in which searches for kinematic gaits look, and gaits with which they begin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hoof_env.tasks.horse import HIP_HEIGHT
from hoof_env.tasks.horse_gaits import PAIRS, bounds, horse_gaits, reference_gaits

Floats = NDArray[np.float64]

STRIDES = (1.3, 1.6, 1.95, 2.3)  # of the gaits that searches begin with [hip heights]
LEADS = np.arange(0.0, 0.5, 0.05)  # of these [strides]

SWING = ((0.2, 1.7), (-0.7, 0.9), (-1.3, 0.3), (-0.5, 0.5), (-0.5, 0.5))
"""Least and largest offset and coefficients of the swing in a search [rad]; other numbers have the limits of
`RATE`, `LEAD` and `PART`."""
RATE = (2.5, 14.0)  # [rad/s]
LEAD = (-0.5, 0.5)  # [strides]
PART = (-0.6, 0.6)  # of the crank's speed [-]


def box() -> tuple[Floats, Floats]:
    """Return the least and the largest numbers of a gait in a search, shape (16,) each."""
    low, high = np.transpose([RATE, LEAD, *[PART, PART, *SWING] * len(PAIRS)])
    limits = bounds()
    return np.maximum(low, limits[0]), np.minimum(high, limits[1])


def decode(points: Floats) -> Floats:
    """Convert points of the box [-1, 1] to gaits, both of shape (n, 16)."""
    low, high = box()
    gaits: Floats = low + (np.clip(points, -1, 1) + 1) / 2 * (high - low)
    return gaits


def encode(gaits: Floats) -> Floats:
    """Convert gaits, shape (n, 16), to points within the box; the inverse of `decode`."""
    low, high = box()
    points: Floats = np.clip(2 * (gaits - low) / (high - low) - 1, -1, 1)
    return points


def first_gaits(kind: str, speed: float, stride: float) -> Floats:
    """Return the gait with which searches for a walk or a trot begin, at a speed [m/s] and with a stride [hip
    heights], once for each of `LEADS`, shape (n, 16).

    It is the reference gait of the speed, or the stored trot-like gait with the leads around its own. Cranks
    turn faster as the stride is shorter, and the swing is smaller.
    """
    gaits = np.repeat(reference_gaits(np.array([speed])), len(LEADS), axis=0)
    gaits[:, 1] = LEADS
    if kind == "trot":
        gaits[:] = horse_gaits()["trot-like"].to_array()
        gaits[:, 1] += (LEADS - LEADS.mean()) / 2
    rate = 2 * np.pi * speed / (stride * HIP_HEIGHT)
    smaller = min(gaits[0, 0] / rate, 1.0)
    gaits[:, 0] = rate
    for k in range(len(PAIRS)):
        # Past the crank's two numbers and the swing's offset
        swing = slice(2 + 7 * k + 3, 2 + 7 * (k + 1))
        gaits[:, swing] *= smaller
    return decode(encode(gaits))
