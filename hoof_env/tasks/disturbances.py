"""Strength of the disturbances of a task, and a horse's rough ground."""

from __future__ import annotations

from typing import Any

MAX_STRENGTH = 10.0
"""Largest factor of all disturbances."""

ROUGH_PUSH = 1.5
ROUGH_SLOPE = 0.1
ROUGHNESS = 0.05
"""Strengths of a horse's rough ground: largest push divided by the mass [m/s], steepest slope [-], largest
bumps [m]. legged_gym pushes robots with hips at 0.55 m by 1 m/s (`max_push_vel_xy`), which is this push at
the same Froude number, and its rough slopes have these bumps (`random_uniform_terrain`). The slope is that
of a steep road. They were chosen before the first training."""


def rough_ground(strength: float, mass: float) -> dict[str, Any]:
    """Return the settings of a horse's rough ground.

    Args:
        strength: factor of all disturbances.
        mass: mass of the horse [kg].
    """
    return {
        "terrain": {
            "kind": "hills",
            "length": 2000.0,
            "rise": 10 * ROUGH_SLOPE * strength,
            # Hills require a positive slope; at strength 0 they have no height.
            "slope": max(ROUGH_SLOPE * strength, 1e-3),
            "roughness": ROUGHNESS * strength,
            "stiffness": [1.0, 1.0],
            "friction": [1.0, 1.0],
        },
        "push_impulse": [-ROUGH_PUSH * mass, ROUGH_PUSH * mass],
        "push_seconds": [2.0, 4.0],
        "strength": strength,
    }
