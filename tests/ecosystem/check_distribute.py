"""`python -m agents.distribute` on a Ray cluster of two cores: what dies or is stopped is not lost."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from agents.train import Args, train

ROOT = Path(__file__).parents[2]
TINY = ("n_envs=8", "n_steps=64", "batch_size=256", "n_epochs=1", '{"policy_kwargs": {"net_arch": [8]}}')
TRIALS = ("trials", "--cpus", "2", "--env-kwargs", "episode_seconds=1", "--params", *TINY)
SLOW = ("--seeds", "3", "--steps", "60000", "--report-every", "10000")
"""Some seconds for each trial, so that there is a middle."""


def start(out: Path, *arguments: str) -> subprocess.Popen[str]:
    """The command with its output in `out`/log."""
    out.mkdir(parents=True, exist_ok=True)
    with (out / "log").open("a") as log:
        command = [sys.executable, "-m", "agents.distribute", *arguments, "--out", str(out)]
        return subprocess.Popen(command, cwd=ROOT, stdout=log, stderr=subprocess.STDOUT, text=True)


def finish(process: subprocess.Popen[str], out: Path) -> tuple[int, str]:
    """Its exit code and all that was said."""
    try:
        code = process.wait(400)
    finally:
        process.kill()
    return code, (out / "log").read_text()


def reports(out: Path, trial: str = "*") -> list[dict[str, float]]:
    """What the trials have reported, in the order of their files and lines."""
    files = sorted(out.glob(f"*/{trial}/result.json"))
    return [json.loads(line) for file in files for line in file.read_text().splitlines() if line[-1] == "}"]


def wait_for(process: subprocess.Popen[str], out: Path, count: int) -> None:
    deadline = time.monotonic() + 300
    while len(reports(out)) < count:
        assert process.poll() is None, (out / "log").read_text()
        assert time.monotonic() < deadline, (out / "log").read_text()
        time.sleep(0.05)


def table(out: Path) -> list[dict[str, str]]:
    (path,) = out.glob("*/trials.csv")
    with path.open() as file:
        return list(csv.DictReader(file))


def test_worker_killed(tmp_path):
    """Seeds: SIGKILL for a worker in the middle; its trial goes on from its checkpoint, none is lost"""
    process = start(tmp_path, *TRIALS, *SLOW)
    wait_for(process, tmp_path, 3)
    victim = reports(tmp_path)[-1]
    os.kill(int(victim["pid"]), signal.SIGKILL)
    code, said = finish(process, tmp_path)
    assert code == 0, said
    assert said.count("Retry 1") == 1
    assert [(row["seed"], row["state"]) for row in table(tmp_path)] == [(s, "done") for s in "012"]
    seed = str(victim["config"]["seed"])
    told = reports(tmp_path, f"*seed={seed}")
    pids = [report["pid"] for report in told]
    assert len(set(pids)) > 1
    steps = [report["steps"] for report in told]
    assert steps == sorted(steps), "it began again"
    assert {row["steps"] for row in table(tmp_path)} == {"60416"}
    for row in table(tmp_path):
        (run,) = tmp_path.glob(f"*/{row['run']}")
        assert (run / "model.zip").is_file()
    # The bits of a run that nobody killed
    whole = train(
        Args(
            seed=int(seed),
            steps=60_000,
            out=tmp_path / "whole",
            env_kwargs=("episode_seconds=1",),
            params=TINY,
        )
    )
    (retried,) = tmp_path.glob(f"*/*seed={seed}/checkpoint_*")
    assert curve(retried) == curve(whole.folder)


def curve(run: Path) -> list[tuple[str, str]]:
    """Return and length of every training episode."""
    with (run / "monitor.csv").open() as file:
        next(file)
        return [(row["r"], row["l"]) for row in csv.DictReader(file)]


def test_interrupted(tmp_path):
    """Seeds: Ctrl-C in the middle; the same command runs what is missing and nothing else"""
    process = start(tmp_path, *TRIALS, *SLOW)
    wait_for(process, tmp_path, 8)
    process.send_signal(signal.SIGINT)
    code, said = finish(process, tmp_path)
    assert code == 130, said
    assert "Traceback" not in said
    before = table(tmp_path)
    assert any(row["state"] == "unfinished" for row in before)
    code, said = finish(start(tmp_path, *TRIALS, *SLOW), tmp_path)
    assert code == 0, said
    assert [row["state"] for row in table(tmp_path)] == ["done"] * 3
    for old, new in zip(before, table(tmp_path), strict=True):
        assert old["state"] == "unfinished" or old == new
    code, _ = finish(start(tmp_path, *TRIALS, *SLOW), tmp_path)
    assert code == 0


def test_rllib_worker_killed(tmp_path):
    """RLlib's PPO: SIGKILL for one of two workers with environments; it is replaced and training goes on"""
    small = ("rllib", "--cpus", "3", "--workers", "2", "--n-envs", "8")
    process = start(tmp_path, *small, "--steps", "40000", "--params", "n_envs=128", "n_steps=32")
    wait_for(process, tmp_path, 2)
    (victim, *others) = env_runners(int(reports(tmp_path)[-1]["pid"]))
    assert len(others) == 1
    os.kill(victim, signal.SIGKILL)
    code, said = finish(process, tmp_path)
    assert code == 0, said
    (row,) = table(tmp_path)
    assert row["state"] == "done"
    assert float(row["steps"]) >= 40_000
    assert reports(tmp_path)[-1]["env_runners"]["num_env_steps_sampled"] >= 4096


def env_runners(learner: int) -> list[int]:
    """Process ids of Ray's workers with environments beside the process `learner`, of the same raylet."""
    parent = stat(learner)[1]
    found = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]
    return [pid for pid in found if stat(pid)[1] == parent and "SingleAgentEnvRunner" in stat(pid)[0]]


def stat(pid: int) -> tuple[str, str]:
    """Command line and parent of a process; empty where it is gone."""
    try:
        line = Path(f"/proc/{pid}/cmdline").read_text()
        return line, Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1]
    except OSError:
        return "", ""


def test_no_cluster(tmp_path):
    """`--address` without a cluster there: one line"""
    code, said = finish(start(tmp_path, *TRIALS, "--address", "auto"), tmp_path)
    assert code == 2
    assert said.startswith("error: address: expected a Ray cluster at 'auto'")
    assert len(said.splitlines()) == 1
