"""Folder of one training run: its files, how they are written and how a model is read back.

    policy.*          the trained policy as plain data (hoof_env/policies/saved.py): this is what is loaded
    model.zip         the trained model (Stable-Baselines3); vecnormalize.pkl: statistics, if normalised
    config.yml        the hyperparameters that were used, in rl-baselines3-zoo's form
    run.json          environment, settings, spaces, command, arguments, versions; "finished" when through
    monitor.csv       return, length and time of every training episode; tensorboard/ has curves
    checkpoints/N/    what `--resume` goes on from (agents/checkpoints.py), until the training is through

A .zip or .pkl is a pickle and can run any code when it is loaded: load only files that you trust.
"""

from __future__ import annotations

import csv
import io
import json
import platform
import re
import shlex
import subprocess
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from hoof_env._collector import paused
from hoof_env._output import check_folder, staged
from hoof_env.envs.make_env import make_env as make_env
from hoof_env.errors import OutputError
from hoof_env.evaluation.versions import PACKAGES as PACKAGES
from hoof_env.evaluation.versions import versions as versions_of_packages
from hoof_env.policies.record import describe_env as describe_env
from hoof_env.policies.record import read_record as read_record
from hoof_env.policies.saved import ABOUT, WEIGHTS, save_policy
from hoof_env.policies.saved import CHECKPOINTS as CHECKPOINTS
from hoof_env.policies.saved import STATISTICS as STATISTICS
from hoof_env.policies.saved import SavedModel as SavedModel
from hoof_env.policies.saved import TrainedPolicy as TrainedPolicy

MODEL = "model.zip"
CONFIG = "config.yml"
RECORD = "run.json"
MONITOR = "monitor.csv"
FILES = (MODEL, WEIGHTS, ABOUT, CONFIG, RECORD, MONITOR)
"""Files of a finished run without normalisation, except TensorBoard's."""

DEFAULT_ENV = "hoof_env/HorseLeg-v0"


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Create the folder and hold its lock, so that no other process works in it, else `OutputError`; a
    process that is killed leaves it free. A block that fails before it has written anything leaves nothing
    behind."""
    from filelock import FileLock, Timeout

    # What does not exist yet, deepest first: exactly this is removed again if nothing comes of it
    missing = [path for path in (folder / ".lock", folder, *folder.parents) if not path.exists()]
    check_folder(folder)
    folder.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder / ".lock")
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise OutputError(f"{folder}: another process is at work there; choose another folder") from None
    except NotImplementedError:  # filelock raises it if a system has no locks
        warnings.warn(f"{folder}: a file system that has no locks; keep other processes out", stacklevel=3)
    try:
        yield
    except BaseException:
        with suppress(OSError):  # a folder that holds something stays
            for path in missing:
                path.rmdir() if path.is_dir() else path.unlink()
        raise
    finally:
        lock.release()


@paused()
def make_vec_env(env_id: str, n_envs: int, num_threads: int = 1, **kwargs: Any) -> Any:
    """Return environments side by side as Stable-Baselines3's `VecEnv`.

    They are stepped in one call and on `num_threads` threads if the id has a vector environment of this
    package, else one after the other. A pipe to another process would cost more.
    """
    with make_env(env_id, **kwargs) as env:
        spec = env.spec
    if spec is not None and str(spec.vector_entry_point).startswith("hoof_env."):
        from hoof_env.envs.sb3 import Sb3VecEnv

        many = Sb3VecEnv(spec.id, n_envs, num_threads=num_threads, **kwargs)
        many.reset()  # the first step compiles; the training's own reset seeds all again
        many.step(np.zeros((n_envs, *(many.action_space.shape or ())), np.float32))
        return many
    from stable_baselines3.common.vec_env import DummyVecEnv

    # Checks are for a first look at an environment, and slow
    return DummyVecEnv([lambda: make_env(env_id, disable_env_checker=True, **kwargs)] * n_envs)


def warm_up(env: gym.Env[Any, Any]) -> None:
    """Compile or load the kernels by one step."""
    env.reset(seed=0)
    env.step(env.action_space.sample())


def command() -> str:
    """Return the command that runs, as a user would type it."""
    return shlex.join(["python", *sys.orig_argv[1:]])


def versions() -> dict[str, str]:
    """Return Python, platform, the packages that a result depends on, and the git commit if there is one."""
    packages = versions_of_packages()
    with suppress(OSError, subprocess.SubprocessError):
        command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--abbrev=12"]
        packages["commit"] = subprocess.run(
            command, capture_output=True, text=True, check=True, timeout=10
        ).stdout.strip()
    return packages


def processor() -> str:
    """Return the name of this machine's processor."""
    path = Path("/proc/cpuinfo")
    name = re.search(r"^model name\s*: (.*)$", path.read_text() if path.exists() else "", re.M)
    return name[1] if name else platform.processor() or "unknown"


def write_text(path: Path, text: str) -> None:
    """Write a text file that replaces an older one only when it is complete; `OutputError` if it cannot."""
    with staged(path.parent) as stage:
        (stage / path.name).write_text(text, encoding="utf-8")


def write_csv(
    path: Path, columns: Sequence[str], rows: Sequence[Mapping[str, Any]], number: str = "{}"
) -> None:
    """Write a CSV file, whole or not at all; `number` formats its cells."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({key: number.format(x) for key, x in row.items() if x is not None})
    write_text(path, text.getvalue())


def write_record(folder: Path, record: dict[str, Any]) -> None:
    """Write run.json."""
    write_text(folder / RECORD, json.dumps(record, indent=2) + "\n")


def read_episodes(folder: Path) -> NDArray[np.float64]:
    """Read the episodes of a training from monitor.csv, shape (episodes, 3): steps of the training at the end
    of each, its return, and the seconds of the training by then."""
    with (folder / MONITOR).open(encoding="utf-8", newline="") as file:
        next(file)  # a comment
        rows = [(float(row["l"]), float(row["r"]), float(row["t"])) for row in csv.DictReader(file)]
    episodes = np.array(rows, dtype=float).reshape(-1, 3)
    # Lengths to steps of the training
    episodes[:, 0] = episodes[:, 0].cumsum()
    return episodes


def save_model(model: Any, path: Path) -> None:
    """Write an SB3 model, its policy as plain data, and the statistics of its `VecNormalize` if it has one,
    never half a file."""
    with staged(path.parent) as stage:
        write_model(model, stage, path.name)


def write_model(model: Any, folder: Path, name: str = MODEL) -> None:
    """Write the files of `save_model` straight into `folder`."""
    model.save(folder / name)
    save_policy(model, folder)
    if model.get_vec_normalize_env() is not None:
        model.get_vec_normalize_env().save(str(folder / STATISTICS))
