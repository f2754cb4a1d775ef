"""Search good settings of a learner with Optuna: each trial is a whole training from nothing.

    python -m agents.tune --algo ppo --env-id hoof_env/HorseLeg-v0 --trials 30 --steps 1500000
    python -m agents.tune --trials 60 --steps 1500000          the same study goes on until it has 60
    optuna trials --storage sqlite:///runs/tune/ppo-HorseLeg-v0/study.db --study-name study

A trial draws settings from agents/search_spaces.yml, trains by agents.train with a seed of its own, and is
scored as it goes on 64 episodes with which no training starts; a bad one is pruned. Ctrl-C ends the trial in
hand; the same command goes on, even after kill -9, when the trial that was killed is run again. One process
works on a study. Its folder holds study.db (Optuna's), best.yml (for --hyperparams of agents.train) and
trials/N, the run folders.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from agents import runs
from agents.command import parse, parse_pairs, run
from agents.settings import FOLDER, TrainingArgs, load_settings
from agents.train import Args as TrainArgs
from agents.train import checked, make_model, make_record, train
from agents.watch import DivergedError, EndedError, Scorer
from hoof_env.errors import DataFileError, ParameterError, check_number, parse_json

SPACES = Path(__file__).with_name("search_spaces.yml")
SEEDS = range(1000, 1064)  # scored episodes; trainings start theirs from other seeds


@dataclass(frozen=True)
class Args(TrainingArgs):
    """Arguments of the command."""

    trials: int = 20
    """trials of the study in the end, with earlier starts counted"""
    scores: int = 10
    """how often a trial is scored, the last time at its end"""
    space: Path = SPACES
    """YAML file of what is drawn; settings in --params are held"""
    seed: int = 0
    """of the search; trial n trains with seed + n"""
    out: Path | None = None
    """folder of the study; otherwise runs/tune/ALGO-ENV"""


def load_space(path: Path, algo: str) -> dict[str, Any]:
    """Return the ranges of `algo` in a file like agents/search_spaces.yml: key to a list, or to a mapping
    with "uniform" or "log" [low, high] and perhaps "lin".

    Raises:
        DataFileError: it is not such a file, or a range is malformed.
    """
    try:
        space = yaml.safe_load(path.read_text(encoding="utf-8"))[algo]
        for key, how in space.items():
            if not (isinstance(how, list) and how):
                (low, high) = how["log"] if "log" in how else how["uniform"]
                if not low < high or ("log" in how and low <= 0):
                    raise ValueError(f"{key}: {how}")
    except (
        OSError,
        yaml.YAMLError,
        KeyError,
        TypeError,
        ValueError,
        AttributeError,
        RecursionError,
    ) as error:
        raise DataFileError(
            f"search space {path}: expected for {algo} keys with lists, or uniform or log: [low, high]; "
            f"{type(error).__name__}: {error}"
        ) from None
    return dict(space)


def draw(trial: Any, space: Mapping[str, Any], base: Mapping[str, Any]) -> dict[str, Any]:
    """Draw settings for an Optuna trial from `space`; the other arguments of a nested setting are those in
    `base`."""
    chosen: dict[str, Any] = {}
    for key, how in space.items():
        value: Any
        if isinstance(how, list):
            value = trial.suggest_categorical(key, how)
            if isinstance(value, str) and value.startswith("["):  # Optuna chooses between plain values only
                value = parse_json(value)
        else:
            low, high = how["log"] if "log" in how else how["uniform"]
            # Three digits are enough, and can be read in a table
            value = float(f"{trial.suggest_float(key, low, high, log='log' in how):.3g}")
            value = f"lin_{value:g}" if how.get("lin") else value
        name, _, inner = key.partition(".")
        chosen[name] = {**chosen.get(name, base.get(name) or {}), inner: value} if inner else value
    return chosen


class TrialScorer(Scorer):
    """Scorer that keeps the mean returns and may prune the training.

    Args:
        env_id: id of the environment.
        env_kwargs: its arguments.
        every: steps between two scores.
        report: called as `report(steps, score)` after each score but the last; True ends the training, which
            is then pruned.

    Attributes:
        curve: rows of (steps, mean return).
        is_pruned: True if `report` ended the training.
    """

    def __init__(
        self,
        env_id: str,
        env_kwargs: Mapping[str, Any],
        every: int,
        report: Callable[[int, float], bool] = lambda steps, score: False,
    ) -> None:
        super().__init__(env_id, env_kwargs, SEEDS, every)
        self.report = report
        self.is_pruned = False
        self.curve: list[tuple[int, float]] = []

    def keep(self, episodes: list[dict[str, float]]) -> None:
        mean = sum(episode["return"] for episode in episodes) / len(episodes)
        self.curve.append((self.num_timesteps, mean))

    def _on_rollout_start(self) -> None:
        before = len(self.curve)
        super()._on_rollout_start()
        # At the end there is nothing left to prune
        if len(self.curve) > before and self.report(*self.curve[-1]):
            self.is_pruned = True
            raise EndedError


def tune(args: Args) -> Any:
    """Run the study of `args` until it has all trials; return the Optuna study.

    Raises:
        ParameterError: an argument does not fit, or the study in the folder was begun with others.
        DataFileError: a file does not fit.
        KeyboardInterrupt: Ctrl-C; finished trials stay.
    """
    check_number("trials", args.trials, low=1)
    check_number("scores", args.scores, low=1)
    kwargs = parse_pairs("--env-kwargs", args.env_kwargs)
    held = parse_pairs("--params", args.params)
    base = load_settings(FOLDER / f"{args.algo}.yml", args.env_id) | held
    base["n_timesteps"] = int(check_number("steps", args.steps or base["n_timesteps"], low=1))
    space = {
        key: how for key, how in load_space(args.space, args.algo).items() if key.split(".")[0] not in held
    }
    make_record(TrainArgs(env_id=args.env_id), kwargs)  # refuses what cannot be trained on
    folder = args.out or Path("runs/tune", f"{args.algo}-{args.env_id.rpartition('/')[2]}")

    def keep(study: Any, trial: Any) -> None:
        curve = trial.user_attrs.get("curve") or [(0, float("nan"))]
        print(f"trial {trial.number}: {trial.state.name.lower()}, {curve[-1][1]:.1f}", flush=True)
        write_best(study, folder, args.env_id)

    with runs.alone(folder):
        study = open_study(args, folder, {"env_kwargs": kwargs, "base": base, "space": space})
        # Trials that failed do not count, so one call may not be enough
        while (left := args.trials - len(finished(study))) > 0:
            study.optimize(
                lambda trial: run_trial(trial, args, folder, kwargs, base | draw(trial, space, base)),
                n_trials=left,
                callbacks=[keep],
            )
        write_best(study, folder, args.env_id)
    return study


def run_trial(
    trial: Any, args: Args, folder: Path, env_kwargs: dict[str, Any], settings: dict[str, Any]
) -> float:
    """Return the last score of a training with `settings`; raise Optuna's `TrialPruned` for a bad one."""
    import optuna

    def report(steps: int, score: float) -> bool:
        trial.report(score, steps)
        return bool(trial.should_prune())

    out = folder / "trials" / str(trial.number)
    # A trial that was killed left a run of other settings
    shutil.rmtree(out, ignore_errors=True)
    trial.set_user_attr("settings", settings)
    scorer = TrialScorer(args.env_id, env_kwargs, -(-settings["n_timesteps"] // args.scores), report)
    training = TrainArgs(
        env_id=args.env_id,
        algo=args.algo,
        env_kwargs=args.env_kwargs,
        out=out,
        params=(json.dumps(settings),),
        seed=args.seed + trial.number,
        checkpoint_every=0,
    )
    try:
        trained = train(training, scorer)
    except DivergedError:  # no settings to go on with
        raise optuna.TrialPruned from None
    trial.set_user_attr("curve", scorer.curve)
    trial.set_user_attr("seconds", round(trained.seconds, 1))
    if trained.stopped_by:
        raise KeyboardInterrupt
    if scorer.is_pruned:
        raise optuna.TrialPruned
    return scorer.curve[-1][1]


def finished(study: Any) -> list[Any]:
    """Return the trials that are through or pruned."""
    return [trial for trial in study.trials if trial.state.name in ("COMPLETE", "PRUNED")]


def open_study(args: Args, folder: Path, about: dict[str, Any]) -> Any:
    """Return the study in `folder`, or a new one; a trial that was killed is queued to run again.

    Raises:
        ParameterError: Optuna is missing, the settings do not fit the algorithm, or the study was begun with
            others.
        DataFileError: study.db is not a study.
    """
    try:
        import optuna
        from sqlalchemy.exc import SQLAlchemyError
    except ModuleNotFoundError:
        raise ParameterError("agents.tune needs Optuna: pip install 'hoof-env[tune]'") from None
    optuna.logging.set_verbosity(optuna.logging.ERROR)  # errors that end a trial are raised, too
    check_space(args, about)
    path = folder / "study.db"
    try:
        study = optuna.create_study(
            storage=f"sqlite:///{path}",
            study_name="study",
            # By the median of five whole trials at the least, and not before a third of a training
            pruner=optuna.pruners.MedianPruner(5, n_warmup_steps=about["base"]["n_timesteps"] // 3),
            direction="maximize",
            load_if_exists=True,
        )
        len(study.trials)  # reads all of it
    except (SQLAlchemyError, optuna.exceptions.OptunaError, RuntimeError) as error:
        reason = str(error).partition("\n")[0]
        raise DataFileError(f"{path}: expected the database of a study, cannot read it: {reason}") from None
    # Of the same seed a study that goes on would draw again what it has drawn
    seed = args.seed + len(study.trials)
    study.sampler = optuna.samplers.TPESampler(seed=seed, multivariate=True, n_startup_trials=8)
    about = {"algo": args.algo, "env_id": args.env_id, **about}
    begun = study.user_attrs.get("about", about)
    if unlike := [key for key in about if begun.get(key) != json.loads(json.dumps(about[key]))]:
        raise ParameterError(
            f"{folder} holds a study with other {', '.join(unlike)}; choose another folder by --out"
        )
    # No other process works on the study: a running trial was killed
    for trial in study.get_trials(states=[optuna.trial.TrialState.RUNNING]):
        study.tell(trial.number, state=optuna.trial.TrialState.FAIL)
        study.enqueue_trial(trial.params)
    for key, value in {"about": about, "command": runs.command(), "versions": runs.versions()}.items():
        study.set_user_attr(key, value)
    return study


def check_space(args: Args, about: dict[str, Any]) -> None:
    """Build a model with settings that are drawn once, which refuses a key that is unknown."""
    import optuna

    drawn = about["base"] | draw(optuna.create_study().ask(), about["space"], about["base"])
    training = TrainArgs(env_id=args.env_id, algo=args.algo, params=(json.dumps(drawn),))
    _, settings = checked(training)
    with closing(runs.make_vec_env(args.env_id, settings["n_envs"], **about["env_kwargs"])) as many:
        make_model(training, settings, many)


def write_best(study: Any, folder: Path, env_id: str) -> None:
    """Write best.yml, the settings of the best trial that is through."""
    complete = [trial for trial in study.trials if trial.state.name == "COMPLETE"]
    if complete:
        best = max(complete, key=lambda trial: trial.value)
        settings = yaml.safe_dump({env_id: best.user_attrs["settings"]}, sort_keys=False)
        score = f"mean return {best.value:.2f} of {len(SEEDS)} episodes"
        runs.write_text(folder / "best.yml", f"# Trial {best.number} of agents.tune: {score}\n{settings}")


def main(argv: list[str] | None = None) -> None:
    """Search, and print the number of trials."""
    args = parse(Args, argv, "python -m agents.tune", __doc__)
    study = tune(args)
    print(f"{args.algo} on {args.env_id}: {len(finished(study))} trials")


if __name__ == "__main__":
    run(main)
