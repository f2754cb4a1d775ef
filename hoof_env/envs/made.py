"""What single and vector environment share once they are made: what is set stays set, and the spec tells how
long an episode lasts."""

from __future__ import annotations

import copy
from dataclasses import fields
from typing import Any

from gymnasium.envs.registration import EnvSpec

from hoof_env.envs.batch import EpisodeBatch
from hoof_env.envs.tasks import PER_EPISODE, Settings
from hoof_env.errors import FixedSettingError

SETTINGS = frozenset(item.name for item in fields(Settings))


def fixed_setting(name: str) -> FixedSettingError:
    """The error of an assignment to a setting, or to what follows from the settings."""
    how = "gymnasium.make(id, ...)" if name in SETTINGS else "the arguments of gymnasium.make"
    if name in PER_EPISODE:
        how += f", or reset(options={{'parameters': {{{name!r}: ...}}}}) for an episode"
    return FixedSettingError(f"{name}: expected no assignment, which would change nothing; set it by {how}")


class Made:
    """Refuses assignments that would look like a setting and change nothing; completes the spec.

    Attributes:
        batch: the episodes.
        spec: what Gymnasium made it from. `max_episode_steps` is the environment's own limit, which
            `episode_seconds` and `dt` give, unless somebody else's is there already.
    """

    batch: EpisodeBatch
    _spec: EnvSpec | None = None

    def __setattr__(self, name: str, value: Any) -> None:
        """As of any object, but for settings and what follows from them.

        Raises:
            FixedSettingError: a setting, or a property that cannot be set.
        """
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
        if spec is not None and spec.max_episode_steps is None:
            spec = copy.copy(spec)  # it may be the registered one
            spec.max_episode_steps = self.batch.steps_per_episode
        self._spec = spec
