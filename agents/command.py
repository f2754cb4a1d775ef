"""What the commands of this folder share: key=value arguments, one line for an error, 130 for Ctrl-C."""

from __future__ import annotations

import sys
import threading
import warnings
from collections.abc import Callable
from typing import NoReturn

from hoof_env._arguments import parse_pairs
from hoof_env.errors import HoofEnvError

__all__ = ["parse_pairs", "run"]


def run(command: Callable[[], int | None]) -> NoReturn:
    """Exit with what `command` returns: one line and 2 for an error of ours or of the system, as a full disk,
    one line and 130 for Ctrl-C; a warning is one line, too."""
    hook = threading.excepthook  # TensorBoard's thread fails on a full disk; its caller tells that, too
    threading.excepthook = lambda told: None if isinstance(told.exc_value, OSError) else hook(told)
    warnings.formatwarning = lambda message, *_, **__: f"warning: {message}\n"
    try:
        code = command() or 0
    except (HoofEnvError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        code = 2
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        code = 130
    sys.exit(code)
