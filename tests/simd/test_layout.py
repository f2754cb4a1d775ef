"""Fields by name: positions follow from the declaration, and what a kernel reads and writes is where NumPy
finds it."""

from itertools import pairwise
from typing import Annotated

import numpy as np
import pytest

from hoof_env.simd import Matrix, Whole, block_at, columns, load_rows, loop, new_rows
from hoof_env.simd.compile import kernel
from hoof_env.simd.layout import Block, Layout, Row, Size, Vector, extended, views


class Point(Layout):
    place: Vector
    depth: Row


class Thing(Layout):
    mass: Row
    numbers: Annotated[Block, 3]
    toe: Point
    heel: Point


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

    @kernel
    def work(data: Matrix) -> None:
        for n in loop(0, data.shape[1], max(lanes, 1)):
            thing = columns(data, lanes, Thing, n)
            thing.mass = 2.0 * thing.mass
            thing.numbers[1] = thing.numbers[0] + thing.toe.place.imag
            thing.heel.depth = thing.toe.depth * thing.mass
            thing.toe.depth = 7

    return work


def run_both(made, data, *others):
    """Run a kernel on an array by machine code, and on a copy of it on NumPy."""
    copy = data.copy()
    made(data, *others)
    made.run_now(copy, *others)
    assert data.tobytes() == copy.tobytes()


@pytest.mark.parametrize("lanes", [0, 1, 8])
def test_a_field_is_where_numpy_finds_it(lanes):
    data = np.random.default_rng(0).normal(size=(10, 16))
    expected = data.copy()
    seen = views(Thing, expected)
    seen.mass *= 2.0
    seen.numbers[1] = seen.numbers[0] + seen.toe[1]
    seen.heel[2] = seen.toe[2] * seen.mass
    seen.toe[2] = 7.0
    run_both(on(lanes), data)
    np.testing.assert_array_equal(data, expected)


@kernel
def swap(data: Matrix) -> None:
    """Toe and heel of all columns, by way of rows on the stack, where the second thing has a copy."""
    both = new_rows(Thing, 8, 2)
    for n in loop(0, data.shape[1], 8):
        given = columns(data, 8, Thing, n)
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
    run_both(swap, data)
    np.testing.assert_array_equal(data, expected)


@pytest.mark.parametrize("lanes", [0, 1, 8])
def test_a_block_of_a_number_that_is_known_when_the_kernel_runs(lanes):
    """On the stack and in columns, and of a row or the like in a loop."""

    @kernel
    def count(data: Matrix, things: Whole) -> None:
        many = new_rows(Thing, lanes, 3)
        first = columns(data, lanes, Thing, 0)
        for i in loop(things):
            load_rows(block_at(many, i), block_at(first, i))
        for i in loop(things):
            for k in loop(things):
                block_at(first, i).numbers[k] = block_at(many, 2 - i).numbers[k] + k

    data = np.random.default_rng(2).normal(size=(30, max(lanes, 1)))
    numbers = data.reshape(3, 10, -1)[:, 1:4].copy()
    run_both(count, data, 3)
    now = data.reshape(3, 10, -1)[:, 1:4]
    np.testing.assert_array_equal(now, numbers[::-1] + np.arange(3)[:, None])


@pytest.mark.parametrize("row", [0, 10])
@pytest.mark.parametrize("stride", [1, 3])
def test_columns_begin_at_a_row_and_are_apart(row, stride):
    @kernel
    def mark(data: Matrix, at: Whole) -> None:
        columns(data, 4, Thing, at, row, stride).mass = 5.0

    data = np.zeros((20, 16))
    run_both(mark, data, 2)
    wanted = np.zeros((20, 16))
    wanted[row, 2 : 2 + 4 * stride : stride] = 5.0
    np.testing.assert_array_equal(data, wanted)


def test_an_unknown_field_is_refused():
    @kernel
    def wrong(data: Matrix) -> None:
        columns(data, 0, Thing, 0).mass = columns(data, 0, Thing, 0).weight

    @kernel
    def wrong_too(data: Matrix) -> None:
        columns(data, 8, Thing, 0).weight = 1.0

    for made in (wrong, wrong_too):
        for run in (made, made.run_now):
            with pytest.raises(AttributeError, match="no field 'weight'; Thing has mass, numbers, toe, heel"):
                run(np.zeros((10, 8)))


def test_a_block_or_a_layout_is_not_set_at_once():
    @kernel
    def wrong(data: Matrix) -> None:
        columns(data, 8, Thing, 0).toe = 1.0

    with pytest.raises(TypeError, match="toe: the rows of a block or a layout are set one by one"):
        wrong(np.zeros((10, 8)))


def test_rows_without_names_have_numbers_only():
    @kernel
    def wrong(data: Matrix) -> None:
        columns(data, 8, None, 0).mass = 1.0

    with pytest.raises(AttributeError, match="these rows have numbers only"):
        wrong(np.zeros((10, 8)))


def test_a_layout_takes_more_fields_behind_its_own():
    wider = extended(Thing, "own", {"drift": {"wind": Row, "rain": Vector}, "last": {"x": Row}})
    assert wider.names[: Thing.size] == Thing.names
    assert wider.names[Thing.size :] == (
        "own_drift_wind",
        "own_drift_rain_x",
        "own_drift_rain_y",
        "own_last_x",
    )

    @kernel
    def fill(data: Matrix) -> None:
        own = columns(data, 8, wider, 0).own
        own.last.x = 3.0 * own.drift.wind

    data = np.ones((wider.size, 8))
    run_both(fill, data)
    assert (data[-1] == 3.0).all()
    assert (data[:-1] == 1.0).all()


class Sums(Layout):
    first: Row
    extra: Annotated[Row, Size("extra", 0), "a note"]
    last: Row


@pytest.mark.parametrize("lanes", [0, 8])
@pytest.mark.parametrize("extra", [0, 1])
def test_a_row_that_some_lack_is_not_a_number_there_and_takes_no_memory(lanes, extra):
    layout = Sums.sized(extra=extra)

    @kernel
    def work(data: Matrix) -> None:
        for n in loop(0, data.shape[1], max(lanes, 1)):
            sums = columns(data, lanes, layout, n)
            sums.extra = sums.extra + 1.0
            sums.first = sums.extra

    assert layout.names == (("first", "extra", "last") if extra else ("first", "last"))
    assert layout.notes == {"extra": "a note"}
    data = np.arange(8.0 * layout.size).reshape(layout.size, 8)
    expected = data.copy()
    expected[0] = expected[1] + 1.0 if extra else np.nan
    expected[1] = expected[1] + extra
    run_both(work, data)
    np.testing.assert_array_equal(data, expected)


@pytest.mark.parametrize("size", [0, 2])
def test_a_block_that_some_lack_is_not_a_number_there_and_takes_no_memory(size):
    class Springs(Layout):
        first: Row
        springs: Annotated[Block, Size("springs", 0)]
        last: Row

    layout = Springs.sized(springs=size)
    assert layout.size == 2 + size

    @kernel
    def work(data: Matrix) -> None:
        rows = columns(data, 8, layout, 0)
        rows.springs[1] = 4.0
        rows.first = rows.springs[1]

    data = np.ones((layout.size, 8))
    run_both(work, data)
    np.testing.assert_array_equal(data[0], np.full(8, 4.0 if size else np.nan))
    assert (data[-1] == 1.0).all()
