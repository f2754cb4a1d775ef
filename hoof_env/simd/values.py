"""Values of kernels: lanes, planar vectors, booleans, whole numbers; the operators and functions on them.

The machine that runs (`machines.CURRENT`) carries the operations out: a `Writer` writes instructions while a
kernel is traced, `Eager` computes with NumPy at once. Ordinary numbers are computed at once on either.

A product that enters a sum is not rounded: `a * b + c` on lanes is one fused operation. The expression
decides this: a value remembers the factors of which it is the product, and `rounded` makes it forget them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NoReturn, Protocol, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from hoof_env.simd.machines import CURRENT

V = TypeVar("V")


class TraceError(TypeError):
    """Use of a value that a kernel cannot make."""


class Value:
    """Base of all values."""

    __slots__ = ()
    kind = "a value"
    fields: tuple[str, ...] = ()  # that users' functions may know
    __hash__ = None  # type: ignore[assignment]

    def __getattr__(self, name: str) -> Any:
        has = f"it has {', '.join(self.fields)}" if self.fields else "it has none"
        raise AttributeError(f"{self.kind} has no field {name!r}; {has}")

    def __repr__(self) -> str:
        return f"<{self.kind} that is known when the kernel runs>"

    def __bool__(self) -> bool:
        raise TraceError(
            f"`if`, `while`, `and`, `or`, `not`, min() or max() of {self.kind}, which is known only when"
            " the kernel runs: write np.where(condition, yes, no), `&`, `|` and `~` of comparisons in"
            " parentheses, np.minimum and np.maximum"
        )

    def __iter__(self) -> Iterator[Any]:
        raise TraceError(
            f"a loop over {self.kind}: a value of a kernel has no elements that Python could access"
        )

    def __len__(self) -> int:
        raise TraceError(
            f"len() of {self.kind}: a value of a kernel has no elements that Python could access"
        )

    def _no_number(self) -> NoReturn:
        raise TraceError(
            f"float(), int(), range(), an index or a function of `math` of {self.kind}, which is known only"
            " when the kernel runs: write NumPy's function, such as np.exp or np.sqrt, and np.where for a"
            " choice"
        )

    def __float__(self) -> float:
        self._no_number()

    def __int__(self) -> int:
        self._no_number()

    def __index__(self) -> int:
        self._no_number()

    def __round__(self, digits: Any = None) -> Any:
        raise TraceError(f"round() of {self.kind}: write np.floor(x + 0.5)")

    def __array__(self, *arguments: Any, **named: Any) -> Any:
        raise TraceError(
            f"a NumPy array with {self.kind}: a kernel works on single"
            " numbers, so write out the operation on each"
        )

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **named: Any) -> Any:
        function = UFUNCS.get(ufunc)
        if method != "__call__" or named or function is None:
            given = f"np.{ufunc.__name__}" + ("" if method == "__call__" else f".{method}")
            extra = f" with {', '.join(named)}" if named else ""
            raise TraceError(f"{given}{extra} of {self.kind}: kernels have {known_functions()}")
        return function(*map(_single, inputs))

    def __array_function__(self, function: Any, types: Any, inputs: Any, named: Any) -> Any:
        made = FUNCTIONS.get(function)
        if made is None:
            raise TraceError(f"np.{function.__name__} of {self.kind}: kernels have {known_functions()}")
        try:
            return made(*map(_single, inputs), **named)
        except TraceError:
            raise
        except TypeError as error:  # an argument that NumPy's function has, and this has not
            raise TraceError(f"np.{function.__name__}: {error}") from None


UFUNCS: dict[Any, Callable[..., Any]] = {}
FUNCTIONS: dict[Any, Callable[..., Any]] = {}
"""NumPy's universal functions that work on values, and NumPy's further functions that do:
`numpy_functions`."""


def known_functions() -> str:
    """Return the names of NumPy's functions that work on values."""
    return ", ".join(sorted({f"np.{function.__name__}" for function in (*UFUNCS, *FUNCTIONS)}))


def _single(x: Any) -> Any:
    """Return an array of no axes, such as np.where makes of two numbers, as a number; refuse any other
    array."""
    if isinstance(x, np.ndarray):
        if x.ndim:
            raise TraceError(
                f"a NumPy array, of shape {x.shape}, in an operation with a value of a kernel, which is"
                " one number: take its elements"
            )
        return x.item()
    return x


def kind_of(x: Any) -> str:
    """Return the kind of an object, for messages."""
    if isinstance(x, np.ndarray):
        return f"a NumPy array, of shape {x.shape}"
    kind = getattr(type(x), "kind", None)
    if isinstance(kind, str):
        return kind
    return "nothing" if x is None else f"{type(x).__name__} {x!r}"


class Lanes(Value):
    """n doubles, one for each lane; an ordinary number that is known only when the kernel runs if n is 0."""

    __slots__ = ("factors", "n", "x")
    kind = "a number"

    def __init__(self, x: Any, n: int, factors: Any = None) -> None:
        self.x = x
        self.n = n
        self.factors = factors

    def __repr__(self) -> str:
        return f"Lanes({self.x})"

    @overload
    def __add__(self, other: Number) -> Lanes: ...
    @overload
    def __add__(self, other: Any) -> Any: ...
    def __add__(self, other: Any) -> Any:
        return _sum("+", self, other)

    def __radd__(self, other: Number) -> Lanes:
        return _sum("+", other, self)

    def __sub__(self, other: Number) -> Lanes:
        return _sum("-", self, other)

    def __rsub__(self, other: Number) -> Lanes:
        return _sum("-", other, self)

    @overload
    def __mul__(self, other: Number) -> Lanes: ...
    @overload
    def __mul__(self, other: Plane) -> Plane: ...
    def __mul__(self, other: Any) -> Any:
        return product(self, other)

    def __rmul__(self, other: Number) -> Lanes:
        return product(other, self)

    def __truediv__(self, other: Number) -> Lanes:
        return _binary("fdiv", self, other) if is_real(other) else NotImplemented

    def __rtruediv__(self, other: Number) -> Lanes:
        return _binary("fdiv", other, self) if is_real(other) else NotImplemented

    def __neg__(self) -> Lanes:
        return Lanes(CURRENT.machine.negative(self.x, self.n), self.n)

    def __pos__(self) -> Lanes:
        return self

    def __pow__(self, exponent: Number) -> Lanes:
        return power(self, exponent)

    def __rpow__(self, base: Number) -> Lanes:
        return power(base, self)

    def __abs__(self) -> Lanes:
        return absolute(self)

    def __mod__(self, other: Number) -> Lanes:
        return UFUNCS[np.remainder](self, other) if is_real(other) else NotImplemented

    def __rmod__(self, other: Number) -> Lanes:
        return UFUNCS[np.remainder](other, self) if is_real(other) else NotImplemented

    def __floordiv__(self, other: Number) -> Lanes:
        return UFUNCS[np.floor_divide](self, other) if is_real(other) else NotImplemented

    def __rfloordiv__(self, other: Number) -> Lanes:
        return UFUNCS[np.floor_divide](other, self) if is_real(other) else NotImplemented

    def __lt__(self, other: Number) -> Mask:
        return compare("<", self, other)

    def __le__(self, other: Number) -> Mask:
        return compare("<=", self, other)

    def __gt__(self, other: Number) -> Mask:
        return compare(">", self, other)

    def __ge__(self, other: Number) -> Mask:
        return compare(">=", self, other)

    def __eq__(self, other: Number) -> Mask:  # type: ignore[override]
        return compare("==", self, other)

    def __ne__(self, other: Number) -> Mask:  # type: ignore[override]
        return compare("!=", self, other)


class Mask(Value):
    """n booleans; one that all lanes share if n is 0."""

    __slots__ = ("n", "x")
    kind = "a boolean"

    def __init__(self, x: Any, n: int) -> None:
        self.x = x
        self.n = n

    def __repr__(self) -> str:
        return f"Mask({self.x})"

    def __and__(self, other: Truth) -> Mask:
        return self._with("and", other)

    def __or__(self, other: Truth) -> Mask:
        return self._with("or", other)

    __rand__, __ror__ = __and__, __or__

    def _with(self, name: str, other: Any) -> Any:
        if isinstance(other, (bool, np.bool_)):  # known when the kernel is traced
            return (self if other else False) if name == "and" else (True if other else self)
        if not isinstance(other, Mask):
            return NotImplemented
        n = max(self.n, other.n)
        x, y = (CURRENT.machine.spread_truth(part.x, part.n, n) for part in (self, other))
        return Mask(CURRENT.machine.logic(name, x, y, n), n)

    def __invert__(self) -> Mask:
        return Mask(CURRENT.machine.invert(self.x, self.n), self.n)

    def __xor__(self, other: Any) -> Any:
        if isinstance(other, (bool, np.bool_)):
            return ~self if other else self
        return (self | other) & ~(self & other) if isinstance(other, Mask) else NotImplemented

    __rxor__ = __xor__

    def __eq__(self, other: Any) -> Any:
        return ~(self ^ other) if isinstance(other, (bool, np.bool_, Mask)) else self.to_real() == other

    def __ne__(self, other: Any) -> Any:
        return self ^ other if isinstance(other, (bool, np.bool_, Mask)) else self.to_real() != other

    def to_real(self) -> Lanes:
        """Return 1.0 where it holds, else 0.0, like NumPy's arithmetic with booleans."""
        return where(self, 1.0, 0.0)

    def _sum(self, sign: str, one: Any, other: Any) -> Any:
        if not all(is_real(part) or isinstance(part, Mask) for part in (one, other)):
            return NotImplemented
        if all(isinstance(part, (Mask, bool, np.bool_)) for part in (one, other)):  # as NumPy has it
            return (one if isinstance(one, Mask) else other) | (other if isinstance(one, Mask) else one)
        one, other = (part.to_real() if isinstance(part, Mask) else part for part in (one, other))
        return _sum(sign, one, other)

    def __add__(self, other: Any) -> Any:
        return self._sum("+", self, other)

    def __radd__(self, other: Any) -> Any:
        return self._sum("+", other, self)

    def __sub__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, Mask) else self._sum("-", self, other)

    def __rsub__(self, other: Any) -> Any:
        return self._sum("-", other, self)

    def __mul__(self, other: Any) -> Any:
        return self & other if isinstance(other, (bool, Mask)) else product(self.to_real(), other)

    __rmul__ = __mul__

    def __truediv__(self, other: Number) -> Lanes:
        return self.to_real() / other

    def __rtruediv__(self, other: Number) -> Lanes:
        return other / self.to_real()

    def __bool__(self) -> bool:
        if CURRENT.machine.runs_now and not self.n:
            return CURRENT.machine.truth(self.x)
        return super().__bool__()

    def to_whole(self) -> Index:
        """Return 1 if it holds, else 0."""
        return index(CURRENT.machine.truth_to_index(self.x))


class Plane(Value):
    """n planar vectors, x and y, that multiply like complex numbers."""

    __slots__ = ("a", "b")
    kind = "a planar vector"
    fields = ("real", "imag")

    def __init__(self, a: Lanes, b: Lanes) -> None:
        self.a = a
        self.b = b

    def __repr__(self) -> str:
        return f"Plane({self.a.x}, {self.b.x})"

    @property
    def n(self) -> int:
        """Number of lanes."""
        return self.a.n

    @property
    def real(self) -> Lanes:
        """The x component, rounded."""
        return Lanes(self.a.x, self.a.n)

    @property
    def imag(self) -> Lanes:
        """The y component, rounded."""
        return Lanes(self.b.x, self.b.n)

    def __add__(self, other: Plane) -> Plane:
        return self._sum("+", other)

    def __sub__(self, other: Plane) -> Plane:
        return self._sum("-", other)

    def _sum(self, sign: str, other: Any) -> Any:
        if not isinstance(other, Plane):
            return NotImplemented
        return Plane(_sum(sign, self.a, other.a), _sum(sign, self.b, other.b))

    def __mul__(self, other: Plane | Number) -> Plane:
        return product(self, other)

    def __rmul__(self, other: Number) -> Plane:
        return product(self, other)

    def __truediv__(self, other: Number) -> Plane:
        if not is_real(other):
            return NotImplemented
        if not self.n:
            return Plane(self.a / other, self.b / other)
        # one reciprocal, since a division takes as long as several products
        per = _binary("fdiv", full(1.0, self.n), other)
        return Plane(product(self.a, per), product(self.b, per))

    def __neg__(self) -> Plane:
        return Plane(-self.a, -self.b)

    def __pos__(self) -> Plane:
        return self

    def __abs__(self) -> Lanes:
        return absolute(self)  # type: ignore[call-overload]

    def conjugate(self) -> Plane:
        """Return the mirror image at the x axis."""
        return Plane(self.a, -self.b)

    def __eq__(self, other: Any) -> Any:
        return (
            (self.a == other.a) & (self.b == other.b) if isinstance(other, Plane) else _no_match(self, other)
        )

    def __ne__(self, other: Any) -> Any:
        return ~(self == other)


class Index(Value):
    """Whole number that all lanes share and that is known only when the kernel runs."""

    __slots__ = ("x",)
    kind = "a whole number"

    def __init__(self, x: Any) -> None:
        self.x = x

    def _with(self, name: str, one: Any, other: Any) -> Any:
        if isinstance(other, (float, Lanes)) or isinstance(one, (float, Lanes)):
            one, other = (part.to_real() if isinstance(part, Index) else part for part in (one, other))
            return {"add": add, "sub": subtract, "mul": product}[name](one, other)
        if not all(isinstance(value, (int, Index)) for value in (one, other)):
            return NotImplemented
        return Index(CURRENT.machine.index_binary(name, word(one), word(other)))

    def __add__(self, other: Any) -> Any:
        return self if isinstance(other, int) and other == 0 else self._with("add", self, other)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self._with("sub", self, other)

    def __rsub__(self, other: Any) -> Any:
        return self._with("sub", other, self)

    def __mul__(self, other: Any) -> Any:
        return self if isinstance(other, int) and other == 1 else self._with("mul", self, other)

    __rmul__ = __mul__

    def __neg__(self) -> Any:
        return self._with("sub", 0, self)

    def __truediv__(self, other: Number) -> Lanes:
        return self.to_real() / other

    def __rtruediv__(self, other: Number) -> Lanes:
        return other / self.to_real()

    def __pow__(self, exponent: Number) -> Lanes:
        return power(self.to_real(), exponent)

    def __rpow__(self, base: Number) -> Lanes:
        return power(base, self.to_real())

    def __mod__(self, other: int) -> Any:
        """Return the rest of a number that is not negative."""
        return self._with("srem", self, other)

    def __or__(self, other: Any) -> Any:
        return self._with("or", self, other)

    __ror__ = __or__

    def _compared(self, name: str, other: Any) -> Any:
        if not isinstance(other, (int, Index)):
            return NotImplemented
        return Mask(CURRENT.machine.index_compare(name, self.x, word(other)), 0)

    def __lt__(self, other: Any) -> Any:
        return self._compared("<", other)

    def __le__(self, other: Any) -> Any:
        return self._compared("<=", other)

    def __gt__(self, other: Any) -> Any:
        return self._compared(">", other)

    def __ge__(self, other: Any) -> Any:
        return self._compared(">=", other)

    def __eq__(self, other: Any) -> Any:
        return self._compared("==", other)

    def __ne__(self, other: Any) -> Any:
        return self._compared("!=", other)

    def to_real(self) -> Lanes:
        """Return it as a number."""
        return Lanes(CURRENT.machine.index_to_real(self.x), 0)


Number = Lanes | Index | float
"""Real number: lanes, or one that all lanes share."""

Truth = Mask | bool
"""Truth of each lane, or one that all lanes share."""

Whole = Index | int
"""Whole number that all lanes share."""

_REAL = (Lanes, Index, int, float, np.floating, np.integer)


def index(x: Any) -> Any:
    """Return the payload of a whole number as a value: a Python int on a machine that computes at once."""
    return int(x) if CURRENT.machine.runs_now else Index(x)


def word(value: Any) -> Any:
    """Return the payload of a whole number."""
    return value.x if isinstance(value, Index) else int(value)


def is_real(value: Any) -> bool:
    """Return True for lanes and ordinary numbers."""
    return isinstance(value, _REAL)


def payload(value: Any, n: int) -> Any:
    """Return a number as payload of n lanes."""
    if isinstance(value, Lanes):
        if value.n == n:
            return value.x
        if value.n > 1 or (value.n and n > 1):
            raise TraceError(f"{value.n} lanes with {n}")
        return CURRENT.machine.single(value.x) if value.n else CURRENT.machine.spread(value.x, n)
    if isinstance(value, Index):
        return CURRENT.machine.spread(value.to_real().x, n)
    value = _single(value)
    if not is_real(value):
        hint = ": write np.where(condition, 1.0, 0.0)" if isinstance(value, Mask) else ""
        raise TraceError(f"{kind_of(value)} where a number is expected{hint}")
    return CURRENT.machine.number(float(value), n)


def full(value: Any, n: int) -> Lanes:
    """Return a number in each of n lanes."""
    return Lanes(payload(value, n), n)


def lanes_of(*values: Any) -> int:
    return max((value.n for value in values if isinstance(value, (Lanes, Plane))), default=0)


def _binary(name: str, one: Any, other: Any) -> Any:
    n = lanes_of(one, other)
    return Lanes(CURRENT.machine.binary(name, payload(one, n), payload(other, n), n), n)


def _sum(sign: str, one: Any, other: Any) -> Any:
    if not (is_real(one) and is_real(other)):
        return NotImplemented
    machine = CURRENT.machine
    n = lanes_of(one, other)
    if isinstance(other, Lanes) and other.factors and other.n == n:
        a, b = other.factors
        return Lanes(machine.fma(machine.negative(a, n) if sign == "-" else a, b, payload(one, n), n), n)
    if isinstance(one, Lanes) and one.factors and one.n == n:
        c = payload(other, n)
        return Lanes(machine.fma(*one.factors, machine.negative(c, n) if sign == "-" else c, n), n)
    return Lanes(machine.binary("fadd" if sign == "+" else "fsub", payload(one, n), payload(other, n), n), n)


def add(one: Any, other: Any) -> Any:
    return one + other


def subtract(one: Any, other: Any) -> Any:
    return one - other


def product(one: Any, other: Any) -> Any:
    """Return the product of numbers or planar vectors; it is rounded unless it enters a sum next."""
    if isinstance(one, Plane) and isinstance(other, Plane):
        x = _sum("-", product(one.a, other.a), product(one.b, other.b))
        return Plane(x, _sum("+", product(one.a, other.b), product(one.b, other.a)))
    if isinstance(one, Plane):
        one, other = other, one
    if isinstance(other, Plane):
        return Plane(product(one, other.a), product(one, other.b)) if is_real(one) else NotImplemented
    if not (is_real(one) and is_real(other)):
        return NotImplemented
    n = lanes_of(one, other)
    factors = payload(one, n), payload(other, n)
    return Lanes(CURRENT.machine.binary("fmul", *factors, n), n, factors if n else None)


def _no_match(one: Any, other: Any) -> Any:
    """Refuse `==` and `!=` of two kinds that are never equal: Python would answer False and True."""
    raise TraceError(f"a comparison of {kind_of(one)} with {kind_of(other)}")


def compare(symbol: str, one: Any, other: Any) -> Any:
    other, one = _single(other), _single(one)
    if isinstance(other, Mask):
        other = other.to_real()
    if not is_real(other) or not is_real(one):
        return _no_match(one, other) if symbol in ("==", "!=") else NotImplemented
    n = lanes_of(one, other)
    return Mask(CURRENT.machine.compare(symbol, payload(one, n), payload(other, n), n), n)


MAX_PRODUCTS = 16
"""Largest whole power that is computed by products."""


def power(base: Any, exponent: Any) -> Any:
    """Return a power: a small whole exponent by products, one half by a root, any other exponent by the C
    library."""
    if isinstance(exponent, (int, float, np.integer, np.floating)):
        exponent = float(exponent)
        if exponent == 2.0:
            return base * base
        if exponent == 0.5:
            return sqrt(base)
        if exponent.is_integer() and 0 < exponent <= MAX_PRODUCTS:
            half = rounded(power(base, exponent // 2)) if exponent > 1 else None
            if half is None:
                return base
            square = rounded(half * half)
            return square * base if exponent % 2 else square
    return library("pow")(base, exponent)


def rounded(value: V) -> V:
    """Return a value, or a tuple of values, that enters sums rounded."""
    made: Any = value
    if isinstance(made, Lanes):
        made = Lanes(made.x, made.n) if made.factors else made
    elif isinstance(made, Plane):
        made = Plane(rounded(made.a), rounded(made.b))
    elif type(made) is tuple:
        made = tuple(map(rounded, made))
    elif isinstance(made, tuple) and any(isinstance(part, (Lanes, Plane)) for part in made):
        made = type(made)(*map(rounded, made))
    return made


# Functions. Ordinary numbers, and NumPy arrays, are computed at once, whatever the machine.


class RealFunction(Protocol):
    """Function of a number, of lanes, or of an array."""

    @overload
    def __call__(self, x: float) -> float: ...
    @overload
    def __call__(self, x: Lanes | Index) -> Lanes: ...
    @overload
    def __call__(self, x: NDArray[Any]) -> NDArray[Any]: ...


def _real_function(name: str, at_once: Any) -> RealFunction:
    def function(x: Any) -> Any:
        if isinstance(x, Index):
            x = x.to_real()
        if not isinstance(x, Lanes):
            if isinstance(x, Value):
                return _other_kind(at_once, x)
            return at_once(x)
        return Lanes(CURRENT.machine.unary(name, x.x, x.n), x.n)

    function.__name__ = at_once.__name__
    function.__doc__ = f"Return NumPy's {at_once.__name__} of a number."
    return function


def _other_kind(at_once: Any, x: Value) -> Any:
    """Return NumPy's function of a boolean, or the length of a planar vector; refuse the rest."""
    if isinstance(x, Plane) and at_once is np.abs:
        return library("hypot")(x.a, x.b)
    if isinstance(x, Mask):
        return UFUNCS[at_once](x.to_real())
    raise TraceError(f"np.{at_once.__name__} of {x.kind}: expected a number")


sqrt = _real_function("sqrt", np.sqrt)
absolute = _real_function("fabs", np.abs)
floor = _real_function("floor", np.floor)
ceil = _real_function("ceil", np.ceil)


def library(name: str) -> Callable[..., Any]:
    """Return a function of the C library, which is called lane by lane."""

    def function(*inputs: Any) -> Any:
        inputs = tuple(x.to_real() if isinstance(x, Mask) else x for x in inputs)
        n = lanes_of(*inputs)
        return Lanes(CURRENT.machine.library(name, [payload(x, n) for x in inputs], n), n)

    return function


def vector(x: Number, y: Number) -> Plane:
    """Return the planar vector (x, y)."""
    n = lanes_of(x, y)
    a, b = (part if isinstance(part, Lanes) and part.n == n else full(part, n) for part in (x, y))
    return Plane(a, b)


def perpendicular(z: Plane) -> Plane:
    """Return a planar vector turned left by a right angle."""
    return Plane(-z.b, Lanes(z.a.x, z.a.n, z.a.factors))


def dot(z: Plane, w: Plane) -> Lanes:
    """Return the scalar product of planar vectors."""
    found: Lanes = _sum("+", product(z.a, w.a), product(z.b, w.b))
    return found


def cross(z: Plane, w: Plane) -> Lanes:
    """Return z x w, positive if w is to the left of z."""
    found: Lanes = _sum("-", product(z.a, w.b), product(z.b, w.a))
    return found


@overload
def where(condition: Truth, yes: Plane, no: Plane) -> Plane: ...
@overload
def where(condition: Truth, yes: Number, no: Number) -> Lanes: ...
@overload
def where(condition: NDArray[Any], yes: Any, no: Any) -> Any: ...
def where(condition: Any, yes: Any, no: Any) -> Any:
    """Return `yes` where the condition holds, else `no`, lane by lane."""
    if isinstance(condition, (bool, np.bool_)):
        return yes if condition else no
    if not isinstance(condition, Mask):
        if isinstance(condition, Value):
            raise TraceError(f"where() of {condition.kind}: expected a condition, such as x > 0.0")
        if isinstance(yes, Value) or isinstance(no, Value):  # NumPy would call these again
            return yes if _single(condition) else no
        return np.where(condition, yes, no)
    if isinstance(yes, Plane) or isinstance(no, Plane):
        yes, no = (vector(part, 0.0) if is_real(part) else part for part in (yes, no))
        if isinstance(yes, Plane) and isinstance(no, Plane):
            return Plane(where(condition, yes.a, no.a), where(condition, yes.b, no.b))
    if isinstance(yes, (Mask, bool, np.bool_)) and isinstance(no, (Mask, bool, np.bool_)):
        return (condition._with("and", yes)) | ((~condition)._with("and", no))
    yes, no = (part.to_real() if isinstance(part, Mask) else _single(part) for part in (yes, no))
    if not (is_real(yes) and is_real(no)):
        raise TraceError(f"where() of {kind_of(no if is_real(yes) else yes)}: expected two numbers")
    n = max(condition.n, lanes_of(yes, no))
    chosen = CURRENT.machine.select(condition.x, payload(yes, n), payload(no, n), n, condition.n)
    return Lanes(chosen, n)


@overload
def maximum(x: float, y: float) -> float: ...  # type: ignore[overload-overlap]
@overload
def maximum(x: Number, y: Number) -> Lanes: ...
@overload
def maximum(x: NDArray[Any], y: Any) -> NDArray[Any]: ...
@overload
def maximum(x: Any, y: NDArray[Any]) -> NDArray[Any]: ...
def maximum(x: Any, y: Any) -> Any:
    """Return the larger number of two; NaN if either is, as NumPy does."""
    return _chosen(">", x, y)


@overload
def minimum(x: float, y: float) -> float: ...  # type: ignore[overload-overlap]
@overload
def minimum(x: Number, y: Number) -> Lanes: ...
@overload
def minimum(x: NDArray[Any], y: Any) -> NDArray[Any]: ...
@overload
def minimum(x: Any, y: NDArray[Any]) -> NDArray[Any]: ...
def minimum(x: Any, y: Any) -> Any:
    """Return the smaller number of two; NaN if either is, as NumPy does."""
    return _chosen("<", x, y)


def _chosen(symbol: str, x: Any, y: Any) -> Any:
    x, y = (part.to_real() if isinstance(part, (Index, Mask)) else part for part in (x, y))
    for part in (x, y):
        if isinstance(part, Value) and not isinstance(part, Lanes):
            raise TraceError(f"the larger or smaller of {part.kind}: expected two numbers")
    if not (isinstance(x, Lanes) or isinstance(y, Lanes)):
        if isinstance(x, np.ndarray) or isinstance(y, np.ndarray) or x != x or y != y:
            return (np.maximum if symbol == ">" else np.minimum)(x, y)
        return y if (y > x if symbol == ">" else y < x) else x
    n = lanes_of(x, y)
    are_known = [not isinstance(part, Lanes) for part in (x, y)]
    x, y = full(x, n), full(y, n)
    if are_known[0]:  # x is chosen by a comparison that NaN fails, so y is NaN where it is NaN
        return where(compare(f"{symbol}=", x, y), x, y)
    takes = compare(symbol, y, x)
    if not are_known[1]:
        takes = takes | (y != y)
    return where(takes, y, x)


def clip(x: Any, a_min: Any = None, a_max: Any = None, *, min: Any = None, max: Any = None) -> Any:
    """Return a number limited to [a_min, a_max], where None is no limit; arguments like NumPy's."""
    low, high = (a_min if min is None else min), (a_max if max is None else max)
    x = x if low is None else maximum(x, low)
    return x if high is None else minimum(x, high)


def any_lane(condition: Truth) -> Any:
    """Return whether a condition holds in any lane."""
    if isinstance(condition, bool):
        return condition
    return Mask(CURRENT.machine.any_lane(condition.x, condition.n), 0)


def lane_of(x: Lanes, lane: Whole) -> Lanes:
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


def steady(x: V) -> V:
    """Return x, a number that is constant under small changes of its inputs because it was rounded by adding
    a large constant. A machine that rearranges or differentiates must leave it alone."""
    if isinstance(x, Lanes):
        return Lanes(CURRENT.machine.steady(x.x), x.n, x.factors)  # type: ignore[return-value]
    return x


def whole(x: Any) -> Any:
    """Return an ordinary number that is whole as a whole number."""
    return index(CURRENT.machine.real_to_index(x.x)) if isinstance(x, Lanes) else int(x)


def quarter_turns(cosine: Lanes, sine: Lanes, shifted: Lanes) -> tuple[Lanes, Lanes]:
    """Return (cosine, sine) of an angle plus quarter turns, whose number is the last two bits of
    `shifted`. Bits are moved, without rounding or comparison."""
    machine = CURRENT.machine
    n = shifted.n
    c, s, quarters = (machine.bits(value.x, n) for value in (cosine, sine, shifted))
    odd = machine.whole("sub", 0, machine.whole("and", quarters, 1, n), n)
    swap = machine.whole("and", machine.whole("xor", c, s, n), odd, n)
    top = 1 << 63
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
