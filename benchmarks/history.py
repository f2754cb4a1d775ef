"""History of every run's barred ratios with date, processor and vector width: a new run does not replace an
old one.

A run adds rows to `speed.csv`; `speed.md` shows them all.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from benchmarks.rounds import bar_text
from hoof_env._output import markdown_table, staged

RESULTS = Path(__file__).parent / "results"
"""Folder with one for each vector width, and the history of all."""

RUN = ("date", "commit", "compiled for", "processor")
COLUMNS = ("case", "beside", "bits", "ratio", "q1", "q3", "required", *RUN)

INTRO = """\
# How fast it was, run by run

Written by `make bench`, which adds rows and replaces none. A ratio is the median of interleaved rounds with
its quartiles; bits are of the widest vectors in the code of kernels. The last run of each width in full:"""

Row = tuple[str, str, Mapping[str, float] | None, float | None]
"""Case, the case that it is compared with, the ratio's spread if it was measured, and the bar if there is
one."""


def write(folder: Path, name: str, result: Mapping[str, Any], page: str, rows: Iterable[Row]) -> Path:
    """Write a run and its page for its vector width, and `keep` its rows; return the folder of the width."""
    width_folder = folder / f"{result['bits']}-bits"
    with staged(width_folder) as stage:
        (stage / f"{name}.json").write_text(json.dumps(result, indent=1) + "\n")
        (stage / f"{name}.md").write_text(page)
    keep(folder, result["machine"], result["bits"], rows)
    return width_folder


def keep(folder: Path, machine: Mapping[str, str], bits: int, rows: Iterable[Row]) -> None:
    """Add the rows that have a bar and a ratio to the files in `folder`.

    Args:
        folder: folder of all results, with a folder for each width.
        machine: `benchmarks.machine.machine()`.
        bits: of the widest vectors.
        rows: of one run.
    """
    run = {"bits": str(bits)} | {name: machine[name] for name in RUN}
    history = read(folder)
    for case, reference, ratio, required in rows:
        # Cases without a bar are in the run's own page only
        if ratio is not None and required is not None:
            numbers = {"ratio": ratio["median"], "q1": ratio["q1"], "q3": ratio["q3"], "required": required}
            texts = {name: f"{value:.3g}" for name, value in numbers.items()}
            history.append({"case": case, "beside": reference} | texts | run)
    with staged(folder) as stage:
        with (stage / "speed.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(history)
        (stage / "speed.md").write_text(page(history, folder))


def read(folder: Path) -> list[dict[str, str]]:
    """Return the rows of all runs so far."""
    path = folder / "speed.csv"
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def page(rows: list[dict[str, str]], folder: Path) -> str:
    """Return all runs as Markdown, case by case and each in order of time."""
    links = sorted(path.relative_to(folder) for path in folder.glob("*-bits/*.md"))
    listed = [f"* [{link.parent.name}, {link.stem}]({link.as_posix()})" for link in links]
    cases = list(dict.fromkeys(row["case"] for row in rows))
    ordered = sorted(rows, key=lambda row: (cases.index(row["case"]), row["date"]))
    head = ["case", "beside", "bits", "ratio", "required", *RUN]
    lines = []
    for row in ordered:
        shown = row | {
            "ratio": f"{row['ratio']} ({row['q1']} to {row['q3']})",
            "required": bar_text(float(row["required"]), {"median": float(row["ratio"])}),
        }
        lines.append([shown[name] for name in head])
    return "\n\n".join([INTRO, "\n".join(listed), markdown_table(head, lines)]) + "\n"
