"""The page of stock learners: learning curves as tables and as a picture, and the returns of policies that
need no learning."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.experiments.curves import CURVES, TUNED
from agents.experiments.plans import LEG, Entry
from agents.results import best_blind, rows_of
from hoof_env._output import markdown_table, staged
from hoof_env.errors import DataFileError
from hoof_env.evaluation.episodes import FINAL_SEEDS, make_rows, play_rows
from hoof_env.evaluation.statistics import iqm
from hoof_env.policies.find import find_policy

BEST = "best without feedback"

ANCHORS = ("zero action", "scripted gait", BEST)
"""Policies that the curves are compared with."""


def mean_return(policy: Any, envs: Any) -> float:
    """Return the mean return of a policy on the starts of the final scores."""
    return float(np.mean([episode["return"] for episode in play_rows(envs, policy, FINAL_SEEDS)]))


def anchors(env_id: str) -> dict[str, float]:
    """Return the mean returns of policies that no curve shows, by name, as far as an id has them."""
    envs = make_rows(env_id, len(FINAL_SEEDS))
    assert envs is not None
    # One action for each row
    zero = np.zeros((len(FINAL_SEEDS), *(envs.single_action_space.shape or ())), np.float32)

    class Zero:
        """Policy of zero actions."""

        def predict(self, *args: Any, **kwargs: Any) -> tuple[NDArray[np.float32], None]:
            return zero, None

    returns = {"zero action": mean_return(Zero(), envs)}
    with runs.make_env(env_id) as env:
        if envs.action_form == "rates":
            returns["scripted gait"] = mean_return(find_policy(envs.task.reference, env, env_id), envs)
    if bar := best_blind(rows_of(env_id)):
        returns[BEST] = bar.mean["return"]
    return returns


AT_STEPS = (20_480, 61_440, 204_800, 400_000, 3_000_000)
AT_SECONDS = (5.0, 20.0, 60.0, 180.0, 600.0)
"""Steps and seconds [s] at which learners of HorseLeg-v0 are compared."""


def at(rows: Sequence[dict[str, Any]], steps: int) -> list[float]:
    """Return the returns of all seeds at the last score up to `steps`."""
    latest: dict[int, dict[str, Any]] = {}
    for row in rows:
        # Rows need not be in order
        if row["steps"] <= steps and row["steps"] >= latest.get(row["seed"], row)["steps"]:
            latest[row["seed"]] = row
    return [row["return"] for row in latest.values()]


def table(
    rows: Sequence[dict[str, Any]], references: dict[str, dict[str, float]], plan: Sequence[Entry]
) -> str:
    """Return a line for each row of the plan: interquartile mean, lowest and highest seed in the middle and
    at the end, and the returns of policies that need no learning."""
    lines = []
    for entry in plan:
        own_rows = [row for row in rows if (row["env_id"], row["algo"]) == (entry.env_id, entry.algo)]
        if not own_rows:
            continue
        last = max(row["steps"] for row in own_rows)
        cells = []
        for steps in (last // 2, last):
            values = at(own_rows, steps)
            cells.append(f"{float(iqm(values)[0]):.1f} ({min(values):.1f} to {max(values):.1f})")
        seconds = _seconds([row for row in own_rows if row["steps"] == last], usual_processor(rows))
        known = references[entry.env_id]
        reference_cells = [f"{known[name]:.1f}" if name in known else "" for name in ANCHORS]
        above = ""
        if BEST in known:
            finals = at(own_rows, last)
            above = f"{sum(value > known[BEST] for value in finals)} of {len(finals)}"
        seeds = str(len({row["seed"] for row in own_rows}))
        name = entry.env_id.rpartition("/")[2].removesuffix("-v0")
        own_cells = [name, entry.algo.upper(), seeds, *cells, f"{last:,}", seconds]
        lines.append([*own_cells, *reference_cells, above])
    head = (
        "id",
        "algorithm",
        "seeds",
        "return at half the steps",
        "return at the end",
        "steps",
        "seconds",
        *ANCHORS,
        "seeds above it at the end",
    )
    return markdown_table(head, lines)


def usual_processor(rows: Sequence[dict[str, Any]]) -> str:
    """Return the processor of most trainings of HorseLeg-v0, whose seconds are compared."""
    trainings = {(row["algo"], row["seed"], row["processor"]) for row in rows if row["env_id"] == LEG}
    processors = sorted(processor for _, _, processor in trainings)
    return max(dict.fromkeys(processors), key=processors.count, default="")


def _seconds(ends: Sequence[dict[str, Any]], processor: str) -> str:
    """Return the median of the seconds of trainings on a processor; with a star the median of all, if
    none ran on it."""
    timed = [row["train_seconds"] for row in ends if row["processor"] == processor]
    if timed:
        return f"{np.median(timed):.0f}"
    return f"{np.median([row['train_seconds'] for row in ends]):.0f}*"


def compared(
    rows: Sequence[dict[str, Any]], column: str, places: Sequence[float], plan: Sequence[Entry]
) -> str:
    """Return a line for each learner of HorseLeg-v0: the interquartile mean of its last returns up to each
    place of `column`, steps or seconds of learning; an empty cell if its trainings do not go so far."""
    lines = []
    for algo in dict.fromkeys(entry.algo for entry in plan if entry.env_id == LEG):
        own_rows = [row for row in rows if (row["env_id"], row["algo"]) == (LEG, algo)]
        if not own_rows:
            continue
        ends: dict[int, float] = {}
        for row in own_rows:
            ends[row["seed"]] = max(row[column], ends.get(row["seed"], 0.0))
        cells = []
        for place in places:
            latest: dict[int, dict[str, Any]] = {}
            for row in own_rows:
                if row[column] <= place and row["steps"] >= latest.get(row["seed"], row)["steps"]:
                    latest[row["seed"]] = row
            # A training that ended before would be compared at its end
            is_reached = all(end >= 0.9 * place for end in ends.values())
            values = [row["return"] for row in latest.values()]
            cells.append(f"{float(iqm(values)[0]):.1f}" if is_reached else "")
        lines.append([title(algo), *cells])
    return markdown_table(("learner", *(f"{place:,.0f}" for place in places)), lines)


def title(algo: str) -> str:
    """Return the name of a learner with the kind of its settings."""
    return "ppo_flat, tuned, 16 environments" if algo == TUNED else f"{algo.upper()}, stock"


def draw(rows: Sequence[dict[str, Any]], references: dict[str, dict[str, float]], path: Path) -> None:
    """Draw a panel for each id: the median of all seeds and their range over steps, and lines for policies
    that need no learning."""
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.ticker import EngFormatter

    from hoof_env._plotting import BLUE, GREEN, GREY, ORANGE, PURPLE, STYLE, save_png

    colours = {"ppo": BLUE, "sac": ORANGE, "td3": GREEN, "tqc": PURPLE}
    styles = dict(zip(ANCHORS, (":", "--", "-"), strict=True))
    ids = list(references)
    with matplotlib.rc_context(STYLE):
        across = min(3, len(ids))
        down = -(-len(ids) // across)
        figure = Figure(figsize=(3.4 * across, 2.6 * down), layout="constrained")
        panels = figure.subplots(down, across, squeeze=False).ravel()
        for panel, env_id in zip(panels, ids, strict=False):
            for algo, colour in colours.items():
                own_rows = [row for row in rows if (row["env_id"], row["algo"]) == (env_id, algo)]
                steps = sorted({row["steps"] for row in own_rows})
                if not steps:
                    continue
                values = [[row["return"] for row in own_rows if row["steps"] == step] for step in steps]
                panel.plot(
                    steps, [np.median(returns) for returns in values], color=colour, label=algo.upper()
                )
                panel.fill_between(
                    steps,
                    [min(returns) for returns in values],
                    [max(returns) for returns in values],
                    color=colour,
                    alpha=0.2,
                    linewidth=0,
                )
            for name, value in references[env_id].items():
                panel.axhline(value, color=GREY, linewidth=0.8, linestyle=styles[name], label=name)
            panel.set_title(env_id.rpartition("/")[2])
            panel.set_xlabel("environment steps")
            panel.set_ylabel("return")
            panel.xaxis.set_major_formatter(EngFormatter(sep=""))
        # The grid may have more panels than ids
        for panel in panels[len(ids) :]:
            panel.set_axis_off()
        panels[0].legend(loc="lower right")
        save_png(figure, path, dpi=150)


PAGE_FILE = "README.md"

PAGE = """# Stock learners

Learning curves of Stable-Baselines3's PPO, SAC and TD3 and of sb3-contrib's TQC with their library's own
defaults: one environment, no wrapper. Written by `python -m agents.experiments --plan stock`,
which trains what is missing in [curves.csv](curves.csv). Returns are of the policy without its noise, on
{starts} starts that no training meets: the interquartile mean over seeds, and the lowest and highest seed.
Seconds are processor time of learning on one thread{processors};
other work on the machine makes them longer. Trained by the code of {commits}.

![Return against environment steps](stock.png)

{table}

## Compared at equal steps and equal seconds

`HorseLeg-v0`, the interquartile mean over seeds. `ppo_flat` has the settings of agents/hyperparams and 16
environments; the others have none, and no settings that were tuned for them are known to be better.

Returns after so many steps:

{by_steps}

Returns after so many seconds of the processor, on one thread:

{by_seconds}
"""


def write(out: Path, rows: Sequence[dict[str, Any]], plan: Sequence[Entry]) -> Path:
    """Write table and picture of learning curves, and return the path of the page; `DataFileError` if there
    are none."""
    if not rows:
        raise DataFileError(f"{out / CURVES}: expected learning curves, found none")
    usual = usual_processor(rows)
    timed = [row for row in rows if row["processor"] == usual]
    rest = sorted({row["processor"] for row in rows} - {usual})
    others = f" of one kind of processor (with a star: of {', '.join(rest)})" if rest else ""
    trained_on = {row["env_id"] for row in rows}
    ids = dict.fromkeys(entry.env_id for entry in plan if entry.env_id in trained_on)
    references = {env_id: anchors(env_id) for env_id in ids}
    with staged(out) as stage:
        draw(rows, references, stage / "stock.png")
        text = PAGE.format(
            starts=len(FINAL_SEEDS),
            commits=", ".join(sorted({f"`{row['commit'] or 'unknown'}`" for row in rows})),
            table=table([row for row in rows if row["algo"] != TUNED], references, plan),
            by_steps=compared(rows, "steps", AT_STEPS, plan),
            by_seconds=compared(timed, "train_seconds", AT_SECONDS, plan),
            processors=others,
        )
        (stage / PAGE_FILE).write_text(text, encoding="utf-8")
    return out / PAGE_FILE
