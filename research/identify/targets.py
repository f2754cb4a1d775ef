"""The numbers that a search aims at: rows in the format of `hoof_env/paper/published.json`, with weights."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from hoof_env.errors import DataFileError, ParameterError, check_number
from hoof_env.paper.published import PublishedRow, load_published, read_row

PERIOD = 1.0
"""Duration of the cycle that the rows describe [s]."""


@dataclass(frozen=True)
class Targets:
    """What a search aims at.

    Attributes:
        rows: the numbers with their bars; at least one has a bar.
        weights: one a row, positive [-].
        digest: tells one set of targets from another, 16 hexadecimal digits.
    """

    rows: tuple[PublishedRow, ...]
    weights: tuple[float, ...]
    digest: str


def load_targets(path: Path | str | None = None) -> Targets:
    """Read targets from a JSON file with a list "rows", by default the paper's numbers.

    A row is written as in `published.json`; its optional "weight" is 1 if left out.

    Raises:
        DataFileError: the file is unreadable, lacks rows, or has an unknown, incomplete, repeated or
            contradictory one.
    """
    file: Any = resources.files("hoof_env.paper").joinpath("published.json") if path is None else Path(path)
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataFileError(f"cannot read {file}: {error.strerror or error}") from None
    except (ValueError, RecursionError) as error:
        raise DataFileError(
            f"{file}: expected JSON with a list 'rows', but it does not parse: {error}"
        ) from None
    entries = data.get("rows") if isinstance(data, dict) else None
    if not isinstance(entries, list) or not entries:
        raise DataFileError(f"{file}: expected an object with a list 'rows' of at least one row")
    known = {row.id: row for row in load_published().rows}
    rows: list[PublishedRow] = []
    weights: list[float] = []
    for number, entry in enumerate(entries, 1):
        try:
            rows.append(_read(entry, known, {row.id for row in rows}))
            weights.append(
                check_number("weight", entry.get("weight", 1.0), low=0, high=1e6, exclusive_low=True)
            )
        except ParameterError as error:
            name = entry.get("id") if isinstance(entry, dict) else None
            raise DataFileError(f"{file}: row {number} ({name or 'without id'}): {error}") from None
    for problem in _contradictions({row.id: row for row in rows}):
        raise DataFileError(f"{file}: {problem}")
    if all(row.bar.limit is None for row in rows):
        raise DataFileError(f"{file}: every bar is 'reported'; expected a row with a bar, like '2 %'")
    return Targets(tuple(rows), tuple(weights), _digest(rows, weights))


def _read(entry: Any, known: dict[str, PublishedRow], seen: set[str]) -> PublishedRow:
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
    if entry["id"] in seen:
        raise ParameterError("id: expected every id once, got it twice")
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
        for name, parts in _DERIVED.items():
            row, sources = rows.get(f"{gait}.{name}"), [rows.get(f"{gait}.{part}") for part in parts]
            barred = [source for source in sources if source is not None and source.bar.limit is not None]
            if row is None or row.bar.limit is None or len(barred) < len(parts):
                continue
            # monotonic in both, falling in the first and rising in the second: the ends are at opposite ends
            (a_low, a_high), (b_low, b_high) = map(_range, barred)
            low, high = (_COMBINED[name](a, b) for a, b in ((a_high, b_low), (a_low, b_high)))
            if not low - row.bar.limit <= row.value <= high + row.bar.limit:
                given = " and ".join(source.id for source in barred)
                yield (
                    f"row {row.id}: got {row.value:g} with bar {row.bar_text}, but {given} with their bars "
                    f"leave {low:.4g} to {high:.4g}"
                )


_DERIVED = {
    "duty": ("contact_start", "contact_end"),
    "reduction": ("peak_elastic", "peak_inelastic"),
    "angle_variation": ("angle_contact", "angle_liftoff"),
}
_COMBINED = {
    "duty": lambda start, end: (end - start) / PERIOD,
    "reduction": lambda elastic, inelastic: 100 * (inelastic - elastic) / inelastic,
    "angle_variation": lambda contact, liftoff: liftoff - contact,
}


def _range(row: PublishedRow) -> tuple[float, float]:
    """Lowest and highest value within the bar."""
    margin = row.bar.limit or 0.0
    if row.bar.measure == "%":
        margin *= row.value / 100
    return row.value - margin, row.value + margin


def _digest(rows: list[PublishedRow], weights: list[float]) -> str:
    content = [[row.id, row.value, row.bar_text, weight] for row, weight in zip(rows, weights, strict=True)]
    return hashlib.sha256(json.dumps(sorted(content)).encode()).hexdigest()[:16]
