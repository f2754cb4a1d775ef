"""The search: checks its input before anything is written, searches, and writes what it found."""

from __future__ import annotations

import hashlib
import importlib
import json
import shlex
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from hoof_env.errors import HoofEnvError, ParameterError, check_choice, check_number
from hoof_env.gait.parameters import load_gait
from hoof_env.ground.preset import load_ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.simd.math import EXPONENT_UNIT
from research.identify.candidate import Choice, encode, to_preset
from research.identify.confirm import GIVEN_UP, JUDGED, confirm
from research.identify.job import CHECKPOINT_EVERY
from research.identify.monitor import Monitor
from research.identify.problem import EXPONENT, SAMPLES, LegProblem
from research.identify.report import Shipped, plausibility_table, versions, write_results
from research.identify.schedule import BEYOND, BUDGET, COLD, FROM_PRESET, Schedule
from research.identify.search import Outcome, search
from research.identify.state import open_state
from research.identify.targets import load_targets


def check_extras() -> None:
    """Raise `HoofEnvError` with the way out unless the optimiser can be imported."""
    for name in ("cma", "scipy", "tqdm"):
        try:
            importlib.import_module(name)
        except ImportError:
            raise HoofEnvError(f'identify needs {name}: pip install "hoof-env[identify]"') from None


def load_start(start: str, exponent: float = EXPONENT) -> tuple[Choice, tuple[float, ...]] | None:
    """Choice, with this exponent, and x of a preset, by name or file; None for "cold".

    Raises:
        HoofEnvError: there is no such preset, or its leg does not turn; the message names it.
    """
    if start == "cold":
        return None
    try:
        load_ground(start)  # it plays no part, but a damaged file is not searched from
        walk, run = (load_gait(gait, start) for gait in ("walk", "run"))
        choice, x = encode(load_geometry(start), walk, run, exponent)
    except HoofEnvError as error:
        raise type(error)(f"start {start}: {error}") from None
    return choice, tuple(x.tolist())


def identify(
    out: Path,
    say: Callable[[str], None],
    *,
    start: str = "first_fit",
    seed: int = 0,
    targets: Path | None = None,
    walk: str = "walks",
    exponent: float = EXPONENT,
    beta: str = "probable",
    workers: int = 2,
    budget: int | None = None,
    resume: bool = False,
    keep_going: bool = False,
    phases: Schedule | None = None,
    every: float = CHECKPOINT_EVERY,
) -> list[Path]:
    """Search for the leg and write what was found; returns the paths of the files.

    Args:
        out: folder; its sub-folder `state` holds what a killed search is resumed from.
        say: takes one line of progress.
        start: "cold", or a preset by name or file.
        seed: two searches with the same seed and options find the same.
        targets: file of rows; the paper's own if None.
        walk: "walks" or "brakes".
        exponent: n of Eq. 14, not published. beta: of the paper's solver, "printed" or "probable".
        workers: processes; their number changes nothing in what is found.
        budget: evaluations, one with the paper's solver by its weight; `BUDGET` if None.
        resume: go on with the search in `out`.
        keep_going: spend the whole budget, to count how many starts reach the bar.
        phases: what to try; by default what suits the start.
        every: seconds between two checkpoints of a job.

    Raises:
        HoofEnvError: bad input, before anything is written; or see `search`.
    """
    check_extras()
    check_choice("walk", walk, GIVEN_UP)
    check_choice("beta", beta, JUDGED)
    exponent = check_number("exponent", exponent, low=1, high=3)
    if exponent * EXPONENT_UNIT % 1:
        raise ParameterError(
            f"exponent: expected a multiple of 1/{EXPONENT_UNIT}, for no environment takes another, "
            f"got {exponent!r}"
        )
    seed = int(check_number("seed", seed, low=0, high=2**53))
    workers = int(check_number("workers", workers, low=1, high=1024))
    budget = int(check_number("budget", BUDGET if budget is None else budget, low=1, high=1e15))
    problem = LegProblem(load_targets(targets), walk, load_start(start, exponent), beta, exponent)
    phases = phases or (COLD if problem.start is None else BEYOND if keep_going else FROM_PRESET)
    about = {
        "start": start if problem.start is None else f"{Path(start).stem} ({_start_digest(problem)})",
        "targets": problem.targets.digest,
        "walk": walk,
        "exponent": exponent,
        "beta": beta,
        "seed": seed,
        "budget": budget,
        "keep_going": keep_going,
        "schedule": digest_of([asdict(phase) for phase in phases]),
        "versions": versions(),
    }
    command = f"python -m research.identify --out {shlex.quote(str(out))} --start {shlex.quote(start)}"
    command += f" --seed {seed} --walk {walk} --exponent {exponent:g} --beta {beta} --budget {budget}"
    command += f" --targets {shlex.quote(str(targets))}" if targets else ""
    command += " --keep-going" if keep_going else ""
    state = open_state(out, about, digest_of(about), resume=resume)
    began = time.monotonic()
    try:
        with Monitor(budget, say) as monitor:
            outcome = search(
                problem, phases, state, monitor,
                seed=seed, budget=budget, workers=workers, keep_going=keep_going, every=every,
            )  # fmt: skip
        shipped = ship(problem, outcome, about)
    except KeyboardInterrupt:
        print(f"the search is kept; go on with: {command} --resume", file=sys.stderr)
        raise
    search_data = {"command": command, **about}
    return write_results(out, outcome, search_data, shipped, time.monotonic() - began)


def ship(problem: LegProblem, outcome: Outcome, about: Mapping[str, Any]) -> Shipped | None:
    """What was confirmed, else the best that the full system can run, with that system's verdict.

    Args:
        about: what was searched, for the provenance.
    """
    used = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
    provenance = (
        "Identified, not published: found by research.identify from the results printed in Batbaatar & "
        "Wagatsuma 2021 (doi 10.2991/jrnal.k.210713.002), which prints neither lengths nor swing parameters; "
        f"start {about['start']}, seed {about['seed']}, budget {about['budget']}, a walk that "
        f"{about['walk']}, exponent {about['exponent']:g}, {about['beta']} beta, targets {about['targets']}; "
        f"{used}; job "
    )
    ranked = sorted((r for r in outcome.results if r.full is not None), key=lambda r: r.full or 0.0)
    for result in [*([outcome.winner] if outcome.winner else []), *ranked]:
        choice, x = Choice.from_dict(result.choice), np.array(result.x)
        try:
            preset = to_preset(x, choice, f"{provenance}{result.id}.", "identified")
            verdict = confirm(preset, problem.targets, problem.walk, problem.beta)
        except HoofEnvError:  # it does not turn, or a gait is beyond its limits
            continue
        objective = problem.objective(choice, SAMPLES, True)
        return Shipped(result, preset, verdict, plausibility_table(objective, problem.walk, x))
    return None


def _start_digest(problem: LegProblem) -> str:
    choice, x = problem.start or (None, ())
    return digest_of([choice and choice.to_dict(), x])


def digest_of(content: Any) -> str:
    """16 hexadecimal digits that tell one JSON value from another."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]
