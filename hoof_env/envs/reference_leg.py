"""A leg on the engine that identification and the paper's reproduction use: what `HorseLegFixed-v0` is made of.

The other environments are `horse_leg`'s, on the faster engine; its manual page explains the terms used here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from hoof_env.dynamics.engine import GRAVITY, LegEngine
from hoof_env.dynamics.result import Result
from hoof_env.dynamics.trace import new_trace
from hoof_env.dynamics.trunk import ONE_LEG, Trunk
from hoof_env.envs import reward
from hoof_env.envs.reference_observation import HALF_RANGE, MIDDLE, layout, observe
from hoof_env.envs.reference_start import HIGHEST, LOWEST, Start, check_options, draw_start
from hoof_env.envs.stance import LIFT_OFF, new_account, summarize, take_account
from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.gait.motion_law import FilterSettings
from hoof_env.gait.parameters import GaitParameters, gait_names, load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry

RENDER_MODES = ("human", "rgb_array")


class ReferenceLegEnv(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A horse's leg that must carry and move its trunk.

    ## Description

    The leg is the closed-loop linkage of Batbaatar & Wagatsuma (2021): 14 links turned by one crank, with a
    hoof triangle that meets a viscoelastic ground at toe and heel (Eqs. 10-15). A second drive swings the
    leg's frame about the crank centre by phi = offset + sine coefficient * sin(theta) + cosine coefficient
    * cos(theta). The policy commands crank speed and swing parameters; filters with bounded rate and
    acceleration turn commands into motion. The trunk moves by what friction gives it and feels every link
    swing. Lengths are *identified* from the paper's results, not published.

    `trunk="suspended"` (default): the trunk moves along x and y. The leg must bear `trunk_share` of the
    weight of trunk and leg; a constant force carries the rest, a vertical spring and damper stands for the
    animal's other legs. `"rail"`: it slides at fixed height. `"fixed"`: it stays; progress is then the
    load-weighted backward travel of the hoof points while they bear load.

    ## Action space

    `Box(-1, 1, (4,), float32)`, clipped to these limits; every 0.02 s by default.

    | Num | Command | At -1 | At +1 | Unit |
    |---|---|---|---|---|
    | 0 | crank speed | 0 | 12.566 (4 pi) | rad/s |
    | 1 | swing offset | 0 | 1.4 | rad |
    | 2 | swing sine coefficient | -0.8 | 0.4 | rad |
    | 3 | swing cosine coefficient | -0.8 | 0.2 | rad |

    ## Observation space

    `Box(-1, 1, (24,), float32)` on a suspended trunk; a rail lacks rows 11-12 and a fixed trunk 10-12.

    | Num | Observation | Scaling | Unit before scaling |
    |---|---|---|---|
    | 0 | sin(crank angle) | none | - |
    | 1 | cos(crank angle) | none | - |
    | 2 | crank speed | as action 0 | rad/s |
    | 3 | swing offset | as action 1 | rad |
    | 4 | swing sine coefficient | as action 2 | rad |
    | 5 | swing cosine coefficient | as action 3 | rad |
    | 6 | rate of crank speed | / 20 | rad/s^2 |
    | 7 | rate of swing offset | / 6 | rad/s |
    | 8 | rate of swing sine coefficient | / 6 | rad/s |
    | 9 | rate of swing cosine coefficient | / 6 | rad/s |
    | 10 | forward speed | tanh(x / 5) | m/s |
    | 11 | vertical speed | tanh(x / 2) | m/s |
    | 12 | height | tanh((x - hip height) / 0.3) | m |
    | 13 | toe contact | 0 or 1 | - |
    | 14 | heel contact | 0 or 1 | - |
    | 15 | toe load | tanh(x / 3 weights) | N |
    | 16 | heel load | tanh(x / 3 weights) | N |
    | 17 | toe approach speed | tanh(x / 2) | m/s |
    | 18 | heel approach speed | tanh(x / 2) | m/s |
    | 19 | running peak force | tanh(x / 3 weights) | N |
    | 20 | previous action: crank speed | none | - |
    | 21 | previous action: swing offset | none | - |
    | 22 | previous action: swing sine coefficient | none | - |
    | 23 | previous action: swing cosine coefficient | none | - |

    A weight is that of trunk and leg. Loads are those of the last substep.

    ## Rewards

    The sum of five terms, each in `info` under its name; `reward_weights` is a mapping with any of the
    weights.

    | Term | Weight | Meaning |
    |---|---|---|
    | `reward_progress` | `progress` = 1 per m | forward travel of the trunk |
    | `reward_peak` | `peak` = 0.3 per kN | minus the increase of the stance's running peak GRF, the maximum over all substeps; the terms of one stance add up to its peak |
    | `reward_energy` | `energy` = 0.1 per kJ | minus the positive work of crank and swing drive; braking power is not recovered |
    | `reward_action` | `action` = 0.03 | minus the mean squared change of the action |
    | `reward_failure` | `failure` = 30 per s | once, minus this times `episode_seconds`, when the episode fails |

    A stance opens when the normal force on the hoof rises above 5 % of the weight, as on a force plate. It
    closes when the force falls below (lift-off), or after one crank revolution, whichever comes first.

    ## Starting state

    Crank angle uniform; gait parameters on the line between the preset's walk and run, at rest in the
    filters; speed uniform in 0 to 1 m/s; the trunk at its nominal height, or as much higher as the hoof
    needs to be above the ground (on a rail or fixed trunk the crank angle is drawn until it is).
    `reset(options=...)` sets any of `gait` (name, mapping or `GaitParameters`), `crank_angle` [rad],
    `speed` [m/s], `height` [m]; `info` tells what was used.

    ## Episode end

    Terminated when the trunk leaves 0.6 to 2 times its nominal height, or the simulation stops being finite
    (`info["failure"]` says which). Truncated after `episode_seconds`. The last `info` has
    `episode_summary`, see `envs.stance.summarize`.

    ## Arguments

    | Name | Default | Unit | Meaning |
    |---|---|---|---|
    | `preset` | "first_fit" | | leg and gaits: a preset's name or a JSON file |
    | `trunk` | "suspended" | | "suspended", "rail" or "fixed" |
    | `hip_height` | None | m | nominal height of the crank centre; None for the geometry's own, 1.718 |
    | `trunk_mass` | 80 | kg | trunk mass that goes with this leg |
    | `trunk_share` | 0.8 | - | part of the weight that the leg must bear |
    | `trunk_stiffness`, `trunk_damping` | 4000, 1130 | N/m, N s/m | vertical suspension |
    | `trunk_drag` | 20 | N s/m | resistance to forward motion |
    | `stiffness`, `exponent` | 2e4, 1.5 | N/m^n, - | K and n of the contact law |
    | `normal_law` | "lankarani-nikravesh" | | also "hunt-crossley", "flores", "gonthier", "hu-guo", "exact", "kelvin-voigt" |
    | `restitution` | 0.5 | - | nominal coefficient of restitution |
    | `approach_floor` | 0.1 | m/s | smallest approach speed in the damping term |
    | `friction_law` | "ambrosio" | | also "threlfall", "tanh" |
    | `friction`, `friction_slow`, `friction_fast` | 0.4, 1e-3, 5e-2 | -, m/s, m/s | mu_k and threshold speeds |
    | `sim_dt`, `dt` | 1e-3, 0.02 | s | substep and control step; `dt` is a whole multiple |
    | `episode_seconds` | 10 | s | time limit |
    | `reward_weights` | None | | changes to the weights above |
    | `render_mode` | None | | "rgb_array" or "human" |

    Raises `ParameterError` (a `ValueError`) for a bad argument, option or action.

    ## Version history

    * v0: first version.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": list(RENDER_MODES), "render_fps": 50}  # type: ignore[misc]

    def __init__(
        self,
        *,
        preset: str = "first_fit",
        trunk: str = "suspended",
        hip_height: float | None = None,
        trunk_mass: float = 80.0,
        trunk_share: float = 0.8,
        trunk_stiffness: float = 4000.0,
        trunk_damping: float = 1130.0,
        trunk_drag: float = 20.0,
        stiffness: float = 2e4,
        exponent: float = 1.5,
        normal_law: str = "lankarani-nikravesh",
        restitution: float = 0.5,
        approach_floor: float = 0.1,
        friction_law: str = "ambrosio",
        friction: float = 0.4,
        friction_slow: float = 1e-3,
        friction_fast: float = 5e-2,
        sim_dt: float = 1e-3,
        dt: float = 0.02,
        episode_seconds: float = 10.0,
        reward_weights: Mapping[str, float] | None = None,
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None:
            check_choice("render_mode", render_mode, RENDER_MODES)
        check_choice("trunk", trunk, ONE_LEG)
        self.preset, self.geometry = preset, load_geometry(preset)
        self.gaits = {name: load_gait(name, preset) for name in gait_names(preset)}
        self.weights = reward.RewardWeights.of(reward_weights)
        self.substeps = _substeps(dt, sim_dt)
        self.sim_dt, self.dt = sim_dt, sim_dt * self.substeps
        self.episode_seconds = check_number(
            "episode_seconds", episode_seconds, low=self.dt * (1 - 1e-9), high=LONGEST_EPISODE
        )
        self._steps_per_episode = round(episode_seconds / self.dt)
        nominal = self.geometry.hip_height
        height = nominal if hip_height is None else hip_height
        check_number("hip_height", height, low=LOWEST * nominal, high=HIGHEST * nominal)
        self.filters = FilterSettings()
        self.engine = self._build_engine(
            Trunk(trunk, trunk_mass, trunk_share, trunk_stiffness, trunk_damping, trunk_drag, height),
            Ground(
                stiffness, exponent, normal_law, restitution, approach_floor, "interpolated",
                friction_law, friction, friction_slow, friction_fast, trunk_mass,
            ),
        )  # fmt: skip
        self.weight = (trunk_mass + self.geometry.mass) * GRAVITY
        self._rate_bounds = self.filters.to_array()[:, 1]

        self.observation_names = layout(trunk)
        self.observation_space = spaces.Box(-1.0, 1.0, (len(self.observation_names),), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (4,), np.float32)
        self.render_mode = render_mode
        self.metadata = {**type(self).metadata, "render_fps": round(1 / self.dt)}  # type: ignore[misc]
        self._renderer: Any = None
        self._action: NDArray[np.float32] = np.zeros(4, np.float32)
        self._account = new_account(LIFT_OFF * self.weight)
        self._step_count = 0
        self._started = False
        self.trace = new_trace(1)

    def _build_engine(self, trunk: Trunk, ground: Ground) -> Any:
        return LegEngine(self.geometry, trunk, ground, self.sim_dt, self.filters)

    def command_of(self, action: NDArray[np.float32]) -> NDArray[np.float64]:
        """Gait parameters that an action commands, shape (4,); the action is clipped to [-1, 1]."""
        return MIDDLE + HALF_RANGE * np.clip(action.astype(np.float64), -1.0, 1.0)

    def action_for(self, gait: GaitParameters) -> NDArray[np.float32]:
        """The action that commands the given gait, to float32 precision."""
        return np.clip((gait.to_array() - MIDDLE) / HALF_RANGE, -1, 1).astype(np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode; see 'Starting state' in the class docstring for the options."""
        super().reset(seed=seed)
        start = self._start(check_options(options, self.gaits))
        self.trace = self.engine.reset(
            start.gait, theta=start.crank_angle, height=start.height, speed=start.speed
        )
        self._action = self.action_for(start.gait)
        self._account = new_account(LIFT_OFF * self.weight)
        self._step_count, self._started = 0, True
        if self.render_mode is not None:
            self._get_renderer().reset()
            self._renderer.add(self.trace)
            if self.render_mode == "human":
                self.render()
        return self._observe(), {**start._asdict(), "gait": asdict(start.gait)}

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Command the gait parameters for `dt`; see the class docstring."""
        if not self._started:
            raise ResetNeeded("step() was called before reset(): expected reset() first")
        previous, self._action = self._action, self._check_action(action)
        result = self._advance()
        failed = result is not Result.OK or self._fallen()
        terms = self._reward_terms(previous, failed)
        self._step_count += 1
        truncated = not failed and self._step_count >= self._steps_per_episode
        info: dict[str, Any] = dict(terms)
        if failed or truncated:
            info["episode_summary"] = summarize(self._account, self.weight, failed)
        if failed:
            info["failure"] = (
                result.message if result is not Result.OK else "the trunk left its range of heights"
            )
        if self.render_mode is not None:
            self._get_renderer().add(self.trace)
            if self.render_mode == "human":
                self.render()
        return self._observe(), sum(terms.values()), failed, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the present state: an (H, W, 3) uint8 array for "rgb_array", a window for "human"."""
        if self.render_mode is None:
            gym.logger.warn(
                "render() was called without a render_mode: pass render_mode='rgb_array' or 'human'"
            )
            return None
        frame: NDArray[np.uint8] | None = self._get_renderer().frame()
        return frame

    def close(self) -> None:
        """Close the window, if any."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def __getstate__(self) -> dict[str, Any]:
        """Copies and pickles leave the window behind; it belongs to this process and this environment."""
        return {**self.__dict__, "_renderer": None}

    def _check_action(self, action: Any) -> NDArray[np.float32]:
        try:
            given = np.asarray(action)
            array = given.astype(np.float32) if given.dtype.kind in "fiu" else np.empty(0, np.float32)
        except ValueError:
            array = np.empty(0, np.float32)
        if array.shape != (4,) or not np.isfinite(array).all():
            raise ParameterError(f"action: expected 4 finite numbers in [-1, 1], got {action!r}")
        return np.clip(array, -1.0, 1.0)

    def _advance(self) -> Result:
        start_x = float(self.trace[-1]["trunk_x"])
        trace = new_trace(self.substeps)
        result: Result = self.engine.advance(self.command_of(self._action), trace)
        if result is Result.OK:
            self.trace = trace
            take_account(self._account, trace, self.sim_dt, start_x, self.engine.trunk.kind == "fixed")
        else:  # the state is the last good one: what led to it is not paid twice
            for name in ("peak_increase", "work", "progress"):
                self._account[name] = 0.0
        return result

    def _fallen(self) -> bool:
        height = self.engine.trunk.height
        return not LOWEST * height < self.trace[-1]["trunk_y"] < HIGHEST * height

    def _reward_terms(self, previous: NDArray[np.float32], failed: bool) -> dict[str, float]:
        weights, account = self.weights, self._account
        return {
            "reward_progress": reward.progress(weights, account),
            "reward_peak": reward.peak(weights, account),
            "reward_energy": reward.energy(weights, account),
            "reward_action": reward.action_change(weights, self._action, previous),
            "reward_failure": reward.failure(weights, failed, self.episode_seconds),
        }

    def _observe(self) -> NDArray[np.float32]:
        trunk = self.engine.trunk
        return observe(
            self.trace[-1],
            self.engine.state.filters,
            self._rate_bounds,
            trunk.kind,
            trunk.height,
            self.weight,
            float(self._account["peak"]),
            self._action,
        )

    def _start(self, options: dict[str, Any]) -> Start:
        return draw_start(options, self.np_random, self.geometry, self.engine.trunk, self.gaits)

    def _get_renderer(self) -> Any:
        if self._renderer is None:
            from hoof_env.envs.rendering import Renderer

            weight = self.weight if self.engine.trunk.kind == "suspended" else None
            self._renderer = Renderer(
                self.geometry,
                str(self.render_mode),
                self.metadata["render_fps"],
                weight_n=weight,
                lift_off_n=LIFT_OFF * self.weight,
            )
        return self._renderer


LONGEST_EPISODE, MOST_SUBSTEPS = 1e6, 100_000
"""Seconds of an episode and substeps of a control step at most."""


def _substeps(dt: float, sim_dt: float) -> int:
    check_number("sim_dt", sim_dt, low=0, exclusive_low=True)
    check_number("dt", dt, low=0, exclusive_low=True)
    ratio = dt / sim_dt
    if not 0.5 < ratio <= MOST_SUBSTEPS or abs(ratio - round(ratio)) > 1e-6:
        raise ParameterError(
            f"dt: expected a whole multiple of sim_dt = {sim_dt:g} s, got {dt:g} s "
            f"(ratio {ratio:g}; at most {MOST_SUBSTEPS})"
        )
    return round(ratio)
