"""Python's garbage collector, which looks again and again through objects that stay."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

MANY = 20_000
"""Objects that only the import of a large library makes: a model or an environment makes fewer."""


@contextmanager
def paused() -> Iterator[None]:
    """Keep the collector off while many objects are made that stay, as in a compilation or in the import of
    torch: it would take a fifth of the time and find nothing. Decorates functions, too."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            if gc.get_count()[0] > MANY and not gc.get_freeze_count():
                # Makes them old without a look at each, as three collections would
                gc.freeze()
                gc.unfreeze()
            gc.enable()
