"""The mechanism of the paper's Eq. 2 by its parts, for tests of that leg."""

from __future__ import annotations

from hoof_env.leg.mechanism import FRAME, Dyad
from hoof_env.leg.mechanism_list import PAPER

POINTS = PAPER.points
NUMBER = PAPER.number
BODIES = PAPER.bodies
CRANK = PAPER.crank
JOINTS = PAPER.joints
(LOCK,) = PAPER.welds
CONSTRUCTION = PAPER.steps
DYADS = PAPER.dyads
LENGTHS = PAPER.lengths
BODY_LENGTHS = PAPER.body_lengths

__all__ = [
    "BODIES",
    "BODY_LENGTHS",
    "CONSTRUCTION",
    "CRANK",
    "DYADS",
    "FRAME",
    "JOINTS",
    "LENGTHS",
    "LOCK",
    "NUMBER",
    "POINTS",
    "SIZE",
    "SOLE",
    "Dyad",
]

SOLE = PAPER.body_of_foot("I")
SIZE = 3 * len(BODIES)
