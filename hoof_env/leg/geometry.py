"""Geometry of a leg: its lengths, pivot, assembly and masses, and its place in the world.

A `Geometry` is a frozen value; building one checks it. `leg.presets` reads its files.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hoof_env._output import staged
from hoof_env.errors import ParameterError, brief, check_choice, check_number, flag
from hoof_env.leg.checks import (
    check_feet,
    check_keys,
    check_length,
    check_names,
    check_signs,
    check_texts,
    checked_masses,
    checked_path,
    checked_pivot,
    numbers_of,
    plain_solids,
    read_structure,
    scaled_solids,
    with_solids,
)
from hoof_env.leg.kinematics import FrameMotion, Pose, pose
from hoof_env.leg.mechanism import Mechanism
from hoof_env.leg.mechanism_list import PAPER
from hoof_env.leg.mobility import check_motion
from hoof_env.leg.presets import DEFAULT_PRESET, Preset, preset_error_type, preset_label, read_preset

if TYPE_CHECKING:
    from hoof_env.leg.mjcf import GroundLike, MotorLike, TrunkLike

LINEAR_DENSITY = 1.0
"""Default mass per length of a link [kg/m]. The paper prints no masses. One kilogram a metre gives the
leg of `HorseLeg-v0` 7.6 kg; on a fixed trunk masses change torques and reactions only, never motion or ground
force."""


@dataclass(frozen=True)
class Geometry:
    """A leg in its own frame: the centre of the crank at the origin, the crank turning clockwise.

    Attributes:
        lengths: the lengths that the mechanism names [m].
        pivot: position of the fixed pivot relative to the crank's centre [m]; of several, by name.
        assembly: for each dyad's point, +1 if it lies left of the line between its two centres, else -1.
        toe, heel: names of the two feet; the heel of a leg with one foot is None.
        travel: +1 if the leg travels towards +x of its own frame, -1 if towards -x. The world's x always
            points forward; the mirror is applied where the leg is placed in the world and nowhere else.
        hip_height: height of O above the ground in the paper's set-up [m], one level for both gaits.
        linear_density: mass per length of every body [kg/m], unless `masses` is given.
        masses: the bodies' masses [kg], or None for `linear_density` times length.
        inertia: "uniform_rod" (J = m L^2 / 3 with half-length L) or "paper" (the printed J = 2 l / 3 with
            half-length l, in kg m^2 though its units do not match; it needs no mass).
        full_turn: whether the crank must be able to turn fully. If not, it may rock between dead points, and
            `TrunkEngine` alone takes such a leg.
        mechanism: the structure or its list; the paper's by default.
        solids: bodies that are not uniform rods, by name: "mass" [kg], "centre" along and across from the
            tail [m], "inertia" about it [kg m^2], by default a rod's; or as entries of the list's `bodies`.
        name, provenance: where the numbers come from.

    Raises:
        ParameterError: a value is missing, unknown, not finite or out of range.
        GeometryError: `full_turn`, and the linkage locks at some crank angle; or bodies leave its points.
    """

    lengths: Mapping[str, float]
    pivot: tuple[float, float] | Mapping[str, tuple[float, float]]
    assembly: Mapping[str, int]
    toe: str
    heel: str | None
    travel: int
    hip_height: float
    linear_density: float = LINEAR_DENSITY
    masses: tuple[float, ...] | None = None
    inertia: str = "uniform_rod"
    full_turn: bool = True
    name: str = "custom"
    provenance: str = field(default="", compare=False)
    mechanism: Mechanism = PAPER
    solids: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        mechanism, solids = read_structure(self.mechanism, self.solids)
        object.__setattr__(self, "mechanism", mechanism)
        check_keys("lengths", self.lengths, mechanism.lengths)
        given = ((name, self.lengths[name]) for name in mechanism.lengths)
        lengths = {name: check_length(mechanism, name, x) for name, x in given}
        points = [dyad.point for dyad in mechanism.dyads]
        check_keys("assembly", self.assembly, points)
        check_signs({f"assembly[{p!r}]": self.assembly[p] for p in points} | {"travel": self.travel})
        check_feet(self.toe, self.heel, self.mechanism.feet)
        check_texts({"name": self.name, "provenance": self.provenance})
        object.__setattr__(self, "travel", int(self.travel))
        for name in ("hip_height", "linear_density"):
            object.__setattr__(self, name, check_number(name, getattr(self, name), low=0, exclusive_low=True))
        check_choice("inertia", self.inertia, ("uniform_rod", "paper"))
        if self.masses is not None:
            object.__setattr__(self, "masses", checked_masses(self.masses, len(self.mechanism.bodies)))
        object.__setattr__(self, "lengths", MappingProxyType(lengths))
        object.__setattr__(self, "pivot", checked_pivot(self.pivot, mechanism.pivots))
        object.__setattr__(self, "assembly", MappingProxyType({p: int(self.assembly[p]) for p in points}))
        object.__setattr__(self, "solids", MappingProxyType(solids))
        object.__setattr__(self, "full_turn", flag("full_turn", self.full_turn))
        check_motion(self)

    def __hash__(self) -> int:
        lengths = tuple(self.lengths.items())
        return hash((lengths, tuple(self.fixed.items()), tuple(self.assembly.items()), self.name))

    def __reduce__(self) -> tuple[Any, ...]:  # mapping proxies do not pickle
        return (Geometry.from_dict, (self.to_dict(),))

    @property
    def fixed(self) -> dict[str, complex]:
        """Places of the fixed points by name [m], as x + iy: the crank's centre at 0, then the pivots."""
        pivots = self.mechanism.pivots
        places = self.pivot if isinstance(self.pivot, Mapping) else {pivots[0]: self.pivot}
        return {self.mechanism.centre: 0j} | {name: complex(*places[name]) for name in pivots}

    @property
    def corners(self) -> tuple[str, str]:
        """Names of toe and heel; the toe's twice if it is the only foot."""
        return self.toe, self.heel or self.toe

    @property
    def crank_length(self) -> float:
        """Length of the crank [m]."""
        return float(self.lengths[self.mechanism.crank_length])

    @property
    def body_lengths(self) -> NDArray[np.float64]:
        """Length of each body [m], shape (bodies,)."""
        return np.array([self.lengths[name] for name in self.mechanism.body_lengths])

    @property
    def body_masses(self) -> NDArray[np.float64]:
        """Mass of each body [kg], shape (bodies,)."""
        masses = self.linear_density * self.body_lengths if self.masses is None else np.array(self.masses)
        return with_solids(masses, "mass", self.solids, self.mechanism)

    @property
    def body_centres(self) -> NDArray[np.complex128]:
        """Centre of mass of each body from its tail, along + i across, in its length [-], shape (bodies,)."""
        centres = np.full(len(self.mechanism.bodies), 0.5 + 0j)
        for i, body in enumerate(self.mechanism.bodies):
            if "centre" in self.solids.get(body.name, {}):
                centres[i] = complex(*self.solids[body.name]["centre"]) / self.lengths[body.length]
        return centres

    @property
    def body_inertias(self) -> NDArray[np.float64]:
        """Moment of inertia of each body about its centre of mass [kg m^2], shape (bodies,)."""
        half = self.body_lengths / 2
        rods = 2 * half / 3 if self.inertia == "paper" else self.body_masses * half**2 / 3
        return with_solids(rods, "inertia", self.solids, self.mechanism)

    @property
    def mass(self) -> float:
        """Mass of the whole leg [kg]."""
        return float(self.body_masses.sum())

    def pose(
        self,
        theta: float,
        swing: float = 0.0,
        theta_rate: float = 0.0,
        swing_rate: float = 0.0,
        theta_acc: float = 0.0,
        swing_acc: float = 0.0,
    ) -> Pose:
        """Return places, angles, velocities and accelerations of all points and bodies, with O at rest at 0.

        `points` of the result has shape (points, 2), with rows in the order of `mechanism.points`, and
        `point(name)` is one of them.

        Args:
            theta, theta_rate, theta_acc: crank angle from the leg's frame, clockwise in that frame before the
                mirror of `travel` [rad, rad/s, rad/s^2].
            swing, swing_rate, swing_acc: turn of the leg's frame about O, likewise before the mirror.

        Raises:
            ParameterError: a number is not finite.
        """
        return pose(self, theta, theta_rate, theta_acc, FrameMotion(swing, swing_rate, swing_acc))

    def to_mjcf(
        self,
        path: str | Path | None = None,
        *,
        theta: float = 0.0,
        swing: float = 0.0,
        trunk: TrunkLike | None = None,
        motor: MotorLike | None = None,
        ground: GroundLike | None = None,
        timestep: float = 1e-3,
    ) -> str:
        """Return this leg as a model of MuJoCo and write it, if there is a path; see `hoof_env.leg.mjcf`.

        Args:
            path: of the file, which ends in .xml.
            theta, swing: crank angle and swing of the pose in which the model begins [rad]; the commands of
                the keyframe "pose" hold it.
            trunk: a `Trunk` that carries the leg, at its height; without one, O is held at `hip_height`.
            motor: a `Motor` that drives the crank; without one, the crank turns freely.
            ground: a `Ground`, of which only the friction is used; no ground if None.
            timestep: of the simulation [s]; a small leg of much less mass per length needs a shorter one.

        Raises:
            ParameterError: an invalid number, type or suffix, or no leg at this `theta`.
            OutputError: the file cannot be written.
        """
        from hoof_env.leg.mjcf import leg_to_mjcf

        return leg_to_mjcf(self, path, (theta, swing), trunk, motor, ground, timestep)

    def to_dict(self) -> dict[str, Any]:
        """Everything that `from_dict` needs, JSON-serialisable."""
        content = {item.name: getattr(self, item.name) for item in fields(self)}
        content |= {name: dict(content[name]) for name in ("lengths", "assembly")}
        content |= {"pivot": list(self.pivot), "masses": None if self.masses is None else list(self.masses)}
        if isinstance(self.pivot, Mapping):
            content["pivot"] = {name: list(place) for name, place in self.pivot.items()}
        # defaults and the paper's mechanism are left out
        if content.pop("full_turn") is False:
            content["full_turn"] = False
        listed = content.pop("mechanism").to_mapping()
        # mechanisms that differ only in their bodies' roles are equal, but not their lists
        if listed != PAPER.to_mapping():
            content["mechanism"] = listed
        if content.pop("solids"):
            content["solids"] = plain_solids(self.solids)
        return content

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
            ParameterError: another suffix, or gaits or a ground that are not mappings of names to numbers.
            OutputError: the file cannot be written.
        """
        _write_preset(self, path, gaits, ground)

    def scaled(self, factor: float, mass_per_metre: float | None = None) -> Geometry:
        """A similar leg: lengths, pivot and hip height times `factor`, angles and gaits as before.

        Mass per length stays, so masses scale with `factor`, first moments with its square and the inertias
        of uniform rods with its cube; inertias of `inertia="paper"` do not depend on mass and scale with
        `factor`. Bodies of one density have masses that scale with `factor` cubed: give `mass_per_metre` for
        these.

        Args:
            factor: of every length [-].
            mass_per_metre: of every link [kg/m]; in place of `linear_density` and `masses`.

        Returns:
            The leg, by the same name; `provenance` has the factor.

        Raises:
            ParameterError: a number is not finite or not above 0, or a length leaves the limits of the class.
        """
        return _scaled(self, factor, mass_per_metre)

    def replace(self, **changes: Any) -> Geometry:
        """A copy with some attributes changed; `lengths` and `assembly` may be partial mappings."""
        for name in ("lengths", "assembly"):
            # other types are left to the checks of the class
            if isinstance(changes.get(name), Mapping):
                changes[name] = {**getattr(self, name), **changes[name]}
        return replace(self, **changes)


def _preset_content(
    geometry: Geometry, gaits: Mapping[str, Any] | None, ground: Mapping[str, float] | None
) -> dict[str, Any]:
    shape = geometry.to_dict()
    content: dict[str, Any] = {"provenance": shape.pop("provenance")}
    content |= {"units": "m, kg, kg/m, rad, rad/s", "geometry": shape}
    if ground is not None:
        check_keys("ground", ground, (), ("stiffness", "exponent"))
        content["ground"] = {
            name: check_number(f"ground[{name!r}]", value, low=0, exclusive_low=True)
            for name, value in ground.items()
        }
    if gaits is not None:
        if not isinstance(gaits, Mapping):
            raise ParameterError(f"gaits: expected a mapping of names to gaits, got {brief(gaits)}")
        check_names("gaits", gaits)
        content["gaits"] = {name: numbers_of(f"gaits[{name!r}]", gait) for name, gait in gaits.items()}
    return content


def _write_preset(
    geometry: Geometry,
    given_path: str | Path,
    gaits: Mapping[str, Any] | None,
    ground: Mapping[str, float] | None,
) -> None:
    """Write the file of `Geometry.save`."""
    path = checked_path(given_path, ".json")
    content = _preset_content(geometry, gaits, ground)
    with staged(path.parent) as stage:
        (stage / path.name).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def _scaled(geometry: Geometry, factor: float, mass_per_metre: float | None) -> Geometry:
    """Return the leg of `Geometry.scaled`."""
    factor = check_number("factor", factor, low=0, exclusive_low=True)
    masses, density = geometry.masses, geometry.linear_density
    if mass_per_metre is not None:
        masses = None
        density = check_number("mass_per_metre", mass_per_metre, low=0, exclusive_low=True)
    changed: Any = 1.0 if mass_per_metre is None else density * geometry.body_lengths / geometry.body_masses
    return replace(
        geometry,
        lengths={name: factor * length for name, length in geometry.lengths.items()},
        pivot={name: (factor * at.real, factor * at.imag) for name, at in list(geometry.fixed.items())[1:]},
        hip_height=factor * geometry.hip_height,
        linear_density=density,
        masses=None if masses is None else tuple(factor * mass for mass in masses),
        solids=scaled_solids(geometry.solids, factor, factor * changed, geometry.mechanism),
        provenance=f"{geometry.provenance} Scaled by {factor:g}.".lstrip(),
    )


def _check_entries(data: Any) -> None:
    defaults = {item.name: (item.default, item.default_factory) for item in fields(Geometry)}
    has_default = {name: given != (MISSING, MISSING) for name, given in defaults.items()}
    required, optional = (
        [name for name, has in has_default.items() if has is kind] for kind in (False, True)
    )
    check_keys("geometry", data, required, optional)


def load_geometry(source: Preset = DEFAULT_PRESET) -> Geometry:
    """Return the geometry of a preset by name, of a file by path, or of such a file's content.

    Raises:
        ParameterError: unknown preset name, a value out of range, or content that lacks a part.
        DataFileError: the file is unreadable, lacks a part or has unknown entries.
        GeometryError: the leg cannot turn.
    """
    data, from_where = read_preset(source), "a string that says where the numbers come from"
    for part, kind, what in (("provenance", str, from_where), ("geometry", Mapping, "an object")):
        if not isinstance(data.get(part), kind):
            got = f"got {data[part]!r:.60}" if part in data else f"found {', '.join(data) or 'nothing'}"
            raise preset_error_type(source)(
                f"{preset_label(source)}: expected an entry {part!r} besides the others, {what}; {got}"
            )
    values = {"provenance": data["provenance"], **data["geometry"]}
    if not isinstance(source, Mapping):
        values = {"name": str(source), **values}
    try:
        _check_entries(values)
    except ParameterError as error:
        raise preset_error_type(source)(f"{preset_label(source)}: {error}") from None
    try:
        return Geometry(**values)
    except ParameterError as error:
        raise type(error)(f"{preset_label(source)}: {error}") from None
