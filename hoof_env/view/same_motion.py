"""Normal force that elastic and inelastic ground would give for the motion that was simulated."""

from __future__ import annotations

from typing import Any

import numpy as np

from hoof_env.ground.laws import REGULAR_LAWS, SMALLEST_RESTITUTION, damping
from hoof_env.render.instant import POINTS, Columns

EXTREMES = {"elastic": 1.0, "inelastic": 0.0}
"""Restitutions of the paper's two conditions [-]."""


def normal_for(record: Any, batch: Any, stiffness: float, restitution: float) -> Any:
    """Return the normal force of Eq. 14 for a recorded motion.

    Args:
        record: substeps as `HorseLegEnv.record` returns them.
        batch: batch of the environment.
        stiffness: K [N/m^n].
        restitution: nominal coefficient of restitution of the ground, 0 to 1.

    Returns:
        Force on each leg, shape (n, legs) [N].
    """
    s = batch.settings
    terrain = batch.engine.terrain
    lowest = 0.0 if s.normal_law in REGULAR_LAWS else SMALLEST_RESTITUTION
    chi, dashpot = damping(s.normal_law, max(restitution, lowest), stiffness, s.trunk_mass)
    total: Any = 0.0
    for point in POINTS:
        depth = record[f"{point}_penetration"][..., 0]
        rate = record[f"{point}_penetration_rate"][..., 0]
        here = np.interp(record[f"{point}_x"][..., 0], terrain.x, terrain.stiffness)
        spring = stiffness * here * np.maximum(depth, 0.0) ** s.exponent
        inverse_speed = record[f"{point}_inverse_approach_speed"][..., 0]
        force = spring * (1.0 + chi * rate * inverse_speed) + dashpot * rate  # Eq. 14
        total = total + np.where(depth > 0.0, np.maximum(force, 0.0), 0.0)
    return total


def elastic_and_inelastic(record: Any, batch: Any, stiffness: float) -> Columns:
    """Return `normal_for` both `EXTREMES`, of one leg, shape (n,); empty under a horse, a spring in the hoof,
    a law from outside the package, or the paper's solver, whose forces are not Eq. 14 of this motion."""
    plain = batch.settings.hoof_stiffness is None and batch.task.contact_law is None
    if not plain or batch.legs > 1 or batch.paper:
        return {}
    return {name: normal_for(record, batch, stiffness, cr)[:, 0] for name, cr in EXTREMES.items()}
