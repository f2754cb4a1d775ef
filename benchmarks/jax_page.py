"""Page docs/evidence/jax.md and its pictures, from what `benchmarks.jax_evidence` measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.jax_learners import SEEDS
from hoof_env._output import markdown_table
from hoof_env._plotting import AMBER, BLUE, GREEN, GREY, ORANGE, STYLE, check_matplotlib, save_png

Found = dict[str, Any]
"""Results and what they were measured with, by part."""

COLOURS = (ORANGE, BLUE, GREEN, AMBER, GREY)
ABOUT = ("jax", "processor", "system", "date", "commit")
RETURNS = "return", "published"
LEGEND = {1: 2, 2: 3}  # columns of a legend by the number of plots
OVER = {"steps": "steps", "seconds": "processor seconds"}

HEAD = """\
# Inside JAX: learners, derivatives, speed

Written by `python -m benchmarks.jax_evidence`. Seconds are processor time without compiling. A return is the
mean of 64 episodes of the compiled environment in which nothing was trained; a row gives the median of its
runs, with the lowest and the highest in brackets. [Inside JAX](../jax.md) describes the programs."""

BLIND = """\
## Without feedback

Policies that see nothing, in the same 64 episodes as the learners below. They are those of
[the published results](../agents.md), whose returns are means of 100 other episodes. A learner that stays
below the best of them does no better than a leg that sees nothing.

{table}"""

LEARNERS = """\
## {name}, beside `ppo_flat`

`{file}` on `{id}`, {steps:,} steps, seeds {seeds}; `ppo_flat` with its settings and the same seeds,
whose learning rate falls over the steps given, once for equal steps and once for as many as take the same
time: its median is {apart:.0f} % away. Compiling took {compiled:.0f} s.

{table}

![Return against steps and against processor seconds](jax/{part}.png)"""

FILES = {"shac": ("SHAC", "examples/jax_shac.py"), "ppo": ("PPO in one program", "examples/jax_ppo.py")}
"""Names and files of the learners, by part."""

GAITS = """\
## A gait by its derivative, beside CMA-ES

`examples/jax_gait.py` on `{id}`: a gait that is locked to the crank, 20 numbers, from {runs} random starts
with a return of {first}, and {steps:,} control steps each. CMA-ES begins at the same gaits with a standard
deviation of 0.3 and 12 candidates, in episodes of 10 s, or of 2 s, of which more fit into as many steps; the
mean of its distribution is what is scored. Compiling the derivative took {compiled:.0f} s.

{table}

![Return against simulated time](jax/gaits.png)"""

DERIVATIVES = """\
## Derivatives through windows

`examples/jax_gradient.py`, in float64, 16 starts: the derivative of the return along one direction of a
constant action, and its distance from the central difference of 0.001, relative to it; medians.

{table}

![Size of derivatives and their distance from differences, by window](jax/derivatives.png)"""

SPEED = """\
## Steps inside `jax.jit`

`python -m benchmarks.jax_speed` on `{id}`, a linear policy: microseconds of processor time (of wall
clock) for a vector step, each the least of many short measurements. No caller can save the time of the kernel
alone, to which reading the clock adds.

{table}"""


def spread(values: list[float], digits: int = 1) -> str:
    """Format the median, and the lowest and highest in brackets."""
    low, middle, high = (f"{x:.{digits}f}" for x in (min(values), np.median(values), max(values)))
    return f"{middle} ({low} to {high})"


def table_of_curves(curves: dict[str, Any]) -> str:
    """Return the table of the last scores of curves."""
    rows = []
    for name, runs in curves.items():
        last = [run[-1] for run in runs]
        steps, seconds = (np.median([score[key] for score in last]) for key in OVER)
        best = spread([max(score["return"] for score in run) for run in runs])
        rows.append([name, f"{steps:,.0f}", f"{seconds:.1f}", spread([x["return"] for x in last]), best])
    return markdown_table(("learner", "steps", "seconds", "last return", "best score of a run"), rows)


def unequal(curves: dict[str, Any], name: str) -> float:
    """Return by how much the seconds of `ppo_flat` that were to be equal differ from a learner's, as a share
    of these."""
    both = name, "ppo_flat, equal seconds"
    ours, theirs = (np.median([run[-1]["seconds"] for run in curves[each]]) for each in both)
    return float(abs(theirs / ours - 1.0))


def thousands(x: float, _: int) -> str:
    """Format a number of steps."""
    return f"{x / 1000:,.0f}k"


def page(found: Found) -> str:
    """Return the page of what was measured."""
    parts = [HEAD]
    results = {part: each["result"] for part, each in found.items()}
    if "blind" in found:
        rows = [
            [
                name,
                f"{each['episodes']:,}" if each["episodes"] else "",
                *(f"{each[key]:.1f}" for key in RETURNS),
            ]
            for name, each in results["blind"].items()
        ]
        head = ("policy", "episodes of its search", "return", "published return")
        parts.append(BLIND.format(table=markdown_table(head, rows)))
    for part, (name, file) in FILES.items():
        if part in found:
            given = results[part]
            about = {key: given[key] for key in ("id", "steps", "compiled")}
            about |= {
                "seeds": f"{SEEDS[part][0]} to {SEEDS[part][-1]}",
                "apart": 100 * unequal(given["curves"], name),
            }
            table = table_of_curves(given["curves"])
            parts.append(LEARNERS.format(name=name, file=file, part=part, table=table, **about))
    if "gaits" in found:
        given = results["gaits"]
        first = spread(given["first"])
        about = {key: given[key] for key in ("id", "steps", "compiled")}
        table = table_of_curves(given["curves"])
        parts.append(GAITS.format(runs=len(given["first"]), first=first, table=table, **about))
    if "derivatives" in found:
        rows = [
            [name, f"{row['seconds']:g}", f"{row['size']:.3g}", f"{row['apart']:.2g}"]
            for name, each in results["derivatives"].items()
            for row in each
        ]
        head = ("body", "window [s]", "size of the derivative", "distance from the difference")
        parts.append(DERIVATIVES.format(table=markdown_table(head, rows)))
    if "speed" in found:
        from benchmarks.jax_speed import table as table_of_speed

        given = results["speed"]
        parts.append(SPEED.format(id=given["id"], table=table_of_speed(given["rows"])))
    rows = [[part, *(each["about"][key] for key in ABOUT)] for part, each in found.items()]
    parts.append(f"## Measured with\n\n{markdown_table(('part', *ABOUT), rows)}")
    return "\n\n".join(parts) + "\n"


def draw(found: Found, folder: Path) -> None:
    """Draw what was measured into a folder."""
    check_matplotlib()
    import matplotlib.pyplot as plt
    from matplotlib.ticker import LogLocator, NullFormatter

    def axes(count: int) -> Any:
        return plt.subplots(1, count, figsize=(4.2 * count, 3.4), layout="constrained", squeeze=False)

    with plt.rc_context(STYLE):
        both = ("steps", "seconds")
        for part, keys in (("shac", both), ("ppo", both), ("gaits", ("steps",))):
            if part not in found:
                continue
            figure, ((*places,),) = axes(len(keys))
            for axis, key in zip(places, keys, strict=True):
                for (name, runs), colour in zip(
                    found[part]["result"]["curves"].items(), COLOURS, strict=False
                ):
                    _draw_runs(axis, name, runs, key, colour)
                _draw_blind(axis, found)
                axis.set(xlabel=OVER[key], ylabel="mean return of 64 episodes")
            for axis, label in zip(places if len(keys) > 1 else (), (thousands, "{x:g}"), strict=False):
                axis.set_xscale("log")
                axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
                axis.xaxis.set_major_formatter(label)
                axis.xaxis.set_minor_formatter(NullFormatter())
            handles, labels = places[0].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside lower center", ncols=LEGEND[len(keys)], fontsize=7)
            save_png(figure, folder / f"{part}.png")
            plt.close(figure)
        if "derivatives" in found:
            figure, ((*places,),) = axes(2)
            for (name, rows), colour in zip(found["derivatives"]["result"].items(), COLOURS, strict=False):
                seconds = [row["seconds"] for row in rows]
                for axis, key in zip(places, ("size", "apart"), strict=True):
                    axis.loglog(seconds, [row[key] for row in rows], "o-", color=colour, label=name)
            for axis, what in zip(
                places, ("size of the derivative", "distance from the difference"), strict=True
            ):
                axis.set(xlabel="window [s]", ylabel=what)
            places[0].legend()
            save_png(figure, folder / "derivatives.png")
            plt.close(figure)


def _draw_blind(axis: Any, found: Found) -> None:
    """Draw the returns of policies that see nothing, as lines across."""
    if "blind" in found:
        for (name, each), style in zip(found["blind"]["result"].items(), (":", "--", "-"), strict=True):
            axis.axhline(each["return"], color=GREY, lw=0.8, ls=style, label=name, zorder=0)


def _draw_runs(axis: Any, name: str, runs: Any, key: str, colour: str) -> None:
    """Draw the median of runs, and each of them thinly."""
    length = min(len(run) for run in runs)
    x = np.array([[score[key] for score in run[:length]] for run in runs])
    y = np.array([[score["return"] for score in run[:length]] for run in runs])
    axis.plot(x.T, y.T, color=colour, lw=0.5, alpha=0.5)
    axis.plot(np.median(x, 0), np.median(y, 0), color=colour, lw=1.8, label=name)
