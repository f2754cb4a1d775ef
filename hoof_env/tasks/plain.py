"""Values as Python and JSON know them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from enum import Enum
from pathlib import PurePath
from typing import Any

import numpy as np

from hoof_env.errors import ParameterError
from hoof_env.tasks.settings import Settings


def to_json(settings: Settings) -> dict[str, Any]:
    """The settings as values that JSON can hold."""
    return {key: json_value(value) for key, value in asdict(settings).items()}


def as_plain(name: str, value: Any) -> Any:
    """A value as Python and JSON know it: numbers of NumPy and pandas as numbers, arrays as lists, paths as
    text, enumerations by their value.

    Raises:
        ParameterError: another kind of number, such as a tensor.
    """
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, (np.generic, np.ndarray)) and value.dtype != object:
        return as_plain(name, value.tolist())
    if isinstance(value, Enum):
        return as_plain(name, value.value)
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): as_plain(f"{name}[{key!r}]", inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        plain = (as_plain(f"{name}[{k}]", inner) for k, inner in enumerate(value))
        return tuple(plain) if isinstance(value, tuple) else list(plain)
    if isinstance(value, (int, float, str)):
        return next(kind(value) for kind in (int, float, str) if isinstance(value, kind))
    if hasattr(type(value), "__float__"):
        raise ParameterError(
            f"{name}: expected a number of Python or NumPy, which JSON can hold, got {value!r}"
        )
    return value  # what takes it says what is wrong


def json_value(value: Any) -> Any:
    """Lists for tuples, however deep, as JSON gives them back."""
    if isinstance(value, (list, tuple)):
        return [json_value(inner) for inner in value]
    if isinstance(value, Mapping):
        return {key: json_value(inner) for key, inner in value.items()}
    return value
