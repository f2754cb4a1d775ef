"""What a leg and its gaits must satisfy beside the paper's numbers, with the paper's claims about shape.

A demand bounds one measured number from below or above. Its shortage is how far the number falls short, times
a scale that makes a shortage of one about as bad as an error of one bar. The bounds keep a little clear of
what `hoof_env.paper.shapes` decides by, so that a leg without a shortage passes the judge.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from research.identify.features import FEATURES

LENGTH_RANGE = (0.08, 3.0)  # of a link [m]: none vanishes, none is longer than the animal

LEG = np.dtype(
    [
        (name, "f8")
        for name in (
            "miss",  # largest gap of a dyad, over its reach [-]
            "transmission",  # smallest sine of a dyad's angle [-]
            "hip_height",  # of the centre of the swing [m]
            "sole", "sole_part",  # length of the sole [m], and over the hip height [-]
            "lowest",  # smallest height of a joint other than toe and heel over both cycles [m]
            "length_excess",  # log lengths beyond `LENGTH_RANGE`, summed [-]
            "pivot_excess",  # how much further C is from O than the longest link may be [m]
            "walk_excess", "run_excess",  # swing beyond the limits of a gait, summed [rad]
        )
    ]
)  # fmt: skip

BOTH = np.dtype(
    [
        ("angle_variation", "f8"),  # the running one over the walking one [-]
        ("step", "f8"),  # the running one minus the walking one [m]
        ("heel_gap", "f8"),  # likewise [m]
        ("turn", "f8"),  # running: push over load in the second half of stance minus the first half [-]
    ]
)

GROUPS = (("leg", LEG), ("walk", FEATURES), ("run", FEATURES), ("both", BOTH))
MEASURED = tuple(f"{group}.{name}" for group, kind in GROUPS for name in kind.names or ())
"""Every measured number, in the order of the array that holds them."""


class Demand(NamedTuple):
    """`measured` must be at least (sense +1) or at most (sense -1) `bound`; `scale`: shortage per unit."""

    name: str
    measured: str
    sense: int
    bound: float
    scale: float
    why: str


LEAST, MOST = 1, -1
_WALKS = "it moves its animal: most load on points that go back at 0.3 m/s, also deeper in the ground"
_FORWARD = "claim walk.direction: one direction through stance, forward on the leg"

_LEG = (
    ("assembles", "leg.miss", MOST, 0.0, 100, "every dyad closes through the revolution"),
    ("transmission", "leg.transmission", LEAST, 0.101, 40, "no dyad near a dead point: 0.1"),
    ("hip_low", "leg.hip_height", LEAST, 1.202, 20, "a horse's hip: 1.2 m or more"),
    ("hip_high", "leg.hip_height", MOST, 1.698, 20, "a horse's hip: 1.7 m or less"),
    ("sole_short", "leg.sole", LEAST, 0.051, 100, "a hoof, not a point: 5 cm or more"),
    ("sole_long", "leg.sole_part", MOST, 0.159, 200, "a hoof, not a foot: under 0.16 of the hip height"),
    ("joints", "leg.lowest", LEAST, 0.01, 50, "no joint but toe and heel goes under the ground"),
    ("lengths", "leg.length_excess", MOST, 0.0, 3, "links of an animal's size"),
    ("pivot", "leg.pivot_excess", MOST, 0.0, 20, "a pivot within the animal"),
    ("walk.limits", "leg.walk_excess", MOST, 0.0, 10, "the gait can be commanded (gait.LIMITS)"),
    ("run.limits", "leg.run_excess", MOST, 0.0, 10, "the gait can be commanded (gait.LIMITS)"),
)
_EACH_GAIT = (
    ("ankle", "ankle", LEAST, 0.01, 50, "the ankle stays above the sole in stance"),
    ("starts_in_air", "start_depth", MOST, -0.002, 50, "stance is one, not cut in two"),
    ("enters_once", "extra_entries", MOST, 0.0, 1, "toe and heel come in once a cycle"),
    ("both_touch", "missing", MOST, 0.0, 20, "toe and heel both bear"),
)
_GAITS = (
    ("walk.heel_first", "walk.toe_after_heel_in", LEAST, 0.005, 200, "claim walk.order: heel-strike"),
    ("walk.toe_last", "walk.toe_after_heel_out", LEAST, 0.005, 200, "claim walk.order: toe-off"),
    ("walk.double", "walk.double", LEAST, 0.01, 200, "claim walk.order: heel and toe bear together"),
    ("walk.flat", "walk.flattest", MOST, 2.8, 1, "claim walk.order: flat within 3 deg while both bear"),
    ("walk.two_peaks", "walk.second_elastic", LEAST, 0.108, 60, "claim walk.peaks: a second by 10 %"),
    ("walk.halves", "walk.peaks_apart", LEAST, 0.003, 200, "claim walk.peaks: each in its half of stance"),
    ("walk.no_third", "walk.third_peak", MOST, 0.08, 50, "claim walk.peaks: no third by 10 %"),
    ("walk.supported", "walk.dip_support", LEAST, 0.001, 500, "claim walk.peaks: both bear in the dip"),
    ("run.toe_first", "run.toe_after_heel_in", MOST, -0.003, 200, "claim run.order: toe-strike"),
    ("run.toe_last", "run.toe_after_heel_out", LEAST, 0.004, 200, "claim run.order: roll-over, toe-off"),
    ("run.heel_gap", "both.heel_gap", LEAST, 0.02, 50, "claim run.order: higher than in walking"),
    ("run.one_elastic", "run.second_elastic", MOST, 0.07, 50, "claim run.peaks: no second peak by 10 %"),
    ("run.one_inelastic", "run.second_inelastic", MOST, 0.07, 50, "claim run.peaks: nor inelastic"),
    ("run.apart", "run.peak_gap", LEAST, 0.0108, 300, "claim run.peaks: 10 ms apart, elastic later"),
    ("run.step", "both.step", LEAST, 0.02, 20, "claim run.step: longer than the walking step"),
    ("run.propels", "run.push_2", LEAST, 0.02, 15, "claim run.direction: forward in the second half"),
    ("run.turns", "both.turn", LEAST, 0.001, 50, "claim run.direction: more than in the first half"),
    *(
        (f"{gait}.walks_{d}", f"{gait}.swept_{d}", LEAST, 0.52, 15, _WALKS)
        for gait in ("run", "walk")
        for d in (0, 5, 10)
    ),
    *((f"walk.forward_{half}", f"walk.push_{half}", LEAST, 0.02, 15, _FORWARD) for half in (1, 2)),
)

LEG_DEMANDS = tuple(Demand(*row) for row in _LEG)
GAIT_DEMANDS = (
    *(Demand(f"{g}.{row[0]}", f"{g}.{row[1]}", *row[2:]) for g in ("walk", "run") for row in _EACH_GAIT),
    *(Demand(*row) for row in _GAITS),
)
DEMANDS = (*LEG_DEMANDS, *GAIT_DEMANDS)
