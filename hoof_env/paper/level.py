"""Dependence of the published rows on the ground level, which decides whether a row tests a leg.

The paper prints no plausible ground level, so the level was fitted with the leg. A row that moves by
more than its bar as the ground moves by up to `SHIFTS` is not determinable: its agreement tests the
fitted ground level, not the leg. These rows are `rows.NOT_DETERMINABLE`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hoof_env.paper.rows import EXACT, Published, Stances, compare

SHIFTS = (-1e-4, -5e-5, -2.5e-5, -1e-5, 1e-5, 2.5e-5, 5e-5, 1e-4)
"""Shifts of the ground level, upwards positive [m]. The paper's own integration misplaces the hoof by
millimetres (`report.largest_drift`)."""


def compare_levels(
    published: Published, rows: Iterable[Mapping[str, Any]], by_shift: Mapping[float, Stances]
) -> list[dict[str, Any]]:
    """Compare the rows that have a bar at several ground levels, with the exact solver.

    Args:
        published: the published numbers.
        rows: `rows.compare` at the fitted level, of any solvers.
        by_shift: measured cycles of the exact solver by the shift of the ground [m].

    Returns:
        A dictionary for each row with values: "shifts_um", and at each of them "simulated" and "within_bar";
        "moved" is the largest change of its error, in bars, and "determinable" is True if that is one or
        less.
    """
    fitted = {row["id"]: row for row in rows if row["solver"] == EXACT}
    found = [{row["id"]: row for row in compare(published, stances, EXACT)} for stances in by_shift.values()]
    entries = []
    for row in published.rows:
        limit = row.bar.limit
        here = [shifted[row.id] for shifted in found]
        errors = [entry["error"] for entry in (fitted[row.id], *here)]
        if limit is None or None in errors:
            continue
        moved = max(abs(error - errors[0]) for error in errors[1:]) / limit
        entries.append(
            {
                "kind": "level",
                "id": row.id,
                "solver": EXACT,
                "shifts_um": [round(1e6 * shift) for shift in by_shift],
                "simulated": [entry["simulated"] for entry in here],
                "within_bar": [abs(error) <= limit for error in errors[1:]],
                "moved": moved,
                "determinable": moved <= 1,
            }
        )
    return entries


def level_line(levels: Iterable[Mapping[str, Any]]) -> str:
    """Return a line on how far rows move within the shifts of the ground level."""
    entries = list(levels)
    lost = [entry for entry in entries if not entry["determinable"]]
    rest = [entry for entry in entries if entry["determinable"]]
    moved = ", ".join(f"{entry['id']} by {entry['moved']:.1f} bars" for entry in lost)
    most = max((entry["moved"] for entry in rest), default=0.0)
    return (
        f"{EXACT}, ground level within {1e3 * max(SHIFTS):g} mm: {moved or 'no row moves by a bar'}; "
        f"the other {len(rest)} rows by {most:.2f} bars at most"
    )
