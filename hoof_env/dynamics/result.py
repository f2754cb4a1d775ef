"""How an advance of the simulation ended: a value inside the loop, with a message for the border."""

from __future__ import annotations

from enum import IntEnum


class Result(IntEnum):
    """Outcome of an advance."""

    OK = 0
    NOT_FINITE = 1
    SINGULAR = 2
    DEAD_POINT = 3
    FALLEN = 4

    @property
    def message(self) -> str:
        """What happened, for people."""
        return _MESSAGES[self]


_MESSAGES = {
    Result.OK: "ok",
    Result.NOT_FINITE: "the state stopped being finite; it was put back to the last good one",
    Result.SINGULAR: "the equations of motion are singular; the state was put back to the last good one",
    Result.DEAD_POINT: (
        "a crank was driven to an angle at which its linkage does not close; "
        "the state was put back to the last good one"
    ),
    Result.FALLEN: "the trunk fell through the ground; the state was put back to the last good one",
}
