"""Checks of the header and the parameters of a .c3d, before a library trusts them.

A parameter section is a chain: each entry holds the distance to the next one. A damaged link leads into
numbers, which are then taken for names and sizes. The checks hold for files of all programs.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

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


DEC_PROCESSOR = 85
"""Code of processors whose floats have another form than IEEE's."""


class Entry(NamedTuple):
    """Numbers of a parameter: number of their first byte in the file, and format of `struct` for all."""

    at: int
    form: str


@dataclass(frozen=True)
class Head:
    """Header and parameter section of a file.

    Attributes:
        content: bytes from the start of the file to the end of the section, or further.
        begin: number of the section's first byte.
        order: order of bytes as `struct` has it, "<" or ">".
        entries: numbers of parameters by group and name, as "POINT:USED".
        groups: numbers of groups by name.
        last: number of the first byte of the last entry.
        end: number of the byte after the last entry.
    """

    content: bytes
    begin: int
    order: str
    entries: dict[str, Entry]
    groups: dict[str, int]
    last: int
    end: int

    @property
    def frames(self) -> tuple[int, int]:
        """First and last frame that the header names."""
        first, last = self.words(4, 2)
        return first, last

    @property
    def is_dec(self) -> bool:
        """True if its floats are not IEEE's."""
        return self.content[self.begin + 3] == DEC_PROCESSOR

    def words(self, number: int, count: int = 1) -> tuple[int, ...]:
        """Return words of the header, unsigned, by the number of the first, from 1."""
        return struct.unpack_from(f"{self.order}{count}H", self.content, 2 * number - 2)

    def real(self, number: int) -> float:
        """Return a float of the header by the number of its first word, from 1."""
        return float(struct.unpack_from(f"{self.order}f", self.content, 2 * number - 2)[0])

    def numbers(self, name: str) -> tuple[float, ...]:
        """Return the numbers of a parameter, none if the file lacks it."""
        entry = self.entries.get(name)
        return struct.unpack_from(entry.form, self.content, entry.at) if entry else ()


def head_of(path: Path) -> Head:
    """Read the header and the parameter section of a file.

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
        return _parameters(head, begin, order)
    except (struct.error, IndexError):
        raise DataFileError(
            f"record {str(path)!r}: cannot read it (its parameters lead beyond the end of the file)"
        ) from None
    except ValueError as error:
        raise DataFileError(
            f"record {str(path)!r}: cannot read it (its parameters are damaged: {error})"
        ) from None


def _parameters(head: bytes, begin: int, order: str) -> Head:
    """Follow the chain of entries.

    Args:
        head: bytes of the file.
        begin: number of the section's first byte.
        order: order of bytes as `struct` has it, "<" or ">".

    Raises:
        ValueError: an entry is damaged.
        struct.error, IndexError: the chain leads beyond the end.
    """
    at = last = begin + SECTION_HEADER_BYTES
    found: list[tuple[int, str, Entry]] = []
    groups: dict[str, int] = {}
    while head[at] != 0:
        # The length of a name is negative if the entry is locked; the number of a group is negative in the
        # entry that names the group, and positive in the entries of its parameters.
        length, group = struct.unpack_from("2b", head, at)
        raw = head[at + 2 : at + 2 + abs(length)]
        if group == 0 or any(sign not in PRINTED for sign in raw):
            raise ValueError(f"no name in byte {at + 1}")
        name = raw.decode("ascii")
        link = at + 2 + abs(length)
        (ahead,) = struct.unpack_from(f"{order}h", head, link)
        end = link + 3 + head[link + 2]  # of a group: its description and the length of it
        if group > 0:
            size, entry = _numbers(head, link + 2, name, order)
            end = link + 2 + size
            if 0 < ahead < end - link:
                raise ValueError(f"{name} is longer than its place")
            found.append((group, name, entry))
            end += 1 + head[end] if end < len(head) else 0
        else:
            groups[name.upper()] = -group
        last = at
        if ahead == 0:  # the last entry
            at = end
            break
        # The distance counts from its own two bytes. A smaller one would make an endless loop.
        if ahead < 2:
            raise ValueError(f"{name} leads backward")
        at = link + ahead
        if at >= len(head):
            raise IndexError
    by_number = {number: name for name, number in groups.items()}
    entries = {f"{by_number.get(group, '')}:{name.upper()}": entry for group, name, entry in found}
    return Head(head, begin, order, entries, groups, last, at)


def _numbers(head: bytes, at: int, name: str, order: str) -> tuple[int, Entry]:
    """Return the bytes of a parameter from its type, in byte `at`, to the end of its numbers; and these."""
    kind, dimensions = struct.unpack_from("bB", head, at)
    if kind not in BYTES_BY_TYPE or dimensions > MAX_DIMENSIONS:
        raise ValueError(f"{name} has type {kind} and {dimensions} dimensions")
    count = math.prod(head[at + 2 : at + 2 + dimensions])
    size = 2 + dimensions + BYTES_BY_TYPE[kind] * count
    if at + size > len(head):
        raise IndexError
    # Counts of frames are integers without a sign, whatever c3d says of integers.
    form = {-1: "B", 1: "B", 2: "H", 4: "f"}[kind]
    return size, Entry(at + 2 + dimensions, f"{order}{count}{form}")
