"""The page of the baselines from what `agents.baselines` left: tables, curves as CSV and as pictures.

python -m agents.baselines                  trains, then writes docs/baselines.md
python -m agents.baselines_report           writes it again, from whatever is done
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from agents import runs
from agents.baselines_figure import draw_curves
from agents.baselines_matched import COLUMNS as SHOWN
from agents.baselines_matched import compare
from agents.baselines_plan import FOLDERS, LEG, PAGES, PLANS
from agents.baselines_results import (
    GAITS,
    OPEN_LOOP,
    Reference,
    Row,
    read_results,
    references,
    settings_of,
    versions_of,
)
from agents.baselines_run import COLUMNS
from agents.baselines_stats import Interval
from agents.command import run
from agents.markdown import put

QUICK_SECONDS, QUICK_SHARE = 120.0, 0.9
"""PPO is to beat both gaits so soon in so large a share of its seeds."""

MARKS = ("bars", "table", "figures", "matched", "made")

README = Path("README.md")
"""Its table of baselines is written together with the page."""


@dataclass(frozen=True)
class Args:
    subset: Literal["full", "nightly"] = "full"
    """which plan"""
    runs: Path | None = None
    """folder of the trainings; otherwise runs/baselines or runs/baselines-nightly"""
    page: Path | None = None
    """the page; pictures and CSV go into the folder beside it of the same name; otherwise baselines.md in the
    folder of the trainings that is given, or docs/baselines.md, or beside the nightly runs"""


def results_table(rows: Sequence[Row], gaits: dict[str, dict[str, Reference]]) -> str:
    """Returns of agents and of what learns nothing, id by id."""
    titles = (
        "id", "policy", "seeds", "steps", "wall s", "processor s", "return: IQM [95 %]", "mean",
        "worst to best seed", "seeds above run", "above open-loop",
        "seeds that beat both gaits: after s, median (slowest)",
    )  # fmt: skip
    lines = [f"| {' | '.join(titles)} |", "|---|---|" + "---|" * (len(titles) - 2)]
    for env_id, known in gaits.items():
        for one in known.values():
            told = one.intervals["return"].text()
            lines.append(f"| `{env_id}` | {one.name} | | | | | {told} | | | | | |")
        for row in (row for row in rows if row.entry.env_id == env_id and not row.entry.label):
            cells = [f"`{env_id}`", row.title, *row_cells(row, known)]
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def row_cells(row: Row, known: dict[str, Reference]) -> list[str]:
    """The cells of an entry from its seeds on."""
    count, returns = len(row.results), np.array([one.figures["return"] for one in row.results])
    wall, cpu = (np.median([one.final[key] for one in row.results]) for key in ("wall_s", "cpu_s"))

    def above(name: str) -> str:
        return f"{np.sum(returns > known[name].figures['return'])}/{count}" if name in known else ""

    seconds = times_to_beat(row, known)
    return [
        str(count) if count == row.entry.seeds else f"{count} of {row.entry.seeds}",
        f"{np.median([one.final['steps'] for one in row.results]):,.0f}", f"{wall:,.0f}", f"{cpu:,.0f}",
        row.intervals["return"].text(), f"{returns.mean():.1f}",
        f"{returns.min():.1f} to {returns.max():.1f}", above("run"), above(OPEN_LOOP),
        f"{len(seconds)}/{count}" + (f": {np.median(seconds):.0f} ({max(seconds):.0f})" if seconds else ""),
    ]  # fmt: skip


def short_table(rows: Sequence[Row], known: Mapping[str, Reference]) -> str:
    """Returns on HorseLeg-v0 for the README."""
    titles = "policy", "seeds", "environment steps", "wall s", "processor s", "return: IQM [95 %]"
    lines = [f"| {' | '.join(titles)} |", "|---" * len(titles) + "|"]
    lines += [f"| {one.name} | | | | | {one.intervals['return'].text()} |" for one in known.values()]
    lines += [
        f"| {row.title} | {' | '.join(row_cells(row, dict(known))[:5])} |"
        for row in rows
        if row.entry.env_id == LEG and not row.entry.label
    ]
    return "\n".join(lines)


def times_to_beat(row: Row, known: dict[str, Reference]) -> list[float]:
    """Wall seconds of training until the curve is above both gaits, of the seeds that get there."""
    beaten = row.beaten(max(known[name].curve_return for name in GAITS))
    return [one["wall_s"] for one in beaten if one]


def figures_table(rows: Sequence[Row], gaits: dict[str, dict[str, Reference]]) -> str:
    """What the gaits are like, id by id."""
    lines = [
        f"| id | policy | {' | '.join(title for title, *_ in SHOWN.values())} |",
        "|---|---|" + "---|" * len(SHOWN),
    ]
    for env_id, known in gaits.items():
        named: list[tuple[str, Mapping[str, Interval]]] = [
            (one.name, one.intervals) for one in known.values()
        ]
        named += [
            (row.title, row.intervals) for row in rows if row.entry.env_id == env_id and not row.entry.label
        ]
        for name, found in named:
            cells = [
                found[key].text(digits, by) if key in found else "" for key, (_, digits, by) in SHOWN.items()
            ]
            lines.append(f"| `{env_id}` | {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def best_of(rows: Sequence[Row]) -> Row | None:
    """The entry of HorseLeg-v0 with the highest return."""
    asked = [row for row in rows if row.entry.env_id == LEG and not row.entry.label]
    return max(asked, key=lambda row: row.intervals["return"].mean, default=None)


def bars_table(rows: Sequence[Row], known: dict[str, Reference], matched: Mapping[str, str]) -> str:
    """What was asked of the baselines, and whether they do it."""
    best, found = best_of(rows), {}
    if best is not None:
        told = best.intervals["return"]
        for name in (name for name in ("run", OPEN_LOOP) if name in known):
            other = known[name].intervals["return"]
            word = "met" if told.above(other) else "not met"
            found[f"the best agent returns more than {name}, intervals apart"] = (
                f"{word}: {best.title} {told.text()} beside {other.text()}"
            )
    found |= matched
    for row in rows:
        if row.entry.algo == "ppo" and row.entry.env_id == LEG and not row.entry.label:
            quick = sum(seconds <= QUICK_SECONDS for seconds in times_to_beat(row, known))
            word = "met" if quick >= QUICK_SHARE * row.entry.seeds else "not met"
            found[f"PPO beats both gaits within {QUICK_SECONDS:.0f} s in {QUICK_SHARE:.0%} of its seeds"] = (
                f"{word}: {quick} of {row.entry.seeds}"
            )
    return "\n".join(["| bar | |", "|---|---|", *(f"| {bar} | {said} |" for bar, said in found.items())])


def made_table(rows: Sequence[Row]) -> str:
    """The command of each entry's first seed, and the versions of all."""
    commands = "\n".join(f"    {row.command}" for row in rows)
    versions = ", ".join(f"{name} {value}" for name, value in versions_of(rows).items())
    return f"The first seed of each:\n\n{commands}\n\nVersions: {versions}.\n"


def write_csv(rows: Sequence[Row], folder: Path) -> None:
    """curves.csv, the learning curves of all, and runs.csv, a line for each training."""
    name = ("policy", "env_id", "seed")
    curves, ends = io.StringIO(), io.StringIO()
    curve = csv.DictWriter(curves, (*name, *COLUMNS), lineterminator="\n")
    end = csv.DictWriter(ends, (*name, *COLUMNS, "config"), lineterminator="\n")
    curve.writeheader()
    end.writeheader()
    for row in rows:
        for one in row.results:
            about = {"policy": row.title, "env_id": row.entry.env_id, "seed": one.final["seed"]}
            curve.writerows(about | dict(line) for line in one.curve)
            clock: dict[str, Any] = {key: one.final[key] for key in ("steps", "wall_s", "cpu_s")}
            numbers = {key: round(value, 4) for key, value in (clock | one.figures).items()}
            end.writerow(about | numbers | {"config": json.dumps(settings_of(row))})
    runs.write_text(folder / "curves.csv", curves.getvalue())
    runs.write_text(folder / "runs.csv", ends.getvalue())


def blank_page(subset: str, pictures: Sequence[str]) -> str:
    """A page with all marks, for a table that has no prose of its own."""
    small = "Fewer seeds and far fewer steps than docs/baselines.md has: all works, and this is no result."
    return "\n\n".join(
        (
            "# Baselines" if subset == "full" else "# A small part of the baselines",
            "docs/baselines.md tells what the tables show." if subset == "full" else small,
            *(f"<!-- {mark} -->\n<!-- /{mark} -->" for mark in MARKS),
            *(f"![{name}](baselines/{name}.png)" for name in pictures),
        )
    )


def report(args: Args) -> Path:
    """Write page, pictures and CSV; returns the page.

    Raises:
        DataFileError: nothing is done, a result cannot be read, or the page has lost its marks.
    """
    import matplotlib

    from hoof_env.paper.figure_style import STYLE

    rows = read_results(PLANS[args.subset], args.runs or FOLDERS[args.subset])
    page = args.page or (args.runs / "baselines.md" if args.runs else PAGES[args.subset])
    beside = page.with_suffix("")
    beside.mkdir(parents=True, exist_ok=True)
    ids = list(dict.fromkeys(row.entry.env_id for row in rows))
    gaits = {env_id: references(env_id) for env_id in ids}
    names = {env_id.rpartition("/")[2]: env_id for env_id in ids}
    with matplotlib.rc_context(STYLE):
        for name, env_id in names.items():
            shown = [row for row in rows if row.entry.env_id == env_id and not row.entry.label]
            if shown:
                draw_curves(shown, gaits[env_id], beside / f"{name}.png")
    write_csv(rows, beside)
    known = gaits.get(LEG) or references(LEG)
    table, bars = compare(rows, best_of(rows), known)
    tables = (
        bars_table(rows, known, bars), results_table(rows, gaits), figures_table(rows, gaits), table,
        made_table(rows),
    )  # fmt: skip
    blank = args.subset == "nightly" or not page.is_file()
    text = blank_page(args.subset, list(names)) if blank else page.read_text(encoding="utf-8")
    for mark, content in zip(MARKS, tables, strict=True):
        text = put(text, mark, content)
    runs.write_text(page, text)
    if page == PAGES["full"]:
        runs.write_text(
            README, put(README.read_text(encoding="utf-8"), "baselines", short_table(rows, known))
        )
    return page


def main(argv: list[str] | None = None) -> None:
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.baselines_report", description=__doc__)
    print(f"written: {report(args)}")


if __name__ == "__main__":
    run(main)
