"""The numbers that a search aims at: rows in the format of `hoof_env/paper/published.json`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hoof_env.errors import DataFileError, ParameterError, check_number
from hoof_env.paper.rows import PublishedRow, load_published, read_row
from research.identify.state import read_json

Rows = tuple[PublishedRow, ...]

PERIOD = 1.0
"""Duration of the cycle that the rows describe [s]."""

_DERIVED = {
    "duty": (("contact_start", "contact_end"), lambda start, end: (end - start) / PERIOD),
    "reduction": (("peak_elastic", "peak_inelastic"), lambda el, inel: 100 * (inel - el) / inel),
    "angle_variation": (("angle_contact", "angle_liftoff"), lambda contact, liftoff: liftoff - contact),
}
"""Rows that follow from two others, each falling in the first and rising in the second."""


def load_targets(path: Path | str | None = None) -> Rows:
    """Read targets from a JSON file with a list "rows", by default the paper's numbers.

    Raises:
        DataFileError: the file is unreadable, lacks rows, or has an unknown, incomplete, repeated or
            contradictory one.
    """
    known = {row.id: row for row in load_published().rows}
    if path is None:
        return tuple(known.values())
    data = read_json(Path(path), "expected JSON with a list 'rows'")
    entries = data.get("rows") if isinstance(data, dict) else None
    if not isinstance(entries, list) or not entries:
        raise DataFileError(f"{path}: expected an object with a list 'rows' of at least one row")
    rows: dict[str, PublishedRow] = {}
    for number, entry in enumerate(entries, 1):
        try:
            row = _read(entry, known)
            if row.id in rows:
                raise ParameterError("id: expected every id once, got it twice")
        except ParameterError as error:
            name = entry.get("id") if isinstance(entry, dict) else None
            raise DataFileError(f"{path}: row {number} ({name or 'without id'}): {error}") from None
        rows[row.id] = row
    for problem in _contradictions(rows):
        raise DataFileError(f"{path}: {problem}")
    if all(row.bar.limit is None for row in rows.values()):
        raise DataFileError(f"{path}: every bar is 'reported'; expected a row with a bar, like '2 %'")
    return tuple(rows.values())


def _read(entry: Any, known: dict[str, PublishedRow]) -> PublishedRow:
    if not isinstance(entry, dict):
        raise ParameterError(f"expected an object with id, published and bar, got {entry!r}")
    missing = [key for key in ("id", "gait", "quantity", "unit", "published", "bar") if key not in entry]
    if missing:
        raise ParameterError(f"expected also {', '.join(missing)}")
    for key in ("id", "unit", "quantity"):
        if not isinstance(entry[key], str):
            raise ParameterError(f"{key}: expected a string, got {entry[key]!r}")
    if entry["id"] not in known:
        raise ParameterError(f"id: expected one of {', '.join(known)}, got {entry['id']!r}")
    for key in ("published", "read_as"):
        check_number(key, entry.get(key, 0.0))
    row, paper = read_row(entry), known[entry["id"]]
    for key in ("gait", "unit", "condition"):
        if getattr(row, key) != getattr(paper, key):
            raise ParameterError(f"{key}: expected {getattr(paper, key)!r}, got {getattr(row, key)!r}")
    if row.bar.limit == 0:
        raise ParameterError(f"bar: expected more than 0, got {row.bar_text!r}")
    if row.unit == "s" and not 0 <= row.value <= PERIOD:
        raise ParameterError(f"published: expected an instant from 0 to {PERIOD:g} s, got {row.value:g}")
    if row.unit == "N" and row.value <= 0:
        raise ParameterError(f"published: expected a force above 0 N, got {row.value:g}")
    return row


def _contradictions(rows: dict[str, PublishedRow]) -> Iterator[str]:
    """One sentence for each pair or triple of rows that no leg could meet together."""
    for gait in ("walk", "run"):
        start, end = rows.get(f"{gait}.contact_start"), rows.get(f"{gait}.contact_end")
        if start and end and end.value <= start.value:
            yield f"row {end.id}: expected later than {start.id}, {start.value:g} s, got {end.value:g} s"
        for condition in ("elastic", "inelastic"):
            peak, mean = rows.get(f"{gait}.peak_{condition}"), rows.get(f"{gait}.mean_{condition}")
            if peak and mean and mean.value > peak.value:
                yield f"row {mean.id}: expected at most {peak.id}, {peak.value:g} N, got {mean.value:g} N"
        for name, (parts, combine) in _DERIVED.items():
            of = [rows[f"{gait}.{part}"] for part in (name, *parts) if f"{gait}.{part}" in rows]
            if len(of) < 3 or any(row.bar.limit is None for row in of):
                continue
            row, first, second = of
            (a_low, a_high), (b_low, b_high), margin = _range(first), _range(second), row.bar.limit or 0.0
            low, high = combine(a_high, b_low), combine(a_low, b_high)
            if not low - margin <= row.value <= high + margin:
                yield (
                    f"row {row.id}: got {row.value:g} with bar {row.bar_text}, but {first.id} and "
                    f"{second.id} with their bars leave {low:.4g} to {high:.4g}"
                )


def _range(row: PublishedRow) -> tuple[float, float]:
    """Lowest and highest value within the bar."""
    margin = (row.bar.limit or 0.0) * (row.value / 100 if row.bar.measure == "%" else 1.0)
    return row.value - margin, row.value + margin
