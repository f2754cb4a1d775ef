"""Geometry of a leg: its lengths, pivot, assembly, masses and how it stands in the world.

A `Geometry` is a frozen value; building one checks it. Presets are JSON files with a provenance line. The one
in `hoof_env/data`, `identified`, is *identified* from the paper's results, for the paper prints no lengths.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env._output import staged
from hoof_env.errors import DataFileError, GeometryError, ParameterError, check_choice, check_number
from hoof_env.leg.linkage import BODIES, BODY_LENGTHS, CONSTRUCTION, DYADS, LENGTHS, NUMBER, Dyad

DEFAULT_PRESET = "identified"
"""The leg of the paper's reproduction."""

Preset = str | Path | Mapping[str, Any]
"""Preset of a leg: its name, the path of a file, or the content of such a file."""

PARTS = ("provenance", "units", "geometry", "ground", "gaits", "gait_provenance")
"""Parts of a preset; docs/own_task.md describes each."""

LINEAR_DENSITY = 1.0
"""Default mass per length of a link [kg/m]. The paper prints no masses. One kilogram a metre gives the
leg of `HorseLeg-v0` 7.6 kg; on a fixed trunk masses change torques and reactions only, never motion or ground
force."""


@dataclass(frozen=True)
class Geometry:
    """A leg of the paper's mechanism, in the frame of the leg: O at the origin, crank turning clockwise.

    Attributes:
        lengths: the 15 lengths named in `linkage.LENGTHS` [m].
        pivot: position of the fixed pivot C relative to the crank centre O [m].
        assembly: for each dyad's point, +1 if it lies left of the line between its two centres, else -1.
        toe, heel: which of the hoof corners "I" and "J" is which.
        travel: +1 if the leg travels towards +x of its own frame, -1 if towards -x. The world's x always
            points forward; the mirror is applied where the leg is placed in the world and nowhere else.
        hip_height: height of O above the ground in the paper's set-up [m], one level for both gaits.
        linear_density: mass per length of every link [kg/m], unless `masses` is given.
        masses: 14 link masses [kg], or None for `linear_density` times length.
        inertia: "uniform_rod" (J = m L^2 / 3 with half-length L) or "paper" (the printed J = 2 l / 3 with
            half-length l, in kg m^2 though its units do not match; it needs no mass).
        full_turn: whether the crank must be able to turn fully. If not, it may rock between dead points, and
            `TrunkEngine` alone takes such a leg.
        name, provenance: where the numbers come from.

    Raises:
        ParameterError: a value is missing, unknown, not finite or out of range.
        GeometryError: `full_turn`, and the linkage cannot be assembled at some crank angle.
    """

    lengths: Mapping[str, float]
    pivot: tuple[float, float]
    assembly: Mapping[str, int]
    toe: str
    heel: str
    travel: int
    hip_height: float
    linear_density: float = LINEAR_DENSITY
    masses: tuple[float, ...] | None = None
    inertia: str = "uniform_rod"
    full_turn: bool = True
    name: str = "custom"
    provenance: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        _check_keys("lengths", self.lengths, LENGTHS)
        lengths = {k: check_number(f"lengths[{k!r}]", self.lengths[k], low=1e-3, high=1e3) for k in LENGTHS}
        points = [dyad.point for dyad in DYADS]
        _check_keys("assembly", self.assembly, points)
        signs = {f"assembly[{point!r}]": self.assembly[point] for point in points}
        for name, sign in {**signs, "travel": self.travel}.items():
            if np.ndim(sign) or sign not in (1, -1):
                raise ParameterError(f"{name}: expected +1 or -1, got {sign!r}")
        if (self.toe, self.heel) not in (("I", "J"), ("J", "I")):
            given = f"{self.toe!r} and {self.heel!r}"
            raise ParameterError(f"toe and heel: expected I and J, one each, got {given}")
        for name, text in (("name", self.name), ("provenance", self.provenance)):
            if not isinstance(text, str):
                raise ParameterError(f"{name}: expected a text, got {text!r}")
        if _count(self.pivot) != 2:
            raise ParameterError(f"pivot: expected two numbers (C_x, C_y) in metres, got {self.pivot!r}")
        pivot = tuple(check_number(f"pivot[{i}]", c) for i, c in enumerate(self.pivot))
        for name in ("hip_height", "linear_density"):
            check_number(name, getattr(self, name), low=0, exclusive_low=True)
        check_choice("inertia", self.inertia, ("uniform_rod", "paper"))
        if self.masses is not None:
            if _count(self.masses) != len(BODIES):
                raise ParameterError(f"masses: expected {len(BODIES)} link masses, got {self.masses!r}")
            masses = tuple(
                check_number(f"masses[{i}]", m, low=0, exclusive_low=True) for i, m in enumerate(self.masses)
            )
            object.__setattr__(self, "masses", masses)
        object.__setattr__(self, "lengths", MappingProxyType(lengths))
        object.__setattr__(self, "pivot", pivot)
        object.__setattr__(self, "assembly", MappingProxyType({p: int(self.assembly[p]) for p in points}))
        if not isinstance(self.full_turn, bool):
            raise ParameterError(f"full_turn: expected True or False, got {self.full_turn!r}")
        if self.full_turn:
            check_full_revolution(self)

    def __hash__(self) -> int:
        return hash((tuple(self.lengths.items()), self.pivot, tuple(self.assembly.items()), self.name))

    def __reduce__(self) -> tuple[Any, ...]:  # mapping proxies do not pickle
        return (Geometry.from_dict, (self.to_dict(),))

    @property
    def body_lengths(self) -> NDArray[np.float64]:
        """Length of each of the 14 bodies [m], shape (14,)."""
        return np.array([self.lengths[name] for name in BODY_LENGTHS])

    @property
    def body_masses(self) -> NDArray[np.float64]:
        """Mass of each of the 14 bodies [kg], shape (14,)."""
        return self.linear_density * self.body_lengths if self.masses is None else np.array(self.masses)

    @property
    def body_inertias(self) -> NDArray[np.float64]:
        """Moment of inertia of each body about its centre [kg m^2], shape (14,)."""
        half = self.body_lengths / 2
        return 2 * half / 3 if self.inertia == "paper" else self.body_masses * half**2 / 3

    @property
    def mass(self) -> float:
        """Mass of the whole leg [kg]."""
        return float(self.body_masses.sum())

    @cached_property
    def transmission_margin(self) -> float:
        """Smallest |sine| of the angle between a dyad's two links over a revolution (0: a dead point) [-]."""
        z, _ = _solve(self, np.linspace(0, 2 * np.pi, 3600))
        arms = [(z[dyad.point] - z[dyad.first], z[dyad.point] - z[dyad.second]) for dyad in DYADS]
        sines = [np.abs((np.conj(one) * two).imag) / (np.abs(one) * np.abs(two)) for one, two in arms]
        return min(float(np.min(np.nan_to_num(sine))) for sine in sines)

    def to_dict(self) -> dict[str, Any]:
        """Everything that `from_dict` needs, JSON-serialisable."""
        content = {item.name: getattr(self, item.name) for item in fields(self)}
        content |= {name: dict(content[name]) for name in ("lengths", "assembly")}
        content |= {"pivot": list(self.pivot), "masses": None if self.masses is None else list(self.masses)}
        if content.pop("full_turn"):
            return content
        return {**content, "full_turn": False}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Geometry:
        """The leg that `to_dict` gave, or the section "geometry" of a preset.

        Raises:
            ParameterError: an entry is missing, unknown, not finite or out of range.
            GeometryError: as of the class.
        """
        _check_entries(data)
        return cls(**data)

    def save(
        self,
        path: str | Path,
        gaits: Mapping[str, Any] | None = None,
        ground: Mapping[str, float] | None = None,
    ) -> None:
        """Write a preset file, which `preset=` and `load_geometry` take; `provenance` goes with it.

        Args:
            path: of the file; ends in .json.
            gaits: `GaitParameters`, or mappings of the same, by name; an environment needs at least one.
            ground: K "stiffness" [N/m^n] and n "exponent" [-] of the contact law, or one of them.

        Raises:
            ParameterError: another suffix, or gaits or a ground that are not numbers by name.
            OutputError: the file cannot be written.
        """
        path = Path(path)
        if path.suffix != ".json":
            raise ParameterError(f"path: expected a file that ends in .json, got {str(path)!r}")
        geometry = self.to_dict()
        content: dict[str, Any] = {"provenance": geometry.pop("provenance")}
        content |= {"units": "m, kg, kg/m, rad, rad/s", "geometry": geometry}
        if ground is not None:
            _check_keys("ground", ground, (), ("stiffness", "exponent"))
            content["ground"] = _numbers("ground", ground)
        if gaits is not None:
            if not isinstance(gaits, Mapping):
                raise ParameterError(f"gaits: expected a mapping of gaits by name, got {gaits!r}")
            content["gaits"] = {name: _numbers(f"gaits[{name!r}]", gait) for name, gait in gaits.items()}
        with staged(path.parent) as stage:
            (stage / path.name).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")

    def scaled(self, factor: float, mass_per_metre: float | None = None) -> Geometry:
        """A similar leg: lengths, pivot and hip height times `factor`, angles and gaits as before.

        Mass per length stays, so masses scale with `factor`, first moments with its square and the inertias
        of uniform rods with its cube; those of `inertia="paper"` know no mass and scale with `factor`. Bodies
        of one density have masses that scale with `factor` cubed: give `mass_per_metre` for these.

        Args:
            factor: of every length [-].
            mass_per_metre: of every link [kg/m]; in the place of `linear_density` and of own `masses`.

        Returns:
            The leg, by the same name; `provenance` says by how much it is scaled.

        Raises:
            ParameterError: a number is not finite or not above 0, or a length leaves the limits of the class.
        """
        factor = check_number("factor", factor, low=0, exclusive_low=True)
        masses, density = self.masses, self.linear_density
        if mass_per_metre is not None:
            masses = None
            density = check_number("mass_per_metre", mass_per_metre, low=0, exclusive_low=True)
        return replace(
            self,
            lengths={name: factor * length for name, length in self.lengths.items()},
            pivot=(factor * self.pivot[0], factor * self.pivot[1]),
            hip_height=factor * self.hip_height,
            linear_density=density,
            masses=None if masses is None else tuple(factor * mass for mass in masses),
            provenance=f"{self.provenance} Scaled by {factor:g}.".lstrip(),
        )

    def replace(self, **changes: Any) -> Geometry:
        """A copy with some attributes changed; `lengths` and `assembly` may be partial mappings."""
        for name in ("lengths", "assembly"):
            if name in changes:
                changes[name] = {**getattr(self, name), **changes[name]}
        return replace(self, **changes)


def _numbers(what: str, given: Any) -> dict[str, Any]:
    """The numbers, or lists of them, of a dataclass or mapping by name, as JSON can hold them."""
    found = asdict(given) if is_dataclass(given) and not isinstance(given, type) else given
    if not isinstance(found, Mapping):
        raise ParameterError(f"{what}: expected numbers by name, got {given!r}")
    return {
        name: [check_number(f"{what}[{name!r}][{k}]", part) for k, part in enumerate(value)]
        if isinstance(value, (list, tuple))
        else check_number(f"{what}[{name!r}]", value)
        for name, value in found.items()
    }


def _check_keys(what: str, given: Any, expected: Sequence[str], optional: Sequence[str] = ()) -> None:
    if not isinstance(given, Mapping):
        raise ParameterError(f"{what}: expected a mapping with {', '.join(expected)}, got {given!r}")
    missing, unknown = set(expected) - set(given), set(given) - {*expected, *optional}
    if missing or unknown:
        parts = [f"missing {', '.join(sorted(missing))}"] if missing else []
        parts += [f"unknown {', '.join(sorted(map(str, unknown)))}"] if unknown else []
        wanted = ", ".join(expected) + (f", and perhaps {', '.join(optional)}" if optional else "")
        raise ParameterError(f"{what}: expected exactly {wanted}; {'; '.join(parts)}")


def _check_entries(data: Any) -> None:
    has_default = {item.name: item.default is not MISSING for item in fields(Geometry)}
    required, optional = (
        [name for name, has in has_default.items() if has is kind] for kind in (False, True)
    )
    _check_keys("geometry", data, required, optional)


def _count(values: Any) -> int:
    return len(values) if isinstance(values, (Sequence, np.ndarray)) else 0


def _solve(geometry: Geometry, theta: NDArray[np.floating[Any]]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Points and, per dyad, (d, r1, r2) at crank angles `theta`; NaN past a dyad that does not close."""
    lengths = geometry.lengths
    z: dict[str, Any] = {"O": 0j * theta, "C": complex(*geometry.pivot) + 0j * theta}
    z["P"] = lengths["OP"] * np.exp(-1j * theta)
    spans = {}
    with np.errstate(invalid="ignore", divide="ignore"):
        for step in CONSTRUCTION:
            a, b = z[step.first], z[step.second]
            if isinstance(step, Dyad):
                r1, r2 = lengths[step.from_first], lengths[step.from_second]
                d2 = np.abs(b - a) ** 2
                u = (r1**2 - r2**2 + d2) / (2 * d2)
                w = geometry.assembly[step.point] * np.sqrt(r1**2 / d2 - u**2)
                z[step.point] = a + (b - a) * (u + 1j * w)
                spans[step.point] = (np.sqrt(d2), r1, r2)
            else:
                z[step.point] = z[step.origin] + (b - a) * (lengths[step.distance] / lengths[step.span])
    return z, spans


def check_full_revolution(geometry: Geometry) -> None:
    """Raise `GeometryError` unless every dyad closes at every crank angle.

    The distance between a dyad's centres must stay strictly between the difference and the sum of its two
    lengths. A grid of 3600 angles is refined three times around the tightest one.
    """
    grid = np.arange(3600) * (2 * np.pi / 3600)
    for index, dyad in enumerate(DYADS):
        theta = grid
        for _ in range(4):
            _, spans = _solve(geometry, theta)
            d, r1, r2 = spans[dyad.point]
            margins = np.stack([r1 + r2 - d, d - abs(r1 - r2)])
            which, where = np.unravel_index(np.argmin(margins), margins.shape)
            miss, angle = -margins[which, where], float(theta[where])
            if not miss < 0:  # or not a number: an earlier dyad misses between two samples
                break
            theta = angle + np.linspace(-1, 1, 201) * (theta[1] - theta[0])
        if not miss < 0:
            reach = "too far apart by" if which == 0 else "too close by"
            raise GeometryError(
                f"dyad {index + 1} ({dyad.first}-{dyad.point}-{dyad.second}, lengths {r1:.6g} and {r2:.6g} m)"
                f" does not close at crank angle {np.degrees(angle) % 360:.2f} deg: its centres, "
                f"{float(d[where]):.6g} m apart, are {reach} {miss:.3g} m; "
                "expected a leg that turns through a full revolution"
            )


def preset_names() -> list[str]:
    """Names accepted by `load_geometry`."""
    files = resources.files("hoof_env").joinpath("data").iterdir()
    return sorted(f.name.removesuffix(".json") for f in files if f.name.endswith(".json"))


def preset_label(preset: Preset) -> str:
    """Return the name of a preset in an error."""
    return "preset" if isinstance(preset, Mapping) else f"preset {preset}"


def preset_error_type(preset: Preset) -> type[ParameterError] | type[DataFileError]:
    """Return the type of an error in a preset: of an argument, or of a file."""
    return ParameterError if isinstance(preset, Mapping) else DataFileError


def read_preset(source: Preset) -> dict[str, Any]:
    """The content of a preset by name, or of a file by path (ends in .json); content comes back as it is."""
    data = source if isinstance(source, Mapping) else _read_file(source)
    if unknown := sorted(str(name) for name in data if name not in PARTS):
        said = f"unknown entries {', '.join(unknown)}; expected some of {', '.join(PARTS)}"
        raise preset_error_type(source)(f"{preset_label(source)}: {said}")
    return dict(data)


def _read_file(source: str | Path) -> dict[str, Any]:
    if isinstance(source, Path) or str(source).endswith(".json"):
        path: Any = Path(source)
    else:
        check_choice("preset", source, preset_names())
        path = resources.files("hoof_env").joinpath("data", f"{source}.json")
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataFileError(f"cannot read {path}: {error.strerror or error}") from None
    except (ValueError, RecursionError) as error:
        raise DataFileError(f"{path}: expected a JSON preset file, but it does not parse: {error}") from None
    if not isinstance(data, dict):
        got = type(data).__name__
        raise DataFileError(f"{path}: expected a JSON object with 'geometry' and 'gaits', got {got}")
    return data


def load_geometry(source: Preset = DEFAULT_PRESET) -> Geometry:
    """The geometry of a preset by name, of a file by path, or of such a file's content.

    Raises:
        ParameterError: unknown preset name, a value out of range, or content that lacks a part.
        DataFileError: the file is unreadable, lacks a part or has unknown entries.
        GeometryError: the leg cannot turn.
    """
    data, from_where = read_preset(source), "a text that says where the numbers come from"
    for part, kind, what in (("provenance", str, from_where), ("geometry", Mapping, "an object")):
        if not isinstance(data.get(part), kind):
            got = f"got {data[part]!r:.60}" if part in data else f"found {', '.join(data) or 'nothing'}"
            raise preset_error_type(source)(
                f"{preset_label(source)}: expected an entry {part!r} beside the others, {what}; {got}"
            )
    values = {"provenance": data["provenance"], **data["geometry"]}
    if not isinstance(source, Mapping):
        values = {"name": str(source), **values}
    try:
        _check_entries(values)
    except ParameterError as error:
        raise preset_error_type(source)(f"{preset_label(source)}: {error}") from None
    return Geometry(**values)


def tables(geometry: Geometry) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The construction of this leg as arrays for the kernels.

    Returns:
        steps: shape (8, 5), rows (is_dyad, point, first, second, origin) as indices into `linkage.POINTS`.
        values: shape (8, 3), rows (r1, r2, side) for a dyad, (distance / span, 0, 0) for an extension.
    """
    lengths = geometry.lengths
    steps, values = [], []
    for step in CONSTRUCTION:
        if isinstance(step, Dyad):
            origin, side = step.first, float(geometry.assembly[step.point])
            values.append((lengths[step.from_first], lengths[step.from_second], side))
        else:
            origin = step.origin
            values.append((lengths[step.distance] / lengths[step.span], 0.0, 0.0))
        points = [NUMBER[name] for name in (step.point, step.first, step.second, origin)]
        steps.append((isinstance(step, Dyad), *points))
    return np.array(steps, dtype=np.int64), np.array(values)
