"""News of a page as one list of numbers.

Bokeh sends a header and a part of its own for each column of a source. A horse has forty columns, which are
news many times a second: one list for all of them costs the server and the browser much less.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.render.instant import Columns

HEAD = 3
"""Numbers before all others: 1 if curves and rewards begin anew, and how many rows both have."""


class News(NamedTuple):
    """News of a page.

    Attributes:
        row: row of the scene, see `drawing.Drawing`.
        curves, steps: new rows of curves and of the reward's terms, by name; {} for none.
        totals: sums of the terms over the episode.
        anew: True if curves and terms replace those that the page has.
    """

    row: NDArray[Any]
    curves: Columns
    steps: Columns
    totals: Iterable[float]
    anew: bool = False

    def packed(self) -> NDArray[np.float64]:
        """Return all numbers, one column after the other, in the order that `names_of` says."""
        counts = [len(columns.get("time", ())) for columns in (self.curves, self.steps)]
        head = np.array([self.anew, *counts], float)
        totals = np.array([*self.totals])
        return np.concatenate([head, self.row, *self.curves.values(), *self.steps.values(), totals])


def names_of(news: News) -> Mapping[str, Any]:
    """Return what a page needs to unpack its news: the length of a row, and names of columns."""
    return {"row": len(news.row), "curves": [*news.curves], "steps": [*news.steps]}
