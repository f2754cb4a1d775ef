"""Trained policies as plain data, played by NumPy alone.

    policy.json         algorithm, kind of policy, its arguments, both spaces, statistics of the observations,
                        and the SHA-256 of all that
    policy.safetensors  the weights, in the format of the library safetensors: the length of a JSON header,
                        the header, and the numbers of all tensors

`saved` writes both, and plays with Stable-Baselines3 the kinds of policy that this module does not know.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from hoof_env._input import as_path, check_regular, read_text
from hoof_env.errors import DataFileError, parse_json
from hoof_env.policies.file_policy import FilePolicy
from hoof_env.policies.record import read_record

WEIGHTS = "policy.safetensors"
ABOUT = "policy.json"
FORMAT = 1  # version of the layout of policy.json
DIGEST = "sha256"  # entry of policy.json

Floats = NDArray[np.float64]
ACTIVATIONS: Mapping[str, Callable[[Floats], Floats]] = {
    "Tanh": np.tanh,
    "ReLU": lambda x: np.maximum(x, 0.0),
    "ELU": lambda x: np.where(x > 0, x, np.expm1(np.minimum(x, 0.0))),
}
"""Functions of the hidden layers by their names in torch.nn; Tanh is Stable-Baselines3's default."""

KNOWN = ("activation_fn", "net_arch", "log_std_init", "ortho_init")
"""Arguments of a policy of PPO with which NumPy plays it; others may change what its weights mean."""


class NumpyPolicy(FilePolicy):
    """Deterministic policy of PPO whose weights are plain data, with Stable-Baselines3's `predict`.

    Attributes:
        path: the folder of its files.
        record: content of run.json in the folder, empty if the file is missing.
        observation_space: space of the observations that it takes.
        action_space: space of its actions.

    Args:
        path: a folder with `ABOUT` and `WEIGHTS`.

    Raises:
        DataFileError: the files cannot be read, or are of a policy that `is_known` does not know.
    """

    def __init__(self, path: Path | str) -> None:
        path = as_path("path", path)
        super().__init__(path)
        self.record = read_record(path)
        try:
            about = parse_json(read_text(path / ABOUT))
            if not is_known(about):
                raise ValueError(f"a policy that NumPy does not play: {about.get('algo')} {about['policy']}")
            check_digest(about, path / WEIGHTS)
            self.observation_space = built_box(**about["observation_space"])
            self.action_space = built_box(**about["action_space"])
            arguments = about["normalize"]
            self._normalize = (
                Normalizer(self.observation_space.shape, **arguments) if arguments else lambda x: x
            )
            hidden = about["policy_kwargs"].get("activation_fn", {"torch.nn": "Tanh"})
            self._activation = ACTIVATIONS[hidden["torch.nn"]]
            self._layers = layers_of(read_tensors(path / WEIGHTS))
            first, _ = self._layers[0]
            last, _ = self._layers[-1]
            if (first.shape[1:], last.shape[:1]) != (self.observation_space.shape, self.action_space.shape):
                raise ValueError(f"weights of shapes {first.shape} to {last.shape}")
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
            raise DataFileError(
                f"policy {path}: expected {ABOUT} and {WEIGHTS} of agents.train, cannot read them ({error})"
            ) from None

    @property
    def number(self) -> type[np.float32]:
        return np.float32

    @property
    def size(self) -> int:
        return int(self.observation_space.shape[0])

    def act(self, observations: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
        *hidden, (matrix, bias) = self._layers
        # In double precision, so that a row of many is rounded to the same action as the row alone.
        x = self._normalize(observations).astype(np.float64)
        for weights, offset in hidden:
            x = self._activation(x @ weights.T + offset)
        actions = np.clip(x @ matrix.T + bias, self.action_space.low, self.action_space.high)
        return actions.astype(np.float32)


def is_known(about: Mapping[str, Any]) -> bool:
    """Return True if `NumpyPolicy` plays the policy that a content of policy.json describes."""
    arguments = about.get("policy_kwargs", {})
    kind = arguments.get("activation_fn", {"torch.nn": "Tanh"})
    is_kind = (about.get("format"), about.get("algo"), about.get("policy")) == (FORMAT, "ppo", "MlpPolicy")
    return is_kind and set(arguments) <= set(KNOWN) and kind.get("torch.nn") in ACTIVATIONS


def digest_of(about: Mapping[str, Any], weights: bytes) -> str:
    """Return the SHA-256 of a policy, hexadecimal.

    Args:
        about: content of policy.json, of which `DIGEST` does not count.
        weights: content of policy.safetensors.
    """
    rest = json.dumps({name: value for name, value in about.items() if name != DIGEST}, sort_keys=True)
    return hashlib.sha256(rest.encode() + weights).hexdigest()


def check_digest(about: Mapping[str, Any], weights: Path) -> None:
    """Check that a policy is as it was written, because one flipped bit may give other weights that can be
    read. Policies of earlier commits have no digest to check.

    Args:
        about: content of policy.json.
        weights: path of policy.safetensors.

    Raises:
        OSError: the weights cannot be read.
        ValueError: a file is damaged or changed.
    """
    check_regular(weights)
    if DIGEST in about and about[DIGEST] != digest_of(about, weights.read_bytes()):
        raise ValueError(
            f"one of them is not as it was written, by {DIGEST} in {ABOUT}: take a copy that is whole; after"
            " a change of your own, remove that entry"
        )


def read_tensors(path: Path | str) -> dict[str, Floats]:
    """Read a file of safetensors with numbers of float32, by name.

    Raises:
        OSError, ValueError, TypeError, KeyError: there is no such file, it is damaged, or its numbers are of
            another type or not finite.
    """
    path = as_path("path", path)
    check_regular(path)
    content = path.read_bytes()
    start = 8 + int.from_bytes(content[:8], "little")
    tensors = {}
    for name, entry in parse_json(content[8:start]).items():
        if name == "__metadata__":
            continue
        begin, end = entry["data_offsets"]
        if entry["dtype"] != "F32":
            raise ValueError(f"{path.name}: numbers of type {entry['dtype']}, expected F32")
        numbers = np.frombuffer(content[start + begin : start + end], "<f4").reshape(entry["shape"])
        if not np.isfinite(numbers).all():
            raise ValueError(f"{path.name} holds numbers that are not finite")
        tensors[name] = numbers.astype(np.float64)
    return tensors


def layers_of(tensors: Mapping[str, Floats]) -> list[tuple[Floats, Floats]]:
    """Return matrix and bias of each layer from the observation to the mean action, by the names that PPO of
    Stable-Baselines3 gives them."""
    prefix = "mlp_extractor.policy_net."
    numbers = sorted(
        int(name.removeprefix(prefix).removesuffix(".weight"))
        for name in tensors
        if name.startswith(prefix) and name.endswith(".weight")
    )
    names = [*(f"{prefix}{number}" for number in numbers), "action_net"]
    return [(tensors[f"{name}.weight"], tensors[f"{name}.bias"]) for name in names]


class Normalizer:
    """Normalisation of observations by the formula of Stable-Baselines3's `VecNormalize`.

    Args:
        shape: shape of an observation.
        mean, var: running mean and variance of the observations, of that shape.
        epsilon: constant added to the variance.
        clip: largest absolute value of a normalised observation.

    Raises:
        ValueError: the statistics have another shape, or are not finite or not positive.
    """

    def __init__(
        self, shape: tuple[int, ...], mean: list[float], var: list[float], epsilon: float, clip: float
    ) -> None:
        self.mean = np.array(mean, np.float64)
        self.var = np.array(var, np.float64)
        self.epsilon = float(epsilon)
        self.clip = float(clip)
        statistics = (self.mean, self.var)
        sound = all(array.shape == shape and np.isfinite(array).all() for array in statistics)
        if not sound or not (self.var + self.epsilon > 0).all() or not self.clip > 0:
            raise ValueError(f"expected statistics of observations of shape {shape}")

    def __call__(self, observation: Any) -> Any:
        scaled = (observation - self.mean) / np.sqrt(self.var + self.epsilon)
        return np.clip(scaled, -self.clip, self.clip).astype(np.float32)


def built_box(low: list[Any], high: list[Any], shape: list[int], dtype: str) -> spaces.Box:
    """Build the box that `saved.save_policy` has written."""
    kind: Any = np.dtype(dtype).type
    least, most = (
        np.array([default if x is None else x for x in bound], kind).reshape(shape)
        for bound, default in ((low, -np.inf), (high, np.inf))
    )
    return spaces.Box(least, most, dtype=kind)
