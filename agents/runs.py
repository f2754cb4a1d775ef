"""The folder of one training run: what stands in it, how it is written and how a model is read back.

    model.zip         the trained model (Stable-Baselines3)
    vecnormalize.pkl  statistics, only where the hyperparameters ask for normalisation
    config.yml        the hyperparameters that were used, in rl-baselines3-zoo's form
    run.json          environment, spaces, command, arguments, versions
    monitor.csv       return, length and time of every training episode
    checkpoints/N/    the model, and its statistics, after N steps
    tensorboard/      curves

A model file is a pickle and can run any code when it is loaded: load only files that you trust.
"""

from __future__ import annotations

import json
import platform
import shlex
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import hoof_env  # noqa: F401  (registers the environments)
from agents.settings import algorithm_class
from hoof_env._output import staged
from hoof_env.errors import DataFileError, ParameterError

FILES = ("model.zip", "config.yml", "run.json", "monitor.csv")
"""What a run without normalisation and checkpoints leaves, TensorBoard's files aside."""

STATISTICS = "vecnormalize.pkl"

PACKAGES = ("hoof-env", "numpy", "gymnasium", "numba", "stable-baselines3", "sb3-contrib", "torch")


def make_env(env_id: str, **kwargs: Any) -> gym.Env[Any, Any]:
    """`gymnasium.make`, refusals in our words.

    Raises:
        ParameterError: unknown id, or an argument that the environment does not take.
    """
    try:
        return gym.make(env_id, **kwargs)
    except (gym.error.Error, ModuleNotFoundError, TypeError) as error:
        raise ParameterError(f"environment {env_id!r} with {kwargs or 'no arguments'}: {error}") from None


def make_vec_env(env_id: str, n_envs: int, **kwargs: Any) -> Any:
    """Environments side by side as Stable-Baselines3's `VecEnv`: in one call where the id has a vector
    environment of this package, else one after the other. A pipe to another process would cost more.

    Raises:
        ParameterError: as `make_env`.
    """
    with make_env(env_id, **kwargs) as env:
        spec = env.spec
    if spec is not None and str(spec.vector_entry_point).startswith("hoof_env."):
        from hoof_env.envs.sb3 import Sb3VecEnv

        many = Sb3VecEnv(spec.id, n_envs, **kwargs)
        many.reset()  # the first step compiles; the training's own reset seeds all again
        many.step(np.zeros((n_envs, *(many.action_space.shape or ())), np.float32))
        return many
    from stable_baselines3.common.vec_env import DummyVecEnv

    return DummyVecEnv([lambda: make_env(env_id, disable_env_checker=True, **kwargs)] * n_envs)


def warm_up(env: gym.Env[Any, Any]) -> None:
    """Reset and step once, so that kernels are compiled before anything is timed."""
    env.reset(seed=0)
    env.step(env.action_space.sample())


def command() -> str:
    """The command that started this process."""
    return shlex.join(["python", *sys.orig_argv[1:]])


def describe_spaces(env: Any) -> dict[str, str]:
    """Both spaces of an environment or a model as text, to be kept beside a model and compared."""
    return {"observation_space": str(env.observation_space), "action_space": str(env.action_space)}


def versions() -> dict[str, str]:
    """Python, platform, the packages that a result depends on, and the git commit where there is one."""
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


def write_text(path: Path, text: str) -> None:
    """Write a text file that replaces an older one only when it is complete; `OutputError` if it cannot."""
    with staged(path.parent) as stage:
        (stage / path.name).write_text(text, encoding="utf-8")


def save_model(model: Any, path: Path) -> None:
    """Write an SB3 model, and the statistics of its `VecNormalize` if it has one, never half a file."""
    with staged(path.parent) as stage:
        model.save(stage / path.name)
        if model.get_vec_normalize_env() is not None:
            model.get_vec_normalize_env().save(str(stage / STATISTICS))


@dataclass(frozen=True)
class SavedModel:
    """A model file and what its run folder says about it; nothing has been unpickled yet.

    Attributes:
        path: of the .zip.
        record: content of run.json, empty where there is none.
    """

    path: Path
    record: dict[str, Any]

    @classmethod
    def find(cls, path: Path) -> SavedModel:
        """The model at `path`, which is a .zip or a run folder.

        Raises:
            DataFileError: there is none, or its run.json cannot be read.
        """
        file = path / "model.zip" if path.is_dir() else path
        if not file.is_file():
            raise DataFileError(
                f"model {path}: expected a .zip of agents.train or its run folder, found no {file}"
            )
        for folder in file.parents[:3:2]:  # a checkpoint is two deeper
            beside = folder / "run.json"
            if beside.is_file():
                try:
                    record = json.loads(beside.read_text(encoding="utf-8"))
                    return cls(file, {**record, "env_id": record["env_id"], "algo": record["algo"]})
                except (OSError, ValueError, TypeError, KeyError) as error:
                    raise DataFileError(
                        f"{beside}: expected the JSON object of agents.train with env_id and algo: {error!r}"
                    ) from None
        return cls(file, {})

    def load(self, env: gym.Env[Any, Any], env_id: str) -> TrainedPolicy:
        """Unpickle the model for `env`. This can run any code that the file holds.

        Raises:
            DataFileError: not a model, or one for another environment or other spaces.
        """
        self._check(self.record, {"env_id": env_id, **describe_spaces(env)})

        from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

        algorithm = algorithm_class(self.record.get("algo", "ppo"))
        statistics, normalize = self.path.with_name(STATISTICS), None
        try:
            model = algorithm.load(self.path, device="cpu")
            if statistics.is_file():
                normalize = VecNormalize.load(str(statistics), DummyVecEnv([lambda: env])).normalize_obs
        except Exception as error:  # a damaged pickle may raise anything
            reason = f"{type(error).__name__}: {error}".splitlines()[0]
            raise DataFileError(
                f"model {self.path}: expected a model saved by Stable-Baselines3, cannot read it ({reason})"
            ) from None
        self._check(describe_spaces(model), describe_spaces(env))
        return TrainedPolicy(model, normalize)

    def _check(self, found: dict[str, Any], wanted: dict[str, str]) -> None:
        for key, value in wanted.items():
            if found.get(key, value) != value:
                raise DataFileError(f"model {self.path}: trained for {key} {found[key]}, expected {value}")


@dataclass(frozen=True)
class TrainedPolicy:
    """A trained policy that sees observations as it saw them in training.

    Attributes:
        model: of Stable-Baselines3.
        normalize: of the `VecNormalize` it was trained with, or None.
    """

    model: Any
    normalize: Any

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Action for an observation of the environment."""
        if self.normalize is not None:
            observation = self.normalize(observation)
        return self.model.predict(observation, state, episode_start, deterministic)
