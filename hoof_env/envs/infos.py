"""What infos say besides the reward: where a leg is, what acts on it, and rows of numbers that have names.

The single environment's infos hold NumPy's scalars and rows, those of many hold arrays of them, under the
same keys at a reset and at a step: libraries that stack infos ask for that.
"""

from __future__ import annotations

from collections.abc import ItemsView, KeysView, Mapping, Sequence, ValuesView
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hoof_env.dynamics.form import form_of
from hoof_env.dynamics.layout import PLAIN, STRIDE_SUMS, STRIDES, TRUNK_REPORT, Features, leg_state
from hoof_env.gait import PARAMETERS

START = ("crank_angle", "speed", "height", "x")
"""What an episode starts with, besides its gait and the parameters that are drawn."""

BEGUN = len(START) + len(PARAMETERS)  # how many numbers these are; those drawn follow

LAST_STEP = slice(-len(STRIDE_SUMS), None)
"""Which rows of what is measured are of the last control step, not of its end."""


def measured_names(features: Features = PLAIN) -> tuple[str, ...]:
    """What an info measures, neighbours in the engine's memory: read with one copy."""
    return (*TRUNK_REPORT, "result", *leg_state(features), *STRIDES, *STRIDE_SUMS)


def at_measured(features: Features) -> slice:
    """Where that is."""
    form = form_of(features)
    return slice(form.trunk_memory.rows("report").start, form.trunk_rows + form.leg_memory.rows("sums").stop)


MEASURED = measured_names()
"""Of a leg with a rigid hoof."""


class Named(np.ndarray[Any, np.dtype[np.float64]]):
    """Numbers that have names along the last axis: `row["crank_speed"]` is `row[..., 0]`.

    An array to libraries, and to people also a mapping; made by `named`. Equality is that of mappings where
    the other one has names, too.
    """

    __slots__ = ()  # no dictionary, which would take as long to make as the array
    names: tuple[str, ...] = ()

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, str):
            if key not in self.names:
                raise KeyError(key)
            key = (..., self.names.index(key))
        return np.asarray(self)[key][()]

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        """What is computed from named numbers has no names."""
        return array[()] if return_scalar else np.asarray(array)

    def get(self, key: str, default: Any = None) -> Any:
        return self[key] if key in self.names else default

    def _mapping(self) -> dict[str, Any]:
        return {name: self[name] for name in self.names}

    def keys(self) -> KeysView[str]:
        return self._mapping().keys()

    def values(self) -> ValuesView[Any]:
        return self._mapping().values()

    def items(self) -> ItemsView[str, Any]:
        return self._mapping().items()

    def __contains__(self, key: Any) -> bool:
        return key in self.names if isinstance(key, str) else super().__contains__(key)

    def __bool__(self) -> bool:
        return bool(self.names)

    def __eq__(self, other: Any) -> Any:
        if isinstance(other, Named | Mapping):
            return self.keys() == other.keys() and all(
                np.array_equal(self[name], other[name]) for name in self.names
            )
        return super().__eq__(other)

    def __ne__(self, other: Any) -> Any:
        return not self == other if isinstance(other, Named | Mapping) else super().__ne__(other)

    __hash__ = None

    def __reduce__(self) -> Any:
        return named, (np.array(self), self.names)


@cache
def _kind(names: tuple[str, ...]) -> type[Named]:
    """A class for each set of names: views and copies of a row have them without another thought."""
    return type("Named", (Named,), {"names": names, "__slots__": (), "__doc__": Named.__doc__})


def named(values: ArrayLike, names: Sequence[str]) -> Named:
    """A view of some numbers, shape (..., len(names)), that has names."""
    return np.asarray(values, np.float64).view(_kind(tuple(names)))


GAIT = _kind(PARAMETERS)
"""A kind of `Named`, to view arrays as."""


def measurements(features: Features) -> type[Named]:
    """That of what is measured."""
    return _kind(measured_names(features))


def row_of(infos: Mapping[str, Any], env: int) -> dict[str, Any]:
    """The info of one environment from those of many, where they are about it."""
    row = {}
    for key, values in infos.items():
        if not key.startswith("_") and infos.get(f"_{key}", np.ones(env + 1, bool))[env]:
            is_named = isinstance(values, Named)
            row[key] = named(values[env].copy(), values.names) if is_named else values[env]
    return row
