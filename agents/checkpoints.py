"""Checkpoints: all that a training needs to continue, in a folder that is complete or does not exist.

`checkpoints/N/`, after N steps and between two rollouts, holds model.zip (weights, optimisers, counters,
schedules, action noise), policy.*, where they exist vecnormalize.pkl and replay.pkl, state.pkl
(environments, generators, length of monitor.csv), and digests.json, because a damaged pickle may load
with wrong numbers.

A resumed run has the bits of a run that was never stopped: on the same machine, on the CPU, with the same
number of threads, with environments that have `get_state` and `set_state`, and without max_episode_steps
around an environment that is not native. Other environments start new episodes, with seeds that differ
from the first ones. These files are pickles: resume only runs that you trust.
"""

from __future__ import annotations

import copy
import hashlib
import json
import os
import pickle
import random
import shutil
import tempfile
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from agents import runs
from hoof_env.errors import DataFileError, OutputError

KEPT = 2
REPLAY = "replay.pkl"
STATE = "state.pkl"
DIGESTS = "digests.json"
"""File with the SHA-256 of every other file of a checkpoint, by name."""
COUNTED = ("episode_returns", "episode_lengths", "episode_count")  # counters of a `VecMonitor`
EXPLORATION = ("exploration_mat", "exploration_matrices")
"""Attributes with the exploration noise that gSDE drew for a rollout, before its first callback."""
UNFINISHED = ".unfinished-"


@contextmanager
def whole(folder: Path) -> Iterator[Path]:
    """Open a folder that exists with all its files, on the disk, once the block has succeeded, else not at
    all; `OutputError` if it cannot be written."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=UNFINISHED, dir=folder.parent))
        try:
            yield stage
            # The files reach the disk before the name does: a crash leaves no checkpoint with holes
            for path in (*stage.iterdir(), stage):
                _flush(path)
            stage.rename(folder)
            _flush(folder.parent)
        finally:
            shutil.rmtree(stage, ignore_errors=True)
    except OSError as error:
        raise OutputError(f"cannot write {str(folder)!r}: {error.strerror or error}") from None


def checkpoints(run: Path) -> list[Path]:
    """Return the checkpoints of a run, the last one first; half-done folders are not among them."""
    folders = (path for path in (run / runs.CHECKPOINTS).glob("*") if path.name.isdigit())
    return sorted(folders, key=lambda path: int(path.name), reverse=True)


def tidy(run: Path, keep: int = KEPT) -> None:
    """Remove all checkpoints but the last `keep`, and what killed processes left; no checkpoint is ever seen
    half-removed."""
    for path in checkpoints(run)[keep:]:
        # Renaming is atomic, removing a folder is not: a reader never finds half a checkpoint
        path.rename(path.with_name(f"{UNFINISHED}{path.name}"))
    for folder in (run, run / runs.CHECKPOINTS):
        for path in folder.glob(f"{UNFINISHED}*"):
            shutil.rmtree(path, ignore_errors=True)
    if not keep:
        shutil.rmtree(run / runs.CHECKPOINTS, ignore_errors=True)


def save(model: Any, run: Path, seconds: float) -> None:
    """Write a checkpoint of a model between two rollouts, `seconds` into the training; remove older ones."""
    import torch
    from stable_baselines3.common.vec_env import VecMonitor

    monitor = _layer(model.env, VecMonitor)
    normalize = model.get_vec_normalize_env()
    state = {
        "seconds": seconds,
        "monitor": {name: getattr(monitor, name) for name in COUNTED},
        "monitor_bytes": (run / runs.MONITOR).stat().st_size,
        "returns": None if normalize is None else normalize.returns,
        "environments": _environment_states(model.env),
        "generators": {
            "python": random.getstate(),
            "numpy": np.random.get_state(),  # noqa: NPY002  (Stable-Baselines3 draws from it)
            "torch": torch.get_rng_state(),
            "actions": model.action_space.np_random.bit_generator.state,
        },
        "exploration": {name: getattr(_explorer(model), name) for name in EXPLORATION if model.use_sde},
    }
    with whole(run / runs.CHECKPOINTS / str(model.num_timesteps)) as stage:
        runs.write_model(model, stage)
        if getattr(model, "replay_buffer", None) is not None:
            model.save_replay_buffer(stage / REPLAY)
        (stage / STATE).write_bytes(pickle.dumps(state))
        (stage / DIGESTS).write_text(json.dumps(_digests(stage), indent=1), encoding="utf-8")
    tidy(run)


def _digests(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of each file of a checkpoint, but for `DIGESTS`, by name."""
    files = sorted(path for path in folder.iterdir() if path.name != DIGESTS)
    digests = {}
    for path in files:
        with path.open("rb") as file:
            digests[path.name] = hashlib.file_digest(file, "sha256").hexdigest()
    return digests


def _check_digests(checkpoint: Path) -> None:
    """Check that the files of a checkpoint are as they were written.

    Raises:
        ValueError: a file is damaged, missing, or of another checkpoint.
    """
    written = json.loads((checkpoint / DIGESTS).read_text(encoding="utf-8"))
    present = _digests(checkpoint)
    if unlike := sorted(name for name in {*written, *present} if written.get(name) != present.get(name)):
        raise ValueError(f"{', '.join(unlike)}: not as written, by {DIGESTS}")


def write_episodes(envs: Any, path: Path, go_on: bool = False) -> None:
    """Have the `VecMonitor` in `envs` write its episodes at `path`, after those in the file or anew."""
    from stable_baselines3.common.monitor import ResultsWriter
    from stable_baselines3.common.vec_env import VecMonitor

    monitor = _layer(envs, VecMonitor)
    header = {"t_start": monitor.t_start, "env_id": "None"}
    monitor.results_writer = ResultsWriter(str(path), header=header, override_existing=not go_on)


class Resumed:
    """Model that goes on from a checkpoint of its class: `model.learn(rest, reset_num_timesteps=False)`.

    Args:
        checkpoint: folder of the checkpoint.
        algorithm: class of the model.
        many: its `VecEnv` without wrappers.
        device: torch device.

    Attributes:
        model: the model with its environments.
        seconds: time of training up to the checkpoint [s].

    Raises:
        DataFileError: the checkpoint cannot be read or is of other environments.
    """

    def __init__(self, checkpoint: Path, algorithm: Any, many: Any, device: str) -> None:
        from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

        try:
            _check_digests(checkpoint)
            self._state = pickle.loads((checkpoint / STATE).read_bytes())
            self.seconds: float = self._state["seconds"]
            monitor = VecMonitor(many)
            # As `make_model` wraps them: the monitor inside, the normalisation outside
            envs: Any = monitor
            if (checkpoint / runs.STATISTICS).exists():
                envs = VecNormalize.load(str(checkpoint / runs.STATISTICS), monitor)
            with warnings.catch_warnings():  # it warns of n_steps without its buffer, which is loaded next
                warnings.filterwarnings("ignore", "`n_steps=", UserWarning)
                self.model = algorithm.load(
                    checkpoint / runs.MODEL, env=envs, device=device, force_reset=False
                )
            if (checkpoint / REPLAY).exists():
                self.model.load_replay_buffer(checkpoint / REPLAY)
            self._put_back(monitor, many)
        except Exception as error:  # a damaged pickle may raise anything
            reason = f"{type(error).__name__}: {error}".splitlines()[0]
            raise DataFileError(
                f"checkpoint {checkpoint}: cannot go on from it ({reason}); without it an earlier one serves"
            ) from None
        self._continue_monitor(monitor, checkpoint.parents[1] / runs.MONITOR)
        self._noise = copy.deepcopy(getattr(self.model, "action_noise", None))

    def _put_back(self, monitor: Any, many: Any) -> None:
        """Restore the states of environments, monitor and normalisation."""
        states = self._state["environments"]
        model = self.model
        if states is None:
            model._last_obs = None  # the training resets them
            # New episodes, other than the first start's
            many.seed((model.seed or 0) + model.num_timesteps)
            return
        many.reset()
        for env, state in zip(_stateful(many), states, strict=True):
            env.set_state(state)
        for name, value in self._state["monitor"].items():
            setattr(monitor, name, value)
        if self._state["returns"] is not None:
            model.get_vec_normalize_env().returns = self._state["returns"]

    def _continue_monitor(self, monitor: Any, path: Path) -> None:
        """Drop the rows of episodes after the checkpoint, which are played again, and continue its clock."""
        monitor.t_start = time.time() - self.seconds
        is_there = path.exists()
        if is_there:
            os.truncate(path, min(path.stat().st_size, self._state["monitor_bytes"]))
        write_episodes(monitor, path, go_on=is_there)

    def start(self) -> None:
        """Restore what setting up a training resets; call it when the training starts."""
        # `learn` resets the action noise, whose state is part of the checkpoint
        if self._noise is not None:
            self.model.action_noise = self._noise

    def start_rollout(self) -> None:
        """Restore the random generators and the noise drawn from them; call it when the first rollout
        starts."""
        import torch

        # Not in `start`: setting up a training draws from these generators
        generators = self._state["generators"]
        random.setstate(generators["python"])
        np.random.set_state(generators["numpy"])  # noqa: NPY002
        torch.set_rng_state(generators["torch"])
        self.model.action_space.np_random.bit_generator.state = generators["actions"]
        for name, drawn in self._state.get("exploration", {}).items():
            setattr(_explorer(self.model), name, drawn)


def _explorer(model: Any) -> Any:
    """Return the distribution that draws exploration noise."""
    return getattr(model, "actor", model.policy).action_dist


def _layer(envs: Any, kind: type) -> Any:
    """Return the wrapper of a kind around or in a `VecEnv`."""
    while not isinstance(envs, kind):
        envs = envs.venv
    return envs


def _stateful(many: Any) -> list[Any]:
    """Return the objects that have the states of a `VecEnv` without wrappers: one environment for all, or
    each."""
    from hoof_env.envs.sb3 import Sb3VecEnv

    return [many.envs] if isinstance(many, Sb3VecEnv) else [env.unwrapped for env in many.envs]


def _environment_states(envs: Any) -> list[Any] | None:
    """Return the states of the environments, None if one has none."""
    try:
        return [env.get_state() for env in _stateful(envs.unwrapped)]
    except AttributeError:
        return None


def _flush(path: Path) -> None:
    """Flush a file or a folder to the disk before anything relies on it."""
    if path.is_dir() and os.name != "posix":  # Windows cannot flush a folder
        return
    number = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(number)
    finally:
        os.close(number)
