"""What the ground does to the hoofs (Eqs. 10 to 15); see `lanes`."""

from __future__ import annotations

from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.vectors import put, vector
from hoof_env.ground.lane_friction import friction_part
from hoof_env.ground.surface import surface
from hoof_env.leg import profile as f
from hoof_env.simd import across, anywhere, choose, cross, dot, larger, level, plane, size
from hoof_env.simd.compile import inlined
from hoof_env.simd.math import root_power

TOE, HEEL = b.CONTACT, b.CONTACT + b.CONTACT_ROWS


@inlined
def level_ground(limb):  # type: ignore[no-untyped-def]
    """What never changes where the ground is the same everywhere."""
    level_point(limb, TOE)
    level_point(limb, HEEL)


@inlined
def level_point(limb, c):  # type: ignore[no-untyped-def]
    """`level_ground` for the hoof point with rows `c`."""
    put(limb, c + b.NORMAL_X, plane(level(limb, 0.0), 1.0))
    limb[c + b.FIRMNESS], limb[c + b.ROUGHNESS] = 1.0, 1.0


@inlined
def meet_ground(trunk, limb, model):  # type: ignore[no-untyped-def]
    """Forces of the ground on toe and heel, and their generalised forces on crank and frame."""
    hip, pitch_rate, w = vector(limb, b.HIP), trunk[t.PITCH_RATE], limb[b.SPIN]
    frame_rate = pitch_rate + limb[b.K] * w + limb[b.SWAY]
    limb[b.FRAME_RATE] = frame_rate
    place = vector(trunk, t.PLACE) + hip
    velocity = vector(trunk, t.VELOCITY) + pitch_rate * across(hip)
    toe_force, toe_theta, toe_beta = meet_point(trunk, limb, place, velocity, model, TOE, b.MEMORY, f.TOE_X)
    force, theta, beta = meet_point(trunk, limb, place, velocity, model, HEEL, b.MEMORY + 3, f.HEEL_X)
    put(limb, b.PUSH, toe_force + force)
    limb[b.Q_THETA], limb[b.Q_BETA] = toe_theta + theta, toe_beta + beta


@inlined
def meet_point(trunk, limb, hip, hip_velocity, model, c, memory, name):  # type: ignore[no-untyped-def]
    """Where a hoof point is, how deep in the ground, how fast it goes in and slides, and so the force of the
    ground on it and that force's part along theta and beta.

    Args:
        trunk, limb, model: as everywhere.
        hip, hip_velocity: of O [m, m/s].
        c, memory, name: the point's rows, what it remembers, and its place among the leg's functions.
    """
    turn, w, frame_rate = vector(limb, b.TURN), limb[b.SPIN], limb[b.FRAME_RATE]
    arm = turn * vector(limb, b.VALUES + name)
    by_theta = turn * vector(limb, b.SLOPES + name)
    spot, velocity = hip + arm, hip_velocity + (w * by_theta + frame_rate * across(arm))
    depth, rate, slide = -spot.imag, -velocity.imag, velocity.real
    if model.is_terrain:
        height, normal_x, normal_y, firmness, roughness = surface(
            spot.real, model.ground_cells, model.ground_origin, model.ground_per_metre
        )
        normal = plane(normal_x, normal_y)
        depth, rate = (height - spot.imag) * normal_y, -dot(normal, velocity)
        slide = -cross(normal, velocity)
        put(limb, c + b.NORMAL_X, normal)
        limb[c + b.FIRMNESS], limb[c + b.ROUGHNESS] = firmness, roughness
    put(limb, c + b.SPOT, spot)
    limb[c + b.DEPTH], limb[c + b.DEPTH_RATE], limb[c + b.SLIDE] = depth, rate, slide

    push = 0.0 * size(depth)  # what is not a number stays so
    spring, slowness, rub, inside = push, limb[memory + 2], push, depth > 0.0
    if anywhere(inside):
        if anywhere(inside & (slowness == 0.0)):
            slowness = choose(
                slowness > 0.0, slowness, entry_slowness(trunk, limb, depth, rate, memory, model)
            )
        pushed, spring = push_back(trunk, limb[c + b.FIRMNESS], depth, rate, slowness, model)
        part = friction_part(size(slide), model.friction_law, trunk[t.SLOW], trunk[t.FAST])
        grip = trunk[t.FRICTION] * limb[c + b.ROUGHNESS] * part * pushed
        rub = choose(inside, choose(slide > 0.0, -grip, grip), push)
        push, spring = choose(inside, pushed, push), choose(inside, spring, push)
    normal = vector(limb, c + b.NORMAL_X)
    force = push * normal - rub * across(normal)
    limb[c + b.SPRING], limb[c + b.SLOWNESS] = spring, slowness
    limb[c + b.NORMAL], limb[c + b.RUB] = push, rub
    put(limb, c + b.FORCE, force)
    return force, dot(force, by_theta), cross(arm, force)


@inlined
def entry_slowness(trunk, limb, depth, rate, memory, model):  # type: ignore[no-untyped-def]
    """1 / v0 with v0 the approach speed at the crossing of the surface, interpolated between the last whole
    step and now."""
    before, rate_before, floor = limb[memory], limb[memory + 1], trunk[t.FLOOR]
    span, entry = level(limb, 1.0), rate
    if model.interpolated:
        crossed = before < 0.0
        span = choose(crossed, depth - before, span)
        entry = choose(crossed, rate_before * span - before * (rate - rate_before), rate)
    return span / larger(entry, floor * span)


@inlined
def push_back(trunk, firmness, depth, rate, slowness, model):  # type: ignore[no-untyped-def]
    """Normal force on a point inside the ground (Eq. 14), which never pulls, and its spring's part [N]."""
    if model.eighths == 12:  # the usual exponent, 3/2
        power = root_power(depth, 12)
    else:
        power = root_power(depth, model.eighths)
    spring = trunk[t.STIFFNESS] * firmness * power
    push = spring * (1.0 + trunk[t.CHI] * rate * slowness) + trunk[t.DASHPOT] * rate
    return larger(push, 0.0), spring


@inlined
def remember_contacts(limb):  # type: ignore[no-untyped-def]
    """At a whole step: keep penetration and rate, and the slowness at entry of a point in the ground."""
    remember_point(limb, TOE, b.MEMORY)
    remember_point(limb, HEEL, b.MEMORY + 3)


@inlined
def remember_point(limb, c, memory):  # type: ignore[no-untyped-def]
    """`remember_contacts` for the point with rows `c`."""
    depth = limb[c + b.DEPTH]
    limb[memory], limb[memory + 1] = depth, limb[c + b.DEPTH_RATE]
    limb[memory + 2] = choose(depth > 0.0, limb[c + b.SLOWNESS], 0.0)
