"""PPO under a constraint: PPO's own bits without a multiplier, advantages by their definition, a bandit, and
refusals."""

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import DummyVecEnv

from agents.ppo_lagrangian import LagrangianPPO
from agents.train import Args, train
from hoof_env.errors import ParameterError
from hoof_env.policies.find import find_saved

GAMMA, LAMBDA = 0.9, 0.8
LIMIT = 2.5
USUAL = {
    "n_steps": 32,
    "batch_size": 64,
    "gamma": GAMMA,
    "gae_lambda": LAMBDA,
    "learning_rate": 0.01,
    "seed": 0,
}


class Bandit(gym.Env):
    """Pays the action and charges its square, ten steps long, then cut off by a time limit."""

    observation_space = gym.spaces.Box(-1, 1, (2,), np.float32)
    action_space = gym.spaces.Box(-1, 1, (1,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.left = 10
        return self._seen(), {}

    def _seen(self):
        return np.array([1.0, self.left / 10], np.float32)

    def step(self, action):
        self.left -= 1
        return self._seen(), float(action[0]), False, self.left == 0, {"cost": float(action[0]) ** 2}


def model(kind=LagrangianPPO, **changes):
    kwargs = {"net_arch": [8], "log_std_init": -1.0}
    return kind("MlpPolicy", DummyVecEnv([Bandit] * 4), policy_kwargs=kwargs, **{**USUAL, **changes})


def numbers(one):
    return {name: value.numpy().tobytes() for name, value in one.policy.state_dict().items()}


def test_without_a_multiplier_it_has_the_bits_of_ppo():
    ours = model(first_multiplier=0.0, multiplier_rate=0.0)
    before = numbers(ours)
    ours.learn(512)
    theirs = model(PPO).learn(512)  # made now, as both draw from torch's own generator
    assert ours.multiplier == 0.0
    assert numbers(ours) == numbers(theirs) != before
    charged = model(first_multiplier=0.5, multiplier_rate=0.0).learn(512)
    assert numbers(charged) != numbers(theirs)


def test_advantages_of_reward_and_cost_follow_their_definition():
    """Generalised advantages (Schulman et al. 2016) as sums over what follows, by the critic's values."""
    ours = model(first_multiplier=0.7, multiplier_rate=0.0)
    found = {}

    def keep():
        buffer = ours.rollout_buffer
        found["advantages"], found["starts"] = buffer.advantages.copy(), buffer.episode_starts.copy()
        found["seen"] = buffer.observations.copy()
        found["costs"], found["cut_off"] = np.array(ours.rollout_costs), ours.cut_off

    ours.train = keep
    ours.learn(128)
    theirs = model(PPO)
    theirs.train = lambda: found.update(rewarded=theirs.rollout_buffer.advantages.copy())
    theirs.learn(128)
    values = ours.constraint.values
    costs, starts = found["costs"], found["starts"]
    sums = np.zeros_like(costs)  # discounted, from the start of each episode on
    for t in range(len(costs)):
        sums[t] = costs[t] + (GAMMA * sums[t - 1] * (1 - starts[t]) if t else 0.0)
    costs = costs / sums.std()
    v = np.concatenate([values(found["seen"]), values(ours._last_obs)[None]])
    steps = len(costs)
    expected = np.zeros(costs.shape)
    for k in range(4):
        last = {step: values(observation) for step, env, observation in found["cut_off"] if env == k}
        for t in range(steps):
            total, weight = 0.0, 1.0
            for s in range(t, steps):
                following = last[s] if s in last else v[s + 1, k]
                total += weight * (costs[s, k] + GAMMA * following - v[s, k])
                weight *= GAMMA * LAMBDA
                if s in last:
                    break
            expected[t, k] = total
    assert len(found["cut_off"]) == 12
    assert starts.sum() == 4 * 4
    want = (found["rewarded"] - 0.7 * expected) / 1.7
    np.testing.assert_allclose(found["advantages"], want, rtol=1e-3, atol=1e-4)


def test_it_keeps_the_limit_that_ppo_breaks():
    faster = {"cost_limit": LIMIT, "n_steps": 64, "n_epochs": 4}
    one = model(multiplier_rate=0.1, **faster).learn(12_000)
    free = model(first_multiplier=0.0, multiplier_rate=0.0, **faster).learn(12_000)
    assert np.mean(one.episode_costs) < LIMIT < 9.0 < np.mean(free.episode_costs)
    assert one.multiplier > 0.5


def test_the_multiplier_rises_above_the_limit_and_falls_below_to_nothing():
    one = model(cost_limit=25.0, multiplier_rate=0.05)
    one.set_logger(configure(None, []))
    for _ in range(10):
        one.change_multiplier(40.0)
    # Adam's steps along a constant gradient are as long as its rate
    assert one.multiplier == pytest.approx(0.001 + 10 * 0.05, rel=1e-6)
    for _ in range(60):
        one.change_multiplier(1.0)
    assert one.multiplier == 0.0


def test_it_trains_on_costs_of_the_package_and_is_loaded_as_ppo(tmp_path):
    small = ("n_steps=16", "batch_size=32", "n_epochs=1", "n_envs=4")
    args = {"algo": "ppo_lagrangian", "steps": 512, "params": small, "env_kwargs": ("episode_seconds=0.4",)}
    folder = tmp_path / "run"
    train(Args(env_id="hoof_env/HorseLegSafe-v0", out=folder, **args))
    env = gym.make("hoof_env/HorseLegSafe-v0", episode_seconds=0.4)
    policy = find_saved(folder).load(env, "hoof_env/HorseLegSafe-v0")
    assert isinstance(policy.model, PPO)
    action, _ = policy.predict(env.reset(seed=0)[0])
    assert env.action_space.contains(action)
    again = LagrangianPPO.load(folder / "model.zip")
    assert torch.isfinite(again.constraint.multiplier)
    assert len(again.episode_costs) > 0


def test_refusals(tmp_path):
    with pytest.raises(ParameterError, match=r"expected an environment with costs.*HorseLegSafe.*without"):
        train(
            Args(
                algo="ppo_lagrangian",
                steps=64,
                params=("n_envs=1", "n_steps=64", "batch_size=64"),
                out=tmp_path / "a",
            )
        )
    for wrong in ({"cost_limit": -1.0}, {"multiplier_rate": "fast"}, {"first_multiplier": -0.1}):
        (name,) = wrong
        with pytest.raises(ParameterError, match=rf"{name}: expected a finite number in \[0"):
            model(**wrong)
    with pytest.raises(ParameterError, match="expected the CPU as device, got 'cuda'"):
        model(device="cuda")
