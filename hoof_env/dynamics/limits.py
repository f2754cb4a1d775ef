"""Limits at which a motion ends: pitch and height of the trunk, joints near the ground.

Limits are checked after every `CHECK_EVERY` whole steps and after the last, and a violation is stored until
the engine's call ends, so that a joint that dips between two calls is not missed. Beyond a limit the motion
goes on, and its state is as good as any other.
"""

from __future__ import annotations

from hoof_env.dynamics.layout import LegRows, TrunkRows
from hoof_env.dynamics.leg_constants import LegConstants, Meeting
from hoof_env.dynamics.model import Model
from hoof_env.dynamics.parts import Result
from hoof_env.ground.terrain import surface
from hoof_env.leg.closed_form import carry, meet
from hoof_env.leg.mechanism import Dyad, Mechanism
from hoof_env.simd import (
    Lanes,
    Mask,
    Plane,
    Truth,
    any_lane,
    full_like,
    lane_sum,
    minimum,
    rounded,
    vector,
    when,
    where,
)

CHECK_EVERY = 5
"""Whole steps from one check to the next: finding all joints takes square roots and quotients."""

ROUNDING = 1e-6  # [m], more than G's places differ by rounding

PITCH, HEIGHT, LOW_JOINT = float(Result.PITCH), float(Result.HEIGHT), float(Result.LOW_JOINT)


def has_moved(result: Lanes) -> Mask:
    """Return where the motion of a call was simulated, within the limits or beyond one."""
    return (result == 0.0) | (result >= PITCH)


def clear_limits(trunk: TrunkRows) -> None:
    """Forget the limits that an earlier call passed."""
    trunk.violated_limit[0] = 0.0


def record_violation(trunk: TrunkRows, is_beyond: Truth, result: float) -> None:
    """Store the first limit that was passed."""
    before = trunk.violated_limit[0]
    trunk.violated_limit[0] = where((before == 0.0) & is_beyond, result, before)


def ground_height(place: Plane, model: Model) -> Lanes:
    """Return the height of the ground below a point [m]."""
    if not model.is_terrain:
        return 0.0 * place.real
    return surface(place.real, model.ground_cells, model.ground_origin, model.ground_per_metre)[0]


def check_trunk(trunk: TrunkRows, model: Model) -> None:
    """Check the trunk's pitch, and its height above the ground."""
    limits, pitch = trunk.settings.limits, trunk.stage.pitch
    height = trunk.place.imag - ground_height(trunk.place, model)
    record_violation(trunk, (pitch < limits[0]) | (pitch > limits[1]), PITCH)
    record_violation(trunk, (height < limits[2]) | (height > limits[3]), HEIGHT)


def moved(turn: Plane, place: LegConstants) -> Plane:
    """Return the point of the crank at its place in the leg's frame; `turn` is exp(i theta)."""
    return rounded(vector(place.travel * turn.real, -turn.imag) * place.crank)


def meeting(dyad: Meeting, first: Plane, second: Plane) -> Plane:
    """Return the point at two lengths from `first` and `second`."""
    return meet(first, second, dyad.one2, dyad.excess, dyad.side)


def height_of_sole(trunk: TrunkRows, leg: LegRows, place: Plane) -> Lanes:
    """Return the height of a point of the sole, at `place` from the toe towards the heel [m]."""
    toe, heel = leg.functions.toe, leg.functions.heel
    return trunk.place.imag + leg.hip.imag + (leg.turn * (toe + place * (heel - toe))).imag


def least_height(trunk: TrunkRows, leg: LegRows, reach: Lanes) -> Lanes:
    """Return a height that no point within `reach` of O comes below [m]."""
    return trunk.place.imag + leg.hip.imag - leg.settings.length_scale[0] * reach


def lower_bound(mechanism: Mechanism, trunk: TrunkRows, leg: LegRows, shape: LegConstants) -> Lanes:
    """Return a lower bound on the height of all joints [m], which does not need their positions."""
    low = least_height(trunk, leg, shape.reach)
    for name in mechanism.sole:
        low = minimum(low, height_of_sole(trunk, leg, getattr(shape, f"sole_{name}")))
    return low


def lowest_joint(
    mechanism: Mechanism, trunk: TrunkRows, leg: LegRows, shape: LegConstants, model: Model
) -> Lanes:
    """Return the height above the ground of the lowest joint that is not a foot [m]."""
    crank = moved(vector(leg.cosine, leg.sine), shape)
    places = {mechanism.centre: crank * 0.0, mechanism.pin: crank}
    places |= {name: getattr(shape, f"pivot_{name}") for name in mechanism.pivots}
    for step in mechanism.steps:
        constant = getattr(shape, f"point_{step.point}")
        if not isinstance(step, Dyad):
            places[step.point] = carry(places[step.origin], places[step.toward], constant)
            continue
        first, second = places[step.first], places[step.second]
        if mechanism.is_corner(step):
            places[step.point] = carry(first, second, constant.place)
        else:
            places[step.point] = meeting(constant, first, second)
    lowest = clearance(trunk, leg, places[mechanism.centre], model)
    for name in mechanism.points[1:]:
        if name not in mechanism.feet:
            lowest = minimum(lowest, clearance(trunk, leg, places[name], model))
    return lowest


def check_joints(
    mechanism: Mechanism, trunk: TrunkRows, leg: LegRows, shape: LegConstants, model: Model
) -> None:
    """Check that no joint of a leg but its feet is too near the ground."""
    low = trunk.settings.limits[4]

    @when(model.is_terrain or any_lane(lower_bound(mechanism, trunk, leg, shape) < low + ROUNDING))
    def _() -> None:
        is_low = where(lowest_joint(mechanism, trunk, leg, shape, model) < low, 1.0, 0.0)
        if model.lanes_are_legs:
            is_low = lane_sum(full_like(trunk, 0.0), is_low)
        record_violation(trunk, is_low > 0.0, LOW_JOINT)


def clearance(trunk: TrunkRows, leg: LegRows, joint: Plane, model: Model) -> Lanes:
    """Return the height above the ground of a joint given in the leg's frame [m]."""
    place = trunk.place + leg.hip + leg.settings.length_scale[0] * (leg.turn * joint)
    return place.imag - ground_height(place, model)
