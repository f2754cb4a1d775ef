"""What confines an ensemble beside the numbers it fits: a demand on plausibility, or one end of a row's bar.

A narrow range is no sign that the published numbers determine a value where something else holds it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hoof_env.identify.plausibility import LEG_DEMANDS
from hoof_env.paper.published import CONDITIONS, Published
from hoof_env.paper.reproduce import GAITS

DEMANDED = {"leg.hip_height": "hip_height", "leg.sole": "length.IJ"}
"""What is measured of a leg for a demand, and the quantity of `spread_names.IDENTIFIED` that it is."""

NEAR = 0.01
"""A member is at the bound of a demand within this part of it [-]."""


def held_by_demands(values: Mapping[str, Sequence[float]]) -> list[dict[str, Any]]:
    """Quantities whose extreme member lies at the bound of a demand on plausibility.

    Args:
        values: of all members, by quantity.

    Returns:
        For each: key, bound, most (whether it is an upper bound), why, members (how many are at the bound).
    """
    found = []
    for demand in LEG_DEMANDS:
        key = DEMANDED.get(demand.measured)
        at = [] if key is None else [v for v in values[key] if abs(v - demand.bound) <= NEAR * demand.bound]
        if at:
            entry = {"key": key, "bound": demand.bound, "most": demand.sense < 0, "why": demand.why}
            found.append({**entry, "members": len(at)})
    return found


def one_sided(values: Mapping[str, Sequence[float]], published: Published) -> list[dict[str, Any]]:
    """Peaks and means that every member puts in the outer half of the bar, on the same side.

    Returns:
        For each: row, low and high (errors of the members, in % of the published value).
    """
    found = []
    for gait in GAITS:
        for condition in CONDITIONS:
            # over a cycle of 1 s the impulse in N s is the mean in N
            for name, key in (("peak", "peak"), ("mean", "impulse")):
                row = published.row(f"{gait}.{name}_{condition}")
                errors = [row.bar.error(value, row.value) for value in values[f"{gait}.{condition}.{key}"]]
                half = (row.bar.limit or 0.0) / 2
                if min(errors) > half or max(errors) < -half:
                    found.append({"row": row.id, "low": min(errors), "high": max(errors)})
    return found
