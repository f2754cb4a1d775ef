"""Functions of ordinary numbers with Python's own `if`, `while`, `and`, `or`, `not` and `math`, as parts of kernels.

Their source is rewritten once: what Python would decide becomes a call of a function here, which decides at once
where everything is known, and writes a branch where it is not. Helpers that they call are rewritten, too.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import textwrap
from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

from hoof_env.simd import values
from hoof_env.simd.flow import Cell, cond
from hoof_env.simd.machines import CURRENT
from hoof_env.simd.values import Index, Lanes, Mask, TraceError, Value, full, is_real


class Unset:
    """A variable without a value."""


def _number(name: str) -> Callable[..., Any]:
    """Return a function of the C library for ordinary numbers of a running kernel."""

    def function(*arguments: Any) -> Lanes:
        machine = CURRENT.machine
        kinds = ", ".join(["double"] * len(arguments))
        machine.declared[name] = f"declare double @{name}({kinds})"
        given = ", ".join(f"double {full(x, 0).x}" for x in arguments)
        return Lanes(machine.new(f"call double @{name}({given})"), 0)

    return function


_IN_KERNELS: dict[Any, Callable[..., Any]] = {
    getattr(math, name): _number(name)
    for name in "exp log log1p expm1 sin cos tan asin acos atan atan2 sinh cosh tanh hypot pow fmod".split()
}
_IN_KERNELS |= {
    math.sqrt: values.sqrt, math.fabs: values.absolute, math.floor: values.floor, builtins.abs: values.absolute,
    builtins.float: lambda x: x, math.isfinite: lambda x: x - x == 0.0, math.isnan: lambda x: x != x,
    builtins.min: lambda *x: _reduced(values.minimum, x), builtins.max: lambda *x: _reduced(values.maximum, x),
    math.copysign: lambda x, y: values.where(y < 0.0, -values.absolute(x), values.absolute(x)),
}  # fmt: skip


def _reduced(function: Callable[..., Any], parts: tuple[Any, ...]) -> Any:
    total = parts[0]
    for part in parts[1:]:
        total = function(total, part)
    return total


def call(function: Any, *arguments: Any, **named: Any) -> Any:
    """Call a function: that of a kernel in the place of Python's where an argument is a kernel's value."""
    if isinstance(function, FunctionType) and not function.__module__.startswith("hoof_env."):
        return rewritten(function)(*arguments, **named)
    if any(isinstance(x, Value) for x in arguments):
        try:
            function = _IN_KERNELS.get(function, function)
        except TypeError:  # not hashable
            pass
    return function(*arguments, **named)


def choose(test: Any, then: Callable[[], Any], otherwise: Callable[[], Any]) -> Any:
    """Return what `if` would: values of variables, or the result of the function."""
    if isinstance(test, (Lanes, Index)):
        test = test != 0
    if not isinstance(test, Mask) or CURRENT.machine.runs_now:
        return then() if test else otherwise()
    others: dict[str, Any] = {}

    def kept(name: str, branch: Callable[[], Any]) -> Any:
        given = branch()
        parts = given if isinstance(given, tuple) else (given,)
        others[name] = given, [x for x in parts if is_real(x) and not isinstance(x, bool)]
        return parts

    # which parts are numbers is known after both; so first the branches without their results
    cells = [Cell(0.0) for _ in range(16)]

    def run(name: str, branch: Callable[[], Any]) -> None:
        for cell, x in zip(cells, kept(name, branch), strict=False):
            if is_real(x):
                cell.value = full(x, 0)

    cond(test, lambda: run("then", then), lambda: run("else", otherwise))
    first, second = others["then"][0], others["else"][0]
    if isinstance(first, tuple):
        pairs = zip(first, second, cells, strict=False)
        return tuple(_merged(a, b, cell) for a, b, cell in pairs)
    return _merged(first, second, cells[0])


def _merged(one: Any, other: Any, cell: Cell) -> Any:
    if is_real(one) and is_real(other):
        return cell.value
    if one is other:
        return one
    if one is Unset or other is Unset:
        return Unset
    raise TraceError(f"{type(one).__name__} in one case and {type(other).__name__} in another")


def both(one: Any, other: Callable[[], Any]) -> Any:
    """`and`"""
    return one & other() if isinstance(one, Mask) else one and other()


def either(one: Any, other: Callable[[], Any]) -> Any:
    """`or`"""
    return one | other() if isinstance(one, Mask) else one or other()


def opposite(one: Any) -> Any:
    """`not`"""
    return ~one if isinstance(one, Mask) else not one


class _Rewriter(ast.NodeTransformer):
    """Transformer of one function's body."""

    def __init__(self) -> None:
        self.count = 0

    # expressions

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        self.generic_visit(node)
        return _called("choose", node.test, _lambda(node.body), _lambda(node.orelse))

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        self.generic_visit(node)
        name = "both" if isinstance(node.op, ast.And) else "either"
        result = node.values[-1]
        for value in reversed(node.values[:-1]):
            result = _called(name, value, _lambda(result))
        return result

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        self.generic_visit(node)
        return _called("opposite", node.operand) if isinstance(node.op, ast.Not) else node

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        parts = [node.left, *node.comparators]
        result: ast.expr | None = None
        for left, op, right in reversed(list(zip(parts, node.ops, parts[1:], strict=False))):
            one = ast.Compare(left, [op], [right])
            result = one if result is None else _called("both", one, _lambda(result))
        return result  # type: ignore[return-value]

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        return ast.Call(_name("_hoof_call"), [node.func, *node.args], node.keywords)

    # statements

    def block(self, body: list[ast.stmt], known: set[str]) -> list[ast.stmt]:
        """Rewrite statements, of which `known` variables are set before."""
        made: list[ast.stmt] = []
        known = set(known)
        for k, one in enumerate(body):
            if isinstance(one, ast.If):
                rest = body[k + 1 :]
                if any(isinstance(inner, ast.Return) for inner in ast.walk(one)):
                    # what follows belongs to each branch that goes on
                    then, other = one.body + rest, one.orelse + rest
                    made += self._branch(one.test, _ended(then), _ended(other), known, None)
                    return made
                names = sorted(_assigned(one.body) | _assigned(one.orelse))
                made += self._branch(one.test, one.body, one.orelse, known, names)
                known |= set(names)
                continue
            if isinstance(one, (ast.While, ast.Try, ast.With)):
                raise TraceError(f"a `{type(one).__name__.lower()}` in line {one.lineno}")
            if isinstance(one, ast.For):
                one.iter = self.visit(one.iter)
                one.body = self.block(one.body, known | _assigned([one]))
            else:
                one = self.visit(one)
            made.append(one)
            known |= _assigned([one])
            if isinstance(one, ast.Return):
                break
        return made

    def _branch(
        self, test: ast.expr, then: list[ast.stmt], other: list[ast.stmt], known: set[str], names: list[str] | None
    ) -> list[ast.stmt]:
        self.count += 1
        functions: list[ast.stmt] = []
        for label, body in (("then", then), ("else", other)):
            own = sorted(_assigned(body))
            made = self.block(body, known | set(own))
            if names is not None:
                values = ast.Tuple([_name(name) for name in names], ast.Load())
                unset = [name for name in names if name not in own and name not in known]
                made = [_set(name, _name("_hoof_Unset")) for name in unset] + made
                made.append(ast.Return(values))
            arguments = ast.arguments(
                posonlyargs=[], args=[ast.arg(name) for name in own], kwonlyargs=[], kw_defaults=[],
                defaults=[_name(name if name in known else "_hoof_Unset") for name in own],
            )  # fmt: skip
            name = f"_{label}{self.count}"
            functions.append(ast.FunctionDef(name, arguments, made or [ast.Pass()], [], type_params=[]))
        result = _called("choose", self.visit(test), *(_name(f.name) for f in functions))
        if names is None:
            return [*functions, ast.Return(result)]
        if not names:
            return [*functions, ast.Expr(result)]
        target = ast.Tuple([ast.Name(name, ast.Store()) for name in names], ast.Store())
        return [*functions, ast.Assign([target], result)]


def _ended(body: list[ast.stmt]) -> list[ast.stmt]:
    return [*body, ast.Return(ast.Constant(None))]


def _assigned(body: list[ast.stmt]) -> set[str]:
    found = (inner for one in body for inner in ast.walk(one))
    return {n.id for n in found if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}


def _name(text: str) -> ast.Name:
    return ast.Name(text, ast.Load())


def _set(name: str, value: ast.expr) -> ast.stmt:
    return ast.Assign([ast.Name(name, ast.Store())], value)


def _called(name: str, *arguments: Any) -> ast.Call:
    return ast.Call(_name(f"_hoof_{name}"), list(arguments), [])


def _lambda(body: Any) -> ast.Lambda:
    nothing = ast.arguments(posonlyargs=[], args=[], kwonlyargs=[], kw_defaults=[], defaults=[])
    return ast.Lambda(nothing, body)


@cache
def rewritten(function: Any) -> Any:
    """Return the function with decisions that a kernel can take; itself if its source is not there."""
    try:
        lines, first = inspect.getsourcelines(function)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, TypeError, SyntaxError):
        return function
    (node,) = tree.body[:1]
    if not isinstance(node, ast.FunctionDef):  # a lambda
        return function
    node.decorator_list = []
    parameters = {arg.arg for arg in [*node.args.posonlyargs, *node.args.args]}
    node.body = _Rewriter().block(node.body, parameters)
    free = function.__code__.co_freevars
    if free:  # variables of the function around it
        cells = [ast.arg(name) for name in free]
        outer = ast.arguments(posonlyargs=[], args=cells, kwonlyargs=[], kw_defaults=[], defaults=[])
        body: list[ast.stmt] = [node, ast.Return(_name(node.name))]
        tree.body = [ast.FunctionDef("_outer", outer, body, [], type_params=[])]
    ast.increment_lineno(tree, first - 1)
    code = compile(ast.fix_missing_locations(tree), inspect.getsourcefile(function) or "?", "exec")
    names: dict[str, Any] = {}
    scope = _Scope(function.__globals__)
    exec(code, scope, names)
    if free:
        made = names["_outer"](*(cell.cell_contents for cell in function.__closure__))
    else:
        made = names[node.name]
    made.__defaults__ = function.__defaults__
    return made


def _Scope(globals_: dict[str, Any]) -> dict[str, Any]:
    own = {"call": call, "choose": choose, "both": both, "either": either, "opposite": opposite, "Unset": Unset}
    return {**globals_, **{f"_hoof_{name}": value for name, value in own.items()}}
