"""The folder of one training run: what stands in it, how it is written and how a model is read back.

    policy.*          the trained policy as plain data (agents/safe.py): this is what is loaded
    model.zip         the trained model (Stable-Baselines3)
    vecnormalize.pkl  statistics, only where the hyperparameters ask for normalisation
    config.yml        the hyperparameters that were used, in rl-baselines3-zoo's form
    run.json          environment, its settings and spaces, command, arguments, versions; when it is through,
                      steps and seconds under "finished"
    monitor.csv       return, length and time of every training episode
    checkpoints/N/    what `--resume` goes on from (agents/checkpoints.py), until the training is through
    tensorboard/      curves
    .lock             held while a process works here

A .zip or .pkl is a pickle and can run any code when it is loaded: load only files that you trust.
"""

from __future__ import annotations

import json
import platform
import shlex
import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import hoof_env  # also registers the environments
from agents.safe import ABOUT, WEIGHTS, load_policy, save_policy
from agents.settings import algorithm_class
from hoof_env._output import check_folder, staged
from hoof_env.errors import DataFileError, OutputError, ParameterError
from hoof_env.onnx_policy import settings_of

FILES = ("model.zip", WEIGHTS, ABOUT, "config.yml", "run.json", "monitor.csv")
"""What a run without normalisation leaves, TensorBoard's files aside."""

STATISTICS = "vecnormalize.pkl"
CHECKPOINTS = "checkpoints"

RECORD = {
    "env_kwargs": dict,
    "settings": dict,
    "args": dict,
    "versions": dict,
    "finished": dict,
    "resumed": list,
}
"""What run.json may hold besides env_id and algo, where its kind matters."""

PACKAGES = ("hoof-env", "numpy", "gymnasium", "numba", "stable-baselines3", "sb3-contrib", "torch")


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """The folder is there and nobody else works in it meanwhile; a process that is killed leaves it free.
    A block that fails before it has written anything leaves nothing behind.

    Raises:
        OutputError: another process is at work there, or it cannot be written.
    """
    from filelock import FileLock, Timeout

    made = [path for path in (folder / ".lock", folder, *folder.parents) if not path.exists()]
    check_folder(folder)
    lock = FileLock(folder / ".lock")
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise OutputError(f"{folder}: another process is at work there; choose another folder") from None
    try:
        yield
    except BaseException:
        with suppress(OSError):  # a folder that holds something stays
            for path in made:
                path.rmdir() if path.is_dir() else path.unlink()
        raise
    finally:
        lock.release()


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
    """Write an SB3 model, its policy as plain data, and the statistics of its `VecNormalize` if it has one,
    never half a file."""
    with staged(path.parent) as stage:
        write_model(model, stage, path.name)


def write_model(model: Any, folder: Path, name: str = "model.zip") -> None:
    """As `save_model`, straight into `folder`."""
    model.save(folder / name)
    save_policy(model, folder)
    if model.get_vec_normalize_env() is not None:
        model.get_vec_normalize_env().save(str(folder / STATISTICS))


def describe_env(env: gym.Env[Any, Any]) -> dict[str, Any]:
    """What a policy for an environment depends on, as JSON gives it back: spaces and all settings."""
    settings = settings_of(env)
    return describe_spaces(env) | ({"settings": settings} if settings else {})


def read_record(folder: Path) -> dict[str, Any]:
    """The content of run.json in `folder`; empty if there is none.

    Raises:
        DataFileError: it cannot be read, or is not what agents.train writes.
    """
    path = folder / "run.json"
    if not path.is_file():
        return {}
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        kinds = {"env_id": str, "algo": str} | {key: kind for key, kind in RECORD.items() if key in record}
        if unlike := [key for key, kind in kinds.items() if not isinstance(record[key], kind)]:
            raise TypeError(f"{unlike[0]}: {record[unlike[0]]!r}")
        if "finished" in record:
            steps, seconds = record["finished"]["steps"], record["finished"]["seconds"]
            record["finished"] |= {"steps": int(steps), "seconds": float(seconds)}
        return dict(record)
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise DataFileError(
            f"{path}: expected the JSON object of agents.train with env_id and algo: {error!r}"
        ) from None


@dataclass(frozen=True)
class SavedModel:
    """A model file and what its run folder says about it; nothing has been read into it yet.

    Attributes:
        path: of model.zip or another .zip; beside a model.zip the policy as plain data is what is loaded.
        record: content of run.json, empty where there is none.
    """

    path: Path
    record: dict[str, Any]

    @classmethod
    def find(cls, path: Path) -> SavedModel:
        """The model at `path`: a .zip, or a run folder, whose last checkpoint serves until it has a model.

        Raises:
            DataFileError: there is none, or its run.json cannot be read.
        """
        saved = cls(path / "model.zip" if path.is_dir() else path, {})
        if path.is_dir() and not (saved.path.is_file() or saved.is_plain):
            found = [one for one in (path / CHECKPOINTS).glob("*") if one.name.isdigit()]
            saved = cls(max(found, key=lambda one: int(one.name), default=path) / "model.zip", {})
        if not (saved.path.is_file() or saved.is_plain):
            raise DataFileError(
                f"model {path}: expected a .zip of agents.train or its run folder, found no {saved.path}"
            )
        for folder in saved.path.parents[:3:2]:  # a checkpoint is two deeper
            if record := read_record(folder):
                return cls(saved.path, record)
        return saved

    @property
    def is_plain(self) -> bool:
        """Whether it can be read without running code of the file."""
        beside = self.path.with_name(ABOUT), self.path.with_name(WEIGHTS)
        return self.path.name == "model.zip" and all(file.is_file() for file in beside)

    def load(self, env: gym.Env[Any, Any], env_id: str) -> TrainedPolicy:
        """The policy for `env`, from plain data where there is some; else a .zip is unpickled, which can run
        any code that it holds, and a warning says so. Warns, too, of other settings or another hoof-env.

        Raises:
            DataFileError: not a model, or one for another environment or other spaces.
        """
        here = {"env_id": env_id, **describe_env(env)}
        self._refuse(self.record, here)
        self._warn(here.get("settings"))
        if self.is_plain:
            model, normalize = load_policy(self.path.parent)
        else:
            warnings.warn(f"{self.path} is a pickle, which can run any code: trusted?", stacklevel=2)
            model, normalize = self._unpickle(env)
        self._refuse(describe_spaces(model), here)
        return TrainedPolicy(model, normalize)

    def _unpickle(self, env: gym.Env[Any, Any]) -> tuple[Any, Any]:
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
        return model, normalize

    def _refuse(self, there: dict[str, Any], here: dict[str, Any]) -> None:
        keys = ("env_id", "observation_space", "action_space")
        unlike = [
            f"{key} {there[key]}, expected {here[key]}"
            for key in keys
            if there.get(key, here[key]) != here[key]
        ]
        if unlike:
            versions = [str(one.get("env_id")).rpartition("-v") for one in (there, here)]
            if versions[0][0] == versions[1][0] != "" and versions[0][2] != versions[1][2]:
                unlike.append("another version of an id is another task")
            raise DataFileError(f"model {self.path}: trained for {'; '.join(unlike)}")

    def _warn(self, here: dict[str, Any] | None) -> None:
        there, made_with = self.record.get("settings"), self.record.get("versions", {}).get("hoof-env")
        unlike = []
        if there is not None and here is not None:
            names = sorted(key for key in {*there, *here} if there.get(key) != here.get(key))
            unlike = [f"{key}={there.get(key)!r}, here {here.get(key)!r}" for key in names]
        if made_with not in (None, hoof_env.__version__):
            unlike.append(f"hoof-env {made_with}, here {hoof_env.__version__}")
        if unlike:
            warnings.warn(f"model {self.path}: trained with {'; '.join(unlike)}", stacklevel=3)


@dataclass(frozen=True)
class TrainedPolicy:
    """A trained policy that sees observations as it saw them in training.

    Attributes:
        model: of Stable-Baselines3; nothing but its policy is there when it was read from plain data.
        normalize: observations as the policy saw them in training, or None.
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
