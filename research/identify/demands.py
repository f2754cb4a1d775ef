"""What a leg and its gaits must satisfy beside the paper's numbers, with the paper's claims about shape.

A demand bounds one measured number from below or above. Its shortage is how far the number falls short, times
a scale that makes a shortage of one about as bad as an error of one bar. The bounds keep a little clear of
what `hoof_env.paper.shapes` decides by, so that a leg without a shortage passes the judge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from research.identify.features import FEATURES

LENGTH_RANGE = (0.08, 3.0)
"""Shortest and longest link [m]: none vanishes, none is longer than the animal."""

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
            "walk_excess", "run_excess",  # swing beyond the limits of a gait, summed [rad]
        )
    ]
)  # fmt: skip
"""What is measured on the leg."""

BOTH = np.dtype(
    [
        ("angle_variation", "f8"),  # the running one over the walking one [-]
        ("step", "f8"),  # the running one minus the walking one [m]
        ("heel_gap", "f8"),  # likewise [m]
        ("turn", "f8"),  # running: push over load in the second half of stance minus the first half [-]
    ]
)
"""What compares the two gaits or halves."""

GROUPS = (("leg", LEG), ("walk", FEATURES), ("run", FEATURES), ("both", BOTH))
MEASURED = tuple(f"{group}.{name}" for group, kind in GROUPS for name in kind.names or ())
"""Every measured number, in the order of the array that holds them."""


@dataclass(frozen=True)
class Demand:
    """`measured` must be at least (sense +1) or at most (sense -1) `bound`; `scale`: shortage per unit."""

    name: str
    measured: str
    sense: int
    bound: float
    scale: float
    why: str


def _at_least(name: str, measured: str, bound: float, scale: float, why: str) -> Demand:
    return Demand(name, measured, 1, bound, scale, why)


def _at_most(name: str, measured: str, bound: float, scale: float, why: str) -> Demand:
    return Demand(name, measured, -1, bound, scale, why)


LEG_DEMANDS = (
    _at_most("assembles", "leg.miss", 0.0, 100, "every dyad closes through the revolution"),
    _at_least("transmission", "leg.transmission", 0.101, 40, "no dyad near a dead point: 0.1"),
    _at_least("hip_low", "leg.hip_height", 1.202, 20, "a horse's hip: 1.2 m or more"),
    _at_most("hip_high", "leg.hip_height", 1.698, 20, "a horse's hip: 1.7 m or less"),
    _at_least("sole_short", "leg.sole", 0.051, 100, "a hoof, not a point: 5 cm or more"),
    _at_most("sole_long", "leg.sole_part", 0.159, 200, "a hoof, not a foot: under 0.16 of the hip height"),
    _at_least("joints", "leg.lowest", 0.01, 50, "no joint but toe and heel goes under the ground"),
    _at_most("lengths", "leg.length_excess", 0.0, 3, "links of an animal's size"),
    _at_most("walk.limits", "leg.walk_excess", 0.0, 10, "the gait can be commanded (gait.LIMITS)"),
    _at_most("run.limits", "leg.run_excess", 0.0, 10, "the gait can be commanded (gait.LIMITS)"),
)


def _of_each_gait(gait: str) -> tuple[Demand, ...]:
    return (
        _at_least(f"{gait}.ankle", f"{gait}.ankle", 0.01, 50, "the ankle stays above the sole in stance"),
        _at_most(f"{gait}.starts_in_air", f"{gait}.start_depth", -0.002, 50, "stance is one, not cut in two"),
        _at_most(f"{gait}.enters_once", f"{gait}.extra_entries", 0.0, 1, "toe and heel come in once a cycle"),
        _at_most(f"{gait}.both_touch", f"{gait}.missing", 0.0, 20, "toe and heel both bear"),
    )


def _walks(gait: str) -> tuple[Demand, ...]:
    why = "it moves its animal: most load on points that go back at 0.3 m/s, also deeper in the ground"
    return tuple(_at_least(f"{gait}.walks_{d}", f"{gait}.swept_{d}", 0.52, 15, why) for d in (0, 5, 10))


GAIT_DEMANDS = (
    *_of_each_gait("walk"),
    *_of_each_gait("run"),
    _at_least("walk.heel_first", "walk.toe_after_heel_in", 0.005, 200, "claim walk.order: heel-strike"),
    _at_least("walk.toe_last", "walk.toe_after_heel_out", 0.005, 200, "claim walk.order: toe-off"),
    _at_least("walk.double", "walk.double", 0.01, 200, "claim walk.order: heel and toe bear together"),
    _at_most("walk.flat", "walk.flattest", 2.8, 1, "claim walk.order: flat within 3 deg while both bear"),
    _at_least("walk.two_peaks", "walk.second_elastic", 0.108, 60, "claim walk.peaks: a second by 10 %"),
    _at_least("walk.halves", "walk.peaks_apart", 0.003, 200, "claim walk.peaks: each in its half of stance"),
    _at_most("walk.no_third", "walk.third_peak", 0.08, 50, "claim walk.peaks: no third by 10 %"),
    _at_least("walk.supported", "walk.dip_support", 0.001, 500, "claim walk.peaks: both bear in the dip"),
    _at_most("run.toe_first", "run.toe_after_heel_in", -0.003, 200, "claim run.order: toe-strike"),
    _at_least("run.toe_last", "run.toe_after_heel_out", 0.004, 200, "claim run.order: roll-over, toe-off"),
    _at_least("run.heel_gap", "both.heel_gap", 0.02, 50, "claim run.order: higher than in walking"),
    _at_most("run.one_elastic", "run.second_elastic", 0.07, 50, "claim run.peaks: no second peak by 10 %"),
    _at_most("run.one_inelastic", "run.second_inelastic", 0.07, 50, "claim run.peaks: nor inelastic"),
    _at_least("run.apart", "run.peak_gap", 0.0108, 300, "claim run.peaks: 10 ms apart, elastic later"),
    _at_least("run.step", "both.step", 0.02, 20, "claim run.step: longer than the walking step"),
    _at_least("run.propels", "run.push_2", 0.02, 15, "claim run.direction: forward in the second half"),
    _at_least("run.turns", "both.turn", 0.001, 50, "claim run.direction: more than in the first half"),
    *_walks("run"),
)  # fmt: skip

_ONE_WAY = "claim walk.direction: one direction through stance"
WALK_DEMANDS = {
    "walks": (
        *_walks("walk"),
        _at_least("walk.forward_1", "walk.push_1", 0.02, 15, f"{_ONE_WAY}, forward on the leg"),
        _at_least("walk.forward_2", "walk.push_2", 0.02, 15, f"{_ONE_WAY}, forward on the leg"),
    ),
    "brakes": (
        _at_most("walk.backward_1", "walk.push_1", -0.02, 15, f"{_ONE_WAY}, backward: figure 6 literally"),
        _at_most("walk.backward_2", "walk.push_2", -0.02, 15, f"{_ONE_WAY}, backward: figure 6 literally"),
    ),
}
"""A walk that moves its animal, or one that brakes through its stance."""


def demands(walk: str) -> tuple[Demand, ...]:
    """All demands for a walk that "walks" or "brakes", those of the leg first."""
    return (*LEG_DEMANDS, *GAIT_DEMANDS, *WALK_DEMANDS[walk])
