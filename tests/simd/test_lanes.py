"""Lanes are numbers side by side: each operation is NumPy's, but for products in sums, with the same bits in
one lane and in eight, by machine code and on NumPy."""

from fractions import Fraction
from typing import Annotated

import numpy as np
import pytest

from hoof_env.simd import (
    Matrix,
    absolute,
    any_lane,
    columns,
    cross,
    dot,
    floor,
    full,
    full_like,
    gather_eight,
    lane_of,
    lane_sum,
    load_rows,
    loop,
    maximum,
    minimum,
    new_rows,
    perpendicular,
    quarter_turns,
    read,
    rounded,
    sqrt,
    vector,
    where,
    write,
)
from hoof_env.simd.compile import kernel
from hoof_env.simd.layout import Block, Layout
from hoof_env.simd.values import TraceError

INPUTS = 6


class Inputs(Layout):
    numbers: Annotated[Block, INPUTS]


def on_lanes(count, operations):
    """A kernel that works on columns, `count` at a time."""

    def work(given: Matrix, found: Matrix) -> None:
        mine = new_rows(Inputs, count)
        width = given.shape[1]
        for n in loop(0, width, count):
            load_rows(mine, columns(given, count, Inputs, n))
            for k, value in enumerate(operations(mine)):
                write(full(value, count), found.first, k * width + n, 1)

    return kernel(work)


def results(count, operations, given):
    """What operations give, one array each; by machine code, of which NumPy has the same bits."""
    made = on_lanes(count, operations)
    found, on_numpy = np.full((2, 32, given.shape[1]), -77.0)
    made(given, found)
    made.run_now(given, on_numpy)
    assert found.tobytes() == on_numpy.tobytes()
    return found[~(found == -77.0).all(1)]


def arithmetic(x):
    a, b, z, w = x[0], x[1], vector(x[2], x[3]), vector(x[4], x[5])
    product, turned = z * w, perpendicular(z)
    mixed = a * z - w * 2.0 + where(a > b, z, -w)
    return [
        a + b, a - 2.5, 3.0 * b, a / b, -a, sqrt(absolute(a)), floor(a), absolute(b),
        maximum(a, b), minimum(a, 0.25), where((a < b) & (b >= 0.1) | (a == 1.0), a, 7.0),
        where((a > 0.5) | (a != a), b, where(a <= -0.5, 1.0, a)), product.real, product.imag,
        turned.real, turned.imag, dot(z, w), cross(z, w), mixed.real, mixed.imag, full_like(x, 4.0) * a, a,
        where(~(a < b), 1.0, (a < b) * b), (z / b).real, 1.0 / b,
    ]  # fmt: skip


def expected(x):
    a, b, z, w = x[0], x[1], x[2] + 1j * x[3], x[4] + 1j * x[5]
    chosen = np.where((a < b) & (b >= 0.1) | (a == 1.0), a, 7.0)
    nested = np.where((a > 0.5) | (a != a), b, np.where(a <= -0.5, 1.0, a))
    mixed = a * z - w * 2.0 + np.where(a > b, z, -w)
    return [
        a + b, a - 2.5, 3.0 * b, a / b, -a, np.sqrt(np.abs(a)), np.floor(a), np.abs(b), np.maximum(a, b),
        np.minimum(a, 0.25), chosen, nested, (z * w).real, (z * w).imag, -x[3], x[2],
        (z.conj() * w).real, (z.conj() * w).imag, mixed.real, mixed.imag, 4.0 * a, a,
        np.where(a >= b, 1.0, b), z.real / b, 1 / b,
    ]  # fmt: skip


@pytest.fixture(scope="module")
def numbers():
    x = np.random.default_rng(0).normal(size=(INPUTS, 64))
    x[0, 3], x[0, 5] = 1.0, -0.0
    return x


@pytest.fixture(scope="module")
def found(numbers):
    return {count: results(count, arithmetic, numbers) for count in (1, 2, 4, 8, 16)}


def test_operations_agree_with_numpy(numbers, found):
    np.testing.assert_allclose(found[8], expected(numbers), rtol=2e-15, atol=1e-15)


@pytest.mark.parametrize("count", [2, 4, 8, 16])
def test_a_lane_has_the_bits_that_it_has_alone(found, count):
    np.testing.assert_array_equal(found[count].view(np.int64), found[1].view(np.int64))


def exact(*rows):
    return [[Fraction(v) for v in row] for row in rows]


@pytest.fixture(scope="module")
def close():
    """Numbers of which sums of products leave mostly rounding."""
    given = np.random.default_rng(1).normal(size=(INPUTS, 64))
    given[2] = -given[0] * given[1] * (1 + 1e-12 * given[4])
    return given


@pytest.mark.parametrize("count", [1, 8])
def test_a_product_that_enters_a_sum_is_not_rounded(close, count):
    def operations(x):
        a, b, c, d = x[0], x[1], x[2], x[3]
        kept = a * c
        return [a * b + c, c + a * b, a * b - c, c - a * b, a * b + c * d, a * b - c * d, kept, kept + b]

    a, b, c, d = exact(*close[:4])
    rounded_ab = [Fraction(float(x * y)) for x, y in zip(a, b, strict=True)]
    wanted = [
        [a * b + c, c + a * b, a * b - c, c - a * b, r + c * d, r - c * d, Fraction(float(a * c)), a * c + b]
        for a, b, c, d, r in zip(a, b, c, d, rounded_ab, strict=True)
    ]
    np.testing.assert_array_equal(results(count, operations, close).T, np.array(wanted, float))


@pytest.mark.parametrize("count", [1, 8])
def test_what_is_rounded_or_came_through_memory_enters_a_sum_so(close, count):
    def operations(x):
        a, b, c = x[0], x[1], x[2]
        row = new_rows(None, count, 1)
        row[0] = a * b
        z = rounded(vector(a, c) * b)
        return [
            rounded(a * b) + c,
            row[0] + c,
            (z + vector(c, b)).real,
            -(a * b) + c,
            where(a > 0, a * b, b) + c,
        ]

    a, b, c = exact(*close[:3])
    products = [Fraction(float(x * y)) for x, y in zip(a, b, strict=True)]
    wanted = [
        [p + c, p + c, p + c, c - p, (p if a > 0 else b) + c]
        for a, b, c, p in zip(a, b, c, products, strict=True)
    ]
    np.testing.assert_array_equal(results(count, operations, close).T, np.array(wanted, float))


@pytest.mark.parametrize("count", [1, 8])
def test_a_dot_product_rounds_its_first_product_only(close, count):
    def operations(x):
        z, w = vector(x[0], x[1]), vector(x[2], x[3])
        return [dot(z, w), cross(z, w)]

    a, b, c, d = exact(*close[:4])
    wanted = [
        [Fraction(float(a * c)) + b * d, Fraction(float(a * d)) - b * c]
        for a, b, c, d in zip(a, b, c, d, strict=True)
    ]
    np.testing.assert_array_equal(results(count, operations, close).T, np.array(wanted, float))


@pytest.mark.parametrize("count", [1, 8])
def test_larger_and_smaller_agree_with_numpy_for_every_pair(count):
    """What is not a number, infinities and signed zeros, of two lanes and of a lane and a constant."""
    odd = (np.nan, np.inf, -np.inf, 0.0, -0.0, 1.0, -2.5, 5e-324)
    given = np.zeros((INPUTS, 64))
    given[0], given[1] = (x.ravel() for x in np.meshgrid(odd, odd))

    def operations(x):
        a, b = x[0], x[1]
        many = [f(a, c) for f in (maximum, minimum) for c in (0.5, -2.5)]
        return [maximum(a, b), minimum(a, b), *many, maximum(0.5, a), minimum(-2.5, a)]

    a, b = given[:2]
    wanted = [np.maximum(a, b), np.minimum(a, b)]
    wanted += [f(a, c) for f in (np.maximum, np.minimum) for c in (0.5, -2.5)]
    wanted += [np.maximum(0.5, a), np.minimum(-2.5, a)]
    np.testing.assert_array_equal(results(count, operations, given), wanted)


def test_nan_differs_from_all_numbers_and_no_comparison_holds():
    def operations(x):
        a, b = x[0], x[1]
        truths = (a == a, a != a, a < b, a <= b, a > b, a >= b, ~(a < b))
        return [*(where(truth, 1.0, 0.0) for truth in truths), absolute(a), -b, where(a != a, b, a)]

    given = np.ones((INPUTS, 8))
    given[0], given[1] = np.nan, -0.0
    found = results(8, operations, given)
    assert found[:7, 0].tolist() == [0, 1, 0, 0, 0, 0, 1]
    assert np.isnan(found[7]).all()
    assert (found[8] == 0).all()
    assert not np.signbit(found[8]).any()
    assert np.signbit(found[9]).all()


def test_quarter_turns():
    def operations(x):
        return [*quarter_turns(x[0], x[1], x[2] + 6755399441055744.0)]

    given = np.zeros((INPUTS, 16))
    given[0], given[1], given[2] = np.cos(0.3), np.sin(0.3), np.arange(-8, 8)
    angle = 0.3 + np.pi / 2 * np.arange(-8, 8)
    np.testing.assert_allclose(results(8, operations, given), [np.cos(angle), np.sin(angle)], atol=1e-14)


def test_the_sum_over_lanes_is_in_their_order():
    def operations(x):
        total = lane_sum(full_like(x, 0.5), x[0])
        pair = lane_sum(vector(full_like(x, 0.5), 0.0), vector(x[0], x[1]))
        return [total, pair.real, pair.imag, where(any_lane(x[0] > 0.9), 1.0, 0.0), lane_of(x[0], 2)]

    given = np.zeros((INPUTS, 8))
    given[0] = [0.1, 0.2, 0.3, 1e16, 0.7, -1e16, 0.5, 0.95]
    given[1] = 1.0
    found = results(4, operations, given)
    assert (found[:2, :4] == 0.5 + 0.1 + 0.2 + 0.3 + 1e16).all()
    assert (found[:2, 4:] == 0.5 + 0.7 - 1e16 + 0.5 + 0.95).all()
    assert (found[2] == 4.0).all()
    assert (found[3] == 1).all()
    assert found[4, ::4].tolist() == [0.3, 0.5]
    given[0, 3] = 0.0
    assert results(4, operations, given)[3, ::4].tolist() == [0, 1]


@pytest.mark.parametrize("stride", [1, 3])
def test_memory_is_read_and_written_apart(stride):
    @kernel
    def copy(table: Matrix, place: Matrix, found: Matrix) -> None:
        write(read(table.first, 2, stride, 4), found.first, 1, stride)
        for k, value in enumerate(gather_eight(table.first, read(place.first, 0, 1, 4))):
            write(value, found.first, 20 + 4 * k, 1)

    table, place = np.arange(30.0), np.array([3.0, 0.0, 19.0, 7.0])
    for run in (copy, copy.run_now):
        found = np.full(52, -1.0)
        run(table, place, found)
        assert (found[:20] != -1).sum() == 4
        np.testing.assert_array_equal(found[1 : 1 + 4 * stride : stride], table[2 : 2 + 4 * stride : stride])
        np.testing.assert_array_equal(found[20:].reshape(8, 4), np.arange(8)[:, None] + [3, 0, 19, 7])


@pytest.mark.parametrize("lanes", [1, 2, 4, 8, 16])
def test_eight_neighbours_are_gathered_by_any_number_of_lanes(lanes):
    @kernel
    def gather(table: Matrix, place: Matrix, found: Matrix) -> None:
        for k, value in enumerate(gather_eight(table.first, read(place.first, 0, 1, lanes))):
            write(value, found.first, lanes * k, 1)

    table = np.random.default_rng(0).normal(size=40)
    place = np.random.default_rng(1).integers(0, 32, lanes).astype(float)
    for run in (gather, gather.run_now):
        found = np.zeros((8, lanes))
        run(table, place, found)
        np.testing.assert_array_equal(found, table[place.astype(int) + np.arange(8)[:, None]])


def test_lanes_of_different_counts_do_not_mix():
    @kernel
    def mix(x: Matrix) -> None:
        write(read(x.first, 0, 1, 4) + read(x.first, 0, 1, 8), x.first, 0, 1)

    with pytest.raises(TraceError, match=r"4 lanes with 8|8 lanes with 4"):
        mix(np.zeros(8))
