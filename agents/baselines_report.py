"""The page of the baselines from what `agents.baselines` left: tables, curves as CSV and as pictures.

python -m agents.baselines                  trains, then writes docs/baselines.md
python -m agents.baselines_report           writes it again, from whatever is done
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from agents import runs
from agents.baselines_matched import COLUMNS as GAIT_COLUMNS
from agents.baselines_matched import bar, cells, compare
from agents.baselines_results import (
    GAITS,
    OPEN_LOOP,
    Floats,
    Row,
    Scored,
    iqm,
    read_results,
    references,
    versions_of,
)
from agents.baselines_run import COLUMNS, FOLDERS, LEG, Plan, load_plan, write_csv
from agents.command import run
from agents.markdown import put, table

QUICK_SECONDS, QUICK_SHARE = 120.0, 0.9
"""PPO is to beat both gaits so soon in so large a share of its seeds."""

PAGE = Path("docs/baselines.md")
"""Of the full plan; a small one is written beside its trainings, over agents/templates/baselines.md."""

BLANK = Path(__file__).parent / "templates" / "baselines.md"

POINTS = 40
"""Of a curve."""

WIDE = 5.0
"""An axis is logarithmic where the longest training is so many times the shortest."""

References = Mapping[str, Mapping[str, Scored]]
"""Policies without learning, by id and name."""


@dataclass(frozen=True)
class Args:
    subset: Plan = "full"
    """which plan"""
    runs: Path | None = None
    """folder of the trainings; otherwise runs/baselines or runs/baselines-nightly"""
    page: Path | None = None
    """the page; pictures and CSV go into the folder beside it of the same name; otherwise baselines.md in the
    folder of the trainings that is given, or docs/baselines.md, or beside the nightly runs"""


def unlabelled(rows: Sequence[Row], env_id: str) -> list[Row]:
    """Entries of an id that are trained for its own reward."""
    return [row for row in rows if row.entry.env_id == env_id and not row.entry.label]


def best_of(rows: Sequence[Row]) -> Row | None:
    """The entry of HorseLeg-v0 with the highest return."""
    return max(unlabelled(rows, LEG), key=lambda row: row.scored.intervals["return"].mean, default=None)


def results_table(rows: Sequence[Row], gaits: References) -> str:
    """Returns of agents and of policies without learning, id by id."""
    titles = (
        "id", "policy", "seeds", "steps", "wall s", "processor s", "return: IQM [95 %]", "mean",
        "worst to best seed", "seeds above run", "above open-loop",
        "seeds that beat both gaits: after s, median (slowest)",
    )  # fmt: skip
    lines = []
    for env_id, known in gaits.items():
        lines += [
            [f"`{env_id}`", one.name, "", "", "", "", one.intervals["return"].text()]
            for one in known.values()
        ]
        lines += [[f"`{env_id}`", row.title, *row_cells(row, known)] for row in unlabelled(rows, env_id)]
    return table(titles, lines)


def row_cells(row: Row, known: Mapping[str, Scored]) -> list[str]:
    """The cells of an entry from its seeds on."""
    count, returns = len(row.results), np.array([one.figures["return"] for one in row.results])
    steps, wall, cpu = (
        np.median([one.final[key] for one in row.results]) for key in ("steps", "wall_s", "cpu_s")
    )

    def above(name: str) -> str:
        if name not in known:
            return ""
        return f"{np.sum(returns > known[name].intervals['return'].mean)}/{count}"

    seconds = times_to_beat(row, known)
    return [
        str(count) if count == row.entry.seeds else f"{count} of {row.entry.seeds}",
        f"{steps:,.0f}", f"{wall:,.0f}", f"{cpu:,.0f}",
        row.scored.intervals["return"].text(), f"{returns.mean():.1f}",
        f"{returns.min():.1f} to {returns.max():.1f}", above("run"), above(OPEN_LOOP),
        f"{len(seconds)}/{count}" + (f": {np.median(seconds):.0f} ({max(seconds):.0f})" if seconds else ""),
    ]  # fmt: skip


def times_to_beat(row: Row, known: Mapping[str, Scored]) -> list[float]:
    """Wall seconds of training until the curve is above both gaits, of the seeds that get there."""
    return row.times_above(max(known[name].curve_return for name in GAITS))


def figures_table(rows: Sequence[Row], gaits: References) -> str:
    """What the gaits are like, id by id."""
    lines = [
        [f"`{env_id}`", one.name, *cells(one)]
        for env_id, known in gaits.items()
        for one in (*known.values(), *(row.scored for row in unlabelled(rows, env_id)))
    ]
    return table(["id", "policy", *(title for title, *_ in GAIT_COLUMNS.values())], lines)


def bars_table(rows: Sequence[Row], known: Mapping[str, Scored]) -> str:
    """What was asked of the baselines, and whether they do it."""
    best, lines = best_of(rows), []
    if best is not None:
        ours = best.scored.intervals["return"]
        for name in (name for name in ("run", OPEN_LOOP) if name in known):
            other = known[name].intervals["return"]
            word = "met" if ours.above(other) else "not met"
            asked = f"the best agent returns more than {name}, intervals apart"
            lines.append([asked, f"{word}: {best.title} {ours.text()} beside {other.text()}"])
    lines += [[row.entry.asked, bar(row, known["run"])] for row in rows if row.entry.label]
    for row in unlabelled(rows, LEG):
        if row.entry.algo == "ppo":
            quick = sum(seconds <= QUICK_SECONDS for seconds in times_to_beat(row, known))
            word = "met" if quick >= QUICK_SHARE * row.entry.seeds else "not met"
            asked = f"PPO beats both gaits within {QUICK_SECONDS:.0f} s in {QUICK_SHARE:.0%} of its seeds"
            lines.append([asked, f"{word}: {quick} of {row.entry.seeds}"])
    return table(["bar", ""], lines)


def made_text(rows: Sequence[Row]) -> str:
    """The command of each entry's first seed, and the versions of all."""
    commands = "\n".join(f"    {row.command}" for row in rows)
    versions = ", ".join(f"{name} {value}" for name, value in versions_of(rows).items())
    return f"The first seed of each:\n\n{commands}\n\nVersions: {versions}.\n"


def write_data(rows: Sequence[Row], folder: Path) -> None:
    """curves.csv, the learning curves of all, and runs.csv, a line for each training."""
    curves, ends = [], []
    for row in rows:
        for one in row.results:
            about = {"policy": row.title, "env_id": row.entry.env_id, "seed": one.final["seed"]}
            curves += [about | line for line in one.curve]
            clock = {key: one.final[key] for key in ("steps", "wall_s", "cpu_s")}
            numbers = {key: round(value, 4) for key, value in (clock | one.figures).items()}
            ends.append(about | numbers | {"config": json.dumps(row.settings)})
    columns = ("policy", "env_id", "seed", *COLUMNS)
    write_csv(folder / "curves.csv", columns, curves)
    write_csv(folder / "runs.csv", (*columns, "config"), ends)


def over_time(row: Row, key: str, is_log: bool) -> tuple[Floats, Floats]:
    """IQM and interval of the return, shape (3, `POINTS`), over "steps" or "wall_s", shape (`POINTS`,), up to
    the last score that all seeds have; on a logarithmic axis from the first score of a trained policy."""
    curves = [one.curve for one in row.results]
    last = min(curve[-1][key] for curve in curves)
    first = min(max(curve[1][key] for curve in curves), last)
    x = np.geomspace(first, last, POINTS) if is_log else np.linspace(0, last, POINTS)
    each = [np.interp(x, [p[key] for p in curve], [p["return"] for p in curve]) for curve in curves]
    return x, iqm(each)


def draw_curves(rows: Sequence[Row], known: Mapping[str, Scored], path: Path) -> None:
    """One picture: the return against steps and against wall time, a line and a band for each entry."""
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.ticker import EngFormatter, NullFormatter

    from hoof_env.paper.figure_style import BLUE, GREEN, GREY, ORANGE, PURPLE, STYLE

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9, 3.6), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        lowest = known["run"].intervals["return"].mean
        for axes, key, label in zip(
            panels, ("steps", "wall_s"), ("environment steps", "wall time of training [s]"), strict=True
        ):
            ends = [one.curve[-1][key] for row in rows for one in row.results]
            is_log = max(ends) > WIDE * min(ends)
            for row, colour in zip(rows, (BLUE, ORANGE, GREEN, PURPLE), strict=False):
                x, (mean, low, high) = over_time(row, key, is_log)
                lowest = min(lowest, float(mean.min()))
                axes.fill_between(x, low, high, color=colour, alpha=0.2, lw=0)
                axes.plot(x, mean, color=colour, lw=1.5, label=f"{row.title}, {len(row.results)} seeds")
            for name, style in ((OPEN_LOOP, "--"), ("run", ":")):
                if name in known:
                    level = known[name].intervals["return"].mean
                    axes.axhline(level, color=GREY, lw=1.2, ls=style, label=name)
            if is_log:
                axes.set_xscale("log")
                axes.xaxis.set_minor_formatter(NullFormatter())
            axes.xaxis.set_major_formatter(EngFormatter(sep=" " if key == "steps" else ""))
            axes.set_xlabel(label)
            axes.grid(axis="y", color=GREY, alpha=0.15)
        panels[0].set_ylabel("return: IQM, 95 % interval")
        panels[0].set_ylim(bottom=max(lowest - 2, -25))
        panels[0].set_title(rows[0].entry.env_id, loc="left")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        figure.savefig(path, dpi=130)


def report(args: Args) -> Path:
    """Write page, pictures and CSV; returns the page.

    Raises:
        DataFileError: nothing is done, a result cannot be read, or the page has lost its marks.
    """
    folder = args.runs or FOLDERS[args.subset]
    rows = read_results(load_plan(args.subset), folder)
    is_small = args.runs is not None or args.subset != "full"
    page = args.page or (folder / "baselines.md" if is_small else PAGE)
    beside = page.with_suffix("")
    beside.mkdir(parents=True, exist_ok=True)
    gaits = {row.entry.env_id: references(row.entry.env_id) for row in rows}
    for env_id, known in gaits.items():
        if shown := unlabelled(rows, env_id):
            draw_curves(shown, known, beside / f"{env_id.rpartition('/')[2]}.png")
    write_data(rows, beside)
    known = gaits.get(LEG) or references(LEG)
    text = (BLANK if args.subset != "full" or not page.is_file() else page).read_text(encoding="utf-8")
    for mark, content in {
        "bars": bars_table(rows, known),
        "table": results_table(rows, gaits),
        "figures": figures_table(rows, gaits),
        "matched": compare(rows, best_of(rows), known["run"]),
        "made": made_text(rows),
    }.items():
        text = put(text, mark, content)
    runs.write_text(page, text)
    return page


def main(argv: list[str] | None = None) -> None:
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.baselines_report", description=__doc__)
    print(f"written: {report(args)}")


if __name__ == "__main__":
    run(main)
