"""Joint reactions of a leg, dyad by dyad: no system of equations is solved.

A link's inertia and weight are written as two forces at its ends which have the same resultant and moment, so
that every law of moments reads 'this force turns the link like that one'. Two links that meet in a point (a
dyad) then give the force in that point from two such laws, and the forces at their far ends from the balance
of each. This starts at the hoof, which is loaded by inertia and ground alone, and ends at the crank.

Planar vectors are in world axes (x forward, y up, counter-clockwise) from the crank centre O. Kernels use
+, -, *, and one division and square root per dyad, without branches: a lane has the bits that a leg has
alone. Forces are named after the link that feels them and the one that exerts them: `gj_gf` is the force on
link GJ by link GF.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.hoof import force_of
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.mechanism import Dyad
from hoof_env.leg.mechanism_list import PAPER
from hoof_env.leg.profile import places
from hoof_env.simd import cross, dot, full_like, perpendicular, sqrt, store_vectors, vector, where
from hoof_env.simd.compile import inline_llvm
from hoof_env.simd.layout import Block, Layout, Row, Vector


class Reactions(Layout):
    """Joint forces and moments of a leg."""

    joints: Annotated[Block, 2 * len(PAPER.joints)]  # force of each joint: x and y [N]
    lock: Row  # moment on body 10 by body 7 [N m]
    driver: Row  # moment on the crank by the leg's frame [N m]
    hip: Row  # moment on the leg's frame by the trunk, about O [N m]


class HingeDyad(Layout):
    """Two links that meet, over a span that varies."""

    one2: Row  # square of the first link's length [m^2]
    half: Row  # half the difference of both squares [m^2]
    side: Row  # on which side of the span they meet, 1 or -1


class TriangleDyad(Layout):
    """Two links that meet, over a third link."""

    place: Vector  # of the point, from the third link's tail, in its length
    inverse: Row  # 1 / (twice the triangle's area) [1/m^2]


class Link(Layout):
    """A link's mass as it acts on its ends [kg]."""

    near: Row  # on the end itself
    far: Row  # on the other one


class LegConstants(Layout):
    """Constants of a leg from which reactions follow; points and links have the linkage's names."""

    crank: Row  # length [m]
    pivot: Vector  # C from O [m]
    travel: Row  # 1 or -1
    toe_is_i: Row  # 1 if the toe is I, 0 if it is J
    shank: Row  # FG / EF
    rocker: Row  # CA / CF
    fetlock: Vector  # of G from the toe, over that of the heel from the toe [-]
    reach: Row  # farthest of any joint but G and the hoof's corners from O, at any crank angle [m]
    B: HingeDyad
    F: HingeDyad
    E: HingeDyad
    J: HingeDyad
    D: TriangleDyad
    I: TriangleDyad  # noqa: E741
    OP: Link
    PB: Link
    CB: Link
    BD: Link
    CD: Link
    DE: Link
    EF: Link
    CF: Link
    PF: Link
    FG: Link
    GJ: Link
    AJ: Link
    GI: Link
    IJ: Link


BETWEEN_ANGLES = 1.05  # more than a point comes farther out between the angles that are looked at

_STEPS = {step.point: step for step in PAPER.steps}
_HINGES, _TRIANGLES = ("B", "F", "E", "J"), ("D", "I")


def leg_constants(geometry: Geometry) -> NDArray[np.float64]:
    """The rows of `LegConstants` of a leg, shape (LegConstants.size,)."""
    lengths = geometry.lengths
    pivot = geometry.fixed["C"]
    values = [lengths["OP"], geometry.travel * pivot.real, pivot.imag, float(geometry.travel)]
    values += [float(geometry.toe == "I"), lengths["FG"] / lengths["EF"], lengths["CA"] / lengths["CF"]]
    z = places(geometry, np.linspace(0.0, 2 * np.pi, 1000))[0]
    hoof = [PAPER.number[point] for point in ("G", *geometry.corners)]
    g, toe, heel = z[np.isfinite(z).all(1)][0, hoof]
    fetlock, others = (g - toe) / (heel - toe), np.delete(z, hoof, axis=1)
    values += [fetlock.real, fetlock.imag, BETWEEN_ANGLES * float(np.nanmax(np.abs(others)))]
    spans = {"D": lengths["CB"], "I": lengths["GJ"]}
    for point in _HINGES + _TRIANGLES:
        step = _STEPS[point]
        assert isinstance(step, Dyad)
        one2, two2 = lengths[step.from_first] ** 2, lengths[step.from_second] ** 2
        side = float(geometry.travel * geometry.assembly[point])
        if point in _HINGES:
            values += [one2, (one2 - two2) / 2, side]
        else:
            span2 = spans[point] ** 2
            along = (span2 + one2 - two2) / (2 * span2)
            across = side * np.sqrt(one2 / span2 - along**2)
            values += [along, across, 1 / (span2 * across)]
    for mass, inertia, length in zip(
        geometry.body_masses, geometry.body_inertias, geometry.body_lengths, strict=True
    ):
        values += [mass / 4 + inertia / length**2, mass / 4 - inertia / length**2]
    return np.array(values)


# -- tools -------------------------------------------------------------------------------------


class Point(NamedTuple):
    """Position from O, velocity relative to O, and acceleration plus g upward; planes."""

    at: Any
    v: Any
    a: Any


class Hinge(NamedTuple):
    """Two links that meet in a point: the point from their far ends, and 1 / cross(one, two)."""

    one: Any
    two: Any
    inverse: Any


@inline_llvm
def turning(p, rate, acc, lift):  # type: ignore[no-untyped-def]
    """A point at p of a body that turns about O."""
    return Point(p, vector(-rate * p.imag, rate * p.real), vector(-rate * rate, acc) * p + lift)


@inline_llvm
def swing(hinge, first, second):  # type: ignore[no-untyped-def]
    """Motion of a hinge from that of the far ends of its links, by the links' rates and accelerations."""
    one, two, inverse = hinge
    slip = second.v - first.v
    rate, rate_two = dot(two, slip) * inverse, dot(one, slip) * inverse
    rate2 = rate * rate
    acc = inverse * (
        dot(two, second.a - first.a) + rate2 * dot(one, two) - rate_two * rate_two * dot(two, two)
    )
    v = vector(-rate * one.imag, rate * one.real)
    return Point(first.at + one, first.v + v, first.a + vector(-rate2, acc) * one)


@inline_llvm
def hinge_point(dyad, first, second):  # type: ignore[no-untyped-def]
    """The hinge of two links of given lengths whose far ends are `first` and `second`."""
    span = second.at - first.at
    d2 = dot(span, span)
    k = 0.5 * d2 + dyad.half
    area = dyad.side * sqrt(dyad.one2 * d2 - k * k)  # cross(one, two)
    inverse = 1.0 / (d2 * area)
    over_d2 = area * inverse
    one = span * vector(k * over_d2, area * over_d2)
    hinge = Hinge(one, one - span, d2 * inverse)
    return hinge, swing(hinge, first, second)


@inline_llvm
def triangle_point(dyad, first, second):  # type: ignore[no-untyped-def]
    """The same where `first` and `second` are the ends of a third link."""
    place = dyad.place
    span = second.at - first.at
    one = span * place
    hinge = Hinge(one, one - span, dyad.inverse)
    return hinge, Point(
        first.at + one, first.v + (second.v - first.v) * place, first.a + (second.a - first.a) * place
    )


@inline_llvm
def extended_point(first, second, origin, ratio):  # type: ignore[no-untyped-def]
    """The point at origin + ratio (second - first) of a link."""
    return Point(
        origin.at + ratio * (second.at - first.at),
        origin.v + ratio * (second.v - first.v),
        origin.a + ratio * (second.a - first.a),
    )


@inline_llvm
def link_loads(link, tail, head):  # type: ignore[no-untyped-def]
    """Forces at tail and head that move a link as it moves, against its weight."""
    near, far = link.near, link.far
    return near * tail.a + far * head.a, near * head.a + far * tail.a


@inline_llvm
def hinge_force(hinge, by_one, by_two):  # type: ignore[no-untyped-def]
    """The force that turns link one about its far end like `by_one`, and link two like `by_two`."""
    one, two, inverse = hinge
    return inverse * cross(one, by_one) * two - inverse * cross(two, by_two) * one


# -- one leg -----------------------------------------------------------------------------------


@inline_llvm
def leg_reactions(  # type: ignore[no-untyped-def]
    g, crank_turn, theta_rate, theta_acc, frame_turn, beta_rate, beta_acc, lift, toe_force, heel_force
):
    """Reactions of one leg, as `parts.Reactions` has them.

    `g` are its `LegConstants`, the turns exp(i theta) and exp(i beta), `lift` the acceleration of O plus g
    upward [m/s^2], and the forces those of the ground on the leg [N].
    """
    # The crank turns clockwise before the mirror.
    travel = g.travel
    arm = g.crank * vector(travel * crank_turn.real, -crank_turn.imag)
    still = vector(full_like(g, 0.0), 0.0)
    O = Point(still, still, lift)  # noqa: E741
    C = turning(g.pivot * frame_turn, beta_rate, beta_acc, lift)
    P = turning(arm * frame_turn, beta_rate - travel * theta_rate, beta_acc - travel * theta_acc, lift)

    # Motion, from the crank to the hoof.
    hinge_b, B = hinge_point(g.B, C, P)
    hinge_d, D = triangle_point(g.D, C, B)
    hinge_f, F = hinge_point(g.F, C, P)
    hinge_e, E = hinge_point(g.E, D, F)
    G = extended_point(E, F, F, g.shank)
    A = extended_point(C, F, C, g.rocker)
    hinge_j, J = hinge_point(g.J, G, A)
    hinge_i, I = triangle_point(g.I, G, J)  # noqa: E741

    # Hoof triangle and tie rod.
    gj_g, gj_j = link_loads(g.GJ, G, J)
    ja_j, ja_a = link_loads(g.AJ, J, A)
    ig_i, ig_g = link_loads(g.GI, I, G)
    ij_i, ij_j = link_loads(g.IJ, I, J)
    toe_at_i = g.toe_is_i > 0.5
    ij_i = ij_i - where(toe_at_i, toe_force, heel_force)
    ij_j = ij_j - where(toe_at_i, heel_force, toe_force)
    ij_ig = hinge_force(hinge_i, -ig_i, ij_i)
    ij_ja = ij_i + ij_j - ij_ig
    ig_gf = ig_i + ig_g + ij_ig
    ja_gj = hinge_force(hinge_j, -gj_j, ja_j + ij_ja)
    gj_gf = gj_g + gj_j + ja_gj
    ja_fc = ja_j + ja_a - ja_gj + ij_ja

    # Shank, connecting rod, rocker and strut.
    gf_g, gf_f = link_loads(g.FG, G, F)
    fe_f, fe_e = link_loads(g.EF, F, E)
    ed_e, ed_d = link_loads(g.DE, E, D)
    fc_f, fc_c = link_loads(g.CF, F, C)
    pf_p, pf_f = link_loads(g.PF, P, F)
    ankle = gf_g + gj_gf + ig_gf
    lock = cross(G.at - F.at, ankle)
    gf_fe = gf_f + ankle
    fe_ed = hinge_force(hinge_e, -ed_e, fe_e - g.shank * ankle)
    ed_db = ed_e + ed_d + fe_ed
    knee = fe_ed - gf_fe - fe_f - fe_e
    fc_fe = hinge_force(hinge_f, fc_f + g.rocker * ja_fc, knee - pf_f)
    pf_fe = knee - fc_fe
    fc_frame = fc_f + fc_c - fc_fe + ja_fc
    pf_op = pf_p + pf_f - pf_fe

    # Upper triangle, coupler and crank.
    cd_c, cd_d = link_loads(g.CD, C, D)
    db_d, db_b = link_loads(g.BD, D, B)
    cb_c, cb_b = link_loads(g.CB, C, B)
    pb_p, pb_b = link_loads(g.PB, P, B)
    op_o, op_p = link_loads(g.OP, O, P)
    cd_db = hinge_force(hinge_d, cd_d, -ed_db - db_d)
    cd_frame = cd_c + cd_d - cd_db
    db_pb = db_d + db_b + cd_db + ed_db
    cb_pb = hinge_force(hinge_b, cb_b, -db_pb - pb_b)
    cb_frame = cb_c + cb_b - cb_pb
    pb_op = pb_p + pb_b + cb_pb + db_pb
    crank_pin = op_p + pb_op + pf_op
    op_frame = op_o + crank_pin
    driver = cross(P.at, crank_pin)
    hip = driver + cross(C.at, cb_frame + cd_frame + fc_frame)

    joints = (
        op_frame, pb_op, cb_pb, cb_frame, db_pb, cd_db, cd_frame, ed_db, fe_ed, fc_fe,
        fc_frame, pf_fe, pf_op, gf_fe, gj_gf, ja_gj, ja_fc, ig_gf, ij_ig, ij_ja,
    )  # fmt: skip
    return joints, lock, driver, hip


@inline_llvm
def react(trunk, leg, constants, reactions):  # type: ignore[no-untyped-def]
    """Keep the `Reactions` of one leg with these `LegConstants`."""
    hip, pitch_rate, pitch_acc = leg.hip, trunk.rates.pitch_rate, trunk.pitch_acceleration
    weight = vector(full_like(trunk, 0.0), trunk.settings.gravity)
    lift = trunk.acceleration + weight + pitch_acc * perpendicular(hip) - pitch_rate * pitch_rate * hip
    joints, lock, driver, by_trunk = leg_reactions(
        constants,
        vector(leg.cosine, leg.sine), leg.theta_rate, leg.theta_acceleration,
        leg.turn, leg.beta_rate,
        pitch_acc + leg.beta_by_theta * leg.theta_acceleration + leg.swing_acceleration,
        lift, force_of(leg.toe), force_of(leg.heel),
    )  # fmt: skip
    store_vectors(reactions.joints, joints)
    reactions.lock, reactions.driver, reactions.hip = lock, driver, by_trunk
