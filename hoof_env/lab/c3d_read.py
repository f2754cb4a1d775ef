"""Force plates of .c3d files: forces in the laboratory's axes, the axis that points up, and the baseline.

**Up.** A plate's own z points down into it, so the normal of FORCE_PLATFORM:CORNERS gives the axis of the
laboratory that points up. Corners in another order than c3d's turn that normal over; markers, which are above
the floor, then decide its sense.

**Baseline.** FORCE_PLATFORM:ZERO names the first and the last frame in which the plates were unloaded. The
mean force of a plate there is subtracted, unless the plate bore a load then, or the frames are not in the
file.
"""

from __future__ import annotations

import importlib.util
import io
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import DataFileError, MissingExtraError
from hoof_env.lab.c3d_header import head_of
from hoof_env.lab.c3d_layout import readable

Floats = NDArray[np.float64]

EIGHT_CHANNEL_TYPE = 3
"""Type of plates with eight channels of forces."""

CALIBRATED_TYPE = 4
"""Type of plates with a matrix that calibrates the channels."""

SECONDS = 120.0
"""Limit of time for reading a small file [s], for systems without a limit of processor time."""

BYTES_A_SECOND = 1e6
"""Size for which one more second is allowed [bytes]."""

MAX_BASELINE_DRIFT = 0.05
"""Largest change of an unloaded plate's force, as a share of the highest force."""

MAX_PULL_SHARE = 0.02
"""Largest pull of a plate, as a share of its highest force."""

SIGMA_PER_MAD = 1.4826
"""Standard deviation of normal noise, in median absolute deviations."""

MAX_NOISE_SIGMAS = 6.0
"""Largest deviation that counts as noise, in standard deviations."""

MAX_OFFSET_SHARE = 0.25
"""Share of a plate's highest force above which a baseline may be a load instead of an offset."""

ZERO_FORCE_SHARE = 0.1
"""Share of the baseline below which a plate's force counts as zero."""

NEEDED = (
    "ANALOG:SCALE",
    "ANALOG:GEN_SCALE",
    "ANALOG:OFFSET",
    *(f"FORCE_PLATFORM:{name}" for name in ("USED", "TYPE", "CORNERS", "ORIGIN", "CHANNEL")),
)
"""Parameters that ezc3d needs for forces."""

PLEA = re.compile(
    r"[\s,.]*\b(please|this is probably due|if you want to ignore)\b.*", re.IGNORECASE | re.DOTALL
)
"""Request in ezc3d's messages, such as to open an issue; it is cut off, as it does not concern our users."""


@dataclass
class Plates:
    """Force plates of a file.

    Attributes:
        forces: forces along the laboratory's x, y and z by limb, or by `plate_1` and so on, shape (n, 3).
        units: units of the forces by limb.
        time: times, shape (n,) [s]; 0 is the first frame of the trial, though the file may begin later. None
            if the file states no rate.
        up: axis of the laboratory that points upward: "x", "y" or "z", with "-" for its other end.
        weight: weight of the animal [N], from files of this package, else None.
        notes: messages about counts that differ from the data's, and a baseline that was not subtracted.
        own: True if this package wrote the file.
    """

    forces: dict[str, Floats]
    units: dict[str, str]
    time: Floats | None
    up: str
    weight: float | None
    notes: list[str]
    own: bool


def read_plates(path: Path) -> Plates:
    """Read the force plates of a file; limbs are `plate_1` and so on in files of other programs.

    Raises:
        DataFileError: the file is damaged, has no plates, or has fewer frames than its header states.
        MissingExtraError: ezc3d is not installed.
    """
    library = importlib.util.find_spec("ezc3d")
    if library is None or library.origin is None:
        raise MissingExtraError('c3d needs ezc3d: pip install "hoof-env[lab]"')
    head = head_of(path)
    # The child needs the folders of both libraries: it starts without the paths of this process.
    folders = [Path(file).parents[1] for file in (library.origin, np.__file__)]
    with tempfile.TemporaryDirectory() as place:
        files, frames, stale = readable(path, head, Path(place))
        try:
            content = _joined([_in_a_process(file, path, folders) for file in files])
        except DataFileError as error:
            lacks = [name for name in NEEDED if name not in head.entries]
            raise DataFileError(f"{error}; it lacks {', '.join(lacks)}" if lacks else str(error)) from None
    if int(content["frames"]) < frames:
        raise DataFileError(
            f"record {str(path)!r}: expected {frames} frames, as its header says, found "
            f"{int(content['frames'])}: is the file cut off? Copy or export it again"
        )
    parameters = json.loads(str(content["parameters"]))
    raw = [content[name].T for name in content if name.startswith("force_")]
    if not raw or any(len(force) < 2 for force in raw):
        without = " with data" if raw else ""
        raise DataFileError(
            f"record {str(path)!r}: expected force plates (FORCE_PLATFORM), found no force plates{without}"
        )
    ours = parameters.get("HOOF_ENV", {})
    limbs = ours["LIMBS"] if "LIMBS" in ours else [f"plate_{k}" for k in range(1, len(raw) + 1)]
    if len(limbs) != len(raw):
        raise DataFileError(
            f"record {str(path)!r}: expected {len(raw)} names of plates (HOOF_ENV:LIMBS), got {len(limbs)}"
        )
    _check_forces(path, limbs, raw, content["corners"])
    rate, camera = (float((*np.ravel(parameters[group]["RATE"]), 0.0)[0]) for group in ("ANALOG", "POINT"))
    first, last = head.frames
    first = first if 0 < first <= last else 1
    start = (first - 1) / camera if camera > 0 else 0.0
    time = start + np.arange(len(raw[0])) / rate if rate > 0 else None
    forces, notes = _without_baseline(raw, limbs, parameters, frames, first)
    units = {limb: _force_unit(parameters, k) for k, limb in enumerate(limbs)}
    weight = float(np.ravel(ours["WEIGHT"])[0]) if "WEIGHT" in ours else None
    up = _upward(content["corners"], content["middle"])
    return Plates(
        dict(zip(limbs, forces, strict=True)), units, time, up, weight, [*stale, *notes], bool(ours)
    )


def _joined(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the arrays of the parts of a file, joined to the whole."""
    whole = dict(parts[0])
    for name in whole:
        if name.startswith("force_"):
            whole[name] = np.concatenate([part[name] for part in parts], axis=1)
    whole["frames"] = sum(int(part["frames"]) for part in parts)
    return whole


def _in_a_process(file: Path, path: Path, folders: list[Path]) -> dict[str, Any]:
    """Run `c3d_process.py` on a file and return its arrays by name.

    Args:
        file: the file, or a copy of it.
        path: the file, for error messages.
        folders: folders from which the script imports its libraries; it imports nothing from the current one.

    Raises:
        DataFileError: the script fails, dies or takes too long.
    """
    script = Path(__file__).with_name("c3d_process.py")
    places = os.pathsep.join(dict.fromkeys(map(str, folders)))
    try:
        done = subprocess.run(
            # -P keeps the script's folder off the path of imports, where its modules could hide libraries.
            [sys.executable, "-P", str(script), str(file.resolve())],
            capture_output=True,
            check=False,
            timeout=SECONDS + file.stat().st_size / BYTES_A_SECOND,
            stdin=subprocess.DEVNULL,
            # More threads of OpenBLAS would only reserve memory.
            env=os.environ | {"PYTHONPATH": places, "OPENBLAS_NUM_THREADS": "1"},
        )
    except subprocess.TimeoutExpired as error:
        raise DataFileError(
            f"record {str(path)!r}: ezc3d did not end within {error.timeout:.0f} s; is the file damaged?"
        ) from None
    if done.returncode == 0:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    if done.returncode == 1:
        # The script caught an exception: its last line is "TypeOfError: message".
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        reason = PLEA.sub("", lines[-1].partition(": ")[2]) if lines else ""
        raise DataFileError(
            f"record {str(path)!r}: cannot read it (ezc3d says: {reason or 'no reason':.200})"
        )
    raise DataFileError(
        f"record {str(path)!r}: cannot read it (ezc3d ended without a word or took too long, code "
        f"{done.returncode}); its header or parameters are damaged"
    )


def _check_forces(path: Path, limbs: list[str], raw: list[Floats], corners: Floats) -> None:
    """Raise `DataFileError` if a plate has no force in any sample, with the parameters that may be why.

    Args:
        path: the file, for error messages.
        limbs: names of the plates.
        raw: forces by plate, shape (n, 3).
        corners: corners of the plates, shape (plates, 3, 4).
    """
    for limb, force, points in zip(limbs, raw, corners, strict=True):
        if np.isfinite(force).any():
            continue
        area = np.cross(points[:, 1] - points[:, 0], points[:, 3] - points[:, 0])
        flat = not np.isfinite(area).all() or not area.any()
        where = "FORCE_PLATFORM:CORNERS, which span no plate" if flat else "ANALOG:GEN_SCALE and ANALOG:SCALE"
        raise DataFileError(
            f"record {str(path)!r}: {limb}: expected forces, got no number in any sample; look at {where},"
            " and export the file again"
        )


def _upward(corners: Floats, middle: Floats) -> str:
    """Return the laboratory's axis that points upward, as "z" or "-z".

    Args:
        corners: corners of the plates, shape (plates, 3, 4).
        middle: median of the markers, shape (3,), NaN without markers.
    """
    ahead = corners[:, :, 0] + corners[:, :, 3] - corners[:, :, 1] - corners[:, :, 2]
    aside = corners[:, :, 0] + corners[:, :, 1] - corners[:, :, 2] - corners[:, :, 3]
    # With c3d's order of corners, ahead and aside are the plate's x and y, and their product points down.
    normal = -np.cross(ahead, aside)
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, size, out=np.zeros_like(normal), where=size > 0)
    if not np.isfinite(normal).all() or not normal.any():
        return "z"
    k = int(np.abs(normal).sum(axis=0).argmax())
    above = middle[k] - corners[:, k].mean()
    # Markers are more reliable than the order of the corners, but they may be missing.
    down = above < 0 if np.isfinite(above) and above != 0 else normal[:, k].sum() < 0
    return ("-" if down and normal[:, k].sum() < 0 else "") + "xyz"[k]


def _without_baseline(
    raw: list[Floats], limbs: list[str], parameters: Mapping[str, Any], frames: int, first: int
) -> tuple[list[Floats], list[str]]:
    """Subtract the baseline of each plate.

    Args:
        raw: forces by plate, shape (n, 3).
        limbs: names of the plates.
        parameters: groups of parameters of the file.
        frames: number of frames of the file.
        first: number of the file's first frame.

    Returns:
        Forces by plate, and notes on a baseline that was not subtracted.
    """
    zero = [int(value) for value in np.ravel(parameters["FORCE_PLATFORM"].get("ZERO", []))[:2]]
    if len(zero) < 2 or zero[0] < 0 or zero[1] < max(zero[0], 1):
        return raw, []  # the file names none: 0 0, or 1 0
    zero[0] = max(zero[0], 1)  # there is no frame 0
    begin, end = (value - first for value in zero)
    if begin < 0 or end >= frames:
        # Some programs count from the first frame of the file and not of the trial.
        begin, end = (value - 1 for value in zero)
    stated = f"FORCE_PLATFORM:ZERO names frames {zero[0]} to {zero[1]} for the baseline"
    if end >= frames:
        return raw, [f"{stated}, but the file has {frames} frames; no baseline is subtracted"]
    highest = max(float(np.ptp(force, axis=0).max()) for force in raw)
    forces = []
    loaded = []
    for limb, force in zip(limbs, raw, strict=True):
        # Plates have several samples in each frame of the cameras.
        each = len(force) // frames
        quiet = force[begin * each : (end + 1) * each]
        base = quiet.mean(axis=0)
        if _unloaded(quiet - base, force - base, base, highest):
            forces.append(force - base)
        else:
            forces.append(force)
            loaded.append(limb)
    if loaded:
        return forces, [
            f"{stated}, in which {', '.join(loaded)} bore a load; no baseline of it is subtracted: if it has "
            "an offset, subtract that before"
        ]
    return forces, []


def _unloaded(quiet: Floats, force: Floats, base: Floats, highest: float) -> bool:
    """Return True if a plate bore no load in its quiet frames.

    It bore none if its force is steady there, if the plate is pushed and not pulled at other times (it would
    seem to be pulled if a load were subtracted), and if its force does not rest at zero at other times.

    Args:
        quiet: forces in the quiet frames less `base`, shape (m, 3).
        force: forces in all frames less `base`, shape (n, 3).
        base: mean force in the quiet frames, shape (3,).
        highest: range of the forces of all plates.
    """
    # Median deviations, so that a few outliers do not hide how steady the other samples are.
    off = np.abs(quiet - np.median(quiet, axis=0))
    noise = SIGMA_PER_MAD * np.median(off, axis=0)
    drift = MAX_BASELINE_DRIFT * highest
    if (noise > drift).any() or (off > np.maximum(drift, MAX_NOISE_SIGMAS * noise)).any():
        return False
    axis = int(np.abs(force).max(axis=0).argmax())
    along = force[:, axis] * np.sign(force[np.abs(force[:, axis]).argmax(), axis])
    if along.max() < drift:  # never loaded
        return True
    least = MAX_PULL_SHARE * along.max() + 3 * float(quiet[:, axis].std())
    shown = np.abs(force[:, axis] + base[axis])
    is_offset_large = abs(base[axis]) > MAX_OFFSET_SHARE * along.max()
    rests = is_offset_large and np.percentile(shown, 10) < ZERO_FORCE_SHARE * abs(base[axis])
    return float(np.percentile(along, 10)) > -least and not rests


def _force_unit(parameters: Mapping[str, Any], plate: int) -> str:
    """Return the unit of a plate's forces: the unit of its force channels, or all of them if they differ.

    It is N, c3d's default, if the file states none, and if a calibration (type 4) makes forces of volts.
    """
    of_plates = parameters["FORCE_PLATFORM"]
    units = parameters["ANALOG"].get("UNITS", [])
    kind = int(of_plates["TYPE"][plate])
    channels = np.array(of_plates["CHANNEL"])[:, plate]
    if kind == CALIBRATED_TYPE:
        return "N"
    # The first channels of a plate are its forces; the others are moments, in other units.
    numbers = [int(channel) - 1 for channel in channels[: 8 if kind == EIGHT_CHANNEL_TYPE else 3]]
    stated = {units[number].strip() for number in numbers if 0 <= number < len(units)} - {""}
    return " and ".join(sorted(stated)) or "N"
