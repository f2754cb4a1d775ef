"""How a gait carries the trunk of the environment: what is measured, and what is asked of one that does.

The trunk, the ground and the starts are those of `HorseLeg-v0` with its defaults. Over whole strides of a
steady gait the vertical momentum does not change, so the mean ground force is what the leg must bear at
rest (`trunk_share` of the weight) plus stiffness times the trunk's mean height over its rest: a gait that
bears its load holds its trunk up, and one that lets the trunk sink bears less.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.engine import GRAVITY, LegEngine
from hoof_env.dynamics.result import Result
from hoof_env.dynamics.trace import new_trace
from hoof_env.dynamics.trunk_model import LIFT_OFF
from hoof_env.envs.parameters import physics
from hoof_env.envs.start import HIGHEST, LOWEST, draw_starts
from hoof_env.envs.tasks import TASKS
from hoof_env.errors import ParameterError
from hoof_env.gait.parameters import GaitParameters, gait_names, load_gait
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.profile import leg_profile

SETTLE = 10.0
"""Seconds from a start that are left out. In flight the forward speed follows within 4.4 s (mass over drag);
friction is faster."""

STRIDES, PHASES = 3, 64
"""Strides measured, and crank angles at which they are compared."""


@dataclass(frozen=True)
class Carriage:
    """How a gait carries the trunk; means over all starts, but for what says otherwise.

    Attributes:
        load_share: mean vertical ground force over the load that the leg must bear at rest [-].
        peak_share: highest vertical ground force over that load [-].
        speed_m_s: forward.
        rise_m: mean height of the trunk over its rest height; negative where it sinks.
        bounce_m: highest less lowest height in the strides measured.
        duty_factor: part of the time that the hoof touches the ground.
        stances: per stride; a stance begins where the force exceeds `LIFT_OFF` weights.
        clearance_m: greatest height of the lower of toe and heel above the ground.
        hoof_angle_deg: size of the hoof's angle with the ground, weighted with the force.
        unsteady_m: largest difference of the trunk's height between any two strides of any two starts, at
            the same crank angle.
        speed_spread_m_s: between the fastest and the slowest start.
        survived: part of the time that the trunk kept within its range of heights; below 1 in any start all
            else is NaN.
    """

    load_share: float
    peak_share: float
    speed_m_s: float
    rise_m: float
    bounce_m: float
    duty_factor: float
    stances: float
    clearance_m: float
    hoof_angle_deg: float
    unsteady_m: float
    speed_spread_m_s: float
    survived: float


@dataclass(frozen=True)
class Demand:
    """A quantity of a `Carriage` that must lie within [low, high].

    Attributes:
        text: with a place for the value. tolerance: by how much missing it counts 1 [unit of the quantity].
    """

    quantity: str
    low: float
    high: float
    tolerance: float
    text: str

    def miss(self, carriage: Carriage, margin: float = 0.0) -> float:
        """By how many tolerances the demand is missed; 0 if it is met with a `margin` [tolerances]."""
        value = float(getattr(carriage, self.quantity))
        return max(0.0, margin + max(self.low - value, value - self.high) / self.tolerance)


DEMANDS = (
    Demand("load_share", 0.95, 1.05, 0.05, "bears {:.2f} of its load"),
    Demand("speed_m_s", 1.2, 1.8, 0.1, "moves at {:.2f} m/s"),
    Demand("unsteady_m", -math.inf, 0.005, 0.005, "its strides differ by {:.3f} m"),
    Demand("speed_spread_m_s", -math.inf, 0.02, 0.02, "its speeds differ by {:.2f} m/s"),
    Demand("stances", 0.9, 1.1, 0.5, "has {:.1f} stances a stride"),
    Demand("clearance_m", 0.05, math.inf, 0.05, "lifts its hoof {:.2f} m"),
    Demand("hoof_angle_deg", -math.inf, 15.0, 5.0, "stands on a hoof tilted by {:.0f} deg"),
)
"""What a carrying walk is; a gait that misses the first bears too little, or more than it must. By the
balance above, a twentieth of the load is 9 mm of the default suspension. 1.2 to 1.8 m/s is a horse's walk."""


def missed(carriage: Carriage) -> list[str]:
    """What a gait does instead of meeting each demand that it misses, in words."""
    if carriage.survived < 1:
        return ["loses its trunk"]
    return [d.text.format(getattr(carriage, d.quantity)) for d in DEMANDS if d.miss(carriage) > 0]


class Course:
    """The default environment on the leg of a preset, with its starts.

    Args:
        preset: name or JSON file.
        starts: how many; they are the environment's own, of the seeds 0, 1, ...
    """

    def __init__(self, preset: str | Path, starts: int) -> None:
        settings = TASKS["leg"].settings({"preset": str(preset)})
        self.geometry, self.sim_dt = load_geometry(preset), settings.sim_dt
        self.trunk, ground, _ = physics(settings, self.geometry.hip_height, {})
        self.engine = LegEngine(self.geometry, self.trunk, ground, self.sim_dt)
        self.weight = (self.trunk.mass + self.geometry.mass) * GRAVITY
        self.load, self.count = self.trunk.share * self.weight, starts
        gaits = {name: load_gait(name, preset) for name in gait_names(preset)}
        generators = [np.random.default_rng(seed) for seed in range(starts)]
        self._starts = draw_starts(
            {}, generators, leg_profile(self.geometry), self.trunk, gaits, Terrain.flat()
        )

    def measure(self, gait: GaitParameters) -> Carriage:
        """Command the gait from every start and measure `STRIDES` strides after `SETTLE` seconds.

        Raises:
            ParameterError: the crank stands still, so that there are no strides.
        """
        if gait.crank_speed == 0:
            raise ParameterError("crank_speed: expected a gait whose crank turns, got 0 rad/s")
        rides, heights = [], []
        for k in range(self.count):
            trace, survived = self._ride(gait, k)
            if survived < 1:
                fallen = dict.fromkeys(Carriage.__annotations__, math.nan)
                return Carriage(**{**fallen, "survived": (k + survived) / self.count})
            rides.append(self._figures(trace[-self._rows(gait, STRIDES) :]))
            heights.append(by_phase(trace["theta"], trace["trunk_y"]))
        speeds = [ride["speed_m_s"] for ride in rides]
        return Carriage(
            **{name: float(np.mean([ride[name] for ride in rides])) for name in rides[0]},
            unsteady_m=float(np.ptp(np.concatenate(heights), axis=0).max()),
            speed_spread_m_s=max(speeds) - min(speeds),
            survived=1.0,
        )

    def _rows(self, gait: GaitParameters, strides: int) -> int:
        return round(strides * 2 * np.pi / gait.crank_speed / self.sim_dt)

    def _ride(self, gait: GaitParameters, k: int) -> tuple[NDArray[np.void], float]:
        """The last strides, one more than is measured, and the part of the time that the trunk survived."""
        begin = self._starts
        self.engine.reset(
            GaitParameters.from_array(begin.gaits[k]), theta=float(begin.crank_angle[k]),
            height=float(begin.height[k]), speed=float(begin.speed[k]),
        )  # fmt: skip
        trace = new_trace(round(SETTLE / self.sim_dt) + self._rows(gait, STRIDES + 1))
        result = self.engine.advance(gait.to_array(), trace)
        height = trace["trunk_y"] / self.trunk.height
        fallen = ~((height > LOWEST) & (height < HIGHEST))
        if fallen.any() or result is not Result.OK:
            return trace, float(np.argmax(fallen)) / len(trace)
        return trace[-self._rows(gait, STRIDES + 1) :], 1.0

    def _figures(self, trace: NDArray[np.void]) -> dict[str, float]:
        """Of whole strides."""
        force, height = trace["normal"], trace["trunk_y"]
        loaded = force > LIFT_OFF * self.weight
        clearance = -np.maximum(trace["toe_penetration"], trace["heel_penetration"])
        seconds = len(trace) * self.sim_dt
        tilt = np.degrees(np.abs(trace["hoof_angle"]))
        return {
            "load_share": float(force.mean() / self.load),
            "peak_share": float(force.max() / self.load),
            "speed_m_s": float(trace["trunk_vx"].sum() * self.sim_dt / seconds),
            "rise_m": float(height.mean() - self.trunk.height),
            "bounce_m": float(np.ptp(height)),
            "duty_factor": float((force > 0).mean()),
            "stances": float((loaded & ~np.roll(loaded, 1)).sum() / STRIDES),
            "clearance_m": float(clearance.max()),
            "hoof_angle_deg": float(tilt @ force / max(force.sum(), 1e-9)),
        }


def by_phase(theta: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values of the strides at `PHASES` even crank angles from 0, shape (`STRIDES`, `PHASES`).

    Args:
        theta: rising crank angle [rad], shape (n,), over at least one stride more.
        values: shape (n,).
    """
    step = 2 * np.pi / PHASES
    last = math.floor(theta[-1] / step)
    angles = np.arange(last - STRIDES * PHASES, last)
    found = np.interp(angles * step, theta, values).reshape(STRIDES, PHASES)
    return np.roll(found, angles[0] % PHASES, axis=1)
