"""The page of learners under a constraint: reward, cost and steps in violation of agents with and without it,
and where the limits of the ids come from."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from agents import runs
from agents.experiments.outcomes import is_done, read_outcome
from agents.experiments.plans import Entry, Run
from agents.runs import SavedModel, TrainedPolicy
from agents.statistics import spread
from hoof_env._output import markdown_table
from hoof_env.envs import open_loop
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.evaluation.episodes import FINAL_SEEDS, score_vector
from hoof_env.policies.catalogue import SHIPPED as CATALOGUE
from hoof_env.tasks.registry import task_of

PUBLISHED = Path(__file__).parents[2] / "docs" / "evidence"
"""Folder of the published page and its rows."""

ROWS = "costs.csv"
PAGE_FILE = "costs.md"

BUDGET = 25.0
"""Largest mean cost of an episode: the limit of Safety-Gymnasium's tasks, and `cost_limit` of
agents/hyperparams/ppo_lagrangian.yml."""

FIGURES = (
    "return",
    "cost",
    "violating_steps",
    "episodes_within",
    "cost_indicator",
    "cost_leaning",
    "median_highest_n",
    "weight_share",
    "least_weight_share",
    "speed_m_s",
    "failed",
)
"""Figures of a row, over the episodes of the final scores: `cost` is per episode, `violating_steps` its share
of the steps, `episodes_within` the share of the episodes that cost `BUDGET` or less."""

COLUMNS = ("env_id", "agent", "seed", "steps", *FIGURES, "commit")

GAITS = ("zero", "walk", "run", "carrying_walk")
"""Policies without learning that are shown beside the agents."""

BLIND = {
    "HorseLeg-v0, constant gait": "HorseLeg-v0-constant.json",
    "HorseLeg-v0, gait locked to the crank": "HorseLeg-v0-phase.json",
    "Horse-v0, gait locked to the crank": "Horse-v0-phase.json",
}
"""Best gaits without feedback of the ids without limits, by name, in the folder of the package's gaits."""

SHIPPED = {"hoof_env/HorseLegSafe-v0": "HorseLeg-v0", "hoof_env/HorseSafe-v0": "Horse-v0"}
"""Ids whose shipped agent, which pays for forces and was trained for long, is shown on an id with costs."""

FREE = "PPO, free"
"""Name of the agent from which the limits come."""

CHOOSING = {"hoof_env/HorseSafe-v0": 0}
"""Seed whose trainings chose settings in agents/hyperparams, by id."""

NAMES = {
    "ppo": "PPO",
    "ppo penalised": "PPO, penalised",
    "ppo_lagrangian": "PPO-Lagrangian",
    "ppo free": FREE,
}


def name_of(entry: Entry) -> str:
    """Return the name of an entry's agent in rows and tables."""
    return NAMES[" ".join(filter(None, (entry.algo, entry.variant)))]


def played_on(entry: Entry) -> str:
    """Return the id with costs on which the agents of an entry are scored."""
    found = {f"hoof_env/{name}": env_id for env_id, name in SHIPPED.items()}
    return found.get(entry.env_id, entry.env_id)


def agent_in(folder: Path, env_id: str, env_kwargs: Mapping[str, Any] | None = None) -> TrainedPolicy:
    """Return an agent that was trained on an id, to play it on another one."""
    with runs.make_env(env_id, **(env_kwargs or {})) as env:
        policy = SavedModel.find(folder).load(env, env_id)
    return policy


def figures_of(policy: Any, env_id: str) -> dict[str, float]:
    """Play a policy on an id as it is registered, also one that was trained with other weights; return its
    figures."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # other weights, which are meant
        episodes = score_vector(policy, env_id, FINAL_SEEDS)

    def column(name: str) -> Any:
        return np.array([episode.get(name, 0.0) for episode in episodes])

    task = task_of(next(key for key in ("safe", "horse_safe") if task_of(key).id == env_id))
    cost = sum(column(f"cost_{name}") for name in task.defaults["cost"])
    steps = column("seconds") / task.settings({}).dt
    return {
        "return": column("return").mean(),
        "cost": cost.mean(),
        "violating_steps": cost.sum() / steps.sum(),
        "episodes_within": (cost <= BUDGET).mean(),
        "cost_indicator": column("cost_indicator").mean(),
        "cost_leaning": column("cost_leaning").mean(),
        "median_highest_n": float(np.median(column("highest_grf_n"))),
        "weight_share": column("weight_share").mean(),
        "least_weight_share": column("weight_share").min(),
        "speed_m_s": column("speed_m_s").mean(),
        "failed": column("failed").mean(),
    }


def read_rows(folder: Path) -> list[dict[str, str]]:
    """Return the rows of costs.csv, as text; an empty list if there is no such file.

    Raises:
        DataFileError: a column is missing.
    """
    path = folder / ROWS
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    if any(set(row) != set(COLUMNS) for row in rows):
        raise DataFileError(f"{path}: expected columns {', '.join(COLUMNS)}")
    return rows


def publish(plan: Sequence[Entry], folder: Path, out: Path) -> list[dict[str, str]]:
    """Score trainings of `folder` that are done and have no row of as many steps, and policies without
    learning; return all rows of costs.csv in `out`."""
    rows = {(row["env_id"], row["agent"], row["seed"]): row for row in read_rows(out)}
    before = dict(rows)
    for one in (Run(entry, seed) for entry in plan for seed in range(entry.seeds)):
        entry = one.entry
        key = played_on(entry), name_of(entry), str(one.seed)
        if not is_done(one, folder):
            continue
        outcome = read_outcome(one, folder)
        if key not in rows or int(rows[key]["steps"]) != int(outcome.final["steps"]):
            commit = runs.read_record(outcome.folder)["versions"].get("commit", "")
            more = {"steps": int(outcome.final["steps"]), "commit": commit}
            agent = agent_in(outcome.folder, entry.env_id, entry.env_kwargs)
            rows[key] = row_of(key, figures_of(agent, key[0]) | more)
    for env_id in {key[0] for key in rows}:
        for name in GAITS:
            if (env_id, name, "") not in rows:
                try:
                    rows[env_id, name, ""] = row_of((env_id, name, ""), figures_of(name, env_id))
                except ParameterError:  # a horse has no such gait
                    continue
        other = SHIPPED[env_id]
        for name, file in BLIND.items():
            if name.startswith(f"{other},") and (env_id, name, "") not in rows:
                figures = figures_of(str(open_loop.GAITS / file), env_id)
                rows[env_id, name, ""] = row_of((env_id, name, ""), figures)
        if (env_id, f"shipped {other}", "") not in rows:
            key = env_id, f"shipped {other}", ""
            agent = agent_in(CATALOGUE / other, f"hoof_env/{other}")
            rows[key] = row_of(key, figures_of(agent, env_id))
    if rows != before:
        out.mkdir(parents=True, exist_ok=True)
        runs.write_csv(out / ROWS, COLUMNS, [rows[key] for key in sorted(rows)])
    return [rows[key] for key in sorted(rows)]


def row_of(key: tuple[str, str, str], figures: dict[str, Any]) -> dict[str, str]:
    """Return a row as text."""
    row = dict(zip(("env_id", "agent", "seed"), key, strict=True))
    texts = {name: f"{x:.6g}" if isinstance(x, float) else str(x) for name, x in figures.items()}
    return {column: (row | texts).get(column, "") for column in COLUMNS}


def of(rows: Sequence[dict[str, str]], name: str) -> Any:
    """Return a figure of some rows."""
    return np.array([float(row[name]) for row in rows])


def table(rows: Sequence[dict[str, str]]) -> str:
    """Return the table of an id."""
    order = [*NAMES.values(), *(f"shipped {name}" for name in SHIPPED.values()), *BLIND, *GAITS]
    lines = []
    for agent in order:
        own = [row for row in rows if row["agent"] == agent]
        if not own:
            continue
        trained = own[0]["steps"]
        lines.append(
            [
                agent if trained or agent not in GAITS else f"gait `{agent}`",
                str(len(own)) if trained else "",
                f"{int(trained):,}" if trained else "",
                spread(of(own, "return"), 0),
                spread(of(own, "cost"), 0),
                spread(of(own, "violating_steps"), 1, 100.0),
                f"{np.sum(of(own, 'cost') <= BUDGET)} of {len(own)}" if trained else "",
                spread(of(own, "median_highest_n"), 2, 1e-3),
                spread(of(own, "weight_share"), 2),
                spread(of(own, "speed_m_s"), 2),
            ]
        )
    titles = (
        "agent",
        "seeds",
        "steps",
        "return",
        "cost of an episode",
        "steps in violation %",
        "keep the limit",
        "median highest GRF kN",
        "weight share",
        "speed m/s",
    )
    return markdown_table(titles, lines)


def limits_table(rows: Sequence[dict[str, str]]) -> str:
    """Return the table of the distributions from which the limits come."""
    lines = []
    for env_id in dict.fromkeys(row["env_id"] for row in rows):
        free = [row for row in rows if (row["env_id"], row["agent"]) == (env_id, FREE)]
        if not free:
            continue
        task = next(found for found in map(task_of, ("safe", "horse_safe")) if found.id == env_id)
        highest = of(free, "median_highest_n")
        lines.append(
            [
                f"`{env_id}`",
                str(len(free)),
                spread(highest, 0),
                f"{np.median(highest):.0f}",
                f"{0.75 * np.median(highest):.0f}",
                f"{task.defaults['cost']['indicator']:.0f}",
                spread(of(free, "weight_share"), 2),
                f"{of(free, 'least_weight_share').min():.2f}",
            ]
        )
    titles = (
        "id",
        "agents",
        "median over episodes of the highest GRF: mean of the agents (lowest to highest) N",
        "median of the agents N",
        "three quarters N",
        "limit N",
        "weight share",
        "least of an episode",
    )
    return markdown_table(titles, lines)


PAGE = """# Learners under a constraint

Agents of Stable-Baselines3's PPO on the ids with [costs](../environments/common.md#costs), in the same
{starts} episodes, with the reward of the id, which charges no force. Written by
`python -m agents.experiments --plan costs` from [costs.csv](costs.csv), which has a row for each training.
Numbers are means over trainings, in brackets the lowest and the highest. The cost of an episode counts its
steps in violation; an agent keeps the limit if its mean is {budget:.0f} or less. Trained by the code of
{commits}.

* **PPO** is not given the cost. Neither is **PPO, free**, which was trained for fewer steps and from which
  the limits come.
* **PPO, penalised** pays for forces as on `HorseLeg-v0` and `Horse-v0`, by the weights of their terms.
* **PPO-Lagrangian** ([agents/ppo_lagrangian.py](../../agents/ppo_lagrangian.py)) has a multiplier for costs.
* **Gaits** see nothing: scripted ones, and the best that searches found for the ids without limits.
* **shipped** is the agent of the package for the id without limits, which pays for forces and was trained for
  millions of steps.

{tables}

{reading}

## Where the limits come from

{limits}

The limit of Safety-Gymnasium's velocity tasks is half of the highest speed of an unconstrained PPO agent.
Here it is three quarters of the highest force of such agents, to a hundred newtons: of each agent the median
over the episodes, of these the median. They were set after a first round of these trainings, which gave
2157 N and 4468 N; the table is of a second round. The limit of `leaning`, 0.8, is `trunk_share` of the task,
which these agents bear without being asked to.
"""


def reading(rows: Sequence[dict[str, str]]) -> str:
    """Return what the tables say of learners whose settings a seed chose, and of a gait that leans."""
    lines = []
    for env_id, seed in CHOOSING.items():
        own = [row for row in rows if (row["env_id"], row["agent"]) == (env_id, NAMES["ppo_lagrangian"])]
        costs = [float(row["cost"]) for row in own if row["seed"] != str(seed)]
        if costs:
            kept = sum(cost <= BUDGET for cost in costs)
            lines.append(
                f"The multiplier's rate on `{env_id}` was set by trainings of seed {seed}. Of the other seeds"
                f" {kept} of {len(costs)} keep the limit, at a mean cost of {np.mean(costs):.0f}.\n"
            )
    for row in rows:
        if row["agent"] == "walk" and float(row["cost_leaning"]) > 0.0:
            share, force, leaning = (
                float(row[name]) for name in ("weight_share", "cost_indicator", "cost_leaning")
            )
            lines.append(
                f"The gait `walk` on `{row['env_id']}` hangs on the suspension and bears {share:.2f} of the"
                f" weight. Of an episode {force:.0f} steps are above the limit of the force, {leaning:.0f}"
                " beyond that of leaning."
            )
    return "\n".join(lines)


def write(out: Path, rows: Sequence[dict[str, str]]) -> Path:
    """Write the page of some rows; return its path.

    Raises:
        DataFileError: there are no rows.
    """
    if not rows:
        raise DataFileError(f"{out / ROWS}: expected rows of trainings, found none")
    ids = dict.fromkeys(row["env_id"] for row in rows)
    tables = [f"## `{one}`\n\n{table([row for row in rows if row['env_id'] == one])}" for one in ids]
    commits = sorted({f"`{row['commit']}`" for row in rows if row["commit"]})
    text = PAGE.format(
        starts=len(FINAL_SEEDS),
        budget=BUDGET,
        commits=", ".join(commits),
        tables="\n\n".join(tables),
        reading=reading(rows),
        limits=limits_table(rows),
    )
    runs.write_text(out / PAGE_FILE, text)
    return out / PAGE_FILE
