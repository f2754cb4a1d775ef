"""NumPy's functions on values: `np.where`, `np.exp` and so on, which a user's function calls as on arrays.

Any other function is refused with a list of these (`values.Value`). Functions of the C library are called
lane by lane, so that a lane has the bits that it would have alone.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hoof_env.simd.machines import CURRENT
from hoof_env.simd.values import (
    FUNCTIONS,
    UFUNCS,
    Lanes,
    Mask,
    Plane,
    Value,
    absolute,
    add,
    ceil,
    clip,
    compare,
    floor,
    full,
    lanes_of,
    library,
    maximum,
    minimum,
    payload,
    power,
    rounded,
    sqrt,
    subtract,
    where,
)


def _sign(x: Any) -> Any:
    return where(x > 0.0, 1.0, where(x < 0.0, -1.0, where(x == 0.0, 0.0, x)))


def _quotient_and_rest(x: Any, y: Any) -> tuple[Any, Any]:
    """Return x // y and x % y as NumPy computes them: the rest has the sign of y."""
    rest = library("fmod")(x, y)
    turns = rounded(x - rest) / y
    crosses = (rest != 0.0) & ((y < 0.0) ^ (rest < 0.0))
    turns = where(crosses, turns - 1.0, turns)
    rest = where(rest != 0.0, where(crosses, rest + y, rest), _copysign(0.0, y))
    below = floor(turns)
    whole = where(turns - below > 0.5, below + 1.0, below)
    whole = where(turns != 0.0, whole, _copysign(0.0, x / y))
    is_zero = y == 0.0
    return where(is_zero, x / y, whole), where(is_zero, library("fmod")(x, y), rest)


def _divided(x: Any, y: Any) -> Any:
    return x / y if isinstance(x, Value) or not isinstance(y, (Lanes, Mask)) else y.__rtruediv__(float(x))


def _select(conditions: Any, choices: Any, default: Any = 0.0) -> Any:
    chosen = default
    for condition, choice in zip(reversed(conditions), reversed(choices), strict=True):
        chosen = where(condition, choice, chosen)
    return chosen


def _copysign(x: Any, y: Any) -> Any:
    machine = CURRENT.machine
    n = lanes_of(x, y)
    top = 1 << 63
    size = machine.whole("and", machine.bits(payload(x, n), n), top - 1, n)
    sign = machine.whole("and", machine.bits(payload(y, n), n), top, n)
    return Lanes(machine.of_bits(machine.whole("or", size, sign, n), n), n)


def _full_like(like: Any, value: Any) -> Any:
    return full(value, like.n)


LIBRARY = (
    "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "sin", "cos", "tan", "sinh", "cosh", "tanh",
    "hypot", "cbrt", "fmod",
)  # fmt: skip
"""NumPy functions that the C library has by the same name."""

UFUNCS |= {
    np.add: add,
    np.subtract: subtract,
    np.multiply: lambda x, y: x * y if isinstance(x, Value) else y * x,
    np.divide: _divided,
    np.floor_divide: lambda x, y: _quotient_and_rest(x, y)[0],
    np.remainder: lambda x, y: _quotient_and_rest(x, y)[1],
    np.conjugate: lambda x: x.conjugate() if isinstance(x, Plane) else x,
    np.isinf: lambda x: absolute(x) == math.inf,
    np.fmax: lambda x, y: where(y != y, x, where(x != x, y, maximum(x, y))),
    np.fmin: lambda x, y: where(y != y, x, where(x != x, y, minimum(x, y))),
    np.trunc: lambda x: _copysign(floor(absolute(x)), x),
    np.logical_xor: lambda x, y: x ^ y,
    np.bitwise_xor: lambda x, y: x ^ y,
    np.negative: lambda x: -x,
    np.positive: lambda x: x,
    np.absolute: absolute,
    np.fabs: absolute,
    np.sqrt: sqrt,
    np.square: lambda x: x * x,
    np.reciprocal: lambda x: 1.0 / x,
    np.floor: floor,
    np.ceil: ceil,
    np.power: power,
    np.float_power: power,
    np.minimum: minimum,
    np.maximum: maximum,
    np.sign: _sign,
    np.copysign: _copysign,
    np.isnan: lambda x: x != x,
    np.isfinite: lambda x: x - x == 0.0,
    np.less: lambda x, y: compare("<", x, y),
    np.less_equal: lambda x, y: compare("<=", x, y),
    np.greater: lambda x, y: compare(">", x, y),
    np.greater_equal: lambda x, y: compare(">=", x, y),
    np.equal: lambda x, y: compare("==", x, y),
    np.not_equal: lambda x, y: compare("!=", x, y),
    np.logical_and: lambda x, y: x & y,
    np.logical_or: lambda x, y: x | y,
    np.logical_not: lambda x: ~x,
    np.bitwise_and: lambda x, y: x & y,
    np.bitwise_or: lambda x, y: x | y,
    np.invert: lambda x: ~x,
    np.deg2rad: lambda x: x * (math.pi / 180),
    np.rad2deg: lambda x: x * (180 / math.pi),
    np.radians: lambda x: x * (math.pi / 180),
    np.degrees: lambda x: x * (180 / math.pi),
    np.arcsin: library("asin"),
    np.arccos: library("acos"),
    np.arctan: library("atan"),
    np.arctan2: library("atan2"),
    **{getattr(np, name): library(name) for name in LIBRARY},
}
FUNCTIONS |= {
    np.where: where,
    np.clip: clip,
    np.select: _select,
    np.real: lambda z: z.real if isinstance(z, Plane) else z,
    np.imag: lambda z: z.imag if isinstance(z, Plane) else full(0.0, z.n),
    np.angle: lambda z: library("atan2")(z.b, z.a),
    np.zeros_like: lambda x: full(0.0, x.n),
    np.ones_like: lambda x: full(1.0, x.n),
    np.full_like: _full_like,
}
