"""What rows cannot depend on, and how they must, whatever the leg, beside what was measured."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

GROUND_PARAMETERS = ("stiffness", "exponent", "friction", "friction_slow", "friction_fast")

TOLERANCE = 1e-9
"""A law holds if no elasticity is further off; all are exact but for round-off."""


@dataclass(frozen=True)
class Law:
    """One law.

    Attributes:
        rows: which rows, in words. pattern: found in their ids and no others; resultants end in ".resultant".
        parameters: those that they answer to alike.
        elasticity: relative change of the row per relative change of the parameter [-]. reason: why.
    """

    rows: str
    pattern: str
    parameters: tuple[str, ...]
    elasticity: float
    reason: str


NORMAL = r"(peak|mean)_\w+$|reduction$"
LAWS = (
    Law(
        "times, angles, duty factors",
        "contact|angle|duty",
        GROUND_PARAMETERS,
        0.0,
        "the trunk is fixed and the motion prescribed: the ground moves nothing",
    ),
    Law(
        "normal forces, their reductions",
        NORMAL,
        ("friction", "friction_slow", "friction_fast"),
        0.0,
        "Eq. 14 does not contain friction, and friction moves nothing",
    ),
    Law(
        "normal forces, resultants",
        "peak|mean",
        ("stiffness",),
        1.0,
        "Eq. 14 is proportional to K, friction to the normal force",
    ),
    Law("all reductions", "reduction", ("stiffness",), 0.0, "K cancels"),
    Law(
        "contact times",
        "contact_(start|end)",
        ("crank_speed",),
        -1.0,
        "the same crank angles come earlier",
    ),
    Law(
        "angles, duty factors",
        "angle|duty",
        ("crank_speed",),
        0.0,
        "positions follow from the crank angle alone",
    ),
    Law(
        "normal forces, their reductions",
        NORMAL,
        ("crank_speed",),
        0.0,
        "Eq. 14 takes speeds as v/v₀ only, as long as v₀ is above its floor",
    ),
)


def confirm(rows: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Every law beside the largest deviation from it.

    Args:
        rows: by row id and parameter a dictionary with "elasticity".

    Returns:
        Dictionaries with rows, parameters, expected, reason, members (row ids), deviation and holds.
    """
    result = []
    for law in LAWS:
        members = [row for row in rows if re.search(law.pattern, row)]
        elasticities = [rows[row][parameter]["elasticity"] for row in members for parameter in law.parameters]
        deviation = max(abs(value - law.elasticity) for value in elasticities if math.isfinite(value))
        result.append(
            {
                "rows": law.rows,
                "parameters": list(law.parameters),
                "expected": law.elasticity,
                "reason": law.reason,
                "members": members,
                "deviation": deviation,
                "holds": deviation < TOLERANCE,
            }
        )
    return result
