"""Arguments of commands that hold settings: key=value items and JSON objects."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from hoof_env.errors import ParameterError


def parse_pairs(option: str, items: Sequence[str]) -> dict[str, Any]:
    """Read `key=value` items, or JSON objects, into one mapping; a value that is not JSON is kept as text.

    >>> parse_pairs("--args", ["trunk=rail", "restitution=0.5", '{"render_mode": null}'])
    {'trunk': 'rail', 'restitution': 0.5, 'render_mode': None}

    Raises:
        ParameterError: an item is neither.
    """
    pairs: dict[str, Any] = {}
    for item in items:
        key, equals, text = item.partition("=")
        why = ""
        if item.lstrip().startswith("{"):
            try:
                pairs.update(json.loads(item))
                continue
            except ValueError as error:
                why = f" ({error})"
        elif equals and key.isidentifier():
            try:
                pairs[key] = json.loads(text)
            except ValueError:
                pairs[key] = text
            continue
        raise ParameterError(f"{option}: expected a JSON object or key=value, got {item!r}{why}")
    return pairs
