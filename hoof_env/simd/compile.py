"""Compilation of all kernels: with numba, cached, and without fast-math, so that a result does not depend on
how the compiler arranged a loop."""

from __future__ import annotations

import hashlib
import os
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba
from numba.core import event

from hoof_env.errors import HoofEnvError
from hoof_env.simd.cache import keep
from hoof_env.simd.renamed import refuse_old_names

F = TypeVar("F", bound=Callable[..., Any])

if not TYPE_CHECKING:
    __getattr__ = refuse_old_names(__name__, {"inlined": "inline_llvm", "pasted": "inline_source"})

QUIET = "HOOF_ENV_QUIET"
"""Environment variable; 1 silences the messages about compiling kernels."""


def kernel(function: F, identity: str = "", threads: bool = False) -> F:
    """Compile `function` with numba at its first call, and keep the result in numba's cache folder, which the
    environment variable NUMBA_CACHE_DIR names. Of several processes that need it at once one compiles.

    Args:
        function: the kernel.
        identity: identity of all that its code depends on besides the package's sources, see
            `reach.fingerprint`; "" for nothing. Kernels of one source need one, and names that differ.
        threads: true if several threads may run it at once, without Python's lock; a call takes a little
            longer.

    Raises:
        OutputError: at the first call, the kernel has to be compiled and the folder is not writable.
        HoofEnvError: numba is set not to compile.
    """
    # names in machine code are made of the qualified name: of two functions of one name the first is called
    if identity:
        identity = f"{function.__name__} {identity}"
        function.__qualname__ += f".{hashlib.sha256(identity.encode()).hexdigest()[:12]}"
    compiled: Any = numba.njit(error_model="numpy", nogil=threads)(function)
    # with NUMBA_DISABLE_JIT, `njit` returns the function itself, which could not read fields of records
    if not hasattr(compiled, "_cache"):
        raise HoofEnvError("NUMBA_DISABLE_JIT is set, but kernels run compiled only: unset it")
    keep(compiled, _say, identity)
    return cast(F, compiled)


def inline_llvm(function: F) -> F:
    """Compile a part of a kernel into its callers as LLVM code, so that the shapes of the caller's arrays are
    constants there."""
    options: Any = {"error_model": "numpy", "forceinline": True}
    # kernels alone call these parts; wrappers for Python and C would take a third of the time to compile
    options |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast(F, numba.njit(**options)(function))


def inline_source(function: F) -> F:
    """Insert a part of a kernel into its callers as source, before types are inferred.

    For the large parts that call `inline_llvm` ones: numba would optimise those by themselves first, which
    takes seconds, and then again inside the kernel.
    """
    return cast(F, numba.njit(error_model="numpy", inline="always")(function))


def _say(text: str) -> None:
    if os.environ.get(QUIET, "") in ("", "0"):
        with suppress(OSError, ValueError):  # stderr is closed
            print(f"hoof-env: {text}", file=sys.stderr, flush=True)


class _Announcer(event.Listener):
    """Listener that reports on stderr that kernels of this package are compiled, not read from the cache, and
    how long the slow ones took. numba calls it when it compiles; it costs nothing otherwise."""

    depth = 0
    started = 0.0
    has_announced = False
    slow = ("step_", "advance_", "react_")  # first parts of the names of kernels that take long

    def on_start(self, event: Any) -> None:
        function: Any = getattr(event.data["dispatcher"], "py_func", None)
        # a kernel compiles those that it calls: only the outermost is announced
        if self.depth or str(getattr(function, "__module__", "")).startswith("hoof_env."):
            self.depth += 1
        if self.depth == 1:
            self.started = time.monotonic()
            if not self.has_announced and function.__name__.startswith(self.slow):
                _say("compiling kernels for this machine, once (about half a minute) ...")
                self.has_announced = True

    def on_end(self, event: Any) -> None:
        if not self.depth:
            return  # not a kernel of this package
        self.depth -= 1
        seconds = time.monotonic() - self.started
        if not self.depth and seconds > 1:
            _say(f"{event.data['dispatcher'].py_func.__name__} compiled in {seconds:.1f} s")


event.register("numba:compile", _Announcer())
