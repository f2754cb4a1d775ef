"""RLlib on its new API stack: PPO, two iterations, two environment runners, on every id."""

from __future__ import annotations

import numpy as np
import pytest
import ray
from alone import skip_unless_native
from ray.rllib.algorithms.ppo import PPOConfig


@pytest.fixture(scope="module", autouse=True)
def cluster():
    """Two worker processes that have not imported hoof_env."""
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    yield
    ray.shutdown()


@pytest.mark.parametrize("mode", ["sync", "vector_entry_point"])
def test_ppo(env_id, mode):
    """PPO, two iterations of 256 steps, two runners, `hoof_env:` before the id; sync and native."""
    if mode == "vector_entry_point":
        skip_unless_native(env_id)
    config = (
        PPOConfig()
        .environment(f"hoof_env:{env_id}", env_config={"episode_seconds": 0.4})
        .env_runners(num_env_runners=2, num_envs_per_env_runner=2, gym_env_vectorize_mode=mode)
        .training(train_batch_size_per_learner=256, minibatch_size=64, num_epochs=2)
        .rl_module(model_config={"fcnet_hiddens": [16]})
        .learners(num_learners=0)
        .debugging(seed=0)
    )
    assert config.enable_rl_module_and_learner
    assert config.enable_env_runner_and_connector_v2
    algorithm = config.build_algo()
    try:
        for iteration in range(2):
            result = algorithm.train()
            assert result["training_iteration"] == iteration + 1
            assert result["env_runners"]["num_env_steps_sampled"] >= 256
            assert np.isfinite(result["env_runners"]["episode_return_mean"])
        assert algorithm.env_runner_group.num_healthy_remote_workers() == 2
    finally:
        algorithm.stop()
