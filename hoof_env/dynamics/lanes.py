"""The equations of motion of N legs on one trunk, for one environment or several side by side.

Every function is one stage of the mechanics on rows of memory (`trunk_rows` as t, `limb_rows` as b). A row
holds `Lanes`, one for each environment, which do not know of each other; compiled for one lane or eight, a
number has the same bits: only + - * / and sqrt, no fast-math, no branch on a lane that changes a bit. Where
the lanes are the legs of one trunk (`together`) each has a copy of the trunk, and sums go over all.

A leg enters as functions of its crank angle theta (`leg.profile` as f): toe and heel, the first moment s and
the inertias a, b, c; ' is d/dtheta, _t and _tt are time derivatives. With the world angle beta = pitch +
side phi(theta, t) of its frame, the velocity v of O and w = theta_t, its kinetic energy is

    T = m |v|^2 / 2 + v . e^(i beta) (s' w + i s beta_t) + (a w^2 + 2 b w beta_t + c beta_t^2) / 2,

and Lagrange's equations follow (docs/engine.md). The trunk's state is the momentum, linear and angular, of
all bodies together: in flight it is kept to round-off, whatever the scheme.
"""

from __future__ import annotations

from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.lanes_ground import meet_ground
from hoof_env.dynamics.trunk import FIXED, FREE, RAIL, SUSPENDED
from hoof_env.dynamics.vectors import add, add_vector, put, vector
from hoof_env.gait.motion_law import COS, OFFSET, SIN, SPEED
from hoof_env.leg import profile as f
from hoof_env.leg.profile import look_up
from hoof_env.simd import across, below, choose, cross, dot, level, plane, size
from hoof_env.simd.compile import inlined, pasted
from hoof_env.simd.math import clip, cos_sin


@pasted
def evaluate(trunk, limbs, legs, model, elapsed):  # type: ignore[no-untyped-def]
    """All forces and accelerations at the present stage, `elapsed` [s] after the step's start."""
    if model.kind != FIXED:
        clear_trunk(trunk, model.kind)
    for i in range(legs):
        limb = below(limbs, i * b.ROWS)
        look_up_functions(trunk, limb, model)
        place_frame(trunk, limb, elapsed)
        if model.kind != FIXED:
            gather_leg(trunk, limb, model.kind, model.together)
    if model.kind != FIXED:
        move_trunk(trunk, model.kind)
    for i in range(legs):
        limb = below(limbs, i * b.ROWS)
        meet_ground(trunk, limb, model)
        feel_leg(trunk, limb, elapsed)
        if model.kind != FIXED:
            load_trunk(trunk, limb, model.kind, model.together)
    if model.kind != FIXED:
        accelerate_trunk(trunk, model.kind)
    for i in range(legs):
        accelerate_crank(trunk, below(limbs, i * b.ROWS))


@inlined
def look_up_functions(trunk, limb, model):  # type: ignore[no-untyped-def]
    """The functions of the crank angle and their derivatives."""
    angle = limb[b.ANGLE]
    look_up(below(limb, b.VALUES), model.tables, limb[b.FIRST], model.cells, angle)
    value = limb[b.VALUES]
    trunk[t.STUCK] = choose((size(angle) <= t.FARTHEST) & (value != value), 1.0, trunk[t.STUCK])


@inlined
def place_frame(trunk, limb, elapsed):  # type: ignore[no-untyped-def]
    """The leg's frame: its turn, how that changes with crank angle and time, and first moment and inertia in
    the world.

    The swing is phi = offset + A sin(theta) + B cos(theta), each parameter moving as its filter does.
    """
    sine, cosine, w = limb[b.VALUES + f.SIN], limb[b.VALUES + f.COS], limb[b.SPIN]
    offset, rate, bend = filtered(limb, OFFSET, elapsed)
    part_a, rate_a, bend_a = filtered(limb, SIN, elapsed)
    part_b, rate_b, bend_b = filtered(limb, COS, elapsed)
    side, swing = limb[b.SIDE], part_a * sine + part_b * cosine
    k = side * (part_a * cosine - part_b * sine)
    bent = bend + bend_a * sine + bend_b * cosine + (2.0 * (rate_a * cosine - rate_b * sine) - swing * w) * w
    limb[b.PHI], limb[b.K] = offset + swing, k
    limb[b.SWAY], limb[b.SWAY_RATE] = side * (rate + rate_a * sine + rate_b * cosine), side * bent

    cos_beta, sin_beta = cos_sin(trunk[t.NOW_PITCH] + side * (offset + swing))
    turn = plane(cos_beta, sin_beta)
    s, ds = turn * vector(limb, b.VALUES + f.S_X), turn * vector(limb, b.VALUES + f.DS_X)
    put(limb, b.TURN, turn)
    put(limb, b.S, s)
    put(limb, b.DS, ds)
    put(limb, b.U, ds + k * across(s))
    frame = limb[b.VALUES + f.C] + limb[b.ROTOR_C]
    coupling = limb[b.VALUES + f.B] + limb[b.ROTOR_B]
    limb[b.FRAME], limb[b.COUPLING] = frame, coupling + k * frame
    limb[b.INERTIA] = limb[b.VALUES + f.A] + limb[b.ROTOR_A] + k * (2.0 * coupling + k * frame)


@inlined
def filtered(limb, k, elapsed):  # type: ignore[no-untyped-def]
    """Parameter k of the gait, its rate and acceleration, `elapsed` [s] after the step's start."""
    value, rate, bend = limb[b.VALUE + k], limb[b.RATE + k], limb[b.BEND + k]
    return value + elapsed * (rate + 0.5 * elapsed * bend), rate + elapsed * bend, bend


@inlined
def keep_still(trunk):  # type: ignore[no-untyped-def]
    """What never changes in a trunk that cannot move, or not pitch."""
    for k in range(t.MOVING):
        trunk[t.NOW + k] = trunk[t.FIRST + k]
        trunk[t.FLOW + k] = 0.0
    nothing = plane(level(trunk, 0.0), 0.0)
    put(trunk, t.PLACE, vector(trunk, t.CENTRE))
    put(trunk, t.VELOCITY, nothing)
    put(trunk, t.ACC, nothing)
    trunk[t.PITCH_ACC], trunk[t.STUCK], trunk[t.FELL] = 0.0, 0.0, 0.0
    put(trunk, t.TURN, plane(level(trunk, 1.0), 0.0))


@inlined
def clear_trunk(trunk, kind):  # type: ignore[no-untyped-def]
    """Before the legs are gathered."""
    if kind == FREE:
        cosine, sine = cos_sin(trunk[t.NOW_PITCH])
        put(trunk, t.TURN, plane(cosine, sine))
    nothing = plane(level(trunk, 0.0), 0.0)
    put(trunk, t.MOMENT, nothing)
    put(trunk, t.DRIFT, nothing)
    trunk[t.ROUND], trunk[t.SWIRL] = trunk[t.PITCH_INERTIA], 0.0


@inlined
def gather_leg(trunk, limb, kind, together):  # type: ignore[no-untyped-def]
    """Add a leg to the first moment, momentum, inertia and spin of all about the trunk's centre of mass."""
    s, w, sway = vector(limb, b.S), limb[b.SPIN], limb[b.SWAY]
    drift = w * vector(limb, b.U) + sway * across(s)
    if kind == FREE:
        put(limb, b.HIP, vector(trunk, t.TURN) * vector(limb, b.HIP_ON_TRUNK))
        hip, frame = vector(limb, b.HIP), limb[b.FRAME]
        add(trunk, t.ROUND, dot(hip, limb[b.MASS] * hip + 2.0 * s) + frame, together)
        add(trunk, t.SWIRL, cross(hip, drift) + limb[b.COUPLING] * w + frame * sway, together)
    add_vector(trunk, t.MOMENT, limb[b.MASS] * vector(limb, b.HIP) + s, together)
    add_vector(trunk, t.DRIFT, drift, together)


@inlined
def move_trunk(trunk, kind):  # type: ignore[no-untyped-def]
    """Place and velocity of the trunk from centre of mass and momentum of all; what acts on it but its legs.

    On a rail the place along y is given and the velocity along y 0.
    """
    centre, moment, momentum = (
        vector(trunk, t.NOW_CENTRE),
        vector(trunk, t.MOMENT),
        vector(trunk, t.NOW_MOMENTUM),
    )
    drift, per_mass = vector(trunk, t.DRIFT), trunk[t.PER_MASS]
    place = centre - per_mass * moment
    velocity = per_mass * (momentum - drift)
    rate = level(trunk, 0.0)
    if kind == RAIL:
        place, velocity = plane(place.real, centre.imag), plane(velocity.real, 0.0)
    if kind == FREE:
        spin = trunk[t.NOW_SPIN] - trunk[t.SWIRL] + cross(moment, drift) * per_mass
        rate = spin / (trunk[t.ROUND] - dot(moment, moment) * per_mass)
        velocity = velocity - rate * per_mass * across(moment)
    put(trunk, t.PLACE, place)
    put(trunk, t.VELOCITY, velocity)
    trunk[t.PITCH_RATE] = rate
    put(trunk, t.CENTRE_FLOW, per_mass * momentum)
    drag, total = -trunk[t.DRAG] * velocity.real, trunk[t.TOTAL_MASS]
    lift = (
        trunk[t.SUPPORT]
        - total * trunk[t.GRAVITY]
        - trunk[t.SPRING] * (place.imag - trunk[t.HEIGHT])
        - trunk[t.DAMPER] * velocity.imag
    )
    put(trunk, t.FORCE, plane(drag, lift))
    trunk[t.TWIST] = -drag * (place.imag - centre.imag)  # the drag acts on the trunk
    put(trunk, t.LOAD, plane(level(trunk, 0.0), 0.0))
    trunk[t.LOAD_TURN] = 0.0
    trunk[t.M_XX], trunk[t.M_XY], trunk[t.M_YY] = total, 0.0, total
    trunk[t.M_XP], trunk[t.M_YP], trunk[t.M_PP] = -moment.imag, moment.real, trunk[t.ROUND]
    trunk[t.FELL] = choose(place.imag < trunk[t.BOTTOM], 1.0, trunk[t.FELL])


@pasted
def settle(trunk, limbs, legs, model, starts):  # type: ignore[no-untyped-def]
    """Centre of mass, momentum and spin of all where an environment starts, from what stands in their place
    then: place and velocity of the trunk and rate of its pitch. The inverse of `move_trunk`."""
    clear_trunk(trunk, model.kind)
    for i in range(legs):
        limb = below(limbs, i * b.ROWS)
        look_up_functions(trunk, limb, model)
        place_frame(trunk, limb, 0.0)
        gather_leg(trunk, limb, model.kind, model.together)
    place, velocity, rate = vector(trunk, t.CENTRE), vector(trunk, t.MOMENTUM), trunk[t.SPIN]
    moment, drift, per_mass = vector(trunk, t.MOMENT), vector(trunk, t.DRIFT), trunk[t.PER_MASS]
    centre = place + per_mass * moment
    momentum = trunk[t.TOTAL_MASS] * velocity + drift
    spin = level(trunk, 0.0)
    if model.kind == RAIL:
        centre, momentum = plane(centre.real, place.imag), plane(momentum.real, 0.0)
    if model.kind == FREE:
        momentum = momentum + rate * across(moment)
        about = trunk[t.ROUND] - dot(moment, moment) * per_mass
        spin = rate * about + trunk[t.SWIRL] - cross(moment, drift) * per_mass
    put(trunk, t.CENTRE, choose(starts, centre, place))
    put(trunk, t.MOMENTUM, choose(starts, momentum, velocity))
    trunk[t.SPIN] = choose(starts, spin, rate)


@inlined
def feel_leg(trunk, limb, elapsed):  # type: ignore[no-untyped-def]
    """A crank's equation of motion: INERTIA theta_tt + U . a + LEVER pitch_tt = torque + ground - rest.

    a is the trunk's acceleration. Here a motor's crank is solved for theta_tt as if the trunk kept still; a
    prescribed one's is given.
    """
    w, frame_rate, k = limb[b.SPIN], limb[b.FRAME_RATE], limb[b.K]
    hip, frame, coupling = vector(limb, b.HIP), limb[b.FRAME], limb[b.COUPLING]
    pitch_rate, sway_rate, dc = trunk[t.PITCH_RATE], limb[b.SWAY_RATE], limb[b.VALUES + f.DC]
    da, db = limb[b.SLOPES + f.A], limb[b.SLOPES + f.B]
    weight = plane(level(trunk, 0.0), trunk[t.GRAVITY]) - pitch_rate * pitch_rate * hip  # a + g of O
    rest_theta = (
        (coupling - k * frame) * sway_rate
        + 0.5 * (da * (w * w) - dc * (frame_rate * frame_rate))
        + dot(weight, vector(limb, b.DS))
    )
    rest_beta = frame * sway_rate + (db * w + dc * frame_rate) * w + dot(weight, across(vector(limb, b.S)))
    limb[b.REST_THETA], limb[b.REST_BETA] = rest_theta, rest_beta
    limb[b.LEVER] = coupling + cross(hip, vector(limb, b.U))
    wanted, wanted_rate, _ = filtered(limb, SPEED, elapsed)
    torque = clip(limb[b.GAIN] * (wanted - w), limb[b.LIMIT])
    softness, is_motor = 1.0 / limb[b.INERTIA], limb[b.MOTOR] > 0.0
    free = softness * (torque + limb[b.Q_THETA] - rest_theta + k * (limb[b.Q_BETA] - rest_beta))
    limb[b.CRANK_TORQUE] = torque
    limb[b.SOFTNESS] = choose(is_motor, softness, 0.0)
    limb[b.SPIN_RATE_FREE] = choose(is_motor, free, wanted_rate)


@inlined
def load_trunk(trunk, limb, kind, together):  # type: ignore[no-untyped-def]
    """A leg's part in the trunk's equations, its crank eliminated, and in the outer force and moment."""
    w, frame_rate, pitch_rate = limb[b.SPIN], limb[b.FRAME_RATE], trunk[t.PITCH_RATE]
    s, hip, u, push = vector(limb, b.S), vector(limb, b.HIP), vector(limb, b.U), vector(limb, b.PUSH)
    mass, lever, free, softness = limb[b.MASS], limb[b.LEVER], limb[b.SPIN_RATE_FREE], limb[b.SOFTNESS]
    slope = vector(limb, b.TURN) * vector(limb, b.SLOPES + f.DS_X)
    throw = (  # what the first moment does at rest of all accelerations
        limb[b.SWAY_RATE] * across(s)
        + w * w * slope
        + frame_rate * (2.0 * w * across(vector(limb, b.DS)) - frame_rate * s)
    )
    sling = pitch_rate * pitch_rate * hip  # less O's acceleration
    soft_u = softness * u
    add_vector(trunk, t.LOAD, mass * sling - throw - free * u, together)
    add(trunk, t.M_XX, -soft_u.real * u.real, together)
    add(trunk, t.M_XY, -soft_u.real * u.imag, together)
    add(trunk, t.M_YY, -soft_u.imag * u.imag, together)
    add_vector(trunk, t.FORCE, push, together)
    if kind == FREE:
        heavy = mass * (plane(level(trunk, 0.0), trunk[t.GRAVITY]) - sling)
        by_frame = limb[b.Q_BETA] - limb[b.REST_BETA]
        add(trunk, t.LOAD_TURN, by_frame + cross(hip, push - heavy - throw) - lever * free, together)
        add(trunk, t.M_XP, -soft_u.real * lever, together)
        add(trunk, t.M_YP, -soft_u.imag * lever, together)
        add(trunk, t.M_PP, -softness * lever * lever, together)
        off = hip + vector(trunk, t.PLACE) - vector(trunk, t.NOW_CENTRE)
        add(trunk, t.TWIST, limb[b.Q_BETA] + cross(off, push), together)


@inlined
def accelerate_trunk(trunk, kind):  # type: ignore[no-untyped-def]
    """Solve the trunk's equations for its accelerations, by Cramer's rule."""
    load = vector(trunk, t.FORCE) + vector(trunk, t.LOAD)
    xx, xy, yy = trunk[t.M_XX], trunk[t.M_XY], trunk[t.M_YY]
    pitch_acc = level(trunk, 0.0)
    if kind == RAIL:
        acc = plane(load.real / xx, 0.0)
        trunk[t.FORCE + 1] = 0.0  # the rail takes it
    elif kind == SUSPENDED:
        per = 1.0 / (xx * yy - xy * xy)
        acc = per * plane(yy * load.real - xy * load.imag, xx * load.imag - xy * load.real)
    else:
        xp, yp, pp, turning = trunk[t.M_XP], trunk[t.M_YP], trunk[t.M_PP], trunk[t.LOAD_TURN]
        c_xx, c_xy, c_xp = yy * pp - yp * yp, xp * yp - xy * pp, xy * yp - yy * xp
        c_yy, c_yp, c_pp = xx * pp - xp * xp, xy * xp - xx * yp, xx * yy - xy * xy
        per = 1.0 / (xx * c_xx + xy * c_xy + xp * c_xp)
        acc = per * plane(
            c_xx * load.real + c_xy * load.imag + c_xp * turning,
            c_xy * load.real + c_yy * load.imag + c_yp * turning,
        )
        pitch_acc = per * (c_xp * load.real + c_yp * load.imag + c_pp * turning)
    if kind != FREE:
        trunk[t.TWIST] = 0.0
    put(trunk, t.ACC, acc)
    trunk[t.PITCH_ACC] = pitch_acc


@inlined
def accelerate_crank(trunk, limb):  # type: ignore[no-untyped-def]
    """The crank's acceleration: a motor's gives way to the trunk's."""
    pull = dot(vector(limb, b.U), vector(trunk, t.ACC)) + limb[b.LEVER] * trunk[t.PITCH_ACC]
    limb[b.SPIN_RATE] = limb[b.SPIN_RATE_FREE] - limb[b.SOFTNESS] * pull
