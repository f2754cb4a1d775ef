"""Distributed trainings, as far as they go without Ray; tests/ecosystem/check_distribute.py has the rest."""

import importlib.util
import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from agents.distribute import Trials, main, parse_space, prepare, start
from hoof_env.errors import HoofEnvError, ParameterError

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    "item", ["gamma", "gamma=", "gamma=0.9", "gamma=[]", "=[1]", "gamma=uniform(0,1)", "gamma=[1", "gamma={}"]
)
def test_bad_space(item):
    with pytest.raises(ParameterError, match="--space: expected key="):
        parse_space([item])


def test_plan():
    plan = prepare(Trials(seeds=3, steps=1000, space=("gamma=[0.9]", 'env.trunk=["rail"]')))
    assert plan["seed"] == [0, 1, 2]
    assert plan["train"]["steps"] == 1000
    assert (plan["gamma"], plan["env.trunk"]) == ([0.9], ["rail"])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"space": ("horsepower=[1]",)}, "'horsepower'"),
        ({"space": ("seed=[1]",)}, "'seed'"),
        ({"space": ("env.wheels=[4]",)}, "wheels"),
        ({"space": ('env.trunk=["flying"]',)}, "flying"),
        ({"space": ("gamma=[0.9]", "gamma=[0.8]")}, "gamma is given twice"),
        ({"seeds": 0}, "seeds"),
        ({"report_every": 0}, "report_every"),
        ({"steps": 0}, "steps"),
        ({"algo": "prayer"}, "prayer"),
        ({"env_id": "hoof_env/Cow-v0"}, "Cow"),
        ({"env_kwargs": ("wheels=4",)}, "wheels"),
    ],
    ids=str,
)
def test_bad_plan(changes, said):
    with pytest.raises(HoofEnvError, match=said):
        prepare(Trials(**changes))


def test_without_ray(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    for call in (lambda: start(Trials()), lambda: main(["trials", "--seeds", "2", "--steps", "99"])):
        with pytest.raises(ParameterError, match=r"pip install 'hoof-env\[distribute\]'"):
            call()


def test_another_word_than_trials_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["rllib"])
    assert "trials" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            "\x1b[36mray::ImplicitFunc.train()\x1b[39m (pid=7, ip=10.0.0.1)\n"
            '  File "trial.py", line 1, in run\n    raise error\n\x1b[31mValueError: bad\x1b[0m',
            "ValueError: bad",
        ),
        ('Traceback (most recent call last):\n  File "x.py", line 1\nKeyError: 3', "KeyError: 3"),
        ("The actor died unexpectedly.\n\tclass_name: ImplicitFunc", "The actor died unexpectedly."),
    ],
)
def test_reason(monkeypatch, error, said):
    monkeypatch.setitem(sys.modules, "ray", SimpleNamespace(tune=SimpleNamespace(Callback=object)))
    report = runpy.run_path(str(ROOT / "agents" / "distribute_trial.py"))
    told = f"Failure # 1 (occurred at noon)\nold\nFailure # 2 (occurred at one)\n{error}\n"
    assert report["reason"](told) == said
