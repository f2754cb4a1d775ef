"""The folder of one training run: what stands in it, how it is written and how a model is read back.

    model.zip         the trained model (Stable-Baselines3)
    vecnormalize.pkl  statistics, only where the hyperparameters ask for normalisation
    config.yml        the hyperparameters that were used, in rl-baselines3-zoo's form
    run.json          environment, spaces, command, arguments, versions
    monitor.csv       return, length and time of every training episode
    checkpoints/      models on the way
    tensorboard/      curves

A model file is a pickle and can run any code when it is loaded: load only files that you trust.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import gymnasium as gym

from hoof_env.errors import OutputError, ParameterError

PACKAGES = ("hoof-env", "numpy", "gymnasium", "numba", "stable-baselines3", "torch")


def make_folder(path: Path) -> Path:
    """Make `path` and check that it takes a file, or raise `OutputError`."""
    probe = path / f".probe-{os.getpid()}"
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OutputError(
            f"cannot write into {path}: {error.strerror}; expected a folder that can be written"
        ) from None
    return path


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary name beside `path`, and put it in the place of `path` only when the block has succeeded."""
    partial = path.with_name(f".{path.stem}-{os.getpid()}{path.suffix}")
    try:
        yield partial
        os.replace(partial, path)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from None
    finally:
        with suppress(OSError):
            partial.unlink()


def save_model(model: Any, path: Path) -> Path:
    """Write an SB3 model, and the statistics of its `VecNormalize` if it has one, without ever leaving half a file."""
    with replacing(path) as partial, partial.open("wb") as file:
        model.save(file)
    statistics = model.get_vec_normalize_env()
    if statistics is not None:
        with replacing(path.with_name("vecnormalize.pkl")) as partial:
            statistics.save(str(partial))
    return path


def write_json(path: Path, data: Any) -> None:
    """Write `data` as JSON, replacing `path` at once."""
    with replacing(path) as partial:
        partial.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")


def versions() -> dict[str, str]:
    """Python, platform, the packages that a result depends on, and the git commit of this checkout where there is one."""
    found = {"python": platform.python_version(), "platform": f"{platform.system()} {platform.machine()}"}
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    with suppress(OSError, subprocess.SubprocessError):
        command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty", "--abbrev=12"]
        found["commit"] = subprocess.run(
            command, capture_output=True, text=True, check=True, timeout=10
        ).stdout.strip()
    return found


def make_env(env_id: str, **kwargs: Any) -> gym.Env[Any, Any]:
    """`gymnasium.make`, with the ids of `hoof_env` registered.

    Raises:
        ParameterError: unknown id, or an argument that the environment does not take.
    """
    import hoof_env  # noqa: F401  (registers the environments)

    try:
        return gym.make(env_id, **kwargs)
    except (gym.error.Error, ModuleNotFoundError, TypeError) as error:
        raise ParameterError(f"environment {env_id!r} with {kwargs or 'no arguments'}: {error}") from None


def describe_spaces(env: gym.Env[Any, Any]) -> dict[str, str]:
    """Both spaces as text, kept beside a model and compared before it is used."""
    return {"observation_space": str(env.observation_space), "action_space": str(env.action_space)}
