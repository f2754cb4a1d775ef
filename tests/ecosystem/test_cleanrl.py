"""CleanRL's scripts ported to Gymnasium 1: their stack of wrappers, and what they read of `infos`."""

from __future__ import annotations

from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from alone import alone, skip_unless_native

SECONDS = 0.2
"""Of an episode: ten steps."""
MODE = gym.vector.AutoresetMode.SAME_STEP
"""In which a ported script is the old one line by line."""
ROWS = 2


def make_env(env_id):
    """`make_env` of ppo_continuous_action.py."""
    env = gym.make(env_id, episode_seconds=SECONDS)
    env = gym.wrappers.FlattenObservation(env)
    env = gym.wrappers.RecordEpisodeStatistics(env)
    env = gym.wrappers.ClipAction(env)
    env = gym.wrappers.NormalizeObservation(env)
    clipped = gym.spaces.Box(-10.0, 10.0, env.observation_space.shape, np.float32)
    env = gym.wrappers.TransformObservation(env, lambda observation: np.clip(observation, -10, 10), clipped)
    env = gym.wrappers.NormalizeReward(env, gamma=0.99)
    return gym.wrappers.TransformReward(env, lambda reward: np.clip(reward, -10, 10))


def ends(env_id, row, actions):
    """Last observations and returns of an environment's episodes under clipped actions (steps, 4)."""
    env = gym.make(env_id, episode_seconds=SECONDS)
    last, returns, total = [], [], 0.0
    for _, observation, reward, terminated, truncated in alone(env, actions.clip(-1, 1), seed=1 + row):
        total += reward
        if terminated or truncated:
            last.append(observation)
            returns.append(total)
            total = 0.0
    return last, returns


def test_ppo(env_id):
    """`ppo_continuous_action.py`: wrappers in a `SyncVectorEnv`, the update, returns from `final_info`."""
    torch = pytest.importorskip("torch")
    torch.manual_seed(0)
    envs = gym.vector.SyncVectorEnv([partial(make_env, env_id)] * ROWS, autoreset_mode=MODE)
    n, k = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
    critic, actor = torch.nn.Linear(n, 1), torch.nn.Linear(n, k)
    log_std = torch.nn.Parameter(torch.zeros(k))
    parameters = [*actor.parameters(), *critic.parameters(), log_std]
    before = [parameter.detach().clone() for parameter in parameters]
    optimizer = torch.optim.Adam(parameters, lr=1e-3, eps=1e-5)
    taken, returns = [], [[], []]
    next_obs, next_done = torch.tensor(envs.reset(seed=1)[0], dtype=torch.float32), torch.zeros(ROWS)
    for _ in range(2):
        rollout = []
        for _ in range(32):
            with torch.no_grad():
                policy = torch.distributions.Normal(actor(next_obs), log_std.exp())
                action, value = policy.sample(), critic(next_obs).flatten()
            taken.append(action.numpy())
            observation, reward, terminated, truncated, infos = envs.step(action.numpy())
            kept = (next_obs, action, policy.log_prob(action).sum(1), value, next_done)
            rollout.append((*kept, torch.tensor(reward, dtype=torch.float32)))
            next_obs = torch.tensor(observation, dtype=torch.float32)
            next_done = torch.tensor(terminated | truncated, dtype=torch.float32)
            if "final_info" in infos:
                for row in np.flatnonzero(infos["_final_info"]):
                    returns[row].append(infos["final_info"]["episode"]["r"][row])
        obs, actions, logprobs, values, dones, rewards = map(torch.stack, zip(*rollout, strict=True))
        with torch.no_grad():
            advantages, following, last = torch.zeros_like(rewards), critic(next_obs).flatten(), 0.0
            for t in reversed(range(32)):
                live = 1.0 - (dones[t + 1] if t < 31 else next_done)
                delta = rewards[t] + 0.99 * following * live - values[t]
                advantages[t] = last = delta + 0.99 * 0.95 * live * last
                following = values[t]
        for _ in range(2):
            policy = torch.distributions.Normal(actor(obs), log_std.exp())
            ratio = (policy.log_prob(actions).sum(2) - logprobs).exp()
            gain = torch.min(advantages * ratio, advantages * ratio.clamp(0.8, 1.2)).mean()
            error = (critic(obs).squeeze(2) - advantages - values).square().mean()
            optimizer.zero_grad()
            (0.5 * error - gain).backward()
            optimizer.step()
    envs.close()
    assert all(torch.isfinite(parameter).all() for parameter in parameters)
    assert all(not torch.equal(*pair) for pair in zip(before, parameters, strict=True))
    for row in range(ROWS):
        assert returns[row] == pytest.approx(ends(env_id, row, np.array(taken)[:, row])[1])
        assert len(returns[row]) >= 6


@pytest.mark.parametrize("kind", ["sync", "native"])
def test_final_obs(env_id, kind):
    """`sac_continuous_action.py`: `real_next_obs` from `final_obs`, sync and native."""
    if kind == "sync":
        make = partial(gym.make, env_id, episode_seconds=SECONDS)
        envs = gym.vector.SyncVectorEnv([make] * ROWS, autoreset_mode=MODE)
    else:
        skip_unless_native(env_id)
        settings = {"vectorization_mode": "vector_entry_point", "episode_seconds": SECONDS}
        envs = gym.make_vec(env_id, num_envs=ROWS, autoreset_mode=MODE, **settings)
    envs = gym.wrappers.vector.RecordEpisodeStatistics(envs)
    envs.reset(seed=1)
    envs.action_space.seed(0)
    taken, last, returns = [], [[], []], [[], []]
    for _ in range(45):
        taken.append(envs.action_space.sample())
        next_obs, _, terminated, truncated, infos = envs.step(taken[-1])
        real_next_obs = next_obs.copy()
        for row in np.flatnonzero(terminated | truncated):
            real_next_obs[row] = infos["final_obs"][row]
            last[row].append(real_next_obs[row])
            returns[row].append(infos["episode"]["r"][row])
            assert not np.array_equal(real_next_obs[row], next_obs[row])
    envs.close()
    for row in range(ROWS):
        observations, sums = ends(env_id, row, np.array(taken)[:, row])
        np.testing.assert_array_equal(last[row], observations)
        assert returns[row] == pytest.approx(sums)
        assert len(sums) >= 4
