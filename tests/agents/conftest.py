"""One tiny training that several tests look at, its environment, and what every training leaves."""

import csv
import json
import sys
from pathlib import Path

import pytest
import torch
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from agents.runs import make_env, save_model
from agents.settings import algorithm_class
from agents.train import Args, Trained, train

sys.path.append(str(Path(__file__).parent))  # for `foreign`

ENV_ID = "hoof_env/HorseLeg-v0"
SHORT = ("episode_seconds=0.4",)
"""Episodes of 20 steps, so that a tiny training ends some."""

KWARGS = {"episode_seconds": 0.4}
"""The same, for Python."""

TINY = ("n_steps=32", "batch_size=64", "n_epochs=1", '{"policy_kwargs": {"net_arch": [8]}}')


def train_tiny(out: Path, **changes) -> Trained:
    """256 steps of the leg in 4 environments."""
    arguments = {"steps": 256, "n_envs": 4, "env_kwargs": SHORT, "params": TINY, "checkpoint_every": 0.0}
    return train(Args(out=out, **{**arguments, **changes}))


@pytest.fixture(scope="session")
def trained(tmp_path_factory) -> Trained:
    return train_tiny(tmp_path_factory.mktemp("runs") / "tiny")


@pytest.fixture(scope="module")
def env():
    """Of the tiny training."""
    with make_env(ENV_ID, **KWARGS) as env:
        yield env


def save_untrained(folder, env, algo="ppo", seed=0, **policy_kwargs):
    """A model that was never trained, with the statistics of a few random steps."""
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
    """Replace entries of a JSON file."""
    path.write_text(json.dumps({**json.loads(path.read_text()), **values}))


def training_episodes(folder: Path) -> list[tuple[str, str]]:
    """Return and length of each."""
    with (folder / "monitor.csv").open() as file:
        next(file)
        return [(row["r"], row["l"]) for row in csv.DictReader(file)]
