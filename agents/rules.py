"""When figures of a gait count: the policy stays up, keeps its speed and does not slip, and hooves land once
a turn of their crank."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hoof_env.tasks.horse_gaits import PAIRS

MAX_FALLS = 0.10  # share of episodes; survivors of more falls are a biased sample
MAX_ERROR = 0.15  # largest difference from the commanded speed, over that [-]
MAX_SLIP = 0.10  # largest slip of a stance [m]
TURNS = (0.95, 1.05)  # stances a turn
TROT = 0.05  # largest lag of a trot or a pace [strides]


def rejection_reason(figures: Mapping[str, Any], pairs: Sequence[str] = PAIRS) -> str:
    """Return why the figures of these pairs of legs do not count at any speed; an empty text if they do.

    Args:
        figures: "fell", slip and stances a turn of these pairs, and "speed_ratio", the speed over the
            commanded one, or both, "reached" and "speed".
        pairs: fore, hind or both.
    """
    reasons = []
    # Written so that NaN is a reason, too
    if not figures["fell"] <= MAX_FALLS:
        reasons.append(f"fell in {100 * figures['fell']:.3g} % of episodes")
    has_ratio = "speed_ratio" in figures
    speed_ratio = figures["speed_ratio"] if has_ratio else figures["reached"] / figures["speed"]
    if not abs(speed_ratio - 1) <= MAX_ERROR:
        reasons.append(f"{speed_ratio:.2f} of the commanded speed")
    for pair in pairs:
        slip = figures[f"slip_{pair}"]
        stances = figures[f"stances_per_turn_{pair}"]
        if not slip < MAX_SLIP:
            reasons.append(f"{pair} hooves slip {slip:.2f} m")
        if not TURNS[0] <= stances <= TURNS[1]:
            reasons.append(f"{stances:.2f} {pair} stances a turn")
    return ", ".join(reasons)
