"""Proximal policy optimisation (PPO) for small networks and fast environments.

    python -m agents.train --algo ppo_flat
    python -m agents.train --algo ppo_flat --env-id hoof_env/HorseLegFixed-v0 --steps 100000

Read `FlatPPO` first: it plays a rollout, estimates the advantages of its actions, improves the networks. It
is Stable-Baselines3's PPO with networks of tanh and without what they do not need; training loop, buffer,
policy and files are that library's. Networks and gradient are in agents/perceptrons.py.

Three things differ. Rewards are scaled by all returns up to the end of the rollout, not of the step. Among
the `locals` of a step a callback finds `new_obs`, `rewards`, `dones`, `infos` and `clipped_actions`, but no
values. The losses of policy and value are logged.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env import VecNormalize
from torch import nn

from agents.perceptrons import ADVANTAGE, CHUNK, Floats, Loss, Part, Weights
from hoof_env.errors import ParameterError
from hoof_env.simd.threads import check_threads, limit_threads, run_together

# Decay rates of the moments, and the term that keeps Adam from dividing by 0
BETA1 = 0.9
BETA2 = 0.999
EPSILON = 1e-5

LARGEST = np.float32(10.0)
"""Largest reward after `Scale`, as in Stable-Baselines3: one failure in a rollout must not hide all else."""

POLICY_KWARGS = {"net_arch", "activation_fn", "log_std_init", "ortho_init"}


# Experience


def flat(observations: Any, kept: int = 1) -> Floats:
    """Return observations with all axes but the first `kept` as one."""
    return np.asarray(observations, np.float32).reshape(*observations.shape[:kept], -1)


class Scale:
    """Standard deviation of the discounted returns so far, from the first step of an episode to each."""

    def __init__(self, gamma: float) -> None:
        self.gamma = gamma
        self.count = 1e-4
        self.mean = 0.0
        self.square = 1.0
        self.restart()

    def restart(self) -> None:
        """Begin all episodes anew."""
        self.returns = np.float32(0.0)

    def after(self, rewards: Floats, ended: NDArray[np.bool_]) -> np.float32:
        """Return the scale that includes these steps; `rewards` and `ended` have shape (T, n)."""
        returns = np.empty_like(rewards)
        # An episode that has ended contributes nothing to the next return
        goes_on = np.float32(self.gamma) * ~ended
        for t in range(len(rewards)):
            returns[t] = self.returns + rewards[t]
            self.returns = goes_on[t] * returns[t]
        count = self.count + returns.size
        mean = float(returns.mean(dtype=np.float64))
        gap = mean - self.mean
        variance = float(returns.var(dtype=np.float64))
        # Chan et al.: variances of two samples, pooled with the gap of their means
        between = gap**2 * self.count * returns.size / count
        self.square = (self.square * self.count + variance * returns.size + between) / count
        self.mean = self.mean + gap * returns.size / count
        self.count = count
        return np.float32(np.sqrt(self.square + 1e-8))


class FlatPPO(OnPolicyAlgorithm):
    """PPO with the arguments of Stable-Baselines3's, as which its policies are loaded.

    Args:
        norm_reward: divide rewards by a `Scale`, as `VecNormalize` would.
        num_threads: threads that compute gradients; None is as many as torch may use. A batch has work for
            one in each `CHUNK` steps.

    Raises:
        ParameterError: another policy than perceptrons with tanh, another device than the CPU, batches of one
            step, or rewards that would be normalised twice.
    """

    policy_aliases: ClassVar[dict[str, Any]] = {"MlpPolicy": ActorCriticPolicy}
    plays_as = "ppo"

    def __init__(
        self,
        policy: str,
        env: Any,
        learning_rate: Any = 3e-4,
        n_steps: int = 500,
        batch_size: int = 2000,
        n_epochs: int = 4,
        gamma: float = 0.99,
        gae_lambda: float = 0.95,
        clip_range: Any = 0.2,
        ent_coef: float = 0.0,
        vf_coef: float = 0.5,
        max_grad_norm: float = 0.5,
        policy_kwargs: dict[str, Any] | None = None,
        seed: int | None = None,
        device: str = "cpu",
        norm_reward: bool = False,
        num_threads: int | None = None,
        _init_setup_model: bool = True,
    ) -> None:
        kwargs = {"activation_fn": nn.Tanh, **(policy_kwargs or {})}
        if kwargs["activation_fn"] is not nn.Tanh or str(device) not in ("cpu", "auto"):
            raise ParameterError(
                f"ppo_flat: expected nn.Tanh on the CPU, got {kwargs['activation_fn']!r} on {device!r}"
            )
        if unknown := set(kwargs) - POLICY_KWARGS:
            known = ", ".join(sorted(POLICY_KWARGS))
            raise ParameterError(f"policy_kwargs: expected some of {known}, got {', '.join(unknown)}")
        if batch_size < 2:
            raise ParameterError(f"batch_size: expected 2 or more, for its advantages, got {batch_size!r}")
        # A reward scaled twice would have the wrong size
        if norm_reward and isinstance(env, VecNormalize) and env.norm_reward:
            raise ParameterError("norm_reward: expected False where `normalize` does it, got both")
        self.batch_size = batch_size
        self.n_epochs = n_epochs
        self.clip_range = clip_range
        self.norm_reward = norm_reward
        self.num_threads = None if num_threads is None else check_threads(num_threads)
        self.random = np.random.default_rng(seed)
        self.scale = Scale(gamma)
        self.moments: Floats | None = None  # moments of the gradient, for Adam
        super().__init__(
            policy,
            env,
            learning_rate,
            n_steps,
            gamma,
            gae_lambda,
            ent_coef,
            vf_coef,
            max_grad_norm,
            use_sde=False,
            sde_sample_freq=-1,
            policy_kwargs=kwargs,
            seed=seed,
            device="cpu",
            _init_setup_model=_init_setup_model,
            supported_action_spaces=(spaces.Box,),
        )

    def _setup_model(self) -> None:
        super()._setup_model()
        self.weights = Weights.of(self.policy)
        self.gradient = Gradient(self)
        if self.moments is None:  # else it was loaded
            self.moments = np.zeros((2, self.weights.vector.size), np.float32)

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "weights", "gradient"]

    def _setup_learn(self, total_timesteps: int, callback: Any = None, *args: Any, **kwargs: Any) -> Any:
        before = self._last_obs
        setup = super()._setup_learn(total_timesteps, callback, *args, **kwargs)
        if self._last_obs is not before:  # the environments were reset
            self.scale.restart()
        return setup

    def collect_rollouts(
        self, env: Any, callback: BaseCallback, rollout_buffer: Any, n_rollout_steps: int
    ) -> bool:
        """Play `n_rollout_steps` steps from the last observation and fill the buffer; return False if the
        callback ends the training."""
        box = self.action_space
        weights = self.weights
        buffer = rollout_buffer
        assert isinstance(box, spaces.Box)
        buffer.reset()
        callback.on_rollout_start()
        ended = np.zeros(buffer.rewards.shape, bool)
        cut_off = []  # episodes cut off by a time limit: step, environment and its last observation
        # All of a rollout at once, which is one call instead of one a step
        noise = self.random.standard_normal(buffer.actions.shape, np.float32)
        buffer.log_probs[:] = -0.5 * np.square(noise).sum(-1) - weights.log_std.sum()
        noise *= np.exp(weights.log_std)
        for t in range(n_rollout_steps):
            buffer.observations[t] = self._last_obs
            buffer.episode_starts[t] = self._last_episode_starts
            np.add(weights.actor(flat(buffer.observations[t])), noise[t], out=buffer.actions[t])
            # A sample outside the box is played at its edge, but learnt from as it was drawn
            clipped_actions = np.clip(buffer.actions[t].reshape(-1, *box.shape), box.low, box.high)
            new_obs, rewards, dones, infos = env.step(clipped_actions)
            self._last_obs = new_obs
            self._last_episode_starts = dones
            buffer.rewards[t] = rewards
            ended[t] = dones
            self.num_timesteps += env.num_envs
            callback.update_locals(locals())
            if not callback.on_step():
                return False
            self._update_info_buffer(infos, dones)
            cut_off += [
                (t, k, infos[k]["terminal_observation"])
                for k in np.flatnonzero(dones).tolist()
                if infos[k].get("TimeLimit.truncated", False)
            ]
        critic = weights.critic
        if self.norm_reward:
            scale = self.scale.after(buffer.rewards, ended)
            buffer.rewards[:] = np.clip(buffer.rewards / scale, -LARGEST, LARGEST)
        if cut_off:
            # Bootstrap of episodes that a time limit cut off, as Stable-Baselines3 does it
            times, envs, last = zip(*cut_off, strict=True)
            buffer.rewards[[*times], [*envs]] += np.float32(self.gamma) * critic(flat(np.array(last)))[:, 0]
        # All at once, after the rollout: a call for each step would cost more than its product
        buffer.values[:] = critic(flat(buffer.observations, 2))[..., 0]
        buffer.compute_returns_and_advantage(torch.from_numpy(critic(flat(new_obs))), dones)
        callback.update_locals(locals())
        callback.on_rollout_end()
        return True

    def train(self) -> None:
        """Take steps of Adam on shuffled batches."""
        buffer = self.rollout_buffer
        progress = self._current_progress_remaining
        columns = (buffer.log_probs, buffer.advantages, buffer.returns)
        steps = np.concatenate([*(column[..., None] for column in columns), buffer.actions], 2)
        steps = steps.reshape(-1, steps.shape[-1])
        observations = buffer.observations.reshape(len(steps), -1)
        rate = self.lr_schedule(progress)
        clip_range = self.clip_range(progress) if callable(self.clip_range) else self.clip_range
        losses = []
        for _ in range(self.n_epochs):
            for chosen in self.batches(len(steps)):
                losses.append(self.gradient.compute(observations, steps, chosen, clip_range))
                self.descend(self.gradient.vector, rate)
        policy_loss, value_loss = np.mean(losses, 0)
        self.logger.record("train/policy_gradient_loss", float(policy_loss))
        self.logger.record("train/value_loss", float(value_loss))
        self.logger.record("train/std", float(np.exp(self.weights.log_std).mean()))
        self.logger.record("train/learning_rate", rate)

    def batches(self, count: int) -> Iterator[NDArray[np.int64]]:
        """Yield all of `count` steps in a random order, `batch_size` at a time."""
        order = self.random.permutation(count)
        for begin in range(0, count, self.batch_size):
            if count - begin > 1:  # advantages are normalised over a batch
                yield order[begin : begin + self.batch_size]

    def descend(self, gradient: Floats, rate: float) -> None:
        """Take a step of Adam (Kingma & Ba 2015), the gradient scaled down to `max_grad_norm`."""
        # As torch's clip_grad_norm_
        gradient *= min(1.0, self.max_grad_norm / (float(np.linalg.norm(gradient)) + 1e-6))
        self._n_updates += 1
        assert self.moments is not None
        mean, square = self.moments
        mean += (1 - BETA1) * (gradient - mean)
        square += (1 - BETA2) * (gradient * gradient - square)
        size = rate / (1 - BETA1**self._n_updates)
        spread = np.sqrt(square / (1 - BETA2**self._n_updates)) + EPSILON
        self.weights.vector[:] -= np.float32(size) * mean / spread


class Gradient:
    """Gradient of the loss over a batch; its arrays stay from one to the next.

    Attributes:
        vector: the gradient, in the order of the weights' vector.
    """

    def __init__(self, model: FlatPPO) -> None:
        self.model = model
        self.parts: dict[tuple[int, int], Part] = {}  # by chunk and its size

    def compute(
        self, observations: Floats, steps: Floats, chosen: NDArray[np.int64], clip_range: float
    ) -> tuple[float, ...]:
        """Compute the gradient for the chosen rows; return the losses of policy and value."""
        model = self.model
        count = len(chosen)
        advantages = steps[chosen, ADVANTAGE]
        mean = np.add.reduce(advantages) / count
        advantages -= mean
        deviation = np.sqrt(np.dot(advantages, advantages) / (count - 1)) + 1e-8
        numbers = (clip_range, model.vf_coef, model.ent_coef, mean, deviation)
        loss = Loss(count, *map(float, numbers))
        # The number of chunks depends on the batch alone, never on threads
        number = -(-count // CHUNK)
        ends = [count * k // number for k in range(number + 1)]
        parts = [self.part(k, end - begin) for k, (begin, end) in enumerate(pairwise(ends))]
        calls = [
            (part, observations, steps, chosen[begin:end], loss)
            for part, (begin, end) in zip(parts, pairwise(ends), strict=True)
        ]
        threads = limit_threads(model.num_threads or torch.get_num_threads())
        run_together(Part.compute, calls, threads)
        # In the order of the chunks, whichever thread was first: the same bits on any number of threads
        self.vector = parts[0].vector
        for part in parts[1:]:
            self.vector += part.vector
        return tuple(map(sum, zip(*(part.losses for part in parts), strict=True)))

    def part(self, number: int, rows: int) -> Part:
        """Return the room for a chunk of a batch."""
        if (number, rows) not in self.parts:
            self.parts[number, rows] = Part(self.model.policy, self.model.weights, rows)
        return self.parts[number, rows]
