"""The family as a native vector environment: all episodes in one call, time limit and autoreset its own.

Row i has the bits of the single environment that was seeded alike: with `reset(seed=s)` row i draws from the
generator that `gym.make(id).reset(seed=s + i)` would have. What one may ask of each environment is what
Gymnasium's own vector environments let one ask.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar, Unpack

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from hoof_env.envs.base import LegBase, array_of, fixed_setting, generator_of
from hoof_env.envs.batch_reports import failure_of, infos_of, summaries_of
from hoof_env.envs.batch_starts import check_options
from hoof_env.envs.batch_states import set_state, spread_state
from hoof_env.envs.infos import name_columns
from hoof_env.envs.recording import Recording
from hoof_env.errors import ParameterError, all_of, count
from hoof_env.render.renderer import USUAL_SIZE
from hoof_env.tasks.episode import FAILED, TRUNCATED
from hoof_env.tasks.keywords import Keywords

Floats = NDArray[np.float64]

MOST_ENVS = 1_000_000

UNKNOWN_SEED = -1  # as Gymnasium says it

MOST_DRAWN = 16  # so many are drawn by default; a picture takes as long as some hundred steps

PER_ENV = (
    "weight", "render", "episode_summary", "raw_observation", "record", "np_random", "np_random_seed",
    "action_for",
)  # fmt: skip
"""What each environment has of its own; the rest is of all."""

SINGLE_SPACES = {"action_space": "single_action_space", "observation_space": "single_observation_space"}


def mode_of(value: Any) -> AutoresetMode:
    """An `AutoresetMode`, given as such, by its name or by its value."""
    known = {key: mode for mode in AutoresetMode for key in (mode, mode.name, mode.value)}
    try:
        return known[value]
    except (KeyError, TypeError):
        names = ", ".join(mode.name for mode in AutoresetMode)
        raise ParameterError(f"autoreset_mode: expected one of {names}, got {value!r}") from None


class HorseLegVectorEnv(LegBase, VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """`num_envs` environments of a task, stepped together.

    Args:
        num_envs: how many, 1 to `MOST_ENVS`.
        num_threads: threads that share them in `step`; they change no bit.
        task, settings: as of `HorseLegEnv`.
        autoreset_mode: an `AutoresetMode`, its name or its value: NEXT_STEP, SAME_STEP or DISABLED.
        max_episode_steps: episodes are no longer than so many control steps, as under Gymnasium's TimeLimit;
            else `episode_seconds` alone ends them.
        render_mode: "rgb_array"; `render` gives a frame of each environment.
        rendered: how many are drawn, the first ones; frames of the others are black. None is all, of at most
            `MOST_DRAWN`.
        width, height: of each picture [pixels].

    Attributes:
        drawn: how many are drawn.

    Rewards are float64, shape (num_envs,). Infos are those of the single environment as arrays; when an
    episode ends they have its figures, too, as "episode_summary", one array for each figure, with masks under
    "_episode_summary", and why it failed as "failure".

    Raises:
        ParameterError: a bad argument, option or action.
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": ["rgb_array"], "render_fps": 50, "autoreset_mode": AutoresetMode.NEXT_STEP
    }  # fmt: skip

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
        **settings: Unpack[Keywords],
    ) -> None:
        self.num_envs = count("num_envs", num_envs, most=MOST_ENVS)
        self.autoreset_mode = mode_of(autoreset_mode)
        one = self._make(task, settings, self.num_envs, render_mode, (width, height), num_threads)
        if max_episode_steps is not None:
            self.batch.limit(count("max_episode_steps", max_episode_steps))
        self.single_observation_space, self.single_action_space = one
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.metadata["autoreset_mode"] = self.autoreset_mode
        self.spec = None
        self.drawn = self._check_drawn(rendered)
        self._watched = {env: Recording(self.batch, env, self._size) for env in range(self.drawn)}
        self._attributes: dict[str, dict[int, Any]] = {}
        self._generators: list[np.random.Generator] = []
        self._seeds: list[int] = []
        self._ended = np.zeros(self.num_envs, bool)
        self._started = np.zeros(self.num_envs, bool)

    # Gymnasium

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start episodes: in all environments, or in those of `options["reset_mask"]`.

        Args:
            seed: of the first; the i-th has `seed + i`. Or one each, None to go on with its generator.
            options: as of the single environment, the same for all; "reset_mask", bool of shape (num_envs,).

        Raises:
            ParameterError: a bad seed, option or mask.
        """
        self._check_open("reset")
        rest: Any = dict(options) if isinstance(options, Mapping) else options
        mask = self._check_mask(rest.pop("reset_mask", None) if isinstance(rest, dict) else None)
        checked = check_options(self.batch, rest)
        self._seed(seed, mask)
        parameters = self._start(np.flatnonzero(mask), checked)
        self._ended[mask] = False
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
        """One control step of all.

        Raises:
            ParameterError: actions of a wrong shape or type, or not finite.
            ResetNeeded: `reset` was not called, or with autoreset disabled an episode that ended.
        """
        self._check_started("step")
        batch = self.batch
        n = self.num_envs
        before = self._ended
        again = before if before.any() else None
        if again is not None and self.autoreset_mode == AutoresetMode.DISABLED:
            raise ResetNeeded(
                f"step() was called although episodes {np.flatnonzero(again).tolist()} ended: "
                "expected reset(options={'reset_mask': ...})"
            )
        batch.actions[:n] = self._check_actions(actions)
        some_ended = batch.step(self._generators, again)
        how = batch.episode_rows.ended[:n]
        terminated = how == FAILED
        truncated = how == TRUNCATED
        if again is not None:  # NEXT_STEP: these were not stepped, they start
            terminated[again] = False
            truncated[again] = False
            self._start(np.flatnonzero(again), {})
        done = terminated | truncated
        infos = infos_of(batch, some_ended)
        rewards = batch.rewards[:n].copy()
        if done.any():
            infos |= self._endings(done, terminated)
        if done.any() and self.autoreset_mode == AutoresetMode.SAME_STEP:
            infos = self._same_step(infos, done)
            done = np.zeros(n, bool)
        else:
            self._remember()
        self._ended = done
        return self._observed(), rewards, terminated, truncated, infos

    def _endings(self, done: NDArray[np.bool_], terminated: NDArray[np.bool_]) -> dict[str, Any]:
        """What infos say of episodes that end, as Gymnasium's `_add_info` puts them together one by one."""
        figures: dict[str, Any] = {}
        for name, values in summaries_of(self.batch, np.flatnonzero(done)).items():
            figures[name] = np.zeros(self.num_envs)
            figures[f"_{name}"] = done.copy()
            figures[name][done] = values
        endings = {"episode_summary": figures, "_episode_summary": done.copy()}
        if terminated.any():
            reasons = np.full(self.num_envs, None, dtype=object)
            for env in np.flatnonzero(terminated).tolist():
                reasons[env] = failure_of(self.batch, env)
            endings |= {"failure": reasons, "_failure": terminated.copy()}
        return endings

    def _same_step(self, final: dict[str, Any], done: NDArray[np.bool_]) -> dict[str, Any]:
        """Start again at once what ended; the infos then, with what it ended with."""
        last = np.full(self.num_envs, None, dtype=object)
        for env in np.flatnonzero(done):
            last[env] = self.batch.observations[env].copy()
        self._remember()
        self._start(np.flatnonzero(done), {})
        infos: dict[str, Any] = infos_of(self.batch)
        infos |= {key: copy.deepcopy(value) for key, value in final.items() if key not in infos}
        final |= {
            f"_{key}": done.copy() for key in final if not key.startswith("_") and f"_{key}" not in final
        }
        infos |= {"final_obs": last, "_final_obs": done.copy()}
        return infos | {"final_info": final, "_final_info": done.copy()}

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """A frame of each environment, (H, W, 3) uint8: those that are drawn, then black ones."""
        if self.render_mode is None:
            gym.logger.warn("render() was called without a render_mode: pass render_mode='rgb_array'")
            return None
        self._check_started("render")
        fps = self.metadata["render_fps"]
        frames = [self._watched[env].frame("rgb_array", fps) for env in range(self.drawn)]
        black = np.broadcast_to(np.uint8(0), frames[0].shape)
        return (*frames, *[black] * (self.num_envs - len(frames)))

    def close_extras(self, **kwargs: Any) -> None:
        """Give the renderers back."""
        self._phase = "closed"
        for recording in self._watched.values():
            recording.close()

    # What one may ask of each

    @property
    def weight(self) -> Floats:
        """Weight of trunk and leg [N], shape (num_envs,)."""
        return self.batch.episode_rows.weight[: self.num_envs].copy()

    @property  # type: ignore[override]
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
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """What each environment was seeded with, as Gymnasium's `SyncVectorEnv` says it; -1 where a generator
        was assigned or came with a state."""
        return (*self._seeds,) if self.np_random else ()

    def record(self, env: int = 0) -> dict[str, Floats]:
        """State and report of an environment at every substep of the last control step, see
        `HorseLegEnv.record`. From the first call on its substeps are kept, which takes time in every step.

        Raises:
            ResetNeeded: an environment has no episode yet.
            ParameterError: there is no such environment.
        """
        self._check_started("record")
        count("env", env, low=0, most=self.num_envs - 1)
        if env not in self._watched:
            self._watched[env] = Recording(self.batch, env)
        return self._watched[env].last()

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

    # Parts of it

    def _has(self, env: int, name: str) -> bool:
        try:
            self.call_on(name, [env])
        except AttributeError:
            return False
        return True

    def _check_drawn(self, rendered: Any) -> int:
        n = self.num_envs
        if self.render_mode is None:
            if rendered is not None:
                raise ParameterError(f"rendered: expected none without a render_mode, got {rendered!r}")
            return 0
        if rendered is None and n > MOST_DRAWN:
            raise ParameterError(
                f"rendered: expected how many of the {n} environments to draw, as they are more than"
                f" {MOST_DRAWN}; for Gymnasium's RecordVideo rendered=1 goes with record_first_only=True"
            )
        drawn = n if rendered is None else count("rendered", rendered)
        if drawn > n:
            raise ParameterError(f"rendered: expected at most num_envs={n}, got {drawn}")
        return drawn

    def _check_mask(self, given: Any) -> NDArray[np.bool_]:
        """The reset option "reset_mask", not all False; None is all."""
        n = self.num_envs
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

    def _check_actions(self, actions: Any) -> NDArray[np.float32]:
        given = array_of(actions)
        shape = (self.num_envs, len(self.batch.body.action_names))
        if given.dtype.kind not in "fiu" or given.shape != shape:
            raise ParameterError(
                f"actions: expected finite numbers in [-1, 1], shape {shape}, "
                f"got {given.dtype} of shape {given.shape}"
            )
        with np.errstate(over="ignore"):  # to infinity, which is refused
            given = given.astype(np.float32, copy=False)
        if not np.isfinite(given).all():
            rows = np.flatnonzero(~np.isfinite(given).all(1)).tolist()
            raise ParameterError(
                f"actions: expected finite numbers in [-1, 1], got others in rows {rows[:8]}"
            )
        return given

    def _start(self, envs: NDArray[np.int64], options: Mapping[str, Any]) -> dict[str, Any]:
        """Start episodes; the parameters that were set or drawn for them, by name."""
        parameters = self.batch.reset(envs, [self._generators[env] for env in envs], options)
        self._started[envs] = True
        if self._phase == "new" and self._started.all():
            self._phase = "running"
        if self._watched:
            for env in self._watched.keys() & set(envs.tolist()):
                self._watched[env].begin()
        return parameters

    def _remember(self) -> None:
        for env, recording in self._watched.items():
            if not self._ended[env]:  # else it has just begun
                recording.add()

    def _observed(self) -> NDArray[np.float32]:
        return self.batch.observations[: self.num_envs].copy()

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

    # State

    def get_state(self) -> dict[str, Any]:
        """Everything that changes, generators included: continuing from it is bit-identical.

        Raises:
            ResetNeeded: there are no episodes yet.
        """
        generators = [generator.bit_generator.state for generator in self._generators]
        return {**self._state_of_batch(), "ended": self._ended.copy(), "generator": generators}

    def set_state(self, state: Mapping[str, Any]) -> NDArray[np.float32]:
        """Put back what `get_state` gave, here or of a single environment, which then goes on in every row:
        many actions can be tried from one state. Returns the observations there.

        Raises:
            ParameterError: a state of another id, geometry, setting or number of environments.
        """
        if isinstance(state, Mapping) and isinstance(state.get("generator"), Mapping):
            self._check_state(state)
            state = self._in_every_row(state)
        self._check_state(state, "ended")
        n = self.num_envs
        states = state["generator"]
        ended = array_of(state["ended"]).copy()
        if ended.dtype != bool or ended.ndim != 1:
            raise ParameterError(
                f"state['ended']: expected a bool array of shape ({n},), got {state['ended']!r}"
            )
        if ended.size != n:
            raise ParameterError(f"state: expected one of {n} environments, got one of {ended.size}")
        if not isinstance(states, (list, tuple)) or len(states) != n:
            raise ParameterError(f"state['generator']: expected a list of {n}, got {states!r:.60}")
        generators = [generator_of(values) for values in states]
        set_state(self.batch, state)
        self._ended = ended
        self._started = np.ones(n, bool)
        self._generators = generators
        self._seeds = [UNKNOWN_SEED] * n
        self._phase = "running"
        for recording in self._watched.values():
            recording.begin()
        return self._observed()

    def _in_every_row(self, state: Mapping[str, Any]) -> dict[str, Any]:
        """The state of a single environment as one of this vector environment."""
        found = {**spread_state(self.batch, state), "generator": [state["generator"]] * self.num_envs}
        return found | {"ended": found["episode"][self.batch.ended_row] != 0.0}
