"""Checks of arguments at the border of an engine: each error names what was given and what was expected."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.errors import ParameterError

Floats = NDArray[np.float64]
Kind = TypeVar("Kind")
LARGEST = float(np.finfo(np.float64).max)


def count(name: str, value: Any, low: int = 1, most: float = np.inf) -> int:
    """`value` as a whole number from `low` to `most`."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or value < low:
        raise ParameterError(f"{name}: expected a whole number, {low} or more, got {value!r}")
    if value > most:
        raise ParameterError(f"{name}: expected at most {most:g}, got {value!r}")
    return int(value)


def spread(name: str, value: ArrayLike, shape: tuple[int, ...], most: float = np.inf) -> Floats:
    """`value` as `finite` does, broadcast to `shape`; one number a leg serves all environments."""
    given = finite(name, value, most)
    if given.shape == shape:
        return given
    if not given.ndim:  # broadcast_to would take four times as long
        return np.full(shape, given)
    if given.ndim == 1 and len(shape) == 2:
        given = given[:, None]
    try:
        return np.broadcast_to(given, shape)
    except ValueError:
        raise ParameterError(f"{name}: expected numbers that fit shape {shape}, got {value!r}") from None


def finite(name: str, value: Any, most: float = np.inf) -> Floats:
    """`value` as finite numbers, from -`most` to `most`."""
    try:
        given = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        given = np.array(np.nan)
    if (np.abs(given) <= min(most, LARGEST)).all():  # in one pass: every reset of an episode comes here
        return given
    if not np.isfinite(given).all():
        raise ParameterError(f"{name}: expected finite numbers, got {value!r}")
    raise ParameterError(f"{name}: expected numbers within +-{most:g}, got {value!r}")


def one_of(name: str, value: Any, kind: type[Kind]) -> Kind:
    """`value`, if it is a `kind`."""
    if not isinstance(value, kind):
        raise ParameterError(f"{name}: expected {kind.__name__}, got {value!r}")
    return value


def all_of(name: str, values: Any, kind: type[Kind]) -> tuple[Kind, ...]:
    """One `kind` or several of them as a tuple."""
    try:
        several = (values,) if isinstance(values, kind) else tuple(values)
    except TypeError:
        several = ()
    if not several or not all(isinstance(value, kind) for value in several):
        raise ParameterError(f"{name}: expected {kind.__name__}, one or more, got {values!r}")
    return several


def flag(name: str, value: Any) -> bool:
    """`value`, if it is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise ParameterError(f"{name}: expected True or False, got {value!r}")
    return bool(value)
