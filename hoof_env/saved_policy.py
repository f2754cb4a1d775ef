"""Trained policies in files: what `agents.train`, `agents.export` and `agents.ship` leave, found and read.

    policy.onnx         the policy alone, played by onnxruntime (extra "onnx"); its metadata say for what
    policy.safetensors  the weights, played by Stable-Baselines3 (extra "train")
    policy.json         algorithm, kind of policy, its arguments, both spaces, statistics of the observations
    model.zip           what learns, too: optimiser, value of the exploration and counters
    run.json            what the training was: env_id, settings, spaces, versions

Reading the first three, plain data, runs nothing that a file says (it may ask for a large network, and so for
memory). A .zip or .pkl is a pickle and can run any code: load only files that you trust.
"""

from __future__ import annotations

import json
import math
import warnings
from dataclasses import asdict, dataclass, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from hoof_env._version import __version__
from hoof_env.errors import (
    DataFileError,
    HoofEnvError,
    MissingExtraError,
    ParameterError,
    check_choice,
    parse_json,
)

FILE = "policy.onnx"
WEIGHTS = "policy.safetensors"
ABOUT = "policy.json"
STATISTICS = "vecnormalize.pkl"
CHECKPOINTS = "checkpoints"
FORMAT = 1  # of policy.json

INPUT = "observation"
OUTPUT = "action"
"""Names of the graph's input, shape (batch, k), and output, shape (batch, n), float32 both."""

OBJECTS = ("env_kwargs", "settings")
LISTS = (*OBJECTS, "observation_names", "action_names")
"""Metadata of an .onnx that is JSON; all other is text."""

RECORD = {
    "env_kwargs": dict, "settings": dict, "args": dict, "versions": dict, "finished": dict, "resumed": list,
}  # fmt: skip
"""What run.json may hold besides env_id and algo, where its kind matters."""

ALGORITHMS = {
    "ppo": "stable_baselines3", "sac": "stable_baselines3", "td3": "stable_baselines3", "tqc": "sb3_contrib",
}  # fmt: skip
"""Where each algorithm lives; each has its file in agents/hyperparams."""


def algorithm_class(name: str) -> Any:
    """The class of an algorithm of `ALGORITHMS`; `ParameterError` if its library is not installed."""
    module = ALGORITHMS[check_choice("algo", name, ALGORITHMS)]
    try:
        return getattr(import_module(module), name.upper())
    except ModuleNotFoundError as error:
        raise ParameterError(
            f"algo {name}: expected {module} to be installed (pip install 'hoof-env[train]'): {error}"
        ) from None


# -- what a policy is for ----------------------------------------------------------------------


def describe_spaces(env: Any) -> dict[str, Any]:
    """Both spaces of an environment or a model as text, to be kept beside a policy and compared."""
    return {"observation_space": str(env.observation_space), "action_space": str(env.action_space)}


def describe(env: Any) -> dict[str, Any]:
    """What an environment says of what it takes and gives: spaces, and names where it has them."""
    keys = ("observation_names", "action_names")
    told = {key: list(names) for key in keys if (names := getattr(env.unwrapped, key, None))}
    return describe_spaces(env) | told | describe_actions(env)


def describe_actions(env: Any) -> dict[str, str]:
    """What the actions of an environment of this package are, to be kept beside a policy; empty for another
    package's."""
    form = getattr(env.unwrapped, "action_form", None)
    return {"actions": form} if form else {}


def describe_env(env: gym.Env[Any, Any]) -> dict[str, Any]:
    """What run.json says of an environment: spaces and all settings."""
    settings = settings_of(env)
    return describe_spaces(env) | describe_actions(env) | ({"settings": settings} if settings else {})


def settings_of(env: Any) -> dict[str, Any]:
    """All settings of an environment of this package, as JSON gives them back; empty for another
    package's."""
    settings = getattr(env.unwrapped, "settings", None)
    if not is_dataclass(settings) or isinstance(settings, type):
        return {}
    plain: dict[str, Any] = json.loads(json.dumps(asdict(settings), default=str))
    return plain


def environment_of(
    path: Path | str, record: dict[str, Any], env_id: str | None = None
) -> tuple[str | None, dict[str, Any]]:
    """The environment that a file asks for, or the one named `env_id` by its user, and the arguments of it
    that the file has; None, and no arguments, where nobody names one.

    Nothing is imported because a file says so: its id is looked up among the registered ones, without the
    module in front of it. `DataFileError` where it is not registered, or an argument asks for a module.
    """
    there = record.get("env_id")
    if there is None or (env_id is not None and not same_id(env_id, there)):
        return env_id, {}
    kwargs: dict[str, Any] = record.get("env_kwargs", {})
    if not isinstance(kwargs, dict):
        raise DataFileError(f"{path}: env_kwargs: expected arguments by name, got {kwargs!r}")
    asks = {"env_id": there} if env_id is None else {}
    asks |= {"task": kwargs["task"]} if ":" in str(kwargs.get("task", "")) else {}
    for name, given in asks.items():
        if own_id(given) not in gym.registry:
            option = f"--env-id {given}" if name == "env_id" else "--env-id, with the task as its argument"
            raise DataFileError(
                f"{path}: expected the id of an environment that is registered here, got {name} {given!r}; a "
                f"file must not import a module. If you trust it, name it yourself: {option}"
            )
    if "task" in asks:
        kwargs = kwargs | {"task": registered_task(asks["task"])}
    return (own_id(there) if env_id is None else env_id), kwargs


def own_id(env_id: Any) -> str:
    """An id without the module that `gymnasium.make` would import first, "module:id"."""
    return str(env_id).rpartition(":")[2]


def same_id(one: Any, other: Any) -> bool:
    """Whether two ids name one environment, with or without the module that registers it."""
    return own_id(one) == own_id(other)


def registered_task(task: str) -> str:
    """What `registry.task_of` takes for a task of one's own that is registered already, so that it imports
    nothing."""
    return str(gym.registry[own_id(task)].kwargs.get("task", own_id(task)))


def refuse_misfit(path: Path, there: dict[str, Any], here: dict[str, Any]) -> None:
    """`DataFileError` where a policy was trained for something else than what is `here`."""
    is_old = bool(there) and "actions" in here and "actions" not in there
    asked = {"env_id": here["env_id"]} if is_old else here  # what else is unlike follows from the form
    unlike = [
        f"{key} {there[key]}, expected {x}"
        for key, x in asked.items()
        if there.get(key, x) != x and not (key == "env_id" and same_id(there[key], x))
    ]
    if is_old:
        unlike.insert(0, f"actions of an older form (positions in a box), expected {here['actions']}")
    if unlike:
        (one, old), (other, new) = (str(of.get("env_id")).rpartition("-v")[::2] for of in (there, here))
        if one == other != "" and old != new:
            unlike.append("another version of an id is another task")
        raise DataFileError(f"policy {path}: trained for {'; '.join(unlike)}")


def check_record(path: Path, record: dict[str, Any], env: Any, env_id: str) -> None:
    """Refuse a policy whose record does not fit an environment; warn where settings, or the version of
    hoof-env, were others where it was trained."""
    refuse_misfit(path, record, {"env_id": env_id, **describe(env)})
    here = settings_of(env)
    there = record.get("settings", here | record.get("env_kwargs", {}))
    names = sorted({*here, *record.get("settings", {})}) if here else []  # another package's has none
    unlike = [
        f"{key}={there.get(key)!r}, here {here.get(key)!r}"
        for key in names
        if there.get(key) != here.get(key)
    ]
    made_with = record.get("hoof_env", record.get("versions", {}).get("hoof-env", __version__))
    if made_with != __version__:
        unlike.append(f"hoof-env {made_with}, here {__version__}")
    if unlike:
        warnings.warn(f"policy {path}: trained with {'; '.join(unlike)}", stacklevel=3)


def read_record(folder: Path) -> dict[str, Any]:
    """The content of run.json in `folder`, empty if there is none; `DataFileError` if it cannot be read."""
    path = folder / "run.json"
    if not path.is_file():
        return {}
    try:
        record: dict[str, Any] = parse_json(path.read_text(encoding="utf-8"))
        kinds = {"env_id": str, "algo": str} | {key: kind for key, kind in RECORD.items() if key in record}
        if unlike := [key for key, kind in kinds.items() if not isinstance(record[key], kind)]:
            raise TypeError(f"{unlike[0]}: {record[unlike[0]]!r}")
        if "finished" in record:
            steps = record["finished"]["steps"]
            seconds = record["finished"]["seconds"]
            record["finished"] |= {"steps": int(steps), "seconds": float(seconds)}
        return record
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise DataFileError(
            f"{path}: expected the JSON object of agents.train with env_id and algo: {error!r}"
        ) from None


def find_saved(path: Path) -> OnnxPolicy | SavedModel:
    """The policy in a file or a folder: an exported one where there is one, else a model of agents.train."""
    is_onnx = path.suffix.lower() == ".onnx" or (path / FILE).is_file()
    return OnnxPolicy(path) if is_onnx else SavedModel.find(path)


# -- policies in ONNX --------------------------------------------------------------------------


class OnnxPolicy:
    """A policy with Stable-Baselines3's `predict`, in a file of `agents.export` or a folder that holds one;
    `DataFileError` of anything else.

    Its `record`, the file's metadata, has env_id, env_kwargs, settings, both spaces, names of observations
    and actions, algo, and the version of hoof_env that trained.
    """

    def __init__(self, path: Path) -> None:
        try:
            import onnxruntime
        except ImportError:
            raise HoofEnvError(
                f'policy {path}: reading it needs onnxruntime: pip install "hoof-env[onnx]"'
            ) from None
        self.path = path / FILE if path.is_dir() else path
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1  # a small network waits for threads
        options.log_severity_level = 3
        try:
            content = self.path.read_bytes()
            self._session = onnxruntime.InferenceSession(content, options, ["CPUExecutionProvider"])
            found = self._session.get_modelmeta().custom_metadata_map
            self.record = {key: parse_json(text) if key in LISTS else text for key, text in found.items()}
            names = [node.name for node in (*self._session.get_inputs(), *self._session.get_outputs())]
            objects = all(isinstance(self.record.get(key, {}), dict) for key in OBJECTS)
            if names != [INPUT, OUTPUT] or "env_id" not in self.record or not objects:
                raise ValueError(f"tensors {names}, metadata {self.record}")
        except Exception as error:  # onnxruntime has an exception for everything, with no common base
            said = (getattr(error, "strerror", None) or str(error) or type(error).__name__).splitlines()[0]
            raise DataFileError(
                f"policy {self.path}: expected an ONNX file of agents.export, cannot read it ({said})"
            ) from None

    def load(self, env: Any, env_id: str) -> OnnxPolicy:
        """This policy, `DataFileError` if it does not fit. Warns of other settings or another hoof-env."""
        check_record(self.path, self.record, env, env_id)
        return self

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[NDArray[np.float32], Any]:
        """Actions for observations of shape (..., k), always the deterministic ones; `state` comes back."""
        rows = np.asarray(observation, np.float32)
        (actions,) = self._session.run([OUTPUT], {INPUT: rows.reshape(-1, rows.shape[-1])})
        return actions.reshape(*rows.shape[:-1], actions.shape[-1]), state


# -- policies of Stable-Baselines3 -------------------------------------------------------------


@dataclass(frozen=True)
class TrainedPolicy:
    """A trained policy that sees observations as it saw them in training, normalised or not. Of a `model`
    that was read from plain data nothing but its policy is there."""

    model: Any
    normalize: Any

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Action for an observation of the environment."""
        if self.normalize is not None:
            observation = self.normalize(observation)
        return self.model.predict(observation, state, episode_start, deterministic)


@dataclass(frozen=True)
class SavedModel:
    """A model file and what its run folder says about it; nothing has been read into it yet.

    Attributes:
        path: of model.zip or another .zip; beside a model.zip the policy as plain data is what is loaded.
        record: content of run.json, empty where there is none.
    """

    path: Path
    record: dict[str, Any]

    @classmethod
    def find(cls, path: Path) -> SavedModel:
        """The model at `path`: a .zip, or a run folder, whose last checkpoint serves until it has a model;
        `DataFileError` if there is none."""
        saved = cls(path / "model.zip" if path.is_dir() else path, {})
        if path.is_dir() and not (saved.path.is_file() or saved.is_plain):
            folders = [one for one in (path / CHECKPOINTS).glob("*") if one.name.isdigit()]
            saved = cls(max(folders, key=lambda one: int(one.name), default=path) / "model.zip", {})
        if not (saved.path.is_file() or saved.is_plain):
            raise DataFileError(
                f"model {path}: expected a .zip of agents.train or its run folder, found no {saved.path}"
            )
        for folder in saved.path.parents[:3:2]:  # a checkpoint is two deeper
            if record := read_record(folder):
                return cls(saved.path, record)
        return saved

    @property
    def is_plain(self) -> bool:
        """Whether it can be read without running code of the file."""
        beside = self.path.with_name(ABOUT), self.path.with_name(WEIGHTS)
        return self.path.name == "model.zip" and all(file.is_file() for file in beside)

    def load(self, env: gym.Env[Any, Any], env_id: str) -> TrainedPolicy:
        """The policy for `env`, from plain data where there is some; else a .zip is unpickled, which can run
        any code that it holds, and a warning says so. Warns, too, of other settings or another hoof-env.
        `DataFileError` if it does not fit, `MissingExtraError` without the library that plays it."""
        check_record(self.path, self.record, env, env_id)
        try:
            for library in ("stable_baselines3", "safetensors.torch"):
                import_module(library)
        except ModuleNotFoundError as error:
            raise MissingExtraError(
                f'policy {self.path}: reading it needs pip install "hoof-env[train]" ({error})'
            ) from None
        file = self.path.with_name(ABOUT)
        origin = "a policy written by agents.train"
        if not self.is_plain:
            warnings.warn(f"{self.path} is a pickle, which can run any code: trusted?", stacklevel=2)
            file = self.path
            origin = "a model saved by Stable-Baselines3"
        try:
            policy = read_plain(self.path.parent) if self.is_plain else self._unpickle(env)
        except Exception as error:  # what is damaged may raise anything
            reason = f"{type(error).__name__}: {error}".splitlines()[0]
            raise DataFileError(f"model {file}: expected {origin}, cannot read it ({reason})") from None
        refuse_misfit(self.path, describe_spaces(policy.model), describe_spaces(env))
        return policy

    def _unpickle(self, env: gym.Env[Any, Any]) -> TrainedPolicy:
        from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

        model = algorithm_class(self.record.get("algo", "ppo")).load(self.path, device="cpu")
        statistics = self.path.with_name(STATISTICS)
        if not statistics.is_file():
            return TrainedPolicy(model, None)
        return TrainedPolicy(
            model, VecNormalize.load(str(statistics), DummyVecEnv([lambda: env])).normalize_obs
        )


# -- the same as plain data --------------------------------------------------------------------


def save_policy(model: Any, folder: Path) -> bool:
    """Write the policy of a Stable-Baselines3 model into `folder`; False, and nothing, where its arguments
    are not plain data or its spaces are not boxes."""
    from safetensors.torch import save

    seen: Any = model.get_vec_normalize_env()
    try:
        about = {
            "format": FORMAT,
            "algo": getattr(model, "plays_as", type(model).__name__.lower()),
            "policy": next(name for name, kind in model.policy_aliases.items() if kind is model.policy_class),
            "policy_kwargs": _plain(({"use_sde": True} if model.use_sde else {}) | model.policy_kwargs),
            "observation_space": _plain_box(model.observation_space),
            "action_space": _plain_box(model.action_space),
            "normalize": {
                "mean": seen.obs_rms.mean.tolist(),
                "var": seen.obs_rms.var.tolist(),
                "epsilon": float(seen.epsilon),
                "clip": float(seen.clip_obs),
            }
            if seen is not None and seen.norm_obs
            else None,
        }
        text = json.dumps(about, indent=1, allow_nan=False) + "\n"
    except (TypeError, ValueError, AttributeError, StopIteration):
        return False
    # A part that two names share is written twice: the format has no references
    weights = {
        key: value.detach().cpu().clone().contiguous() for key, value in model.policy.state_dict().items()
    }
    (folder / WEIGHTS).write_bytes(save(weights))  # save_file lets the owner alone read it
    (folder / ABOUT).write_text(text, encoding="utf-8")
    return True


def read_plain(folder: Path) -> TrainedPolicy:
    """What `save_policy` wrote; the model holds nothing but its policy. Any exception if it is damaged."""
    from safetensors.torch import load_file

    about = parse_json((folder / ABOUT).read_text(encoding="utf-8"))
    if about["format"] != FORMAT:
        raise ValueError(f"format {about['format']!r}, expected {FORMAT}")
    model = algorithm_class(about["algo"])(about["policy"], None, device="cpu", _init_setup_model=False)
    model.observation_space = _built_box(**about["observation_space"])
    model.action_space = _built_box(**about["action_space"])
    model.policy_kwargs = _built(about["policy_kwargs"])
    model.policy = model.policy_class(
        model.observation_space, model.action_space, lambda _: 0.0, **model.policy_kwargs
    )
    weights = load_file(folder / WEIGHTS)
    if not all(bool(one.isfinite().all()) for one in weights.values()):
        raise ValueError(f"{WEIGHTS} holds numbers that are not finite")
    model.policy.load_state_dict(weights)
    model.policy.set_training_mode(False)
    shape = model.observation_space.shape
    return TrainedPolicy(model, _Normalizer(shape, **about["normalize"]) if about["normalize"] else None)


class _Normalizer:
    """Observations of a shape as `VecNormalize` shows them; its formula; `ValueError` for others."""

    def __init__(
        self, shape: tuple[int, ...], mean: list[float], var: list[float], epsilon: float, clip: float
    ) -> None:
        self.mean = np.array(mean, np.float64)
        self.var = np.array(var, np.float64)
        self.epsilon = float(epsilon)
        self.clip = float(clip)
        sound = all(one.shape == shape and np.isfinite(one).all() for one in (self.mean, self.var))
        if not sound or not (self.var + self.epsilon > 0).all() or not self.clip > 0:
            raise ValueError(f"expected statistics of observations of shape {shape}")

    def __call__(self, observation: Any) -> Any:
        scaled = (observation - self.mean) / np.sqrt(self.var + self.epsilon)
        return np.clip(scaled, -self.clip, self.clip).astype(np.float32)


def _plain_box(space: Any) -> dict[str, Any]:
    """A box as JSON; None for an infinite bound. `AttributeError` for another space."""
    low, high = (
        [float(x) if math.isfinite(x) else None for x in bound.ravel()] for bound in (space.low, space.high)
    )
    return {"low": low, "high": high, "shape": list(space.shape), "dtype": str(space.dtype)}


def _built_box(low: list[Any], high: list[Any], shape: list[int], dtype: str) -> spaces.Box:
    kind: Any = np.dtype(dtype).type
    least, most = (
        np.array([default if x is None else x for x in bound], kind).reshape(shape)
        for bound, default in ((low, -np.inf), (high, np.inf))
    )
    return spaces.Box(least, most, dtype=kind)


def _plain(value: Any) -> Any:
    """Arguments of a policy as JSON; `TypeError` if one cannot be told."""
    from torch import nn

    if isinstance(value, dict):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    name = getattr(value, "__name__", "")
    if name and getattr(nn, name, None) is value:
        return {"torch.nn": name}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError(value)


def _built(value: Any) -> Any:
    """What `_plain` gave, as the policy takes it."""
    from torch import nn

    if isinstance(value, dict):
        if value.keys() == {"torch.nn"}:
            kind = getattr(nn, str(value["torch.nn"]))
            if not (isinstance(kind, type) and issubclass(kind, nn.Module)):
                raise ValueError(f"expected the name of a torch.nn module, got {value['torch.nn']!r}")
            return kind
        return {key: _built(inner) for key, inner in value.items()}
    return [_built(inner) for inner in value] if isinstance(value, list) else value
