"""Check that a leg turns, that its bodies move with its points, and that no other motion is possible.

A list may have as many rows as coordinates and still leave one body free and hold another twice, or name a
point of a body that moves independently. `check_motion` tests the leg's numbers at some angles.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import GeometryError
from hoof_env.leg.assembly import check_full_revolution, solve, weld_angles
from hoof_env.leg.mechanism import FRAME, Mechanism
from hoof_env.leg.mechanism_list import PAPER

if TYPE_CHECKING:
    from hoof_env.leg.geometry import Geometry

SAMPLES = 360
"""Number of crank angles at which the points are found."""

RANKED = 8
"""Largest number of these at which the rows' rank is computed: at single angles rows may be dependent."""

ROUNDING = 1e-8
"""Part of a length, or of the largest singular value, that is rounding."""


@dataclass(frozen=True)
class _Motion:
    """Parts of a leg on which its motion depends, and the leg itself."""

    mechanism: Mechanism
    lengths: tuple[tuple[str, float], ...]
    fixed: tuple[tuple[str, complex], ...]
    assembly: tuple[tuple[str, int], ...]
    full_turn: bool
    geometry: Geometry = field(compare=False)


def check_motion(geometry: Geometry) -> None:
    """Raise `GeometryError` unless a leg turns fully, if it must, the points of each body are fixed on it,
    and the rows of joints, welds and crank leave no body free.

    Bodies of the paper's mechanism, and of a leg that assembles at no angle, are not checked.
    """
    motion = _Motion(
        geometry.mechanism,
        tuple(geometry.lengths.items()),
        tuple(geometry.fixed.items()),
        tuple(geometry.assembly.items()),
        geometry.full_turn,
        geometry,
    )
    try:
        hash(motion)
    except TypeError:  # a mechanism that was made of lists
        _check(geometry)
    else:
        _check_once(motion)


# Each environment makes a new leg, and most legs were checked before. An error is not cached: it is raised
# each time.
@lru_cache(maxsize=32)
def _check_once(motion: _Motion) -> None:
    _check(motion.geometry)


def _check(geometry: Geometry) -> None:
    if geometry.full_turn:
        check_full_revolution(geometry)
    if geometry.mechanism == PAPER:
        return
    z = solve(geometry, np.arange(SAMPLES) * (2 * np.pi / SAMPLES))[0]
    z = z[np.isfinite(z).all(1)]
    if not len(z):
        return
    _check_bodies(geometry.mechanism, z)
    _check_rows(geometry.mechanism, z[:: -(-len(z) // RANKED)])
    weld_angles(geometry)


def _check_bodies(mechanism: Mechanism, z: NDArray[np.complex128]) -> None:
    for k, body in enumerate(mechanism.bodies):
        tail = z[:, mechanism.tails[k]]
        axis = z[:, mechanism.heads[k]] - tail
        for point in body.points:
            place = (z[:, mechanism.number[point]] - tail) / axis
            moved = float(np.abs(place - place[0]).max() * np.abs(axis[0]))
            if moved > ROUNDING * np.abs(z).max():
                raise GeometryError(
                    f"mechanism.bodies[{k}]: {point!r} is not a point of body {body.name!r}, on which it "
                    f"moves by {moved:.3g} m as the crank turns; leave it out of the body's points, or find "
                    f"it by 'body': {body.name!r}"
                )


def _check_rows(mechanism: Mechanism, z: NDArray[np.complex128]) -> None:
    """Check that the rows determine the velocities of all bodies at one of the angles at least."""
    rows = _rows(mechanism, z / np.abs(z).max())
    _, values, motions = np.linalg.svd(rows)
    margins = values[:, -1] / values[:, 0]
    best = int(np.argmax(margins))
    if margins[best] < ROUNDING:
        free = np.abs(motions[best][values[best] < ROUNDING * values[best, 0]])
        moves = free.reshape(-1, len(mechanism.bodies), 3).max((0, 2)) > ROUNDING
        names = ", ".join(repr(body.name) for body, does in zip(mechanism.bodies, moves, strict=True) if does)
        raise GeometryError(
            f"mechanism.joints: joints and welds hold some bodies twice and leave others free to move while "
            f"the crank stands: {names}; tie these to bodies that the crank moves, and leave out rows that "
            "hold the same twice"
        )


def _rows(mechanism: Mechanism, z: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the matrices of joints, welds and crank for the velocities (x, y, angle) of all bodies, where x
    and y are of the body's point at the crank's centre; shape (angles, rows, rows)."""
    size = 3 * len(mechanism.bodies)
    matrix = np.zeros((len(z), size, size))
    for row, joint in enumerate(mechanism.joints):
        place = z[:, mechanism.number[joint.point]]
        for body, sign in ((joint.i, 1.0), (joint.j, -1.0)):
            if body == FRAME:
                continue
            # v + i w p is the velocity of the point p of a body that turns at the rate w
            matrix[:, 2 * row, 3 * body] = sign
            matrix[:, 2 * row, 3 * body + 2] = -sign * place.imag
            matrix[:, 2 * row + 1, 3 * body + 1] = sign
            matrix[:, 2 * row + 1, 3 * body + 2] = sign * place.real
    for row, (one, other) in enumerate(mechanism.welds, 2 * len(mechanism.joints)):
        matrix[:, row, 3 * one + 2] = 1.0
        matrix[:, row, 3 * other + 2] = -1.0
    matrix[:, -1, 3 * mechanism.crank + 2] = 1.0
    return matrix
