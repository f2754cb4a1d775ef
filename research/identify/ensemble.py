"""Legs that all meet the published numbers: what those numbers leave open, as a file.

The ensemble of a preset lies in `ensembles` beside this file, under the preset's name. A member is written as
a preset file writes a leg and its gaits, with how well it fits:

    {"provenance": ..., "units": ..., "walk": "walks", "ground": {"exponent": ...},
     "bar": {"exact": 0.97, "paper": 0.99},
     "members": [{"geometry": ..., "gaits": ..., "errors": {"exact": ..., "paper": ...}, "short": {}}, ...]}

Errors are those of the worst row, in units of its own bar; with the paper's solver the walking inelastic
rows, which are ill-conditioned, do not count. "short" names the demands on plausibility that a leg misses.
All legs share the preset's ground, written as in a preset file; without it they have the default one.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from hoof_env.errors import DataFileError, HoofEnvError, ParameterError, check_choice, check_number
from hoof_env.gait.parameters import GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.ground.preset import read_ground, write_ground
from hoof_env.leg.geometry import Geometry

GAITS = ("walk", "run")
SOLVERS = ("exact", "paper")
WALKS = ("walks", "brakes")
"""How the walk of an ensemble may be read."""


@dataclass(frozen=True)
class Member:
    """One leg of an ensemble.

    Attributes:
        geometry: the leg. gaits: "walk" and "run".
        errors: by solver, the largest error of a row [bars].
        short: by name, shortage of the demands on plausibility that the leg misses; empty if none.
        ground: what it stands on.
    """

    geometry: Geometry
    gaits: Mapping[str, GaitParameters]
    errors: Mapping[str, float]
    short: Mapping[str, float]
    ground: Ground = field(default_factory=Ground)

    def to_preset(self) -> dict[str, Any]:
        """The content of a preset file of this leg."""
        geometry = self.geometry.to_dict()
        provenance = geometry.pop("provenance")
        gaits = {gait: asdict(parameters) for gait, parameters in self.gaits.items()}
        ground = write_ground(self.ground)
        return {"provenance": provenance, "geometry": geometry, "gaits": gaits, "ground": ground}


@dataclass(frozen=True)
class Ensemble:
    """At least one leg.

    Attributes:
        name: of the preset that it belongs to, or of its file. provenance: where it comes from.
        walk: the reading of the walk that its members share, one of `WALKS`.
        members: in the order in which they were found or chosen.
    """

    name: str
    provenance: str
    walk: str
    members: tuple[Member, ...]

    @property
    def bar(self) -> dict[str, float]:
        """By solver, the bar that all members meet: the largest error of any [bars]."""
        return {solver: max(member.errors[solver] for member in self.members) for solver in SOLVERS}


def has_ensemble(preset: str) -> bool:
    """Whether the package has an ensemble for this preset; false for a preset file."""
    return _file_of(preset).is_file()


def load_ensemble(source: str | Path) -> Ensemble:
    """The ensemble of a preset (by name) or of a file (by path).

    Raises:
        ParameterError: the preset has none.
        DataFileError: the file is unreadable, lacks a part, holds a leg that does not turn or is there
            twice, or its bar is not that of its members.
    """
    if isinstance(source, Path) or str(source).endswith(".json"):
        path: Any = Path(source)
    elif has_ensemble(source):
        path = _file_of(source)
    else:
        raise ParameterError(f"ensemble: expected a preset that has one or a .json file, got {source!r}")
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataFileError(f"cannot read {path}: {error.strerror or error}") from None
    except (ValueError, RecursionError) as error:
        raise DataFileError(f"{path}: expected an ensemble in JSON, but it does not parse: {error}") from None
    members = data.get("members") if isinstance(data, dict) else None
    if not isinstance(members, list) or not members:
        raise DataFileError(f"{path}: expected an object with a list 'members' of at least one leg")
    ground = read_ground(data, str(path))
    found: list[Member] = []
    for number, entry in enumerate(members, 1):
        try:
            found.append(read_member(entry, f"member {number}", ground))
        except HoofEnvError as error:
            raise DataFileError(f"{path}, member {number}: {error}") from None
    for number, member in enumerate(found, 1):
        for twin, other in enumerate(found[: number - 1], 1):
            if member.geometry.replace(name=other.geometry.name) == other.geometry:
                raise DataFileError(
                    f"{path}: members {twin} and {number}: expected different legs, got one twice"
                )
    try:
        walk = check_choice("walk", data.get("walk", WALKS[0]), WALKS)
    except ParameterError as error:
        raise DataFileError(f"{path}: {error}") from None
    name = source if isinstance(source, str) else source.stem
    ensemble = Ensemble(name, str(data.get("provenance", "")), walk, tuple(found))
    if data.get("bar") != ensemble.bar:
        raise DataFileError(
            f"{path}: bar: expected {ensemble.bar}, its members' largest errors, got {data.get('bar')!r}"
        )
    return ensemble


def read_member(entry: Any, name: str, ground: Ground) -> Member:
    """A member as an ensemble's file writes it, on the ensemble's ground; `name` becomes that of its leg.

    Raises:
        HoofEnvError: something is missing, unknown or out of range, or the leg does not turn.
    """
    if not isinstance(entry, dict):
        raise ParameterError(f"expected an object with geometry, gaits and errors, got {entry!r}")
    try:
        geometry = dict(entry["geometry"])
        leg = Geometry(**{**geometry, "pivot": tuple(geometry["pivot"]), "name": name})
        gaits = {gait: GaitParameters(**entry["gaits"][gait]) for gait in GAITS}
        errors = {s: check_number(f"errors[{s!r}]", entry["errors"][s], low=0) for s in SOLVERS}
        short = {k: check_number(f"short[{k!r}]", v, low=0) for k, v in entry.get("short", {}).items()}
    except KeyError as error:
        raise ParameterError(f"lacks {error}") from None
    except HoofEnvError:
        raise
    except (AttributeError, TypeError, ValueError) as error:
        raise ParameterError(f"is incomplete or has unknown entries: {error}") from None
    return Member(leg, gaits, errors, short, ground)


def write_member(preset: Mapping[str, Any], errors: Mapping[str, float], short: Mapping[str, float]) -> Any:
    """A member as an ensemble's file writes it, from the content of a preset file."""
    parts = {key: preset[key] for key in ("geometry", "gaits")}
    return {**parts, "errors": dict(errors), "short": dict(short)}


def to_data(
    members: list[dict[str, Any]], provenance: str, walk: str, ground: Ground | None = None
) -> dict[str, Any]:
    """The content of an ensemble's file, from members as `write_member` gives them, on one ground
    (by default the one that a preset has which says nothing of it)."""
    bar = {solver: max(member["errors"][solver] for member in members) for solver in SOLVERS}
    return {
        "provenance": provenance,
        "units": "m, rad, rad/s, N/m^n; errors in bars",
        "walk": walk,
        "ground": write_ground(ground or Ground()),
        "bar": bar,
        "members": members,
    }


def _file_of(preset: str) -> Any:
    return Path(__file__).with_name("ensembles") / f"{Path(preset).name}.json"
