"""Figures of the path that a foot draws while the crank turns and the leg's frame keeps still."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hoof_env.gait import GaitParameters
from hoof_env.leg.assembly import solve
from hoof_env.leg.geometry import Geometry

ANGLES = 360  # of the crank


def crank_angles() -> NDArray[np.float64]:
    """Return the crank angles at which legs are looked at [rad]."""
    return np.linspace(0.0, 2 * np.pi, ANGLES, endpoint=False)


def path_of(
    leg: Geometry, gait: GaitParameters | None = None
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.int64]]:
    """Return the path of the toe [m], its derivative by the crank angle, and the indices of the stance: the
    half turn with the lowest mean. With a gait the frame swings as in it."""
    theta = crank_angles()
    z, dz, _ = solve(leg, theta)
    toe = leg.mechanism.number[leg.toe]
    foot = z[:, toe]
    moved = dz[:, toe]
    if gait is not None:
        sine = np.sin(theta)
        cosine = np.cos(theta)
        swing = gait.swing_offset + gait.swing_sin * sine + gait.swing_cos * cosine
        rate = gait.swing_sin * cosine - gait.swing_cos * sine
        turn = np.exp(1j * swing)
        moved = (moved + 1j * rate * foot) * turn
        foot = foot * turn
    half = ANGLES // 2
    heights = np.concatenate([foot.imag, foot[: half - 1].imag])
    first = int(np.argmin(np.convolve(heights, np.ones(half), "valid")))
    return foot, moved, (first + np.arange(half)) % ANGLES


def figures(leg: Geometry, gait: GaitParameters | None = None) -> dict[str, float]:
    """Return the figures of a path, lengths in heights of the crank's centre over the lowest point of it.

    "level" is the range of the foot's height in stance, "uneven" the standard deviation of its forward speed
    there over the mean, "stroke" the range of its way there. "passes" is the least height over the highest
    point of the stance with which the foot comes back over the middle half of the stroke, "lift" the range of
    its height over the turn. "margin" is the least sine of the angle between the links of a dyad that moves,
    which is 0 at a dead point, "clearance" the least height of another point than a foot with the frame at
    rest, and "longest" the longest link.
    """
    foot, moved, stance = path_of(leg, gait)
    hip = -foot.imag.min()
    speed = moved[stance].real
    ahead = foot[stance].real.max()
    behind = foot[stance].real.min()
    is_over = np.abs(foot.real - (ahead + behind) / 2) < (ahead - behind) / 4
    is_over[stance] = False
    back = foot.imag[is_over] if is_over.any() else foot.imag
    z = solve(leg, crank_angles())[0]
    at = leg.mechanism.number
    margin = 1.0
    for dyad in leg.mechanism.dyads:
        if not leg.mechanism.is_corner(dyad):
            one = z[:, at[dyad.point]] - z[:, at[dyad.first]]
            other = z[:, at[dyad.point]] - z[:, at[dyad.second]]
            sines = np.abs((one.conj() * other).imag) / (np.abs(one) * np.abs(other))
            margin = min(margin, float(sines.min()))
    others = [number for name, number in at.items() if name not in leg.mechanism.feet]
    return {
        "level": float(np.ptp(foot[stance].imag)) / hip,
        "uneven": float(speed.std() / abs(speed.mean())),
        "stroke": float(np.ptp(foot[stance].real)) / hip,
        "passes": float(back.min() - foot[stance].imag.max()) / hip,
        "lift": float(np.ptp(foot.imag)) / hip,
        "margin": margin,
        "clearance": 1.0 + float(z[:, others].imag.min()) / hip,
        "longest": float(leg.body_lengths.max()) / hip,
    }
