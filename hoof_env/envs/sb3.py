"""The native vector environment as Stable-Baselines3's `VecEnv`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from hoof_env.envs.base import fixed_setting
from hoof_env.envs.batch_starts import check_options
from hoof_env.envs.infos import row_of
from hoof_env.envs.rows import PER_ENV
from hoof_env.envs.vector import HorseLegVectorEnv
from hoof_env.errors import ParameterError
from hoof_env.tasks.keywords import VectorKeywords
from hoof_env.tasks.settings import SETTINGS


class Sb3VecEnv(VecEnv):
    """`num_envs` environments of an id for Stable-Baselines3, all stepped in one call.

    Wrap it in `VecMonitor` for episode returns. When an episode ends its info has "terminal_observation",
    "TimeLimit.truncated" and "episode_summary"; nothing else is in the infos, for a dictionary an environment
    and step costs more than the simulation: `terms` and `measured` are of the last step. `reset_infos` has
    what `reset` says of each environment's present episode, drawn parameters too.

    Args:
        env_id: registered id of the family.
        num_envs: how many.
        settings: arguments of the environment, and `num_threads`.

    Attributes:
        terms: of the last rewards by name, shape (num_envs,) each.
        measured: what the last step's infos measure, shape (num_envs, ...), by position or by name; where an
            episode ended, at the start of the next one.

    Raises:
        ParameterError: an id without a native vector environment, another autoreset mode than SAME_STEP, or a
            bad argument.
    """

    def __init__(
        self, env_id: str = "hoof_env/HorseLeg-v0", num_envs: int = 64, **settings: Unpack[VectorKeywords]
    ) -> None:
        if "vectorization_mode" in settings:
            raise ParameterError("vectorization_mode: expected none, for all are stepped in one call")
        settings.setdefault("autoreset_mode", AutoresetMode.SAME_STEP)
        try:
            many: dict[str, Any] = {"vectorization_mode": "vector_entry_point", **settings}
            envs = gym.make_vec(env_id, num_envs, **many).unwrapped
        except ParameterError:
            raise
        except (gym.error.Error, ModuleNotFoundError, TypeError):  # an unknown id, or one of another package
            envs = None
        if not isinstance(envs, HorseLegVectorEnv):
            raise ParameterError(f"env_id: expected an id of this package with many at once, got {env_id!r}")
        if envs.autoreset_mode != AutoresetMode.SAME_STEP:
            raise ParameterError(f"autoreset_mode: expected SAME_STEP, got {settings['autoreset_mode']!r}")
        self.envs = envs
        self.render_mode = envs.render_mode
        self._actions: NDArray[Any] | None = None
        self.terms = {name: np.zeros(num_envs) for name in envs.batch.terms}
        super().__init__(num_envs, envs.single_observation_space, envs.single_action_space)

    def __setattr__(self, name: str, value: Any) -> None:
        """As of any object, but for settings, which `HorseLegVectorEnv` refuses, too."""
        if name in SETTINGS:
            raise fixed_setting(name)
        super().__setattr__(name, value)

    def reset(self) -> NDArray[np.float32]:
        """Observations at the start of all episodes."""
        seeds = list(self._seeds)
        groups: list[tuple[Any, list[int]]] = []  # options, and the environments that have them
        for env, options in enumerate(self._options):
            rows = next((rows for known, rows in groups if known == (options or None)), None)
            if rows is None:
                groups.append((options or None, [env]))
            else:
                rows.append(env)
        for options, _ in groups:  # what is refused changes nothing
            check_options(self.envs.batch, options)
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for options, rows in groups:
            mask = np.zeros(self.num_envs, bool)
            mask[rows] = True
            some = {**(options or {}), "reset_mask": mask}
            observations, infos = self.envs.reset(seed=seeds, options=some)
            for env in rows:
                self.reset_infos[env] = row_of(infos, env)
        self.measured = infos["measured"]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Take the step."""
        observations, rewards, terminated, truncated, infos = self.envs.step(self._actions)  # type: ignore[arg-type]
        self.terms = {name: infos[name] for name in self.terms}
        self.measured = infos["measured"]
        dones = terminated | truncated
        each: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if dones.any():
            final = infos["final_info"]
            figures = infos["final_info"]["episode_summary"]
            names = [name for name in figures if not name.startswith("_")]
            for name in self.terms:
                self.terms[name] = np.where(dones, final[name], infos[name])
            started = {key: values for key, values in infos.items() if key in self.reset_infos[0]}
            for env in np.flatnonzero(dones):
                self.reset_infos[env] = row_of(started, int(env))
                each[env] = {
                    "terminal_observation": infos["final_obs"][env],
                    "TimeLimit.truncated": bool(truncated[env]),
                    "episode_summary": {name: float(figures[name][env]) for name in names},
                }
        return observations, rewards.astype(np.float32), dones, each

    def close(self) -> None:
        """Give everything back."""
        self.envs.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Frames of the environments that are drawn."""
        return list(self.envs.render() or ())[: self.envs.drawn]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """As `HorseLegVectorEnv.get_attr`."""
        return self.envs.call_on(attr_name, self._get_indices(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """As `HorseLegVectorEnv.set_attr`, of some environments or of all."""
        self.envs.set_attr_of(attr_name, dict.fromkeys(self._get_indices(indices), value))

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """As `HorseLegVectorEnv.call`; ParameterError where some are meant by a method of all together."""
        if method_name not in (*PER_ENV, "get_wrapper_attr", "has_wrapper_attr"):
            self._whole("env_method", indices)
        return self.envs.call_on(method_name, self._get_indices(indices), *args, **kwargs)

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Nothing is wrapped."""
        return [False for _ in self._get_indices(indices)]

    def _whole(self, name: str, indices: Any) -> None:
        if len(list(self._get_indices(indices))) != self.num_envs:
            raise ParameterError(f"{name}: expected all environments, which are one, got {indices!r}")
