"""Check for settings that have no effect under the remaining settings."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hoof_env.errors import ParameterError
from hoof_env.tasks.body_settings import GIVEN
from hoof_env.tasks.settings import NEEDED, Settings


def check_effect(name: str, settings: Settings, within: str = "") -> None:
    """Check that a setting has an effect under the remaining settings.

    Args:
        name: name of the setting.
        settings: all settings, this one included.
        within: argument or option that contains the setting, for the message; "" if it is passed directly.

    Raises:
        ParameterError: the setting has no effect.
    """
    # Not in `NEEDED`, which has lists of values: here any number disables the laws that the settings are for.
    if name in ("friction_law", "friction_slow", "friction_fast") and settings.hoof_stiffness is not None:
        named = f"{within}: {name!r}" if within else name
        raise ParameterError(
            f"{named}: expected none with a hoof_stiffness, whose friction needs no sliding speed, got "
            f"hoof_stiffness={settings.hoof_stiffness!r}"
        )
    needed, values = NEEDED.get(name, ("", ()))
    present: Any = getattr(settings, needed, None)
    if needed and not _has_effect(present, values):
        good = " or ".join(f"{needed}={value!r}" for value in values) or f"a range of {needed}"
        good = f"a {needed}" if values == GIVEN else good
        named = f"{within}: {name!r}" if within else name
        # The trunk is part of the task: the message cannot suggest another.
        if needed == "trunk" and "free" in (present, *values) and present != "fixed":
            body = "a horse" if present == "free" else "one leg"
            raise ParameterError(f"{named}: expected none for {body}, where it has no effect")
        raise ParameterError(
            f"{named}: expected {good}, without which it has no effect, got {needed}={present!r}"
        )


def _has_effect(present: Any, values: tuple[str, ...]) -> bool:
    """Return whether a setting has one of the values in `About.needs`."""
    if values == GIVEN:
        return present is not None
    return present in values if values else not _is_one(present)


def _is_one(value: Any) -> bool:
    """Return whether a value is single: a number, None, or a range with equal ends."""
    ends = tuple(value) if isinstance(value, Iterable) else (value, value)
    return len(ends) == 2 and bool(ends[0] == ends[1])
