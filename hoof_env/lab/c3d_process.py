"""A script that reads a .c3d by ezc3d in a process of its own: `python c3d_process.py FILE`.

It writes an .npz to its standard output. ezc3d is compiled code that trusts what a file says of itself: a
damaged file can end it, or keep it in a loop or filling memory for ever. Here it can harm nothing, and has
limits of processor time and memory. Nothing of this package is imported, so that it starts at once.
"""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

# of processor time; a healthy file takes some 0.05 s a megabyte
SECONDS = 2.0
SECONDS_A_MEGABYTE = 0.5
# of memory beyond that of the libraries
BYTES = 1 << 30
TIMES_ITS_SIZE = 100
GROUPS = ("POINT", "ANALOG", "FORCE_PLATFORM", "HOOF_ENV")


def limit(size: int) -> None:
    """Limit processor time and memory by the size of the file, where the system can."""
    try:
        import resource
    except ImportError:  # Windows; the limit of the caller holds there
        return
    used = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    seconds = int(used + SECONDS + SECONDS_A_MEGABYTE * size / 1e6) + 1
    lower(resource, resource.RLIMIT_CPU, seconds)
    lower(resource, resource.RLIMIT_CORE, 0)
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    except (OSError, ValueError):  # macOS, which does not enforce it
        return
    lower(resource, resource.RLIMIT_AS, pages * resource.getpagesize() + BYTES + TIMES_ITS_SIZE * size)


def lower(resource: Any, which: int, most: int) -> None:
    """Set a limit, unless there is a lower one already."""
    if any(0 <= limit < most for limit in resource.getrlimit(which)):  # endless is -1 or a large number
        return
    resource.setrlimit(which, (most, most))


def plain(value: Any) -> Any:
    """`value` as JSON has it."""
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def main(path: str) -> None:
    """Write the plates' forces, the middle of all markers and the parameters that are asked for."""
    import ezc3d

    limit(Path(path).stat().st_size)
    file = ezc3d.c3d(path, extract_forceplat_data=True)
    points = np.asarray(file["data"]["points"][:3], float)
    seen = points[:, np.isfinite(points).all(axis=0) & (points != 0).any(axis=0)]
    groups = {group: file["parameters"][group] for group in GROUPS if group in file["parameters"]}
    parameters = {
        group: {name: plain(one["value"]) for name, one in rows.items() if not name.startswith("__")}
        for group, rows in groups.items()
    }
    arrays = {
        f"force_{k}": np.asarray(plate["force"], float)
        for k, plate in enumerate(file["data"]["platform"])
    }  # fmt: skip
    corners = [plate["corners"] for plate in file["data"]["platform"]]
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
    except Exception as error:  # of a library that raises all kinds
        sys.stderr.write(f"{type(error).__name__}: {error}\n")
        sys.exit(1)
