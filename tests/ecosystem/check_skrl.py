"""skrl: its wrapper of single and of vector environments, and its PPO, on every id."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
import torch
from alone import skip_unless_native
from skrl.agents.torch.ppo import PPO
from skrl.envs.wrappers.torch import wrap_env
from skrl.memories.torch import RandomMemory
from skrl.trainers.torch import SequentialTrainer
from skrl.utils import set_seed
from skrl.utils.model_instantiators.torch import deterministic_model, gaussian_model

torch.set_num_threads(1)

SECONDS = 0.2
"""Of an episode: ten steps."""
SEED = 3
MODES = {"single": None, "sync": "sync", "native": "vector_entry_point"}


@pytest.fixture(params=list(MODES))
def env(request, env_id):
    """One environment, or two side by side that restart on the next step, as skrl wraps them."""
    set_seed(SEED)
    if request.param == "single":
        return wrap_env(gym.make(env_id, episode_seconds=SECONDS), verbose=False)
    if request.param == "native":
        skip_unless_native(env_id)
    settings = {"vectorization_mode": MODES[request.param], "episode_seconds": SECONDS}
    return wrap_env(gym.make_vec(env_id, num_envs=2, **settings), verbose=False)


def test_wrap_env(env_id, env):
    """`wrap_env`, single, sync and native: the environment's own data over the ends of episodes."""
    observations, _ = env.reset()
    assert observations.shape == (env.num_envs, *env.observation_space.shape)
    alone = [gym.make(env_id, episode_seconds=SECONDS) for _ in range(env.num_envs)]
    wanted = [one.reset(seed=SEED + row)[0] for row, one in enumerate(alone)]
    np.testing.assert_array_equal(observations, wanted)
    ended = [False] * env.num_envs
    ends = 0
    for _ in range(35):
        actions = 2 * torch.rand(env.num_envs, *env.action_space.shape) - 1
        observations, rewards, terminated, truncated, _ = env.step(actions)
        for row, (one, action) in enumerate(zip(alone, actions.numpy(), strict=True)):
            if ended[row]:  # this step restarts
                observation, wanted = one.reset()[0], [0.0, False, False]
            else:
                observation, reward, *flags, _ = one.step(action)
                wanted = [np.float32(reward), *flags]
            np.testing.assert_array_equal(observations[row].numpy(), observation)
            assert [told[row].item() for told in (rewards, terminated, truncated)] == wanted
            ended[row] = wanted[1] or wanted[2]
            ends += ended[row]
        if env.num_envs == 1 and ended[0]:  # as skrl's trainers do
            np.testing.assert_array_equal(env.reset()[0][0], alone[0].reset()[0])
            ended[0] = False
    assert ends >= 3 * env.num_envs


def test_ppo(env, tmp_path):
    """PPO and `SequentialTrainer`, 256 steps, single, sync and native; then its evaluation."""
    spaces = {"observation_space": env.observation_space, "action_space": env.action_space}
    network = [{"name": "net", "input": "OBSERVATIONS", "layers": [16], "activations": "elu"}]
    models = {
        "policy": gaussian_model(**spaces, network=network, output="ACTIONS", clip_actions=True),
        "value": deterministic_model(**spaces, network=network, output="ONE"),
    }
    for role, model in models.items():
        model.init_state_dict(role=role)
    settings = {"rollouts": 64, "learning_epochs": 2, "mini_batches": 2, "time_limit_bootstrap": True}
    settings["experiment"] = {"directory": str(tmp_path), "write_interval": 64, "checkpoint_interval": 256}
    memory = RandomMemory(memory_size=64, num_envs=env.num_envs)
    agent = PPO(models=models, memory=memory, cfg=settings, **spaces)
    before = [parameter.clone() for model in models.values() for parameter in model.parameters()]
    quiet = {"disable_progressbar": True, "close_environment_at_exit": False}
    trainer = SequentialTrainer(env=env, agents=agent, cfg={"timesteps": 256, **quiet})
    trainer.train()
    after = [parameter for model in models.values() for parameter in model.parameters()]
    assert all(not torch.equal(*pair) for pair in zip(before, after, strict=True))
    assert all(torch.isfinite(parameter).all() for parameter in after)
    ends = memory.get_tensor_by_name("terminated") | memory.get_tensor_by_name("truncated")
    assert (ends.sum(0) >= 5).all()  # none of 64 steps is in an episode longer than ten
    trainer.eval()


def test_render(env_id):
    """`SequentialTrainer`'s `env.render()` of a native vector environment: a frame of each."""
    skip_unless_native(env_id)
    envs = gym.make_vec(
        env_id, num_envs=2, vectorization_mode="vector_entry_point", render_mode="rgb_array", rendered=2
    )
    env = wrap_env(envs, verbose=False)
    env.reset()
    frames = env.render()
    assert len(frames) == 2
    assert all(frame.ndim == 3 and frame.dtype == np.uint8 for frame in frames)
