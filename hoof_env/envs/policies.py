"""Scripted policies: the gaits of a preset and the simplest things a policy can do wrong.

All have Stable-Baselines3's `predict`, so that scripted and trained policies are interchangeable.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from hoof_env.envs.start import extreme_posture
from hoof_env.errors import check_choice
from hoof_env.gait.parameters import GaitParameters, paper_gaits
from hoof_env.leg.profile import leg_profile

Action = NDArray[np.float32]


class Policy(Protocol):
    """Anything with Stable-Baselines3's `predict`."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Action for an observation, and the next recurrent state (None)."""


class Scripted:
    """A policy for one environment as a function of (observation, time since its creation or `reset` [s])."""

    def __init__(self, act: Any, dt: float) -> None:
        self._act, self._dt, self._steps = act, dt, 0

    def reset(self) -> None:
        """Start an episode."""
        self._steps = 0

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Action, None]:
        """Action for one observation; `episode_start` (bool or array of one) restarts the clock."""
        if episode_start is not None and bool(np.all(episode_start)):
            self.reset()
        time = self._steps * self._dt
        self._steps += 1
        return np.asarray(self._act(observation, time), dtype=np.float32), None


POLICIES = ("idle", "random", "bang-bang", "drag", "airborne")
"""Names of the policies that are not a gait of the preset."""


def policy_names(env: Any) -> list[str]:
    """Names accepted by `make_policy` for an environment: the gaits of its preset and `POLICIES`."""
    return sorted(env.unwrapped.gaits) + list(POLICIES)


def make_policy(name: str, env: Any, seed: int = 0) -> Scripted:
    """A scripted policy for an environment.

    A gait name commands that gait. "idle" stops the crank and holds the swing; "random" draws a new action
    every step; "bang-bang" flips all four actions between their limits every quarter of a second; "drag"
    turns the hoof to the ground, stops there and rubs it to and fro with the swing; "airborne" turns it to
    its highest place and stops there.

    Raises:
        ParameterError: unknown name.
    """
    leg = env.unwrapped
    check_choice("policy", name, policy_names(env))
    if name in leg.gaits:
        action = leg.action_for(leg.gaits[name])
        return Scripted(lambda observation, time: action, leg.dt)
    if name == "random":
        generator = np.random.default_rng(seed)
        return Scripted(lambda observation, time: generator.uniform(-1, 1, 4), leg.dt)
    if name == "bang-bang":
        return Scripted(lambda observation, time: np.full(4, 1.0 if int(time / 0.25) % 2 else -1.0), leg.dt)
    offsets = [gait.swing_offset for gait in paper_gaits(leg.gaits).values()]
    middle = sum(offsets) / len(offsets)
    rest = leg.action_for(GaitParameters(0.0, middle, 0.0, 0.0))
    if name == "idle":
        return Scripted(lambda observation, time: rest, leg.dt)
    offsets = [middle] if name == "drag" else np.linspace(0.0, 1.4, 15).tolist()
    offset, target = extreme_posture(leg_profile(leg.geometry), offsets, name == "drag")

    def hold(observation: Any, time: float) -> Action:
        """Turn the crank (it turns one way only) to `target` and stop; "drag" then swings to and fro."""
        ahead = (target - math.atan2(observation[0], observation[1])) % (2 * np.pi)
        speed = 2.0 * ahead if 0.05 < ahead < np.pi * 1.5 else 0.0
        swing = 0.15 * math.sin(np.pi * time) if name == "drag" else 0.0
        return leg.action_for(GaitParameters(min(speed, 2 * np.pi), offset + swing, 0.0, 0.0))

    return Scripted(hold, leg.dt)
