"""Checks of the parts of a `Geometry`, and bodies that are not uniform rods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, is_dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import TEXTS, ParameterError, brief, check_number, is_number
from hoof_env.leg.mechanism import BodyPoint, Mechanism
from hoof_env.leg.mechanism_list import read_mechanism, split_solids

Solids = Mapping[str, Mapping[str, Any]]
"""Bodies that are not uniform rods; see `Geometry`."""


def numbers_of(what: str, given: Any) -> dict[str, Any]:
    """Return the numbers, or lists of them, of a dataclass or mapping by name, as JSON can hold them."""
    found = asdict(given) if is_dataclass(given) and not isinstance(given, type) else given
    if not isinstance(found, Mapping) or not found:
        raise ParameterError(f"{what}: expected a mapping of names to numbers, got {brief(given)}")
    check_names(what, found)
    return {
        name: [check_number(f"{what}[{name!r}][{k}]", part) for k, part in enumerate(value)]
        if isinstance(value, (list, tuple))
        else check_number(f"{what}[{name!r}]", value)
        for name, value in found.items()
    }


def check_names(what: str, given: Mapping[Any, Any]) -> None:
    """Raise `ParameterError` unless all names are strings; a file would store any other name as a string."""
    for name in given:
        if not isinstance(name, str):
            raise ParameterError(f"{what}: expected names that are strings, got {brief(name)}")


MIN_LENGTH = 1e-3
MAX_LENGTH = 1e3
"""Smallest and largest length of a link [m]."""


def check_length(mechanism: Mechanism, name: str, given: Any) -> float:
    """Return a length [m]; an error of a negative one along or across a body says where its sign belongs."""
    try:
        return check_number(f"lengths[{name!r}]", given, low=MIN_LENGTH, high=MAX_LENGTH)
    except ParameterError as error:
        for step in mechanism.steps:
            if not isinstance(step, BodyPoint):
                continue
            for axis, text in (("along", step.along), ("across", step.across)):
                if text.lstrip("-") == name and is_number(given) and given < 0:
                    other = name if text.startswith("-") else f"-{name}"
                    raise ParameterError(
                        f"{error}; a point on the other side has the sign in the list of points: {axis!r}:"
                        f" {other!r} of {step.point!r}"
                    ) from None
        raise


def checked_path(given: Any, suffix: str) -> Path:
    """Return the path of a file that is written.

    Raises:
        ParameterError: no path, or a path with another suffix.
    """
    if not isinstance(given, (str, Path)):
        raise ParameterError(
            f"path: expected the path of a file whose name ends in {suffix}, got {brief(given)}"
        )
    path = Path(given)
    if path.suffix != suffix:
        raise ParameterError(f"path: expected a file that ends in {suffix}, got {brief(str(path))}")
    return path


def check_keys(what: str, given: Any, expected: Sequence[str], optional: Sequence[str] = ()) -> None:
    """Raise `ParameterError` unless a mapping has all expected keys and no unknown ones."""
    names = ", ".join(expected or optional) or "no entries"
    if not isinstance(given, Mapping):
        raise ParameterError(f"{what}: expected a mapping with {names}, got {brief(given)}")
    missing, unknown = set(expected) - set(given), set(given) - {*expected, *optional}
    if missing or unknown:
        parts = [f"missing {', '.join(sorted(missing))}"] if missing else []
        parts += [f"unknown {', '.join(sorted(map(str, unknown)))}"] if unknown else []
        if expected:
            wanted = f"exactly {names}" + (f", and perhaps {', '.join(optional)}" if optional else "")
        else:
            wanted = f"some of {names}" if optional else names
        raise ParameterError(f"{what}: expected {wanted}; {'; '.join(parts)}")


def count_of(values: Any) -> int:
    """Return the number of values in a sequence or row, 0 for a string or any other value."""
    if isinstance(values, np.ndarray):
        return values.size if values.ndim == 1 else 0
    return len(values) if isinstance(values, Sequence) and not isinstance(values, TEXTS) else 0


def check_signs(signs: Mapping[str, Any]) -> None:
    """Raise `ParameterError` unless all values are +1 or -1."""
    for name, sign in signs.items():
        if not is_number(sign) or sign not in (1, -1):
            raise ParameterError(f"{name}: expected +1 or -1, got {brief(sign)}")


def check_texts(texts: Mapping[str, Any]) -> None:
    """Raise `ParameterError` unless all values are strings."""
    for name, text in texts.items():
        if not isinstance(text, str):
            raise ParameterError(f"{name}: expected a string, got {brief(text)}")


def checked_masses(given: Any, bodies: int) -> tuple[float, ...]:
    """Return the bodies' masses.

    Raises:
        ParameterError: a wrong number of masses, or a mass that is not finite or not above 0.
    """
    if count_of(given) != bodies:
        raise ParameterError(f"masses: expected {bodies} link masses, got {brief(given)}")
    return tuple(check_number(f"masses[{i}]", m, low=0, exclusive_low=True) for i, m in enumerate(given))


def check_feet(toe: Any, heel: Any, feet: Sequence[str]) -> None:
    """Raise `ParameterError` unless toe and heel are the feet of a mechanism; with one foot the heel is
    None."""
    given = [foot for foot in (toe, heel) if foot is not None]
    if not all(isinstance(foot, str) for foot in given) or toe is None or sorted(given) != sorted(feet):
        expected = f"{' and '.join(sorted(feet))}, one each" if len(feet) == 2 else f"{feet[0]} and None"
        raise ParameterError(f"toe and heel: expected {expected}, got {brief(toe)} and {heel!r}")


def checked_pivot(given: Any, pivots: Sequence[str]) -> Any:
    """Return the place of a single pivot as a pair, or the places of several as a mapping.

    Raises:
        ParameterError: a place is missing or is not a pair of finite numbers.
    """
    if isinstance(given, Mapping):
        check_keys("pivot", given, pivots)
    elif len(pivots) == 1:
        given = {pivots[0]: given}
    else:
        raise ParameterError(
            f"pivot: expected a mapping of {', '.join(pivots)} to their places, got {brief(given)}"
        )
    places = {}
    for name in pivots:
        if count_of(given[name]) != 2:
            raise ParameterError(
                f"pivot: expected two numbers ({name}_x, {name}_y) in metres, got {brief(given[name])}"
            )
        where = "pivot" if len(pivots) == 1 else f"pivot[{name!r}]"
        places[name] = tuple(check_number(f"{where}[{i}]", c) for i, c in enumerate(given[name]))
    return places[pivots[0]] if len(pivots) == 1 else MappingProxyType(places)


def read_structure(given: Any, solids: Any) -> tuple[Mechanism, dict[str, Mapping[str, Any]]]:
    """Return the mechanism and the bodies that are not uniform rods, which the list may describe."""
    labels: dict[str, str] = {}
    if not isinstance(given, Mechanism):
        given, listed, labels = split_solids(given)
        given = read_mechanism(given)
        solids = merged_solids(solids, listed, labels)
    return given, checked_solids(solids, given, labels)


def merged_solids(given: Any, listed: Solids, labels: Mapping[str, str]) -> Any:
    """Return the bodies that are not uniform rods, from `solids` and from the mechanism's list.

    Raises:
        ParameterError: both describe a body.
    """
    if not isinstance(given, Mapping):
        return given
    for name in listed:
        if name in given:
            raise ParameterError(
                f"solids[{name!r}]: {labels[name]} has numbers of {name!r}, too; leave one out"
            )
    return {**given, **listed}


def checked_solids(
    given: Any, mechanism: Mechanism, labels: Mapping[str, str] = MappingProxyType({})
) -> dict[str, Mapping[str, Any]]:
    """Return the bodies that are not uniform rods; `labels` are names of entries in errors.

    Raises:
        ParameterError: no such body, an unknown entry, or a number that is not finite or, of mass and
            inertia, not above 0.
    """
    names = [body.name for body in mechanism.bodies]
    check_keys("solids", given, (), names)
    solids: dict[str, Mapping[str, Any]] = {}
    for name, solid in given.items():
        what = labels.get(name, f"solids[{name!r}]")
        check_keys(what, solid, (), ("mass", "centre", "inertia"))
        checked: dict[str, Any] = {
            key: check_number(f"{what}[{key!r}]", solid[key], low=0, exclusive_low=True)
            for key in ("mass", "inertia")
            if key in solid
        }
        if "centre" in solid:
            if count_of(solid["centre"]) != 2:
                raise ParameterError(
                    f"{what}['centre']: expected two numbers, along and across from the tail, in metres, "
                    f"got {brief(solid['centre'])}"
                )
            # a tuple, which the caller cannot change
            checked["centre"] = tuple(check_number(f"{what}['centre']", part) for part in solid["centre"])
        solids[name] = MappingProxyType(checked)
    return solids


def plain_solids(solids: Solids) -> dict[str, Any]:
    """Return such bodies in a form for JSON."""
    return {
        name: {key: list(value) if key == "centre" else value for key, value in solid.items()}
        for name, solid in solids.items()
    }


def with_solids(
    values: NDArray[np.float64], key: str, solids: Solids, mechanism: Mechanism
) -> NDArray[np.float64]:
    """Return masses or inertias of rods, replaced by the solids' where these are given."""
    given = [solids.get(body.name, {}) for body in mechanism.bodies]
    return np.array([solid.get(key, value) for solid, value in zip(given, values, strict=True)])


def scaled_solids(solids: Solids, factor: float, heavier: Any, mechanism: Mechanism) -> dict[str, Any]:
    """Return bodies of `factor` times the size and `heavier` times the mass, one number or one a body."""
    scaled: dict[str, Any] = {}
    names = [body.name for body in mechanism.bodies]
    times = dict(zip(names, np.broadcast_to(heavier, len(names)).tolist(), strict=True))
    for name, solid in solids.items():
        scaled[name] = dict(solid)
        if "centre" in solid:
            scaled[name]["centre"] = [factor * part for part in solid["centre"]]
        for key, power in (("mass", 0), ("inertia", 2)):
            if key in solid:
                scaled[name][key] = solid[key] * times[name] * factor**power
    return scaled
