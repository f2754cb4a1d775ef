"""Lines that commands print."""

from __future__ import annotations

from pathlib import Path

from hoof_env.errors import printable


def say(line: str) -> None:
    """Print a line at once, also where the output is a pipe; control characters, as of a file's name, become
    escapes."""
    print(printable(line), flush=True)


def size(path: Path) -> str:
    """Return the size of a file as text."""
    count = path.stat().st_size
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"
