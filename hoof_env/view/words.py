"""Words for what goes wrong on a page."""

from __future__ import annotations

import threading
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from hoof_env.errors import HoofEnvError


def words_of(error: BaseException) -> str:
    """Return what a page says of an error. Where a cause is not of this package, the terminal gets the whole
    trace, from which authors of a policy or of a law see where it comes from."""
    is_told = isinstance(error, HoofEnvError)
    if not is_told or error.__cause__ is not None:
        traceback.print_exception(error)
    return str(error) if is_told else f"{type(error).__name__}: {error}"


class Ears:
    """Warnings by the thread that they are in. Python's `catch_warnings` alone hears those of all threads,
    and leaves its filters behind where two of them overlap."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._said: dict[int, list[str]] = {}
        self._caught: Any = None
        self._show: Any = None

    @contextmanager
    def heard(self) -> Iterator[list[str]]:
        """Collect what this thread is warned of; yield the list, which grows meanwhile."""
        said: list[str] = []
        with self._lock:
            if not self._said:
                if warnings.showwarning != self._hear:  # another thread may have put it back
                    self._show = warnings.showwarning
                self._caught = warnings.catch_warnings()
                self._caught.__enter__()
                warnings.simplefilter("always")
                warnings.showwarning = self._hear
            self._said[threading.get_ident()] = said
        try:
            yield said
        finally:
            with self._lock:
                del self._said[threading.get_ident()]
                if not self._said:
                    self._caught.__exit__(None, None, None)

    def _hear(self, message: Any, *more: Any, **named: Any) -> None:
        """Keep a warning, or show it where its thread does not listen."""
        said = self._said.get(threading.get_ident())
        if said is None:
            self._show(message, *more, **named)
        else:
            said.append(str(message))


heard = Ears().heard
