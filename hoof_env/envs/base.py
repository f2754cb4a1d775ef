"""Base of the single and the vector environment: properties, settings and states, and checks for calls at the
wrong time and for assignments without effect."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from numpy.typing import ArrayLike, NDArray

from hoof_env.envs.batch import EpisodeBatch
from hoof_env.envs.batch_pushes import push_now
from hoof_env.envs.batch_reports import summaries_of
from hoof_env.envs.batch_states import state_of
from hoof_env.envs.conditions import CHANGEABLE
from hoof_env.envs.drawn_recording import DrawnRecording
from hoof_env.envs.properties import LegProperties
from hoof_env.envs.recording import Recording
from hoof_env.envs.settings_changes import SettingsChanges
from hoof_env.errors import FixedSettingError, ParameterError, check_choice
from hoof_env.gait import GaitParameters
from hoof_env.render.size import check_side
from hoof_env.tasks.plain import as_plain, json_value, to_json
from hoof_env.tasks.registry import Task, task_of
from hoof_env.tasks.settings import PER_EPISODE, SETTINGS, Settings


def fixed_setting(name: str) -> FixedSettingError:
    """Return the error of an assignment to a setting, or to an attribute that follows from the settings."""
    how = "gymnasium.make(id, ...)" if name in SETTINGS else "the arguments of gymnasium.make"
    if name in PER_EPISODE:
        how += f", or reset(options={{'parameters': {{{name!r}: ...}}}}) for an episode"
    if name in CHANGEABLE:
        how += f", or from the next reset on by change_settings({name}=...)"
    return FixedSettingError(f"{name}: expected no assignment, which would change nothing; set it by {how}")


def array_of(value: Any) -> NDArray[Any]:
    """Convert to an array; return an empty object array if NumPy cannot."""
    try:
        return np.asarray(value)
    except (ValueError, TypeError, RuntimeError):  # RuntimeError is that of a tensor with a gradient
        return np.empty(0, object)


# Asking the system for entropy takes as long as a step.
ANY_SEED = np.random.SeedSequence(0)
"""Seed of generators that get a state at once."""


def generator_of(state: Any) -> np.random.Generator:
    """Make a generator from the state of a `PCG64`.

    Raises:
        ParameterError: `state` is not such a state.
    """
    generator = np.random.Generator(np.random.PCG64(ANY_SEED))
    try:
        generator.bit_generator.state = state
    except (TypeError, ValueError, KeyError):
        raise ParameterError(f"state['generator']: expected the state of a PCG64, got {state!r}") from None
    return generator


class LegBase(LegProperties, SettingsChanges):
    """Base of the single and the vector environment.

    Attributes:
        task, settings: task and its settings.
        spec: Gymnasium's specification. Its `max_episode_steps` is the environment's own limit, from
            `episode_seconds` and `dt`, unless it has one already.
    """

    task: Task
    metadata: dict[str, Any]
    render_mode: str | None
    _size: tuple[int, int]
    _watched: dict[int, DrawnRecording]  # recordings by environment, of those that are drawn or recorded
    _spec: EnvSpec | None = None
    _as_json: tuple[Settings | None, dict[str, Any], list[str]] = (None, {}, [])
    _phase = "new"
    """State of the object: "new" before the first reset, "running", and "closed" after `close`; in a single
    environment also "ended" after an episode, and "warned" after a further step."""

    def _make(
        self,
        task: str,
        given: Mapping[str, Any],
        n: int,
        render_mode: str | None,
        size: tuple[int, int],
        num_threads: int = 1,
    ) -> list[Any]:
        """Make the batch of `n` environments; return the spaces of an observation and of an action.

        Raises:
            ParameterError: a bad argument or setting.
        """
        if render_mode is not None:
            check_choice("render_mode", render_mode, self.metadata["render_modes"])
        self._size = check_side("width", size[0]), check_side("height", size[1])
        self.task = task_of(task)
        self.render_mode = render_mode
        # Kept for `change_settings`, which replaces some and starts from the task's defaults again.
        self._given = [{name: as_plain(name, value) for name, value in given.items()}] * n
        self.batch = EpisodeBatch(self.task, self.task.settings(given), n, num_threads)
        self.metadata = {**self.metadata, "render_fps": max(1, round(1 / self.batch.dt))}
        sizes = len(self.batch.names), len(self.batch.action_names)
        return [spaces.Box(-1.0, 1.0, (size,), np.float32) for size in sizes]

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an attribute.

        Raises:
            FixedSettingError: a setting, or an attribute that follows from the settings.
        """
        fixed = getattr(type(self), name, None)
        if name in SETTINGS or (isinstance(fixed, property) and fixed.fset is None):
            raise fixed_setting(name)
        super().__setattr__(name, value)

    def set_wrapper_attr(self, name: str, value: Any, *, force: bool = True) -> bool:
        """Override Gymnasium's method, which would create a setting as an attribute on the wrapper."""
        if force or name in SETTINGS or hasattr(self, name):
            setattr(self, name, value)
            return True
        return False

    @property
    def spec(self) -> EnvSpec | None:
        """Specification; None for an environment that Gymnasium did not make."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            # A copy, because it may be the registered one; plain values, for its `to_json`.
            spec = copy.copy(spec)
            spec.kwargs = {name: as_plain(name, value) for name, value in spec.kwargs.items()}
            if spec.max_episode_steps is None:
                spec.max_episode_steps = self.batch.steps_per_episode
        self._spec = spec

    @property
    def settings(self) -> Settings:
        """Settings of the episode; of a vector environment those of every episode that starts from now on."""
        return self.batch.asked

    def episode_summary(self) -> dict[str, Any]:
        """Return figures of the episode so far by name, as in `info["episode_summary"]`; in a vector
        environment of shape (num_envs,). The info lacks them where a wrapper ends an episode, such as the one
        of `gymnasium.make(..., max_episode_steps=...)`.

        Raises:
            ResetNeeded: there is no episode yet.
        """
        self._check_started("episode_summary")
        figures = summaries_of(self.batch, np.arange(self.batch.num_envs))
        return {name: self._each(values) for name, values in figures.items()}

    def raw_observation(self) -> dict[str, Any]:
        """Return what is observed of the present, before scaling and without disturbances, by name, in
        `observation_units`; in a vector environment of shape (num_envs,).

        Raises:
            ResetNeeded: there is no episode yet.
        """
        self._check_started("raw_observation")
        return {name: self._each(values) for name, values in self.batch.measured().items()}

    def _each(self, values: Any) -> Any:
        """Return values of all environments as an array; the single environment returns its own value."""
        return np.array(values)

    def _checked(self) -> NDArray[np.float32]:
        """Return the observation of the first environment, of which entries from outside are checked."""
        self.batch.check_observed()
        observation: NDArray[np.float32] = self.batch.observations[0].copy()
        return observation

    def action_for(self, gait: str | GaitParameters | NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the action that moves from the present gait towards another one as fast as is allowed. If it
        is computed again for every step, the gait arrives there and stays. Shape (4,); in a vector
        environment (num_envs, 4).

        Args:
            gait: name of one of `gaits`, or four gait parameters; in a vector environment also an array of
                shape (num_envs, 4).

        Raises:
            ParameterError: an unknown name, not four parameters, or an environment of a horse.
            ResetNeeded: there is no episode yet, and therefore no present gait.
        """
        self._check_started("action_for")
        if self.task.action_map:
            raise ParameterError(
                f"action_for: expected actions that are rates, got actions that are {self.action_form}"
            )
        actions: NDArray[np.float32] = self._each(
            self.batch.body.action_for(gait, self.engine, self.batch.dt)
        )
        return actions

    def push(self, forward: ArrayLike, upward: ArrayLike = 0.0, envs: ArrayLike | None = None) -> None:
        """Push the trunk now, at its centre of mass; the next step shows its new velocity.

        Args:
            forward, upward: impulses [N s], one number, or one for each environment that is pushed.
            envs: environments that are pushed, as indices or as a mask; None for all.

        Raises:
            ParameterError: an impulse is not finite or of another shape, or the trunk is fixed.
            ResetNeeded: there is no episode yet.
        """
        self._check_started("push")
        push_now(self.batch, forward, upward, envs)
        for recording in self._watched.values():
            recording.replace()

    def _check_open(self, call: str) -> None:
        """Raise `ClosedEnvironmentError` after `close`; `call` is the name of the method."""
        if self._phase == "closed":
            raise ClosedEnvironmentError(f"{call}() was called after close(): make a new one")

    def recording(self, env: int = 0) -> Recording:
        """Return the recording of an environment, which the first call switches on; raise `ResetNeeded` if
        there is no episode yet."""
        self._check_started("record")
        if env not in self._watched:
            self._watched[env] = DrawnRecording(self.batch, env)
        return self._watched[env]

    def _check_started(self, call: str) -> None:
        """Raise `ResetNeeded` before the first reset, too."""
        self._check_open(call)
        if self._phase == "new":
            raise ResetNeeded(f"{call}() was called before reset(): expected reset() first")

    def _check_state(self, state: Any, *parts: str) -> None:
        """Check that `state` is one of `get_state` of an environment with this id and these settings.

        Args:
            state: state to check.
            parts: names of further parts that it must have.

        Raises:
            ParameterError: it is not.
        """
        self._check_open("set_state")
        names = ("id", "settings", "engine", "episode", "generator", *parts)
        missing = [name for name in names if not isinstance(state, Mapping) or name not in state]
        if missing:
            raise ParameterError(f"state: expected what get_state gives, but {', '.join(missing)} is missing")
        if state["id"] != self.task.id:
            raise ParameterError(f"state: expected one of {self.task.id}, got one of {state['id']}")
        if (form := state.get("actions")) != self.action_form:
            raise ParameterError(f"state: expected one whose actions are {self.action_form}, got {form!r}")
        there = state["settings"] if isinstance(state["settings"], Mapping) else {}
        here = self._settings_as_json()
        if here == there:
            return
        # Rows of such a state have settings of their own.
        free = CHANGEABLE if "rows" in state else ()
        # Only settings that exist now: states of other versions may have more.
        unlike = [
            f"{k}: {v!r} here, {there.get(k)!r} there"
            for k, v in here.items()
            if there.get(k) != v and k not in free
        ]
        if unlike:
            raise ParameterError(f"state: of other settings; {'; '.join(unlike)}")

    def _state_of_batch(self) -> dict[str, Any]:
        """Return the state without the generators."""
        self._check_started("get_state")
        values = self._settings_as_json()
        # Copies of lists and mappings, because callers may change the state.
        settings = values | {name: json_value(values[name]) for name in self._as_json[2]}
        about = {"id": self.task.id, "actions": self.action_form, "settings": settings}
        return about | state_of(self.batch)

    def _settings_as_json(self) -> dict[str, Any]:
        """Return the settings as values that JSON can hold. They are converted once: planners take a state at
        every node of their tree."""
        converted, values, _ = self._as_json
        if converted is not self.settings:
            values = to_json(self.settings)
            changeable = [name for name, value in values.items() if isinstance(value, (dict, list))]
            self._as_json = self.settings, values, changeable
        return values

    def _warn_ended(self) -> None:
        """Warn once, in Gymnasium's words, of a step after the end of an episode."""
        if self._phase == "ended":
            self._phase = "warned"
            gym.logger.warn(
                "You are calling 'step()' even though this environment has already returned terminated = True"
                " or truncated = True. You should always call 'reset()' once you receive either -- any"
                " further steps are undefined behavior."
            )
