"""Trainings of `agents.train` on a Ray cluster: seeds and sweeps.

    python -m agents.distribute trials --seeds 5                                      five seeds
    python -m agents.distribute trials --seeds 3 --space 'learning_rate=[1e-3,5e-4]'  a sweep

Without --address a cluster of this machine's cores is made and ended with the command. A worker that dies is
replaced and its trial goes on from its last checkpoint. Ctrl-C keeps what is there; the same command, given
again, runs what is missing. docs/agents.md says how to use a real cluster and where results land.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import json
import logging
import os
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from tyro.conf import Positional

from agents import runs
from agents.command import parse, parse_pairs, run
from agents.settings import ENV, TrainingArgs, algorithm_class
from agents.train import Args as TrainArgs
from agents.train import checked
from hoof_env.errors import HoofEnvError, OutputError, ParameterError, check_number

ROOT = Path(__file__).resolve().parents[1]

SHIPPED = {
    "working_dir": str(ROOT),
    "excludes": ["/.?*", "/runs", "/docs", "/dist", "/build", "__pycache__", "*.pyc"],
}
"""Runtime environment of trials on a cluster: the checkout, without what no training needs."""


@dataclass(frozen=True)
class Cluster:
    """Arguments of every command on a cluster."""

    what: Positional[Literal["trials"]] = "trials"
    """trainings, each a trial of Ray Tune"""
    address: str | None = None
    """a running Ray cluster: auto (this machine is part of it), host:port or ray://host:10001"""
    cpus: int | None = None
    """of the cluster that is made where no address is given; otherwise all"""
    runtime_env: tuple[str, ...] = ()
    """more for Ray's runtime_env on a cluster: key=value ..., or one JSON object, as
    '{"pip": ["gymnasium", "stable-baselines3"]}'"""
    retries: int = 3
    """of each trial after its worker died or failed"""
    out: str = "runs/distribute"
    """folder that all machines see, or s3://... and the like; each experiment has its own folder there"""


@dataclass(frozen=True)
class Trials(Cluster, TrainingArgs):
    """Arguments of the command."""

    seeds: int = 1
    """trainings of each setting, from seed 0 on"""
    space: tuple[str, ...] = ()
    """what is varied: key=[JSON, ...] runs all; a key is a hyperparameter, or env.ARGUMENT of the
    environment"""
    report_every: int = 100_000
    """steps between two scores, which are checkpoints as well"""
    cpus_per_trial: int = 1
    """cores that a trial asks of the cluster, and threads of torch"""


def parse_space(items: Sequence[str]) -> dict[str, list[Any]]:
    """Parse `key=[...]`; `ParameterError` if an item is something else or a key comes twice.

    >>> parse_space(["n_steps=[16, 32]", 'env.trunk=["rail"]'])
    {'n_steps': [16, 32], 'env.trunk': ['rail']}
    """
    space: dict[str, list[Any]] = {}
    for item in items:
        key, _, text = item.partition("=")
        values = parse_pairs("--space", [f"values={text}"])["values"]
        if not (key and values and isinstance(values, list)):
            raise ParameterError(f"--space: expected key=[JSON, ...], got {item!r}; agents.tune searches")
        # The later one would replace the earlier silently
        if key in space:
            raise ParameterError(f"--space: expected each key once, got {key} twice")
        space[key] = values
    return space


def check_keys(keys: Iterable[str], algo: str, settings: Iterable[str]) -> None:
    """Refuse keys that are neither hyperparameters of `algo`, nor in its `settings`, nor an environment's."""
    known = {*inspect.signature(algorithm_class(algo)).parameters, *settings, "normalize", "n_envs"}
    # Arguments that the command itself sets
    known -= {"env", "seed", "device", "_init_setup_model", "verbose", "tensorboard_log", "n_timesteps"}
    for key in keys:
        if key not in known and not key.startswith(ENV):
            raise ParameterError(
                f"--space: expected a hyperparameter of {algo} ({', '.join(sorted(known))}) or {ENV}ARGUMENT "
                f"of the environment, got {key!r}"
            )


def prepare(args: Trials) -> dict[str, Any]:
    """Return the parameter space of `args`, checked: constants, lists of what varies and of seeds."""
    for name in ("seeds", "report_every", "cpus_per_trial"):
        check_number(name, getattr(args, name), low=1)
    algorithm_class(args.algo)
    fixed: dict[str, Any] = {"env_id": args.env_id, "algo": args.algo, "torch_threads": args.cpus_per_trial}
    training = TrainArgs(**fixed, steps=args.steps, env_kwargs=args.env_kwargs, params=args.params)
    env_kwargs, settings = checked(training)
    space = parse_space(args.space)
    check_keys(space, args.algo, settings)
    with runs.make_env(args.env_id, **env_kwargs) as env:
        # Once here, not in every worker at the same time
        runs.warm_up(env)  # kernels are compiled before workers want them
    for key, values in space.items():
        # A value that no environment takes fails here, not in a worker
        for value in values if key.startswith(ENV) else ():
            runs.make_env(args.env_id, **env_kwargs | {key.removeprefix(ENV): value}).close()
    return {
        "train": fixed | {"steps": settings["n_timesteps"]},
        "env_kwargs": env_kwargs,
        "params": parse_pairs("--params", args.params),
        "report_every": args.report_every,
        "command": runs.command(),
        **space,
        "seed": list(range(args.seeds)),
    }


def run_trials(args: Trials) -> int:
    """Run the trials of `args` that have not ended yet, write their table and return its exit code."""
    plan = prepare(args)
    start(args)
    from ray import tune

    from agents.distribute_trial import FIXED, Progress, train_trial, write_table

    varied = [*(key for key in plan if key not in FIXED), "seed"]
    space = plan | {key: tune.grid_search(plan[key]) for key in varied}
    config = tune.TuneConfig(
        metric="return",
        mode="max",
        reuse_actors=True,  # libraries are imported and kernels read once for each worker
        trial_dirname_creator=lambda trial: _folder_name(trial, varied),
    )
    trainable = tune.with_resources(train_trial, {"cpu": args.cpus_per_trial})
    name = experiment_name(args)
    storage = args.out
    storage = storage if "://" in storage else str(Path(storage).absolute())
    folder = f"{storage}/{name}"
    running = tune.RunConfig(
        name=name,
        storage_path=storage,
        verbose=0,
        callbacks=[Progress()],
        failure_config=tune.FailureConfig(max_failures=args.retries),
        checkpoint_config=tune.CheckpointConfig(num_to_keep=1),
    )
    try:
        if tune.Tuner.can_restore(folder):
            print(f"going on with {folder}, whose files are pickles, which can run any code", flush=True)
            experiment = tune.Tuner.restore(folder, trainable, resume_errored=True)
        else:
            experiment = tune.Tuner(trainable, param_space=space, tune_config=config, run_config=running)
        results = experiment.fit()
    except OSError as error:
        raise OutputError(f"cannot write to {args.out!r}: {error}") from None
    except tune.TuneError as error:
        raise HoofEnvError(f"Ray Tune: {str(error).strip().splitlines()[-1]}") from None
    return write_table(results, folder, varied)


def experiment_name(args: Trials) -> str:
    """Return the folder's name, with a digest of the arguments that a result depends on; where it runs does
    not count."""
    asked = {key: value for key, value in asdict(args).items() if key not in Cluster.__dataclass_fields__}
    # The same arguments find the same folder again, other ones never
    digest = hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:8]
    return f"{args.algo}-{args.env_id.rpartition('/')[2]}-{digest}"


def _folder_name(trial: Any, varied: list[str]) -> str:
    """Return the folder's name of a trial, at most 100 characters and its number."""
    text = ",".join(f"{key}={trial.config[key]}" for key in varied)
    number = trial.trial_id.rpartition("_")[2]
    return f"{number}-" + "".join(c if c.isalnum() or c in "=,.-_" else "_" for c in text)[:100]


def start(args: Cluster) -> None:
    """Join the cluster at `args.address`, or make one of this machine's cores; `ParameterError` if Ray is not
    installed, or the cluster cannot be reached."""
    if missing := [name for name in ("ray", "pandas") if not importlib.util.find_spec(name)]:
        raise ParameterError(
            f"expected ray[tune] to be installed, found no {', '.join(missing)}: "
            "pip install 'hoof-env[distribute]'"
        )
    check_number("retries", args.retries, low=0)
    # None is all cores, by Ray's own count
    if args.cpus is not None:
        check_number("cpus", args.cpus, low=1)
    os.environ.setdefault("RAY_AIR_NEW_OUTPUT", "0")
    import ray
    from ray.exceptions import AuthenticationError

    options: dict[str, Any] = {"num_cpus": args.cpus, "include_dashboard": False}
    if args.address:
        # Ray refuses a second working_dir in a job that was submitted with one
        job = json.loads(os.environ.get("RAY_JOB_CONFIG_JSON_ENV_VAR", "{}")).get("runtime_env", {})
        sent = {} if "working_dir" in job else SHIPPED
        options = {"runtime_env": sent | parse_pairs("--runtime-env", args.runtime_env)}
    # A failure is written in one line by agents.distribute_trial
    logging.getLogger("ray.tune.execution.tune_controller").setLevel(logging.CRITICAL)
    try:
        ray.init(args.address or "local", log_to_driver=False, logging_level=logging.ERROR, **options)
    except (AuthenticationError, ConnectionError, OSError, RuntimeError, ValueError) as error:
        lines = str(error).strip().splitlines() or [type(error).__name__]
        where = f"a Ray cluster at {args.address!r}" if args.address else "a Ray cluster on this machine"
        raise ParameterError(f"address: expected {where}, cannot reach it: {lines[0]}") from None


def main(argv: list[str] | None = None) -> int:
    """Run the trials and return the exit code."""
    return run_trials(parse(Trials, argv, "python -m agents.distribute", __doc__))


if __name__ == "__main__":
    run(main)
