"""Files .c3d whose header and parameters contradict the data: all data are read, and it is said."""

from __future__ import annotations

import re
import struct

import numpy as np
import pytest

from hoof_env.errors import DataFileError, ParameterError
from hoof_env.lab.read import read_record
from tests.lab.made import BOTH, ezc3d, plate

SAMPLES = 10
"""Samples in a frame of the fast plates, at 1000 Hz."""


def fast(path, frames=300, more=None, samples=SAMPLES):
    """A plate at 1000 Hz beside markers at 100 Hz; its force is a ramp, so that no frame is like another."""
    file = ezc3d().c3d()
    rows = file["parameters"]
    ramp = np.arange(1.0, samples * frames + 1)
    channels = np.zeros((1, 6, len(ramp)))
    channels[0, 2] = -ramp
    corners = np.array([[500.0, 250, 0], [-500, 250, 0], [-500, -250, 0], [500, -250, 0]]).T
    rows["POINT"]["RATE"]["value"], rows["ANALOG"]["RATE"]["value"] = [100.0], [100.0 * samples]
    rows["POINT"]["LABELS"]["value"] = ["toe"]
    rows["ANALOG"]["UNITS"]["value"] = ["N"] * 3 + ["Nmm"] * 3
    rows["ANALOG"]["LABELS"]["value"] = list("abcdef")
    for name, value in (
        ("USED", [1]), ("TYPE", [2]), ("ZERO", [0, 0]), ("ORIGIN", np.zeros((3, 1))),
        ("CORNERS", corners[..., None]), ("CHANNEL", np.arange(1, 7).reshape(6, 1)),
    ):  # fmt: skip
        rows["FORCE_PLATFORM"][name]["value"] = value
    if more:
        more(file)
    file["data"]["points"] = np.ones((4, 1, frames))
    file["data"]["analogs"] = channels
    file.write(str(path))
    return path


def word(number, value, form="H"):
    """A file with another word of the header."""

    def change(content):
        struct.pack_into(f"<{form}", content, 2 * number - 2, value)

    return change


def parameter(name, value, form="h"):
    """A file with another number of a parameter."""

    def change(content):
        group, _, field = name.partition(":")
        at = content.index(field.encode(), content.index(group.encode())) + len(field)
        dimensions = content[at + 3]
        struct.pack_into(f"<{form}", content, at + 4 + dimensions, value)

    return change


def without(name):
    """A file in which a parameter has another name."""

    def change(content):
        group, _, field = name.partition(":")
        at = content.index(field.encode(), content.index(group.encode()))
        content[at : at + 1] = b"Q"

    return change


STALE = {
    **{f"first frame {n}": (word(4, n), r"300 frames are read, .*\(header\)") for n in (2, 50, 301, 65535)},
    **{
        f"last frame {n}": (word(5, n), r"300 frames are read, .*\(header\)") for n in (0, 1, 299, 301, 65535)
    },
    "no first frame": (word(4, 0), ""),
    **{f"{n} points": (word(2, n), "") for n in (0, 65535)},
    **{f"{n} numbers of plates": (word(3, n), "") for n in (0, 65535)},
    **{f"{n} samples": (word(10, n), "") for n in (0, 2)},
    **{f"frames at {rate} Hz": (word(11, rate, "f"), "") for rate in (0.0, 50.0, np.nan)},
    **{f"scale {scale}": (word(7, scale, "f"), "form of numbers") for scale in (0.0, 1.0)},
    **{f"data in block {n}": (word(9, n), "block of the data") for n in (0, 1, 10, 100)},
    **{f"POINT:FRAMES {n}": (parameter("POINT:FRAMES", n), rf"300 .* not {n}") for n in (100, 1000)},
    "POINT:FRAMES 0": (parameter("POINT:FRAMES", 0), ""),
    **{f"POINT:USED {n}": (parameter("POINT:USED", n), "POINT:USED") for n in (0, 2)},
    **{f"ANALOG:USED {n}": (parameter("ANALOG:USED", n), "ANALOG:USED") for n in (0, 3, 12)},
    "POINT:RATE": (parameter("POINT:RATE", 17.0, "f"), "ANALOG:RATE"),
    **{f"ANALOG:RATE {r}": (parameter("ANALOG:RATE", r, "f"), "ANALOG:RATE") for r in (0.0, 50.0, 5000.0)},
    **{f"without {name}": (without(name), name) for name in ("ANALOG:RATE", "ANALOG:USED")},
    "without POINT:FRAMES": (without("POINT:FRAMES"), ""),
    "empty blocks behind the data": (lambda content: content.extend(bytes(5000)), ""),
}
"""Damage, and words of a note, "" for none."""


def as_integers(path, stale=False):
    """The fast file with integers of two bytes; `stale` leaves the scale of floats in the header."""
    content = bytearray(fast(path).read_bytes())
    start = (struct.unpack_from("<H", content, 16)[0] - 1) * 512
    numbers = np.frombuffer(bytes(content[start:]), "<f4")[: 300 * (4 + 6 * SAMPLES)]
    del content[start:]
    content += numbers.astype("<i2").tobytes()
    content += bytes(-len(content) % 512)
    parameter("POINT:SCALE", 1.0, "f")(content)
    if not stale:
        word(7, 1.0, "f")(content)
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("stale", [False, True])
def test_integers_are_read(stale, tmp_path):
    found = read_record(as_integers(tmp_path / "x.c3d", stale))
    (force,) = found.limbs.values()
    np.testing.assert_allclose(force[:, 1], np.arange(1.0, 3001.0))
    assert_said(found, "form of numbers" if stale else "")


PADDED = ("first frame 50", "last frame 301", "POINT:FRAMES 1000")
"""Damages of a file whose frames are so small that padding could be taken for some."""


@pytest.mark.parametrize(("change", "words"), STALE.values(), ids=STALE)
def test_data_are_read_whatever_the_counts_say(change, words, tmp_path):
    found = read_record(changed(fast(tmp_path / "x.c3d"), change))
    (force,) = found.limbs.values()
    np.testing.assert_allclose(force[:, 1], np.arange(1.0, 3001.0), rtol=1e-6)
    assert found.rate == pytest.approx(1000)
    assert_said(found, words)


@pytest.mark.parametrize("name", PADDED)
def test_padding_does_not_count_as_a_frame(name, tmp_path):
    change, words = STALE[name]
    found = read_record(changed(plate(tmp_path / "x.c3d"), change))
    np.testing.assert_allclose(found.limbs["plate_1"], BOTH, atol=1e-3)
    assert_said(found, words)


def changed(path, change):
    content = bytearray(path.read_bytes())
    change(content)
    path.write_bytes(content)
    return path


def assert_said(found, words):
    said = " ".join(note for note in found.notes if "frame" in note)
    assert bool(said) == bool(words)
    assert re.search(words, said)


def vicon(file):
    """Frames 1 to 70000, as two words each, the lower first."""
    file.add_parameter("TRIAL", "ACTUAL_START_FIELD", [1, 0])
    file.add_parameter("TRIAL", "ACTUAL_END_FIELD", [70000 - 65536, 1])


def long_frames(file):
    file.add_parameter("POINT", "LONG_FRAMES", [70000.0])


@pytest.mark.parametrize("more", [None, vicon, long_frames])
def test_frames_beyond_the_header_s_count_are_read(more, tmp_path):
    """A word counts to 65535, eleven minutes at 100 Hz."""
    found = read_record(fast(tmp_path / "x.c3d", 70000, more, 1))
    (force,) = found.limbs.values()
    np.testing.assert_allclose(force[:, 1], np.arange(1.0, 70001.0), rtol=1e-6)
    assert_said(found, "70000 frames are read, which the file holds, not 65535 .header., 65535 .POINT:FRAMES")


@pytest.mark.parametrize("part", [0.3, 0.6, 0.95])
def test_a_file_that_is_cut_off_is_refused(part, tmp_path):
    def cut(content):
        del content[int(part * len(content)) :]

    with pytest.raises(
        DataFileError, match=r"expected 300 frames, .* is the file cut off. Copy or export it"
    ):
        read_record(changed(fast(tmp_path / "x.c3d"), cut))


def test_without_any_rate_the_option_is_named_and_helps(tmp_path):
    path = fast(tmp_path / "x.c3d")
    for change in (without("ANALOG:RATE"), without("POINT:RATE"), word(11, 0.0, "f")):
        changed(path, change)
    with pytest.raises(ParameterError, match=r"x\.c3d for time.*--rate-a"):
        read_record(path)
    found = read_record(path, rate=1000.0)
    assert len(found.time) == 3000


@pytest.mark.parametrize("name", ["ANALOG:OFFSET", "FORCE_PLATFORM:CORNERS"])
def test_a_parameter_without_which_there_is_no_force_is_named(name, tmp_path):
    with pytest.raises(DataFileError, match=f"it lacks {name}"):
        read_record(changed(plate(tmp_path / "x.c3d"), without(name)))
