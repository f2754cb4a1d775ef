"""Cache of kernels in memory. Sets of this package stay; sets with functions from outside are dropped once they
are unused, except for the last few. numba never gives back the machine code of a set that goes and what
it was made from, 10 MB and more."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from threading import RLock
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
    """Cache of the sets of one kind. Of several threads that ask for a set that is not there one makes it."""

    def __init__(self) -> None:
        self._own: dict[Hashable, Kernels] = {}
        self._used: WeakValueDictionary[Hashable, Kernels] = WeakValueDictionary()
        self._last: list[Kernels] = []
        self._lock = RLock()

    def get(self, key: Hashable, make: Callable[[], Kernels], from_outside: bool) -> Any:
        """Return the kernels of a key, and make them if there are none.

        Args:
            key: identifies the set.
            make: makes it.
            from_outside: true if the set contains functions from outside this package.
        """
        with self._lock:
            if not from_outside:
                if key not in self._own:
                    self._own[key] = make()
                return self._own[key]
            found = self._used.get(key)
            if found is None:
                found = self._used[key] = make()
            others = [one for one in self._last if one is not found]
            self._last = [*others, found][-MOST:]
            return found
