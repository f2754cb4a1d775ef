"""Constants of a leg from which its joints and their reactions follow; the layout belongs to a structure."""

from __future__ import annotations

import hashlib
from functools import cache
from typing import Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray

from hoof_env.leg.assembly import coordinate
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.mechanism import BodyPoint, Dyad, Mechanism
from hoof_env.leg.mechanism_list import PAPER
from hoof_env.leg.profile import places
from hoof_env.simd.layout import Layout, Row, Vector, new_layout

BETWEEN_ANGLES = 1.05
"""Bound on how much farther out a point is between the sampled angles [-]."""


class Structure(NamedTuple):
    """The structure for which kernels are made.

    Attributes:
        mechanism: of the leg.
        off_centre: names of the bodies whose centre of mass is not in the middle between their ends.
    """

    mechanism: Mechanism
    off_centre: tuple[str, ...] = ()


PAPER_STRUCTURE = Structure(PAPER)


def structure_of(geometry: Geometry) -> Structure:
    """Return the structure of a leg."""
    centres = zip(geometry.mechanism.bodies, geometry.body_centres, strict=True)
    return Structure(geometry.mechanism, tuple(body.name for body, centre in centres if centre != 0.5))


class Meeting(Layout):
    """Two lengths that meet in a point, over a distance that varies."""

    one2: Row  # square of the length from the first point [m^2]
    excess: Row  # excess over the square of the other length [m^2]
    side: Row  # on which side of the line from the first point to the second they meet, 1 or -1


class Corner(Layout):
    """Two links that meet in a point, over a distance that does not change."""

    place: Vector  # of the point, from the first towards the second, in their distance [-]
    inverse: Row  # 1 / (twice the triangle's area) [1/m^2]


class Rod(Layout):
    """Mass of a body, centred between its ends, as it acts on them [kg]."""

    near: Row  # on the end itself
    far: Row  # on the other end


class Solid(Layout):
    """The same for a body whose centre of mass is anywhere [kg]."""

    tail: Row  # on the tail itself
    head: Row
    mixed: Vector  # on the tail by the head; on the head by the tail its mirror image


class LegConstants(Layout):
    """Constants common to all structures; `constants_layout` adds the constants of one."""

    crank: Row  # length [m]
    travel: Row  # 1 or -1
    toe_is_first: Row  # 1 if the toe is the first of the mechanism's feet, else 0
    reach: Row  # farthest of any joint but the sole's points from O, at any crank angle [m]


@cache
def constants_layout(structure: Structure) -> type[LegConstants]:
    """Return the layout of the constants of legs with a structure."""
    mechanism = structure.mechanism
    fields: dict[str, Any] = get_type_hints(LegConstants, include_extras=True)
    fields |= {f"pivot_{name}": Vector for name in mechanism.pivots}  # from O [m]
    # from the toe, in lengths from toe to heel [-]
    fields |= {f"sole_{name}": Vector for name in mechanism.sole}
    for step in mechanism.steps:
        kind: Any = Vector
        if isinstance(step, Dyad):
            kind = Corner if mechanism.is_corner(step) else Meeting
        fields[f"point_{step.point}"] = kind
    for body in mechanism.bodies:
        fields[f"body_{body.name}"] = Solid if body.name in structure.off_centre else Rod
    digest = hashlib.sha256(repr(structure).encode()).hexdigest()[:12]
    made: type[LegConstants] = new_layout(f"LegConstants_{digest}", fields)
    return made


def leg_constants(geometry: Geometry) -> NDArray[np.float64]:
    """Return the rows of `constants_layout` of a leg, shape (rows,)."""
    mechanism = geometry.mechanism
    structure = structure_of(geometry)
    values = [geometry.crank_length, float(geometry.travel), float(geometry.toe == mechanism.feet[0])]
    z = places(geometry, np.linspace(0.0, 2 * np.pi, 1000))[0]
    sole = mechanism.sole
    near_ground = [mechanism.number[point] for point in (*sole, *mechanism.feet)]
    values.append(BETWEEN_ANGLES * float(np.nanmax(np.abs(np.delete(z, near_ground, axis=1)))))
    for place in list(geometry.fixed.values())[1:]:
        values += [geometry.travel * place.real, place.imag]
    at = dict(zip(mechanism.points, z[np.isfinite(z).all(1)][0], strict=True))
    toe, heel = (at[point] for point in geometry.corners)
    for point in sole:
        ratio = (at[point] - toe) / (heel - toe)
        values += [ratio.real, ratio.imag]
    for step in mechanism.steps:
        values += _point_constants(geometry, step, at)
    bodies = zip(
        mechanism.bodies,
        geometry.body_masses,
        geometry.body_inertias,
        geometry.body_lengths,
        geometry.body_centres,
        strict=True,
    )
    for body, mass, inertia, length, centre in bodies:
        turning = inertia / length**2
        if body.name in structure.off_centre:
            place = centre if geometry.travel > 0 else centre.conjugate()
            mixed = mass * (1 - place.conjugate()) * place - turning
            values += [mass * abs(1 - place) ** 2 + turning, mass * abs(place) ** 2 + turning]
            values += [mixed.real, mixed.imag]
        else:
            values += [mass / 4 + turning, mass / 4 - turning]
    return np.array(values)


def _point_constants(geometry: Geometry, step: Dyad | BodyPoint, at: dict[str, complex]) -> list[float]:
    lengths = geometry.lengths
    if isinstance(step, BodyPoint):
        along, across = (coordinate(lengths, text) / lengths[step.span] for text in (step.along, step.across))
        return [along, geometry.travel * across]
    one2 = lengths[step.from_first] ** 2
    two2 = lengths[step.from_second] ** 2
    side = float(geometry.travel * geometry.assembly[step.point])
    if not geometry.mechanism.is_corner(step):
        return [one2, one2 - two2, side]
    span2 = abs(at[step.second] - at[step.first]) ** 2
    along = (span2 + one2 - two2) / (2 * span2)
    across = side * np.sqrt(one2 / span2 - along**2)
    return [along, across, 1 / (span2 * across)]
