"""The mechanism of the paper's Eq. 2 as one table: 14 bodies, 20 revolute joints, a lock and a driver.

Both solvers are built from it. The constrained solver (`hoof_env.dynamics.constrained`) reads `BODIES` and
`JOINTS` and writes one constraint row after the other; the closed form (`hoof_env.leg.kinematics`) reads
`CONSTRUCTION` and finds each point from points known before it.

A body i has its centre r_i at mid-link, an orientation th_i and a half-length L_i; with
e_i = (cos th_i, sin th_i) its tail is r_i - L_i e_i and its head r_i + L_i e_i (the paper's convention).
Points carry the letters of the labelled mechanism: O crank centre, C fixed pivot, P crank pin, G ankle,
J and I the two corners of the hoof triangle below the ankle.
"""

from __future__ import annotations

from dataclasses import dataclass

POINTS = ("O", "C", "P", "B", "D", "F", "E", "G", "A", "J", "I")
"""Every named point, in the order in which the closed form finds them."""

NUMBER = {name: number for number, name in enumerate(POINTS)}
"""Position of each point in `POINTS`."""

FRAME = -1
"""Stands for 'the leg's frame' where a joint needs a body index."""


@dataclass(frozen=True)
class Body:
    """One link: `tail` and `head` are point names, `role` says what it is in the leg."""

    tail: str
    head: str
    role: str


BODIES = (
    Body("O", "P", "crank"),
    Body("P", "B", "coupler"),
    Body("C", "B", "upper triangle"),
    Body("D", "B", "upper triangle"),
    Body("C", "D", "upper triangle"),
    Body("E", "D", "connecting rod"),
    Body("F", "E", "shank, upper part"),
    Body("F", "C", "rocker"),
    Body("P", "F", "strut"),
    Body("G", "F", "shank, lower part"),
    Body("G", "J", "hoof triangle"),
    Body("J", "A", "hoof tie rod"),
    Body("I", "G", "hoof triangle"),
    Body("I", "J", "hoof triangle, sole"),
)
"""Bodies 1 to 14 of Eq. 2; index 0 here is the paper's body 1."""

CRANK = 0

TAILS, HEADS = [NUMBER[body.tail] for body in BODIES], [NUMBER[body.head] for body in BODIES]
"""Numbers of the points at the bodies' ends."""


@dataclass(frozen=True)
class Joint:
    """A revolute joint: `point` of body `i` coincides with the same point of body `j` (or of the frame).

    `i` and `j` are zero-based body indices; `j` is `FRAME` for the two pivots O and C.
    """

    point: str
    i: int
    j: int


JOINTS = (
    Joint("O", 0, FRAME),  # rows 1-2    T1 = O
    Joint("P", 1, 0),  # rows 3-4    T2 = H1
    Joint("B", 2, 1),  # rows 5-6    H3 = H2
    Joint("C", 2, FRAME),  # rows 7-8    T3 = C
    Joint("B", 3, 1),  # rows 9-10   H4 = H2
    Joint("D", 4, 3),  # rows 11-12  H5 = T4
    Joint("C", 4, FRAME),  # rows 13-14  T5 = C
    Joint("D", 5, 3),  # rows 15-16  H6 = T4
    Joint("E", 6, 5),  # rows 17-18  H7 = T6
    Joint("F", 7, 6),  # rows 19-20  T8 = T7
    Joint("C", 7, FRAME),  # rows 21-22  H8 = C
    Joint("F", 8, 6),  # rows 23-24  H9 = T7 (an assumption: Jansen's linkage; the print is garbled)
    Joint("P", 8, 0),  # rows 25-26  T9 = H1
    Joint("F", 9, 6),  # rows 27-28  H10 = T7
    Joint("G", 10, 9),  # rows 30-31  T11 = T10
    Joint("J", 11, 10),  # rows 32-33  T12 = H11
    Joint("A", 11, 7),  # rows 34-35  H12 = A, a point of link 8
    Joint("G", 12, 9),  # rows 36-37  H13 = T10
    Joint("I", 13, 12),  # rows 38-39  T14 = T13
    Joint("J", 13, 11),  # rows 40-41  H14 = T12
)
"""The 20 revolute joints of Eq. 2 (40 rows)."""

LOCK = (9, 6)
"""Row 29: bodies 10 and 7 keep one orientation (link 10 extends link 7 past F)."""

DRIVER = CRANK
"""Row 42: the crank's orientation is prescribed, th_1 = phi - theta (the crank turns clockwise)."""


@dataclass(frozen=True)
class Dyad:
    """`point` lies at length `from_first` from `first` and `from_second` from `second`.

    The lengths are names of `Geometry.lengths`; which of the two intersections is meant (left, +1, or
    right, -1, of the line from `first` to `second`) is part of the geometry: `Geometry.assembly[point]`.
    """

    point: str
    first: str
    second: str
    from_first: str
    from_second: str


@dataclass(frozen=True)
class Extension:
    """`point` lies on the line from `first` through `second`.

    Its distance from `origin` (one of the two) is the length named `distance`; the link between the two has
    the length named `span`.
    """

    point: str
    first: str
    second: str
    span: str
    origin: str
    distance: str


CONSTRUCTION: tuple[Dyad | Extension, ...] = (
    Dyad("B", "C", "P", "CB", "PB"),
    Dyad("D", "C", "B", "CD", "BD"),
    Dyad("F", "C", "P", "CF", "PF"),
    Dyad("E", "D", "F", "DE", "EF"),
    Extension("G", "E", "F", "EF", "F", "FG"),
    Extension("A", "C", "F", "CF", "C", "CA"),
    Dyad("J", "G", "A", "GJ", "AJ"),
    Dyad("I", "G", "J", "GI", "IJ"),
)
"""Closed form, step by step: from O, C and P to the hoof without iteration."""

DYADS = tuple(step for step in CONSTRUCTION if isinstance(step, Dyad))

LENGTHS = ("OP", "PB", "CB", "BD", "CD", "DE", "EF", "CF", "PF", "FG", "GJ", "GI", "IJ", "AJ", "CA")
"""Names of the 15 lengths of a geometry [m]; with the pivot C (2 numbers) they are all it has."""

BODY_LENGTHS = ("OP", "PB", "CB", "BD", "CD", "DE", "EF", "CF", "PF", "FG", "GJ", "AJ", "GI", "IJ")
"""The length of each body, in the order of `BODIES`."""
