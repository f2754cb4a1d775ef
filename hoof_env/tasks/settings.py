"""Settings of environments: default, type and meaning of each, the settings with which it has an effect, and
conversion to plain values of Python and JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from enum import Enum
from pathlib import PurePath
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np

from hoof_env.errors import ParameterError, brief
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.presets import DEFAULT_PRESET, Preset

PRINTED_BETA = math.sqrt(2 * 15.0)
"""Baumgarte's beta as the paper's Table 1 prints it, sqrt(2 alpha) [1/s]; sqrt(2) alpha = 21.2 is probably
meant."""

SOLVERS = ("exact", "paper")  # the closed form, and Eq. 8 as the paper solves it


Range = float | Sequence[float]
"""Lowest and highest value, or one number for both."""

GIVEN = ("given",)
"""Placeholder in `About.needs` for any value except None."""


class About(NamedTuple):
    """Description of a setting.

    Attributes:
        unit: unit of the value; "" if it has no unit.
        text: meaning, for the manual; $names stand for numbers and choices; see `envs.manual.choices`.
        of_horse: meaning for a horse, if it differs.
        per_episode: True if `reset(options={"parameters": ...})` and `randomize` can change the setting.
        needs: another setting and its values with which this one has an effect; () for any range, `GIVEN` for
            any value except None.
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

    Types are what callers may pass: the fields are keyword arguments of the environments, too, see
    `envs.arguments`.
    """

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
    trunk: Annotated[
        str,
        About(
            "",
            "$trunks; a fixed one stays where it is; on a boom the leg bears the whole weight, and under a"
            " floating trunk, which pitches, too",
        ),
    ] = "suspended"
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
            needs=("trunk", ("suspended", "boom", "floating", "rail")),
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
    hoof_length: Annotated[
        float,
        About(
            "m",
            "of that spring at rest, from the leg's hoof point down to the sole; with 0 the hoof point sinks"
            " into the ground as the spring yields",
            needs=("hoof_stiffness", GIVEN),
        ),
    ] = 0.0
    terrain: Annotated[
        Terrain | Mapping[str, Any] | None,
        About(
            "",
            (
                'None for level ground, {"kind": "slope", "angle": rad}, {"kind": "hills", ...} or '
                '{"kind": "ditches", ...} as in '
                "[HorseLegTerrain](HorseLegTerrain.md#terrain), a `Terrain`, or what its `to_dict` returns; "
                "a suspended trunk and a rail keep their height, and a boom limits it, so ground "
                "that drifts from y = 0 is refused"
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
                " leg, and by similarity in inverse proportion to the hip height"
            ),
            needs=("trunk", ("suspended", "boom", "floating", "rail", "fixed")),
        ),
    ] = 18.0
    swing_rate: Annotated[
        float,
        About(
            "rad/s",
            (
                "rate of the swing's coefficients at an action of 1; above 0, to $swing_bound; for the "
                "published leg, and by similarity in inverse proportion to the root of the hip height"
            ),
            needs=("trunk", ("suspended", "boom", "floating", "rail", "fixed")),
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
                "substep, divided where ground, suspension or motor need shorter ones; None for the solver's "
                "own, 1e-4 or the paper's 1e-3"
            ),
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
                "lowest and highest commanded speed, up to which progress is rewarded; it never changes "
                "where both are the same; None for no command"
            ),
            of_horse=(
                "lowest and highest commanded speed; it never changes where both are the same; None for the "
                "default times the root of `size`"
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
                "of a horse: length relative to a horse of $horse_mass kg, $smallest_size to "
                "$largest_size; None for 1"
            ),
            needs=("trunk", ("free",)),
        ),
    ] = None
    harmonics: Annotated[
        int | None,
        About(
            "-",
            "of a horse's swing, 1 or 2; None for 2",
            needs=("trunk", ("free",)),
        ),
    ] = None
    filters: Annotated[
        str | None,
        About(
            "",
            (
                'of a horse\'s commands: "quick", with which its cranks follow a stance, or "slow", as on '
                "one leg; None for quick"
            ),
            needs=("trunk", ("free",)),
        ),
    ] = None
    footfall: Annotated[
        str | None,
        About(
            "",
            (
                'of a horse: "fixed" has the first action of each leg scale the speed of its crank, "free" '
                "has it shift the leg's phase by up to a quarter of a stride; None for fixed"
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
    force_threshold: Annotated[
        float,
        About(
            "N",
            (
                "load of toe or heel below which a sensor reads neither load nor contact; of their sum for "
                "the centre of pressure"
            ),
        ),
    ] = 0.0
    reward_weights: Annotated[
        Mapping[str, float] | None, About("", "mapping of weights that differ from the defaults")
    ] = None
    constants: Annotated[
        Mapping[str, float] | None,
        About("", "values of [constants](../own_task.md#constants) of terms and entries, by name"),
    ] = None
    randomize: Annotated[
        Mapping[str, Range] | None,
        About("", "physical parameters to draw at each reset, in the form of the reset option `parameters`"),
    ] = None

    # Curricula
    context_set: Annotated[
        str | None,
        About(
            "",
            (
                "SPLIT/SET, a set of [contexts](../contexts.md) of which each episode draws one: splits "
                "ground, body, all; sets train, interpolation, extrapolation"
            ),
        ),
    ] = None
    context_visible: Annotated[
        bool, About("", "True adds the group `context`, which shows the context, to the observation")
    ] = False
    schedule: Annotated[
        Mapping[str, Sequence[Any]] | None,
        About(
            "control steps",
            "[first, last, steps between] by setting ([curricula](../own_task.md#curricula))",
        ),
    ] = None

    # Disturbances
    noise: Annotated[
        Mapping[str, float] | None,
        About(
            "-",
            "largest error in each step, by group, before a number saturates",
        ),
    ] = None
    bias: Annotated[
        Mapping[str, float] | None,
        About("-", "likewise, for an episode"),
    ] = None
    push_impulse: Annotated[
        Range | None,
        About(
            "N s",
            "range of random pushes forward",
            needs=("trunk", ("suspended", "boom", "floating", "rail", "free")),
        ),
    ] = None
    push_seconds: Annotated[
        Range,
        About("s", "time between pushes", needs=("push_impulse", GIVEN)),
    ] = (2.0, 4.0)
    pushes: Annotated[
        Sequence[Sequence[float]] | None,
        About(
            "s, N s",
            "given ones: time, forward, upward",
            needs=("trunk", ("suspended", "boom", "floating", "rail", "free")),
        ),
    ] = None
    strength: Annotated[
        float, About("-", "factor of noise, bias and pushes, 0 to 10; a reset option, too")
    ] = 1.0

    # Costs
    cost: Annotated[
        Mapping[str, float] | None,
        About(
            "N, N/s, -",
            (
                "limits of the costs `peak`, `excess`, `indicator` [N], `loading` [N/s] and `leaning` [-] in "
                "infos, which are no part of the reward"
            ),
            of_horse=(
                "limits of the costs `peak`, `excess`, `indicator` [N] and `loading` [N/s] in infos, which "
                "are no part of the reward"
            ),
        ),
    ] = None

    # Delays, and the observed past
    observation_delay: Annotated[
        Range,
        About(
            "control steps",
            "number, or two to draw between",
        ),
    ] = 0.0
    action_delay: Annotated[
        Range,
        About("control steps", "likewise"),
    ] = 0.0
    observation_history: Annotated[int, About("-", "observations that are seen, newest first")] = 1
    last_actions: Annotated[int, About("-", "actions that follow, newest first")] = 0
    privileged: Annotated[
        Sequence[str],
        About("", "groups whose true numbers stand last"),
    ] = ()

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
"""Settings that have an effect only with certain values of another setting; () for any range, `GIVEN` for any
value except None."""


def check_effect(name: str, settings: Settings, within: str = "") -> None:
    """Check that a setting has an effect under the remaining settings.

    Args:
        name: name of the setting.
        settings: all settings, this one included.
        within: argument or option that contains the setting, for the message; "" if it is passed directly.

    Raises:
        ParameterError: the setting has no effect.
    """
    # Not in `NEEDED`, which has lists of values: here any number disables the laws that the settings are for.
    if name in ("friction_law", "friction_slow", "friction_fast") and settings.hoof_stiffness is not None:
        named = f"{within}: {name!r}" if within else name
        raise ParameterError(
            f"{named}: expected none with a hoof_stiffness, whose friction needs no sliding speed, got "
            f"hoof_stiffness={settings.hoof_stiffness!r}"
        )
    needed, values = NEEDED.get(name, ("", ()))
    present: Any = getattr(settings, needed, None)
    if needed and not _has_effect(present, values):
        good = " or ".join(f"{needed}={value!r}" for value in values) or f"a range of {needed}"
        good = f"a {needed}" if values == GIVEN else good
        named = f"{within}: {name!r}" if within else name
        # The trunk is part of the task: the message cannot suggest another.
        if needed == "trunk" and "free" in (present, *values) and present != "fixed":
            body = "a horse" if present == "free" else "one leg"
            raise ParameterError(f"{named}: expected none for {body}, where it has no effect")
        raise ParameterError(
            f"{named}: expected {good}, without which it has no effect, got {needed}={present!r}"
        )


def _has_effect(present: Any, values: tuple[str, ...]) -> bool:
    """Return whether a setting has one of the values in `About.needs`."""
    if values == GIVEN:
        return present is not None
    return present in values if values else not _is_one(present)


def _is_one(value: Any) -> bool:
    """Return whether a value is single: a number, None, or a range with equal ends."""
    ends = tuple(value) if isinstance(value, Iterable) else (value, value)
    return len(ends) == 2 and bool(ends[0] == ends[1])


def to_json(settings: Settings) -> dict[str, Any]:
    """Return the settings as values that JSON can hold, by name."""
    return {key: json_value(value) for key, value in asdict(settings).items()}


def as_plain(name: str, value: Any) -> Any:
    """Convert a value to plain Python: numbers of NumPy and pandas to numbers, arrays and other sequences to
    lists, paths to text, enumerations to their value, a terrain to its mapping. Other objects are returned
    unchanged.

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
        # Python has no numbers of more than double precision.
        doubles = {"f": np.float64, "c": np.complex128}.get(value.dtype.kind)
        return as_plain(name, (value if doubles is None else value.astype(doubles)).tolist())
    if isinstance(value, Enum):
        return as_plain(name, value.value)
    if isinstance(value, PurePath):
        return str(value)
    if isinstance(value, Terrain):
        return value.to_dict()
    if isinstance(value, Mapping):
        return {str(key): as_plain(f"{name}[{key!r}]", inner) for key, inner in value.items()}
    # Any sequence, such as the lists of a configuration library.
    if isinstance(value, Sequence) and not isinstance(value, (str, bytes)):
        plain = (as_plain(f"{name}[{k}]", inner) for k, inner in enumerate(value))
        return tuple(plain) if isinstance(value, tuple) else list(plain)
    # JSON and pickles must not depend on other libraries' subclasses.
    if isinstance(value, (int, float, str)):
        return next(kind(value) for kind in (int, float, str) if isinstance(value, kind))
    if hasattr(type(value), "__float__"):
        raise ParameterError(
            f"{name}: expected a number of Python or NumPy, which JSON can hold, got {brief(value)}"
        )
    return value  # the setting's check raises the error


def json_value(value: Any) -> Any:
    """Convert tuples to lists at every depth, which is the form in which JSON returns them."""
    if isinstance(value, (list, tuple)):
        return [json_value(inner) for inner in value]
    if isinstance(value, Mapping):
        return {key: json_value(inner) for key, inner in value.items()}
    return value
