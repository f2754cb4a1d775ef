"""A trained policy as plain data, so that reading it runs nothing that a file says (it may ask for a large
network, and so for memory).

    policy.safetensors  the weights
    policy.json         algorithm, kind of policy, its arguments, both spaces, statistics of the observations

Holds what acts, not what learns: optimiser, value of the exploration and counters are in model.zip.
"""

from __future__ import annotations

import json
import math
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from hoof_env.errors import DataFileError, ParameterError, check_choice

WEIGHTS, ABOUT = "policy.safetensors", "policy.json"
FORMAT = 1

ALGORITHMS = {
    "ppo": "stable_baselines3",
    "sac": "stable_baselines3",
    "td3": "stable_baselines3",
    "tqc": "sb3_contrib",
}
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
        model.observation_space, model.action_space = (
            box(about["observation_space"]),
            box(about["action_space"]),
        )
        model.policy_kwargs = _built(about["policy_kwargs"])
        model.policy = model.policy_class(
            model.observation_space, model.action_space, lambda _: 0.0, **model.policy_kwargs
        )
        weights = load_file(folder / WEIGHTS)
        if not all(bool(one.isfinite().all()) for one in weights.values()):
            raise ValueError(f"{WEIGHTS} holds numbers that are not finite")
        model.policy.load_state_dict(weights)
        normalize = _Normalizer(**about["normalize"]) if about["normalize"] else None
        if normalize is not None:
            normalize.check(model.observation_space.shape)
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
    """Observations as `VecNormalize` shows them; its formula."""

    def __init__(self, mean: list[float], var: list[float], epsilon: float, clip: float) -> None:
        self.mean, self.var = np.array(mean, np.float64), np.array(var, np.float64)
        self.epsilon, self.clip = float(epsilon), float(clip)

    def check(self, shape: tuple[int, ...]) -> None:
        """`ValueError` unless these are statistics of observations of that shape."""
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
