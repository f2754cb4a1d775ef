"""A study of tiny trainings: what it writes, that it goes on, prunes and is refused what misfits."""

import logging
from pathlib import Path
from typing import get_args

import pytest
import yaml

from agents.settings import Algorithm, load_settings
from agents.train import Args as TrainArgs
from agents.train import train
from agents.tune import SPACES, Args, TrialScorer, draw, finished, load_space, tune
from agents.watch import DivergedError
from hoof_env.errors import ParameterError
from tests.agents.conftest import KWARGS, SHORT, TINY

optuna = pytest.importorskip("optuna")

HELD = ("n_envs=4", *TINY)


def tiny(out: Path, **changes) -> Args:
    return Args(
        **{"trials": 2, "steps": 256, "scores": 2, "env_kwargs": SHORT, "params": HELD, "out": out, **changes}
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A study of two trials."""
    out = tmp_path_factory.mktemp("tune") / "study"
    tune(tiny(out))
    return out


def trials(folder: Path) -> list[optuna.trial.FrozenTrial]:
    return optuna.load_study(study_name="study", storage=f"sqlite:///{folder / 'study.db'}").trials


def best(folder: Path) -> optuna.trial.FrozenTrial:
    complete = [trial for trial in trials(folder) if trial.state.name == "COMPLETE"]
    return max(complete, key=lambda trial: trial.value)


def test_what_a_study_leaves(folder):
    assert [trial.state.name for trial in trials(folder)] == ["COMPLETE", "COMPLETE"]
    attributes = best(folder).user_attrs
    assert [steps for steps, _ in attributes["curve"]] == [128, 256]
    used = load_settings(folder / "best.yml", "hoof_env/HorseLeg-v0")
    assert used == attributes["settings"]
    assert used["learning_rate"] == f"lin_{best(folder).params['learning_rate']:.3g}"
    assert used["n_steps"] == 32
    assert "n_steps" not in best(folder).params


def test_the_best_settings_give_its_score_again(folder, tmp_path):
    scorer = TrialScorer("hoof_env/HorseLeg-v0", KWARGS, 128)
    arguments = {"seed": best(folder).number, "env_kwargs": SHORT, "out": tmp_path / "run"}
    train(TrainArgs(hyperparams=folder / "best.yml", **arguments), scorer)
    assert scorer.curve == [tuple(row) for row in best(folder).user_attrs["curve"]]


def test_a_study_goes_on(folder):
    before = trials(folder)
    study = tune(tiny(folder, trials=3))
    assert len(finished(study)) == 3
    assert trials(folder)[:2] == before
    assert len({trial.params["learning_rate"] for trial in trials(folder)}) == 3


def test_an_interrupted_trial_does_not_count(tmp_path, monkeypatch):
    class Stopped:
        stopped_by, seconds = 2, 1.0

    with monkeypatch.context() as patch:
        patch.setattr(
            "agents.tune.train", lambda args, scorer: setattr(scorer, "curve", [(128, 1.0)]) or Stopped
        )
        with pytest.raises(KeyboardInterrupt):
            tune(tiny(tmp_path))
    study = tune(tiny(tmp_path, trials=1))
    assert [trial.state.name for trial in study.trials] == ["FAIL", "COMPLETE"]


def test_a_killed_trial_is_run_again(tmp_path):
    """kill -9 leaves a trial that runs for ever."""
    args = tiny(tmp_path, trials=1)
    tune(args)
    study = optuna.load_study(study_name="study", storage=f"sqlite:///{tmp_path / 'study.db'}")
    killed = study.ask()
    drawn = draw(killed, {"gamma": load_space(SPACES, "ppo")["gamma"]}, {})
    study = tune(tiny(tmp_path))
    assert [trial.state.name for trial in study.trials] == ["COMPLETE", "FAIL", "COMPLETE"]
    assert study.trials[2].params["gamma"] == drawn["gamma"]


def test_a_bad_trial_is_pruned(tmp_path):
    scores = []

    def report(steps, score):
        scores.append((steps, score))
        return True

    scorer = TrialScorer("hoof_env/HorseLeg-v0", KWARGS, 128, report)
    trained = train(TrainArgs(steps=512, params=HELD, env_kwargs=SHORT, out=tmp_path / "run"), scorer)
    assert scorer.is_pruned
    assert trained.steps < 512
    assert scores == scorer.curve[:1]


@pytest.mark.parametrize("algo", get_args(Algorithm))
def test_every_algorithm_has_a_space(algo):
    space = load_space(SPACES, algo)
    base = {"policy_kwargs": {"net_arch": [8], "kept": 1}}
    trial = optuna.create_study().ask()
    settings = draw(trial, space, base)
    assert set(settings) == {key.split(".")[0] for key in space}
    assert settings["policy_kwargs"]["kept"] == 1
    assert settings["policy_kwargs"]["net_arch"] != [8]
    assert yaml.safe_load(yaml.safe_dump(settings)) == settings


def test_a_study_of_another_base_is_not_gone_on_with(folder):
    before = trials(folder)
    with pytest.raises(ParameterError, match="other base"):
        tune(tiny(folder, steps=512))
    assert trials(folder) == before


def test_a_trial_that_diverges_counts_as_pruned(tmp_path, monkeypatch):
    def diverge(args, scorer):
        raise DivergedError("a loss is nan")

    monkeypatch.setattr("agents.tune.train", diverge)
    study = tune(tiny(tmp_path))
    assert [trial.state.name for trial in study.trials] == ["PRUNED", "PRUNED"]
    assert not (tmp_path / "best.yml").exists()


def test_a_trial_shorter_than_a_rollout_is_scored(tmp_path):
    study = tune(tiny(tmp_path, trials=1, steps=5))
    assert study.trials[0].user_attrs["curve"]


@pytest.mark.parametrize("error", [ZeroDivisionError("of a pruner"), ParameterError("of a setting")])
def test_an_error_does_not_count_as_divergence_and_is_told_once(tmp_path, monkeypatch, caplog, error):
    def fail(args, scorer):
        raise error

    monkeypatch.setattr("agents.tune.train", fail)
    monkeypatch.setattr(logging.getLogger("optuna"), "propagate", True)
    with pytest.raises(type(error), match=str(error)):
        tune(tiny(tmp_path))
    assert not caplog.records
