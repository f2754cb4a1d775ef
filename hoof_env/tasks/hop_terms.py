"""Reward and observation of a leg that carries itself, in place of `reward.TERMS` and `observation.ENTRIES`.

The reward pays for travel and charges force, work, slip and a fall. Nothing is paid for bearing weight, which
this leg cannot avoid."""

from __future__ import annotations

from dataclasses import replace

from hoof_env.simd import Lanes, Number
from hoof_env.tasks.observation import ENTRIES, TRUE_RATE, Entry, Scale, tanh_of
from hoof_env.tasks.reward import Outcome, Term, energy, failure, loading, overspeed, progress, slip


def peak(step: Outcome, weight: Number) -> Lanes:
    """Return the charge for the increase of the square of the stance's peak GRF, in units of the weight.

    The square, because the sum of the peaks themselves orders nothing: a leg that bears its weight in half as
    many stances has peaks twice as high, and their sum is the same.
    """
    rise = step.sums.peak_grf_increase
    # A step in which the peak rises ends that rise at its highest force: b^2 - a^2 = (b - a) (2 b - (b - a))
    return -weight * rise * (2.0 * step.sums.highest_grf - rise) / (step.weight * step.weight)


HOP_TERMS = (
    Term("progress", 10.0, "1/m", "forward travel, up to the commanded speed", progress),
    Term(
        "peak",
        0.3,
        "-",
        "minus the square of each stance's peak GRF divided by the weight, as it increases",
        peak,
    ),
    Term(
        "loading",
        10.0,
        "s/MN",
        "minus the increase of the stance's steepest rise of the normal force, while its peak grows",
        loading,
    ),
    Term("energy", 1.0, "1/kJ", "minus the positive work of both drives; braking is not recovered", energy),
    # As much as a metre of progress pays, so that no way of sliding does
    Term("slip", 10.0, "1/m", "minus the distance that the hoof slides in stance, in both directions", slip),
    Term("failure", 5.0, "1/s", "once, minus the rest of `episode_seconds`, if the episode fails", failure),
)
"""Terms of the reward of `HorseLegHop-v0`, in the order in which they are added."""

BALANCE_SPEED_TERMS = (
    HOP_TERMS[0],
    Term("overspeed", 10.0, "1/m", "minus forward travel beyond the commanded speed", overspeed),
    *HOP_TERMS[1:],
)
"""Terms of the reward of `HorseLegBalanceSpeed-v0`."""

SCALES = {
    # A motor's crank also turns back, and beyond the largest rate that a gait may ask for
    TRUE_RATE: tanh_of(10.0),
    # Forces rise by 50 to 600 weights a second: ten times as fast as on a suspension
    "steepest rise of the force": Scale(
        "tanh(x / (300 weights / s))", lambda x, scene: x / (300.0 * scene.episode.weight), True
    ),
}
"""Scales of a leg that bears the whole weight that differ from other ids', by entry."""

HOP_ENTRIES = tuple(
    replace(entry, scale=SCALES.get(entry.name, entry.scale))
    for entry in ENTRIES
    if entry.name != "bearing allowance"
)
"""Entries that can be observed on `HorseLegHop-v0`."""

BALANCE_ENTRIES = (
    *HOP_ENTRIES,
    Entry("pitch", "trunk", "rad", lambda s: s.trunk.state.moving.pitch, tanh_of(0.3)),
    Entry("pitch rate", "trunk", "rad/s", lambda s: s.trunk.report.pitch_rate, tanh_of(2.0)),
)
"""Entries that can be observed of a leg under a trunk that pitches."""
