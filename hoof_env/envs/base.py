"""Base of the single and the vector environment: properties, settings and states, and checks for calls at the
wrong time and for assignments without effect."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from numpy.typing import ArrayLike, NDArray

from hoof_env._display import html_table, line_of
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.memory import env_indices as which_of
from hoof_env.episodes.batch import EpisodeBatch
from hoof_env.episodes.row_plans import CHANGEABLE
from hoof_env.episodes.states import state_of
from hoof_env.episodes.summaries import summaries_of
from hoof_env.errors import FixedSettingError, ParameterError, check_choice, check_number
from hoof_env.gait import GaitParameters
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import Geometry
from hoof_env.render.size import check_side
from hoof_env.tasks.body import Body
from hoof_env.tasks.registry import Task, task_of
from hoof_env.tasks.schedules import SPEED, check_unscheduled
from hoof_env.tasks.settings import (
    PER_EPISODE,
    SETTINGS,
    ResolvedSettings,
    Settings,
    as_plain,
    json_value,
    to_json,
)

if TYPE_CHECKING:
    from hoof_env.envs.drawn_recording import DrawnRecording
    from hoof_env.episodes.recording import Recording
    from hoof_env.record.surroundings import Surroundings


def fixed_setting(name: str) -> FixedSettingError:
    """Return the error of an assignment to a setting, or to an attribute that follows from the settings."""
    how = "gymnasium.make(id, ...)" if name in SETTINGS else "the arguments of gymnasium.make"
    if name in PER_EPISODE:
        how += f", or reset(options={{'parameters': {{{name!r}: ...}}}}) for an episode"
    if name in CHANGEABLE:
        how += f", or from the next reset on by change_settings({name}=...)"
    return FixedSettingError(f"{name}: expected no assignment, which would change nothing; set it by {how}")


def array_of(name: str, value: Any) -> NDArray[Any]:
    """Convert a value to an array.

    Args:
        name: name of the value in messages.
        value: array, nested list, tensor, ...

    Raises:
        ParameterError: NumPy cannot convert it, such as a tensor with a gradient or of half precision.
    """
    try:
        return np.asarray(value)
    except (ValueError, TypeError, RuntimeError) as error:
        of_numbers = f" of {value.dtype}" if hasattr(value, "dtype") else ""
        raise ParameterError(
            f"{name}: expected numbers that NumPy can convert, got a {type(value).__name__}{of_numbers}"
            f" ({error}); of a PyTorch tensor give .detach().float().cpu().numpy()"
        ) from None


def longer_limit(given: int, steps: int, dt: float) -> str:
    """Return the message about a limit beyond the environment's own, with the remedy.

    Args:
        given: `max_episode_steps`.
        steps: control steps of an episode.
        dt: control step [s].
    """
    return (
        f"max_episode_steps: expected at most {steps}, which is episode_seconds={steps * dt:g}, got {given};"
        f" for longer episodes give episode_seconds={given * dt:g}"
    )


def _times(arguments: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return the arguments of an environment from which its limit follows."""
    return arguments.get("episode_seconds"), arguments.get("dt")


class LimitedSpec(EnvSpec):
    """Specification of which `max_episode_steps` is at most the environment's own limit.

    Gymnasium's TimeLimit does not tell an environment its limit. It writes it into a copy of the
    specification, where a longer one would be wrong: episodes end earlier, and wrappers that divide by the
    limit never see 1.
    """

    # Slots are not fields, so JSON does not hold them.
    __slots__ = ("dt", "own_limit", "times")
    own_limit: int
    dt: float
    times: tuple[Any, ...]

    @classmethod
    def of(cls, spec: EnvSpec, own_limit: int, dt: float) -> LimitedSpec:
        """Return a copy of a specification, for episodes of at most `own_limit` control steps of `dt` [s]."""
        made = cls.__new__(cls)
        made.own_limit = own_limit
        made.dt = dt
        made.times = _times(spec.kwargs)
        for name, value in {**vars(spec), "max_episode_steps": None}.items():
            setattr(made, name, value)
        made.max_episode_steps = spec.max_episode_steps
        return made

    def __setattr__(self, name: str, value: Any) -> None:
        """Set a field; a longer limit becomes the environment's own, with a warning."""
        # A copy with other times is of another environment.
        is_limit = name == "max_episode_steps" and _times(getattr(self, "kwargs", {})) == self.times
        if is_limit and isinstance(value, int) and value > self.own_limit:
            gym.logger.warn(longer_limit(value, self.own_limit, self.dt))
            value = self.own_limit
        super().__setattr__(name, value)


class LegBase:
    """Base of the single and the vector environment.

    Attributes:
        task, settings: task and its settings.
        batch: episodes, a batch of one in the single environment.
        spec: Gymnasium's specification. Its `max_episode_steps` is the environment's own limit, from
            `episode_seconds` and `dt`, unless it has one already.
    """

    task: Task
    batch: EpisodeBatch
    metadata: dict[str, Any]
    render_mode: str | None
    _size: tuple[int, int]
    _watched: dict[int, DrawnRecording]  # recordings of the environments that are drawn or recorded, by index
    _spec: EnvSpec | None = None
    _as_json: tuple[Settings | None, dict[str, Any], list[str]] = (None, {}, [])
    _phase = "new"
    """State of the object: "new" before the first reset, "running", "interrupted" after a call that ended
    half-way, and "closed" after `close`; in a single environment also "ended" after an episode, and
    "warned" after a further step."""

    def _make(
        self,
        task: str,
        given: Mapping[str, Any],
        n: int,
        render_mode: str | None,
        size: tuple[int, int],
        num_threads: int = 1,
        max_episode_steps: int | None = None,
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
        self._given: list[Mapping[str, Any]] = [
            {name: as_plain(name, value) for name, value in given.items()}
        ] * n
        self.batch = EpisodeBatch(self.task, self.task.settings(given), n, num_threads, max_episode_steps)
        self.metadata = {**self.metadata, "render_fps": max(1, round(1 / self.dt))}
        sizes = len(self.observation_names), len(self.action_names)
        return [spaces.Box(-1.0, 1.0, (size,), np.float32) for size in sizes]

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an attribute.

        Raises:
            FixedSettingError: it is a setting, or an attribute that follows from the settings.
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
            spec = LimitedSpec.of(spec, self.steps_per_episode, self.dt)
            spec.kwargs = {name: as_plain(name, value) for name, value in spec.kwargs.items()}
            if spec.max_episode_steps is None:
                spec.max_episode_steps = self.steps_per_episode
        self._spec = spec

    @property
    def settings(self) -> Settings:
        """Settings of the episode; in a vector environment, of every episode that starts from now on."""
        return self.batch.plan.asked

    @property
    def contexts(self) -> tuple[dict[str, float], ...]:
        """Contexts of the setting `context_set`, in order; each can be played by
        `reset(options={"parameters": context})`. Empty without the setting."""
        return tuple(map(dict, self.batch.plan.randomization.contexts.known))

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
        """Return the present entries of the observation, before scaling and without disturbances, by name, in
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
        observation: NDArray[np.float32] = self.batch.rows.observations[0].copy()
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
        actions: NDArray[np.float32] = self._each(self.body.action_for(gait, self.engine, self.dt))
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
        self.batch.push(forward, upward, envs)
        for recording in self._watched.values():
            recording.replace()

    @property
    def commanded_speed(self) -> Any:
        """Present commanded speed [m/s]; in a vector environment of shape (num_envs,). None where no speed is
        commanded."""
        if not any(plan.commands.speeds for plan in self.batch.row_plans.in_use()):
            return None
        return self._each(self.batch.rows.named.target[: self.batch.num_envs])

    def command_speed(self, speed: float) -> None:
        """Command a speed from now to the end of the episode, in all environments.

        Args:
            speed: the speed, 0.1 to 20 [m/s].

        Raises:
            ParameterError: no speed is commanded here, or it is out of range.
            ResetNeeded: there is no episode yet.
        """
        self._check_started("command_speed")
        if self.commanded_speed is None:
            raise ParameterError(f"target_speed: expected an id with a commanded speed, got {self.task.id}")
        number = check_number("target_speed", speed, low=0.1, high=20.0)
        self.batch.plan.commands.command(self.batch.rows, slice(self.batch.num_envs), number)

    def touch(self, parameters: Mapping[str, float]) -> bool:
        """Change physical parameters in the middle of an episode, in the first environment, for somebody who
        plays with it; the next reset takes them back. Return False, and change nothing, where the present
        engine cannot run them: they need shorter substeps, or the paper's solver runs.

        Args:
            parameters: all parameters that differ from the settings, by the names of `settings.PER_EPISODE`.

        Raises:
            ParameterError: an unknown parameter, one without effect, or one out of range.
        """
        (is_done,) = self.batch.under_each(np.array([0]), lambda group: self._touch(parameters))
        return bool(is_done)

    def _touch(self, parameters: Mapping[str, float]) -> bool:
        """Change physical parameters of the first environment under its own plan, see `touch`."""
        plan = self.batch.plan
        plan.body.check_options({"parameters": dict(parameters)}, self.engine.trunk, plan.settings)
        if not plan.randomization.fits(parameters, self.engine):
            return False
        plan.randomization.put(self.batch.rows, 0, parameters, self.engine)
        self.batch.rows.has_overrides[0] = True
        return True

    def surroundings(self, env: int = 0) -> Surroundings:
        """Return the surroundings of an environment: ground, trunk, hips, weight, and kind of picture."""
        from hoof_env.episodes.recording import surroundings_of

        return surroundings_of(self.batch, env)

    def commands_between(
        self, before: NDArray[np.float64], after: NDArray[np.float64]
    ) -> list[tuple[NDArray[np.float64], int]]:
        """Return the commands of a control step, shape (legs, gait parameters), each with the number of
        substeps in which it acts.

        Args:
            before, after: memory of the engine before and after the step; see `TrunkEngine.column`.
        """
        from hoof_env.episodes.recording import commands_of_step

        return commands_of_step(self.batch, before, after)

    def _check_open(self, call: str) -> None:
        """Raise `ClosedEnvironmentError` after `close`; `call` is the name of the method."""
        if self._phase == "closed":
            raise ClosedEnvironmentError(f"{call}() was called after close(): make a new one")

    def recording(self, env: int = 0) -> Recording:
        """Return the recording of an environment, which the first call switches on; raise `ResetNeeded` if
        there is no episode yet."""
        self._check_started("record")
        if env not in self._watched:
            self._watch(env)
        return self._watched[env]

    def _watch(self, env: int) -> None:
        """Switch the recording of an environment on, from which its pictures are drawn."""
        # Most environments are neither recorded nor drawn.
        from hoof_env.envs.drawn_recording import DrawnRecording

        self._watched[env] = DrawnRecording(self.batch, env, self._size)

    def _check_started(self, call: str) -> None:
        """Raise `ResetNeeded` before the first reset, too."""
        self._check_open(call)
        if self._phase == "new":
            raise ResetNeeded(f"{call}() was called before reset(): expected reset() first")
        if self._phase == "interrupted":
            raise ResetNeeded(
                f"{call}() was called after a call that was interrupted, as by Ctrl-C, and may be half done:"
                " expected reset() or set_state(...) first"
            )

    def _interrupt(self, error: BaseException) -> None:
        """Refuse calls until the next reset, after an error that ended a step, a reset or a state half-way.
        Errors of bad input come before anything has happened."""
        if not isinstance(error, ParameterError):
            self._phase = "interrupted"

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
            raise ParameterError(
                f"state: expected what get_state returns, but {', '.join(missing)} is missing"
            )
        if state["id"] != self.task.id:
            raise ParameterError(f"state: expected a state of {self.task.id}, got one of {state['id']}")
        if (form := state.get("actions")) != self.action_form:
            raise ParameterError(
                f"state: expected a state whose actions are {self.action_form}, got {form!r}"
            )
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
            raise ParameterError(f"state: made with other settings; {'; '.join(unlike)}")

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

    # Properties that follow from the settings

    def __repr__(self) -> str:
        return line_of(type(self).__name__, id=self.task.id, environments=self.batch.num_envs)

    def _repr_html_(self) -> str:
        """Return the entries of the observation and the effects of actions, as a table."""
        entries = zip(self.observation_names, self.observation_units, strict=True)
        both = [("observation", *entry) for entry in entries]
        both += [("action", name, "-1 to 1") for name in self.action_names]
        return html_table(("space", "entry", "unit"), both, f"{self.task.id}: {self.task.summary}")

    @property
    def resolved_settings(self) -> ResolvedSettings:
        """Settings with values in place of None: the ground of the preset, the solver's own scheme and
        step."""
        return self.batch.settings

    @property
    def body(self) -> Body:
        """Body, one leg or a horse."""
        return self.batch.plan.body

    @property
    def terms(self) -> tuple[str, ...]:
        """Keys of the reward's terms in infos."""
        return tuple(term.key for term in self.task.terms if not term.is_cost)

    @property
    def costs(self) -> tuple[str, ...]:
        """Keys of the costs in infos, of which `info["cost"]` is the sum."""
        return self.batch.plan.costs.keys

    @property
    def weights(self) -> dict[str, float]:
        """Weights of the reward's terms by name."""
        weights = self.batch.plan.weights
        return {term.name: weights[term.name] for term in self.task.terms if not term.is_cost}

    @property
    def episode_seconds(self) -> float:
        """Time limit of an episode [s]."""
        return self.batch.plan.episode_seconds

    @property
    def steps_per_episode(self) -> int:
        """Largest number of control steps in an episode."""
        return self.batch.plan.steps_per_episode

    @property
    def geometry(self) -> Geometry:
        """Geometry of a leg."""
        return self.body.geometry

    @property
    def gaits(self) -> dict[str, GaitParameters]:
        """Gaits of the preset by name; of a horse they are `HorseGait`s."""
        of_body: Any = self.body.gaits
        gaits: dict[str, GaitParameters] = of_body
        return gaits

    @property
    def engine(self) -> TrunkEngine:
        """Engine that simulates all environments."""
        return self.batch.engine

    @property
    def terrain(self) -> Terrain:
        """Terrain under the legs; a vector environment has one for each by `get_attr("terrain")`."""
        return self.batch.engine.terrain

    @property
    def dt(self) -> float:
        """Control step [s]."""
        return self.batch.plan.dt

    @property
    def sim_dt(self) -> float:
        """Substep of the settings [s], which the engine may divide."""
        return self.resolved_settings.sim_dt

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the observation's entries, in order."""
        return self.batch.plan.observation_names

    @property
    def action_names(self) -> tuple[str, ...]:
        """Names of the actions; a horse's carry the leg as prefix."""
        return self.batch.plan.action_names

    @property
    def observation_units(self) -> tuple[str, ...]:
        """Units of `raw_observation`, in the order of its names."""
        return tuple(entry.unit for entry in self.batch.plan.observed.entries)

    @property
    def observation_scales(self) -> dict[str, str]:
        """Formula of the scale of each observed entry, by name, as in "tanh(x / 5)". Files of policies
        contain it, so that a policy that was trained with other scales is refused."""
        return self.batch.plan.observation_scales

    @property
    def action_form(self) -> str:
        """Meaning of actions: "rates" of the gait parameters of one leg, offsets from a horse's
        gait and their spans, as in "offsets of 0.4 and 0.04 rad", or the form of a user's map.
        States and files of policies contain it, so that a file of another form is refused."""
        return self.batch.plan.action_form

    # Changes of settings

    def change_settings(self, *, envs: ArrayLike | None = None, **changes: Any) -> None:
        """Change settings from the next reset on, for a curriculum. The present episode continues with the
        old ones. In a vector environment each environment takes the new ones when it starts again, by itself
        or by `reset`.

        Args:
            envs: environments that take them, as indices or as a mask; None for all.
            changes: some of the settings of `row_plans.CHANGEABLE`, as for `gymnasium.make`. Afterwards the
                environment is as if they had been arguments of `gymnasium.make`.

        Raises:
            ParameterError: a value is out of range, or the settings do not fit together; nothing has changed
                then.
            FixedSettingError: another setting.
        """
        self._check_open("change_settings")
        for name in changes:
            if name in SETTINGS and name not in CHANGEABLE:
                raise FixedSettingError(
                    f"change_settings: expected some of {', '.join(CHANGEABLE)}, got {name!r}, which stays as"
                    " it was made"
                )
        new = {name: as_plain(name, value) for name, value in changes.items()}
        rows = which_of(envs, self.batch.num_envs)
        if not rows.size:
            self.batch.plan_of(self.task.settings({**self._given[0], **new}))
        # Rows that were given the same settings share the mapping, and go on to share it.
        groups: dict[int, list[int]] = {}
        for row in rows.tolist():
            groups.setdefault(id(self._given[row]), []).append(row)
        given = [{**self._given[group[0]], **new} for group in groups.values()]
        asked = [self.task.settings(each) for each in given]
        if SPEED in new and "schedule" not in new:
            for settings in asked:
                check_unscheduled(SPEED, settings)
        of_rows = {row: each for each, group in zip(given, groups.values(), strict=True) for row in group}
        merged = [of_rows.get(row, each) for row, each in enumerate(self._given)]
        self.batch.change(asked, [*groups.values()])
        self._given = merged

    def _take_given(self) -> None:
        """Go on, after a state, from the settings of its rows."""
        shared: dict[int, dict[str, Any]] = {}
        for row in range(self.batch.num_envs):
            asked = self.batch.row_plans.pending_of(row).asked
            self._given[row] = shared.setdefault(id(asked), dict(vars(asked)))
