"""How long a step the ground allows under these legs: `ground.stiffness` with the masses that their hoofs set against it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hoof_env.dynamics.drive import Motor
from hoof_env.dynamics.engine import GRAVITY
from hoof_env.dynamics.limb import Limb
from hoof_env.dynamics.trunk import Trunk
from hoof_env.ground.contact import Ground
from hoof_env.ground.stiffness import contact_rates
from hoof_env.ground.terrain import Terrain
from hoof_env.leg import profile as f
from hoof_env.leg.profile import LegProfile

ANGLES = 48
"""Crank angles at which the hoofs' masses are looked at."""


class StepWarning(UserWarning):
    """The time step is too long for the stiffness of the ground."""


def longest_steps(
    limbs: Sequence[Limb],
    profiles: Sequence[LegProfile],
    trunk: Trunk,
    ground: Ground,
    terrain: Terrain,
    scheme: str,
) -> dict[str, float]:
    """Longest step [s] for each cause of `ground.stiffness.ContactRates.longest_steps`: "elastic", "damping",
    "friction". Friction past its limit does not blow up; the engine heeds the other two."""
    load = (trunk.mass + sum(limb.geometry.mass for limb in limbs)) * GRAVITY / len(limbs)
    limits = {"elastic": np.inf, "damping": np.inf, "friction": np.inf}
    for limb, profile in zip(limbs, profiles, strict=True):
        mass = [np.inf, np.inf]
        for axis in range(2):
            mass[axis] = _lightest(limb, profile, trunk, axis)
        if not np.isfinite(mass).all():
            mass = [min(m, trunk.mass + limb.geometry.mass) for m in mass]
        rates = contact_rates(ground, mass[1], load, sliding_mass=mass[0], terrain=terrain)
        for name, longest in rates.longest_steps(scheme).items():
            limits[name] = min(limits[name], longest)
    return limits


def _lightest(limb: Limb, profile: LegProfile, trunk: Trunk, axis: int) -> float:
    """Smallest mass [kg] that toe or heel sets against a force along x (0) or y (1), the hoof in its lower half."""
    value, slope = profile(np.arange(ANGLES) * 2 * np.pi / ANGLES)
    mobility = np.zeros(ANGLES)
    moves = {"fixed": (), "rail": (0,), "suspended": (0, 1), "free": (0, 1)}[trunk.kind]
    if axis in moves:
        mobility += 1 / trunk.mass
    if isinstance(limb.drive, Motor):
        inertia = value[:, f.A] + limb.drive.reflected_inertia
        mobility += np.max(slope[:, [f.TOE_X + axis, f.HEEL_X + axis]] ** 2, axis=1) / inertia
    low = np.nanmin(value[:, [f.TOE_Y, f.HEEL_Y]], axis=1) <= np.nanmedian(value[:, [f.TOE_Y, f.HEEL_Y]])
    largest = np.nanmax(mobility[low])
    return float(1 / largest) if largest > 0 else np.inf
