"""Words for what goes wrong on a page."""

from __future__ import annotations

import traceback

from hoof_env.errors import HoofEnvError


def words_of(error: Exception) -> str:
    """Return what a page says of an error. Where a cause is not of this package, the terminal gets the whole
    trace, from which authors of a policy or of a law see where it comes from."""
    is_told = isinstance(error, HoofEnvError)
    if not is_told or error.__cause__ is not None:
        traceback.print_exception(error)
    return str(error) if is_told else f"{type(error).__name__}: {error}"
