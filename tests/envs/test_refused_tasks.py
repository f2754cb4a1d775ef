"""Own tasks that cannot be, by the words of each error: registrations (`REGISTRATIONS`), calls with an id
(`CALLS`). `test_refused_functions` has the functions."""

from __future__ import annotations

import pickle
from dataclasses import replace

import gymnasium as gym
import pytest

import hoof_env
from hoof_env import Entry, Scale, Term, register
from hoof_env.envs.manual import tables_of
from hoof_env.errors import ParameterError
from hoof_env.tasks import registry as tasks

BAD = "own/Bad-v0"


pytestmark = pytest.mark.usefixtures("registered")


def term(compute, name="mine", **kwargs):
    return Term(name, 1.0, "-", "a test's", compute, **kwargs)


def entry(measure, name="mine"):
    return Entry(name, "mine", "-", measure, Scale("none"))


def constant(step, weight):
    return 1.0


def powers(penetration, rate, inverse_approach_speed, ground):
    return ground.stiffness * penetration**1.5


REGISTRATIONS = [
    (
        lambda: {"env_id": "Turf"},
        "env_id: expected 'namespace/Name-v0' .*namespace .*got 'Turf'",
    ),
    (lambda: {"env_id": "hoof_env/HorseLeg-v0"}, "of a namespace .*got 'hoof_env/HorseLeg-v0'"),
    (lambda: {"env_id": 3}, "env_id: expected .*got 3"),
    (lambda: {"base": "pony"}, r"task: expected .*fixed, .*hop, horse, .*leg, .*, terrain.*, got 'pony'"),
    (lambda: {"terms": [term(constant), term(constant)]}, "expected names that differ, got mine twice"),
    (
        lambda: {"entries": [entry(len), entry(len)]},
        "expected .*1 arguments, got <built-in",
    ),
    (
        lambda: {"entries": [entry(lambda s: 0.0), entry(lambda s: 1.0)]},
        "names that differ, got mine twice",
    ),
    (lambda: {"entries": [entry(lambda s: 0.0, "height")]}, "names that differ, got height twice"),
    (lambda: {"terms": [constant]}, f"{BAD}: terms: expected .*hoof_env.Term, got <function"),
    (lambda: {"terms": None}, f"{BAD}: terms: expected .*hoof_env.Term, got None"),
    (lambda: {"entries": 3}, f"{BAD}: entries: expected .*hoof_env.Entry, got 3"),
    (lambda: {"entries": ["speed"]}, f"{BAD}: entries: expected .*hoof_env.Entry, got 'speed'"),
    (
        lambda: {"terms": [term(lambda step: 0.0)]},
        r"compute: expected .*2 arguments, got .*\(step\)",
    ),
    (
        lambda: {"contact_law": constant},
        r"contact_law: expected .*4 arguments, got .*\(step, weight\)",
    ),
    (
        lambda: {"stiffnes": 1.0},
        f"{BAD}: unexpected keyword argument 'stiffnes'; did you mean stiffness",
    ),
    (
        lambda: {"motor_gain": 1.0},
        "motor_gain: expected drive='motor'.*effect",
    ),
    (
        lambda: {"reward_weights": {"slop": 1.0}},
        "reward_weights: expected .*progress, .*slop",
    ),
    (
        lambda: {"observation": ["crank", "smell"]},
        "observation: expected .*crank, .*smell",
    ),
    (
        lambda: {"base": "fixed", "solver": "paper", "contact_law": powers},
        'solver: expected "exact" .*contact law of one\'s own, got "paper"',
    ),
]
"""Arguments of `register`, and words."""


@pytest.mark.parametrize(("arguments", "words"), REGISTRATIONS, ids=[row[1] for row in REGISTRATIONS])
def test_registrations(arguments, words):
    """Nothing is registered, and nothing is lost."""
    before = dict(gym.registry), dict(tasks._OWN)
    with pytest.raises(ParameterError, match=words):
        register(**{"env_id": BAD, **arguments()})
    assert (dict(gym.registry), dict(tasks._OWN)) == before


def registered_no_more(own):
    """The id's module is imported, but registers it no more."""
    tasks._OWN.pop(own.ID)
    gym.make(own.ID)


def pickled(own):
    """A pickle of another registration."""
    text = pickle.dumps(tasks._OWN[own.ID])
    assert pickle.loads(text) is tasks._OWN[own.ID]
    tasks._OWN[own.ID] = replace(tasks._OWN[own.ID], terms=own.TERMS)
    pickle.loads(text)


CALLS = [
    (
        lambda own: gym.make(own.ID, reward_weights={"slop": 1}),
        r"some of .*support, overspeed, loading, friction, comfort, got \{'slop': 1\}",
    ),
    (pickled, "pickled with other terms, entries or law"),
    (registered_no_more, "task: expected .*, got 'own/Everything-v0'"),
    (lambda own: hoof_env.HorseLegEnv(task="nobody:own/Nothing-v0"), "No module named 'nobody'"),
    (lambda own: tables_of("own/Nothing-v0"), "expected .*, got 'own/Nothing-v0'"),
]
"""Calls with the module of a user, and words."""


@pytest.mark.parametrize(("call", "words"), CALLS, ids=[row[1] for row in CALLS])
def test_calls(own, call, words):
    with pytest.raises(ParameterError, match=words):
        call(own)
