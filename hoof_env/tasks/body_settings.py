"""Settings of what moves and of the ground under it, the first part of `settings.Settings`, and the
description that each setting carries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

from hoof_env.ground.terrain import Terrain
from hoof_env.leg.presets import DEFAULT_PRESET, Preset

Range = float | Sequence[float]
"""Lowest and highest value, or one number for both."""

GIVEN = ("given",)
"""Stand-in for all values of a setting but None, in `About.needs`."""


class About(NamedTuple):
    """Description of a setting.

    Attributes:
        unit: unit of the value, "" for none.
        text: meaning, for the manual; $names stand for numbers and choices, see `envs.manual_words`.
        of_horse: meaning for a horse, if it differs.
        per_episode: True if `reset(options={"parameters": ...})` and `randomize` can change the setting.
        needs: another setting, and the values of it with which this one has an effect; () for any range,
            `GIVEN` for all but None.
        span: values that a slider offers; None for a setting without one.
    """

    unit: str
    text: str
    of_horse: str = ""
    per_episode: bool = False
    needs: tuple[str, tuple[str, ...]] | None = None
    span: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class BodySettings:
    """Settings of leg, trunk, ground and hoof, each with its default and its `About`."""

    # Leg and gait, trunk
    preset: Annotated[
        Preset,
        About(
            "",
            (
                "leg and gaits: $presets, or [your own](../own_task.md#a-leg-of-your-own): a mapping or a "
                "JSON file"
            ),
            of_horse=(
                "the legs' linkage, with the paper's mechanism: $horse_presets, or [your "
                "own](../own_task.md#a-leg-of-your-own): a mapping or a JSON file"
            ),
        ),
    ] = DEFAULT_PRESET
    gait: Annotated[
        str | None,
        About(
            "",
            "gait of the preset that episodes start in; None for one between walk and run",
            of_horse=(
                "gait from which actions are offsets at any commanded speed: $horse_gaits; None for the "
                "reference gait of that speed"
            ),
        ),
    ] = None
    trunk: Annotated[str, About("", "$trunks; a fixed one stays where it is")] = "suspended"
    hip_height: Annotated[
        float | None,
        About(
            "m",
            (
                "nominal height of O, the crank centre, $lowest to $highest times the geometry's own; None"
                " for that"
            ),
        ),
    ] = None
    trunk_mass: Annotated[
        float,
        About(
            "kg",
            "of the trunk on this leg",
            of_horse="of the trunk without the limbs",
            per_episode=True,
            span=(10.0, 200.0),
        ),
    ] = 50.0
    trunk_share: Annotated[
        float,
        About(
            "-",
            "part of the weight of trunk and leg that the leg must bear; suspended",
            per_episode=True,
            needs=("trunk", ("suspended",)),
            span=(0.1, 1.0),
        ),
    ] = 0.8
    trunk_stiffness: Annotated[
        float,
        About(
            "N/m",
            "of the suspension's spring; suspended",
            per_episode=True,
            needs=("trunk", ("suspended",)),
        ),
    ] = 12000.0
    trunk_damping: Annotated[
        float,
        About(
            "N s/m",
            "of the suspension's damper; suspended",
            per_episode=True,
            needs=("trunk", ("suspended",)),
        ),
    ] = 1590.0
    trunk_drag: Annotated[
        float,
        About(
            "N s/m",
            "resistance to forward motion",
            per_episode=True,
            needs=("trunk", ("suspended", "rail")),
        ),
    ] = 20.0
    # Ground and hoof
    stiffness: Annotated[
        float | None,
        About(
            "N/m^n",
            "K of the contact law (Eq. 14); None for the preset's",
            per_episode=True,
            span=(2e3, 1e6),
        ),
    ] = None
    exponent: Annotated[
        float | None,
        About("-", "n of the contact law, 1 to 3 in steps of 1/8; None for the preset's", span=(1.0, 3.0)),
    ] = None
    normal_law: Annotated[str, About("", "$normal_laws")] = "lankarani-nikravesh"
    restitution: Annotated[
        float,
        About("-", "nominal coefficient of restitution, 0 to 1", per_episode=True, span=(0.0, 1.0)),
    ] = 0.5
    approach_floor: Annotated[
        float,
        About(
            "m/s",
            "smallest approach speed in the damping term",
            per_episode=True,
        ),
    ] = 0.1
    friction_law: Annotated[
        str,
        About(
            "",
            "$friction_laws; of a rigid hoof",
        ),
    ] = "ambrosio"
    friction: Annotated[float, About("-", "mu_k", per_episode=True, span=(0.0, 1.2))] = 0.4
    friction_slow: Annotated[
        float,
        About(
            "m/s",
            "lower threshold of the friction law, of a rigid hoof",
            per_episode=True,
            needs=("friction_law", ("ambrosio",)),
        ),
    ] = 1e-3
    friction_fast: Annotated[
        float,
        About(
            "m/s",
            "upper threshold of the friction law, of a rigid hoof",
            per_episode=True,
        ),
    ] = 5e-2
    hoof_stiffness: Annotated[
        float | None,
        About(
            "N/m",
            (
                "of a spring at each hoof point, along the ground's normal and tangent, which makes friction "
                "Coulomb's, without thresholds; None for a rigid hoof"
            ),
        ),
    ] = None
    hoof_damping: Annotated[
        float | None,
        About(
            "N s/m",
            "of its damper; None for a tenth of the critical one under the trunk; needs `hoof_stiffness`",
            of_horse=(
                "of its damper; None for a tenth of the critical one under a fourth of $horse_mass kg; "
                "needs `hoof_stiffness`"
            ),
        ),
    ] = None
    terrain: Annotated[
        Terrain | Mapping[str, Any] | None,
        About(
            "",
            (
                'None for level ground, {"kind": "slope", "angle": rad}, {"kind": "hills", ...} as in '
                "[HorseLegTerrain](HorseLegTerrain.md#terrain), a `Terrain`, or what its `to_dict` returns; "
                "a suspended trunk and a rail keep their height, so ground that drifts from y = 0 is refused"
            ),
        ),
    ] = None
