"""Values of kernels: lanes, planar vectors, truths, whole numbers; operators and functions on them.

`CURRENT.machine` carries the operations out: while a kernel is traced it writes instructions, otherwise it
computes. A product that enters a sum is not rounded: `a * b + c` on lanes is one fused operation. A value
remembers the factors that it is the product of; `rounded` makes it forget them, as passing a function does.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hoof_env.simd.machines import CURRENT

_REAL = (int, float, np.floating, np.integer)


class TraceError(TypeError):
    """Something that a kernel cannot do with a value."""


def _no_truth(value: Any) -> bool:
    raise TraceError(
        f"`if`, `and`, `or` or `not` of {value.kind}, which is known only when the kernel runs: use where(condition,"
        " yes, no), & and | in their place, or `when` for a condition that all lanes share; or scalar=True"
    )


class Value:
    """Base of values."""

    __slots__ = ()
    kind = "a value"
    __hash__ = None  # type: ignore[assignment]
    __array_ufunc__ = None  # NumPy's numbers leave the operators to this class

    def __iter__(self) -> Any:
        raise TraceError(f"a loop over {self.kind}")

    def __float__(self) -> float:
        raise TraceError(f"float(), or a function of `math`, of {self.kind}: use those of simd, or scalar=True")

    __index__ = __int__ = __float__


class Lanes(Value):
    """n doubles, one for each lane; an ordinary number that is known only when the kernel runs if n is 0."""

    __slots__ = ("factors", "n", "x")
    kind = "a number"

    def __init__(self, x: Any, n: int, factors: Any = None) -> None:
        self.x = x
        self.n = n
        self.factors = factors

    def __add__(self, other: Any) -> Any:
        return _sum("+", self, other)

    def __radd__(self, other: Any) -> Any:
        return _sum("+", other, self)

    def __sub__(self, other: Any) -> Any:
        return _sum("-", self, other)

    def __rsub__(self, other: Any) -> Any:
        return _sum("-", other, self)

    def __mul__(self, other: Any) -> Any:
        return _product(self, other)

    def __rmul__(self, other: Any) -> Any:
        return _product(other, self)

    def __truediv__(self, other: Any) -> Any:
        return _binary("fdiv", self, other) if is_real(other) else NotImplemented

    def __rtruediv__(self, other: Any) -> Any:
        return _binary("fdiv", other, self) if is_real(other) else NotImplemented

    def __neg__(self) -> Lanes:
        return Lanes(CURRENT.machine.negative(self.x, self.n), self.n)

    def __pow__(self, power: Any) -> Any:
        if power == 2:
            return self * self
        raise TraceError("a power other than 2 of lanes: use simd.math.root_power")

    def __abs__(self) -> Lanes:
        return absolute(self)

    def __lt__(self, other: Any) -> Any:
        return _comparison("<", self, other)

    def __le__(self, other: Any) -> Any:
        return _comparison("<=", self, other)

    def __gt__(self, other: Any) -> Any:
        return _comparison(">", self, other)

    def __ge__(self, other: Any) -> Any:
        return _comparison(">=", self, other)

    def __eq__(self, other: Any) -> Any:
        return _comparison("==", self, other)

    def __ne__(self, other: Any) -> Any:
        return _comparison("!=", self, other)

    def __bool__(self) -> bool:
        return _no_truth(self)


class Mask(Value):
    """n truths; one that all lanes share if n is 0."""

    __slots__ = ("n", "x")
    kind = "a truth"

    def __init__(self, x: Any, n: int) -> None:
        self.x = x
        self.n = n

    def __and__(self, other: Any) -> Mask:
        return self._with("and", other)

    def __or__(self, other: Any) -> Mask:
        return self._with("or", other)

    __rand__, __ror__ = __and__, __or__

    def _with(self, name: str, other: Any) -> Any:
        if isinstance(other, bool):  # known when the kernel is traced
            return (self if other else False) if name == "and" else (True if other else self)
        if self.n != other.n:
            return NotImplemented
        return Mask(CURRENT.machine.logic(name, self.x, other.x, self.n), self.n)

    def to_whole(self) -> Index:
        """Return 1 if it holds, else 0."""
        return Index(CURRENT.machine.new(f"zext i1 {self.x} to i64"))

    def __invert__(self) -> Mask:
        return Mask(CURRENT.machine.logic("xor", self.x, "true", 0), 0)

    def __bool__(self) -> bool:
        if CURRENT.machine.runs_now and not self.n:
            return bool(self.x)
        return _no_truth(self)


class Plane(Value):
    """n planar vectors, x and y, that multiply like complex numbers."""

    __slots__ = ("a", "b")
    kind = "a planar vector"

    def __init__(self, a: Lanes, b: Lanes) -> None:
        self.a = a
        self.b = b

    @property
    def n(self) -> int:
        return self.a.n

    @property
    def real(self) -> Lanes:
        return Lanes(self.a.x, self.a.n)

    @property
    def imag(self) -> Lanes:
        return Lanes(self.b.x, self.b.n)

    def __add__(self, other: Any) -> Any:
        return self._sum("+", other)

    def __sub__(self, other: Any) -> Any:
        return self._sum("-", other)

    def _sum(self, sign: str, other: Any) -> Any:
        if not isinstance(other, Plane):
            return NotImplemented
        return Plane(_sum(sign, self.a, other.a), _sum(sign, self.b, other.b))

    def __mul__(self, other: Any) -> Any:
        return _product(self, other)

    def __rmul__(self, other: Any) -> Any:
        return _product(other, self)

    def __truediv__(self, other: Any) -> Any:
        if not is_real(other):
            return NotImplemented
        # one reciprocal, since a division takes as long as several products
        per = _binary("fdiv", full(1.0, self.n), other)
        return Plane(_product(self.a, per), _product(self.b, per))

    def __neg__(self) -> Plane:
        return Plane(-self.a, -self.b)

    def __bool__(self) -> bool:
        return _no_truth(self)


class Index(Value):
    """Whole number that all lanes share and that is known only when the kernel runs."""

    __slots__ = ("x",)
    kind = "a whole number"

    def __init__(self, x: str) -> None:
        self.x = x

    def _with(self, name: str, one: Any, other: Any) -> Any:
        if not all(isinstance(value, (int, Index)) for value in (one, other)):
            return NotImplemented
        return Index(CURRENT.machine.new(f"{name} i64 {word(one)}, {word(other)}"))

    def __add__(self, other: Any) -> Any:
        if isinstance(other, (float, Lanes)):
            return self.to_real() + other
        return self if isinstance(other, int) and other == 0 else self._with("add", self, other)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        if isinstance(other, (float, Lanes)):
            return self.to_real() - other
        return self._with("sub", self, other)

    def __rsub__(self, other: Any) -> Any:
        return self._with("sub", other, self)

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, (float, Lanes)):
            return self.to_real() * other
        return self if isinstance(other, int) and other == 1 else self._with("mul", self, other)

    __rmul__ = __mul__

    def __mod__(self, other: int) -> Any:
        """Return the rest of a number that is not negative."""
        return self._with("srem", self, other)

    def __or__(self, other: Any) -> Any:
        return self._with("or", self, other)

    __ror__ = __or__

    def _compared(self, name: str, other: Any) -> Any:
        if not isinstance(other, (int, Index)):
            return NotImplemented
        return Mask(CURRENT.machine.new(f"icmp {name} i64 {self.x}, {word(other)}"), 0)

    def __lt__(self, other: Any) -> Any:
        return self._compared("slt", other)

    def __le__(self, other: Any) -> Any:
        return self._compared("sle", other)

    def __gt__(self, other: Any) -> Any:
        return self._compared("sgt", other)

    def __ge__(self, other: Any) -> Any:
        return self._compared("sge", other)

    def __eq__(self, other: Any) -> Any:
        return self._compared("eq", other)

    def __ne__(self, other: Any) -> Any:
        return self._compared("ne", other)

    def __bool__(self) -> bool:
        return _no_truth(self)

    def to_real(self) -> Lanes:
        """Return it as a number."""
        return Lanes(CURRENT.machine.new(f"sitofp i64 {self.x} to double"), 0)


def word(value: Any) -> Any:
    """Return what stands for a whole number in an instruction."""
    return value.x if isinstance(value, Index) else int(value)


def is_real(value: Any) -> bool:
    """True for lanes and ordinary numbers."""
    return isinstance(value, (Lanes, Index, *_REAL))


def payload(value: Any, n: int) -> Any:
    """Return a number as payload of n lanes."""
    if isinstance(value, Lanes):
        if value.n == n or max(value.n, n) <= 1:
            return value.x
        if value.n:
            raise TraceError(f"{value.n} lanes with {n}")
        return CURRENT.machine.spread(value.x, n)
    if isinstance(value, Index):
        return CURRENT.machine.spread(value.to_real().x, n)
    return CURRENT.machine.number(float(value), n)


def full(value: Any, n: int) -> Lanes:
    """Return a number in each of n lanes."""
    return Lanes(payload(value, n), n)


def _lanes_of(*values: Any) -> int:
    return max((value.n for value in values if isinstance(value, (Lanes, Plane))), default=0)


def _binary(name: str, one: Any, other: Any) -> Lanes:
    n = _lanes_of(one, other)
    return Lanes(CURRENT.machine.binary(name, payload(one, n), payload(other, n), n), n)


def _sum(sign: str, one: Any, other: Any) -> Any:
    if not (is_real(one) and is_real(other)):
        return NotImplemented
    machine = CURRENT.machine
    n = _lanes_of(one, other)
    if isinstance(other, Lanes) and other.factors and other.n == n:
        a, b = other.factors
        return Lanes(machine.fma(machine.negative(a, n) if sign == "-" else a, b, payload(one, n), n), n)
    if isinstance(one, Lanes) and one.factors and one.n == n:
        c = payload(other, n)
        return Lanes(machine.fma(*one.factors, machine.negative(c, n) if sign == "-" else c, n), n)
    return Lanes(machine.binary("fadd" if sign == "+" else "fsub", payload(one, n), payload(other, n), n), n)


def _product(one: Any, other: Any) -> Any:
    if isinstance(one, Plane) and isinstance(other, Plane):
        x = _sum("-", _product(one.a, other.a), _product(one.b, other.b))
        return Plane(x, _sum("+", _product(one.a, other.b), _product(one.b, other.a)))
    if isinstance(one, Plane):
        one, other = other, one
    if isinstance(other, Plane):
        return Plane(_product(one, other.a), _product(one, other.b)) if is_real(one) else NotImplemented
    if not (is_real(one) and is_real(other)):
        return NotImplemented
    n = _lanes_of(one, other)
    factors = payload(one, n), payload(other, n)
    return Lanes(CURRENT.machine.binary("fmul", *factors, n), n, factors if n else None)


def _comparison(symbol: str, one: Any, other: Any) -> Any:
    if not is_real(other):
        return NotImplemented
    n = _lanes_of(one, other)
    return Mask(CURRENT.machine.compare(symbol, payload(one, n), payload(other, n), n), n)


def rounded(value: Any) -> Any:
    """Return a value, or a tuple of values, that enters sums rounded."""
    if isinstance(value, Lanes):
        return Lanes(value.x, value.n) if value.factors else value
    if isinstance(value, Plane):
        return Plane(rounded(value.a), rounded(value.b))
    if type(value) is tuple:
        return tuple(map(rounded, value))
    if isinstance(value, tuple) and any(isinstance(part, (Lanes, Plane)) for part in value):
        return type(value)(*map(rounded, value))
    return value


# Functions. Ordinary numbers are computed at once, whatever the machine.


def _real_function(name: str, at_once: Any) -> Any:
    def function(x: Any) -> Any:
        if not isinstance(x, Lanes):
            return at_once(x)
        return Lanes(CURRENT.machine.unary(name, x.x, x.n), x.n)

    return function


sqrt = _real_function("sqrt", np.sqrt)
absolute = _real_function("fabs", np.abs)
floor = _real_function("floor", np.floor)


def vector(x: Any, y: Any) -> Any:
    """Return the planar vector (x, y)."""
    n = _lanes_of(x, y)
    kept = [part if isinstance(part, Lanes) and part.n == n else full(part, n) for part in (x, y)]
    return Plane(*kept)


def perpendicular(z: Any) -> Any:
    """Return a planar vector turned left by a right angle."""
    return Plane(-z.b, Lanes(z.a.x, z.a.n, z.a.factors)) if isinstance(z, Plane) else 1j * z


def dot(z: Plane, w: Plane) -> Lanes:
    """Return the scalar product of planar vectors."""
    return _sum("+", _product(z.a, w.a), _product(z.b, w.b))


def cross(z: Plane, w: Plane) -> Lanes:
    """Return z x w, positive if w is to the left of z."""
    return _sum("-", _product(z.a, w.b), _product(z.b, w.a))


def where(condition: Any, yes: Any, no: Any) -> Any:
    """Return `yes` where the condition holds, else `no`, lane by lane."""
    if isinstance(condition, (bool, np.bool_)):
        return yes if condition else no
    if isinstance(yes, Plane):
        return Plane(where(condition, yes.a, no.a), where(condition, yes.b, no.b))
    n = max(condition.n, _lanes_of(yes, no))
    chosen = CURRENT.machine.select(condition.x, payload(yes, n), payload(no, n), n, condition.n)
    return Lanes(chosen, n)


def maximum(x: Any, y: Any) -> Any:
    """Return y if it is larger, else x: NaN stays NaN if it is x."""
    return _chosen(">", x, y)


def minimum(x: Any, y: Any) -> Any:
    """Return y if it is smaller, else x: NaN stays NaN if it is x."""
    return _chosen("<", x, y)


def _chosen(symbol: str, x: Any, y: Any) -> Any:
    if not (isinstance(x, Lanes) or isinstance(y, Lanes)):
        return y if (y > x if symbol == ">" else y < x) else x
    n = _lanes_of(x, y)
    x, y = full(x, n), full(y, n)
    return where(_comparison(symbol, y, x), y, x)


def any_lane(condition: Any) -> Any:
    """Return whether a condition holds in any lane."""
    return condition if isinstance(condition, bool) else Mask(CURRENT.machine.any_lane(condition.x, condition.n), 0)


def lane_of(x: Lanes, lane: Any) -> Lanes:
    """Return one lane as an ordinary number."""
    return Lanes(CURRENT.machine.pick(x.x, word(lane), x.n), 0)


def lane_sum(start: Any, x: Any) -> Any:
    """Return start + x_0 + x_1 + ..., added in this order, in every lane."""
    if isinstance(x, Plane):
        return Plane(lane_sum(start.a, x.a), lane_sum(start.b, x.b))
    total = lane_of(start, 0)
    for lane in range(max(x.n, 1)):
        total = total + lane_of(x, lane)
    return full(total, x.n)


def steady(x: Any) -> Any:
    """Return x, which does not change for small changes of what it was computed from: a rounded number."""
    stop = getattr(CURRENT.machine, "steady", None)
    return Lanes(stop(x.x), x.n, x.factors) if stop and isinstance(x, Lanes) else x


def whole(x: Lanes) -> Any:
    """Return an ordinary number that is whole as a whole number."""
    return Index(CURRENT.machine.new(f"fptosi double {x.x} to i64")) if isinstance(x, Lanes) else int(x)


def quarter_turns(cosine: Lanes, sine: Lanes, shifted: Lanes) -> tuple[Lanes, Lanes]:
    """Return (cosine, sine) of an angle plus some quarter turns: as many as the last two bits of `shifted`
    say. Bits are moved, nothing is rounded or compared."""
    machine = CURRENT.machine
    n = shifted.n
    if machine.runs_now:
        x, y = machine.quarter_turns(cosine.x, sine.x, shifted.x, n)
        return Lanes(x, n), Lanes(y, n)
    c, s, quarters = (machine.bits(value.x, n) for value in (cosine, sine, shifted))
    odd = machine.whole("sub", 0, machine.whole("and", quarters, 1, n), n)
    swap = machine.whole("and", machine.whole("xor", c, s, n), odd, n)
    top = -(2**63)
    sine_sign = machine.whole("and", machine.whole("shl", quarters, 62, n), top, n)
    next_quarter = machine.whole("add", quarters, 1, n)
    cosine_sign = machine.whole("and", machine.whole("shl", next_quarter, 62, n), top, n)
    x = machine.whole("xor", machine.whole("xor", c, swap, n), cosine_sign, n)
    y = machine.whole("xor", machine.whole("xor", s, swap, n), sine_sign, n)
    return Lanes(machine.of_bits(x, n), n), Lanes(machine.of_bits(y, n), n)


def transposed(rows: list[Lanes]) -> list[Lanes]:
    """Return the columns of vectors, one a lane, of equal length; both counts are powers of two."""
    machine = CURRENT.machine
    n, width = len(rows), rows[0].n
    if n == 1:
        return [Lanes(machine.pick(rows[0].x, k, width), 1) for k in range(width)]
    side = min(n, width)
    columns = []
    for begin in range(0, width, side):
        square = [machine.shuffle(row.x, row.x, list(range(begin, begin + side)), width) for row in rows]
        size = side
        while size < n:  # rows i, i + side, i + 2 side, ... become one vector
            firsts = [k for k in range(len(square)) if not k & side]
            square = [
                machine.shuffle(square[k], square[k + side], list(range(2 * size)), size) for k in firsts
            ]
            size *= 2
        block = 1
        while block < side:
            swapped = list(square)
            low = [i + (n - block if i & block else 0) for i in range(n)]
            high = [i + block if not i & block else n + i for i in range(n)]
            for i in range(side):
                if not i & block:
                    upper, lower = square[i], square[i + block]
                    swapped[i] = machine.shuffle(upper, lower, low, n)
                    swapped[i + block] = machine.shuffle(upper, lower, high, n)
            square = swapped
            block = 2 * block
        columns += [Lanes(x, n) for x in square]
    return columns
