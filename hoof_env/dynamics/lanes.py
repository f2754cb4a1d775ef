"""The equations of motion of N legs on one trunk, for a tile of environments side by side.

Every function is one stage of the mechanics: a loop over the lanes of a tile, which do not know of each
other. Compiled for a tile of one lane or of many these loops become scalar or vector code from one source,
and a number has the same bits in both: only + - * / and sqrt, no fast-math, no branch that depends on a lane.
Where the lanes are the legs of one trunk (`together`) each has a copy of the trunk, and sums go over all.
Planar vectors are complex numbers, kept in two rows (`trunk_rows` as t, `limb_rows` as b).

A leg enters as functions of its crank angle theta (`leg.profile` as f): toe and heel, the first moment s and
the inertias a, b, c; ' is d/dtheta, _t and _tt are time derivatives. With the world angle beta = pitch +
side phi(theta, t) of its frame, the velocity v of O and w = theta_t, its kinetic energy is

    T = m |v|^2 / 2 + v . e^(i beta) (s' w + i s beta_t) + (a w^2 + 2 b w beta_t + c beta_t^2) / 2,

and Lagrange's equations follow (docs/engine.md). The trunk's state is the momentum, linear and angular, of
all bodies together: in flight it is kept to round-off, whatever the scheme.
"""

from __future__ import annotations

from numba import carray

from hoof_env._jit import inlined, pasted
from hoof_env._memory import address, offset
from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.lanes_ground import clear_ground, meet_ground, push_back
from hoof_env.dynamics.trunk import FIXED, FREE, RAIL, SUSPENDED
from hoof_env.dynamics.vectors import across, gather_row, put, times, vector
from hoof_env.gait.motion_law import COS, OFFSET, SIN, SPEED, clip
from hoof_env.ground.exact_math import ROUNDER, cos_sin
from hoof_env.leg import profile as f
from hoof_env.leg.kinematics import cross, dot
from hoof_env.leg.profile import find_cell, look_up, look_up_eight, look_up_four


@pasted
def evaluate(trunk, limbs, model, scratch, elapsed):  # type: ignore[no-untyped-def]
    """All forces and accelerations at the present stage, `elapsed` [s] after the step's start."""
    kind = model.kind
    if kind != FIXED:
        clear_trunk(trunk, kind)
    for i in range(limbs.shape[0]):
        look_up_functions(trunk, limbs[i], model.tables, model.cells, scratch)
        place_frame(trunk, limbs[i], elapsed)
        if kind != FIXED:
            gather_leg(trunk, limbs[i], model.together)
    if kind != FIXED:
        move_trunk(trunk, kind)
    for i in range(limbs.shape[0]):
        clear_ground(limbs[i])
        for point in range(2):
            meet_ground(trunk, limbs[i], point, model)
            push_back(trunk, limbs[i], point, model)
        feel_leg(trunk, limbs[i], elapsed)
        if kind != FIXED:
            load_trunk(trunk, limbs[i], kind, model.together)
    if kind != FIXED:
        accelerate_trunk(trunk, kind)
    for i in range(limbs.shape[0]):
        accelerate_crank(trunk, limbs[i])


@inlined
def look_up_functions(trunk, limb, table, cells, scratch):  # type: ignore[no-untyped-def]
    """The functions of the crank angle and their derivatives."""
    lanes = limb.shape[1]
    for lane in range(lanes):
        cell, limb[b.CELL + 1, lane] = find_cell(limb[b.ANGLE, lane], cells)
        row = cell - ((cell * (1.0 / cells) - 0.5 + ROUNDER) - ROUNDER) * cells  # less whole turns
        row = row if (row >= 0.0) & (row < cells) else 0.0  # what is not a number has the first row
        limb[b.CELL, lane] = limb[b.FIRST, lane] + row
    at = address(limb)
    if lanes % 8 == 0:
        for lane in range(0, lanes, 8):
            look_up_eight(
                table, offset(at, b.CELL * lanes + lane), offset(at, (b.CELL + 1) * lanes + lane),
                offset(at, b.VALUES * lanes + lane), lanes,
            )  # fmt: skip
    elif lanes == 4:
        look_up_four(
            table, offset(at, b.CELL * 4), offset(at, (b.CELL + 1) * 4), offset(at, b.VALUES * 4), 4
        )  # fmt: skip
    else:
        row = carray(scratch, 2 * f.WIDTH)
        for lane in range(lanes):
            look_up(table, int(limb[b.CELL, lane]), limb[b.CELL + 1, lane], scratch)
            for k in range(f.COS + 1):
                limb[b.VALUES + k, lane] = row[k]
                limb[b.SLOPES + k, lane] = row[f.WIDTH + k]
    for lane in range(limb.shape[1]):
        angle, value = limb[b.ANGLE, lane], limb[b.VALUES, lane]
        trunk[t.STUCK, lane] = 1.0 if (angle == angle) & (value != value) else trunk[t.STUCK, lane]


@inlined
def place_frame(trunk, limb, elapsed):  # type: ignore[no-untyped-def]
    """The leg's frame: its turn, how that changes with crank angle and time, and first moment and inertia in
    the world.

    The swing is phi = offset + A sin(theta) + B cos(theta), each parameter moving as its filter does.
    """
    half = 0.5 * elapsed
    for lane in range(limb.shape[1]):
        bend, bend_a, bend_b = limb[b.BEND + OFFSET, lane], limb[b.BEND + SIN, lane], limb[b.BEND + COS, lane]
        rate = limb[b.RATE + OFFSET, lane] + elapsed * bend
        rate_a = limb[b.RATE + SIN, lane] + elapsed * bend_a
        rate_b = limb[b.RATE + COS, lane] + elapsed * bend_b
        offset = limb[b.VALUE + OFFSET, lane] + elapsed * (limb[b.RATE + OFFSET, lane] + half * bend)
        part_a = limb[b.VALUE + SIN, lane] + elapsed * (limb[b.RATE + SIN, lane] + half * bend_a)
        part_b = limb[b.VALUE + COS, lane] + elapsed * (limb[b.RATE + COS, lane] + half * bend_b)
        sine, cosine = limb[b.VALUES + f.SIN, lane], limb[b.VALUES + f.COS, lane]
        swing = part_a * sine + part_b * cosine
        w, side = limb[b.SPIN, lane], limb[b.SIDE, lane]
        k = side * (part_a * cosine - part_b * sine)
        limb[b.PHI, lane] = offset + swing
        limb[b.K, lane] = k
        limb[b.SWAY, lane] = side * (rate + rate_a * sine + rate_b * cosine)
        limb[b.SWAY_RATE, lane] = side * (
            bend + bend_a * sine + bend_b * cosine + (2.0 * (rate_a * cosine - rate_b * sine) - swing * w) * w
        )
        cos_beta, sin_beta = cos_sin(trunk[t.NOW_PITCH, lane] + side * (offset + swing))
        turn = complex(cos_beta, sin_beta)
        s, ds = turn * vector(limb, b.VALUES + f.S_X, lane), turn * vector(limb, b.VALUES + f.DS_X, lane)
        put(limb, b.TURN, lane, turn)
        put(limb, b.HIP, lane, vector(trunk, t.TURN, lane) * vector(limb, b.HIP_ON_TRUNK, lane))
        put(limb, b.S, lane, s)
        put(limb, b.DS, lane, ds)
        put(limb, b.U, lane, ds + times(k, across(s)))
        frame = limb[b.VALUES + f.C, lane] + limb[b.ROTOR_C, lane]
        coupling = limb[b.VALUES + f.B, lane] + limb[b.ROTOR_B, lane]
        limb[b.COUPLING, lane] = coupling + k * frame
        limb[b.INERTIA, lane] = (
            limb[b.VALUES + f.A, lane] + limb[b.ROTOR_A, lane] + k * (2.0 * coupling + k * frame)
        )


@inlined
def keep_still(trunk):  # type: ignore[no-untyped-def]
    """What never changes in a trunk that cannot move, or not pitch."""
    for lane in range(trunk.shape[1]):
        for k in range(t.MOVING):
            trunk[t.FLOW + k, lane] = 0.0
        put(trunk, t.PLACE, lane, vector(trunk, t.CENTRE, lane))
        put(trunk, t.VELOCITY, lane, 0j)
        put(trunk, t.ACC, lane, 0j)
        trunk[t.PITCH_ACC, lane] = 0.0
        trunk[t.STUCK, lane] = 0.0
        put(trunk, t.TURN, lane, complex(1.0, 0.0))


@inlined
def clear_trunk(trunk, kind):  # type: ignore[no-untyped-def]
    """Before the legs are gathered."""
    for lane in range(trunk.shape[1]):
        if kind == FREE:
            cosine, sine = cos_sin(trunk[t.NOW_PITCH, lane])
            put(trunk, t.TURN, lane, complex(cosine, sine))
        put(trunk, t.MOMENT, lane, 0j)
        put(trunk, t.DRIFT, lane, 0j)
        trunk[t.ROUND, lane] = trunk[t.PITCH_INERTIA, lane]
        trunk[t.SWIRL, lane] = 0.0


@inlined
def gather_leg(trunk, limb, together):  # type: ignore[no-untyped-def]
    """Add a leg to the first moment, momentum, inertia and spin of all about the trunk's centre of mass."""
    for lane in range(limb.shape[1]):
        hip, s, u = vector(limb, b.HIP, lane), vector(limb, b.S, lane), vector(limb, b.U, lane)
        w, sway = limb[b.SPIN, lane], limb[b.SWAY, lane]
        frame = limb[b.VALUES + f.C, lane] + limb[b.ROTOR_C, lane]
        drift = times(w, u) + times(sway, across(s))
        moment = times(limb[b.MASS, lane], hip)
        put(limb, b.PART, lane, moment + s)
        put(limb, b.PART + 2, lane, drift)
        limb[b.PART + 4, lane] = dot(hip, moment + times(2.0, s)) + frame
        limb[b.PART + 5, lane] = cross(hip, drift) + limb[b.COUPLING, lane] * w + frame * sway
    gather_row(trunk, t.MOMENT, limb, b.PART, 1.0, together)
    gather_row(trunk, t.MOMENT + 1, limb, b.PART + 1, 1.0, together)
    gather_row(trunk, t.DRIFT, limb, b.PART + 2, 1.0, together)
    gather_row(trunk, t.DRIFT + 1, limb, b.PART + 3, 1.0, together)
    gather_row(trunk, t.ROUND, limb, b.PART + 4, 1.0, together)
    gather_row(trunk, t.SWIRL, limb, b.PART + 5, 1.0, together)


@inlined
def move_trunk(trunk, kind):  # type: ignore[no-untyped-def]
    """Place and velocity of the trunk from centre of mass and momentum of all; what acts on it but its legs.

    On a rail the place along y is given and the velocity along y 0.
    """
    for lane in range(trunk.shape[1]):
        centre, moment = vector(trunk, t.NOW_CENTRE, lane), vector(trunk, t.MOMENT, lane)
        drift, per_mass = vector(trunk, t.DRIFT, lane), trunk[t.PER_MASS, lane]
        place = centre - times(per_mass, moment)
        velocity = times(per_mass, vector(trunk, t.NOW_MOMENTUM, lane) - drift)
        rate = 0.0
        if kind == RAIL:
            place, velocity = complex(place.real, centre.imag), complex(velocity.real, 0.0)
        if kind == FREE:
            spin = trunk[t.NOW_SPIN, lane] - trunk[t.SWIRL, lane] + cross(moment, drift) * per_mass
            rate = spin / (trunk[t.ROUND, lane] - dot(moment, moment) * per_mass)
            velocity -= times(rate * per_mass, across(moment))
        put(trunk, t.PLACE, lane, place)
        put(trunk, t.VELOCITY, lane, velocity)
        trunk[t.PITCH_RATE, lane] = rate
        put(trunk, t.CENTRE_FLOW, lane, times(per_mass, vector(trunk, t.NOW_MOMENTUM, lane)))
        force = complex(
            -trunk[t.DRAG, lane] * velocity.real,
            trunk[t.SUPPORT, lane]
            - trunk[t.TOTAL_MASS, lane] * trunk[t.GRAVITY, lane]
            - trunk[t.SPRING, lane] * (place.imag - trunk[t.HEIGHT, lane])
            - trunk[t.DAMPER, lane] * velocity.imag,
        )
        put(trunk, t.FORCE, lane, force)
        trunk[t.TWIST, lane] = -force.real * (place.imag - centre.imag)  # the drag acts on the trunk
        put(trunk, t.LOAD, lane, 0j)
        trunk[t.LOAD_TURN, lane] = 0.0
        trunk[t.M_XX, lane] = trunk[t.TOTAL_MASS, lane]
        trunk[t.M_YY, lane] = trunk[t.TOTAL_MASS, lane]
        trunk[t.M_XY, lane] = 0.0
        trunk[t.M_XP, lane] = -moment.imag
        trunk[t.M_YP, lane] = moment.real
        trunk[t.M_PP, lane] = trunk[t.ROUND, lane]


@inlined
def feel_leg(trunk, limb, elapsed):  # type: ignore[no-untyped-def]
    """A crank's equation of motion: INERTIA theta_tt + U . a + LEVER pitch_tt = torque + ground - rest.

    a is the trunk's acceleration. Here a motor's crank is solved for theta_tt as if the trunk kept still; a
    prescribed one's is given.
    """
    for lane in range(limb.shape[1]):
        w, frame_rate, k = limb[b.SPIN, lane], limb[b.FRAME_RATE, lane], limb[b.K, lane]
        s, ds, hip = vector(limb, b.S, lane), vector(limb, b.DS, lane), vector(limb, b.HIP, lane)
        frame = limb[b.VALUES + f.C, lane] + limb[b.ROTOR_C, lane]
        coupling, sway_rate = limb[b.COUPLING, lane], limb[b.SWAY_RATE, lane]
        pitch_rate, dc = trunk[t.PITCH_RATE, lane], limb[b.SLOPES + f.C, lane]
        da, db = limb[b.SLOPES + f.A, lane], limb[b.SLOPES + f.B, lane]
        weight = complex(0.0, trunk[t.GRAVITY, lane]) - times(pitch_rate * pitch_rate, hip)  # a + g of O
        rest_theta = (
            (coupling - k * frame) * sway_rate
            + 0.5 * (da * (w * w) - dc * (frame_rate * frame_rate))
            + dot(weight, ds)
        )
        rest_beta = frame * sway_rate + (db * w + dc * frame_rate) * w + dot(weight, across(s))
        limb[b.REST_THETA, lane], limb[b.REST_BETA, lane] = rest_theta, rest_beta
        limb[b.LEVER, lane] = coupling + cross(hip, vector(limb, b.U, lane))
        value, rate = limb[b.VALUE + SPEED, lane], limb[b.RATE + SPEED, lane]
        bend = limb[b.BEND + SPEED, lane]
        wanted = value + elapsed * (rate + 0.5 * elapsed * bend)
        torque = clip(limb[b.GAIN, lane] * (wanted - w), limb[b.LIMIT, lane])
        softness = 1.0 / limb[b.INERTIA, lane]
        is_motor = limb[b.MOTOR, lane] > 0.0
        free = softness * (
            torque + limb[b.Q_THETA, lane] - rest_theta + k * (limb[b.Q_BETA, lane] - rest_beta)
        )
        limb[b.CRANK_TORQUE, lane] = torque
        limb[b.SOFTNESS, lane] = softness if is_motor else 0.0
        limb[b.SPIN_RATE_FREE, lane] = free if is_motor else rate + elapsed * bend


@inlined
def load_trunk(trunk, limb, kind, together):  # type: ignore[no-untyped-def]
    """A leg's part in the trunk's equations, its crank eliminated, and in the outer force and moment."""
    for lane in range(limb.shape[1]):
        w, frame_rate, u = limb[b.SPIN, lane], limb[b.FRAME_RATE, lane], vector(limb, b.U, lane)
        s, ds, hip = vector(limb, b.S, lane), vector(limb, b.DS, lane), vector(limb, b.HIP, lane)
        push, mass, lever = vector(limb, b.PUSH, lane), limb[b.MASS, lane], limb[b.LEVER, lane]
        free, softness = limb[b.SPIN_RATE_FREE, lane], limb[b.SOFTNESS, lane]
        slope = vector(limb, b.TURN, lane) * vector(limb, b.SLOPES + f.DS_X, lane)
        throw = (  # what the first moment does at rest of all accelerations
            times(limb[b.SWAY_RATE, lane], across(s))
            + times(w * w, slope)
            + times(frame_rate, times(2.0 * w, across(ds)) - times(frame_rate, s))
        )
        sling = times(trunk[t.PITCH_RATE, lane] * trunk[t.PITCH_RATE, lane], hip)  # less O's acceleration
        put(limb, b.PART, lane, times(mass, sling) - throw - times(free, u))
        limb[b.PART + 2, lane] = (
            (limb[b.Q_BETA, lane] - limb[b.REST_BETA, lane])
            + cross(hip, push - times(mass, complex(0.0, trunk[t.GRAVITY, lane]) - sling) - throw)
            - lever * free
        )
        soft_u = times(softness, u)
        limb[b.PART + 3, lane] = soft_u.real * u.real
        limb[b.PART + 4, lane] = soft_u.real * u.imag
        limb[b.PART + 5, lane] = soft_u.imag * u.imag
        limb[b.PART + 6, lane] = soft_u.real * lever
        limb[b.PART + 7, lane] = soft_u.imag * lever
        limb[b.PART + 8, lane] = softness * lever * lever
        off = hip + vector(trunk, t.PLACE, lane) - vector(trunk, t.NOW_CENTRE, lane)
        limb[b.PART + 9, lane] = limb[b.Q_BETA, lane] + cross(off, push)
    gather_row(trunk, t.LOAD, limb, b.PART, 1.0, together)
    gather_row(trunk, t.LOAD + 1, limb, b.PART + 1, 1.0, together)
    gather_row(trunk, t.M_XX, limb, b.PART + 3, -1.0, together)
    gather_row(trunk, t.M_XY, limb, b.PART + 4, -1.0, together)
    gather_row(trunk, t.M_YY, limb, b.PART + 5, -1.0, together)
    gather_row(trunk, t.FORCE, limb, b.PUSH, 1.0, together)
    gather_row(trunk, t.FORCE + 1, limb, b.PUSH + 1, 1.0, together)
    if kind == FREE:
        gather_row(trunk, t.LOAD_TURN, limb, b.PART + 2, 1.0, together)
        gather_row(trunk, t.M_XP, limb, b.PART + 6, -1.0, together)
        gather_row(trunk, t.M_YP, limb, b.PART + 7, -1.0, together)
        gather_row(trunk, t.M_PP, limb, b.PART + 8, -1.0, together)
        gather_row(trunk, t.TWIST, limb, b.PART + 9, 1.0, together)


@inlined
def accelerate_trunk(trunk, kind):  # type: ignore[no-untyped-def]
    """Solve the trunk's equations for its accelerations, by Cramer's rule."""
    for lane in range(trunk.shape[1]):
        acc, pitch_acc = 0j, 0.0
        load = vector(trunk, t.FORCE, lane) + vector(trunk, t.LOAD, lane)
        xx, xy, yy = trunk[t.M_XX, lane], trunk[t.M_XY, lane], trunk[t.M_YY, lane]
        if kind == RAIL:
            acc = complex(load.real / xx, 0.0)
            trunk[t.FORCE + 1, lane] = 0.0  # the rail takes it
        elif kind == SUSPENDED:
            per = 1.0 / (xx * yy - xy * xy)
            acc = complex((yy * load.real - xy * load.imag) * per, (xx * load.imag - xy * load.real) * per)
        else:
            xp, yp, pp = trunk[t.M_XP, lane], trunk[t.M_YP, lane], trunk[t.M_PP, lane]
            turning = trunk[t.LOAD_TURN, lane]
            c_xx, c_xy, c_xp = yy * pp - yp * yp, xp * yp - xy * pp, xy * yp - yy * xp
            c_yy, c_yp, c_pp = xx * pp - xp * xp, xy * xp - xx * yp, xx * yy - xy * xy
            per = 1.0 / (xx * c_xx + xy * c_xy + xp * c_xp)
            acc = complex(
                (c_xx * load.real + c_xy * load.imag + c_xp * turning) * per,
                (c_xy * load.real + c_yy * load.imag + c_yp * turning) * per,
            )
            pitch_acc = (c_xp * load.real + c_yp * load.imag + c_pp * turning) * per
        if kind != FREE:
            trunk[t.TWIST, lane] = 0.0
        put(trunk, t.ACC, lane, acc)
        trunk[t.PITCH_ACC, lane] = pitch_acc


@inlined
def accelerate_crank(trunk, limb):  # type: ignore[no-untyped-def]
    """The crank's acceleration: a motor's gives way to the trunk's."""
    for lane in range(limb.shape[1]):
        pull = (
            dot(vector(limb, b.U, lane), vector(trunk, t.ACC, lane))
            + limb[b.LEVER, lane] * trunk[t.PITCH_ACC, lane]
        )
        limb[b.SPIN_RATE, lane] = limb[b.SPIN_RATE_FREE, lane] - limb[b.SOFTNESS, lane] * pull
