"""Check of settings that have no effect with the others."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hoof_env.errors import ParameterError
from hoof_env.tasks.settings import NEEDED, Settings


def check_effect(name: str, settings: Settings, within: str = "") -> None:
    """Raise `ParameterError` where a setting that somebody names, perhaps `within` another argument or
    option, has no effect beside the others."""
    if name in ("friction_law", "friction_slow", "friction_fast") and settings.hoof_stiffness is not None:
        named = f"{within}: {name!r}" if within else name
        raise ParameterError(
            f"{named}: expected none with a hoof_stiffness, whose friction needs no sliding speed, got "
            f"hoof_stiffness={settings.hoof_stiffness!r}"
        )
    needed, values = NEEDED.get(name, ("", ()))
    given: Any = getattr(settings, needed, None)
    if needed and (given not in values if values else _is_one(given)):
        good = " or ".join(f"{needed}={value!r}" for value in values) or f"a range of {needed}"
        named = f"{within}: {name!r}" if within else name
        if needed == "trunk" and "free" in (given, *values):  # which no argument changes
            who = "a horse" if given == "free" else "one leg"
            raise ParameterError(f"{named}: expected none of {who}, where it has no effect")
        raise ParameterError(
            f"{named}: expected {good} beside it, without which it has no effect, got {needed}={given!r}"
        )


def _is_one(given: Any) -> bool:
    """Whether nothing can be drawn: no range, or one whose ends are the same."""
    ends = tuple(given) if isinstance(given, Iterable) else (given, given)
    return len(ends) == 2 and bool(ends[0] == ends[1])
