"""Do agents land more softly than gaits that see nothing, at equal speed?

    python -m agents.softness                       searches and trains what is missing, then writes the page
    python -m agents.softness --no-train            the page of what is there

`HorseLegHop-v0` pays for travel up to one speed and lets gaits go faster, so its policies differ in speed,
and a faster gait lands harder. Here travel beyond the commanded speed is charged as strongly as travel up to
it is paid, as on `HorseLegBalanceSpeed-v0`: policies of one command go at one speed. For each of `SPEEDS`
CMA-ES finds the best constant gait, which is scripted, and the best gait with a clock. `ppo_flat` learns all
speeds at once, from commands that change.

Whether a training finds the soft gait is a matter of luck there. So gaits are searched and agents trained
once more under charges of the ground's force that are twice as dear, at each of `DEAR_SPEEDS`. The agents
begin as the best gait with a clock under those charges: their networks imitate it, and then train with little
noise. Trainings and searches go on where they stopped.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from agents import open_loop, runs
from agents.command import parse, run
from agents.experiments.hop_page import figures_of, rounded
from agents.imitate import ROWS, Imitation
from agents.kept import EVIDENCE, read_kept
from agents.train import Args as TrainingArgs
from agents.train import train
from hoof_env import register
from hoof_env._output import markdown_table
from hoof_env._plotting import AMBER, BLUE, GREEN, GREY, PURPLE, STYLE
from hoof_env.envs.open_loop import gait_file, open_loop_record
from hoof_env.errors import DataFileError, ParameterError, count
from hoof_env.evaluation.episodes import FINAL_SEEDS, make_rows, score_vector
from hoof_env.evaluation.statistics import Interval, estimate, over_seeds
from hoof_env.tasks.hop_terms import BALANCE_SPEED_TERMS
from hoof_env.tasks.registry import task_of

DATA = "softness.json"
PAGE_FILE = "softness.md"
PICTURE = "softness.png"

ID = "softness/HopSpeed-v0"
HOP = "hoof_env/HorseLegHop-v0"
BALANCE = "hoof_env/HorseLegBalanceSpeed-v0"

SPEEDS = (1.5, 2.25, 3.0)
"""Commanded speeds at which policies are compared [m/s]."""

NEAR = 0.2
"""Largest difference of a policy's speed from the command, over the command, at which it is compared."""

SEEN = ("crank", "gait", "trunk", "hoof", "target")
"""Observation of the agents; a gait sees nothing, and has no command to see: it is of one speed."""

STEPS = 1_000_000
"""Environment steps of a training."""

DEAR: Mapping[str, float] = {"peak": 0.6, "loading": 20.0, "slip": 20.0, "failure": 10.0}
"""Dear charges: twice the weights of `HorseLegHop-v0`. Slip is among them, for gaits that slide have small
peaks, and a fall, for otherwise searches end at gaits that fall at once and pay for no stance."""

DEAR_SPEEDS = (2.25,)
"""Commanded speeds of policies under dear charges [m/s]; at the slowest of `SPEEDS` the best gait with a
clock slides."""

SLOWER: Mapping[float, float] = {2.25: 2.05}
"""Slower commands under dear charges by command: agents that begin as a gait lose some of its speed, and
their forces are compared with those of a gait that is as slow."""

DEAR_STEP = 0.02
"""First standard deviation of a search under dear charges: with the usual one, five times as large, searches
lost the gait from which they began, and ended at worse ones."""

DEAR_STEPS = 800_000
"""Environment steps of a training that begins as a gait."""

QUIET: Mapping[str, Any] = {
    "policy_kwargs": {"log_std_init": -2.0},
    "learning_rate": "lin_0.0003",
    "n_envs": 64,
    "batch_size": 1024,
}
"""Hyperparameters of a training that begins as a gait. With the noise and the rate of others the gait is lost
at once, with their 16 environments it gets worse again after a third of the steps."""

FIGURES: Mapping[str, tuple[str, int, float]] = {
    "speed_m_s": ("speed m/s", 2, 1.0),
    "failed": ("falls %", 1, 100.0),
    "stance_peak_n": ("stance peak, weights", 2, 1.0),
    "loading_rate_n_s": ("loading kN/s", 0, 1e-3),
    "slip_m": ("slip of a stance cm", 1, 100.0),
    "cost_of_transport": ("cost of transport", 2, 1.0),
    "return": ("return", 0, 1.0),
}
"""Titles, digits and factors of the columns; a peak is divided by the weight."""

SOFT = {
    "stance_peak_n": "stance peak",
    "loading_rate_n_s": "loading",
    "slip_m": "slip",
    "cost_of_transport": "cost of transport",
}
"""Figures that are compared; less is softer, or cheaper."""

HARDNESS = ("stance_peak_n", "loading_rate_n_s")
"""Figures of which both must be lower for a softer gait."""

FAMILIES: Mapping[Literal["constant", "phase"], str] = {
    "constant": "best constant gait",
    "phase": "best gait with a clock",
}

DEAR_GAIT = "dear_phase"
SLOW_GAIT = "slower_phase"
DEAR_AGENTS = "dear_agents"
"""Keys of policies under dear charges, and beginnings of the names of their files."""

OVERSPEED = next(term for term in BALANCE_SPEED_TERMS if term.name == "overspeed")

register(
    ID,
    base="hop",
    terms=[OVERSPEED],
    target_speed=task_of("balance_speed").defaults["target_speed"],
    target_seconds=task_of("balance_speed").defaults["target_seconds"],
)


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    seeds: int = 5
    """trainings, of the seeds from 0 on"""
    folder: Path = Path("runs/softness")
    """folder of trainings and searches"""
    balance: Path = Path("runs/seeing")
    """folder of the trainings of `agents.experiments --plan seeing`, whose agents are played as well"""
    train: bool = True
    """search and train; otherwise write the page of what is there"""
    out: Path = EVIDENCE
    """folder of page, figures and picture"""


def command_of(speed: float) -> dict[str, Any]:
    """Return the argument of an environment that commands one speed [m/s]."""
    return {"target_speed": [speed, speed]}


def dear(speed: float) -> dict[str, Any]:
    """Return the arguments of an environment with dear charges and one speed [m/s]."""
    return {**command_of(speed), "reward_weights": dict(DEAR)}


def gait_path(folder: Path, family: str, speed: float) -> Path:
    """Return the file of a gait."""
    return folder / f"{family}-{speed:g}.json"


def search(
    out: Path,
    family: Literal["constant", "phase"],
    env_kwargs: Mapping[str, Any],
    start: Path,
    step: float = open_loop.Args.step,
) -> None:
    """Search for the best gait of a family in an environment, from random points and from a gait that is
    known, and write its file. Arguments and errors are as in `open_loop.optimise`."""
    open_loop.optimise(
        open_loop.Args(
            env_id=ID,
            env_kwargs=(json.dumps(env_kwargs),),
            family=family,
            harmonics=1 if family == "phase" else None,
            restarts=2,
            start=start,
            step=step,
            out=out,
        )
    )


def learn(
    out: Path,
    seed: int,
    env_kwargs: Mapping[str, Any],
    *also: Any,
    env_id: str = ID,
    steps: int = STEPS,
    params: Mapping[str, Any] | None = None,
) -> None:
    """Train an agent of `ppo_flat`, or go on with its training; `also` are more callbacks.

    Raises:
        ParameterError: it was stopped before its end.
    """
    trained = train(
        TrainingArgs(
            env_id=env_id,
            env_kwargs=(json.dumps(env_kwargs),),
            algo="ppo_flat",
            steps=steps,
            seed=seed,
            params=(json.dumps(params or {}),),
            out=out,
            resume=True,
        ),
        *also,
    )
    if trained.stopped_by:
        raise ParameterError(f"{out}: stopped by signal {trained.stopped_by}; the same command goes on")


def search_dear(folder: Path, speed: float) -> None:
    """Search for the best gait with a clock under dear charges from the one under the usual ones, and from
    there for one of a slower command."""
    usual, found = (gait_path(folder, key, speed) for key in ("phase", DEAR_GAIT))
    search(found, "phase", dear(speed), usual, DEAR_STEP)
    if slower := SLOWER.get(speed):
        search(gait_path(folder, SLOW_GAIT, speed), "phase", dear(slower), found, DEAR_STEP)


def learn_from_gait(folder: Path, seed: int, speed: float) -> None:
    """Train an agent under dear charges that begins as the best gait with a clock under the same charges;
    errors as in `learn`."""
    out = folder / f"{DEAR_AGENTS}-{speed:g}-s{seed}"
    env_kwargs = {"observation": SEEN, **dear(speed)}
    gait = gait_path(folder, DEAR_GAIT, speed)
    imitation = Imitation(gait, make_rows(ID, ROWS, **env_kwargs), seed)
    learn(out, seed, env_kwargs, imitation, steps=DEAR_STEPS, params=QUIET)


def trained_folders(folder: Path, pattern: str) -> list[Path]:
    """Return the folders of trainings that are through, by the seed at the end of their names."""
    found = [path for path in folder.glob(pattern) if runs.read_record(path).get("finished")]
    return sorted(found, key=lambda path: int(path.name.rpartition("s")[2]))


def of_gait(path: Path, env_kwargs: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of a gait in an environment, with intervals over episodes."""
    episodes = score_vector(str(path), ID, FINAL_SEEDS, **env_kwargs)
    record = open_loop_record(path)
    columns = {name: [episode[name] for episode in episodes] for name in FIGURES}
    found = {name: estimate([x for x in values if np.isfinite(x)]) for name, values in columns.items()}
    return {
        "intervals": {
            name: [round(x, 6) for x in (one.mean, one.low, one.high)] for name, one in found.items()
        },
        "searches": [
            {
                "origin": one["origin"],
                "episodes": one["episodes"],
                "stalled": one["stalled"],
                "return": round(one["mean"]["return"], 2),
            }
            for one in record["restarts"]
        ],
        "commit": record["versions"].get("commit", ""),
    }


def of_agents(folders: Sequence[Path], env_id: str, **env_kwargs: Any) -> list[dict[str, Any]]:
    """Return the figures of each agent in an environment."""
    return [
        {
            "seed": int(path.name.rpartition("s")[2]),
            "steps": int(runs.read_record(path)["finished"]["steps"]),
            "commit": runs.read_record(path)["versions"].get("commit", ""),
            **rounded(figures_of(score_vector(str(path), env_id, FINAL_SEEDS, **env_kwargs))),
        }
        for path in folders
    ]


def read_known(path: Path) -> dict[str, Any]:
    """Return the figures of an earlier measurement; empty if there is no such file.

    Raises:
        DataFileError: the file is malformed.
    """

    def taken(content: Any) -> dict[str, Any]:
        for speed in SPEEDS:
            dict(content["speeds"].get(f"{speed:g}", {}))
        return dict(content)

    if not path.is_file():
        return {}
    return read_kept(path, "figures that agents.softness measured", taken)


def measure(args: Args) -> dict[str, Any]:
    """Play all policies that are there, write their figures and return them; figures of agents whose folders
    are not here stay."""
    agents = trained_folders(args.folder, "s*")
    balancing = trained_folders(args.balance, "ppo_flat-HorseLegBalanceSpeed-v0-s*")
    known = read_known(args.out / DATA)
    envs: Any = make_rows(ID, 1)
    data: dict[str, Any] = {"weight_n": float(np.ravel(envs.weight)[0]), "speeds": {}}
    for speed in SPEEDS:
        before = known.get("speeds", {}).get(f"{speed:g}", {})
        entry: dict[str, Any] = {}
        for family in FAMILIES:
            path = gait_path(args.folder, family, speed)
            entry[family] = of_gait(path, command_of(speed)) if path.is_file() else before.get(family)
        usual = of_agents(agents, ID, observation=SEEN, **command_of(speed))
        entry["agents"] = usual or before.get("agents")
        entry["balancing"] = of_agents(balancing, BALANCE, **command_of(speed)) or before.get("balancing")
        if speed in DEAR_SPEEDS:
            path = gait_path(args.folder, DEAR_GAIT, speed)
            entry[DEAR_GAIT] = of_gait(path, dear(speed)) if path.is_file() else before.get(DEAR_GAIT)
            if slower := SLOWER.get(speed):
                path = gait_path(args.folder, SLOW_GAIT, speed)
                entry[SLOW_GAIT] = of_gait(path, dear(slower)) if path.is_file() else before.get(SLOW_GAIT)
            folders = trained_folders(args.folder, f"{DEAR_AGENTS}-{speed:g}-s*")
            learnt = of_agents(folders, ID, observation=SEEN, **dear(speed))
            entry[DEAR_AGENTS] = learnt or before.get(DEAR_AGENTS)
        if missing := [name for name, value in entry.items() if not value]:
            raise DataFileError(
                f"{args.folder}, {args.balance}: expected all policies of {speed:g} m/s, found no"
                f" {', '.join(missing)}; without --no-train the first folder is filled"
            )
        data["speeds"][f"{speed:g}"] = entry
    args.out.mkdir(parents=True, exist_ok=True)
    runs.write_text(args.out / DATA, json.dumps(data, indent=1) + "\n")
    return data


def is_near(speed: float, command: float) -> bool:
    """True if a policy goes at about the commanded speed."""
    return abs(speed - command) <= NEAR * command


def intervals_of(policy: Any) -> dict[str, Interval]:
    """Return figures with intervals: over episodes of a gait, over seeds of agents."""
    if isinstance(policy, list):
        return over_seeds([{name: seed[name] for name in FIGURES} for seed in policy])
    return {name: Interval(*values) for name, values in policy["intervals"].items()}


def compared(data: Mapping[str, Any]) -> dict[float, dict[str, Any]]:
    """Return the policies of each commanded speed that go at about that speed: gaits, and lists of agents
    that may be empty."""
    found: dict[float, dict[str, Any]] = {}
    for text, entry in data["speeds"].items():
        speed = float(text)
        found[speed] = {
            key: [seed for seed in policy if is_near(seed["speed_m_s"], speed)]
            if isinstance(policy, list)
            else policy
            for key, policy in entry.items()
            if isinstance(policy, list) or is_near(policy["intervals"]["speed_m_s"][0], speed)
        }
    return found


POLICIES: Mapping[str, str] = {
    **{str(family): title for family, title in FAMILIES.items()},
    "agents": "agents",
    "balancing": "agents that balance",
    DEAR_GAIT: "dear: best gait with a clock",
    SLOW_GAIT: "dear: best gait with a clock, of a slower command",
    DEAR_AGENTS: "dear: agents from a gait",
}
"""Policies of a speed, in the order of the table."""


def table(data: Mapping[str, Any]) -> str:
    """Return the table of all policies by speed; of agents those that go at about that speed."""
    lines = []
    near = compared(data)
    for text, entry in data["speeds"].items():
        for key, title in POLICIES.items():
            if key not in entry:
                continue
            is_learnt = isinstance(entry[key], list)
            policy = near[float(text)][key] if is_learnt else entry[key]
            seeds = f"{len(policy)} of {len(entry[key])}" if is_learnt else ""
            cells = []
            found = intervals_of(policy) if policy else {}
            for name, (_, digits, factor) in FIGURES.items():
                by = 1 / data["weight_n"] if name == "stance_peak_n" else factor
                cells.append(found[name].text(digits, by) if found else "")
            lines.append([text, title, seeds, *cells])
    titles = ("command m/s", "policy", "at this speed", *(title for title, *_ in FIGURES.values()))
    return markdown_table(titles, lines)


def relation(agents: Interval, gait: Interval) -> str:
    """Return how the agents' figure lies beside the gait's."""
    if gait.above(agents):
        return "lower"
    return "higher" if agents.above(gait) else "not apart"


def relations(
    data: Mapping[str, Any], family: str, name: str, learnt: str = "agents"
) -> list[tuple[str, float]]:
    """Return how agents compare with a family of gaits in a figure at each speed, and the ratio of the
    means; ("", NaN) where either does not go at that speed."""
    found = []
    for near in compared(data).values():
        if family not in near or not near.get(learnt):
            found.append(("", math.nan))
            continue
        agents, gait = (intervals_of(near[key])[name] for key in (learnt, family))
        found.append((relation(agents, gait), agents.mean / gait.mean))
    return found


PAIRS: Mapping[tuple[str, str], str] = {
    ("agents", "constant"): "agents, best constant gait",
    ("agents", "phase"): "agents, best gait with a clock",
    (DEAR_AGENTS, DEAR_GAIT): "dear: agents, best gait with a clock",
    (DEAR_AGENTS, SLOW_GAIT): "dear: agents, best gait with a clock of a slower command",
    (DEAR_AGENTS, "phase"): "dear agents, best gait under the usual charges",
}
"""Agents and gaits that are compared."""


def relation_table(data: Mapping[str, Any]) -> str:
    """Return the table of how agents compare with gaits."""
    lines = [
        [
            title,
            figure,
            *(f"{word}, {ratio:.2f}" if word else "" for word, ratio in relations(data, gait, name, learnt)),
        ]
        for (learnt, gait), title in PAIRS.items()
        for name, figure in SOFT.items()
    ]
    return markdown_table(
        ("agents beside gait", "figure", *(f"{speed} m/s" for speed in data["speeds"])), lines
    )


def verdict(data: Mapping[str, Any]) -> str:
    """Write whether agents are softer than the best gait with a clock."""
    soft = [[word for word, _ in relations(data, "phase", name)] for name in HARDNESS]
    count_of = {word: sum(each.count(word) for each in soft) for word in ("lower", "higher", "not apart")}
    if not any(map(any, soft)):
        return "No agent and gait go at the same speed, so that nothing is compared."
    pairs = [pair for pair in zip(*soft, strict=True) if all(pair)]
    softer = sum(all(word == "lower" for word in pair) for pair in pairs)
    return (
        f"Of {sum(count_of.values())} comparisons of stance peak and loading with the best gait with a clock"
        f" agents are lower in {count_of['lower']}, higher in {count_of['higher']}, and not apart in"
        f" {count_of['not apart']}; at {softer} of {len(pairs)} speeds both are lower."
    )


def softer(data: Mapping[str, Any], learnt: str, gait: str) -> str:
    """Write how agents compare with a gait in stance peak and loading at each speed where both go."""
    found = [relations(data, gait, name, learnt) for name in HARDNESS]
    return " ".join(
        f"At {speed} m/s "
        + " and ".join(
            f"{SOFT[name]} is {word} ({ratio:.2f} times)"
            for name, (word, ratio) in zip(HARDNESS, pair, strict=True)
        )
        + "."
        for speed, pair in zip(data["speeds"], zip(*found, strict=True), strict=True)
        if all(word for word, _ in pair)
    )


def known_better(data: Mapping[str, Any]) -> str:
    """Write what searches for a gait with a clock returned by where they began."""
    searches = [one for entry in data["speeds"].values() for one in entry["phase"]["searches"]]
    returns = [
        sorted(one["return"] for one in searches if (one["origin"] == "random") == is_random)
        for is_random in (True, False)
    ]
    if not all(returns):
        return ""
    blind, begun = (f"{each[0]:.0f} to {each[-1]:.0f}" for each in returns)
    return (
        f"Searches for the gait that began from the gait of `HorseLegHop-v0` returned {begun}, searches from"
        f" random points, where a learner begins, too, {blind}."
    )


def draw(data: Mapping[str, Any], path: Path) -> None:
    """Draw stance peak and loading over the speed: gaits as lines, each agent as a dot."""
    panels = (
        ("stance_peak_n", "stance peak, weights", 1 / data["weight_n"]),
        ("loading_rate_n_s", "loading, kN/s", 1e-3),
    )
    with matplotlib.rc_context({**STYLE, "font.size": 11}):
        figure = Figure(figsize=(8, 4.2), layout="constrained")
        for axes, (name, title, factor) in zip(figure.subplots(1, 2), panels, strict=True):
            for family, colour in (("constant", AMBER), ("phase", GREY), (DEAR_GAIT, "black")):
                found = [intervals_of(near[family]) for near in compared(data).values() if family in near]
                x = [one["speed_m_s"].mean for one in found]
                y = [factor * one[name].mean for one in found]
                axes.plot(x, y, "s-", ms=5, color=colour, label=POLICIES[family])
            learnt = (("agents", BLUE, BLUE), ("balancing", GREEN, "none"), (DEAR_AGENTS, PURPLE, PURPLE))
            for key, colour, filling in learnt:
                seeds = [seed for near in compared(data).values() for seed in near.get(key, ())]
                x = [seed["speed_m_s"] for seed in seeds]
                y = [factor * seed[name] for seed in seeds]
                axes.plot(x, y, "o", ms=4, color=colour, mfc=filling, label=POLICIES[key])
            axes.set_xlabel("speed, m/s")
            axes.set_title(title)
            axes.set_ylim(bottom=0)
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
        figure.savefig(path, dpi=110)


TRIED = """
## What was tried before

Trainings from scratch under the usual charges at 2.25 m/s alone, one or two of each kind: they chose the
settings above, and their figures are not kept. One speed instead of all, and a discount of 0.995 with it,
ended in gaits that land hard, or that hardly travel. Charges of peak and loading that are thrice as dear from
the first step ended in agents that hardly travel. Less noise at first (`log_std_init` of -1 or -2), and 64
environments with three times the steps, found soft gaits in some trainings and hard or sliding ones in
others. Agents that began as a gait with the 16 environments of `ppo_flat` got worse again after a third of
their steps. The number of environments was chosen after that, with the seeds and episodes above: they are no
fresh sample. A training
from scratch is made by `python -m agents.train --env-id agents.softness:softness/HopSpeed-v0 --algo ppo_flat
--env-kwargs target_speed=[2.25,2.25] --params gamma=0.995`, with other arguments of the environment and other
settings.
"""

PAGE = """# Is softness learnt?

Policies of a leg that carries itself at equal speed. Written by `python -m agents.softness` from
[softness.json](softness.json); the agents are of {agent_commits}, the searches of {gait_commits},
the agents that balance of {balance_commits}. The task is [`HorseLegHop-v0`](../environments/HorseLegHop.md),
but travel beyond the commanded speed is charged as strongly as travel up to it is paid.

* **Gaits** see nothing. CMA-ES searched for the best constant gait, four numbers that are held, and the best
  gait with a clock, of one harmonic, at each speed, from random points and from the gaits of
  `HorseLegHop-v0`, until the last quarter of a search gained less than a hundredth: {episodes} episodes for
  each gait, {stalled}.
* **Agents** are {seeds} trainings of `ppo_flat`, {steps:,} steps each. One agent goes at all speeds: in its
  training a new speed was commanded every {shortest:g} to {longest:g} s, {slowest:g} to {fastest:g} m/s.
* **Dear** policies are of charges of stance peak, loading, slip and falls that are twice as dear, and of one
  speed each, gaits and agents alike. The gait was searched from the best one under the usual charges, with
  small steps. The {dear_seeds} agents of a speed, of {dear_commits}, begin as that gait: their networks first
  imitate it, without a clock to see, and then train for {dear_steps:,} steps each, with less noise, smaller
  steps and more environments than others ({quiet}).
  Returns are under the dear charges. Agents lose some of the gait's speed, so that they are also beside a
  gait of a slower command ({slower}).
* **Agents that balance** are the {balancing} of
  [`HorseLegBalanceSpeed-v0`](../environments/HorseLegBalanceSpeed.md) of [seeing.md](seeing.md): another
  task, in which gaits without feedback fall over before they have a speed, and are no bar. They are beside
  what goes at their speed with the pitch held.

All play the same {starts} episodes at each speed. Agents have interquartile means over seeds and their
intervals, gaits means over episodes and theirs. Agents whose speed differs from the command by more than
{near:.0%} are left out, as their forces are those of another speed, and gaits are not compared there. The
cost of transport is positive work over weight and distance.

{table}

## Beside gaits that see nothing

Whether the agents' figure is lower or higher, with intervals apart, and the ratio of the means; nothing where
one of them is missing or does not go at that speed:

{relations}

* **Agents.** {verdict} {known_better}
* **Dear.** {dear_verdict}
* **Dear, beside the gait of a slower command.** {slower_verdict}
* **Dear, beside the gait of the usual charges.** {dearer_verdict}
{tried}
![Stance peak and loading over the speed](softness.png)
"""


def commits_of(records: Sequence[Mapping[str, Any]]) -> str:
    """Write the commits of trainings or searches."""
    return ", ".join(sorted({f"`{record['commit']}`" for record in records}))


def write(out: Path, data: Mapping[str, Any]) -> Path:
    """Write the page and its picture; return the page's path."""
    entries = [*data["speeds"].values()]
    gaits = [entry[key] for entry in entries for key in (*FAMILIES, DEAR_GAIT, SLOW_GAIT) if key in entry]
    searches = [one for gait in gaits for one in gait["searches"]]
    spent = [sum(one["episodes"] for one in gait["searches"]) for gait in gaits]
    stalled = sum(one["stalled"] for one in searches)
    slowest, fastest = task_of(ID).defaults["target_speed"]
    shortest, longest = task_of(ID).defaults["target_seconds"]
    said = {**QUIET, **QUIET["policy_kwargs"]}
    del said["policy_kwargs"]
    learnt = [seed for entry in entries for seed in entry.get(DEAR_AGENTS, ())]
    text = PAGE.format(
        agent_commits=commits_of(entries[0]["agents"]),
        gait_commits=commits_of(gaits),
        balance_commits=commits_of(entries[0]["balancing"]),
        episodes=f"{min(spent):,} to {max(spent):,}",
        stalled=f"{stalled} of {len(searches)} searches stalled",
        dear_seeds=len({seed["seed"] for seed in learnt}),
        dear_commits=commits_of(learnt),
        dear_steps=max(seed["steps"] for seed in learnt),
        slower=", ".join(f"{slow:g} for {speed:g} m/s" for speed, slow in SLOWER.items()),
        quiet=", ".join(f"`{name}` {value}" for name, value in said.items()),
        seeds=len(entries[0]["agents"]),
        steps=entries[0]["agents"][0]["steps"],
        shortest=shortest,
        longest=longest,
        slowest=slowest,
        fastest=fastest,
        balancing=len(entries[0]["balancing"]),
        starts=len(FINAL_SEEDS),
        near=NEAR,
        table=table(data),
        relations=relation_table(data),
        verdict=verdict(data),
        known_better=known_better(data),
        dear_verdict=softer(data, DEAR_AGENTS, DEAR_GAIT),
        slower_verdict=softer(data, DEAR_AGENTS, SLOW_GAIT),
        dearer_verdict=softer(data, DEAR_AGENTS, "phase"),
        tried=TRIED,
    )
    runs.write_text(out / PAGE_FILE, text)
    draw(data, out / PICTURE)
    return out / PAGE_FILE


def main(argv: list[str] | None = None) -> None:
    """Search, train, play and write."""
    args = parse(Args, argv, "python -m agents.softness", __doc__)
    if args.train:
        for seed in range(count("seeds", args.seeds)):
            learn(args.folder / f"s{seed}", seed, {"observation": SEEN})
        for speed in SPEEDS:
            for family in FAMILIES:
                path = gait_path(args.folder, family, speed)
                search(path, family, command_of(speed), gait_file(HOP, family))
        for speed in DEAR_SPEEDS:
            search_dear(args.folder, speed)
            for seed in range(args.seeds):
                learn_from_gait(args.folder, seed, speed)
    print(f"written: {write(args.out, measure(args))}")


if __name__ == "__main__":
    run(main)
