"""Distributed trainings, as far as they go without Ray; tests/ecosystem/check_distribute.py has the rest."""

import pytest

from agents.distribute import Trials, prepare, reason


def test_plan():
    plan = prepare(Trials(seeds=3, steps=1000, space=("gamma=[0.9]", 'env.trunk=["rail"]')))
    assert plan["seed"] == [0, 1, 2]
    assert plan["train"]["steps"] == 1000
    assert (plan["gamma"], plan["env.trunk"]) == ([0.9], ["rail"])


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
def test_reason(error, said):
    told = f"Failure # 1 (occurred at noon)\nold\nFailure # 2 (occurred at one)\n{error}\n"
    assert reason(told) == said
