"""The structure of a leg as a list: points in solving order, bodies, joints, feet.

A `Mechanism` is the structure alone. It is hashable, and kernels are made for it. Its lengths have only
names, for which `Geometry` has the numbers. `mechanism_list.read_mechanism` reads and checks the list of a
preset:

    {"fixed": ["O", "B"],                         the first is the centre of the crank
     "crank": {"point": "A", "length": "OA"},
     "points": [{"point": "C", "dyad": ["B", "A"], "lengths": ["BC", "AC"]},
                {"point": "D", "body": "AC", "from": "C", "along": "-CD"}],
     "bodies": [{"name": "OA", "tail": "O", "head": "A"}, {"name": "AC", "tail": "A", "head": "C"},
                {"name": "BC", "tail": "B", "head": "C"}],
     "joints": [["O", "OA", "frame"], ["A", "AC", "OA"], ["C", "BC", "AC"], ["B", "BC", "frame"]],
     "feet": ["D"]}

To read a mechanism: `points` names all points in solving order; `steps` finds all points after the fixed
points and the crank's pin; `bodies`, `joints` and `welds` are numbered from 0 in the order of the list;
`tails` and `heads` are the numbers, among `points`, of the bodies' ends. A body's axes start at its tail:
along points to its head, across to the left. `Geometry` adds numbers, in the same orders: `body_lengths`,
`body_masses`, `body_centres`, `body_inertias`, `fixed` (places of the fixed points), and `leg.pose` has the
places of all points.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

FRAME = -1
"""Number of the leg's frame among the bodies of a joint."""

FRAME_NAME = "frame"
"""Name of the leg's frame in the list of joints."""


@dataclass(frozen=True)
class Dyad:
    """A point at the length `from_first` from `first` and `from_second` from `second`.

    Which of the two intersections is meant (left, +1, or right, -1, of the line from `first` to `second`) is
    part of the geometry: `Geometry.assembly[point]`.
    """

    point: str
    first: str
    second: str
    from_first: str
    from_second: str


@dataclass(frozen=True)
class BodyPoint:
    """A point of a body, by its coordinates from the body's end `origin`.

    The axis "along" points from `origin` to the other end, `toward`. The axis "across" points to its left.
    Each coordinate is the name of a length: a leading "-" reverses it, and "" is 0.
    """

    point: str
    body: str
    origin: str
    toward: str
    span: str
    along: str
    across: str = ""


@dataclass(frozen=True)
class Body:
    """A rigid body with the ends `tail` and `head`, whose distance is the length named `length`.

    `points` are its further points, `role` is its function in the leg.
    """

    name: str
    tail: str
    head: str
    length: str
    points: tuple[str, ...] = ()
    role: str = field(default="", compare=False)

    @property
    def all_points(self) -> tuple[str, ...]:
        """Tail, head and further points."""
        return (self.tail, self.head, *self.points)


@dataclass(frozen=True)
class Joint:
    """A revolute joint: `point` of body `i` coincides with the same point of body `j`, or of the `FRAME`."""

    point: str
    i: int
    j: int


@dataclass(frozen=True)
class Group:
    """The two rigid parts that meet in a dyad's point. Bodies that are welded together are one part.

    Numbers of the bodies of each part: `one` has the dyad's first point, `two` its second.
    """

    dyad: Dyad
    one: tuple[int, ...]
    two: tuple[int, ...]


@dataclass(frozen=True)
class Mechanism:
    """The structure of a leg: a closed linkage whose one degree of freedom is its crank's.

    Attributes:
        fixed: points of the leg's frame; the first is the centre of the crank.
        pin: the point at which the crank carries the linkage.
        crank_length: name of the crank's length.
        steps: construction of each further point from points before it.
        bodies, joints, welds: in the order of the rows of Eq. 2. A weld fixes the relative angle of two
            bodies that share a joint.
        feet: points that touch the ground, one or two.
    """

    fixed: tuple[str, ...]
    pin: str
    crank_length: str
    steps: tuple[Dyad | BodyPoint, ...]
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    welds: tuple[tuple[int, int], ...]
    feet: tuple[str, ...]

    def to_mapping(self) -> dict[str, Any]:
        """Return the list that `mechanism_list.read_mechanism` reads."""
        names = [body.name for body in self.bodies]
        points: list[dict[str, Any]] = []
        for step in self.steps:
            if isinstance(step, Dyad):
                lengths = [step.from_first, step.from_second]
                points.append({"point": step.point, "dyad": [step.first, step.second], "lengths": lengths})
            else:
                place = {"body": step.body, "from": step.origin, "along": step.along, "across": step.across}
                points.append({"point": step.point} | {key: text for key, text in place.items() if text})
        bodies = [
            {"name": body.name, "tail": body.tail, "head": body.head}
            | ({} if body.length == body.name else {"length": body.length})
            | ({"points": list(body.points)} if body.points else {})
            | ({"role": body.role} if body.role else {})
            for body in self.bodies
        ]
        return {
            "fixed": list(self.fixed),
            "crank": {"point": self.pin, "length": self.crank_length},
            "points": points,
            "bodies": bodies,
            "joints": [
                [joint.point, names[joint.i], FRAME_NAME if joint.j == FRAME else names[joint.j]]
                for joint in self.joints
            ],
            "welds": [[names[i], names[j]] for i, j in self.welds],
            "feet": list(self.feet),
        }

    @property
    def centre(self) -> str:
        """The point about which the crank turns."""
        return self.fixed[0]

    @property
    def pivots(self) -> tuple[str, ...]:
        """The fixed points except the crank's centre."""
        return self.fixed[1:]

    @cached_property
    def points(self) -> tuple[str, ...]:
        """Every named point, in solving order."""
        return (*self.fixed, self.pin, *(step.point for step in self.steps))

    @cached_property
    def number(self) -> dict[str, int]:
        """Position of each point in `points`."""
        return {name: number for number, name in enumerate(self.points)}

    @cached_property
    def dyads(self) -> tuple[Dyad, ...]:
        """The steps that are dyads."""
        return tuple(step for step in self.steps if isinstance(step, Dyad))

    @cached_property
    def body_lengths(self) -> tuple[str, ...]:
        """The name of the length of each body."""
        return tuple(body.length for body in self.bodies)

    @cached_property
    def lengths(self) -> tuple[str, ...]:
        """Names of all lengths, the bodies' lengths first."""
        named = [*self.body_lengths, self.crank_length]
        for step in self.steps:
            if isinstance(step, Dyad):
                named += [step.from_first, step.from_second]
            else:
                named += [step.span, *(text.lstrip("-") for text in (step.along, step.across) if text)]
        return tuple(dict.fromkeys(named))

    @cached_property
    def tails(self) -> list[int]:
        """Numbers of the points at the bodies' tails."""
        return [self.number[body.tail] for body in self.bodies]

    @cached_property
    def heads(self) -> list[int]:
        """Numbers of the points at the bodies' heads."""
        return [self.number[body.head] for body in self.bodies]

    @cached_property
    def crank(self) -> int:
        """Number of the body that is driven."""
        return next(
            i for i, body in enumerate(self.bodies) if {self.centre, self.pin} == {body.tail, body.head}
        )

    @cached_property
    def parts(self) -> tuple[tuple[int, ...], ...]:
        """The rigid part to which each body belongs: itself and the bodies welded to it."""
        part = [{i} for i in range(len(self.bodies))]
        for one, other in self.welds:
            whole = part[one] | part[other]
            for i in whole:
                part[i] = whole
        return tuple(tuple(sorted(members)) for members in part)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """The two parts that each dyad adds, in solving order; a dyad within a body adds none."""
        found = []
        for dyad in self.dyads:
            one = self.bodies_with(dyad.first, dyad.point)
            two = self.bodies_with(dyad.second, dyad.point)
            if not set(one) & set(two):
                found.append(Group(dyad, self.parts[one[0]], self.parts[two[0]]))
        return tuple(found)

    def is_corner(self, dyad: Dyad) -> bool:
        """Return whether the two points that define a dyad are at a constant distance."""
        return {dyad.first, dyad.second} <= {*self.fixed} or bool(self.bodies_with(dyad.first, dyad.second))

    @cached_property
    def plates(self) -> tuple[tuple[str, ...], ...]:
        """Groups of three or more points at constant distances: triangles of links, and bodies with
        further points."""
        corners = [dyad for dyad in self.dyads if self.is_corner(dyad)]
        triangles = [(dyad.first, dyad.second, dyad.point) for dyad in corners]
        return (*triangles, *(body.all_points for body in self.bodies if body.points))

    @cached_property
    def edges(self) -> tuple[tuple[str, str], ...]:
        """Edges of bodies with further points than tail and head, whose plate may be a straight rod."""
        return tuple(
            pair
            for body in self.bodies
            if body.points
            for pair in pairwise((*body.all_points, body.all_points[0]))
            if {*pair} != {body.tail, body.head}
        )

    @cached_property
    def sole(self) -> tuple[str, ...]:
        """The points at constant distances from both feet, if there are two."""
        if len(self.feet) < 2:
            return ()
        rigid = [{*plate} for plate in self.plates] + [{body.tail, body.head} for body in self.bodies]

        def is_rigid(point: str) -> bool:
            return all(any({point, foot} <= group for group in rigid) for foot in self.feet)

        feet_are_rigid = any({*self.feet} <= group for group in rigid)
        others = [point for point in self.points if point not in self.feet]
        return tuple(point for point in others if feet_are_rigid and is_rigid(point))

    def body_of_foot(self, foot: str) -> int:
        """Return the body on which the ground acts in a foot: one with both feet, or the first with this
        foot."""
        return (self.bodies_with(*self.feet) or self.bodies_with(foot))[0]

    def bodies_with(self, *points: str) -> list[int]:
        """Return the bodies that have all these points."""
        return [i for i, body in enumerate(self.bodies) if {*points} <= {*body.all_points}]

    def at(self, point: str) -> list[int]:
        """Return the bodies that joints connect at a point, possibly `FRAME`."""
        pairs = [(joint.i, joint.j) for joint in self.joints if joint.point == point]
        return list(dict.fromkeys(number for pair in pairs for number in pair))
