"""Equations of motion of N legs on one trunk, for one environment or several side by side.

Every function is one stage of the mechanics on rows of memory; `layout` has their names and units. A row
holds `Lanes`, one value per environment; lanes are independent. A result has the same bits in one lane and
in eight: kernels use only + - * /, fused operations and sqrt, no fast-math, and no branch on a lane that
changes a bit. Where the lanes are the legs of one trunk (`lanes_are_legs`), each lane has a copy of the
trunk, and sums run over all lanes.

A leg enters as functions of its crank angle theta (`leg.profile`): toe and heel, the first moment s and the
inertias a, b, c; ' is d/dtheta, _t and _tt are time derivatives. With the world angle beta = pitch +
side phi(theta, t) of its frame, the velocity v of O and w = theta_t, its kinetic energy is

    T = m |v|^2 / 2 + v . e^(i beta) (s' w + i s beta_t) + (a w^2 + 2 b w beta_t + c beta_t^2) / 2,

and Lagrange's equations follow: (E1) to (E9) in docs/engine.md. The trunk's state is the linear and angular
momentum of all bodies together: in flight it is constant to round-off, with any scheme.
"""

from __future__ import annotations

from typing import TypeVar

from hoof_env.dynamics.hoof import ground_forces
from hoof_env.dynamics.layout import MAX_STATE, LegRows, Moving, TrunkRows
from hoof_env.dynamics.model import Model
from hoof_env.dynamics.parts import FIXED, FREE, RAIL, UPRIGHT
from hoof_env.gait import COS, OFFSET, SIN, SPEED
from hoof_env.leg.profile import Functions, Slopes, locate, look_up
from hoof_env.simd import (
    Lanes,
    Number,
    Plane,
    Truth,
    Whole,
    absolute,
    block_at,
    cond,
    cross,
    dot,
    full_like,
    lane_sum,
    loop,
    perpendicular,
    rounded,
    vector,
    where,
)
from hoof_env.simd.math import clip, cos_sin

MOVING = Moving.size

Sum = TypeVar("Sum", Lanes, Plane)


def add(total: Sum, x: Sum, lanes_are_legs: bool) -> Sum:
    """Return total + x, lane by lane; where the lanes are the legs of one trunk, return total plus the x of
    all lanes, in the order of a loop over legs."""
    if lanes_are_legs:
        summed: Sum = lane_sum(total, x)
        return summed
    return total + rounded(x)


def evaluate(trunk: TrunkRows, legs: LegRows, leg_count: Whole, model: Model, elapsed: Number) -> None:
    """Compute all forces and accelerations at the present stage, `elapsed` [s] after the step's start."""
    if model.kind != FIXED:
        clear_trunk(trunk, model.kind)
    # a loop of its own: the addresses of all look-ups are known before the first waits for memory
    for i in loop(leg_count):
        find_crank(block_at(legs, i), model)
    for i in loop(leg_count):
        leg = block_at(legs, i)
        look_up_functions(trunk, leg, model)
        place_frame(trunk, leg, model.form.harmonics, elapsed)
        if model.kind != FIXED:
            gather_leg(trunk, leg, model.kind, model.lanes_are_legs)
    if model.kind != FIXED:
        move_trunk(trunk, model.kind)
    for i in loop(leg_count):
        leg = block_at(legs, i)
        ground_forces(trunk, leg, model)
        set_up_crank(trunk, leg, model.has_motors, elapsed)
        if model.kind != FIXED:
            load_trunk(trunk, leg, model.kind, model.has_motors, model.lanes_are_legs)
    if model.kind != FIXED:
        accelerate_trunk(trunk, model.kind)
    for i in loop(leg_count):
        accelerate_crank(trunk, block_at(legs, i), model.has_motors)


def find_crank(leg: LegRows, model: Model) -> None:
    """Compute cell, cosine and sine of the crank angle, for all legs before their look-ups need them."""
    locate(leg, model.cells)
    leg.cosine, leg.sine = cos_sin(leg.theta)


def look_up_functions(trunk: TrunkRows, leg: LegRows, model: Model) -> None:
    """Look up the functions of the crank angle and their derivatives."""
    look_up(leg, model.tables)
    if model.form.has_limits:
        scale_functions(leg.functions, leg.slopes, leg.settings.length_scale[0], leg.settings.mass_scale[0])
    value = leg.functions[0]
    # tables have NaN where the linkage does not close; the NaN of an angle out of range is another failure
    trunk.at_dead_point = where(
        (absolute(leg.theta) <= MAX_STATE) & (value != value), 1.0, trunk.at_dead_point
    )


def scale_functions(value: Functions, slope: Slopes, length: Lanes, mass: Lanes) -> None:
    """Scale the functions to a similar leg, `length` times as large with `mass` times the mass."""
    moment = mass * length
    inertia = mass * length * length
    value.toe = length * value.toe
    value.heel = length * value.heel
    slope.toe = length * slope.toe
    slope.heel = length * slope.heel
    value.first_moment = moment * value.first_moment
    value.moment_slope = moment * value.moment_slope
    slope.moment_slope = moment * slope.moment_slope
    value.crank_inertia = inertia * value.crank_inertia
    value.coupling = inertia * value.coupling
    slope.crank_inertia = inertia * slope.crank_inertia
    slope.coupling = inertia * slope.coupling
    value.frame_inertia = inertia * value.frame_inertia
    value.frame_inertia_slope = inertia * value.frame_inertia_slope


def place_frame(trunk: TrunkRows, leg: LegRows, harmonics: int, elapsed: Number) -> None:
    """Compute the leg's frame (E1), and its first moment and inertia in the world. The swing is phi = phi_0
    + phi_s sin(theta) + phi_c cos(theta) and higher harmonics, if any; each parameter moves as its filter
    does."""
    sine = leg.sine
    cosine = leg.cosine
    w = leg.theta_rate
    offset, rate, acceleration = gait_parameter_at(leg, OFFSET, elapsed)
    part_a, rate_a, acc_a = gait_parameter_at(leg, SIN, elapsed)
    part_b, rate_b, acc_b = gait_parameter_at(leg, COS, elapsed)
    side = leg.settings.side
    swing = part_a * sine + part_b * cosine
    slope = part_a * cosine - part_b * sine
    swing_acceleration = acceleration + acc_a * sine + acc_b * cosine
    swing_acceleration = swing_acceleration + (2.0 * (rate_a * cosine - rate_b * sine) - swing * w) * w
    swing_rate = rate + rate_a * sine + rate_b * cosine
    sine_n = sine
    cosine_n = cosine
    for n in range(2, harmonics + 1):
        sine_n, cosine_n = sine_n * cosine + cosine_n * sine, cosine_n * cosine - sine_n * sine
        part_a, rate_a, acc_a = gait_parameter_at(leg, 2 * n, elapsed)
        part_b, rate_b, acc_b = gait_parameter_at(leg, 2 * n + 1, elapsed)
        part = part_a * sine_n + part_b * cosine_n
        n_w = n * w
        swing = swing + part
        slope = slope + n * (part_a * cosine_n - part_b * sine_n)
        swing_rate = swing_rate + rate_a * sine_n + rate_b * cosine_n
        harmonic_acceleration = 2.0 * (rate_a * cosine_n - rate_b * sine_n) - part * n_w
        swing_acceleration = swing_acceleration + acc_a * sine_n + acc_b * cosine_n
        swing_acceleration = swing_acceleration + harmonic_acceleration * n_w
    k = side * slope
    leg.phi = offset + swing
    leg.beta_by_theta = k  # (E1)
    leg.swing_rate = side * swing_rate  # v_phi of (E1)
    leg.swing_acceleration = side * swing_acceleration  # a_phi of (E1)

    cos_beta, sin_beta = cos_sin(trunk.stage.pitch + side * (offset + swing))
    turn = vector(cos_beta, sin_beta)
    s = turn * leg.functions.first_moment
    ds = turn * leg.functions.moment_slope
    leg.turn = turn
    leg.first_moment = s  # S of (E3)
    leg.moment_by_theta = ds  # D of (E2)
    leg.moment_by_crank = ds + k * perpendicular(s)  # U of (E5)
    frame = leg.functions.frame_inertia + leg.settings.rotor_frame
    coupling = leg.functions.coupling + leg.settings.rotor_coupling
    leg.frame_inertia = frame
    leg.crank_coupling = coupling + k * frame
    leg.crank_inertia = (  # I of (E5)
        leg.functions.crank_inertia + leg.settings.rotor_crank + k * (2.0 * coupling + k * frame)
    )


def gait_parameter_at(leg: LegRows, k: int, elapsed: Number) -> tuple[Lanes, Lanes, Lanes]:
    """Return parameter k of the gait, its rate and acceleration, `elapsed` [s] after the step's start."""
    value = leg.state.gait[k]
    rate = leg.state.gait_rate[k]
    acceleration = leg.gait_acceleration[k]

    def moved() -> tuple[Lanes, Lanes]:
        return (
            value + elapsed * (rate + 0.5 * elapsed * acceleration),
            rate + elapsed * acceleration,
        )

    return (*cond(elapsed != 0.0, moved, (value, rate)), acceleration)


def keep_still(trunk: TrunkRows) -> None:
    """Set the constant quantities of a trunk that is fixed or does not pitch."""
    for k in range(MOVING):
        trunk.stage[k] = trunk.state.moving[k]
        trunk.rates[k] = 0.0
    nothing = vector(full_like(trunk, 0.0), 0.0)
    trunk.place = trunk.state.moving.centre
    trunk.velocity = nothing
    trunk.acceleration = nothing
    trunk.pitch_acceleration = 0.0
    trunk.at_dead_point = 0.0
    trunk.fallen = 0.0
    trunk.turn = vector(full_like(trunk, 1.0), 0.0)


def clear_trunk(trunk: TrunkRows, kind: int) -> None:
    """Reset the trunk's sums before the legs are gathered."""
    if kind == FREE:
        cosine, sine = cos_sin(trunk.stage.pitch)
        trunk.turn = vector(cosine, sine)
    nothing = vector(full_like(trunk, 0.0), 0.0)
    trunk.first_moment = nothing
    trunk.relative_momentum = nothing
    trunk.composite_inertia = trunk.settings.pitch_inertia
    trunk.relative_angular_momentum = 0.0


def gather_leg(trunk: TrunkRows, leg: LegRows, kind: int, lanes_are_legs: bool) -> None:
    """Add a leg to first moment, momentum, inertia and angular momentum about the trunk's centre of mass
    (E6)."""
    s = leg.first_moment
    w = leg.theta_rate
    sway = leg.swing_rate
    drift = w * leg.moment_by_crank + sway * perpendicular(s)  # q of (E6)
    if kind == FREE:
        leg.hip = trunk.turn * leg.settings.hip_on_trunk
        hip = leg.hip
        frame = leg.frame_inertia
        trunk.composite_inertia = add(  # J_sum of (E6)
            trunk.composite_inertia, dot(hip, leg.settings.mass * hip + 2.0 * s) + frame, lanes_are_legs
        )
        trunk.relative_angular_momentum = add(  # H_sum of (E6)
            trunk.relative_angular_momentum,
            cross(hip, drift) + leg.crank_coupling * w + frame * sway,
            lanes_are_legs,
        )
    # S_sum and p_sum of (E6)
    trunk.first_moment = add(trunk.first_moment, leg.settings.mass * leg.hip + s, lanes_are_legs)
    trunk.relative_momentum = add(trunk.relative_momentum, drift, lanes_are_legs)


def gather_legs(trunk: TrunkRows, legs: LegRows, leg_count: Whole, model: Model) -> None:
    """Compute the legs' functions and frames at the present state, and their sums about the trunk's centre of
    mass (E6), without forces: the parts of the momentum of all bodies."""
    clear_trunk(trunk, model.kind)
    for i in loop(leg_count):
        leg = block_at(legs, i)
        find_crank(leg, model)
        look_up_functions(trunk, leg, model)
        place_frame(trunk, leg, model.form.harmonics, 0.0)
        gather_leg(trunk, leg, model.kind, model.lanes_are_legs)


def move_trunk(trunk: TrunkRows, kind: int) -> None:
    """Compute place and velocity of the trunk from centre of mass and momentum of all bodies (E7), on a rail
    along x only, and the forces on it except the legs'."""
    centre = trunk.stage.centre
    moment = trunk.first_moment
    momentum = trunk.stage.momentum
    drift = trunk.relative_momentum
    per_mass = trunk.settings.inverse_mass
    place = centre - per_mass * moment  # (E7)
    velocity = per_mass * (momentum - drift)  # (E7), psi_t to follow
    rate = full_like(trunk, 0.0)
    if kind == RAIL:
        place = vector(place.real, centre.imag)
        velocity = vector(velocity.real, 0.0)
    if kind == FREE:
        spin = (
            trunk.stage.angular_momentum - trunk.relative_angular_momentum + cross(moment, drift) * per_mass
        )
        rate = spin / (trunk.composite_inertia - dot(moment, moment) * per_mass)  # psi_t of (E7)
        velocity = velocity - rate * per_mass * perpendicular(moment)
    trunk.place = place
    trunk.velocity = velocity
    trunk.rates.pitch_rate = rate
    trunk.rates.velocity = per_mass * momentum
    drag = -trunk.settings.drag * velocity.real
    total = trunk.settings.total_mass
    lift = (
        trunk.settings.support  # of `trunk_share`
        - total * trunk.settings.gravity
        - trunk.settings.spring * (place.imag - trunk.settings.height)
        - trunk.settings.damper * velocity.imag
    )
    trunk.rates.force = vector(drag, lift)
    trunk.rates.moment = -drag * (place.imag - centre.imag)  # the drag acts on the trunk
    trunk.load = vector(full_like(trunk, 0.0), 0.0)
    trunk.load_moment = 0.0
    # A of (E8); `load_trunk` takes off each motor's crank
    trunk.mass_xx = total
    trunk.mass_xy = 0.0
    trunk.mass_yy = total
    trunk.mass_xp = -moment.imag
    trunk.mass_yp = moment.real
    trunk.mass_pp = trunk.composite_inertia
    trunk.fallen = where(place.imag < trunk.settings.bottom, 1.0, trunk.fallen)


def set_up_crank(trunk: TrunkRows, leg: LegRows, motors: bool, elapsed: Number) -> None:
    """Set up a crank's equation of motion (E5), with the trunk's acceleration a,

        crank_inertia theta_tt + moment_by_crank . a + crank_pitch_coupling pitch_tt = torque + ground - rest.

    A motor's crank is solved for theta_tt as if the trunk did not accelerate; a prescribed one's is given.
    """
    w = leg.theta_rate
    frame_rate = leg.beta_rate
    k = leg.beta_by_theta
    hip = leg.hip
    frame = leg.frame_inertia
    coupling = leg.crank_coupling
    pitch_rate = trunk.rates.pitch_rate
    swing_acceleration = leg.swing_acceleration
    da = leg.slopes.crank_inertia
    db = leg.slopes.coupling
    dc = leg.functions.frame_inertia_slope
    # a_h + i g of (E2) and (E3), without the trunk's acceleration
    weight = vector(full_like(trunk, 0.0), trunk.settings.gravity) - pitch_rate * pitch_rate * hip
    rest_theta = (  # (E2), where coupling - k frame is b
        (coupling - k * frame) * swing_acceleration
        + 0.5 * (da * (w * w) - dc * (frame_rate * frame_rate))
        + dot(weight, leg.moment_by_theta)
    )
    rest_beta = (  # (E3)
        frame * swing_acceleration
        + (db * w + dc * frame_rate) * w
        + dot(weight, perpendicular(leg.first_moment))
    )
    leg.rest_moment_theta = rest_theta
    leg.rest_moment_beta = rest_beta
    leg.crank_pitch_coupling = coupling + cross(hip, leg.moment_by_crank)  # L of (E5)
    wanted, wanted_rate, _ = gait_parameter_at(leg, SPEED, elapsed)
    leg.free_theta_acceleration = wanted_rate
    if motors:
        torque = clip(leg.settings.speed_gain * (wanted - w), leg.settings.torque_limit)
        mobility = 1.0 / leg.crank_inertia
        is_motor = leg.settings.is_motor > 0.0
        free = mobility * (  # (E5) with a_T = 0 and psi_tt = 0: w_t0 of (E8)
            torque + leg.ground_moment_theta - rest_theta + k * (leg.ground_moment_beta - rest_beta)
        )
        leg.crank_torque = torque
        leg.crank_mobility = where(is_motor, mobility, 0.0)
        leg.free_theta_acceleration = where(is_motor, free, wanted_rate)


def load_trunk(trunk: TrunkRows, leg: LegRows, kind: int, motors: bool, lanes_are_legs: bool) -> None:
    """Add a leg to the trunk's equations, its crank eliminated (E8), and to outer force and moment."""
    w = leg.theta_rate
    frame_rate = leg.beta_rate
    pitch_rate = trunk.rates.pitch_rate
    s = leg.first_moment
    hip = leg.hip
    u = leg.moment_by_crank
    ground_force = leg.ground_force
    mass = leg.settings.mass
    coupling = leg.crank_pitch_coupling
    free = leg.free_theta_acceleration
    slope = leg.turn * leg.slopes.moment_slope
    moment_acceleration = (  # of the first moment, where theta_tt, pitch_tt and a are 0
        leg.swing_acceleration * perpendicular(s)
        + w * w * slope
        + frame_rate * (2.0 * w * perpendicular(leg.moment_by_theta) - frame_rate * s)
    )
    centripetal = rounded(pitch_rate * pitch_rate * hip)  # minus O's acceleration there
    # loads of (E8)
    trunk.load = add(trunk.load, mass * centripetal - moment_acceleration - free * u, lanes_are_legs)
    # A - sum u u^T / I of (E8); prescribed cranks have 1 / I = 0
    if motors:
        mobile_u = leg.crank_mobility * u
        trunk.mass_xx = add(trunk.mass_xx, -mobile_u.real * u.real, lanes_are_legs)
        trunk.mass_xy = add(trunk.mass_xy, -mobile_u.real * u.imag, lanes_are_legs)
        trunk.mass_yy = add(trunk.mass_yy, -mobile_u.imag * u.imag, lanes_are_legs)
        if kind == FREE:
            trunk.mass_xp = add(trunk.mass_xp, -mobile_u.real * coupling, lanes_are_legs)
            trunk.mass_yp = add(trunk.mass_yp, -mobile_u.imag * coupling, lanes_are_legs)
            trunk.mass_pp = add(trunk.mass_pp, -leg.crank_mobility * coupling * coupling, lanes_are_legs)
    trunk.rates.force = add(trunk.rates.force, ground_force, lanes_are_legs)
    if kind == FREE:
        rest_force = mass * (vector(full_like(trunk, 0.0), trunk.settings.gravity) - centripetal)
        by_frame = leg.ground_moment_beta - leg.rest_moment_beta
        trunk.load_moment = add(
            trunk.load_moment,
            by_frame + cross(hip, ground_force - rest_force - moment_acceleration) - coupling * free,
            lanes_are_legs,
        )
        off = hip + trunk.place - trunk.stage.centre
        trunk.rates.moment = add(
            trunk.rates.moment, leg.ground_moment_beta + cross(off, ground_force), lanes_are_legs
        )


def accelerate_trunk(trunk: TrunkRows, kind: int) -> None:
    """Solve the trunk's equations (E8) for its accelerations, by Cramer's rule."""
    load = trunk.rates.force + trunk.load
    xx = trunk.mass_xx
    xy = trunk.mass_xy
    yy = trunk.mass_yy
    pitch_acc = full_like(trunk, 0.0)
    if kind == RAIL:
        acc = vector(load.real / xx, 0.0)
        trunk.rates.force = vector(trunk.rates.force.real, 0.0)  # the rail takes the rest
    elif kind == UPRIGHT:
        per = 1.0 / (xx * yy - xy * xy)
        acc = per * vector(yy * load.real - xy * load.imag, xx * load.imag - xy * load.real)
    else:
        xp = trunk.mass_xp
        yp = trunk.mass_yp
        pp = trunk.mass_pp
        turning = trunk.load_moment
        # cofactors of the symmetric 3 x 3 matrix
        c_xx = yy * pp - yp * yp
        c_xy = xp * yp - xy * pp
        c_xp = xy * yp - yy * xp
        c_yy = xx * pp - xp * xp
        c_yp = xy * xp - xx * yp
        c_pp = xx * yy - xy * xy
        per = 1.0 / (xx * c_xx + xy * c_xy + xp * c_xp)
        acc = per * vector(
            c_xx * load.real + c_xy * load.imag + c_xp * turning,
            c_xy * load.real + c_yy * load.imag + c_yp * turning,
        )
        pitch_acc = per * (c_xp * load.real + c_yp * load.imag + c_pp * turning)
    if kind != FREE:
        trunk.rates.moment = 0.0
    trunk.acceleration = acc
    trunk.pitch_acceleration = pitch_acc


def accelerate_crank(trunk: TrunkRows, leg: LegRows, motors: bool) -> None:
    """Set the crank's acceleration; a motor's crank yields to the trunk's acceleration (E9)."""
    leg.theta_acceleration = leg.free_theta_acceleration
    if motors:
        u = leg.moment_by_crank
        coupling = leg.crank_pitch_coupling
        pull = dot(u, trunk.acceleration) + coupling * trunk.pitch_acceleration
        leg.theta_acceleration = leg.free_theta_acceleration - leg.crank_mobility * pull  # (E9)


def velocities_to_momenta(
    trunk: TrunkRows, legs: LegRows, leg_count: Whole, model: Model, starts: Truth
) -> None:
    """Compute centre of mass, momentum and angular momentum of all bodies at a start, as `move_trunk` inverts
    it (E7).

    Before, their rows hold the trunk's place, velocity and pitch rate; lanes not in `starts` do not change.
    """
    gather_legs(trunk, legs, leg_count, model)
    place = trunk.state.moving.centre
    velocity = trunk.state.moving.momentum
    rate = trunk.state.moving.angular_momentum
    moment = trunk.first_moment
    drift = trunk.relative_momentum
    per_mass = trunk.settings.inverse_mass
    centre = place + per_mass * moment
    momentum = trunk.settings.total_mass * velocity + drift
    spin = full_like(trunk, 0.0)
    if model.kind == RAIL:
        centre = vector(centre.real, place.imag)
        momentum = vector(momentum.real, 0.0)
    if model.kind == FREE:
        momentum = momentum + rate * perpendicular(moment)
        about = trunk.composite_inertia - dot(moment, moment) * per_mass
        spin = rate * about + trunk.relative_angular_momentum - cross(moment, drift) * per_mass
    trunk.state.moving.centre = where(starts, centre, place)
    trunk.state.moving.momentum = where(starts, momentum, velocity)
    trunk.state.moving.angular_momentum = where(starts, spin, rate)
