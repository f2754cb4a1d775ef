"""Thread in which a tab works, so that none of the others waits for a slow policy."""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from queue import Queue


class Interrupted(BaseException):
    """End of a job that is not wanted any more. A policy's `except Exception` does not catch it."""


class Worker:
    """Thread that does one job after the other.

    It does not keep the process from ending, as a policy may never return.
    """

    def __init__(self) -> None:
        self._jobs: Queue[Callable[[], None] | None] = Queue()
        self._began = 0.0
        self._thread = threading.Thread(target=self._run, name="hoof-env view", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        """Do jobs until there is a None."""
        for job in iter(self._jobs.get, None):
            with suppress(Interrupted):
                job()
            self._jobs.task_done()

    def do(self, job: Callable[[], None]) -> None:
        """Do a job, which raises nothing, after those that came before."""
        if not self.is_busy:
            self._began = time.monotonic()
        self._jobs.put(job)

    @property
    def is_busy(self) -> bool:
        """True while a job is not done."""
        return self._jobs.unfinished_tasks > 0

    @property
    def busy_for(self) -> float:
        """Time for which it has been busy [s], 0 if it is not."""
        return time.monotonic() - self._began if self.is_busy else 0.0

    def end(self) -> None:
        """Let the thread end when its jobs are done."""
        self._jobs.put(None)

    def interrupt(self, patience: float) -> None:
        """End the present job, and wait for some time [s] until the thread ends.

        Only Python's own code can be interrupted: a call that never returns from elsewhere leaves the thread
        behind.
        """
        thread = ctypes.c_ulong(self._thread.ident or 0)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, ctypes.py_object(Interrupted))
        self._thread.join(patience)
