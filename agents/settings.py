"""Hyperparameters in rl-baselines3-zoo's YAML format, read by the zoo's own rules but without `eval`."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from hoof_env.errors import DataFileError

FOLDER = Path(__file__).parent / "hyperparams"
SCHEDULED = ("learning_rate", "clip_range", "clip_range_vf")
"""Keys that may hold `lin_<x>`: falling linearly from x to zero over the training."""


def load_settings(path: Path, env_id: str) -> dict[str, Any]:
    """The entry of `env_id` in the YAML file at `path`, else its `default`, as plain data.

    Raises:
        DataFileError: no such file, not YAML, or neither entry is a mapping with n_envs and n_timesteps.
    """
    try:
        entries = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
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


def model_arguments(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The part of `settings` that the algorithm's constructor takes, schedules and network arguments built.

    Raises:
        DataFileError: a schedule or `policy_kwargs` is not in the zoo's form.
    """
    from stable_baselines3.common.utils import LinearSchedule

    arguments = {
        key: value for key, value in settings.items() if key not in ("n_envs", "n_timesteps", "normalize")
    }
    for key in SCHEDULED:
        value = arguments.get(key)
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


def _dict_call(text: str) -> dict[str, Any]:
    """Read the zoo's `dict(net_arch=[64, 64], activation_fn=nn.ReLU)` without running it as code."""
    from torch import nn

    def value(node: ast.expr) -> Any:
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
