"""Environments by their ids, with errors that name the id and arguments."""

from __future__ import annotations

from difflib import get_close_matches
from typing import Any

import gymnasium as gym

from hoof_env.errors import ParameterError, brief


def make_env(env_id: str, **kwargs: Any) -> gym.Env[Any, Any]:
    """Call `gymnasium.make`; `ParameterError` for an unknown id, or an argument that the environment does not
    take."""
    try:
        return gym.make(env_id, **kwargs)
    except ParameterError as error:  # first, because `UnknownArgumentError` is a TypeError, too
        raise error from None
    except (gym.error.Error, ModuleNotFoundError, TypeError) as error:
        raise ParameterError(
            f"environment {env_id!r} with {brief(kwargs) if kwargs else 'no arguments'}: expected a "
            f"registered id and arguments that it takes: {str(error).rstrip('. ')}{_alike(env_id)}"
        ) from None


def _alike(env_id: str) -> str:
    """Return a question that names the id of this package most like an unregistered one, "" without any."""
    ours = {_bare(name): name for name in gym.registry if name.startswith("hoof_env/")}
    found = get_close_matches(_bare(env_id), ours, 1, 0.7)
    return f"; did you mean {ours[found[0]]}?" if found and env_id not in gym.registry else ""


def _bare(env_id: str) -> str:
    """Return an id without namespace and version, in small letters."""
    return env_id.rpartition("/")[2].partition("-v")[0].lower()
