"""`python -m research.identify.collect`: the ensemble."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from research.identify.run import run, say

NAME = "python -m research.identify.collect"


def collect(
    out: Path,
    preset: str,
    starts: tuple[str, ...] = (),
    size: int = 24,
    bar: float = 1.0,
    both: bool = False,
    walk: Literal["walks", "brakes"] = "walks",
    beta: Literal["printed", "probable"] = "probable",
    targets: Path | None = None,
    seed: int = 0,
    attempts: int = 240,
    workers: int = 2,
    resume: bool = False,
) -> None:
    """Collect legs that fit the published numbers, far apart: what those leave open (needs 'identify').

    Args:
        out: folder for ensemble.json; made if need be.
        preset: the leg to begin with, a name or a JSON file; all members stand on its ground.
        starts: more of them, or folders of `python -m research.identify`, whose independent starts all count.
        size: members wanted.
        bar: largest error of a row, in units of its own bar.
        both: rows count with the paper's solver too, all but the ill-conditioned.
        walk: a walk that moves its animal, or one that brakes through its stance (figure 6 read literally).
        beta: of the paper's solver: as printed, sqrt(2 alpha), or as it is probably meant, sqrt(2) alpha.
        targets: JSON file of the rows to meet, as published.json.
        seed: the same seed and options find the same legs, with any number of workers.
        attempts: to find a further leg; the members are chosen among all that were found.
        workers: processes.
        resume: go on with a collection in this folder that was interrupted or killed.
    """
    from research.identify.ensemble_command import ensemble

    paths = ensemble(
        out, say, preset=preset, starts=starts, size=size, bar=bar, both=both, walk=walk, beta=beta,
        targets=targets, seed=seed, attempts=attempts, workers=workers, resume=resume,
    )  # fmt: skip
    say(f"{paths[0]} written")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return run(collect, NAME, arguments)


if __name__ == "__main__":
    sys.exit(main())
