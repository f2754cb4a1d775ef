"""Machine that hands the operations of kernels to JAX: the source that is compiled for a step becomes a
function of JAX's, which has derivatives.

Payloads are JAX's numbers, of shape (lanes,), or () in a single lane; what is known stays an ordinary number,
so that settings are constants. The caller's arrays that change are `Cells`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from hoof_env.errors import ParameterError
from hoof_env.simd.machines import COMPARISONS, Eager, Place
from hoof_env.simd.math import ROUNDER

WHOLE = 2.0**52
"""Constant that tables add to a whole number, `leg.profile.WHOLE`."""

ROUNDERS = (ROUNDER, WHOLE)
"""Constants whose addition rounds a double to a whole number, which their subtraction gives back. Here the
sum is the whole number itself, in single precision, too."""

NAMES = {
    "asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2", "pow": "power",
}  # fmt: skip
"""JAX's names of functions of the C library, where they differ."""


class Cells(list[Any]):
    """Array of the caller, of one column, whose elements are JAX's numbers."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of its axes."""
        return len(self), 1

    def reshape(self, size: int) -> Cells:
        """Return the array itself, which is flat."""
        return self


class Singles(Cells):
    """Array of the caller whose elements the kernels keep in single precision: what is stored is rounded."""

    def __setitem__(self, k: Any, x: Any) -> None:
        super().__setitem__(k, single_precision(x))


class Held:
    """Arrays of a call, as `memory.Given` takes them; see `memory.Arrays`.

    Attributes:
        arrays: arrays by name, NumPy's where they are constant.
        columns: columns of the call.
    """

    def __init__(self, arrays: dict[str, Any]) -> None:
        self.arrays = arrays
        self.columns = range(1)


def is_known(*values: Any) -> bool:
    """Return True if all are known while JAX traces."""
    return not any(isinstance(value, jax.Array) for value in values)


def single_precision(x: Any) -> Any:
    """Return the nearest number of single precision, of the type of x, with a slope of 1."""
    if is_known(x):
        return float(np.float32(x))
    return x + jax.lax.stop_gradient(jax.lax.reduce_precision(x, 8, 23) - x)


def plain(value: Any) -> Any:
    """Return one of NumPy's numbers as Python's, which does not decide a precision."""
    return value.item() if isinstance(value, (np.generic, np.ndarray)) else value


class Jax(Eager):
    """Machine of JAX.

    Args:
        kind: type of numbers, float64 or float32.

    Attributes:
        huge: quotient by 0, without a slope; far beyond what is physical, and products with it are finite.
    """

    has_angles = True

    def __init__(self, kind: Any) -> None:
        super().__init__(exact=False)
        self.kind = np.dtype(kind)
        self.huge = float(np.sqrt(np.finfo(self.kind).max))
        self.whole_kind = np.int64 if self.kind == np.float64 else np.int32

    # numbers

    def number(self, value: float, n: int) -> Any:
        return value

    spread = number

    def single(self, x: Any) -> Any:
        return x

    def spread_truth(self, x: Any, n: int, to: int) -> Any:
        return x

    def pick(self, x: Any, lane: int, n: int, kind: str = "double") -> Any:
        return x[lane] if np.ndim(x) else x

    def gathered(self, scalars: Sequence[Any], kind: str = "double") -> Any:
        if len(scalars) == 1:
            return scalars[0]
        return jnp.stack([jnp.asarray(x, self.kind) for x in scalars])

    def binary(self, name: str, x: Any, y: Any, n: int) -> Any:
        if is_known(x, y):
            with np.errstate(all="ignore"):
                return plain(self._binaries[name](x, np.float64(y)))
        if name == "fadd":
            return rounded(x) if is_rounder(y) else rounded(y) if is_rounder(x) else x + y
        if name == "fsub":
            return x if is_rounder(y) else x - y
        if name == "fmul":
            return x * y
        if is_known(y):
            return x / y
        # infinity as a factor in a branch that is not chosen would make slopes of 0 NaN on their way back
        endless = jnp.sign(jax.lax.stop_gradient(x)) * self.huge
        return jnp.where(y == 0.0, endless, x / jnp.where(y == 0.0, 1.0, y))

    def negative(self, x: Any, n: int) -> Any:
        return -x

    def fma(self, a: Any, b: Any, c: Any, n: int) -> Any:
        return rounded(a * b) if is_rounder(c) else a * b + c

    def unary(self, name: str, x: Any, n: int) -> Any:
        if is_known(x):
            return plain(self._unaries[name](x))
        if name == "sqrt":  # no slope at 0 and below, which would be NaN even where it is not chosen
            return jnp.where(
                x > 0.0, jnp.sqrt(jnp.where(x > 0.0, x, 1.0)), jax.lax.stop_gradient(jnp.sqrt(x))
            )
        functions: dict[str, Callable[..., Any]] = {"fabs": jnp.abs, "floor": jnp.floor, "ceil": jnp.ceil}
        return functions[name](x)

    def library(self, name: str, inputs: Sequence[Any], n: int) -> Any:
        return getattr(jnp, NAMES.get(name, name))(*inputs)

    def cos_sin(self, angle: Any) -> tuple[Any, Any]:
        """Return the cosine and sine of an angle [rad]."""
        return jnp.cos(angle), jnp.sin(angle)

    def steady(self, x: Any) -> Any:
        return x if is_known(x) else jax.lax.stop_gradient(x)

    # truths

    def compare(self, symbol: str, x: Any, y: Any, n: int) -> Any:
        if is_known(x, y):
            return bool(COMPARISONS[symbol](x, y))
        return COMPARED[symbol](x, y)

    def logic(self, name: str, x: Any, y: Any, n: int) -> Any:
        for known, other in ((x, y), (y, x)):
            if is_known(known):
                return other if bool(known) == (name == "and") else known
        return x & y if name == "and" else x | y

    def invert(self, x: Any, n: int) -> Any:
        return not x if is_known(x) else ~x

    def select(self, condition: Any, x: Any, y: Any, n: int, truths: int) -> Any:
        if x is None or y is None:  # a row that was never written, which nobody chooses
            return y if x is None else x
        if is_known(condition):
            return x if condition else y
        return jnp.where(condition, x, y)

    def any_lane(self, x: Any, n: int) -> Any:
        return x if is_known(x) else jnp.any(x)

    def truth(self, x: Any) -> bool:
        return bool(x) if is_known(x) else True

    def truth_to_index(self, x: Any) -> int:
        return int(x) if is_known(x) else 0  # codes of a step, which nobody reads here

    def real_to_index(self, x: Any) -> int:
        if is_known(x):
            return int(x)
        raise ParameterError(
            "a delay that each episode draws: expected one number of control steps, because hoof_env.jax has"
            " no arrays of rows that are found while it runs"
        )

    # bits

    def bits(self, x: Any, n: int) -> Any:
        if self.kind != np.float64:
            raise ParameterError("noise, bias and np.copysign take the bits of doubles: expected float64")
        return jax.lax.bitcast_convert_type(jax.lax.stop_gradient(jnp.asarray(x, self.kind)), jnp.uint64)

    def of_bits(self, x: Any, n: int) -> Any:
        return jax.lax.bitcast_convert_type(x, jnp.float64)

    def whole(self, name: str, x: Any, y: Any, n: int) -> Any:
        x, y = (np.uint64(v % 2**64) if isinstance(v, int) else v for v in (x, y))
        functions: dict[str, Callable[..., Any]] = {
            "add": jnp.add, "sub": jnp.subtract, "mul": jnp.multiply, "and": jnp.bitwise_and,
            "or": jnp.bitwise_or, "xor": jnp.bitwise_xor, "shl": jnp.left_shift, "lshr": jnp.right_shift,
        }  # fmt: skip
        return functions[name](x, y)

    # memory

    def load_truth(self, pointer: Place) -> bool:
        return bool(pointer.array[pointer.k])

    def load(self, pointer: Place, kind: str, n: int = 0, align: int = 0) -> Any:
        return plain(pointer.array[pointer.k])

    def load_real(self, pointer: Place, kind: str, n: int = 0, align: int = 0) -> Any:
        return self.load(pointer, kind)

    def store(self, pointer: Place, x: Any, kind: str, n: int = 0, align: int = 0) -> None:
        pointer.array[pointer.k] = x

    store_real = store

    def table_rows(self, table: Place, begin: Any, size: int) -> list[Any]:
        numbers = jnp.asarray(table.array, self.kind)
        if not np.ndim(begin):
            found = jax.lax.dynamic_slice(numbers, (begin + table.k,), (size,))
            return [found[k] for k in range(size)]
        found = numbers[begin[:, None] + (table.k + np.arange(size))]
        return [found[:, k] for k in range(size)]

    def whole_of(self, x: Any) -> Any:
        return jnp.asarray(jax.lax.stop_gradient(x)).astype(self.whole_kind)


COMPARED: dict[str, Callable[..., Any]] = {
    "<": jnp.less, "<=": jnp.less_equal, ">": jnp.greater, ">=": jnp.greater_equal, "==": jnp.equal,
    "!=": jnp.not_equal,
}  # fmt: skip


def is_rounder(x: Any) -> bool:
    """Return True for a constant that rounds."""
    return isinstance(x, float) and x in ROUNDERS


def rounded(x: Any) -> Any:
    """Return the nearest whole number, which has no slope."""
    return jnp.round(jax.lax.stop_gradient(x))
