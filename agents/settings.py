"""Hyperparameters in rl-baselines3-zoo's YAML format, read by the zoo's own rules but without `eval`."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import numpy as np
import yaml

from hoof_env._collector import paused
from hoof_env.errors import DataFileError
from hoof_env.policies.saved import ALGORITHMS as ALGORITHMS
from hoof_env.policies.saved import algorithm_class as library_class

Algorithm = Literal["ppo", "ppo_flat", "ppo_lagrangian", "sac", "td3", "tqc"]
"""Names of `ALGORITHMS` and our own, for the commands."""

OWN = {"ppo_flat": "FlatPPO", "ppo_lagrangian": "LagrangianPPO"}
"""Classes of our own algorithms, each in the module of its name."""


def algorithm_class(name: str) -> Any:
    """Return the class of an algorithm, one of this folder's or one of `saved.algorithm_class`."""
    if name not in OWN:
        return library_class(name)
    with paused():
        return getattr(import_module(f"agents.{name}"), OWN[name])


@dataclass(frozen=True)
class TrainingArgs:
    """Arguments of every command that trains."""

    env_id: str = "hoof_env/HorseLeg-v0"
    """registered environment; module:id imports the module first"""
    algo: Algorithm = "ppo"
    """algorithm of Stable-Baselines3 or sb3-contrib, with its file in agents/hyperparams"""
    steps: int | None = None
    """environment steps of a training, rounded up to whole rollouts (n_steps times n_envs); otherwise
    n_timesteps of the hyperparameter file"""
    env_kwargs: tuple[str, ...] = ()
    """arguments of the environment: key=value ..., or one JSON object"""
    params: tuple[str, ...] = ()
    """hyperparameters to change: key=value ..., or one JSON object"""


FOLDER = Path(__file__).parent / "hyperparams"
ENV = "env."  # before the name of an argument of the environment where hyperparameters may stand, too

COUNTED = ("n_epochs", "n_steps", "batch_size", "buffer_size", "policy_delay")
"""Keys that hold whole numbers of 1 or more; not all are looked at before they are used."""
NORMALIZE = {"training": bool, "norm_obs": bool, "norm_reward": bool} | dict.fromkeys(
    ("clip_obs", "clip_reward", "gamma", "epsilon"), (int, float)
)
"""Arguments of `VecNormalize` that the key `normalize` may hold, and their types."""
SCHEDULED = ("learning_rate", "clip_range", "clip_range_vf")
"""Keys that may hold `lin_<x>`: falling linearly from x to zero over the training."""


def load_settings(path: Path, env_id: str) -> dict[str, Any]:
    """Return the entry of `env_id` in the YAML file at `path`, else its `default`, as plain data.

    Raises:
        DataFileError: there is no such file, it is not YAML, or neither entry is a mapping with n_envs,
            n_timesteps and policy.
    """
    try:
        entries = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        raise DataFileError(f"hyperparameter file {path}: expected readable YAML: {error}") from None
    if not isinstance(entries, Mapping):
        raise DataFileError(
            f"hyperparameter file {path}: expected a mapping of environment ids, got {entries!r}"
        )
    entry = entries.get(env_id, entries.get("default"))
    if not isinstance(entry, Mapping) or not {"n_envs", "n_timesteps", "policy"} <= entry.keys():
        raise DataFileError(
            f"hyperparameter file {path}: expected an entry {env_id!r} or 'default' with "
            f"n_envs, n_timesteps and policy, got {entry!r}"
        )
    return dict(entry)


def model_arguments(settings: Mapping[str, Any], actions: int = 1) -> dict[str, Any]:
    """Return the part of `settings` that the algorithm's constructor takes; schedules, noise on `actions`
    numbers and network arguments are built.

    Raises:
        DataFileError: one of them, or a count, is not in the zoo's form.
    """
    from stable_baselines3.common.utils import LinearSchedule

    arguments = {
        key: value for key, value in settings.items() if key not in ("n_envs", "n_timesteps", "normalize")
    }
    for key in COUNTED:
        value = arguments.get(key, 1)
        if not (isinstance(value, int) and not isinstance(value, bool) and value >= 1):
            raise DataFileError(f"hyperparameter {key}: expected a whole number of 1 or more, got {value!r}")
    if isinstance(arguments.get("train_freq"), list):  # [1, episode]: YAML knows no tuple
        arguments["train_freq"] = tuple(arguments["train_freq"])
    kind = arguments.pop("noise_type", None)
    spread = arguments.pop("noise_std", 0.1)
    if kind is not None:
        arguments["action_noise"] = _action_noise(kind, spread, actions)
    for key in SCHEDULED:
        value = arguments.get(key)
        # Numbers are constant, texts are schedules
        if isinstance(value, str):
            try:
                kind, start = value.split("_")
                if kind != "lin":
                    raise ValueError
                arguments[key] = LinearSchedule(float(start), 0.0, 1.0)
            except ValueError:
                raise DataFileError(
                    f"hyperparameter {key}: expected a number or lin_<number>, got {value!r}"
                ) from None
    if isinstance(arguments.get("policy_kwargs"), str):
        arguments["policy_kwargs"] = _dict_call(arguments["policy_kwargs"])
    return arguments


def normalize_arguments(settings: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the arguments of `VecNormalize` in the key `normalize` of `settings`, None if it is false.

    Raises:
        DataFileError: it is neither true or false nor a mapping of such arguments.
    """
    normalize = settings.get("normalize") or False
    arguments = {} if isinstance(normalize, bool) else normalize
    if not isinstance(arguments, Mapping) or not all(
        isinstance(value, NORMALIZE.get(key, ())) for key, value in arguments.items()
    ):
        raise DataFileError(
            f"hyperparameter normalize: expected true, false or a mapping of {', '.join(NORMALIZE)}, "
            f"got {normalize!r}"
        )
    return {"gamma": settings.get("gamma", 0.99), **arguments} if normalize else None


def _action_noise(kind: Any, spread: Any, actions: int) -> Any:
    """Return the noise on `actions` numbers; `DataFileError` if kind or spread is malformed."""
    from stable_baselines3.common.noise import NormalActionNoise, OrnsteinUhlenbeckActionNoise

    known = {"normal": NormalActionNoise, "ornstein-uhlenbeck": OrnsteinUhlenbeckActionNoise}
    if kind not in known or isinstance(spread, bool) or not isinstance(spread, (int, float)) or spread < 0:
        raise DataFileError(
            f"hyperparameters noise_type, noise_std: expected one of {', '.join(known)} and a number of 0 or "
            f"more, got {kind!r} and {spread!r}"
        )
    return known[kind](np.zeros(actions), np.full(actions, float(spread)))


def _dict_call(text: str) -> dict[str, Any]:
    """Read the zoo's `dict(net_arch=[64, 64], activation_fn=nn.ReLU)` without running it as code."""
    from torch import nn

    def value(node: ast.expr) -> Any:
        # Literals and nn.<Module> only: nothing of a file is called
        match node:
            case ast.Call(func=ast.Name(id="dict"), args=[], keywords=keywords):
                return {str(item.arg): value(item.value) for item in keywords}
            case ast.Attribute(value=ast.Name(id="nn"), attr=name):
                return getattr(nn, name)
            case _:
                return ast.literal_eval(node)

    try:
        arguments = value(ast.parse(text.strip(), mode="eval").body)
    except (SyntaxError, ValueError, AttributeError):
        arguments = None
    if not isinstance(arguments, dict):
        raise DataFileError(
            f"hyperparameter policy_kwargs: expected dict(...) of literals and nn.<Module>, got {text!r}"
        )
    return arguments
