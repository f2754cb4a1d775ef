"""The page of one leg that balances its trunk: what policies gain by seeing, and how they bear pushes."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from agents import runs
from agents.experiments.hop_page import figures_of, rounded
from agents.experiments.outcomes import is_done, read_figures, read_outcome
from agents.experiments.plans import Entry, Run
from agents.statistics import spread
from hoof_env._output import markdown_table
from hoof_env._plotting import BLUE, GREEN, GREY, ORANGE, PURPLE, STYLE
from hoof_env.envs.open_loop import gait_file, open_loop_record
from hoof_env.evaluation.episodes import FINAL_SEEDS, score_vector
from hoof_env.evaluation.statistics import Interval, estimate, over_seeds

PUBLISHED = Path(__file__).parents[2] / "docs" / "evidence"
"""Folder of the page and its figures."""

DATA = "seeing.json"
PAGE_FILE = "seeing.md"
PICTURE = "seeing.png"

IDS = ("hoof_env/HorseLegBalance-v0", "hoof_env/HorseLegBalanceSpeed-v0")

GAITS = {
    "zero": "zero action",
    "constant": "best constant gait",
    "open-loop": "best gait with a clock",
    "shipped": "shipped agent",
}
"""Policies that are played as they are stored."""

MANY = range(FINAL_SEEDS.start, FINAL_SEEDS.start + 1000)
"""Seeds of their episodes, beginning with the seeds of the final scores."""

LEARNERS = {
    "crank": "`ppo_flat`, crank and gait",
    "trunk": "`ppo_flat`, + trunk",
    "": "`ppo_flat`, + hoof: all",
    "pushed": "`ppo_flat`, all, pushed in training",
    "ppo": "stock PPO, all",
}
"""Learners by variant, or by another algorithm than `ppo_flat`, in the order of the tables."""

IMPULSES = (0.0, 43.2, 86.4, 129.6, 172.8)
"""Largest impulses of pushes, forward and back [N s]: the third is 1.5 m/s times the mass, as on
`HorseRough-v0`; the rest are 0, 0.5, 1.5 and 2 times as much."""

PUSH_SECONDS = (2.0, 4.0)
"""Shortest and longest time between pushes [s], as on `HorseRough-v0`."""

PUSH_LIMITS = IMPULSES[2], IMPULSES[3]
"""Largest impulses at which senses are compared [N s]."""

SENSES = {"loads": ("", "trunk"), "training": ("pushed", "")}
"""Learners that are compared under pushes, by what the first has and the second lacks."""

CURVES = {
    "open-loop": ("sees nothing", GREY, "-"),
    "crank": ("crank and gait", ORANGE, "-"),
    "trunk": ("+ trunk", GREEN, "-"),
    "": ("+ hoof: all", BLUE, "-"),
    "pushed": ("all, pushed in training", PURPLE, "--"),
}
"""Names, colours and lines of the curves in the picture."""


def key_of(entry: Entry) -> str:
    """Return the key of a learner: its id, its algorithm if that is not `ppo_flat`, and its variant."""
    algorithm = "" if entry.algo == "ppo_flat" else entry.algo
    return " ".join(filter(None, (entry.env_id, algorithm, entry.variant)))


def without_pushes(entry: Entry) -> dict[str, Any]:
    """Return the arguments of the environment in which learners of an entry are compared."""
    return {name: value for name, value in entry.env_kwargs.items() if not name.startswith("push_")}


def publish(plan: Sequence[Entry], folder: Path, out: Path) -> dict[str, Any]:
    """Add the trainings of `folder` that are done to the data in `out`, play gaits anew, and return all."""
    learners = learned(plan, folder, read_figures(out / DATA).get("learners", {}))
    data = {
        "learners": learners,
        "gaits": {env_id: {name: played(name, env_id) for name in GAITS} for env_id in IDS},
        "pushed": pushed("open-loop", IDS[0]),
        "search": {env_id: searched(env_id) for env_id in IDS},
        "commit": runs.versions().get("commit", ""),
    }
    out.mkdir(parents=True, exist_ok=True)
    runs.write_text(out / DATA, json.dumps(data, indent=1) + "\n")
    return data


def learned(plan: Sequence[Entry], folder: Path, known: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of the trainings that are known and of those of `folder` that are done, by learner
    and seed; what is known of a training of the same commit is not played again."""
    for one in (Run(entry, seed) for entry in plan for seed in range(entry.seeds)):
        if not is_done(one, folder):
            continue
        outcome = read_outcome(one, folder)
        seeds = known.setdefault(key_of(one.entry), {})
        commit = runs.read_record(outcome.folder)["versions"].get("commit", "")
        if seeds.get(str(one.seed), {}).get("commit") == commit:
            continue
        entry, policy = one.entry, str(outcome.folder)
        level = without_pushes(entry)
        is_scored = level == dict(entry.env_kwargs)
        episodes = (
            outcome.final["episodes"]
            if is_scored
            else score_vector(policy, entry.env_id, FINAL_SEEDS, **level)
        )
        seeds[str(one.seed)] = {
            "steps": int(outcome.final["steps"]),
            "cpu_s": round(outcome.final["cpu_s"], 1),
            "commit": commit,
            **rounded(figures_of(episodes)),
            "pushed": pushed(policy, entry.env_id, **level),
        }
    return known


def played(name: str, env_id: str) -> dict[str, Any]:
    """Return the figures of a stored policy over `MANY`, and intervals of its return and falls."""
    episodes = score_vector(name, env_id, MANY)
    found = {key: estimate([episode[key] for episode in episodes]) for key in ("return", "failed")}
    return rounded(figures_of(episodes)) | {
        "intervals": {key: [round(one.low, 6), round(one.high, 6)] for key, one in found.items()}
    }


def pushed(policy: str, env_id: str, **env_kwargs: Any) -> list[dict[str, float]]:
    """Return return and falls of a policy under pushes of each of `IMPULSES`; empty on another id than the
    first, on which nothing commands a speed."""
    if env_id != IDS[0]:
        return []
    found = []
    for impulse in IMPULSES:
        push: dict[str, Any] = {"push_impulse": (-impulse, impulse), "push_seconds": PUSH_SECONDS}
        episodes = score_vector(policy, env_id, FINAL_SEEDS, **env_kwargs, **push)
        means = {key: float(np.mean([episode[key] for episode in episodes])) for key in ("return", "failed")}
        found.append({"impulse": impulse, **rounded(means)})
    return found


def searched(env_id: str) -> list[dict[str, Any]]:
    """Return what the searches for the gait with a clock spent and found."""
    record = open_loop_record(gait_file(env_id, "phase"))
    names = ("origin", "episodes", "stalled")
    return [
        {name: one[name] for name in names} | {"return": round(one["mean"]["return"], 2)}
        for one in record["restarts"]
    ]


def interval_of(gait: Mapping[str, Any], name: str) -> Interval:
    """Return mean and interval of a figure of a stored policy."""
    return Interval(gait[name], *gait["intervals"][name])


def best_blind(data: Mapping[str, Any], env_id: str) -> str:
    """Return the name of the best policy without feedback."""
    gaits = data["gaits"][env_id]
    return max(("zero", "constant", "open-loop"), key=lambda name: float(gaits[name]["return"]))


def sighted(data: Mapping[str, Any], env_id: str, variant: str = "") -> list[Mapping[str, Any]]:
    """Return the figures of each seed of a learner, in order."""
    seeds = data["learners"].get(f"{env_id} {variant}".strip(), {})
    return [seeds[seed] for seed in sorted(seeds, key=int)]


def numbers(seed: Mapping[str, Any]) -> dict[str, float]:
    """Return the figures of a seed that are numbers."""
    return {name: float(value) for name, value in seed.items() if isinstance(value, (int, float))}


def table(data: Mapping[str, Any], env_id: str) -> str:
    """Return the table of policies of an id."""
    gaits = data["gaits"][env_id]
    lines = [line_of(title, [gaits[name]], MANY) for name, title in GAITS.items()]
    for variant, title in LEARNERS.items():
        if seeds := sighted(data, env_id, variant):
            lines.append(line_of(title, seeds, FINAL_SEEDS))
    titles = ("policy", "seeds", "steps", "episodes", "return", "falls %", "speed m/s", "duty factor")
    return markdown_table((*titles, "stance peak kN", "loading kN/s", "slip of a stance cm"), lines)


def line_of(title: str, seeds: Sequence[Mapping[str, Any]], episodes: Sequence[int]) -> list[str]:
    """Return the line of a policy: figures of its seeds."""

    def column(name: str, factor: float = 1.0) -> list[float]:
        return [factor * float(seed[name]) for seed in seeds]

    is_trained = "steps" in seeds[0]
    return [
        title,
        str(len(seeds)) if is_trained else "",
        f"{int(seeds[0]['steps']):,}" if is_trained else "",
        f"{len(episodes):,}",
        spread(column("return"), 0),
        spread(column("failed", 100.0), 1),
        spread(column("speed_m_s"), 2),
        spread(column("duty_factor"), 2),
        spread(column("stance_peak_n", 1e-3), 1),
        spread(column("loading_rate_n_s", 1e-3), 0),
        spread(column("slip_m", 100.0), 1),
    ]


def verdict(data: Mapping[str, Any], env_id: str) -> str:
    """Write what seeing gains, with intervals over seeds and over episodes."""
    gaits = data["gaits"][env_id]
    name = best_blind(data, env_id)
    blind = interval_of(gaits[name], "return")
    zero = interval_of(gaits["zero"], "return")
    seeds = sighted(data, env_id)
    over = over_seeds([numbers(seed) for seed in seeds])
    seen = over["return"]
    # The bounds that are least in favour of seeing
    share = (seen.mean - blind.mean) / (seen.mean - zero.mean)
    least = (seen.low - blind.high) / (seen.low - zero.low)
    is_met = "is met" if least >= 0.25 else "is not met"
    falls, blind_falls = over["failed"], interval_of(gaits[name], "failed")
    is_half = "are apart" if falls.high < 0.5 * blind_falls.low else "are not apart"
    return (
        f"Sighted agents return {seen.text(0)} (interquartile mean of {len(seeds)} seeds and its interval),"
        f" the best policy without feedback, {GAITS[name]}, {blind.text(0)}, the zero action {zero.text(0)}."
        f" Seeing gains {share:.2f} of what agents gain over the zero action, at least {least:.2f} where"
        f" intervals are taken at their worst: the bar of a quarter {is_met}. Agents fall in"
        f" {falls.text(1, 100)} % of their episodes, the policy without feedback in"
        f" {blind_falls.text(1, 100)} %; half its falls and theirs {is_half}."
    )


def searches(data: Mapping[str, Any], env_id: str) -> str:
    """Write what the searches of an id spent."""
    return "\n".join(
        f"* from {one['origin']}: {one['episodes']:,} episodes, return {one['return']:.0f},"
        f" {'stalled' if one['stalled'] else 'most episodes spent'}"
        for one in data["search"][env_id]
    )


def push_lines(data: Mapping[str, Any]) -> dict[str, list[list[Mapping[str, float]]]]:
    """Return the figures under pushes of each policy, one list for each seed."""
    found = {"open-loop": [data["pushed"]]}
    for variant in LEARNERS:
        if seeds := [seed["pushed"] for seed in sighted(data, IDS[0], variant)]:
            found[variant] = seeds
    return found


def push_table(data: Mapping[str, Any]) -> str:
    """Return the table of returns and falls by the largest impulse of pushes."""
    lines = []
    for key, seeds in push_lines(data).items():
        title = GAITS.get(key) or LEARNERS[key]
        cells = [
            f"{spread([seed[k]['return'] for seed in seeds], 0)};"
            f" {spread([100 * seed[k]['failed'] for seed in seeds], 0)} %"
            for k in range(len(IMPULSES))
        ]
        lines.append([title, str(len(seeds)) if key != "open-loop" else "", *cells])
    return markdown_table(("policy", "seeds", *(f"{impulse:.0f} N s" for impulse in IMPULSES)), lines)


def compared(data: Mapping[str, Any], name: str) -> str:
    """Write falls of two learners of `SENSES` under pushes, with intervals over seeds."""
    names = SENSES[name]
    each = [sighted(data, IDS[0], variant) for variant in names]
    texts = []
    for impulse in PUSH_LIMITS:
        at = IMPULSES.index(impulse)
        falls, others = (over_seeds([seed["pushed"][at] for seed in seeds])["failed"] for seeds in each)
        is_apart = falls.above(others) or others.above(falls)
        texts.append(
            f"under pushes of up to {impulse:.0f} N s {falls.text(0, 100)} % and {others.text(0, 100)} %,"
            f" {'intervals apart' if is_apart else 'intervals not apart'}"
        )
    counts = " and ".join(f"{len(seeds)}" for seeds in each)
    return f"{'; '.join(texts)} ({counts} seeds)"


def draw(data: Mapping[str, Any], path: Path) -> None:
    """Draw returns and falls over the largest impulse of pushes."""
    with matplotlib.rc_context({**STYLE, "font.size": 11}):
        figure = Figure(figsize=(8, 4.2), layout="constrained")
        lines = push_lines(data)
        for axes, (name, title, factor) in zip(
            figure.subplots(1, 2), (("return", "return", 1.0), ("failed", "falls, %", 100.0)), strict=True
        ):
            for key, (label, colour, style) in CURVES.items():
                if key not in lines:
                    continue
                values = factor * np.array([[row[name] for row in seed] for seed in lines[key]])
                axes.fill_between(IMPULSES, values.min(0), values.max(0), color=colour, alpha=0.15, lw=0)
                axes.plot(IMPULSES, values.mean(0), f"o{style}", ms=4, color=colour, label=label)
            axes.set_xlabel("largest push, N s")
            axes.set_title(title)
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        figure.savefig(path, dpi=110)


PAGE = """# Where seeing pays on one leg

Policies on [`HorseLegBalance-v0`](../environments/HorseLegBalance.md) and
[`HorseLegBalanceSpeed-v0`](../environments/HorseLegBalanceSpeed.md). Written by
`python -m agents.experiments --plan seeing` from [seeing.json](seeing.json). Numbers are means over
trainings, in brackets the lowest and the highest; a single number is of one policy. Trained by the code of
{commits}; where a commit is `-dirty`, pages that an earlier publication had written differed, and no code.
All play the same episodes, of which agents of several trainings play the first {starts}.
The plan, `agents/plans/seeing.yml`, has more: where a table has fewer seeds, or lacks a row, they were not
trained, and the same command goes on.

{sections}

## How much each sense is worth

![Return and falls under pushes]({picture})

`HorseLegBalance-v0` under pushes forward and back every {shortest:g} to {longest:g} s, uniform up to the
impulse of a column; 86 N s are 1.5 m/s times the mass, as on `HorseRough-v0`. Agents that were pushed in
training met pushes of up to {hardest:.0f} N s there; the others met none. A cell has return; falls.

{pushes}

Observations are nested: crank and gait, which a motor lets the ground disturb; with the trunk's speed, height
and pitch; and with the hoof's contacts and loads, which is all. Falls, interquartile means over seeds and
their intervals:

* all and without the hoof's loads: {loads};
* all, pushed in training and not: {training}.

## What was tried and does not pay

With the pitch held seeing pays little: tasks of one's own on `HorseLegHop-v0`, with
`push_impulse=(-150, 150)`, and with `target_speed=(1, 3.5)`, `target_seconds=(3, 5)` and travel beyond the
command charged by 10 a metre. One training of `ppo_flat` of 400,000 steps each, and a search of 12,000
episodes from that id's gait with a clock; neither was run to its end. Means of 200 episodes, and standard
errors:

| disturbance | zero action | sighted | gait with a clock |
|---|---|---|---|
| pushes of up to 150 N s every 2 to 4 s | -51 ± 3 | 163 ± 0.3 | 165 ± 0.4 |
| a new speed every 3 to 5 s | -89 ± 3 | 92 ± 3 | 62 |

Neither the agent nor the gait falls under these pushes: on a boom hopping is stable by itself. Under commands
seeing gains 0.17 of what the agent gains over the zero action, below the bar of a quarter.

Ditches across level ground were tried as a task, too, in place of `HorseLegTerrain-v0`:
`HorseLegHop-v0` with `terrain={{"kind": "ditches"}}`, which are 0.08 m deep, and
`reward_weights={{"failure": 10}}`. Entries of one's own showed the level of the ground at O and up to 1.6 m
ahead. Agents are trainings of `ppo_flat` of a million steps, each played in 100 episodes. Agents
that see no ground are made again by `python -m agents.train
--env-id hoof_env/HorseLegHop-v0 --algo ppo_flat --steps 1000000 --seed 0` and other seeds,
with these arguments as `--env-kwargs`, and gaits by `python -m agents.open_loop`. The id that showed the
ground is gone, and no command makes the last row again:

| policy | return | falls % |
|---|---|---|
| zero action | -117 | 36 |
| best gait with a clock of `HorseLegHop-v0`, 188 on level ground | -268 | 0 |
| gait with a clock, searched through depths of 0.03 and 0.05 m | 116 | 0 |
| agents, crank and gait | -58, -10, 2 | 98, 4, 9 |
| agents, + trunk and hoof | 133, 125, 138, 5, 130 | 0, 0, 0, 0, 0 |
| agents, + ground ahead | 122, 146, 117, -18, 121 | 0, 0, 0, 27, 0 |

Searches from random points, or from the gait of the level, returned -40 with ditches of 0.12 m, and 51 (four
constant numbers) at 0.08 m; only through shallower ditches, 74,000 to 93,000 episodes for each depth, did
they find a gait whose hoof comes down steeply enough not to strike the sides. Beside that one feedback gains
0.06 of what agents gain over the zero action, and the ground ahead nothing. At 0.12 m and 5 a second for a
fall, four of ten agents dived or stood still; at 0.2 to 0.3 m the ones that were tried stood still when they
were stopped, after 0.3 to 0.7 million steps.

At the price of a fall of `HorseLegHop-v0`, 5 a second, the trainings of seed 1 of both ids kept diving
forward until they fell, for 600,000 steps; with 64 environments, or with a discount of 0.995, seed 1 of
`HorseLegBalance-v0` did so for 250,000. At 10 a second {upright} of the {trainings} trainings of `ppo_flat`
that see all, and meet no pushes, fall in under a tenth of their episodes. That price was chosen after
trainings of the ids as they were, in which the rise of the force saturated on the scale of a suspension;
strengths, inertia and starts were not. They followed a probe that began in the gait of `HorseLegHop-v0`,
under a radius of gyration of 0.5 m, and lasted a second an episode after 100,000 steps. 600,000 steps are
what the time allowed.
"""

SECTION = """## `{name}`

{table}

{verdict}

The gaits with a clock were searched by CMA-ES (`python -m agents.open_loop`); a search goes on until its last
quarter gains less than a hundredth. One through easier settings begins on a boom, which holds the pitch:

{searches}"""


def write(out: Path, data: Mapping[str, Any]) -> Path:
    """Write the page and its picture; return the page's path."""
    commits = sorted(
        {f"`{seed['commit']}`" for seeds in data["learners"].values() for seed in seeds.values()}
    )
    sections = [
        SECTION.format(
            name=env_id.rpartition("/")[2],
            table=table(data, env_id),
            verdict=verdict(data, env_id),
            searches=searches(data, env_id),
        )
        for env_id in IDS
    ]
    seeing = [seed for env_id in IDS for seed in sighted(data, env_id)]
    text = PAGE.format(
        commits=", ".join(commits),
        starts=len(FINAL_SEEDS),
        sections="\n\n".join(sections),
        picture=PICTURE,
        shortest=PUSH_SECONDS[0],
        longest=PUSH_SECONDS[1],
        hardest=IMPULSES[-1],
        pushes=push_table(data),
        **{name: compared(data, name) for name in SENSES},
        upright=sum(seed["failed"] < 0.1 for seed in seeing),
        trainings=len(seeing),
    )
    runs.write_text(out / PAGE_FILE, text)
    draw(data, out / PICTURE)
    return out / PAGE_FILE
