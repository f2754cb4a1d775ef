"""Script that reads a .c3d by ezc3d in a process of its own: `python c3d_process.py FILE`.

It writes an .npz to its standard output. ezc3d is compiled code that trusts the sizes in a file: a damaged
file can crash it, keep it in a loop or fill the memory. In a process of its own it does no harm, and has
limits of processor time and memory. Nothing of this package is imported, so that it starts at once.
"""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

SECONDS = 2.0
"""Limit of processor time for a small file [s]."""

SECONDS_A_MEGABYTE = 0.5
"""Processor time allowed for each megabyte in addition [s]; an undamaged file takes some 0.05 s."""

BYTES = 1 << 30
"""Limit of memory for a small file, beyond the memory of the libraries [bytes]."""

TIMES_ITS_SIZE = 100
"""Memory allowed in addition, in sizes of the file."""

GROUPS = ("POINT", "ANALOG", "FORCE_PLATFORM", "HOOF_ENV")
"""Groups of parameters that are passed on."""


def limit(size: int) -> None:
    """Limit processor time and memory by the file's size [bytes], as far as the system supports it."""
    try:
        import resource
    except ImportError:
        # Windows has no such module; there only the caller's limit of time holds.
        return
    used = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    seconds = int(used + SECONDS + SECONDS_A_MEGABYTE * size / 1e6) + 1
    lower(resource, resource.RLIMIT_CPU, seconds)
    lower(resource, resource.RLIMIT_CORE, 0)
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    except (OSError, ValueError):
        # macOS has no /proc and would not enforce a limit of memory.
        return
    lower(resource, resource.RLIMIT_AS, pages * resource.getpagesize() + BYTES + TIMES_ITS_SIZE * size)


def lower(resource: Any, which: int, most: int) -> None:
    """Set a limit of the module `resource`, unless there is a lower one already."""
    # No limit is -1 or a large number, depending on the system.
    if any(0 <= limit < most for limit in resource.getrlimit(which)):
        return
    resource.setrlimit(which, (most, most))


def plain(value: Any) -> Any:
    """Convert a value to types that JSON has."""
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def main(path: str) -> None:
    """Write the plates' forces and corners, the median of all markers and the `GROUPS` of parameters."""
    import ezc3d

    limit(Path(path).stat().st_size)
    file = ezc3d.c3d(path, extract_forceplat_data=True)
    points = np.asarray(file["data"]["points"][:3], float)
    # A marker that was not seen is NaN, or in files of some programs at the origin.
    seen = points[:, np.isfinite(points).all(axis=0) & (points != 0).any(axis=0)]
    groups = {group: file["parameters"][group] for group in GROUPS if group in file["parameters"]}
    parameters = {}
    for group, rows in groups.items():
        parameters[group] = {
            name: plain(row["value"]) for name, row in rows.items() if not name.startswith("__")
        }
    plates = file["data"]["platform"]
    arrays = {f"force_{k}": np.asarray(plate["force"], float) for k, plate in enumerate(plates)}
    corners = [plate["corners"] for plate in plates]
    out = io.BytesIO()
    np.savez(
        out,
        frames=points.shape[2],
        middle=np.median(seen, axis=1) if seen.size else np.full(3, np.nan),
        corners=np.array(corners, float).reshape(-1, 3, 4),
        parameters=json.dumps(parameters),
        **arrays,  # type: ignore[arg-type]
    )
    sys.stdout.buffer.write(out.getvalue())


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    # ezc3d raises exceptions of any type; the caller shows the last line.
    except Exception as error:
        sys.stderr.write(f"{type(error).__name__}: {error}\n")
        sys.exit(1)
