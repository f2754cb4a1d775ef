"""Files in which commands keep what they find: read with care, and never another page's by mistake."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from hoof_env._input import read_text
from hoof_env.errors import DataFileError, ParameterError, brief, parse_json

Kind = TypeVar("Kind")

EVIDENCE = Path(__file__).parents[1] / "docs" / "evidence"
"""Folder of the committed pages and their data."""


def read_kept(path: Path, what: str, taken: Callable[[Any], Kind]) -> Kind:
    """Return what a function takes from the object in a JSON file.

    Args:
        path: the file.
        what: name of such a file in messages.
        taken: function of the object; raises KeyError, TypeError or ValueError where something is missing or
            of another form.

    Raises:
        DataFileError: the file cannot be read, is cut off or is another one.
    """
    try:
        content = parse_json(read_text(path))
        if not isinstance(content, dict):
            raise TypeError(f"it has {brief(content)}")
        return taken(content)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        if isinstance(error, KeyError):
            reason = f"there is no entry {error}"
        raise DataFileError(
            f"{path}: expected {what}: {reason}; name another file, or remove this one to begin anew"
        ) from None


def check_numbers(where: str, given: Any, names: Iterable[str], missing: bool = False) -> None:
    """Check that a mapping of a file has numbers under some names.

    Args:
        where: place of the mapping in messages.
        given: the mapping.
        names: the names.
        missing: True where None may stand for a number that there is not.

    Raises:
        KeyError: a name is missing.
        TypeError: it is no mapping, or has something other than a number.
    """
    if not isinstance(given, Mapping):
        raise TypeError(f"{where} is {brief(given)}")
    for name in names:
        value = given[name]
        # By type, for True is an int, too
        if type(value) not in (int, float) and not (missing and value is None):
            raise TypeError(f"{name} of {where} is {brief(value)}")


def check_shape(where: str, given: Any, shape: tuple[int, ...]) -> None:
    """Check that a list of a file has finite numbers of a shape; raise TypeError or ValueError if not."""
    array = np.asarray(given, float)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(f"{where} is {brief(given)}, not numbers of shape {shape}")


def file_of(found: Path | None, out: Path, name: str, file: str) -> Path:
    """Return the file with the data of a page, which lies next to the page unless another one is named.

    Args:
        found: the file that was named, None for the page's own.
        out: folder of the page.
        name: name of the page.
        file: name of its own file.

    Raises:
        ParameterError: there is no such file, or its page would replace a committed one of other data.
    """
    own = out / name / file
    if found is None or found.resolve() == own.resolve():
        return own
    if not found.is_file():
        raise ParameterError(
            f"--found: expected a file that exists, got {brief(str(found))}; without it {own} is begun, or"
            " gone on with"
        )
    if out.resolve() == EVIDENCE.resolve():
        raise ParameterError(
            f"--out: expected another folder for the page of {brief(str(found))}, for {out / name}.md is that"
            f" of {own.name} in {own.parent}"
        )
    return found
