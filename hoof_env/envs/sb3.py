"""Native vector environment with the interface of Stable-Baselines3's `VecEnv`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from hoof_env.envs.arguments import Sb3Arguments, takes
from hoof_env.envs.base import fixed_setting
from hoof_env.envs.vector import PER_ENV, HorseLegVectorEnv
from hoof_env.episodes.infos import NamedArray, name_columns, row_of
from hoof_env.errors import ParameterError
from hoof_env.tasks.settings import SETTINGS

ENDINGS = ("episode_summary", "end", "is_success", "final_obs", "final_info")
"""Entries of the vector environment's infos that are of ends of episodes alone."""


class RowInfo(dict[str, Any]):
    """Info of one environment after a step.

    Its own entries are added at an episode's end. The measurements of every step are read from the arrays of
    all environments on request: as dictionaries they would cost more than the simulation. The first call that
    removes or stores such an entry makes it an ordinary dictionary.

    Args:
        arrays: infos of the vector environment.
        env: index of the environment.
        ended: entries of the end of its episode.
    """

    __slots__ = ("_arrays", "_env")

    def __init__(self, arrays: Mapping[str, Any], env: int, ended: Mapping[str, Any] | None = None) -> None:
        self._arrays = arrays
        self._env = env
        if ended:
            self.update(ended)

    def __missing__(self, key: str) -> Any:
        if not self._is_measured(key):
            raise KeyError(key)
        values = self._arrays[key]
        row = values[self._env]
        return name_columns(row.copy(), values.names) if isinstance(values, NamedArray) else row

    def _is_measured(self, key: Any) -> bool:
        return key in self._arrays and not key.startswith("_") and key not in ENDINGS

    def __contains__(self, key: object) -> bool:
        return super().__contains__(key) or self._is_measured(key)

    def get(self, key: str, default: Any = None) -> Any:
        """Return an entry, or `default` if there is none."""
        # Quickly for keys that no info has, for which learners ask in every row of every step.
        found = super().get(key, self)
        if found is not self:
            return found
        return self[key] if key in self._arrays and self._is_measured(key) else default

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def __len__(self) -> int:
        return len(self.keys())

    def keys(self) -> Any:
        """Return the names of all entries."""
        return dict.fromkeys([*filter(self._is_measured, self._arrays), *super().keys()]).keys()

    def values(self) -> Any:
        """Return the values of all entries."""
        return self.copy().values()

    def items(self) -> Any:
        """Return the names and values of all entries."""
        return self.copy().items()

    def copy(self) -> dict[str, Any]:
        """Return an ordinary dictionary with all entries."""
        return {key: self[key] for key in self.keys()}

    def _fill(self) -> RowInfo:
        """Take all entries into the dictionary itself; return it."""
        entries = self.copy()
        self.clear()
        self.update(entries)
        return self

    def clear(self) -> None:
        """Remove all entries."""
        super().clear()
        self._arrays = {}

    def __delitem__(self, key: str) -> None:
        dict.__delitem__(self._fill(), key)

    def pop(self, *args: Any) -> Any:
        """Remove an entry and return it; see `dict.pop`."""
        return dict.pop(self._fill(), *args)

    def popitem(self) -> tuple[str, Any]:
        """Remove the last entry and return it."""
        return dict.popitem(self._fill())

    def setdefault(self, key: str, default: Any = None) -> Any:
        """Return an entry, `default` if there is none, and keep it."""
        return dict.setdefault(self._fill(), key, default)

    def __eq__(self, other: object) -> bool:
        return self.copy() == (other.copy() if isinstance(other, RowInfo) else other)

    def __ne__(self, other: object) -> bool:
        return not self == other

    __hash__ = None

    def __or__(self, other: Any) -> Any:
        return self.copy() | other

    def __reversed__(self) -> Iterator[str]:
        return reversed(self.keys())

    def __repr__(self) -> str:
        return repr(self.copy())

    def __reduce__(self) -> Any:
        return dict, (self.copy(),)


class Sb3VecEnv(VecEnv):
    """`num_envs` environments of an id for Stable-Baselines3, all stepped in one call.

    Wrap it in `VecMonitor` for episode returns. When an episode ends its info has "terminal_observation",
    "TimeLimit.truncated", "episode_summary", "end" and "is_success". The other entries of an info are read
    from arrays when they are asked for (`RowInfo`); `terms` and `measured` are the arrays of the last step.
    `reset_infos` contains the info of the reset of each environment's present episode, drawn parameters
    included.

    >>> import hoof_env
    >>> from stable_baselines3 import PPO
    >>> envs = hoof_env.Sb3VecEnv("hoof_env/HorseLeg-v0", num_envs=3)
    >>> model = PPO("MlpPolicy", envs, device="cpu")
    >>> model.predict(envs.reset())[0].shape
    (3, 4)

    Args:
        env_id: registered id of this package.
        num_envs: number of environments.
        settings: arguments of the environment, and `num_threads`.

    Attributes:
        terms: terms of the last rewards by name, shape (num_envs,) each.
        measured: measurements of the last step, shape (num_envs, ...), by position or by name, also where it
            ended an episode.

    Raises:
        ParameterError: an id without a native vector environment, another autoreset mode than SAME_STEP, or a
            bad argument.
    """

    @takes(Sb3Arguments)
    def __init__(self, env_id: str = "hoof_env/HorseLeg-v0", num_envs: int = 64, **settings: Any) -> None:
        if "vectorization_mode" in settings:
            raise ParameterError("vectorization_mode: expected none, because all are stepped in one call")
        settings.setdefault("autoreset_mode", AutoresetMode.SAME_STEP)
        try:
            many: dict[str, Any] = {"vectorization_mode": "vector_entry_point", **settings}
            envs = gym.make_vec(env_id, num_envs, **many).unwrapped
        except ParameterError:
            raise
        # An unknown id, or one of another package: its environments do not take these arguments.
        except (gym.error.Error, ModuleNotFoundError, TypeError):
            envs = None
        if not isinstance(envs, HorseLegVectorEnv):
            raise ParameterError(f"env_id: expected an id of this package with many at once, got {env_id!r}")
        if hasattr(envs, "reward_space"):
            raise ParameterError(
                f"env_id: expected an id with one number for a reward, got {env_id!r} with a"
                " vector; hoof_env/HorseLeg-v0 pays its weighted sum with"
                " reward_weights=hoof_env.tasks.objectives.scalar_weights([...])"
            )
        if envs.autoreset_mode != AutoresetMode.SAME_STEP:
            raise ParameterError(f"autoreset_mode: expected SAME_STEP, got {settings['autoreset_mode']!r}")
        self.envs = envs
        self.render_mode = envs.render_mode
        self._actions: NDArray[Any] | None = None
        self.terms = {name: np.zeros(num_envs) for name in envs.terms}
        super().__init__(num_envs, envs.single_observation_space, envs.single_action_space)

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an attribute.

        Raises:
            FixedSettingError: a setting, which `HorseLegVectorEnv` refuses, too.
        """
        if name in SETTINGS:
            raise fixed_setting(name)
        super().__setattr__(name, value)

    def reset(self) -> NDArray[np.float32]:
        """Start all episodes, with the seeds and options that were set for the next reset; return the
        observations."""
        seeds = list(self._seeds)
        # Options, and the environments that have them: each group is one call of the vector environment.
        groups: list[tuple[Any, list[int]]] = []
        for env, options in enumerate(self._options):
            rows = next((rows for known, rows in groups if _are_equal(known, options or None)), None)
            if rows is None:
                groups.append((options or None, [env]))
            else:
                rows.append(env)
        # All before the first reset, so that refused options change nothing.
        for options, _ in groups:
            self.envs.batch.check_options(options)
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for options, rows in groups:
            mask = np.zeros(self.num_envs, bool)
            mask[rows] = True
            masked = {**(options or {}), "reset_mask": mask}
            observations, infos = self.envs.reset(seed=seeds, options=masked)
            for env in rows:
                self.reset_infos[env] = row_of(infos, env)
        self.measured = infos["measured"]
        # Stable-Baselines3 uses seeds and options once.
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Take a control step; return observations, rewards, ends of episodes, and infos."""
        observations, rewards, terminated, truncated, infos = self.envs.step(self._actions)  # type: ignore[arg-type]
        dones = terminated | truncated
        # With SAME_STEP `infos` are already of the next episode where one ended.
        of_step = infos.get("final_info", infos)
        self.terms = {name: of_step[name] for name in self.terms}
        self.measured = of_step["measured"]
        each: list[dict[str, Any]] = [RowInfo(of_step, env) for env in range(self.num_envs)]
        if dones.any():
            final = infos["final_info"]
            figures = infos["final_info"]["episode_summary"]
            names = [name for name in figures if not name.startswith("_")]
            reasons = [reason for reason in final["end"] if not reason.startswith("_")]
            started = {key: values for key, values in infos.items() if key in self.reset_infos[0]}
            for env in np.flatnonzero(dones):
                self.reset_infos[env] = row_of(started, int(env))
                ended = {
                    "terminal_observation": infos["final_obs"][env],
                    "TimeLimit.truncated": bool(truncated[env]),
                    "episode_summary": {name: float(figures[name][env]) for name in names},
                    "end": {reason: True for reason in reasons if final["end"][reason][env]},
                    "is_success": bool(final["is_success"][env]),
                }
                each[env] = RowInfo(of_step, int(env), ended)
        return observations, rewards.astype(np.float32), dones, each

    def close(self) -> None:
        """Close the vector environment."""
        self.envs.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return pictures of the environments that are drawn."""
        return list(self.envs.render() or ())[: self.envs.drawn]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of some environments, or of all; see `HorseLegVectorEnv.get_attr`."""
        return self.envs.call_on(attr_name, self._get_indices(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Store an attribute of some environments, or of all; see `HorseLegVectorEnv.set_attr`; one value for
        all of these."""
        self.envs.set_attr_of(attr_name, dict.fromkeys(self._get_indices(indices), value))

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Call a method of some environments, or of all; see `HorseLegVectorEnv.call`.

        Raises:
            ParameterError: `indices` are some environments only, and the method is one of all together.
        """
        if method_name not in (*PER_ENV, "change_settings", "get_wrapper_attr", "has_wrapper_attr"):
            self._whole("env_method", indices)
        return self.envs.call_on(method_name, self._get_indices(indices), *args, **kwargs)

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return False for each environment: single ones do not exist and cannot be wrapped."""
        return [False for _ in self._get_indices(indices)]

    def _whole(self, name: str, indices: Any) -> None:
        """Check that indices name all environments.

        Raises:
            ParameterError: they are not.
        """
        if len(list(self._get_indices(indices))) != self.num_envs:
            raise ParameterError(f"{name}: expected all environments, which are one, got {indices!r}")


def _are_equal(one: Any, other: Any) -> bool:
    """Return True if options are known to be equal; options with arrays only if they are one object."""
    if one is other:
        return True
    try:
        return bool(one == other)
    except ValueError:  # the comparison of arrays is an array
        return False
