"""A body with a number of legs for which no kernel runs single environments: it runs side by side."""

from __future__ import annotations

from dataclasses import replace

import gymnasium as gym
import numpy as np

from hoof_env.simd import block_at, maximum, minimum, read
from hoof_env.simd.compile import inline_llvm
from hoof_env.simd.math import clip
from hoof_env.tasks import registry
from hoof_env.tasks.body import BodyKernels
from hoof_env.tasks.episode import ACTIONS, Episode
from hoof_env.tasks.one_leg import OneLeg, keep_gait

ID = "own/TwoLegs-v0"


@inline_llvm
def command_both(task, actions, episode, first_leg, parameters, n, scratch):
    for i in range(2):
        leg = block_at(first_leg, i)
        for k in range(ACTIONS):
            action = clip(read(leg, actions, (2 * n + i) * ACTIONS + k, 2 * ACTIONS), 1.0)
            heading = leg.state.gait[k] + task.lead * leg.state.gait_rate[k]
            leg.command[k] = minimum(maximum(heading + task.reach[k] * action, task.low[k]), task.high[k])


class TwoLegs(OneLeg):
    """Two legs at the same place, half a turn of their cranks apart."""

    kernels = BodyKernels(2, Episode, (), 1, command_both, keep_gait)
    leg_prefixes = ("near_", "off_")
    action_names = tuple(f"{leg}{name}" for leg in leg_prefixes for name in OneLeg.action_names)

    def parts(self, s):
        trunk, ground, (limb,) = super().parts(s)
        return trunk, ground, (limb, limb)

    def draw(self, options, generators, engine):
        start = super().draw(options, generators, engine)
        start.commands = np.repeat(start.commands, 2, axis=0)
        start.theta = np.concatenate([start.theta, start.theta + np.pi])
        return start


def test_two_legs_have_the_same_bits_alone_and_in_rows(monkeypatch):
    task = replace(registry.TASKS["leg"], name=ID, body=TwoLegs)
    monkeypatch.setitem(registry._OWN, ID, task)
    registry._add_to_gymnasium(task)
    env, envs = gym.make(ID).unwrapped, gym.make_vec(ID, num_envs=3).unwrapped
    assert env.action_space.shape == (8,)
    first, _ = env.reset(seed=1)
    np.testing.assert_array_equal(envs.reset(seed=0)[0][1], first)
    rng = np.random.default_rng(0)
    for _ in range(10):
        actions = rng.uniform(-1, 1, (3, 8)).astype(np.float32)
        observation, reward, *_, info = env.step(actions[1])
        observations, rewards, *_, infos = envs.step(actions)
        np.testing.assert_array_equal(observations[1], observation)
        assert rewards[1] == reward
        np.testing.assert_array_equal(infos["measured"][1], info["measured"])
    near, off = (info["measured"][f"{leg}crank_angle"] for leg in TwoLegs.leg_prefixes)
    assert abs(off - near - np.pi) < 2.0
    assert near != off - np.pi  # each has actions of its own
