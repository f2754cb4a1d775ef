"""Callbacks of a training: progress, checkpoints, signals, the time limit, divergence, and scores on the
way."""

from __future__ import annotations

import math
import signal
import sys
import threading
import time
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

from agents import checkpoints, runs
from hoof_env.errors import HoofEnvError
from hoof_env.evaluation.episodes import score_vector


class DivergedError(HoofEnvError, ArithmeticError):
    """Error of a loss or a parameter of the policy that is out of all bounds: later results are worthless."""


class EndedError(Exception):
    """Signal that the training was asked to end; it is between two rollouts."""


LARGEST = 1e10  # no parameter of a policy that learns comes near it


def check_divergence(model: Any, folder: Path) -> None:
    """Raise `DivergedError` if a loss or a parameter is out of all bounds."""
    for name, value in model.logger.name_to_value.items():
        if "loss" in name and not math.isfinite(value):
            raise diverged(model, folder, f"{name} is {value}")
    for name, parameter in model.policy.named_parameters():
        highest = float(parameter.detach().abs().max())
        if not highest < LARGEST:  # nor NaN
            raise diverged(model, folder, f"the policy's {name} holds {highest:g}")


def diverged(model: Any, folder: Path, reason: str) -> DivergedError:
    """Return the error with the step and the reason of a divergence, and the last good checkpoint."""
    kept = checkpoints.checkpoints(folder)[:1]
    left = f"the last good checkpoint is {kept[0]}" if kept else "there is no checkpoint yet"
    return DivergedError(
        f"the training diverged before step {model.num_timesteps:,}: {reason}; {left}; try a lower "
        "learning rate or smaller updates"
    )


class Watch(BaseCallback):
    """Callback that supervises a training.

    Between two rollouts it checks the model, keeps a checkpoint when one is due, `checkpoint_every` seconds
    after the last (0: none), and ends the training by `EndedError`; it shows progress and logs gait figures.
    """

    def __init__(
        self,
        folder: Path,
        steps: int,
        checkpoint_every: float,
        max_minutes: float | None,
        resumed: checkpoints.Resumed | None,
    ) -> None:
        super().__init__()
        self.folder = folder
        self.steps = steps
        self.resumed = resumed
        self.checkpoint_every = checkpoint_every
        self.max_seconds = math.inf if max_minutes is None else 60 * max_minutes
        self.stopped_by: int | None = None
        self.bar: Any = None

    @property
    def seconds(self) -> float:
        """Seconds of training so far, those before a resume included."""
        return (self.resumed.seconds if self.resumed else 0.0) + time.monotonic() - self.started

    def _on_training_start(self) -> None:
        self.started = self.last_kept = time.monotonic()
        interval = 0.3 if sys.stderr.isatty() else 10.0  # seconds between two lines, where each is kept
        self.bar = tqdm(
            total=self.steps,
            initial=self.num_timesteps,
            unit=" steps",
            unit_scale=True,
            smoothing=0.1,
            mininterval=interval,
        )
        self.summaries: list[dict[str, float]] = []
        if self.resumed:
            self.resumed.start()

    def _on_rollout_start(self) -> None:
        is_first = self.num_timesteps == self.model._num_timesteps_at_start
        # The library has drawn from the generators while it set up
        if self.resumed and is_first:
            self.resumed.start_rollout()
        check_divergence(self.model, self.folder)
        # Only here, between two rollouts, is a checkpoint complete
        end = self.stopped_by is not None or time.monotonic() - self.started >= self.max_seconds
        due = end or time.monotonic() - self.last_kept >= self.checkpoint_every
        if self.checkpoint_every and due and not is_first:
            checkpoints.save(self.model, self.folder, self.seconds)
            self.last_kept = time.monotonic()
        if end:
            raise EndedError

    def _on_step(self) -> bool:
        self.bar.update(self.training_env.num_envs)
        for index in np.flatnonzero(self.locals["dones"]):
            self.summaries.append(self.locals["infos"][index].get("episode_summary", {}))
        return True

    def _on_rollout_end(self) -> None:
        if self.model.ep_info_buffer:
            returns = [episode["r"] for episode in self.model.ep_info_buffer]
            self.bar.set_postfix_str(f"return {np.mean(returns):.1f}", refresh=False)
        for summary in self.summaries:
            for key, value in summary.items():
                if np.isfinite(value):  # the cost of transport is infinite without progress
                    self.logger.record_mean(f"gait/{key}", value)
        self.summaries.clear()

    def close(self) -> None:
        """Close the bar."""
        if self.bar is not None:
            self.bar.close()


@contextmanager
def stop_on_signals(watch: Watch) -> Iterator[None]:
    """Let the first SIGINT or SIGTERM end the training in good order; the second acts as it always does. In a
    thread other than the main one, in which signals cannot be caught, nothing changes."""
    previous: dict[int, Any] = {}

    def stop(number: int, frame: FrameType | None) -> None:
        watch.stopped_by = number
        restore()

    def restore() -> None:
        for number, handler in previous.items():
            signal.signal(number, handler)

    # Python sets handlers in the main thread only
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM):
            previous[number] = signal.signal(number, stop)
    try:
        yield
    finally:
        restore()


class Scorer(BaseCallback):
    """Callback that scores the policy in training on the same episodes each time: between two rollouts
    whenever `every` more steps are done, and at the end. A subclass implements `keep`.

    Attributes:
        wall_s: wall time of training alone, scores left out [s]; a subclass that resumes sets it.
        cpu_s: processor time of the same [s].
    """

    def __init__(self, env_id: str, env_kwargs: Mapping[str, Any], seeds: Sequence[int], every: int) -> None:
        super().__init__()
        self.env_id = env_id
        self.env_kwargs = env_kwargs
        self.seeds = seeds
        self.every = every
        self.wall_s = self.cpu_s = 0.0

    @abstractmethod
    def keep(self, episodes: list[dict[str, float]]) -> None:
        """Store or report a score; `episodes` are as `play` returns them."""

    def score(self) -> None:
        """Score the policy, with the clock stopped."""
        self.wall_s += time.monotonic() - self._since[0]
        self.cpu_s += time.process_time() - self._since[1]
        self.scored_at = self.num_timesteps
        normalize = self.model.get_vec_normalize_env()
        # As the policy will act when it is loaded
        policy = runs.TrainedPolicy(self.model, normalize.normalize_obs if normalize is not None else None)
        self.keep(score_vector(policy, self.env_id, self.seeds, **self.env_kwargs))
        self._start_clock()

    def _start_clock(self) -> None:
        self._since = time.monotonic(), time.process_time()

    def _on_training_start(self) -> None:
        self.scored_at = self.num_timesteps
        self._start_clock()

    def _on_rollout_start(self) -> None:
        if self.num_timesteps // self.every > self.scored_at // self.every:
            self.score()

    def _on_training_end(self) -> None:
        if self.num_timesteps > self.scored_at:
            self.score()

    def _on_step(self) -> bool:
        return True
