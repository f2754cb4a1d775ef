"""Rows of a vector environment, as Gymnasium's own vector environments let callers reach them: generators and
attributes of each environment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from hoof_env.envs.base import fixed_setting
from hoof_env.errors import ParameterError, all_of, count

UNKNOWN_SEED = -1  # as Gymnasium says it

PER_ENV = (
    "weight",
    "render",
    "episode_summary",
    "raw_observation",
    "record",
    "np_random",
    "np_random_seed",
    "action_for",
)
"""What each environment has of its own; the rest is of all."""

SINGLE_SPACES = {"action_space": "single_action_space", "observation_space": "single_observation_space"}


class RowSeeds:
    """Generators of the rows, seeded as Gymnasium's `SyncVectorEnv` seeds its environments."""

    num_envs: int
    _generators: list[np.random.Generator]
    _seeds: list[int]

    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:
        """The generator of each environment. One that is assigned seeds them all; a list has one for each."""
        if not self._generators:
            self._new_generators([None] * self.num_envs)
        return tuple(self._generators)

    @np_random.setter
    def np_random(self, value: np.random.Generator | Sequence[np.random.Generator]) -> None:
        given: Any = value
        if isinstance(given, np.random.Generator):
            self._new_generators(given.integers(2**63, size=self.num_envs).tolist())
        elif not isinstance(given, (list, tuple)) or len(given) != self.num_envs:
            raise ParameterError(
                f"np_random: expected a generator, or a list of {self.num_envs}, got {value!r:.80}"
            )
        else:
            self._generators = list(all_of("np_random", given, np.random.Generator))
        self._seeds = [UNKNOWN_SEED] * self.num_envs

    @property
    def np_random_seed(self) -> tuple[int, ...]:
        """What each environment was seeded with, as Gymnasium's `SyncVectorEnv` says it; -1 where a generator
        was assigned or came with a state."""
        return (*self._seeds,) if self.np_random else ()

    def _seed(self, seed: Any, mask: NDArray[np.bool_]) -> None:
        n = self.num_envs
        if isinstance(seed, (list, tuple, np.ndarray)):
            if len(seed) != n:
                raise ParameterError(f"seed: expected one number or {n}, got {len(seed)}")
            seeds = [None if value is None else count("seed", value, low=0) for value in seed]
        else:
            seeds = [None if seed is None else count("seed", seed, low=0) + env for env in range(n)]
        if not self._generators:
            self._new_generators(seeds)
            return
        for env in np.flatnonzero(mask):
            if seeds[env] is not None:
                self._generators[env], self._seeds[env] = seeding.np_random(seeds[env])

    def _new_generators(self, seeds: Sequence[int | None]) -> None:
        made = [seeding.np_random(seed) for seed in seeds]
        self._generators = [one for one, _ in made]
        self._seeds = [seed for _, seed in made]


class RowAttributes:
    """Methods and attributes of the rows, by `call`, `get_attr` and `set_attr` as of `SyncVectorEnv`."""

    num_envs: int
    np_random: Any
    batch: Any
    record: Any
    _attributes: dict[str, dict[int, Any]]

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """What a method or attribute of each environment gives, as of Gymnasium's `SyncVectorEnv`.

        Args:
            name: of `HorseLegEnv`, or set by `set_attr`. What belongs to all together, as `get_state`, is
                asked once, and there for each.
            args, kwargs: of the method.

        Raises:
            AttributeError: there is none of that name.
            ParameterError: "reset" or "step", which take arrays of all.
        """
        return tuple(self.call_on(name, range(self.num_envs), *args, **kwargs))

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each environment; as `call`."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Remember something for `get_attr`: a list or tuple has a value for each, anything else is for all.
        "np_random" gives each its generator.

        Raises:
            FixedSettingError: a setting or another attribute that the environments have.
            ParameterError: not one value each.
        """
        each = list(values) if isinstance(values, (list, tuple)) else [values] * self.num_envs
        if len(each) != self.num_envs:
            raise ParameterError(f"values: expected one or {self.num_envs}, got {len(each)}")
        self.set_attr_of(name, dict(enumerate(each)))

    def set_attr_of(self, name: str, values: Mapping[int, Any]) -> None:
        """`set_attr` of some environments, each with a value."""
        if name == "np_random":
            self.np_random = [values.get(env, one) for env, one in enumerate(self.np_random)]
            return
        if hasattr(self.batch.settings, name) or hasattr(self, name) or hasattr(self.batch, name):
            raise fixed_setting(name)
        self._attributes.setdefault(name, {}).update(values)

    def call_on(self, name: str, envs: Iterable[int], *args: Any, **kwargs: Any) -> list[Any]:
        """`call` of some environments."""
        chosen = list(envs)
        if name == "get_wrapper_attr":
            return self.call_on(*args, chosen, **kwargs)
        if name == "has_wrapper_attr":
            return [self._has(env, *args, **kwargs) for env in chosen]
        if name in self._attributes:
            if lacks := [env for env in chosen if env not in self._attributes[name]]:
                raise AttributeError(f"environments {lacks} have no attribute {name!r}")
            return [self._attributes[name][env] for env in chosen]
        if name in ("reset", "step"):
            raise ParameterError(f"call: {name!r} is of all together; expected envs.{name}(...)")
        if name == "record":
            return [self.record(env) for env in chosen]
        name = SINGLE_SPACES.get(name, name)
        owner: Any = self if hasattr(self, name) else self.batch
        if name.startswith("_") or not hasattr(owner, name):
            raise AttributeError(f"{type(self).__name__}: the environments have no attribute {name!r}")
        value = getattr(owner, name)
        value = value(*args, **kwargs) if callable(value) else value
        if name not in PER_ENV or value is None:
            return [value] * len(chosen)
        if isinstance(value, dict):
            return [{key: values[env] for key, values in value.items()} for env in chosen]
        return [value[env] for env in chosen]

    def _has(self, env: int, name: str) -> bool:
        try:
            self.call_on(name, [env])
        except AttributeError:
            return False
        return True
