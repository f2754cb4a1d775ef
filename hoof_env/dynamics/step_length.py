"""Longest step for these legs on this ground: `ground.stiffness` with the masses that hooves set against it,
the servos of the motors, and the support of the trunk.

Slow touch-downs decide on damping: Eq. 14 divides by the approach speed, down to `Ground.approach_floor`. A
horse of 349 kg walks with restitution 0.5, midpoint, sim_dt = 1 ms, 24 starts of 0.5 s. For floors of 1e-2,
1e-3 and 1e-4 m/s this module chooses 14, 134 and 1334 substeps. With the first two the energy account closes
to 2e-4 and 2e-6 of the work from 5 and 20 substeps on; with the third it misses 20 % still with 100, and with
1 and 2 some starts end as NOT_FINITE.

A servo decays at the rate of its gain divided by the inertia of its crank. With gains of 1e3 to 1e4 N m s/rad
a crank in the air follows its command in all schemes at twice the limit here; from 2.6 times on some diverge.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from functools import cached_property

import numpy as np

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.parts import FREEDOMS, HoofSpring, Limb, Mechanics, Motor
from hoof_env.errors import Floats, ParameterError
from hoof_env.ground.contact import Ground
from hoof_env.ground.stiffness import MAX_ANGLE, SCHEME_LIMITS, ContactRates, contact_rates, spring_rates
from hoof_env.leg.profile import LegProfile, by_name

ANGLES = 48
"""Number of crank angles at which masses and inertias are evaluated."""

FAST = 0.1
"""Speed of a fast touch-down [m/s], which goes deep."""

HARD = 2.0
"""Speed of a hard touch-down, as of a trotting horse's fore hoof [m/s]; there the ground damps a massless
sole least."""

Functions = dict[str, Floats]

CAUSES = {
    "elastic": "the stiffness of this ground under these masses",
    "damping": "the damping of this ground under these masses",
    "hoof": "the damping of the hooves' springs against the stiffness of this ground",
    "servo": "the speed gain of a motor and the inertia of its crank",
    "support": "spring, damper or drag of the trunk",
}
"""Sentence for each cause that the choice of substeps obeys. "friction" is not one: past its limit a standing
hoof slides back and forth, but the motion does not diverge."""

MAX_NEEDED = 10**12
"""Largest number of substeps of a step that settings may need; beyond it they are refused."""

MAX_SUBSTEPS = 50
"""Largest number of substeps that is chosen; a warning is issued if it is not enough."""

FLOORS = tuple(digit * 10.0**power for power in range(-6, 1) for digit in (1, 2, 5))
"""Approach floors that a warning may propose [m/s]."""


class StepWarning(UserWarning):
    """Warning that the time step is too long for the ground, the motors or the trunk's support."""


class StepLength:
    """Longest step that each part of a mechanics allows, and the choice of substeps.

    Attributes:
        mechanics: legs, trunk, ground and scheme; its substeps and its model are not read.
    """

    def __init__(self, mechanics: Mechanics) -> None:
        self.mechanics = mechanics

    @cached_property
    def limits(self) -> dict[str, float]:
        """Longest step [s] for each cause, infinite if there is no limit: "elastic", "damping" and "friction"
        of the ground (`ground.stiffness`), "hoof" of the hooves' springs, "servo" of the motors, "support" of
        spring, damper and drag of the trunk."""
        trunk = self.mechanics.trunk
        decay = SCHEME_LIMITS[self.mechanics.integrator].decay
        mass = trunk.mass + sum(limb.geometry.mass for limb in self.mechanics.limbs)
        is_held = trunk.kind == "suspended"
        damper, spring = (trunk.damping, trunk.stiffness) if is_held else (0.0, 0.0)
        drag = trunk.drag if trunk.kind != "fixed" else 0.0
        return self._ground_limits(self.mechanics.ground) | {
            "servo": _over(decay, self._servo_rate()),
            "support": min(
                _over(decay, max(damper, drag) / mass), _over(MAX_ANGLE, math.sqrt(spring / mass))
            ),
        }

    def choose(self, sim_dt: float, asked: int | None, stacklevel: int = 3) -> int:
        """Return the number of substeps of `sim_dt` [s]: the given one, else as many as needed, at most
        `MAX_SUBSTEPS`.

        Raises:
            ParameterError: more than `MAX_NEEDED` substeps would be needed.

        Warns:
            StepWarning: the number is too small.
        """
        cause = min(CAUSES, key=self.limits.__getitem__)
        limit = self.limits[cause]
        # true for a limit that is NaN, too
        if not sim_dt / MAX_NEEDED <= limit:
            raise ParameterError(
                f"{CAUSES[cause]}: expected settings that steps of {sim_dt / MAX_NEEDED:g} s can follow, "
                f"got some that ask for {limit:g} s"
            )
        needed = max(1, math.ceil(sim_dt / limit))
        chosen = min(needed, MAX_SUBSTEPS) if asked is None else asked
        if chosen < needed:
            step = sim_dt / chosen
            remedy = f"expected at most {sim_dt / needed:.3g} s, that is substeps={needed} of"
            remedy += f" sim_dt = {sim_dt:g} s"
            floor = self._bearable_floor(step) if cause == "damping" else None
            if floor:
                present = self.mechanics.ground.approach_floor
                remedy += f", or an approach_floor of {floor:g} m/s, not {present:g}"
            warnings.warn(
                f"steps of {step:.3g} s are too long for {CAUSES[cause]}: {remedy}",
                StepWarning,
                stacklevel=stacklevel,
            )
        return chosen

    def _bearable_floor(self, step: float) -> float | None:
        """Return the smallest of `FLOORS` with which damping allows a step [s]; None if there is none."""
        for floor in FLOORS:
            if self._ground_limits(replace(self.mechanics.ground, approach_floor=floor))["damping"] >= step:
                return floor
        return None

    def _ground_limits(self, ground: Ground) -> dict[str, float]:
        limits = {"elastic": np.inf, "damping": np.inf, "friction": np.inf, "hoof": np.inf}
        limbs = self.mechanics.limbs
        whole = self.mechanics.trunk.mass + sum(limb.geometry.mass for limb in limbs)
        load = whole * GRAVITY / len(limbs)
        for limb, (slides, sinks) in zip(limbs, self._masses, strict=True):
            if limb.spring:
                masses = min(slides, whole), min(sinks, whole)
                for name, longest in self._spring_limits(ground, limb.spring, masses, load).items():
                    if name == "hoof" or np.isfinite(sinks):
                        limits[name] = min(limits[name], longest)
                continue
            # fast touch-downs go deep, slow ones are damped strongly: either may need the shorter step
            for speed in {FAST, ground.approach_floor}:
                # `contact_rates` refuses infinite masses; the limits of a point that cannot move are dropped
                mass = min(sinks, whole)
                sliding_mass = min(slides, whole)
                rates = contact_rates(ground, mass, load, speed, sliding_mass, self.mechanics.terrain)
                for name, longest in self._longest_steps(rates).items():
                    if np.isfinite(slides if name == "friction" else sinks):
                        limits[name] = min(limits[name], longest)
        return limits

    def _longest_steps(self, rates: ContactRates) -> dict[str, float]:
        """Return the longest step [s] for each cause with these rates, under the scheme and its error."""
        return rates.longest_steps(self.mechanics.integrator, self.mechanics.step_error)

    def _spring_limits(
        self, ground: Ground, spring: HoofSpring, masses: tuple[float, float], load: float
    ) -> dict[str, float]:
        """Return the limits of a hoof with a spring, on masses [kg] that it sets against forces along the
        ground and into it."""
        slides, sinks = masses
        k = spring.tangential_stiffness or 0.0
        c = spring.tangential_damping or 0.0
        along = ContactRates(math.sqrt(k / slides), c / slides, 0.0, 1.0)
        all_rates = [along]
        soles = [k / c]
        for speed in {FAST, ground.approach_floor, HARD}:
            vertical = (spring.stiffness, spring.damping)
            rates, sole = spring_rates(ground, vertical, sinks, load, speed, self.mechanics.terrain)
            all_rates.append(rates)
            soles.append(sole)
        steps = [self._longest_steps(rates) for rates in all_rates]
        limits = {name: min(step[name] for step in steps) for name in ("elastic", "damping")}
        return limits | {"hoof": SCHEME_LIMITS[self.mechanics.integrator].decay / max(soles)}

    @cached_property
    def _masses(self) -> list[tuple[float, float]]:
        """Smallest masses [kg] that each leg sets against a force along the ground and against one into it,
        at toe or heel, while the hoof is in its lower half; infinite where it cannot be moved."""
        masses = []
        is_level = len(set(self.mechanics.terrain.height)) == 1
        for limb, profile in zip(self.mechanics.limbs, self.mechanics.profiles, strict=True):
            value, slope = map(by_name, _samples(profile))
            lower = np.minimum(value["toe_y"], value["heel_y"])
            half = len(lower) // 2  # not `np.median`, which imports NumPy's masked arrays
            low = lower <= np.sort(lower)[[(len(lower) - 1) // 2, half]].mean()
            x, y = (float(np.max(self._mobility(limb, value, slope, axis)[low])) for axis in "xy")
            # on a slope the normal may point in any direction
            slides, sinks = (x, y) if is_level else (max(x, y), max(x, y))
            masses.append((_over(1.0, slides), _over(1.0, sinks)))
        return masses

    def _mobility(self, limb: Limb, value: Functions, slope: Functions, axis: str) -> Floats:
        """Return the larger acceleration of toe and heel per force along x or y [1/kg], for each crank
        angle."""
        trunk = self.mechanics.trunk
        across = "y" if axis == "x" else "x"
        mobility = np.zeros((2, len(value["toe_x"])))
        if axis in "xy"[: FREEDOMS[trunk.kind]]:
            mobility += 1 / trunk.mass
        for k, point in enumerate(("toe", "heel")):
            if trunk.pitches:
                lever = limb.hip["xy".index(across)] + value[f"{point}_{across}"]
                mobility[k] += lever**2 / trunk.pitch_inertia
            if isinstance(limb.drive, Motor):
                inertia = value["crank_inertia"] + limb.drive.reflected_inertia
                mobility[k] += slope[f"{point}_{axis}"] ** 2 / inertia
        return mobility.max(0)

    def _servo_rate(self) -> float:
        """Return the largest rate [1/s] of a motor's servo: its gain divided by the crank's inertia where
        trunk and frame of the leg yield, with any gait."""
        rates = [0.0]
        for limb, profile in zip(self.mechanics.limbs, self.mechanics.profiles, strict=True):
            if isinstance(limb.drive, Motor):
                f = by_name(_samples(profile)[0])
                motor = limb.drive
                side = limb.geometry.travel
                # mass matrix of crank, frame, x and y, in the leg's frame; only its upper triangle at first
                matrix = np.zeros((len(f["toe_x"]), 4, 4))
                matrix[:, 0, 0] = f["crank_inertia"] + motor.reflected_inertia
                matrix[:, 0, 1] = f["coupling"] - side * motor.gear_ratio * motor.rotor_inertia
                matrix[:, 1, 1] = f["frame_inertia"] + motor.rotor_inertia
                matrix[:, 0, 2] = f["moment_slope_x"]
                matrix[:, 0, 3] = f["moment_slope_y"]
                matrix[:, 1, 2] = -f["first_moment_y"]
                matrix[:, 1, 3] = f["first_moment_x"]
                matrix[:, [2, 3], [2, 3]] = self.mechanics.trunk.mass + limb.geometry.mass
                matrix = np.triu(matrix) + np.triu(matrix, 1).transpose(0, 2, 1)
                rates.append(motor.speed_gain * float(np.linalg.inv(matrix)[:, 0, 0].max()))
        return max(rates)


def _over(a: float, b: float) -> float:
    return a / b if b > 0 else math.inf


def _samples(profile: LegProfile) -> tuple[Floats, Floats]:
    """Return the functions and derivatives at `ANGLES` crank angles, except angles at which the linkage does
    not close."""
    value, slope = profile(np.arange(ANGLES) * 2 * np.pi / ANGLES)
    known = np.isfinite(value[:, 0])
    return value[known], slope[known]
