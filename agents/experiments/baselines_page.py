"""The page of the baselines, report.md: tables, curves as CSV and pictures.

An agent of HorseLegSpeed-v0 follows its command by the slope of its speed over constant commands.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, NullFormatter

from agents import runs
from agents.experiments.outcomes import Row, read_rows, seconds_to, versions_of
from agents.experiments.plans import LEG, Entry
from agents.experiments.training import COLUMNS
from agents.settings import load_settings
from agents.statistics import compare
from hoof_env._output import markdown_table
from hoof_env._plotting import BLUE, GREEN, GREY, ORANGE, PURPLE, STYLE
from hoof_env.errors import HoofEnvError
from hoof_env.evaluation.episodes import FINAL_SEEDS, score_vector
from hoof_env.evaluation.statistics import (
    PUBLISHED,
    TABLE,
    Floats,
    Scored,
    cells,
    iqm,
    over_episodes,
    over_seeds,
)
from hoof_env.policies.saved import ABOUT
from hoof_env.tasks.registry import TASKS

GAITS = ("run", "walk")
OPEN_LOOP = "open-loop"  # name of the gait that CMA-ES found for an id, without learning

SPEED = "hoof_env/HorseLegSpeed-v0"
COMMANDS = 5  # speeds between the lowest and the highest command
SETTLED = 4.0  # seconds after which the speed is the commanded one

POINTS = 40  # points of a drawn curve
SOON = 0.4  # bar: share of the first row's time to the open-loop gait's return
References = Mapping[str, Mapping[str, Scored]]  # policies without learning, by id and name


# Policies without learning, and how commands are followed


def references(env_id: str) -> dict[str, Scored]:
    """Score the paper's gaits and the open-loop gait of an id on the episodes of the agents; return those
    that the id has, by name."""
    known = {}
    for name in (*GAITS, OPEN_LOOP):
        try:
            known[name] = reference(name, name, env_id)
        except HoofEnvError:
            # Not every id has an open-loop gait; the paper's gaits must be found
            if name in GAITS:
                raise
    return known


def reference(name: str, policy: Any, env_id: str) -> Scored:
    """Score a policy without learning, as `score_vector` takes it."""
    return Scored(name, over_episodes(score_vector(policy, env_id, FINAL_SEEDS)))


def settled_speeds(row: Row) -> dict[int, list[float]]:
    """Return, by seed, `settled_speed` under each of `following_commands`, for agents of `SPEED` with stored
    policies."""
    speeds_of = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # they were trained with other commands, which is meant
        for outcome in row.outcomes:
            if (outcome.folder / ABOUT).is_file():
                speeds = [settled_speed(str(outcome.folder), command) for command in following_commands()]
                speeds_of[outcome.final["seed"]] = speeds
    return speeds_of


def following_commands() -> list[float]:
    """Return commands [m/s] from the slowest to the fastest of `SPEED`."""
    low, high = TASKS["speed"].defaults["target_speed"]
    return [float(command) for command in np.linspace(low, high, COMMANDS)]


def following(title: str, speeds: Mapping[int, Sequence[float]]) -> Scored:
    """Estimate the change of the settled speed over the change of command: the slope of a line through
    them."""
    slopes = [
        {"follows": float(np.polyfit(following_commands(), settled, 1)[0])} for settled in speeds.values()
    ]
    return Scored(title, over_seeds(slopes), slopes)


def settled_speed(policy: str, command: float) -> float:
    """Return the mean speed [m/s] after the first `SETTLED` seconds under one command."""
    kwargs: dict[str, Any] = {"target_speed": [command, command]}
    # Twice the same episodes, whole and cut off: the difference is the settled part
    whole = score_vector(policy, SPEED, FINAL_SEEDS, **kwargs)
    start = score_vector(policy, SPEED, FINAL_SEEDS, **kwargs, episode_seconds=SETTLED)
    distance = np.mean([episode["distance_m"] for episode in whole]) - np.mean(
        [episode["distance_m"] for episode in start]
    )
    return float(distance / (whole[0]["seconds"] - SETTLED))


# Tables and pictures


def of_id(rows: Sequence[Row], env_id: str) -> list[Row]:
    """Return the rows of one id."""
    return [row for row in rows if row.entry.env_id == env_id]


def results_table(rows: Sequence[Row], gaits: References) -> str:
    """Return the table of returns: policies without learning and agents, by id."""
    titles = (
        "id",
        "policy",
        "seeds",
        "steps",
        "wall s",
        "processor s",
        "return: IQM [95 %]",
        "mean",
        "worst to best seed",
        "seeds above run",
        "above open-loop",
    )
    lines = []
    for env_id, known in gaits.items():
        lines += [
            [f"`{env_id}`", policy.name, "", "", "", "", policy.intervals["return"].text()]
            for policy in known.values()
        ]
        lines += [[f"`{env_id}`", row.title, *row_cells(row, known)] for row in of_id(rows, env_id)]
    return markdown_table(titles, lines)


def row_cells(row: Row, known: Mapping[str, Scored]) -> list[str]:
    """Return the cells of an agent in the table of returns; `known` are the policies without learning."""
    count = len(row.outcomes)
    returns = np.array([outcome.figures["return"] for outcome in row.outcomes])

    def median(key: str) -> str:
        return f"{np.median([outcome.final[key] for outcome in row.outcomes]):,.0f}"

    def above(name: str) -> str:
        if name not in known:
            return ""
        return f"{np.sum(returns > known[name].intervals['return'].mean)}/{count}"

    return [
        str(count) if count == row.entry.seeds else f"{count} of {row.entry.seeds}",
        median("steps"),
        median("wall_s"),
        median("cpu_s"),
        row.scored.intervals["return"].text(),
        f"{returns.mean():.1f}",
        f"{returns.min():.1f} to {returns.max():.1f}",
        above("run"),
        above(OPEN_LOOP),
    ]


def figures_table(rows: Sequence[Row], gaits: References) -> str:
    """Return the table of gait figures: policies without learning and agents, by id."""
    lines = []
    for env_id, known in gaits.items():
        agents = [row.scored for row in of_id(rows, env_id)]
        lines += [[f"`{env_id}`", policy.name, *cells(policy)] for policy in (*known.values(), *agents)]
    return markdown_table(["id", "policy", *(title for title, *_ in TABLE.values())], lines)


def pace_table(rows: Sequence[Row], known: Mapping[str, Scored]) -> str:
    """Return a table of steps a second, return, and seconds until the open-loop gait's return, compared with
    the first row seed by seed. Only seeds that reach that return in both rows are compared."""
    level = known[OPEN_LOOP].intervals["return"].mean
    first = rows[0]
    rates = []
    times = []
    for row in rows:
        ends = [outcome.final for outcome in row.outcomes]
        rates.append({end["seed"]: end["steps"] / end["wall_s"] for end in ends})
        times.append({outcome.final["seed"]: seconds_to(level, outcome) for outcome in row.outcomes})
    lines = []
    for row, rate, time in zip(rows, rates, times, strict=True):
        # Only seeds that both rows have are paired
        paired = [seed for seed in rate if seed in rates[0]]
        faster = [rate[seed] / rates[0][seed] for seed in paired]
        parts = [time[seed] / times[0][seed] for seed in paired if np.isfinite(time[seed] + times[0][seed])]
        returns = row.scored.intervals["return"]
        first_returns = first.scored.intervals["return"]
        lines.append(
            [
                row.title,
                str(len(rate)),
                span(rate.values(), 0),
                span(faster, 2),
                returns.text(),
                "no" if returns.mean < first_returns.low else "yes",
                span(time.values(), 0),
                f"{np.isfinite([*time.values()]).sum()}/{len(time)}",
                span(parts, 2),
                f"{np.sum(np.array(parts) <= SOON)}/{len(paired)}",
            ]
        )
    titles = (
        "policy",
        "seeds",
        "steps/s",
        f"beside {first.title}",
        "return: IQM [95 %]",
        f"IQM not below {first.title}'s interval",
        f"s to {level:.1f}",
        "reached",
        f"beside {first.title}",
        f"at most {SOON}",
    )
    return markdown_table(titles, lines)


def span(values: Iterable[float], digits: int) -> str:
    """Format median, least and greatest; an empty text if there are no values."""
    numbers = np.array([*values])
    if not numbers.size:
        return ""
    three = (np.median(numbers), numbers.min(), numbers.max())
    texts = [f"{x:,.{digits}f}" if np.isfinite(x) else "never" for x in three]
    return "{} ({} to {})".format(*texts)


def draw_frontier(rows: Sequence[Row], known: Mapping[str, Scored], path: Path) -> None:
    """Draw the return over steps a second, a point for each row."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(8, 3.6), layout="constrained")
        axes = figure.subplots()
        for row, marker in zip(rows, cycle("osD^vP*X")):
            rate = np.median([outcome.final["steps"] / outcome.final["wall_s"] for outcome in row.outcomes])
            returns = row.scored.intervals["return"]
            # A single seed has no interval
            bars = np.nan_to_num([[returns.mean - returns.low], [returns.high - returns.mean]])
            axes.errorbar(
                [rate],
                [returns.mean],
                bars,
                fmt=marker,
                capsize=3,
                color=BLUE if row.entry.algo == "ppo_flat" else ORANGE,
                label=f"{row.title}, {len(row.outcomes)} seeds",
            )
        axes.axhline(known[OPEN_LOOP].intervals["return"].mean, color=GREY, lw=1.2, ls="--", label=OPEN_LOOP)
        axes.set(xlabel="environment steps a second of training", ylabel="return: IQM, 95 % interval")
        axes.xaxis.set_major_formatter(EngFormatter(sep=" "))
        axes.grid(axis="y", color=GREY, alpha=0.15)
        figure.legend(loc="outside right upper")
        figure.savefig(path, dpi=130)


def following_table(settled: Mapping[str, Mapping[int, Sequence[float]]]) -> str:
    """Return a table of how commands are followed, from settled speeds by row's title and seed."""
    lines = []
    for title, speeds in settled.items():
        slopes = following(title, speeds)
        of_seeds = ", ".join(f"{seed['follows']:.2f}" for seed in slopes.seeds)
        lines.append([title, slopes.intervals["follows"].text(2), of_seeds])
    return markdown_table(["", "change of settled speed / change of command", "each seed"], lines)


def write_settled(settled: Mapping[str, Mapping[int, Sequence[float]]], path: Path) -> None:
    """Write a line for each agent and command."""
    lines = []
    for title, speeds_of in settled.items():
        for seed, speeds in speeds_of.items():
            for command, speed in zip(following_commands(), speeds, strict=True):
                figures = {"command_m_s": command, "settled_m_s": round(speed, 4)}
                lines.append({"policy": title, "seed": seed} | figures)
    runs.write_csv(path, ("policy", "seed", "command_m_s", "settled_m_s"), lines)


def made_text(rows: Sequence[Row]) -> str:
    """Return the commands that train the first seeds, and the versions."""
    commands = "\n".join(f"    {row.command}" for row in rows)
    versions = ", ".join(f"{name} {value}" for name, value in versions_of(rows).items())
    return f"The first seed of each:\n\n{commands}\n\nVersions: {versions}.\n"


def write_data(rows: Sequence[Row], folder: Path) -> None:
    """Write curves.csv, the learning curves of all; runs.csv, a line for each training; and episodes.csv, a
    line for each episode of the final scores."""
    curves = []
    ends = []
    episodes = []
    for row in rows:
        for outcome in row.outcomes:
            about = {"policy": row.title, "env_id": row.entry.env_id, "seed": outcome.final["seed"]}
            curves += [about | line for line in outcome.curve]
            played = zip(FINAL_SEEDS, outcome.final["episodes"], strict=True)
            episodes += [about | {"episode": seed} | short(episode) for seed, episode in played]
            clock = {key: outcome.final[key] for key in ("steps", "wall_s", "cpu_s")}
            numbers = {key: round(value, 4) for key, value in (clock | outcome.figures).items()}
            settings = load_settings(outcome.folder / runs.CONFIG, row.entry.env_id)
            ends.append(about | numbers | {"config": json.dumps(settings)})
    columns = ("policy", "env_id", "seed", *COLUMNS)
    runs.write_csv(folder / "curves.csv", columns, curves)
    runs.write_csv(folder / "runs.csv", (*columns, "config"), ends)
    runs.write_csv(folder / "episodes.csv", ("policy", "env_id", "seed", "episode", *PUBLISHED), episodes)


def short(episode: Mapping[str, float]) -> dict[str, str]:
    """Format the `PUBLISHED` figures of an episode with five digits."""
    return {key: f"{episode[key]:.5g}" for key in PUBLISHED if key in episode}


def over_time(row: Row, key: str) -> tuple[Floats, Floats]:
    """Return steps or seconds, shape (`POINTS`,), and IQM and interval of the return there, shape (3,
    `POINTS`), from the first score of a trained policy to the last that all seeds have; `key` is "steps" or
    "wall_s"."""
    curves = [outcome.curve for outcome in row.outcomes]
    last = min(curve[-1][key] for curve in curves)
    # From the second score on: the first is of the untrained policy, at 0, which no logarithm shows
    first = min(max(curve[1][key] for curve in curves), last)
    x = np.geomspace(first, last, POINTS)
    returns = []
    for curve in curves:
        places = [point[key] for point in curve]
        returns.append(np.interp(x, places, [point["return"] for point in curve]))
    return x, iqm(returns)


def most(rows: Sequence[Row]) -> list[Row]:
    """Return the rows with the largest number of seeds."""
    count = max(row.entry.seeds for row in rows)
    return [row for row in rows if row.entry.seeds == count]


def draw_curves(rows: Sequence[Row], known: Mapping[str, Scored], path: Path) -> None:
    """Draw the return over steps and over seconds for the rows with most seeds."""
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
                axes.plot(x, mean, color=colour, lw=1.5, label=f"{row.title}, {len(row.outcomes)} seeds")
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
        # One failed policy must not flatten all curves
        panels[0].set_ylim(bottom=max(lowest - 2, -25))
        panels[0].set_title(rows[0].entry.env_id, loc="left")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
        figure.savefig(path, dpi=130)


def write(title: str, plan: Sequence[Entry], folder: Path) -> Path:
    """Write page, pictures and CSV files of the trainings in `folder`, and return the path of the page.

    Raises:
        DataFileError: nothing is done, or an outcome cannot be read.
    """
    rows = read_rows(plan, folder)
    page = folder / "report.md"
    pictures = folder / "report"
    pictures.mkdir(parents=True, exist_ok=True)
    gaits = {row.entry.env_id: references(row.entry.env_id) for row in rows}
    parts = [f"# Baselines: {title}", "## Returns", results_table(rows, gaits)]
    for env_id, known in gaits.items():
        name = env_id.rpartition("/")[2]
        draw_curves(of_id(rows, env_id), known, pictures / f"{name}.png")
        parts.append(f"![{name}]({pictures.name}/{name}.png)")
    write_data(rows, pictures)
    parts += ["## What the gaits are like", figures_table(rows, gaits)]
    if LEG in gaits:
        # All are compared with the run
        others = [policy for name, policy in gaits[LEG].items() if name != "run"]
        agents = others + [row.scored for row in of_id(rows, LEG)]
        parts += ["## Beside the paper's run", compare(agents, gaits[LEG]["run"])]
        if OPEN_LOOP in gaits[LEG]:
            parts += ["## How fast they train", pace_table(of_id(rows, LEG), gaits[LEG])]
            draw_frontier(of_id(rows, LEG), gaits[LEG], pictures / "frontier.png")
            parts.append(f"![Return over steps a second]({pictures.name}/frontier.png)")
    settled = {row.title: settled_speeds(row) for row in of_id(rows, SPEED)}
    if any(settled.values()):  # else there are results without policies
        parts += ["## How a command is followed", following_table(settled)]
        write_settled(settled, pictures / "settled.csv")
    parts += ["## How it was made", made_text(rows)]
    runs.write_text(page, "\n\n".join(parts) + "\n")
    return page
