"""One way to play a policy: what it returns besides an action is carried from step to step."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from hoof_env.envs.policies import start_of
from hoof_env.errors import ParameterError, brief
from hoof_env.policies.find import load_policy
from hoof_env.tasks.schedules import SPEED


class Actor:
    """Policy as every command plays it: with its memory, from the start of each episode, and the mode of its
    distribution.

    >>> import gymnasium as gym, hoof_env
    >>> from hoof_env.policies.actor import Actor
    >>> env = gym.make("hoof_env/HorseLeg-v0")
    >>> actor = Actor("shipped", env)
    >>> observation, _ = env.reset(seed=0, options=actor.start)
    >>> observation, *_ = env.step(actor.act(observation))

    Args:
        policy: what `load_policy` takes.
        env: single environment that it plays, or one like the rows of a vector environment.
        seed: seed of the policy "random".

    Attributes:
        policy: the policy.
        start: reset options of its episodes, empty for most.

    Raises:
        HoofEnvError: as in `load_policy`.
        ParameterError: its `predict` takes other arguments.
    """

    def __init__(self, policy: Any, env: gym.Env[Any, Any] | None = None, seed: int = 0) -> None:
        self.policy = load_policy(policy, env, seed)
        self.start = start_of(self.policy)
        _check_signature(self.policy)
        self.begin()

    def begin(self, rows: int = 1) -> None:
        """Begin new episodes, one or a row for each of many; what the policy remembers is forgotten."""
        self._state: Any = None
        self._begins: NDArray[np.bool_] = np.ones(rows, bool)

    def act(self, observation: Any) -> Any:
        """Return the action for an observation, or the actions for a row of each; `ParameterError` if the
        policy returns anything other than actions and a state."""
        # Policies without a memory need not know of one.
        remembered = {} if self._state is None else {"state": self._state}
        found = self.policy.predict(observation, episode_start=self._begins, deterministic=True, **remembered)
        if not isinstance(found, tuple) or len(found) != 2:
            raise ParameterError(
                f"policy {type(self.policy).__name__}: expected predict to return actions and a state, None"
                f" without a memory, got {brief(found)}"
            )
        action, self._state = found
        self._begins = np.zeros_like(self._begins)
        return action

    def restart(self, rows: NDArray[np.bool_]) -> None:
        """Say which rows, shape (n,), begin a new episode with their next observation."""
        self._begins = np.array(rows, bool)


def lost_command(start: Mapping[str, Any], env: gym.Env[Any, Any]) -> str:
    """Return in words that reset options have a commanded speed in place of one that was asked for when the
    environment was made; "" if it replaces none.

    Args:
        start: reset options.
        env: environment, wrapped or not.
    """
    speed = start.get("target_speed")
    leg: Any = env.unwrapped
    if speed is None or not hasattr(leg, "task"):
        return ""
    asked = leg.settings
    usual = leg.task.settings({"size": asked.size})
    given = [
        f"{name}={brief(value)}"
        for name, value in (("target_speed", asked.target_speed), ("schedule", asked.schedule))
        if value != getattr(usual, name) and value != speed and (name != "schedule" or SPEED in (value or {}))
    ]
    return f"commanded speed {float(speed):.2f} m/s, in place of {' and '.join(given)}" if given else ""


def _check_signature(policy: Any) -> None:
    """Raise `ParameterError` unless a policy's `predict` can be called as `Actor` calls it."""
    try:
        signature = inspect.signature(policy.predict)
    # Functions of compiled modules have none
    except (TypeError, ValueError):
        return
    try:
        signature.bind(None, episode_start=None, deterministic=True)
    except TypeError as error:
        raise ParameterError(
            f"policy {type(policy).__name__}: expected predict(observation, state=None, episode_start=None,"
            f" deterministic=True), as in Stable-Baselines3; got predict{signature} ({error})"
        ) from None
