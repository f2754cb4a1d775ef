"""Arrays and records that kernels take, and memory that begins where vectors want it."""

import copy
import gc
import pickle
import threading
import weakref

import numpy as np
import pytest

from hoof_env.simd import Number, Whole, columns, loop, read, where, write
from hoof_env.simd.compile import Kernel
from hoof_env.simd.memory import LARGE, LINE, Arrays, RecordType, aligned

RECORD = np.dtype(
    [("count", "i8"), ("factor", "f8"), ("flags", "?"), ("grid", "f8", (2, 3)), ("ways", "i8", (2,))],
    align=True,
)

ARRAYS = Arrays(
    {"x": "f8", "out": "f4", "which": "i8", "record": RecordType(RECORD, {"count": 2, "known": (1.5, 2.5)})}
)


def work(given, h: Number, steps: Whole) -> Whole:
    """Read all kinds of arrays, write lanes as singles."""
    record = given.record
    assert record.count == 2  # known while this is traced
    total = record.factor * record.known[1] + record.grid[1, 2] + record.grid[0]
    for n in loop(given.begin, given.end, 4):
        x = read(given.x.first, n, 1, 4)
        k = given.which.first[n]
        at = given.x.first[k]
        chosen = where(record.flags, at, -at)
        write(x * h + total + chosen, given.out.first, n, 1)
    given.x.first[0] = steps * h
    return given.x.shape[1] + record.ways[1]


def made():
    record = np.zeros(1, RECORD)
    record["factor"], record["flags"], record["ways"] = 0.5, True, (3, 4)
    record["grid"] = np.arange(6.0).reshape(2, 3)
    x = np.arange(16.0).reshape(2, 8)
    return {"x": x, "out": np.zeros(8, np.float32), "which": np.arange(8)[::-1].copy(), "record": record}


def kernel():
    return Kernel(work, [ARRAYS, float, int])


@pytest.mark.parametrize("flag", [True, False])
def test_arrays_and_records_are_read_and_written(flag):
    for run in (kernel(), kernel().run_now):
        given = made()
        given["record"]["flags"] = flag
        assert run(ARRAYS.hold(given, range(4, 8)), 0.5, 3) == 12
        x = np.arange(16.0)
        first = x[4:8] * 0.5 + (0.5 * 2.5 + 5.0 + 0.0) + (3.0 if flag else -3.0)
        np.testing.assert_array_equal(given["out"], [0] * 4 + first.astype(np.float32).tolist())
        assert given["x"][0, 0] == 1.5


def test_without_columns_nothing_is_done():
    given = made()
    held = ARRAYS.hold(given, range(4, 8))
    kernel()(held.on(range(0)), 0.5, 3)
    assert not given["out"].any()
    assert held.columns == range(4, 8)


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("x", np.zeros((2, 8), np.float32), "x: expected a contiguous array of float64, got float32"),
        ("out", np.zeros(8), "out: expected a contiguous array of float32, got float64"),
        ("which", np.zeros(8, np.int32), "which: expected a contiguous array of int64"),
        ("record", np.zeros(1, [("count", "i8")]), "record: expected a contiguous array"),
        ("x", np.zeros((8, 2)).T, "x: expected a contiguous array"),
        ("x", np.zeros((2, 16))[:, ::2], "x: expected a contiguous array"),
        ("x", np.zeros((1, 1, 2, 8)), "x: expected a contiguous array"),
        ("x", [1.0], "x: expected an array"),
        ("x", None, "x: expected an array"),
    ],
)
def test_an_array_that_the_kernel_would_misread_is_refused(name, wrong, words):
    with pytest.raises(TypeError, match=words):
        ARRAYS.hold(made() | {name: wrong})


def test_a_missing_array_is_refused():
    given = made()
    del given["which"]
    with pytest.raises(TypeError, match="which: expected an array, got None"):
        ARRAYS.hold(given)


def test_an_unknown_array_or_field_is_named_with_those_that_there_are():
    arrays = Arrays({"x": "f8", "record": RecordType(RECORD, {})})

    def wrong_array(given):
        return given.y

    def wrong_field(given):
        return given.record.weight

    for function, words in (
        (wrong_array, "no array 'y'; there are x, record"),
        (wrong_field, "no field 'weight'; there are count, factor, flags, grid, ways"),
    ):
        with pytest.raises(AttributeError, match=words):
            Kernel(function, [arrays]).compile()


def test_arrays_live_as_long_as_what_holds_them():
    given = made()
    held = ARRAYS.hold(given, range(8))
    alive = weakref.ref(given["x"])
    out = given["out"]
    del given
    gc.collect()
    junk = [np.full((2, 8), np.nan) for _ in range(1000)]  # where freed memory would be
    assert kernel()(held, 0.5, 3) == 12
    assert np.isfinite(out).all()
    assert (out != 0).all()
    del held, junk
    gc.collect()
    assert alive() is None


def test_addresses_are_not_copied_to_where_they_do_not_hold():
    held = ARRAYS.hold(made())
    for copied in (pickle.dumps, copy.copy, copy.deepcopy):
        with pytest.raises(TypeError, match="addresses are valid in one process only"):
            copied(held)
        with pytest.raises(TypeError, match="addresses are valid in one process only"):
            copied({"held": [held]} if copied is not copy.copy else held)


@pytest.mark.parametrize("shape", [(3,), (5, 7), (1, 1), (40, 8000)])
def test_new_arrays_begin_at_a_line_or_a_large_page(shape):
    kept = [aligned(*shape) for _ in range(5)]  # wherever NumPy's memory begins
    for array in kept:
        assert array.shape == shape
        assert array.flags.c_contiguous
        assert array.ctypes.data % (LARGE if array.nbytes >= LARGE else LINE) == 0
        array[:] = 1.0


def test_a_matrix_on_several_threads_is_one_memory():
    """Each call works on its own columns; none is held by another's arguments."""

    def double(given) -> None:
        for n in loop(given.begin, given.end, 8):
            columns(given.x, 8, None, n)[0] = columns(given.x, 8, None, n)[0] * 2.0

    arrays = Arrays({"x": "f8"})
    run = Kernel(double, [arrays], is_threaded=True)
    x = np.arange(64.0).reshape(1, 64)
    run.compile()
    parts = [arrays.hold({"x": x}, range(k, k + 16)) for k in range(0, 64, 16)]
    threads = [threading.Thread(target=run, args=(part,)) for part in parts]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    np.testing.assert_array_equal(x[0], 2.0 * np.arange(64))
