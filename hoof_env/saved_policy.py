"""Trained policies as `agents.train` leaves them, found and read: run folders, checkpoints and .zip files.

Needs the extra "train". A .zip or .pkl is a pickle and can run any code when it is loaded: load only files
that you trust.
"""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym

from hoof_env._version import __version__
from hoof_env.errors import DataFileError
from hoof_env.onnx_policy import settings_of
from hoof_env.plain_policy import ABOUT, WEIGHTS, algorithm_class, load_policy

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


def describe_spaces(env: Any) -> dict[str, str]:
    """Both spaces of an environment or a model as text, to be kept beside a model and compared."""
    return {"observation_space": str(env.observation_space), "action_space": str(env.action_space)}


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
        if made_with not in (None, __version__):
            unlike.append(f"hoof-env {made_with}, here {__version__}")
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
