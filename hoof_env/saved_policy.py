"""Trained policies as `agents.train` leaves them: run folders, checkpoints and .zip files, found and read.

    policy.safetensors  the weights
    policy.json         algorithm, kind of policy, its arguments, both spaces, statistics of the observations
    model.zip           what learns, too: optimiser, value of the exploration and counters

Needs the extra "train". Reading the first two, plain data, runs nothing that a file says (it may ask for a
large network, and so for memory). A .zip or .pkl is a pickle and can run any code: load only files that you
trust.
"""

from __future__ import annotations

import json
import math
import warnings
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from hoof_env.errors import DataFileError, ParameterError, check_choice
from hoof_env.onnx_policy import describe_spaces, settings_of, warn_of_differences

STATISTICS = "vecnormalize.pkl"
CHECKPOINTS = "checkpoints"
WEIGHTS, ABOUT = "policy.safetensors", "policy.json"
FORMAT = 1

ALGORITHMS = {
    "ppo": "stable_baselines3", "sac": "stable_baselines3", "td3": "stable_baselines3", "tqc": "sb3_contrib",
}  # fmt: skip
"""Where each algorithm lives; each has its file in agents/hyperparams."""


def algorithm_class(name: str) -> Any:
    """The class of an algorithm of `ALGORITHMS`.

    Raises:
        ParameterError: another name, or its library is not installed.
    """
    module = ALGORITHMS[check_choice("algo", name, ALGORITHMS)]
    try:
        return getattr(import_module(module), name.upper())
    except ModuleNotFoundError as error:
        raise ParameterError(
            f"algo {name}: expected {module} to be installed (pip install 'hoof-env[train]'): {error}"
        ) from None


RECORD = {
    "env_kwargs": dict, "settings": dict, "args": dict, "versions": dict, "finished": dict, "resumed": list,
}  # fmt: skip
"""What run.json may hold besides env_id and algo, where its kind matters."""


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
        there = self.record.get("settings", settings_of(env))
        made_with = self.record.get("versions", {}).get("hoof-env")
        warn_of_differences(f"model {self.path}", there, settings_of(env) or there, made_with)
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


def save_policy(model: Any, folder: Path) -> bool:
    """Write the policy of a Stable-Baselines3 model into `folder`; False, and nothing, where its arguments
    are not plain data or its spaces are not boxes."""
    from safetensors.torch import save

    normalize = model.get_vec_normalize_env()
    try:
        about = {
            "format": FORMAT,
            "algo": type(model).__name__.lower(),
            "policy": next(name for name, kind in model.policy_aliases.items() if kind is model.policy_class),
            "policy_kwargs": _plain(({"use_sde": True} if model.use_sde else {}) | model.policy_kwargs),
            "observation_space": _box(model.observation_space),
            "action_space": _box(model.action_space),
            "normalize": _statistics(normalize) if normalize is not None and normalize.norm_obs else None,
        }
        text = json.dumps(about, indent=1, allow_nan=False) + "\n"
    except (TypeError, ValueError, AttributeError, StopIteration):
        return False
    # A part that two names share is written twice: the format has no references
    weights = {
        key: value.detach().cpu().clone().contiguous() for key, value in model.policy.state_dict().items()
    }
    (folder / WEIGHTS).write_bytes(save(weights))  # save_file lets the owner alone read it
    (folder / ABOUT).write_text(text, encoding="utf-8")
    return True


def load_policy(folder: Path) -> tuple[Any, Any]:
    """The model, with nothing in it but its policy, and the function that normalises observations, or None.

    Raises:
        DataFileError: a file is missing or damaged, or does not describe a policy.
    """
    from gymnasium import spaces
    from safetensors.torch import load_file

    def box(about: dict[str, Any]) -> spaces.Box:
        kind: Any = np.dtype(about["dtype"]).type
        low, high = (
            np.array([default if x is None else x for x in about[name]], kind).reshape(about["shape"])
            for name, default in (("low", -np.inf), ("high", np.inf))
        )
        return spaces.Box(low, high, dtype=kind)

    try:
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
        if about["format"] != FORMAT:
            raise ValueError(f"format {about['format']!r}, expected {FORMAT}")
        model = algorithm_class(about["algo"])(about["policy"], None, device="cpu", _init_setup_model=False)
        model.observation_space = box(about["observation_space"])
        model.action_space = box(about["action_space"])
        model.policy_kwargs = _built(about["policy_kwargs"])
        model.policy = model.policy_class(
            model.observation_space, model.action_space, lambda _: 0.0, **model.policy_kwargs
        )
        weights = load_file(folder / WEIGHTS)
        if not all(bool(one.isfinite().all()) for one in weights.values()):
            raise ValueError(f"{WEIGHTS} holds numbers that are not finite")
        model.policy.load_state_dict(weights)
        shape = model.observation_space.shape
        normalize = _Normalizer(shape, **about["normalize"]) if about["normalize"] else None
    except ParameterError as error:
        raise DataFileError(f"model {folder / ABOUT}: {error}") from None
    except Exception as error:  # a damaged description may raise anything
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
        raise DataFileError(
            f"model {folder / ABOUT}: expected a policy written by agents.train, cannot read it ({reason})"
        ) from None
    model.policy.set_training_mode(False)
    return model, normalize


class _Normalizer:
    """Observations of a shape as `VecNormalize` shows them; its formula; `ValueError` for others."""

    def __init__(
        self, shape: tuple[int, ...], mean: list[float], var: list[float], epsilon: float, clip: float
    ) -> None:
        self.mean, self.var = np.array(mean, np.float64), np.array(var, np.float64)
        self.epsilon, self.clip = float(epsilon), float(clip)
        sound = all(one.shape == shape and np.isfinite(one).all() for one in (self.mean, self.var))
        if not sound or not (self.var + self.epsilon > 0).all() or not self.clip > 0:
            raise ValueError(f"expected statistics of observations of shape {shape}")

    def __call__(self, observation: Any) -> Any:
        scaled = (observation - self.mean) / np.sqrt(self.var + self.epsilon)
        return np.clip(scaled, -self.clip, self.clip).astype(np.float32)


def _statistics(normalize: Any) -> dict[str, Any]:
    found = {"mean": normalize.obs_rms.mean.tolist(), "var": normalize.obs_rms.var.tolist()}
    return {**found, "epsilon": float(normalize.epsilon), "clip": float(normalize.clip_obs)}


def _box(space: Any) -> dict[str, Any]:
    """A box as JSON; None for an infinite bound. `AttributeError` for another space."""
    low, high = (
        [float(x) if math.isfinite(x) else None for x in bound.ravel()] for bound in (space.low, space.high)
    )
    return {"low": low, "high": high, "shape": list(space.shape), "dtype": str(space.dtype)}


def _plain(value: Any) -> Any:
    """Arguments of a policy as JSON; `TypeError` if one cannot be told."""
    import torch

    nn: Any = torch.nn
    if isinstance(value, dict):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    name = getattr(value, "__name__", "")
    if name and getattr(nn, name, None) is value:
        return {"torch.nn": name}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError(value)


def _built(value: Any) -> Any:
    """What `_plain` gave, as the policy takes it."""
    from torch import nn

    if isinstance(value, dict):
        if value.keys() == {"torch.nn"}:
            kind = getattr(nn, str(value["torch.nn"]))
            if not (isinstance(kind, type) and issubclass(kind, nn.Module)):
                raise ValueError(f"expected the name of a torch.nn module, got {value['torch.nn']!r}")
            return kind
        return {key: _built(inner) for key, inner in value.items()}
    return [_built(inner) for inner in value] if isinstance(value, list) else value
