"""The page of the baselines, report.md, from what `agents.baselines` left: tables, curves as CSV and
pictures.

    python -m agents.baselines_report           writes it again, from whatever is done
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, NullFormatter

from agents import runs
from agents.baselines_results import (
    OPEN_LOOP,
    SPEED,
    Row,
    compare,
    following,
    following_commands,
    read_results,
    references,
    seconds_to,
    settled_speeds,
    versions_of,
)
from agents.baselines_run import COLUMNS, CURVE, FOLDERS, LEG, Plan, load_plan, read_curve
from agents.command import run
from agents.evaluate import Score
from agents.score import FINAL_SEEDS
from agents.settings import load_settings
from agents.statistics import PUBLISHED, TABLE, Floats, Scored, cells, iqm
from hoof_env._output import markdown_table
from hoof_env._plotting import BLUE, GREEN, GREY, ORANGE, PURPLE, STYLE

TEMPLATES = Path(__file__).with_name("templates")

POINTS = 40  # of a curve
SOON = 0.4  # of the first row's time to the open-loop gait's return
BINS = 60  # of training episodes in the picture of one training
References = Mapping[str, Mapping[str, Scored]]  # policies without learning, by id and name


@dataclass(frozen=True)
class Args:
    subset: Plan = "full"
    """which plan"""
    runs: Path | None = None
    """folder of the trainings, and of report.md; otherwise runs/baselines, or the plan's own"""


def of_id(rows: Sequence[Row], env_id: str) -> list[Row]:
    return [row for row in rows if row.entry.env_id == env_id]


def results_table(rows: Sequence[Row], gaits: References) -> str:
    titles = (
        "id", "policy", "seeds", "steps", "wall s", "processor s", "return: IQM [95 %]", "mean",
        "worst to best seed", "seeds above run", "above open-loop",
    )  # fmt: skip
    lines = []
    for env_id, known in gaits.items():
        lines += [
            [f"`{env_id}`", one.name, "", "", "", "", one.intervals["return"].text()]
            for one in known.values()
        ]
        lines += [[f"`{env_id}`", row.title, *row_cells(row, known)] for row in of_id(rows, env_id)]
    return markdown_table(titles, lines)


def row_cells(row: Row, known: Mapping[str, Scored]) -> list[str]:
    count = len(row.results)
    returns = np.array([one.figures["return"] for one in row.results])
    steps, wall, cpu = (
        np.median([one.final[key] for one in row.results]) for key in ("steps", "wall_s", "cpu_s")
    )

    def above(name: str) -> str:
        if name not in known:
            return ""
        return f"{np.sum(returns > known[name].intervals['return'].mean)}/{count}"

    return [
        str(count) if count == row.entry.seeds else f"{count} of {row.entry.seeds}",
        f"{steps:,.0f}", f"{wall:,.0f}", f"{cpu:,.0f}",
        row.scored.intervals["return"].text(), f"{returns.mean():.1f}",
        f"{returns.min():.1f} to {returns.max():.1f}", above("run"), above(OPEN_LOOP),
    ]  # fmt: skip


def figures_table(rows: Sequence[Row], gaits: References) -> str:
    lines = [
        [f"`{env_id}`", one.name, *cells(one)]
        for env_id, known in gaits.items()
        for one in (*known.values(), *(row.scored for row in of_id(rows, env_id)))
    ]
    return markdown_table(["id", "policy", *(title for title, *_ in TABLE.values())], lines)


def pace_table(rows: Sequence[Row], known: Mapping[str, Scored]) -> str:
    """Steps a second, return, and seconds until the open-loop gait's return; beside the first row, seed by
    seed. Only seeds that reach that return in both are compared."""
    level = known[OPEN_LOOP].intervals["return"].mean
    first = rows[0]
    rates = []
    times = []
    for row in rows:
        ends = [one.final for one in row.results]
        rates.append({end["seed"]: end["steps"] / end["wall_s"] for end in ends})
        times.append({one.final["seed"]: seconds_to(level, one) for one in row.results})
    lines = []
    for row, rate, time in zip(rows, rates, times, strict=True):
        both = [seed for seed in rate if seed in rates[0]]
        faster = [rate[seed] / rates[0][seed] for seed in both]
        parts = [time[seed] / times[0][seed] for seed in both if np.isfinite(time[seed] + times[0][seed])]
        ours = row.scored.intervals["return"]
        theirs = first.scored.intervals["return"]
        lines.append(
            [row.title, str(len(rate)), span(rate.values(), 0), span(faster, 2), ours.text(),
             "no" if ours.mean < theirs.low else "yes", span(time.values(), 0),
             f"{np.isfinite([*time.values()]).sum()}/{len(time)}", span(parts, 2),
             f"{np.sum(np.array(parts) <= SOON)}/{len(both)}"]
        )  # fmt: skip
    titles = (
        "policy", "seeds", "steps/s", f"beside {first.title}", "return: IQM [95 %]",
        f"IQM not below {first.title}'s interval", f"s to {level:.1f}", "reached", f"beside {first.title}",
        f"at most {SOON}",
    )  # fmt: skip
    return markdown_table(titles, lines)


def span(values: Iterable[float], digits: int) -> str:
    """Median, least and greatest; nothing where there is none."""
    numbers = np.array([*values])
    if not numbers.size:
        return ""
    three = (np.median(numbers), numbers.min(), numbers.max())
    texts = [f"{x:,.{digits}f}" if np.isfinite(x) else "never" for x in three]
    return "{} ({} to {})".format(*texts)


def draw_frontier(rows: Sequence[Row], known: Mapping[str, Scored], path: Path) -> None:
    """Return over steps a second, a point for each row."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8, 3.6), layout="constrained")
        axes = figure.subplots()
        for row, marker in zip(rows, cycle("osD^vP*X")):
            rate = np.median([one.final["steps"] / one.final["wall_s"] for one in row.results])
            of = row.scored.intervals["return"]
            bars = np.nan_to_num([[of.mean - of.low], [of.high - of.mean]])
            axes.errorbar(
                [rate], [of.mean], bars, fmt=marker, capsize=3,
                color=BLUE if row.entry.algo == "ppo_flat" else ORANGE,
                label=f"{row.title}, {len(row.results)} seeds",
            )  # fmt: skip
        axes.axhline(known[OPEN_LOOP].intervals["return"].mean, color=GREY, lw=1.2, ls="--", label=OPEN_LOOP)
        axes.set(xlabel="environment steps a second of training", ylabel="return: IQM, 95 % interval")
        axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
        axes.grid(axis="y", color=GREY, alpha=0.15)
        figure.legend(loc="outside right upper")
        figure.savefig(path, dpi=130)


def following_table(settled: Mapping[str, Mapping[int, Sequence[float]]]) -> str:
    """Of settled speeds by row's title and seed."""
    lines = []
    for title, speeds in settled.items():
        one = following(title, speeds)
        each = ", ".join(f"{seed['follows']:.2f}" for seed in one.seeds)
        lines.append([title, one.intervals["follows"].text(2), each])
    return markdown_table(["", "change of settled speed / change of command", "each seed"], lines)


def write_settled(settled: Mapping[str, Mapping[int, Sequence[float]]], path: Path) -> None:
    """A line for each agent and command."""
    lines = [
        {"policy": title, "seed": seed, "command_m_s": command, "settled_m_s": round(speed, 4)}
        for title, speeds in settled.items()
        for seed, each in speeds.items()
        for command, speed in zip(following_commands(), each, strict=True)
    ]
    runs.write_csv(path, ("policy", "seed", "command_m_s", "settled_m_s"), lines)


def made_text(rows: Sequence[Row]) -> str:
    commands = "\n".join(f"    {row.command}" for row in rows)
    versions = ", ".join(f"{name} {value}" for name, value in versions_of(rows).items())
    return f"The first seed of each:\n\n{commands}\n\nVersions: {versions}.\n"


def write_data(rows: Sequence[Row], folder: Path) -> None:
    """curves.csv, the learning curves of all, runs.csv, a line for each training, and episodes.csv, a line
    for each episode of the final scores."""
    curves = []
    ends = []
    episodes = []
    for row in rows:
        for one in row.results:
            about = {"policy": row.title, "env_id": row.entry.env_id, "seed": one.final["seed"]}
            curves += [about | line for line in one.curve]
            played = zip(FINAL_SEEDS, one.final["episodes"], strict=True)
            episodes += [about | {"episode": seed} | short(episode) for seed, episode in played]
            clock = {key: one.final[key] for key in ("steps", "wall_s", "cpu_s")}
            numbers = {key: round(value, 4) for key, value in (clock | one.figures).items()}
            settings = load_settings(one.folder / runs.CONFIG, row.entry.env_id)
            ends.append(about | numbers | {"config": json.dumps(settings)})
    columns = ("policy", "env_id", "seed", *COLUMNS)
    runs.write_csv(folder / "curves.csv", columns, curves)
    runs.write_csv(folder / "runs.csv", (*columns, "config"), ends)
    runs.write_csv(folder / "episodes.csv", ("policy", "env_id", "seed", "episode", *PUBLISHED), episodes)


def short(episode: Mapping[str, float]) -> dict[str, str]:
    """The `PUBLISHED` figures of an episode with five digits."""
    return {key: f"{episode[key]:.5g}" for key in PUBLISHED if key in episode}


def over_time(row: Row, key: str) -> tuple[Floats, Floats]:
    """IQM and interval of the return, shape (3, `POINTS`), over "steps" or "wall_s", shape (`POINTS`,), from
    the first score of a trained policy to the last that all seeds have."""
    curves = [one.curve for one in row.results]
    last = min(curve[-1][key] for curve in curves)
    first = min(max(curve[1][key] for curve in curves), last)
    x = np.geomspace(first, last, POINTS)
    each = [np.interp(x, [p[key] for p in curve], [p["return"] for p in curve]) for curve in curves]
    return x, iqm(each)


def most(rows: Sequence[Row]) -> list[Row]:
    """Those with as many seeds as any."""
    count = max(row.entry.seeds for row in rows)
    return [row for row in rows if row.entry.seeds == count]


def draw_curves(rows: Sequence[Row], known: Mapping[str, Scored], path: Path) -> None:
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9, 3.6), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        lowest = known["run"].intervals["return"].mean
        for axes, key, label in zip(
            panels, ("steps", "wall_s"), ("environment steps", "wall time of training [s]"), strict=True
        ):
            for row, colour in zip(most(rows), (BLUE, ORANGE, GREEN, PURPLE), strict=False):
                x, (mean, low, high) = over_time(row, key)
                lowest = min(lowest, float(mean.min()))
                axes.fill_between(x, low, high, color=colour, alpha=0.2, lw=0)
                axes.plot(x, mean, color=colour, lw=1.5, label=f"{row.title}, {len(row.results)} seeds")
            for name, style in ((OPEN_LOOP, "--"), ("run", ":")):
                if name in known:
                    level = known[name].intervals["return"].mean
                    axes.axhline(level, color=GREY, lw=1.2, ls=style, label=name)
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


def draw_learning_curve(folder: Path, scores: Sequence[Score], path: Path, **options: Any) -> None:
    """Draw the training episodes of a run folder, the scores on the way where it has a curve.csv, the trained
    policy, which is the first of `scores`, and the means of the others; `options` are of `Figure.savefig`."""
    episodes = runs.read_episodes(folder)
    bins = [part for part in np.array_split(episodes, BINS) if len(part)]
    with matplotlib.rc_context({**STYLE, "font.size": 10}):
        figure = Figure(figsize=(7, 3.6), layout="constrained")
        axes = figure.subplots()
        if bins:
            steps = [1e-6 * part[:, 0].mean() for part in bins]
            low, middle, high = np.transpose([np.quantile(part[:, 1], (0.1, 0.5, 0.9)) for part in bins])
            axes.fill_between(
                steps, low, high, color=BLUE, alpha=0.2, lw=0, label="80 % of training episodes"
            )
            axes.plot(steps, middle, color=BLUE, lw=1.5, label="their median")
        if curve := read_curve(folder / CURVE):
            points = [(1e-6 * row["steps"], row["return"]) for row in curve]
            axes.plot(*zip(*points, strict=True), color=GREEN, lw=1, label="without noise on the way")
        policy, *others = [(score.policy, score.estimates["return"].mean) for score in scores]
        label = f"this policy, without noise: {policy[1]:.1f}"
        axes.plot(1e-6 * training_length(folder)[0], policy[1], "o", color=GREEN, label=label)
        for _, level in others:
            axes.axhline(level, color=ORANGE, lw=1, ls="--")
        height = 0.065 * np.ptp(axes.get_ylim())  # of a line of text
        below = -np.inf
        for name, level in sorted(others, key=lambda one: one[1]):
            below = max(level, below + height)
            axes.annotate(
                f"{name} {level:.1f}", (1, below), (4, 0), xycoords=axes.get_yaxis_transform(),
                textcoords="offset points", va="center", color=ORANGE,
            )  # fmt: skip
        axes.set(xlabel="environment steps [millions]", ylabel="return of an episode")
        axes.set_xlim(left=0)
        axes.grid(axis="y", color=GREY, alpha=0.15)
        figure.legend(loc="outside upper left", ncols=2)
        figure.savefig(path, **options)


def render_template(file: str, /, **values: Any) -> str:
    """Fill a file of agents/templates; values are escaped in a page of HTML."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    templates = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=".html" in file, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    return templates.get_template(file).render(values)


def training_length(folder: Path) -> tuple[int, float]:
    if finished := runs.read_record(folder).get("finished"):
        return int(finished["steps"]), float(finished["seconds"])
    episodes = runs.read_episodes(folder)
    return (int(episodes[-1, 0]), float(episodes[:, 2].max())) if len(episodes) else (0, 0.0)


def report(args: Args) -> Path:
    """Write page, pictures and CSV; returns the page. `DataFileError`: nothing is done, or a result cannot be
    read."""
    folder = args.runs or FOLDERS[args.subset]
    rows = read_results(load_plan(args.subset), folder)
    page = folder / "report.md"
    beside = folder / "report"
    beside.mkdir(parents=True, exist_ok=True)
    gaits = {row.entry.env_id: references(row.entry.env_id) for row in rows}
    parts = [f"# Baselines: the {args.subset} plan", "## Returns", results_table(rows, gaits)]
    for env_id, known in gaits.items():
        name = env_id.rpartition("/")[2]
        draw_curves(of_id(rows, env_id), known, beside / f"{name}.png")
        parts.append(f"![{name}]({beside.name}/{name}.png)")
    write_data(rows, beside)
    parts += ["## What the gaits are like", figures_table(rows, gaits)]
    if LEG in gaits:
        others = [one for name, one in gaits[LEG].items() if name != "run"]
        agents = others + [row.scored for row in of_id(rows, LEG)]
        parts += ["## Beside the paper's run", compare(agents, gaits[LEG]["run"])]
        if OPEN_LOOP in gaits[LEG]:
            parts += ["## How fast they train", pace_table(of_id(rows, LEG), gaits[LEG])]
            draw_frontier(of_id(rows, LEG), gaits[LEG], beside / "frontier.png")
            parts.append(f"![Return over steps a second]({beside.name}/frontier.png)")
    settled = {row.title: settled_speeds(row) for row in of_id(rows, SPEED)}
    if any(settled.values()):  # else there are results without policies
        parts += ["## How a command is followed", following_table(settled)]
        write_settled(settled, beside / "settled.csv")
    parts += ["## How it was made", made_text(rows)]
    runs.write_text(page, "\n\n".join(parts) + "\n")
    return page


def main(argv: list[str] | None = None) -> None:
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.baselines_report", description=__doc__)
    print(f"written: {report(args)}")


if __name__ == "__main__":
    run(main)
