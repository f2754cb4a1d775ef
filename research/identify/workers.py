"""Processes that run jobs. They end with their parent, however it ends."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from multiprocessing import connection
from typing import Any

from hoof_env.errors import HoofEnvError
from research.identify.job import run_job
from research.identify.records import Job, Problem, Progress, Result
from research.identify.state import State

_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS")


class Workers:
    """Up to `count` processes, started when the first jobs come; leave the `with` block to end them.

    Args:
        problem: what is searched. state: where jobs leave their checkpoints and results.
        every: seconds between two checkpoints.
    """

    def __init__(self, problem: Problem, state: State, count: int, every: float) -> None:
        self._arguments = (problem, state, every)
        self._count = count
        self._workers: list[tuple[Any, Any]] = []

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *error: object) -> None:
        for process, pipe in self._workers:
            process.terminate()
            process.join()
            pipe.close()
        self._workers.clear()

    def run(
        self,
        jobs: Sequence[Job],
        tell: Callable[[Progress], None],
        done: Callable[[Result], bool],
    ) -> None:
        """Run jobs in their order and side by side.

        Args:
            tell: called with the progress of a running job.
            done: called with each result as it comes; True ends the search: jobs that come after that one
                are dropped, those before it are finished.

        Raises:
            HoofEnvError: a job failed, or a process died.
        """
        waiting, running = list(jobs), dict[Any, Job]()
        self._start(min(self._count, len(waiting)))
        idle = [pipe for _, pipe in self._workers]
        while waiting or running:
            while waiting and idle:
                pipe, job = idle.pop(), waiting.pop(0)
                pipe.send(job)
                running[pipe] = job
            ready: list[Any] = connection.wait(list(running))
            for pipe in ready:
                if pipe not in running:
                    continue
                job = running[pipe]
                try:
                    message: Any = pipe.recv()
                except (EOFError, OSError):
                    raise HoofEnvError(
                        f"a process died while it ran job {job.id} (out of memory, or killed); "
                        "the search is kept and goes on with --resume"
                    ) from None
                if isinstance(message, Progress):
                    tell(message)
                elif isinstance(message, Result):
                    del running[pipe]
                    idle.append(pipe)
                    if done(message):
                        waiting = [other for other in waiting if other.index < job.index]
                        for late in [p for p, other in running.items() if other.index > job.index]:
                            del running[late]
                else:
                    raise message

    def _start(self, count: int) -> None:
        context = multiprocessing.get_context("spawn")
        with quiet_start():
            while len(self._workers) < count:
                ours, theirs = context.Pipe()
                process = context.Process(target=_serve, args=(theirs, *self._arguments), daemon=True)
                process.start()
                theirs.close()
                self._workers.append((process, ours))


@contextmanager
def quiet_start() -> Iterator[None]:
    """Processes that are started meanwhile leave an interrupt to their parent and use one thread each."""
    old = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    main = threading.current_thread() is threading.main_thread()
    handler = signal.signal(signal.SIGINT, signal.SIG_IGN) if main else None
    try:
        yield
    finally:
        if main:
            signal.signal(signal.SIGINT, handler)
        for name, value in old.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _serve(pipe: Any, problem: Problem, state: State, every: float) -> None:
    """Run the jobs that come through the pipe until it closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        while True:
            job: Job = pipe.recv()
            try:
                save = partial(state.save, job.id)
                result = run_job(problem, job, state.load(job.id), save, pipe.send, every)
                state.finish(result)
            except HoofEnvError as error:
                pipe.send(error)
            except (BrokenPipeError, ConnectionResetError):
                raise
            except Exception as error:
                error.add_note(f"in job {job.id}:\n{traceback.format_exc()}")
                pipe.send(error)
            else:
                pipe.send(result)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        return  # the parent is gone


def end_with_parent() -> None:
    """Make this process end when its parent does, however that ends; for the workers of a pool."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_exit_after, args=(parent,), daemon=True).start()


def _exit_after(parent: Any) -> None:
    parent.join()
    os._exit(1)
