"""Times of day, durations and dates in text, as seconds."""

from __future__ import annotations

import re
from datetime import date

SECONDS_A_DAY = 86_400.0

DATE = (
    r"(?P<year>\d{4})-(?P<month>\d\d?)-(?P<day>\d\d?)",
    r"(?P<day>\d\d?)\.(?P<month>\d\d?)\.(?P<year>\d{4})",
    r"(?P<month>\d\d?)/(?P<day>\d\d?)/(?P<year>\d{4})",
)
"""Patterns of dates: 2024-05-31, 31.5.2024 and 5/31/2024."""

TIME = r"(?:(?P<hours>\d+):)?(?P<minutes>\d+):(?P<seconds>\d+(?:[.,]\d*)?)(?:\s*(?P<half>[AaPp])[Mm])?"
"""Pattern of 12:34:56.789, also with AM or PM, and of 34:56.789 without hours."""

ZONE = r"(?:\s*(?:Z|UTC|[+-]\d\d:?\d\d))?"
"""Pattern of a time zone, which changes no difference of times."""

PATTERNS = (
    re.compile(rf"(?:(?P<days>\d+)\s+days?,?\s+)?{TIME}"),
    *(re.compile(rf"{day}(?:T|\s+){TIME}{ZONE}") for day in DATE),
)
"""Patterns of durations, as 0 days 00:00:01.5, and of dates with times."""


def moment(text: str) -> tuple[int, float] | None:
    """Return a time as days and seconds, None if the text is none.

    Days are a duration's, or a date's since the year 1.
    """
    bare = text.strip()
    # Most cells are numbers.
    if ":" not in bare:
        return None
    for pattern in PATTERNS:
        if (match := pattern.fullmatch(bare)) is None:
            continue
        part = match.groupdict()
        days = int(part.get("days") or 0)
        if "year" in part:
            try:
                days = date(int(part["year"]), int(part["month"]), int(part["day"])).toordinal()
            except ValueError:
                return None
        seconds = float(part["seconds"].replace(",", "."))
        hours = int(part["hours"] or 0)
        if part["half"]:
            hours = hours % 12 + (12 if part["half"] in "Pp" else 0)
        return days, 3600.0 * hours + 60.0 * int(part["minutes"]) + seconds
    return None


def seconds_of(cells: list[str]) -> tuple[list[float], date | None]:
    """Return times as seconds since the midnight of the first day, and that day if they have dates.

    Times of day without a date go on after midnight.

    Raises:
        ValueError: a cell is no time; the argument of the error is its number.
    """
    moments = []
    for k, cell in enumerate(cells):
        if (read := moment(cell)) is None:
            raise ValueError(k)
        moments.append(read)
    first = moments[0][0] if moments else 0
    has_dates = first > 366  # days since the year 1
    times: list[float] = []
    ahead = 0.0
    for days, seconds in moments:
        at = SECONDS_A_DAY * (days - (first if has_dates else 0)) + seconds + ahead
        if times and not has_dates and at < times[-1] - SECONDS_A_DAY / 2:
            at += SECONDS_A_DAY
            ahead += SECONDS_A_DAY
        times.append(at)
    return times, date.fromordinal(first) if has_dates else None
