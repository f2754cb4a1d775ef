"""Fields by name: positions follow from the declaration, and what a kernel reads and writes is where NumPy
finds it."""

from itertools import pairwise
from typing import Annotated

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError

from hoof_env.simd import block_at, columns, load_rows, rows
from hoof_env.simd.layout import Block, Layout, Row, Size, Vector, views
from hoof_env.simd.memory import address, doubles


class Point(Layout):
    place: Vector
    depth: Row


class Thing(Layout):
    mass: Row
    numbers: Annotated[Block, 3]
    toe: Point
    heel: Point


SIZE = Thing.size


def test_positions_follow_from_the_declaration():
    assert (Thing.size, Point.size) == (10, 3)
    assert Thing.names[:5] == ("mass", "numbers_0", "numbers_1", "numbers_2", "toe_place_x")
    starts = [0, 1, 4, 7, 10]
    assert [Thing.rows(name) for name in Thing.fields] == [slice(*pair) for pair in pairwise(starts)]
    seen = views(Thing, np.arange(20.0).reshape(10, 2))
    assert (seen.mass == [0, 1]).all()
    assert (seen.heel == [[14, 15], [16, 17], [18, 19]]).all()


def on(lanes):
    """A kernel that works on all columns, `lanes` at a time; 0 as ordinary numbers."""

    @njit(error_model="numpy")
    def work(data):
        for n in range(0, data.shape[1], max(lanes, 1)):
            thing = columns(address(data), lanes, Thing, n, data.shape[1], 1)
            thing.mass = 2.0 * thing.mass
            thing.numbers[1] = thing.numbers[0] + thing.toe.place.imag
            thing.heel.depth = thing.toe.depth * thing.mass
            thing.toe.depth = 7

    return work


@pytest.mark.parametrize("lanes", [0, 1, 8])
def test_a_field_is_where_numpy_finds_it(lanes):
    data = np.random.default_rng(0).normal(size=(10, 16))
    expected = data.copy()
    seen = views(Thing, expected)
    seen.mass *= 2.0
    seen.numbers[1] = seen.numbers[0] + seen.toe[1]
    seen.heel[2] = seen.toe[2] * seen.mass
    seen.toe[2] = 7.0
    on(lanes)(data)
    np.testing.assert_array_equal(data, expected)


@njit(error_model="numpy")
def swap(data):
    """Toe and heel of all columns, by way of rows on the stack, where the second thing has a copy."""
    both = rows(doubles(2 * SIZE * 8), 8, Thing)
    for n in range(0, data.shape[1], 8):
        given = columns(address(data), 8, Thing, n, data.shape[1], 1)
        first, second = block_at(both, 0), block_at(both, 1)
        load_rows(first, given)
        load_rows(second, given)
        first.toe.place = second.heel.place
        first.heel.place = second.toe.place
        given.toe.place, given.heel.place = first.toe.place, first.heel.place


def test_rows_on_the_stack_have_the_same_names():
    data = np.random.default_rng(1).normal(size=(10, 8))
    expected = data.copy()
    expected[[4, 5, 7, 8]] = data[[7, 8, 4, 5]]
    swap(data)
    np.testing.assert_array_equal(data, expected)


def test_an_unknown_field_is_refused():
    @njit
    def wrong(data):
        return columns(address(data), 0, Thing, 0, 1, 1).weight

    with pytest.raises(TypingError, match=r"Unknown attribute 'weight'"):
        wrong(np.zeros((10, 1)))


def test_memory_of_another_layout_does_not_fill_rows():
    @njit
    def wrong(data):
        load_rows(rows(doubles(10), 1, Thing), columns(address(data), 1, Point, 0, 1, 1))

    with pytest.raises(TypeError, match="fill: expected one layout"):
        wrong(np.zeros((10, 1)))


class Sums(Layout):
    first: Row
    extra: Annotated[Row, Size("extra", 0), "a note"]
    last: Row


@pytest.mark.parametrize("lanes", [0, 8])
@pytest.mark.parametrize("extra", [0, 1])
def test_a_row_that_some_lack_is_not_a_number_there_and_takes_no_memory(lanes, extra):
    layout = Sums.sized(extra=extra)

    @njit(error_model="numpy")
    def work(data):
        for n in range(0, data.shape[1], max(lanes, 1)):
            sums = columns(address(data), lanes, layout, n, data.shape[1], 1)
            sums.extra = sums.extra + 1.0
            sums.first = sums.extra

    assert layout.names == (("first", "extra", "last") if extra else ("first", "last"))
    assert layout.notes == {"extra": "a note"}
    data = np.arange(8.0 * layout.size).reshape(layout.size, 8)
    expected = data.copy()
    expected[0] = expected[1] + 1.0 if extra else np.nan
    expected[1] = expected[1] + extra
    work(data)
    np.testing.assert_array_equal(data, expected)
