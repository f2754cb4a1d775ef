"""c3d files by ezc3d: a force plate of type 2 for each limb, and markers at toes, heels and trunk.

The model is planar, so the plates of all limbs are one rectangle under the whole track, as in a treadmill
with a plate for each limb. On level ground and on one slope it lies in the surface; on other ground at y = 0,
and the CoP of a reader is where the force's line meets that plane.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import DataFileError, MissingExtraError, ParameterError
from hoof_env.ground.terrain import Terrain
from hoof_env.lab.forces import Columns, limb_name, limbs_of, loaded

Floats = NDArray[np.float64]

MARKERS = ("toe", "heel")
"""Of a limb; the trunk has one, too: the crank centre of one leg, a horse's centre of mass."""

CHANNELS = {"Fx": "N", "Fy": "N", "Fz": "N", "Mx": "Nmm", "My": "Nmm", "Mz": "Nmm"}
"""Channels of a plate, in its own frame about the centre of its surface, and their units."""

MOST_FRAMES = 65_535  # a c3d header counts in 16 bits
MM = 1000.0
BLOCK, MIPS = 512, 86  # bytes of a block of a c3d file; the code of processors that write the high byte first
EIGHT_FORCES, CALIBRATED = 3, 4  # types of plates: eight channels of forces; a matrix calibrates the channels
MARGIN, HALF_WIDTH = 0.5, 0.5  # of a plate, beyond the first and last CoP, and to the left and right [m]


def ezc3d() -> Any:
    """The library; `MissingExtraError` without it."""
    try:
        import ezc3d
    except ImportError:
        raise MissingExtraError('c3d needs ezc3d: pip install "hoof-env[lab]"') from None
    return ezc3d


def plane_of(terrain: Terrain, low: float, high: float) -> tuple[complex, complex]:
    """Middle of the plate from `low` to `high` [m], and its direction forward, as x + i y."""
    inner = terrain.x[(terrain.x > low) & (terrain.x < high)]
    x = np.concatenate([[low], inner, [high]])
    rise = terrain.height_at(x)
    slope = (rise[-1] - rise[0]) / (high - low)
    if not np.allclose(rise, rise[0] + slope * (x - low), atol=1e-6):
        return complex((low + high) / 2, 0.0), 1 + 0j
    along = complex(1, slope) / math.hypot(1, slope)
    return complex((low + high) / 2, (rise[0] + rise[-1]) / 2), along


def write_c3d(record: Columns, about: Mapping[str, Any], path: Path) -> None:
    """Write points [mm], analog channels and the group FORCE_PLATFORM, all at the rate of the record; limbs,
    weight and threshold [N] are in a group HOOF_ENV. `ParameterError` of a record that is too long."""
    time, limbs = record["time"], limbs_of(record)
    if len(time) > MOST_FRAMES:
        raise ParameterError(f"seconds: expected at most {MOST_FRAMES} frames of a c3d, got {len(time)}")
    file = ezc3d().c3d()
    parameters, rate = file["parameters"], [1 / float(np.median(np.diff(time)))]
    markers = {f"{limb}{name}": f"{limb}{name}_" for limb in limbs for name in MARKERS}
    markers["trunk"] = "trunk_" if "trunk_x" in record else ""
    points = [
        [record[f"{of}x"] * MM, 0 * time, record[f"{of}y"] * MM, 0 * time + 1] for of in markers.values()
    ]
    under = np.concatenate([record[f"{limb}cop_x"][loaded(record, limb)] for limb in limbs])
    ends = (under.min() - MARGIN, under.max() + MARGIN) if under.size else (-MARGIN, MARGIN)
    middle, along = plane_of(Terrain.from_dict(about["terrain"]), *ends)
    channels = np.concatenate([_channels(record, limb, middle, along) for limb in limbs])
    n = len(limbs)
    for group, name, value in (
        ("POINT", "RATE", rate), ("POINT", "LABELS", [*markers]), ("POINT", "UNITS", ["mm"]),
        ("ANALOG", "RATE", rate), ("ANALOG", "UNITS", [*CHANNELS.values()] * n),
        ("ANALOG", "LABELS", [f"{limb}{channel}" for limb in limbs for channel in CHANNELS]),
        ("FORCE_PLATFORM", "USED", [n]), ("FORCE_PLATFORM", "TYPE", [2] * n),
        ("FORCE_PLATFORM", "ZERO", [0, 0]), ("FORCE_PLATFORM", "ORIGIN", np.zeros((3, n))),
        ("FORCE_PLATFORM", "CORNERS", np.repeat(_corners(ends, middle, along)[..., None], n, axis=2)),
        ("FORCE_PLATFORM", "CHANNEL", np.arange(1, 6 * n + 1).reshape(n, 6).T),
    ):  # fmt: skip
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
    """What a plate measures of a limb, shape (6, n): `CHANNELS`."""
    bears = loaded(record, limb)
    force = (record[f"{limb}force_x"] + 1j * record[f"{limb}force_y"]) * along.conjugate()
    arm = (record[f"{limb}cop_x"] + 1j * record[f"{limb}cop_y"] - middle) * along.conjugate()
    about_middle = np.where(
        bears, (arm.conjugate() * force).imag, 0.0
    )  # counter-clockwise seen from the right
    nothing = np.zeros(len(bears))
    # x forward, z down, and so y to the right, about which angles in the plane are counter-clockwise
    return np.array([force.real, nothing, -force.imag, nothing, MM * about_middle, nothing])


def _corners(ends: tuple[float, float], middle: complex, along: complex) -> Floats:
    """Corners in the quadrants ++, -+, --, +- of the plate's frame, in the laboratory's [mm], shape
    (3, 4)."""
    half = (ends[1] - ends[0]) / 2 / along.real
    at = [middle + side * half * along for side in (1, -1, -1, 1)]
    left = [-HALF_WIDTH, -HALF_WIDTH, HALF_WIDTH, HALF_WIDTH]
    return MM * np.array([[z.real for z in at], left, [z.imag for z in at]])


def read_c3d(path: Path) -> tuple[Columns, dict[str, str], dict[str, Any]]:
    """Forces of every plate: columns `LIMB_x`, `LIMB_y` and `LIMB_z` of the laboratory's axes, as the file
    has them, and "time"; their units, as ANALOG:UNITS has them; and "weight_n", if a file of this package
    says it.

    Limbs are `plate_1` and so on in files of others. `DataFileError` of a file without plates or with fewer
    frames than its header says; other errors are those of ezc3d.
    """
    file = ezc3d().c3d(str(path), extract_forceplat_data=True)
    plates, parameters = file["data"]["platform"], file["parameters"]
    _check_frames(path, file["data"]["points"].shape[2])
    if not plates:
        raise DataFileError(
            f"record {str(path)!r}: expected force plates (FORCE_PLATFORM), found no force plates"
        )
    own = parameters.get("HOOF_ENV", {})
    limbs = own["LIMBS"]["value"] if own else [f"plate_{k}" for k in range(1, len(plates) + 1)]
    rate = float(parameters["ANALOG"]["RATE"]["value"][0])
    columns, units = {}, {"time": "s"}
    for k, (limb, plate) in enumerate(zip(limbs, plates, strict=True)):
        unit = _force_unit(parameters, k)
        for axis, values in zip("xyz", plate["force"], strict=True):
            columns[f"{limb}_{axis}"], units[f"{limb}_{axis}"] = np.asarray(values), unit
    columns["time"] = np.arange(len(next(iter(columns.values())))) / rate
    return columns, units, {"weight_n": float(own["WEIGHT"]["value"][0])} if own else {}


def _check_frames(path: Path, found: int) -> None:
    """`DataFileError` unless there are as many frames as the header says: ezc3d stops silently where a file
    is cut off."""
    head = path.read_bytes()[: (255 + 1) * BLOCK]
    parameters = (head[0] - 1) * BLOCK
    order = ">" if head[parameters + 3 : parameters + 4] == bytes([MIPS]) else "<"
    first, last = struct.unpack_from(f"{order}2H", head, 6)
    if found < last - first + 1:
        raise DataFileError(
            f"record {str(path)!r}: expected {last - first + 1} frames, as its header says, found {found}: "
            "is the file cut off?"
        )


def _force_unit(parameters: Mapping[str, Any], plate: int) -> str:
    """The unit of a plate's forces: that of its force channels, each named if they differ. N where the file
    says nothing, as c3d has it, and where a calibration (type 4) makes forces of volts."""
    of_plates, units = parameters["FORCE_PLATFORM"], parameters["ANALOG"].get("UNITS", {}).get("value", [])
    kind, channels = int(of_plates["TYPE"]["value"][plate]), of_plates["CHANNEL"]["value"][:, plate]
    if kind == CALIBRATED:
        return "N"
    numbers = [int(channel) - 1 for channel in channels[: 8 if kind == EIGHT_FORCES else 3]]
    said = {units[number].strip() for number in numbers if 0 <= number < len(units)} - {""}
    return " and ".join(sorted(said)) or "N"
