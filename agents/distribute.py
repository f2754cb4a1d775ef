"""Trainings of `agents.train` on a Ray cluster: seeds, sweeps and searches.

    python -m agents.distribute trials --seeds 5                                      five seeds
    python -m agents.distribute trials --seeds 3 --space 'learning_rate=[1e-3,5e-4]'  a sweep
    python -m agents.distribute trials --samples 20 --asha --space 'learning_rate=loguniform(1e-4,1e-2)'

Without --address a cluster of this machine's cores is made and ended with the command. A worker that dies is
replaced and its trial goes on from its last checkpoint. Ctrl-C keeps what is there; the same command, given
again, runs what is missing. docs/distribute.md says how to use a real cluster and where results land.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import inspect
import json
import logging
import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from tyro.conf import Positional

from agents import runs
from agents.command import parse_pairs, run
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


DRAWS = {
    "choice": 1, "uniform": 2, "loguniform": 2, "randint": 2, "lograndint": 2,
    "quniform": 3, "qloguniform": 3, "qrandint": 3, "qlograndint": 3,
}  # fmt: skip
"""Distributions of ray.tune, with the number of their arguments."""

LISTED = "grid_search"


@dataclass(frozen=True)
class Cluster:
    what: Positional[Literal["trials"]] = "trials"
    """trainings, each a trial of Ray Tune"""
    address: str | None = None
    """a running Ray cluster: auto (this machine is part of it), host:port or ray://host:10001"""
    cpus: int | None = None
    """of the cluster that is made where no address is given; otherwise all"""
    runtime_env: tuple[str, ...] = ()
    """more for Ray's runtime_env on a cluster: key=value ..., or one JSON object, as
    '{"pip": ["numba", "stable-baselines3"]}'"""
    retries: int = 3
    """of each trial whose worker dies or fails"""
    out: str = "runs/distribute"
    """folder that all machines see, or s3://... and the like; each experiment has its own folder there"""


@dataclass(frozen=True)
class Trials(Cluster, TrainingArgs):
    seeds: int = 1
    """trainings of each setting, from seed 0 on"""
    space: tuple[str, ...] = ()
    """what is varied: key=[JSON, ...] runs all, key=loguniform(a,b) and the like of ray.tune draw; a key is a
    hyperparameter, or env.ARGUMENT of the environment"""
    samples: int = 1
    """draws of the distributions in --space; the same for each seed"""
    asha: bool = False
    """give up the worse trials early (asynchronous successive halving)"""
    report_every: int = 100_000
    """steps between two scores, which are checkpoints as well"""
    cpus_per_trial: int = 1
    """cores that a trial asks of the cluster, and threads of torch"""


@dataclass(frozen=True)
class Axis:
    """One thing that is varied: `values` to run all of, or a distribution of `DRAWS` with its arguments."""

    key: str
    draw: str
    arguments: tuple[Any, ...]

    @property
    def values(self) -> list[Any]:
        """Those that are listed, or the arguments of the distribution: something of the right kind to try."""
        return list(self.arguments[0] if self.draw in (LISTED, "choice") else self.arguments[:2])

    def build(self) -> Any:
        """The same for Tune; `ParameterError` if it refuses the arguments."""
        from ray import tune

        try:
            built = getattr(tune, self.draw)(*self.arguments)
            if self.draw != LISTED:
                built.sample()
        except (TypeError, ValueError, ArithmeticError, AssertionError) as error:
            reason = f"--space {self.key}: {self.draw}{self.arguments} cannot be drawn from: {error}"
            raise ParameterError(reason) from None
        return built


def parse_space(items: Sequence[str]) -> list[Axis]:
    """Read `key=[...]` and `key=distribution(...)`; `ParameterError` if an item is neither or a key comes
    twice.

    >>> parse_space(["n_steps=[16, 32]", "learning_rate=loguniform(1e-4, 1e-2)"])
    [Axis(key='n_steps', draw='grid_search', arguments=([16, 32],)), \
    Axis(key='learning_rate', draw='loguniform', arguments=(0.0001, 0.01))]
    """
    axes: dict[str, Axis] = {}
    for item in items:
        key, _, text = item.partition("=")
        draw, arguments = _read(text)
        if not key or not draw:
            known = ", ".join(f"{name}({', '.join('abq'[:count])})" for name, count in DRAWS.items())
            raise ParameterError(f"--space: expected key=[JSON, ...] or key=draw of {known}; got {item!r}")
        if key in axes:
            raise ParameterError(f"--space: {key} is given twice")
        axes[key] = Axis(key, draw, arguments)
    return list(axes.values())


def _read(text: str) -> tuple[str, tuple[Any, ...]]:
    """Name and arguments of what stands behind the equals sign; no name where it cannot be read."""
    values = parse_pairs("--space", [f"values={text}"])["values"]
    if isinstance(values, list):
        return (LISTED, (values,)) if values else ("", ())
    with suppress(SyntaxError, ValueError):
        match ast.parse(text.strip(), mode="eval").body:
            case ast.Call(func=ast.Name(id=name), args=nodes, keywords=[]) if len(nodes) == DRAWS.get(name):
                arguments = tuple(ast.literal_eval(node) for node in nodes)
                if name != "choice" or (isinstance(arguments[0], list) and arguments[0]):
                    return name, arguments
    return "", ()


def check_keys(axes: Iterable[Axis], algo: str, settings: Iterable[str]) -> None:
    """Refuse keys that are neither hyperparameters of `algo`, nor in its `settings`, nor an environment's."""
    known = {*inspect.signature(algorithm_class(algo)).parameters, *settings, "normalize", "n_envs"}
    known -= {"env", "seed", "device", "_init_setup_model", "verbose", "tensorboard_log", "n_timesteps"}
    for axis in axes:
        if axis.key not in known and not axis.key.startswith(ENV):
            raise ParameterError(
                f"--space: expected a hyperparameter of {algo} ({', '.join(sorted(known))}) or {ENV}ARGUMENT "
                f"of the environment, got {axis.key!r}"
            )


def prepare(args: Trials) -> dict[str, Any]:
    """The parameter space of `args`: constants, an `Axis` for what varies, a list of seeds; all checked."""
    for name in ("seeds", "samples", "report_every", "cpus_per_trial"):
        check_number(name, getattr(args, name), low=1)
    algorithm_class(args.algo)
    fixed: dict[str, Any] = {"env_id": args.env_id, "algo": args.algo, "torch_threads": args.cpus_per_trial}
    one = TrainArgs(**fixed, steps=args.steps, env_kwargs=args.env_kwargs, params=args.params)
    env_kwargs, settings = checked(one)
    axes = parse_space(args.space)
    check_keys(axes, args.algo, settings)
    if args.samples > 1 and all(axis.draw == "grid_search" for axis in axes):
        raise ParameterError(f"samples: expected 1 where --space draws nothing, got {args.samples}")
    with runs.make_env(args.env_id, **env_kwargs) as env:
        runs.warm_up(env)  # kernels are compiled before workers want them
    for axis in axes:
        for value in axis.values if axis.key.startswith(ENV) else ():
            runs.make_env(args.env_id, **env_kwargs | {axis.key.removeprefix(ENV): value}).close()
    return {
        "train": fixed | {"steps": settings["n_timesteps"]},
        "env_kwargs": env_kwargs,
        "params": parse_pairs("--params", args.params),
        "report_every": args.report_every,
        "command": runs.command(),
        **{axis.key: axis for axis in axes},
        "seed": list(range(args.seeds)),
    }


def run_trials(args: Trials) -> int:
    """Run the trials of `args` that have not ended yet and write their table; returns its exit code."""
    plan = prepare(args)
    start(args)
    from ray import tune
    from ray.tune.schedulers import ASHAScheduler
    from ray.tune.search.basic_variant import BasicVariantGenerator

    from agents.distribute_trial import FIXED, Progress, train_trial, write_table

    axes = [key for key in plan if key not in FIXED]
    space = plan | {key: plan[key].build() for key in axes} | {"seed": tune.grid_search(plan["seed"])}
    steps = plan["train"]["steps"]
    asha = ASHAScheduler("steps", max_t=steps, grace_period=min(args.report_every, steps))
    varied = [*axes, "seed"]
    config = tune.TuneConfig(
        metric="return", mode="max", num_samples=args.samples,
        search_alg=BasicVariantGenerator(constant_grid_search=True, random_state=0),
        scheduler=asha if args.asha else None,
        reuse_actors=True,  # libraries are imported and kernels read once for each worker
        trial_dirname_creator=lambda trial: _folder_name(trial, varied),
    )  # fmt: skip
    trainable = tune.with_resources(train_trial, {"cpu": args.cpus_per_trial})
    name, storage = experiment_name(args), args.out
    storage = storage if "://" in storage else str(Path(storage).absolute())
    folder = f"{storage}/{name}"
    running = tune.RunConfig(
        name=name, storage_path=storage, verbose=0, callbacks=[Progress()],
        failure_config=tune.FailureConfig(max_failures=args.retries),
        checkpoint_config=tune.CheckpointConfig(num_to_keep=1),
    )  # fmt: skip
    try:
        if tune.Tuner.can_restore(folder):
            print(f"going on with {folder}", flush=True)
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
    """What the folder is called: a digest tells apart what was asked for, wherever it runs."""
    asked = {key: value for key, value in asdict(args).items() if key not in Cluster.__dataclass_fields__}
    digest = hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:8]
    return f"{args.algo}-{args.env_id.rpartition('/')[2]}-{digest}"


def _folder_name(trial: Any, varied: list[str]) -> str:
    text = ",".join(f"{key}={trial.config[key]}" for key in varied)
    number = trial.trial_id.rpartition("_")[2]
    return f"{number}-" + "".join(c if c.isalnum() or c in "=,.-_" else "_" for c in text)[:100]


def start(args: Cluster) -> None:
    """Join the cluster at `args.address`, or make one of this machine's cores; `ParameterError` if Ray is not
    installed, or no cluster at that address lets us in."""
    if missing := [name for name in ("ray", "pandas") if not importlib.util.find_spec(name)]:
        raise ParameterError(
            f"expected ray[tune] to be installed, found no {', '.join(missing)}: "
            "pip install 'hoof-env[distribute]'"
        )
    check_number("retries", args.retries, low=0)
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
    import tyro

    return run_trials(tyro.cli(Trials, args=argv, prog="python -m agents.distribute", description=__doc__))


if __name__ == "__main__":
    run(main)
