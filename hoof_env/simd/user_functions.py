"""Plain functions from outside this package inside kernels: checks of what they are and return, and error
messages for their authors."""

from __future__ import annotations

import dis
import os
import traceback
from collections.abc import Callable, Iterator, Mapping
from functools import wraps
from pathlib import Path
from types import CodeType, FunctionType, MappingProxyType
from typing import Any

import numpy as np

from hoof_env.errors import ParameterError
from hoof_env.simd.machines import CURRENT
from hoof_env.simd.values import TraceError, is_real, rounded

PACKAGE = Path(__file__).parents[1]
NUMPY = Path(np.__file__).parent


class UserFunctionError(Exception):
    """Reason why a function from outside this package cannot be part of a kernel, and where."""


def foreign(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function from outside this package as a part of kernels: what it takes and returns enters sums
    rounded, and what it raises becomes a `UserFunctionError`."""

    @wraps(function)
    def part(*arguments: Any) -> Any:
        given = tuple(map(rounded, arguments))
        try:
            return rounded(_steady(function, given))
        except UserFunctionError:
            raise
        except Exception as error:  # the user's code may raise anything
            raise UserFunctionError(f"{_said(error)}{_place(error)}") from error

    return part


def _steady(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """Return the result of a function; raise TraceError if a second call gives other instructions, as random
    numbers do, or a clock: a kernel would repeat those of the first call for ever."""
    machine = CURRENT.machine
    if machine.runs_now:
        return function(*arguments)
    slots, lines, count = len(machine.slots), len(machine.lines), machine.count
    function(*arguments)
    first = machine.slots[slots:], machine.lines[lines:]
    del machine.slots[slots:], machine.lines[lines:]
    machine.count = count
    result = function(*arguments)
    if first != (machine.slots[slots:], machine.lines[lines:]):
        raise TraceError(
            f"{function.__qualname__} does something else at each call: a kernel is made of one call, so"
            " random numbers, clocks and counters would stay as they were then"
        )
    return result


def _said(error: Exception) -> str:
    """Return what an error says, for the author of the function."""
    if isinstance(error, RecursionError):
        return "a recursion, or a loop, whose end is not known when the kernel is made: write it without"
    if isinstance(error, (TraceError, AttributeError)):
        return str(error)
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def _place(error: Exception) -> str:
    """Return function and line of the user's file."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if not _is_ours(frame.filename)]
    return f", in {frames[-1].name} ({frames[-1].filename}, line {frames[-1].lineno})" if frames else ""


def _is_ours(path: str) -> bool:
    where = Path(os.path.abspath(path))
    return where.is_relative_to(PACKAGE) or where.is_relative_to(NUMPY)


def number_of(what: str) -> Callable[[Any], Any]:
    """Return a function that passes on the result of `what`, and refuses it unless it is a number."""

    def number(x: Any) -> Any:
        if not is_real(x) or isinstance(x, bool):
            raise UserFunctionError(f"{what} returns {_kind(x)}; expected a number")
        return x

    return number


def numbers_of(what: str, count: int) -> Callable[[Any], Any]:
    """Return the same for a tuple of `count` values."""

    def numbers(x: Any) -> Any:
        if not isinstance(x, (tuple, list)) or len(x) != count:
            given = f"a tuple of {len(x)}" if isinstance(x, (tuple, list)) else _kind(x)
            raise UserFunctionError(f"{what} returns {given}; expected a tuple of {count} numbers")
        return tuple(x)

    return numbers


def _kind(x: Any) -> str:
    return getattr(x, "kind", "nothing" if x is None else f"{type(x).__name__} {x!r}")


def check_function(name: str, function: Any, arguments: int) -> None:
    """Raise ParameterError unless something is a plain function of `arguments` arguments that imports
    nothing."""
    if not isinstance(function, FunctionType) or function.__code__.co_flags & 0x0C:  # *args, **kwargs
        raise ParameterError(f"{name}: expected a plain function of {arguments} arguments, got {function!r}")
    code = function.__code__
    least = code.co_argcount - len(function.__defaults__ or ())
    if not least <= arguments <= code.co_argcount or code.co_kwonlyargcount:
        given = ", ".join(code.co_varnames[: code.co_argcount + code.co_kwonlyargcount])
        raise ParameterError(f"{name}: expected a function of {arguments} arguments, got one of ({given})")
    for line in _imports(code):
        raise ParameterError(
            f"{name}: `import` in {function.__name__} ({code.co_filename}, line {line}): expected it at the"
            " top of the file, for a function becomes a kernel by one call"
        )


def _imports(code: CodeType) -> Iterator[int]:
    """Yield the lines of a function, and of those inside it, that import something."""
    line = code.co_firstlineno
    for instruction in dis.get_instructions(code):
        if isinstance(instruction.starts_line, int) and not isinstance(instruction.starts_line, bool):
            line = instruction.starts_line
        line = getattr(instruction, "line_number", None) or line  # Python 3.13
        if instruction.opname == "IMPORT_NAME":
            yield line
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield from _imports(part)


def user_error(
    name: str, error: UserFunctionError, moved: Mapping[str, str] = MappingProxyType({})
) -> ParameterError:
    """Return the error for the author of a function, about the task or setting of a name.

    Args:
        name: of the task or setting.
        error: what was wrong.
        moved: present names of fields that had other ones, or were elsewhere.
    """
    words = str(error)
    now = next((place for old, place in moved.items() if f"no field {old!r}" in words), "")
    return ParameterError(f"{name}: {words}{f'; it is .{now} now' if now else ''}")


def function_name(function: Callable[..., Any]) -> str:
    """Return module and name of a function, for messages."""
    return f"{function.__module__}.{function.__qualname__}"
