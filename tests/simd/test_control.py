"""Branches, loops and cells of kernels: the same by machine code, on NumPy and as Python's own."""

from fractions import Fraction

import numpy as np
import pytest

from hoof_env.simd import (
    Cell,
    Matrix,
    Number,
    Whole,
    any_lane,
    cond,
    full,
    loop,
    new_rows,
    one_of,
    read,
    rolled,
    vector,
    when,
    where,
    whole,
    write,
)
from hoof_env.simd.compile import CompilerError, kernel

LANES = [0, 1, 8]


def both(made, *arguments):
    """The result of a kernel by machine code; on NumPy it has the same, and changes arrays alike."""
    copies = [x.copy() if isinstance(x, np.ndarray) else x for x in arguments]
    found, on_numpy = made(*arguments), made.run_now(*copies)
    assert found == on_numpy or (found != found and on_numpy != on_numpy)
    for one, other in zip(arguments, copies, strict=True):
        assert not isinstance(one, np.ndarray) or one.tobytes() == other.tobytes()
    return found


@kernel
def larger(x: Number, y: Number) -> Number:
    return cond(x > y, lambda: x * 2.0, y)


@kernel
def steps_of_collatz(start: Whole, most: Whole) -> Whole:
    """A loop with branches inside that have branches inside."""
    n, count = Cell(start), Cell(0)
    for _ in loop(most):

        @when(n.value > 1)
        def _() -> None:
            count.value = count.value + 1

            def odd() -> None:
                n.value = 3 * n.value + 1

            def even() -> None:
                n.value = whole(n.value * 0.5)

            cond(n.value % 2 == 0, even, odd)

    return count.value


@kernel
def sum_of_rests(begin: Whole, end: Whole, step: Whole) -> Whole:
    total = Cell(0)
    for i in loop(begin, end, step):
        for j in loop(i):
            total.value = total.value + j % 3
    return total.value


def test_a_branch_takes_one_side():
    assert both(larger, 3.0, 2.0) == 6.0
    assert both(larger, 2.0, 3.0) == 3.0
    assert both(larger, float("nan"), 3.0) == 3.0


def test_branches_inside_branches_inside_loops():
    for start, wanted in ((1, 0), (2, 1), (6, 8), (27, 111)):
        assert both(steps_of_collatz, start, 200) == wanted
    assert both(steps_of_collatz, 27, 5) == 5
    assert both(steps_of_collatz, 27, 0) == 0


@pytest.mark.parametrize("bounds", [(0, 7, 1), (2, 9, 3), (5, 5, 1), (5, 2, 1), (-3, 3, 2), (0, 0, 1)])
def test_a_loop_has_the_turns_of_range(bounds):
    wanted = sum(j % 3 for i in range(*bounds) for j in range(i))
    assert both(sum_of_rests, *bounds) == wanted


def test_known_bounds_and_conditions_act_as_in_python():
    @kernel
    def known(x: Number) -> Number:
        total = Cell(0.0)
        turns = list(loop(2, 8, 3))
        assert turns == [2, 5]
        for k in loop(4):
            if k > 1:
                total.value = total.value + k * x
        assert cond(True, lambda: "yes", "no") == "yes"
        assert cond(False, lambda: "yes", lambda: "no") == "no"
        ran = []
        when(True)(lambda: ran.append(1))
        when(False)(lambda: ran.append(2))
        assert ran == [1]
        return total.value + one_of((1.0, 2.0), 1)

    assert both(known, 0.5) == 4.5


def test_a_rolled_loop_is_traced_once_and_turns_as_often():
    traces = []

    @kernel
    def count(x: Number) -> Number:
        total = Cell(0.0)
        for k in loop(rolled(5)):
            traces.append(k)
            total.value = total.value + k * x
        return total.value

    assert count(0.5) == 5.0
    assert len(traces) == 1
    assert count.run_now(0.5) == 5.0


@pytest.mark.parametrize("lanes", LANES)
def test_a_branch_returns_lanes_vectors_and_several_values(lanes):
    @kernel
    def choose(x: Matrix, found: Matrix) -> None:
        a = read(x.first, 0, 1, lanes)

        def yes() -> tuple:
            return a + 1.0, vector(a, 2.0), 7.0

        one, two, three = cond(any_lane(a > 3.0), yes, (a, vector(0.0, a), a))
        other = cond(any_lane(a > 3.0), lambda: vector(a, a), lambda: vector(a, 5.0))
        for k, value in enumerate((one, two.real, two.imag, three, other.imag)):
            write(full(value, lanes), found.first, max(lanes, 1) * k, 1)

    count = max(lanes, 1)
    for last, wanted in ((4.0, [5.0, 4.0, 2.0, 7.0, 4.0]), (1.0, [1.0, 0.0, 1.0, 1.0, 5.0])):
        x, found = np.full(count, last), np.zeros((5, count))
        both(choose, x, found)
        np.testing.assert_array_equal(found, np.array(wanted)[:, None] * np.ones(count))


def test_one_lane_is_enough_for_a_branch_that_all_take():
    @kernel
    def enter(x: Matrix) -> Whole:
        ran = Cell(0)
        a = read(x.first, 0, 1, 8)

        @when(any_lane(a > 0.0))
        def _() -> None:
            ran.value = 1
            write(a + 1.0, x.first, 0, 1)

        return ran.value

    x = -np.ones(8)
    assert both(enter, x) == 0
    assert (x == -1).all()
    x[5] = 1.0
    assert both(enter, x) == 1
    assert x.tolist() == [0] * 5 + [2] + [0] * 2


@pytest.mark.parametrize("lanes", LANES)
def test_what_a_cell_or_a_branch_gives_enters_a_sum_rounded(lanes):
    """It is in memory in between, whether the condition is known or not, and on NumPy as well."""

    @kernel
    def sums(x: Matrix, found: Matrix) -> None:
        a, b, c = (read(x.first, max(lanes, 1) * k, 1, lanes) for k in range(3))
        cell = Cell(a * b)
        cell.value = a * b
        ways = (cell.value, cond(True, lambda: a * b, a), cond(any_lane(a == a), lambda: a * b, a))
        for k, value in enumerate(ways):
            write(value + c, found.first, max(lanes, 1) * k, 1)

    count = max(lanes, 1)
    x = np.random.default_rng(3).normal(size=(3, count))
    x[2] = -x[0] * x[1] * (1 + 1e-13)
    found = np.zeros((3, count))
    both(sums, x, found)
    np.testing.assert_array_equal(found, np.ones((3, 1)) * (x[0] * x[1] + x[2]))
    if lanes:  # what it would be otherwise
        exact = [float(Fraction(a) * Fraction(b) + Fraction(c)) for a, b, c in x.T]
        assert (found[0] != exact).any()


def test_a_cell_keeps_lanes_numbers_and_whole_numbers():
    @kernel
    def fill(x: Matrix) -> Whole:
        lanes, number, count = Cell(read(x.first, 0, 1, 8)), Cell(1.0), Cell(0)
        for k in loop(x.shape[0] - 8):
            lanes.value = lanes.value * 2.0
            number.value = number.value + 0.5
            count.value = count.value + k
        write(lanes.value + number.value, x.first, 0, 1)
        return count.value

    x = np.arange(12.0)
    assert both(fill, x) == 6
    np.testing.assert_array_equal(x[:8], 16 * np.arange(8) + 3.0)


@pytest.mark.parametrize("k", [0, 1, 2])
def test_one_of_a_few_numbers(k):
    @kernel
    def pick(k: Whole, x: Number) -> Number:
        return one_of((x, 2.0, x + 5.0), k) + one_of((1.0,), 0)

    assert both(pick, k, 0.25) == (0.25, 2.0, 5.25)[k] + 1


def test_a_value_that_leaves_its_branch_is_refused_in_words():
    @kernel
    def leaving(x: Number) -> Number:
        kept = []
        when(x > 0.0)(lambda: kept.append(x * 2.0))
        return kept[0]

    with pytest.raises(CompilerError, match=r"made inside `when`, `cond` or `loop` is used outside.*Cell"):
        leaving(1.0)


def test_a_value_that_leaves_its_loop_is_refused_or_is_of_the_last_turn():
    """Of a loop whose count is known there is a last turn; of another there may be none."""

    @kernel
    def known(x: Number) -> Number:
        for k in loop(3):
            last = x + k
        return last

    @kernel
    def unknown(x: Number, count: Whole) -> Number:
        last = x
        for k in loop(count):

            @when(k > 1)
            def _(k=k) -> None:
                nonlocal last
                last = x + k

        return last

    assert both(known, 1.0) == 3.0
    with pytest.raises(CompilerError, match="is used outside"):
        unknown(1.0, 3)


def test_memory_of_rows_changes_in_branches():
    @kernel
    def swap(x: Matrix) -> None:
        rows = new_rows(None, 4, 2)
        rows[0], rows[1] = read(x.first, 0, 1, 4), read(x.first, 4, 1, 4)

        @when(any_lane(rows[0] > rows[1]))
        def _() -> None:
            first = rows[0]
            rows[0] = rows[1]
            rows[1] = where(first > 0.0, first, -first)

        for k in range(2):
            write(rows[k], x.first, 4 * k, 1)

    x = np.array([1.0, 2, 3, -4, 1, 1, 5, 5])
    both(swap, x)
    assert x.tolist() == [1, 1, 5, 5, 1, 2, 3, 4]
    both(swap, x)
    assert x.tolist() == [1, 2, 3, 4, 1, 1, 5, 5]
    y = np.array([0.0, 0, 0, 0, 1, 1, 1, 1])
    both(swap, y)
    assert y.tolist() == [0, 0, 0, 0, 1, 1, 1, 1]
