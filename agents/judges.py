"""Figures of living horses, read from `agents/judges.json`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

Bars = dict[str, list[tuple[float, float]]]
"""Ranges in which a figure may lie, by its name: one of each source."""

JUDGES = Path(__file__).with_name("judges.json")


def read_judges() -> dict[str, Any]:
    """Return all of the file."""
    return dict(json.loads(JUDGES.read_text(encoding="utf-8")))


def of_speeds(judges: dict[str, Any]) -> list[tuple[float, dict[str, Any]]]:
    """Return Froude numbers and figures of a group that is listed by Froude numbers."""
    return [
        (float(froude), judge) for froude, judge in judges.items() if froude not in ("source", "searched")
    ]


def nearest_of(judges: dict[str, Any], froude: float) -> dict[str, Any]:
    """Return the figures at the Froude number nearest to `froude` of a group that is listed by these."""
    return min(of_speeds(judges), key=lambda one: abs(one[0] - froude))[1]


def searched_bars(kind: str, froude: float) -> Bars:
    """Return what a search for a "walk" or a "trot" at a Froude number is given: the bars of the rows that
    are marked `searched`."""
    judges = read_judges()
    bars: Bars = {}
    for name, judge in judges[kind].items():
        if not isinstance(judge, dict) or not judge.get("searched"):
            continue
        names = ("duty_fore", "duty_hind") if name == "duty" else (name,)
        bars |= {each: [tuple(judge["bar"])] for each in names}
    if kind == "trot":
        for group, names in (("duty", ("duty_fore", "duty_hind")), ("stride_over_hip", ("stride_over_hip",))):
            judge = nearest_of(judges[group], froude)
            bars |= {each: [(x - judge["bar"], x + judge["bar"]) for x in judge["horse"]] for each in names}
    return bars
