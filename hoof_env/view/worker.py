"""Thread of a tab: other tabs do not wait for its slow policy."""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from queue import Queue


class Interrupted(BaseException):
    """Interruption of a job. A policy's `except Exception` does not catch it."""


class Worker:
    """Thread that does one job after the other.

    It is a daemon, because a policy may never return.
    """

    def __init__(self) -> None:
        self._jobs: Queue[Callable[[], None] | None] = Queue()
        self._began = 0.0
        self._thread = threading.Thread(target=self._run, name="hoof-env view", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        """Run jobs until the queue yields None."""
        for job in iter(self._jobs.get, None):
            with suppress(Interrupted):
                job()
            self._jobs.task_done()

    def do(self, job: Callable[[], None]) -> None:
        """Queue a job, which must not raise."""
        if not self.is_busy:
            self._began = time.monotonic()
        self._jobs.put(job)

    @property
    def is_busy(self) -> bool:
        """True while jobs are unfinished."""
        return self._jobs.unfinished_tasks > 0

    @property
    def busy_for(self) -> float:
        """Time for which it has been busy [s], 0 if it is not."""
        return time.monotonic() - self._began if self.is_busy else 0.0

    def end(self) -> None:
        """End the thread after its jobs."""
        self._jobs.put(None)

    def interrupt(self, patience: float) -> None:
        """End the present job, and wait for some time [s] until the thread ends.

        Only Python code can be interrupted: a compiled function that never returns leaves the thread behind.
        """
        thread = ctypes.c_ulong(self._thread.ident or 0)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, ctypes.py_object(Interrupted))
        self._thread.join(patience)
