"""Processes that map a function over tasks. They end with their parent, however it ends."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from hoof_env.errors import HoofEnvError

Run = Callable[[Callable[[Any], Any], Sequence[Any]], Iterable[Any]]
"""A function and its tasks to results, as they come."""

_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


@contextmanager
def processes(count: int) -> Iterator[Run]:
    """A function that maps over tasks in up to `count` processes; one is this process itself.

    The results come as they are done; tasks begin in their order. At the end of the block, tasks that run
    are stopped and those that wait are dropped.

    Raises:
        HoofEnvError: a process died.
    """
    if count == 1:
        yield map
        return
    for variable in _ONE_THREAD:
        os.environ.setdefault(variable, "1")  # as the processes inherit it
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count, context, initializer=_end_with_parent)

    def run(function: Callable[[Any], Any], tasks: Sequence[Any]) -> Iterator[Any]:
        with _quiet_start():
            futures = [pool.submit(function, task) for task in tasks]
        try:
            for future in as_completed(futures):
                yield future.result()
        except BrokenProcessPool:
            raise HoofEnvError(
                "a process died (out of memory, or killed); what is done is kept and goes on with --resume"
            ) from None

    try:
        yield run
    finally:
        for process in list((pool._processes or {}).values()):
            process.terminate()
        pool.shutdown(cancel_futures=True)


@contextmanager
def _quiet_start() -> Iterator[None]:
    """Processes that are started meanwhile leave an interrupt to their parent."""
    main = threading.current_thread() is threading.main_thread()
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN) if main else None
    try:
        yield
    finally:
        if main:
            signal.signal(signal.SIGINT, handler)


def _end_with_parent() -> None:
    """Make this process end when its parent does, however that ends."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_exit_after, args=(parent,), daemon=True).start()


def _exit_after(parent: Any) -> None:
    parent.join()
    os._exit(1)
