"""`python -m agents.distribute` on a Ray cluster of two cores, of one node or two: what dies or is stopped is
not lost."""

from __future__ import annotations

import csv
import json
import os
import secrets
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from agents.settings import Algorithm
from agents.train import Args, train

ROOT = Path(__file__).parents[2]
TINY = ("n_envs=8", "n_steps=64", "batch_size=256", "n_epochs=1", '{"policy_kwargs": {"net_arch": [8]}}')
TRIALS = ("--cpus", "2", "--env-kwargs", "episode_seconds=1", "--params", *TINY)
SLOW = ("--seeds", "3", "--steps", "60000", "--report-every", "10000")
"""Some seconds for each trial, so that there is a middle."""


def start(out: Path, *arguments: str, environment: dict[str, str] | None = None) -> subprocess.Popen[str]:
    """The command with its output in `out`/log."""
    out.mkdir(parents=True, exist_ok=True)
    with (out / "log").open("a") as log:
        command = [sys.executable, "-m", "agents.distribute", *arguments, "--out", str(out)]
        options = {"env": environment, "stdout": log, "stderr": subprocess.STDOUT, "text": True}
        return subprocess.Popen(command, cwd=ROOT, **options)


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


def wait_for(process: subprocess.Popen[str], out: Path, count: int, trial: str = "*") -> None:
    deadline = time.monotonic() + 300
    while len(reports(out, trial)) < count:
        assert process.poll() is None, (out / "log").read_text()
        assert time.monotonic() < deadline, (out / "log").read_text()
        time.sleep(0.05)


def table(out: Path) -> list[dict[str, str]]:
    (path,) = out.glob("*/trials.csv")
    with path.open() as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("algo", ["ppo", "ppo_flat"])
def test_worker_killed(tmp_path, algo):
    """Seeds: SIGKILL for a worker in the middle; its trial goes on from its checkpoint, none is lost"""
    process = start(tmp_path, *TRIALS, *SLOW, "--algo", algo)
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
    assert_undisturbed(tmp_path, int(seed), 60_000, algo)


def assert_undisturbed(out: Path, seed: int, steps: int, algo: Algorithm) -> None:
    """A trial has the bits of a run that nobody killed."""
    asked = {"algo": algo, "env_kwargs": ("episode_seconds=1",), "params": TINY}
    whole = train(Args(seed=seed, steps=steps, out=out / f"whole{seed}", **asked))
    (retried,) = out.glob(f"*/*seed={seed}/checkpoint_*")
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


@pytest.mark.parametrize("algo", ["ppo_flat"])
def test_node_killed(tmp_path, algo):
    """A cluster of two nodes, both at work: SIGKILL for all of one; its trial goes on on the other"""
    with nodes(2) as (address, environment, (_, lost)):
        assert "working_dir_files" in where(address, environment), "the checkout was not sent"
        # Kernels of a checkout that was sent would have to be compiled first
        here = ("--address", address, "--runtime-env", json.dumps({"working_dir": str(tmp_path)}))
        asked = ("--algo", algo, "--seeds", "2", "--steps", "40000", "--report-every", "10000")
        process = start(tmp_path, *TRIALS, *asked, *here, environment=environment)
        wait_for(process, tmp_path, 1, "00000*")
        wait_for(process, tmp_path, 1, "00001*")
        dead = {lost.pid, *descendants(lost.pid)}
        for pid in dead:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        killed = [r for r in reports(tmp_path) if r["pid"] in dead]
        code, said = finish(process, tmp_path)
    assert code == 0, said
    (seed,) = {report["config"]["seed"] for report in killed}
    assert said.count("Retry 1") == 1
    assert [(row["state"], row["steps"]) for row in table(tmp_path)] == [("done", "40448")] * 2
    told = reports(tmp_path, f"*seed={seed}")
    assert told[-1]["pid"] not in dead
    assert_undisturbed(tmp_path, seed, 40_000, algo)


@contextmanager
def nodes(count: int) -> Iterator[tuple[str, dict[str, str], list[subprocess.Popen[bytes]]]]:
    """A Ray cluster of `count` nodes with one core each: its address, what a process needs in its environment
    to be let in, and the nodes, of which each is a process and its descendants."""
    with socket.socket() as free:
        free.bind(("", 0))
        port = free.getsockname()[1]
    environment = {**os.environ, "RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex()}
    command = [sys.executable, "-m", "ray.scripts.scripts", "start", "--block", "--num-cpus=1"]
    going: list[subprocess.Popen[bytes]] = []
    # Sockets lie in the folder, and their names must be short
    with tempfile.TemporaryDirectory(dir="/tmp", prefix="ray", ignore_cleanup_errors=True) as folder:
        try:
            for number in range(count):
                place = f"--address=127.0.0.1:{port}" if number else f"--port={port}"
                more = [] if number else ["--head", f"--temp-dir={folder}", "--include-dashboard=false"]
                with Path(folder, f"node{number}").open("wb") as log:
                    options = {"env": environment, "stdout": log, "stderr": log}
                    going.append(subprocess.Popen([*command, place, *more], **options))
                deadline = time.monotonic() + 90
                while "runtime started" not in (said := Path(folder, f"node{number}").read_text()):
                    assert going[-1].poll() is None, said
                    assert time.monotonic() < deadline, said
                    time.sleep(0.1)
            yield f"127.0.0.1:{port}", environment, going
        finally:
            for node in reversed(going):
                node.terminate()
            for node in going:
                node.wait(60)


def where(address: str, environment: dict[str, str]) -> str:
    """The file that `agents` is read from in a process of the cluster."""
    script = f"""
import ray
from agents.distribute import SHIPPED
ray.init({address!r}, runtime_env=SHIPPED)
print(ray.get(ray.remote(lambda: __import__("agents").__file__).remote()))
"""
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def descendants(pid: int) -> set[int]:
    """Process ids of a process's children, of theirs, and so on."""
    parents = {int(p.name): stat(int(p.name))[1] for p in Path("/proc").iterdir() if p.name.isdigit()}
    found: set[int] = set()
    layer = {pid}
    while layer:
        layer = {child for child, parent in parents.items() if parent and int(parent) in layer}
        found |= layer
    return found


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
