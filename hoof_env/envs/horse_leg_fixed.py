"""`hoof_env/HorseLegFixed-v0`: the paper's set-up, one gait on a fixed trunk for one second."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.constrained import ConstrainedLeg
from hoof_env.dynamics.integrators import INTEGRATORS
from hoof_env.dynamics.trunk import Trunk
from hoof_env.envs.reference_leg import ReferenceLegEnv
from hoof_env.envs.reference_observation import HALF_RANGE
from hoof_env.envs.reference_start import Start
from hoof_env.errors import check_choice, check_number
from hoof_env.gait.parameters import LIMITS, GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.ground.preset import load_ground
from hoof_env.leg.geometry import DEFAULT_PRESET

SOLVERS = ("exact", "paper")

PRINTED_BETA = math.sqrt(2 * 15.0)
"""Baumgarte's beta as the paper's Table 1 prints it, sqrt(2 alpha) [1/s]; sqrt(2) alpha = 21.2 is probably meant."""


class HorseLegFixedEnv(ReferenceLegEnv):
    """The paper's set-up: one gait on a fixed trunk, one crank revolution.

    ## Description

    The trunk is fixed and a policy commands offsets from the paper's walk or run; the zero action is
    exactly that gait, and reproduces the paper: `hoof-env reproduce` runs this environment.
    `solver="paper"` integrates Eq. 8 (42 coordinates, 42 multipliers, Baumgarte) with explicit Euler at 1
    ms and samples the approach speed at the first step inside the ground; `solver="exact"` follows the
    closed form at 0.1 ms and interpolates it.

    ## Action space

    `Box(-1, 1, (4,), float32)`: offsets from the gait in half ranges of the commands of
    `hoof_env/HorseLeg-v0`; the sum is clipped to the commands' limits.

    | Num | Offset of | At -1 | At +1 | Unit |
    |---|---|---|---|---|
    | 0 | crank speed | -6.283 | +6.283 | rad/s |
    | 1 | swing offset | -0.7 | +0.7 | rad |
    | 2 | swing sine coefficient | -0.6 | +0.6 | rad |
    | 3 | swing cosine coefficient | -0.5 | +0.5 | rad |

    ## Observation space

    `Box(-1, 1, (21,), float32)`: the entries of `hoof_env/HorseLeg-v0` without those of the trunk.

    ## Rewards

    As in `hoof_env/HorseLeg-v0`; progress is the load-weighted backward travel of the hoof points while
    they bear load.

    ## Starting state

    The gait at crank angle 0, always the same; `reset(options=...)` as in `hoof_env/HorseLeg-v0`.

    ## Episode end

    Truncated after `episode_seconds`, one crank revolution of the paper's gaits. Terminated if the
    simulation stops being finite.

    ## Arguments

    | Name | Default | Unit | Meaning |
    |---|---|---|---|
    | `gait` | "walk" | | "walk", "run" or another gait of the preset |
    | `solver` | "exact" | | "exact" or "paper" |
    | `preset` | "identified" | | leg, ground and gaits: a preset's name or a JSON file |
    | `stiffness`, `exponent` | None | N/m^n, - | K and n of Eq. 14; None for the preset's, or 2e4 and 1.5 |
    | `restitution` | 1 | - | 1 is the paper's elastic condition, 0 its inelastic one |
    | `approach_floor` | 1e-4 | m/s | smallest approach speed in Eq. 14: the walk grazes |
    | `friction_fast` | 1e-2 | m/s | upper threshold of Ambrosio's correction; assumed |
    | `integrator` | "euler" | | of `solver="paper"`: also "semi_implicit_euler", "midpoint", "rk4" |
    | `baumgarte_alpha`, `baumgarte_beta` | 15, 5.477 | 1/s | of `solver="paper"`; beta as printed, sqrt(2 alpha) |
    | `sim_dt` | None | s | None for the solver's own, 1e-3 or 1e-4 |
    | `episode_seconds` | 1 | s | time limit |

    `hip_height`, `normal_law`, `friction_law`, `friction`, `friction_slow`, `dt`,
    `reward_weights` and `render_mode` as in `hoof_env/HorseLeg-v0`.

    ## Version history

    * v0: first version.
    """

    def __init__(
        self,
        *,
        gait: str = "walk",
        solver: str = "exact",
        preset: str = DEFAULT_PRESET,
        hip_height: float | None = None,
        stiffness: float | None = None,
        exponent: float | None = None,
        normal_law: str = "lankarani-nikravesh",
        restitution: float = 1.0,
        approach_floor: float = 1e-4,
        friction_law: str = "ambrosio",
        friction: float = 0.4,
        friction_slow: float = 1e-3,
        friction_fast: float = 1e-2,
        integrator: str = "euler",
        baumgarte_alpha: float = 15.0,
        baumgarte_beta: float = PRINTED_BETA,
        sim_dt: float | None = None,
        dt: float = 0.02,
        episode_seconds: float = 1.0,
        reward_weights: dict[str, float] | None = None,
        render_mode: str | None = None,
    ) -> None:
        self.solver = check_choice("solver", solver, SOLVERS)
        self._scheme: dict[str, Any] = {
            "alpha": check_number("baumgarte_alpha", baumgarte_alpha, low=0),
            "beta": check_number("baumgarte_beta", baumgarte_beta, low=0),
            "integrator": check_choice("integrator", integrator, INTEGRATORS),
        }
        if sim_dt is None:
            sim_dt = 1e-3 if solver == "paper" else 1e-4
        ground = load_ground(preset, stiffness=stiffness, exponent=exponent)
        super().__init__(
            preset=preset, trunk="fixed", hip_height=hip_height,
            stiffness=ground.stiffness, exponent=ground.exponent, normal_law=normal_law, restitution=restitution, approach_floor=approach_floor, friction_law=friction_law,
            friction=friction, friction_slow=friction_slow, friction_fast=friction_fast, sim_dt=sim_dt, dt=dt,
            episode_seconds=episode_seconds, reward_weights=reward_weights, render_mode=render_mode,
        )  # fmt: skip
        self.gait = self.gaits[check_choice("gait", gait, self.gaits)]

    def _build_engine(self, trunk: Trunk, ground: Ground) -> Any:
        if self.solver == "exact":
            return super()._build_engine(trunk, ground)
        sampled = Ground(**{**vars(ground), "approach": "sampled"})
        return ConstrainedLeg(
            self.geometry, sampled, self.sim_dt, self.filters, height=trunk.height, **self._scheme
        )

    def command_of(self, action: NDArray[np.float32]) -> NDArray[np.float64]:
        """Gait parameters that an action commands: the gait plus an offset; the zero action is exactly the gait."""
        low, high = np.array(list(LIMITS.values())).T
        offset = HALF_RANGE * np.clip(action.astype(np.float64), -1.0, 1.0)
        return np.clip(self.gait.to_array() + offset, low, high)

    def action_for(self, gait: GaitParameters) -> NDArray[np.float32]:
        """The offset that commands the given gait, to float32 precision."""
        return np.clip((gait.to_array() - self.gait.to_array()) / HALF_RANGE, -1, 1).astype(np.float32)

    def _start(self, options: dict[str, Any]) -> Start:
        """The gait at crank angle 0, as in the paper, unless an option says otherwise."""
        options = {"gait": self.gait, "crank_angle": 0.0, **options}
        return super()._start(options)
