"""Page docs/evidence/jax.md and its pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

Found = dict[str, Any]


def draw(found: Found, folder: Path) -> None:
    """Draw what was measured."""


def page(found: Found) -> str:
    """Return the page of what was measured."""
    return ""
