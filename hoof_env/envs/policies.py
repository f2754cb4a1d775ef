"""Scripted policies: gaits of a preset or a file, and simple policies that a good reward must not favour.

All have the method `predict` of Stable-Baselines3, so that scripted and trained policies are interchangeable.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env._display import line_of
from hoof_env.errors import ParameterError, brief, check_choice
from hoof_env.gait import LIMITS, GaitParameters, paper_gaits
from hoof_env.leg.profile import leg_profile
from hoof_env.tasks.leg_starts import extreme_posture
from hoof_env.tasks.one_leg import action_towards, lead_of

Action = NDArray[np.float32]


class Scripted:
    """Policy that is a function of observation and time since the start of the episode [s], for one
    environment or many.

    Args:
        act: function of an observation, shape (k,), and a time that returns the action, shape (4,). For many
            environments it must also take shapes (n, k) and (n,) and return (n, 4), or (4,) for all.
        dt: control step [s].
        start: reset options of the policy's episodes, unless a call gives its own; a gait starts in itself.

    Attributes:
        name: name by which `make_policy` made it, "" if it did not.
    """

    name = ""

    def __init__(self, act: Any, dt: float, start: Mapping[str, Any] | None = None) -> None:
        self._act = act
        self._dt = dt
        self.start = dict(start or {})
        self.reset()

    def __repr__(self) -> str:
        return line_of(type(self).__name__, name=self.name, start=self.start)

    def reset(self) -> None:
        """Restart the clocks of all environments."""
        self._steps = np.zeros((), int)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Action, None]:
        """Return the action for an observation, or the actions for many, shape (n, 4), and no state.

        Args:
            observation: observation, shape (k,), or (n, k) of n environments.
            state: ignored; it belongs to the interface.
            episode_start: True where an episode starts, a bool or an array of shape (n,): the clock is
                restarted there.
            deterministic: ignored; it belongs to the interface.
        """
        rows = np.shape(observation)[:-1]
        # Another number of environments than at the last call: these are new episodes.
        if self._steps.shape != rows:
            self._steps = np.zeros(rows, int)
        if episode_start is not None:
            again = np.broadcast_to(episode_start, rows) if rows else bool(np.all(episode_start))
            self._steps = np.where(again, 0, self._steps)
        action = np.asarray(self._act(observation, self._steps * self._dt), dtype=np.float32)
        self._steps = self._steps + 1
        return np.broadcast_to(action, (*rows, action.shape[-1])).copy(), None


def start_of(policy: Any) -> dict[str, Any]:
    """Return the reset options of a policy's episodes, an empty mapping for a policy without any."""
    return dict(getattr(policy, "start", None) or {})


def policy_names(env: Any) -> list[str]:
    """Return the names that `make_policy` accepts for an environment; see `body.Body.policy_names`."""
    return list(env.unwrapped.body.policy_names)


def heading_seen(env: Any) -> Any:
    """Return a function of observations of one leg, shape (..., k), that returns the parameters towards which
    the gait is heading, shape (..., 4); see `one_leg.heading_now`.

    Raises:
        ParameterError: the environment does not observe its gait.
    """
    leg: Any = env.unwrapped
    if "gait" not in leg.settings.observation:
        raise ParameterError(
            "policy: expected 'gait' among the observed groups, because a policy that goes to a gait must see"
            f" the present one; got {brief(leg.settings.observation)}"
        )
    names = leg.observation_names
    first = names.index("crank speed")
    middle = first + len(LIMITS)
    last = middle + len(LIMITS)
    body = leg.body
    lead = lead_of(body.filters, leg.dt)
    rate_bounds = body.filters.to_array()[:, 1]

    def heading(observation: Any) -> Any:
        """Undo the scaling of the observation: gait plus lead times rate."""
        seen = np.asarray(observation, float)
        if not seen.ndim:
            raise ParameterError(
                f"observation: expected what the environment returned, of shape (..., {len(names)}), because"
                f" a policy that goes to a gait must see the present one; got {brief(observation)}"
            )
        gait = body.middle + body.half * seen[..., first:middle]
        return gait + lead * rate_bounds * seen[..., middle:last]

    return heading


def towards(env: Any, gait_at: Any) -> Any:
    """Return a function of observations and times. Its actions change the gait towards `gait_at(observations,
    times)` as fast as is allowed; see `LegBase.action_for`."""
    leg = env.unwrapped
    heading = heading_seen(env)
    reach = leg.body.reach(leg.engine, leg.dt)

    def act(observation: Any, time: Any) -> Action:
        return action_towards(np.asarray(gait_at(observation, time), float), heading(observation), reach)

    return act


def make_policy(name: str, env: Any, seed: int = 0) -> Scripted:
    """Make a scripted policy for an environment.

    The name of a gait starts in that gait and keeps it. "zero" is the zero action: it keeps the gait in which
    an episode starts, and on a horse is "reference" by another name. "idle" stops the crank and holds the
    swing; "random" draws a new action in every step; "bang-bang" switches all actions between their limits
    every quarter of a second; "drag" turns the hoof to the ground, stops there and moves it back and forth
    with the swing; "airborne" turns it to its highest position and stops there. For a horse, "reference" is
    the zero action: the gait from which actions make offsets. "kinematic-walk" and "kinematic-trot" are zero
    actions in the stored gait of this name, at its own speed.

    >>> import gymnasium as gym, hoof_env
    >>> env = gym.make("hoof_env/HorseLeg-v0")
    >>> policy = hoof_env.make_policy("run", env)
    >>> observation, info = env.reset(seed=0, options=policy.start)
    >>> action, _ = policy.predict(observation, episode_start=True)

    Args:
        name: one of `policy_names`.
        env: environment of this package, wrapped or not.
        seed: seed of "random".

    Raises:
        ParameterError: an unknown name, or a policy that needs an entry that is not observed.
    """
    leg: Any = getattr(env, "unwrapped", None)
    if not hasattr(leg, "gaits"):
        raise ParameterError(
            f"env: expected an environment of this package, make_policy(name, env), got {brief(env)}"
        )
    check_choice("policy", name, policy_names(env))
    if leg.task.action_map and name not in ("zero", "random", "bang-bang"):
        raise ParameterError(
            f'policy {name!r}: expected actions of the leg, got actions that are {leg.action_form}; "zero",'
            ' "random" and "bang-bang" take any'
        )
    policy = _scripted(name, env, leg, seed)
    policy.name = name
    return policy


def _scripted(name: str, env: Any, leg: Any, seed: int) -> Scripted:
    """Make the policy of a known name; see `make_policy`; `leg` is the unwrapped environment."""
    count = len(leg.action_names)
    if name in ("zero", "reference"):
        return Scripted(lambda observation, time: np.zeros(count, np.float32), leg.dt)
    if name == "random":
        generator = np.random.default_rng(seed)
        return Scripted(lambda observation, time: generator.uniform(-1, 1, (*np.shape(time), count)), leg.dt)
    if name == "bang-bang":
        return Scripted(partial(_bang_bang, count), leg.dt)
    if name in leg.body.policy_starts:
        zeros = np.zeros(count, np.float32)
        return Scripted(lambda observation, time: zeros, leg.dt, leg.body.policy_starts[name])
    if name in leg.gaits:
        return constant_gait(leg.gaits[name], env, starts_in_it=True)
    offsets = [gait.swing_offset for gait in paper_gaits(leg.gaits).values()]
    middle = sum(offsets) / len(offsets)
    if name == "idle":
        return constant_gait(GaitParameters(0.0, middle, 0.0, 0.0), env)
    return _at_a_posture(name, env, middle)


def _bang_bang(count: int, observation: Any, time: Any) -> Any:
    """Return the actions of "bang-bang"."""
    is_high = np.asarray(time / 0.25).astype(int)[..., None] % 2
    return np.where(is_high, np.ones(count), -np.ones(count))


def constant_gait(gait: GaitParameters, env: Any, starts_in_it: bool = False) -> Scripted:
    """Make a policy that goes to a gait and keeps it.

    Args:
        gait: gait parameters.
        env: environment of one leg.
        starts_in_it: True if episodes start in this gait.

    Raises:
        ParameterError: the gait cannot be commanded.
    """
    values = gait.to_array()
    env.unwrapped.body.check_reachable("gait", values)
    start = {"gait": gait} if starts_in_it else None
    return Scripted(towards(env, lambda observation, time: values), env.unwrapped.dt, start)


def _at_a_posture(name: str, env: Any, middle: float) -> Scripted:
    """Make the policy "drag" or "airborne", which turns the crank to an angle and stops it there.

    Args:
        name: name of the policy.
        env: environment of one leg.
        middle: swing offset of "drag" [rad].
    """
    leg: Any = env.unwrapped
    seen = [f"{function}(crank angle)" for function in ("sin", "cos")]
    if not set(seen) <= set(leg.observation_names):
        raise ParameterError(
            f"policy {name!r}: expected 'crank' among the observed groups, got"
            f" {brief(leg.settings.observation)}"
        )
    sine, cosine = map(leg.observation_names.index, seen)
    brakes = leg.body.rates[0]
    offsets = np.linspace(*LIMITS["swing_offset"], 14) if name == "airborne" else [middle]
    rests = np.array([(0.0, offset, 0.0, 0.0) for offset in offsets])
    posture, target = extreme_posture(leg_profile(leg.geometry), rests, name == "drag")

    def hold(observation: Any, time: Any) -> Any:
        """Return the gait that turns the crank to its target and, in "drag", moves the swing."""
        numbers = np.asarray(observation, float)
        # The crank turns one way only: the target is always ahead.
        ahead = (target - np.arctan2(numbers[..., sine], numbers[..., cosine])) % (2 * np.pi)
        # As fast as four fifths of the largest deceleration can stop in time.
        speed = np.minimum(np.minimum(2 * ahead, np.sqrt(1.6 * brakes * ahead)), 2 * np.pi)
        # A crank that was too fast to stop at its target turns once more.
        speed = np.where((ahead > 0.05) & (ahead < 2 * np.pi - 0.3), speed, 0.0)
        swing = 0.15 * np.sin(np.pi * np.asarray(time)) if name == "drag" else 0.0
        return np.stack(np.broadcast_arrays(speed, posture[1] + swing, *posture[2:]), -1)

    return Scripted(towards(env, hold), leg.dt)


STANDS_FOR = {"hoof_env/HorseLegMO-v0": "hoof_env/HorseLeg-v0"}
"""Ids that share the policies of another id, by their own: the leg is the same, and the sum of the first
one's rewards is the reward of the second."""
