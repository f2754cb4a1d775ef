"""Levels of data for offline learning: policies between random actions and the shipped agent.

The normalised score of a return is 0 for random actions and 100 for the shipped agent, each the mean over the
episodes of the published scores. "simple" and "medium" are the shipped agent, of which a share of the actions
is random; the share is the one at which the score is 25 or 50. Fujimoto et al. (2019), "Off-policy deep
reinforcement learning without exploration", have such imperfect demonstrations. "mixed" has equal parts of
the other four.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from hoof_env.envs.policies import start_of
from hoof_env.envs.vector import HorseLegVectorEnv
from hoof_env.errors import ParameterError
from hoof_env.evaluation.episodes import CURVE_SEEDS, FINAL_SEEDS, make_rows, play_rows
from hoof_env.policies.find import find_policy

Level = Literal["random", "simple", "medium", "expert", "mixed"]

SCORES = {"random": 0.0, "simple": 25.0, "medium": 50.0, "expert": 100.0}
"""Normalised score of each level."""

HALVINGS = 7
"""Halvings in the search for a share: it is found to 1/128."""


class Partly:
    """Policy that replaces a share of another one's actions by random ones.

    Args:
        policy: object with Stable-Baselines3's `predict`.
        share: probability of a random action, from 0 to 1.
        seed: seed of the random actions.
    """

    def __init__(self, policy: Any, share: float, seed: int = 0) -> None:
        self.policy = policy
        self.share = share
        self.start = start_of(policy)
        self._generator = np.random.default_rng(seed)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Return the action, or the actions for many observations, and the state of the other policy."""
        action, state = self.policy.predict(observation, state, episode_start, deterministic)
        action = np.asarray(action, np.float32)
        other = self._generator.uniform(-1.0, 1.0, action.shape).astype(np.float32)
        is_random = self._generator.random(action.shape[:-1]) < self.share
        return np.where(np.asarray(is_random)[..., np.newaxis], other, action), state


@dataclass(frozen=True)
class Scale:
    """Returns by which a score is normalised.

    Attributes:
        random, shipped: mean returns over the episodes of the published scores.
    """

    random: float
    shipped: float

    def score(self, mean_return: float) -> float:
        """Return the normalised score of a mean return."""
        return 100.0 * (mean_return - self.random) / (self.shipped - self.random)


class Levels:
    """Policies of the levels on an environment.

    Args:
        env: the environment.
        env_id: its id.
        kwargs: its arguments.

    Attributes:
        scale: returns by which scores are normalised.

    Raises:
        ParameterError: an environment without a shipped policy or without many at once, or one on which the
            shipped agent returns no more than random actions.
    """

    def __init__(self, env: Any, env_id: str, kwargs: dict[str, Any]) -> None:
        self._env, self._env_id, self._kwargs = env, env_id, kwargs
        self.shipped = find_policy("shipped", env, env_id)
        self.random = find_policy("random", env, env_id)
        self.scale = Scale(*(self._mean(policy, FINAL_SEEDS) for policy in (self.random, self.shipped)))
        if not self.scale.random < self.scale.shipped:
            raise ParameterError(
                f"{env_id}: expected an environment on which the shipped agent returns more than random"
                f" actions, got {self.scale.shipped:.4g} and {self.scale.random:.4g}"
            )

    def policies(self, level: Level) -> dict[str, Any]:
        """Return the policies of a level by the names of their own levels."""
        names = [*SCORES] if level == "mixed" else [level]
        return {name: self._policy(name) for name in names}

    def _policy(self, name: str) -> Any:
        if name in ("random", "expert"):
            return self.random if name == "random" else self.shipped
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            share = (low + high) / 2
            score = self.scale.score(self._mean(Partly(self.shipped, share), CURVE_SEEDS))
            low, high = (share, high) if score > SCORES[name] else (low, share)
        return Partly(self.shipped, (low + high) / 2)

    def _mean(self, policy: Any, seeds: Sequence[int]) -> float:
        """Return the mean return of a policy."""
        envs: HorseLegVectorEnv | None = make_rows(self._env_id, len(seeds), **self._kwargs)
        if envs is None:
            raise ParameterError(f"level: expected an id of this package, got {self._env_id!r}")
        return float(np.mean([episode["return"] for episode in play_rows(envs, policy, seeds)]))
