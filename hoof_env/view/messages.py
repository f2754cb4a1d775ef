"""Messages for the live page: texts of errors and warnings."""

from __future__ import annotations

import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from hoof_env.errors import HoofEnvError


def error_text(error: BaseException) -> str:
    """Return the text of an error for the page. If this package did not cause the error, print its trace in
    the terminal, for the authors of the policy or the contact law."""
    is_own = isinstance(error, HoofEnvError)
    if not is_own or error.__cause__ is not None:
        traceback.print_exception(error)
    return str(error) if is_own else f"{type(error).__name__}: {error}"


@contextmanager
def collect_warnings() -> Iterator[list[str]]:
    """Collect warnings; yield a list, which has their texts after the block.

    Python's warning filters are common to all threads. Where the blocks of two tabs overlap in time, one tab
    may get the warnings of the other, and later warnings may not reach the terminal.
    """
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            yield texts
        finally:
            texts += [str(warning.message) for warning in caught]
