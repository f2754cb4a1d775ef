"""The trade-off of speed, peak force and cost of transport, and how learned gaits move: trains, then writes.

    python -m agents.tradeoff                   all of docs/tradeoff.md: see there for how long it takes
    python -m agents.tradeoff --quick           a small part in minutes, into a folder of its own
    python -m agents.tradeoff --no-train        the page again, from whatever is done

What is trained is in agents/tradeoff_plan.py. A training that is done is not repeated; Ctrl-C, or kill -9,
and the same command go on where it was. Each has its log beside its results, RUN/log.txt.
"""

from __future__ import annotations

import csv
import io
import signal
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from agents import runs, tradeoff_front, tradeoff_gait, tradeoff_impact
from agents.baselines import exit_code, work_off
from agents.baselines_plan import LEG, Run, runs_of
from agents.baselines_results import Row, read_results, versions_of
from agents.command import run
from agents.impact import GAIT
from agents.learning_report import put
from agents.tradeoff_front import Point
from agents.tradeoff_gait import Answer
from agents.tradeoff_plan import DEFAULT, FULL, QUICK, SLOW, Plan
from hoof_env._output import check_folder
from hoof_env.errors import DataFileError, check_number

MARKS = ("levels", "front", "speed", "stiffness", "impact", "made")


@dataclass(frozen=True)
class Args:
    quick: bool = False
    """a small part, to see that all works"""
    train: bool = True
    """train what is not done; otherwise only write about what is"""
    workers: int = 2
    """trainings at a time, one thread each"""
    out: Path | None = None
    """folder of the trainings; otherwise runs/tradeoff or runs/tradeoff-quick"""
    page: Path | None = None
    """the page; data and pictures go into the folder beside it of the same name; otherwise
    docs/tradeoff.md, or one beside the quick trainings"""


def plan_of(args: Args) -> Plan:
    """The plan that is asked for, with folder and page."""
    plan = QUICK if args.quick else FULL
    return replace(plan, folder=args.out or plan.folder, page=args.page or plan.page)


def train_all(plan: Plan, workers: int) -> list[Run]:
    """Train what is not done yet; returns the trainings that failed.

    Raises:
        ParameterError, OutputError: the number of workers, or a folder that cannot be written.
        KeyboardInterrupt: Ctrl-C; everything can go on.
    """
    check_number("workers", workers, low=1)
    check_folder(plan.folder)
    return work_off(list(runs_of((*plan.entries, plan.commanded))), plan.folder, workers)


def report(plan: Plan) -> Path:
    """Write page, pictures and CSV; returns the page.

    Raises:
        DataFileError: no training is done, one that parts of the page need is not, or is of another reward,
            or the page has lost its marks.
    """
    import matplotlib
    from tqdm import tqdm

    from hoof_env.paper.figure_style import STYLE

    rows = read_results((*plan.entries, plan.commanded), plan.folder)
    default, slow, commanded = (
        folders_of(rows, entry.name) for entry in (plan.entry(DEFAULT), plan.entry(SLOW), plan.commanded)
    )
    looked_at = {tradeoff_impact.FAST: default[0], tradeoff_impact.SLOW: slow[0]}
    beside = plan.page.with_suffix("")
    beside.mkdir(parents=True, exist_ok=True)
    learned = tradeoff_front.learned(row for row in rows if row.entry.env_id == LEG)
    points = learned + tradeoff_front.others()
    with runs.make_env(LEG) as env:
        leg: Any = env.unwrapped
        weight = leg.weight
    count = len(commanded) * len(plan.speeds) + (len(default) + 2) * len(plan.factors) + 8
    with tqdm(total=count * plan.episodes, unit=" episodes") as bar:
        speeds = tradeoff_gait.told_speeds(commanded, plan, bar.update)
        grounds = tradeoff_gait.grounds(default, plan, bar.update)
        played = tradeoff_impact.players(looked_at, plan, bar.update)
    with matplotlib.rc_context(STYLE):
        tradeoff_front.draw_front(points, weight, beside / "front.png")
        label = "commanded speed [m/s]"
        tradeoff_gait.draw_answers(speeds, weight, label, False, beside / "speed.png")
        label = "stiffness / that of the training [-]"
        tradeoff_gait.draw_answers(grounds, weight, label, True, beside / "stiffness.png")
        curves = tradeoff_impact.draw_impact(played, weight, beside / "impact.png")
    write_front(points, beside / "front.csv")
    for name, answers in (("speed", speeds), ("stiffness", grounds)):
        write_answers(answers, name, beside / f"{name}.csv")
    write_csv(curves, zip(*curves.values(), strict=True), beside / "impact.csv")
    tables = (
        tradeoff_front.level_table(points), tradeoff_front.front_table(points),
        tradeoff_gait.answer_table(speeds, "told m/s"),
        tradeoff_gait.answer_table(grounds, "stiffness / training's"),
        tradeoff_impact.impact_table(played), made_table(rows, plan),
    )  # fmt: skip
    text = plan.page.read_text(encoding="utf-8") if plan.page.is_file() else blank_page()
    for mark, table in zip(MARKS, tables, strict=True):
        text = put(text, mark, table)
    runs.write_text(plan.page, text)
    return plan.page


def folders_of(rows: Sequence[Row], name: str) -> list[Path]:
    """Folders of the trainings of an entry, first seed first.

    Raises:
        DataFileError: none is done.
    """
    found = [one.folder for row in rows if row.entry.name == name for one in row.results]
    if not found:
        raise DataFileError(
            f"{name}: expected a training that is done, found none; python -m agents.tradeoff"
        )
    return found


def made_table(rows: Sequence[Row], plan: Plan) -> str:
    """Steps, time and versions."""
    lines = ["| training | seeds done | environment steps | processor s a seed |", "|---|---|---|---|"]
    for row in rows:
        steps, seconds = ([one.final[key] for one in row.results] for key in ("steps", "cpu_s"))
        told = f"`{' '.join(row.entry.env_kwargs)}`" if row.entry.env_kwargs else "as by default"
        lines.append(
            f"| {row.entry.name}: {told} | {len(row.results)}/{row.entry.seeds} | {np.median(steps):,.0f} |"
            f" {np.median(seconds):.0f} |"
        )
    versions = ", ".join(f"{name} {version}" for name, version in versions_of(rows).items())
    return "\n".join([*lines, "", f"With {versions}."])


def write_front(points: Sequence[Point], path: Path) -> None:
    """Every gait of the picture, in SI units."""
    keys = tuple(tradeoff_front.COLUMNS)
    marked = zip(points, tradeoff_front.on_front(points), strict=True)
    rows = (
        [one.kind, one.name, one.seed, *(one.figures[key] for key in keys), int(front)]
        for one, front in marked
    )
    write_csv(("kind", "name", "seed", *keys, "not_beaten"), rows, path)


def write_answers(answers: Sequence[Answer], asked: str, path: Path) -> None:
    """Every gait and circumstance, in SI units."""
    keys = (*GAIT, "swing_amplitude", "failed")
    rows = ([one.gait, one.seed, one.asked, *(one.figures[key] for key in keys)] for one in answers)
    write_csv(("gait", "seed", asked, *keys), rows, path)


def write_csv(header: Iterable[str] | Mapping[str, Any], rows: Iterable[Iterable[Any]], path: Path) -> None:
    """A CSV file, whole or not at all; what is not known stays empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    for row in rows:
        writer.writerow(("" if np.isnan(x) else f"{x:.5g}") if isinstance(x, float) else x for x in row)
    runs.write_text(path, text.getvalue())


def blank_page() -> str:
    """A page with all marks, for one that has no prose of its own."""
    pictures = (f"![{name}](tradeoff/{name}.png)" for name in ("front", "speed", "stiffness", "impact"))
    marks = (f"<!-- {mark} -->\n<!-- /{mark} -->" for mark in MARKS)
    said = "Fewer seeds and far fewer steps than docs/tradeoff.md has: all works, and this is no result."
    return "\n\n".join(("# A small part of the trade-off", said, *pictures, *marks)) + "\n"


def main(argv: list[str] | None = None) -> int:
    import tyro

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, interrupt)
    args = tyro.cli(Args, args=argv, prog="python -m agents.tradeoff", description=__doc__)
    plan = plan_of(args)
    failed = train_all(plan, args.workers) if args.train else []
    print(f"written: {report(plan)}")
    return exit_code(failed)


if __name__ == "__main__":
    run(main)
