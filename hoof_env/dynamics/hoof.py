"""Forces of the ground on the hooves (Eqs. 10 to 15); see `mechanics`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from hoof_env.ground.laws import friction_part, normal_force
from hoof_env.ground.terrain import surface
from hoof_env.simd import (
    absolute,
    any_lane,
    cond,
    cross,
    dot,
    full_like,
    maximum,
    perpendicular,
    rounded,
    vector,
    where,
)
from hoof_env.simd.math import clip, root_power
from hoof_env.simd.user_functions import foreign, function_name, inputs


def level_ground(leg):  # type: ignore[no-untyped-def]
    """Set what is constant on ground that is level and the same everywhere: normal and scales of the
    terrain."""
    upward = vector(full_like(leg, 0.0), 1.0)
    leg.toe.ground_normal = upward
    leg.toe.stiffness_scale = 1.0
    leg.toe.friction_scale = 1.0
    leg.heel.ground_normal = upward
    leg.heel.stiffness_scale = 1.0
    leg.heel.friction_scale = 1.0


def lift_heel(leg, springs):  # type: ignore[no-untyped-def]
    """Set the contact of a heel that is not there, of a hoof with one point, to nothing; it stays so."""
    leg.heel.penetration = 0.0
    leg.heel.penetration_rate = 0.0
    leg.heel.slide = 0.0
    leg.heel.spring_force = 0.0
    leg.heel.inverse_approach_speed = 0.0
    leg.heel.normal = 0.0
    leg.heel.friction = 0.0
    for k in range(springs):
        leg.heel.deflection[k] = 0.0
        leg.heel.deflection_rate[k] = 0.0
        leg.heel.mean_deflection_rate[k] = 0.0


def meet_ground(trunk, leg, model):  # type: ignore[no-untyped-def]
    """Compute the forces of the ground on toe and heel, and their generalised forces on crank and frame."""
    hip = leg.hip
    pitch_rate = trunk.rates.pitch_rate
    w = leg.theta_rate
    leg.beta_rate = pitch_rate + leg.beta_by_theta * w + leg.swing_rate
    place = trunk.place + hip
    velocity = trunk.velocity + pitch_rate * perpendicular(hip)
    toe_force, toe_theta, toe_beta = meet_point(
        trunk, leg, leg.toe, leg.state.toe, leg.functions.toe, leg.slopes.toe, place, velocity, model
    )
    if model.form.feet == 2:
        force, theta, beta = meet_point(
            trunk, leg, leg.heel, leg.state.heel, leg.functions.heel, leg.slopes.heel, place, velocity, model
        )
        leg.ground_force = toe_force + force
        leg.ground_moment_theta = toe_theta + theta
        leg.ground_moment_beta = toe_beta + beta
    else:
        leg.ground_force = toe_force
        leg.ground_moment_theta = toe_theta
        leg.ground_moment_beta = toe_beta


def meet_point(trunk, leg, point, memory, arm, arm_by_theta, hip, hip_velocity, model):  # type: ignore[no-untyped-def]
    """Compute the motion of a hoof point; return the force of the ground on it and that force's parts along
    theta and beta. `arm` is the vector from O to the point in the leg's frame, `hip` is O's place [m]."""
    arm = leg.turn * arm
    by_theta = leg.turn * arm_by_theta
    place = hip + arm
    velocity = hip_velocity + (leg.theta_rate * by_theta + leg.beta_rate * perpendicular(arm))
    penetration = -place.imag  # Eq. 10
    rate = -velocity.imag  # Eq. 12
    sliding_speed = velocity.real  # Eq. 13
    if model.is_terrain:
        height, normal_x, normal_y, stiffness_scale, friction_scale = surface(
            place.real, model.ground_cells, model.ground_origin, model.ground_per_metre
        )
        normal = vector(normal_x, normal_y)
        penetration = rounded((height - place.imag) * normal_y)
        rate = -dot(normal, velocity)
        sliding_speed = -cross(normal, velocity)
        point.ground_normal = normal
        point.stiffness_scale = stiffness_scale
        point.friction_scale = friction_scale
    point.penetration = penetration
    point.penetration_rate = rate
    point.slide = sliding_speed

    if model.form.springs:
        press_through_spring(trunk, leg, point, memory, model)
    else:
        press_rigidly(trunk, point, memory, penetration, rate, sliding_speed, model)
    force = vector(point.friction, point.normal)  # on level ground
    if model.is_terrain:
        force = force_of(point)
    return force, dot(force, by_theta), cross(arm, force)


def force_of(point):  # type: ignore[no-untyped-def]
    """Return the force of the ground on a hoof point, in the world [N]."""
    return point.normal * point.ground_normal - point.friction * perpendicular(point.ground_normal)


def press_rigidly(trunk, point, memory, penetration, rate, sliding_speed, model):  # type: ignore[no-untyped-def]
    """Compute the forces on a point of a rigid hoof, which is the sole itself."""
    nothing = 0.0 * absolute(penetration)  # 0, but NaN where the penetration is NaN
    inverse_speed = memory.inverse_approach_speed
    inside = penetration > 0.0

    def meets():  # type: ignore[no-untyped-def]
        latched = latch(trunk, memory, inside, inverse_speed, penetration, rate, model)
        pushed, stored = model.law(
            trunk.settings, point.stiffness_scale, penetration, rate, latched, model.eighths
        )
        laws = trunk.settings
        part = friction_part(
            absolute(sliding_speed), model.friction_law, laws.friction_slow, laws.friction_fast
        )
        grip = laws.friction * point.friction_scale * part * pushed  # Eq. 15
        return (
            where(inside, pushed, nothing),
            where(inside, stored, nothing),
            where(inside, where(sliding_speed > 0.0, -grip, grip), nothing),
            latched,
        )

    # branches on all lanes together, to save time in the air; `where` chooses in each lane
    force, spring, friction, inverse_speed = cond(
        any_lane(inside), meets, (nothing, nothing, nothing, inverse_speed)
    )
    point.spring_force = spring
    point.inverse_approach_speed = inverse_speed
    point.normal = force
    point.friction = friction


def press_through_spring(trunk, leg, point, memory, model):  # type: ignore[no-untyped-def]
    """Compute the forces on a point of a compliant hoof. Its sole has no mass: spring and damper carry the
    force of the ground.

    The leg's point is `depth` in the ground, the sole s less. With b = chi S / v0 + c of the ground, S + b
    (depth' - s') = k s + d s' gives s'. Where that asks the ground to pull, the spring returns freely. Along
    the ground u is the displacement of the leg ahead of the sole: k u + d u' is friction, and u' is the leg's
    speed while the sole stands.
    """
    laws = trunk.settings
    stiffness = leg.settings.hoof_stiffness
    damping = leg.settings.hoof_damping
    deflection = point.deflection[0]
    along = point.deflection[1]
    speed = point.slide
    depth_rate = point.penetration_rate
    elastic = rounded(stiffness[0] * deflection)
    penetration = point.penetration - deflection
    free_return_rate = rounded(-elastic * leg.inverse_damping[0])  # of a spring that nothing presses
    nothing = 0.0 * absolute(penetration)
    inverse_speed = memory.inverse_approach_speed
    inside = penetration > 0.0

    def meets():  # type: ignore[no-untyped-def]
        approach = depth_rate - free_return_rate
        latched = latch(trunk, memory, inside, inverse_speed, penetration, approach, model)
        pushed = ground_spring(laws, point.stiffness_scale, maximum(penetration, 0.0), model.eighths)
        spring = where(inside, pushed, nothing)
        return spring, where(inside, laws.chi * spring * latched + laws.dashpot, nothing), latched

    spring, resistance, inverse_speed = cond(any_lane(inside), meets, (nothing, nothing, inverse_speed))
    # the balance of the docstring, with Eq. 14 for the ground, solved for s'
    rate = (spring + resistance * depth_rate - elastic) / (damping[0] + resistance)
    pushes = inside & (rate > free_return_rate)
    rate = maximum(rate, free_return_rate)
    force = where(pushes, maximum(elastic + damping[0] * rate, 0.0), nothing)
    # Coulomb's law instead of Eq. 15: the sole slides only where it would need more than the grip to stand
    sticking = stiffness[1] * along + damping[1] * speed
    grip = laws.friction * point.friction_scale * force
    held = clip(sticking, grip)
    shear = where(absolute(sticking) <= grip, speed, (held - stiffness[1] * along) * leg.inverse_damping[1])
    point.deflection_rate[0] = rate
    point.deflection_rate[1] = shear
    point.penetration = penetration
    point.penetration_rate = depth_rate - rate
    point.slide = speed - shear
    point.spring_force = spring
    point.inverse_approach_speed = inverse_speed
    point.normal = force
    point.friction = -held


def latch(trunk, memory, inside, inverse_speed, penetration, rate, model):  # type: ignore[no-untyped-def]
    """Return 1 / v0 [s/m] of points that are in the ground, kept from when they entered it."""

    def entered():  # type: ignore[no-untyped-def]
        entering = inverse_entry_speed(trunk, memory, penetration, rate, model)
        return where(inverse_speed > 0.0, inverse_speed, entering)

    return cond(any_lane(inside & (inverse_speed == 0.0)), entered, inverse_speed)


def inverse_entry_speed(trunk, memory, penetration, rate, model):  # type: ignore[no-untyped-def]
    """Return 1 / v0 [s/m] with v0 the approach speed at the crossing of the surface, interpolated between the
    last whole step and now."""
    before = memory.penetration
    rate_before = memory.penetration_rate
    floor = trunk.settings.approach_floor
    span = full_like(memory, 1.0)
    entry = rate
    if model.interpolated:
        crossed = before < 0.0
        span = where(crossed, penetration - before, span)
        entry = where(crossed, rate_before * span - before * (rate - rate_before), rate)
    # `entry` is v0 times `span`, so that one division is enough
    return span / maximum(entry, floor * span)


def ground_spring(ground, stiffness_scale, penetration, eighths):  # type: ignore[no-untyped-def]
    """Return the elastic force K d^n of Eq. 14 [N]."""
    # the usual exponent, 3/2, as a constant: `root_power` then has no branches
    if eighths == 12:
        power = root_power(penetration, 12)
    else:
        power = root_power(penetration, eighths)
    return ground.stiffness * stiffness_scale * power


def contact_force(ground, stiffness_scale, penetration, rate, inverse_speed, eighths):  # type: ignore[no-untyped-def]
    """Return the normal force on a point inside the ground (Eq. 14), and its elastic part [N]."""
    spring = ground_spring(ground, stiffness_scale, penetration, eighths)
    return normal_force(spring, ground.chi, ground.dashpot, rate, inverse_speed), spring  # Eq. 14


@inputs
class GroundHere(NamedTuple):
    """Parameters of the ground under a hoof point, for a law of contact."""

    stiffness: Any  # K of Eq. 14, with the terrain's factor there [N/m^n]
    eighths: Any  # the exponent n in eighths, for `root_power`
    chi: Any  # damping factor, from restitution and `normal_law` [-]
    dashpot: Any  # [N s/m]


def law_of(contact_law: Callable[..., Any] | None) -> Any:
    """Return the kernel of the normal force: `contact_force`, or the user's law in its place.

    Args:
        contact_law: function of penetration [m], its rate [m/s], the inverse of the approach speed [s/m] and
            `GroundHere`; returns the normal force [N]. Negative (adhesive) values are set to 0. No part of
            this force counts as stored in the ground.
    """
    if contact_law is None:
        return contact_force
    force = foreign(f"the contact law {function_name(contact_law)}", contact_law)

    def push(ground, stiffness_scale, penetration, rate, inverse_speed, eighths):  # type: ignore[no-untyped-def]
        here = GroundHere(ground.stiffness * stiffness_scale, eighths, ground.chi, ground.dashpot)
        pushed = maximum(force(penetration, rate, inverse_speed, here), 0.0)
        return pushed, 0.0 * pushed

    return push


def remember_contacts(leg):  # type: ignore[no-untyped-def]
    """Store penetration, rate and inverse approach speed of toe and heel at a whole step; the speed is 0
    outside the ground."""
    remember_point(leg.toe, leg.state.toe)
    remember_point(leg.heel, leg.state.heel)


def remember_point(point, memory):  # type: ignore[no-untyped-def]
    """Store them for one point, see `remember_contacts`."""
    memory.penetration = point.penetration
    memory.penetration_rate = point.penetration_rate
    kept = where(point.penetration > 0.0, point.inverse_approach_speed, 0.0)
    memory.inverse_approach_speed = kept


# States of the hooves' springs, for the functions of `stepping`; `count` rows a point, 0 of rigid hooves


def begin_springs(leg, count):  # type: ignore[no-untyped-def]
    """Set the springs of the first stage to the state itself."""
    for k in range(count):
        leg.toe.deflection[k] = leg.state.toe.deflection[k]
        leg.heel.deflection[k] = leg.state.heel.deflection[k]


def clear_springs(leg, count):  # type: ignore[no-untyped-def]
    """Set the means of the springs' rates to 0."""
    for k in range(count):
        leg.toe.mean_deflection_rate[k] = 0.0
        leg.heel.mean_deflection_rate[k] = 0.0


def weigh_springs(leg, count, weight):  # type: ignore[no-untyped-def]
    """Add the rates at the present stage to their means."""
    toe = leg.toe.mean_deflection_rate
    heel = leg.heel.mean_deflection_rate
    for k in range(count):
        toe[k] = toe[k] + weight * leg.toe.deflection_rate[k]
        heel[k] = heel[k] + weight * leg.heel.deflection_rate[k]


def move_springs(leg, count, elapsed):  # type: ignore[no-untyped-def]
    """Move the springs `elapsed` [s] from the step's start with the rates of the present stage."""
    for k in range(count):
        leg.toe.deflection[k] = leg.state.toe.deflection[k] + elapsed * leg.toe.deflection_rate[k]
        leg.heel.deflection[k] = leg.state.heel.deflection[k] + elapsed * leg.heel.deflection_rate[k]


def end_springs(leg, count, averages, h):  # type: ignore[no-untyped-def]
    """Advance the springs' states by a step of `h` [s]."""
    for k in range(count):
        toe = leg.toe.deflection_rate[k]
        heel = leg.heel.deflection_rate[k]
        if averages:
            toe = leg.toe.mean_deflection_rate[k]
            heel = leg.heel.mean_deflection_rate[k]
        leg.state.toe.deflection[k] = leg.state.toe.deflection[k] + h * toe
        leg.state.heel.deflection[k] = leg.state.heel.deflection[k] + h * heel
