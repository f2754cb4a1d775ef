"""Forces of the ground on the hooves (Eqs. 10 to 15); see `mechanics`."""

from __future__ import annotations

from typing import NamedTuple

from hoof_env.dynamics.layout import Contact, ContactMemory, LegRows, TrunkRows, TrunkSettings
from hoof_env.dynamics.model import Model
from hoof_env.ground.laws import friction_part, normal_force
from hoof_env.ground.terrain import surface
from hoof_env.simd import (
    Lanes,
    Number,
    Plane,
    Truth,
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


def level_ground(leg: LegRows) -> None:
    """Set the constants of level, uniform ground: normal and scales of the terrain."""
    upward = vector(full_like(leg, 0.0), 1.0)
    for point in (leg.toe, leg.heel):
        point.ground_normal = upward
        point.stiffness_scale = 1.0
        point.friction_scale = 1.0


def disable_heel(leg: LegRows, springs: int) -> None:
    """Set the contact of the missing heel of a hoof with one point to zero; it stays zero."""
    heel = leg.heel
    heel.penetration = 0.0
    heel.penetration_rate = 0.0
    heel.slide = 0.0
    heel.spring_force = 0.0
    heel.inverse_approach_speed = 0.0
    heel.normal = 0.0
    heel.friction = 0.0
    for k in range(springs):
        heel.deflection[k] = 0.0
        heel.deflection_rate[k] = 0.0
        heel.mean_deflection_rate[k] = 0.0


def ground_forces(trunk: TrunkRows, leg: LegRows, model: Model) -> None:
    """Compute the forces of the ground on toe and heel, and their generalised forces on crank and frame."""
    hip = leg.hip
    pitch_rate = trunk.rates.pitch_rate
    w = leg.theta_rate
    leg.beta_rate = pitch_rate + leg.beta_by_theta * w + leg.swing_rate
    place = trunk.place + hip
    velocity = trunk.velocity + pitch_rate * perpendicular(hip)
    toe_force, toe_theta, toe_beta = contact_point(
        trunk, leg, leg.toe, leg.state.toe, leg.functions.toe, leg.slopes.toe, place, velocity, model
    )
    if model.form.feet == 2:
        force, theta, beta = contact_point(
            trunk, leg, leg.heel, leg.state.heel, leg.functions.heel, leg.slopes.heel, place, velocity, model
        )
        leg.ground_force = toe_force + force
        leg.ground_moment_theta = toe_theta + theta
        leg.ground_moment_beta = toe_beta + beta
    else:
        leg.ground_force = toe_force
        leg.ground_moment_theta = toe_theta
        leg.ground_moment_beta = toe_beta


def contact_point(
    trunk: TrunkRows,
    leg: LegRows,
    point: Contact,
    memory: ContactMemory,
    arm: Plane,
    arm_by_theta: Plane,
    hip: Plane,
    hip_velocity: Plane,
    model: Model,
) -> tuple[Plane, Lanes, Lanes]:
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
        spring_contact(trunk, leg, point, memory, model)
    else:
        rigid_contact(trunk, point, memory, penetration, rate, sliding_speed, model)
    force = force_of(point) if model.is_terrain else vector(point.friction, point.normal)
    return force, dot(force, by_theta), cross(arm, force)


def force_of(point: Contact) -> Plane:
    """Return the force of the ground on a hoof point, in the world [N]."""
    return point.normal * point.ground_normal - point.friction * perpendicular(point.ground_normal)


def rigid_contact(
    trunk: TrunkRows,
    point: Contact,
    memory: ContactMemory,
    penetration: Lanes,
    rate: Lanes,
    sliding_speed: Lanes,
    model: Model,
) -> None:
    """Compute the forces on a point of a rigid hoof, which is the sole itself."""
    zero = 0.0 * absolute(penetration)  # 0, but NaN where the penetration is NaN
    inverse_speed = memory.inverse_approach_speed
    inside = penetration > 0.0

    def meets() -> tuple[Lanes, Lanes, Lanes, Lanes]:
        latched = latch(trunk, memory, inside, inverse_speed, penetration, rate, model)
        laws = trunk.settings
        pushed, stored = contact_force(laws, point.stiffness_scale, penetration, rate, latched, model)
        part = friction_part(
            absolute(sliding_speed), model.friction_law, laws.friction_slow, laws.friction_fast
        )
        grip = laws.friction * point.friction_scale * part * pushed  # Eq. 15
        return (
            where(inside, pushed, zero),
            where(inside, stored, zero),
            where(inside, where(sliding_speed > 0.0, -grip, grip), zero),
            latched,
        )

    # branches on all lanes together, to save time in the air; `where` chooses in each lane
    force, spring, friction, inverse_speed = cond(any_lane(inside), meets, (zero, zero, zero, inverse_speed))
    point.spring_force = spring
    point.inverse_approach_speed = inverse_speed
    point.normal = force
    point.friction = friction


def spring_contact(
    trunk: TrunkRows, leg: LegRows, point: Contact, memory: ContactMemory, model: Model
) -> None:
    """Compute the forces on a point of a compliant hoof. Its sole has no mass: spring and damper carry the
    force of the ground.

    The leg's point is `depth` in the ground, the sole deeper by the spring's length less s. With b =
    chi S / v0 + c of the ground, S + b (depth' - s') = k s + d s' gives s'. Where the ground would have
    to pull, the spring returns freely. Along the ground u is the displacement of the leg ahead of the sole:
    k u + d u' is friction, and u' is the leg's speed while the sole sticks.
    """
    laws = trunk.settings
    stiffness = leg.settings.hoof_stiffness
    damping = leg.settings.hoof_damping
    deflection = point.deflection[0]
    along = point.deflection[1]
    speed = point.slide
    depth_rate = point.penetration_rate
    elastic = rounded(stiffness[0] * deflection)
    penetration = point.penetration + leg.settings.hoof_length - deflection
    free_return_rate = rounded(-elastic * leg.inverse_damping[0])  # of an unloaded spring
    zero = 0.0 * absolute(penetration)
    inverse_speed = memory.inverse_approach_speed
    inside = penetration > 0.0

    def meets() -> tuple[Lanes, Lanes, Lanes]:
        approach = depth_rate - free_return_rate
        latched = latch(trunk, memory, inside, inverse_speed, penetration, approach, model)
        pushed = ground_spring(laws, point.stiffness_scale, maximum(penetration, 0.0), model.eighths)
        spring = where(inside, pushed, zero)
        return spring, where(inside, laws.chi * spring * latched + laws.dashpot, zero), latched

    spring, resistance, inverse_speed = cond(any_lane(inside), meets, (zero, zero, inverse_speed))
    # the balance of the docstring, with Eq. 14 for the ground, solved for s'
    rate = (spring + resistance * depth_rate - elastic) / (damping[0] + resistance)
    pushes = inside & (rate > free_return_rate)
    rate = maximum(rate, free_return_rate)
    force = where(pushes, maximum(elastic + damping[0] * rate, 0.0), zero)
    # Coulomb's law instead of Eq. 15: the sole slides only where sticking would need more than the grip
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


def latch(
    trunk: TrunkRows,
    memory: ContactMemory,
    inside: Truth,
    inverse_speed: Lanes,
    penetration: Lanes,
    rate: Lanes,
    model: Model,
) -> Lanes:
    """Return 1 / v0 [s/m] of points in the ground, latched at their touch-down."""

    def entered() -> Lanes:
        entering = inverse_entry_speed(trunk, memory, penetration, rate, model)
        return where(inverse_speed > 0.0, inverse_speed, entering)

    latched: Lanes = cond(any_lane(inside & (inverse_speed == 0.0)), entered, inverse_speed)
    return latched


def inverse_entry_speed(
    trunk: TrunkRows, memory: ContactMemory, penetration: Lanes, rate: Lanes, model: Model
) -> Lanes:
    """Return 1 / v0 [s/m] with v0 the approach speed at the crossing of the surface, interpolated between the
    last whole step and now."""
    before = memory.penetration
    rate_before = memory.penetration_rate
    floor = trunk.settings.approach_floor
    span = full_like(memory, 1.0)
    entry = rate
    if model.is_interpolated:
        crossed = before < 0.0
        span = where(crossed, penetration - before, span)
        entry = where(crossed, rate_before * span - before * (rate - rate_before), rate)
    # `entry` is v0 times `span`, so that one division is enough
    return span / maximum(entry, floor * span)


def ground_spring(ground: TrunkSettings, stiffness_scale: Lanes, penetration: Lanes, eighths: int) -> Lanes:
    """Return the elastic force K d^n of Eq. 14 [N]."""
    power = root_power(penetration, eighths)
    return ground.stiffness * stiffness_scale * power


@inputs
class GroundHere(NamedTuple):
    """Parameters of the ground under a hoof point, for a law of contact."""

    stiffness: Lanes  # K of Eq. 14, with the terrain's factor there [N/m^n]
    eighths: int  # the exponent n in eighths, for `root_power`
    chi: Lanes  # damping factor, from restitution and `normal_law` [-]
    dashpot: Lanes  # [N s/m]


def contact_force(
    ground: TrunkSettings,
    stiffness_scale: Lanes,
    penetration: Lanes,
    rate: Lanes,
    inverse_speed: Lanes,
    model: Model,
) -> tuple[Lanes, Lanes]:
    """Return the normal force on a point inside the ground, and the part that is stored in it [N]: of Eq. 14
    or, if the model has one, of a user's law.

    That is a function of penetration [m], its rate [m/s], the inverse of the approach speed [s/m] and
    `GroundHere`, which returns the normal force [N]. Negative (adhesive) values are set to 0. No part of this
    force counts as stored.
    """
    law = model.contact_law
    if law is None:
        spring = ground_spring(ground, stiffness_scale, penetration, model.eighths)
        return normal_force(spring, ground.chi, ground.dashpot, rate, inverse_speed), spring  # Eq. 14
    force = foreign(f"the contact law {function_name(law)}", law)
    here = GroundHere(ground.stiffness * stiffness_scale, model.eighths, ground.chi, ground.dashpot)
    pushed = maximum(force(penetration, rate, inverse_speed, here), 0.0)
    return pushed, 0.0 * pushed


def remember_contacts(leg: LegRows) -> None:
    """Store penetration, rate and inverse approach speed of toe and heel at a whole step; the speed is 0
    outside the ground."""
    remember_point(leg.toe, leg.state.toe)
    remember_point(leg.heel, leg.state.heel)


def remember_point(point: Contact, memory: ContactMemory) -> None:
    """Store them for one point; see `remember_contacts`."""
    memory.penetration = point.penetration
    memory.penetration_rate = point.penetration_rate
    kept = where(point.penetration > 0.0, point.inverse_approach_speed, 0.0)
    memory.inverse_approach_speed = kept


# States of the hooves' springs, for the functions of `stepping`; `count` rows a point, 0 of rigid hooves


def begin_springs(leg: LegRows, count: int) -> None:
    """Set the springs of the first stage to the state itself."""
    for k in range(count):
        leg.toe.deflection[k] = leg.state.toe.deflection[k]
        leg.heel.deflection[k] = leg.state.heel.deflection[k]


def clear_springs(leg: LegRows, count: int) -> None:
    """Set the means of the springs' rates to 0."""
    for k in range(count):
        leg.toe.mean_deflection_rate[k] = 0.0
        leg.heel.mean_deflection_rate[k] = 0.0


def weigh_springs(leg: LegRows, count: int, weight: Number) -> None:
    """Add the rates at the present stage to their means."""
    toe = leg.toe.mean_deflection_rate
    heel = leg.heel.mean_deflection_rate
    for k in range(count):
        toe[k] = toe[k] + weight * leg.toe.deflection_rate[k]
        heel[k] = heel[k] + weight * leg.heel.deflection_rate[k]


def move_springs(leg: LegRows, count: int, elapsed: Number) -> None:
    """Move the springs `elapsed` [s] from the step's start with the rates of the present stage."""
    for k in range(count):
        leg.toe.deflection[k] = leg.state.toe.deflection[k] + elapsed * leg.toe.deflection_rate[k]
        leg.heel.deflection[k] = leg.state.heel.deflection[k] + elapsed * leg.heel.deflection_rate[k]


def end_springs(leg: LegRows, count: int, averages: bool, h: Number) -> None:
    """Advance the springs' states by a step of `h` [s]."""
    for k in range(count):
        toe = leg.toe.deflection_rate[k]
        heel = leg.heel.deflection_rate[k]
        if averages:
            toe = leg.toe.mean_deflection_rate[k]
            heel = leg.heel.mean_deflection_rate[k]
        leg.state.toe.deflection[k] = leg.state.toe.deflection[k] + h * toe
        leg.state.heel.deflection[k] = leg.state.heel.deflection[k] + h * heel
