"""Sets of kernels that are in memory, some 60 MB each once compiled: those of this package stay, those with
functions from outside go once nothing uses them, but for the last few."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable
from types import SimpleNamespace
from typing import Any
from weakref import WeakValueDictionary

MOST = 2
"""Sets with functions from outside that stay though nothing uses them: an id that is made again is there at
once."""


class Kernels(SimpleNamespace):
    """A set of kernels by name."""

    __slots__ = ("__weakref__",)


class Kept:
    """The sets of one kind."""

    def __init__(self) -> None:
        self._own: dict[Hashable, Kernels] = {}
        self._used: WeakValueDictionary[Hashable, Kernels] = WeakValueDictionary()
        self._last: deque[Kernels] = deque(maxlen=MOST)

    def get(self, key: Hashable, make: Callable[[], Kernels], from_outside: bool) -> Any:
        """The kernels of a key, made where there are none."""
        if not from_outside:
            if key not in self._own:
                self._own[key] = make()
            return self._own[key]
        found = self._used.get(key)
        if found is None:
            found = self._used[key] = make()
        if found in self._last:
            self._last.remove(found)
        self._last.append(found)
        return found
