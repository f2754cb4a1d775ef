"""What one may ask of each of many environments, as Gymnasium's own vector environments let one ask."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from hoof_env.envs.arguments import fixed_setting
from hoof_env.envs.batch import EpisodeBatch
from hoof_env.envs.recording import Recording
from hoof_env.errors import ParameterError, count
from hoof_env.ground.terrain import Terrain

Floats = NDArray[np.float64]
OWN = ("weight", "render", "episode_summary", "raw_observation", "record", "np_random")
"""What each environment has of its own; the rest is of all."""

SINGLE = {"action_space": "single_action_space", "observation_space": "single_observation_space"}


class Rows:
    """The part of `HorseLegVectorEnv` that is about its environments one by one."""

    batch: EpisodeBatch
    num_envs: int
    _recordings: list[Recording]
    _generators: list[np.random.Generator]
    _started: NDArray[np.bool_]
    _refuse_closed: Callable[[str], None]

    def __init__(self) -> None:
        self._watched: dict[int, Recording] = {}
        self._marks: dict[str, list[Any]] = {}

    @property
    def dt(self) -> float:
        """Control step [s]."""
        return self.batch.dt

    @property
    def sim_dt(self) -> float:
        """Substep [s]."""
        return float(self.batch.settings.sim_dt)

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Of the observation's entries."""
        return tuple(self.batch.names)

    @property
    def observation_units(self) -> tuple[str, ...]:
        """Of what `raw_observation` gives, in the observation's order."""
        return tuple(entry.unit for entry in self.batch.entries)

    @property
    def drawn(self) -> int:
        """How many are drawn, the first ones."""
        return len(self._recordings)

    @property
    def weight(self) -> Floats:
        """Weight of trunk and leg [N], shape (num_envs,)."""
        return self.batch.now.weight[: self.num_envs].copy()

    def raw_observation(self) -> dict[str, Floats]:
        """What is observed now, before it is scaled: by name, shape (num_envs,), in `observation_units`.

        Raises:
            ResetNeeded: an environment has no episode yet.
        """
        self._refuse("raw_observation")
        return self.batch.measured()

    def episode_summary(self) -> dict[str, Floats]:
        """Figures of the episodes so far by name, shape (num_envs,); those of `infos["episode_summary"]`.

        Raises:
            ResetNeeded: an environment has no episode yet.
        """
        self._refuse("episode_summary")
        each = [self.batch.summary(env) for env in range(self.num_envs)]
        return {name: np.array([summary[name] for summary in each]) for name in each[0]}

    def record(self, env: int = 0) -> dict[str, Floats]:
        """State and report of an environment at every substep of the last control step, see
        `HorseLegEnv.record`. From the first call on its substeps are kept, which takes time in every step.

        Raises:
            ResetNeeded: an environment has no episode yet.
            ParameterError: there is no such environment.
        """
        self._refuse("record")
        count("env", env, low=0, most=self.num_envs - 1)
        for recording in self._recordings:
            if recording.env == env:
                return recording.last()
        if env not in self._watched:
            self._watched[env] = Recording(self.batch, env)
        return self._watched[env].last()

    @property
    def terrain(self) -> Terrain:
        """What all stand on."""
        return self.batch.engine.terrain

    @property
    def manual(self) -> str:
        """The manual page of the id, Markdown."""
        from hoof_env.envs.manual import page_of

        return page_of(self.batch.task.id)

    # As Gymnasium's

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
        return tuple(self.ask(name, range(self.num_envs), *args, **kwargs))

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each environment; as `call`."""
        return self.call(name)

    def set_attr(self, name: str, values: Any) -> None:
        """Remember something for `get_attr`: a list or tuple has a value for each, anything else is for all.

        Raises:
            FixedSettingError: a setting or another attribute that the environments have.
            ParameterError: not one value each.
        """
        each = list(values) if isinstance(values, (list, tuple)) else [values] * self.num_envs
        if len(each) != self.num_envs:
            raise ParameterError(f"values: expected one or {self.num_envs}, got {len(each)}")
        if hasattr(self.batch.settings, name) or hasattr(self, name) or hasattr(self.batch, name):
            raise fixed_setting(name)
        self._marks[name] = each

    def ask(self, name: str, envs: Iterable[int], *args: Any, **kwargs: Any) -> list[Any]:
        """`call` of some environments."""
        chosen = list(envs)
        if name in self._marks:
            return [self._marks[name][env] for env in chosen]
        if name in ("reset", "step"):
            raise ParameterError(f"call: {name!r} is of all together; expected envs.{name}(...)")
        if name == "record":
            return [self.record(env) for env in chosen]
        if name == "np_random":
            self._refuse(name)
            return [self._generators[env] for env in chosen]
        name = SINGLE.get(name, name)
        owner: Any = self if hasattr(self, name) else self.batch
        if name.startswith("_") or not hasattr(owner, name):
            raise AttributeError(f"{type(self).__name__}: the environments have no attribute {name!r}")
        found = getattr(owner, name)
        found = found(*args, **kwargs) if callable(found) else found
        if name not in OWN or found is None:
            return [found] * len(chosen)
        if isinstance(found, dict):
            return [{key: values[env] for key, values in found.items()} for env in chosen]
        return [found[env] for env in chosen]

    def _refuse(self, name: str) -> None:
        self._refuse_closed(name)
        if not self._started.all():
            raise ResetNeeded(f"{name}() was called before reset(): expected reset() first")
