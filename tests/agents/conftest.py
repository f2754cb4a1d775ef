"""One tiny training that several tests look at, and a shelter for what they write."""

from pathlib import Path

import pytest

from agents.train import Args, Trained, train

SHORT = ("episode_seconds=0.4",)
"""Episodes of 20 steps, so that a tiny training ends some."""

TINY = ("n_steps=32", "batch_size=64", "n_epochs=1", '{"policy_kwargs": {"net_arch": [8]}}')


def train_tiny(out: Path, **changes) -> Trained:
    """256 steps of the leg in 4 environments."""
    arguments = {"steps": 256, "n_envs": 4, "env_kwargs": SHORT, "params": TINY, "checkpoint_every": 0.0}
    return train(Args(out=out, **{**arguments, **changes}))


@pytest.fixture(scope="session")
def trained(tmp_path_factory) -> Trained:
    return train_tiny(tmp_path_factory.mktemp("runs") / "tiny")
