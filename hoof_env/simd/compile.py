"""The one place where kernels are compiled: numba, serial, cached, and without fast-math, so that a result
does not depend on how the compiler arranged a loop."""

from __future__ import annotations

import hashlib
import os
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar, cast

import numba
from numba.core import event

from hoof_env.errors import HoofEnvError
from hoof_env.simd.cache import keep

F = TypeVar("F", bound=Callable[..., Any])

QUIET = "HOOF_ENV_QUIET"
"""Environment variable; set to 1 it silences what is said while kernels compile."""


def kernel(function: F, identity: str = "", threads: bool = False) -> F:
    """Compile `function` with numba at its first call, and keep the result in numba's cache folder, which the
    environment variable NUMBA_CACHE_DIR names. Of several processes that need it at once one compiles.

    `identity` is that of the functions from outside this package that it contains, see `user_functions`. The
    first call raises OutputError if the kernel has to be compiled and the folder is not writable. `threads`:
    several may run it at once, for Python goes on meanwhile; a call takes a little longer.
    """
    if identity:  # names in machine code are made of it: of two functions of one name the first is called
        function.__qualname__ += f".{hashlib.sha256(identity.encode()).hexdigest()[:12]}"
    compiled: Any = numba.njit(error_model="numpy", nogil=threads)(function)
    if not hasattr(compiled, "_cache"):  # records have no attributes outside compiled code
        raise HoofEnvError("NUMBA_DISABLE_JIT is set, but kernels run compiled only: unset it")
    keep(compiled, _say, identity)
    return cast(F, compiled)


def inline_llvm(function: F) -> F:
    """A part of a kernel that is compiled into whatever calls it, so that the shapes of the caller's arrays
    are known there."""
    options: Any = {"error_model": "numpy", "forceinline": True}
    options |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}  # a third of the time to compile
    return cast(F, numba.njit(**options)(function))


def inline_source(function: F) -> F:
    """A part of a kernel whose text is put in the place of each call, before types are known.

    For the large parts that call `inline_llvm` ones: those would be optimised by themselves first, which
    takes seconds, and then again inside the kernel.
    """
    return cast(F, numba.njit(error_model="numpy", inline="always")(function))


def _say(text: str) -> None:
    if os.environ.get(QUIET, "") in ("", "0"):
        with suppress(OSError, ValueError):  # stderr is closed
            print(f"hoof-env: {text}", file=sys.stderr, flush=True)


class _Announcer(event.Listener):
    """Says on stderr that kernels of this package are compiled, not read from the cache, and how long the
    long ones took. numba tells when it compiles; it costs nothing when it does not."""

    depth = 0
    started = 0.0
    is_told = False
    long = ("step_", "advance_", "react_")  # names of kernels that take long begin so

    def on_start(self, event: Any) -> None:
        function: Any = getattr(event.data["dispatcher"], "py_func", None)
        if self.depth or str(getattr(function, "__module__", "")).startswith("hoof_env."):
            self.depth += 1  # a kernel compiles those that it calls
        if self.depth == 1:
            self.started = time.monotonic()
            if not self.is_told and function.__name__.startswith(self.long):
                _say("compiling kernels for this machine, once (about half a minute) ...")
                self.is_told = True

    def on_end(self, event: Any) -> None:
        if not self.depth:
            return  # not ours
        self.depth -= 1
        seconds = time.monotonic() - self.started
        if not self.depth and seconds > 1:
            _say(f"{event.data['dispatcher'].py_func.__name__} compiled in {seconds:.1f} s")


event.register("numba:compile", _Announcer())
