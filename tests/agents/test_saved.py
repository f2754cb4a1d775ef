"""Models on disk: the plain form acts as the zip does, runs no code, and refuses what does not fit."""

import copy
import pickle
import shutil
import warnings

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

from agents.runs import STATISTICS, SavedModel
from hoof_env.errors import DataFileError
from hoof_env.policies.plain import NumpyPolicy
from hoof_env.policies.saved import ABOUT, WEIGHTS
from tests.agents.conftest import ENV_ID, change, save_untrained


@pytest.mark.parametrize("algo", ["ppo", "sac", "td3", "tqc"])
def test_plain_data_act_as_the_zip(algo, env, tmp_path):
    save_untrained(tmp_path, env, algo)
    plain = SavedModel.find(tmp_path).load(env, ENV_ID)
    (tmp_path / WEIGHTS).unlink()
    with pytest.warns(UserWarning, match="pickle"):
        zipped = SavedModel.find(tmp_path).load(env, ENV_ID)
    for seed in range(5):
        observation, _ = env.reset(seed=seed)
        np.testing.assert_array_equal(plain.predict(observation)[0], zipped.predict(observation)[0])
        assert not np.array_equal(plain.normalize(observation), observation)
    assert env.action_space.contains(plain.predict(observation)[0])


def optimizers(policy):
    return [each.optimizer for each in policy.modules() if hasattr(each, "optimizer")]


def options(optimizer):
    """All of an optimizer but its parameters and their rate, which a policy that is read has not."""
    (group,) = optimizer.state_dict()["param_groups"]
    return {key: value for key, value in group.items() if key not in ("params", "lr")}


@pytest.mark.parametrize("algo", ["ppo", "sac", "td3", "tqc"])
def test_a_policy_of_plain_data_learns_like_the_model(algo, env, tmp_path):
    """By its own optimizers, also in a deep or saved copy, and with the loaded states of optimizers."""
    model = save_untrained(tmp_path, env, algo)
    policy = SavedModel.find(tmp_path).load(env, ENV_ID).model.policy
    policy.save(tmp_path / "copy.pt")
    saved = type(policy).load(tmp_path / "copy.pt")
    for optimizer in [*optimizers(policy), *optimizers(saved)]:
        optimizer.param_groups[0]["lr"] = model.lr_schedule(1.0)
    copied, emptied = (copy.deepcopy(policy) for _ in range(2))
    for optimizer in optimizers(emptied):
        optimizer.zero_grad()

    def learn(learner):
        for optimizer in optimizers(learner):
            sum(parameter.square().sum() for parameter in learner.parameters()).backward()
            optimizer.step()
        for optimizer in optimizers(learner):
            optimizer.zero_grad()

    learners = [model.policy, policy, copied, emptied, saved]
    for learner in learners:
        learn(learner)
    for other in learners[1:]:
        for mine, others in zip(optimizers(other), optimizers(model.policy), strict=True):
            assert type(mine) is torch.optim.Adam
            assert options(mine) == options(others)
        for mine, others in zip(other.parameters(), model.policy.parameters(), strict=True):
            assert torch.equal(mine, others)
    again = SavedModel.find(tmp_path).load(env, ENV_ID).model.policy
    again.load_state_dict(model.policy.state_dict())
    for mine, others in zip(optimizers(again), optimizers(model.policy), strict=True):
        mine.load_state_dict(copy.deepcopy(others.state_dict()))
    learn(again)
    learn(model.policy)
    for mine, others in zip(again.parameters(), model.policy.parameters(), strict=True):
        assert torch.equal(mine, others)


def test_all_files_have_the_same_mode_and_nothing_is_unpickled(env, tmp_path):
    class Bomb:
        def __reduce__(self):
            return pytest.fail, ("unpickled",)

    save_untrained(tmp_path, env)
    (tmp_path / "usual").touch()
    assert len({path.stat().st_mode for path in tmp_path.iterdir()}) == 1
    for name in ("model.zip", STATISTICS):
        (tmp_path / name).write_bytes(pickle.dumps(Bomb()))
    policy = SavedModel.find(tmp_path).load(env, ENV_ID)
    policy.predict(env.reset(seed=0)[0])
    (tmp_path / "model.zip").unlink()
    assert SavedModel.find(tmp_path).load(env, ENV_ID).predict(env.reset(seed=0)[0])


@pytest.mark.parametrize("place", ["weights", "header", "metadata"])
def test_a_flipped_bit_is_refused_or_changes_nothing(place, env, tmp_path):
    """In the numbers of the weights, in the header that says where they are, or in policy.json."""
    model = save_untrained(tmp_path, env)
    observations = np.random.default_rng(1).normal(size=(5, *env.observation_space.shape)).astype(np.float32)
    wanted = NumpyPolicy(tmp_path).predict(observations)[0]
    np.testing.assert_allclose(
        model.predict(model.get_vec_normalize_env().normalize_obs(observations), deterministic=True)[0],
        wanted,
        atol=1e-6,
    )
    path = tmp_path / (ABOUT if place == "metadata" else WEIGHTS)
    whole = path.read_bytes()
    numbers = 8 + int.from_bytes(whole[:8], "little")
    begin, end = {"weights": (numbers, len(whole)), "header": (0, numbers), "metadata": (0, len(whole))}[
        place
    ]
    generator = np.random.default_rng(0)
    refused = 0
    for _ in range(300):
        content = bytearray(whole)
        content[generator.integers(begin, end)] ^= 1 << int(generator.integers(8))
        path.write_bytes(content)
        try:
            found = NumpyPolicy(tmp_path).predict(observations)[0]
        except DataFileError:
            refused += 1
            if refused < 20:
                with pytest.raises(DataFileError):
                    SavedModel.find(tmp_path).load(env, ENV_ID)
        else:
            np.testing.assert_array_equal(found, wanted)
    # Of policy.json the name of the digest may be hit, and then nothing is checked, and nothing damaged
    assert refused == 300 if place != "metadata" else refused > 280


def test_arguments_that_are_not_plain_leave_only_the_zip(env, tmp_path):
    class Mine(torch.nn.ELU):
        pass

    save_untrained(tmp_path, env, activation_fn=Mine)
    assert not (tmp_path / ABOUT).exists()
    assert (tmp_path / "model.zip").exists()


def test_a_zip_of_another_name_is_not_mistaken_for_the_plain_policy(env, tmp_path):
    save_untrained(tmp_path, env)
    shutil.copy(tmp_path / "model.zip", tmp_path / "best.zip")
    with pytest.warns(UserWarning, match=r"best\.zip is a pickle"):
        policy = SavedModel.find(tmp_path / "best.zip").load(env, ENV_ID)
    assert isinstance(policy.model, PPO)


def test_other_settings_and_versions_are_reported(env, tmp_path):
    save_untrained(tmp_path, env)
    # A setting that the record lacks is newer than the policy, which was trained with its default.
    change(tmp_path / "run.json", settings={}, versions={"hoof-env": "0.0.1"})
    with pytest.warns(UserWarning, match=r"episode_seconds=10\.0, here 0\.4; .*hoof-env 0\.0\.1, here"):
        SavedModel.find(tmp_path).load(env, ENV_ID)


def test_a_model_that_fits_loads_without_a_word(env, trained):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        SavedModel.find(trained.folder).load(env, ENV_ID)
