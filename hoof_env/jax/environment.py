"""Environments in gymnax's form: pure functions of keys, states and actions."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.utils import seeding

from hoof_env.dynamics.advance import ONE_BY_ONE
from hoof_env.dynamics.layout import engine_layout
from hoof_env.envs.manual import MULTI_OBJECTIVE, task_of_id
from hoof_env.envs.xla import numbers_of
from hoof_env.episodes.batch import EpisodeBatch
from hoof_env.episodes.observation_kernel import Observer
from hoof_env.episodes.scene import Scene, TaskKind
from hoof_env.episodes.step import step_rows
from hoof_env.errors import ParameterError, count
from hoof_env.jax.engine import JaxAdvance
from hoof_env.jax.machine import Cells, Held, Jax, Singles
from hoof_env.simd import new_rows
from hoof_env.simd.machines import running_on
from hoof_env.simd.memory import Given
from hoof_env.tasks.episode import ACTIONS, FAILED
from hoof_env.tasks.registry import Task

STARTS = 256
"""Default number of starts that are drawn."""


class State(NamedTuple):
    """State of an episode, one row of a batch; `vmap` makes many.

    Attributes:
        engine: memory of the engine, shape (numbers,), named by `JaxEnv.engine_names`.
        episode: memory of the episode, shape (numbers,), named by `JaxEnv.episode_rows`.
        past_actions, frames, acted: what delays and histories keep, flat; empty where nothing needs it.
        observation: observation of the state.
    """

    engine: Any
    episode: Any
    past_actions: Any
    frames: Any
    acted: Any
    observation: Any


class Params(NamedTuple):
    """What a reset chooses from.

    Attributes:
        starts: states at the start of episodes, a `State` of arrays of shape (number, ...).
    """

    starts: State


class Box(NamedTuple):
    """Space of numbers between bounds."""

    low: float
    high: float
    shape: tuple[int, ...]
    dtype: Any

    def sample(self, key: Any) -> Any:
        """Return random numbers."""
        return jax.random.uniform(key, self.shape, self.dtype, self.low, self.high)


def make(id: str, *, dtype: Any = None, starts: int = STARTS, seed: int = 0, **settings: Any) -> Any:
    """Return an environment and its parameters.

    Args:
        id: id of an environment, of one leg or of a horse: of this package, or your own, which may be
            "module:id".
        dtype: float64, which needs `jax_enable_x64`, or float32; None for what JAX has now.
        starts: number of starts. The k-th is the start after `reset(seed=seed + k)` of the environment; a
            reset takes one of them at random.
        seed: see `starts`.
        settings: settings of the id, as for `gymnasium.make`.

    Raises:
        ParameterError: an unknown id, a setting that this form lacks, or a bad value.
    """
    env = JaxEnv(id, dtype, settings)
    return env, env.params_of(range(seed, seed + count("starts", starts)))


def check_kind(dtype: Any) -> np.dtype[Any]:
    """Return the type of numbers.

    Raises:
        ParameterError: neither float32 nor float64, or float64 where JAX has none.
    """
    has_doubles = jax.config.jax_enable_x64
    kind = np.dtype(("float64" if has_doubles else "float32") if dtype is None else dtype)
    if kind not in (np.dtype("float32"), np.dtype("float64")):
        raise ParameterError(f"dtype: expected float32 or float64, got {dtype!r}")
    if kind == np.float64 and not has_doubles:
        raise ParameterError(
            "dtype: expected float32, because JAX has no doubles now, got float64; for the accuracy of the"
            " kernels run jax.config.update('jax_enable_x64', True) first"
        )
    return kind


def task_with_one_reward(id: str) -> Task:
    """Return the task of an id.

    Raises:
        ParameterError: an unknown id, or one whose reward is a vector.
    """
    if id == MULTI_OBJECTIVE:
        raise ParameterError(
            f"id: expected an id with one reward, got {id!r}, whose objectives are sums of terms: take"
            " 'hoof_env/HorseLeg-v0', whose info['terms'] has them"
        )
    return task_of_id(id)


def refused(plan: Any) -> str:
    """Return the setting that this form lacks, with the remedy; "" without one."""
    delays = plan.delays
    if plan.settings.solver == "paper":
        return f"solver: expected None, got {plan.settings.solver!r}, which is no kernel"
    if plan.pushes.impulse is not None or plan.pushes.given:
        return "push_impulse and pushes: expected None, because Python applies pushes; give push_impulse=None"
    if plan.costs.limits:
        return f"cost: expected None, got {dict(plan.costs.limits)}, which Python computes from info"
    if plan.commands.ramp or plan.settings.schedule:
        return f"schedule: expected None, got {plan.settings.schedule!r}, because Python counts its steps"
    for name, delay in (("observation_delay", delays.observation), ("action_delay", delays.action)):
        if delay.least != delay.most:
            return f"{name}: expected one number, got a range, whose place would be found while it runs"
    return ""


class JaxEnv:
    """Environment as pure functions, one episode each; `jax.vmap` makes many.

    Attributes:
        id: id of the environment.
        dt: control step [s].
        observation_names, action_names: names of what is observed and of the actions.
        terms: keys of the reward's terms in `info`.
        engine_names: names of the numbers of `State.engine`.
        episode_rows: places of the numbers of `State.episode`, by name.

    Args:
        id: id of an environment.
        dtype: type of numbers; see `make`.
        settings: settings of the id.
    """

    def __init__(self, id: str, dtype: Any, settings: Any) -> None:
        task = task_with_one_reward(id)
        self.id = id
        self._kind = check_kind(dtype)
        self._settings = task.settings(settings)
        self._batch = EpisodeBatch(task, self._settings, 1)
        self._plan = plan = self._batch.plan
        if lacks := refused(plan):
            raise ParameterError(f"hoof_env.jax: {id}: {lacks}")
        self.dt = plan.dt
        self.observation_names, self.action_names = plan.observation_names, plan.action_names
        self.terms = self._batch.terms
        self._task: TaskKind = self._batch.task_kind
        self._constant = self._batch.calls.held.arrays
        self.episode_rows = {name: row for row, name in enumerate(plan.layout.names)}
        form = engine_layout(self._batch.engine.features)
        hips = plan.body.hips
        self.engine_names = (
            *form.trunk_memory.names,
            *(f"{hip}{name}" for hip in hips for name in form.leg_memory.names),
        )

    # Spaces and parameters

    def observation_space(self, params: Params | None = None) -> Box:
        """Return the space of observations."""
        return Box(-1.0, 1.0, (len(self.observation_names),), jnp.float32)

    def action_space(self, params: Params | None = None) -> Box:
        """Return the space of actions."""
        return Box(-1.0, 1.0, (len(self.action_names),), jnp.float32)

    @property
    def num_actions(self) -> int:
        """Number of actions."""
        return len(self.action_names)

    def params_of(self, seeds: Any, options: Any = None) -> Params:
        """Return parameters with the starts of `reset(seed=..., options=options)` for some seeds."""
        seeds = list(seeds)
        batch = EpisodeBatch(self._batch.task, self._settings, len(seeds))
        generators = [seeding.np_random(int(seed))[0] for seed in seeds]
        batch.reset(range(len(seeds)), generators, batch.check_options(options))
        return Params(self.states_of(batch))

    def states_of(self, batch: EpisodeBatch) -> State:
        """Return the states of a batch of episodes with these settings."""
        n, rows = batch.num_envs, batch.rows
        array = partial(jnp.asarray, dtype=self._kind)
        flat = (rows.past_actions, rows.frames, np.zeros((n, 0)) if rows.acted is None else rows.acted)
        past_actions, frames, acted = (array(each[:n].reshape(n, -1)) for each in flat)
        return State(
            array(batch.engine.arrays[0][:, :n].T),
            array(rows.episode[:, :n].T),
            past_actions,
            frames,
            acted,
            jnp.asarray(rows.observations[:n]),
        )

    # gymnax

    def reset(self, key: Any, params: Params) -> tuple[Any, State]:
        """Return the observation and state of one of the starts, at random."""
        starts = params.starts
        k = jax.random.randint(key, (), 0, starts.engine.shape[0])
        state = jax.tree.map(lambda array: array[k], starts)
        return state.observation, state

    def step(self, key: Any, state: State, action: Any, params: Params) -> tuple[Any, State, Any, Any, Any]:
        """Take a control step, and start another episode where one ends; return observation, state, reward,
        done and info. `info["final_obs"]` is the observation before the start."""
        of_step, of_reset = jax.random.split(key)
        observation, after, reward, done, info = self.step_env(of_step, state, action, params)
        first, start = self.reset(of_reset, params)
        state = jax.tree.map(lambda x, y: jnp.where(done, x, y), start, after)
        return jnp.where(done, first, observation), state, reward, done, info

    def step_env(self, key: Any, state: State, action: Any, params: Any = None) -> Any:
        """Take a control step without another start; see `step`."""
        after, reward, terms, unweighted = self._advance(state, action)
        ended = after.episode[self.episode_rows["ended"]]
        after = after._replace(episode=self._command(key, after.episode))
        info = {
            "terminated": ended == FAILED,
            "truncated": ended > FAILED,
            "final_obs": after.observation,
            "terms": dict(zip(self.terms, terms, strict=True)),
            "unweighted": dict(zip((term.name for term in self._task.terms), unweighted, strict=True)),
        }
        return after.observation, after, reward, ended > 0.0, info

    def _command(self, key: Any, episode: Any) -> Any:
        """Draw the next commanded speed where another one is commanded now; see `Commands.draw_next`."""
        commands = self._plan.commands
        if not commands.varies:
            return episode
        low, high = commands.at(0)
        shortest, longest = commands.seconds
        rows = self.episode_rows
        now = {name: episode[rows[name]] for name in ("steps", "switch", "target")}
        when, where = jax.random.uniform(key, (2,), self._kind)
        steps = jnp.round((shortest + (longest - shortest) * when) / commands.dt)
        low = jnp.maximum(low, now["target"] - commands.largest_change)
        high = jnp.minimum(high, now["target"] + commands.largest_change)
        is_due = now["steps"] >= now["switch"]
        for name, value in {
            "switch": now["steps"] + steps,
            "next_target": low + (high - low) * where,
        }.items():
            episode = episode.at[rows[name]].set(jnp.where(is_due, value, episode[rows[name]]))
        return episode

    # The kernel of a step

    def _advance(self, state: State, action: Any) -> Any:
        """Return state, reward, terms and terms with a weight of 1 after the kernel of a step."""
        task, kind = self._task, self._kind
        shape = (self.num_actions,)
        wanted = f"action: expected numbers in [-1, 1], shape {shape}, of which jax.vmap takes many"
        taken = jnp.asarray(numbers_of(jnp.asarray, action, shape, wanted), kind)
        cells = {
            "data": _cells(state.engine),
            "episode": self._episode_cells(state.episode),
            "actions": _cells(taken),
            "observations": Cells([0.0] * len(self.observation_names)),
            "rewards": Cells([0.0]),
            "past_actions": _cells(state.past_actions),
            "frames": _cells(state.frames),
            "unweighted": Cells([0.0] * len(self.terms)),
        }
        cells["acted"] = _cells(state.acted) if state.acted.size else cells["actions"]
        body_actions = Singles([0.0] * (task.body.legs * ACTIONS))
        cells["mapped"] = body_actions if task.action_map else cells["acted"]
        with running_on(Jax(kind)):
            given: Any = Given(task.arrays, Held(self._constant | cells))
            scene = Scene(task, given, 1)
            advance = JaxAdvance(given, task.engine, ONE_BY_ONE[task.body.legs])
            so_far = new_rows(None, 1, scene.layouts.legs * scene.layouts.sums + 1)
            step_rows(scene, 0, advance, Observer(scene), so_far)
        after = State(
            _stacked(cells["data"], kind),
            _stacked(cells["episode"], kind),
            _stacked(cells["past_actions"], kind),
            _stacked(cells["frames"], kind),
            _stacked(cells["acted"], kind) if state.acted.size else state.acted,
            _stacked(cells["observations"], jnp.float32),
        )
        terms = after.episode[self._plan.layout.rows("terms")]
        return after, jnp.asarray(cells["rewards"][0], kind), terms, _stacked(cells["unweighted"], kind)

    def _episode_cells(self, episode: Any) -> Cells:
        """Return the rows of an episode; delays, which never change, as ordinary numbers."""
        cells, delays = _cells(episode), self._plan.delays
        for name, delay in (("observation_delay", delays.observation), ("action_delay", delays.action)):
            cells[self.episode_rows[name]] = float(delay.least)
        return cells


def _cells(array: Any) -> Cells:
    """Return the numbers of an array of one axis, one by one."""
    return Cells([array[k] for k in range(array.shape[0])])


def _stacked(numbers: Cells, kind: Any) -> Any:
    """Return numbers as an array."""
    return jnp.stack([jnp.asarray(x, kind) for x in numbers]) if numbers else jnp.zeros(0, kind)
