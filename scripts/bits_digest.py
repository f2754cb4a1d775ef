"""Digests of what a package computes, a name for each quantity, so that a renaming can be followed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np


class Digests:
    """SHA-256 sums of sequences of values, by name.

    Mappings, named arrays and named tuples are taken apart: what they hold gets a digest of its own under
    `name.key`, so that a key that is renamed changes a name and no digest.
    """

    def __init__(self) -> None:
        self._sums: dict[str, Any] = {}

    def add(self, name: str, value: Any) -> None:
        """Add a value to the sequence of this name."""
        if isinstance(value, Mapping):
            for key in value:
                self.add(f"{name}.{key}", value[key])
        elif isinstance(value, np.ndarray) and getattr(value, "names", ()):
            for key in value.names:  # type: ignore[attr-defined]
                self.add(f"{name}.{key}", value[key])
        elif isinstance(value, (np.ndarray, np.void)) and value.dtype.names:
            for key in value.dtype.names:
                self.add(f"{name}.{key}", value[key])
        elif isinstance(value, tuple) and hasattr(value, "_asdict"):
            self.add(name, value._asdict())
        elif isinstance(value, (list, tuple)):
            self._feed(name, f"[{len(value)}]".encode())
            for item in value:
                self.add(name, item)
        else:
            self._feed(name, as_bytes(value))

    def _feed(self, name: str, data: bytes) -> None:
        self._sums.setdefault(name, hashlib.sha256()).update(data)

    def results(self) -> dict[str, str]:
        """The digests so far, 16 hexadecimal digits each, by name."""
        return {name: total.hexdigest()[:16] for name, total in self._sums.items()}


def as_bytes(value: Any) -> bytes:
    """A value as bytes that determine it: numbers with kind and shape, others by what they print."""
    is_number = isinstance(value, (np.ndarray, np.generic, int, float, complex)) and not isinstance(
        value, bool
    )
    if not is_number:
        return repr(value).encode()
    array = np.asarray(value)
    if array.dtype == object:
        return repr(array.tolist()).encode()
    return array.dtype.kind.encode() + str(array.shape).encode() + array.tobytes()


Cases = Iterator[tuple[str, Digests]]
"""Names of cases, and what was found in each."""
