"""A record of a leg and one of a horse, with their descriptions."""

import gymnasium as gym
import pytest

from hoof_env import records
from hoof_env.envs.policies import make_policy
from hoof_env.lab.forces import THRESHOLD, above_threshold


def played(env_id, policy, seconds, **arguments):
    with gym.make(env_id, **arguments) as env:
        record = records.record_episode(env, make_policy(policy, env), 1, seconds)
        about = records.describe(env, environment=env_id, policy=policy, seed=1)
        about["threshold_n"] = THRESHOLD
        return above_threshold(record, THRESHOLD, records.surroundings(env).terrain), about


@pytest.fixture(scope="session")
def of_leg():
    return played("hoof_env/HorseLeg-v0", "run", 2.0)


@pytest.fixture(scope="session")
def of_horse():
    return played("hoof_env/Horse-v0", "reference", 3.0, target_speed=1.853)


@pytest.fixture(scope="session")
def of_fast_horse():
    return played("hoof_env/Horse-v0", "reference", 3.0, target_speed=3.3)


@pytest.fixture(scope="session")
def of_slope():
    slope = {"height": [-50.0, 50.0], "start": -1000.0, "spacing": 2000.0}
    return played("hoof_env/HorseLegTerrain-v0", "run", 1.5, terrain=slope, trunk="fixed")
