"""Hyperparameters: what our file holds is what rl-baselines3-zoo and Stable-Baselines3 take."""

import inspect

import gymnasium as gym
import pytest
import yaml
from stable_baselines3 import PPO
from torch import nn

import hoof_env
from agents.settings import FOLDER, SCHEDULED, load_settings, model_arguments
from hoof_env.errors import DataFileError

ENTRIES = yaml.safe_load((FOLDER / "ppo.yml").read_text())


def test_entries_are_ids_that_exist():
    assert hoof_env.__version__
    assert {name for name in ENTRIES if name != "default"} <= set(gym.registry)
    assert {"hoof_env/HorseLeg-v0", "default"} <= set(ENTRIES)


@pytest.mark.parametrize("entry", ENTRIES.values(), ids=ENTRIES)
def test_the_zoo_reads_every_entry(entry):
    """By its rules, what its own keys leave goes to the constructor, and a schedule in words is lin_<x>."""
    of_zoo = {"n_envs", "n_timesteps", "normalize", "env_wrapper", "frame_stack", "callback", "env_kwargs"}
    assert set(entry) - of_zoo <= set(inspect.signature(PPO.__init__).parameters)
    assert int(entry["n_timesteps"]) > 0
    assert isinstance(entry["normalize"], (bool, dict))
    for key in SCHEDULED:
        if isinstance(entry.get(key), str):
            schedule, start = entry[key].split("_")
            assert schedule == "lin"
            assert float(start) > 0
    assert (entry["n_envs"] * entry["n_steps"]) % entry[
        "batch_size"
    ] == 0  # else SB3 warns of a cut mini-batch


def test_the_algorithm_takes_the_entry():
    settings = load_settings(FOLDER / "ppo.yml", "hoof_env/HorseLeg-v0")
    model = PPO(
        env="Pendulum-v1", device="cpu", **model_arguments(settings | {"n_steps": 8, "batch_size": 8})
    )
    start = float(settings["learning_rate"].removeprefix("lin_"))
    assert model.lr_schedule(1.0) == pytest.approx(start)
    assert model.lr_schedule(0.25) == pytest.approx(start / 4)


def test_unknown_id_takes_the_default():
    assert load_settings(FOLDER / "ppo.yml", "Pendulum-v1") == ENTRIES["default"]


def test_network_arguments_in_the_zoo_s_text_form():
    text = "dict(net_arch=dict(pi=[8], vf=[16]), activation_fn=nn.ELU, log_std_init=-1.5)"
    assert model_arguments({"policy_kwargs": text})["policy_kwargs"] == {
        "net_arch": {"pi": [8], "vf": [16]},
        "activation_fn": nn.ELU,
        "log_std_init": -1.5,
    }


@pytest.mark.parametrize(
    "text", ["dict(a=print(1))", "print(1)", "dict(a=nn.Nothing)", "[1]", "dict(a=", "dict(__import__('os'))"]
)
def test_network_arguments_are_never_run_as_code(text):
    with pytest.raises(DataFileError, match="policy_kwargs"):
        model_arguments({"policy_kwargs": text})


@pytest.mark.parametrize("value", ["lin_", "exp_1", "0.001x", "lin_1_2"])
def test_unknown_schedule(value):
    with pytest.raises(DataFileError, match="learning_rate"):
        model_arguments({"learning_rate": value})


@pytest.mark.parametrize("content", ["a: [", "[1, 2]", "Pendulum-v1: {n_envs: 1}", "other: {}", b"\xff\xfe"])
def test_unusable_file(tmp_path, content):
    path = tmp_path / "ppo.yml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(DataFileError, match=r"ppo\.yml"):
        load_settings(path, "Pendulum-v1")


def test_missing_file(tmp_path):
    with pytest.raises(DataFileError, match=r"none\.yml"):
        load_settings(tmp_path / "none.yml", "Pendulum-v1")
