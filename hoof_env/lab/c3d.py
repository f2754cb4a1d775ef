"""Writer of c3d files by ezc3d: a force plate of type 2 for each limb, markers at toes, heels and trunk.

The model is planar, so the plates of all limbs are one rectangle under the whole track, as in a treadmill
with a plate for each limb. On level ground and on a constant slope it lies in the surface; on other ground it
lies at y = 0, and a reader's CoP is the point where the force's line meets that plane.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import MissingExtraError, ParameterError
from hoof_env.ground.terrain import Terrain
from hoof_env.lab.forces import Columns, limb_name, limbs_of, loaded

Floats = NDArray[np.float64]

MARKERS = ("toe", "heel")
"""Markers of a limb. The trunk has one, too: the crank centre of a single leg, a horse's centre of mass."""

CHANNELS = {"Fx": "N", "Fy": "N", "Fz": "N", "Mx": "Nmm", "My": "Nmm", "Mz": "Nmm"}
"""Channels of a plate, in its own frame about the centre of its surface, and their units."""

MAX_FRAMES = 65_535
"""Largest number of frames; a c3d header has 16 bits for it."""

MM = 1000.0
"""Millimetres of a metre."""

MARGIN = 0.5
"""Length of a plate before the first and behind the last CoP [m]."""

HALF_WIDTH = 0.5
"""Half of a plate's width [m]."""


def ezc3d() -> Any:
    """Import the library ezc3d; raise `MissingExtraError` if it is not installed."""
    try:
        import ezc3d
    except ImportError:
        raise MissingExtraError('c3d needs ezc3d: pip install "hoof-env[lab]"') from None
    return ezc3d


def plane_of(terrain: Terrain, low: float, high: float) -> tuple[complex, complex]:
    """Return the middle [m] of the plate from x = `low` to `high` [m], and its unit vector forward, both as
    x + i y."""
    inner = terrain.x[(terrain.x > low) & (terrain.x < high)]
    x = np.concatenate([[low], inner, [high]])
    rise = terrain.height_at(x)
    slope = (rise[-1] - rise[0]) / (high - low)
    # A plate is plane: uneven ground has a level one at y = 0.
    if not np.allclose(rise, rise[0] + slope * (x - low), atol=1e-6):
        return complex((low + high) / 2, 0.0), 1 + 0j
    along = complex(1, slope) / math.hypot(1, slope)
    return complex((low + high) / 2, (rise[0] + rise[-1]) / 2), along


def write_c3d(record: Columns, about: Mapping[str, Any], path: Path) -> None:
    """Write points [mm], analog channels and the group FORCE_PLATFORM, all at the rate of the record, and
    limbs, weight and threshold [N] in a group HOOF_ENV.

    Raises:
        ParameterError: the record has more than `MAX_FRAMES` rows.
    """
    time = record["time"]
    limbs = limbs_of(record)
    if len(time) > MAX_FRAMES:
        raise ParameterError(
            f"seconds: expected at most {MAX_FRAMES} frames of a c3d, got {len(time)}; --seconds shortens "
            "the episode, and other formats hold more"
        )
    file = ezc3d().c3d()
    parameters = file["parameters"]
    rate = [1 / float(np.median(np.diff(time)))]
    markers = {f"{limb}{name}": f"{limb}{name}_" for limb in limbs for name in MARKERS}
    markers["trunk"] = ""
    # Homogeneous coordinates, as ezc3d takes them: the fourth is 1.
    points = [
        [record[f"{column}x"] * MM, 0 * time, record[f"{column}y"] * MM, 0 * time + 1]
        for column in markers.values()
    ]
    under = np.concatenate([record[f"{limb}cop_x"][loaded(record, limb)] for limb in limbs])
    ends = (under.min() - MARGIN, under.max() + MARGIN) if under.size else (-MARGIN, MARGIN)
    middle, along = plane_of(Terrain.from_dict(about["terrain"]), *ends)
    channels = np.concatenate([_channels(record, limb, middle, along) for limb in limbs])
    n = len(limbs)
    for group, name, value in (
        ("POINT", "RATE", rate),
        ("POINT", "LABELS", [*markers]),
        ("POINT", "UNITS", ["mm"]),
        ("ANALOG", "RATE", rate),
        ("ANALOG", "UNITS", [*CHANNELS.values()] * n),
        ("ANALOG", "LABELS", [f"{limb}{channel}" for limb in limbs for channel in CHANNELS]),
        ("FORCE_PLATFORM", "USED", [n]),
        ("FORCE_PLATFORM", "TYPE", [2] * n),
        ("FORCE_PLATFORM", "ZERO", [0, 0]),  # no frames for a baseline: a simulated plate has no offset
        ("FORCE_PLATFORM", "ORIGIN", np.zeros((3, n))),
        ("FORCE_PLATFORM", "CORNERS", np.repeat(_corners(ends, middle, along)[..., None], n, axis=2)),
        ("FORCE_PLATFORM", "CHANNEL", np.arange(1, 6 * n + 1).reshape(n, 6).T),
    ):
        parameters[group][name]["value"] = value
    file.add_parameter("POINT", "X_SCREEN", ["+X"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    file.add_parameter("HOOF_ENV", "LIMBS", [limb_name(limb) for limb in limbs])
    file.add_parameter("HOOF_ENV", "WEIGHT", [float(about["weight_n"])])
    if "threshold_n" in about:
        file.add_parameter("HOOF_ENV", "THRESHOLD", [float(about["threshold_n"])])
    file["data"]["points"] = np.array(points).transpose(1, 0, 2)
    file["data"]["analogs"] = channels[None]
    file.write(str(path))


def _channels(record: Columns, limb: str, middle: complex, along: complex) -> Floats:
    """Return the `CHANNELS` of a limb's plate, shape (6, n), by its middle [m] and its vector forward."""
    bears = loaded(record, limb)
    force = (record[f"{limb}force_x"] + 1j * record[f"{limb}force_y"]) * along.conjugate()
    arm = (record[f"{limb}cop_x"] + 1j * record[f"{limb}cop_y"] - middle) * along.conjugate()
    # Counter-clockwise seen from the right.
    about_middle = np.where(bears, (arm.conjugate() * force).imag, 0.0)
    nothing = np.zeros(len(bears))
    # The plate's x is forward, its z down and its y to the right, about which moments in the plane have the
    # same sign as in the world.
    return np.array([force.real, nothing, -force.imag, nothing, MM * about_middle, nothing])


def _corners(ends: tuple[float, float], middle: complex, along: complex) -> Floats:
    """Return the corners in the quadrants ++, -+, --, +- of the plate's frame, in the laboratory's frame,
    shape (3, 4) [mm]."""
    half = (ends[1] - ends[0]) / 2 / along.real
    at = [middle + side * half * along for side in (1, -1, -1, 1)]
    left = [-HALF_WIDTH, -HALF_WIDTH, HALF_WIDTH, HALF_WIDTH]
    return MM * np.array([[z.real for z in at], left, [z.imag for z in at]])
