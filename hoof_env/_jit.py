"""The one place where kernels are compiled: numba, serial, cached, without fast-math.

Kernels are plain scalar functions over NumPy records and arrays. Fast-math stays off, so that a result does
not depend on how the compiler arranged a loop.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from hoof_env.errors import HoofEnvError, OutputError

F = TypeVar("F", bound=Callable[..., Any])

MECHANICS = ("leg", "ground", "gait", "dynamics", "identify")
"""The rooms whose sources end up in kernels."""


def kernel(function: F) -> F:
    """Compile `function` with numba at its first call and keep the result in numba's cache folder.

    Raises:
        OutputError: the folder named by NUMBA_CACHE_DIR, or without it every folder that numba tries, is not
            writable.
        HoofEnvError: numba is told not to compile.
    """
    import numba

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
    are known there and its loops over lanes become vector code."""
    import numba

    return cast(F, numba.njit(error_model="numpy", forceinline=True)(function))


def pasted(function: F) -> F:
    """A part of a kernel whose text is put in the place of each call, before types are known.

    For the large parts that call `inlined` ones: those would be optimised by themselves first, which takes
    seconds, and then again inside the kernel.
    """
    import numba

    return cast(F, numba.njit(error_model="numpy", inline="always")(function))


@cache
def _check_writable(folder: str) -> None:
    os.makedirs(folder, exist_ok=True)
    tempfile.TemporaryFile(dir=folder).close()


@cache
def _sources() -> str:
    """Digest of everything that kernels are made from."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for path in sorted(path for room in MECHANICS for path in (here / room).glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
