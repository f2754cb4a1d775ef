"""Signal and noise of the first policy gradient of PPO: how many rollouts a learner needs to see which way to
go.

An untrained policy plays Gaussian noise of deviation 1. The gradient of each environment's episodes with
respect to linear feedback, all observations times all actions, is a sample; the mean of all samples has the
signal, and their scatter, for a rollout of 2048 steps, the noise. Advantages are generalised ones with the
constants of Stable-Baselines3's PPO, and the value function is a linear fit to the returns. As terms of the
reward are recorded one by one, one recording says the ratio for any weights.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from agents.side_by_side import DEFAULTS, advantages_of
from hoof_env.errors import ParameterError, count

Floats = NDArray[Any]

FITS = 3  # fits of the value function; each takes the values after a cut from the last one
SEED = 50_000  # first seed of the environments
RIDGE = 1e-2  # added to the squares of the fit, which constant entries would make singular


@dataclass(frozen=True)
class Recording:
    """What an untrained policy met.

    Attributes:
        observations: of each step and after the last one, shape (T + 1, n, k).
        noise: standard normal numbers, which are the actions before they are clipped, shape (T, n, m).
        terms: of the reward, with a weight of 1, by name, shape (T, n) each.
        ended, failed: True where an episode ended, and where it ended by a failure, shape (T, n).
    """

    observations: Floats
    noise: Floats
    terms: Mapping[str, Floats]
    ended: NDArray[np.bool_]
    failed: NDArray[np.bool_]


def record(env_id: str, rows: int, steps: int, sample: int = 0, **env_kwargs: Any) -> Recording:
    """Play noise in many environments.

    Args:
        env_id: id of this package.
        rows, steps: environments, and steps of each.
        sample: number of the recording; others have other noise and starts.
        **env_kwargs: arguments of the environment.

    Raises:
        ParameterError: a count below 2 or 1, or an argument that the environment refuses.
    """
    n = count("rows", rows, low=2)
    envs: Any = gym.make_vec(
        env_id, n, "vector_entry_point", autoreset_mode="SAME_STEP", **env_kwargs
    ).unwrapped
    steps = count("steps", steps)
    random = np.random.default_rng(sample)
    seen, _ = envs.reset(seed=list(range(SEED + sample * n, SEED + (sample + 1) * n)))
    observations = np.empty((steps + 1, *seen.shape), np.float32)
    noise = random.standard_normal((steps, n, envs.single_action_space.shape[0]), np.float32)
    ended, failed = np.empty((2, steps, n), bool)
    names = tuple(envs.weights)
    terms = np.empty((steps, n, len(names)))
    for t in range(steps):
        observations[t] = seen
        seen, _, failed[t], truncated, infos = envs.step(np.clip(noise[t], -1.0, 1.0))
        ended[t] = failed[t] | truncated
        terms[t] = infos["unweighted"]
        if ended[t].any():
            # The row has begun anew; its last step is among the final ones
            terms[t][ended[t]] = np.asarray(infos["final_info"]["unweighted"])[ended[t]]
    observations[-1] = seen
    by_name = dict(zip(names, np.moveaxis(terms, 2, 0), strict=True))
    return Recording(observations, noise, by_name, ended, failed)


def scaled_advantages(recording: Recording, weights: Mapping[str, float]) -> Floats:
    """Return advantages with a mean of 0 and a deviation of 1, shape (T, n), under weights of the terms.

    Raises:
        ParameterError: a weight of an unknown term, or none that is not 0.
    """
    if unknown := sorted(set(weights) - set(recording.terms)):
        raise ParameterError(f"weights: expected terms of {', '.join(recording.terms)}, got {unknown[0]!r}")
    if not any(weights.values()):
        raise ParameterError("weights: expected one that is not 0, got none")
    rewards = sum(weight * recording.terms[name] for name, weight in weights.items())
    advantages = _advantages(recording, np.asarray(rewards))
    scaled: Floats = (advantages - advantages.mean()) / advantages.std()
    return scaled


def signal_to_noise(recording: Recording, weights: Mapping[str, float]) -> float:
    """Return the square of the gradient over the variance of its estimate from one rollout.

    Args:
        recording: of `record`.
        weights: of the terms of the reward by name; 0 of the terms that are left out.

    Raises:
        ParameterError: a weight of an unknown term, or none that is not 0.
    """
    scaled = scaled_advantages(recording, weights)
    steps, n, _ = recording.noise.shape
    seen = recording.observations[:-1]
    seen = np.concatenate([seen, np.ones((steps, n, 1), seen.dtype)], axis=2)
    weighted = (seen * scaled[..., None].astype(np.float32)).swapaxes(0, 1)
    gradients = weighted.swapaxes(1, 2) @ recording.noise.swapaxes(0, 1) / steps
    gradients = gradients.reshape(n, -1).astype(float)
    variance = gradients.var(axis=0, ddof=1).sum()
    # The square of the mean of n samples is too large by their variance over n
    square = (gradients.mean(axis=0) ** 2).sum() - variance / n
    return float(square / (variance * steps / DEFAULTS.n_steps))


@dataclass(frozen=True)
class LinearPolicy:
    """Policy whose actions are linear in the observation.

    Attributes:
        mean: of the observations, shape (k,).
        gain: of each observation and of a constant, shape (k + 1, m).
    """

    mean: Floats
    gain: Floats

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Return actions, shape (n, m), for observations, shape (n, k)."""
        actions = (np.asarray(observation, float) - self.mean) @ self.gain[:-1] + self.gain[-1]
        return np.clip(actions, -1.0, 1.0).astype(np.float32), state


def first_step(
    recording: Recording, weights: Mapping[str, float], size: float, whitened: bool
) -> LinearPolicy:
    """Return the policy one step from the untrained one, along the gradient of all recorded steps.

    Args:
        recording: of `record`.
        weights: of the terms of the reward by name.
        size: root mean square of the actions of the step.
        whitened: True for the gradient with respect to observations that are uncorrelated and of one size,
            the natural gradient; False for observations as they are.

    Raises:
        ParameterError: a weight of an unknown term, or none that is not 0.
    """
    scaled = scaled_advantages(recording, weights)
    steps, n, m = recording.noise.shape
    seen = recording.observations[:-1].reshape(steps * n, -1).astype(float)
    mean = seen.mean(axis=0)
    features = np.concatenate([seen - mean, np.ones((len(seen), 1))], axis=1)
    gain = features.T @ (scaled.reshape(-1, 1) * recording.noise.reshape(-1, m)) / len(seen)
    if whitened:
        squares = features.T @ features / len(seen)
        gain = np.linalg.solve(squares + RIDGE * np.eye(len(squares)), gain)
    return LinearPolicy(mean, gain * size / np.sqrt(((features @ gain) ** 2).mean()))


def _advantages(recording: Recording, rewards: Floats) -> Floats:
    """Return advantages with a value function that is linear in the observation and its squares, shape
    (T, n)."""
    gamma = DEFAULTS.gamma
    seen = recording.observations.astype(float)
    features = np.concatenate([seen, seen * seen, np.ones((*seen.shape[:2], 1))], axis=2)
    flat = features[:-1].reshape(-1, features.shape[2])
    squares = flat.T @ flat + RIDGE * np.eye(features.shape[2])
    fit = np.zeros(features.shape[2])
    cut = recording.ended & ~recording.failed
    for _ in range(FITS):
        values = features @ fit
        returns = np.empty_like(rewards)
        after = values[-1]
        for t in reversed(range(len(rewards))):
            # The state after a cut is not kept; that before it is worth as much
            after = np.where(recording.ended[t], cut[t] * values[t], after)
            after = rewards[t] + gamma * after
            returns[t] = after
        fit = np.linalg.solve(squares, flat.T @ returns.ravel())
    values = features @ fit
    bootstrapped = rewards + gamma * cut * values[:-1]
    return advantages_of(bootstrapped, values, recording.ended, gamma, DEFAULTS.gae_lambda)
