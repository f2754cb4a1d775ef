"""Kernels on several threads: each call works on columns of its own, so any number of threads gives the same
bits."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import cache
from itertools import pairwise, starmap
from typing import Any

from hoof_env.errors import ParameterError, count

MOST_THREADS = 1024

PARTS = 8  # blocks of columns for each thread


def available() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_threads(num_threads: Any) -> int:
    """The number of threads; `ParameterError` below 1 or above what there is."""
    threads = count("num_threads", num_threads)
    most = min(available(), MOST_THREADS)
    if threads > most:
        raise ParameterError(
            f"num_threads: expected 1 to {most}, the processors that there are, got {threads}"
        )
    return threads


def limit_threads(num_threads: int) -> int:
    """So many, or the processors that there are: a copy may go on where there are fewer."""
    return min(num_threads, available())


def blocks(columns: int, lanes: int, num_threads: int) -> list[range]:
    """Columns in equal parts that begin with a group of lanes: one for a thread alone, else `PARTS` a thread
    where there are enough, since the processors of a busy machine are not equally fast."""
    groups = -(-columns // lanes)
    parts = min(num_threads * PARTS if num_threads > 1 else 1, groups)
    ends = [min(columns, groups * part // parts * lanes) for part in range(parts + 1)]
    return [range(*pair) for pair in pairwise(ends)]


@cache
def _workers() -> ThreadPoolExecutor:
    """The threads of this process, each started when it is needed; they stay."""
    return ThreadPoolExecutor(MOST_THREADS, "hoof-env")


if hasattr(os, "register_at_fork"):  # a child has none of its parent's threads
    os.register_at_fork(after_in_child=_workers.cache_clear)


def run_together(kernel: Any, calls: Sequence[tuple[Any, ...]], num_threads: int) -> list[Any]:
    """Call a kernel with each of these arguments, so many at once; what the calls returned, in any order.

    This thread is one of them. All have ended when this returns, and when it raises, as at Ctrl-C.
    """
    if num_threads == 1 or len(calls) == 1 or not kernel.overloads:  # it is compiled by this thread
        return [kernel(*call) for call in calls]
    # A thread takes a call and makes it without bytecode between, so that no other can take it, too
    waiting = starmap(kernel, iter(calls))
    with _interrupts_wait():
        others = [_workers().submit(list, waiting) for _ in range(min(num_threads, len(calls)) - 1)]
        try:
            own = list(waiting)
        finally:
            wait(others)
    return own + [result for other in others for result in other.result()]


@contextmanager
def _interrupts_wait() -> Iterator[None]:
    """Ctrl-C is heard at the end: in the midst of it, calls and locks of the threads would be lost."""
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield  # only the main thread hears it, and only a function of Python's can come in between
        return
    heard: list[tuple[int, Any]] = []
    signal.signal(signal.SIGINT, lambda number, frame: heard.append((number, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if heard:
            handler(*heard[0])
