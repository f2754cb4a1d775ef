"""What suites of constrained learning read of an environment with costs, by copies of how their readers
behave: the suites themselves pin old packages."""

import gymnasium as gym
import numpy as np
import pytest

import hoof_env

SAFE = ("hoof_env/HorseLegSafe-v0", "hoof_env/HorseSafe-v0")


class FromGymnasium(gym.Wrapper):
    """As `Gymnasium2SafetyGymnasium` of Safety-Gymnasium (wrappers/gymnasium_conversion.py)."""

    def step(self, action):
        observation, reward, terminated, truncated, info = self.env.step(action)
        try:
            cost = info["cost"]
        except KeyError as error:
            raise ValueError("the info has no cost") from error
        return observation, reward, cost, terminated, truncated, info


class ToGymnasium(gym.Wrapper):
    """As `SafetyGymnasium2Gymnasium` of the same file: the third of six values goes into the info."""

    def step(self, action):
        observation, reward, cost, terminated, truncated, info = self.env.step(action)
        info["cost"] = cost
        return observation, reward, terminated, truncated, info


def read_info(infos, keys, known):
    """Read infos as TorchRL's `default_info_dict_reader` (envs/gym_like.py): arrays of objects are stacked,
    and a key that a step lacks is 0 in the shape that it had."""
    found = {}
    for key in keys:
        if key in infos:
            value = infos[key]
            value = np.stack(list(value)) if getattr(value, "dtype", None) == np.dtype("O") else value
            found[key] = np.asarray(value)
            known[key] = found[key].shape, found[key].dtype
        elif key in known:
            shape, dtype = known[key]
            found[key] = np.zeros(shape, dtype)
    return found


@pytest.mark.parametrize("env_id", SAFE)
def test_the_two_wrappers_of_safety_gymnasium_undo_each_other(env_id):
    plain, there = gym.make(env_id), FromGymnasium(gym.make(env_id))
    back = ToGymnasium(hoof_env.SeparateCost(gym.make(env_id)))
    for env in (plain, there, back):
        env.reset(seed=0)
    total = 0.0
    for taken in np.random.default_rng(0).uniform(-1, 1, (200, *plain.action_space.shape)).astype(np.float32):
        one, six, five = plain.step(taken), there.step(taken), back.step(taken)
        assert one[1] == six[1] == five[1]
        assert one[4]["cost"] == six[2] == five[4]["cost"] >= 0.0
        assert one[2:4] == six[3:5] == five[2:4]
        total += six[2]
    assert total == plain.unwrapped.batch.rows.cost_sums.sum() > 0.0


def test_an_environment_without_costs_is_refused_by_both():
    env = FromGymnasium(gym.make("hoof_env/HorseLeg-v0"))
    env.reset(seed=0)
    with pytest.raises(ValueError, match="no cost"):
        env.step(env.action_space.sample())


@pytest.mark.parametrize("env_id", SAFE)
def test_torchrls_reader_finds_a_number_in_every_step_and_reset(env_id):
    keys = ("cost", *gym.make(env_id).unwrapped.costs)
    envs = gym.make_vec(env_id, num_envs=3, autoreset_mode="SAME_STEP", episode_seconds=0.4)
    known, total = {}, 0.0
    first = read_info(envs.reset(seed=0)[1], keys, known)
    for taken in np.random.default_rng(0).uniform(-1, 1, (60, *envs.action_space.shape)).astype(np.float32):
        infos = envs.step(taken)[4]
        found = read_info(infos, keys, known)
        for key in keys:
            assert found[key].shape == first[key].shape == (3,)
            assert found[key].dtype == np.float64
        # FSRL reads the same key by `info.get("cost", 0)`
        np.testing.assert_array_equal(infos.get("cost", 0), found["cost"])
        total += found["cost"].sum()
    assert total > 0.0
    env, known = gym.make(env_id), {}
    first = read_info(env.reset(seed=0)[1], keys, known)
    assert all(first[key].shape == () and first[key] == 0.0 for key in keys)
