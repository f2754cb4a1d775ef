"""What a search says while it runs: a bar on a terminal, elsewhere a line for each finished job."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from research.identify.records import Job, Progress, Result, Standing

_FORMAT = "{desc} {percentage:3.0f}%|{bar:12}| {elapsed}<{remaining}"


def describe(standing: Standing) -> str:
    """Rows within their bars, and what is furthest from its own."""
    parts = [f"{standing.within} of {standing.of} rows within their bars"]
    if standing.within < standing.of:
        parts.append(f"worst {standing.worst} {standing.error:+.2f} bars")
    if standing.short > 0:
        parts.append(f"plausibility short by {standing.short:.2g}")
    return ", ".join(parts)


class Monitor:
    """Watches a search.

    Args:
        budget: evaluations. say: takes one line. bar: draw a progress bar on the standard error instead;
            None does so on a terminal.
    """

    def __init__(self, budget: int, say: Callable[[str], None], bar: bool | None = None) -> None:
        self._budget, self._say = budget, say
        self._weights: dict[str, int] = {}
        self._spent: dict[str, int] = {}
        self._best: dict[int, Standing] = {}
        self._bar: Any = None
        if sys.stderr.isatty() if bar is None else bar:
            from tqdm import tqdm

            self._bar = tqdm(desc="starting", total=budget, dynamic_ncols=True, bar_format=_FORMAT)

    def __enter__(self) -> Monitor:
        return self

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def planned(self, jobs: list[Job]) -> None:
        self._weights = {job.id: job.phase.weight for job in jobs}

    def running(self, progress: Progress) -> None:
        self._count(progress.id, progress.evaluations)
        self._mark(progress.standing)

    def finished(self, result: Result) -> None:
        self._count(result.id, result.evaluations)
        standings = [result.standing, *([result.both] if result.both and result.standing.met else [])]
        for standing in standings:
            self._mark(standing)
        if self._bar is None:
            self._say(
                f"job {result.id} ({result.phase}): {describe(standings[-1])}; "
                f"{result.evaluations} evaluations in {result.seconds:.0f} s"
                + (", confirmed by the full system" if result.confirmed else "")
            )

    def _count(self, job_id: str, evaluations: int) -> None:
        self._spent[job_id] = self._weights[job_id] * evaluations
        if self._bar is not None:
            self._bar.n = min(sum(self._spent.values()), self._budget)
            self._bar.refresh()

    def _mark(self, standing: Standing) -> None:
        """Show the best so far, with the exact solver alone and, once there is one, with both."""
        best = self._best.get(standing.of)
        if best is None or standing.excess < best.excess:
            self._best[standing.of] = standing
            if self._bar is not None:
                parts = (
                    f"{s.within}/{s.of} rows, worst {s.worst} {s.error:+.2f} bars"
                    for _, s in sorted(self._best.items())
                )
                self._bar.set_description_str(f"best: {'; '.join(parts)}")
