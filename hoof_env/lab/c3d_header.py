"""Checks of the header and the parameters of a .c3d, before a library trusts them.

A parameter section is a chain: each entry holds the distance to the next one. A damaged link leads into
numbers, which are then taken for names and sizes. The checks hold for files of all programs.
"""

from __future__ import annotations

import math
import struct
from pathlib import Path

from hoof_env.errors import DataFileError

BLOCK = 512
"""Bytes of a block."""

C3D_MARK = 80
"""Second byte of every c3d."""

BIG_ENDIAN_PROCESSOR = 86
"""Code of processors that write the high byte first."""

SECTION_HEADER_BYTES = 4
"""Bytes of a parameter section before its first entry."""

BYTES_BY_TYPE = {-1: 1, 1: 1, 2: 2, 4: 4}
"""Bytes of a number by the type of a parameter: text, byte, integer, float."""

MAX_DIMENSIONS = 7
"""Largest number of dimensions of a parameter that c3d allows."""

PRINTED = range(32, 127)
"""Printable characters of ASCII, of which names consist."""


def frames_of(path: Path) -> tuple[int, int]:
    """Return the first and the last frame that the header names.

    Raises:
        DataFileError: the file is not a c3d, or its parameter section is damaged.
    """
    with path.open("rb") as file:
        # The section begins in block 255 at most and has 255 blocks at most: each number is one byte.
        head = file.read((255 + 255 + 1) * BLOCK)
    begin = (head[0] - 1) * BLOCK if head else 0
    if len(head) < 2 * BLOCK or head[1] != C3D_MARK or not 0 < begin < len(head) - SECTION_HEADER_BYTES:
        raise DataFileError(
            f"record {str(path)!r}: cannot read it (expected a c3d: the second byte is {C3D_MARK}, the first "
            "the number of the block where the parameters begin)"
        )
    order = ">" if head[begin + 3] == BIG_ENDIAN_PROCESSOR else "<"
    try:
        _check_parameters(head, begin + SECTION_HEADER_BYTES, order)
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
    """Follow the chain of entries from byte `at` on.

    Args:
        head: bytes of the file.
        at: number of the first entry's first byte.
        order: order of bytes as `struct` has it, "<" or ">".

    Raises:
        ValueError: an entry is damaged.
        struct.error, IndexError: the chain leads beyond the end.
    """
    while head[at] != 0:
        # The length of a name is negative if the entry is locked; the number of a group is negative in the
        # entry that names the group, and positive in those of its parameters.
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
        if ahead == 0:  # the last entry
            return
        # The distance counts from its own two bytes. A smaller one would make an endless loop.
        if ahead < 2:
            raise ValueError(f"{name.decode('ascii')} leads backward")
        at = link + ahead
        if at >= len(head):
            raise IndexError


def _size(head: bytes, at: int, name: str) -> int:
    """Return the bytes of a parameter from its type, in byte `at`, to the end of its numbers."""
    kind, dimensions = struct.unpack_from("bB", head, at)
    if kind not in BYTES_BY_TYPE or dimensions > MAX_DIMENSIONS:
        raise ValueError(f"{name} has type {kind} and {dimensions} dimensions")
    numbers = math.prod(head[at + 2 : at + 2 + dimensions])
    size = 2 + dimensions + BYTES_BY_TYPE[kind] * numbers
    if at + size > len(head):
        raise IndexError
    return size
