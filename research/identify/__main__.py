"""Search the leg, the ground level and the gaits that the paper does not print.

    python -m research.identify --out runs/identify

It ends at the first leg that meets every bar with the exact and the paper's solver, or with the budget; after
a kill the same command goes on with --resume. See docs/identification.md.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hoof_env.errors import HoofEnvError, ParameterError, check_number
from hoof_env.simd.math import EXPONENT_UNIT
from research.identify.confirm import Confirmation, confirm
from research.identify.job import Result
from research.identify.leg import Choice, encode, to_preset
from research.identify.problem import EXPONENT, LegProblem
from research.identify.run import check_counts, check_extras, run
from research.identify.schedule import BEYOND, BUDGET, COLD, FROM_PRESET
from research.identify.search import Outcome, search
from research.identify.state import digest_of, open_state, versions, write_json
from research.identify.targets import load_targets


def identify(
    out: Path,
    start: str = "first_fit",
    seed: int = 0,
    targets: Path | None = None,
    walk: Literal["walks", "brakes"] = "walks",
    exponent: float = EXPONENT,
    beta: Literal["printed", "probable"] = "probable",
    workers: int = 2,
    budget: int = BUDGET,
    resume: bool = False,
    keep_going: bool = False,
) -> None:
    """Search the leg, the ground level and the gaits that the paper does not print (needs 'identify').

    Ends at the first leg that meets every bar with the exact and the paper's solver, or with the budget.

    Args:
        out: folder for identified.json, a preset, and identify.json, how good it is; made if need be. Its
            folder state holds what a killed search is resumed from.
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
    check_extras()
    from tqdm import tqdm

    seed, workers, budget = check_counts(seed=seed, workers=workers, budget=budget)
    exponent = check_number("exponent", exponent, low=1, high=3)
    if exponent * EXPONENT_UNIT % 1:
        raise ParameterError(
            f"exponent: expected a multiple of 1/{EXPONENT_UNIT}, for no environment takes another, "
            f"got {exponent!r}"
        )
    problem = LegProblem(load_targets(targets), walk, load_start(start, exponent), beta, exponent)
    schedule = COLD if problem.start is None else BEYOND if keep_going else FROM_PRESET
    about = {
        "start": start
        if problem.start is None
        else f"{Path(start).stem} ({digest_of(_plain(problem.start))})",
        "targets": problem.targets.digest,
        "walk": walk,
        "exponent": exponent,
        "beta": beta,
        "seed": seed,
        "budget": budget,
        "keep_going": keep_going,
        "schedule": digest_of([asdict(phase) for phase in schedule]),
        "versions": versions(),
    }
    state = open_state(out, about, resume=resume, product="identified.json")
    with tqdm(total=budget, disable=None, dynamic_ncols=True) as bar:

        def report(result: Result, spent: int) -> None:
            words = ", confirmed by the full system" if result.confirmed else ""
            bar.write(
                f"job {result.id} ({result.phase}): {result.standing}; {result.evaluations} evaluations in "
                f"{result.seconds:.0f} s{words}"
            )
            bar.update(min(spent, budget - bar.n))

        outcome = search(
            problem, schedule, state, report, seed=seed, budget=budget, workers=workers, keep_going=keep_going
        )
    data: dict[str, Any] = {"search": about, "reached": outcome.winner is not None, "spent": outcome.spent}
    leg = best_leg(problem, outcome, about)
    if leg is None:
        print("no candidate was found that the full system can simulate")
    else:
        result, preset, verdict = leg
        data |= {"best": result.id, **asdict(verdict)}
        print(f"job {result.id}: {verdict}\n{write_json(out, 'identified', preset)} written")
    print(f"{write_json(out, 'identify', data | {'jobs': [r.to_dict() for r in outcome.results]})} written")


def load_start(start: str, exponent: float | None = None) -> tuple[Choice, tuple[float, ...]] | None:
    """Choice and x of a preset, by name or file, on its own ground or one with this exponent; None for
    "cold".

    Raises:
        HoofEnvError: there is no such preset, or its leg does not turn; the message names it.
    """
    if start == "cold":
        return None
    try:
        choice, x = encode(start, exponent)
    except HoofEnvError as error:
        raise type(error)(f"start {start}: {error}") from None
    return choice, tuple(x.tolist())


def best_leg(
    problem: LegProblem, outcome: Outcome, about: Mapping[str, Any]
) -> tuple[Result, dict[str, Any], Confirmation] | None:
    """What was confirmed, else the best that the full system can run, as a preset with that system's verdict.

    Args:
        about: what was searched, for the provenance.
    """
    ranked = sorted(outcome.results, key=lambda result: result.both)
    for result in [*([outcome.winner] if outcome.winner else []), *ranked]:
        provenance = (
            "Identified, not published: found by research.identify from the results printed in Batbaatar & "
            "Wagatsuma 2021 (doi 10.2991/jrnal.k.210713.002), which prints neither lengths nor swing "
            f"parameters; {_words(about)}; job {result.id}."
        )
        try:
            preset = to_preset(np.array(result.x), result.choice, provenance)
            return result, preset, confirm(preset, problem.targets, problem.walk, problem.beta)
        except HoofEnvError:  # it does not turn, or a gait is beyond its limits
            continue
    return None


def _words(about: Mapping[str, Any]) -> str:
    flat = {key: value for key, value in about.items() if key not in ("schedule", "versions")}
    return ", ".join(f"{key} {value}" for key, value in {**flat, **about["versions"]}.items())


def _plain(start: tuple[Choice, tuple[float, ...]]) -> Any:
    return [asdict(start[0]), start[1]]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return run(identify, "research.identify", arguments)


if __name__ == "__main__":
    sys.exit(main())
