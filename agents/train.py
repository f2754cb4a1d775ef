"""Train an agent with Stable-Baselines3.

    python -m agents.train                                  the full training of hoof_env/HorseLeg-v0
    python -m agents.train --steps 300000                   a quick one
    python -m agents.train --out runs/mine --resume         go on where it was stopped or killed, else start
    tensorboard --logdir runs                               watch it

Ctrl-C stops after the current rollout and keeps the model and a checkpoint; pressed twice it keeps only
checkpoints. agents/runs.py says what a run folder holds. The same seed, arguments, machine and versions give
the same run, resumed or not (agents/checkpoints.py says where that ends).
"""

from __future__ import annotations

import warnings
from contextlib import closing
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from agents import checkpoints, runs
from agents.command import check_threads, parse, parse_pairs, run
from agents.settings import (
    FOLDER,
    TrainingArgs,
    algorithm_class,
    load_settings,
    model_arguments,
    normalize_arguments,
)
from hoof_env.errors import HoofEnvError, OutputError, ParameterError, check_number
from hoof_env.policies.record import SCALES, misfits
from hoof_env.policies.saved import WEIGHTS


@dataclass(frozen=True)
class Args(TrainingArgs):
    """Arguments of the command."""

    seed: int = 0
    """of the environments, the network and the sampling"""
    n_envs: int | None = None
    """environments stepped side by side; otherwise n_envs of the hyperparameter file"""
    hyperparams: Path | None = None
    """YAML file in rl-baselines3-zoo's format; otherwise agents/hyperparams/ALGO.yml"""
    out: Path | None = None
    """run folder; otherwise runs/ALGO-ENV-sSEED-TIME"""
    resume: bool = False
    """go on with the run in --out, which the same command began; without one there, start it. Its checkpoints
    are pickles, which can run any code: resume only runs that you trust"""
    checkpoint_every: float = 30.0
    """seconds between two checkpoints, which stand between two rollouts; the last two stay; 0: none"""
    max_minutes: float | None = None
    """stop after this time, counted from this start, even if steps are left"""
    device: str = "cpu"
    """torch device; small networks are fastest on the CPU"""
    torch_threads: int = 1
    """threads of torch and of the environments; on a busy machine more than one are slower"""


@dataclass(frozen=True)
class Trained:
    """Result of a training; `stopped_by` is the number of the signal that ended it, None if it is through."""

    folder: Path
    steps: int
    seconds: float
    stopped_by: int | None  # signal number

    @property
    def rate(self) -> float:
        """Steps per second."""
        return self.steps / max(self.seconds, 1e-9)

    def __str__(self) -> str:
        pace = f"{self.steps:,} steps in {self.seconds:.0f} s ({self.rate:,.0f} steps/s)"
        return f"{pace}; model kept in {self.folder}"


def train(args: Args, *also: Any) -> Trained:
    """Train as `args` say and fill the run folder; SIGINT, SIGTERM and the time limit end it early.

    Args:
        args: the arguments of the command.
        *also: more callbacks of Stable-Baselines3; on a resume they begin anew.

    Raises:
        ParameterError: something does not fit, or it is not the run to go on with.
        DataFileError: a file of settings or a checkpoint cannot be read.
        OutputError: the folder cannot be written, holds a run already, or another process trains there.
        DivergedError: a loss or the policy is not finite any more.
    """
    env_kwargs, settings = checked(args)
    check_threads(args.torch_threads)
    name = args.env_id.rpartition("/")[2]
    folder = args.out or Path("runs", f"{args.algo}-{name}-s{args.seed}-{datetime.now():%Y%m%d-%H%M%S}")
    record = make_record(args, env_kwargs)
    try:
        with runs.alone(folder):
            return _train(args, folder, record, env_kwargs, settings, also)
    except HoofEnvError:
        # An OutputError is an OSError, too, and says more than the one below
        raise
    except OSError as error:  # a full disk, for example, at monitor.csv
        raise OutputError(f"cannot write to {str(folder)!r}: {error.strerror or error}") from None


def _train(
    args: Args,
    folder: Path,
    record: dict[str, Any],
    env_kwargs: dict[str, Any],
    settings: dict[str, Any],
    also: tuple[Any, ...],
) -> Trained:
    """Train as `train` does, in a folder that is locked."""
    earlier = find_earlier(args, folder, record, settings)
    # The same command again: nothing to do
    if finished := earlier.get("finished"):
        checkpoints.tidy(folder, keep=0)  # a process that was killed may have left them
        return Trained(folder, finished["steps"], finished["seconds"], None)
    checkpoints.tidy(folder)
    start = next(iter(checkpoints.checkpoints(folder)), None) if earlier else None
    if start:
        warn_of_bits(folder, earlier, record)
        record = {**earlier, "resumed": [*earlier.get("resumed", []), int(start.name)]}
    algorithm_class(args.algo)  # imports its library, which takes seconds
    import torch

    if args.device.startswith("cuda") and not torch.cuda.is_available():  # the library would take the CPU
        raise ParameterError(f"device: expected one that torch finds here, got {args.device!r}")
    torch.set_num_threads(args.torch_threads)
    config = yaml.safe_dump({args.env_id: settings}, sort_keys=False)  # the library adds to policy_kwargs
    threads = args.torch_threads  # threads of the environments, too: they change no bit there
    envs = many = runs.make_vec_env(args.env_id, settings["n_envs"], threads, **env_kwargs)
    try:
        resumed = None
        if start:
            warnings.warn(f"{start} holds pickles, which can run any code: trusted?", stacklevel=2)
            resumed = checkpoints.Resumed(start, algorithm_class(args.algo), many, args.device)
        model = resumed.model if resumed else make_model(args, settings, many)
        envs = model.env
        # Nothing is refused any more
        runs.write_record(folder, record)
        runs.write_text(folder / runs.CONFIG, config)
        if not resumed:
            checkpoints.write_episodes(envs, folder / runs.MONITOR)
        # Curves of steps that are trained again are hidden
        model.set_logger(make_logger(folder / "tensorboard", model.num_timesteps + 1 if resumed else 0))
        return learn(args, folder, record, settings["n_timesteps"], model, resumed, also)
    finally:
        envs.close()


def learn(
    args: Args,
    folder: Path,
    record: dict[str, Any],
    steps: int,
    model: Any,
    resumed: checkpoints.Resumed | None,
    also: tuple[Any, ...],
) -> Trained:
    """Train the model until it is through or asked to end, and save it."""
    from stable_baselines3.common.callbacks import CallbackList

    from agents.watch import EndedError, Watch, check_divergence, diverged, stop_on_signals

    watch = Watch(folder, steps, args.checkpoint_every, args.max_minutes, resumed)
    callbacks = CallbackList([watch, *also])
    is_through = False
    with closing(watch), stop_on_signals(watch):
        try:
            model.learn(steps - model.num_timesteps, callbacks, reset_num_timesteps=not resumed)
            is_through = True
        except EndedError:
            callbacks.on_training_end()
        except (ValueError, RuntimeError) as error:
            # Torch or the environment has refused numbers that are not finite
            check_divergence(model, folder)
            if "of distribution" in str(error):
                raise diverged(model, folder, "the policy's actions have no distribution") from None
            if "without overflow" in str(error):
                raise diverged(model, folder, str(error)) from None
            raise
        trained = Trained(folder, model.num_timesteps, watch.seconds, watch.stopped_by)
        check_divergence(model, folder)
        runs.save_model(model, folder / runs.MODEL)
        if is_through:
            record["finished"] = {"steps": trained.steps, "seconds": round(trained.seconds, 3)}
            runs.write_record(folder, record)
            checkpoints.tidy(folder, keep=0)
    return trained


def checked(args: Args) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return arguments of the environment and settings; all are checked before anything slow starts or is
    written."""
    env_kwargs = parse_pairs("--env-kwargs", args.env_kwargs)
    settings = load_settings(args.hyperparams or FOLDER / f"{args.algo}.yml", args.env_id)
    settings |= parse_pairs("--params", args.params)
    overrides = {"n_timesteps": args.steps, "n_envs": args.n_envs}
    settings |= {key: value for key, value in overrides.items() if value is not None}
    settings["n_envs"] = int(check_number("n_envs", settings["n_envs"], low=1, high=4096))
    settings["n_timesteps"] = int(check_number("steps", settings["n_timesteps"], low=1))
    check_number("seed", args.seed, low=0)
    check_number("checkpoint_every", args.checkpoint_every, low=0)
    normalize_arguments(settings)
    if args.max_minutes is not None:
        check_number("max_minutes", args.max_minutes, low=0.0, exclusive_low=True)
    if args.resume and args.out is None:
        raise ParameterError("--resume: expected the folder of the run, too: --out FOLDER")
    return env_kwargs, settings


def make_record(args: Args, env_kwargs: dict[str, Any]) -> dict[str, Any]:
    """Return the content of run.json, without "finished"; `ParameterError` if the environment cannot be
    trained on."""
    with runs.make_env(args.env_id, **env_kwargs) as env:
        if hasattr(env.unwrapped, "reward_space"):
            raise ParameterError(
                f"{args.env_id}: expected one number for a reward, got a vector; train on an environment "
                "that adds it up by reward_weights"
            )
        about = runs.describe_env(env)
        runs.warm_up(env)
    return {
        "env_id": args.env_id,
        "env_kwargs": env_kwargs,
        "algo": args.algo,
        **about,
        "seed": args.seed,
        "args": {
            key: str(value) if isinstance(value, Path) else value
            for key, value in asdict(args).items()
            if key != "out"  # the run is where this file is
        },
        "command": runs.command(),
        "versions": runs.versions(),
    }


def find_earlier(
    args: Args, folder: Path, record: dict[str, Any], settings: dict[str, Any]
) -> dict[str, Any]:
    """Return the record of the run in `folder` to go on with, empty if there is none.

    Raises:
        OutputError: there is a run, but none to go on with.
        ParameterError: it was begun otherwise.
    """
    earlier = runs.read_record(folder)
    present = [name for name in (*runs.FILES, runs.STATISTICS, runs.CHECKPOINTS) if (folder / name).exists()]
    if present and not earlier:
        raise OutputError(
            f"{folder}: expected a new folder or one of a run, found {', '.join(present)} and no run.json; "
            "choose another folder"
        )
    held = {runs.MODEL, WEIGHTS, runs.CHECKPOINTS} & {*present}
    if held and not args.resume:
        raise OutputError(
            f"{folder} already holds a trained model; choose another folder, remove that one, or go on with "
            "its run by --resume"
        )
    if not args.resume or not held:
        return {}
    # Everything that decides what is learnt
    keys = ("env_id", "env_kwargs", "settings", "observation_space", "action_space", "algo", "seed")
    pairs = {key: (earlier.get(key), record.get(key)) for key in keys}
    # Another version may have other rewards or observations
    pairs["hoof-env"] = earlier.get("versions", {}).get("hoof-env"), record["versions"].get("hoof-env")
    used = load_settings(folder / runs.CONFIG, args.env_id)
    pairs |= {key: (used.get(key), settings.get(key)) for key in {**used, **settings}}
    unlike = [
        f"{key}: {theirs!r} there, {ours!r} here" for key, (theirs, ours) in pairs.items() if theirs != ours
    ]
    unlike += misfits(earlier, {key: record[key] for key in ("observation_names", SCALES) if key in record})
    if unlike:
        raise ParameterError(f"--resume: expected what {folder} was begun with; {'; '.join(unlike)}")
    # A model without checkpoints cannot go on
    kept = earlier.get("finished") or checkpoints.checkpoints(folder)
    if not kept and earlier.get("args", {}).get("checkpoint_every") == 0:  # it would be lost
        raise OutputError(f"--resume: {folder} holds a model, but no checkpoint to go on from")
    return earlier


def warn_of_bits(folder: Path, earlier: dict[str, Any], record: dict[str, Any]) -> None:
    """Warn of differences under which a run may go on, but not with the same bits."""
    keys = ("python", "platform", *runs.PACKAGES, "torch_threads", "device")
    theirs, ours = (
        {**record_of.get("versions", {}), **record_of.get("args", {})} for record_of in (earlier, record)
    )
    pairs = {key: (theirs[key], ours.get(key)) for key in keys if key in theirs}
    unlike = [f"{key} {then} there, {now} here" for key, (then, now) in pairs.items() if then != now]
    if unlike:
        warnings.warn(f"--resume: {folder} goes on, but with other bits: {'; '.join(unlike)}", stacklevel=2)


def make_model(args: Args, settings: dict[str, Any], many: Any) -> Any:
    """Return the algorithm as `settings` build it, on environments with a `VecMonitor` that writes nothing
    yet."""
    from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecNormalize

    envs: VecEnv = VecMonitor(many)
    normalize = normalize_arguments(settings)
    arguments = model_arguments(settings, int(np.prod(envs.action_space.shape or 1)))
    try:
        # Outside of the monitor, which must see the rewards as they are
        envs = envs if normalize is None else VecNormalize(envs, **normalize)
        if "buffer_size" in arguments:  # more would stand empty in every checkpoint
            most = settings["n_timesteps"] + settings["n_envs"]
            arguments["buffer_size"] = min(arguments["buffer_size"], most)
        return algorithm_class(args.algo)(env=envs, seed=args.seed, device=args.device, **arguments)
    except (TypeError, ValueError, AssertionError, RuntimeError) as error:  # torch's, for the device
        raise ParameterError(
            f"hyperparameters of {args.algo} for {args.env_id} on device {args.device!r}: {error}"
        ) from None


def make_logger(folder: Path, hidden: int) -> Any:
    """Return a logger for TensorBoard; of what an earlier process logged, steps from `hidden` on are not
    shown."""
    from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat
    from torch.utils.tensorboard import SummaryWriter

    curves = TensorBoardOutputFormat(str(folder))
    curves.writer.close()
    curves.writer = SummaryWriter(str(folder), purge_step=hidden)
    return Logger(str(folder), [curves])


def main(argv: list[str] | None = None) -> int:
    """Train, and return the exit code."""
    trained = train(parse(Args, argv, "python -m agents.train", __doc__))
    print(f"{'interrupted: ' if trained.stopped_by else ''}{trained}")
    return 128 + trained.stopped_by if trained.stopped_by else 0


if __name__ == "__main__":
    run(main)
