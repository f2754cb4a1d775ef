"""Search the leg, the ground level and the gaits that the paper does not print; see docs/paper.md.

python -m research.identify --out runs/identify
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from hoof_env.errors import HoofEnvError
from research.identify.command import check_counts, check_extras, load_start, provenance, run_command
from research.identify.confirm import Confirmation, confirm
from research.identify.leg import FIRST_FIT, to_preset
from research.identify.resume import digest_of, open_state, versions, write_json
from research.identify.search import BUDGET, SCHEDULE, LegProblem, Phase, Result, search

EXPONENT = 1.375  # n of Eq. 14, not printed: with it a leg meets every number, see docs/decisions.md


def identify(
    out: Path,
    start: str = FIRST_FIT,
    seed: int = 0,
    workers: int = 2,
    budget: int = BUDGET,
    resume: bool = False,
) -> None:
    """Search the leg, the ground level and the gaits that the paper does not print (needs 'identify').

    Ends at the first leg that meets every bar with the exact and the paper's solver, or with the budget.

    Args:
        out: folder for identified.json, a preset, and identify.json, how good it is; made if need be. Its
            folder state holds what a killed search is resumed from.
        start: a preset to search around, a name or a JSON file.
        seed: the same seed and options find the same leg, with any number of workers.
        workers: processes.
        budget: evaluations at most; one with the paper's solver counts for several.
        resume: go on with a search in this folder that was interrupted or killed.
    """
    check_extras()
    from tqdm import tqdm

    seed, workers, budget = check_counts(seed=seed, workers=workers, budget=budget)
    choice, x = load_start(start, EXPONENT)
    problem = LegProblem(choice)
    about = {
        "start": f"{Path(start).stem} ({digest_of([asdict(choice), x])})",
        "exponent": EXPONENT,
        "seed": seed,
        "budget": budget,
        "schedule": digest_of([asdict(phase) for phase in SCHEDULE]),
        "versions": versions(),
    }
    state = open_state(out, about, resume=resume, product="identified.json")
    with tqdm(total=budget, disable=None, dynamic_ncols=True) as bar:

        def report(phase: Phase, result: Result) -> None:
            end = ", confirmed by the full system" if result.confirmed else ""
            bar.write(
                f"job {result.id} ({phase.name}): {result.standing}; {result.evaluations} evaluations in "
                f"{result.seconds:.0f} s{end}"
            )
            bar.update(min(phase.weight * result.evaluations, budget - bar.n))

        results = search(problem, x, SCHEDULE, state, report, seed=seed, budget=budget, workers=workers)
    data: dict[str, Any] = {"search": about, "reached": results[-1].confirmed}
    leg = best_leg(problem, results, about)
    if leg is None:
        print("no candidate was found that the full system can simulate")
    else:
        result, preset, verdict = leg
        data |= {"best": result.id, **asdict(verdict)}
        print(f"job {result.id}: {verdict}\n{write_json(out, 'identified', preset)} written")
    data["jobs"] = [asdict(result) for result in results]
    print(f"{write_json(out, 'identify', data)} written")


def best_leg(
    problem: LegProblem, results: Sequence[Result], about: Mapping[str, Any]
) -> tuple[Result, dict[str, Any], Confirmation] | None:
    """What was confirmed, else the best that the full system can run, with its preset and verdict."""
    for result in sorted(results, key=lambda result: (not result.confirmed, result.both)):
        origin = provenance(f"research.identify, job {result.id}", about)
        try:
            preset = to_preset(np.array(result.x), problem.choice, origin)
            return result, preset, confirm(preset)
        except HoofEnvError:  # it does not turn, or a gait is beyond its limits
            continue
    return None


def main(arguments: Sequence[str] | None = None) -> int:
    return run_command(identify, "research.identify", arguments)


if __name__ == "__main__":
    sys.exit(main())
