"""Settings of environments: default, type, meaning, and the settings on which the effect of each depends."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Annotated, Any, get_type_hints

from hoof_env.tasks.body_settings import GIVEN, About, BodySettings, Range

PRINTED_BETA = math.sqrt(2 * 15.0)
"""Baumgarte's beta as the paper's Table 1 prints it, sqrt(2 alpha) [1/s]; sqrt(2) alpha = 21.2 is probably
meant."""

SOLVERS = ("exact", "paper")  # the closed form, and Eq. 8 as the paper solves it


@dataclass(frozen=True, kw_only=True)
class TaskSettings(BodySettings):
    """Settings of what is asked and how it is simulated, each with its default and its `About`."""

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
                "of a horse: length over that of one of $horse_mass kg, $smallest_size to $largest_size; "
                "None for 1"
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
                'of a horse\'s commands: "quick", with which its cranks follow a stance, or "slow", those of '
                "one leg; None for quick"
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


@dataclass(frozen=True, kw_only=True)
class Settings(TaskSettings):
    """Settings of an environment, plain values that JSON can hold, each with its default and its `About`.

    The types are those that callers may pass: the fields are keyword arguments of the environments, too, see
    `envs.arguments`.
    """

    # Curricula
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
            needs=("trunk", ("suspended", "rail", "free")),
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
            needs=("trunk", ("suspended", "rail", "free")),
        ),
    ] = None
    strength: Annotated[
        float, About("-", "factor of noise, bias and pushes, 0 to 10; a reset option, too")
    ] = 1.0

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
