"""Columns are shared among threads without gap or overlap, and no call goes on behind its caller's back."""

import signal
import sys
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hoof_env.errors import ParameterError
from hoof_env.simd import threads
from hoof_env.simd.threads import available, blocks, check_threads, run_together


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
def test_what_is_no_number_of_threads(given):
    with pytest.raises(ParameterError, match="num_threads: expected"):
        check_threads(given)


class Slow:
    """In the place of a compiled kernel: waits, and says who called."""

    overloads = (None,)

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
    for where in range(1000):
        slow, left = Slow(0.001), [where]

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


def test_a_kernel_that_is_not_compiled_is_called_by_one_thread():
    slow = Slow()
    slow.overloads = ()
    assert run_together(slow, [(1,), (2,)], 2) == [1, 4]
    assert slow.callers == {threading.get_ident()}


def test_more_threads_than_ever_are_refused(monkeypatch):
    monkeypatch.setattr(threads, "available", lambda: 10**6)
    assert check_threads(threads.MOST_THREADS) == threads.MOST_THREADS
    with pytest.raises(ParameterError, match=f"1 to {threads.MOST_THREADS}"):
        check_threads(threads.MOST_THREADS + 1)
