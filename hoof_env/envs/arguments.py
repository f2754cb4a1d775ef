"""Keyword arguments of the environments, for type checkers and editors.

The fields of `Settings` are keyword arguments of every environment; the classes here add the rest. A
decorator gives the constructor of an environment the parameters of such a class.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Concatenate, ParamSpec, TypeVar, get_type_hints

from gymnasium.vector import AutoresetMode

from hoof_env.render.size import USUAL_SIZE
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
    """Return a decorator that gives a constructor the parameters of a class, for type checkers, editors and
    `help`. What the constructor does stays the same.

    Args:
        arguments: class with these parameters.
    """

    def describe(constructor: Callable[Concatenate[Made, Parameters], None]) -> Any:
        # The bare types: the descriptions of the settings would hide their names.
        types = get_type_hints(arguments)
        taken = inspect.signature(arguments).parameters.values()
        itself = inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD)
        described: Any = constructor
        described.__signature__ = inspect.Signature(
            [itself, *(each.replace(annotation=types[each.name]) for each in taken)]
        )
        return described

    return describe
