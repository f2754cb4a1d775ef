"""What both commands share: options from a function's signature, one line for an error."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

from hoof_env.errors import HoofEnvError


def run(command: Callable[..., None], name: str, arguments: Sequence[str] | None = None) -> int:
    """Call `command` with the options of the command line; returns the exit code: 0 done, 2 a wrong option or
    an error, told in one line, 130 interrupted."""
    import tyro

    try:
        tyro.cli(command, prog=name, args=arguments)
    except HoofEnvError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    return 0


def say(line: str) -> None:
    """Print a line at once."""
    print(line, flush=True)
