"""Native vector environment: all episodes in one call, with its own time limit and autoreset.

Row i has the bits of a single environment with the same seed: with `reset(seed=s)` row i draws from the
generator that `gym.make(id).reset(seed=s + i)` would have. `call`, `get_attr` and `set_attr` accept the
arguments that they have in `SyncVectorEnv`.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from hoof_env.envs.arguments import VectorArguments, takes
from hoof_env.envs.base import LegBase, array_of, fixed_setting, longer_limit
from hoof_env.envs.generators import Generators, generator_of
from hoof_env.episodes.infos import name_columns
from hoof_env.episodes.states import set_state, spread_state
from hoof_env.episodes.summaries import endings_of, infos_of
from hoof_env.errors import ParameterError, count
from hoof_env.render.size import USUAL_SIZE
from hoof_env.tasks.episode import FAILED, TRUNCATED
from hoof_env.tasks.settings import SETTINGS

if TYPE_CHECKING:
    from hoof_env.envs.xla import XlaSteps

Floats = NDArray[np.float64]

MAX_ENVS = 1_000_000
"""Largest number of environments."""

MAX_DRAWN = 16
"""Largest number of environments that are drawn by default; a picture takes as long as some hundred steps."""

PER_ENV = (
    "weight",
    "render",
    "episode_summary",
    "raw_observation",
    "record",
    "np_random",
    "np_random_seed",
    "action_for",
    "commanded_speed",
)
"""Attributes and methods with a value for each environment; the rest, but for `OF_PLAN`, have one for all."""

OF_PLAN = {"terrain": "terrain", "weights": "weights", "resolved_settings": "settings"}
"""Attributes that an environment has from the plan of its present episode, with their names in `Plan`."""

SINGLE_SPACES = {"action_space": "single_action_space", "observation_space": "single_observation_space"}
"""Names of the vector environment for attributes of a single one."""


def check_drawn(rendered: Any, n: int, render_mode: str | None) -> int:
    """Return the number of environments that are drawn.

    Args:
        rendered: argument of `HorseLegVectorEnv`.
        n: number of environments.
        render_mode: render mode.

    Raises:
        ParameterError: more environments than there are, a number without a render_mode, or no number for
            more than `MAX_DRAWN` environments.
    """
    if render_mode is None:
        if rendered is not None:
            raise ParameterError(f"rendered: expected none without a render_mode, got {rendered!r}")
        return 0
    if rendered is None and n > MAX_DRAWN:
        raise ParameterError(
            f"rendered: expected how many of the {n} environments to draw, as they are more than"
            f" {MAX_DRAWN}; for Gymnasium's RecordVideo rendered=1 goes with record_first_only=True"
        )
    drawn = n if rendered is None else count("rendered", rendered)
    if drawn > n:
        raise ParameterError(f"rendered: expected at most num_envs={n}, got {drawn}")
    return drawn


def check_mask(given: Any, n: int) -> NDArray[np.bool_]:
    """Return the reset option "reset_mask" of n environments, shape (n,); None stands for all.

    Raises:
        ParameterError: not a bool array of that shape, or one without a True.
    """
    if given is None:
        return np.ones(n, bool)
    good = isinstance(given, np.ndarray) and given.dtype == bool and given.shape == (n,)
    if not (good and given.any()):
        raise ParameterError(
            f"options['reset_mask']: expected a bool array of shape ({n},) with at least one True, "
            f"got {given!r}"
        )
    mask: NDArray[np.bool_] = given
    return mask


def check_actions(actions: Any, shape: tuple[int, int]) -> NDArray[np.float32]:
    """Convert actions to float32.

    Raises:
        ParameterError: another shape or type, or numbers that are not finite.
    """
    array = array_of("actions", actions)
    if array.dtype.kind not in "fiu" or array.shape != shape:
        raise ParameterError(
            f"actions: expected finite numbers in [-1, 1], shape {shape}, "
            f"got {array.dtype} of shape {array.shape}"
        )
    # Too large numbers become infinite in float32, which is refused below.
    with np.errstate(over="ignore"):
        array = array.astype(np.float32, copy=False)
    # The kernel checks, too, but does not know which rows are wrong.
    if not np.isfinite(array).all():
        rows = np.flatnonzero(~np.isfinite(array).all(1)).tolist()
        raise ParameterError(
            f"actions: expected finite numbers in [-1, 1], got NaN or infinity in rows {rows[:8]}"
        )
    return array


def mode_of(value: Any) -> AutoresetMode:
    """Return an `AutoresetMode`, from one, its name, or its value.

    Raises:
        ParameterError: an unknown mode.
    """
    known = {key: mode for mode in AutoresetMode for key in (mode, mode.name, mode.value)}
    try:
        return known[value]
    except (KeyError, TypeError):
        names = ", ".join(mode.name for mode in AutoresetMode)
        raise ParameterError(f"autoreset_mode: expected one of {names}, got {value!r}") from None


class HorseLegVectorEnv(LegBase, VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """`num_envs` environments of a task, stepped together.

    >>> import gymnasium as gym, hoof_env
    >>> envs = gym.make_vec("hoof_env/HorseLeg-v0", num_envs=3)
    >>> observations, infos = envs.reset(seed=0)
    >>> observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
    >>> observations.shape, rewards.shape
    ((3, 22), (3,))

    Args:
        num_envs: number of environments, 1 to `MAX_ENVS`.
        num_threads: threads that share the environments in a step; their number changes no bit.
        task, settings: arguments of `HorseLegEnv`.
        autoreset_mode: an `AutoresetMode`, its name or its value: NEXT_STEP, SAME_STEP or DISABLED.
        max_episode_steps: largest number of control steps of an episode, as of Gymnasium's TimeLimit; at most
            `episode_seconds / dt`. None for `episode_seconds` alone.
        render_mode: "rgb_array"; `render` returns a picture of each environment.
        rendered: number of environments that are drawn, the first ones; pictures of the rest are black.
            None draws all, if they are at most `MAX_DRAWN`.
        width, height: size of each picture [pixels].

    Attributes:
        drawn: number of environments that are drawn.

    Rewards are float64, shape (num_envs,). Infos are the single environment's, as arrays. When an
    episode ends they also contain its figures as "episode_summary", one array for each figure, with masks
    under "_episode_summary", and the reasons as "end": by reason, an array that is True where it holds.

    Raises:
        ParameterError: a bad argument, option or action.
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": ["rgb_array"],
        "render_fps": 50,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    @takes(VectorArguments)
    def __init__(
        self,
        num_envs: int = 1,
        *,
        num_threads: int = 1,
        task: str = "leg",
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        rendered: int | None = None,
        width: int = USUAL_SIZE[0],
        height: int = USUAL_SIZE[1],
        **settings: Any,
    ) -> None:
        self.num_envs = count("num_envs", num_envs, most=MAX_ENVS)
        self.autoreset_mode = mode_of(autoreset_mode)
        steps = None if max_episode_steps is None else count("max_episode_steps", max_episode_steps)
        size = width, height
        spaces = self._make(task, settings, self.num_envs, render_mode, size, num_threads, steps)
        if steps is not None and steps > self.steps_per_episode:
            gym.logger.warn(longer_limit(steps, self.steps_per_episode, self.dt))
        self.single_observation_space, self.single_action_space = spaces
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.metadata["autoreset_mode"] = self.autoreset_mode
        self.spec = None
        self.drawn = check_drawn(rendered, self.num_envs, self.render_mode)
        self._watched = {}
        for env in range(self.drawn):
            self._watch(env)
        self._attributes: dict[str, dict[int, Any]] = {}
        self._generators = Generators(self.num_envs)
        self._ended = np.zeros(self.num_envs, bool)
        self._started = np.zeros(self.num_envs, bool)
        self._xla: XlaSteps | None = None

    # Gymnasium

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start episodes: in all environments, or where `options["reset_mask"]` is True.

        Args:
            seed: seed of the first environment; the i-th has `seed + i`. Or a seed for each, None to continue
                with its generator.
            options: options of `HorseLegEnv.reset`, the same for all environments, and "reset_mask", a bool
                array of shape (num_envs,), for the environments that start; by default all.

        Returns:
            Observations, float32, shape (num_envs, numbers), 0 where there is no episode yet, and the infos.

        Raises:
            ParameterError: a bad seed, option or mask.
        """
        self._check_open("reset")
        rest: Any = dict(options) if isinstance(options, Mapping) else options
        mask = check_mask(rest.pop("reset_mask", None) if isinstance(rest, dict) else None, self.num_envs)
        # Before the generators are seeded, so that a refused reset changes nothing.
        checked = self.batch.check_options(rest, np.flatnonzero(mask))
        try:
            seeded = self._generators.seed(seed, np.flatnonzero(mask).tolist())
            self.batch.restart_schedules(seeded)
            self._ended[mask] = False
            parameters = self._start(np.flatnonzero(mask), checked)
        except BaseException as error:
            self._interrupt(error)
            raise
        observations = self._observed()
        observations[~self._started] = 0.0
        infos: dict[str, Any] = infos_of(self.batch)
        if parameters:
            infos["parameters"] = name_columns(np.zeros((self.num_envs, len(parameters))), [*parameters])
            infos["parameters"][mask] = np.transpose([*parameters.values()])
        return observations, infos | {f"_{key}": mask.copy() for key in infos}

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Take a control step of all environments.

        Args:
            actions: actions, shape (num_envs, numbers), as of `HorseLegEnv.step`.

        Returns:
            Observations, rewards, terminated, truncated, and infos.

        Raises:
            ParameterError: actions of a wrong shape or type, or not finite.
            ResetNeeded: `reset` was not called, or, with autoreset disabled, an episode has ended.
        """
        self.check_step()
        batch, n = self.batch, self.num_envs
        batch.rows.actions[:n] = self.check_actions(actions)
        try:
            some_ended, terminated, truncated = self.finish_step(batch.run_kernels())
            done = terminated | truncated
            infos = infos_of(batch, some_ended)
            rewards = self._rewards()
            if done.any():
                infos |= endings_of(batch, done)
            is_same_step = self.autoreset_mode == AutoresetMode.SAME_STEP and done.any()
            # Objects, as Gymnasium gives final observations: None for the other environments.
            last = np.full(n, None, dtype=object) if is_same_step else None
            if last is not None:
                for env in np.flatnonzero(done):
                    last[env] = batch.rows.observations[env].copy()
            self.restart_ended(done)
            if last is not None:
                infos = self._same_step(infos, last, done)
        except BaseException as error:
            self._interrupt(error)
            raise
        return self._observed(), rewards, terminated, truncated, infos

    def check_step(self) -> None:
        """Raise `ResetNeeded` if a step would be wrong now."""
        if self._phase == "new" and self._started.any():
            missing = np.flatnonzero(~self._started).tolist()
            raise ResetNeeded(
                f"step() was called while environments {missing} have no episode yet: expected reset()"
            )
        self._check_started("step")
        if self.has_ended and self.autoreset_mode == AutoresetMode.DISABLED:
            raise ResetNeeded(
                f"step() was called although episodes {np.flatnonzero(self._ended).tolist()} ended: "
                "expected reset(options={'reset_mask': ...})"
            )

    def check_actions(self, actions: Any) -> NDArray[np.float32]:
        """Convert actions to float32; see `check_actions`."""
        return check_actions(actions, (self.num_envs, len(self.action_names)))

    def finish_step(self, happened: int) -> tuple[bool, NDArray[np.bool_], NDArray[np.bool_]]:
        """Finish a step after its kernels, which returned the code `happened`. In mode NEXT_STEP environments
        that ended before start now; their step does not count. Return whether any episode ended, terminated
        and truncated."""
        again = self._ended if self.has_ended else None
        some_ended = self.batch.end_step(happened, self._generators.all, again)
        how = self.batch.rows.named.ended[: self.num_envs]
        terminated = how == FAILED
        truncated = how == TRUNCATED
        if again is not None:
            terminated[again] = False
            truncated[again] = False
            self._start(np.flatnonzero(again), {})
        return some_ended, terminated, truncated

    def restart_ended(self, done: NDArray[np.bool_]) -> None:
        """End a step in which some episodes ended: they start again at once in mode SAME_STEP."""
        self._remember()
        if self.autoreset_mode == AutoresetMode.SAME_STEP and done.any():
            self._start(np.flatnonzero(done), {})
            done = np.zeros(self.num_envs, bool)
        self._ended = done

    def _same_step(
        self, final: dict[str, Any], last: NDArray[Any], done: NDArray[np.bool_]
    ) -> dict[str, Any]:
        """Return the infos of the starts after ended episodes, with the last observations and infos as
        "final_obs" and "final_info".

        Args:
            final: infos of the step.
            last: last observations, as objects, shape (num_envs,).
            done: True for environments that ended an episode, shape (num_envs,).
        """
        infos: dict[str, Any] = infos_of(self.batch)
        infos |= {key: copy.deepcopy(value) for key, value in final.items() if key not in infos}
        final |= {
            f"_{key}": done.copy() for key in final if not key.startswith("_") and f"_{key}" not in final
        }
        infos |= {"final_obs": last, "_final_obs": done.copy()}
        return infos | {"final_info": final, "_final_info": done.copy()}

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Return a picture of each environment, uint8 of shape (H, W, 3), black where none is drawn; warn and
        return None without a render_mode."""
        if self.render_mode is None:
            gym.logger.warn("render() was called without a render_mode: pass render_mode='rgb_array'")
            return None
        self._check_started("render")
        fps = self.metadata["render_fps"]
        frames = [self._watched[env].frame("rgb_array", fps) for env in range(self.drawn)]
        # One pixel with strides of 0: a million black pictures need no memory.
        black = np.broadcast_to(np.uint8(0), frames[0].shape)
        return (*frames, *[black] * (self.num_envs - len(frames)))

    def close_extras(self, **kwargs: Any) -> None:
        """Close the renderers; `VectorEnv.close` calls this."""
        self._phase = "closed"
        if self._xla is not None:
            self._xla.look()
        for recording in self._watched.values():
            recording.close()

    # XLA

    def xla(self) -> Any:
        """Return `handle, recv, send, step`, an `envs.xla.Functions`, like EnvPool's `xla`: steps inside
        `jax.jit` and `lax.scan`, with the bits of `step`; see docs/jax.md.

        Raises:
            MissingExtraError: jax is not installed, or is too old.
        """
        from hoof_env.envs.xla import XlaSteps, loaded_jax

        self._check_open("xla")
        loaded_jax()
        if self._xla is None:
            self._xla = XlaSteps(self)
        return self._xla.functions()

    @property
    def has_ended(self) -> bool:
        """True if an episode has ended whose environment has not started again."""
        return bool(self._ended.any())

    @property
    def is_plain(self) -> bool:
        """True if a step is one call of a kernel, unless something happens in it."""
        return not self._watched and self.batch.is_plain

    def _check_open(self, call: str) -> None:
        # The call may give XLA's steps something to do.
        if self._xla is not None:
            self._xla.look()
        super()._check_open(call)

    # Values of each environment

    @property
    def weight(self) -> Floats:
        """Weight of trunk and leg [N], shape (num_envs,)."""
        return self.batch.rows.named.weight[: self.num_envs].copy()

    def record(self, env: int = 0) -> dict[str, Floats]:
        """Return the state and report of an environment at every substep of the last control step, see
        `HorseLegEnv.record`. The first call switches its recording on, which takes time in every step.

        Raises:
            ResetNeeded: an environment has no episode yet.
            ParameterError: there is no such environment.
        """
        return self.recording(count("env", env, low=0, most=self.num_envs - 1)).last()

    # Parts of reset and step

    def _start(self, envs: NDArray[np.int64], options: Mapping[str, Any]) -> dict[str, Any]:
        """Start episodes; return the parameters that were set or drawn for them, by name."""
        parameters = self.batch.reset(envs, [self._generators[env] for env in envs], options)
        self._started[envs] = True
        if self._watched:
            for env in self._watched.keys() & set(envs.tolist()):
                self._watched[env].begin()
        # Steps are refused until every environment has had a first episode.
        if self._phase in ("new", "interrupted"):
            self._phase = "running" if self._started.all() else "new"
        return parameters

    def _interrupt(self, error: BaseException) -> None:
        super()._interrupt(error)
        # All environments have to start again, by one reset or by several with masks.
        if self._phase == "interrupted":
            self._started[:] = False

    def _rewards(self) -> NDArray[Any]:
        """Return the rewards of the step, a copy that later steps do not change; 0 of environments that have
        just started."""
        return self.batch.rows.rewards[: self.num_envs].copy()

    def _remember(self) -> None:
        """Add the step to the recordings."""
        for env, recording in self._watched.items():
            if not self._ended[env]:  # else it has just started, and `_start` began its recording
                recording.add()

    # Generators

    @property  # type: ignore[override]  # of all rows
    def np_random(self) -> tuple[np.random.Generator, ...]:
        """Generator of each environment. A generator that is assigned seeds all of them; a list assigns one
        to each."""
        return self._generators.all

    @np_random.setter
    def np_random(self, value: np.random.Generator | Sequence[np.random.Generator]) -> None:
        self._generators.assign(value)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """Seed of each environment, -1 if its generator was assigned or is from a state; as in
        Gymnasium's `SyncVectorEnv`."""
        # Reading `np_random` makes the generators, if there are none yet.
        return tuple(self._generators.seeds) if self.np_random else ()

    # Methods and attributes of each environment

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
        """Return an attribute of each environment; see `call`."""
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
        if name in SETTINGS or hasattr(self, name):
            raise fixed_setting(name)
        self._attributes.setdefault(name, {}).update(values)

    def call_on(self, name: str, envs: Iterable[int], /, *args: Any, **kwargs: Any) -> list[Any]:
        """Return the results of a method or attribute of some environments; see `call`."""
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
            raise ParameterError(f"call: {name!r} is for all together; expected envs.{name}(...)")
        # Of these environments alone, as by `indices` of Stable-Baselines3.
        if name == "change_settings":
            if "envs" in kwargs and len(set(chosen)) < self.num_envs:
                raise ParameterError(
                    f"envs: expected none together with indices {chosen}, got {kwargs['envs']!r}"
                )
            some = None if len(set(chosen)) == self.num_envs else chosen
            self.change_settings(*args, **{"envs": some, **kwargs})
            return [None] * len(chosen)
        if name == "settings":
            return [self.batch.row_plans.pending_of(env).asked for env in chosen]
        if name in OF_PLAN:
            values = [getattr(self.batch.row_plans.of(env), OF_PLAN[name]) for env in chosen]
            return [dict(value) if isinstance(value, dict) else value for value in values]
        # Of the environments that are asked for; only these keep their substeps.
        if name in ("record", "surroundings"):
            return [getattr(self, name)(env, *args, **kwargs) for env in chosen]
        name = SINGLE_SPACES.get(name, name)
        if name.startswith("_") or not hasattr(self, name):
            raise AttributeError(f"{type(self).__name__}: the environments have no attribute {name!r}")
        value = getattr(self, name)
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

    # States

    def _observed(self) -> NDArray[np.float32]:
        """Return the observations, a copy that later steps do not change."""
        self.batch.check_observed()
        return self.batch.rows.observations[: self.num_envs].copy()

    def get_state(self) -> dict[str, Any]:
        """Return everything that changes, generators included: episodes that continue from it have the same
        bits.

        Raises:
            ResetNeeded: there are no episodes yet.
        """
        state = self._state_of_batch()
        return {**state, "ended": self._ended.copy(), "generator": self._generators.states()}

    def set_state(self, state: Mapping[str, Any]) -> NDArray[np.float32]:
        """Restore a state of `get_state`; return the observations. With a state of a single environment every
        row continues from it, so that many actions can be tried from one state.

        Raises:
            ParameterError: a state of another id, geometry, setting or number of environments.
        """
        if isinstance(state, Mapping) and isinstance(state.get("generator"), Mapping):
            self._check_state(state)
            state = spread_state(self.batch, state)
        self._check_state(state, "ended")
        n = self.num_envs
        states = state["generator"]
        try:
            ended = np.array(state["ended"])
        except (TypeError, ValueError):
            ended = np.empty(0, object)  # refused below
        if ended.dtype != bool or ended.ndim != 1:
            raise ParameterError(
                f"state['ended']: expected a bool array of shape ({n},), got {state['ended']!r}"
            )
        if ended.size != n:
            raise ParameterError(f"state: expected a state of {n} environments, got one of {ended.size}")
        if not isinstance(states, (list, tuple)) or len(states) != n:
            raise ParameterError(f"state['generator']: expected a list of {n}, got {states!r:.60}")
        # The last checks: nothing has changed until here.
        generators = [generator_of(values) for values in states]
        try:
            set_state(self.batch, state)
            if "rows" in state:
                self._take_given()
            self._ended = ended
            self._started = np.ones(n, bool)
            self._generators.assign(generators)
            for recording in self._watched.values():
                recording.begin()
            self._phase = "running"
        except BaseException as error:
            self._interrupt(error)
            raise
        return self._observed()
