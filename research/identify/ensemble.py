"""Collect legs that all meet the published numbers, far apart: what those numbers leave open.

    python -m research.identify.ensemble --preset identified --both --out runs/ensemble

The ensemble of a preset lies in `ensembles` beside this file, under the preset's name. A member is the
content of a preset file, with how well it fits:

    {"provenance": ..., "units": ..., "walk": "walks", "ground": {"exponent": ...},
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
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from hoof_env.errors import DataFileError, HoofEnvError, ParameterError, check_choice, check_number
from hoof_env.ground.contact import Ground
from hoof_env.ground.preset import load_ground, read_ground, write_ground
from research.identify.__main__ import load_start
from research.identify.attempt import SOLVERS, Aim, Attempt
from research.identify.collect import Collection, Start, collect
from research.identify.demands import WALK_DEMANDS
from research.identify.leg import encode
from research.identify.problem import LegProblem
from research.identify.run import check_counts, check_extras, run
from research.identify.state import digest_of, open_state, read_json, versions, write_json
from research.identify.targets import load_targets


@dataclass(frozen=True)
class Ensemble:
    """At least one leg.

    Attributes:
        provenance: where it comes from.
        walk: the reading of the walk that its members share, "walks" or "brakes".
        bar: by solver, the bar that all members meet: the largest error of any [bars].
        members: each the content of a preset, with its ground.
        errors: of each member, by solver.
    """

    provenance: str
    walk: str
    bar: Mapping[str, float]
    members: tuple[dict[str, Any], ...]
    errors: tuple[Mapping[str, float], ...]


def load_ensemble(source: str | Path) -> Ensemble:
    """The ensemble of a preset (by name) or of a file (by path).

    Raises:
        DataFileError: the file is missing, unreadable, lacks a part, holds a leg that does not turn or is
            there twice, or its bar is not that of its members.
    """
    path = Path(source)
    if path.suffix != ".json":
        path = Path(__file__).with_name("ensembles") / f"{path.name}.json"
    data = read_json(path, "expected an ensemble in JSON")
    entries = data.get("members") if isinstance(data, dict) else None
    if not isinstance(entries, list) or not entries:
        raise DataFileError(f"{path}: expected an object with a list 'members' of at least one leg")
    ground = write_ground(read_ground(data, str(path)))
    members: list[dict[str, Any]] = []
    errors: list[dict[str, float]] = []
    for number, entry in enumerate(entries, 1):
        try:
            members.append({"geometry": entry["geometry"], "gaits": entry["gaits"], "ground": ground})
            encode(members[-1])
            errors.append({s: check_number(f"errors[{s!r}]", entry["errors"][s], low=0) for s in SOLVERS})
        except (HoofEnvError, KeyError, TypeError) as error:
            raise DataFileError(f"{path}, member {number}: {_what(error)}") from None
        for twin, other in enumerate(members[:-1], 1):
            if members[-1]["geometry"] == other["geometry"]:
                raise DataFileError(
                    f"{path}: members {twin} and {number}: expected different legs, got one twice"
                )
    try:
        walk = check_choice("walk", data.get("walk"), WALK_DEMANDS)
    except ParameterError as error:
        raise DataFileError(f"{path}: {error}") from None
    bar = largest(errors)
    if data.get("bar") != bar:
        raise DataFileError(
            f"{path}: bar: expected {bar}, its members' largest errors, got {data.get('bar')!r}"
        )
    return Ensemble(str(data.get("provenance", "")), walk, bar, tuple(members), tuple(errors))


def _what(error: Exception) -> str:
    return f"lacks {error}" if isinstance(error, KeyError) else str(error)


def largest(errors: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """The largest error of any member, by solver [bars]."""
    return {solver: max(error[solver] for error in errors) for solver in SOLVERS}


def ensemble(
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
        out: folder for ensemble.json; made if need be. Its folder state holds what a killed collection is
            resumed from.
        preset: the leg to begin with, a name or a JSON file; all members stand on its ground.
        starts: more of them, as identified.json of other searches.
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
    check_extras()
    size, seed, workers = check_counts(size=size, seed=seed, workers=workers)
    attempts = int(check_number("attempts", attempts, low=0, high=1e6))
    bar = check_number("bar", bar, low=0, high=100, exclusive_low=True)
    ground = load_ground(preset)
    if ground.stiffness != Ground().stiffness:
        raise ParameterError(
            f"preset {preset}: expected a ground with the paper's stiffness, {Ground().stiffness:g} N/m^n, "
            f"got {ground.stiffness:g}"
        )
    aim = Aim(LegProblem(load_targets(targets), walk, None, beta), bar, both)
    legs = load_starts([preset, *starts], ground.exponent)
    about = {
        "ensemble of": Path(preset).stem,
        "starts": [f"{leg.name} ({digest_of([asdict(leg.choice), leg.x])})" for leg in legs],
        "targets": aim.problem.targets.digest,
        "walk": walk,
        "bar": bar,
        "both": both,
        "beta": beta,
        "exponent": ground.exponent,
        "seed": seed,
        "attempts": attempts,
        "size": size,
        "versions": versions(),
    }
    state = open_state(out, about, resume=resume, product="ensemble.json", kind="collection")
    found = collect(legs, aim, state, _say, size=size, attempts=attempts, seed=seed, workers=workers)
    if not found.members:
        why = Counter(reason for one in found.refused for reason in one.reasons(aim))
        raise HoofEnvError(
            f"the full system refuses all legs within {bar:g} bars: {', '.join(why)}; expected a wider --bar"
        )
    errors = [dict(one.errors) for one in found.members]
    content = {
        "provenance": provenance(about, found),
        "units": "m, rad, rad/s, N/m^n; errors in bars",
        "walk": walk,
        "ground": write_ground(ground),
        "bar": largest(errors),
        "members": [_member(one, aim) for one in found.members],
    }
    path = write_json(out, "ensemble", content)
    met = " and ".join(f"{error:.4f} with the {solver} solver" for solver, error in largest(errors).items())
    _say(f"{len(errors)} of {size} members; largest error {met} [bars]; {len(found.refused)} legs refused")
    _say(f"{path} written")


def load_starts(sources: Sequence[str], exponent: float) -> list[Start]:
    """The legs of presets, by name or file, on ground with this exponent.

    Raises:
        HoofEnvError: a preset whose leg does not turn, a damaged file, or the same leg twice; the message
            names it.
    """
    legs: list[Start] = []
    for source in sources:
        start = load_start(source, exponent)
        if start is None:
            raise ParameterError(f"start {source}: expected a preset, by name or file")
        for leg in legs:
            if (leg.choice, leg.x) == start:
                raise ParameterError(
                    f"starts: expected different legs, got one twice: {leg.name} and {source}"
                )
        legs.append(Start(Path(source).stem, *start))
    return legs


def provenance(about: Mapping[str, Any], found: Collection) -> str:
    """How the members were found, in words."""
    shares = Counter(one.start for one in found.members)
    settings = {key: about[key] for key in ("walk", "bar", "both", "beta", "exponent", "seed", "targets")}
    words = ", ".join(f"{key} {value}" for key, value in {**settings, **about["versions"]}.items())
    return (
        "Identified, not published: legs that fit the results printed in Batbaatar & Wagatsuma 2021 (doi "
        "10.2991/jrnal.k.210713.002), which prints neither lengths nor swing parameters. Found by "
        f"research.identify.ensemble from {'; '.join(about['starts'])}: legs known to fit were pushed in random "
        "directions, along one length or all, as far as the bar let them, "
        f"{len(found.attempts) - len(about['starts'])} times; of all that fit, the {len(found.members)} "
        "members are chosen far apart, so that extremes are more frequent among them than among all legs "
        "that fit, and their range is a lower limit of what the numbers leave open. Members: "
        f"{', '.join(f'{count} from {start}' for start, count in shares.items())}. Settings: {words}."
    )


def _member(one: Attempt, aim: Aim) -> dict[str, Any]:
    preset, source = one.preset(aim), {"attempt": one.id, "start": one.start}
    parts = {"geometry": preset["geometry"], "gaits": preset["gaits"]}
    return {**parts, "errors": dict(one.errors), "short": dict(one.short), "found": source}


def _say(line: str) -> None:
    print(line, flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    return run(ensemble, "research.identify.ensemble", arguments)


if __name__ == "__main__":
    sys.exit(main())
