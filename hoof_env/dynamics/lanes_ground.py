"""What the ground does to the hoofs of a tile of environments (Eqs. 10 to 15); see `lanes`."""

from __future__ import annotations

from hoof_env._jit import inlined
from hoof_env.dynamics import limb_rows as b
from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.vectors import across, put, times, vector
from hoof_env.ground.exact_math import root_power
from hoof_env.ground.lane_contact import AMBROSIO, TANH, THRELFALL, friction_part
from hoof_env.ground.surface import surface
from hoof_env.leg import profile as f
from hoof_env.leg.kinematics import dot


@inlined
def clear_ground(limb):  # type: ignore[no-untyped-def]
    """Before the two points of a hoof push."""
    for lane in range(limb.shape[1]):
        limb[b.Q_THETA, lane] = 0.0
        limb[b.Q_BETA, lane] = 0.0
        put(limb, b.PUSH, lane, 0j)


@inlined
def level_ground(limb):  # type: ignore[no-untyped-def]
    """What never changes where the ground is the same everywhere."""
    for point in range(2):
        c = b.CONTACT + point * b.CONTACT_ROWS
        for lane in range(limb.shape[1]):
            limb[c + b.HEIGHT, lane] = 0.0
            limb[c + b.NORMAL_X, lane] = 0.0
            limb[c + b.NORMAL_Y, lane] = 1.0
            limb[c + b.FIRMNESS, lane] = 1.0
            limb[c + b.ROUGHNESS, lane] = 1.0


@inlined
def meet_ground(trunk, limb, point, model):  # type: ignore[no-untyped-def]
    """Where a hoof point is, how deep in the ground, how fast it goes in and slides; 0 is the toe."""
    c = b.CONTACT + point * b.CONTACT_ROWS
    for lane in range(limb.shape[1]):
        turn, hip = vector(limb, b.TURN, lane), vector(limb, b.HIP, lane)
        pitch_rate, w = trunk[t.PITCH_RATE, lane], limb[b.SPIN, lane]
        frame_rate = pitch_rate + limb[b.K, lane] * w + limb[b.SWAY, lane]
        limb[b.FRAME_RATE, lane] = frame_rate
        z = turn * vector(limb, b.VALUES + f.TOE_X + 2 * point, lane)
        dz = turn * vector(limb, b.SLOPES + f.TOE_X + 2 * point, lane)
        put(limb, c + b.ARM, lane, z)
        put(limb, c + b.BY_THETA, lane, dz)
        put(limb, c + b.SPOT, lane, vector(trunk, t.PLACE, lane) + hip + z)
        velocity = (
            vector(trunk, t.VELOCITY, lane)
            + times(pitch_rate, across(hip))
            + (times(w, dz) + times(frame_rate, across(z)))
        )
        put(limb, c + b.SPOT_RATE, lane, velocity)
    if model.is_terrain:
        for lane in range(limb.shape[1]):
            height, normal_x, normal_y, firmness, roughness = surface(
                limb[c + b.SPOT, lane], model.ground_cells, model.ground_origin, model.ground_per_metre
            )
            limb[c + b.HEIGHT, lane] = height
            limb[c + b.NORMAL_X, lane], limb[c + b.NORMAL_Y, lane] = normal_x, normal_y
            limb[c + b.FIRMNESS, lane], limb[c + b.ROUGHNESS, lane] = firmness, roughness
    for lane in range(limb.shape[1]):
        normal, velocity = vector(limb, c + b.NORMAL_X, lane), vector(limb, c + b.SPOT_RATE, lane)
        limb[c + b.DEPTH, lane] = (limb[c + b.HEIGHT, lane] - limb[c + b.SPOT + 1, lane]) * normal.imag
        limb[c + b.DEPTH_RATE, lane] = -dot(normal, velocity)
        slide = velocity.real * normal.imag - velocity.imag * normal.real
        limb[c + b.SLIDE, lane] = slide
        limb[c + b.SLIDING, lane] = abs(slide)
    if model.eighths == 12:
        for lane in range(limb.shape[1]):
            limb[c + b.POWER, lane] = root_power(limb[c + b.DEPTH, lane], 12)
    else:
        for lane in range(limb.shape[1]):
            limb[c + b.POWER, lane] = root_power(limb[c + b.DEPTH, lane], model.eighths)
    if model.friction_law == AMBROSIO:
        grip_ground(trunk, limb, c, AMBROSIO)
    elif model.friction_law == THRELFALL:
        grip_ground(trunk, limb, c, THRELFALL)
    else:
        grip_ground(trunk, limb, c, TANH)


@inlined
def grip_ground(trunk, limb, c, law):  # type: ignore[no-untyped-def]
    """Which part of the kinetic friction acts at the sliding speed."""
    for lane in range(limb.shape[1]):
        limb[c + b.GRIP, lane] = friction_part(
            limb[c + b.SLIDING, lane], law, trunk[t.SLOW, lane], trunk[t.FAST, lane]
        )


@inlined
def push_back(trunk, limb, point, model):  # type: ignore[no-untyped-def]
    """Forces of the ground on a hoof point (Eqs. 14, 15) and their generalised forces.

    The approach speed v0 is that at the crossing, interpolated between the last whole step and now, or the
    one kept from there, both as slowness 1 / v0.
    """
    c, memory, interpolated = b.CONTACT + point * b.CONTACT_ROWS, b.MEMORY + 3 * point, model.interpolated
    for lane in range(limb.shape[1]):
        depth, rate = limb[c + b.DEPTH, lane], limb[c + b.DEPTH_RATE, lane]
        before, rate_before = limb[memory, lane], limb[memory + 1, lane]
        kept, floor = limb[memory + 2, lane], trunk[t.FLOOR, lane]
        crossed = (before < 0.0) & interpolated
        span = depth - before if crossed else 1.0
        entry = rate_before * span - before * (rate - rate_before) if crossed else rate
        fresh = span / max(entry, floor * span)
        slowness = kept if kept > 0.0 else fresh
        limb[c + b.SLOWNESS, lane] = slowness
        stiffness = trunk[t.STIFFNESS, lane] * limb[c + b.FIRMNESS, lane]
        push = (
            stiffness * limb[c + b.POWER, lane] * (1.0 + trunk[t.CHI, lane] * rate * slowness)
            + trunk[t.DASHPOT, lane] * rate
        )
        push = max(push, 0.0) if depth > 0.0 else 0.0 * abs(depth)  # what is not a number stays so
        grip = trunk[t.FRICTION, lane] * limb[c + b.ROUGHNESS, lane] * limb[c + b.GRIP, lane] * push
        rub = -grip if limb[c + b.SLIDE, lane] > 0.0 else grip
        limb[c + b.NORMAL, lane] = push
        limb[c + b.RUB, lane] = rub
        normal = vector(limb, c + b.NORMAL_X, lane)
        force = times(push, normal) - times(rub, across(normal))
        limb[b.Q_THETA, lane] += dot(force, vector(limb, c + b.BY_THETA, lane))
        limb[b.Q_BETA, lane] += dot(force, across(vector(limb, c + b.ARM, lane)))
        put(limb, b.PUSH, lane, vector(limb, b.PUSH, lane) + force)


@inlined
def remember_contacts(limb):  # type: ignore[no-untyped-def]
    """At a whole step: keep penetration and rate, and the slowness at entry of a point in the ground."""
    for point in range(2):
        c, memory = b.CONTACT + point * b.CONTACT_ROWS, b.MEMORY + 3 * point
        for lane in range(limb.shape[1]):
            depth, slowness = limb[c + b.DEPTH, lane], limb[c + b.SLOWNESS, lane]
            limb[memory, lane] = depth
            limb[memory + 1, lane] = limb[c + b.DEPTH_RATE, lane]
            limb[memory + 2, lane] = slowness if depth > 0.0 else 0.0
