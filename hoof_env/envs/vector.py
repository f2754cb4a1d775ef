"""Native vector environment: all episodes in one call, with its own time limit and autoreset.

Row i has the bits of a single environment with the same seed: with `reset(seed=s)` row i draws from the
generator that `gym.make(id).reset(seed=s + i)` would have. `call`, `get_attr` and `set_attr` accept what
those of `SyncVectorEnv` do.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from hoof_env.envs.arguments import VectorArguments, takes
from hoof_env.envs.batch_reports import endings_of, infos_of
from hoof_env.envs.batch_starts import check_options
from hoof_env.envs.drawn_recording import DrawnRecording
from hoof_env.envs.infos import name_columns
from hoof_env.envs.row_states import RowStates
from hoof_env.envs.rows import RowAttributes, RowSeeds
from hoof_env.envs.vector_checks import check_actions, check_drawn, check_mask
from hoof_env.errors import ParameterError, count
from hoof_env.render.size import USUAL_SIZE
from hoof_env.tasks.episode import FAILED, TRUNCATED

Floats = NDArray[np.float64]

MOST_ENVS = 1_000_000  # largest number of environments


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


class HorseLegVectorEnv(  # type: ignore[misc]  # generators are of all
    RowSeeds, RowAttributes, RowStates, VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]
):
    """`num_envs` environments of a task, stepped together.

    >>> import gymnasium as gym, hoof_env
    >>> envs = gym.make_vec("hoof_env/HorseLeg-v0", num_envs=3)
    >>> observations, infos = envs.reset(seed=0)
    >>> observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
    >>> observations.shape, rewards.shape
    ((3, 22), (3,))

    Args:
        num_envs: number of environments, 1 to `MOST_ENVS`.
        num_threads: threads that share the environments in a step; their number changes no bit.
        task, settings: arguments of `HorseLegEnv`.
        autoreset_mode: an `AutoresetMode`, its name or its value: NEXT_STEP, SAME_STEP or DISABLED.
        max_episode_steps: largest number of control steps of an episode, like that of Gymnasium's TimeLimit;
            None for `episode_seconds` alone.
        render_mode: "rgb_array"; `render` returns a picture of each environment.
        rendered: number of environments that are drawn, the first ones; pictures of the others are black.
            None draws all, if they are at most `MOST_DRAWN`.
        width, height: size of each picture [pixels].

    Attributes:
        drawn: number of environments that are drawn.

    Rewards are float64, shape (num_envs,). Infos are those of the single environment as arrays. When an
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
        self.num_envs = count("num_envs", num_envs, most=MOST_ENVS)
        self.autoreset_mode = mode_of(autoreset_mode)
        spaces = self._make(task, settings, self.num_envs, render_mode, (width, height), num_threads)
        if max_episode_steps is not None:
            self.batch.limit(count("max_episode_steps", max_episode_steps))
        self.single_observation_space, self.single_action_space = spaces
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.metadata["autoreset_mode"] = self.autoreset_mode
        self.spec = None
        self.drawn = check_drawn(rendered, self.num_envs, self.render_mode)
        self._watched = {env: DrawnRecording(self.batch, env, self._size) for env in range(self.drawn)}
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
        checked = check_options(self.batch, rest, np.flatnonzero(mask))
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
        """Take a control step of all environments.

        Args:
            actions: actions, shape (num_envs, numbers), as of `HorseLegEnv.step`.

        Returns:
            Observations, rewards, terminated, truncated, and infos.

        Raises:
            ParameterError: actions of a wrong shape or type, or not finite.
            ResetNeeded: `reset` was not called, or, with autoreset disabled, an episode has ended.
        """
        if self._phase == "new" and self._started.any():
            missing = np.flatnonzero(~self._started).tolist()
            raise ResetNeeded(
                f"step() was called while environments {missing} have no episode yet: expected reset()"
            )
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
        batch.actions[:n] = check_actions(actions, (n, len(batch.action_names)))
        some_ended = batch.step(self._generators, again)
        how = batch.episode_rows.ended[:n]
        terminated = how == FAILED
        truncated = how == TRUNCATED
        # NEXT_STEP: these environments start in this call; their step above does not count.
        if again is not None:
            terminated[again] = False
            truncated[again] = False
            self._start(np.flatnonzero(again), {})
        done = terminated | truncated
        infos = infos_of(batch, some_ended)
        rewards = batch.rewards[:n].copy()
        if done.any():
            infos |= endings_of(batch, done)
        if done.any() and self.autoreset_mode == AutoresetMode.SAME_STEP:
            infos = self._same_step(infos, done)
            done = np.zeros(n, bool)
        else:
            self._remember()
        self._ended = done
        return self._observed(), rewards, terminated, truncated, infos

    def _same_step(self, final: dict[str, Any], done: NDArray[np.bool_]) -> dict[str, Any]:
        """Start ended episodes again at once. Return the infos of the starts, with the last observations and
        infos as "final_obs" and "final_info".

        Args:
            final: infos of the step.
            done: True for environments that ended an episode, shape (num_envs,).
        """
        # Objects, as Gymnasium gives final observations: None for the other environments.
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
        """Return a picture of each environment, uint8 of shape (H, W, 3): those that are drawn, then black
        ones; warn and return None without a render_mode."""
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
        for recording in self._watched.values():
            recording.close()

    # Values of each environment

    @property
    def weight(self) -> Floats:
        """Weight of trunk and leg [N], shape (num_envs,)."""
        return self.batch.episode_rows.weight[: self.num_envs].copy()

    def record(self, env: int = 0) -> dict[str, Floats]:
        """Return state and report of an environment at every substep of the last control step, see
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
        # Steps are refused until every environment has had a first episode.
        if self._phase == "new" and self._started.all():
            self._phase = "running"
        if self._watched:
            for env in self._watched.keys() & set(envs.tolist()):
                self._watched[env].begin()
        return parameters

    def _remember(self) -> None:
        """Add the step to the recordings."""
        for env, recording in self._watched.items():
            if not self._ended[env]:  # else it has just started, and `_start` began its recording
                recording.add()
