"""Collect legs that all meet the published numbers, far apart: what those numbers leave open.

    python -m research.identify.ensemble --preset identified --both --out runs/ensemble

The ensemble of a preset lies in `ensembles` beside this file, under the preset's name. A member is the
content of a preset file, with how well it fits:

    {"provenance": ..., "units": ..., "ground": {"exponent": ...},
     "bar": {"exact": 0.97, "paper": 0.99},
     "members": [{"geometry": ..., "gaits": ..., "errors": {"exact": ..., "paper": ...}, "short": {}}, ...]}

Errors are those of the worst row, in units of its own bar; with the paper's solver the walking inelastic
rows, which are ill-conditioned, do not count. "short" names the demands on plausibility that a leg misses.
All legs share the preset's ground, written as in a preset file; without it they have the default one.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from hoof_env.errors import HoofEnvError, ParameterError, check_number
from hoof_env.ground.contact import Ground, load_ground, write_ground
from research.identify.collect import Aim, collect
from research.identify.command import check_counts, check_extras, load_start, provenance, run
from research.identify.confirm import COUNTED
from research.identify.problem import LegProblem
from research.identify.state import digest_of, open_state, read_json, versions, write_json


def load_ensemble(preset: str) -> list[dict[str, Any]]:
    """The members of a preset's ensemble, each the content of a preset."""
    path = Path(__file__).with_name("ensembles") / f"{preset}.json"
    data = read_json(path, "take it from the repository again")
    about = {"provenance": f"a member of the ensemble of {preset}", "ground": data["ground"]}
    return [{**about, "geometry": one["geometry"], "gaits": one["gaits"]} for one in data["members"]]


def largest(errors: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """The largest error of any member, by solver [bars]."""
    return {solver: max(error[solver] for error in errors) for solver in COUNTED}


def ensemble(
    out: Path,
    preset: str,
    starts: tuple[str, ...] = (),
    size: int = 24,
    bar: float = 1.0,
    both: bool = False,
    seed: int = 0,
    attempts: int = 240,
    workers: int = 2,
    resume: bool = False,
) -> None:
    """Collect legs that fit the published numbers, far apart: what those leave open (needs 'identify').

    Args:
        out: folder for ensemble.json; made if need be. Its folder state holds what a killed collection is
            resumed from.
        preset: the leg to begin with, a name or a JSON file; all members stand on its ground.
        starts: more of them, as identified.json of other searches.
        size: members wanted.
        bar: largest error of a row, in units of its own bar.
        both: rows count with the paper's solver too, all but the ill-conditioned.
        seed: the same seed and options find the same legs, with any number of workers.
        attempts: to find a further leg; the members are chosen among all that were found.
        workers: processes.
        resume: go on with a collection in this folder that was interrupted or killed.
    """
    check_extras()
    size, attempts, seed, workers = check_counts(size=size, attempts=attempts, seed=seed, workers=workers)
    bar = check_number("bar", bar, low=0, high=100, exclusive_low=True)
    ground = load_ground(preset)
    if ground.stiffness != Ground().stiffness:
        raise ParameterError(
            f"preset {preset}: expected a ground with the paper's stiffness, {Ground().stiffness:g} N/m^n, "
            f"got {ground.stiffness:g}"
        )
    choice, _ = load_start(preset, ground.exponent)
    legs: dict[str, tuple[float, ...]] = {}
    for source in (preset, *starts):
        other, x = load_start(source, ground.exponent)
        if other != choice:
            raise ParameterError(
                f"start {source}: expected assembly, toe and travel of {preset}, got {other}"
            )
        if x in legs.values():
            raise ParameterError(f"starts: expected different legs, got one twice: {source}")
        legs[f"{Path(source).stem} ({digest_of([asdict(choice), x])})"] = x
    aim = Aim(LegProblem(choice), bar, both)
    about = {
        "starts": [*legs],
        "bar": bar,
        "both": both,
        "seed": seed,
        "attempts": attempts,
        "size": size,
        "versions": versions(),
    }
    say = partial(print, flush=True)
    state = open_state(out, about, resume=resume, product="ensemble.json")
    found = collect(legs, aim, state, say, size=size, attempts=attempts, seed=seed, workers=workers)
    if not found.members:
        why = Counter(reason for verdict in found.verdicts.values() for reason in verdict.reasons)
        raise HoofEnvError(
            f"the full system refuses all legs within {bar:g} bars: {', '.join(why)}; expected a wider --bar"
        )
    members = []
    for one in found.members:
        verdict = found.verdicts[one.id]
        parts = {name: verdict.preset[name] for name in ("geometry", "gaits")}
        origin = {"attempt": one.id, "start": one.start}
        members.append({**parts, "errors": verdict.errors, "short": verdict.short, "found": origin})
    counts = Counter(one.start for one in found.members)
    shares = ", ".join(f"{count} from {start}" for start, count in counts.items())
    how = (
        "research.identify.ensemble: legs known to fit were pushed in random directions, along one length or "
        f"all, as far as the bar let them, {len(found.attempts) - len(legs)} times; of all that fit, the "
        f"{len(members)} members ({shares}) are chosen far apart, so that extremes are more frequent among "
        "them than among all legs that fit, and their range is a lower limit of what the numbers leave open"
    )
    content = {
        "provenance": provenance(how, about),
        "units": "m, rad, rad/s, N/m^n; errors in bars",
        "ground": write_ground(ground),
        "bar": largest([member["errors"] for member in members]),
        "members": members,
    }
    refused = len(found.verdicts) - len(members)
    say(f"{len(members)} of {size} members; largest errors {content['bar']} [bars]; {refused} legs refused")
    say(f"{write_json(out, 'ensemble', content)} written")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return run(ensemble, "research.identify.ensemble", arguments)


if __name__ == "__main__":
    sys.exit(main())
