"""Score any policy on many episodes at once: the rows of the native vector environment, one episode each.

An episode is that of `agents.evaluate.play` with the same seed, to the bit where the policy acts in a batch
as alone: scripted policies do, but for "random", which draws for all rows at once; a network does to its
last bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.evaluate import find_policy, play
from hoof_env.envs.vector import HorseLegVectorEnv
from hoof_env.errors import ParameterError

ROWS = 1024
"""Episodes side by side at most; more are played one batch after the other."""


def score_vector(
    policy: Any,
    env_id: str,
    seeds: Sequence[int],
    tick: Callable[[int], Any] = lambda count: None,
    **env_kwargs: Any,
) -> list[dict[str, float]]:
    """One episode per seed; its return and the figures of its summary, as `agents.evaluate.play` gives them.

    Args:
        policy: anything with Stable-Baselines3's `predict` that takes many observations, shape (n, k), and
            `episode_start`, shape (n,); the name or path of one, as `agents.evaluate` takes them; or actions
            that are held, shape (4,) for all or (len(seeds), 4).
        env_id: registered environment. One without a native vector environment is played one by one.
        seeds: of the episodes.
        tick: called with the number of episodes that were added.
        env_kwargs: arguments of the environment.

    Raises:
        ParameterError, DataFileError: unknown environment or policy, or one that does not fit.
    """
    with runs.make_env(env_id, **env_kwargs) as env:
        if isinstance(policy, str):
            policy = find_policy(policy, env, env_id)
        held = None if hasattr(policy, "predict") else _held(policy, len(seeds))
        episodes: list[dict[str, float]] = []
        batch, envs = min(ROWS, len(seeds)), None
        while len(episodes) < len(seeds):
            part = slice(len(episodes), len(episodes) + batch)
            now = Held(held[part]) if held is not None else policy
            some = list(seeds[part])
            if envs is None or envs.num_envs != len(some):
                envs = make_rows(env_id, len(some), **env_kwargs)
            if envs is None:
                for k, seed in enumerate(some):
                    episodes += play(env, now if held is None else Held(held[part][k]), [seed])
                    tick(1)
            else:
                episodes += play_rows(envs, now, some)
                tick(len(some))
    return episodes


class Held:
    """A policy that holds its actions, shape (4,), or (n, 4) for n environments."""

    def __init__(self, actions: NDArray[np.float32]) -> None:
        self._actions = np.asarray(actions, np.float32)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[NDArray[np.float32], None]:
        """The actions."""
        return np.broadcast_to(self._actions, (*np.shape(observation)[:-1], self._actions.shape[-1])), None


def _held(actions: Any, count: int) -> NDArray[np.float32]:
    """Actions for `count` episodes, shape (count, 4)."""
    with suppress(ValueError, TypeError):
        given = np.asarray(actions, np.float32)
        if given.shape in ((4,), (count, 4)) and np.isfinite(given).all():
            return np.broadcast_to(given, (count, 4))
    raise ParameterError(
        f"policy: expected one with predict, its name, or finite actions of shape (4,) or ({count}, 4), "
        f"got {actions!r}"
    )


def make_rows(env_id: str, num_envs: int, **env_kwargs: Any) -> HorseLegVectorEnv | None:
    """The native vector environment of an id; None where there is none."""
    with suppress(gym.error.Error):
        many: dict[str, Any] = {"num_envs": num_envs, "vectorization_mode": "vector_entry_point"}
        envs = gym.make_vec(env_id, **many, **env_kwargs).unwrapped
        if isinstance(envs, HorseLegVectorEnv):
            return envs
    return None


def play_rows(envs: HorseLegVectorEnv, policy: Any, seeds: Sequence[int]) -> list[dict[str, float]]:
    """`score_vector` with an environment that is there already, one row for each seed."""
    observation, _ = envs.reset(seed=list(seeds))
    start, going = np.ones(envs.num_envs, bool), np.ones(envs.num_envs, bool)
    total, state = np.zeros(envs.num_envs), None
    episodes: list[dict[str, float]] = [{} for _ in seeds]
    while going.any():
        actions, state = policy.predict(observation, state, episode_start=start, deterministic=True)
        observation, rewards, terminated, truncated, infos = envs.step(actions)
        total += np.where(going, rewards, 0.0)  # a row that is over starts again; that is not counted
        ended = going & (terminated | truncated)
        for row in np.flatnonzero(ended):
            figures = infos["episode_summary"]
            summary = {key: float(x[row]) for key, x in figures.items() if not key.startswith("_")}
            summary["stance_peak_n"] = summary["stance_peak_sum_n"] / max(summary["stances"], 1.0)
            episodes[row] = {"return": float(total[row]), **summary}
        going &= ~ended
        start = terminated | truncated
    return episodes
