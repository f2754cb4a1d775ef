"""Models on disk: the plain form acts as the zip does, runs no code, and refuses what does not fit."""

import json
import pickle
import shutil
import warnings

import numpy as np
import pytest
import torch
from safetensors.torch import save_file
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from agents.runs import STATISTICS, SavedModel, make_env, save_model
from agents.settings import algorithm_class
from hoof_env.errors import DataFileError
from hoof_env.saved_policy import ABOUT, WEIGHTS
from tests.agents.conftest import ENV_ID


def save(folder, env, algo="ppo", seed=0, **policy_kwargs):
    """A model that was never trained, its statistics those of a few random steps."""
    envs = VecNormalize(DummyVecEnv([lambda: env]), clip_obs=2.0)
    envs.reset()
    for _ in range(5):
        envs.step([envs.action_space.sample()])
    kwargs = {"net_arch": [8], "activation_fn": torch.nn.ELU, **policy_kwargs}
    kwargs |= {"n_quantiles": 5} if algo == "tqc" else {}
    model = algorithm_class(algo)("MlpPolicy", envs, policy_kwargs=kwargs, device="cpu", seed=seed)
    save_model(model, folder / "model.zip")
    record = {
        "env_id": ENV_ID,
        "algo": algo,
        "actions": env.unwrapped.action_form,
        "settings": {**vars(env.unwrapped.settings), "episode_seconds": 0.4},
        "versions": {},
    }
    (folder / "run.json").write_text(json.dumps(record, default=str))
    return model


def change(path, **values):
    path.write_text(json.dumps({**json.loads(path.read_text()), **values}))


@pytest.mark.parametrize("algo", ["ppo", "sac", "td3", "tqc"])
def test_plain_data_act_as_the_zip(algo, env, tmp_path):
    save(tmp_path, env, algo)
    plain = SavedModel.find(tmp_path).load(env, ENV_ID)
    (tmp_path / WEIGHTS).unlink()
    with pytest.warns(UserWarning, match="pickle"):
        zipped = SavedModel.find(tmp_path).load(env, ENV_ID)
    for seed in range(5):
        observation, _ = env.reset(seed=seed)
        np.testing.assert_array_equal(plain.predict(observation)[0], zipped.predict(observation)[0])
        assert not np.array_equal(plain.normalize(observation), observation)
    assert env.action_space.contains(plain.predict(observation)[0])


@pytest.mark.parametrize(
    "values",
    [
        {"env_id": 3},
        {"env_kwargs": 3},
        {"versions": None},
        {"finished": {"steps": 5}},
        {"finished": {"steps": "x", "seconds": 1}},
    ],
    ids=str,
)
def test_a_record_of_other_kinds(env, tmp_path, values):
    save(tmp_path, env)
    change(tmp_path / "run.json", **values)
    with pytest.raises(DataFileError, match=r"run\.json: expected"):
        SavedModel.find(tmp_path)


def test_all_files_have_the_same_mode_and_nothing_is_unpickled(env, tmp_path):
    class Bomb:
        def __reduce__(self):
            return pytest.fail, ("unpickled",)

    save(tmp_path, env)
    (tmp_path / "usual").touch()
    assert len({path.stat().st_mode for path in tmp_path.iterdir()}) == 1
    for name in ("model.zip", STATISTICS):
        (tmp_path / name).write_bytes(pickle.dumps(Bomb()))
    policy = SavedModel.find(tmp_path).load(env, ENV_ID)
    policy.predict(env.reset(seed=0)[0])
    (tmp_path / "model.zip").unlink()
    assert SavedModel.find(tmp_path).load(env, ENV_ID).predict(env.reset(seed=0)[0])


def test_arguments_that_are_not_plain_leave_only_the_zip(env, tmp_path):
    class Mine(torch.nn.ELU):
        pass

    save(tmp_path, env, activation_fn=Mine)
    assert not (tmp_path / ABOUT).exists()
    assert (tmp_path / "model.zip").exists()


def test_a_zip_of_another_name_is_not_mistaken_for_the_plain_policy(env, tmp_path):
    save(tmp_path, env)
    shutil.copy(tmp_path / "model.zip", tmp_path / "best.zip")
    with pytest.warns(UserWarning, match=r"best\.zip is a pickle"):
        policy = SavedModel.find(tmp_path / "best.zip").load(env, ENV_ID)
    assert isinstance(policy.model, PPO)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"env_id": "hoof_env/HorseLeg-v7"}, "HorseLeg-v7, expected hoof_env/HorseLeg-v0; another version"),
        ({"env_id": "hoof_env/HorseLegRail-v0"}, "HorseLegRail-v0, expected"),
        ({"actions": "offsets"}, "actions offsets, expected rates"),
        (
            {"observation_space": "Box(3)", "action_space": "Box(1)"},
            r"Box\(3\), expected .*; action_space Box\(1\)",
        ),
    ],
    ids=str,
)
def test_a_model_for_something_else(env, tmp_path, values, said):
    save(tmp_path, env)
    change(tmp_path / "run.json", **values)
    with pytest.raises(DataFileError, match=said):
        SavedModel.find(tmp_path).load(env, ENV_ID)


def test_a_model_without_the_form_of_its_actions(env, tmp_path):
    save(tmp_path, env)
    record = json.loads((tmp_path / "run.json").read_text())
    del record["actions"]
    (tmp_path / "run.json").write_text(json.dumps(record))
    with pytest.raises(DataFileError, match=r"actions of an older form .*, expected rates"):
        SavedModel.find(tmp_path).load(env, ENV_ID)


def test_a_policy_of_other_spaces(env, tmp_path):
    save(tmp_path, env)
    (tmp_path / "run.json").unlink()
    with make_env("Pendulum-v1") as pendulum, pytest.raises(DataFileError, match="observation_space"):
        SavedModel.find(tmp_path).load(pendulum, "Pendulum-v1")


def test_other_settings_and_versions_are_told(env, tmp_path):
    save(tmp_path, env)
    # A setting that the record lacks is newer than the policy, which was trained with its default.
    change(tmp_path / "run.json", settings={}, versions={"hoof-env": "0.0.1"})
    with pytest.warns(UserWarning, match=r"episode_seconds=10\.0, here 0\.4; .*hoof-env 0\.0\.1, here"):
        SavedModel.find(tmp_path).load(env, ENV_ID)


def test_a_model_that_fits_loads_without_a_word(env, trained):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        SavedModel.find(trained.folder).load(env, ENV_ID)


@pytest.mark.parametrize(
    "values",
    [
        {"format": 2},
        {"algo": "os.system"},
        {"policy": "CnnPolicyOfMine"},
        {"policy_kwargs": {"net_arch": [8], "activation_fn": {"torch.nn": "init"}}},
        {"policy_kwargs": {"net_arch": [9]}},
        {"action_space": None},
        {"normalize": {"mean": []}},
        {"normalize": {"mean": [0.0], "var": [1.0], "epsilon": 1e-8, "clip": 10.0}},
        {"normalize": {"mean": [0.0] * 24, "var": [-1.0] * 24, "epsilon": 1e-8, "clip": 10.0}},
    ],
    ids=str,
)
def test_a_damaged_description(env, tmp_path, values):
    save(tmp_path, env)
    change(tmp_path / ABOUT, **values)
    with pytest.raises(DataFileError, match=r"policy\.json"):
        SavedModel.find(tmp_path).load(env, ENV_ID)


def test_damaged_weights(env, tmp_path):
    weights = save(tmp_path, env).policy.state_dict()
    weights["log_std"][0] = torch.nan
    save_file(weights, tmp_path / WEIGHTS)
    with pytest.raises(DataFileError, match="not finite"):
        SavedModel.find(tmp_path).load(env, ENV_ID)
    (tmp_path / WEIGHTS).write_bytes((tmp_path / WEIGHTS).read_bytes()[:100])
    with pytest.raises(DataFileError, match=r"policy\.json"):
        SavedModel.find(tmp_path).load(env, ENV_ID)
