"""Behaviour that all commands share: key=value arguments, threads, one line for an error, 130 for Ctrl-C."""

from __future__ import annotations

import os
import sys
import threading
import warnings
from collections.abc import Callable
from typing import NoReturn

from hoof_env._output import bear_any_output, check_arguments, flush_or_drop
from hoof_env.commands.options import parse as parse
from hoof_env.errors import HoofEnvError, bounded, check_number
from hoof_env.errors import parse_pairs as parse_pairs


def check_threads(threads: int) -> None:
    """Check that there are as many cores as threads of torch, for more only wait; `ParameterError` if not."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    check_number("torch_threads", threads, low=1, high=usable)


def run(command: Callable[[], int | None]) -> NoReturn:
    """Exit with the return value of `command`.

    An error of this package or of the system, as a full disk, is one line and code 2; Ctrl-C is one line and
    code 130; a warning is one line, too.
    """
    # Other threads' errors keep their tracebacks
    hook = threading.excepthook  # TensorBoard's thread fails on a full disk; its caller reports that, too
    bear_any_output()
    threading.excepthook = lambda args: None if isinstance(args.exc_value, OSError) else hook(args)
    warnings.formatwarning = lambda message, *_, **__: f"warning: {bounded(str(message))}\n"
    try:
        check_arguments(sys.argv[1:])
        code = command() or 0
        sys.stdout.flush()
    except (HoofEnvError, OSError) as error:
        flush_or_drop()
        print(f"error: {error}", file=sys.stderr)
        code = 2
    except RecursionError:
        # JSON and YAML parsers recurse once a level
        print("error: a file or an argument is nested too deep", file=sys.stderr)
        code = 2
    except MemoryError as error:
        print(f"error: there is not enough memory; {error}".rstrip("; "), file=sys.stderr)
        code = 2
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        code = 130
    sys.exit(code)
