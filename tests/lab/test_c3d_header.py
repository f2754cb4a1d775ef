"""The chain of parameters of a .c3d, written here by the format's manual and then damaged."""

import struct

import pytest

from hoof_env.errors import DataFileError
from hoof_env.lab.c3d_header import head_of

BLOCK = 512
PARAMETERS_IN = 3  # number of the block, from 1


def group(name, number=-1, locked=False):
    """Return the entry that names a group, without a description."""
    return {"name": name, "group": number, "rest": b"\0", "locked": locked}


def floats(name, values, number=1, locked=False):
    """Return the entry of a parameter of floats in one dimension."""
    rest = struct.pack("bB", 4, 1) + bytes([len(values)]) + b"\0" * (4 * len(values)) + b"\0"
    return {"name": name, "group": number, "rest": rest, "locked": locked}


def chain(entries, order="<", last=0):
    """Return the bytes of entries, each with the distance to the next one."""
    out = b""
    for k, entry in enumerate(entries):
        name = entry["name"] if isinstance(entry["name"], bytes) else entry["name"].encode()
        length = -len(name) if entry["locked"] else len(name)
        ahead = entry.get("ahead", 2 + len(entry["rest"]) if k + 1 < len(entries) else last)
        out += struct.pack("2b", length, entry["group"]) + name
        out += struct.pack(f"{order}h", ahead) + entry["rest"]
    return out


def write(path, entries, order="<", blocks=1, last=0):
    """Write the two blocks of a header and the blocks of the parameters."""
    header = bytes([PARAMETERS_IN, 80]) + b"\0" * 4 + struct.pack(f"{order}2H", 7, 1234)
    processor = 84 if order == "<" else 86
    section = bytes([1, 80, blocks, processor]) + chain(entries, order, last)
    path.write_bytes(header.ljust((PARAMETERS_IN - 1) * BLOCK, b"\0") + section.ljust(blocks * BLOCK, b"\0"))
    return path


GOOD = [group("POINT"), floats("SCALE", [1.0]), floats("RATE", [200.0], locked=True), group("ANALOG", -2)]


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("last", [0, 3], ids=["ends by its link", "ends by an empty name"])
def test_a_whole_chain_passes(tmp_path, order, last):
    """The last entry has no distance, or leads to a name of no letters; an entry may be locked."""
    assert head_of(write(tmp_path / "a.c3d", GOOD, order, last=last)).frames == (7, 1234)


DAMAGES = {
    "a name that is not printed": ([group(b"PO\x07NT"), *GOOD[1:]], "no name in byte 1029"),
    "an entry of no group": ([GOOD[0], floats("SCALE", [1.0], number=0)], "no name in byte 1039"),
    "a link into itself": ([GOOD[0] | {"ahead": 1}, *GOOD[1:]], "POINT leads backward"),
    "a link backward": ([GOOD[0] | {"ahead": -4}, *GOOD[1:]], "POINT leads backward"),
    "a link into the numbers": (
        [GOOD[0], floats("SCALE", [1.0, 2.0]) | {"ahead": 6}, GOOD[2]],
        "SCALE is longer than its place",
    ),
    "an unknown type": (
        [GOOD[0], GOOD[1] | {"rest": b"\x03" + GOOD[1]["rest"][1:]}],
        "SCALE has type 3 and 1 dimensions",
    ),
    "eight dimensions": (
        [GOOD[0], GOOD[1] | {"rest": b"\x04\x08" + b"\x01" * 8 + b"\0" * 5}],
        "SCALE has type 4 and 8 dimensions",
    ),
    "a link beyond the end": ([GOOD[0], GOOD[1] | {"ahead": 600}, GOOD[2]], "beyond the end of the file"),
    "more numbers than there is file": (
        [GOOD[0], {**GOOD[1], "rest": b"\x04\x02\xff\xff" + b"\0" * 5}],
        "beyond the end of the file",
    ),
}


@pytest.mark.parametrize(("entries", "words"), DAMAGES.values(), ids=DAMAGES)
def test_a_damaged_chain_is_reported(tmp_path, entries, words):
    with pytest.raises(DataFileError, match=words):
        head_of(write(tmp_path / "a.c3d", entries))
