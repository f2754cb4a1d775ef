"""Networks that begin a training as a gait."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback

from hoof_env.envs.open_loop import open_loop, open_loop_record
from hoof_env.policies.actor import Actor

ROWS = 64
"""Episodes that are imitated, each to its end."""

STRAY = 0.3
"""Standard deviation of the noise with which the gait is played, so that states beside its own are seen."""

EPOCHS = 30
BATCH = 512
RATE = 1e-3


class Imitation(BaseCallback):
    """Fits the actor to the actions of a gait before the first step of a training; a training that goes on
    is left as it is.

    Args:
        gait: file of a gait.
        envs: native vector environment of `ROWS` rows, with the observation of the training.
        seed: seed of the noise and of the batches, and the first seed of the episodes.
    """

    def __init__(self, gait: Path, envs: Any, seed: int) -> None:
        super().__init__()
        self.gait = gait
        self.envs = envs
        self.seed = seed

    def _on_training_start(self) -> None:
        if not self.model.num_timesteps:
            fit(self.model.policy, *played(self.gait, self.envs, self.seed), self.seed)

    def _on_step(self) -> bool:
        return True


def played(gait: Path, envs: Any, seed: int) -> tuple[Any, Any]:
    """Return observations and the gait's actions in them, shapes (n, k) and (n, 4)."""
    policy = open_loop(open_loop_record(gait)["parameters"], envs)
    noise = np.random.default_rng(seed)
    actor = Actor(policy)
    actor.begin(envs.num_envs)
    observation, _ = envs.reset(seed=[seed + row for row in range(envs.num_envs)], options=actor.start)
    seen, done = [], []
    for _ in range(round(envs.settings.episode_seconds / envs.dt)):
        action = np.asarray(actor.act(observation))
        seen.append(observation.copy())
        done.append(action.copy())
        stray = action + STRAY * noise.standard_normal(action.shape)
        observation, _, terminated, truncated, _ = envs.step(np.clip(stray, -1.0, 1.0).astype(np.float32))
        actor.restart(terminated | truncated)
    return np.concatenate(seen), np.concatenate(done)


def fit(policy: Any, observations: Any, actions: Any, seed: int) -> float:
    """Fit the mean of a policy to actions by least squares; return the mean square of what is left."""
    x, y = (torch.as_tensor(np.asarray(each, np.float32)) for each in (observations, actions))
    actor = torch.nn.Sequential(policy.mlp_extractor.policy_net, policy.action_net)
    optimiser = torch.optim.Adam(actor.parameters(), RATE)
    order = np.random.default_rng(seed)
    for _ in range(EPOCHS):
        for chosen in np.array_split(order.permutation(len(x)), max(len(x) // BATCH, 1)):
            loss = torch.nn.functional.mse_loss(actor(x[chosen]), y[chosen])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
    with torch.no_grad():
        return float(torch.nn.functional.mse_loss(actor(x), y))
