"""What looks after a training while it runs: progress, checkpoints, signals, the time limit, divergence."""

from __future__ import annotations

import math
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from agents import checkpoints
from hoof_env.errors import HoofEnvError


class DivergedError(HoofEnvError, ArithmeticError):
    """A loss or a parameter of the policy is out of all bounds: what follows is worth nothing."""


class EndedError(Exception):
    """The training was asked to end; it stands between two rollouts."""


LARGEST = 1e10
"""No parameter of a policy that learns comes near it."""


def divergence(model: Any) -> str:
    """Which loss or parameter of a model is out of all bounds; empty if none is."""
    for name, value in model.logger.name_to_value.items():
        if "loss" in name and not math.isfinite(value):
            return f"{name} is {value}"
    for name, parameter in model.policy.named_parameters():
        if not float(parameter.detach().abs().max()) < LARGEST:  # nor NaN
            return f"the policy's {name} holds {float(parameter.detach().abs().max()):g}"
    return ""


def check_divergence(model: Any, folder: Path) -> None:
    """Raise `DivergedError`, which says where and names what is left, if losses or policy diverged."""
    if reason := divergence(model):
        raise diverged(model, folder, reason)


def diverged(model: Any, folder: Path, reason: str) -> DivergedError:
    """The error that says where a training diverged, why, and what is left of it."""
    kept = checkpoints.checkpoints(folder)[:1]
    left = f"the last good checkpoint is {kept[0]}" if kept else "there is no checkpoint yet"
    return DivergedError(
        f"the training diverged before step {model.num_timesteps:,}: {reason}; {left}; try a lower "
        "learning rate or smaller updates"
    )


def make_watch(
    folder: Path,
    steps: int,
    checkpoint_every: float,
    max_minutes: float | None,
    resumed: checkpoints.Resumed | None,
) -> Any:
    """The callback. Between two rollouts it checks the model, keeps a checkpoint when one is due, and ends
    the training by `EndedError`; it shows progress and logs gait figures."""
    from stable_baselines3.common.callbacks import BaseCallback
    from tqdm import tqdm

    class Watch(BaseCallback):
        stopped_by: int | None = None
        bar: Any = None
        earlier = resumed.seconds if resumed else 0.0

        @property
        def seconds(self) -> float:
            """Of training, before a resume too."""
            return self.earlier + time.monotonic() - self.started

        def _on_training_start(self) -> None:
            self.started = self.last = time.monotonic()
            rest = 0.3 if sys.stderr.isatty() else 10.0  # seconds between two lines, where each is kept
            self.bar = tqdm(
                total=steps, initial=self.num_timesteps, unit=" steps", unit_scale=True, smoothing=0.1,
                mininterval=rest,
            )  # fmt: skip
            self.summaries: list[dict[str, float]] = []
            if resumed:
                resumed.start()

        def _on_rollout_start(self) -> None:
            if resumed and self.num_timesteps == self.model._num_timesteps_at_start:
                resumed.start_rollout()
            check_divergence(self.model, folder)
            late = max_minutes is not None and time.monotonic() - self.started >= 60 * max_minutes
            end = self.stopped_by is not None or late
            due = end or time.monotonic() - self.last >= checkpoint_every
            if checkpoint_every and due and self.num_timesteps > self.model._num_timesteps_at_start:
                checkpoints.save(self.model, folder, self.seconds)
                self.last = time.monotonic()
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
            if self.bar is not None:
                self.bar.close()

    return Watch()


@contextmanager
def stop_on_signals(watch: Any) -> Iterator[None]:
    """Let the first SIGINT or SIGTERM end the training in good order; the second acts as it always does."""
    previous: dict[int, Any] = {}

    def stop(number: int, frame: FrameType | None) -> None:
        watch.stopped_by = number
        restore()

    def restore() -> None:
        for number, handler in previous.items():
            signal.signal(number, handler)

    for number in (signal.SIGINT, signal.SIGTERM):
        previous[number] = signal.signal(number, stop)
    try:
        yield
    finally:
        restore()
