"""Proximal policy optimisation (PPO) in one file, for small networks and fast environments.

    python -m agents.train --algo ppo_flat
    python -m agents.train --algo ppo_flat --env-id hoof_env/HorseLegFixed-v0 --steps 100000

Read `learn` first: it plays a rollout, estimates what its actions were worth, improves the networks. The
algorithm is that of Stable-Baselines3's PPO with networks of tanh; policy, files and callbacks are that
library's, so whatever works with one works with the other. What takes time is written out: the gradient of
such networks is a dozen products of small matrices, and torch spends more time between them than in them.

The networks' weights are one vector, `weights`; those of the library's policy are views of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn

from hoof_env.errors import ParameterError
from hoof_env.simd.compile import inlined, kernel
from hoof_env.simd.threads import check_threads, run_together

Floats = NDArray[np.float32]

CHUNK = 1000
"""Steps of a batch whose gradient is computed at once, by one thread: their numbers stay in the cache. The
gradients are added up in order, so any number of threads gives the same bits."""

BETA1, BETA2, EPSILON = 0.9, 0.999, 1e-5  # of Adam

LARGEST = np.float32(10.0)
"""Reward after `Scale`, as in Stable-Baselines3: one failure in a rollout is not to hide all else."""

LOG_PROB, ADVANTAGE, TARGET, ACTIONS = 0, 1, 2, 3
"""Columns of what is learnt from, with the actions from the last one on."""

ZERO, HALF, ONE = (np.float32(number) for number in (0.0, 0.5, 1.0))
C0, A1, A2, A3 = (np.float32(number) for number in (34459425, 4729725, 135135, 990))
B1, B2, B3, B4 = (np.float32(number) for number in (16216200, 945945, 13860, 45))


# Networks, perceptrons with tanh: matrices, shape (outputs, inputs) each, and biases


@inlined
def tanh(x):  # type: ignore[no-untyped-def]
    """Lambert's continued fraction, the first nine terms, within 8e-6: without a call, so that the compiler
    does many at once."""
    s = x * x
    above = x * (C0 + s * (A1 + s * (A2 + s * (A3 + s))))
    y = above / (C0 + s * (B1 + s * (B2 + s * (B3 + s * B4))))
    return min(max(y, -ONE), ONE)


@inlined
def forward(x, matrices, biases, outputs):  # type: ignore[no-untyped-def]
    """What each layer gives for rows of inputs, the hidden ones behind a tanh."""
    for k in range(len(matrices)):
        y, bias = outputs[k], biases[k]
        np.dot(x if k == 0 else outputs[k - 1], matrices[k].T, y)
        if k < len(matrices) - 1:
            for i in range(y.shape[0]):
                for j in range(y.shape[1]):
                    y[i, j] = tanh(y[i, j] + bias[j])
        else:
            for i in range(y.shape[0]):
                for j in range(y.shape[1]):
                    y[i, j] += bias[j]


@inlined
def backward(x, matrices, outputs, slopes, by_matrices, by_biases):  # type: ignore[no-untyped-def]
    """The derivatives by matrices and biases from those by the last outputs, in the last of `slopes`; the
    others are room for those by the hidden layers."""
    for k in range(len(matrices) - 1, -1, -1):
        slope, by_bias = slopes[k], by_biases[k]
        if k < len(matrices) - 1:
            np.dot(slopes[k + 1], matrices[k + 1], slope)
            y = outputs[k]
            for i in range(slope.shape[0]):
                for j in range(slope.shape[1]):
                    slope[i, j] *= ONE - y[i, j] * y[i, j]
        by_bias[:] = ZERO
        for i in range(slope.shape[0]):
            for j in range(slope.shape[1]):
                by_bias[j] += slope[i, j]
        np.dot(slope.T, x if k == 0 else outputs[k - 1], by_matrices[k])


@inlined
def loss_of(  # type: ignore[no-untyped-def]
    means, values, log_std, steps, clip_range, vf_coef, count, by_means, by_values, by_log_std, losses
):  # fmt: skip
    """The loss of Schulman et al. 2017 (Eq. 9 without the entropy) of some of `count` steps, and its
    derivatives. The columns of `steps` are as `LOG_PROB` and so on say."""
    by_log_std[:], losses[:] = ZERO, ZERO
    for i in range(len(steps)):
        log_prob = ZERO
        for k in range(ACTIONS, steps.shape[1]):
            z = (steps[i, k] - means[i, k - ACTIONS]) * np.exp(-log_std[k - ACTIONS])
            log_prob -= HALF * z * z + log_std[k - ACTIONS]
        ratio, advantage = np.exp(log_prob - steps[i, LOG_PROB]), steps[i, ADVANTAGE]
        held = min(max(ratio, ONE - clip_range), ONE + clip_range)
        losses[0] -= min(ratio * advantage, held * advantage) / count
        weight = -ratio * advantage / count if ratio * advantage <= held * advantage else ZERO
        for k in range(len(log_std)):
            z = (steps[i, ACTIONS + k] - means[i, k]) * np.exp(-log_std[k])
            by_means[i, k] = weight * z * np.exp(-log_std[k])
            by_log_std[k] += weight * (z * z - ONE)
        error = values[i, 0] - steps[i, TARGET]
        losses[1] += error * error / count
        by_values[i, 0] = (vf_coef + vf_coef) * error / count


def gradient_of(  # type: ignore[no-untyped-def]
    observations, steps, rows, scale, x, own, actor, critic, log_std, clip_range, vf_coef, count, losses
):
    """The loss of these rows, some of the `count` of a batch, and its derivatives, into the rooms of `actor`
    and `critic`: tuples of matrices, biases, outputs, slopes, and derivatives by matrices and biases.
    Advantages are normalised by `scale`, their mean and deviation."""
    for i in range(len(rows)):
        x[i] = observations[rows[i]]
        own[i] = steps[rows[i]]
        own[i, ADVANTAGE] = (own[i, ADVANTAGE] - scale[0]) / scale[1]
    forward(x, actor[0], actor[1], actor[2])
    forward(x, critic[0], critic[1], critic[2])
    loss_of(
        actor[2][-1], critic[2][-1], log_std[0], own, clip_range, vf_coef, count,
        actor[3][-1], critic[3][-1], log_std[1], losses,
    )  # fmt: skip
    backward(x, actor[0], actor[2], actor[3], actor[4], actor[5])
    backward(x, critic[0], critic[2], critic[3], critic[4], critic[5])


def outputs_of(x, matrices, biases, outputs):  # type: ignore[no-untyped-def]
    """As `forward`."""
    forward(x, matrices, biases, outputs)


compiled_gradient: Any = kernel(gradient_of, threads=True)
compiled_outputs: Any = kernel(outputs_of)


@dataclass(frozen=True)
class Network:
    """Matrices and biases of a perceptron with tanh, views of a vector."""

    matrices: tuple[Floats, ...]
    biases: tuple[Floats, ...]

    def room(self, rows: int) -> tuple[Floats, ...]:
        """For what each layer gives."""
        return tuple(np.zeros((rows, len(bias)), np.float32) for bias in self.biases)

    def __call__(self, x: Floats) -> Floats:
        """Outputs for rows of inputs, shape (..., inputs)."""
        rows, outputs = x.reshape(-1, x.shape[-1]), []
        for begin in range(0, len(rows), CHUNK):
            part = rows[begin : begin + CHUNK]
            room = self.room(len(part))
            compiled_outputs(part, self.matrices, self.biases, room)
            outputs.append(room[-1])
        return np.concatenate(outputs).reshape(*x.shape[:-1], -1)


@dataclass(frozen=True)
class Weights:
    """All weights, or what there is one of for each, as one vector, and by name as views of it."""

    vector: Floats
    actor: Network
    critic: Network
    log_std: Floats

    @classmethod
    def like(cls, policy: Any) -> Weights:
        """Zeros in the form of a policy's parameters."""
        named = dict(policy.named_parameters())
        ends = np.cumsum([one.numel() for one in named.values()])
        vector = np.zeros(ends[-1], np.float32)
        parts = {
            name: part.reshape(tuple(one.shape))
            for (name, one), part in zip(named.items(), np.split(vector, ends[:-1]), strict=True)
        }

        def network(hidden: str, last: str) -> Network:
            layers = [name.removesuffix(".bias") for name in parts if name.startswith(hidden)]
            layers = [layer for layer in layers if not layer.endswith("weight")] + [last]
            return Network(
                tuple(parts[f"{layer}.weight"] for layer in layers),
                tuple(parts[f"{layer}.bias"] for layer in layers),
            )

        actor = network("mlp_extractor.policy_net.", "action_net")
        return cls(vector, actor, network("mlp_extractor.value_net.", "value_net"), parts["log_std"])

    @classmethod
    def shared(cls, policy: Any) -> Weights:
        """Those of a policy, whose parameters are views of the vector from now on."""
        weights, begin = cls.like(policy), 0
        for parameter in policy.parameters():
            part = weights.vector[begin : begin + parameter.numel()].reshape(tuple(parameter.shape))
            part[:] = parameter.detach().numpy()
            parameter.data = torch.from_numpy(part)
            begin += parameter.numel()
        return weights


# Experience


def estimate_advantages(
    rewards: Floats, values: Floats, ended: NDArray[np.bool_], gamma: float, gae_lambda: float
) -> Floats:
    """Generalised advantage estimation (Schulman et al. 2016), shape (T, n), of T steps of n environments.
    `values`, shape (T + 1, n), are of the observations before each step and after the last. What comes after
    a step that `ended` an episode is another one; what a time limit cut off is in that step's reward."""
    goes_on = (~ended).astype(np.float32)
    surprises = rewards + np.float32(gamma) * values[1:] * goes_on - values[:-1]
    advantages, later = np.empty_like(rewards), np.zeros_like(rewards[0])
    for t in reversed(range(len(rewards))):
        later = surprises[t] + np.float32(gamma * gae_lambda) * goes_on[t] * later
        advantages[t] = later
    return advantages


class Scale:
    """The standard deviation of discounted returns so far, from the first step of an episode to each."""

    def __init__(self, gamma: float) -> None:
        self.gamma, self.returns = gamma, np.float32(0.0)
        self.count, self.mean, self.square = 1e-4, 0.0, 1.0

    def after(self, rewards: Floats, ended: NDArray[np.bool_]) -> np.float32:
        """The scale when these steps are counted, too, shape (T, n) both."""
        returns, goes_on = np.empty_like(rewards), np.float32(self.gamma) * ~ended
        for t in range(len(rewards)):
            returns[t] = self.returns + rewards[t]
            self.returns = goes_on[t] * returns[t]
        count, mean = self.count + returns.size, float(returns.mean(dtype=np.float64))
        gap, own = mean - self.mean, float(returns.var(dtype=np.float64))
        between = gap**2 * self.count * returns.size / count
        self.square = (self.square * self.count + own * returns.size + between) / count
        self.mean, self.count = self.mean + gap * returns.size / count, count
        return np.float32(np.sqrt(self.square + 1e-8))


@dataclass
class Rollout:
    """Steps of all environments, shape (T, n, ...); observations have one row more. `cut_off` are steps that
    a time limit ended, as (t, environment), with the last observation of the episode."""

    observations: Floats
    actions: Floats
    log_probs: Floats
    rewards: Floats
    ended: NDArray[np.bool_]
    cut_off: list[tuple[int, int, Floats]] = field(default_factory=list)

    @classmethod
    def room(cls, steps: int, envs: int, entries: int, actions: int) -> Rollout:
        """For so many steps."""
        return cls(
            np.zeros((steps + 1, envs, entries), np.float32), np.zeros((steps, envs, actions), np.float32),
            np.zeros((steps, envs), np.float32), np.zeros((steps, envs), np.float32),
            np.zeros((steps, envs), bool),
        )  # fmt: skip


class FlatPPO(BaseAlgorithm):
    """PPO; arguments as those of Stable-Baselines3's, which its policies are loaded as.

    Args:
        norm_reward: divide rewards by a `Scale`.
        num_threads: threads that compute gradients; None is as many as torch may use.

    Raises:
        ParameterError: another policy than perceptrons with tanh, or another device than the CPU.
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
        clip_range: float = 0.2,
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
        if batch_size < 2:
            raise ParameterError(f"batch_size: expected 2 or more, for its advantages, got {batch_size!r}")
        super().__init__(
            policy, env, learning_rate, kwargs, seed=seed, device="cpu", support_multi_env=True,
            supported_action_spaces=(spaces.Box,),
        )  # fmt: skip
        self.n_steps, self.batch_size, self.n_epochs = n_steps, batch_size, n_epochs
        self.gamma, self.gae_lambda, self.clip_range = gamma, gae_lambda, clip_range
        self.ent_coef, self.vf_coef, self.max_grad_norm = ent_coef, vf_coef, max_grad_norm
        self.norm_reward = norm_reward
        self.num_threads = None if num_threads is None else check_threads(num_threads)
        self.random, self.scale = np.random.default_rng(seed), Scale(gamma)
        self.moments: Floats | None = None  # of the gradient, for Adam
        if _init_setup_model:
            self._setup_model()

    def _setup_model(self) -> None:
        self._setup_lr_schedule()
        self.set_random_seed(self.seed)
        self.policy = self.policy_class(
            self.observation_space, self.action_space, self.lr_schedule, **self.policy_kwargs
        )
        self.weights = Weights.shared(self.policy)
        numbers = Weights.like(self.policy)
        numbers.log_std[:] = 1.0
        self.places = np.flatnonzero(numbers.vector)  # of log_std
        if self.moments is None:  # else it was loaded
            self.moments = np.zeros((2, self.weights.vector.size), np.float32)

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "weights", "places"]

    def _get_torch_save_params(self) -> tuple[list[str], list[str]]:
        return ["policy"], []

    def learn(
        self,
        total_timesteps: int,
        callback: Any = None,
        log_interval: int = 1,
        tb_log_name: str = "ppo_flat",
        reset_num_timesteps: bool = True,
        progress_bar: bool = False,
    ) -> FlatPPO:
        """Train for so many more steps. A callback is told of every step, and of every rollout."""
        total, told = self._setup_learn(
            total_timesteps, callback, reset_num_timesteps, tb_log_name, progress_bar
        )
        told.on_training_start(locals(), globals())
        while self.num_timesteps < total:
            told.on_rollout_start()
            rollout = self.play(told)
            if rollout is None:
                break
            told.on_rollout_end()
            self._update_current_progress_remaining(self.num_timesteps, total)
            self.log()
            self.improve(*self.experience(rollout))
        told.on_training_end()
        return self

    def play(self, callback: BaseCallback) -> Rollout | None:
        """Go on from the last observation for `n_steps`; None where the callback ends the training."""
        envs, box, weights = self.env, self.action_space, self.weights
        assert envs is not None
        assert isinstance(box, spaces.Box)
        entries, actions = (int(np.prod(space.shape or ())) for space in (self.observation_space, box))
        rollout = Rollout.room(self.n_steps, envs.num_envs, entries, actions)
        noise = self.random.standard_normal(rollout.actions.shape, np.float32)
        rollout.log_probs[:] = -0.5 * np.square(noise).sum(-1) - weights.log_std.sum()
        noise *= np.exp(weights.log_std)
        seen: Any = self._last_obs
        for t in range(self.n_steps):
            rollout.observations[t] = seen
            np.add(weights.actor(rollout.observations[t]), noise[t], out=rollout.actions[t])
            # A sample outside the box is played at its edge, but learnt from as it was drawn
            played = np.clip(rollout.actions[t], box.low, box.high)
            seen, rollout.rewards[t], dones, infos = envs.step(played)
            rollout.ended[t] = dones
            self.num_timesteps += envs.num_envs
            callback.update_locals(locals())
            if not callback.on_step():
                return None
            self._update_info_buffer(infos, dones)
            for env in np.flatnonzero(dones).tolist():
                if infos[env].get("TimeLimit.truncated", False):
                    rollout.cut_off.append((t, env, infos[env]["terminal_observation"]))
        rollout.observations[-1] = self._last_obs = seen
        return rollout

    def experience(self, rollout: Rollout) -> tuple[Floats, Floats]:
        """What is learnt from, in one row for each step: observations, and log probabilities, advantages,
        targets of the value and actions."""
        critic = self.weights.critic
        values, rewards = critic(rollout.observations)[..., 0], rollout.rewards
        if self.norm_reward:
            rewards = np.clip(rewards / self.scale.after(rewards, rollout.ended), -LARGEST, LARGEST)
        if rollout.cut_off:
            times, envs, last = zip(*rollout.cut_off, strict=True)
            rewards[[*times], [*envs]] += np.float32(self.gamma) * critic(np.array(last))[:, 0]
        advantages = estimate_advantages(rewards, values, rollout.ended, self.gamma, self.gae_lambda)
        columns = rollout.log_probs, advantages, advantages + values[:-1]
        steps = np.concatenate([*(one[..., None] for one in columns), rollout.actions], 2)
        observations = rollout.observations[:-1]
        return observations.reshape(-1, observations.shape[-1]), steps.reshape(-1, steps.shape[-1])

    def improve(self, observations: Floats, steps: Floats) -> None:
        """Steps of Adam on shuffled batches."""
        rate = self.lr_schedule(self._current_progress_remaining)
        gradient, losses = Gradient(self), []
        for _ in range(self.n_epochs):
            for chosen in self.batches(len(steps)):
                losses.append(gradient.compute(observations, steps, chosen))
                self.descend(gradient.vector, rate)
        policy_loss, value_loss = np.mean(losses, 0)
        self.logger.record("train/policy_gradient_loss", float(policy_loss))
        self.logger.record("train/value_loss", float(value_loss))
        self.logger.record("train/std", float(np.exp(self.weights.log_std).mean()))
        self.logger.record("train/learning_rate", rate)

    def batches(self, count: int) -> Iterator[NDArray[np.int64]]:
        """All of `count` steps in a random order, `batch_size` at a time."""
        order = self.random.permutation(count)
        for begin in range(0, count, self.batch_size):
            if count - begin > 1:  # advantages are normalised over a batch
                yield order[begin : begin + self.batch_size]

    def descend(self, gradient: Floats, rate: float) -> None:
        """A step of Adam (Kingma & Ba 2015), the gradient scaled down to `max_grad_norm`."""
        gradient *= min(1.0, self.max_grad_norm / (float(np.linalg.norm(gradient)) + 1e-6))
        self._n_updates += 1
        assert self.moments is not None
        mean, square = self.moments
        mean += (1 - BETA1) * (gradient - mean)
        square += (1 - BETA2) * (gradient * gradient - square)
        size = rate / (1 - BETA1**self._n_updates)
        spread = np.sqrt(square / (1 - BETA2**self._n_updates)) + EPSILON
        self.weights.vector[:] -= np.float32(size) * mean / spread

    def log(self) -> None:
        """Write what was recorded since the last rollout."""
        if self.ep_info_buffer:
            for name, key in (("rew", "r"), ("len", "l")):
                mean = float(np.mean([episode[key] for episode in self.ep_info_buffer]))
                self.logger.record(f"rollout/ep_{name}_mean", mean)
        self.logger.dump(self.num_timesteps)


class Gradient:
    """The gradient of the loss over a batch, `vector`."""

    def __init__(self, model: FlatPPO) -> None:
        self.model = model
        self.parts: dict[tuple[int, int], tuple[Any, ...]] = {}  # rooms, by chunk and its size

    def compute(self, observations: Floats, steps: Floats, chosen: NDArray[np.int64]) -> Floats:
        """Compute it for the chosen rows; returns the losses of policy and value."""
        model, log_std = self.model, self.model.weights.log_std
        advantages = steps[chosen, ADVANTAGE]
        scale = np.array([advantages.mean(), advantages.std(ddof=1) + 1e-8], np.float32)
        constants = (np.float32(one) for one in (model.clip_range, model.vf_coef, len(chosen)))
        clip_range, vf_coef, count = constants
        chunks = [chosen[begin : begin + CHUNK] for begin in range(0, len(chosen), CHUNK)]
        parts = [self.part(k, len(rows)) for k, rows in enumerate(chunks)]

        calls = [
            (
                observations, steps, rows, scale, *room, (log_std, own.log_std), clip_range, vf_coef, count,
                losses,
            )
            for rows, (own, room, losses) in zip(chunks, parts, strict=True)
        ]  # fmt: skip
        run_together(compiled_gradient, calls, model.num_threads or torch.get_num_threads())
        self.vector = np.sum([own.vector for own, _, _ in parts], 0)
        self.vector[model.places] -= np.float32(model.ent_coef)  # of the entropy, the sum of log_std and more
        return np.sum([losses for *_, losses in parts], 0)

    def part(self, number: int, rows: int) -> tuple[Any, ...]:
        """Room for a chunk of a batch: derivatives, what is between, losses."""
        if (number, rows) not in self.parts:
            model, own = self.model, Weights.like(self.model.policy)
            widths = model.weights.actor.matrices[0].shape[1], ACTIONS + model.weights.log_std.size
            room: list[Any] = [np.zeros((rows, width), np.float32) for width in widths]
            room += [
                (net.matrices, net.biases, net.room(rows), net.room(rows), by.matrices, by.biases)
                for net, by in ((model.weights.actor, own.actor), (model.weights.critic, own.critic))
            ]
            self.parts[number, rows] = own, room, np.zeros(2, np.float32)
        return self.parts[number, rows]
