"""Plain functions from outside this package inside kernels: their compilation, checks of their results, and
error messages for those that cannot be compiled. `hoof_env.simd.reach` distinguishes them."""

from __future__ import annotations

import ast
import linecache
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from types import FunctionType, MappingProxyType
from typing import Any

from numba.core import types
from numba.core.errors import NumbaError

from hoof_env.errors import ParameterError
from hoof_env.simd.compile import inline_llvm
from hoof_env.simd.types import Mask, Plane, instruction, is_real

PACKAGE = Path(__file__).parents[1]


class NotCompiledError(Exception):
    """Reason why a function from outside this package cannot be part of a kernel.

    numba passes it on at once. After an error of its own it goes on, and compiles again what calls the
    function, which takes twice as long for a contact law.
    """


class WrongResultError(NotCompiledError):
    """Result of such a function that a kernel cannot take, in words for its author."""


def inline_foreign(function: Callable[..., Any]) -> Any:
    """Return a function from outside this package as `inline_llvm` does, with `NotCompiledError` where numba
    cannot compile it."""
    compiled: Any = inline_llvm(function)
    compile_now = compiled.compile

    def compile_once(signature: Any) -> Any:
        try:
            return compile_now(signature)
        except NumbaError as error:
            raise NotCompiledError(str(error)) from None

    compiled.compile = compile_once
    return compiled


def number_of(what: str) -> Any:
    """Return a function for kernels that passes on the result of `what`, and refuses it unless it is a
    number."""
    names = {Mask: "truths", Plane: "planar vectors", types.Boolean: "a truth", types.NoneType: "nothing"}

    def typed(x: Any) -> Any:
        if not is_real(x):
            kinds = (name for kind, name in names.items() if isinstance(x, kind))
            given = "nothing in some cases" if isinstance(x, types.Optional) else next(kinds, str(x))
            raise WrongResultError(f"{what} returns {given}; expected a number")
        return x(x)

    return instruction(typed)(lambda code, x: x)


def numbers_of(what: str, count: int) -> Any:
    """Return a function for kernels that passes on the result of `what`, and refuses it unless it is a tuple
    of `count` values."""

    def typed(x: Any) -> Any:
        if not isinstance(x, types.BaseTuple) or len(x) != count:
            given = f"a tuple of {len(x)}" if isinstance(x, types.BaseTuple) else str(x)
            raise WrongResultError(f"{what} returns {given}; expected a tuple of {count} numbers")
        return x(x)

    return instruction(typed)(lambda code, x: x)


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
    """Return the error for the author of a function, about the task or setting of a name; arguments are those
    of `what_cannot_be_compiled`. It takes the traceback from `error`: numba's hundred frames would hide the
    message, and keep all that was compiled alive."""
    error.__traceback__ = None
    return ParameterError(f"{name}: {what_cannot_be_compiled(error, moved)}")


def what_cannot_be_compiled(error: Exception, moved: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return what numba does not compile in a function from outside: the operation, the function and the
    line.

    Args:
        error: numba's, or `NotCompiledError`.
        moved: present names of attributes that had other ones, or were elsewhere.
    """
    text = str(error)
    if isinstance(error, WrongResultError):
        return text
    where = next((place for place in map(_place, re.findall(r'File "(.*?)", line (\d+)', text)) if place), "")
    return (
        f"cannot compile {_operation(text, moved)}{where}; expected + - * /, comparisons and the functions "
        "of hoof_env.simd (`where` in the place of `if`), or of a term or entry scalar=True"
    )


def _operation(text: str, moved: Mapping[str, str]) -> str:
    """Return the innermost cause in a message of numba's."""
    if found := re.search(r"No implementation of function Function\(<(.+?)(?: at 0x\w+)?>\)", text):
        name = re.findall(r"[\w.]+", found[1])[-1]
        return "`if`, `and`, `or` or `not` of numbers" if name == "bool" else f"{name}()"
    if found := re.search(r"Unknown attribute '(\w+)' of type (\w+)", text):
        now = f" (it is .{moved[found[1]]} now)" if found[1] in moved else ""
        return f".{found[1]}, which {found[2]} has not{now},"
    if found := re.search(r"Untyped global name '(\w+)'", text):
        return f"{found[1]}, a function without @hoof_env.simd.compile.inline_llvm, or no number"
    causes = re.findall(r"Failed in nopython mode pipeline.*\n\s*(\S.*)", text) or [text.strip()]
    return causes[-1].splitlines()[0][:200]


def _place(found: tuple[str, str]) -> str:
    """Return function and line of a place in a user's file; empty if the file belongs to this package."""
    path = os.path.abspath(found[0])
    line = int(found[1])
    if Path(path).is_relative_to(PACKAGE):
        return ""
    tree = ast.parse("".join(linecache.getlines(path)))
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    # the last one is the innermost: `ast.walk` visits outer functions first
    inside = [node.name for node in functions if node.lineno <= line <= (node.end_lineno or line)]
    return f" in {inside[-1]} ({path}, line {line})" if inside else f" in {path}, line {line}"


def function_name(function: Callable[..., Any]) -> str:
    """Return module and name of a function, for messages."""
    return f"{function.__module__}.{function.__qualname__}"
