"""Errors raised at the boundary of the package, and checks that raise them.

Each message names the value that was given and what was expected.
"""

from __future__ import annotations

import json
import math
import reprlib
import unicodedata
from collections.abc import Iterable, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

MAX_LINES = 20
"""Largest number of lines of a message."""

MAX_LETTERS = 2000
"""Largest number of letters of a message, about as many as twenty lines of a terminal hold."""

MAX_VALUE_LETTERS = 200
"""Largest number of letters of a value in a message."""


GYMNASIUM_ADDS = " was raised from the environment creator for"
"""Begin of what `gymnasium.make` adds to a message: the id, and all arguments at any length."""


def printable(text: str) -> str:
    """Return a text whose control characters, such as the escape sequences of a file's name, are written as
    escapes; line breaks and tabs stay."""
    if text.isprintable():
        return text
    return "".join(
        letter
        if letter.isprintable() or letter in "\n\t" or unicodedata.category(letter) == "Zs"
        else letter.encode("unicode_escape").decode()
        for letter in text
    )


class _Brief(reprlib.Repr):
    """Texts of values that are too long for a message: the begin of rows, and the types of objects."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlist = self.maxtuple = self.maxdict = self.maxset = 4
        self.maxstring = 60
        self.maxlevel = 3

    def repr_ndarray(self, x: NDArray[Any], level: int) -> str:
        return f"array of shape {x.shape}"

    def repr_instance(self, x: Any, level: int) -> str:
        text = repr(x)
        return text if len(text) <= self.maxstring and "\n" not in text else f"{type(x).__name__}(...)"


def brief(value: Any) -> str:
    """Return a value for a message: one that is long loses its middle, and a large object is only named.

    >>> brief([0.5] * 1000)
    '[0.5, 0.5, 0.5, 0.5, ...]'
    """
    try:
        text = repr(value)
    # The object is a user's, whose text may fail in any way.
    except Exception:
        return f"{type(value).__name__}(...)"
    if not isinstance(value, str):
        text = " ".join(text.split())
    if len(text) > MAX_VALUE_LETTERS:
        text = _Brief().repr(value)
    return text if len(text) <= MAX_VALUE_LETTERS else f"{text[:MAX_VALUE_LETTERS]}..."


def bounded(text: str) -> str:
    """Return a message that prints, of at most `MAX_LINES` and `MAX_LETTERS`, without what Gymnasium adds:
    a longer one loses its middle."""
    text = printable(text.partition(GYMNASIUM_ADDS)[0])
    lines = text.split("\n")
    if len(lines) > MAX_LINES:
        first, last = lines[: MAX_LINES - 6], lines[-5:]
        left_out = len(lines) - len(first) - len(last)
        text = "\n".join([*first, f"... ({left_out} lines are left out)", *last])
    if len(text) > MAX_LETTERS:
        first_letters, last_letters = text[: MAX_LETTERS - 600], text[-500:]
        left_out = len(text) - len(first_letters) - len(last_letters)
        text = f"{first_letters}... ({left_out} letters are left out) ...{last_letters}"
    return text


class HoofEnvError(Exception):
    """Base class of every error that this package raises on purpose; a message is `bounded`."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*(bounded(part) if isinstance(part, str) else part for part in args))


class ParameterError(HoofEnvError, ValueError):
    """Parameter of a wrong type, not finite or outside its range."""


class UnknownArgumentError(ParameterError, TypeError):
    """Keyword that an environment does not take: a TypeError too, as for any Python function."""


class FixedSettingError(ParameterError, AttributeError):
    """Attribute that cannot be assigned: an AttributeError too, as for any read-only property."""


class MissingExtraError(HoofEnvError, ImportError):
    """Missing library that an extra of this package installs."""


class NotStartedError(HoofEnvError, RuntimeError):
    """Request to move an engine in which nothing has been started."""


class GeometryError(ParameterError):
    """Linkage that cannot be assembled or cannot turn through a full revolution."""


class DataFileError(HoofEnvError, ValueError):
    """Data, preset or model file that is missing, unreadable or incomplete."""


class OutputError(HoofEnvError, OSError):
    """Output file or folder that cannot be written."""


MIN_POSITIVE = 1e-12
"""Smallest value of positive settings, in any unit."""


TEXTS = (str, bytes, bytearray, memoryview)
"""Types of strings, which are sequences, too."""


def is_number(value: Any) -> bool:
    """Return False for what `float` accepts although it is not a number: booleans, strings of digits, and
    arrays of one boolean, string or complex number."""
    if isinstance(value, (np.ndarray, np.generic)):
        return value.ndim == 0 and value.dtype.kind in "iuf"
    return not isinstance(value, (bool, *TEXTS))


def check_number(
    name: str, value: Any, *, low: float = -np.inf, high: float = np.inf, exclusive_low: bool = False
) -> float:
    """Return `value` as a float.

    Raises:
        ParameterError: it is not a finite number within [low, high]; or, with `exclusive_low`, it is `low`
            or, for a `low` of 0, less than `MIN_POSITIVE`, so that quotients stay finite.
    """
    try:
        number = float(value) if is_number(value) else np.nan
    except (TypeError, ValueError, OverflowError):
        number = np.nan
    if not (math.isfinite(number) and low <= number <= high) or (exclusive_low and number == low):
        bounds = f"{'(' if exclusive_low else '['}{low:g}, {high:g}]"
        raise ParameterError(f"{name}: expected a finite number in {bounds}, got {brief(value)}")
    if exclusive_low and low == 0 and number < MIN_POSITIVE:
        raise ParameterError(f"{name}: expected {MIN_POSITIVE:g} or more, got {brief(value)}")
    return number


def check_choice(name: str, value: Any, choices: Iterable[str]) -> str:
    """Return `value`, or raise `ParameterError` unless it is one of `choices`."""
    known = sorted(choices)
    if not isinstance(value, str) or value not in known:
        raise ParameterError(f"{name}: expected one of {', '.join(known)}, got {brief(value)}")
    return value


def parse_json(text: str | bytes) -> Any:
    """Return `json.loads(text)`; raise ValueError also for text that is nested too deep."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("nested too deep") from None


def parse_pairs(option: str, items: Sequence[str]) -> dict[str, Any]:
    """Read `key=value` items, or JSON objects, into one mapping; a value that is not JSON is kept as text.

    >>> parse_pairs("--env-kwargs", ["trunk=rail", "restitution=0.5", '{"render_mode": null}'])
    {'trunk': 'rail', 'restitution': 0.5, 'render_mode': None}

    Raises:
        ParameterError: an item is neither.
    """
    pairs: dict[str, Any] = {}
    for item in items:
        key, equals, text = item.partition("=")
        why = ""
        if item.lstrip().startswith("{"):
            try:
                pairs.update(parse_json(item))
                continue
            except ValueError as error:
                why = f" ({error})"
        elif equals and key.isidentifier():
            try:
                pairs[key] = json.loads(text)
            # not JSON: plain text, as in trunk=rail
            except ValueError:
                pairs[key] = text
                continue
            except RecursionError:
                why = " (nested too deep)"
            else:
                continue
        raise ParameterError(f"{option}: expected a JSON object or key=value, got {brief(item)}{why}")
    return pairs


Floats = NDArray[np.float64]
Kind = TypeVar("Kind")
MAX_FLOAT = float(np.finfo(np.float64).max)
"""Largest finite number."""


def count(name: str, value: Any, low: int = 1, most: float = np.inf) -> int:
    """Return `value` as an int; raise `ParameterError` unless it is a whole number from `low` to `most`."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or value < low:
        raise ParameterError(f"{name}: expected a whole number, {low} or more, got {brief(value)}")
    if value > most:
        raise ParameterError(f"{name}: expected at most {most:g}, got {brief(value)}")
    return int(value)


def spread(name: str, value: ArrayLike, shape: tuple[int, ...], most: float = np.inf) -> Floats:
    """Return `value` as `finite` does, broadcast to `shape`. Values of shape (legs,) apply to all
    environments."""
    numbers = finite(name, value, most)
    if numbers.shape == shape:
        return numbers
    # broadcast_to would take four times as long
    if not numbers.ndim:
        return np.full(shape, numbers)
    if numbers.ndim == 1 and len(shape) == 2:
        numbers = numbers[:, None]
    try:
        return np.broadcast_to(numbers, shape)
    except ValueError:
        raise ParameterError(f"{name}: expected numbers that fit shape {shape}, got {brief(value)}") from None


def finite(name: str, value: Any, most: float = np.inf) -> Floats:
    """Return `value` as an array of doubles; raise `ParameterError` unless all are finite and within
    +-`most`."""
    try:
        numbers = _doubles(np.asarray(value))
    except (TypeError, ValueError, OverflowError):
        numbers = np.array(np.nan)
    # one pass for both checks, NaN included: every reset of an episode calls this function
    if (np.abs(numbers) <= min(most, MAX_FLOAT)).all():
        return numbers
    if not np.isfinite(numbers).all():
        raise ParameterError(f"{name}: expected finite numbers, got {brief(value)}")
    raise ParameterError(f"{name}: expected numbers within +-{most:g}, got {brief(value)}")


def _doubles(values: NDArray[Any]) -> Floats:
    """Return numbers as doubles, and NaN for booleans, strings and complex numbers."""
    kind = values.dtype.kind
    # an object is what NumPy has no type for, such as a fraction or a large integer
    if kind in "iuf" or (kind == "O" and all(is_number(value) for value in values.flat)):
        return values.astype(np.float64, copy=False)
    return np.array(np.nan)


def one_of(name: str, value: Any, kind: type[Kind]) -> Kind:
    """Return `value`; raise `ParameterError` unless it is a `kind`."""
    if not isinstance(value, kind):
        raise ParameterError(f"{name}: expected {kind.__name__}, got {brief(value)}")
    return value


def all_of(name: str, values: Any, kind: type[Kind]) -> tuple[Kind, ...]:
    """Return one `kind` or several as a tuple; raise `ParameterError` unless there is one and all are
    `kind`s."""
    try:
        several = (values,) if isinstance(values, kind) else tuple(values)
    except TypeError:
        several = ()
    if not several or not all(isinstance(value, kind) for value in several):
        raise ParameterError(f"{name}: expected {kind.__name__}, one or more, got {brief(values)}")
    return several


def flag(name: str, value: Any) -> bool:
    """Return `value` as a bool; raise `ParameterError` unless it is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise ParameterError(f"{name}: expected True or False, got {brief(value)}")
    return bool(value)
