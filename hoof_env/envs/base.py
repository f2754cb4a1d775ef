"""What the environment and the vector environment share: what they say of themselves, and the refusal of
calls at the wrong time and of assignments that would change nothing."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from numpy.typing import NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.envs.batch import EpisodeBatch
from hoof_env.envs.batch_reports import summaries_of
from hoof_env.envs.batch_states import state_of
from hoof_env.envs.conditions import CHANGEABLE
from hoof_env.errors import FixedSettingError, ParameterError, check_choice
from hoof_env.gait import GaitParameters
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import Geometry
from hoof_env.render.renderer import check_side
from hoof_env.tasks.plain import as_plain, json_value, to_json
from hoof_env.tasks.registry import Task, task_of
from hoof_env.tasks.settings import PER_EPISODE, SETTINGS, Settings


def fixed_setting(name: str) -> FixedSettingError:
    """The error of an assignment to a setting, or to what follows from the settings."""
    how = "gymnasium.make(id, ...)" if name in SETTINGS else "the arguments of gymnasium.make"
    if name in PER_EPISODE:
        how += f", or reset(options={{'parameters': {{{name!r}: ...}}}}) for an episode"
    if name in CHANGEABLE:
        how += f", or from the next reset on by change_settings({name}=...)"
    return FixedSettingError(f"{name}: expected no assignment, which would change nothing; set it by {how}")


def array_of(given: Any) -> NDArray[Any]:
    """An array of what a caller gave; an empty one of objects where it makes none."""
    try:
        return np.asarray(given)
    except (ValueError, TypeError, RuntimeError):  # the last of a tensor that has a gradient
        return np.empty(0, object)


ANY_SEED = np.random.SeedSequence(0)
"""Of a generator whose state is set at once: to ask the system for entropy takes as long as a step."""


def generator_of(state: Any) -> np.random.Generator:
    """A generator in the state that a `PCG64` had; `ParameterError` if it is none."""
    generator = np.random.Generator(np.random.PCG64(ANY_SEED))
    try:
        generator.bit_generator.state = state
    except (TypeError, ValueError, KeyError):
        raise ParameterError(f"state['generator']: expected the state of a PCG64, got {state!r}") from None
    return generator


class LegBase:
    """One environment of a task, or many.

    Attributes:
        task, settings: the task and its settings.
        batch: the episodes.
        spec: what Gymnasium made it from. `max_episode_steps` is the environment's own limit, which
            `episode_seconds` and `dt` give, unless it has one already.
    """

    task: Task
    batch: EpisodeBatch
    metadata: dict[str, Any]
    render_mode: str | None
    _size: tuple[int, int]
    _spec: EnvSpec | None = None
    _as_json: tuple[Settings | None, dict[str, Any], list[str]] = (None, {}, [])
    _phase = "new"
    """Then "running", and "closed"; a single environment also has "ended" and "warned"."""

    def _make(
        self,
        task: str,
        given: Mapping[str, Any],
        n: int,
        render_mode: str | None,
        size: tuple[int, int],
        num_threads: int = 1,
    ) -> list[Any]:
        """Make `n` environments; returns the space of an observation and of an action."""
        if render_mode is not None:
            check_choice("render_mode", render_mode, self.metadata["render_modes"])
        self._size = check_side("width", size[0]), check_side("height", size[1])
        self.task = task_of(task)
        self.render_mode = render_mode
        self._given = {name: as_plain(name, value) for name, value in given.items()}
        self.batch = EpisodeBatch(self.task, self.task.settings(given), n, num_threads)
        self.metadata = {**self.metadata, "render_fps": max(1, round(1 / self.batch.dt))}
        sizes = len(self.batch.names), len(self.batch.body.action_names)
        return [spaces.Box(-1.0, 1.0, (size,), np.float32) for size in sizes]

    def __setattr__(self, name: str, value: Any) -> None:
        """As of any object; `FixedSettingError` for settings and what follows from them."""
        fixed = getattr(type(self), name, None)
        if name in SETTINGS or (isinstance(fixed, property) and fixed.fset is None):
            raise fixed_setting(name)
        super().__setattr__(name, value)

    def set_wrapper_attr(self, name: str, value: Any, *, force: bool = True) -> bool:
        """As Gymnasium's, which would otherwise set a setting that the environment lacks on a wrapper."""
        if force or name in SETTINGS or hasattr(self, name):
            setattr(self, name, value)
            return True
        return False

    @property
    def spec(self) -> EnvSpec | None:
        """The specification, None for an environment that Gymnasium did not make."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            spec = copy.copy(spec)  # it may be the registered one
            spec.kwargs = {name: as_plain(name, value) for name, value in spec.kwargs.items()}  # for to_json
            if spec.max_episode_steps is None:
                spec.max_episode_steps = self.batch.steps_per_episode
        self._spec = spec

    @property
    def settings(self) -> Settings:
        """Those of the episode; of many environments those of every episode that starts from now on."""
        return self.batch.asked

    def change_settings(self, **changes: Any) -> None:
        """Change settings from the next reset on, as a curriculum does: the episode goes on with the old.
        Of many environments each takes the new ones when it starts again, by itself or by `reset`.

        Args:
            changes: some of `target_speed`, `target_seconds`, `terrain`, `reward_weights` and `randomize`, as
                the arguments of `gymnasium.make`: afterwards all is as if it had been made with them.

        Raises:
            ParameterError: a value is out of range, or an episode of these settings would lack something;
                nothing has changed then.
            FixedSettingError: another setting.
        """
        self._check_open("change_settings")
        for name in changes:
            if name in SETTINGS and name not in CHANGEABLE:
                raise FixedSettingError(
                    f"change_settings: expected some of {', '.join(CHANGEABLE)}, got {name!r}, which stays as"
                    " it was made"
                )
        given = self._given | {name: as_plain(name, value) for name, value in changes.items()}
        self.batch.change(self.task.settings(given))
        self._given = given

    @property
    def geometry(self) -> Geometry:
        """The leg."""
        return self.batch.body.geometry

    @property
    def gaits(self) -> dict[str, GaitParameters]:
        """Gaits of the preset by name; of a horse they are `HorseGait`s."""
        gaits: Any = self.batch.body.gaits
        found: dict[str, GaitParameters] = gaits
        return found

    @property
    def engine(self) -> TrunkEngine:
        """The mechanics."""
        return self.batch.engine

    @property
    def terrain(self) -> Terrain:
        """What the legs stand on."""
        return self.batch.engine.terrain

    @property
    def dt(self) -> float:
        """Control step [s]."""
        return self.batch.dt

    @property
    def sim_dt(self) -> float:
        """Substep [s]."""
        return self.batch.settings.sim_dt

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Of the observation's entries."""
        return tuple(self.batch.names)

    @property
    def action_names(self) -> tuple[str, ...]:
        """Of the action's numbers; of a horse with the leg before each."""
        names: tuple[str, ...] = self.batch.body.action_names
        return names

    @property
    def observation_units(self) -> tuple[str, ...]:
        """Of what `raw_observation` gives, in the observation's order."""
        return tuple(entry.unit for entry in self.batch.entries)

    def episode_summary(self) -> dict[str, Any]:
        """Figures of the episode so far by name, those of `info["episode_summary"]`; of many, shape
        (num_envs,). The info lacks them where a wrapper ends an episode, as that of
        `gymnasium.make(..., max_episode_steps=...)` does.

        Raises:
            ResetNeeded: there is no episode yet.
        """
        self._check_started("episode_summary")
        figures = summaries_of(self.batch, np.arange(self.batch.num_envs))
        return {name: self._each(values) for name, values in figures.items()}

    def raw_observation(self) -> dict[str, Any]:
        """What is observed now, before it is scaled: by name, in `observation_units`; of many, shape
        (num_envs,).

        Raises:
            ResetNeeded: there is no episode yet.
        """
        self._check_started("raw_observation")
        return {name: self._each(values) for name, values in self.batch.measured().items()}

    def _each(self, values: Any) -> Any:
        """What every environment has, as an array; a single environment gives its own."""
        return np.array(values)

    @property
    def action_form(self) -> str:
        """What actions are: "rates" of the gait parameters of one leg, or "offsets" from a horse's gait. It
        is in states and in files of policies, so that none of another form is taken."""
        form: str = self.batch.body.action_form
        return form

    def action_for(self, gait: str | GaitParameters | NDArray[np.float64]) -> NDArray[np.float32]:
        """The action that goes towards a gait from the present one, as fast as is allowed: given again at
        every step it ends there and keeps it. Shape (4,); of many environments (num_envs, 4).

        Args:
            gait: the name of one of `gaits`, or its four parameters; as an array also many, shape
                (num_envs, 4).

        Raises:
            ParameterError: an unknown name, or not four parameters.
            ResetNeeded: there is no episode yet, so no present gait.
        """
        self._check_started("action_for")
        actions: NDArray[np.float32] = self._each(
            self.batch.body.action_for(gait, self.engine, self.batch.dt)
        )
        return actions

    def _check_open(self, call: str) -> None:
        if self._phase == "closed":
            raise ClosedEnvironmentError(f"{call}() was called after close(): make a new one")

    def _check_started(self, call: str) -> None:
        self._check_open(call)
        if self._phase == "new":
            raise ResetNeeded(f"{call}() was called before reset(): expected reset() first")

    def _check_state(self, state: Any, *parts: str) -> None:
        """`ParameterError` unless `state` is one that `get_state` of such an environment gave."""
        self._check_open("set_state")
        names = ("id", "settings", "engine", "episode", "generator", *parts)
        missing = [name for name in names if not isinstance(state, Mapping) or name not in state]
        if missing:
            raise ParameterError(f"state: expected what get_state gives, but {', '.join(missing)} is missing")
        if state["id"] != self.task.id:
            raise ParameterError(f"state: expected one of {self.task.id}, got one of {state['id']}")
        if (form := state.get("actions")) != self.action_form:
            got = repr(form) if "actions" in state else "one of an older form (positions in a box)"
            raise ParameterError(f"state: expected one whose actions are {self.action_form}, got {got}")
        there = state["settings"] if isinstance(state["settings"], Mapping) else {}
        here = self._settings_as_json()
        if here == there:
            return
        unlike = [f"{k}: {v!r} here, {there.get(k)!r} there" for k, v in here.items() if there.get(k) != v]
        if unlike:
            raise ParameterError(f"state: of other settings; {'; '.join(unlike)}")

    def _state_of_batch(self) -> dict[str, Any]:
        """What `get_state` gives but for the generators."""
        self._check_started("get_state")
        values = self._settings_as_json()
        settings = values | {name: json_value(values[name]) for name in self._as_json[2]}  # nobody else's
        about = {"id": self.task.id, "actions": self.action_form, "settings": settings}
        return about | state_of(self.batch)

    def _settings_as_json(self) -> dict[str, Any]:
        """As values that JSON can hold, found once for these settings."""
        found, values, _ = self._as_json
        if found is not self.settings:
            values = to_json(self.settings)
            changeable = [name for name, value in values.items() if isinstance(value, (dict, list))]
            self._as_json = self.settings, values, changeable
        return values

    def _warn_ended(self) -> None:
        if self._phase == "ended":
            self._phase = "warned"
            gym.logger.warn(
                "You are calling 'step()' even though this environment has already returned terminated = True"
                " or truncated = True. You should always call 'reset()' once you receive either -- any"
                " further steps are undefined behavior."
            )
