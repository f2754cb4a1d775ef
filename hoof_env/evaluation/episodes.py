"""Episodes of any policy and what they return, one by one or as rows of a batch.

A row of the native vector environment is the episode that `play` gives with the same seed: bitwise identical
where the policy acts in a batch as alone, as scripted policies do, but for "random", which draws for all rows
at once; a network does to its last bits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import gymnasium as gym
import numpy as np

from hoof_env.envs.make_env import make_env
from hoof_env.envs.vector import HorseLegVectorEnv
from hoof_env.policies.actor import Actor
from hoof_env.policies.find import find_policy, load_policy

ROWS = 1024  # episodes side by side at most; more are played one batch after the other

CURVE_SEEDS = range(1000, 1020)
"""Episodes of the learning curves; training starts its own from other seeds."""

FINAL_SEEDS = range(1_000_000, 1_000_100)
"""Episodes of the final scores, on which nothing else is played: no training, curve, tuning or search."""


def play(
    env: gym.Env[Any, Any],
    policy: Any,
    seeds: Sequence[int],
    tick: Any = lambda: None,
) -> list[dict[str, float]]:
    """Play one episode per seed, with the start of the policy; return the return and the summary of each.
    `policy` is what `load_policy` takes, and `tick` is called after each episode."""
    actor = Actor(policy, env)
    episodes = []
    for seed in seeds:
        observation, info = env.reset(seed=seed, options=actor.start)
        actor.begin()
        total = 0.0
        done = False
        while not done:
            observation, reward, terminated, truncated, info = env.step(actor.act(observation))
            total += float(np.asarray(reward).sum())  # a vector reward: the sum of all objectives
            done = terminated or truncated
        episodes.append({"return": total, **_with_stance_peak(info.get("episode_summary", {}))})
        tick()
    return episodes


def score_vector(policy: Any, env_id: str, seeds: Sequence[int], **env_kwargs: Any) -> list[dict[str, float]]:
    """Play one episode per seed, as `play` does, in batches of the native vector environment if the id has
    one.

    Args:
        policy: what `load_policy` takes; an object needs Stable-Baselines3's `predict` for many observations,
            shape (n, k), and `episode_start`, shape (n,).
        env_id: id of the environment.
        seeds: seeds of the episodes.
        **env_kwargs: arguments of the environment.

    Raises:
        ParameterError: unknown environment or policy.
        DataFileError: a model that does not fit.
    """
    with make_env(env_id, **env_kwargs) as env:
        # Not by `load_policy`, which knows the id only as the environment has it
        policy = find_policy(policy, env, env_id) if isinstance(policy, str) else load_policy(policy, env)
        episodes: list[dict[str, float]] = []
        envs = None
        for first in range(0, len(seeds), ROWS):
            batch = list(seeds[first : first + ROWS])
            # The last batch may be smaller
            if envs is None or envs.num_envs != len(batch):
                envs = make_rows(env_id, len(batch), **env_kwargs)
            episodes += play(env, policy, batch) if envs is None else play_rows(envs, policy, batch)
    return episodes


def make_rows(env_id: str, num_envs: int, **env_kwargs: Any) -> HorseLegVectorEnv | None:
    """Return the native vector environment of an id, None if there is none."""
    with suppress(gym.error.Error):
        many: dict[str, Any] = {"num_envs": num_envs, "vectorization_mode": "vector_entry_point"}
        envs = gym.make_vec(env_id, **many, **env_kwargs).unwrapped
        if isinstance(envs, HorseLegVectorEnv):
            return envs
    return None


def play_rows(envs: HorseLegVectorEnv, policy: Any, seeds: Sequence[int]) -> list[dict[str, float]]:
    """Play as `score_vector` does in an environment with one row for each seed."""
    actor = Actor(policy)
    actor.begin(envs.num_envs)
    observation, _ = envs.reset(seed=list(seeds), options=actor.start)
    going = np.ones(envs.num_envs, bool)
    total = np.zeros(envs.num_envs)
    episodes: list[dict[str, float]] = [{} for _ in seeds]
    while going.any():
        observation, rewards, terminated, truncated, infos = envs.step(actor.act(observation))
        rewards = rewards.reshape(envs.num_envs, -1).sum(axis=1)  # vector rewards: the sum of all objectives
        total += np.where(going, rewards, 0.0)  # a row that is over starts again; that is not counted
        ended = going & (terminated | truncated)
        for row in np.flatnonzero(ended):
            columns = infos["episode_summary"]
            summary = {key: float(x[row]) for key, x in columns.items() if not key.startswith("_")}
            episodes[row] = {"return": float(total[row]), **_with_stance_peak(summary)}
        going &= ~ended
        # A row that has ended begins a new episode, which a policy with a memory must know
        actor.restart(terminated | truncated)
    return episodes


def _with_stance_peak(summary: Mapping[str, float]) -> dict[str, float]:
    """Return a summary with the mean of the stances' highest forces [N]."""
    if "stances" not in summary:
        return dict(summary)
    return {**summary, "stance_peak_n": summary["stance_peak_sum_n"] / max(summary["stances"], 1.0)}
