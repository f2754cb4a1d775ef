"""Cache of kernels in memory, about 60 MB for each compiled set. Sets of this package stay; sets with
functions from outside are dropped once they are unused, except for the last few."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable
from types import SimpleNamespace
from typing import Any
from weakref import WeakValueDictionary

MOST = 2
"""Number of unused sets with functions from outside that are kept, so that an id that is made again needs no
compiling."""


class Kernels(SimpleNamespace):
    """Set of kernels by name."""

    __slots__ = ("__weakref__",)  # `SimpleNamespace` has no weak references


class Kept:
    """Cache of the sets of one kind."""

    def __init__(self) -> None:
        self._own: dict[Hashable, Kernels] = {}
        self._used: WeakValueDictionary[Hashable, Kernels] = WeakValueDictionary()
        self._last: deque[Kernels] = deque(maxlen=MOST)

    def get(self, key: Hashable, make: Callable[[], Kernels], from_outside: bool) -> Any:
        """Return the kernels of a key, and make them if there are none.

        Args:
            key: identifies the set.
            make: makes it.
            from_outside: true if the set contains functions from outside this package.
        """
        if not from_outside:
            if key not in self._own:
                self._own[key] = make()
            return self._own[key]
        kernels = self._used.get(key)
        if kernels is None:
            kernels = self._used[key] = make()
        # to the end of the queue: the set used least recently is dropped first
        if kernels in self._last:
            self._last.remove(kernels)
        self._last.append(kernels)
        return kernels
