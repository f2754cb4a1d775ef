"""A leg's points at many crank angles, and whether they can be found at each: its dead points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import GeometryError
from hoof_env.leg.closed_form import solve_points
from hoof_env.leg.mechanism import FRAME, BodyPoint, Dyad

if TYPE_CHECKING:
    from hoof_env.leg.geometry import Geometry

ANGLES = 3600
"""Number of crank angles at which a leg is checked."""


MIN_TURN = 1e-9
"""Angle below which two directions are one, up to rounding [rad]."""


def coordinate(lengths: Any, text: str) -> float:
    """Return a coordinate of a `BodyPoint` [m]."""
    if not text:
        return 0.0
    return -lengths[text[1:]] if text.startswith("-") else lengths[text]


def tables(geometry: Geometry) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the steps that find a leg's points, as arrays for `closed_form.solve_points`.

    Returns:
        steps: shape (points to find, 4), rows (is_dyad, point, first, second) by `Mechanism.number`.
        values: shape (points to find, 3), rows (r1^2, r1^2 - r2^2, side) for a dyad, (along, across, 0) in
            lengths of the body for a body point.
    """
    number = geometry.mechanism.number
    lengths = geometry.lengths
    steps = []
    values = []
    for step in geometry.mechanism.steps:
        if isinstance(step, Dyad):
            ends = (step.first, step.second)
            r1 = lengths[step.from_first]
            r2 = lengths[step.from_second]
            values.append((r1 * r1, r1 * r1 - r2 * r2, float(geometry.assembly[step.point])))
        else:
            ends = (step.origin, step.toward)
            span = lengths[step.span]
            along, across = (coordinate(lengths, text) for text in (step.along, step.across))
            values.append((along / span, across / span, 0.0))
        steps.append((isinstance(step, Dyad), number[step.point], *(number[end] for end in ends)))
    return np.array(steps, dtype=np.int64).reshape(-1, 4), np.array(values).reshape(-1, 3)


def solve(geometry: Geometry, theta: Any) -> tuple[NDArray[np.complex128], ...]:
    """Return the points of a leg, and their first and second derivative by the crank angle, in its own frame.

    Each has shape (len(theta), points); NaN where the linkage cannot be closed.
    """
    theta = np.asarray(theta, dtype=np.float64)
    crank = geometry.lengths[geometry.mechanism.crank_length]
    fixed = np.array(list(geometry.fixed.values()), np.complex128)
    points = solve_points(theta, crank, fixed, *tables(geometry))
    solved = tuple(np.empty((theta.size, len(points)), np.complex128) for _ in range(3))
    parts = [(array.real, array.imag) for array in solved]
    for k, point in enumerate(points):
        for (real, imag), vectors in zip(parts, point, strict=True):
            real[:, k] = vectors.real
            imag[:, k] = vectors.imag
    return solved


def centres(geometry: Geometry, z: NDArray[np.complex128], mirrored: bool) -> NDArray[np.complex128]:
    """Return the bodies' centres of mass from the points, or their derivatives, shape (..., bodies).

    `mirrored` is true if the points are in the world's sense, after the mirror of `Geometry.travel`.
    """
    mechanism = geometry.mechanism
    tail = z[..., mechanism.tails]
    head = z[..., mechanism.heads]
    middle = (tail + head) / 2
    if not geometry.solids:
        return middle
    place = geometry.body_centres
    place = place.conj() if mirrored and geometry.travel < 0 else place
    return np.where(place == 0.5, middle, tail + (head - tail) * place)


def body_coordinate(geometry: Geometry, point: str, body: int) -> complex:
    """Place of a named point on a body, in the body's own axes: from its centre of mass, first axis along e_i
    [m]."""
    if body == FRAME:
        return geometry.fixed[point]
    mechanism = geometry.mechanism
    of = mechanism.bodies[body]
    length = float(geometry.body_lengths[body])
    centre = geometry.body_centres[body] * length
    place = {of.tail: -centre, of.head: length - centre}
    if point not in place:
        step = next((s for s in mechanism.steps if isinstance(s, BodyPoint) and s.point == point), None)
        if step is not None and {step.origin, step.toward} == {of.tail, of.head}:
            sense = 1 if step.toward == of.head else -1
            along, across = (coordinate(geometry.lengths, text) for text in (step.along, step.across))
            place[point] = place[step.origin] + sense * complex(along, across)
        else:
            z = solve(geometry, np.linspace(0, 2 * np.pi, ANGLES))[0]
            names = (of.tail, of.head, point)
            tail, head, at = z[np.isfinite(z).all(1)][0, [mechanism.number[name] for name in names]]
            place[point] = (at - tail) / (head - tail) * length - centre
    return complex(place[point])


def check_full_revolution(geometry: Geometry) -> None:
    """Raise `GeometryError` unless every dyad closes at every crank angle.

    The distance between a dyad's centres must stay strictly between the difference and the sum of its two
    lengths. A grid of angles is refined three times around the tightest one.
    """
    number = geometry.mechanism.number
    grid = np.arange(ANGLES) * (2 * np.pi / ANGLES)
    places = solve(geometry, grid)[0]
    for index, dyad in enumerate(geometry.mechanism.dyads):
        r1 = geometry.lengths[dyad.from_first]
        r2 = geometry.lengths[dyad.from_second]
        theta = grid
        z = places
        for _ in range(4):
            d = np.abs(z[:, number[dyad.second]] - z[:, number[dyad.first]])
            margins = np.stack([r1 + r2 - d, d - abs(r1 - r2)])
            which, where = np.unravel_index(np.argmin(margins), margins.shape)
            miss, angle = -margins[which, where], float(theta[where])
            # or not a number: an earlier dyad misses between two samples
            if not miss < 0:
                break
            theta = angle + np.linspace(-1, 1, 201) * (theta[1] - theta[0])
            z = solve(geometry, theta)[0]
        if not miss < 0:
            reach = "too far apart by" if which == 0 else "too close by"
            raise GeometryError(
                f"dyad {index + 1} ({dyad.first}-{dyad.point}-{dyad.second}, lengths {r1:.6g} and {r2:.6g} m)"
                f" does not close at crank angle {np.degrees(angle) % 360:.2f} deg: its centres, "
                f"{float(d[where]):.6g} m apart, are {reach} {miss:.3g} m; "
                "expected a leg that turns through a full revolution; hoof-env lengths --preset NAME prints"
                " how far each length of a leg can change"
            )


def weld_angles(geometry: Geometry) -> list[float]:
    """Return the angle of each weld's first body relative to the second, before the mirror [rad].

    Raises:
        GeometryError: the two bodies turn relative to each other.
    """
    mechanism = geometry.mechanism
    if not mechanism.welds:
        return []
    z = solve(geometry, np.linspace(0, 2 * np.pi, 48, endpoint=False))[0]
    z = z[np.isfinite(z).all(1)]
    angles = []
    for one, other in mechanism.welds:
        axes = [z[:, mechanism.heads[i]] - z[:, mechanism.tails[i]] for i in (one, other)]
        turns = axes[0] * axes[1].conj()
        if len(turns) and np.abs(np.angle(turns * turns[0].conj())).max() > MIN_TURN:
            names = " and ".join(repr(mechanism.bodies[i].name) for i in (one, other))
            raise GeometryError(
                f"mechanism.welds: {names} turn against each other, so they cannot be welded; make the "
                "points of one points of the other body, or leave the weld out"
            )
        angle = float(np.angle(turns[0])) if len(turns) else 0.0
        angles.append(angle if abs(angle) > MIN_TURN else 0.0)
    return angles


def transmission_margin(geometry: Geometry) -> float:
    """Return the smallest |sine| of the angle between a dyad's two links over a revolution [-]."""
    number = geometry.mechanism.number
    z = solve(geometry, np.linspace(0, 2 * np.pi, ANGLES))[0]
    smallest = 1.0
    for dyad in geometry.mechanism.dyads:
        point, first, second = (z[:, number[name]] for name in (dyad.point, dyad.first, dyad.second))
        one = point - first
        two = point - second
        sines = np.abs((np.conj(one) * two).imag) / (np.abs(one) * np.abs(two))
        smallest = min(smallest, float(np.min(np.nan_to_num(sines))))
    return smallest
