"""Charges for landings: each is paid when it should be, and by as much."""

import importlib

import gymnasium as gym
import numpy as np
import pytest

from agents.settings import FOLDER, load_settings, model_arguments
from hoof_env import make_policy
from hoof_env.errors import parse_pairs


@pytest.fixture(scope="module")
def soft_terms():
    """The module, imported when a test runs: others have tests for every id that is registered before."""
    return importlib.import_module("agents.soft_terms")


@pytest.fixture(scope="module")
def soft_landing(soft_terms):
    """The command, which imports the module."""
    return importlib.import_module("agents.soft_landing")


@pytest.fixture(scope="module", params=("threshold", "first_contact", "approach"))
def steps(request, soft_terms):
    """Charge, and for each step of a run on the usual ground what was paid and measured."""
    env = gym.make(soft_terms.id_of(request.param), randomize=None).unwrapped
    policy = make_policy("run", env)
    observation, _ = env.reset(seed=3, options={"gait": "run"})
    rows = []
    for _ in range(250):
        observation, _, _, _, info = env.step(policy.predict(observation)[0])
        measured = {name: float(info["measured"][name]) for name in info["measured"].names}
        rows.append((info[f"reward_{request.param}"], measured, env.engine.limbs[0].geometry.mass))
    return request.param, rows, env


def test_it_is_the_documented_quantity(steps, soft_terms):
    charge, rows, env = steps
    weight = soft_terms.WEIGHTS[charge]
    body = 9.81 * (env.engine.trunk.mass + rows[0][2])
    for paid, m, _ in rows:
        begins = m["stances"] > 0
        if charge == "threshold":
            expected = 0.02 * max(m["running_peak"] / body - soft_terms.THRESHOLD, 0.0)
        elif charge == "first_contact":
            expected = begins * (m["toe_normal"] + m["heel_normal"]) / body
        else:
            speeds = [m[f"{foot}_inverse_approach_speed"] for foot in ("toe", "heel")]
            expected = begins * max(1 / speed if speed else 0.0 for speed in speeds) ** 2
        assert paid == pytest.approx(-weight * expected, rel=2e-3, abs=1e-6)
    assert min(paid for paid, _, _ in rows) < 0.0


def test_the_run_pays_the_same_for_each(soft_terms, soft_landing):
    for charge in soft_terms.TERMS:
        found = soft_landing.play("run", soft_terms.id_of(charge), 100, randomize=None)
        assert -found[f"charge_{charge}"] / found["seconds"] == pytest.approx(soft_terms.PRICE, rel=0.02)
        assert 0.5 < found["seen"] < 1.0


def test_control_steps_hide_peaks(soft_terms, soft_landing):
    """The highest force at the ends of control steps is below that of all substeps, of a whole episode by
    little."""
    found = soft_landing.play("run", soft_terms.id_of("own"), 8)
    assert 0.9 < found["seen"] < 1.0
    assert np.isfinite(list(found.values())).all()


def test_a_training_has_the_settings_of_the_leg(soft_landing, tmp_path, monkeypatch):
    given = []
    monkeypatch.setattr(soft_landing, "train", given.append)
    soft_landing.train_all(soft_landing.Args("train", seeds=2, steps=4096, out=tmp_path))
    assert len(given) == 2 * len(soft_landing.CHARGES)
    assert len({arguments.out for arguments in given}) == len(given)
    wanted = load_settings(FOLDER / "ppo_flat.yml", "hoof_env/HorseLeg-v0")
    for arguments in given:
        settings = parse_pairs("--params", arguments.params)
        assert settings == wanted
        model_arguments(settings, 4)


def test_heavier_charges_differ_from_the_usual_in_one_weight(soft_terms):
    usual = weights_in(soft_terms.id_of("own"))
    assert usual == weights_in("hoof_env/HorseLeg-v0")
    for charge, factor in soft_terms.HEAVIER.items():
        weights = weights_in(soft_terms.id_of(charge))
        changed = {name: weights[name] / usual[name] for name in usual if weights[name] != usual[name]}
        assert changed == {"loading": factor}


def weights_in(env_id):
    """Weights of an environment's terms by name."""
    return dict(gym.make(env_id).unwrapped.weights)
