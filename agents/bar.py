"""The bar of an id: the best policy that sees nothing, searched and trained, by one command.

    python -m agents.bar                                 all ids; hours
    python -m agents.bar --env-id hoof_env/HorseLeg-v0 --seeds 3

For each id it searches a gait that is locked to the crank (`agents.open_loop`) and trains blind agents, whose
observation is crank, gait and command alone, with the settings and steps of the shipped agent. Gait and best
agent are stored, proved blind (`agents.blindness`) and scored as rows (`agents.results`); the better one is
the bar. Finished searches and runs are not repeated, so that an interrupted command goes on.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from agents import open_loop, results, runs, train
from agents.command import parse, run
from agents.ship import CHOOSING_SEEDS, shown_command
from hoof_env.envs.open_loop import BLIND, GAITS, check_blind
from hoof_env.errors import OutputError, ParameterError, check_choice, check_number
from hoof_env.evaluation.episodes import FINAL_SEEDS, score_vector
from hoof_env.policies.saved import ABOUT, WEIGHTS

ALGORITHM = "ppo_flat"

SEEDS = {"HorseLeg-v0": 10, "HorseRough-v0": 10}
"""Blind training runs of an id; 3 of any other."""

IDS = (
    "HorseLeg-v0",
    "HorseLegRail-v0",
    "HorseLegSpeed-v0",
    "HorseLegTerrain-v0",
    "HorseLegFixed-v0",
    "Horse-v0",
    "HorseRough-v0",
)
"""Ids with a bar; `HorseLegMO-v0` shares the bar of `HorseLeg-v0`."""

STARTS_FROM = {"HorseRough-v0": "Horse-v0"}
"""Easier ids whose gait a search begins with."""

AGENTS = results.RESULTS / "policies"
"""Folder of the blind agents."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    env_id: tuple[str, ...] = tuple(f"hoof_env/{name}" for name in IDS)
    """one id or more"""
    seeds: int | None = None
    """blind training runs of each id; otherwise 10 on HorseLeg-v0 and HorseRough-v0, 3 on the rest"""
    steps: int | None = None
    """steps of each; otherwise as many as the shipped agent's"""
    episodes: int | None = None
    """least of each search for a gait"""
    most: int | None = None
    """most of each search for a gait"""
    restarts: int = 3
    """searches for a gait"""
    observation: tuple[str, ...] = ()
    """groups that the agents observe; otherwise all of the id that depend on no force"""
    runs: Path = Path("runs/bar")
    """folder of searches and training runs"""
    out: Path = results.RESULTS
    """folder of the rows; in another one than results/ gaits and agents are stored beside them"""


def blind_groups(env_id: str, asked: Sequence[str] = ()) -> list[str]:
    """Return the groups that blind agents of an id observe.

    Raises:
        ParameterError: a group that was asked for depends on a force.
    """
    if asked:
        with runs.make_env(env_id, observation=list(asked)) as env:
            check_blind(env.unwrapped.settings)  # type: ignore[attr-defined]
        return list(asked)
    with runs.make_env(env_id) as env:
        settings = env.unwrapped.settings  # type: ignore[attr-defined]
    if settings.drive != "prescribed":
        raise ParameterError(
            "drive: expected 'prescribed' for blind agents, got 'motor': its crank feels the ground, and no"
            " observation is a clock; agents.open_loop searches gaits with a clock"
        )
    return [group for group in settings.observation if group in BLIND]


def gait(name: str, args: Args) -> Path:
    """Search the gait of an id and return its file."""
    path = args.runs / f"{name}-phase.json"
    begin = STARTS_FROM.get(name)
    start = args.runs / f"{begin}-phase.json" if begin else None
    open_loop.optimise(
        open_loop.Args(
            f"hoof_env/{name}",
            episodes=args.episodes,
            most=args.most,
            restarts=args.restarts,
            start=start if start and start.is_file() else None,
            out=path,
        )
    )
    return path


def agents_of(name: str, args: Args, groups: list[str]) -> list[Path]:
    """Train the blind agents of an id and return their folders."""
    folders = []
    for seed in range(args.seeds or SEEDS.get(name, 3)):
        folder = args.runs / name / f"blind-s{seed}"
        command = ["--algo", ALGORITHM, "--env-id", f"hoof_env/{name}", "--seed", str(seed)]
        command += ["--env-kwargs", json.dumps({"observation": groups}), "--out", str(folder), "--resume"]
        command += ["--steps", str(args.steps)] if args.steps else []
        if not is_through(folder):
            train.main(command)
        if not is_through(folder):
            raise OutputError(f"{folder}: the training was interrupted; the same command goes on with it")
        check_run(folder, groups, args.steps)
        folders.append(folder)
    return folders


def check_run(folder: Path, groups: list[str], steps: int | None) -> None:
    """Raise `OutputError` for a finished run with another observation, or with fewer steps than asked for."""
    record = runs.read_record(folder)
    seen = record.get("env_kwargs", {}).get("observation")
    trained = record["finished"]["steps"]
    if seen != groups or trained < (steps or 0):
        raise OutputError(
            f"{folder}: expected a run that observes {', '.join(groups)} for {steps or 'the usual'} steps,"
            f" got one of {seen} and {trained:,} steps; name another --runs"
        )


def is_through(folder: Path) -> bool:
    """True if a training run is finished."""
    return (folder / runs.RECORD).is_file() and "finished" in runs.read_record(folder)


def returns_in(folder: Path, name: str, seeds: range, groups: list[str]) -> float:
    """Return the mean return of a blind agent in some episodes."""
    episodes = score_vector(str(folder), f"hoof_env/{name}", seeds, observation=groups)
    return float(np.mean([episode["return"] for episode in episodes]))


def store_gait(name: str, found: Path, args: Args) -> str:
    """Store a gait where the package finds it; return its place as a row names it."""
    folder = GAITS if args.out == results.RESULTS else args.out
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"{name}-phase.json"
    content = json.loads(found.read_text(encoding="utf-8"))
    content["command"] = shown_command(content["command"])
    runs.write_text(target, json.dumps(content, indent=1) + "\n")
    return place_of(target)


def store_agent(name: str, folder: Path, args: Args) -> str:
    """Store the policy of a run as plain data; return its place as a row names it."""
    target = (AGENTS if args.out == results.RESULTS else args.out / "policies") / f"{name}-blind"
    target.mkdir(parents=True, exist_ok=True)
    for file in (WEIGHTS, ABOUT):
        shutil.copyfile(folder / file, target / file)
    record: dict[str, Any] = dict(runs.read_record(folder))
    record["command"] = shown_command(record.get("command", ""))
    record.pop("args", None)  # paths of the machine that trained
    runs.write_record(target, record)
    return place_of(target)


def place_of(path: Path) -> str:
    """Return a path as rows name it: within the repository, or as it is."""
    resolved = path.resolve()
    return (
        resolved.relative_to(results.ROOT).as_posix() if results.ROOT in resolved.parents else str(resolved)
    )


def find(name: str, args: Args) -> results.Row:
    """Find the bar of an id and write its rows; return the better one."""
    env_id = f"hoof_env/{name}"
    groups = blind_groups(env_id, args.observation)
    path = gait(name, args)
    record = json.loads(path.read_text(encoding="utf-8"))
    searched = {"episodes": record["episodes"]}
    place = store_gait(name, path, args)
    command = shown_command(runs.command())
    found = [results.make_row(env_id, "open-loop", place, effort=searched, command=command)]
    folders = agents_of(name, args, groups)
    chosen = max(folders, key=lambda folder: returns_in(folder, name, CHOOSING_SEEDS, groups))
    all_runs = {str(k): returns_in(each, name, FINAL_SEEDS, groups) for k, each in enumerate(folders)}
    steps = {"steps": runs.read_record(chosen)["finished"]["steps"]}
    agent = store_agent(name, chosen, args)
    note = f"observes {', '.join(groups)}; {ALGORITHM} with the settings of the shipped agent"
    found.append(results.make_row(env_id, "blind", agent, all_runs, steps, command, note))
    for row in found:
        row.write(args.out)
    return max(found, key=lambda row: row.mean["return"])


def main(argv: list[str] | None = None) -> None:
    """Find the bars."""
    args = parse(Args, argv, "python -m agents.bar", __doc__)
    if args.seeds is not None:
        check_number("seeds", args.seeds, low=1, high=1000)
    for env_id in args.env_id:
        check_choice("env_id", env_id, [f"hoof_env/{name}" for name in IDS])
        blind_groups(env_id, args.observation)
    for env_id in args.env_id:
        name = env_id.removeprefix("hoof_env/")
        row = find(name, args)
        print(f"{name}: {results.KINDS[row.kind]}, {row.mean['return']:.1f}", flush=True)


if __name__ == "__main__":
    run(main)
