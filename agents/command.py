"""What the commands of this folder share: key=value arguments, one line for an error, 130 for Ctrl-C."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from hoof_env.errors import HoofEnvError, ParameterError


def run(command: Callable[[], int | None]) -> NoReturn:
    """Exit with what `command` returns: one line and 2 for an error of ours, one line and 130 for Ctrl-C."""
    try:
        code = command() or 0
    except HoofEnvError as error:
        print(f"error: {error}", file=sys.stderr)
        code = 2
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        code = 130
    sys.exit(code)


def parse_pairs(option: str, items: Sequence[str]) -> dict[str, Any]:
    """Read `key=value` items, or JSON objects, into one mapping; a value that is not JSON is kept as text.

    >>> parse_pairs("--env-kwargs", ["trunk=rail", "restitution=0.5", '{"render_mode": null}'])
    {'trunk': 'rail', 'restitution': 0.5, 'render_mode': None}

    Raises:
        ParameterError: an item is neither.
    """
    pairs: dict[str, Any] = {}
    for item in items:
        if item.lstrip().startswith("{"):
            try:
                pairs.update(json.loads(item))
            except json.JSONDecodeError as error:
                raise ParameterError(
                    f"{option}: expected a JSON object or key=value, got {item!r} ({error})"
                ) from None
            continue
        key, equals, text = item.partition("=")
        if not equals or not key.isidentifier():
            raise ParameterError(f"{option}: expected a JSON object or key=value, got {item!r}")
        try:
            pairs[key] = json.loads(text)
        except json.JSONDecodeError:
            pairs[key] = text
    return pairs
