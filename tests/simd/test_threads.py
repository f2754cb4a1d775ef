"""Columns are shared among threads without gap or overlap, and no call goes on behind its caller's back."""

import signal
import sys
import threading
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.scenes import engine as scene_engine
from benchmarks.scenes import scenes
from hoof_env.errors import ParameterError
from hoof_env.simd import Matrix, columns, loop, read, threads, where, write
from hoof_env.simd.compile import Kernel, kernel
from hoof_env.simd.memory import Arrays
from hoof_env.simd.threads import available, blocks, check_threads, run_together
from tests.simd.processes import start_python


@given(st.integers(1, 5000), st.sampled_from([1, 4, 8]), st.integers(1, 70))
def test_blocks_are_all_columns_in_equal_groups_of_lanes(columns, lanes, num_threads):
    parts = blocks(columns, lanes, num_threads)
    assert [column for part in parts for column in part] == list(range(columns))
    groups = [-(-len(part) // lanes) for part in parts]
    most = 1 if num_threads == 1 else threads.PARTS * num_threads
    assert len(parts) == min(most, -(-columns // lanes))
    assert max(groups) - min(groups) <= 1
    assert all(part.start % lanes == 0 for part in parts)


@pytest.mark.parametrize("given", [0, -1, 1.5, True, "2", None, available() + 1])
def test_bad_numbers_of_threads_are_refused(given):
    with pytest.raises(ParameterError, match="num_threads: expected"):
        check_threads(given)


class Slow:
    """In the place of a kernel: waits, and says who called."""

    def __init__(self, seconds=0.0):
        self.seconds, self.ended, self.callers = seconds, [], set()

    def __call__(self, number):
        self.callers.add(threading.get_ident())
        time.sleep(self.seconds if number else 0.0)
        self.ended.append(number)
        return number**2


def test_what_calls_return_comes_of_several_threads():
    slow = Slow(0.01)
    assert sorted(run_together(slow, [(number,) for number in range(6)], 3)) == [0, 1, 4, 9, 16, 25]
    assert threading.get_ident() in slow.callers
    assert 2 <= len(slow.callers) <= 3


def test_a_plain_function_is_called_by_several_threads():
    both = threading.Barrier(2, timeout=30)
    assert len(set(run_together(lambda _: both.wait(), [(1,), (2,)], 2))) == 2


def test_many_calls_are_each_made_once():
    slow = Slow()
    for _ in range(200):
        assert sorted(run_together(slow, [(number,) for number in range(64)], 4)) == [
            k * k for k in range(64)
        ]


def test_an_interrupt_is_raised_when_all_calls_have_ended():
    main, ended = threading.main_thread(), []

    def interrupt_soon():
        for seconds in (0.05, 0.1):
            threading.Timer(seconds, signal.pthread_kill, (main.ident, signal.SIGINT)).start()

    class Together(Slow):
        """Has every thread in a call; the caller's ends first, so that it is interrupted while it waits."""

        all_there = threading.Barrier(3, interrupt_soon)

        def __call__(self, number):
            self.all_there.wait()
            time.sleep(0.0 if threading.current_thread() is main else 0.3)
            ended.append(number)

    with pytest.raises(KeyboardInterrupt):
        run_together(Together(), [(number,) for number in range(3)], 3)
    assert sorted(ended) == [0, 1, 2]


def test_an_interrupt_at_any_line_loses_no_call():
    """Wherever in the function it comes, as far as Python can be traced; then all is as before."""
    handler = signal.getsignal(signal.SIGINT)
    lines = 0
    for line in range(1000):
        slow, left = Slow(0.001), [line]

        def trace(frame, event, argument, left=left):
            if frame.f_code.co_filename == threading.__file__:
                return None  # of the pool's start, which is the library's
            left[0] -= 1
            if left[0] == 0:
                signal.raise_signal(signal.SIGINT)
            return trace

        sys.settrace(trace)
        try:
            run_together(slow, [(number,) for number in range(6)], 3)
        except KeyboardInterrupt:
            lines += 1
        finally:
            sys.settrace(None)
        ended = sorted(slow.ended)
        time.sleep(0.002)
        assert sorted(slow.ended) == ended, "a call went on"
        assert signal.getsignal(signal.SIGINT) is handler
        if left[0] > 0:
            break
    assert lines > 30


def test_an_error_is_raised_when_all_calls_have_ended():
    slow = Slow(0.1)
    with pytest.raises(TypeError, match="unsupported"):
        run_together(slow, [("first",), (1,), (2,)], 2)
    assert {1, 2} < {*slow.ended}


def test_a_slow_call_does_not_hold_up_the_others():
    slow = Slow(0.2)
    assert sorted(run_together(slow, [(1,), (0,), (0,), (0,), (0,)], 2)) == [0, 0, 0, 0, 1]
    assert slow.ended == [0, 0, 0, 0, 1]


def test_a_kernel_that_is_not_compiled_is_compiled_once():
    traces = []

    def work(given):
        traces.append(1)
        for n in loop(given.begin, given.end, 8):
            columns(given.x, 8, None, n)[0] = columns(given.x, 8, None, n)[0] + 1.0

    arrays = Arrays({"x": "f8"})
    x = np.arange(64.0).reshape(1, 64)
    calls = [(arrays.hold({"x": x}, range(k, k + 8)),) for k in range(0, 64, 8)]
    assert run_together(Kernel(work, [arrays], is_threaded=True), calls, 3) == [None] * 8
    assert traces == [1]
    np.testing.assert_array_equal(x[0], 1.0 + np.arange(64))


@pytest.mark.parametrize("num_threads", [2, 3, 8])
def test_any_number_of_threads_gives_the_same_bits(num_threads, monkeypatch):
    monkeypatch.setattr(threads, "available", lambda: 8)
    found = {}
    for count in (1, num_threads):
        engine = scene_engine(scenes("identified")["leg"], "identified", 200, num_threads=count)
        assert len(engine.blocks) == (1 if count == 1 else min(25, count * threads.PARTS))
        engine.advance(steps=40)
        found[count] = engine._memory.data.tobytes()
    assert found[1] == found[num_threads]


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="sends signals to threads")
def test_an_interrupt_of_a_long_call_of_an_engine_ends_it():
    """In machine code no signal is seen; a long call has parts, between which it is."""
    code = """
        import signal, threading, time
        from benchmarks.scenes import engine, scenes
        made = engine(scenes("identified")["leg"], "identified", 16, num_threads=2)
        made.advance(steps=1)
        stop = lambda: signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
        threading.Timer(0.5, stop).start()
        try:
            made.advance(steps=10**9)
        except KeyboardInterrupt:
            print("ended", len(made.advance(steps=1)))
    """
    if available() < 2:
        code = code.replace(", num_threads=2", "")
    process = start_python(code)
    assert process.communicate(timeout=100)[0].strip() == "ended 16"


def test_threads_that_trace_and_compile_at_once_do_not_mix_what_they_write():
    """One thread computes with NumPy's machine, which each thread has for itself, while the remaining threads
    trace. All meet in the middle of their functions."""
    middle = threading.Barrier(7, timeout=60)

    def made(k, meets=False):
        def work(x: Matrix) -> None:
            for n in loop(0, x.shape[0], 8):
                value = read(x.first, n, 1, 8)
                for turn in range(60):
                    value = value * 1.001 + k
                    if meets and turn in (10, 30):
                        middle.wait()
                write(where(value > 0.0, value, -value), x.first, n, 1)

        return work

    errors, found = [], {}

    def trace(k):
        try:
            x = np.arange(8.0) - 3.5
            for turn in range(4):
                kernel(made(10.0 * turn + k, meets=turn == 1))(x)
            found[k] = x
        except Exception as error:
            errors.append(error)

    def compute(k):
        try:
            x = np.arange(8.0) - 3.5
            for turn in range(4):
                kernel(made(10.0 * turn + k, meets=turn == 1)).run_now(x)
            found["now", k] = x
        except Exception as error:
            errors.append(error)

    switch = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    try:
        mine = [threading.Thread(target=trace, args=(float(k),)) for k in range(6)]
        mine.append(threading.Thread(target=compute, args=(3.0,)))
        for thread in mine:
            thread.start()
        for thread in mine:
            thread.join()
    finally:
        sys.setswitchinterval(switch)
    assert errors == []
    assert found["now", 3.0].tobytes() == found[3.0].tobytes()
    for k in range(6):
        x = np.arange(8.0) - 3.5
        for turn in range(4):
            kernel(made(10.0 * turn + k)).run_now(x)
        assert x.tobytes() == found[float(k)].tobytes()


def test_more_threads_than_ever_are_refused(monkeypatch):
    monkeypatch.setattr(threads, "available", lambda: 10**6)
    assert check_threads(threads.MAX_THREADS) == threads.MAX_THREADS
    with pytest.raises(ParameterError, match=f"1 to {threads.MAX_THREADS}"):
        check_threads(threads.MAX_THREADS + 1)
