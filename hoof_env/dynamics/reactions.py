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

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.vectors import put, vector
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.linkage import BODY_LENGTHS, CONSTRUCTION, JOINTS, Dyad
from hoof_env.simd import choose, cross, dot, level, plane, root
from hoof_env.simd.compile import inlined

LOCK, DRIVER, HIP = 2 * len(JOINTS), 2 * len(JOINTS) + 1, 2 * len(JOINTS) + 2
OUTPUTS = HIP + 1
"""Rows of what is kept: x and y of each joint's force [N] as in `linkage.JOINTS`; then three moments
[N m]: on body 10 by body 7, on the crank by the leg's frame, on the leg's frame by the trunk (about O)."""

_STEPS = {step.point: step for step in CONSTRUCTION}
_HINGES, _TRIANGLES = ("B", "F", "E", "J"), ("D", "I")  # dyads with a varying and with a constant span
_LAYOUT = {"crank": 1, "pivot": 2, "travel": 1, "toe": 1, "shank": 1, "rocker": 1}
_LAYOUT |= dict.fromkeys(_HINGES + _TRIANGLES, 3) | dict.fromkeys(BODY_LENGTHS, 2)
_ROWS = dict(zip(_LAYOUT, np.cumsum([0, *_LAYOUT.values()]).tolist(), strict=False))
CONSTANTS = sum(_LAYOUT.values())
"""Rows of `leg_constants`."""

_CRANK, _PIVOT, _TRAVEL, _TOE, _SHANK, _ROCKER, _B, _F, _E, _J, _D, _I = list(_ROWS.values())[:12]
_OP, _PB, _CB, _BD, _CD, _DE, _EF, _CF, _PF, _FG, _GJ, _AJ, _GI, _IJ = list(_ROWS.values())[12:]


def leg_constants(geometry: Geometry) -> NDArray[np.float64]:
    """What the kernels need of a leg, shape (CONSTANTS, 1)."""
    lengths = geometry.lengths
    values = [lengths["OP"], geometry.travel * geometry.pivot[0], geometry.pivot[1], float(geometry.travel)]
    values += [
        1.0 if geometry.toe == "I" else 0.0,
        lengths["FG"] / lengths["EF"],
        lengths["CA"] / lengths["CF"],
    ]
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
    return np.array(values)[:, None]


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


@inlined
def turning(p, rate, acc, lift):  # type: ignore[no-untyped-def]
    """A point at p of a body that turns about O."""
    return Point(p, plane(-rate * p.imag, rate * p.real), plane(-rate * rate, acc) * p + lift)


@inlined
def swing(hinge, first, second):  # type: ignore[no-untyped-def]
    """Motion of a hinge from that of the far ends of its links, by the links' rates and accelerations."""
    one, two, inverse = hinge
    slip = second.v - first.v
    rate, rate_two = dot(two, slip) * inverse, dot(one, slip) * inverse
    rate2 = rate * rate
    acc = inverse * (
        dot(two, second.a - first.a) + rate2 * dot(one, two) - rate_two * rate_two * dot(two, two)
    )
    v = plane(-rate * one.imag, rate * one.real)
    return Point(first.at + one, first.v + v, first.a + plane(-rate2, acc) * one)


@inlined
def hinge_point(g, row, first, second):  # type: ignore[no-untyped-def]
    """The hinge of two links of given lengths whose far ends are `first` and `second`."""
    one2, half, side = g[row], g[row + 1], g[row + 2]
    span = second.at - first.at
    d2 = dot(span, span)
    k = 0.5 * d2 + half
    area = side * root(one2 * d2 - k * k)  # cross(one, two)
    inverse = 1.0 / (d2 * area)
    over_d2 = area * inverse
    one = span * plane(k * over_d2, area * over_d2)
    hinge = Hinge(one, one - span, d2 * inverse)
    return hinge, swing(hinge, first, second)


@inlined
def triangle_point(g, row, first, second):  # type: ignore[no-untyped-def]
    """The same where `first` and `second` are the ends of a third link."""
    place = vector(g, row)
    span = second.at - first.at
    one = span * place
    hinge = Hinge(one, one - span, g[row + 2])
    return hinge, Point(
        first.at + one, first.v + (second.v - first.v) * place, first.a + (second.a - first.a) * place
    )


@inlined
def beyond(first, second, origin, ratio):  # type: ignore[no-untyped-def]
    """The point at origin + ratio (second - first) of a link."""
    return Point(
        origin.at + ratio * (second.at - first.at),
        origin.v + ratio * (second.v - first.v),
        origin.a + ratio * (second.a - first.a),
    )


@inlined
def link_loads(g, row, tail, head):  # type: ignore[no-untyped-def]
    """Forces at tail and head that move a link as it moves, against its weight."""
    near, far = g[row], g[row + 1]
    return near * tail.a + far * head.a, near * head.a + far * tail.a


@inlined
def hinge_force(hinge, by_one, by_two):  # type: ignore[no-untyped-def]
    """The force that turns link one about its far end like `by_one`, and link two like `by_two`."""
    one, two, inverse = hinge
    return inverse * cross(one, by_one) * two - inverse * cross(two, by_two) * one


# -- one leg -----------------------------------------------------------------------------------


@inlined
def leg_reactions(  # type: ignore[no-untyped-def]
    g, crank_turn, theta_rate, theta_acc, frame_turn, beta_rate, beta_acc, lift, toe_force, heel_force
):
    """Reactions of one leg.

    Args:
        g: rows of `leg_constants`.
        crank_turn, frame_turn: exp(i theta), exp(i beta).
        theta_rate, theta_acc, beta_rate, beta_acc: [rad/s, rad/s^2].
        lift: acceleration of O plus g upward [m/s^2].
        toe_force, heel_force: of the ground on the leg [N].

    Returns:
        The forces on body `i` of each joint of `linkage.JOINTS` [N], and the moments on body 10 by body 7,
        on the crank by the leg's frame and on the leg's frame by the trunk [N m]. Each joint's second body
        feels the opposite.
    """
    # The crank turns clockwise before the mirror.
    travel = g[_TRAVEL]
    arm = g[_CRANK] * plane(travel * crank_turn.real, -crank_turn.imag)
    still = plane(level(g, 0.0), 0.0)
    O = Point(still, still, lift)  # noqa: E741
    C = turning(vector(g, _PIVOT) * frame_turn, beta_rate, beta_acc, lift)
    P = turning(arm * frame_turn, beta_rate - travel * theta_rate, beta_acc - travel * theta_acc, lift)

    # Motion, from the crank to the hoof.
    hinge_b, B = hinge_point(g, _B, C, P)
    hinge_d, D = triangle_point(g, _D, C, B)
    hinge_f, F = hinge_point(g, _F, C, P)
    hinge_e, E = hinge_point(g, _E, D, F)
    G = beyond(E, F, F, g[_SHANK])
    A = beyond(C, F, C, g[_ROCKER])
    hinge_j, J = hinge_point(g, _J, G, A)
    hinge_i, I = triangle_point(g, _I, G, J)  # noqa: E741

    # Hoof triangle and tie rod.
    gj_g, gj_j = link_loads(g, _GJ, G, J)
    ja_j, ja_a = link_loads(g, _AJ, J, A)
    ig_i, ig_g = link_loads(g, _GI, I, G)
    ij_i, ij_j = link_loads(g, _IJ, I, J)
    toe_at_i = g[_TOE] > 0.5
    ij_i = ij_i - choose(toe_at_i, toe_force, heel_force)
    ij_j = ij_j - choose(toe_at_i, heel_force, toe_force)
    ij_ig = hinge_force(hinge_i, -ig_i, ij_i)
    ij_ja = ij_i + ij_j - ij_ig
    ig_gf = ig_i + ig_g + ij_ig
    ja_gj = hinge_force(hinge_j, -gj_j, ja_j + ij_ja)
    gj_gf = gj_g + gj_j + ja_gj
    ja_fc = ja_j + ja_a - ja_gj + ij_ja

    # Shank, connecting rod, rocker and strut.
    gf_g, gf_f = link_loads(g, _FG, G, F)
    fe_f, fe_e = link_loads(g, _EF, F, E)
    ed_e, ed_d = link_loads(g, _DE, E, D)
    fc_f, fc_c = link_loads(g, _CF, F, C)
    pf_p, pf_f = link_loads(g, _PF, P, F)
    ankle = gf_g + gj_gf + ig_gf
    lock = cross(G.at - F.at, ankle)
    gf_fe = gf_f + ankle
    fe_ed = hinge_force(hinge_e, -ed_e, fe_e - g[_SHANK] * ankle)
    ed_db = ed_e + ed_d + fe_ed
    knee = fe_ed - gf_fe - fe_f - fe_e
    fc_fe = hinge_force(hinge_f, fc_f + g[_ROCKER] * ja_fc, knee - pf_f)
    pf_fe = knee - fc_fe
    fc_frame = fc_f + fc_c - fc_fe + ja_fc
    pf_op = pf_p + pf_f - pf_fe

    # Upper triangle, coupler and crank.
    cd_c, cd_d = link_loads(g, _CD, C, D)
    db_d, db_b = link_loads(g, _BD, D, B)
    cb_c, cb_b = link_loads(g, _CB, C, B)
    pb_p, pb_b = link_loads(g, _PB, P, B)
    op_o, op_p = link_loads(g, _OP, O, P)
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


@inlined
def keep_reactions(out, joints, lock, driver, hip):  # type: ignore[no-untyped-def]
    """Write what `leg_reactions` returns into the first OUTPUTS rows of `out`."""
    put(out, 0, joints[0])
    put(out, 2, joints[1])
    put(out, 4, joints[2])
    put(out, 6, joints[3])
    put(out, 8, joints[4])
    put(out, 10, joints[5])
    put(out, 12, joints[6])
    put(out, 14, joints[7])
    put(out, 16, joints[8])
    put(out, 18, joints[9])
    put(out, 20, joints[10])
    put(out, 22, joints[11])
    put(out, 24, joints[12])
    put(out, 26, joints[13])
    put(out, 28, joints[14])
    put(out, 30, joints[15])
    put(out, 32, joints[16])
    put(out, 34, joints[17])
    put(out, 36, joints[18])
    put(out, 38, joints[19])
    out[LOCK], out[DRIVER], out[HIP] = lock, driver, hip
