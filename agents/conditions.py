"""When figures of a gait count beside a horse's: where the policy stays up and keeps the commanded speed, the
hooves stand and land once a turn of their crank, and the speed is about that of the horse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

MOST_FALLS = 0.10  # share of episodes; what is left of more of them is luck
MOST_OFF = 0.15  # from the commanded speed, over that [-]
MOST_SLIP = 0.10  # a stance [m]
TURNS = (0.95, 1.05)  # stances a turn
NEAR = 0.1  # between Froude numbers, of the speed reached and of the horse


def rejection_reason(figures: dict[str, Any], pairs: Sequence[str]) -> str:
    """Why the figures of these pairs of legs do not count at any speed; empty where they do."""
    found = []
    if figures["fell"] > MOST_FALLS:
        found.append(f"fell in {100 * figures['fell']:.3g} % of episodes")
    kept = figures["reached"] / figures["speed"]
    if not abs(kept - 1) <= MOST_OFF:
        found.append(f"{kept:.2f} of the commanded speed")
    for pair in pairs:
        slip = figures[f"slip_{pair}"]
        stances = figures[f"stances_per_turn_{pair}"]
        if not slip < MOST_SLIP:
            found.append(f"{pair} hooves slip {slip:.2f} m")
        if not TURNS[0] <= stances <= TURNS[1]:
            found.append(f"{stances:.2f} {pair} stances a turn")
    return ", ".join(found)


def distance(figures: dict[str, Any], froude: float) -> float:
    """Between the Froude number that was reached and another."""
    return abs(float(figures["froude_reached"]) - froude)
