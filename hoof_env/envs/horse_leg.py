"""Single environments: one class for all tasks of `tasks.registry`, and `HorseLegMOEnv` with a reward of
three numbers."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from hoof_env.dynamics.parts import broken
from hoof_env.envs.arguments import EnvArguments, takes
from hoof_env.envs.base import LegBase, array_of
from hoof_env.envs.generators import generator_of, state_of
from hoof_env.episodes.infos import name_columns
from hoof_env.episodes.states import check_single, set_state
from hoof_env.episodes.step import SOME_SWITCHED
from hoof_env.episodes.summaries import ending_of
from hoof_env.errors import ParameterError, brief, count, flag
from hoof_env.render.size import USUAL_SIZE
from hoof_env.simd.compile import BLOCKS
from hoof_env.tasks.episode import FAILED
from hoof_env.tasks.objectives import reward_space, vector_reward
from hoof_env.tasks.reward import OBJECTIVES, failure


class HorseLegEnv(LegBase, gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A horse's leg: rates of its gait in, a trunk that moves, a ground reaction force that costs.

    Args:
        task: name in `registry.TASKS`; the registered ids set it.
        render_mode: "rgb_array" or "human".
        width, height: size of a picture [pixels].
        settings: any of `settings.Settings`; the manual page (`hoof-env manual`) describes them.

    Attributes:
        batch: episode, a batch of one.
        action_space, observation_space: boxes from -1 to 1, float32, of `action_names`, `observation_names`.

    Raises:
        ParameterError: a bad argument, option or action, with what was given and what was expected.
        ResetNeeded: a step, a picture or the state before the first reset.
        ClosedEnvironmentError: any use after `close`.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["human", "rgb_array"], "render_fps": 50}  # type: ignore[misc]

    @takes(EnvArguments)
    def __init__(
        self,
        *,
        task: str = "leg",
        render_mode: str | None = None,
        width: int = USUAL_SIZE[0],
        height: int = USUAL_SIZE[1],
        **settings: Any,
    ) -> None:
        spaces_of = self._make(task, settings, 1, render_mode, (width, height))
        self.observation_space, self.action_space = spaces_of
        self._began_with = b"", 0.0
        self._watched = {}
        if render_mode:
            self._watch(0)
        self._attach()

    def _attach(self) -> None:
        """Collect all that a step reads, writes or calls: looking it up costs as much as a substep."""
        batch, rows = self.batch, self.batch.rows
        weighted = [(k, term) for k, term in enumerate(self.task.terms) if batch.plan.weights[term.name]]
        # Terms that can differ from 0 before the end of an episode; infos start with 0 for the rest.
        paid = [(term.key, k) for k, term in weighted if term.compute is not failure]
        self._views: tuple[Any, ...] = (
            rows.actions[0].data,
            batch.direct_step(),
            batch.calls.held,
            bool(batch.drawn_names),
            paid,
            rows.named.terms[:, 0],
            rows.rewards.data,
            self._checked if batch.plan.observed.has_user_entries else rows.observations[0].copy,
            batch.measurements.reader(batch.engine.arrays[0][:, 0]),
            batch.plan.costs.keys,
            name_columns(rows.unweighted[:, 0], batch.term_names).copy,
        )

    @property
    def weight(self) -> float:
        """Weight of trunk and leg [N]."""
        return float(self.batch.rows.named.weight[0])

    def _each(self, values: Any) -> Any:
        return values[0] if np.ndim(values) > 1 else float(values[0])

    def record(self) -> dict[str, NDArray[np.float64]]:
        """Return the state and report of the engine at every substep of the last control step, or at the
        start, by name, with time on the first axis. The first call switches recording on.

        Raises:
            ResetNeeded: there is no episode yet.
        """
        return self.recording().last()

    # Gymnasium

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Start an episode.

        Args:
            seed: seed of the generator, a whole number from 0; None continues with the present generator.
            options: values of the start and of the episode by name; the manual page has names and units.

        Returns:
            The observation, float32, and the info, with the values that were drawn or set.

        Raises:
            ParameterError: a bad seed or option; nothing has changed then.
        """
        self._check_open("reset")
        checked = self.batch.check_options(options)  # first, so that a refused reset changes nothing
        try:
            super().reset(seed=None if seed is None else count("seed", seed, low=0))
            self.batch.restart_schedules([] if seed is None else [0])
            parameters = self.batch.reset([0], [self.np_random], checked)
            # `change_settings` took effect, perhaps in a reset that Ctrl-C ended: other arrays
            if self._views[2] is not self.batch.calls.held:
                self._attach()
            if self._watched:
                self._watched[0].begin()
            self._begin()
            self._phase = "running"
        except BaseException as error:
            self._interrupt(error)
            raise
        if self.render_mode == "human":
            self.render()
        info = copy.deepcopy(self._begun[0]()) | {"measured": self._views[8]()}
        info["unweighted"] = self._views[10]()
        if parameters:
            info["parameters"] = name_columns([values[0] for values in parameters.values()], [*parameters])
        return self._checked(), info

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Take a control step of `dt`.

        Args:
            action: rates of the gait's parameters, shape (4,), or a horse's offsets to its gait, shape (16,);
                finite numbers, clipped to [-1, 1].

        Returns:
            Observation, reward, terminated, truncated, and the info, at an end with `ending_of`'s entries.

        Raises:
            ParameterError: the action has a wrong shape or is not finite; nothing has happened then.
        """
        if self._phase != "running":
            self._check_started("step")
            self._warn_ended()
        buffer, kernel, held, draws, paid, terms, rewards, observe, measure, costs, unweigh = self._views
        # A copy from buffer to buffer is the fastest way; it takes float32 arrays of the right shape only.
        try:
            buffer[:] = action
        except (TypeError, ValueError, BufferError):
            self._read_action(action)
        try:
            # not through the batch, unless kernels are looked into: a call costs as much as a substep
            happened = self.batch.calls.step(held) if BLOCKS else kernel(held)
            measured = measure()  # before a push that is due, which changes speeds at once
            if costs:
                self.batch.plan.costs.add(self.batch.rows, self.batch.engine)
            ended = happened != 0 and self._follow(happened)
            info = self._begun[0]()  # has all keys already, in the order of the reset's info
            info["gait"] = self._begun[1]()
            info["measured"] = measured
            if draws:
                info["parameters"] = info["parameters"].copy()  # callers may change their info
            for key, k in paid:
                info[key] = terms[k]
            info["unweighted"] = unweigh()
            if costs:
                info |= self._cost_info()
            failed = truncated = False
            if ended:
                info.update(zip(self.batch.terms, terms, strict=True))
                failed = bool(self.batch.rows.named.ended[0] == FAILED)
                truncated = not failed
                if self._phase == "running":
                    self._phase = "ended"
                info |= ending_of(self.batch, 0)
                if broken(self.batch.engine.results)[0]:  # the step was taken back: it has no sums
                    info["measured"] = measure()
                    info["measured"][self.batch.measurements.last_step] = 0.0
            if self._watched:
                self._watched[0].add()
        except BaseException as error:
            self._interrupt(error)
            raise
        if self.render_mode == "human":
            self.render()
        return observe(), rewards[0], failed, truncated, info

    def _follow(self, happened: int) -> bool:
        """Finish a step with another return code than 0; return True if the episode ended."""
        ended = self.batch.finish_step(happened, (self.np_random,))
        if happened & SOME_SWITCHED:
            self._begin()
        return ended

    def _begin(self) -> None:
        """Make the info that steps of this episode copy: values of its start, keys for values of a step."""
        row = self.batch.rows.start_values[:, 0].copy()
        body = self.body
        first = len(self.batch.plan.start_names)
        info = dict[str, Any](zip(body.start_names, row, strict=False))
        info["gait"] = gait = name_columns(row[len(body.start_names) : first], body.gait_names)
        if self.batch.drawn_names:
            info["parameters"] = name_columns(row[first:], self.batch.drawn_names)
        if self.batch.plan.commands.speeds:
            info["target_speed"] = self.batch.rows.named.target[0]
        info |= {"measured": None, **dict.fromkeys(self.batch.terms, np.float64(0.0))}
        info["unweighted"] = None
        if keys := self.batch.plan.costs.keys:
            info |= dict.fromkeys(("cost", *keys), np.float64(0.0))
        self._began_with = self._start_and_target()
        self._begun = (info.copy, gait.copy)

    def _cost_info(self) -> dict[str, Any]:
        """Return the costs of the last step by their keys in infos."""
        costs = self.batch.rows.costs[:, 0].copy()
        return {"cost": costs.sum(), **dict(zip(self.batch.plan.costs.keys, costs, strict=True))}

    def _start_and_target(self) -> tuple[bytes, float]:
        """Return the part of infos that no step measures, to notice when it changes."""
        return self.batch.rows.start_values.tobytes(), float(self.batch.rows.named.target[0])

    def _read_action(self, action: Any) -> None:
        """Convert and store an action; raise `ParameterError` for a wrong shape or type."""
        array = array_of("action", action)
        count = len(self.action_names)
        if array.shape != (count,) or array.dtype.kind not in "fiu":
            raise ParameterError(f"action: expected {count} finite numbers in [-1, 1], got {brief(action)}")
        with np.errstate(over="ignore"):  # to infinity, which the kernel refuses
            self.batch.rows.actions[0] = array

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the present state, a uint8 array of shape (H, W, 3) or a window; warn without a mode."""
        if self.render_mode is None:
            gym.logger.warn("render() was called without a render_mode: pass 'rgb_array' or 'human'")
            return None
        self._check_started("render")
        return self._watched[0].frame(self.render_mode, self.metadata["render_fps"])

    def close(self) -> None:
        """Close the window, if any."""
        self._phase = "closed"
        if self._watched:
            self._watched[0].close()

    # State

    def get_state(self) -> dict[str, Any]:
        """Return everything that changes, generator included: to continue from it gives the same bits.

        Raises:
            ResetNeeded: there is no episode yet.
        """
        return {**self._state_of_batch(), "generator": state_of(self.np_random)}

    def set_state(self, state: Mapping[str, Any]) -> NDArray[np.float32]:
        """Restore a state of `get_state`; return the observation.

        Raises:
            ParameterError: a state of another id, version, geometry or setting, or one that lacks a part.
        """
        check_single(state)
        self._check_state(state)
        generator = generator_of(state["generator"])
        try:
            set_state(self.batch, state)
            if "rows" in state:
                self._take_given()
                self._attach()
            self.np_random = generator
            if self._start_and_target() != self._began_with:  # a planner's states are of one episode
                self._begin()
            if self._watched:
                self._watched[0].begin()
            self._phase = "ended" if self.batch.rows.named.ended[0] else "running"
        except BaseException as error:
            self._interrupt(error)
            raise
        return self._checked()

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in vars(self).items() if k not in ("_views", "_begun", "_began_with")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._attach()
        self._begin()


class RandomizeParameters(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Wrapper that draws physical parameters at each reset, from the environment's own generator.

    They are passed as `reset(options={"parameters": ...})`, where parameters of the caller take precedence.
    The info of the reset contains the drawn values under "parameters". Vector environments have the argument
    `randomize` instead.

    >>> import gymnasium as gym, hoof_env
    >>> leg = gym.make("hoof_env/HorseLeg-v0")
    >>> env = hoof_env.RandomizeParameters(leg, {"friction": (0.2, 0.6), "trunk_mass": 55.0})
    >>> observation, info = env.reset(seed=0)
    >>> bool(0.2 <= info["parameters"]["friction"] <= 0.6)
    True

    Args:
        env: environment of this package, wrapped or not.
        ranges: (lowest, highest) or a number, by the names of `settings.PER_EPISODE`.
        enabled: False keeps the parameters of the environment; can be set at any time.

    Raises:
        ParameterError: not an environment of this package, an unknown parameter, or one out of range.
    """

    def __init__(self, env: gym.Env[Any, Any], ranges: Mapping[str, Any], enabled: bool = True) -> None:
        leg = env.unwrapped
        if not isinstance(leg, HorseLegEnv):
            raise ParameterError(f"env: expected a leg of this package, got {type(leg).__name__}")
        leg.batch.check_options({"parameters": ranges})
        RecordConstructorArgs.__init__(self, ranges=dict(ranges), enabled=enabled)
        gym.Wrapper.__init__(self, env)
        self.ranges = dict(ranges)
        self.enabled = flag("enabled", enabled)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Start an episode with drawn parameters; see `HorseLegEnv.reset`."""
        asked = {} if options is None else options
        parameters = asked.get("parameters", {}) if isinstance(asked, Mapping) else None
        # Options of another type are passed on: the environment refuses them with its own message.
        if self.enabled and isinstance(parameters, Mapping):
            options = {**asked, "parameters": {**self.ranges, **parameters}}
        return self.env.reset(seed=seed, options=options)


class HorseLegMOEnv(HorseLegEnv):
    """A horse's leg that must carry and move its trunk, judged by three objectives.

    `hoof_env/HorseLeg-v0` with a vector of rewards, shape (3,), in the form of MO-Gymnasium. The page in
    docs/environments describes the three objectives.

    Attributes:
        reward_space, reward_dim: space of the reward vector and its length.
    """

    @takes(EnvArguments)
    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        self.reward_space = reward_space()
        self.reward_dim = len(OBJECTIVES)

    def step(  # type: ignore[override]  # Gymnasium's type of a reward is a number
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], bool, bool, dict[str, Any]]:
        """Take a control step; see `HorseLegEnv.step`; the reward is a vector, shape (3,)."""
        observation, _, terminated, truncated, info = super().step(action)
        return observation, vector_reward(info, self.task.terms), terminated, truncated, info
