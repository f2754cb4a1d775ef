"""Policies and gaits that cannot be, by the words of each error: names and environments (`CALLS`), files of
gaits (`FILES`)."""

from __future__ import annotations

import json
from functools import cache

import gymnasium as gym
import numpy as np
import pytest

from hoof_env.envs.open_loop import GAITS, load_open_loop, open_loop
from hoof_env.envs.policies import make_policy
from hoof_env.errors import DataFileError, ParameterError

LEG = "hoof_env/HorseLeg-v0"
COEFFICIENTS = [[[5.0, 0.4, 0.1, 0.0], [1.0, 0.0, 0.0, 0.1], [0.0, 0.2, 0.0, 0.0]]]
CLOCKED = {"coefficients": COEFFICIENTS, "frequency_hz": 0.25}


@cache
def made(env_id=LEG, *observation):
    """An environment; with its observed groups, if some are given."""
    return gym.make(env_id, **({"observation": list(observation)} if observation else {}))


def blind():
    return made(LEG, "crank", "hoof")


def horse():
    return made("hoof_env/Horse-v0")


UNSEEN = r"policy: expected 'gait' .*groups.*got \['crank', 'hoof'\]"
NO_ENV = "env: expected an environment .*make_policy.*got"
CALLS = [
    *((lambda name=name: make_policy(name, blind()), UNSEEN) for name in ("run", "idle", "drag", "airborne")),
    (lambda: open_loop(CLOCKED, blind()), UNSEEN),
    *(
        (
            lambda name=name: make_policy(name, made(LEG, "gait")),
            r"expected 'crank' .*groups, got \['gait'\]",
        )
        for name in ("drag", "airborne")
    ),
    (
        lambda: make_policy("idle", horse()),
        "policy: expected .*bang-bang, kinematic-.*, random, reference, zero, got 'idle'",
    ),
    (lambda: make_policy(made(), "run"), NO_ENV),
    (lambda: make_policy("run", "walk"), NO_ENV),
    (lambda: make_policy("run", made("CartPole-v1")), NO_ENV),
    (lambda: make_policy(3, made()), "policy: expected .*got 3"),
    (
        lambda: make_policy("run", made()).predict(None),
        r"observation: expected what .*shape \(\.\.\., \d+\).*got None",
    ),
]
"""Calls and words."""


@pytest.mark.parametrize(("call", "words"), CALLS)
def test_calls(call, words):
    with pytest.raises(ParameterError, match=words):
        call()


GAIT = {"env_id": LEG, "form": "gait", "parameters": CLOCKED}
NO_GAIT = r"gait\.json: expected a JSON .*agents\.open_loop"
OLD = r"gait\.json: expected form 'gait'.*got .*agents"
FILES = [
    ({**GAIT, "form": None}, OLD),
    ({**GAIT, "form": "actions"}, OLD),
    *(
        ({**GAIT, "parameters": parameters}, f"{NO_GAIT}.*{given}")
        for parameters, given in (
            ({"constant": [0.0, 0.0, 0.0]}, r"constant \[0.0, 0.0, 0.0\]"),
            ({**CLOCKED, "frequency_hz": None}, "frequency_hz None"),
            ({"constant": [0.0] * 4, "sin": [0.0] * 4}, r"parameters \['constant', 'sin'\]"),
            ({"coefficients": COEFFICIENTS[0]}, r"coefficients \[\[5\.0"),
            ({"coefficients": [COEFFICIENTS[0][:2]]}, r"coefficients \[\[\[5\.0"),
            (None, "NoneType"),
            ({"constant": [0.0, 0.0, 0.0, float("nan")]}, "constant .*nan"),
            ({"constant": ["6", "0", "0", "0"]}, "constant .*'6'"),
            ({"constant": [True, False, False, False]}, "constant .*True"),
            ({"constant": [10**400, 0, 0, 0]}, "constant .*000"),
            ({**CLOCKED, "frequency_hz": 1e308}, r"frequency_hz 1e\+308"),
            ({"constant": [True, 0.5, 0.0, 0.0]}, "constant .*True"),
            ({"coefficients": [[[1e300] * 4]]}, r"coefficients \[\[\[1e\+300"),
        )
    ),
    ({**GAIT, "env_kwargs": [1]}, rf"{NO_GAIT}.*env_kwargs \[1\]"),
    ({**GAIT, "env_id": 5}, f"{NO_GAIT}.*env_id 5"),
    ({**GAIT, "versions": None}, f"{NO_GAIT}.*versions None"),
    ({**GAIT, "observation_scales": "tanh"}, f"{NO_GAIT}.*observation_scales 'tanh'"),
    ("", NO_GAIT),
    ("[]", NO_GAIT),
    ("{}", f"{NO_GAIT}.*'parameters'"),
    ("\x00", NO_GAIT),
    (None, f"{NO_GAIT}.*No such file"),
]
"""Content of a file, a text or what JSON takes, or None for no file, and words."""


@pytest.mark.parametrize(("content", "words"), FILES, ids=str)
def test_files(content, words, tmp_path):
    path = tmp_path / "gait.json"
    if content is not None:
        path.write_text(content if isinstance(content, str) else json.dumps(content))
    with pytest.raises(DataFileError, match=words):
        load_open_loop(path, made())


def test_a_file_for_an_environment_whose_actions_mean_something_else(tmp_path):
    path = tmp_path / "gait.json"
    path.write_text(json.dumps({**GAIT, "env_id": "hoof_env/Horse-v0"}))
    with pytest.raises(DataFileError, match=r"expected the form 'offsets of .*' of HorseLegEnv, whose act"):
        load_open_loop(path, horse())
    content = {"form": horse().unwrapped.action_form, "parameters": {"constant": [6.0, 0.0, 0.0, 0.0]}}
    path.write_text(json.dumps(content))
    with pytest.raises(DataFileError, match=r"constant: expected an environment .*leg, got a horse"):
        load_open_loop(path, horse())


def test_a_gait_for_a_command_on_another_scale(tmp_path):
    """Of HorseRough-v0, as it was when the speed was seen as on Horse-v0."""
    path = tmp_path / "gait.json"
    record = json.loads((GAITS / "HorseRough-v0-phase.json").read_text())
    rough = made("hoof_env/HorseRough-v0")
    for scales in (record["observation_scales"], {}):
        path.write_text(json.dumps(record | {"observation_scales": scales}))
        load_open_loop(path, rough)
    path.write_text(json.dumps(record | {"observation_scales": {"commanded speed": "tanh(x / 5)"}}))
    expected = (
        r"scale 'tanh\(\(x / sqrt\(size\) - 2\.4\) / 0\.7\)' of the .*, got 'tanh\(x / 5\)'; search again"
    )
    with pytest.raises(DataFileError, match=expected):
        load_open_loop(path, rough)


def test_an_id_without_a_gait():
    with pytest.raises(DataFileError, match=r"of Cow-v0: expected .*HorseLeg-v0-constant\.json"):
        load_open_loop("hoof_env/Cow-v0", made())


def test_blind_policies_need_no_gait():
    for name in ("random", "bang-bang"):
        assert make_policy(name, blind()).predict(np.zeros(10))[0].shape == (4,)
