"""Hyperparameters: what our file holds is what rl-baselines3-zoo and Stable-Baselines3 take."""

import inspect
from typing import get_args

import gymnasium as gym
import pytest
import yaml
from stable_baselines3 import PPO
from stable_baselines3.common.noise import OrnsteinUhlenbeckActionNoise
from torch import nn

import hoof_env
from agents.settings import (
    ALGORITHMS,
    FOLDER,
    SCHEDULED,
    Algorithm,
    algorithm_class,
    load_settings,
    model_arguments,
)

FILES = {name: yaml.safe_load((FOLDER / f"{name}.yml").read_text()) for name in ALGORITHMS}
ENTRIES = FILES["ppo"]
OF_ZOO = {"n_envs", "n_timesteps", "normalize", "env_wrapper", "frame_stack", "callback", "env_kwargs"}
"""Keys that the zoo keeps to itself; what it leaves goes to the constructor."""


def test_the_commands_name_every_algorithm():
    assert set(get_args(Algorithm)) == {*ALGORITHMS, "ppo_flat", "ppo_lagrangian"}


@pytest.mark.parametrize("env_id", ["hoof_env/HorseLeg-v0", "hoof_env/HorseLegFixed-v0", "Pendulum-v1"])
def test_the_flat_trainer_has_the_settings_of_ppo(env_id):
    ours, theirs = (load_settings(FOLDER / f"{name}.yml", env_id) for name in ("ppo_flat", "ppo"))
    assert theirs.pop("normalize") == {"norm_obs": False, "norm_reward": ours.pop("norm_reward")}
    assert ours == theirs
    model = algorithm_class("ppo_flat")(env="Pendulum-v1", **model_arguments(ours | {"n_steps": 8}))
    assert model.n_epochs == theirs["n_epochs"]


@pytest.mark.parametrize("entries", FILES.values(), ids=FILES)
def test_entries_are_ids_that_exist(entries):
    assert hoof_env.__version__
    assert {name for name in entries if name != "default"} <= set(gym.registry)
    assert {"hoof_env/HorseLeg-v0", "default"} <= set(entries)


@pytest.mark.parametrize(
    ("algo", "entry"), [(algo, entry) for algo, entries in FILES.items() for entry in entries.values()]
)
def test_the_zoo_reads_every_entry(algo, entry):
    """By its rules, schedules in words, which are lin_<x>, and noise aside."""
    taken = set(inspect.signature(algorithm_class(algo).__init__).parameters)
    assert set(entry) - OF_ZOO - ({"noise_type", "noise_std"} if algo == "td3" else set()) <= taken
    assert int(entry["n_timesteps"]) > 0
    assert isinstance(entry.get("normalize", False), (bool, dict))
    for key in SCHEDULED:
        if isinstance(entry.get(key), str):
            schedule, start = entry[key].split("_")
            assert schedule == "lin"
            assert float(start) > 0
    if algo == "ppo":  # else SB3 warns of a cut mini-batch
        assert (entry["n_envs"] * entry["n_steps"]) % entry["batch_size"] == 0


@pytest.mark.parametrize("algo", ["sac", "td3", "tqc"])
def test_off_policy_files_build_their_models(algo):
    settings = load_settings(FOLDER / f"{algo}.yml", "hoof_env/HorseLeg-v0") | {"buffer_size": 10}
    build = algorithm_class(algo)
    usual = inspect.signature(build.__init__).parameters["train_freq"].default
    model = build(env="Pendulum-v1", device="cpu", **model_arguments(settings))
    assert model.train_freq.frequency == settings.get("train_freq", usual)
    assert (model.action_noise is None) == ("noise_type" not in settings)


def test_noise_and_episodes_in_the_zoo_s_form():
    settings = {"noise_type": "ornstein-uhlenbeck", "noise_std": 0.5, "train_freq": [2, "episode"]}
    arguments = model_arguments(settings, actions=3)
    assert arguments.keys() == {"action_noise", "train_freq"}
    assert arguments["train_freq"] == (2, "episode")
    assert isinstance(arguments["action_noise"], OrnsteinUhlenbeckActionNoise)
    assert arguments["action_noise"]().shape == (3,)


def test_the_algorithm_takes_the_entry():
    settings = load_settings(FOLDER / "ppo.yml", "hoof_env/HorseLeg-v0")
    assert load_settings(FOLDER / "ppo.yml", "Pendulum-v1") == ENTRIES["default"]
    model = PPO(
        env="Pendulum-v1", device="cpu", **model_arguments(settings | {"n_steps": 8, "batch_size": 8})
    )
    start = float(settings["learning_rate"].removeprefix("lin_"))
    assert model.lr_schedule(1.0) == pytest.approx(start)
    assert model.lr_schedule(0.25) == pytest.approx(start / 4)


def test_network_arguments_in_the_zoo_s_text_form():
    text = "dict(net_arch=dict(pi=[8], vf=[16]), activation_fn=nn.ELU, log_std_init=-1.5)"
    assert model_arguments({"policy_kwargs": text})["policy_kwargs"] == {
        "net_arch": {"pi": [8], "vf": [16]},
        "activation_fn": nn.ELU,
        "log_std_init": -1.5,
    }
