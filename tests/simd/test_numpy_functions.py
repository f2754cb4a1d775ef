"""NumPy's functions on values of kernels: what they give on arrays, with the same bits in one lane and in
eight. So a user's function can be tested on arrays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hoof_env.simd import Matrix, loop, read, vector, write
from hoof_env.simd.compile import Kernel
from hoof_env.simd.numpy_functions import LIBRARY
from hoof_env.simd.values import FUNCTIONS, UFUNCS, Lanes

WIDTH = 16
SPECIAL = (
    0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 3.0, np.inf, -np.inf, np.nan, 5e-324, -5e-324, 2.2e-308, 1e-310, 1e300,
    -1e300, 0.1, 1e16, 709.5, -745.0, np.pi, 1 + 2**-52,
)  # fmt: skip


def number(truth):
    return np.where(truth, 1.0, 0.0)


def planar(x, y):
    """A planar vector: a complex number of NumPy, in which an infinite part leaves the other one alone."""
    if isinstance(x, Lanes):
        return vector(x, y)
    z = np.empty(x.shape, complex)
    z.real, z.imag = x, y
    return z


EXACT = {
    "x + y": lambda x, y: x + y,
    "x - y": lambda x, y: x - y,
    "2 - x": lambda x, y: 2 - x,
    "x * y": lambda x, y: x * y,
    "3 * x": lambda x, y: 3 * x,
    "x / y": lambda x, y: x / y,
    "1 / x": lambda x, y: 1 / x,
    "np.add": np.add,
    "np.subtract": np.subtract,
    "np.multiply": np.multiply,
    "np.divide": np.divide,
    "np.divide of a number": lambda x, y: np.divide(2.0, x),
    "np.subtract of a number": lambda x, y: np.subtract(2.0, x),
    "np.float64 * x": lambda x, y: np.float64(0.3) * x,
    "np.float64 / x": lambda x, y: np.float64(0.3) / x,
    "np.array - x": lambda x, y: np.array(0.3) - x,
    "x / np.array": lambda x, y: x / np.array(0.3),
    "-x": lambda x, y: -x,
    "+x": lambda x, y: +x,
    "abs": lambda x, y: abs(x),
    "np.abs": lambda x, y: np.abs(x),
    "np.fabs": lambda x, y: np.fabs(x),
    "np.negative": lambda x, y: np.negative(x),
    "np.positive": lambda x, y: np.positive(x),
    "np.sqrt": lambda x, y: np.sqrt(x),
    "np.square": lambda x, y: np.square(x),
    "np.reciprocal": lambda x, y: np.reciprocal(x),
    "np.floor": lambda x, y: np.floor(x),
    "np.ceil": lambda x, y: np.ceil(x),
    "np.trunc": lambda x, y: np.trunc(x),
    "np.sign": lambda x, y: np.sign(x),
    "np.copysign": np.copysign,
    "np.minimum": np.minimum,
    "np.maximum": np.maximum,
    "np.minimum of a number": lambda x, y: np.minimum(0.5, x),
    "np.maximum with a number": lambda x, y: np.maximum(x, 0.5),
    "np.maximum of a number": lambda x, y: np.maximum(0.5, x),
    "np.fmax": np.fmax,
    "np.fmin": np.fmin,
    "np.clip": lambda x, y: np.clip(x, -0.5, 1.5),
    "np.clip between values": lambda x, y: np.clip(0.3, x, y),
    "np.clip by name": lambda x, y: np.clip(x, a_min=-0.5, a_max=None),
    "np.isnan": lambda x, y: number(np.isnan(x)),
    "np.isfinite": lambda x, y: number(np.isfinite(x)),
    "np.isinf": lambda x, y: number(np.isinf(x)),
    "x ** 0.5": lambda x, y: x**0.5,
    "x ** 1": lambda x, y: x**1,
    "x ** 2": lambda x, y: x**2,
    "np.power(x, 2)": lambda x, y: np.power(x, 2),
    "<": lambda x, y: number(x < y),
    "<=": lambda x, y: number(x <= y),
    ">": lambda x, y: number(x > y),
    ">=": lambda x, y: number(x >= y),
    "==": lambda x, y: number(x == y),
    "!=": lambda x, y: number(x != y),
    "number < x": lambda x, y: number(0.5 < x),  # noqa: SIM300
    "np.less": lambda x, y: number(np.less(x, y)),
    "np.less_equal": lambda x, y: number(np.less_equal(x, y)),
    "np.greater": lambda x, y: number(np.greater(x, y)),
    "np.greater_equal": lambda x, y: number(np.greater_equal(x, y)),
    "np.equal": lambda x, y: number(np.equal(x, y)),
    "np.not_equal": lambda x, y: number(np.not_equal(x, y)),
    "&": lambda x, y: number((x > 0) & (y > 0)),
    "|": lambda x, y: number((x > 0) | (y > 0)),
    "^": lambda x, y: number((x > 0) ^ (y > 0)),
    "~": lambda x, y: number(~(x > 0)),
    "np.logical_and": lambda x, y: number(np.logical_and(x > 0, y > 0)),
    "np.logical_or": lambda x, y: number(np.logical_or(x > 0, y > 0)),
    "np.logical_xor": lambda x, y: number(np.logical_xor(x > 0, y > 0)),
    "np.logical_not": lambda x, y: number(np.logical_not(x > 0)),
    "np.bitwise_and": lambda x, y: number(np.bitwise_and(x > 0, y > 0)),
    "np.bitwise_or": lambda x, y: number(np.bitwise_or(x > 0, y > 0)),
    "np.bitwise_xor": lambda x, y: number(np.bitwise_xor(x > 0, y > 0)),
    "np.invert": lambda x, y: number(np.invert(x > 0)),
    "truth == truth": lambda x, y: number((x > 0) == (y > 0)),
    "truth != truth": lambda x, y: number((x > 0) != (y > 0)),
    "truth == True": lambda x, y: number((x > 0) == True),  # noqa: E712
    "x == truth": lambda x, y: number(x == (y > 0)),
    "truth * y": lambda x, y: (x > 0) * y,
    "y * truth": lambda x, y: y * (x > 0),
    "truth * 2": lambda x, y: (x > 0) * 2.0,
    "truth + y": lambda x, y: (x > 0) + y,
    "y - truth": lambda x, y: y - (x > 0),
    "1 - truth": lambda x, y: 1 - (x > 0),
    "truth / y": lambda x, y: (x > 0) / y,
    "2 / truth": lambda x, y: 2.0 / (x > 0),
    "np.divide by a truth": lambda x, y: np.divide(2.0, x > 0),
    "truth + truth": lambda x, y: number((x > 0) + (y > 0)),
    "truth * truth": lambda x, y: number((x > 0) * (y > 0)),
    "np.where": lambda x, y: np.where(x < y, x, y),
    "np.where of numbers": lambda x, y: np.where(x != x, 1, -0.0),
    "np.where of truths": lambda x, y: number(np.where(x > 0, y > 0, y < 0)),
    "np.where of a truth": lambda x, y: np.where(x > 0, y > 0, 0.5),
    "np.where known": lambda x, y: np.where(True, x, y),
    "np.where of a number known": lambda x, y: np.where(0.0, x, y) + 0.0,
    "np.select": lambda x, y: np.select([x > 1, x > 0], [x, y], 0.5),
    "np.select, 0 else": lambda x, y: np.select([x > 1, x > 0], [1.0, y]),
    "np.zeros_like": lambda x, y: np.zeros_like(x),
    "np.ones_like": lambda x, y: np.ones_like(x),
    "np.full_like": lambda x, y: np.full_like(x, 0.3),
    "np.real of a number": lambda x, y: np.real(x),
    "np.deg2rad": lambda x, y: np.deg2rad(x),
    "np.rad2deg": lambda x, y: np.rad2deg(x),
    "np.radians": lambda x, y: np.radians(x),
    "np.degrees": lambda x, y: np.degrees(x),
    "x // y": lambda x, y: x // y,
    "x % y": lambda x, y: x % y,
    "x % 1.0": lambda x, y: x % 1.0,
    "1.0 % x": lambda x, y: 1.0 % x,
    "np.floor_divide": np.floor_divide,
    "np.remainder": np.remainder,
    "np.fmod": np.fmod,
    "z.real": lambda x, y: planar(x, y).real,
    "np.imag": lambda x, y: np.imag(planar(x, y)),
    "z + w": lambda x, y: (planar(x, y) + planar(y, x)).real,
    "z - w": lambda x, y: (planar(x, y) - planar(y, y)).imag,
    "-z": lambda x, y: (-planar(x, y)).imag,
    "np.conjugate": lambda x, y: np.conjugate(planar(x, y)).imag,
    "z == w": lambda x, y: number(planar(x, y) == planar(y, x)),
    "z != w": lambda x, y: number(planar(x, y) != planar(y, x)),
    "where of vectors": lambda x, y: np.where(x > 0, planar(x, y), planar(y, x)).real,
    "where of vectors, y": lambda x, y: np.where(x > 0, planar(x, y), planar(y, x)).imag,
    "where of a vector and 0": lambda x, y: np.where(x > 0, planar(x, y), 0.0).imag,
}
"""Operations that IEEE 754 rounds, and choices: bits are NumPy's."""

CLOSE = {
    **{f"np.{name}": (lambda f: lambda x, y: f(x))(getattr(np, name)) for name in LIBRARY
       if name not in ("hypot", "fmod")},
    "np.hypot": np.hypot,
    "np.hypot with a number": lambda x, y: np.hypot(x, 1.0),
    "np.arctan2": np.arctan2,
    "np.arctan2 with a number": lambda x, y: np.arctan2(1.0, x),
    "np.arctan": lambda x, y: np.arctan(x),
    "np.arcsin": lambda x, y: np.arcsin(x),
    "np.arccos": lambda x, y: np.arccos(x),
    "np.power": np.power,
    "np.float_power": np.float_power,
    "x ** y": lambda x, y: x**y,
    "x ** 3": lambda x, y: x**3,
    "x ** 4": lambda x, y: x**4,
    "x ** -1": lambda x, y: x**-1.0,
    "x ** 0": lambda x, y: x**0,
    "x ** 1.5": lambda x, y: x**1.5,
    "2 ** x": lambda x, y: 2.0**x,
    "abs of a vector": lambda x, y: abs(planar(x, y)),
    "np.abs of a vector": lambda x, y: np.abs(planar(x, y)),
    "np.angle": lambda x, y: np.angle(planar(x, y)),
    "np.exp of a truth": lambda x, y: np.exp(1.0 * (x > 0)),
}  # fmt: skip
"""Functions of the C library, whose last digits are not NumPy's."""

CHOICES = ("imum", "np.fm", "np.clip")
"""Words in the names of functions for which NumPy does not say which zero of two they choose."""

ALL = {**EXACT, **CLOSE}


def made(count):
    """A kernel of all operations, `count` numbers at a time, or one ordinary number for 0."""

    def run(given, found):
        width = given.shape[1]
        for n in loop(0, width, max(count, 1)):
            x, y = (read(given.first, row * width + n, 1, count) for row in range(2))
            for k, operation in enumerate(ALL.values()):
                result = operation(x, y)
                write(result, found.first, k * width + n, 1)

    return Kernel(run, [Matrix, Matrix], f"numpy_{count}")


@pytest.fixture(scope="module")
def kernels():
    return {count: made(count) for count in (0, 1, 8)}


NUMBERS = st.one_of(st.sampled_from(SPECIAL), st.floats(-1e3, 1e3), st.floats(width=64))


@settings(max_examples=150, deadline=None)
@given(x=arrays(np.float64, (2, WIDTH), elements=NUMBERS, fill=st.nothing()))
def test_functions_give_what_numpy_gives(kernels, x):
    results = {}
    for count, kernel in kernels.items():
        results[count] = np.empty((len(ALL), WIDTH))
        kernel(x, results[count])
    for count in (0, 8):
        same_bits(results[count], results[1], ALL)
    with np.errstate(all="ignore"):
        for k, (name, operation) in enumerate(ALL.items()):
            found, right = results[1][k], operation(*x)
            good = (found == right) & (np.signbit(found) == np.signbit(right))
            if any(word in name for word in CHOICES):
                good |= found == right
            if name in CLOSE:
                good |= np.abs(found - right) <= 4 * np.spacing(np.abs(right))
            good |= np.isnan(found) & np.isnan(right)
            assert good.all(), (name, x[:, ~good], found[~good], right[~good])


def same_bits(one, two, names):
    wrong = (one.view(np.int64) != two.view(np.int64)) & ~(np.isnan(one) & np.isnan(two))
    assert not wrong.any(), np.array(list(names))[wrong.any(1)]


def test_all_functions_are_tested():
    """By their names in the tables above."""
    names = {f"np.{function.__name__}" for function in (*UFUNCS, *FUNCTIONS)}
    tested = {word.strip("(,") for name in ALL for word in name.replace("(", " ").split()}
    aliases = {"np.absolute": "np.abs", "np.conjugate": "np.conjugate"}
    assert {name for name in names if aliases.get(name, name) not in tested} == set()
