"""Trained policies in files of `agents.train`, `agents.export` and `agents.ship`: finding, reading, playing.

    policy.onnx         the policy alone, played by onnxruntime (extra "onnx"); its metadata are its record
    policy.safetensors  the weights, played by Stable-Baselines3 (extra "train"), or by NumPy (see `plain`)
    policy.json         algorithm, kind of policy, its arguments, both spaces, statistics of the observations
    model.zip           the policy and the state of its training: optimiser, exploration and counters
    run.json            the record of the training: env_id, settings, spaces, versions (see `record`)

Reading the first three, which are plain data, runs no code from a file, although a file may ask for a large
network, and so for memory. A .zip or .pkl is a pickle and can run any code: load only files that you trust.
"""

from __future__ import annotations

import json
import math
import os
import warnings
import zipfile
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium as gym

from hoof_env._collector import paused
from hoof_env._input import as_path, read_text
from hoof_env.errors import (
    DataFileError,
    MissingExtraError,
    ParameterError,
    brief,
    check_choice,
    parse_json,
)
from hoof_env.policies.normalisation import STATISTICS as STATISTICS
from hoof_env.policies.normalisation import normaliser_of
from hoof_env.policies.plain import ABOUT as ABOUT
from hoof_env.policies.plain import DIGEST, FORMAT, Normalizer, built_box, check_digest, digest_of
from hoof_env.policies.plain import WEIGHTS as WEIGHTS
from hoof_env.policies.record import check_record as check_record
from hoof_env.policies.record import describe as describe
from hoof_env.policies.record import describe_env as describe_env
from hoof_env.policies.record import describe_spaces, refuse_misfit
from hoof_env.policies.record import environment_of as environment_of
from hoof_env.policies.record import own_id as own_id
from hoof_env.policies.record import read_record as read_record
from hoof_env.policies.record import settings_of as settings_of

FILE = "policy.onnx"
CHECKPOINTS = "checkpoints"

ALGORITHMS = {
    "ppo": "stable_baselines3",
    "sac": "stable_baselines3",
    "td3": "stable_baselines3",
    "tqc": "sb3_contrib",
}
"""Module of each algorithm's class; agents/hyperparams has a file for each."""


MARKS = {"tqc": "top_quantiles_to_drop_per_net", "sac": "target_entropy", "td3": "policy_delay"}
"""Entry by which the data in a .zip show their algorithm; TQC has the entry of SAC, too."""


def algorithm_of(path: Path | str) -> str:
    """Return the algorithm of `ALGORITHMS` that plays a .zip of Stable-Baselines3, "ppo" for a file without a
    mark, as of A2C, which has the same policy. Nothing is unpickled.

    Raises:
        OSError, KeyError, ValueError, zipfile.BadZipFile: not such a file.
    """
    path = as_path("path", path)
    with zipfile.ZipFile(path) as file:
        entries = parse_json(file.read("data"))
    return next((algo for algo, mark in MARKS.items() if mark in entries), "ppo")


def algorithm_class(name: str) -> Any:
    """Return the class of an algorithm of `ALGORITHMS`; raise `ParameterError` if its library is missing."""
    module = ALGORITHMS[check_choice("algo", name, ALGORITHMS)]
    try:
        with paused():
            return getattr(import_module(module), name.upper())
    except ModuleNotFoundError as error:
        raise ParameterError(
            f"algo {name}: expected {module} to be installed (pip install 'hoof-env[train]'): {error}"
        ) from None


# -- policies of Stable-Baselines3 -------------------------------------------------------------


@dataclass(frozen=True)
class TrainedPolicy:
    """Policy of Stable-Baselines3 with the normalisation of observations with which it was trained.

    Attributes:
        model: the model; one that was read from plain data has a policy only and cannot train.
        normalize: function of an observation, or None if the policy takes observations as they are.
    """

    model: Any
    normalize: Any

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Any, Any]:
        """Return the action for an observation of the environment, and the policy's state, as
        Stable-Baselines3's `predict` does."""
        if self.normalize is not None:
            observation = self.normalize(observation)
        return self.model.predict(observation, state, episode_start, deterministic)


@dataclass(frozen=True)
class SavedModel:
    """Model file of agents.train and the record of its run folder, before it is loaded.

    Attributes:
        path: path of model.zip or another .zip; next to a model.zip, the policy as plain data is loaded.
        record: content of run.json, empty if the file is missing.
    """

    path: Path
    record: dict[str, Any]

    @classmethod
    def find(cls, path: Path | str) -> SavedModel:
        """Return the model at `path`, a .zip or a run folder; raise `DataFileError` if there is none.

        A run folder without a model, as its training has not ended, gives its last checkpoint.
        """
        path = as_path("path", path)
        is_folder = os.path.isdir(path)
        saved = cls(path / "model.zip" if is_folder else path, {})
        if is_folder and not (os.path.isfile(saved.path) or saved.is_plain):
            folders = [folder for folder in (path / CHECKPOINTS).glob("*") if folder.name.isdigit()]
            last = max(folders, key=lambda folder: int(folder.name), default=path)
            saved = cls(last / "model.zip", {})
        if not (os.path.isfile(saved.path) or saved.is_plain):
            raise DataFileError(
                f"model {path}: expected a .zip of agents.train or its run folder, found no {saved.path}"
            )
        # run.json lies next to the model, or two folders above a checkpoint's.
        for folder in saved.path.parents[:3:2]:
            if record := read_record(folder):
                return cls(saved.path, record)
        return saved

    @property
    def is_plain(self) -> bool:
        """True if the policy can be read from plain data, which runs no code of the file."""
        files = (self.path.with_name(ABOUT), self.path.with_name(WEIGHTS))
        return self.path.name == "model.zip" and all(file.is_file() for file in files)

    def load(self, env: gym.Env[Any, Any], env_id: str) -> TrainedPolicy:
        """Return the policy for `env`, from plain data if there is some, else from the .zip.

        Unpickling a .zip can run any code that it holds, so that a warning names it. Another warning names
        other settings, or another version of hoof-env, with which the policy was trained.

        Raises:
            DataFileError: the policy does not fit `env`, or its file cannot be read.
            MissingExtraError: Stable-Baselines3 or safetensors is not installed.
        """
        check_record(self.path, self.record, env, env_id)
        try:
            with paused():
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
        # A warning where a caller makes errors of warnings
        except (DataFileError, UserWarning):
            raise
        # Damaged files raise exceptions of any type.
        except Exception as error:
            reason = f"{type(error).__name__}: {error}".splitlines()[0]
            raise DataFileError(f"model {file}: expected {origin}, cannot read it ({reason})") from None
        refuse_misfit(self.path, describe_spaces(policy.model), describe_spaces(env))
        return policy

    def _unpickle(self, env: gym.Env[Any, Any]) -> TrainedPolicy:
        """Load the .zip and the statistics of observations beside it, if there are any."""
        algo = self.record.get("algo") or algorithm_of(self.path)
        model = algorithm_class(algo).load(self.path, device="cpu")
        return TrainedPolicy(model, normaliser_of(model, self.path, env))


# -- the same as plain data --------------------------------------------------------------------


def save_policy(model: Any, folder: Path | str) -> bool:
    """Write the policy of a Stable-Baselines3 model into `folder` as plain data.

    Returns:
        True, or False if nothing is written, because the policy's arguments are not plain data or its spaces
        are not boxes.
    """
    folder = as_path("folder", folder)
    from safetensors.torch import save

    envs: Any = model.get_vec_normalize_env()
    try:
        normalize = None
        if envs is not None and envs.norm_obs:
            normalize = {
                "mean": envs.obs_rms.mean.tolist(),
                "var": envs.obs_rms.var.tolist(),
                "epsilon": float(envs.epsilon),
                "clip": float(envs.clip_obs),
            }
        about = {
            "format": FORMAT,
            "algo": getattr(model, "plays_as", type(model).__name__.lower()),
            "policy": next(name for name, kind in model.policy_aliases.items() if kind is model.policy_class),
            "policy_kwargs": _plain(({"use_sde": True} if model.use_sde else {}) | model.policy_kwargs),
            "observation_space": _plain_box(model.observation_space),
            "action_space": _plain_box(model.action_space),
            "normalize": normalize,
        }
        # As it is read back, for the digest
        about = json.loads(json.dumps(about, allow_nan=False))
    except (TypeError, ValueError, AttributeError, StopIteration):
        return False
    # Cloned, so that a tensor that two names share is written twice: the format has no references.
    weights = {
        key: value.detach().cpu().clone().contiguous() for key, value in model.policy.state_dict().items()
    }
    # Not by `save_file`, which makes a file that only its owner can read.
    content = save(weights)
    about[DIGEST] = digest_of(about, content)
    (folder / WEIGHTS).write_bytes(content)
    (folder / ABOUT).write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
    return True


def read_plain(folder: Path | str) -> TrainedPolicy:
    """Read the policy that `save_policy` wrote into `folder`, without a model's other parts. Damaged files
    raise exceptions of any type."""
    folder = as_path("folder", folder)
    from safetensors.torch import load_file

    about = parse_json(read_text(folder / ABOUT))
    if about["format"] != FORMAT:
        raise ValueError(f"format {about['format']!r}, expected {FORMAT}")
    check_digest(about, folder / WEIGHTS)
    # Without set-up, which needs an environment and makes a replay buffer; only the policy is built.
    model = algorithm_class(about["algo"])(about["policy"], None, device="cpu", _init_setup_model=False)
    model.observation_space = built_box(**about["observation_space"])
    model.action_space = built_box(**about["action_space"])
    model.policy_kwargs = _built(about["policy_kwargs"])
    model.policy = model.policy_class(
        model.observation_space,
        model.action_space,
        lambda _: 0.0,
        **model.policy_kwargs,
    )
    weights = load_file(folder / WEIGHTS)
    if not all(bool(tensor.isfinite().all()) for tensor in weights.values()):
        raise ValueError(f"{WEIGHTS} holds numbers that are not finite")
    model.policy.load_state_dict(weights)
    model.policy.set_training_mode(False)
    shape = model.observation_space.shape
    return TrainedPolicy(model, Normalizer(shape, **about["normalize"]) if about["normalize"] else None)


def _plain_box(space: Any) -> dict[str, Any]:
    """Return a box as JSON, None for an infinite bound; raise `AttributeError` for another space."""
    low, high = (
        [float(x) if math.isfinite(x) else None for x in bound.ravel()] for bound in (space.low, space.high)
    )
    return {"low": low, "high": high, "shape": list(space.shape), "dtype": str(space.dtype)}


def _plain(value: Any) -> Any:
    """Return arguments of a policy as JSON, classes of `torch.nn` by their names; raise `TypeError` for
    other values."""
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
    """Build the arguments of a policy that `_plain` has written.

    Names are looked up in `torch.nn` only, and only its modules are accepted, so that a file cannot choose
    other code to run.
    """
    from torch import nn

    if isinstance(value, dict):
        if value.keys() == {"torch.nn"}:
            kind = getattr(nn, str(value["torch.nn"]))
            if not (isinstance(kind, type) and issubclass(kind, nn.Module)):
                raise ValueError(f"expected the name of a torch.nn module, got {brief(value['torch.nn'])}")
            return kind
        return {key: _built(inner) for key, inner in value.items()}
    return [_built(inner) for inner in value] if isinstance(value, list) else value
