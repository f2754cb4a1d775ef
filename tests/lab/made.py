"""Force records that are made up: half sine waves, with braking before propulsion."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from hoof_env.lab.read import ForceRecord


def force(time):
    """Forward and upward force of one limb: a stance of half a second in each second."""
    phase = (time - 0.4) % 1.0 / 0.5
    up = np.where(phase < 1, 760 * np.sin(np.pi * phase), 0.0)
    return np.column_stack([np.where(phase < 1, -120 * np.sin(2 * np.pi * phase), 0.0), up])


def table(path, time, true=None, name="time [s]", form="%.9g"):
    """A text file with these times; the forces are of the `true` times."""
    rows = np.column_stack([time, force(time if true is None else true)])
    names = f"{name},left_force_x [N],left_force_y [N]"
    np.savetxt(path, rows, [form, "%.6f", "%.6f"], ",", header=names, comments="")
    return path


RATE = 100.0
TIME = np.arange(300) / RATE
FORWARD, UP = force(TIME).T
ASIDE = 0.05 * UP
BOTH = np.column_stack([FORWARD, UP])
ROWS = np.column_stack([TIME, BOTH])
OFFSETS = ((7.0, -3.0, 30.0), (-5.0, 2.0, -46.0))
"""Of two plates, in the laboratory's axes [N]."""

AXES = {sign + name: (-1 if sign else 1) * np.eye(3)[k] for sign in ("", "-") for k, name in enumerate("xyz")}


def text(rows=ROWS, between=",", comma=False):
    """Lines of numbers."""
    lines = [between.join(f"{value:.6f}" for value in row) for row in rows]
    return "\n".join(line.replace(".", ",") if comma else line for line in lines) + "\n"


def ezc3d():
    """The library, or the test is skipped."""
    return pytest.importorskip("ezc3d", reason='pip install "hoof-env[lab]"')


def plate(
    path,
    up="z",
    forward="x",
    zero=(0, 0),
    offsets=((0, 0, 0),),
    first=1,
    other_order=False,
    markers=None,
    noise=0.0,
):
    """A file of one plate or more, whose first one is loaded, in a laboratory with that axis upward, whose
    animal travels along that other. Offsets are forces in the laboratory's axes, of each plate."""
    upward, ahead = AXES[up], AXES[forward]
    aside = np.cross(upward, ahead)  # to the left
    own = np.array([ahead, -aside, -upward])  # a plate's axes: x ahead, y to the right, z into the floor
    quadrants = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])
    if other_order:
        quadrants = quadrants[::-1]  # mirrors the plate's y, and so its z points up
        own = np.array([ahead, aside, upward])
    corners = 300 * (quadrants @ (own[:2] if not other_order else np.array([ahead, -aside])))
    file = ezc3d().c3d()
    rows, n = file["parameters"], len(offsets)
    acts = np.outer(FORWARD, ahead) + np.outer(ASIDE, aside) + np.outer(UP, upward)
    channels = []
    for k, offset in enumerate(offsets):
        felt = (acts if k == 0 else 0 * acts) + np.array(offset)
        felt = felt + np.random.default_rng(k).normal(0, noise, felt.shape)
        channels += [*(felt @ own.T).T, *np.zeros((3, len(TIME)))]
    rows["POINT"]["RATE"]["value"] = rows["ANALOG"]["RATE"]["value"] = [RATE]
    rows["ANALOG"]["UNITS"]["value"] = ["N", "N", "N", "Nmm", "Nmm", "Nmm"] * n
    rows["ANALOG"]["LABELS"]["value"] = [f"{name}{k}" for k in range(n) for name in "abcdef"]
    for name, value in (
        ("USED", [n]), ("TYPE", [2] * n), ("ZERO", list(zero)), ("ORIGIN", np.zeros((3, n))),
        ("CORNERS", np.repeat(corners.T[..., None], n, axis=2)),
        ("CHANNEL", np.arange(1, 6 * n + 1).reshape(n, 6).T),
    ):  # fmt: skip
        rows["FORCE_PLATFORM"][name]["value"] = value
    file["data"]["analogs"] = np.array(channels)[None]
    rows["POINT"]["LABELS"]["value"] = ["trunk"]
    seen = np.append(np.zeros(3) if markers is None else markers, 1.0)  # zeros: not seen by a camera
    file["data"]["points"] = np.tile(seen[:, None, None], (1, 1, len(TIME)))
    file.write(str(path))
    if first != 1:
        content = bytearray(path.read_bytes())
        struct.pack_into("<2H", content, 6, first, first + len(TIME) - 1)
        path.write_bytes(content)
    return path


def changed(path, group, name, value):
    """The plate's file once more, with another value of a parameter."""
    file = ezc3d().c3d(str(path))
    file["parameters"][group][name]["value"] = value
    file.write(str(path))
    return path


PERIOD, CONTACT, HIGHEST = 1.0, 0.4, 900.0


def strides(rate=1000.0, scale=1.0, begin=0.3, contact=CONTACT, seconds=5.0, unit="N", weight=None, lead=0.5):
    """Half sine waves of two limbs, `lead` strides apart, with braking before propulsion."""
    time = np.arange(round(seconds * rate) + 1) / rate
    limbs = {}
    for limb, late in (("left", 0.0), ("right", lead)):
        phase = (time - begin - late * PERIOD) % PERIOD / contact
        up = np.where(phase < 1, HIGHEST * scale * np.sin(np.pi * phase), 0.0)
        forward = np.where(phase < 1, -0.2 * HIGHEST * scale * np.sin(2 * np.pi * phase), 0.0)
        limbs[limb] = np.column_stack([forward, up])
    return ForceRecord(f"{scale:g}.csv", time, limbs, unit, weight)
