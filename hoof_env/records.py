"""Episodes of any policy on any environment of the package, substep by substep: for files and for pictures.

`setting` and `substeps` are all that is read from behind an environment; the rest is written against them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import hoof_env
from hoof_env._output import check_folder
from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.envs.policies import Scripted, load_open_loop, make_policy, policy_names, read_open_loop
from hoof_env.errors import OutputError, ParameterError, check_number
from hoof_env.gait.gait import PARAMETERS, GaitParameters
from hoof_env.ground.terrain import Terrain
from hoof_env.render.instant import UNITS, Columns, Setting, columns_of_engine
from hoof_env.saved_policy import find_saved

RECORD = {name: unit for name, unit in UNITS.items() if name not in PARAMETERS[1:]} | {"free_moment": "N m"}
"""Columns of a record and their units: fields of `Instant` but for the swing's parameters, which are known at
the end of a control step only. The free moment about the centre of pressure is 0."""


def setting(env: Any) -> Setting:
    """The setting of an environment of this package, wrapped or not.

    Raises:
        ParameterError: not an environment of this package.
    """
    leg = env.unwrapped
    try:
        return Setting(
            leg.geometry,
            getattr(leg, "terrain", None) or Terrain.flat(),
            leg.weight,
            leg.engine.trunk.kind,
            LIFT_OFF * leg.weight,
            leg.dt,
            leg.sim_dt,
        )
    except AttributeError:
        raise ParameterError(
            f"environment: expected one leg of this package behind it, got {type(leg).__name__}"
        ) from None


def substeps(env: Any, command: NDArray[np.float64] | None = None) -> Columns:
    """What happened in the last control step of an environment of this package, one row a substep, or the
    start after a reset; `command`, shape (4,), is what was commanded, if known."""
    leg = env.unwrapped
    return columns_of_engine(leg.record(), leg.terrain, command=command)


def make_env(env_id: str, arguments: Mapping[str, Any] | None = None) -> gym.Env[Any, Any]:
    """`gymnasium.make`, refusals in our words.

    Raises:
        ParameterError: unknown id, an argument that the environment does not take, or an environment of
            another package.
    """
    arguments = dict(arguments or {})
    if "render_mode" in arguments:
        raise ParameterError("render_mode: expected none here, where the environment need not draw itself")
    try:
        env = gym.make(env_id, **arguments)
    except ParameterError:
        raise
    except (gym.error.Error, ModuleNotFoundError, TypeError) as error:
        raise ParameterError(f"environment {env_id!r} with {arguments or 'no arguments'}: {error}") from None
    setting(env)
    return env


def find_policy(name: str, env: gym.Env[Any, Any], env_id: str, seed: int = 0) -> Any:
    """A policy by its name: a gait or another scripted one, four gait parameters, or the path of one.

    Args:
        name: as "run", as "6.28,0.7,-0.2,-0.3" (crank speed [rad/s], swing offset, sine and cosine
            coefficient [rad]), or the .zip or run folder of a model. A model is a pickle: it can run code.
            A policy's .onnx file, the folder of one that is shipped, or a gait's .json are data. "open-loop"
            is the best gait that comes with this package for the id.
        env, env_id: what it is for.
        seed: of "random".

    Raises:
        ParameterError: unknown name, or gait parameters out of range.
        DataFileError: a model that cannot be read or does not fit.
        MissingExtraError, HoofEnvError: the library that plays it is missing.
    """
    names = policy_names(env)
    if name in names:
        return make_policy(name, env, seed)
    if name.endswith(".json"):
        return read_open_loop(Path(name), env)
    if name == "open-loop":
        return load_open_loop(env_id, env)
    if name.endswith((".zip", ".onnx")) or Path(name).is_dir():
        return find_saved(Path(name)).load(env, env_id)
    if len(numbers := name.split(",")) == len(PARAMETERS):
        try:
            gait = GaitParameters(*(float(number) for number in numbers))
        except ParameterError:
            raise
        except ValueError:
            pass
        else:
            action = env.unwrapped.action_for(gait)  # type: ignore[attr-defined]
            return Scripted(lambda observation, time: action, setting(env).dt)
    raise ParameterError(
        f"policy: expected a name ({', '.join(names)}, open-loop), four gait parameters as "
        f"6.28,0.7,-0.2,-0.3, or the path of a trained model or a gait's .json, got {name!r}"
    )


def episode(
    env: gym.Env[Any, Any],
    policy: Any,
    seed: int = 0,
    seconds: float | None = None,
    options: Mapping[str, Any] | None = None,
) -> Iterator[Columns]:
    """Play an episode; yields the columns of its start (one row) and of every control step.

    Args:
        env: an environment of this package, wrapped or not.
        policy: anything with Stable-Baselines3's `predict`.
        seed, options: of `reset`.
        seconds: when to stop; None for its own end.

    Raises:
        ParameterError: as `reset` and `step` do, or `seconds` is not positive.
    """
    if seconds is not None:
        check_number("seconds", seconds, low=0, exclusive_low=True)
    leg: Any = env.unwrapped
    observation, info = env.reset(seed=seed, options=dict(options or {}))
    gait = info.get("gait")
    here = substeps(env, np.array([gait[name] for name in PARAMETERS]) if gait else None)
    yield here
    start, ended = np.ones(1, bool), False
    while not ended and (seconds is None or here["time"][-1] < seconds - 1e-9):
        action, _ = policy.predict(observation, episode_start=start, deterministic=True)
        observation, _, failed, truncated, _ = env.step(action)
        start, ended = np.zeros(1, bool), failed or truncated
        before = here["time"][-1]
        here = substeps(env, leg.command_of(np.asarray(action, np.float32)))
        if here["time"][-1] > before:  # else the simulation failed and nothing happened
            yield here


def record_episode(
    env: gym.Env[Any, Any],
    policy: Any,
    seed: int = 0,
    seconds: float | None = None,
    options: Mapping[str, Any] | None = None,
) -> Columns:
    """The record of an episode at every substep: arrays of shape (n,), names and units as in `RECORD`.

    Arguments and errors are those of `episode`.
    """
    parts = list(episode(env, policy, seed, seconds, options))
    record = {name: np.concatenate([part[name] for part in parts]) for name in RECORD if name in parts[0]}
    return record | {"free_moment": np.zeros(len(record["time"]))}


def describe(env: gym.Env[Any, Any], **about: Any) -> dict[str, Any]:
    """What a file says about its record, JSON-serialisable: version, units, leg, ground and `about`."""
    here = setting(env)
    ground = asdict(env.unwrapped.engine.ground).items()  # type: ignore[attr-defined]
    return {
        "hoof_env": hoof_env.__version__,
        **about,
        "sim_dt_s": here.sim_dt,
        "weight_n": here.weight_n,
        "axes": "x forward, y up, z to the right; angles counter-clockwise",
        "units": RECORD,
        "geometry": here.geometry.to_dict(),
        "ground": {name: value.item() if isinstance(value, np.generic) else value for name, value in ground},
        "terrain": here.terrain.to_dict(),
    }


def check_place(path: Path, suffixes: Iterable[str]) -> None:
    """Raise unless a file can be written at `path` and its suffix is one of `suffixes`.

    Raises:
        ParameterError: another suffix. OutputError: a folder is in its place, or its folder is not writable.
    """
    known = sorted(suffixes)
    if path.suffix.lower() not in known:
        raise ParameterError(f"out: expected a file that ends in {', '.join(known)}, got {str(path)!r}")
    if path.is_dir():
        raise OutputError(f"cannot write to {str(path)!r}: expected a file, got a folder")
    check_folder(path.parent)
