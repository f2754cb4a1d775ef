"""What a sweep or a search varies: `key=[...]` lists values, all of which are run;
`key=loguniform(1e-4, 1e-2)` draws one for each sample. Names and arguments are those of ray.tune."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from agents.settings import algorithm_class
from hoof_env._arguments import parse_pairs
from hoof_env.errors import ParameterError

DRAWS = {
    "choice": 1, "uniform": 2, "loguniform": 2, "randint": 2, "lograndint": 2,
    "quniform": 3, "qloguniform": 3, "qrandint": 3, "qlograndint": 3,
}  # fmt: skip
"""Distributions of ray.tune, with the number of their arguments."""

LISTED = "grid_search"

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
        return list(self.arguments[0] if self.draw in (LISTED, "choice") else self.arguments[:2])

    def build(self) -> Any:
        """The same for Tune.

        Raises:
            ParameterError: Tune refuses the arguments.
        """
        from ray import tune

        try:
            built = getattr(tune, self.draw)(*self.arguments)
            if self.draw != LISTED:
                built.sample()
        except (TypeError, ValueError, ArithmeticError, AssertionError) as error:
            reason = f"--space {self.key}: {self.draw}{self.arguments} cannot be drawn from: {error}"
            raise ParameterError(reason) from None
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
        if not key or not draw:
            known = ", ".join(f"{name}({', '.join('abq'[:count])})" for name, count in DRAWS.items())
            raise ParameterError(f"--space: expected key=[JSON, ...] or key=draw of {known}; got {item!r}")
        if key in axes:
            raise ParameterError(f"--space: {key} is given twice")
        axes[key] = Axis(key, draw, arguments)
    return list(axes.values())


def _read(text: str) -> tuple[str, tuple[Any, ...]]:
    """Name and arguments of what stands behind the equals sign; no name where it cannot be read."""
    values = parse_pairs("--space", [f"values={text}"])["values"]
    if isinstance(values, list):
        return (LISTED, (values,)) if values else ("", ())
    with suppress(SyntaxError, ValueError):
        match ast.parse(text.strip(), mode="eval").body:
            case ast.Call(func=ast.Name(id=name), args=nodes, keywords=[]) if len(nodes) == DRAWS.get(name):
                arguments = tuple(ast.literal_eval(node) for node in nodes)
                if name != "choice" or (isinstance(arguments[0], list) and arguments[0]):
                    return name, arguments
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
