"""The header and the parameters of a .c3d, checked before a library follows what they say.

A parameter section is a chain: each entry says how far the next one is. A damaged link leads into numbers
that are taken for names and sizes then. Checked is what every file has, whichever program wrote it.
"""

from __future__ import annotations

import math
import struct
from pathlib import Path

from hoof_env.errors import DataFileError

# bytes of a block; the second byte of every c3d
BLOCK = 512
KEY = 80
MIPS = 86  # the code of processors that write the high byte first
FIRST = 4  # bytes of a parameter section before its first entry
BYTES = {-1: 1, 1: 1, 2: 2, 4: 4}  # of a number by the type of a parameter: text, byte, integer, float
MOST_DIMENSIONS = 7
PRINTED = range(32, 127)  # ASCII


def frames_of(path: Path) -> tuple[int, int]:
    """The first and the last frame that the header names. `DataFileError` of a file that is no c3d, or one
    with a damaged parameter section."""
    with path.open("rb") as file:
        head = file.read((255 + 255 + 1) * BLOCK)
    begin = (head[0] - 1) * BLOCK if head else 0
    if len(head) < 2 * BLOCK or head[1] != KEY or not 0 < begin < len(head) - FIRST:
        raise DataFileError(
            f"record {str(path)!r}: cannot read it (expected a c3d, whose second byte is {KEY} and whose "
            "first is the number of the block where its parameters begin)"
        )
    order = ">" if head[begin + 3] == MIPS else "<"
    try:
        _check_parameters(head, begin + FIRST, order)
    except (struct.error, IndexError):
        raise DataFileError(
            f"record {str(path)!r}: cannot read it (its parameters lead beyond the end of the file)"
        ) from None
    except ValueError as error:
        raise DataFileError(
            f"record {str(path)!r}: cannot read it (its parameters are damaged: {error})"
        ) from None
    first, last = struct.unpack_from(f"{order}2H", head, 6)
    return int(first), int(last)


def _check_parameters(head: bytes, at: int, order: str) -> None:
    """Follow the chain of entries from byte `at` on. `ValueError` of one that is none, `struct.error` and
    `IndexError` beyond the end."""
    while head[at] != 0:
        length, group = struct.unpack_from("2b", head, at)
        name = head[at + 2 : at + 2 + abs(length)]
        if group == 0 or any(sign not in PRINTED for sign in name):
            raise ValueError(f"no name in byte {at + 1}")
        link = at + 2 + abs(length)
        (ahead,) = struct.unpack_from(f"{order}h", head, link)
        if group > 0:
            end = link + 2 + _size(head, link + 2, name.decode("ascii"))
            if 0 < ahead < end - link:
                raise ValueError(f"{name.decode('ascii')} is longer than its place")
        if ahead == 0:
            return
        if ahead < 2:
            raise ValueError(f"{name.decode('ascii')} leads backward")
        at = link + ahead
        if at >= len(head):
            raise IndexError


def _size(head: bytes, at: int, name: str) -> int:
    """Bytes of a parameter from its type on to the end of its numbers."""
    kind, dimensions = struct.unpack_from("bB", head, at)
    if kind not in BYTES or dimensions > MOST_DIMENSIONS:
        raise ValueError(f"{name} has type {kind} and {dimensions} dimensions")
    numbers = math.prod(head[at + 2 : at + 2 + dimensions])
    size = 2 + dimensions + BYTES[kind] * numbers
    if at + size > len(head):
        raise IndexError
    return size
