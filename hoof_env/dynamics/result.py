"""How an advance of the simulation ended: a value inside the loop, with a message for the border."""

from __future__ import annotations

from enum import IntEnum


class Result(IntEnum):
    """Outcome of an advance."""

    OK = 0
    NOT_FINITE = 1
    SINGULAR = 2

    @property
    def message(self) -> str:
        """What happened, for people."""
        return _MESSAGES[self]


_MESSAGES = {
    Result.OK: "ok",
    Result.NOT_FINITE: "the state stopped being finite; it was put back to the last good one",
    Result.SINGULAR: "the equations of motion are singular; the state was put back to the last good one",
}
