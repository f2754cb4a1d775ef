"""Figures of living horses, as `agents/judges.json` has them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

JUDGES = Path(__file__).with_name("judges.json")


def read_judges() -> dict[str, Any]:
    """All of the file."""
    return dict(json.loads(JUDGES.read_text(encoding="utf-8")))


def of_speeds(judges: dict[str, Any]) -> list[tuple[float, dict[str, Any]]]:
    """Those of a group that goes by Froude numbers, with these."""
    return [(float(froude), judge) for froude, judge in judges.items() if froude != "source"]
