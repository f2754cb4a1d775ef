"""Environments by their ids, with errors that name what was asked for."""

from __future__ import annotations

from typing import Any

import gymnasium as gym

from hoof_env.errors import ParameterError


def make_env(env_id: str, **kwargs: Any) -> gym.Env[Any, Any]:
    """Call `gymnasium.make`; `ParameterError` for an unknown id, or an argument that the environment does not
    take."""
    try:
        return gym.make(env_id, **kwargs)
    except ParameterError:
        raise
    except (gym.error.Error, ModuleNotFoundError, TypeError) as error:
        raise ParameterError(
            f"environment {env_id!r} with {kwargs or 'no arguments'}: expected a registered id and arguments "
            f"that it takes: {error}"
        ) from None
