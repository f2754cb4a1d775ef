"""Agents of `agents.gait_task`: which lag they learn at each speed, by what they spare.

Each is trained by `ppo_flat` for one objective or none, one seed and one kind of gait to begin with, on
commanded speeds of Froude numbers 0.1 to 1.1. Then it plays fixed commands: the same starts for all, measured
as the searched gaits are. Horses that have learnt nothing are played as well.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from agents import gait_map, gait_task, runs, train
from agents.gait_map import CHECKED, FIGURES, OBJECTIVES
from agents.gait_rig import Rig
from agents.gait_task import COMMANDS, STARTS, id_of, weights_of
from agents.horse_gaits import speed_of
from agents.kept import check_numbers, read_kept
from agents.rules import rejection_reason
from agents.settings import FOLDER, load_settings
from hoof_env.envs.policies import make_policy
from hoof_env.errors import brief
from hoof_env.policies.find import find_policy

FROUDES = tuple(froude for froude in gait_map.FROUDES if COMMANDS[0] <= froude <= COMMANDS[1])
"""Froude numbers of the commands: those of the searches that agents are trained on."""
SEEDS = 5  # trainings for each objective and beginning
CONTROLS = 3  # trainings without an objective for each beginning
RUNS = Path("runs", "gait_agents")
CONTROL = "nothing"  # what an agent without an objective spares
NONE = "none"  # objective of a horse that has learnt nothing
FIRST_START = 10**9  # seed of the first start, as of the searched gaits

Row = dict[str, Any]


class Agent(NamedTuple):
    """One agent, or a horse that has learnt nothing."""

    start: str
    objective: str
    seed: int

    @property
    def folder(self) -> Path:
        """Folder of its training."""
        return RUNS / f"{self.start}-{self.objective}-s{self.seed}"


def all_agents() -> list[Agent]:
    """Return all agents, those with the same seed together."""
    agents = [Agent(start, NONE, 0) for start in STARTS]
    for seed in range(SEEDS):
        spared = (*OBJECTIVES, CONTROL) if seed < CONTROLS else OBJECTIVES
        agents += [Agent(start, objective, seed) for objective in spared for start in STARTS]
    return agents


def settings() -> dict[str, Any]:
    """Return the hyperparameters of a training."""
    return load_settings(FOLDER / "ppo_flat.yml", "gait_agents")


def train_all(agents: Sequence[Agent]) -> None:
    """Train the agents whose training is not through."""
    for agent in agents:
        if agent.objective == NONE:
            continue
        weights = {"reward_weights": weights_of(agent.objective)}
        args = train.Args(
            env_id=f"{gait_task.__name__}:{id_of(agent.start)}",
            algo="ppo_flat",
            env_kwargs=(json.dumps(weights),),
            params=(json.dumps(settings()),),
            seed=agent.seed,
            out=agent.folder,
            resume=True,
        )
        print(f"{agent.folder}: {train.train(args)}", flush=True)


def play(agent: Agent) -> list[Row]:
    """Return an agent's figures at all speeds."""
    env_id = id_of(agent.start)
    rig = Rig(CHECKED, env_id, num_threads=1)
    is_trained = agent.objective != NONE
    kwargs = {"reward_weights": weights_of(agent.objective)} if is_trained else {}
    with runs.make_env(env_id, **kwargs) as env:
        policy = find_policy(str(agent.folder), env, env_id) if is_trained else make_policy("zero", env)
    rows = []
    for froude in FROUDES:
        speed = speed_of(froude)
        gait = rig.envs.body.reference(np.array([speed]))
        figures = rig.play(gait, speed, FIRST_START, CHECKED, policy=policy)
        shown = {name: round(float(figures[name][0]), 4) for name in FIGURES}
        rows.append(
            agent._asdict()
            | {"froude": froude}
            | {name: None if np.isnan(value) else value for name, value in shown.items()}
        )
    return rows


def counts(row: Row) -> bool:
    """Return True if an agent's figures at a speed count."""
    return not rejection_reason({name: np.nan if row[name] is None else row[name] for name in FIGURES})


def rows_of_file(content: Any) -> tuple[dict[str, str], int, list[Row]]:
    """Return versions, steps of a training and figures of a file's content; raise KeyError, TypeError or
    ValueError for another file's."""
    rows = [dict(zip(content["columns"], row, strict=True)) for row in content["rows"]]
    for k, row in enumerate(rows):
        check_numbers(f"row {k}", row, ("froude", "seed"))
        check_numbers(f"row {k}", row, FIGURES, missing=True)
        for name, known in (
            ("start", STARTS),
            ("objective", (*OBJECTIVES, CONTROL, NONE)),
            ("froude", FROUDES),
        ):
            if row[name] not in known:
                raise ValueError(f"{name} of row {k} is {brief(row[name])}")
        if not isinstance(row["commit"], str):
            raise TypeError(f"commit of row {k} is {brief(row['commit'])}")
    return dict(content["versions"]), int(content["steps"]), rows


class Herd:
    """Figures of agents in a file, which is written after each agent.

    Args:
        path: the file; one that exists is gone on with.

    Raises:
        DataFileError: it exists and is no such file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.about: dict[str, str] = {}
        self.steps: int = settings()["n_timesteps"]
        self.rows: list[Row] = []
        if path.is_file():
            what = "figures of agents that agents.gait_change trained"
            self.about, self.steps, self.rows = read_kept(path, what, rows_of_file)

    def agents(self) -> list[Agent]:
        """Return the agents that have figures."""
        return [*dict.fromkeys(Agent(row["start"], row["objective"], row["seed"]) for row in self.rows)]

    def commits(self) -> list[str]:
        """Return the commits at which figures were measured."""
        return [*dict.fromkeys(row["commit"] for row in self.rows)]

    def keep(self, rows: list[Row]) -> None:
        """Add rows and write the file."""
        now = runs.versions()
        self.rows += [row | {"commit": now.get("commit", "unknown")} for row in rows]
        self.about = self.about or now
        columns = [*self.rows[0]]
        lines = [json.dumps([row[name] for name in columns]) for row in self.rows]
        head = {"versions": self.about, "steps": self.steps, "columns": columns}
        text = json.dumps(head)[:-1] + ',\n"rows": [\n' + ",\n".join(lines) + "\n]}\n"
        self.path.parent.mkdir(parents=True, exist_ok=True)
        runs.write_text(self.path, text)


def complete(path: Path) -> Herd:
    """Train and play the agents that are not in the file; return all."""
    herd = Herd(path)
    known = herd.agents()
    missing = [agent for agent in all_agents() if agent not in known]
    print(f"{path}: has {len(known)} of {len(known) + len(missing)} agents", flush=True)
    if missing:
        print(f"{len(missing)} agents to train, minutes each, and to play", flush=True)
    for agent in missing:
        train_all([agent])
        herd.keep(play(agent))
    return herd
