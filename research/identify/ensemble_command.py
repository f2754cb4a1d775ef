"""The ensemble: checks its input before anything is written, collects, and writes what it found."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hoof_env._output import staged
from hoof_env.errors import (
    DataFileError,
    HoofEnvError,
    ParameterError,
    check_choice,
    check_number,
)
from hoof_env.ground.contact import Ground
from hoof_env.ground.preset import load_ground
from research.identify.candidate import Choice, names
from research.identify.command import check_extras, digest_of, load_start
from research.identify.confirm import GIVEN_UP, JUDGED
from research.identify.ensemble import SOLVERS, to_data, write_member
from research.identify.ensemble_attempt import Aim, Attempt
from research.identify.ensemble_search import Collection, Start, collect, distance
from research.identify.records import Result
from research.identify.report import versions
from research.identify.state import FOLDER, open_state, read_json
from research.identify.targets import load_targets

NAME = "ensemble.json"

WORTH_TRYING = 1.5
"""Results of a search that are further out than this, in the wanted bar, are no starts."""


def ensemble(
    out: Path,
    say: Callable[[str], None],
    *,
    preset: str,
    starts: Sequence[str] = (),
    size: int = 24,
    bar: float = 1.0,
    both: bool = False,
    walk: str = "walks",
    beta: str = "probable",
    targets: Path | None = None,
    seed: int = 0,
    attempts: int = 240,
    workers: int = 2,
    resume: bool = False,
) -> list[Path]:
    """Collect legs that all meet the bar and write them; returns the paths of the files.

    Args:
        out: folder; its sub-folder `state` holds what a killed collection is resumed from.
        say: takes a line of progress or of the table at the end.
        preset: the leg to begin with, by name or file; all members stand on its ground.
        starts: more of them, or folders of `identify`, whose independent starts all count.
        size: members wanted.
        bar: largest error of a row, in units of its own bar.
        both: rows count with the paper's solver too, all but the ill-conditioned.
        walk: "walks" or "brakes". beta: of the paper's solver, "printed" or "probable".
        targets: file of rows; the paper's own if None.
        seed: two collections with the same seed and options find the same.
        attempts: to find a further leg. workers: processes; their number changes nothing in what is found.
        resume: go on with the collection in `out`.

    Raises:
        HoofEnvError: bad input, before anything is written; or see `collect`; or no leg is within the bar.
    """
    check_extras()
    check_choice("walk", walk, GIVEN_UP)
    check_choice("beta", beta, JUDGED)
    size = int(check_number("size", size, low=1, high=1e4))
    attempts = int(check_number("attempts", attempts, low=0, high=1e6))
    seed = int(check_number("seed", seed, low=0, high=2**53))
    workers = int(check_number("workers", workers, low=1, high=1024))
    bar = check_number("bar", bar, low=0, high=100, exclusive_low=True)
    aim, ground = Aim(load_targets(targets), walk, bar, both, beta), load_ground(preset)
    if ground.stiffness != Ground().stiffness:
        raise ParameterError(
            f"preset {preset}: expected a ground with the paper's stiffness, {Ground().stiffness:g} N/m^n, "
            f"got {ground.stiffness:g}"
        )
    legs = load_starts([preset, *starts], aim, ground.exponent)
    about = {
        "ensemble of": Path(preset).stem,
        "starts": [f"{leg.name} ({digest_of([leg.choice.to_dict(), leg.x])})" for leg in legs],
        "targets": aim.targets.digest,
        "walk": walk,
        "bar": aim.bar,
        "both": both,
        "beta": beta,
        "exponent": ground.exponent,
        "seed": seed,
        "attempts": attempts,
        "size": size,
        "versions": versions(),
    }
    state = open_state(out, about, digest_of(about), resume=resume, kind="collection", product=NAME)
    try:
        found = collect(legs, aim, state, say, size=size, attempts=attempts, seed=seed, workers=workers)
    except KeyboardInterrupt:
        print("the collection is kept; go on with the same command and --resume", file=sys.stderr)
        raise
    if not found.members:
        why = Counter(reason for one in found.refused for reason in reasons(one, aim))
        raise HoofEnvError(
            f"the full system refuses all legs within {bar:g} bars: {', '.join(why)}; expected a wider --bar"
        )
    data = to_data([_member(one, aim) for one in found.members], provenance(about, found), walk, ground)
    with staged(out) as stage:
        (stage / NAME).write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    for line in table(found, legs[0], aim, size):
        say(line)
    return [out / NAME]


def load_starts(sources: Sequence[str], aim: Aim, exponent: float) -> list[Start]:
    """The legs of presets, by name or file, and of the folders of searches, on ground with this exponent.

    Raises:
        HoofEnvError: a preset whose leg does not turn, a folder without a result near the bar, a damaged
            file, or the same source twice; the message names it.
    """
    legs: list[Start] = []
    for source in sources:
        if Path(source).is_dir():
            found = _results(Path(source), aim, exponent)
        else:
            start = load_start(source, exponent)
            if start is None:
                raise ParameterError(f"start {source}: expected a preset or the folder of a search")
            found = [Start(Path(source).stem, *start)]
        legs += found
    twice = [name for name, count in Counter((leg.choice, leg.x) for leg in legs).items() if count > 1]
    if twice:
        same = [leg.name for leg in legs if (leg.choice, leg.x) == twice[0]]
        raise ParameterError(f"starts: expected different legs, got one twice: {' and '.join(same)}")
    return legs


def _results(source: Path, aim: Aim, exponent: float) -> list[Start]:
    """The best result of each independent start of a search, as far as it is near the bar."""
    folder = source / FOLDER if (source / FOLDER).is_dir() else source
    best: dict[str, tuple[float, Result]] = {}
    for path in sorted(folder.glob("job-*.json")):
        try:
            result = Result.from_dict(read_json(path, "leave this folder out")["result"])
        except (KeyError, TypeError):
            raise DataFileError(f"start {source}: {path} is damaged; leave this folder out") from None
        merit = result.full if aim.both else result.exact
        if result.full is None or merit is None or merit > WORTH_TRYING * aim.bar:
            continue
        if Choice.from_dict(result.choice).exponent != exponent:
            continue
        if result.root not in best or merit < best[result.root][0]:
            best[result.root] = merit, result
    if not best:
        raise DataFileError(
            f"start {source}: expected the folder of a search with a leg within "
            f"{WORTH_TRYING * aim.bar:g} bars on ground with exponent {exponent:g}"
        )
    search = (folder.parent if folder.name == FOLDER else folder).resolve().name
    return [
        Start(f"{search}, start {root}", Choice.from_dict(result.choice), tuple(result.x))
        for root, (_, result) in best.items()
    ]


def provenance(about: dict[str, Any], found: Collection) -> str:
    """How the members were found, in words."""
    used = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
    solvers = "the exact solver"
    if about["both"]:
        solvers = f"both solvers (the paper's with {about['beta']} beta, without the ill-conditioned rows)"
    per_start = Counter(one.start for one in found.members)
    shares = ", ".join(f"{count} from {start}" for start, count in per_start.items())
    return (
        "Identified, not published: legs that fit the results printed in Batbaatar & Wagatsuma 2021 (doi "
        "10.2991/jrnal.k.210713.002), which prints neither lengths nor swing parameters, each row within "
        f"{about['bar']:g} of its own bar with {solvers}. Found by research.identify.collect from "
        f"{'; '.join(about['starts'])}: legs known to fit were pushed in random directions, along one length "
        "or all, as far as the bar let them, "
        f"{len(found.attempts) - len(about['starts'])} times; of all that fit, the {len(found.members)} "
        "members are chosen far apart, so that extremes are more frequent among them than among all legs "
        "that fit, and their range is a lower limit of what the numbers leave open. "
        f"Members: {shares}. Walk that {about['walk']}, exponent {about['exponent']:g}, "
        f"seed {about['seed']}, targets {about['targets']}; {used}."
    )


def reasons(one: Attempt, aim: Aim) -> list[str]:
    """Why the full system refuses a leg."""
    counted = SOLVERS if aim.both else SOLVERS[:1]
    errors = [
        f"{solver} error of {one.errors[solver]:.2f} bars"
        for solver in counted
        if one.errors[solver] > aim.bar
    ]
    return [*errors, *one.short, *one.untrue]


def table(found: Collection, first: Start, aim: Aim, size: int) -> list[str]:
    """What was collected, a line each: members, bar met, and the spread of every coordinate of the leg."""
    members = found.members
    met = " and ".join(f"{max(one.errors[s] for one in members):.4f} with the {s} solver" for s in SOLVERS)
    gaps = [
        min(distance(one, o) for o in members if o is not one) for one in members[: len(members) > 1 and None]
    ]
    lines = [
        f"{len(members)} of {size} members; largest error {met} [bars]"
        + (f"; {len(found.refused)} legs refused by the full system" if found.refused else ""),
        *(f"{count} from start {start}" for start, count in Counter(one.start for one in members).items()),
    ]
    if gaps:
        lines.append(
            f"nearest other member: {min(gaps):.4f} to {max(gaps):.4f} (rms of log lengths and pivot [m])"
        )
    lines.append(f"{'':24}{'start':>9}{'lowest':>9}{'median':>9}{'highest':>9}{'range/median':>14}")
    keys = names(first.choice)
    alike = np.array([one.x(aim) for one in members])
    for key, own, column in zip(keys, first.x, alike.T, strict=True):
        log = key.startswith("log ")
        name, unit = (key[4:], "m") if log else (key, "rad" if "swing" in key else "m")
        own, column = (np.exp(own), np.exp(column)) if log else (own, column)
        low, middle, high = np.quantile(column, [0, 0.5, 1])
        relative = f"{100 * (high - low) / middle:12.1f} %" if log or key == "hip_height" else ""
        lines.append(f"{f'{name} [{unit}]':24}{own:9.4f}{low:9.4f}{middle:9.4f}{high:9.4f}{relative}")
    return lines


def _member(one: Attempt, aim: Aim) -> dict[str, Any]:
    return {
        **write_member(one.preset(aim), one.errors, one.short),
        "found": {"attempt": one.id, "start": one.start},
    }
