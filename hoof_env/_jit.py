"""The one place where kernels are compiled: numba, serial, cached, without fast-math.

Kernels are plain scalar functions over NumPy records and arrays. Fast-math stays off, so that a result does not
depend on how the compiler arranged a loop.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, TypeVar

from hoof_env.errors import OutputError

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile `function` with numba at its first call and keep the result in numba's cache folder.

    Raises:
        OutputError: no cache folder can be written.
    """
    import numba

    try:
        return numba.njit(cache=True, error_model="numpy")(function)  # type: ignore[no-any-return]
    except (RuntimeError, OSError) as error:
        given = os.environ.get("NUMBA_CACHE_DIR") or os.path.dirname(function.__code__.co_filename)
        raise OutputError(
            f"cannot keep compiled kernels in {given!r} ({error}); expected a writable folder: "
            "set the environment variable NUMBA_CACHE_DIR to one"
        ) from None
