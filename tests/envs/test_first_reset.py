"""A first reset that is refused changes nothing: the next one begins an episode."""

import gymnasium as gym
import numpy as np
import pytest
from family import IDS, same

from hoof_env.errors import ParameterError


@pytest.mark.parametrize("env_id", IDS)
def test_after_a_refused_reset_the_next_is_the_first(env_id):
    env, other = gym.make(env_id), gym.make(env_id)
    with pytest.raises(ParameterError, match=r"gait.*expected"):
        env.reset(seed=0, options={"gait": "gallop"})
    same(env.reset(seed=0)[0], other.reset(seed=0)[0])
    action = np.zeros(env.action_space.shape, np.float32)
    same(env.step(action)[0], other.step(action)[0])
