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
    pool = ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), initializer=_end_with_parent)

    def run(function: Callable[[Any], Any], tasks: Sequence[Any]) -> Iterator[Any]:
        handler = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as the processes inherit it
        try:
            futures = [pool.submit(function, task) for task in tasks]
        finally:
            signal.signal(signal.SIGINT, handler)
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


def _end_with_parent() -> None:
    parent: Any = multiprocessing.parent_process()

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
