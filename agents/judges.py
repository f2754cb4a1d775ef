"""Figures of living horses, read from `agents/judges.json`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

JUDGES = Path(__file__).with_name("judges.json")


def read_judges() -> dict[str, Any]:
    """Return all of the file."""
    return dict(json.loads(JUDGES.read_text(encoding="utf-8")))


def of_speeds(judges: dict[str, Any]) -> list[tuple[float, dict[str, Any]]]:
    """Return Froude numbers and figures of a group that is listed by Froude numbers."""
    return [(float(froude), judge) for froude, judge in judges.items() if froude != "source"]
