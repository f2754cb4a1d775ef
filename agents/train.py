"""Train an agent with Stable-Baselines3.

    python -m agents.train                                  the full training of hoof_env/HorseLeg-v0
    python -m agents.train --steps 300000                   a quick one
    tensorboard --logdir runs                               watch it

Ctrl-C stops after the current step and keeps the model; pressed twice it stops at once and keeps only
checkpoints. What a run folder holds is written in agents/runs.py. The same seed, arguments, machine and
versions give the same run.
"""

from __future__ import annotations

import json
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from types import FrameType
from typing import Any, Literal

import numpy as np
import yaml

from agents import runs
from agents.command import parse_pairs, run
from agents.settings import FOLDER, algorithm_class, load_settings, model_arguments
from hoof_env._output import check_folder
from hoof_env.errors import OutputError, ParameterError, check_number


@dataclass(frozen=True)
class Args:
    env_id: str = "hoof_env/HorseLeg-v0"
    """registered environment; module:id imports the module first"""
    algo: Literal["ppo", "sac", "td3", "tqc"] = "ppo"
    """algorithm of Stable-Baselines3 or sb3-contrib, with its file in agents/hyperparams"""
    seed: int = 0
    """of the environments, the network and the sampling"""
    steps: int | None = None
    """environment steps in all, rounded up to whole rollouts (n_steps times n_envs); otherwise n_timesteps
    of the hyperparameter file"""
    n_envs: int | None = None
    """environments stepped side by side; otherwise n_envs of the hyperparameter file"""
    env_kwargs: tuple[str, ...] = ()
    """arguments of the environment: key=value ..., or one JSON object"""
    params: tuple[str, ...] = ()
    """hyperparameters to change: key=value ..., or one JSON object"""
    hyperparams: Path | None = None
    """YAML file in rl-baselines3-zoo's format; otherwise agents/hyperparams/ALGO.yml"""
    out: Path | None = None
    """run folder; otherwise runs/ALGO-ENV-sSEED-TIME"""
    checkpoint_every: int = 250_000
    """steps between two checkpoints; 0: none"""
    max_minutes: float | None = None
    """stop after this time even if steps are left"""
    device: str = "cpu"
    """torch device; small networks are fastest on the CPU"""
    torch_threads: int = 1
    """threads of torch"""


@dataclass(frozen=True)
class Trained:
    """Where a training ended."""

    folder: Path
    steps: int
    seconds: float
    stopped_by: int | None  # signal number

    @property
    def rate(self) -> float:
        """Steps per second."""
        return self.steps / max(self.seconds, 1e-9)

    def __str__(self) -> str:
        return (
            f"{self.steps:,} steps in {self.seconds:.0f} s ({self.rate:,.0f} steps/s); "
            f"model kept in {self.folder}"
        )


def train(args: Args, *also: Any) -> Trained:
    """Train as `args` say and fill the run folder. SIGINT, SIGTERM and the time limit end it early.

    Args:
        args: see there.
        also: more callbacks of Stable-Baselines3.

    Raises:
        ParameterError, DataFileError: the arguments, the environment or the hyperparameters do not fit.
        OutputError: the run folder cannot be written or already holds a run.
    """
    # What is asked for: all checked before anything slow starts or any file is written
    env_kwargs = parse_pairs("--env-kwargs", args.env_kwargs)
    settings = load_settings(args.hyperparams or FOLDER / f"{args.algo}.yml", args.env_id)
    settings |= parse_pairs("--params", args.params)
    settings |= {"n_timesteps": args.steps} if args.steps is not None else {}
    settings |= {"n_envs": args.n_envs} if args.n_envs is not None else {}
    n_envs = int(check_number("n_envs", settings["n_envs"], low=1, high=4096))
    steps = int(check_number("steps", settings["n_timesteps"], low=1))
    if args.seed < 0:
        raise ParameterError(f"seed: expected 0 or more, got {args.seed}")
    check_number("checkpoint_every", args.checkpoint_every, low=0)
    check_number("torch_threads", args.torch_threads, low=1)
    if args.max_minutes is not None:
        check_number("max_minutes", args.max_minutes, low=0.0, exclusive_low=True)
    name = args.env_id.rpartition("/")[2]
    folder = args.out or Path("runs", f"{args.algo}-{name}-s{args.seed}-{datetime.now():%Y%m%d-%H%M%S}")
    if (folder / "model.zip").exists() or (folder / "checkpoints").exists():
        raise OutputError(
            f"{folder} already holds a trained model; choose another folder, or remove that one"
        )
    with runs.make_env(args.env_id, **env_kwargs) as env:
        spaces = runs.describe_spaces(env)
        runs.warm_up(env)
    check_folder(folder)

    # Importing torch takes seconds: only now
    import torch
    from stable_baselines3.common.callbacks import CallbackList
    from stable_baselines3.common.logger import configure
    from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecNormalize

    # The run folder
    record = {
        "env_id": args.env_id,
        "env_kwargs": env_kwargs,
        "algo": args.algo,
        **spaces,
        "seed": args.seed,
        "args": {
            key: str(value) if isinstance(value, Path) else value
            for key, value in asdict(args).items()
            if key != "out"  # the run is where this file is
        },
        "command": runs.command(),
        "versions": runs.versions(),
    }
    runs.write_text(folder / "run.json", json.dumps(record, indent=2) + "\n")
    runs.write_text(folder / "config.yml", yaml.safe_dump({args.env_id: settings}, sort_keys=False))

    torch.set_num_threads(args.torch_threads)
    many = runs.make_vec_env(args.env_id, n_envs, **env_kwargs)
    envs: VecEnv = VecMonitor(many, str(folder / "monitor.csv"))
    normalize = settings.get("normalize", False)
    if normalize:
        arguments = {"gamma": settings.get("gamma", 0.99)} | (
            normalize if isinstance(normalize, dict) else {}
        )
        envs = VecNormalize(envs, **arguments)
    try:
        algorithm = algorithm_class(args.algo)
        arguments = model_arguments(settings, int(np.prod(envs.action_space.shape or 1)))
        try:
            model = algorithm(env=envs, seed=args.seed, device=args.device, **arguments)
        except (TypeError, ValueError, AssertionError, RuntimeError) as error:  # torch's, for the device
            said = f"hyperparameters of {args.algo} for {args.env_id} on device {args.device!r}: {error}"
            raise ParameterError(said) from None
        model.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))

        # Train
        watch = make_watch(folder, steps, args.checkpoint_every, args.max_minutes)
        started = time.monotonic()
        with stop_on_signals(watch):
            model.learn(steps, callback=CallbackList([watch, *also]))
            seconds = time.monotonic() - started
            runs.save_model(model, folder / "model.zip")
        return Trained(folder, model.num_timesteps, seconds, watch.stopped_by)
    finally:
        envs.close()


def make_watch(folder: Path, steps: int, checkpoint_every: int, max_minutes: float | None) -> Any:
    """The callback that shows progress, keeps checkpoints, logs gait figures and ends the training early."""
    from stable_baselines3.common.callbacks import BaseCallback
    from tqdm import tqdm

    class Watch(BaseCallback):
        stopped_by: int | None = None

        def _on_training_start(self) -> None:
            self.deadline = time.monotonic() + 60 * max_minutes if max_minutes else np.inf
            self.next_checkpoint = checkpoint_every or np.inf
            rest = 0.3 if sys.stderr.isatty() else 10.0  # seconds between two lines, where each is kept
            self.bar = tqdm(total=steps, unit=" steps", unit_scale=True, smoothing=0.1, mininterval=rest)
            self.summaries: list[dict[str, float]] = []

        def _on_step(self) -> bool:
            self.bar.update(self.training_env.num_envs)
            for index in np.flatnonzero(self.locals["dones"]):
                self.summaries.append(self.locals["infos"][index].get("episode_summary", {}))
            if self.num_timesteps >= self.next_checkpoint:
                self.next_checkpoint += checkpoint_every
                runs.save_model(self.model, folder / "checkpoints" / str(self.num_timesteps) / "model.zip")
            return self.stopped_by is None and time.monotonic() < self.deadline

        def _on_rollout_end(self) -> None:
            if self.model.ep_info_buffer:
                returns = [episode["r"] for episode in self.model.ep_info_buffer]
                self.bar.set_postfix_str(f"return {np.mean(returns):.1f}", refresh=False)
            for summary in self.summaries:
                for key, value in summary.items():
                    if np.isfinite(value):  # the cost of transport is infinite without progress
                        self.logger.record_mean(f"gait/{key}", value)
            self.summaries.clear()

        def _on_training_end(self) -> None:
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


def main(argv: list[str] | None = None) -> int:
    import tyro

    trained = train(tyro.cli(Args, args=argv, prog="python -m agents.train", description=__doc__))
    print(f"{'interrupted: ' if trained.stopped_by else ''}{trained}")
    return 128 + trained.stopped_by if trained.stopped_by else 0


if __name__ == "__main__":
    run(main)
