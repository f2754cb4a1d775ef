"""The leg that golden numbers of many tests are of: the seed of the search in `research/identify`, which does
not ship."""

from research.identify.leg import FIRST_FIT

PRESETS = {"first_fit": FIRST_FIT, "identified": "identified"}

OLD_HORSE = {
    "preset": FIRST_FIT,  # with its ground
    "trunk_mass": 80.0,
    "trunk_stiffness": 4000.0,
    "trunk_damping": 1130.0,
    "target_speed": None,
    "reward_weights": {"progress": 1.0, "peak": 0.3, "energy": 0.1, "support": 0.0},
}
"""`HorseLeg-v0` when golden numbers of that leg were made."""
