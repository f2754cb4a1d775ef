"""Kernels on several threads. Each call works on separate columns, so that the bits do not depend on the
number of threads."""

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
from hoof_env.simd.compile import Kernel, is_on_machine

MAX_THREADS = 1024
"""Largest number of threads."""

PARTS = 8
"""Number of blocks of columns for each thread."""


def available() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_threads(num_threads: Any) -> int:
    """Return the number of threads; raise `ParameterError` if it is below 1 or above the number of
    processors."""
    threads = count("num_threads", num_threads)
    most = min(available(), MAX_THREADS)
    if threads > most:
        raise ParameterError(f"num_threads: expected 1 to {most}, the number of processors, got {threads}")
    return threads


def limit_threads(num_threads: int) -> int:
    """Return `num_threads`, at most the available processors: a copy may continue on a machine with fewer."""
    return min(num_threads, available())


def blocks(columns: int, lanes: int, num_threads: int) -> list[range]:
    """Return columns in equal parts of whole groups of lanes: one part for a single thread, else
    `PARTS` for each thread if there are enough, because the processors of a busy machine are not equally
    fast."""
    groups = -(-columns // lanes)
    parts = min(num_threads * PARTS if num_threads > 1 else 1, groups)
    ends = [min(columns, groups * part // parts * lanes) for part in range(parts + 1)]
    return [range(*pair) for pair in pairwise(ends)]


@cache
def _workers() -> ThreadPoolExecutor:
    """Return the threads of this process, each started when it is needed; they stay."""
    return ThreadPoolExecutor(MAX_THREADS, "hoof-env")


if hasattr(os, "register_at_fork"):  # a child process does not inherit its parent's threads
    os.register_at_fork(after_in_child=_workers.cache_clear)


def run_together(kernel: Any, calls: Sequence[tuple[Any, ...]], num_threads: int) -> list[Any]:
    """Call a kernel, or another function that lets threads run at once, with each of these arguments,
    `num_threads` calls at once; return the results, in any order.

    The calling thread is one of the threads. All calls have ended when this returns, and when it raises, as
    at Ctrl-C.
    """
    if num_threads == 1 or len(calls) == 1 or is_on_machine():
        return [kernel(*call) for call in calls]
    # one thread compiles a kernel, not each of them
    if isinstance(kernel, Kernel) and kernel.call is None:
        kernel.compile()
    # `list` and `starmap` take and make a call without bytecode in between, so that no other thread takes it
    waiting = starmap(kernel, iter(calls))
    with _interrupts_wait():
        helpers = [_workers().submit(list, waiting) for _ in range(min(num_threads, len(calls)) - 1)]
        try:
            results = list(waiting)
        finally:
            wait(helpers)
    for helper in helpers:
        results += helper.result()
    return results


@contextmanager
def _interrupts_wait() -> Iterator[None]:
    """Defer Ctrl-C to the end of the calls: in between it would lose calls and locks of the threads."""
    handler = signal.getsignal(signal.SIGINT)
    # only the main thread receives signals, and only a handler in Python can come in between
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    received: list[tuple[int, Any]] = []
    signal.signal(signal.SIGINT, lambda number, frame: received.append((number, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if received:
            handler(*received[0])
