"""Body of all ids except `Horse-v0`: a trunk that one leg carries or pulls; see `horse` for the horse."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import ONE_LEG, Limb, Limits, Trunk
from hoof_env.errors import ParameterError, brief, check_choice, check_number
from hoof_env.gait import (
    INNER,
    PARAMETERS,
    FilterSettings,
    GaitParameters,
    HarmonicGait,
    gait_names,
    limits_of,
    load_gait,
    paper_gaits,
    speed_scale_of,
)
from hoof_env.ground.contact import Ground, load_ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.presets import preset_error_type, preset_label
from hoof_env.leg.profile import leg_profile
from hoof_env.record.surroundings import ONE_HIP, Hips
from hoof_env.simd import Mask, Pointer, Whole, maximum, minimum, read
from hoof_env.simd.math import clip
from hoof_env.tasks.body import BodyKernels
from hoof_env.tasks.episode import ACTIONS, Episode
from hoof_env.tasks.leg_starts import (
    MAX_HEIGHT,
    MIN_HEIGHT,
    OPTIONS,
    RISING,
    Start,
    check_options,
    draw_starts,
    is_free_height,
    startable_share,
)
from hoof_env.tasks.parameters import check_range, drive_of, ground_of, hoof_spring
from hoof_env.tasks.settings import ResolvedSettings, Settings

Floats = NDArray[np.float64]

GYRATION = 0.5 / 1.4
"""Radius of gyration of a trunk that pitches, about O, relative to the height of O [-]: a horse's, see
`horse.GYRATION` and `horse.HIP_HEIGHT`."""

PITCH = 0.5
"""Pitch beyond which a trunk that pitches has fallen, forward and back [rad]: a horse's, `horse.PITCH`."""

CARRIED = 5 / 6
"""Part of a change that continues under a zero action [-]. With 0 a rate would end with its action, and rates
would jump in every step; with 1 a change would never end."""


def lead_of(filters: FilterSettings, dt: float) -> float:
    """Return the time by which the command of a zero action is ahead of a changing gait [s]: a part of the
    lag of the filters behind a command that moves at a steady rate, in control steps of `dt` [s]."""
    return CARRIED * (1 / filters.gain + dt / 2)


def check_rates(s: Settings, speed_scale: float = 1.0) -> Floats:
    """Return the rates at which an action of 1 changes the gait, shape (4,) [rad/s^2, rad/s, rad/s, rad/s].

    Args:
        s: settings; their rates are for the size of the published leg.
        speed_scale: see `gait.speed_scale_of`.

    Raises:
        ParameterError: a rate is not above 0, or beyond the bound of the filters.
    """
    filters = FilterSettings()
    crank = check_number("crank_rate", s.crank_rate, low=0, high=filters.crank_rate, exclusive_low=True)
    swing = check_number("swing_rate", s.swing_rate, low=0, high=filters.swing_rate, exclusive_low=True)
    # By similarity, with lengths as the square of `speed_scale`: times are proportional to `speed_scale`.
    swing = swing / speed_scale
    return np.array([crank / speed_scale**2, swing, swing, swing])


def reach_per_rate(filters: FilterSettings, dt: float, substep: float) -> float:
    """Return the distance of a command from `heading_now` per rate of the gait [s]: the rate at which the
    gait changes if the command keeps that distance in every control step.

    While a command is held, its distance d from the gait and the gait's rate v change in a substep h by

        d -= h v + h^2/2 a,    v += h a,    a = INNER gain (gain d - v),

    which has two modes, v = m d, in which a substep multiplies both by l. A gait changes at the steady rate r
    if each mode loses in a control step what a command that moves by r dt adds to it,

        d_1 (1 - l_1^n) = r dt m_2 / (m_2 - m_1),    d_2 (1 - l_2^n) = r dt m_1 / (m_1 - m_2).

    Args:
        filters: filters of the commands.
        dt: control step [s].
        substep: substep of the filters [s].
    """
    gain = filters.gain
    follow = INNER * gain
    h = substep
    n = round(dt / substep)
    # The matrix of a substep for (d, v), by the equations above.
    keeps_distance = 1 - 0.5 * h * h * follow * gain
    from_speed = -h + 0.5 * h * h * follow
    from_distance = h * follow * gain
    keeps_speed = 1 - h * follow
    # Its eigenvalues l, from trace and determinant, and the slopes m of its eigenvectors.
    middle = 0.5 * (keeps_distance + keeps_speed)
    product = keeps_distance * keeps_speed
    apart = math.sqrt(middle**2 - product + from_speed * from_distance)
    factors = middle + apart, middle - apart
    slopes = [from_distance / (factor - keeps_speed) for factor in factors]
    reach = 0.0
    lead = lead_of(filters, dt)
    for factor, slope, other in zip(factors, slopes, reversed(slopes), strict=True):
        distance = dt * other / (other - slope) / (1 - factor**n)
        # From the gait to where it is heading: less the lead times the rate of this mode.
        reach += distance * (1 - lead * slope)
    return reach


AT_REST = 1e-6
"""Differences from a gait that count as 0 [rad/s, rad]: observations are rounded to float32."""


def action_towards(gaits: Floats, heading: Floats, reach: Floats) -> NDArray[np.float32]:
    """Return actions that move towards gaits as fast as is allowed, and stop there; shape (..., 4).

    Args:
        gaits: gait parameters [rad/s, rad, rad, rad], shape (..., 4).
        heading: parameters towards which the gait is heading; see `heading_now`.
        reach: distance of the command of an action of 1 from there, shape (4,); see `OneLeg.reach`.
    """
    gap = gaits - heading
    gap = np.where(np.abs(gap) < AT_REST, 0.0, gap)
    return np.clip(gap / reach, -1.0, 1.0).astype(np.float32)


def heading_now(engine: TrunkEngine, dt: float) -> Floats:
    """Return the parameters towards which the gait of the first leg is heading, which a zero action commands;
    shape (num_envs, 4).

    `command_rates` computes them in the kernels, and `policies.heading_seen` from an observation."""
    state = engine.state
    gait, rate = (
        np.stack([state[name + suffix][0] for name in PARAMETERS], axis=-1) for suffix in ("", "_rate")
    )
    heading: Floats = gait + lead_of(engine.filters, dt) * rate
    return heading


def command_rates(
    task: Any, actions: Pointer, episode: Episode, leg: Any, parameters: int, n: Whole, scratch: Any
) -> None:
    """Command the rates that an action requests, relative to the gait's heading and within the limits;
    see `body.BodyKernels.command`."""
    for k in range(ACTIONS):
        action = clip(read(actions, n * ACTIONS + k, ACTIONS, leg.lanes), 1.0)
        heading = leg.state.gait[k] + task.lead * leg.state.gait_rate[k]
        command = heading + task.reach[k] * action
        leg.command[k] = minimum(maximum(command, task.low[k]), task.high[k])


def keep_gait(task: Any, episode: Episode, switched: Mask) -> None:
    """Do nothing: the gait of one leg does not depend on the commanded speed."""


LEG_KERNELS = BodyKernels(
    legs=1,
    episode=Episode,
    task_fields=(),
    scratch_size=1,
    command=command_rates,
    on_switch=keep_gait,
)

POLICIES = ("zero", "idle", "random", "bang-bang", "drag", "airborne")
"""Names of the scripted policies that are not a gait of the preset."""


class OneLeg:
    """One leg under a trunk; see `body.Body`.

    Attributes:
        speed_scale: speed relative to the published leg's; see `gait.speed_scale_of` [-].
        low, high, middle, half: limits of the gait parameters, their middle and half range, shape (4,)
            [rad/s, rad, rad, rad].
        rates: rates of the parameters at an action of 1, shape (4,) [rad/s^2, rad/s, rad/s, rad/s].
        gait: gait of all starts; None for one between walk and run.

    Raises:
        ParameterError: a setting is out of range.
        Exception: the preset's own type of error, if one of its gaits cannot be commanded.
    """

    kernels = LEG_KERNELS
    harmonics = 1
    limits: Limits | None = None
    action_names: tuple[str, ...] = tuple(f"rate_of_{name}" for name in PARAMETERS)
    action_form = "rates"
    policy_starts: Mapping[str, dict[str, Any]] = MappingProxyType({})
    renamed: Mapping[str, str] = MappingProxyType({})
    hips: Hips = ONE_HIP
    picture = "leg"
    step_error = 0.01
    command_step = math.inf
    start_names: tuple[str, ...] = ("crank_angle", "speed", "height", "x")
    gait_names: tuple[str, ...] = PARAMETERS

    def __init__(self, settings: Settings) -> None:
        s = settings
        check_choice("trunk", s.trunk, ONE_LEG)
        self.geometry = load_geometry(s.preset)
        load_ground(s.preset)  # a broken preset raises here, even if the settings replace its ground
        self.speed_scale = speed_scale_of(self.geometry)
        # Similar legs: times are proportional to the speed scale, so that filters slow down with it.
        self.filters = FilterSettings().sped_up(1 / self.speed_scale)
        self.low, self.high = np.array([*limits_of(self.geometry).values()]).T
        self.middle = (self.low + self.high) / 2
        self.half = (self.high - self.low) / 2
        self.gaits: Mapping[str, Any] = {name: load_gait(name, s.preset) for name in gait_names(s.preset)}
        for name, gait in self.gaits.items():
            if isinstance(gait, HarmonicGait):
                raise preset_error_type(s.preset)(
                    f"{preset_label(s.preset)}, gait {name!r}: expected the four parameters of one harmonic, "
                    f"which environments of one leg take, got {brief(gait)}"
                )
            self.check_reachable(
                f"{preset_label(s.preset)}, gait {name!r}", gait.to_array(), preset_error_type(s.preset)
            )
        self.gait = None if s.gait is None else self.gaits[check_choice("gait", s.gait, self.gaits)]
        self._spring = hoof_spring(s)
        self.limits = Limits((-PITCH, PITCH)) if s.trunk == "floating" else None
        self.rates = check_rates(s, self.speed_scale)
        self._length = self._spring.length if self._spring else 0.0
        nominal = self.geometry.hip_height + self._length
        height = nominal if s.hip_height is None else s.hip_height
        self.height = check_number("hip_height", height, low=MIN_HEIGHT * nominal, high=MAX_HEIGHT * nominal)

    def scale_of(self, name: str) -> float:
        """Return 1: settings are the values of this leg, see `Body.scale_of`."""
        return 1.0

    def parts(self, s: ResolvedSettings) -> tuple[Trunk, Ground, tuple[Limb, ...]]:
        """Make trunk, ground and legs from settings; see `Body.parts`."""
        trunk = Trunk(
            kind=s.trunk,
            mass=s.trunk_mass,
            share=s.trunk_share,
            stiffness=s.trunk_stiffness,
            damping=s.trunk_damping,
            drag=s.trunk_drag,
            height=self.height,
            pitch_inertia=s.trunk_mass * (GYRATION * self.geometry.hip_height) ** 2,
        )
        limb = Limb(self.geometry, drive=drive_of(s), spring=self._spring)
        return trunk, ground_of(s, s.trunk_mass), (limb,)

    def commanded_speeds(self, s: Settings) -> tuple[float, float] | None:
        """Return the lowest and highest commanded speed [m/s]; None without a command."""
        if s.target_speed is None:
            return None
        return check_range("target_speed", s.target_speed, *OPTIONS["target_speed"])

    def reach(self, engine: TrunkEngine, dt: float) -> Floats:
        """Return the distance of the command of an action of 1 from where the gait is heading, shape (4,)
        [rad/s, rad, rad, rad]."""
        return self.rates * reach_per_rate(self.filters, dt, engine.substep)

    def check_reachable(self, name: str, gaits: Floats, error: type[Exception] = ParameterError) -> None:
        """Check that gait parameters can be commanded: commands are clipped to the limits, and another gait
        would result silently.

        Args:
            name: name of the gait in messages.
            gaits: gait parameters, shape (..., 4).
            error: type of the error.

        Raises:
            error: a parameter is beyond the limits of the leg.
        """
        for k, parameter in enumerate(PARAMETERS):
            values = gaits[..., k]
            low = self.low[k]
            high = self.high[k]
            slack = 1e-9 * self.half[k]  # for the rounding of sums like middle + half
            if ((values < low - slack) | (values > high + slack)).any():
                beyond = float(values.flat[np.argmax(np.abs(values - self.middle[k]))])
                whose = f" of a leg of {self.geometry.hip_height:.4g} m" if parameter == "crank_speed" else ""
                raise error(
                    f"{name}: expected {parameter} from {low:.6g} to {high:.6g}{whose}, beyond which commands"
                    f" are clipped, got {beyond:.6g}"
                )

    def constants(self, engine: TrunkEngine, dt: float) -> dict[str, Any]:
        """Return the body's part of the task's record, for a control step of `dt` [s]."""
        return {
            "reach": self.reach(engine, dt),
            "lead": lead_of(self.filters, dt),
            "middle": self.middle,
            "half": self.half,
            "low": self.low,
            "high": self.high,
            "height": self.height,
            "lowest": MIN_HEIGHT * self.height,
            "highest": MAX_HEIGHT * self.height,
        }

    def check_options(self, options: Any, trunk: Trunk, settings: Settings) -> dict[str, Any]:
        """Check reset options; see `leg_starts.check_options`; a gait must be one that can be commanded."""
        checked = check_options(options, self.gaits, trunk, settings)
        if checked.get("gait") is not None:
            self.check_reachable("options['gait']", checked["gait"].to_array())
        return checked

    def startable_share(self, options: Mapping[str, Any], trunk: Trunk) -> float:
        """Return at what share of the crank angles an episode can start; see `Body.startable_share`."""
        if trunk.kind not in RISING or not is_free_height(options):
            return 1.0
        fixed = options.get("gait") or self.gait
        gaits = [fixed] if fixed else [*paper_gaits(self.gaits).values()]
        return startable_share(options, leg_profile(self.geometry), trunk, gaits, self._length)

    def draw(
        self, options: Mapping[str, Any], generators: Sequence[np.random.Generator], engine: TrunkEngine
    ) -> Start:
        """Draw starts of episodes; see `leg_starts.draw_starts`."""
        return draw_starts(
            options,
            generators,
            engine.profiles[0],
            engine.trunk,
            self.gaits,
            engine.terrain,
            self.gait,
            self._length,
        )

    def complete_start(self, start: Start, targets: Floats, options: Any, engine: TrunkEngine) -> None:
        """Do nothing: starts do not depend on the commanded speeds."""

    def begin_episodes(self, episode: Any, which: NDArray[np.int64], start: Start) -> None:
        """Do nothing: an episode of one leg has no further fields."""

    @property
    def policy_names(self) -> list[str]:
        """Names of the scripted policies: the gaits of the preset, then `POLICIES`."""
        return sorted(self.gaits) + list(POLICIES)

    def action_for(
        self, gaits: str | GaitParameters | Floats, engine: TrunkEngine, dt: float
    ) -> NDArray[np.float32]:
        """Return the actions that move towards gaits, shape (num_envs, 4); see `LegBase.action_for`.

        Raises:
            ParameterError: an unknown name, another shape, or a gait that cannot be commanded.
        """
        if isinstance(gaits, str):
            gaits = self.gaits[check_choice("gait", gaits, self.gaits)]
        try:
            values = gaits.to_array() if isinstance(gaits, GaitParameters) else np.asarray(gaits, np.float64)
        except (TypeError, ValueError):
            values = np.empty(0)
        if values.shape not in ((4,), (engine.num_envs, 4)) or not np.isfinite(values).all():
            raise ParameterError(
                f"gait: expected one of {', '.join(self.gaits)}, GaitParameters or an array of shape (4,) or "
                f"({engine.num_envs}, 4), got {brief(gaits)}"
            )
        self.check_reachable("gait", values)
        return action_towards(values, heading_now(engine, dt), self.reach(engine, dt))
