"""Keyword arguments of the environments, for type checkers and editors.

The fields of `Settings` are keyword arguments of every environment; the classes here add the others. A
decorator gives the constructor of an environment the parameters of such a class.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Concatenate, ParamSpec, TypeVar

from gymnasium.vector import AutoresetMode

from hoof_env.render.renderer import USUAL_SIZE
from hoof_env.tasks.settings import Settings

Parameters = ParamSpec("Parameters")
Made = TypeVar("Made")


@dataclass(frozen=True, kw_only=True)
class EnvArguments(Settings):
    """Arguments of `HorseLegEnv` and `HorseLegMOEnv`, which describe them."""

    task: str = "leg"
    render_mode: str | None = None
    width: int = USUAL_SIZE[0]
    height: int = USUAL_SIZE[1]


@dataclass(frozen=True, kw_only=True)
class VectorArguments(EnvArguments):
    """Arguments of `HorseLegVectorEnv`, which describes them."""

    num_envs: int = field(default=1, kw_only=False)
    num_threads: int = 1
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP
    max_episode_steps: int | None = None
    rendered: int | None = None


@dataclass(frozen=True, kw_only=True)
class Sb3Arguments(Settings):
    """Arguments of `Sb3VecEnv`, which passes all but the first to `HorseLegVectorEnv`."""

    env_id: str = field(default="hoof_env/HorseLeg-v0", kw_only=False)
    num_envs: int = field(default=64, kw_only=False)
    num_threads: int = 1
    autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP
    max_episode_steps: int | None = None
    render_mode: str | None = None
    rendered: int | None = None
    width: int = USUAL_SIZE[0]
    height: int = USUAL_SIZE[1]


def takes(
    arguments: Callable[Parameters, object],
) -> Callable[[Callable[Concatenate[Made, Parameters], None]], Callable[Concatenate[Made, Parameters], None]]:
    """Return a decorator that gives a constructor the parameters of a class, for type checkers and editors.
    When the program runs it changes nothing.

    Args:
        arguments: class with these parameters.
    """
    return lambda constructor: constructor
