"""Training on tiny numbers: what it writes, that it repeats, ends in good order and refuses what misfits."""

import errno
import json
import signal
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml
from stable_baselines3 import PPO

from agents.command import parse_pairs, run
from agents.runs import FILES, STATISTICS, read_episodes
from hoof_env.errors import OutputError
from tests.agents.conftest import SHORT, TINY, train_tiny, training_episodes

ROOT = Path(__file__).parents[2]
GPU = torch.cuda.is_available()


def test_run_folder(trained):
    names = {path.name for path in trained.folder.iterdir()}
    assert names == {*FILES, STATISTICS, "tensorboard", ".lock"}  # no checkpoints when it is through
    assert trained.steps == 256
    assert trained.stopped_by is None
    record = json.loads((trained.folder / "run.json").read_text())
    assert record["env_id"] == "hoof_env/HorseLeg-v0"
    assert record["env_kwargs"] == {"episode_seconds": 0.4}
    assert record["settings"]["episode_seconds"] == 0.4
    assert record["settings"]["trunk"] == "suspended"
    assert record["settings"]["dt"] == 0.02
    assert [*record["observation_scales"]] == record["observation_names"]
    assert record["seed"] == 0
    assert record["finished"]["steps"] == 256
    assert {"python", "platform", "hoof-env", "numpy", "gymnasium", "stable-baselines3", "torch"} <= set(
        record["versions"]
    )
    used = yaml.safe_load((trained.folder / "config.yml").read_text())["hoof_env/HorseLeg-v0"]
    assert (used["n_steps"], used["n_envs"], used["n_timesteps"]) == (32, 4, 256)


def test_every_training_step_is_in_the_training_episodes(trained):
    episodes = training_episodes(trained.folder)
    assert {length for _, length in episodes} == {"20"}
    assert len(episodes) == 4 * (256 // 4 // 20)


def test_episodes_count_steps(tmp_path):
    (tmp_path / "monitor.csv").write_text('#{"t_start": 0}\nr,l,t\n-1.5,20,0.1\n2.0,30,0.2\n')
    np.testing.assert_array_equal(read_episodes(tmp_path), [[20, -1.5, 0.1], [50, 2.0, 0.2]])


def test_same_seed_same_run(trained, tmp_path):
    again, other = train_tiny(tmp_path / "again"), train_tiny(tmp_path / "other", seed=1)
    assert training_episodes(again.folder) == training_episodes(trained.folder)
    assert training_episodes(other.folder) != training_episodes(trained.folder)


def test_time_limit(tmp_path):
    trained = train_tiny(tmp_path / "run", steps=10**9, max_minutes=0.01, checkpoint_every=0)
    assert trained.steps < 10**5
    assert (trained.folder / "model.zip").is_file()


def test_interrupted_training_keeps_its_model(tmp_path):
    folder = tmp_path / "run"
    options = ["--steps", "1000000000", "--max-minutes", "5", "--n-envs", "4", "--out", str(folder)]
    process = subprocess.Popen(
        [sys.executable, "-m", "agents.train", *options, "--env-kwargs", *SHORT, "--params", *TINY],
        cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    monitor, deadline = folder / "monitor.csv", time.monotonic() + 240
    while not (monitor.is_file() and len(monitor.read_text().splitlines()) > 2):
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < deadline, "no episode ended within four minutes"
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "Traceback" not in err
    (line,) = out.splitlines()
    assert line.startswith("interrupted: ")
    assert str(folder) in line
    assert PPO.load(folder / "model.zip").num_timesteps > 0
    assert "finished" not in json.loads((folder / "run.json").read_text())


def test_finished_run_is_not_overwritten(trained):
    before = (trained.folder / "model.zip").read_bytes()
    with pytest.raises(OutputError, match="already holds a trained model"):
        train_tiny(trained.folder)
    assert (trained.folder / "model.zip").read_bytes() == before


def test_a_log_beside_a_run(tmp_path):
    (tmp_path / "log.txt").write_text("mine")
    assert train_tiny(tmp_path, steps=1).steps == 128
    assert (tmp_path / "log.txt").read_text() == "mine"


def test_an_error_of_the_system_is_one_line(capsys, monkeypatch):
    def fail():
        thread = threading.Thread(target=full)
        thread.start()
        thread.join()
        full()

    def full():
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(warnings, "formatwarning", None)
    monkeypatch.setattr(threading, "excepthook", None)
    with pytest.raises(SystemExit) as ended:
        run(fail)
    assert ended.value.code == 2
    assert capsys.readouterr().err == "error: [Errno 28] No space left on device\n"
    assert warnings.formatwarning("nearly", UserWarning, "file", 1, "code") == "warning: nearly\n"


def test_an_error_is_one_line():
    command = [sys.executable, "-m", "agents.train", "--env-id", "hoof_env/Cow-v0"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("error: environment 'hoof_env/Cow-v0'")
    assert len(done.stderr.splitlines()) == 1


def test_pairs():
    items = ["trunk=rail", "restitution=0.5", '{"reward_weights": {"peak": 1}, "x": null}', "empty="]
    assert parse_pairs("--env-kwargs", items) == {
        "trunk": "rail",
        "restitution": 0.5,
        "reward_weights": {"peak": 1},
        "x": None,
        "empty": "",
    }
