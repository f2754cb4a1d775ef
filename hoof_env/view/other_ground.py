"""Normal forces that elastic and inelastic ground would give for the motion that was simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.ground.laws import MIN_RESTITUTION, REGULAR_LAWS
from hoof_env.record.columns import Columns
from hoof_env.record.instant import POINTS

EXTREMES = {"elastic": 1.0, "inelastic": 0.0}
"""Restitutions of the paper's two conditions [-]."""

Floats = NDArray[np.float64]


class OtherGround:
    """Normal forces of other ground, for the simulated motion of the legs.

    A rigid hoof is where its leg has it, and the force is Eq. 14 there. A spring in the hoof gives way to the
    force: the leg's motion stays, and the sole's follows from the balance of spring, damper and ground, as in
    `dynamics.hoof.spring_contact`. Approach speeds are taken from the simulated touch-downs. An episode
    may start with hooves in the ground and springs without load, which elastic ground would throw out: with
    springs, forces are NaN until a hoof has been in the air.

    Args:
        env: environment, without wrappers.
        restitutions: nominal coefficients of restitution of the ground, 0 to 1.

    Attributes:
        refusal: reason for which there are no such forces, "" if there are.
    """

    def __init__(self, env: Any, restitutions: tuple[float, ...] = tuple(EXTREMES.values())) -> None:
        self._env = env
        self._restitutions = restitutions
        self.refusal = ""
        if env.task.contact_law is not None:
            self.refusal = "the contact law is from outside the package, and has no restitution"
        self.set_ground({})

    def set_ground(self, parameters: Mapping[str, float]) -> None:
        """Take the ground of the settings, some of which have other values from now on."""
        _, ground, limbs = self._env.body.parts(replace(self._env.resolved_settings, **parameters))
        lowest = 0.0 if ground.normal_law in REGULAR_LAWS else MIN_RESTITUTION
        laws = [replace(ground, restitution=max(cr, lowest)).damping for cr in self._restitutions]
        self._chi, self._dashpot = np.array(laws).T[:, :, None, None]
        self._ground = ground
        self._spring = limbs[0].spring

    def begin(self, record: Mapping[str, Any]) -> None:
        """Take the start of an episode."""
        shape = (len(self._restitutions), len(POINTS), len(self._env.engine.limbs))
        self._time = float(record["time"][0].item())
        self._deflection = np.zeros(shape)
        self._rate = np.zeros(shape)
        self._decay = np.zeros(shape)
        self._has_flown = np.zeros(shape[1:], bool)

    def columns(self, record: Mapping[str, Any], legs: Sequence[str]) -> Columns:
        """Return the forces on each leg by prefix and name, shape (n,); {} where they are refused."""
        if self.refusal:
            return {}
        forces = dict(zip(EXTREMES, self.forces(record), strict=True))
        return {f"{leg}{name}": forces[name][:, i] for name in forces for i, leg in enumerate(legs)}

    def forces(self, record: Mapping[str, Any]) -> Floats:
        """Return the forces of the next substeps, as `HorseLegEnv.record` has them, shape (restitutions, n,
        legs) [N]."""
        depth = _points(record, "penetration")
        rate = _points(record, "penetration_rate")
        inverse_speed = _points(record, "inverse_approach_speed")
        terrain = self._env.terrain
        stiffness = self._ground.stiffness * np.interp(_points(record, "x"), terrain.x, terrain.stiffness)
        if self._spring is None:
            elastic = stiffness * np.maximum(depth, 0.0) ** self._ground.exponent
            chi = self._chi[:, None]
            dashpot = self._dashpot[:, None]
            force = elastic * (1.0 + chi * rate * inverse_speed) + dashpot * rate  # Eq. 14
            return np.where(depth > 0.0, np.maximum(force, 0.0), 0.0).sum(axis=2)
        deflection = _points(record, "deflection_normal")
        in_air = depth <= 0.0
        pressed = _points(record, "normal") - self._spring.stiffness * deflection
        depth = depth + deflection
        rate = rate + pressed / self._spring.damping
        time = np.asarray(record["time"], float).reshape(len(depth))
        rows = zip(time, in_air, depth, rate, inverse_speed, stiffness, strict=True)
        return np.stack([self._through_spring(*row).sum(axis=1) for row in rows], axis=1)

    def _through_spring(
        self, time: float, in_air: Any, depth: Floats, rate: Floats, inverse_speed: Floats, stiffness: Floats
    ) -> Floats:
        """Move the soles to a time [s]; return the forces there, shape (restitutions, points, legs) [N]."""
        k = self._spring.stiffness
        c = self._spring.damping
        n = self._ground.exponent
        # As the engine does, but no further than to the balance: the sole is fast under stiff ground.
        h = time - self._time
        self._deflection += h * self._rate / np.maximum(h * self._decay, 1.0)
        self._time = time
        self._has_flown |= in_air
        inside = np.maximum(depth - self._deflection, 0.0)
        slope = stiffness * inside ** (n - 1)
        elastic = slope * inside
        resistance = self._chi * elastic * inverse_speed + self._dashpot * (inside > 0.0)
        spring = k * self._deflection
        free = -spring / c  # rate of a spring that nothing presses
        self._rate = np.maximum((elastic + resistance * rate - spring) / (c + resistance), free)
        self._decay = (k + n * slope) / (c + resistance)
        force = np.maximum(spring + c * self._rate, 0.0) * (self._rate > free)
        return np.where(self._has_flown, force, np.nan)


def _points(record: Mapping[str, Any], name: str) -> Floats:
    """Return columns of toes and heels, shape (n, points, legs)."""
    return np.stack([np.asarray(record[f"{point}_{name}"], float)[..., 0] for point in POINTS], axis=1)
