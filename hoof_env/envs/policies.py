"""Scripted policies: gaits of a preset or a file, and the simplest things a policy can do wrong.

All have Stable-Baselines3's `predict`, so that scripted and trained policies are interchangeable.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env._version import __version__
from hoof_env.envs.reference import ACTED
from hoof_env.envs.start import extreme_posture
from hoof_env.errors import DataFileError, ParameterError, check_choice
from hoof_env.gait import LIMITS, paper_gaits
from hoof_env.leg.profile import leg_profile

Action = NDArray[np.float32]


class Scripted:
    """A policy as a function of (observation, time since the episode began [s]), for one environment or many.

    Args:
        act: gives the action, shape (4,), for an observation of shape (k,) and a time. To serve many
            environments it must also take shapes (n, k) and (n,) and give (n, 4), or (4,) for all.
        dt: control step [s].
    """

    def __init__(self, act: Any, dt: float) -> None:
        self._act, self._dt = act, dt
        self.reset()

    def reset(self) -> None:
        """Start an episode, in all environments."""
        self._steps = np.zeros((), int)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Action, None]:
        """Action for an observation, or actions for many, shape (n, 4).

        `episode_start` (bool, or an array with one entry for each environment) restarts clocks, and so does
        another number of environments.
        """
        rows = np.shape(observation)[:-1]
        if self._steps.shape != rows:
            self._steps = np.zeros(rows, int)
        if episode_start is not None:
            again = np.broadcast_to(episode_start, rows) if rows else bool(np.all(episode_start))
            self._steps = np.where(again, 0, self._steps)
        action = np.asarray(self._act(observation, self._steps * self._dt), dtype=np.float32)
        self._steps = self._steps + 1
        return np.broadcast_to(action, (*rows, action.shape[-1])).copy(), None


POLICIES = ("idle", "random", "bang-bang", "drag", "airborne")
"""Names of the policies that are not a gait of the preset."""


HORSE_POLICIES = ("reference", "idle", "random", "bang-bang")
"""Those of a horse."""


def policy_names(env: Any) -> list[str]:
    """Names accepted by `make_policy` for an environment: the gaits of its preset and `POLICIES`, or
    `HORSE_POLICIES`."""
    if env.unwrapped.batch.body.legs > 1:
        return list(HORSE_POLICIES)
    return sorted(env.unwrapped.gaits) + list(POLICIES)


def make_policy(name: str, env: Any, seed: int = 0) -> Scripted:
    """A scripted policy for an environment.

    A gait name commands that gait. "idle" stops the crank and holds the swing; "random" draws a new action
    every step; "bang-bang" flips all four actions between their limits every quarter of a second; "drag"
    turns the hoof to the ground, stops there and rubs it to and fro with the swing; "airborne" turns it to
    its highest place and stops there. Where actions are offsets to a gait (`gait=`) and do not reach
    everything, a gait is the nearest one, the highest place the highest in reach, and a swing stops at its
    limits. Of a horse "reference" is the zero action, the gait around which actions lie, and "idle" stops all
    cranks.

    Raises:
        ParameterError: unknown name, a policy that stops the crank where no action stops it, or one that must
            see the crank angle where it is not observed.
    """
    leg: Any = getattr(env, "unwrapped", None)
    if not hasattr(leg, "gaits"):
        raise ParameterError(
            f"env: expected an environment of this package, make_policy(name, env), got {env!r}"
        )
    check_choice("policy", name, policy_names(env))
    count = len(leg.batch.body.action_names)
    if leg.batch.body.legs > 1 and name in ("reference", "idle"):
        still = np.zeros(count, np.float32)
        still[::ACTED] = -1.0 if name == "idle" else 0.0
        return Scripted(lambda observation, time: still, leg.dt)
    if name in leg.gaits:
        action = leg.action_for(leg.gaits[name])
        return Scripted(lambda observation, time: action, leg.dt)
    if name == "random":
        generator = np.random.default_rng(seed)
        return Scripted(lambda observation, time: generator.uniform(-1, 1, (*np.shape(time), count)), leg.dt)
    if name == "bang-bang":
        high = lambda time: np.asarray(time / 0.25).astype(int)[..., None] % 2  # noqa: E731
        return Scripted(
            lambda observation, time: np.where(high(time), np.ones(count), -np.ones(count)), leg.dt
        )
    offsets = [gait.swing_offset for gait in paper_gaits(leg.gaits).values()]
    middle = sum(offsets) / len(offsets)
    offsets = np.linspace(*LIMITS["swing_offset"], 14).tolist() if name == "airborne" else [middle]
    rests = _in_reach(leg, np.array([(0.0, offset, 0.0, 0.0) for offset in offsets]))
    if rests[0, 0] > 0.0:
        raise ParameterError(
            f"policy {name!r}: expected an environment whose actions can stop the crank; with "
            f"gait={leg.settings.gait!r} it turns at {rests[0, 0]:.3g} rad/s at least"
        )
    if name == "idle":
        rest = leg.action_for(rests[0])
        return Scripted(lambda observation, time: rest, leg.dt)
    seen = [f"{function}(crank angle)" for function in ("sin", "cos")]
    if not set(seen) <= set(leg.observation_names):
        raise ParameterError(
            f"policy {name!r}: expected 'crank' among the observed groups, got {leg.settings.observation!r}"
        )
    sine, cosine = map(leg.observation_names.index, seen)
    posture, target = extreme_posture(leg_profile(leg.geometry), rests, name == "drag")

    def hold(observation: Any, time: Any) -> Action:
        """Turn the crank (it turns one way only) to `target` and stop; "drag" then swings to and fro."""
        here = np.asarray(observation, float)
        ahead = (target - np.arctan2(here[..., sine], here[..., cosine])) % (2 * np.pi)
        speed = np.where((ahead > 0.05) & (ahead < np.pi * 1.5), np.minimum(2 * ahead, 2 * np.pi), 0.0)
        swing = 0.15 * np.sin(np.pi * np.asarray(time)) if name == "drag" else 0.0
        return leg.action_for(np.stack(np.broadcast_arrays(speed, posture[1] + swing, *posture[2:]), -1))

    return Scripted(hold, leg.dt)


def _in_reach(leg: Any, gaits: NDArray[np.float64]) -> NDArray[np.float64]:
    """The nearest gaits that actions command, shape (n, 4)."""
    reached = leg.command_of(leg.action_for(gaits))
    return np.where(np.abs(reached - gaits) < 1e-6, gaits, reached)  # an action is rounded to float32


def open_loop(parameters: Mapping[str, Any], dt: float) -> Scripted:
    """A policy that sees nothing: constant actions, or with a first harmonic of a clock,

        a(t) = constant + sin * sin(2 pi f t) + cos * cos(2 pi f t),   t the time since the episode began.

    Args:
        parameters: "constant", shape (4,), or (n, 4) for n environments; and, if there is a clock, "sin" and
            "cos" of the same shape and "frequency_hz", a number or shape (n,). The environment clips the sum.
        dt: control step [s].
    """
    constant = np.asarray(parameters["constant"], float)
    if "frequency_hz" not in parameters:
        return Scripted(lambda observation, time: constant, dt)
    sine, cosine = (np.asarray(parameters[name], float) for name in ("sin", "cos"))
    rate = 2 * np.pi * np.asarray(parameters["frequency_hz"], float)

    def act(observation: Any, time: Any) -> Any:
        phase = np.asarray(rate * time)[..., None]
        return constant + sine * np.sin(phase) + cosine * np.cos(phase)

    return Scripted(act, dt)


STANDS_FOR = {"hoof_env/HorseLegMO-v0": "hoof_env/HorseLeg-v0"}
"""A policy of the second id is one of the first: the same leg, and the sum of its rewards is the other's."""


def open_loop_record(path: Path) -> dict[str, Any]:
    """What the file of an open-loop gait holds, which `agents.open_loop` writes: "parameters" of one
    environment as `open_loop` takes them, "dt", control step [s], and "gait", the four parameters that the
    constant commands."""
    try:
        record: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        given, _, _ = (
            record["parameters"],
            float(record["dt"]),
            np.array(list(record["gait"].values()), float),
        )
        shapes = {"constant": (4,), "sin": (4,), "cos": (4,), "frequency_hz": ()}
        clocked = "frequency_hz" in given
        if set(given) != (set(shapes) if clocked else {"constant"}):
            raise ValueError(f"parameters {sorted(given)}")
        for name, value in given.items():
            if np.shape(value) != shapes[name] or not np.isfinite(np.asarray(value, float)).all():
                raise ValueError(f"{name} {value!r}")
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise DataFileError(
            f"open-loop gait {path}: expected the JSON object of agents.open_loop with parameters, dt and "
            f"gait: {error!r}"
        ) from None
    return record


GAITS = Path(__file__).parents[1] / "data" / "gaits"
"""Open-loop gaits that come with the package, as `agents.open_loop` found them."""


def load_open_loop(path_or_env_id: str | Path, env: Any = None) -> Scripted:
    """The policy of a gait file; or, for the id of an environment, of the best gait that is stored. Its clock
    has the control step of `env`, or that of the file. Warns if it was found for another id, with other
    settings, or by another version.

    `DataFileError` if there is none, it cannot be read, or actions of `env` command other gaits.
    """
    path = Path(path_or_env_id)
    if path.suffix != ".json":
        name = STANDS_FOR.get(str(path_or_env_id), str(path_or_env_id)).rpartition("/")[2]
        both = (GAITS / f"{name}-{family}.json" for family in ("constant", "clocked"))
        files = [file for file in both if file.is_file()]
        if not files:
            known = ", ".join(sorted(file.name for file in GAITS.glob("*.json"))) or "none"
            raise DataFileError(f"open-loop gait of {name}: expected one of those in {GAITS.name}/: {known}")
        path = max(files, key=lambda file: open_loop_record(file)["score"]["mean"]["return"])
    record = open_loop_record(path)
    given, dt = record["parameters"], float(record["dt"])
    if env is not None:
        leg, dt = env.unwrapped, getattr(env.unwrapped, "dt", dt)
        meant = getattr(leg, "command_of", lambda action: np.full(4, np.nan))(np.array(given["constant"]))
        if not np.allclose(meant, list(record["gait"].values()), atol=1e-6):
            raise DataFileError(
                f"open-loop gait {path}: expected an environment whose actions command gaits as those of "
                f"{record.get('env_id')} do, got {type(leg).__name__}, where this one is {meant.tolist()}"
            )
        here = leg.spec and leg.spec.id
        unlike = []
        if here and (there := record.get("env_id") or here) not in (here, STANDS_FOR.get(here)):
            unlike.append(f"{there}, here {here}")
        if (made_with := record.get("versions", {}).get("hoof-env", __version__)) != __version__:
            unlike.append(f"hoof-env {made_with}, here {__version__}")
        settings = getattr(leg, "settings", None)
        for key, there in record.get("env_kwargs", {}).items():
            if (now := json.loads(json.dumps(getattr(settings, key, None), default=str))) != there:
                unlike.append(f"{key}={there!r}, here {now!r}")
        if unlike:
            warnings.warn(f"open-loop gait {path}: found for {'; '.join(unlike)}", stacklevel=2)
    return open_loop(given, dt)
