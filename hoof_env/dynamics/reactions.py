"""Joint reactions of a leg, dyad by dyad: no system of equations is solved.

A body's inertia and weight are written as two forces at its ends which have the same resultant and moment.
Two parts that meet in a point (a dyad) then give the force in that point from the laws of moments about their
far ends, and the forces at these ends from the balance of each. This starts at the feet, which are loaded by
inertia and ground alone, and ends at the crank. The list of the mechanism is followed when a kernel is
traced; lengths and masses are data.

Planar vectors are in world axes (x forward, y up, counter-clockwise) from the crank's centre. Kernels use
+, -, *, and divisions and a square root per dyad, without branches: a lane has the bits that a leg has alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, TypeVar

from hoof_env.dynamics.hoof import force_of
from hoof_env.dynamics.layout import LegRows, Reactions, TrunkRows
from hoof_env.dynamics.leg_constants import LegConstants, Meeting, Rod, Solid, Structure
from hoof_env.leg.closed_form import carry, meet, meet_acceleration, meet_rate
from hoof_env.leg.mechanism import FRAME, Dyad, Mechanism
from hoof_env.simd import Lanes, Plane, cross, full_like, perpendicular, rounded, vector, where

# -- motion ------------------------------------------------------------------------------------


class Point(NamedTuple):
    """Position from O, velocity relative to O, and acceleration plus g upward."""

    at: Plane
    v: Plane
    a: Plane


def resting(rows: LegConstants, lift: Plane) -> Point:
    """Return O itself."""
    still = vector(full_like(rows, 0.0), 0.0)
    return Point(still, still, lift)


def turning(place: Plane, frame_turn: Plane, rate: Lanes, acc: Lanes, lift: Plane) -> Point:
    """Return a point of a body that turns about O, at `place` in the leg's frame."""
    p = place * frame_turn
    return Point(p, rounded(vector(-rate * p.imag, rate * p.real)), vector(-rate * rate, acc) * p + lift)


def crank_pin(g: LegConstants, crank_turn: Plane) -> Plane:
    """Return the place of the crank's pin in the leg's frame; the crank turns clockwise before the mirror."""
    return g.crank * vector(g.travel * crank_turn.real, -crank_turn.imag)


def crank_rate(g: LegConstants, frame_rate: Lanes, rate: Lanes) -> Lanes:
    """Return the turning of the crank in the world, by its rates or accelerations."""
    return frame_rate - g.travel * rate


def meeting_point(dyad: Meeting, first: Point, second: Point) -> Point:
    """Return the motion of the point at two lengths from `first` and `second`."""
    at = meet(first.at, second.at, dyad.one2, dyad.excess, dyad.side)
    e1 = at - first.at
    e2 = at - second.at
    v = meet_rate(e1, e2, first.v, second.v)
    return Point(at, v, meet_acceleration(e1, e2, v - first.v, v - second.v, first.a, second.a))


def carried_point(place: Plane, first: Point, second: Point) -> Point:
    """Return the motion of a point that a body, or a triangle of links, carries with `first` and `second`."""
    return Point(
        carry(first.at, second.at, place), carry(first.v, second.v, place), carry(first.a, second.a, place)
    )


# -- forces ------------------------------------------------------------------------------------


def rod_loads(rod: Rod, tail: Point, head: Point) -> tuple[Plane, Plane]:
    """Return the forces at tail and head that move a rod as it moves, against its weight."""
    near, far = rod.near, rod.far
    return near * tail.a + far * head.a, near * head.a + far * tail.a


def solid_loads(solid: Solid, tail: Point, head: Point) -> tuple[Plane, Plane]:
    """Return the same for a body whose centre of mass is anywhere."""
    mixed = solid.mixed
    mirrored = vector(mixed.real, -mixed.imag)
    return solid.tail * tail.a + mixed * head.a, solid.head * head.a + mirrored * tail.a


def moment(point: Point, about: Point, force: Plane) -> Lanes:
    """Return the moment of a force at a point about another."""
    return cross(point.at - about.at, force)


def inverse_area(hinge: Point, first: Point, second: Point) -> Lanes:
    """Return 1 / (twice the area of the triangle) that two parts span, where it changes."""
    return 1.0 / cross(hinge.at - first.at, hinge.at - second.at)


def hinge_force(
    hinge: Point, first: Point, second: Point, inverse: Lanes, turn_one: Lanes, turn_two: Lanes
) -> Plane:
    """Return the force f on the first of two parts in their hinge, with one x f = turn_one about its far end,
    and two x f = -turn_two about the far end of the second."""
    one = hinge.at - first.at
    two = hinge.at - second.at
    return (inverse * turn_one) * two + (inverse * turn_two) * one


Loads = dict[str, Plane]
"""Forces by the names of the points at which they act."""


def _add(loads: Loads, point: str, force: Plane) -> None:
    loads[point] = loads[point] + force if point in loads else force


Summed = TypeVar("Summed", Lanes, Plane)


class _Statics:
    """Forces of one leg as they become known: `pins` are the forces on a body in a pin, by body and point."""

    def __init__(self, structure: Structure, constants: LegConstants, points: dict[str, Point]) -> None:
        self.structure = structure
        self.mechanism = structure.mechanism
        self.constants = constants
        self.points = points
        self.pins: dict[tuple[int, str], Plane] = {}
        self.ground: dict[int, Loads] = {}

    def rest(self, bodies: Iterable[int], unknown: Iterable[str]) -> Loads:
        """Return the forces on bodies minus the known ones; pins at points of `unknown` are not known."""
        rest: Loads = {}
        for i in bodies:
            body = self.mechanism.bodies[i]
            masses = getattr(self.constants, f"body_{body.name}")
            tail, head = self.points[body.tail], self.points[body.head]
            is_solid = body.name in self.structure.off_centre
            loads = solid_loads(masses, tail, head) if is_solid else rod_loads(masses, tail, head)
            for point, force in zip((body.tail, body.head), loads, strict=True):
                _add(rest, point, force)
            for point, force in self.ground.get(i, {}).items():
                _add(rest, point, -force)
            for point in body.all_points:
                if point not in unknown and i in self.mechanism.at(point):
                    _add(rest, point, -self.pin(i, point))
        return rest

    def pin(self, body: int, point: str) -> Plane:
        """Return the force on a body in a pin, if necessary from the forces on all further bodies there."""
        if (body, point) not in self.pins:
            others = [self.pins[other, point] for other in self.mechanism.at(point) if other != body]
            self.pins[body, point] = -_sum(others)
        return self.pins[body, point]

    def turn(self, rest: Loads, about: str) -> Lanes:
        """Return the moment of forces about a point."""
        arms = [point for point in rest if point != about]
        return _sum([moment(self.points[p], self.points[about], rest[p]) for p in arms])

    def solve_group(self, dyad: Dyad, one: tuple[int, ...], two: tuple[int, ...]) -> None:
        """Find the pins of the two parts that meet in a dyad's point."""
        point, first, second = dyad.point, dyad.first, dyad.second
        rest_one = self.rest(one, {point, first, *self.weld_points(one)})
        rest_two = self.rest(two, {point, second, *self.weld_points(two)})
        for body in self.mechanism.at(point):
            if body not in (*one, *two):
                _add(rest_two, point, self.pins[body, point])
        corners = (self.points[point], self.points[first], self.points[second])
        if self.mechanism.is_corner(dyad):
            inverse = getattr(self.constants, f"point_{point}").inverse
        else:
            inverse = inverse_area(*corners)
        turns = (self.turn(rest_one, first), self.turn(rest_two, second))
        force = hinge_force(*corners, inverse, *turns)
        rest = _sum(list(rest_two.values()))
        on_two = -force
        for body in self.mechanism.at(point):
            if body not in (*one, *two):
                on_two = on_two - self.pins[body, point]
        self.set_part(one, {point: force, first: _sum(list(rest_one.values())) - force})
        self.set_part(two, {point: on_two, second: rest + force})

    def weld_points(self, part: tuple[int, ...]) -> list[str]:
        """Return the points of the joints that welded bodies share."""
        welds = [{*weld} for weld in self.mechanism.welds if weld[0] in part]
        return [joint.point for joint in self.mechanism.joints if {joint.i, joint.j} in welds]

    def set_part(self, part: tuple[int, ...], forces: Loads) -> None:
        """Share the forces on a part among its bodies."""
        at_welds = self.weld_points(part)
        for point, force in forces.items():
            if point not in at_welds:
                (body,) = (i for i in part if i in self.mechanism.at(point))
                self.pins[body, point] = force
        for (leaf, trunk), point in zip(self.welds(part), at_welds, strict=True):
            own = _sum(list(self.rest([leaf], {point}).values()))
            self.pins[leaf, point] = own
            self.pins[trunk, point] = forces[point] - own if point in forces else -own

    def welds(self, part: tuple[int, ...]) -> list[tuple[int, int]]:
        """Return the welds of a part in the order of the joints."""
        pairs = [{joint.i, joint.j} for joint in self.mechanism.joints]
        found = [weld for weld in self.mechanism.welds if weld[0] in part]
        return sorted(found, key=lambda weld: pairs.index({*weld}))

    def lock(self, weld: tuple[int, int]) -> Lanes:
        """Return the moment on the first body of a weld by the second."""
        (point,) = (j.point for j in self.mechanism.joints if {j.i, j.j} == {*weld})
        return self.turn(self.rest([weld[0]], {point}), point)

    def joint(self, number: int) -> Plane:
        """Return the force on the first body of a joint by the second: of all bodies on its side of the
        joint."""
        cut = self.mechanism.joints[number]
        side = _side(self.mechanism, number, cut.i)
        if FRAME in side:
            return -_sum([self.pin(body, cut.point) for body in _side(self.mechanism, number, cut.j)])
        return _sum([self.pin(body, cut.point) for body in side])


def _side(mechanism: Mechanism, number: int, start: int) -> list[int]:
    """Return the bodies that stay tied to one at a pin when one of its joints is cut."""
    cut = mechanism.joints[number]
    side = [start]
    for body in side:
        for k, joint in enumerate(mechanism.joints):
            if k != number and joint.point == cut.point and body in (joint.i, joint.j):
                other = joint.j if joint.i == body else joint.i
                if other not in side:
                    side.append(other)
    return side


def _sum(forces: list[Summed]) -> Summed:
    total = forces[0]
    for force in forces[1:]:
        total = total + force
    return total


class Motion(NamedTuple):
    """Motion of crank and frame, and ground forces, of one leg: the turns exp(i theta) and exp(i beta), the
    acceleration of O plus g upward [m/s^2], and the forces of the ground on the leg [N]."""

    crank_turn: Plane
    theta_rate: Lanes
    theta_acc: Lanes
    frame_turn: Plane
    beta_rate: Lanes
    beta_acc: Lanes
    lift: Plane
    toe_force: Plane
    heel_force: Plane


def _motion_of_points(mechanism: Mechanism, g: LegConstants, motion: Motion) -> dict[str, Point]:
    """Return the motion of all points by name."""
    frame_turn, beta_rate, beta_acc, lift = motion.frame_turn, motion.beta_rate, motion.beta_acc, motion.lift
    points = {mechanism.centre: resting(g, lift)}
    for name in mechanism.pivots:
        points[name] = turning(getattr(g, f"pivot_{name}"), frame_turn, beta_rate, beta_acc, lift)
    rate = crank_rate(g, beta_rate, motion.theta_rate)
    acc = crank_rate(g, beta_acc, motion.theta_acc)
    arm = crank_pin(g, motion.crank_turn)
    points[mechanism.pin] = turning(arm, frame_turn, rate, acc, lift)
    for step in mechanism.steps:
        constant = getattr(g, f"point_{step.point}")
        if not isinstance(step, Dyad):
            points[step.point] = carried_point(constant, points[step.origin], points[step.toward])
            continue
        first, second = points[step.first], points[step.second]
        if mechanism.is_corner(step):
            points[step.point] = carried_point(constant.place, first, second)
        else:
            points[step.point] = meeting_point(constant, first, second)
    return points


def force_on_first(g: LegConstants, motion: Motion) -> Plane:
    """Return the ground's force on the first foot of a mechanism."""
    return where(g.toe_is_first > 0.5, motion.toe_force, motion.heel_force)


def force_on_second(g: LegConstants, motion: Motion) -> Plane:
    """Return the ground's force on the second foot of a mechanism."""
    return where(g.toe_is_first > 0.5, motion.heel_force, motion.toe_force)


def store(rows: Reactions, values: list[Plane | Lanes]) -> None:
    """Write numbers, or planar vectors, to consecutive rows."""
    at = 0
    for each in values:
        for part in (each.a, each.b) if isinstance(each, Plane) else (each,):
            rows[at] = part
            at += 1


def find_reactions(
    structure: Structure, trunk: TrunkRows, leg: LegRows, constants: LegConstants, reactions: Reactions
) -> None:
    """Compute the `Reactions` of one leg."""
    hip, pitch_rate, pitch_acc = leg.hip, trunk.rates.pitch_rate, trunk.pitch_acceleration
    weight = vector(full_like(trunk, 0.0), trunk.settings.gravity)
    lift = trunk.acceleration + weight + pitch_acc * perpendicular(hip) - pitch_rate * pitch_rate * hip
    motion = Motion(
        vector(leg.cosine, leg.sine),
        leg.theta_rate,
        leg.theta_acceleration,
        leg.turn,
        leg.beta_rate,
        pitch_acc + leg.beta_by_theta * leg.theta_acceleration + leg.swing_acceleration,
        lift,
        force_of(leg.toe),
        force_of(leg.heel),
    )
    solve(structure, constants, motion, reactions)


def solve(structure: Structure, g: LegConstants, motion: Motion, reactions: Reactions) -> None:
    """Compute the `Reactions` of a leg that moves like this."""
    mechanism = structure.mechanism
    statics = _Statics(structure, g, _motion_of_points(mechanism, g, motion))
    forces = [force_on_first(g, motion), force_on_second(g, motion)]
    if len(mechanism.feet) == 1:
        forces = [motion.toe_force]
    for foot, force in zip(mechanism.feet, forces, strict=True):
        _add(statics.ground.setdefault(mechanism.body_of_foot(foot), {}), foot, force)
    for group in reversed(mechanism.groups):
        statics.solve_group(group.dyad, group.one, group.two)
    rest = statics.rest([mechanism.crank], {mechanism.centre})
    statics.pins[mechanism.crank, mechanism.centre] = _sum(list(rest.values()))
    driver = statics.turn(rest, mechanism.centre)
    hip = driver
    for pivot in mechanism.pivots:
        held = [statics.pin(body, pivot) for body in mechanism.at(pivot) if body != FRAME]
        if held:
            hip = hip + moment(statics.points[pivot], statics.points[mechanism.centre], _sum(held))
    joints = [statics.joint(number) for number in range(len(mechanism.joints))]
    locks = [statics.lock(weld) for weld in mechanism.welds]
    store(reactions, [*joints, *locks, driver, hip])
