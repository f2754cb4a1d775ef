"""Generators and attributes of the rows of a vector environment, with the interface of Gymnasium's
`SyncVectorEnv`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from hoof_env.envs.base import fixed_setting
from hoof_env.errors import ParameterError, all_of, count

UNKNOWN_SEED = -1  # Gymnasium's value for a generator of unknown seed

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
"""Attributes and methods with a value for each environment; the others have one value for all."""

SINGLE_SPACES = {"action_space": "single_action_space", "observation_space": "single_observation_space"}
"""Names of the vector environment for attributes of a single one."""


class RowSeeds:
    """Generators of the rows, seeded as Gymnasium's `SyncVectorEnv` seeds its environments."""

    num_envs: int
    batch: Any
    _generators: list[np.random.Generator]
    _seeds: list[int]

    @property
    def np_random(self) -> tuple[np.random.Generator, ...]:
        """Generator of each environment. A generator that is assigned seeds all of them; a list assigns one
        to each."""
        if not self._generators:
            self._new_generators([None] * self.num_envs)
        return tuple(self._generators)

    @np_random.setter
    def np_random(self, value: np.random.Generator | Sequence[np.random.Generator]) -> None:
        assigned: Any = value
        if isinstance(assigned, np.random.Generator):
            self._new_generators(assigned.integers(2**63, size=self.num_envs).tolist())
        elif not isinstance(assigned, (list, tuple)) or len(assigned) != self.num_envs:
            raise ParameterError(
                f"np_random: expected a generator, or a list of {self.num_envs}, got {value!r:.80}"
            )
        else:
            self._generators = list(all_of("np_random", assigned, np.random.Generator))
        self._seeds = [UNKNOWN_SEED] * self.num_envs

    @property
    def np_random_seed(self) -> tuple[int, ...]:
        """Seed of each environment, -1 if its generator was assigned or is from a state; like that of
        Gymnasium's `SyncVectorEnv`."""
        # Reading `np_random` makes the generators, if there are none yet.
        return (*self._seeds,) if self.np_random else ()

    def _seed(self, seed: Any, mask: NDArray[np.bool_]) -> None:
        """Seed the generators of some environments, see `HorseLegVectorEnv.reset`.

        Raises:
            ParameterError: a bad seed; nothing has changed then.
        """
        n = self.num_envs
        if isinstance(seed, (list, tuple, np.ndarray)):
            if len(seed) != n:
                raise ParameterError(f"seed: expected one number or {n}, got {len(seed)}")
            seeds = [None if value is None else count("seed", value, low=0) for value in seed]
        else:
            seeds = [None if seed is None else count("seed", seed, low=0) + env for env in range(n)]
        # The first reset also seeds environments outside the mask, so that all have a generator.
        if not self._generators:
            self._new_generators(seeds)
            return
        for env in np.flatnonzero(mask):
            if seeds[env] is not None:
                self._generators[env], self._seeds[env] = seeding.np_random(seeds[env])
                self.batch.restart_schedules(np.array([env]))

    def _new_generators(self, seeds: Sequence[int | None]) -> None:
        """Make a generator for each environment, from entropy for a seed of None."""
        made = [seeding.np_random(seed) for seed in seeds]
        self._generators = [generator for generator, _ in made]
        self._seeds = [seed for _, seed in made]


class RowAttributes:
    """Access to methods and attributes of the rows by `call`, `get_attr` and `set_attr`, like that of
    `SyncVectorEnv`."""

    num_envs: int
    np_random: Any
    batch: Any
    record: Any
    change_settings: Any
    _attributes: dict[str, dict[int, Any]]

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Return the results of a method, or the values of an attribute, of each environment.

        Args:
            name: name in `HorseLegEnv`, or one set by `set_attr`. A method of all environments together, such
                as `get_state`, is called once, and each environment has its result.
            args, kwargs: arguments of the method.

        Raises:
            AttributeError: there is no such method or attribute.
            ParameterError: "reset" or "step", which take arrays of all environments.
        """
        return tuple(self.call_on(name, range(self.num_envs), *args, **kwargs))

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute of each environment, see `call`."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Store an attribute per environment; `get_attr` returns it.

        Args:
            name: name of the attribute. "np_random" assigns the generators.
            values: list or tuple with a value for each environment, or another object for all.

        Raises:
            FixedSettingError: a setting, or another attribute that the environments have.
            ParameterError: a list of another length.
        """
        each = list(values) if isinstance(values, (list, tuple)) else [values] * self.num_envs
        if len(each) != self.num_envs:
            raise ParameterError(f"values: expected one or {self.num_envs}, got {len(each)}")
        self.set_attr_of(name, dict(enumerate(each)))

    def set_attr_of(self, name: str, values: Mapping[int, Any]) -> None:
        """Store an attribute of some environments, values by index; see `set_attr`."""
        if name == "np_random":
            self.np_random = [values.get(env, present) for env, present in enumerate(self.np_random)]
            return
        if hasattr(self.batch.settings, name) or hasattr(self, name) or hasattr(self.batch, name):
            raise fixed_setting(name)
        self._attributes.setdefault(name, {}).update(values)

    def call_on(self, name: str, envs: Iterable[int], /, *args: Any, **kwargs: Any) -> list[Any]:
        """Return the results of a method or attribute of some environments, see `call`."""
        chosen = list(envs)
        # Methods of Gymnasium's wrappers, which take the name as their first argument.
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
        # Of these environments alone, as by `indices` of Stable-Baselines3.
        if name == "change_settings":
            if "envs" in kwargs and len(set(chosen)) < self.num_envs:
                raise ParameterError(f"envs: expected none beside indices {chosen}, got {kwargs['envs']!r}")
            some = None if len(set(chosen)) == self.num_envs else chosen
            return [self.change_settings(*args, **{"envs": some, **kwargs})] * len(chosen)
        if name == "settings":
            return [self.batch.coming_settings(env) for env in chosen]
        # Only environments that are asked for keep their substeps.
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
        # Figures by name, an array of all environments each.
        if isinstance(value, dict):
            return [{key: values[env] for key, values in value.items()} for env in chosen]
        return [value[env] for env in chosen]

    def _has(self, env: int, name: str) -> bool:
        """True if an environment has an attribute."""
        try:
            self.call_on(name, [env])
        except AttributeError:
            return False
        return True
