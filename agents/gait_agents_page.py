"""Section and figure of the page `docs/evidence/gait_change.md` on agents: at which speed their lag jumps,
and whether it is learnt or that with which they began."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from agents.gait_agents import CONTROL, FROUDES, NONE, Agent, Herd, Row, counts
from agents.gait_map import (
    CHANGES,
    CHECKED,
    CLOSE,
    JUMP,
    MIXTURE,
    OBJECTIVES,
    TITLES,
    apart,
    jumps_between,
    turned,
    value_of,
)
from agents.gait_task import COMMANDS, KEPT, SPARED, STARTS
from agents.judge_pictures import DPI, LETTERS, WIDTH
from agents.judges import read_judges
from agents.rules import rejection_reason
from hoof_env._output import markdown_table
from hoof_env.tasks.horse import PHASE_SPAN, SPANS

CHANGE = CHANGES["walk to trot"]
ALL = (*OBJECTIVES, CONTROL)
STEP = (0.35, 0.45)  # played Froude numbers between which horses change
LEAST = -0.2  # lag that is shown as the least one: agents from trots land their fore hooves early [strides]
COLOURS = {"walk": "#0072B2", "trot": "#D55E00"}
SYMBOLS = {"walk": "o", "trot": "^"}

SECTION = """## Agents

**Asked.** Does one agent for all speeds, whose footfall is free, change its lag, at which speed, and by what
it spares?

**Trained.** {agents}, by `ppo_flat`,
{steps:,} steps each, at {commits}
([figures]({name}/agents.json)). The task is that of `HorseRough-v0` on level ground without pushes, with
`footfall="free"`, 50 actions a second and one command an episode, from Froude number {low:g} to {high:g}
(`agents/gait_task.py`). Per second the reward is {alive:g} for staying up, {tracking:g} (1 - 2 e) for a
relative error e of the speed, less {slip:g} times the slip over the commanded distance and {spared:g} times
the objective, and {fall:g} less for a fall. Actions shift each leg by up to {span:g} strides, so that any lag
is in reach, and change the swing by up to {swing:g} rad. They do so around the gaits above that were searched
for the mixture with seed 0, at the rate of the command, so that strides are given here, too. Half of the
agents begin with walks and half with trots, which tells what is learnt from what is inherited, and some are
paid for nothing that horses may spare, which tells what is learnt for it.

**Found.** {found}

![Work, peak force, loading and their mixture of agents that spare them, and their lag, over the Froude
number]({name}/agents.png)

Lines are means over seeds, symbols single seeds, faint ones of speeds at which an agent does not count;
dashes are the lags of the gaits around which agents act, dots those of agents that spare nothing. Each agent
played the same {starts} starts at each command; the rules of a gait that counts are those above without the
given stride.

### Where the lag of agents jumps

{jumps}

*Counting* are pairs of an agent and a speed. A lag *jumps* where it differs by more than {jump:g} strides
from one speed at which the agent counts to the next such one.

### Which beginning pays

Means over the seeds that count, their number in brackets; *untrained* are the searched gaits as they are. The
*best* beginning is also one where the agents of the other do not count.

{paying}

"""


def mean_of(lags: Sequence[float]) -> float:
    """Return the circular mean of lags, from `LEAST` on [strides]; NaN of none."""
    if not len(lags):
        return float("nan")
    return turned(float(np.angle(np.mean(np.exp(4j * np.pi * np.array(lags)))) / (4 * np.pi)), LEAST)


def some(rows: Sequence[Row], start: str, objective: str, froude: float | None = None) -> list[Row]:
    """Return the figures of the agents with a beginning and an objective, at all speeds or one."""
    return [
        row
        for row in rows
        if row["start"] == start and row["objective"] == objective and froude in (None, row["froude"])
    ]


def seeds_of(rows: Sequence[Row], start: str, objective: str) -> list[int]:
    """Return the seeds of the agents with a beginning and an objective."""
    return sorted({row["seed"] for row in some(rows, start, objective)})


def lags_at(rows: Sequence[Row]) -> list[float]:
    """Return the lags of rows that have one."""
    return [row["lag"] for row in rows if row["lag"] is not None]


def lags_of(rows: Sequence[Row], agent: Agent) -> list[tuple[float, float]]:
    """Return the Froude numbers at which an agent counts, and its lag there [strides], from `LEAST` on."""
    own = [row for row in some(rows, agent.start, agent.objective) if row["seed"] == agent.seed]
    return [(row["froude"], turned(row["lag"], LEAST)) for row in own if counts(row)]


def jump_rows(rows: Sequence[Row]) -> list[list[str]]:
    """Return a row for each objective and beginning: how many count, lags at low and high speed, jumps."""
    table = []
    for objective in ALL:
        for start in STARTS:
            own = some(rows, start, objective)
            if not own:
                continue
            cells = [
                TITLES.get(objective, objective),
                f"{start}s",
                str(len(seeds_of(rows, start, objective))),
            ]
            cells.append(f"{sum(map(counts, own))} of {len(own)}")
            for is_of in (lambda row: row["froude"] < CHANGE[0], lambda row: row["froude"] > CHANGE[1]):
                before, after = (
                    mean_of(lags_at([row for row in of if is_of(row)]))
                    for of in (some(rows, start, NONE), own)
                )
                cells.append(f"{before:.2f} to {after:.2f}")
            jumps = []
            for seed in seeds_of(rows, start, objective):
                found = jumps_between(lags_of(rows, Agent(start, objective, seed)))
                jumps += [f"seed {seed}, {a:g} to {b:g}: {x:.2f} to {y:.2f}" for a, b, x, y in found]
            table.append([*cells, "; ".join(jumps) or "none"])
    return table


def value_at(rows: Sequence[Row], start: str, objective: str, froude: float) -> tuple[float, int]:
    """Return the mean of what the agents that count spare at a speed, and how many they are."""
    values = [float(value_of(row, objective)) for row in some(rows, start, objective, froude) if counts(row)]
    return (float(np.mean(values)) if values else float("nan")), len(values)


def best_at(rows: Sequence[Row], objective: str, froude: float) -> str:
    """Return the beginning whose agents spare most at a speed; "equal" if another's do as well, "none" where
    no agent counts."""
    values = {start: value_at(rows, start, objective, froude)[0] for start in STARTS}
    known = {start: value for start, value in values.items() if np.isfinite(value)}
    if not known:
        return "none"
    first = min(known, key=lambda start: known[start])
    is_close = any(value / known[first] - 1 < CLOSE for start, value in known.items() if start != first)
    return "equal" if is_close else first


def paying_rows(rows: Sequence[Row]) -> list[list[str]]:
    """Return a row for each objective and speed: what agents of each beginning spare, and their lags."""
    table = []
    for objective in OBJECTIVES:
        for froude in FROUDES:
            cells = [TITLES[objective], f"{froude:g}"]
            for start in STARTS:
                value, number = value_at(rows, start, objective, froude)
                lag = mean_of([row["lag"] for row in some(rows, start, objective, froude) if counts(row)])
                cells.append(f"{value:.2f} at lag {lag:.2f} ({number})" if number else "-")
            untrained = [some(rows, start, NONE, froude) for start in STARTS]
            shown = [f"{value_of(of[0], objective):.2f}" if counts(of[0]) else "-" for of in untrained]
            cells.append(", ".join(shown))
            table.append([*cells, best_at(rows, objective, froude)])
    return table


def distance(one: Sequence[Row], other: Sequence[Row]) -> float:
    """Return the mean distance of the lags of two groups of agents over speeds [strides]; NaN without any."""
    found = []
    for froude in FROUDES:
        groups = [lags_at([row for row in rows if row["froude"] == froude]) for rows in (one, other)]
        if all(groups):
            found.append(abs(apart(*map(mean_of, groups))))
    return float(np.mean(found)) if found else float("nan")


def between_starts(rows: Sequence[Row], objective: str) -> float:
    """Return the mean distance of the lags of agents from walks from those of agents from trots [strides]."""
    return distance(some(rows, "walk", objective), some(rows, "trot", objective))


def moved(rows: Sequence[Row], objective: str, others: str) -> float:
    """Return the mean distance of the lags of agents from those of others with the same beginning
    [strides]."""
    return float(
        np.mean([distance(some(rows, start, objective), some(rows, start, others)) for start in STARTS])
    )


def spared_against(rows: Sequence[Row], objective: str, others: str) -> float:
    """Return by which part agents that spare something have less of it than those that spare something else:
    a mean over beginnings and the speeds at which both count; NaN without these."""
    parts = []
    for start in STARTS:
        for froude in FROUDES:
            ours = value_at(rows, start, objective, froude)[0]
            theirs = [float(value_of(r, objective)) for r in some(rows, start, others, froude) if counts(r)]
            if np.isfinite(ours) and theirs:
                parts.append(1 - ours / np.mean(theirs))
    return float(np.mean(parts)) if parts else float("nan")


def changes_as_horses(jumps: Sequence[tuple[float, float, float, float]]) -> bool:
    """Return True if a lag jumps once, down, and where horses change."""
    if len(jumps) != 1:
        return False
    a, b, before, after = jumps[0]
    return apart(after, before) < 0 and a <= CHANGE[1] and b >= CHANGE[0]


def steps_of(rows: Sequence[Row], start: str, objective: str) -> list[float]:
    """Return the change of the lag of each agent over `STEP`, counting or not [strides]."""
    found = []
    for seed in seeds_of(rows, start, objective):
        own = [row for row in some(rows, start, objective) if row["seed"] == seed]
        first, then = (mean_of(lags_at([row for row in own if row["froude"] == froude])) for froude in STEP)
        found.append(apart(then, first))
    return found


def beginning_changes_as_horses(rows: Sequence[Row], objective: str) -> bool:
    """Return True if the beginning whose agents spare most changes once over the speeds, from walks to trots
    and where horses change; speeds at which both do as well or neither counts are passed over."""
    best = [(froude, best_at(rows, objective, froude)) for froude in FROUDES]
    known = [(froude, kind) for froude, kind in best if kind in STARTS]
    changes = [(a, b, x, y) for (a, x), (b, y) in pairwise(known) if x != y]
    low, high = CHANGE
    return [change[2:] for change in changes] == [("walk", "trot")] and (
        changes[0][0] <= high and changes[0][1] >= low
    )


def told(rows: Sequence[Row]) -> str:
    """Return what was found, in sentences."""
    trained = [row for row in rows if row["objective"] != NONE]
    agents = [*dict.fromkeys(Agent(row["start"], row["objective"], row["seed"]) for row in trained)]
    spared = [one for one in ALL if all(some(rows, start, one) for start in STARTS)]
    names = {one: TITLES.get(one, one) for one in spared}
    reasons = [rejection_reason({n: np.nan if x is None else x for n, x in row.items()}) for row in trained]
    words = ("fell in", "of the commanded speed", "slip", "stances a turn")
    fell, slow, slipping, landing = (sum(word in reason for reason in reasons) for word in words)
    jumping = []
    as_horses = []
    is_null = True
    for one in spared:
        own = [agent for agent in agents if agent.objective == one]
        jumps = [jumps_between(lags_of(rows, agent)) for agent in own]
        jumping.append(f"{sum(map(bool, jumps))} of {len(own)} by {names[one]}")
        changing = sum(map(changes_as_horses, jumps))
        is_null = is_null and not changing
        as_horses.append(f"{changing} by {names[one]}")
    where = f"between speeds that touch {CHANGE[0]:g} to {CHANGE[1]:g}"
    text = [
        f"Of {len(trained)} pairs of an agent and a speed {reasons.count('')} count; {fell} fall too often,"
        f" {slow} miss the speed, {slipping} slip too far and {landing} do not land once a turn, some of"
        " them for two reasons",
        f"The lag of an agent jumps somewhere in {', '.join(jumping)}",
        f"It jumps once, down and {where}, where horses change, in {', '.join(as_horses)}"
        + (": a null result" if is_null else ""),
    ]
    a, b = STEP
    by = []
    for one in spared:
        steps = steps_of(rows, "walk", one)
        by.append(f"{np.mean(steps):+.2f} ({min(steps):+.2f} to {max(steps):+.2f}) by {names[one]}")
    (untrained,) = steps_of(rows, "walk", NONE)
    text.append(
        f"From {a:g} to {b:g} the lag of agents from walks, whether they count or not, changes by"
        f" {', '.join(by)}; that of the gaits around which they act changes by {untrained:+.2f}"
    )
    apart_by = [f"{between_starts(rows, one):.2f} by {names[one]}" for one in spared]
    text.append(
        f"On the average over speeds agents from walks and from trots are {between_starts(rows, NONE):.2f}"
        f" strides of lag apart untrained, and trained {', '.join(apart_by)}"
    )
    if CONTROL in spared:
        by = [f"{moved(rows, one, CONTROL):.2f} by {names[one]}" for one in spared if one != CONTROL]
        text.append(
            f"The lag of agents that spare nothing is {moved(rows, CONTROL, NONE):.2f} from that of the gaits"
            f" around which they act; what is spared moves it from there by {', '.join(by)}"
        )
    for others, title in ((CONTROL, "agents that spare nothing"), (NONE, "the gaits around which they act")):
        if others == NONE or others in spared:
            of = [one for one in spared if one != CONTROL]
            less = [f"{100 * spared_against(rows, one, others):z.0f} % {names[one]}" for one in of]
            text.append(f"Where both count, agents have less than {title} by {', '.join(less)}")
    pooled = [names[one] for one in OBJECTIVES if beginning_changes_as_horses(rows, one)]
    seeds = sorted({agent.seed for agent in agents})
    alone = []
    for one in [one for one in spared if one != CONTROL]:
        of_seeds = [
            [row for row in rows if row["seed"] == seed or row["objective"] == NONE] for seed in seeds
        ]
        alone.append(f"{sum(beginning_changes_as_horses(part, one) for part in of_seeds)} by {names[one]}")
    text.append(
        f"The beginning that pays most changes once, from walks to trots and {where}, by"
        f" {', '.join(pooled) or 'nothing'} over all seeds; of {len(seeds)} seeds alone in {', '.join(alone)}"
    )
    return ". ".join(text) + "."


def draw(rows: Sequence[Row], path: Path) -> None:
    """Write a picture: what agents spare by beginning and speed, and their lag."""
    from matplotlib.figure import Figure

    picture = Figure((WIDTH / DPI, 6.2), dpi=DPI, layout="constrained")
    axes = picture.subplots(2, len(OBJECTIVES), sharex=True, sharey="row")
    walk = read_judges()["walk"]["lag"]["bar"]
    for column, objective in enumerate(OBJECTIVES):
        for axis in axes[:, column]:
            axis.axvspan(*CHANGE, color="0.85", lw=0)
            axis.set_xscale("log")
            axis.tick_params(labelsize=LETTERS)
            axis.grid(alpha=0.3)
        up, down = axes[:, column]
        down.axhspan(*walk, color=COLOURS["walk"], alpha=0.12, lw=0)
        down.axhspan(-0.05, 0.05, color=COLOURS["trot"], alpha=0.12, lw=0)
        for start in STARTS:
            style = {"color": COLOURS[start]}
            for row in some(rows, start, objective):
                if row["lag"] is None:
                    continue
                faint = {"ms": 3, "ls": "", "marker": SYMBOLS[start], "alpha": 0.7 if counts(row) else 0.15}
                up.plot([row["froude"]], [value_of(row, objective)], **style, **faint)
                down.plot([row["froude"]], [turned(row["lag"], LEAST)], **style, **faint)
            means = [value_at(rows, start, objective, froude)[0] for froude in FROUDES]
            up.plot(FROUDES, means, lw=1.4, label=f"from {start}s", **style)
            for of, dash, width in ((objective, "-", 1.4), (CONTROL, ":", 1.2), (NONE, "--", 0.9)):
                lags = [mean_of(lags_at(some(rows, start, of, froude))) for froude in FROUDES]
                down.plot(FROUDES, lags, dash, lw=width, **style)
        up.set_title(TITLES[objective], fontsize=LETTERS)
        down.set_xlabel("Froude number", fontsize=LETTERS)
        down.set_xticks([0.1, 0.3, 1], ["0.1", "0.3", "1"])
        down.set_xticks([], minor=True)
    axes[0, 0].set_ylabel("figure over its scale, less is better [-]", fontsize=LETTERS)
    axes[1, 0].set_ylabel("lag [strides]", fontsize=LETTERS)
    axes[0, 0].legend(fontsize=LETTERS, frameon=False)
    picture.savefig(path, metadata={"Software": None})


JUMP_HEAD = (
    "spared",
    "beginning",
    "seeds",
    "counting",
    "lag under Fr 0.35, untrained to trained",
    "lag above Fr 0.5, untrained to trained",
    "lag jumps at Fr",
)
PAYING_HEAD = ("spared", "Fr", *(f"from {start}s" for start in STARTS), "untrained, walk and trot", "best")


def section(herd: Herd, name: str, folder: Path) -> str:
    """Return the section of a page and write its figure; nothing without agents.

    Args:
        herd: figures of agents.
        name: folder of the figure in the page's links.
        folder: that folder.
    """
    if not herd.rows:
        return ""
    rows = herd.rows
    draw(rows, folder / "agents.png")
    numbers = [f"{len(seeds_of(rows, start, MIXTURE))} from {start}s" for start in STARTS]
    controls = len({row["seed"] for row in rows if row["objective"] == CONTROL})
    commits = herd.commits()
    return SECTION.format(
        agents=f"For each objective {' and '.join(numbers)}, and {controls} of each that spare nothing",
        low=COMMANDS[0],
        high=COMMANDS[1],
        steps=herd.steps,
        commits=f"commit{'s' * (len(commits) > 1)} {', '.join(f'`{commit}`' for commit in commits)}",
        name=name,
        alive=KEPT["alive"],
        tracking=KEPT["tracking"],
        slip=KEPT["slip"],
        spared=SPARED,
        fall=KEPT["fall"],
        span=PHASE_SPAN,
        swing=SPANS[1],
        found=told(rows),
        starts=CHECKED,
        jumps=markdown_table(JUMP_HEAD, jump_rows(rows)),
        jump=JUMP,
        paying=markdown_table(PAYING_HEAD, paying_rows(rows)),
    )
