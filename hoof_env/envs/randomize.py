"""Other masses, grounds and motors in each episode, as a wrapper that evaluation can switch off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
from gymnasium.utils import RecordConstructorArgs

from hoof_env.envs.horse_leg import HorseLegEnv
from hoof_env.errors import ParameterError, flag


class RandomizeParameters(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Draws physical parameters at each reset, from the environment's own generator.

    They go to `reset(options={"parameters": ...})`, where a parameter that the caller names takes precedence.
    What was drawn is in the info of the reset, under "parameters". Many environments at once have the
    argument `randomize` instead.

    Args:
        env: an environment of this family, wrapped or not.
        ranges: (lowest, highest) or a number, by the names of `tasks.PER_EPISODE`.
        enabled: False leaves the parameters as the environment was made with; can be set at any time.

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
        self.ranges, self.enabled = dict(ranges), flag("enabled", enabled)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Start an episode with parameters of its own."""
        given = {} if options is None else options
        own = given.get("parameters", {}) if isinstance(given, Mapping) else None
        if self.enabled and isinstance(own, Mapping):  # else the environment says what is wrong
            options = {**given, "parameters": {**self.ranges, **own}}
        return self.env.reset(seed=seed, options=options)
