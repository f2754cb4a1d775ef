"""Minari: data sets of scripted gaits, a random and a trained policy, and the environment they bring back."""

from __future__ import annotations

import gymnasium as gym
import minari
import numpy as np
import pytest
from stable_baselines3 import PPO

import hoof_env
from agents import dataset as command

SHORT = {"episode_seconds": 0.4}


class RewardTerms(minari.StepDataCallback):
    """Keeps the terms of the reward; Minari wants the same keys from every step and from a reset."""

    def __call__(self, env, obs, info, **kwargs):
        return super().__call__(env=env, obs=obs, info=terms_of(info), **kwargs)


def terms_of(info):
    return {key: value for key, value in info.items() if key.startswith("reward_")}


def scripted_policies(env_id):
    """Names of two policies that need no learning."""
    is_horse = gym.make(env_id).action_space.shape == (16,)
    return ("reference", "bang-bang") if is_horse else ("walk", "run")


@pytest.fixture(autouse=True)
def shelf(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))


def collect(env_id, name, policy, episodes=2, **kwargs):
    collector = minari.DataCollector(
        gym.make(env_id, **SHORT, **kwargs), step_data_callback=RewardTerms, record_infos=True
    )
    total = 0
    for episode in range(episodes):
        observation, _ = collector.reset(seed=episode)
        start, ended = True, False
        while not ended:
            action, _ = policy.predict(observation, episode_start=np.array([start]))
            observation, _, terminated, truncated, _ = collector.step(action)
            start, ended, total = False, terminated or truncated, total + 1
    made = collector.create_dataset(
        f"hoof_env/{gym.spec(env_id).name}/{name}-v0",
        algorithm_name=name,
        author="hoof-env contributors",
        description=f"{name} on {env_id}",
        requirements=[f"hoof-env=={hoof_env.__version__}"],
        num_episodes_average_score=2,
    )
    assert made.total_steps == total
    return made.spec.dataset_id


def look(dataset_id, env_id, **kwargs):
    """Reload a data set and play it again, step by step, in the environment that it recovers."""
    dataset = minari.load_dataset(dataset_id)
    assert dataset.total_episodes == 2
    env = dataset.recover_environment()
    assert env.spec.id == env_id
    assert env.spec.kwargs.items() >= {**SHORT, **kwargs}.items()
    for episode in dataset.iterate_episodes():
        observation, _ = env.reset(seed=int(episode.id))
        np.testing.assert_array_equal(observation, episode.observations[0])
        for step, action in enumerate(episode.actions):
            observation, reward, terminated, truncated, info = env.step(action)
            np.testing.assert_array_equal(observation, episode.observations[step + 1])
            assert reward == episode.rewards[step]
            assert (terminated, truncated) == (episode.terminations[step], episode.truncations[step])
            kept = {key: values[step + 1] for key, values in episode.infos.items()}
            assert terms_of(info) == kept
    assert terminated or truncated


@pytest.mark.parametrize("k", range(3))
def test_scripted(env_id, k):
    """Scripted and random policies: collected, reloaded, played again in the recovered environment."""
    name = (*scripted_policies(env_id), "random")[k]
    look(collect(env_id, name, hoof_env.make_policy(name, gym.make(env_id))), env_id)


def test_trained(env_id):
    """A PPO of Stable-Baselines3 after 256 steps, likewise."""
    model = PPO("MlpPolicy", gym.make(env_id, **SHORT), n_steps=64, n_epochs=1, seed=0, device="cpu").learn(
        256
    )
    look(collect(env_id, "ppo", model), env_id)


def test_arguments_come_back(env_id):
    """An environment with arguments of its own is recovered with them."""
    weights = {"reward_weights": {"peak": 0.6}}
    _, name = scripted_policies(env_id)
    policy = hoof_env.make_policy(name, gym.make(env_id))
    look(collect(env_id, name, policy, **weights), env_id, **weights)


def test_option_of_minari(env_id):
    """`reset(options={"minari_autoseed": False})`, which Minari documents and hands on to the environment."""
    collector = minari.DataCollector(gym.make(env_id))
    collector.reset(options={"minari_autoseed": False})
    collector.close()


def test_combine(env_id):
    """`combine_datasets` and `split_dataset`."""
    env = gym.make(env_id)
    names = [collect(env_id, name, hoof_env.make_policy(name, env)) for name in scripted_policies(env_id)]
    combined = minari.combine_datasets([minari.load_dataset(name) for name in names], "hoof_env/both-v0")
    assert combined.total_episodes == 4
    assert [len(part) for part in minari.split_dataset(combined, sizes=[3, 1])] == [3, 1]


def test_levels(env_id, tmp_path):
    """`agents.dataset --level mixed`: Minari's description, its normalised scores, a replay of each part."""
    kwargs = ("--env-kwargs", "episode_seconds=2.0", "--episodes", "4", "--author", "A. Horse")
    command.main(["--level", "mixed", "--env-id", env_id, *kwargs, "--out", str(tmp_path)])
    data = minari.load_dataset(f"hoof_env/{gym.spec(env_id).name}/mixed-v0")
    stored = data.storage.metadata
    assert stored["author"] == {"A. Horse"}
    assert {"algorithm_name", "description", "requirements", "minari_version"} <= stored.keys()
    scores = [minari.get_normalized_score(data, x.rewards.sum()) for x in data.iterate_episodes()]
    assert len(scores) == 4
    assert np.isfinite(scores).all()
    env = data.recover_environment()
    for k, episode in enumerate(data.iterate_episodes()):
        np.testing.assert_array_equal(env.reset(seed=k)[0], episode.observations[0])
        for action, reward in zip(episode.actions, episode.rewards, strict=True):
            assert env.step(action)[1] == reward
