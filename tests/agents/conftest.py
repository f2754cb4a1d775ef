"""One tiny training that several tests look at, its environment, and what every training leaves."""

import csv
from pathlib import Path

import pytest

from agents.runs import make_env
from agents.train import Args, Trained, train

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


def training_episodes(folder: Path) -> list[tuple[str, str]]:
    """Return and length of each."""
    with (folder / "monitor.csv").open() as file:
        next(file)
        return [(row["r"], row["l"]) for row in csv.DictReader(file)]
