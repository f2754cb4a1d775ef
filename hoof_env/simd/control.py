"""Control flow that depends on values of the running kernel. With conditions and counts that are known when a
kernel is traced, and on a machine that computes at once, all of it is Python's own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from hoof_env.simd.machines import CURRENT, wide
from hoof_env.simd.values import Index, Lanes, Mask, Plane, Truth, Whole, full, rounded, word


def _is_known(condition: Any) -> bool:
    return not isinstance(condition, Mask) or CURRENT.machine.runs_now


def when(condition: Truth) -> Callable[[Callable[[], None]], None]:
    """Return a decorator that runs a function where a condition holds that all lanes share:

    @when(any_lane(inside))
    def _() -> None: ...

    The function's results are in memory, or in a `Cell`.
    """

    def decorate(function: Callable[[], None]) -> None:
        cond(condition, function, None)

    return decorate


def cond(condition: Truth, then: Callable[[], Any], otherwise: Any) -> Any:
    """Return the result of `then` where a condition holds that all lanes share, else `otherwise`: a value or
    a tuple of values, or a function that returns them. The result enters sums rounded."""
    if _is_known(condition):
        if condition:
            return rounded(then())
        return rounded(otherwise() if callable(otherwise) else otherwise)
    machine = CURRENT.machine
    x = condition.x  # type: ignore[union-attr]
    yes, no, end = (machine.label(name) for name in ("then", "else", "end"))
    machine.do(f"br i1 {x}, label %{yes}, label %{no if callable(otherwise) else end}")
    entry, at = machine.lines, len(machine.lines) - 1
    machine.begin(yes)
    given = then()
    if given is None and not callable(otherwise):  # memory alone changes
        machine.do(f"br label %{end}")
        machine.begin(end)
        return None
    many = isinstance(given, tuple)
    values = given if many else () if given is None else (given,)
    # through the stack, of which LLVM makes registers
    other = None if callable(otherwise) else otherwise if many else (otherwise,)
    kinds = [_kind_of(value, *(() if other is None else (other[k],))) for k, value in enumerate(values)]
    slots = [[machine.slot(wide("double", n)) for _ in range(parts)] for n, parts in kinds]
    if other is not None:  # before the branch
        body = entry[at:]
        del entry[at:]
        _keep(other, kinds, slots)
        entry += body
    _keep(values, kinds, slots)
    machine.do(f"br label %{end}")
    if callable(otherwise):
        machine.begin(no)
        other = otherwise()
        if given is not None:
            _keep(other if many else (other,), kinds, slots)
        machine.do(f"br label %{end}")
    machine.begin(end)
    if given is None:
        return None
    results: list[Any] = []
    for (n, _), places in zip(kinds, slots, strict=True):
        parts = [Lanes(machine.load(place, "double", n, 64), n) for place in places]
        results.append(Plane(*parts) if len(parts) == 2 else parts[0])
    return tuple(results) if many else results[0]


def _kind_of(*values: Any) -> tuple[int, int]:
    """Return the number of lanes of values of one kind, and the number of parts of each."""
    n = max(getattr(value, "n", 0) for value in values)
    return n, 2 if any(isinstance(value, Plane) for value in values) else 1


def _keep(values: Any, kinds: Any, slots: Any) -> None:
    machine = CURRENT.machine
    for value, (n, _), places in zip(values, kinds, slots, strict=True):
        parts = (value.a, value.b) if isinstance(value, Plane) else (value,)
        for part, place in zip(parts, places, strict=True):
            machine.store(place, full(part, n).x, "double", n, 64)


def loop(begin: Whole, end: Whole | None = None, step: Whole = 1) -> Iterator[Any]:
    """Run the body of a `for` with the numbers of `range`; traced once if a bound is known only when the
    kernel runs. Variables that change from turn to turn are in memory, or in a `Cell`."""
    first, last = (0, begin) if end is None else (begin, end)
    if not any(isinstance(bound, Index) for bound in (first, last, step)):
        yield from range(first, last, step)
        return
    machine = CURRENT.machine
    counter = machine.slot("i64")
    machine.store(counter, word(first), "i64")
    test, body, after = (machine.label(name) for name in ("loop", "body", "after"))
    machine.do(f"br label %{test}")
    machine.begin(test)
    now = machine.load(counter, "i64")
    goes_on = machine.index_compare("<", now, word(last))
    machine.do(f"br i1 {goes_on}, label %{body}, label %{after}")
    machine.begin(body)
    yield Index(now)
    machine.store(counter, machine.index_binary("add", now, word(step)), "i64")
    machine.do(f"br label %{test}")
    machine.begin(after)


def rolled(count: int) -> Whole:
    """Return a count whose `loop` is traced once, not turn by turn: a body of many instructions is short
    then."""
    return count if CURRENT.machine.runs_now else Index(str(count))


class Cell:
    """Variable of a kernel that changes inside `loop` or `when`: lanes, an ordinary number, or a whole number
    if its first value is one. Its value enters sums rounded."""

    def __init__(self, value: Any) -> None:
        is_whole = isinstance(value, (int, Index))
        self._kind = "i64" if is_whole else "double"
        self._n = getattr(value, "n", 0)
        self._runs_now = CURRENT.machine.runs_now
        if not self._runs_now:
            self._slot = CURRENT.machine.slot(wide(self._kind, self._n))
        self.value = value

    @property
    def value(self) -> Any:
        """The present value."""
        if self._runs_now:
            return self._value
        x = CURRENT.machine.load(self._slot, self._kind, self._n)
        return Lanes(x, self._n) if self._kind == "double" else Index(x)

    @value.setter
    def value(self, value: Any) -> None:
        if self._runs_now:
            self._value = rounded(value)
            return
        x = full(value, self._n).x if self._kind == "double" else word(value)
        CURRENT.machine.store(self._slot, x, self._kind, self._n)


def one_of(values: Any, k: Whole) -> Any:
    """Return the k-th of a few numbers."""
    if not isinstance(k, Index):
        return values[k]
    chosen: Any = values[-1]
    for j in range(len(values) - 2, -1, -1):
        mask = k == j
        chosen = Lanes(CURRENT.machine.select(mask.x, full(values[j], 0).x, full(chosen, 0).x, 0, 0), 0)
    return full(chosen, 0)
