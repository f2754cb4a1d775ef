"""Force plates of .c3d files: forces in the laboratory's axes, which of these is up, and the baseline.

**Up.** A plate's own z points down into it, so the normal of FORCE_PLATFORM:CORNERS says which axis of the
laboratory is up. Corners in another order than c3d's turn that normal over; markers, which are above the
floor, then decide its sense.

**Baseline.** FORCE_PLATFORM:ZERO names the first and the last frame in which the plates were unloaded. What a
plate shows there on average is subtracted, unless it bore a load then, or the frames are not in the file.
"""

from __future__ import annotations

import importlib.util
import io
import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import DataFileError, MissingExtraError
from hoof_env.lab.c3d_header import frames_of

Floats = NDArray[np.float64]

# types of plates: eight channels of forces; a matrix calibrates the channels
EIGHT_FORCES = 3
CALIBRATED = 4
# that reading takes at most where processor time has no limit
SECONDS = 120.0
BYTES_A_SECOND = 1e6
# shares of the highest force: of changes, and of pull, that an unloaded plate has
STEADY = 0.05
IDLE = 0.02
# standard deviations a median deviation; and those that noise reaches
ROBUST = 1.4826
NOISY = 6.0
# shares of the highest force and of the baseline: a load in place of an offset
LARGE = 0.25
SMALL = 0.1
PLEA = re.compile(
    r"[\s,.]*\b(please|this is probably due|if you want to ignore)\b.*", re.IGNORECASE | re.DOTALL
)
"""What ezc3d asks of people who read its messages, such as to open an issue: it is not for ours."""


@dataclass
class Plates:
    """Force plates of a file.

    Attributes:
        forces: by limb, or `plate_1` and so on, along the laboratory's x, y and z, shape (n, 3).
        units: of them, by limb.
        time: shape (n,) [s]; that of the first frame of the trial is 0, though the file may begin later.
        up: the axis of the laboratory that points upward: "x", "y" or "z", with "-" for its other end.
        weight: of the animal [N], if a file of this package says it.
        notes: what was made of the baseline, where that is remarkable.
    """

    forces: dict[str, Floats]
    units: dict[str, str]
    time: Floats
    up: str
    weight: float | None
    notes: list[str]


def read_plates(path: Path) -> Plates:
    """The force plates of a file. Limbs are `plate_1` and so on in files of others. `DataFileError` of a file
    that is damaged, without plates or with fewer frames than its header says."""
    library = importlib.util.find_spec("ezc3d")
    if library is None or library.origin is None:
        raise MissingExtraError('c3d needs ezc3d: pip install "hoof-env[lab]"')
    first, last = frames_of(path)
    found = _in_a_process(path, [Path(one).parents[1] for one in (library.origin, np.__file__)])
    frames = int(found["frames"])
    if frames < last - first + 1:
        raise DataFileError(
            f"record {str(path)!r}: expected {last - first + 1} frames, as its header says, found {frames}: "
            "is the file cut off?"
        )
    parameters = json.loads(str(found["parameters"]))
    raw = [found[name].T for name in found if name.startswith("force_")]
    if not raw or any(len(force) < 2 for force in raw):
        raise DataFileError(
            f"record {str(path)!r}: expected force plates (FORCE_PLATFORM), found no force plates with data"
            if raw else
            f"record {str(path)!r}: expected force plates (FORCE_PLATFORM), found no force plates"
        )  # fmt: skip
    own = parameters.get("HOOF_ENV", {})
    limbs = own["LIMBS"] if "LIMBS" in own else [f"plate_{k}" for k in range(1, len(raw) + 1)]
    rate = float(np.ravel(parameters["ANALOG"]["RATE"])[0])
    camera = float(np.ravel(parameters["POINT"]["RATE"])[0])
    if not rate > 0 or len(limbs) != len(raw):
        raise DataFileError(
            f"record {str(path)!r}: expected a rate (ANALOG:RATE) and {len(raw)} names of plates, got "
            f"{rate:g} Hz and {len(limbs)}"
        )
    start = max(first - 1, 0) / camera if camera > 0 else 0.0
    time = start + np.arange(len(raw[0])) / rate
    forces, notes = _without_baseline(raw, limbs, parameters, frames, first)
    units = {limb: _force_unit(parameters, k) for k, limb in enumerate(limbs)}
    weight = float(np.ravel(own["WEIGHT"])[0]) if "WEIGHT" in own else None
    up = _upward(found["corners"], found["middle"])
    return Plates(dict(zip(limbs, forces, strict=True)), units, time, up, weight, notes)


def _in_a_process(path: Path, folders: list[Path]) -> dict[str, Any]:
    """What `c3d_process.py` finds with the libraries in some folders, and nothing from the current one.
    `DataFileError` if it fails, dies or takes too long."""
    script = Path(__file__).with_name("c3d_process.py")
    places = os.pathsep.join(dict.fromkeys(map(str, folders)))
    try:
        done = subprocess.run(
            [sys.executable, "-P", str(script), str(path.resolve())], capture_output=True, check=False,
            timeout=SECONDS + path.stat().st_size / BYTES_A_SECOND, stdin=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": places, "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise DataFileError(
            f"record {str(path)!r}: ezc3d did not end within {error.timeout:.0f} s; is the file damaged?"
        ) from None
    if done.returncode == 0:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    if done.returncode == 1:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        reason = PLEA.sub("", said[-1].partition(": ")[2]) if said else ""
        raise DataFileError(
            f"record {str(path)!r}: cannot read it (ezc3d says: {reason or 'no reason':.200})"
        )
    raise DataFileError(
        f"record {str(path)!r}: cannot read it (ezc3d ended without a word or took too long, code "
        f"{done.returncode}); its header or parameters are damaged"
    )


def _upward(corners: Floats, middle: Floats) -> str:
    """The laboratory's axis that points upward, from corners of shape (plates, 3, 4) and the middle of the
    markers, shape (3,)."""
    ahead = corners[:, :, 0] + corners[:, :, 3] - corners[:, :, 1] - corners[:, :, 2]
    aside = corners[:, :, 0] + corners[:, :, 1] - corners[:, :, 2] - corners[:, :, 3]
    normal = -np.cross(ahead, aside)
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, size, out=np.zeros_like(normal), where=size > 0)
    if not np.isfinite(normal).all() or not normal.any():
        return "z"
    k = int(np.abs(normal).sum(axis=0).argmax())
    above = middle[k] - corners[:, k].mean()
    down = above < 0 if np.isfinite(above) and above != 0 else normal[:, k].sum() < 0
    return ("-" if down and normal[:, k].sum() < 0 else "") + "xyz"[k]


def _without_baseline(
    raw: list[Floats], limbs: list[str], parameters: Mapping[str, Any], frames: int, first: int
) -> tuple[list[Floats], list[str]]:
    """Forces without what plates show while they are unloaded, and what to say of that."""
    zero = [int(value) for value in np.ravel(parameters["FORCE_PLATFORM"].get("ZERO", []))[:2]]
    if len(zero) < 2 or zero[0] < 0 or zero[1] < max(zero[0], 1):
        return raw, []  # the file names none: 0 0, or 1 0
    zero[0] = max(zero[0], 1)  # there is no frame 0
    begin, end = (value - first for value in zero)
    if begin < 0 or end >= frames:  # numbers that count from the first frame of the file
        begin, end = (value - 1 for value in zero)
    said = f"FORCE_PLATFORM:ZERO names frames {zero[0]} to {zero[1]} for the baseline"
    if end >= frames:
        return raw, [f"{said}, but the file has {frames} frames; no baseline is subtracted"]
    highest = max(float(np.ptp(force, axis=0).max()) for force in raw)
    forces = []
    loaded = []
    for limb, force in zip(limbs, raw, strict=True):
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
            f"{said}, in which {', '.join(loaded)} bore a load; no baseline of it is subtracted: if it has "
            "an offset, subtract that before"
        ]
    return forces, []


def _unloaded(quiet: Floats, force: Floats, base: Floats, highest: float) -> bool:
    """Whether a plate bore no load in its quiet frames: it is steady there, later pushed and not pulled, as
    it would seem to be once a load were subtracted, and does not rest at zero at other times. Forces less
    `base`, their mean in those frames."""
    off = np.abs(quiet - np.median(quiet, axis=0))
    noise = ROBUST * np.median(off, axis=0)
    if (noise > STEADY * highest).any() or (off > np.maximum(STEADY * highest, NOISY * noise)).any():
        return False
    axis = int(np.abs(force).max(axis=0).argmax())
    along = force[:, axis] * np.sign(force[np.abs(force[:, axis]).argmax(), axis])
    if along.max() < STEADY * highest:  # never loaded
        return True
    least = IDLE * along.max() + 3 * float(quiet[:, axis].std())
    shown = np.abs(force[:, axis] + base[axis])
    rests = abs(base[axis]) > LARGE * along.max() and np.percentile(shown, 10) < SMALL * abs(base[axis])
    return float(np.percentile(along, 10)) > -least and not rests


def _force_unit(parameters: Mapping[str, Any], plate: int) -> str:
    """The unit of a plate's forces: that of its force channels, each named if they differ. N where the file
    says nothing, as c3d has it, and where a calibration (type 4) makes forces of volts."""
    of_plates = parameters["FORCE_PLATFORM"]
    units = parameters["ANALOG"].get("UNITS", [])
    kind = int(of_plates["TYPE"][plate])
    channels = np.array(of_plates["CHANNEL"])[:, plate]
    if kind == CALIBRATED:
        return "N"
    numbers = [int(channel) - 1 for channel in channels[: 8 if kind == EIGHT_FORCES else 3]]
    said = {units[number].strip() for number in numbers if 0 <= number < len(units)} - {""}
    return " and ".join(sorted(said)) or "N"
