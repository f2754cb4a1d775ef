"""Conversion of settings and arguments to plain values of Python and JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from enum import Enum
from pathlib import PurePath
from typing import Any

import numpy as np

from hoof_env.errors import ParameterError, brief
from hoof_env.ground.terrain import Terrain
from hoof_env.tasks.settings import Settings


def to_json(settings: Settings) -> dict[str, Any]:
    """Return the settings as values that JSON can hold, by name."""
    return {key: json_value(value) for key, value in asdict(settings).items()}


def as_plain(name: str, value: Any) -> Any:
    """Convert a value to plain Python: numbers of NumPy and pandas to numbers, arrays to lists, paths to
    text, enumerations to their value, a terrain to its mapping. Other objects are returned as they are.

    Args:
        name: name of the value in messages.
        value: any object.

    Raises:
        ParameterError: another kind of number, such as a tensor.
    """
    # Most values are plain already; by type, because a bool is an int and subclasses are converted below.
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, (np.generic, np.ndarray)) and value.dtype != object:
        return as_plain(name, value.tolist())
    if isinstance(value, Enum):
        return as_plain(name, value.value)
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, Terrain):
        return value.to_dict()
    if isinstance(value, Mapping):
        return {str(key): as_plain(f"{name}[{key!r}]", inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        plain = (as_plain(f"{name}[{k}]", inner) for k, inner in enumerate(value))
        return tuple(plain) if isinstance(value, tuple) else list(plain)
    # Subclasses of other libraries, which JSON and pickles of this package should not depend on.
    if isinstance(value, (int, float, str)):
        return next(kind(value) for kind in (int, float, str) if isinstance(value, kind))
    if hasattr(type(value), "__float__"):
        raise ParameterError(
            f"{name}: expected a number of Python or NumPy, which JSON can hold, got {brief(value)}"
        )
    return value  # the check of the setting says what is wrong


def json_value(value: Any) -> Any:
    """Convert tuples to lists at every depth, which is the form in which JSON returns them."""
    if isinstance(value, (list, tuple)):
        return [json_value(inner) for inner in value]
    if isinstance(value, Mapping):
        return {key: json_value(inner) for key, inner in value.items()}
    return value
