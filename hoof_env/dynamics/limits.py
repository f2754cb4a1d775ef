"""Limits at which a motion ends: pitch and height of the trunk, joints near the ground.

What is checked after every `CHECK_EVERY` whole steps, and after the last, is kept until the call of the
engine ends, so that a joint that dips between two calls is not missed. Beyond a limit the motion goes
on, and its state is as good as any other.
"""

from __future__ import annotations

from hoof_env.dynamics.parts import Result
from hoof_env.ground.terrain import surface
from hoof_env.simd import any_lane, full_like, lane_sum, minimum, sqrt, vector, where
from hoof_env.simd.compile import inline_llvm

CHECK_EVERY = 5
"""Whole steps from one look to the next: to find all joints takes square roots and quotients."""

ROUNDING = 1e-6  # [m], more than G's places differ by rounding

PITCH, HEIGHT, LOW_JOINT = float(Result.PITCH), float(Result.HEIGHT), float(Result.LOW_JOINT)


@inline_llvm
def has_moved(result):  # type: ignore[no-untyped-def]
    """Return where the motion that a call asked for happened, within the limits or beyond one."""
    return (result == 0.0) | (result >= PITCH)


@inline_llvm
def clear_limits(trunk):  # type: ignore[no-untyped-def]
    """Forget the limits that an earlier call passed."""
    trunk.violated_limit[0] = 0.0


@inline_llvm
def record_violation(trunk, is_beyond, result):  # type: ignore[no-untyped-def]
    """Keep the first of the limits that were passed."""
    before = trunk.violated_limit[0]
    trunk.violated_limit[0] = where((before == 0.0) & is_beyond, result, before)


@inline_llvm
def ground_height(place, model):  # type: ignore[no-untyped-def]
    """Return the height of the ground below a point [m]."""
    height = 0.0 * place.real
    if model.is_terrain:
        height, _, _, _, _ = surface(
            place.real, model.ground_cells, model.ground_origin, model.ground_per_metre
        )
    return height


@inline_llvm
def check_trunk(trunk, model):  # type: ignore[no-untyped-def]
    """Check the trunk's pitch, and its height above the ground."""
    limits, pitch = trunk.settings.limits, trunk.stage.pitch
    height = trunk.place.imag - ground_height(trunk.place, model)
    record_violation(trunk, (pitch < limits[0]) | (pitch > limits[1]), PITCH)
    record_violation(trunk, (height < limits[2]) | (height > limits[3]), HEIGHT)


@inline_llvm
def check_joints(trunk, leg, shape, model):  # type: ignore[no-untyped-def]
    """Check that no joint but the hoof's corners is too near the ground; `shape` are `LegConstants`."""
    if not (model.is_terrain or any_lane(may_be_low(trunk, leg, shape))):
        return
    crank = shape.crank * vector(shape.travel * leg.cosine, -leg.sine)
    b = meeting(shape.B, shape.pivot, crank)
    d = shape.pivot + (b - shape.pivot) * shape.D.place
    f = meeting(shape.F, shape.pivot, crank)
    e = meeting(shape.E, d, f)
    a, g = shape.pivot + shape.rocker * (f - shape.pivot), f + shape.shank * (f - e)
    lowest = clearance(trunk, leg, 0.0 * crank, model)  # O
    for joint in (crank, shape.pivot, b, d, f, e, a, g):
        lowest = minimum(lowest, clearance(trunk, leg, joint, model))
    is_low = where(lowest < trunk.settings.limits[4], 1.0, 0.0)
    if model.lanes_are_legs:
        is_low = lane_sum(full_like(trunk, 0.0), is_low)
    record_violation(trunk, is_low > 0.0, LOW_JOINT)


@inline_llvm
def may_be_low(trunk, leg, shape):  # type: ignore[no-untyped-def]
    """Return where a joint may be too near level ground; elsewhere the joints need not be found.

    G's place follows from the hoof's corners; of the others only the largest distance from O is used.
    """
    toe, heel = leg.functions.toe, leg.functions.heel
    origin, low = trunk.place.imag + leg.hip.imag, trunk.settings.limits[4] + ROUNDING
    fetlock = origin + (leg.turn * (toe + shape.fetlock * (heel - toe))).imag
    return (fetlock < low) | (origin - leg.settings.length_scale[0] * shape.reach < low)


@inline_llvm
def meeting(dyad, first, second):  # type: ignore[no-untyped-def]
    """Return the hinge of two links with far ends at `first` and `second`; see `reactions.hinge_point`."""
    span = second - first
    d2 = span.real * span.real + span.imag * span.imag
    k = 0.5 * d2 + dyad.half
    return first + span * (1.0 / d2) * vector(k, dyad.side * sqrt(dyad.one2 * d2 - k * k))


@inline_llvm
def clearance(trunk, leg, joint, model):  # type: ignore[no-untyped-def]
    """Return the height above the ground of a joint given in the leg's frame [m]."""
    place = trunk.place + leg.hip + leg.settings.length_scale[0] * (leg.turn * joint)
    return place.imag - ground_height(place, model)
