"""Settings of environments: default, type, meaning, and the other settings with which each has an effect."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple, get_type_hints

from hoof_env.leg.geometry import DEFAULT_PRESET, Preset

PRINTED_BETA = math.sqrt(2 * 15.0)
"""Baumgarte's beta as the paper's Table 1 prints it, sqrt(2 alpha) [1/s]; sqrt(2) alpha = 21.2 is probably
meant."""

Range = float | Sequence[float]
"""Lowest and highest value, or one number for both."""

SOLVERS = ("exact", "paper")  # the closed form, and Eq. 8 as the paper solves it


class About(NamedTuple):
    """Description of a setting.

    Attributes:
        unit: unit of the value, "" for none.
        text: meaning, for the manual; $names stand for numbers and choices, see `envs.manual_words`.
        of_horse: meaning for a horse, if it differs.
        per_episode: True if `reset(options={"parameters": ...})` and `randomize` can change the setting.
        needs: another setting, and the values of it with which this one has an effect; () for any range.
        span: values that a slider offers; None for a setting without one.
    """

    unit: str
    text: str
    of_horse: str = ""
    per_episode: bool = False
    needs: tuple[str, tuple[str, ...]] | None = None
    span: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of an environment, plain values that JSON can hold, each with its default and its `About`.

    The types are those that callers may pass: the fields are keyword arguments of the environments, too, see
    `envs.arguments`.
    """

    # Leg and gait, trunk
    preset: Annotated[
        Preset,
        About(
            "",
            (
                "leg and gaits: $presets, or [one's own](../own_task.md#a-leg-of-your-own): a mapping or a "
                "JSON file"
            ),
            of_horse=(
                "the legs' linkage: $presets, or [one's own](../own_task.md#a-leg-of-your-own): a mapping "
                "or a JSON file"
            ),
        ),
    ] = DEFAULT_PRESET
    gait: Annotated[
        str | None,
        About(
            "",
            "gait of the preset that episodes start in; None for one between walk and run",
            of_horse=(
                "gait from which actions make offsets whatever speed is commanded: $horse_gaits; None for "
                "the reference gait of the commanded speed"
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
            "of the trunk that goes with this leg",
            of_horse="of the trunk without the limbs; at `size` 1",
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
            of_horse="smallest approach speed in the damping term; at `size` 1",
            per_episode=True,
        ),
    ] = 0.1
    friction_law: Annotated[
        str,
        About(
            "",
            "$friction_laws",
            of_horse="$friction_laws; of a rigid hoof",
        ),
    ] = "ambrosio"
    friction: Annotated[float, About("-", "mu_k", per_episode=True, span=(0.0, 1.2))] = 0.4
    friction_slow: Annotated[
        float,
        About(
            "m/s",
            "lower threshold of the friction law",
            of_horse="lower threshold of the friction law; of a rigid hoof, at `size` 1",
            per_episode=True,
            needs=("friction_law", ("ambrosio",)),
        ),
    ] = 1e-3
    friction_fast: Annotated[
        float,
        About(
            "m/s",
            "upper threshold of the friction law",
            of_horse="upper threshold of the friction law; of a rigid hoof, at `size` 1",
            per_episode=True,
        ),
    ] = 5e-2
    hoof_stiffness: Annotated[
        float | None,
        About(
            "N/m",
            (
                "of a spring at each hoof point, along the ground's normal and tangent; with one friction is "
                "Coulomb's, without thresholds; None for a rigid hoof"
            ),
            of_horse=(
                "of a spring at each hoof point, along the ground's normal and tangent, at `size` 1; with "
                "one friction is Coulomb's, without thresholds; None for a rigid hoof"
            ),
        ),
    ] = None
    hoof_damping: Annotated[
        float | None,
        About(
            "N s/m",
            "of its damper; None for a tenth of the critical one under the trunk; needs `hoof_stiffness`",
            of_horse=(
                "of its damper, at `size` 1; None for a tenth of the critical one under a fourth of "
                "$horse_mass kg; needs `hoof_stiffness`"
            ),
        ),
    ] = None
    terrain: Annotated[
        Mapping[str, Any] | None,
        About(
            "",
            (
                'None for level ground, {"kind": "slope", "angle": rad}, {"kind": "hills", ...} as in '
                "[HorseLegTerrain](HorseLegTerrain.md#terrain), or what `Terrain.to_dict` gives; ground that "
                "drifts from y = 0 is refused under a suspended trunk and a rail, which keep their height"
            ),
        ),
    ] = None
    # Actions and drive
    crank_rate: Annotated[
        float,
        About(
            "rad/s^2",
            (
                "rate of the crank's speed at an action of 1; above 0, to $crank_bound; for the published"
                " leg, and by similarity as 1 over the hip height"
            ),
            needs=("trunk", ("suspended", "rail", "fixed")),
        ),
    ] = 18.0
    swing_rate: Annotated[
        float,
        About(
            "rad/s",
            (
                "rate of the swing's coefficients at an action of 1; above 0, to $swing_bound; for the "
                "published leg, and by similarity as 1 over the root of the hip height"
            ),
            needs=("trunk", ("suspended", "rail", "fixed")),
        ),
    ] = 1.2
    drive: Annotated[
        str,
        About(
            "",
            '"prescribed": the crank follows its command; "motor": a servo that the ground can slow',
        ),
    ] = "prescribed"
    motor_gain: Annotated[
        float,
        About(
            "N m s/rad",
            "torque of the motor per difference of crank speed",
            of_horse="torque of the motor per difference of crank speed; at `size` 1",
            per_episode=True,
            needs=("drive", ("motor",)),
            span=(10.0, 500.0),
        ),
    ] = 100.0
    motor_torque: Annotated[
        float,
        About(
            "N m",
            "largest torque of the motor, at the crank",
            of_horse="largest torque of the motor, at the crank; at `size` 1",
            per_episode=True,
            needs=("drive", ("motor",)),
            span=(50.0, 2000.0),
        ),
    ] = 600.0
    motor_inertia: Annotated[
        float,
        About(
            "kg m^2",
            "of its rotor, at the crank",
            of_horse="of its rotor, at the crank; at `size` 1",
            needs=("drive", ("motor",)),
            span=(0.05, 5.0),
        ),
    ] = 0.5
    # Solver and time steps
    solver: Annotated[
        str,
        About(
            "",
            (
                '"exact": the closed form; "paper": Eq. 8 as the paper solves it, on a fixed trunk over level'
                " ground, with a prescribed drive and nothing drawn"
            ),
        ),
    ] = "exact"
    baumgarte_alpha: Annotated[
        float,
        About(
            "1/s",
            "alpha of the paper's solver",
            needs=("solver", ("paper",)),
        ),
    ] = 15.0
    baumgarte_beta: Annotated[
        float,
        About(
            "1/s",
            "beta of the paper's solver; by default as printed, sqrt(2 * 15)",
            needs=("solver", ("paper",)),
        ),
    ] = PRINTED_BETA
    integrator: Annotated[
        str | None,
        About(
            "",
            "$schemes; of the paper's solver $paper_schemes; None for midpoint, and for the paper's Euler",
            of_horse="$schemes; None for midpoint",
        ),
    ] = "midpoint"
    sim_dt: Annotated[
        float | None,
        About(
            "s",
            (
                "substep; it is divided where ground, suspension or motor need shorter ones; None for the "
                "solver's own, 1e-4 or the paper's 1e-3"
            ),
            of_horse="substep; it is divided where ground or motor need shorter ones; None for 1e-4",
        ),
    ] = 1e-3
    dt: Annotated[float, About("s", "control step, a whole multiple of `sim_dt`")] = 0.02
    episode_seconds: Annotated[float, About("s", "time limit of an episode")] = 10.0
    # Command
    target_speed: Annotated[
        Range | None,
        About(
            "m/s",
            (
                "lowest and highest commanded speed, up to which progress is paid; one that never changes "
                "where both are the same; None for no command"
            ),
            of_horse=(
                "lowest and highest commanded speed; one that never changes where both are the same; None "
                "for the default times the root of `size`"
            ),
            span=(0.5, 5.0),
        ),
    ] = (2.5, 2.5)
    target_seconds: Annotated[
        Range,
        About(
            "s",
            "shortest and longest time for which a command holds",
            needs=("target_speed", ()),
        ),
    ] = (2.0, 4.0)
    # A horse only
    size: Annotated[
        float | None,
        About(
            "-",
            (
                "of a horse over one of 475 kg, by geometric similarity: lengths go with it, masses with its "
                "cube, hoof stiffness with its square; None for 1"
            ),
            of_horse=(
                "length over that of a horse of $horse_mass kg, $smallest_size to $largest_size; None for 1"
            ),
            needs=("trunk", ("free",)),
        ),
    ] = None
    harmonics: Annotated[
        int | None,
        About(
            "-",
            "of a horse's swing, 1 or 2; None for 2",
            of_horse="of the swing, 1 or 2; None for 2",
            needs=("trunk", ("free",)),
        ),
    ] = None
    filters: Annotated[
        str | None,
        About(
            "",
            (
                'of a horse\'s commands: "quick", with which its cranks follow a stance, or "slow", as of '
                "one leg; None for quick"
            ),
            of_horse=(
                'of the commands: "quick", with which cranks follow a stance, or "slow", as of one leg; '
                "None for quick"
            ),
            needs=("trunk", ("free",)),
        ),
    ] = None
    # Observation, reward, and variation
    observation: Annotated[Sequence[str], About("", "groups to observe, in this order")] = (
        "crank",
        "gait",
        "trunk",
        "hoof",
    )
    reward_weights: Annotated[
        Mapping[str, float] | None, About("", "mapping of the weights that are to differ from those above")
    ] = None
    randomize: Annotated[
        Mapping[str, Range] | None,
        About(
            "", "physical parameters to draw at each reset, as the reset option `parameters`; None for none"
        ),
    ] = None

    def __deepcopy__(self, memo: Any) -> Settings:
        """Return the settings themselves, which never change."""
        return self


@dataclass(frozen=True, kw_only=True)
class ResolvedSettings(Settings):
    """Settings after `parameters.resolved`, which replaces None in these."""

    stiffness: float
    exponent: float
    integrator: str
    sim_dt: float


SETTINGS = tuple(item.name for item in fields(Settings))

ABOUT: Mapping[str, About] = MappingProxyType(
    {name: hint.__metadata__[0] for name, hint in get_type_hints(Settings, include_extras=True).items()}
)
"""Descriptions of the settings, by name."""

PER_EPISODE = tuple(name for name, about in ABOUT.items() if about.per_episode)
"""Settings that `reset(options={"parameters": ...})` and `randomize` can change for an episode."""

NEEDED: Mapping[str, tuple[str, tuple[str, ...]]] = MappingProxyType(
    {name: about.needs for name, about in ABOUT.items() if about.needs}
)
"""Settings that have an effect only with certain values of another one; () stands for any range."""
