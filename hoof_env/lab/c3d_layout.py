"""Layout of the data of a .c3d, and copies of files whose header and parameters contradict each other.

Counts of frames, points and channels stand in the header, in parameters, and follow from the file's length.
Many are stale, and the header and POINT:FRAMES cannot count beyond 65535; ezc3d believes some of them. The
layout that fills the file is taken. Where ezc3d would read another one, it gets copies with counts that
agree, of `MAX_FRAMES` frames each, and notes name what was not believed.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from hoof_env.errors import DataFileError
from hoof_env.lab.c3d_header import BLOCK, Head

MAX_FRAMES = 32_767
"""Largest number of frames of a copy, which any reader takes for positive."""

MAX_RATIO_ERROR = 0.02
"""Largest relative error of a rate, and of a ratio of rates from a whole number: 600 Hz beside 59.94 Hz."""

WORD = 1 << 16
"""Values of a word: TRIAL has counts of frames as two of them, the lower one first."""

TRIAL_FIELDS = ("ACTUAL_START_FIELD", "ACTUAL_END_FIELD")
"""Parameters of the group TRIAL with the first and the last frame."""


@dataclass(frozen=True)
class Layout:
    """Layout of the data.

    Attributes:
        start: number of the first byte.
        real: True if numbers are floats of four bytes, False if integers of two.
        points: number of points in a frame.
        channels: number of analog channels.
        samples: samples of each channel in a frame.
    """

    start: int
    real: bool
    points: int
    channels: int
    samples: int

    @property
    def frame_bytes(self) -> int:
        """Bytes of a frame."""
        return (4 if self.real else 2) * (4 * self.points + self.channels * self.samples)

    def held(self, size: int) -> int:
        """Return the number of frames in a file of `size` bytes, its padding included."""
        return max(size - self.start, 0) // self.frame_bytes if self.frame_bytes else 0

    def fills(self, size: int, frames: int) -> bool:
        """Return True if so many frames fill a file of `size` bytes but for the padding of a block."""
        return bool(self.frame_bytes) and 0 <= size - self.start - frames * self.frame_bytes <= BLOCK


def readable(path: Path, head: Head, folder: Path) -> tuple[list[Path], int, list[str]]:
    """Return the files that ezc3d reads right, and what they hold.

    Args:
        path: the file.
        head: its header and parameters.
        folder: a folder for copies.

    Returns:
        The file itself, or copies of its parts in order; their number of frames; and notes on counts that
        differ from the data's.

    Raises:
        DataFileError: the file holds fewer frames than it states.
    """
    stated = _stated(head)
    size = path.stat().st_size
    believed = _believed(head)
    layout = _layout(head, size, [*stated.values()], believed)
    if head.is_dec or not layout.frame_bytes:
        return [path], stated["header"], []
    frames = _frames(path, layout, size, stated)
    notes = _notes(head, stated, frames, believed, layout)
    if layout == believed and stated.get("POINT:FRAMES", stated["header"]) == frames:
        return [path], frames, notes
    return _copies(path, head, layout, frames, folder), frames, notes


def _frames(path: Path, layout: Layout, size: int, stated: dict[str, int]) -> int:
    """Return the number of frames in a file of `size` bytes, of which `stated` are those by `_stated`.

    Raises:
        DataFileError: the file holds fewer than all that it states.
    """
    held = layout.held(size)
    most = max(stated.values())
    fitting = [count for count in stated.values() if 0 < count <= held]
    if not fitting and most > 0:
        raise DataFileError(
            f"record {str(path)!r}: expected {most} frames, as its header says, found {held}: is the "
            "file cut off? Copy or export it again"
        )
    filling = sorted({count for count in fitting if layout.fills(size, count)})
    if len(filling) == 1:
        return filling[0]
    # What is left may be padding, which is less than a block or empty.
    filled = held - _empty(path, layout, held)
    of_points = stated.get("POINT:FRAMES", 0)
    if of_points in filling and of_points >= filled:
        return of_points
    return max([filled, *fitting])


def _stated(head: Head) -> dict[str, int]:
    """Return the numbers of frames that the header and parameters state, by the place."""
    first, last = head.frames
    counts = {"header": last - max(first, 1) + 1}
    for name in ("POINT:FRAMES", "POINT:LONG_FRAMES"):
        values = head.numbers(name)
        if values and np.isfinite(values[0]):
            counts[name] = int(values[0])
    ends = [head.numbers(f"TRIAL:{name}")[:2] for name in TRIAL_FIELDS]
    if all(len(words) == 2 for words in ends):
        begin, end = (int(low) + WORD * int(high) for low, high in ends)
        counts["TRIAL:ACTUAL_END_FIELD"] = end - begin + 1
    return {name: count for name, count in counts.items() if count > 0 or name == "header"}


def _believed(head: Head) -> Layout:
    """Return the layout that ezc3d reads: counts of the parameters, the header's start and form."""
    (used, *_), (channels, *_) = (head.numbers(f"{group}:USED") or (0,) for group in ("POINT", "ANALOG"))
    return Layout((head.words(9)[0] - 1) * BLOCK, head.real(7) < 0, int(used), int(channels), _samples(head))


def _samples(head: Head) -> int:
    """Return the samples of a channel in a frame by the rates, 0 if they do not tell."""
    (rate, *_), (camera, *_) = (head.numbers(f"{group}:RATE") or (0.0,) for group in ("ANALOG", "POINT"))
    if not rate > 0:
        return 0
    ratio = min(rate / camera, WORD) if camera > 0 else max(head.words(10)[0], 1)
    samples = round(ratio)
    return samples if abs(ratio - samples) < MAX_RATIO_ERROR * samples else 0


def _camera(head: Head, samples: int) -> float:
    """Return the rate of frames [Hz]: the header's if it fits ANALOG:RATE, else POINT:RATE; 0 if unknown."""
    (rate, *_), (camera, *_) = (head.numbers(f"{group}:RATE") or (0.0,) for group in ("ANALOG", "POINT"))
    of_header = head.real(11)
    if of_header > 0 and (not camera > 0 or math.isclose(rate, of_header * samples, rel_tol=MAX_RATIO_ERROR)):
        return of_header
    return float(camera) if camera > 0 else 0.0


def _layout(head: Head, size: int, counts: list[int], believed: Layout) -> Layout:
    """Return the layout that fills a file of `size` bytes with one of the `counts` of frames, `believed` if
    it does or if none does."""
    points, words = head.words(2, 2)
    (samples,) = head.words(10)
    of_header: dict[str, Any] = {
        "points": points,
        "channels": words // max(samples, 1),
        "samples": max(samples, 1),
    }
    starts = [believed.start, *(int(n - 1) * BLOCK for n in head.numbers("POINT:DATA_START")[:1])]
    starts.append(head.begin + head.content[head.begin + 2] * BLOCK)
    reals = [believed.real, *(scale < 0 for scale in head.numbers("POINT:SCALE")[:1])]
    changes = [{}, of_header]
    for start, real, change in product(starts, reals, changes):
        layout = replace(believed, start=start, real=real, **change)
        # Data cannot begin in the parameters.
        if start >= head.end and any(layout.fills(size, count) for count in counts if count > 0):
            return layout
    start = believed.start if believed.start >= head.end else starts[-1]
    return replace(believed, start=start, **({} if believed.samples else of_header))


def _empty(path: Path, layout: Layout, held: int) -> int:
    """Return the number of frames at the end of a file that hold zeros only."""
    data = np.memmap(path, np.uint8, "r", layout.start, (held, layout.frame_bytes))
    empty = 0
    # From the end on, as memory is limited.
    for last in range(held, 0, -MAX_FRAMES):
        filled = np.flatnonzero(data[max(last - MAX_FRAMES, 0) : last].any(axis=1))
        if filled.size:
            return held - max(last - MAX_FRAMES, 0) - int(filled[-1]) - 1
        empty = held - max(last - MAX_FRAMES, 0)
    return empty


def _notes(head: Head, stated: dict[str, int], frames: int, believed: Layout, layout: Layout) -> list[str]:
    """Return notes on counts and places that differ from the data's."""
    notes = []
    wrong = [f"{count} ({name})" for name, count in stated.items() if count != frames]
    if wrong:
        notes.append(f"{frames} frames are read, which the file holds, not {', '.join(wrong)}")
    names = {
        "start": "block of the data",
        "real": "form of numbers",
        "points": "POINT:USED",
        "channels": "ANALOG:USED",
        "samples": "ANALOG:RATE",
    }
    off = [said for name, said in names.items() if getattr(believed, name) != getattr(layout, name)]
    if off:
        rate = layout.samples * _camera(head, layout.samples)
        notes.append(
            f"{', '.join(off)}: missing, or does not fit the length of the file; a frame is read as points: "
            f"{layout.points}, channels: {layout.channels}, samples of each: {layout.samples}, at {rate:g} "
            "Hz; --rate-a or --rate-b gives another rate"
        )
    return notes


def _copies(path: Path, head: Head, layout: Layout, frames: int, folder: Path) -> list[Path]:
    """Write copies of parts of a file whose counts agree with the layout."""
    content = path.read_bytes()
    files = []
    for number, first in enumerate(range(0, frames, MAX_FRAMES)):
        count = min(MAX_FRAMES, frames - first)
        data = content[layout.start :][first * layout.frame_bytes : (first + count) * layout.frame_bytes]
        file = folder / f"{number}{path.suffix}"
        file.write_bytes(_head_with(head, layout, count) + data + bytes(-len(data) % BLOCK))
        files.append(file)
    return files


def _head_with(head: Head, layout: Layout, frames: int) -> bytes:
    """Return header and parameters, padded to whole blocks, with the counts of a layout."""
    out = bytearray(head.content[: head.end])
    camera = _camera(head, layout.samples)
    values = {
        "POINT:USED": layout.points,
        "POINT:RATE": camera,
        "POINT:FRAMES": frames,
        "ANALOG:USED": layout.channels,
        "ANALOG:RATE": layout.samples * camera,
    }
    last = head.last
    for name, value in values.items():
        group, _, field = name.partition(":")
        if numbers := head.numbers(name):
            at, form = head.entries[name]
            kind: Callable[[float], Any] = float if form.endswith("f") else int
            struct.pack_into(form, out, at, kind(value), *map(kind, numbers[1:]))
        elif group in head.groups:
            _append(out, last, head.order, head.groups[group], field, value)
            last = len(out) - _entry_bytes(field, value)
    for field in TRIAL_FIELDS:  # ezc3d believes them: under another name it does not
        if (at := out.find(field.encode(), head.begin)) > 0:
            out[at : at + 1] = b"_"
    section = (len(out) - head.begin) // BLOCK + 1
    out += bytes(head.begin + section * BLOCK - len(out))
    out[head.begin + 2] = section
    start = len(out) // BLOCK + 1
    if entry := head.entries.get("POINT:DATA_START"):
        struct.pack_into(entry.form, out, entry.at, start)
    counts = (layout.points, layout.channels * layout.samples, 1, frames)
    struct.pack_into(f"{head.order}4H", out, 2, *counts)
    scale = abs(head.real(7)) or 1.0
    struct.pack_into(f"{head.order}f2H", out, 12, -scale if layout.real else scale, start, layout.samples)
    return bytes(out)


def _entry_bytes(name: str, value: float) -> int:
    """Return the bytes of an entry that `_append` writes."""
    return 7 + len(name) + (4 if isinstance(value, float) else 2)


def _append(out: bytearray, last: int, order: str, group: int, name: str, value: float) -> None:
    """Add a parameter behind the entry that begins in byte `last`, with which a section ends."""
    link = last + 2 + abs(struct.unpack_from("b", out, last)[0])
    struct.pack_into(f"{order}h", out, link, len(out) - link)
    form, kind = ("f", 4) if isinstance(value, float) else ("H", 2)
    # Length of the name, group, name, no next entry, type and dimensions, number, no description.
    out += struct.pack("2b", len(name), group) + name.encode() + struct.pack(f"{order}hbB", 0, kind, 0)
    out += struct.pack(f"{order}{form}b", value, 0)
