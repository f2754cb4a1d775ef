"""A policy in an ONNX file, played by onnxruntime: no learning library, and no code in the file.

`agents.export` writes such files. What they say of themselves stands in their metadata: env_id, env_kwargs,
settings, observation_space, action_space, observation_names, action_names, algo, and the version of hoof_env
that trained.
"""

from __future__ import annotations

import json
import warnings
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env._version import __version__
from hoof_env.errors import DataFileError, HoofEnvError

FILE = "policy.onnx"  # in a policy's folder
INPUT, OUTPUT = "observation", "action"
"""Names of the graph's input, shape (batch, k), and output, shape (batch, n), float32 both."""

OBJECTS = ("env_kwargs", "settings")
LISTS = (*OBJECTS, "observation_names", "action_names")
"""Metadata that is JSON; all other is text."""


class OnnxPolicy:
    """A policy with Stable-Baselines3's `predict`.

    Args:
        path: of an .onnx file, or of a folder that holds `FILE`.

    Attributes:
        path: of the file.
        record: its metadata.

    Raises:
        DataFileError: no such file, or not one of `agents.export`.
        HoofEnvError: onnxruntime is missing.
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
            self.record = {key: json.loads(text) if key in LISTS else text for key, text in found.items()}
            names = [node.name for node in (*self._session.get_inputs(), *self._session.get_outputs())]
            objects = all(isinstance(self.record.get(key, {}), dict) for key in OBJECTS)
            if names != [INPUT, OUTPUT] or "env_id" not in self.record or not objects:
                raise ValueError(f"tensors {names}, metadata {self.record}")
        except Exception as error:  # onnxruntime has an exception for everything, with no common base
            said = (getattr(error, "strerror", None) or str(error) or type(error).__name__).splitlines()[0]
            raise DataFileError(
                f"policy {self.path}: expected an ONNX file of agents.export, cannot read it ({said})"
            ) from None

    @staticmethod
    def stands_at(path: Path) -> bool:
        """Whether `path` is that of an ONNX file or of a folder that holds a policy."""
        return path.suffix == ".onnx" or (path / FILE).is_file()

    def load(self, env: Any, env_id: str) -> OnnxPolicy:
        """This policy, if it fits an environment. Warns of other settings or another hoof-env.

        Raises:
            DataFileError: it is for another environment, other spaces, or observes other things.
        """
        wanted = {"env_id": env_id, **describe(env)}
        for key, value in wanted.items():
            if key in self.record and self.record[key] != value:
                raise DataFileError(
                    f"policy {self.path}: made for {key} {self.record[key]}, expected {value}"
                )
        there, here = self.record.get("settings", self.record.get("env_kwargs", {})), settings_of(env)
        alike = {key: here[key] for key in there.keys() & here.keys()}
        there = {key: there[key] for key in alike}
        warn_of_differences(f"policy {self.path}", there, alike, self.record.get("hoof_env"))
        return self

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[NDArray[np.float32], Any]:
        """Actions for observations of shape (..., k), always the deterministic ones; `state` comes back."""
        rows = np.asarray(observation, np.float32)
        (actions,) = self._session.run([OUTPUT], {INPUT: rows.reshape(-1, rows.shape[-1])})
        return actions.reshape(*rows.shape[:-1], actions.shape[-1]), state


def describe(env: Any) -> dict[str, Any]:
    """What an environment says of what it takes and gives: spaces, and names where it has them."""
    from hoof_env.gait.gait import PARAMETERS

    found: dict[str, Any] = dict(describe_spaces(env))
    names = getattr(env.unwrapped, "observation_names", None)
    if names is not None:
        found |= {"observation_names": list(names), "action_names": list(PARAMETERS)}
    return found


def describe_spaces(env: Any) -> dict[str, str]:
    """Both spaces of an environment or a model as text, to be kept beside a model and compared."""
    return {"observation_space": str(env.observation_space), "action_space": str(env.action_space)}


def settings_of(env: Any) -> dict[str, Any]:
    """All settings of an environment of this package, as JSON gives them back; empty for another
    package's."""
    settings = getattr(env.unwrapped, "settings", None)
    if not is_dataclass(settings) or isinstance(settings, type):
        return {}
    plain: dict[str, Any] = json.loads(json.dumps(asdict(settings), default=str))
    return plain


def warn_of_differences(
    policy: str, there: dict[str, Any], here: dict[str, Any], made_with: str | None
) -> None:
    """Warn of settings, or a version of hoof-env, that were others where a policy was trained."""
    names = sorted(key for key in {*there, *here} if there.get(key) != here.get(key))
    unlike = [f"{key}={there.get(key)!r}, here {here.get(key)!r}" for key in names]
    if made_with not in (None, __version__):
        unlike.append(f"hoof-env {made_with}, here {__version__}")
    if unlike:
        warnings.warn(f"{policy}: trained with {'; '.join(unlike)}", stacklevel=3)
