"""Names, units and decimals of what `hoof_env.paper.spread` measures on every leg."""

from __future__ import annotations

from hoof_env.leg.linkage import BODIES, BODY_LENGTHS, LENGTHS
from hoof_env.paper.published import CONDITIONS

DIGITS = {"m": 3, "rad": 3, "s": 4, "N": 1, "N m": 1, "N s": 2, "kg": 2}
"""Decimals by unit."""

ZEROED = ("m", "N", "N m", "N s", "kg")
"""Units of quantities whose zero means something, but for `COORDINATES`."""

COORDINATES = ("pivot.x", "pivot.y")

SWING = ("swing_offset", "swing_sin", "swing_cos")
GAIT_NAMES = {"walk": "walking", "run": "running"}
GAITS = tuple(GAIT_NAMES)
_ROLES = dict(zip(BODY_LENGTHS, (body.role for body in BODIES), strict=True)) | {"CA": "rocker, as far as A"}

IDENTIFIED = {
    **{f"length.{name}": (f"{name}, {_ROLES[name]}", "m") for name in LENGTHS},
    "length.OC": ("OC, between the pivots", "m"),
    "pivot.x": ("C along the leg's x from O", "m"),
    "pivot.y": ("C along the leg's y from O", "m"),
    "hip_height": ("height of O above the ground", "m"),
    **{
        f"{gait}.{name}": (f"{GAIT_NAMES[gait]}, {name.replace('_', ' ')}", "rad")
        for gait in GAITS
        for name in SWING
    },
}
"""What the paper does not print of a leg and its gaits: name and unit by id."""

FOLLOWING = {
    "mass": ("mass of the leg", "kg"),
    **{
        f"{gait}.{key}": (f"{GAIT_NAMES[gait]}, {name}", "m")
        for gait in GAITS
        for key, name in (
            ("step", "travel of the sole in stance"),
            ("reach", "fore-and-aft extent of the sole's path"),
            ("lift", "greatest height of the sole"),
        )
    },
    **{
        f"{gait}.{condition}.{key}": (f"{GAIT_NAMES[gait]}, {condition}, {name}", unit)
        for key, name, unit in (
            ("crank_peak", "largest crank torque", "N m"),
            ("crank_rms", "rms crank torque", "N m"),
            ("peak", "peak of the normal force", "N"),
            ("peak_time", "time of the force's peak", "s"),
            ("impulse", "impulse of the normal force", "N s"),
        )
        for gait in GAITS
        for condition in CONDITIONS
    },
}
"""What follows from it: name and unit by id."""
