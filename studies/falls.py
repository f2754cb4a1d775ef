"""Falls of a horse on rough ground under pushes, at several strengths, from the same starts for every policy.

    python -m agents.falls reference agents/policies/Horse-v0
    python -m agents.falls runs/rough --strengths 1 --episodes 200
    python -m agents.falls reference agents/policies/HorseRough-v0 --film fall.gif   # a fall prevented

A policy is what `hoof-env evaluate` takes, or a folder with runs of agents.train, a row each. The strengths
are factors of those that `hoof_env.tasks.disturbances` has in units: slopes, bumps, and pushes on the trunk.
Episode i of every policy has the same ground, start, commands and, as long as it lasts, pushes. Each policy
plays on its own id, whose disturbances are replaced: when this was written, the ids of horses differed in
nothing else; since then `HorseRough-v0` has another control step, observation and reward.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tyro.conf import Positional

from agents import runs
from agents.command import run
from hoof_env import records
from hoof_env._output import markdown_table
from hoof_env.errors import ParameterError, check_number, count
from hoof_env.evaluation.episodes import score_vector
from hoof_env.film import frames, write_film
from hoof_env.policies.find import find_policy, read_policy_record
from hoof_env.policies.saved import own_id
from hoof_env.render.renderer import Renderer
from hoof_env.tasks.disturbances import MOST_STRENGTH, rough_ground
from hoof_env.tasks.horse import MASS

ENV_ID = "hoof_env/Horse-v0"
FIRST_SEED = 2_000_000  # on which nothing else is played

FILMED = 1.6  # time before a fall that a film shows [s]
FPS = 10.0
SIZE = (480, 270)


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    policies: Positional[tuple[str, ...]] = ("reference",)
    """names of scripted policies, and paths of trained models"""
    strengths: tuple[float, ...] = (0.5, 1.0, 2.0)
    """factors of all disturbances"""
    episodes: int = 1000
    """of each policy at each strength"""
    film: Path | None = None
    """film, a .gif or .mp4, of an episode in which the first policy falls and the last one does not, instead
    of the table"""


def played(policy: str, strength: float, seeds: range) -> list[dict[str, float]]:
    """Return the summaries of a policy's episodes on rough ground."""
    env_id = own_id(read_policy_record(policy).get("env_id", ENV_ID))
    return score_vector(policy, env_id, seeds, **rough_ground(strength, MASS))


def falls_of(policy: str, strength: float, episodes: int) -> tuple[float, float]:
    """Return the share of episodes in which a policy falls, and that of those which succeed, see
    `hoof_env.envs.batch_reports.is_success`.

    Args:
        policy: name or path of the policy.
        strength: factor of all disturbances.
        episodes: number of episodes.
    """
    found = played(policy, strength, range(FIRST_SEED, FIRST_SEED + episodes))
    falls, successes = (float(np.mean([each[name] for each in found])) for name in ("failed", "success"))
    return falls, successes


def runs_in(policy: str) -> list[str]:
    """Return the runs in a folder of some, in order; of anything else, a run among them, just that."""
    folder = Path(policy)
    found = sorted(str(path.parent) for path in folder.glob(f"*/{runs.RECORD}"))
    return found if folder.is_dir() and found else [policy]


def table(policies: tuple[str, ...], strengths: tuple[float, ...], episodes: int) -> str:
    """Return the table of falls and successes in Markdown, a row for each policy."""
    rows = []
    for policy in (each for given in policies for each in runs_in(given)):
        cells = [policy]
        for strength in strengths:
            falls, successes = falls_of(policy, strength, episodes)
            cells += [f"{100 * falls:.1f} %", f"{100 * successes:.1f} %"]
            print(f"{policy} at strength {strength:g}: falls {cells[-2]}", file=sys.stderr, flush=True)
        rows.append(cells)
    head = [f"{what} at {strength:g}" for strength in strengths for what in ("falls", "success")]
    return markdown_table(["policy", *head], rows)


def film_of(policies: tuple[str, ...], strength: float, episodes: int, path: Path) -> None:
    """Film the end of the first policy's fall, and below it the last policy at the same time of the same
    episode: the first in which that one lasts, and in which the fall comes after `FILMED` seconds.

    Raises:
        ParameterError: there is no such episode.
    """
    seeds = range(FIRST_SEED, FIRST_SEED + episodes)
    pairs = zip(*(played(policy, strength, seeds) for policy in (policies[0], policies[-1])), strict=True)
    episodes_found = (
        (seed, fallen["seconds"])
        for seed, (fallen, lasting) in zip(seeds, pairs, strict=True)
        if fallen["failed"] and fallen["seconds"] >= FILMED and not lasting["failed"]
    )
    seed, end = next(episodes_found, (0, 0.0))
    if not end:
        raise ParameterError(
            f"--film: expected an episode among {episodes} in which {policies[0]} falls and"
            f" {policies[-1]} does not, got none"
        )
    strips = [strip(policy, strength, seed, end) for policy in (policies[0], policies[-1])]
    # A fallen horse stays in its last picture
    strips[0] += strips[0][-1:] * max(len(strips[1]) - len(strips[0]), 0)
    write_film((np.concatenate(each) for each in zip(*strips, strict=False)), path, FPS)
    print(f"seed {seed}: {policies[0]} falls after {end:.2f} s")


def strip(policy: str, strength: float, seed: int, end: float) -> list[NDArray[np.uint8]]:
    """Return the pictures of a policy's episode from `FILMED` seconds before a time to half a second after
    it."""
    settings = rough_ground(strength, MASS)
    env_id = own_id(read_policy_record(policy).get("env_id", ENV_ID))
    with records.make_env(env_id, settings) as env:
        player = find_policy(policy, env, env_id)
        renderer = Renderer(records.surroundings(env), size=SIZE)
        episode = records.episode(env, player, seed, end + 0.5)
        pictures = list(frames(renderer, episode, FPS))
    return pictures[round((end - FILMED) * FPS) :]


def main(argv: list[str] | None = None) -> None:
    """Play and print."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.falls", description=__doc__)
    for strength in args.strengths:
        check_number("--strengths", strength, low=0.0, high=MOST_STRENGTH)
    episodes = count("--episodes", args.episodes)
    if args.film:
        film_of(args.policies, args.strengths[-1], episodes, args.film)
        return
    print(table(args.policies, args.strengths, episodes))


if __name__ == "__main__":
    run(main)
