"""A model that was trained on normalised observations is played on them, wherever its statistics lie."""

import shutil
import warnings

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.callbacks import CheckpointCallback
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

import hoof_env
from hoof_env.errors import DataFileError
from hoof_env.evaluation.scores import evaluate

ID = "hoof_env/HorseLeg-v0"


def trained(folder, algorithm=PPO, **norms):
    """A trained model and the environment that normalised, or None; its checkpoints are in `folder`."""
    many = DummyVecEnv([lambda: gym.make(ID)])
    many = VecNormalize(many, **norms) if norms else many
    settings = {"n_steps": 64} if algorithm is PPO else {"learning_starts": 1000, "buffer_size": 100}
    model = algorithm("MlpPolicy", many, device="cpu", seed=0, **settings)
    save = CheckpointCallback(64, str(folder), name_prefix="leg", save_vecnormalize=True)
    model.learn(128, save)
    return model, many if norms else None


@pytest.fixture(scope="module", params=[PPO, SAC], ids=["ppo", "sac"])
def normalised(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("trained")
    return *trained(folder, request.param, norm_reward=True), folder


@pytest.fixture(scope="module")
def env():
    with gym.make(ID) as env:
        yield env


def words_of(call):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = call()
    return result, [str(one.message) for one in caught if "pickle" not in str(one.message)]


def is_played(policy, model, many, env):
    """True if a policy acts on observations as the training saw them."""
    observation, _ = env.reset(seed=0)
    wanted, _ = model.predict(many.normalize_obs(observation), deterministic=True)
    return np.allclose(policy.predict(observation)[0], wanted, atol=1e-6)


PLACES = {
    "agents.train": ("run/model.zip", "run/vecnormalize.pkl"),
    "one name for both": ("leg.zip", "leg_vecnormalize.pkl"),
    "shared by a folder": ("best_model.zip", "vecnormalize.pkl"),
    "rl_zoo3": ("HorseLeg-v0_1/HorseLeg-v0.zip", "HorseLeg-v0_1/HorseLeg-v0/vecnormalize.pkl"),
    "best of rl_zoo3": ("HorseLeg-v0_1/best_model.zip", "HorseLeg-v0_1/HorseLeg-v0/vecnormalize.pkl"),
    "hub": ("hub/ppo-HorseLeg-v0.zip", "hub/vec_normalize.pkl"),
}


@pytest.mark.parametrize(("file", "statistics"), PLACES.values(), ids=PLACES)
def test_statistics_are_found(file, statistics, normalised, env, tmp_path):
    model, many, _ = normalised
    for name, thing in ((file, model), (statistics, many)):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        thing.save(str(tmp_path / name))
    policy, said = words_of(lambda: hoof_env.load_policy(tmp_path / file, env))
    assert is_played(policy, model, many, env)
    assert not said


def test_statistics_are_read_with_a_warning(normalised, env, tmp_path):
    model, many, _ = normalised
    model.save(tmp_path / "leg.zip")
    many.save(str(tmp_path / "vec_normalize.pkl"))
    with pytest.warns(UserWarning, match=r"vec_normalize\.pkl is a pickle, which can run any code"):
        hoof_env.load_policy(tmp_path / "leg.zip", env)


def test_each_checkpoint_has_its_own(normalised, env):
    _, many, folder = normalised
    early, late = (
        words_of(lambda steps=steps: hoof_env.load_policy(folder / f"leg_{steps}_steps.zip", env))
        for steps in (64, 128)
    )
    assert early[1] == late[1] == []
    seen = np.ones(env.observation_space.shape)
    # The statistics of the first one are of half as many observations.
    assert not np.allclose(early[0].normalize(seen), late[0].normalize(seen))
    assert np.allclose(late[0].normalize(seen), many.normalize_obs(seen))
    assert is_played(late[0], late[0].model, many, env)


def test_statistics_that_are_missing_are_reported(normalised, env, tmp_path):
    model, many, _ = normalised
    model.save(tmp_path / "leg.zip")
    _, said = words_of(lambda: hoof_env.load_policy(tmp_path / "leg.zip", env))
    assert len(said) == 1
    assert "trained under VecNormalize, whose statistics are missing" in said[0]
    assert "found none" in said[0]
    # Of two nobody says which is meant.
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        many.save(str(tmp_path / name / "vecnormalize.pkl"))
    _, (said,) = words_of(lambda: hoof_env.load_policy(tmp_path / "leg.zip", env))
    assert "found " in said
    assert "one/vecnormalize.pkl" in said.replace("\\", "/")
    with pytest.raises(DataFileError, match=r"statistics are missing.* another task"):
        words_of(lambda: evaluate([str(tmp_path / "leg.zip")], ID, published=True))


@pytest.mark.parametrize("around", [None, DummyVecEnv([lambda: gym.make(ID)])], ids=["none", "plain"])
def test_a_model_that_is_an_object_without_its_statistics_is_reported(around, normalised, env, tmp_path):
    """As `load` gives it, unless the statistics are around its environment."""
    model, many, _ = normalised
    model.save(tmp_path / "leg.zip")
    many.save(str(tmp_path / "statistics.pkl"))
    bare = type(model).load(tmp_path / "leg.zip", env=around, device="cpu")
    _, (said,) = words_of(lambda: hoof_env.load_policy(bare, env))
    assert f"{type(model).__name__}: trained under VecNormalize, whose statistics are missing" in said
    with_them = VecNormalize.load(str(tmp_path / "statistics.pkl"), DummyVecEnv([lambda: gym.make(ID)]))
    whole = type(model).load(tmp_path / "leg.zip", env=with_them, device="cpu")
    policy, said = words_of(lambda: hoof_env.load_policy(whole, env))
    assert not said
    assert is_played(policy, model, many, env)


def test_a_model_that_was_never_normalised_has_none(env, tmp_path):
    model, _ = trained(tmp_path)
    model.save(tmp_path / "plain.zip")
    policy, said = words_of(lambda: hoof_env.load_policy(tmp_path / "plain.zip", env))
    assert not said
    # Beside another model's statistics
    _, many = trained(tmp_path / "other", norm_reward=True)
    many.save(str(tmp_path / "vecnormalize.pkl"))
    policy, (said,) = words_of(lambda: hoof_env.load_policy(tmp_path / "plain.zip", env))
    assert "played without" in said
    assert policy.normalize is None


def test_statistics_of_rewards_alone_change_no_observation(env, tmp_path):
    model, many = trained(tmp_path, norm_obs=False)
    model.save(tmp_path / "plain.zip")
    policy, (said,) = words_of(lambda: hoof_env.load_policy(tmp_path / "plain.zip", env))
    assert "unless only rewards were normalised" in said
    assert policy.normalize is None
    many.save(str(tmp_path / "vecnormalize.pkl"))
    policy, said = words_of(lambda: hoof_env.load_policy(tmp_path / "plain.zip", env))
    assert policy.normalize is None
    assert not said


@pytest.mark.parametrize("content", [b"", b"cut off", None])
def test_statistics_that_cannot_be_read_are_named(normalised, env, tmp_path, content):
    model, *_ = normalised
    model.save(tmp_path / "leg.zip")
    file = tmp_path / "vecnormalize.pkl"
    if content is None:
        other = VecNormalize(DummyVecEnv([lambda: gym.make("Pendulum-v1")]))
        other.save(str(file))
    else:
        file.write_bytes(content)
    with pytest.raises(
        DataFileError, match=r"statistics .*vecnormalize\.pkl: expected statistics of VecNormalize"
    ):
        words_of(lambda: hoof_env.load_policy(tmp_path / "leg.zip", env))
    shutil.rmtree(tmp_path)
