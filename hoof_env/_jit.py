"""The one place where kernels are compiled: numba, serial, cached, without fast-math.

Kernels are plain functions over NumPy records and arrays, or over lanes (`_lanes`). Fast-math stays off, so
that a result does not depend on how the compiler arranged a loop.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from hoof_env.errors import HoofEnvError, OutputError

F = TypeVar("F", bound=Callable[..., Any])

MECHANICS = ("_lanes", "leg", "ground", "gait", "dynamics", "identify")
"""The rooms whose sources end up in kernels."""

QUIET = "HOOF_ENV_QUIET"
"""Environment variable; set to 1 it silences what is said while kernels compile."""


def kernel(function: F) -> F:
    """Compile `function` with numba at its first call and keep the result in numba's cache folder.

    Raises:
        OutputError: the folder named by NUMBA_CACHE_DIR, or without it every folder that numba tries, is not
            writable.
        HoofEnvError: numba is told not to compile.
    """
    import numba

    _announce_compiling()
    given = os.environ.get("NUMBA_CACHE_DIR")
    try:
        if given:
            _check_writable(given)  # numba would pass it over in silence
        compiled: Any = numba.njit(cache=True, error_model="numpy")(function)
    except (RuntimeError, OSError) as error:
        folder = given or os.path.dirname(function.__code__.co_filename)
        raise OutputError(
            f"cannot keep compiled kernels in {folder!r} ({error}); expected a writable folder: "
            "set the environment variable NUMBA_CACHE_DIR to one"
        ) from None
    if not hasattr(compiled, "_cache"):  # records have no attributes outside compiled code
        raise HoofEnvError("NUMBA_DISABLE_JIT is set, but kernels run compiled only: unset it")
    # numba looks for changes in the file of a kernel alone, but a kernel contains those that it calls
    stored = compiled._cache._cache_file
    stored._source_stamp = (stored._source_stamp, _sources())
    return cast(F, compiled)


def inlined(function: F) -> F:
    """A part of a kernel that is compiled into whatever calls it, so that the shapes of the caller's arrays
    are known there."""
    import numba

    options: Any = {"error_model": "numpy", "forceinline": True}
    options |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}  # a third of the time to compile
    return cast(F, numba.njit(**options)(function))


def pasted(function: F) -> F:
    """A part of a kernel whose text is put in the place of each call, before types are known.

    For the large parts that call `inlined` ones: those would be optimised by themselves first, which takes
    seconds, and then again inside the kernel.
    """
    import numba

    return cast(F, numba.njit(error_model="numpy", inline="always")(function))


@cache
def _announce_compiling() -> None:
    """From now on, say on stderr that kernels of this package are compiled, not read from the cache, and how
    long the long ones took. numba tells when it compiles; it costs nothing when it does not."""
    from numba.core import event

    class Announcer(event.Listener):
        depth, started, is_told = 0, 0.0, False

        def on_start(self, event: Any) -> None:
            function = getattr(event.data["dispatcher"], "py_func", None)
            if self.depth or str(getattr(function, "__module__", "")).startswith("hoof_env."):
                self.depth += 1  # a kernel compiles those that it calls
            if self.depth == 1:
                self.started = time.monotonic()
                if not self.is_told:
                    _say("compiling kernels for this machine, once (about half a minute) ...")
                self.is_told = True

        def on_end(self, event: Any) -> None:
            if not self.depth:
                return  # not ours
            self.depth -= 1
            seconds = time.monotonic() - self.started
            if not self.depth and seconds > 1:
                _say(f"{event.data['dispatcher'].py_func.__name__} compiled in {seconds:.1f} s")

    event.register("numba:compile", Announcer())


def _say(text: str) -> None:
    if os.environ.get(QUIET, "") in ("", "0"):
        with suppress(OSError, ValueError):  # nobody listens
            print(f"hoof-env: {text}", file=sys.stderr, flush=True)


@cache
def _check_writable(folder: str) -> None:
    os.makedirs(folder, exist_ok=True)
    tempfile.TemporaryFile(dir=folder).close()


@cache
def _sources() -> str:
    """Digest of everything that kernels are made from."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    rooms = (path for room in MECHANICS for path in (here / room).glob("*.py"))
    for path in sorted((*rooms, *here.glob("_*.py"))):
        digest.update(path.read_bytes())
    return digest.hexdigest()
