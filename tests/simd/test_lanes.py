"""Lanes are numbers side by side: each operation is NumPy's, but for products in sums, with the same bits in
one lane and in eight."""

from fractions import Fraction
from typing import Annotated

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError

from hoof_env.simd import (
    absolute,
    any_lane,
    columns,
    cross,
    dot,
    floor,
    full_like,
    gather_eight,
    lane_sum,
    load_rows,
    maximum,
    minimum,
    perpendicular,
    quarter_turns,
    read,
    rows,
    sqrt,
    vector,
    where,
    write,
)
from hoof_env.simd.layout import Block, Layout
from hoof_env.simd.memory import address, doubles

INPUTS, OUTPUTS = 6, 23


class Inputs(Layout):
    numbers: Annotated[Block, INPUTS]


def on_lanes(count, operations):
    """A kernel that works on columns, `count` at a time."""
    operations = njit(error_model="numpy", forceinline=True)(operations)

    def kernel(given, found):
        mine, out = rows(doubles(INPUTS * count), count, Inputs), rows(doubles(OUTPUTS * count), count, None)
        row = given.shape[1]
        for n in range(0, row, count):
            load_rows(mine, columns(address(given), count, Inputs, n, row, 1))
            operations(mine, out)
            for k in range(OUTPUTS):
                write(out[k], address(found), k * row + n, 1)

    return njit(error_model="numpy")(kernel)


def arithmetic(x, out):
    a, b, z, w = x[0], x[1], vector(x[2], x[3]), vector(x[4], x[5])
    out[0], out[1], out[2], out[3], out[4] = a + b, a - 2.5, 3.0 * b, a / b, -a
    out[5], out[6], out[7] = sqrt(absolute(a)), floor(a), absolute(b)
    out[8], out[9] = maximum(a, b), minimum(a, 0.25)
    out[10] = where((a < b) & (b >= 0.1) | (a == 1.0), a, 7.0)
    out[11] = where((a > 0.5) | (a != a), b, where(a <= -0.5, 1.0, a))
    product, turned = z * w, perpendicular(z)
    out[12], out[13] = product.real, product.imag
    out[14], out[15] = turned.real, turned.imag
    out[16], out[17] = dot(z, w), cross(z, w)
    mixed = a * z - w * 2.0 + where(a > b, z, -w)
    out[18], out[19] = mixed.real, mixed.imag
    out[20], out[21] = full_like(out, 4.0) * a, a
    out[22] = 1.0 if any_lane(a > 1e9) else 0.0


def expected(x):
    a, b, z, w = x[0], x[1], x[2] + 1j * x[3], x[4] + 1j * x[5]
    chosen = np.where((a < b) & (b >= 0.1) | (a == 1.0), a, 7.0)
    nested = np.where((a > 0.5) | (a != a), b, np.where(a <= -0.5, 1.0, a))
    mixed = a * z - w * 2.0 + np.where(a > b, z, -w)
    return [
        a + b, a - 2.5, 3.0 * b, a / b, -a, np.sqrt(np.abs(a)), np.floor(a), np.abs(b), np.maximum(a, b),
        np.minimum(a, 0.25), chosen, nested, (z * w).real, (z * w).imag, -x[3], x[2],
        (z.conj() * w).real, (z.conj() * w).imag, mixed.real, mixed.imag, 4.0 * a, a,
    ]  # fmt: skip


@pytest.fixture(scope="module")
def numbers():
    x = np.random.default_rng(0).normal(size=(INPUTS, 64))
    x[0, 3], x[0, 5] = 1.0, -0.0
    return x


@pytest.fixture(scope="module")
def found(numbers):
    results = {count: np.empty((OUTPUTS, 64)) for count in (1, 4, 8)}
    for count, result in results.items():
        on_lanes(count, arithmetic)(numbers, result)
    return results


def test_operations_are_those_of_numpy(numbers, found):
    np.testing.assert_allclose(found[8][:22], expected(numbers), rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize("count", [4, 8])
def test_a_lane_has_the_bits_that_it_has_alone(found, count):
    np.testing.assert_array_equal(found[count].view(np.int64), found[1].view(np.int64))


def test_a_product_that_enters_a_sum_is_not_rounded():
    def operations(x, out):
        a, b, c, d = x[0], x[1], x[2], x[3]
        out[0], out[1], out[2], out[3] = a * b + c, c + a * b, a * b - c, c - a * b
        out[4], out[5] = a * b + c * d, a * b - c * d
        out[6] = a * c
        out[7] = out[6] + b

    given = np.random.default_rng(1).normal(size=(INPUTS, 64))
    given[2] = -given[0] * given[1] * (1 + 1e-12 * given[4])  # what is left is mostly rounding
    a, b, c, d = ([Fraction(v) for v in row] for row in given[:4])
    rounded = [[Fraction(float(x * y)) for x, y in zip(*two, strict=True)] for two in ((a, b), (a, c))]
    exact = [
        [a * b + c, c + a * b, a * b - c, c - a * b, r + c * d, r - c * d, s, s + b]
        for a, b, c, d, r, s in zip(a, b, c, d, *rounded, strict=True)
    ]
    for count in (1, 8):
        result = np.empty((OUTPUTS, 64))
        on_lanes(count, operations)(given, result)
        np.testing.assert_array_equal(result[:8].T, np.array(exact, float))


def test_what_is_not_a_number_stays_so_where_it_comes_first():
    def operations(x, out):
        out[0], out[1] = maximum(x[0], x[1]), minimum(x[0], x[1])
        out[2], out[3] = maximum(x[1], x[0]), minimum(x[1], x[0])
        out[4] = where(x[0] == x[0], 1.0, 2.0)

    given, result = np.ones((INPUTS, 8)), np.zeros((OUTPUTS, 8))
    given[0] = np.nan
    on_lanes(8, operations)(given, result)
    assert np.isnan(result[:2]).all()
    assert (result[2:4] == 1).all()
    assert (result[4] == 2).all()


def test_quarter_turns():
    def operations(x, out):
        out[0], out[1] = quarter_turns(x[0], x[1], x[2] + 6755399441055744.0)

    given, result = np.zeros((INPUTS, 16)), np.zeros((OUTPUTS, 16))
    given[0], given[1], given[2] = np.cos(0.3), np.sin(0.3), np.arange(-8, 8)
    on_lanes(8, operations)(given, result)
    angle = 0.3 + np.pi / 2 * np.arange(-8, 8)
    np.testing.assert_allclose(result[:2], [np.cos(angle), np.sin(angle)], atol=1e-14)


def test_the_sum_over_lanes_is_in_their_order():
    def operations(x, out):
        out[0] = lane_sum(full_like(x, 0.5), x[0])
        out[1] = 1.0 if any_lane(x[0] > 0.9) else 0.0

    given, result = np.zeros((INPUTS, 8)), np.zeros((OUTPUTS, 8))
    given[0] = [0.1, 0.2, 0.3, 1e16, 0.7, -1e16, 0.5, 0.95]
    on_lanes(4, operations)(given, result)
    assert (result[0, :4] == 0.5 + 0.1 + 0.2 + 0.3 + 1e16).all()
    assert (result[0, 4:] == 0.5 + 0.7 - 1e16 + 0.5 + 0.95).all()
    assert result[1, 0] == 1
    given[0, 3] = 0.0
    on_lanes(4, operations)(given, result)
    assert list(result[1, ::4]) == [0, 1]


@pytest.mark.parametrize("stride", [1, 3])
def test_memory_is_read_and_written_apart(stride):
    @njit(error_model="numpy")
    def copy(table, index, found):
        row = rows(doubles(4), 4, None)
        x = read(row, address(table), 2, stride)
        write(x, address(found), 1, stride)
        many = gather_eight(address(table), read(row, address(index), 0, 1))
        for k in range(8):
            write(many[k], address(found), 20 + 4 * k, 1)

    table, found = np.arange(30.0), np.full(52, -1.0)
    copy(table, np.array([3.0, 0.0, 19.0, 7.0]), found)
    np.testing.assert_array_equal(found[1 : 1 + 4 * stride : stride], table[2 : 2 + 4 * stride : stride])
    np.testing.assert_array_equal(found[20:].reshape(8, 4), np.arange(8)[:, None] + [3, 0, 19, 7])


def test_lanes_of_different_counts_do_not_mix():
    @njit(error_model="numpy")
    def mix():
        one, two = rows(doubles(4), 4, None), rows(doubles(8), 8, None)
        one[0] = one[0] + two[0]

    with pytest.raises(TypingError):
        mix()
