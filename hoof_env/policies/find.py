"""Policies by their names: scripted, shipped, saved in a file, or a Python function."""

from __future__ import annotations

import os
import sys
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from hoof_env._input import as_path
from hoof_env.envs.base import array_of
from hoof_env.envs.open_loop import gait_file, load_open_loop, open_loop_record
from hoof_env.envs.policies import constant_gait, make_policy, policy_names
from hoof_env.errors import DataFileError, MissingExtraError, ParameterError, brief, count
from hoof_env.gait import PARAMETERS, GaitParameters
from hoof_env.policies.catalogue import SHIPPED
from hoof_env.policies.normalisation import MISSING, has_missing_statistics
from hoof_env.policies.onnx_file import FILE, OnnxPolicy
from hoof_env.policies.plain import ABOUT, NumpyPolicy
from hoof_env.policies.record import describe_spaces, own_id, refuse_misfit, same_id
from hoof_env.policies.saved import CHECKPOINTS, SavedModel, TrainedPolicy

MODEL = "model.zip"


def shipped_ids() -> list[str]:
    """Return the ids for which a trained policy ships."""
    return sorted(f"hoof_env/{path.parent.name}" for path in SHIPPED.glob(f"*/{ABOUT}"))


def shipped_policy(env_id: str) -> NumpyPolicy:
    """Return the trained policy that ships for an id; raise `DataFileError` if there is none."""
    if own_id(env_id) not in shipped_ids():
        known = ", ".join(shipped_ids())
        raise DataFileError(
            f"policy: none ships for {env_id}; expected one of {known}, which load_policy(id) plays elsewhere"
        )
    return NumpyPolicy(SHIPPED / own_id(env_id).rpartition("/")[2])


def find_saved(path: Path | str) -> OnnxPolicy | SavedModel:
    """Return the policy in a file or a folder: the .onnx if there is one, else the model of agents.train.

    Raises:
        DataFileError: there is no policy, or its file or record cannot be read.
        HoofEnvError: the .onnx needs onnxruntime, which is not installed.
    """
    path = as_path("path", path)
    is_onnx = path.suffix.lower() == ".onnx" or os.path.isfile(path / FILE)
    return OnnxPolicy(path) if is_onnx else SavedModel.find(path)


def is_model(name: str) -> bool:
    """Return True if a policy's name is the path of a model, or the id of one that ships."""
    if not name:
        return False
    is_path = (
        name.lower().endswith((".zip", ".onnx"))
        or Path(name).name != name
        or any(os.path.exists(Path(name) / part) for part in (MODEL, ABOUT, FILE, CHECKPOINTS))
    )
    return (is_path and not name.endswith(".json")) or name == "shipped"


def read_policy_record(name: str) -> dict[str, Any]:
    """Return the record in a policy's file, env_id and env_kwargs among it; empty for other policies, and for
    "shipped", which is another one for each id. `DataFileError`: no such model or gait."""
    if name.endswith(".json"):
        return open_loop_record(Path(name))
    if name in shipped_ids():
        return shipped_policy(name).record
    return find_saved(Path(name)).record if is_model(name) and name != "shipped" else {}


# -- functions as policies ---------------------------------------------------------------------


@dataclass(frozen=True)
class Function:
    """Policy from a Python function of observations, shape (n, k), that returns actions, a row each.

    Attributes:
        name: its name, for messages.
        act: the function.
        actions: number of actions.
    """

    name: str
    act: Callable[[Any], Any]
    actions: int

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Return actions for observations, shape (n, k) or (k,); `ParameterError` if the function does not
        fit."""
        # A copy, which the function may change
        rows = np.array(observation, ndmin=2)
        try:
            returned = self.act(rows)
        # The function is the user's, and may fail in any way.
        except Exception as error:
            raise ParameterError(
                f"policy {self.name}: expected a function of observations, shape {rows.shape}, that returns"
                f" actions; {_place(error)}"
            ) from error
        wanted = f"policy {self.name}: expected finite actions of shape {(len(rows), self.actions)}"
        try:
            actions = array_of("actions", returned).astype(np.float32)
        except (ParameterError, TypeError, ValueError) as error:
            # Only of a tensor does the reason say more than what was returned.
            reason = f" ({error})" if hasattr(returned, "dtype") else ""
            raise ParameterError(f"{wanted}, got {brief(returned)}{reason}") from None
        if actions.shape != (len(rows), self.actions) or not np.isfinite(actions).all():
            raise ParameterError(
                f"{wanted} for observations of shape {rows.shape}, got shape {actions.shape} and"
                f" {np.sum(~np.isfinite(actions))} that are not finite"
            )
        return actions.reshape(*np.shape(observation)[:-1], self.actions), state


def _place(error: Exception) -> str:
    """Return an error of a user's code in words, with the line that raised it."""
    line = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__} in {Path(line.filename).name}, line {line.lineno}: {error}"


def is_function(name: str) -> bool:
    """Return True if a policy's name has the form MODULE:NAME."""
    module, _, function = name.partition(":")
    return function.isidentifier() and all(part.isidentifier() for part in module.split("."))


def find_function(name: str, env: gym.Env[Any, Any]) -> Any:
    """Return the policy MODULE:NAME, a function or an object with `predict`, of this folder or installed;
    `ParameterError` if there is none."""
    module, _, function = name.partition(":")
    # MODULE may lie in the working folder, which not every interpreter searches.
    if "" not in sys.path:
        sys.path.insert(0, "")
    try:
        act = getattr(import_module(module), function)
    except (ImportError, AttributeError, SyntaxError) as error:
        raise ParameterError(f"policy: expected MODULE:NAME, got {brief(name)}: {error}") from error
    # The module is the user's, and may fail in any way.
    except Exception as error:
        raise ParameterError(f"policy: expected MODULE:NAME, got {brief(name)}; {_place(error)}") from error
    if not isinstance(act, type) and hasattr(act, "predict"):
        return policy_of(act, env)
    if not callable(act) or isinstance(act, type):
        raise ParameterError(
            f"policy {name}: expected a function of observations, or an object with predict, got {brief(act)}"
        )
    return Function(name, act, gym.spaces.flatdim(env.action_space))


def policy_of(policy: Any, env: gym.Env[Any, Any] | None) -> Any:
    """Return a policy that is an object with `predict`: a model of Stable-Baselines3 with the normalisation
    of its environment, and any other policy as it is. A warning says if a model lacks the normalisation of
    its training.

    Raises:
        DataFileError: a model of other spaces.
    """
    if not hasattr(policy, "get_vec_normalize_env"):
        return policy
    if env is not None:
        refuse_misfit(Path(type(policy).__name__), describe_spaces(policy), describe_spaces(env))
    statistics = policy.get_vec_normalize_env()
    if has_missing_statistics(policy):
        name = type(policy).__name__
        warnings.warn(
            f"policy {name}: {MISSING}; {name}.load(path, env=VecNormalize.load(statistics, many)) has them",
            stacklevel=4,
        )
    is_normalised = statistics is not None and statistics.norm_obs
    return TrainedPolicy(policy, statistics.normalize_obs if is_normalised else None)


# -- all policies ------------------------------------------------------------------------------


def stored_names(env_id: str) -> list[str]:
    """Return the names of the policies that the package has for an id in files: the best gait, the best gait
    that is held, and the trained policy."""
    own = own_id(env_id)
    found = []
    for name, family in (("open-loop", None), ("constant", "constant")):
        with suppress(DataFileError):
            gait_file(own, family)
            found.append(name)
    return [*found, "shipped"] if own in shipped_ids() else found


def names_of(env: gym.Env[Any, Any], env_id: str) -> list[str]:
    """Return the names of the policies of an environment of this package, which has an id."""
    return [*policy_names(env), *stored_names(env_id)]


def default_policy(env: gym.Env[Any, Any]) -> str:
    """Return the name of the policy to play if none is named: zero actions where the task starts in a gait of
    its own, else the horse's reference, the run, or the first gait of a preset without one."""
    if "gait" in env.unwrapped.batch.usual_start:  # type: ignore[attr-defined]
        return "zero"
    names = policy_names(env)
    return next((name for name in ("reference", "run") if name in names), names[0])


def find_policy(name: str | None, env: gym.Env[Any, Any], env_id: str, seed: int = 0) -> Any:
    """Return a policy for an environment, as `load_policy` does; None is `default_policy`'s.

    Args:
        name: the policy, a text.
        env: the environment, of another package only for files and functions.
        env_id: its id.
        seed: seed of the policy "random".

    Raises:
        ParameterError: unknown name.
        DataFileError: no such file, or one that cannot be read or does not fit.
    """
    is_ours = hasattr(env.unwrapped, "gaits")
    names = policy_names(env) if is_ours else []
    if name is None and is_ours:
        name = default_policy(env)
    if name in names:
        return make_policy(str(name), env, seed)
    text = str(name)
    if is_function(text):
        return find_function(text, env)
    if text == "shipped" or text in shipped_ids():
        return shipped_policy(env_id if text == "shipped" else text).load(env, env_id)
    if is_model(text) or (text and os.path.isdir(text)):
        return _load_saved(find_saved(Path(text)), env, env_id)
    if not is_ours:
        raise ParameterError(
            f"policy: expected the path of a trained model, for none is scripted for {env_id}, got"
            f" {brief(name)}"
        )
    if text.endswith(".json"):
        return load_open_loop(text, env)
    if text in ("open-loop", "constant"):
        return load_open_loop(env_id, env, None if text == "open-loop" else text)
    try:
        numbers = [float(number) for number in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) == len(PARAMETERS):
        return constant_gait(GaitParameters(*numbers), env, starts_in_it=True)
    raise ParameterError(
        f"policy: expected a name ({', '.join(names_of(env, env_id))}), four gait parameters as "
        f"6.28,0.7,-0.2,-0.3, module:function, or the path of a trained model or a gait's .json, got"
        f" {brief(name)}"
    )


def _load_saved(saved: OnnxPolicy | SavedModel, env: gym.Env[Any, Any], env_id: str) -> Any:
    """Return the policy of a file for an environment; NumPy plays plain data where Stable-Baselines3 is not
    installed."""
    try:
        return saved.load(env, env_id)
    except MissingExtraError:
        if not (isinstance(saved, SavedModel) and saved.is_plain):
            raise
        return NumpyPolicy(saved.path.parent).load(env, env_id)


def load_policy(policy: Any, env: gym.Env[Any, Any] | None = None, seed: int = 0) -> Any:
    """Return a policy that plays an environment: one that ships, one from a file, a scripted one, or yours.

    The result has Stable-Baselines3's `predict(observation, state, episode_start, deterministic)`, which
    returns actions and state for one observation, shape (k,), or for many, (n, k). Policies with a clock need
    `episode_start`, True in the first step of an episode; a policy whose episodes start in its gait has their
    reset options in `start`.

    >>> import gymnasium as gym, hoof_env
    >>> env = gym.make("hoof_env/HorseLeg-v0")
    >>> policy = hoof_env.load_policy("shipped", env)
    >>> action, _ = policy.predict(env.reset(seed=0)[0], episode_start=True)

    Args:
        policy: one of these:

            - "shipped", the trained policy that ships for the environment, or the id of one that ships; NumPy
              plays it;
            - the path of an .onnx file of `agents.export` or `stamp_onnx` (extra "onnx"), or of a .zip of
              Stable-Baselines3 or a run folder (extra "train"); a .zip can run code: load what you trust;
            - a scripted policy by its name, see `make_policy`, "open-loop", the best stored gait of an id
              that sees nothing, or "constant", the best that is held;
            - the path of an open-loop gait, a .json;
            - a gait of one leg, in which episodes start: `GaitParameters`, or crank speed [rad/s], swing
              offset, sine and cosine coefficient [rad] as four numbers or as a text "6.28,0.7,-0.2,-0.3";
            - "module:name", or what it names: a function of observations, shape (n, k), that returns actions,
              or an object with `predict`, such as a model of Stable-Baselines3, which plays with the
              normalisation of its environment.
        env: the environment that it is to play. It may be left out for an id that ships, an .onnx file and an
            object, which are then not compared with any environment.
        seed: seed of the policy "random".

    Raises:
        DataFileError: no such file; or the policy is for another id, other spaces, other observations,
            other scales of them, or another form of actions. With other settings, dt among them, or of
            another version of hoof-env, it warns.
        ParameterError: no such name, or an environment is needed.
        MissingExtraError: an extra is missing that the file needs.
    """
    is_object = hasattr(policy, "predict") and not isinstance(policy, type)
    if env is None:
        return policy_of(policy, env) if is_object else _load_alone(policy)
    if not isinstance(env, gym.Env):
        raise ParameterError(
            "env: expected a single environment, as gymnasium.make returns it, for its policy plays many"
            f" observations, too: load_policy(policy, env); got {brief(env)}"
        )
    count("seed", seed, low=0)
    spec = env.spec
    # Before functions: a network is callable, and would return more than actions.
    if is_object:
        return policy_of(policy, env)
    if callable(policy) and not isinstance(policy, type):
        actions = gym.spaces.flatdim(env.action_space)
        return Function(getattr(policy, "__name__", repr(policy)), policy, actions)
    if isinstance(policy, GaitParameters):
        return constant_gait(policy, env, starts_in_it=True)
    if isinstance(policy, (tuple, list, np.ndarray)):
        values = policy.tolist() if isinstance(policy, np.ndarray) else list(policy)
        if not isinstance(values, list) or len(values) != len(PARAMETERS):
            raise ParameterError(f"policy: expected four gait parameters, got {brief(policy)}")
        return constant_gait(GaitParameters(*values), env, starts_in_it=True)
    if not isinstance(policy, (str, Path)):
        raise ParameterError(f"policy: expected a name, a path, a gait or a function, got {brief(policy)}")
    name = str(policy)
    # An environment that gymnasium.make has not made has no id: the file's id stands for it.
    env_id = spec.id if spec else read_policy_record(name).get("env_id", type(env.unwrapped).__name__)
    return find_policy(name, env, env_id, seed)


def _load_alone(policy: Any) -> Any:
    """Return a policy that needs no environment, see `load_policy`."""
    if isinstance(policy, (str, Path)):
        text = str(policy)
        for env_id in shipped_ids():
            if same_id(text, env_id):
                return shipped_policy(env_id)
        if Path(text).suffix.lower() == ".onnx" or os.path.isfile(Path(text) / FILE):
            return OnnxPolicy(Path(text))
    raise ParameterError(
        f"policy {brief(policy)}: expected the environment, too, load_policy(policy, env); without it, an"
        f" .onnx file or one of {', '.join(shipped_ids())}"
    )
