"""`python -m research.identify`: the search."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from research.identify.run import run, say

NAME = "python -m research.identify"


def search(
    out: Path,
    start: str = "first_fit",
    seed: int = 0,
    targets: Path | None = None,
    walk: Literal["walks", "brakes"] = "walks",
    exponent: float = 1.375,
    beta: Literal["printed", "probable"] = "probable",
    workers: int = 2,
    budget: int | None = None,
    resume: bool = False,
    keep_going: bool = False,
) -> None:
    """Search for the leg, the ground level and the gaits that the paper does not print (needs 'identify').

    Ends at the first leg that meets every bar with the exact and the paper's solver, or with the budget.

    Args:
        out: folder for identified.json (a preset), identify.json and identify.md; made if need be.
        start: where to search: around a preset (a name or a JSON file), or "cold" for anywhere.
        seed: the same seed and options find the same leg, with any number of workers.
        targets: JSON file of the rows to meet, as published.json, each with an optional weight.
        walk: a walk that moves its animal, or one that brakes through its stance (figure 6 read literally).
        exponent: of the contact law (Eq. 14), which the paper does not print.
        beta: of the paper's solver: as printed, sqrt(2 alpha), or as it is probably meant, sqrt(2) alpha.
        workers: processes.
        budget: evaluations at most; one with the paper's solver counts for several.
        resume: go on with a search in this folder that was interrupted or killed.
        keep_going: spend the whole budget: the leg furthest inside the bars, and how many starts meet them.
    """
    from research.identify.command import identify

    paths = identify(
        out, say, start=start, seed=seed, targets=targets, walk=walk, exponent=exponent, beta=beta,
        workers=workers, budget=budget, resume=resume, keep_going=keep_going,
    )  # fmt: skip
    say(f"{len(paths)} files written; read {out / 'identify.md'} first")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return run(search, NAME, arguments)


if __name__ == "__main__":
    sys.exit(main())
