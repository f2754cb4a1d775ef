"""Proximal policy optimisation (PPO) under a constraint: the mean cost of an episode stays within a limit.

    python -m agents.train --algo ppo_lagrangian --env-id hoof_env/HorseLegSafe-v0

Stable-Baselines3's PPO with a multiplier m >= 0 for `info["cost"]`. Before each update

    m <- max(0, m + step of Adam along (J_C - d)),

with J_C the mean cost of the last n episodes that ended, of n environments, and d the limit. The policy
follows the advantages

    (A - m A_C) / (1 + m)

of reward and cost. Costs are divided by the standard deviation of their discounted sums, as the setting
`normalize` does with rewards, so that a multiplier of 1 weighs both alike whatever their units. A critic of
its own estimates the costs to come. With a multiplier of 0 the policy has PPO's bits.

This is PPO-Lagrangian of Ray, Achiam and Amodei (2019), Benchmarking Safe Exploration in Deep Reinforcement
Learning, section 5, with the clamp and the rate of OmniSafe's class `Lagrange` (Ji et al. 2023).
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from torch import nn

from agents.ppo_flat import Scale
from hoof_env.errors import ParameterError, check_number

WIDTHS = (64, 64)
"""Widths of the hidden layers of the costs' critic, as in Stable-Baselines3's own critic."""

Floats = NDArray[np.float32]


class Constraint(nn.Module):
    """Multiplier and critic of the costs, both saved with the model.

    Args:
        numbers: length of an observation.
        multiplier: first multiplier.
    """

    def __init__(self, numbers: int, multiplier: float) -> None:
        super().__init__()
        self.multiplier = nn.Parameter(torch.tensor(multiplier, dtype=torch.float64))
        layers: list[nn.Module] = []
        for before, width in zip((numbers, *WIDTHS), WIDTHS, strict=False):
            layers += [nn.Linear(before, width), nn.Tanh()]
        self.critic = nn.Sequential(*layers, nn.Linear(WIDTHS[-1], 1))

    def values(self, observations: Any) -> Floats:
        """Return the costs to come after observations, shape (..., numbers), without the last axis."""
        with torch.no_grad():
            found: Floats = self.critic(torch.as_tensor(observations, dtype=torch.float32))[..., 0].numpy()
        return found


class LagrangianPPO(PPO):
    """PPO of Stable-Baselines3 with a limit on the cost; its policies are loaded as PPO's.

    Args:
        cost_limit: largest mean cost of an episode, in the unit of `info["cost"]`.
        multiplier_rate: learning rate of the multiplier; 0 leaves it as it is.
        first_multiplier: multiplier at the start.

    Raises:
        ParameterError: a limit, rate or multiplier below 0, an environment whose infos have no cost, or
            another device than the CPU.
    """

    plays_as = "ppo"

    def __init__(
        self,
        policy: Any,
        env: Any,
        learning_rate: Any = 3e-4,
        n_steps: int = 2048,
        batch_size: int = 64,
        n_epochs: int = 10,
        gamma: float = 0.99,
        gae_lambda: float = 0.95,
        clip_range: Any = 0.2,
        ent_coef: float = 0.0,
        vf_coef: float = 0.5,
        max_grad_norm: float = 0.5,
        policy_kwargs: dict[str, Any] | None = None,
        seed: int | None = None,
        device: str = "cpu",
        cost_limit: float = 25.0,
        multiplier_rate: float = 0.035,
        first_multiplier: float = 0.001,
        _init_setup_model: bool = True,
    ) -> None:
        if str(device) not in ("cpu", "auto"):
            raise ParameterError(f"ppo_lagrangian: expected the CPU as device, got {device!r}")
        self.cost_limit = check_number("cost_limit", cost_limit, low=0.0)
        self.multiplier_rate = check_number("multiplier_rate", multiplier_rate, low=0.0)
        self.first_multiplier = check_number("first_multiplier", first_multiplier, low=0.0)
        self.random = np.random.default_rng(seed)
        self.episode_costs: deque[float] = deque()  # of the last episodes, as many as environments
        self.costs_so_far: NDArray[np.float64] | None = None  # of the episodes that go on
        super().__init__(
            policy,
            env,
            learning_rate,
            n_steps,
            batch_size,
            n_epochs,
            gamma,
            gae_lambda,
            clip_range,
            ent_coef=ent_coef,
            vf_coef=vf_coef,
            max_grad_norm=max_grad_norm,
            policy_kwargs=policy_kwargs,
            seed=seed,
            device="cpu",
            _init_setup_model=_init_setup_model,
        )

    @property
    def multiplier(self) -> float:
        """Present multiplier."""
        return float(self.constraint.multiplier.detach())

    def _setup_model(self) -> None:
        super()._setup_model()
        numbers = int(np.prod(self.observation_space.shape or 1))
        with torch.random.fork_rng():  # the policy draws the numbers of PPO's
            torch.manual_seed(self.seed or 0)
            self.constraint = Constraint(numbers, self.first_multiplier)
        self.critic_optimizer = torch.optim.Adam(self.constraint.critic.parameters(), eps=1e-5)
        self.multiplier_optimizer = torch.optim.Adam([self.constraint.multiplier], self.multiplier_rate)
        self.cost_buffer = RolloutBuffer(
            self.n_steps,
            self.observation_space,
            self.action_space,
            "cpu",
            gamma=self.gamma,
            gae_lambda=self.gae_lambda,
            n_envs=self.n_envs,
        )
        if self.costs_so_far is None:  # else it was loaded
            self.costs_so_far = np.zeros(self.n_envs)
            self.episode_costs = deque(maxlen=self.n_envs)
            self.scale = Scale(self.gamma)

    def _excluded_save_params(self) -> list[str]:
        own = ["constraint", "critic_optimizer", "multiplier_optimizer"]
        of_rollout = ["cost_buffer", "rollout_costs", "rollout_ends", "cut_off", "cost_samples"]
        return [*super()._excluded_save_params(), *own, *of_rollout]

    def _get_torch_save_params(self) -> tuple[list[str], list[str]]:
        names, variables = super()._get_torch_save_params()
        return [*names, "constraint", "critic_optimizer", "multiplier_optimizer"], variables

    # Costs of a rollout

    def _update_info_buffer(self, infos: list[dict[str, Any]], dones: Any = None) -> None:
        """Read the costs of a step, of which Stable-Baselines3 hands over the infos here."""
        super()._update_info_buffer(infos, dones)
        try:
            costs = np.array([info["cost"] for info in infos])
        except KeyError:
            raise ParameterError(
                "ppo_lagrangian: expected an environment with costs, as hoof_env/HorseLegSafe-v0 or one made"
                ' with cost={"indicator": 2000.0}, got infos without "cost"'
            ) from None
        assert self.costs_so_far is not None
        step = len(self.rollout_costs)
        self.rollout_costs.append(costs)
        self.rollout_ends.append(np.array(dones, bool))
        self.costs_so_far += costs
        for k in np.flatnonzero(dones).tolist():
            self.episode_costs.append(float(self.costs_so_far[k]))
            self.costs_so_far[k] = 0.0
            if infos[k].get("TimeLimit.truncated", False):
                self.cut_off.append((step, k, infos[k]["terminal_observation"]))

    def collect_rollouts(self, env: Any, callback: Any, rollout_buffer: Any, n_rollout_steps: int) -> bool:
        """Play a rollout, change the multiplier, and put the costs into its advantages; see PPO."""
        self.rollout_costs: list[NDArray[np.float64]] = []
        self.rollout_ends: list[NDArray[np.bool_]] = []
        self.cut_off: list[tuple[int, int, Any]] = []
        goes_on = super().collect_rollouts(env, callback, rollout_buffer, n_rollout_steps)
        if goes_on:
            if self.episode_costs:
                self.change_multiplier(float(np.mean(self.episode_costs)))
            self.charge(rollout_buffer)
        return goes_on

    def change_multiplier(self, mean_cost: float) -> None:
        """Raise the multiplier if the mean cost of an episode is above the limit; lower it otherwise."""
        multiplier = self.constraint.multiplier
        self.multiplier_optimizer.zero_grad()
        (-multiplier * (mean_cost - self.cost_limit)).backward()
        self.multiplier_optimizer.step()
        multiplier.data.clamp_(min=0.0)
        self.logger.record("train/multiplier", self.multiplier)
        self.logger.record("train/episode_cost", mean_cost)

    def charge(self, rollouts: RolloutBuffer) -> None:
        """Replace the advantages of a rollout by advantages of reward and cost together."""
        buffer, values = self.cost_buffer, self.constraint.values
        buffer.reset()
        costs = np.array(self.rollout_costs, np.float32)
        buffer.rewards[:] = costs / self.scale.after(costs, np.array(self.rollout_ends))
        for step, k, last in self.cut_off:  # costs beyond a time limit, as PPO estimates rewards
            buffer.rewards[step, k] += self.gamma * values(last.reshape(-1))
        flat = rollouts.observations.reshape(*rollouts.rewards.shape, -1)
        buffer.episode_starts[:] = rollouts.episode_starts
        buffer.values[:] = values(flat)
        assert self._last_obs is not None
        assert self._last_episode_starts is not None
        last_values = values(np.asarray(self._last_obs).reshape(self.n_envs, -1))
        buffer.compute_returns_and_advantage(torch.from_numpy(last_values), self._last_episode_starts)
        m = self.multiplier
        rollouts.advantages[:] = (rollouts.advantages - m * buffer.advantages) / (1.0 + m)
        self.cost_samples = flat.reshape(-1, flat.shape[-1]).copy(), buffer.returns.reshape(-1).copy()

    # Updates

    def train(self) -> None:
        """Update the policy as PPO does, then the critic of the costs."""
        super().train()
        observations, returns = (torch.as_tensor(part, dtype=torch.float32) for part in self.cost_samples)
        critic = self.constraint.critic
        for group in self.critic_optimizer.param_groups:
            group["lr"] = self.lr_schedule(self._current_progress_remaining)
        losses = []
        for _ in range(self.n_epochs):
            order = torch.from_numpy(self.random.permutation(len(returns)))
            for chosen in order.split(self.batch_size):
                loss = nn.functional.mse_loss(critic(observations[chosen])[:, 0], returns[chosen])
                self.critic_optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(critic.parameters(), self.max_grad_norm)
                self.critic_optimizer.step()
                losses.append(loss.item())
        self.logger.record("train/cost_value_loss", float(np.mean(losses)))
