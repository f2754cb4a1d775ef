"""Trained policies in ONNX: reading and playing them, and marking the files of other exporters.

A policy's graph has one input, observations of shape (batch, k), and gives actions of shape (batch, n). Its
metadata are the policy's record (see `record`): without them a file does not say for which environment it is,
nor what its actions mean.
"""

from __future__ import annotations

import json
import os
from copy import deepcopy
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from hoof_env._input import as_path, check_regular
from hoof_env._output import staged
from hoof_env.errors import DataFileError, HoofEnvError, MissingExtraError, ParameterError, brief, parse_json
from hoof_env.policies.file_policy import FilePolicy
from hoof_env.policies.record import about

FILE = "policy.onnx"

INPUT = "observation"
OUTPUT = "action"
"""Names of input and output in files of `agents.export`. In others the input may have any name, and the
actions are the output of this name or the first one."""

OBJECTS = ("env_kwargs", "settings", "observation_scales")
LISTS = (*OBJECTS, "observation_names", "action_names")
"""Metadata of an .onnx file that are JSON; the others are text."""

NUMBERS: dict[str, type[np.floating[Any]]] = {"tensor(float)": np.float32, "tensor(double)": np.float64}
"""Types of numbers that a graph may take."""

TRIED = 16  # random observations that a stamped policy must answer


class OnnxPolicy(FilePolicy):
    """Policy in an ONNX file, with Stable-Baselines3's `predict`.

    Attributes:
        path: the file.
        record: the file's metadata: env_id, env_kwargs, settings, both spaces, names of observations and
            actions, scales of observations, algo, and the version of hoof_env in which it was trained.

    Args:
        path: a file of `agents.export` or `stamp_onnx`, or a folder that holds one as policy.onnx.
        content: the bytes of the file if they are known; otherwise they are read.

    Raises:
        DataFileError: the file is not one of these, or cannot be read.
        HoofEnvError: onnxruntime is not installed.
    """

    def __init__(self, path: Path | str, content: bytes | None = None) -> None:
        path = as_path("path", path)
        try:
            import onnxruntime
        except ImportError:
            raise HoofEnvError(
                f'policy {path}: reading it needs onnxruntime: pip install "hoof-env[onnx]"'
            ) from None
        super().__init__(path / FILE if os.path.isdir(path) else path)
        options = onnxruntime.SessionOptions()
        # One thread: in a small network, waiting for other threads takes longer than the arithmetic.
        options.intra_op_num_threads = 1
        options.inter_op_num_threads = 1
        options.log_severity_level = 3  # errors only
        try:
            if content is None:
                check_regular(self.path)
                content = self.path.read_bytes()
            self._session = onnxruntime.InferenceSession(content, options, ["CPUExecutionProvider"])
            metadata = self._session.get_modelmeta().custom_metadata_map
            self.record = {key: _entry(key, text) for key, text in metadata.items()}
            self._read_graph()
        # Exceptions of onnxruntime have no common base.
        except Exception as error:
            reason = (getattr(error, "strerror", None) or str(error) or type(error).__name__).splitlines()[0]
            raise DataFileError(
                f"policy {self.path}: expected an ONNX file of agents.export or hoof_env.stamp_onnx, cannot"
                f" read it ({reason})"
            ) from None

    def _read_graph(self) -> None:
        """Read the names and the types of input and output; raise ValueError where they, or the metadata, do
        not belong to a policy."""
        if not self.record.get("env_id"):
            raise ValueError("its metadata names no environment; hoof_env.stamp_onnx(path, env) adds them")
        inputs = self._session.get_inputs()
        names = [node.name for node in self._session.get_outputs()]
        if len(inputs) != 1 or len(inputs[0].shape) != 2 or inputs[0].type not in NUMBERS:
            given = [(one.name, one.shape) for one in inputs]
            raise ValueError(f"expected one input of floats, shape (batch, k), got {given}")
        self._input = inputs[0].name
        self._number = NUMBERS[inputs[0].type]
        self._batch, self._size = inputs[0].shape
        self._output = OUTPUT if OUTPUT in names else names[0]

    @property
    def number(self) -> type[np.floating[Any]]:
        return self._number

    @property
    def size(self) -> int | None:
        return self._size if isinstance(self._size, int) else None

    def act(self, observations: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
        rows = observations.reshape(-1, observations.shape[-1])
        if isinstance(self._batch, int) and len(rows) % self._batch:
            raise ParameterError(
                f"observation: expected a multiple of {self._batch} rows, which the graph of {self.path.name}"
                f" takes at once, got {len(rows)}; export it with a batch of any size"
            )
        # An exporter may have fixed the number of rows, as a rule to one.
        parts = [rows] if not isinstance(self._batch, int) else np.split(rows, len(rows) // self._batch)
        results = [self._session.run([self._output], {self._input: part})[0] for part in parts]
        actions = np.concatenate(results).astype(np.float32)
        return actions.reshape(*observations.shape[:-1], actions.shape[-1])


def _entry(key: str, text: str) -> Any:
    """Return an entry of the metadata; raise ValueError for one that is not of its type."""
    if key not in LISTS:
        return text
    try:
        value = parse_json(text)
    except ValueError:
        value = None
    kind, words = (dict, "object") if key in OBJECTS else (list, "list")
    if not isinstance(value, kind):
        raise ValueError(f"metadata {key}: expected a JSON {words}, got {brief(text[:80])}")
    return value


def stamp_onnx(path: str | Path, env: gym.Env[Any, Any], **record: str) -> OnnxPolicy:
    """Mark an ONNX file of any exporter as a policy for an environment; return the policy.

    The file is changed in place: its metadata get the id, arguments, settings, spaces, names and scales of
    the environment, the form of its actions, and this version of hoof-env. All commands and `load_policy`
    take it then, and refuse it where it does not fit. Its graph stays as it is. It must take observations as
    `env` gives them, (batch, k), and give mean actions, (batch, n), as the output "action" or the first one;
    with a batch of fixed size that is 1. Actions beyond [-1, 1] are clipped by the environment.

    >>> import gymnasium as gym, hoof_env
    >>> env = gym.make("hoof_env/HorseLeg-v0")
    >>> policy = hoof_env.stamp_onnx("mine.onnx", env, algo="ppo")  # doctest: +SKIP
    >>> action, _ = policy.predict(env.reset(seed=0)[0])  # doctest: +SKIP

    Args:
        path: the file.
        env: the environment for which the policy was trained, made by `gymnasium.make`.
        **record: more metadata, as algo="ppo" and seed="3".

    Raises:
        DataFileError: there is no such file, or it does not answer observations of `env` with its actions.
            The file is as it was.
        ParameterError: `env` was not made by `gymnasium.make`, the file does not end in .onnx, or `record`
            has an entry that is no text or is read off `env`.
        MissingExtraError: onnx is not installed (extra "onnx").
    """
    try:
        import onnx
    except ImportError:
        raise MissingExtraError('stamping an ONNX file needs onnx: pip install "hoof-env[onnx]"') from None
    if not isinstance(env, gym.Env) or env.spec is None:
        raise ParameterError(
            f"env: expected a single environment made by gymnasium.make, stamp_onnx(path, env), got"
            f" {brief(env)}"
        )
    if not isinstance(path, (str, Path)) or Path(path).suffix.lower() != ".onnx":
        raise ParameterError(f"path: expected a file name ending in .onnx, got {brief(path)}")
    file = Path(path)
    known = about(env, env.spec.id, arguments_of(env), {})
    if taken := sorted(known.keys() & record):
        raise ParameterError(f"record: expected no entry that is read off env, got {taken}")
    for key, value in record.items():
        if not isinstance(value, str):
            raise ParameterError(f'{key}: expected a string, as in seed="3", got {brief(value)}')
    metadata = known | record
    try:
        graph = onnx.load(file)
    # Damaged files raise exceptions of any type.
    except Exception as error:
        raise DataFileError(f"policy {file}: expected an ONNX file, cannot read it ({error})") from None
    kept = {entry.key: entry.value for entry in graph.metadata_props}
    texts = {key: json.dumps(value) if key in LISTS else str(value) for key, value in metadata.items()}
    onnx.helper.set_model_props(graph, kept | texts)
    content = graph.SerializeToString()
    policy = OnnxPolicy(file, content)
    check_answers(policy, env)
    with staged(file.parent) as stage:
        (stage / file.name).write_bytes(content)
    return policy


def arguments_of(env: gym.Env[Any, Any]) -> dict[str, Any]:
    """Return the arguments with which an environment was made beyond its id's own, as JSON has them; what
    JSON cannot hold is left out."""
    assert env.spec is not None
    of_id = gym.registry[env.spec.id].kwargs if env.spec.id in gym.registry else {}
    arguments = {}
    for key, value in env.spec.kwargs.items():
        if key == "render_mode" or (key in of_id and of_id[key] == value):
            continue
        try:
            arguments[key] = json.loads(json.dumps(value))
        except TypeError:
            continue
    return arguments


def check_answers(policy: OnnxPolicy, env: gym.Env[Any, Any]) -> None:
    """Raise `DataFileError` unless a policy answers random observations of an environment, several at once
    and one alone, with finite actions of the right number."""
    space = deepcopy(env.observation_space)  # its generator is the environment's
    space.seed(0)
    seen = np.stack([space.sample() for _ in range(TRIED)])
    expected = (TRIED, *(env.action_space.shape or ()))
    if policy.size not in (None, seen.shape[-1]):
        made = env.spec.id if env.spec else repr(env)
        raise DataFileError(
            f"policy {policy.path}: expected a graph that takes the {seen.shape[-1]} observations of {made},"
            f" got one that takes {policy.size}; make the environment with the id and the arguments"
            " used in training"
        )
    try:
        actions, _ = policy.predict(seen)
        alone, _ = policy.predict(seen[0])
        if actions.shape != expected or alone.shape != expected[1:]:
            raise ValueError(f"shape {actions.shape}")
        if not np.isfinite(actions).all():
            raise ValueError("numbers that are not finite")
    # Exceptions of onnxruntime have no common base.
    except Exception as error:
        reason = str(error).splitlines()[0]
        raise DataFileError(
            f"policy {policy.path}: expected actions of shape {expected} for observations of shape"
            f" {seen.shape}, got {reason}; export the mean action, with a batch of any size"
        ) from None
