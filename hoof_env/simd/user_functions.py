"""Plain functions from outside this package inside kernels: checks of their results, and error messages for those
that cannot be traced."""

from __future__ import annotations

import os
import traceback
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from types import FunctionType, MappingProxyType
from typing import Any

from hoof_env.errors import ParameterError
from hoof_env.simd.compile import inline_llvm
from hoof_env.simd.values import is_real

PACKAGE = Path(__file__).parents[1]


class NotCompiledError(Exception):
    """Reason why a function from outside this package cannot be part of a kernel."""


def inline_foreign(function: Callable[..., Any]) -> Any:
    """Return a function from outside this package as `inline_llvm` does, with `NotCompiledError` where it cannot be
    traced."""
    part = inline_llvm(function)

    @wraps(function)
    def foreign(*arguments: Any) -> Any:
        try:
            return part(*arguments)
        except NotCompiledError:
            raise
        except Exception as error:  # the user's code may raise anything
            raise NotCompiledError(f"{_said(error)}{_place(error)}") from error

    return foreign


def _said(error: Exception) -> str:
    if isinstance(error, AttributeError):
        return f"no {error}"
    return str(error) or type(error).__name__


def _place(error: Exception) -> str:
    """Return function and line of the user's file."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if not Path(os.path.abspath(frame.filename)).is_relative_to(PACKAGE)]
    return f" in {own[-1].name} ({own[-1].filename}, line {own[-1].lineno})" if own else ""


def scalar_part(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of ordinary numbers with `if`, `and`, `or` and `math` as a part of kernels."""
    from hoof_env.simd.scalar import rewritten

    return rewritten(function)


def number_of(what: str) -> Any:
    """Return a function for kernels that passes on the result of `what`, and refuses it unless it is a number."""

    def number(x: Any) -> Any:
        if not is_real(x) or isinstance(x, bool):
            kind = getattr(x, "kind", "nothing" if x is None else type(x).__name__)
            raise NotCompiledError(f"{what} returns {kind}; expected a number")
        return x

    return number


def numbers_of(what: str, count: int) -> Any:
    """Return the same for a tuple of `count` values."""

    def numbers(x: Any) -> Any:
        if not isinstance(x, tuple) or len(x) != count:
            given = f"a tuple of {len(x)}" if isinstance(x, tuple) else type(x).__name__
            raise NotCompiledError(f"{what} returns {given}; expected a tuple of {count} numbers")
        return x

    return numbers


def check_function(name: str, function: Any, arguments: int) -> None:
    """Raise ParameterError unless something is a plain function of `arguments` arguments."""
    if not isinstance(function, FunctionType) or function.__code__.co_flags & 0x0C:  # *args, **kwargs
        raise ParameterError(f"{name}: expected a plain function of {arguments} arguments, got {function!r}")
    code = function.__code__
    least = code.co_argcount - len(function.__defaults__ or ())
    if not least <= arguments <= code.co_argcount or code.co_kwonlyargcount:
        given = ", ".join(code.co_varnames[: code.co_argcount + code.co_kwonlyargcount])
        raise ParameterError(f"{name}: expected a function of {arguments} arguments, got one of ({given})")


def compilation_error(
    name: str, error: Exception, moved: Mapping[str, str] = MappingProxyType({})
) -> ParameterError:
    """Return the error for the author of a function, about the task or setting of a name."""
    return ParameterError(f"{name}: {error}")


def function_name(function: Callable[..., Any]) -> str:
    """Return module and name of a function, for messages."""
    return f"{function.__module__}.{function.__qualname__}"
