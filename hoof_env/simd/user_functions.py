"""Plain functions from outside this package inside kernels: checks of their form and results, and error
messages for their authors."""

from __future__ import annotations

import dis
import math
import os
import re
import sysconfig
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from functools import wraps
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import numpy as np

from hoof_env.errors import ParameterError
from hoof_env.simd.machines import CURRENT
from hoof_env.simd.memory import Rows, locked, refuse_write
from hoof_env.simd.values import Lanes, Mask, Plane, TraceError, Value, is_real, kind_of, rounded

PACKAGE = Path(__file__).parents[1]
NUMPY = Path(np.__file__).parent
LIBRARIES = tuple(Path(sysconfig.get_path(name)) for name in ("stdlib", "purelib", "platlib"))

MAX_OPERATIONS = 200_000
"""Largest number of instructions of a user's function, some thousand times as many as a term has."""

MAX_PARTS = 10_000
"""Largest number of parts of a variable that are searched for a value."""

MAX_LETTERS = 400
"""Largest number of letters of an error that a user's function raises."""

PLAIN_FLAGS = 0x0C | 0x20 | 0x80 | 0x200
"""Flags of code that a plain function lacks: of *args, **kwargs, generators and coroutines."""


class UserFunctionError(ParameterError):
    """Reason why a function from outside this package cannot be part of a kernel, and where."""


def foreign(
    what: str, function: Callable[..., Any], count: int | None = None, stateful: str = "", legs: int = 1
) -> Callable[..., Any]:
    """Return a function from outside this package as a part of kernels: it cannot write its arguments; these
    and its results enter sums rounded; an exception while a kernel is traced becomes a `UserFunctionError`.

    Args:
        what: title of the function in messages.
        function: the function.
        count: number of numbers that it returns as a tuple; None for one number.
        stateful: name of the term whose state, `episode.own.<term>`, it may set.
        legs: number of legs in the field `leg` of its arguments.
    """

    @wraps(function)
    def part(*arguments: Any) -> Any:
        own = ("own", stateful) if stateful else ()
        given = tuple(locked(rounded(argument), own, legs) for argument in arguments)
        check_imports(what, function, UserFunctionError)
        try:
            found = rounded(_plain(_steady(function, given)))
        except UserFunctionError:
            raise
        except Exception as error:  # the user's code may raise anything
            if CURRENT.machine.runs_now:  # a debugger wants to know where
                raise
            raise UserFunctionError(f"{what}: {_message_of(error)}{_place(error)}") from None
        wrong = _wrong(found, count) or _leaked_value(function)
        if wrong:
            raise UserFunctionError(f"{what} {wrong}, in {_where(function.__name__, function.__code__)}")
        return found

    return part


def _steady(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    """Return the result of a function; raise TraceError if a second call gives different instructions, for
    example because of random numbers or a clock: a kernel would repeat the first call for ever."""
    machine = CURRENT.machine
    if machine.runs_now:
        return function(*arguments)
    slots, lines, count, most = len(machine.slots), len(machine.lines), machine.count, machine.most
    machine.most = count + MAX_OPERATIONS
    try:
        first = _text(function(*arguments)), machine.slots[slots:], machine.lines[lines:]
        del machine.slots[slots:], machine.lines[lines:]
        machine.count = count
        result = function(*arguments)
    finally:
        machine.most = most
    if first != (_text(result), machine.slots[slots:], machine.lines[lines:]):
        raise _Unsteady(
            f"{function.__name__} does something else at each call: a kernel is made from one call, so random"
            f" numbers, clocks and counters would stay as they were then{_at(function)}"
        )
    return result


class _Unsteady(TraceError):
    """Error that names its place itself."""


def _text(x: Any) -> Any:
    """Return a fingerprint of a result, to compare the results of two calls."""
    if isinstance(x, (Lanes, Mask)):
        return x.x
    if isinstance(x, Plane):
        return x.a.x, x.b.x
    if isinstance(x, (tuple, list)):
        return [_text(part) for part in x]
    return repr(x) if isinstance(x, (int, float, np.generic, np.ndarray)) else type(x)


# Results


def _wrong(x: Any, count: int | None) -> str:
    """Return a complaint about the result of a function; "" if it is valid."""
    if count is None:
        return f"returns {_result(x)}; expected a number" if _is_wrong(x) else ""
    expected = f"expected a tuple of {count} numbers"
    if not isinstance(x, (tuple, list)):
        return f"returns {_result(x)}; {expected}"
    if len(x) != count:
        return f"returns a tuple of {len(x)}; {expected}"
    wrong = [k for k, one in enumerate(x) if _is_wrong(one)]
    return f"returns {_result(x[wrong[0]])} at [{wrong[0]}]; {expected}" if wrong else ""


def _plain(x: Any) -> Any:
    """Return arrays of no axes, such as np.where makes of two numbers, as numbers."""
    if type(x) in (tuple, list):
        return type(x)(map(_plain, x))
    return x.item() if isinstance(x, np.ndarray) and not x.ndim else x


def _is_wrong(x: Any) -> bool:
    if isinstance(x, Value):
        return not is_real(x)
    if not is_real(x) or isinstance(x, bool):
        return True
    try:
        return not math.isfinite(x)
    except OverflowError:  # a whole number too large
        return True


def _result(x: Any) -> str:
    if isinstance(x, (bool, np.bool_, Mask)):
        return "a boolean (np.where(condition, 1.0, 0.0) makes a number of it)"
    if isinstance(x, (tuple, list)):
        return f"a {type(x).__name__} of {len(x)}"
    if isinstance(x, Plane):
        return "a planar vector (.real and .imag are its numbers)"
    words = kind_of(x)
    return words if len(words) < 80 else f"{words[:80]}..."


def _leaked_value(function: Any) -> str:
    """Return a complaint if a variable outside a function holds a value of the kernel: the next kernel
    would read it."""
    for each in _reached(function):
        for name, x in each.variables:
            if _holds_value(x):
                return (
                    f"keeps a value in {name!r}, which another kernel would read; for numbers that last from"
                    " step to step, declare the term's `state`"
                )
    return ""


def _holds_value(x: Any) -> bool:
    """Return whether a variable, or a part of it, is a value or memory of a kernel."""
    waiting, seen = [x], {id(x)}
    for part in waiting:  # which grows
        if isinstance(part, (Value, Rows)):
            return True
        if isinstance(part, dict):
            inside: Any = part.values()
        elif isinstance(part, (list, tuple, set, deque)):
            inside = part
        elif isinstance(part, (ModuleType, FunctionType)) or not hasattr(part, "__dict__"):
            inside = ()
        else:
            inside = vars(part).values()
        if len(waiting) + len(inside) < MAX_PARTS:
            new = {id(one): one for one in inside if id(one) not in seen}
            waiting += new.values()
            seen |= new.keys()
    return False


# Messages and positions


NAMES = {
    "Lanes": "a number", "float": "a number", "int": "a number", "Index": "a whole number",
    "Mask": "a boolean", "bool": "a boolean", "Plane": "a planar vector",
    "Columns": "memory", "Rows": "memory",
    "Pointer": "an array", "Matrix": "an array", "Record": "the record", "Field": "an array of the record",
    "NoneType": "nothing",
}  # fmt: skip
"""Users' names of the types in Python's messages."""


def _message_of(error: Exception) -> str:
    """Return the message of an error in one line, for the author of the function."""
    words = " ".join(str(error).split())
    words = words if len(words) <= MAX_LETTERS else f"{words[:MAX_LETTERS]}..."
    if isinstance(error, RecursionError):
        return "a recursion, or a loop, whose end is not known when the kernel is made: write it without"
    if isinstance(error, TraceError):
        return " ".join(str(error).split())
    if isinstance(error, TypeError) and "unsupported operand" in words and re.search(r"for [&|^]", words):
        words += ": put comparisons in parentheses, as in (x > 0.0) & (y > 0.0)"
    if isinstance(error, TypeError):
        words = re.sub(r"'(\w+)'( object)?", lambda found: NAMES.get(found[1], found[0]), words)
    if isinstance(error, AttributeError):
        return words
    return f"{type(error).__name__}: {words}" if words else type(error).__name__


def _place(error: Exception) -> str:
    """Return the function and line of the user's file."""
    if isinstance(error, _Unsteady):
        return ""
    frames = [
        frame for frame in traceback.extract_tb(error.__traceback__) if not _is_in(frame.filename, OURS)
    ]
    users = [frame for frame in frames if not _is_in(frame.filename, LIBRARIES)] or frames
    return f", in {users[-1].name} ({users[-1].filename}, line {users[-1].lineno})" if users else ""


OURS = (PACKAGE, NUMPY)


def _is_in(path: str, folders: tuple[Path, ...]) -> bool:
    if path.startswith("<"):  # of a notebook or a console
        return False
    where = Path(os.path.abspath(path))
    return any(where.is_relative_to(folder) for folder in folders)


def _where(name: str, code: CodeType) -> str:
    return f"{name} ({code.co_filename}, line {code.co_firstlineno})"


def _at(function: Any) -> str:
    return f", in {_where(function.__name__, function.__code__)}"


# Functions and their helpers


class Reached(NamedTuple):
    """Function that another function reaches by its names, and the outer variables that it reads."""

    function: FunctionType
    variables: list[tuple[str, Any]]


def _reached(function: FunctionType) -> Iterator[Reached]:
    """Yield a function and the helpers of the same author that it reaches by globals, modules, closures and
    defaults."""
    seen = set()
    waiting: list[Any] = [function]
    root = str(function.__module__).split(".")[0]
    while waiting:
        one = waiting.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        variables = list(_variables(one))
        yield Reached(one, variables)
        for _, x in variables:
            x = getattr(x, "__wrapped__", x)
            if not isinstance(x, FunctionType) or _is_in(x.__code__.co_filename, OURS):
                continue
            if str(x.__module__).split(".")[0] == root or not _is_in(x.__code__.co_filename, LIBRARIES):
                waiting.append(x)


def _variables(function: FunctionType) -> Iterator[tuple[str, Any]]:
    codes = [function.__code__]
    for code in codes:
        codes += [part for part in code.co_consts if isinstance(part, CodeType)]
        for name in code.co_names:
            if name in function.__globals__:
                x = function.__globals__[name]
                yield name, x
                if isinstance(x, ModuleType):
                    found = ((f"{name}.{other}", vars(x).get(other)) for other in code.co_names)
                    yield from (pair for pair in found if isinstance(pair[1], FunctionType))
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            yield name, cell.cell_contents
        except ValueError:  # not set yet
            continue
    names = function.__code__.co_varnames
    for name, x in [*zip(reversed(names[: function.__code__.co_argcount]),
                         reversed(function.__defaults__ or ()), strict=False),
                    *(function.__kwdefaults__ or {}).items()]:  # fmt: skip
        yield name, x
    yield from vars(function).items()


def check_imports(name: str, function: Any, error: type[ParameterError] = ParameterError) -> None:
    """Raise ParameterError, or the given kind of it, if a function or one of its helpers imports a module."""
    for each, _ in _reached(function):
        for line in _imports(each.__code__):
            raise error(
                f"{name}: `import` in {each.__name__} ({each.__code__.co_filename}, line {line}): expected it"
                " at the top of the file, because a function becomes a kernel by one call"
            )


def check_function(name: str, function: Any, arguments: int) -> None:
    """Raise ParameterError unless `function` is a plain function of `arguments` arguments without imports."""
    if not isinstance(function, FunctionType) or function.__code__.co_flags & PLAIN_FLAGS:
        raise ParameterError(
            f"{name}: expected a plain function of {arguments} arguments, got {function!r};"
            " write one with def or lambda, which may call methods and objects"
        )
    code = function.__code__
    least = code.co_argcount - len(function.__defaults__ or ())
    if not least <= arguments <= code.co_argcount or code.co_kwonlyargcount:
        given = ", ".join(code.co_varnames[: code.co_argcount + code.co_kwonlyargcount])
        raise ParameterError(f"{name}: expected a function of {arguments} arguments, got one of ({given})")
    check_imports(name, function)


def _imports(code: CodeType) -> Iterator[int]:
    """Yield the lines with an import in a function and in the functions inside it."""
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


# Arguments of functions, and messages


def inputs(kind: Any) -> Any:
    """Make a named tuple, an argument of users' functions, refuse unknown fields and assignments."""

    def unknown(self: Any, name: str) -> Any:
        raise AttributeError(f"no field {name!r}; {kind.__name__} has {', '.join(kind._fields)}")

    def refuse(self: Any, name: str, value: Any = None) -> None:
        refuse_write(repr(name))

    kind.__getattr__, kind.__setattr__, kind.__delattr__ = unknown, refuse, refuse
    return kind


def user_error(name: str, error: UserFunctionError) -> ParameterError:
    """Return the error for the author of a function, about the task or setting of a name.

    Args:
        name: of the task or setting.
        error: the error.
    """
    return ParameterError(f"{name}: {error}")


def function_name(function: Callable[..., Any]) -> str:
    """Return the module and name of a function, for messages."""
    return f"{function.__module__}.{function.__qualname__}"
