"""Trainings of `agents.train` on a Ray cluster: seeds and sweeps.

    python -m agents.distribute --seeds 5                                             five seeds
    python -m agents.distribute --seeds 3 --space 'learning_rate=[1e-3,5e-4]'         a sweep

Without --address a cluster of this machine's cores starts and ends with the command. A worker that dies is
replaced and its trial goes on from its last checkpoint. Ctrl-C keeps all results; the same command, given
again, runs the missing trials. docs/agents.md describes a real cluster and the place of results.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import json
import logging
import os
import re
import shlex
import shutil
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from agents import checkpoints, runs
from agents.command import parse, parse_pairs, run
from agents.settings import ENV, TrainingArgs, algorithm_class
from agents.train import Args as TrainArgs
from agents.train import checked, train
from agents.watch import DivergedError, Scorer
from hoof_env.errors import DataFileError, HoofEnvError, OutputError, ParameterError, check_number
from hoof_env.evaluation.episodes import CURVE_SEEDS

try:
    from ray import tune
except ImportError:  # `start` names the extra that has it
    tune = None

ROOT = Path(__file__).resolve().parents[1]

SHIPPED = {
    "working_dir": str(ROOT),
    "excludes": ["/.?*", "/runs", "/docs", "/dist", "/build", "__pycache__", "*.pyc"],
}
"""Runtime environment of trials on a cluster: the checkout, without what no training needs."""


FIXED = ("train", "env_kwargs", "params", "report_every", "seed", "command")
"""Keys of a trial's configuration that no search chooses, seeds aside."""


@dataclass(frozen=True)
class Cluster:
    """Arguments of every command on a cluster."""

    address: str | None = None
    """a running Ray cluster: auto (this machine is part of it), host:port or ray://host:10001"""
    cpus: int | None = None
    """cores of the cluster that starts where no address is given; otherwise all"""
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
    # A failure is written in one line by `Progress`
    logging.getLogger("ray.tune.execution.tune_controller").setLevel(logging.CRITICAL)
    try:
        ray.init(args.address or "local", log_to_driver=False, logging_level=logging.ERROR, **options)
    except (AuthenticationError, ConnectionError, OSError, RuntimeError, ValueError) as error:
        lines = str(error).strip().splitlines() or [type(error).__name__]
        where = f"a Ray cluster at {args.address!r}" if args.address else "a Ray cluster on this machine"
        raise ParameterError(f"address: expected {where}, cannot reach it: {lines[0]}") from None


# A trial on a worker


def train_trial(config: dict[str, Any]) -> None:
    """Train as `config` says (`agents.distribute.prepare`).

    Every `report_every` steps and at the end it reports the score to Tune and, as a checkpoint, the run
    folder. A trial that is retried goes on from its last checkpoint. One that diverges or has settings that
    do not fit would do so again: it ends with the reason as its figure "failed".
    """
    chosen = {key: value for key, value in config.items() if key not in FIXED}
    env_kwargs = config["env_kwargs"] | {
        k.removeprefix(ENV): v for k, v in chosen.items() if k.startswith(ENV)
    }
    params = config["params"] | {k: v for k, v in chosen.items() if not k.startswith(ENV)}
    folder = Path("run").absolute()  # in the trial's own folder on the worker
    shutil.rmtree(folder, ignore_errors=True)  # a worker that died here left it
    checkpoint = tune.get_checkpoint()
    if checkpoint:
        checkpoint.to_directory(str(folder))
    reporter = Reporter(folder, config, env_kwargs, checkpoint.get_metadata() if checkpoint else {})
    # The reporter keeps the checkpoints: two of the same step would not go into one folder
    args = TrainArgs(
        **config["train"],
        seed=config["seed"],
        out=folder,
        resume=True,
        checkpoint_every=0,
        env_kwargs=(json.dumps(env_kwargs),),
        params=(json.dumps(params),),
    )
    # run.json shall name the user's command, not the command of Ray's worker
    sys.orig_argv = shlex.split(config["command"])
    try:
        train(args, reporter)
    except (ParameterError, DataFileError, DivergedError) as error:
        tune.report({"return": float("nan"), **reporter.last, "failed": str(error)})
    else:
        reporter.report()


class Reporter(Scorer):
    """Scorer that keeps a checkpoint and reports it to Tune with the score.

    Attributes:
        last: the last score: "return", mean over the episodes of `CURVE_SEEDS`, "steps", and "train_s",
            seconds of training alone, with earlier tries included.
    """

    def __init__(
        self, folder: Path, config: dict[str, Any], env_kwargs: dict[str, Any], last: dict[str, float]
    ) -> None:
        super().__init__(config["train"]["env_id"], env_kwargs, CURVE_SEEDS, config["report_every"])
        self.folder = folder
        self.last = dict(last)
        self.wall_s = self.last.get("train_s", 0.0)

    def keep(self, episodes: list[dict[str, float]]) -> None:
        mean = sum(episode["return"] for episode in episodes) / len(episodes)
        self.last = {"return": mean, "steps": self.num_timesteps, "train_s": self.wall_s}

    def _on_rollout_start(self) -> None:
        before = self.scored_at
        super()._on_rollout_start()
        if self.scored_at > before:
            checkpoints.save(self.model, self.folder, self.wall_s)
            # Each report uploads the folder: one checkpoint is enough
            checkpoints.tidy(self.folder, keep=1)
            self.report()
            self._start_clock()

    def report(self) -> None:
        """Report the last score with the run folder as its checkpoint."""
        checkpoint = tune.Checkpoint.from_directory(str(self.folder))
        checkpoint.set_metadata(self.last)
        tune.report(self.last, checkpoint=checkpoint)


# Progress and outcome of all trials

FIGURES = ("return", "steps", "train_s")  # numbers of a report


class Progress(tune.Callback if tune else object):  # type: ignore[misc]
    """Callback that prints a line for each score, and when a trial ends, when its worker died and when it
    goes on.

    Attributes:
        going: ids of trials that had not ended at the last step; an attribute of the class, for Tune works
            with a copy of the callback.
    """

    going: ClassVar[set[str]] = set()

    def on_step_end(self, iteration: int, trials: list[Any], **info: Any) -> None:
        Progress.going = {t.trial_id for t in trials if t.status not in ("TERMINATED", "ERROR")}

    def on_trial_result(
        self, iteration: int, trials: list[Any], trial: Any, result: dict[str, Any], **info: Any
    ) -> None:
        write_line(trial, f"{result.get('steps', 0):,.0f} steps, return {result['return']:.2f}")

    def on_trial_recover(self, iteration: int, trials: list[Any], trial: Any, **info: Any) -> None:
        report = trial.latest_checkpoint_result
        steps = report.metrics["steps"] if report else 0
        write_line(trial, f"{last_failure(trial)} Retry {trial.num_failures}, from step {steps:,.0f}")

    def on_trial_error(self, iteration: int, trials: list[Any], trial: Any, **info: Any) -> None:
        write_line(trial, f"{last_failure(trial)} No retry is left")

    def on_trial_complete(self, iteration: int, trials: list[Any], trial: Any, **info: Any) -> None:
        write_line(trial, f"done, return {trial.last_result['return']:.2f}")


def write_line(trial: Any, what: str) -> None:
    """Print a line about a trial."""
    print(f"trial {trial.trial_id.rpartition('_')[2]}: {what}", flush=True)


def last_failure(trial: Any) -> str:
    """Return the last failure of a trial in one line."""
    path = Path(trial.error_file or "")
    return reason(path.read_text() if path.is_file() else "")


def reason(error: str) -> str:
    """Return the last failure in a line: Ray writes its message first, but after a traceback Python's is
    last."""
    # Ray colours its messages
    error = re.sub(r"\x1b\[[\d;]*m", "", error)
    lines = [line.strip() for line in error.rpartition("Failure #")[2].strip().splitlines()]
    lines = [line for line in lines if "(occurred at" not in line] or ["unknown."]
    return lines[-1 if any(line.startswith(("Traceback", "ray::")) for line in lines) else 0]


def write_table(results: Any, folder: str, varied: list[str]) -> int:
    """Write `folder`/trials.csv if that is a path, print the outcome of the trials, and return the exit code:
    0, 1 if a trial failed for good, 130 if one has not ended."""
    rows = []
    reasons = []
    # Whether a trial is done stands in its status alone; but after Ctrl-C all look as if they were
    pairs = zip(results, results._experiment_analysis.trials, strict=True)
    for result, trial in sorted(pairs, key=lambda pair: Path(pair[0].path).name):
        report = result.metrics or {}
        config = result.config or {}
        # A trial that failed at once has no checkpoint
        run = result.checkpoint.path if result.checkpoint else ""
        why = reason(str(result.error)) if result.error else report.get("failed")
        is_done = trial.status == "TERMINATED" and trial.trial_id not in Progress.going
        state = "done" if is_done else "unfinished"
        if why:
            state = "failed"
            reasons.append(f"  {run or 'a trial'}: {why}")
        row = {key: config.get(key) for key in varied} | {key: report.get(key) for key in FIGURES}
        rows.append(row | {"state": state, "run": str(run).removeprefix(f"{folder}/")})
    if "://" not in folder and rows:
        runs.write_csv(Path(folder, "trials.csv"), list(rows[0]), rows)
    states = [row["state"] for row in rows]
    counts = {state: states.count(state) for state in ("done", "failed", "unfinished")}
    print(", ".join(f"{count} {state}" for state, count in counts.items() if count) + f": {folder}")
    print("\n".join(reasons), end="\n" if reasons else "")
    if counts["unfinished"]:
        print("interrupted; the same command goes on")
        return 130
    return 1 if counts["failed"] else 0


def main(argv: list[str] | None = None) -> int:
    """Run the trials and return the exit code."""
    return run_trials(parse(Trials, argv, "python -m agents.distribute", __doc__))


if __name__ == "__main__":
    from agents import distribute  # by whose name workers find the trial

    run(distribute.main)
