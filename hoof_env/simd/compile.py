"""The one place where kernels are compiled: numba, serial, cached, without fast-math.

Kernels are plain functions over NumPy records and arrays, or over lanes (`simd`). Fast-math stays off, so
that a result does not depend on how the compiler arranged a loop.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import Any, TypeVar, cast

from hoof_env.errors import HoofEnvError

F = TypeVar("F", bound=Callable[..., Any])

QUIET = "HOOF_ENV_QUIET"
"""Environment variable; set to 1 it silences what is said while kernels compile."""


def kernel(function: F, identity: str = "") -> F:
    """Compile `function` with numba at its first call, and keep the result in numba's cache folder, which the
    environment variable NUMBA_CACHE_DIR names.

    Args:
        function: the kernel.
        identity: of the functions from outside this package that it contains, see `fingerprint`.

    Of several processes that need it at once one compiles. The first call raises OutputError if the kernel
    has to be compiled and the folder is not writable.

    Raises:
        HoofEnvError: numba is told not to compile.
    """
    import numba

    from hoof_env.simd.cache import keep

    _announce_compiling()
    compiled: Any = numba.njit(error_model="numpy")(function)
    if not hasattr(compiled, "_cache"):  # records have no attributes outside compiled code
        raise HoofEnvError("NUMBA_DISABLE_JIT is set, but kernels run compiled only: unset it")
    keep(compiled, _say, identity)
    return cast(F, compiled)


def fingerprint(*functions: Callable[..., Any] | None) -> str:
    """What tells kernels apart that contain different functions: a digest of those from outside this package,
    with the constants and functions that they name. An edit of any of them changes it."""
    digest = hashlib.sha256()
    for function in functions:
        _add_function(digest, function, set())
    return digest.hexdigest()


def _add_function(digest: Any, function: Any, known: set[int]) -> None:
    function = getattr(function, "py_func", function)  # of numba's
    code = getattr(function, "__code__", None)
    if code is None or id(code) in known:
        digest.update(repr(function).encode() if isinstance(function, int | float | str | tuple) else b"-")
        return
    known.add(id(code))
    digest.update(f"{function.__module__}.{function.__qualname__}".encode())
    inside = function.__module__.startswith("hoof_env.")  # whose sources are in every kernel's digest
    if not inside:
        digest.update(code.co_code + repr(code.co_consts).encode())
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    named = [] if inside else [function.__globals__.get(name) for name in code.co_names]
    for part in (*cells, *named, *(function.__defaults__ or ())):
        _add_function(digest, part, known)


def what_cannot_be_compiled(error: Exception) -> str:
    """What numba does not compile of a function from outside, in a line: the operation, the function and the
    line."""
    text = str(error)
    what = re.search(
        r"No implementation of function (.*?) found for signature|(Cannot cast .*? to bool\w*)", text
    )
    places = [place for place in re.findall(r'File "(.*?)", line (\d+)', text) if "hoof_env" not in place[0]]
    where = f" in {places[-1][0]}, line {places[-1][1]}" if places else ""
    found = next((part for part in what.groups() if part), "") if what else text.strip().splitlines()[-1]
    return (
        f"cannot compile {found}{where}; expected + - * /, comparisons and the functions of hoof_env.simd "
        "(`choose` in the place of `if`), or scalar=True"
    )


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
        with suppress(OSError, ValueError):  # stderr is closed
            print(f"hoof-env: {text}", file=sys.stderr, flush=True)
