"""What makes a horse change gait, asked of the model: `python -m agents.gait_change`.

It searches for the best walks, trots and free gaits at twelve speeds (`agents.gait_map`), leaving out what is
in the file, and writes `docs/evidence/gait_change.md` with its figure: which gait spares more at each speed,
by work, peak force, loading and their mixture, and at which speed the better one changes. Then it trains
agents that choose their footfall (`agents.gait_agents`), which tell whether they change their gait.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from agents import runs
from agents.command import parse, run
from agents.gait_agents import Herd, complete
from agents.gait_agents_page import section
from agents.gait_map import (
    CHANGES,
    CLOSE,
    FREE,
    FROUDES,
    JUMP,
    KINDS,
    MIXTURE,
    OBJECTIVES,
    SCALES,
    STRIDE_BAR,
    TITLES,
    Map,
    jumps_between,
    search_all,
    stands_of,
    stride_at,
    turned,
    value_of,
)
from agents.judge_pictures import DPI, LETTERS, WIDTH
from agents.judges import read_judges
from agents.kept import EVIDENCE, file_of
from hoof_env._output import check_folder, markdown_table
from hoof_env.errors import DataFileError, count

NAME = "gait_change"
COLOURS = {"walk": "#0072B2", "trot": "#D55E00", FREE: "#555555"}
SYMBOLS = {"walk": "o", "trot": "^", FREE: "x"}

Row = dict[str, Any]

PAGE = """# What makes a horse change gait

Written by `{command}` at commit `{commit}`; [the gaits]({name}/searches.json) were searched at commit
`{searched}`.

**Asked.** Horses walk at low speed, trot from a Froude number of 0.35 to 0.5 on and canter from 2 to 3 on.
Hoyt and Taylor (1981) explain the changes by energy, Farley and Taylor (1991) that from trot to gallop by the
peak force. Does a gait's best lag jump in the model, at which speed, and by which of these?

**Searched.** At twelve Froude numbers, the best gait of `Horse-v0` with zero actions: with a walk's
lag, {walk_lag} strides, with a trot's, under {trot_lag}, and with any; by positive work of the drives over
weight and distance, by the mean of the stances' peaks, by the mean of their steepest rises, and by the mean
of the three over {scales}. The stride is given, since a horse's grows steadily through its changes of
gait: 1.66 Fr^0.215 hip heights, fitted to a trot's (Bullimore and Burn 2006), within {stride_bar}.
Duty factors, number of peaks and all else are free. A gait counts if it falls in at most a tenth of its
starts, is within 15 % of the speed, slips less than 0.10 m a stance, lands about once a turn and keeps the
stride.
CMA-ES; {seeds}.

**Found.** {found}

![Work, peak force, loading and their mixture of the best walks and trots, and the lag of the best gait, over
the Froude number]({name}/map.png)

Lines are means over seeds, symbols single seeds; grey bands are the Froude numbers at which horses change
gait, and the lag of their walk.

## Where the better gait changes

{changes}

*Better* is also a gait where the other was not found. *Equal* are gaits that differ by less than {close}. The
*lag* is that of the best gait of all kinds; it jumps where it differs by more than {jump} strides from one
speed to the next.

## By speed

The best over all seeds; in brackets the number of seeds of which the search found one that counts.

{table}

{agents}## What horses do, and what the model cannot say

{limits}

```bash
{command}    # hours; goes on after an interruption
```
"""

LIMITS = """* Horses change from walk to trot at Froude numbers 0.35 to 0.5, where a trot begins to cost less
  (Hoyt and Taylor 1981), and from trot to gallop at 2 to 3, at a lower speed when loaded, and with 14 % less
  peak force after the change (Farley and Taylor 1991; all read second-hand).
* **No canter.** Left and right legs are half a stride apart, so that of trot and gallop only the trot exists.
  The second half of the question, from trot to canter, cannot be asked of this map.
* **No trot but for its lag.** In the plane a trot cannot be told from a pace, and *walk* and *trot* here are
  names of a lag alone: a fast "walk" has short stances and flight.
* **Mechanical work, not metabolism.** The drives impose the motion and take no energy back; only hooves are
  elastic. A horse stores a trot's energy in tendons, which makes a trot cheap, and its muscles cost more as
  they shorten faster. Neither is in the model.
* **The stride is given.** With a free one the cheapest gaits have longer strides than a horse's.
* **Agents learn around searched gaits.** Their actions change the swing a little and the cranks' rates not at
  all, so that a lag far from the one with which they begin has to do with a swing that was made for another.
  More steps, wider actions or another learner might lead further.
* **Searches end early.** A gait that was not found is no proof that there is none, and the best of few seeds
  is no more than an upper bound. Differences smaller than those between seeds say nothing."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    seeds: int = 3
    """searches at each speed, each from its own draws"""
    search: bool = True
    """search for gaits and train agents that are missing; without it the page is of what is in the files"""
    found: Path | None = None
    """file of found gaits, which is gone on with; by default that of the page in --out"""
    out: Path = EVIDENCE
    """folder of the page"""


def best_of(rows: Sequence[Row], froude: float, kind: str, objective: str) -> Row | None:
    """Return the kept gait that spares most of those that count as of a kind at a Froude number, whatever it
    was searched for; None without one."""
    counting = [row for row in rows if row["froude"] == froude and stands_of(row, kind)]
    return min(counting, key=lambda row: float(value_of(row, objective)), default=None)


def better_of(rows: Sequence[Row], froude: float, objective: str) -> str:
    """Return which of walk and trot spares more: its kind, "equal", or "none" where neither counts."""
    values = {kind: best_of(rows, froude, kind, objective) for kind in KINDS}
    spared = {kind: float(value_of(row, objective)) for kind, row in values.items() if row is not None}
    if not spared:
        return "none"
    first = min(spared, key=lambda kind: spared[kind])
    others = [value for kind, value in spared.items() if kind != first]
    is_close = any(value / spared[first] - 1 < CLOSE for value in others)
    return "equal" if is_close else first


def changes_of(rows: Sequence[Row], objective: str) -> list[tuple[float, float, str, str]]:
    """Return where the better gait changes: two Froude numbers, and the kinds at them. Speeds with gaits that
    are equal or do not count are passed over."""
    known = [(froude, better_of(rows, froude, objective)) for froude in FROUDES]
    known = [(froude, kind) for froude, kind in known if kind in KINDS]
    return [(a, b, before, after) for (a, before), (b, after) in pairwise(known) if before != after]


def lags_of(rows: Sequence[Row], objective: str) -> list[tuple[float, float]]:
    """Return Froude numbers and the lag of the best gait of any kind there [strides], from -0.1 to 0.4."""
    found = []
    for froude in FROUDES:
        row = best_of(rows, froude, FREE, objective)
        if row is not None:
            found.append((froude, turned(float(row["lag"]))))
    return found


def jumps_of(rows: Sequence[Row], objective: str) -> list[tuple[float, float, float, float]]:
    """Return where the lag of the best gait jumps: two Froude numbers, and the lags at them."""
    return jumps_between(lags_of(rows, objective))


def seeds_of(rows: Sequence[Row]) -> list[int]:
    """Return the seeds that have gaits of all kinds to be compared."""
    seeds = sorted({int(row["seed"]) for row in rows})
    return [s for s in seeds if set(KINDS) <= {row["kind"] for row in rows if row["seed"] == s}]


def compared(rows: Sequence[Row]) -> list[Row]:
    """Return the rows of those seeds and Froude numbers at which both walk and trot were searched for: a gait
    with more searches than the other would not be compared fairly."""
    kinds: dict[tuple[int, float], set[str]] = {}
    for row in rows:
        kinds.setdefault((row["seed"], row["froude"]), set()).add(row["kind"])
    return [row for row in rows if set(KINDS) <= kinds[row["seed"], row["froude"]]]


def as_horses(rows: Sequence[Row], objective: str) -> bool:
    """Return True if the better gait changes once up to Froude number 1, from walk to trot, and where horses
    do."""
    low, high = CHANGES["walk to trot"]
    slow = [change for change in changes_of(rows, objective) if change[0] < 1]
    return [change[2:] for change in slow] == [("walk", "trot")] and slow[0][0] <= high and slow[0][1] >= low


def span(low: float, high: float) -> str:
    """Return two Froude numbers as text."""
    return f"{low:g} to {high:g}"


def change_rows(rows: Sequence[Row]) -> list[list[str]]:
    """Return a row for each objective, of all seeds together and of each alone."""
    table = []
    for objective in OBJECTIVES:
        seeds = seeds_of(rows)
        parts = [("all", list(rows))] + [(str(s), [row for row in rows if row["seed"] == s]) for s in seeds]
        for name, part in parts if len(seeds) > 1 else parts[:1]:
            better = [better_of(part, froude, objective) for froude in FROUDES]
            of_kind = {
                kind: [f"{froude:g}" for froude, one in zip(FROUDES, better, strict=True) if one == kind]
                for kind in (*KINDS, "equal")
            }
            changes = [f"{span(a, b)}: {x} to {y}" for a, b, x, y in changes_of(part, objective)]
            jumps = [f"{span(a, b)}: {x:.2f} to {y:.2f}" for a, b, x, y in jumps_of(part, objective)]
            table.append(
                [
                    TITLES[objective],
                    name,
                    *(", ".join(of_kind[kind]) or "-" for kind in (*KINDS, "equal")),
                    "; ".join(changes) or "none",
                    "; ".join(jumps) or "none",
                ]
            )
    return table


def speed_rows(rows: Sequence[Row]) -> list[list[str]]:
    """Return a row for each Froude number and kind: its best figures by objective, and how many count."""
    table = []
    for froude in FROUDES:
        for kind in (*KINDS, FREE):
            of_kind = [row for row in rows if row["froude"] == froude and row["kind"] == kind]
            if not of_kind:
                continue
            seeds = sorted({row["seed"] for row in of_kind})
            counting = sum(any(stands_of(row) for row in of_kind if row["seed"] == s) for s in seeds)
            cells = [f"{froude:g}", f"{kind} ({counting} of {len(seeds)})"]
            for objective, digits in (("work", 2), ("peak", 2), ("loading", 0)):
                row = best_of(rows, froude, kind, objective)
                name = OBJECTIVES[objective][0]
                cells.append("-" if row is None else f"{row[name]:.{digits}f}")
            row = best_of(rows, froude, kind, "mixture")
            if row is None:
                cells += ["-"] * 5
            else:
                cells += [
                    f"{value_of(row, 'mixture'):.2f}",
                    f"{row['lag']:.2f}",
                    f"{row['duty_fore']:.2f}, {row['duty_hind']:.2f}",
                    f"{row['stride_over_hip']:.2f} ({stride_at(froude):.2f})",
                    f"{max(row['slip_fore'], row['slip_hind']):.2f}",
                ]
            table.append(cells)
    return table


def effort(rows: Sequence[Row]) -> str:
    """Return which seeds were searched at which speeds, in words."""
    parts = []
    for seed in seeds_of(rows):
        speeds = sorted({row["froude"] for row in rows if row["seed"] == seed})
        parts.append(f"seed {seed} at {len(speeds)} Froude numbers from {speeds[0]:g} to {speeds[-1]:g}")
    free = {(row["seed"], row["froude"]) for row in rows if row["kind"] == FREE}
    return ", ".join(parts) + f"; searches with any lag at {len(free)} of these"


def agreed(rows: Sequence[Row], objective: str) -> dict[str, list[float]]:
    """Return the Froude numbers at which each kind is better in every seed, of those that two seeds have."""
    found: dict[str, list[float]] = {kind: [] for kind in KINDS}
    for froude in FROUDES:
        seeds = {row["seed"] for row in rows if row["froude"] == froude}
        better = {better_of([row for row in rows if row["seed"] == s], froude, objective) for s in seeds}
        for kind in KINDS:
            if len(seeds) > 1 and better == {kind}:
                found[kind].append(froude)
    return found


def told(rows: Sequence[Row]) -> str:
    """Return what was found, in sentences."""
    text = []
    for kind in KINDS:
        known = [froude for froude in FROUDES if best_of(rows, froude, kind, MIXTURE)]
        missing = [f"{froude:g}" for froude in FROUDES if froude not in known]
        text.append(
            f"Gaits with a {kind}'s lag that count exist at {len(known)} of {len(FROUDES)} Froude numbers"
            + (f", and were not found at {', '.join(missing)}" if missing else "")
        )
    low, high = CHANGES["walk to trot"]
    each = [[row for row in rows if row["seed"] == s] for s in seeds_of(rows)]
    pooled = [one for one in OBJECTIVES if as_horses(rows, one)]
    alone = [one for one in OBJECTIVES if all(as_horses(part, one) for part in each)]
    text.append(
        f"Below Froude number 1 the better gait changes once, from walk to trot and between searched speeds "
        f"that touch {low:g} to {high:g}, where horses change, by "
        f"{', '.join(TITLES[one] for one in pooled) or 'nothing'} over all seeds, "
        f"and by {', '.join(TITLES[one] for one in alone) or 'nothing'} in each seed alone"
    )
    if not alone:
        text.append(
            "Seeds differ as much as gaits do, and the map does not say what makes a horse change gait: a "
            "null result"
        )
    if len(each) > 1:
        parts = []
        for objective in OBJECTIVES:
            same = [
                f"{kind} at {', '.join(f'{froude:g}' for froude in froudes)}"
                for kind, froudes in agreed(rows, objective).items()
                if froudes
            ]
            parts.append(f"by {TITLES[objective]} {' and '.join(same) or 'none'}")
        text.append(f"All seeds agree on the better gait, where there are two: {'; '.join(parts)}")
    return ". ".join(text) + "."


def draw(rows: Sequence[Row], path: Path) -> None:
    """Write the map as a picture: what is spared by kind and speed, and the lag of the best gait."""
    from matplotlib.figure import Figure

    picture = Figure((WIDTH / DPI, 6.2), dpi=DPI, layout="constrained")
    axes = picture.subplots(2, len(OBJECTIVES), sharex=True, sharey="row")
    walk = read_judges()["walk"]["lag"]["bar"]
    for column, objective in enumerate(OBJECTIVES):
        up, down = axes[0, column], axes[1, column]
        for axis in (up, down):
            for low, high in CHANGES.values():
                axis.axvspan(low, high, color="0.85", lw=0)
            axis.set_xscale("log")
            axis.tick_params(labelsize=LETTERS)
            axis.grid(alpha=0.3)
        for kind in KINDS:
            means = []
            for froude in FROUDES:
                found = [
                    best_of([row for row in rows if row["seed"] == s], froude, kind, objective)
                    for s in seeds_of(rows)
                ]
                values = [float(value_of(row, objective)) for row in found if row is not None]
                up.plot([froude] * len(values), values, SYMBOLS[kind], ms=3, color=COLOURS[kind], alpha=0.6)
                means.append(np.mean(values) if values else np.nan)
            up.plot(FROUDES, means, lw=1.4, color=COLOURS[kind], label=kind)
        down.axhspan(*walk, color=COLOURS["walk"], alpha=0.12, lw=0)
        down.axhspan(-0.05, 0.05, color=COLOURS["trot"], alpha=0.12, lw=0)
        for seed in seeds_of(rows):
            lags = lags_of([row for row in rows if row["seed"] == seed], objective)
            down.plot(*zip(*lags, strict=True), "x", ms=4, color=COLOURS[FREE])
        lags = lags_of(rows, objective)
        down.plot(*zip(*lags, strict=True), "-", lw=1.2, color=COLOURS[FREE])
        up.set_title(TITLES[objective], fontsize=LETTERS)
        down.set_xlabel("Froude number", fontsize=LETTERS)
        down.set_xticks([0.1, 0.3, 1, 3], ["0.1", "0.3", "1", "3"])
    axes[0, 0].set_ylabel("figure over its scale, less is better [-]", fontsize=LETTERS)
    axes[1, 0].set_ylabel("lag of the best gait [strides]", fontsize=LETTERS)
    axes[0, 0].legend(fontsize=LETTERS, frameon=False)
    picture.savefig(path, metadata={"Software": None})


CHANGE_HEAD = (
    "spared",
    "seed",
    "walk better at Fr",
    "trot better at Fr",
    "equal at Fr",
    "changes at Fr",
    "lag jumps at Fr",
)
SPEED_HEAD = (
    "Fr",
    "lag of a",
    "work [-]",
    "peak [weights]",
    "loading [1/s]",
    "mixture [-]",
    "its lag",
    "its duty factors, fore and hind",
    "its stride, and the given one [hip heights]",
    "its slip [m]",
)


def write(found: Map, herd: Herd, out: Path) -> None:
    """Write the page and its figures."""
    folder = out / NAME
    folder.mkdir(parents=True, exist_ok=True)
    rows = compared(found.rows)
    draw(rows, folder / "map.png")
    judges = read_judges()
    page = PAGE.format(
        command="python -m agents.gait_change",
        commit=runs.versions().get("commit", "unknown"),
        searched=found.about.get("commit", "unknown"),
        name=NAME,
        walk_lag=span(*judges["walk"]["lag"]["bar"]),
        trot_lag=f"{judges['trot']['lag']['bar'][1]:g}",
        scales=", ".join(f"{scale:g}" for scale in SCALES.values()),
        stride_bar=f"{STRIDE_BAR:g} in the search and twice that to count",
        seeds=effort(rows),
        found=told(rows),
        changes=markdown_table(CHANGE_HEAD, change_rows(rows)),
        close=f"{CLOSE:.0%}",
        jump=f"{JUMP:g}",
        table=markdown_table(SPEED_HEAD, speed_rows(rows)),
        agents=section(herd, NAME, folder),
        limits=LIMITS,
    )
    runs.write_text(out / f"{NAME}.md", page)
    print(f"written: {out / NAME}.md")


def main(argv: list[str] | None = None) -> None:
    """Search for what is missing and write the page."""
    args = parse(Args, argv, "python -m agents.gait_change", __doc__)
    seeds = count("--seeds", args.seeds)
    check_folder(args.out)
    path = file_of(args.found, args.out, NAME, "searches.json")
    found = search_all(path, seeds) if args.search else Map(path)
    if not compared(found.rows):
        raise DataFileError(
            f"{path}: expected walks and trots of one seed and speed, got {len(found.rows)} gaits"
        )
    of_agents = args.out / NAME / "agents.json"
    write(found, complete(of_agents) if args.search else Herd(of_agents), args.out)


if __name__ == "__main__":
    run(main)
