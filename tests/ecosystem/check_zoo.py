"""rl-baselines3-zoo: its `train` and `enjoy` commands with the settings of agents/hyperparams."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

SETTINGS = Path(__file__).resolve().parents[2] / "agents" / "hyperparams"
FEW = {"ppo": ("n_envs:2", "n_steps:64", "batch_size:64")}
OFF_POLICY = ("learning_starts:100",)


def zoo(command, *arguments):
    started = [sys.executable, "-m", f"rl_zoo3.{command}", "--gym-packages", "hoof_env", *map(str, arguments)]
    done = subprocess.run(started, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stderr.strip().splitlines()[-1]
    return done.stdout


def train_and_enjoy(algorithm, env_id, folder):
    common = f"--algo {algorithm} --env {env_id} --seed 0 --device cpu --num-threads 1".split()
    common += ["-f", folder]
    settings = ["--conf-file", SETTINGS / f"{algorithm}.yml", "--env-kwargs", "episode_seconds:0.4"]
    settings += ["--hyperparams", *FEW.get(algorithm, OFF_POLICY)]
    zoo("train", *common, *settings, *["-n", "300", "--eval-freq", "200", "--eval-episodes", "1"])
    run = folder / algorithm / f"{env_id.replace('/', '-')}_1"
    assert (run / f"{env_id.replace('/', '-')}.zip").exists()
    assert (run / "best_model.zip").exists()
    assert "Mean reward" in zoo("enjoy", *common, "--no-render", "-n", "100")


def test_ppo(env_id, tmp_path):
    """`rl_zoo3 train` and `enjoy`, PPO with `ppo.yml`, 300 steps."""
    train_and_enjoy("ppo", env_id, tmp_path)


@pytest.mark.parametrize("algorithm", ["sac", "td3", "tqc"])
def test_off_policy(algorithm, tmp_path):
    """`rl_zoo3 train` and `enjoy`, SAC, TD3 and TQC with their files, 300 steps of HorseLeg-v0."""
    train_and_enjoy(algorithm, "hoof_env/HorseLeg-v0", tmp_path)
