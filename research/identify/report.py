"""What a search leaves behind: the leg as a preset, and a file and a page that say how good it is."""

from __future__ import annotations

import json
import platform
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from hoof_env import __version__
from hoof_env._output import staged
from research.identify.confirm import Confirmation
from research.identify.objective import Objective
from research.identify.page import describe_choice, page
from research.identify.plausibility import demands
from research.identify.records import Result
from research.identify.search import Outcome

NAMES = ("identified.json", "identify.json", "identify.md")

_PACKAGES = ("cma", "numpy", "numba")


@dataclass(frozen=True)
class Shipped:
    """The candidate that a search ends with.

    Attributes:
        result: the job that found it. preset: content of a preset file.
        confirmation: what the full system says of it. plausibility: see `plausibility_table`.
    """

    result: Result
    preset: Mapping[str, Any]
    confirmation: Confirmation
    plausibility: Sequence[Mapping[str, Any]]


def versions() -> dict[str, str]:
    """Of what a search's numbers depend on."""
    found = {name: version(name) for name in _PACKAGES}
    return {"hoof-env": __version__, "Python": platform.python_version(), **found}


def plausibility_table(objective: Objective, walk: str, x: Any) -> list[dict[str, Any]]:
    """One dictionary for each demand: name, why, bound in words, and the value with each solver [units of the
    measure]; "paper" is None where the demand concerns the leg itself.

    Args:
        objective: of the candidate's choice. walk: "walks" or "brakes".
    """
    exact, paper = objective.measured(x), objective.measured(x, paper_solver=True)
    return [
        {
            "name": demand.name,
            "why": demand.why,
            "bound": f"at {'least' if demand.sense > 0 else 'most'} {demand.bound:g}",
            "exact": _finite(exact[demand.measured]),
            "paper": None if demand.measured.startswith("leg.") else _finite(paper[demand.measured]),
        }
        for demand in demands(walk)
    ]


def _finite(value: float) -> float | None:
    return value if abs(value) < float("inf") else None


def starts(results: Iterable[Result]) -> list[dict[str, Any]]:
    """One dictionary for each independent start, with all jobs that go back to it.

    Returns:
        Dictionaries with root (the job it began with), start, choice, jobs, evaluations, seconds, error (the
        lowest with the exact solver alone), exact (some candidate met every bar with that solver), both (with
        both solvers) and confirmed (and the full system agreed).
    """
    families: dict[str, list[Result]] = defaultdict(list)
    for result in results:
        families[result.root].append(result)
    return [
        {
            "root": root,
            "start": family[0].start,
            "choice": family[0].choice,
            "jobs": len(family),
            "evaluations": sum(r.evaluations for r in family),
            "seconds": sum(r.seconds for r in family),
            "error": min(r.exact for r in family),
            "exact": any(r.standing.met for r in family),
            "both": any(r.both is not None and r.both.met for r in family),
            "confirmed": any(r.confirmed for r in family),
        }
        for root, family in families.items()
    ]


def counts(families: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """How many of the `starts` reached the bar, for each choice but for the signs of its dyads.

    Returns:
        Dictionaries with choice (in words), starts, exact, both, confirmed (how many) and error (the lowest).
    """
    kinds: dict[str, list[Mapping[str, Any]]] = defaultdict(list)
    for family in families:
        kinds[describe_choice(family["choice"])].append(family)
    return [
        {"choice": kind, "starts": len(members)}
        | {key: sum(m[key] for m in members) for key in ("exact", "both", "confirmed")}
        | {"error": min(m["error"] for m in members)}
        for kind, members in sorted(kinds.items())
    ]


def write_results(
    out: Path, outcome: Outcome, search: Mapping[str, Any], shipped: Shipped | None, wall_s: float
) -> list[Path]:
    """Write `NAMES` into `out`; returns their paths. Where nothing is shipped there is no `identified.json`.

    Args:
        search: what was searched: command, seed, targets, versions and more.
        wall_s: duration of the search since it was begun or last resumed [s].

    Raises:
        OutputError: the folder cannot be written.
    """
    families = starts(outcome.results)
    data: dict[str, Any] = {
        "search": dict(search),
        "reached": outcome.winner is not None,
        "evaluations": outcome.spent,
        "wall_s": wall_s,
        "job_s": sum(result.seconds for result in outcome.results),
        "counts": counts(families),
        "starts": families,
        "jobs": [result.to_dict() for result in outcome.results],
    }
    if shipped is not None:
        data |= {
            "best": shipped.result.id,
            "plausibility": list(shipped.plausibility),
            "rows": shipped.confirmation.reproduction.rows,
            "claims": shipped.confirmation.reproduction.shapes,
            "outside": shipped.confirmation.outside,
            "untrue": shipped.confirmation.untrue,
        }
    with staged(out) as stage:
        if shipped is not None:
            _dump(stage / "identified.json", shipped.preset)
        _dump(stage / "identify.json", data)
        text = page(data, shipped.confirmation if shipped else None)
        (stage / "identify.md").write_text(text, encoding="utf-8")
        names = sorted(file.name for file in stage.iterdir())
    return [out / name for name in names]


def _dump(path: Path, data: Any) -> None:
    path.write_text(json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8")
