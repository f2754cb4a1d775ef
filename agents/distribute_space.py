"""What a sweep or a search varies: `key=[...]` lists values, all of which are run;
`key=loguniform(1e-4, 1e-2)` draws one for each sample. Names and arguments are those of ray.tune."""

from __future__ import annotations

import ast
import inspect
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from agents.settings import algorithm_class
from hoof_env.errors import ParameterError

DRAWS = {
    name: count
    for count, names in {
        1: "choice",
        2: "uniform loguniform randint lograndint",
        3: "quniform qloguniform qrandint qlograndint",
    }.items()
    for name in names.split()
}
"""Distributions of ray.tune, with the number of their arguments."""

ENV = "env."
"""Before the name of an argument of the environment."""


@dataclass(frozen=True)
class Axis:
    """One thing that is varied: `values` to run all of, or a distribution of `DRAWS` with its arguments."""

    key: str
    draw: str
    arguments: tuple[Any, ...]

    @property
    def values(self) -> list[Any]:
        """Those that are listed, or the arguments of the distribution: something of the right kind to try."""
        return list(self.arguments[0]) if self.draw in ("grid_search", "choice") else list(self.arguments[:2])

    def build(self) -> Any:
        """The same for Tune.

        Raises:
            ParameterError: Tune refuses the arguments.
        """
        from ray import tune

        try:
            built = getattr(tune, self.draw)(*self.arguments)
            if self.draw != "grid_search":
                built.sample()
        except (TypeError, ValueError, ArithmeticError, AssertionError) as error:
            said = f"--space {self.key}: {self.draw}{self.arguments} cannot be drawn from: {error}"
            raise ParameterError(said) from None
        return built


def parse_space(items: Sequence[str]) -> list[Axis]:
    """Read `key=[...]` and `key=distribution(...)`.

    >>> parse_space(["n_steps=[16, 32]", "learning_rate=loguniform(1e-4, 1e-2)"])
    [Axis(key='n_steps', draw='grid_search', arguments=([16, 32],)), \
Axis(key='learning_rate', draw='loguniform', arguments=(0.0001, 0.01))]

    Raises:
        ParameterError: an item is neither, or a key comes twice.
    """
    axes: dict[str, Axis] = {}
    for item in items:
        key, _, text = item.partition("=")
        draw, arguments = _read(text)
        given = len(arguments) and (draw not in ("grid_search", "choice") or arguments[0])
        if not key or not given or len(arguments) != DRAWS.get(draw, 1):
            told = ", ".join(f"{name}({', '.join('abq'[:count])})" for name, count in DRAWS.items())
            raise ParameterError(f"--space: expected key=[JSON, ...] or key=draw of {told}; got {item!r}")
        if key in axes:
            raise ParameterError(f"--space: {key} is given twice")
        axes[key] = Axis(key, draw, arguments)
    return list(axes.values())


def _read(text: str) -> tuple[str, tuple[Any, ...]]:
    """Name and arguments of what stands behind the equals sign; no arguments where it cannot be read."""
    try:
        listed = json.loads(text)
        return "grid_search", (listed,) if isinstance(listed, list) else ()
    except json.JSONDecodeError:
        pass
    try:
        call = ast.parse(text.strip(), mode="eval").body
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in DRAWS:
            arguments = tuple(ast.literal_eval(node) for node in call.args)
            if not call.keywords and (call.func.id != "choice" or isinstance(arguments[0], list)):
                return call.func.id, arguments
    except (SyntaxError, ValueError, IndexError):
        pass
    return "", ()


def check_keys(axes: Iterable[Axis], algo: str, settings: Iterable[str]) -> None:
    """Refuse keys that are neither hyperparameters of `algo`, nor in its `settings`, nor an environment's.

    Raises:
        ParameterError: an unknown key.
    """
    known = {*inspect.signature(algorithm_class(algo)).parameters, *settings, "normalize", "n_envs"}
    known -= {"env", "seed", "device", "_init_setup_model", "verbose", "tensorboard_log", "n_timesteps"}
    for axis in axes:
        if axis.key not in known and not axis.key.startswith(ENV):
            raise ParameterError(
                f"--space: expected a hyperparameter of {algo} ({', '.join(sorted(known))}) or {ENV}ARGUMENT "
                f"of the environment, got {axis.key!r}"
            )
