"""The learned gait looked at closely: its audit closes, and its tables find their places."""

import pytest

from agents import learning_report
from agents.baselines_plan import CURVE_SEEDS, LEG
from agents.evaluate import find_policy, play
from agents.learned_gait import POINTS, audit, strides, watch
from agents.learning_report import best_constant, put, simple_returns
from agents.runs import make_env
from hoof_env.errors import DataFileError


def test_the_best_of_many_constant_actions_is_one_of_them(monkeypatch):
    monkeypatch.setattr(learning_report, "TRIED", 40)
    monkeypatch.setattr(learning_report, "TRIED_AGAIN", 4)
    monkeypatch.setattr(learning_report, "AGAIN_SEEDS", range(5000, 5004))
    of_few = best_constant(LEG)
    monkeypatch.setattr(learning_report, "TRIED", 160)
    assert best_constant(LEG) > of_few > 0
    simple = simple_returns(LEG)
    assert simple["run"] > simple["idle"] > simple["bang-bang"]


@pytest.fixture(scope="module")
def episode():
    return watch("run")


def test_the_audit_closes(episode):
    rows = audit(episode)
    assert abs(rows["not accounted for [of the weight]"]) < 5e-3
    weight = rows["ground bears [of the weight]"]
    assert weight == pytest.approx(episode.summary["weight_share"], abs=5e-3)
    with make_env(LEG) as env:
        (one,) = play(env, find_policy("run", env, LEG), [CURVE_SEEDS[0]])
    assert rows["return [-]"] == pytest.approx(one["return"], abs=1e-9)
    assert rows["speed [m/s]"] == pytest.approx(one["speed_m_s"], rel=1e-9)


def test_strides_begin_with_the_load(episode):
    found = strides(episode)
    assert found["normal"].shape == (len(found["duration"]), POINTS)
    assert found["duration"] == pytest.approx(1.0, abs=0.05)  # a turn of the run's crank
    assert (found["normal"][:, 1:20] > found["normal"][:, :1]).all()


def test_a_table_goes_between_its_marks():
    text = "a\n<!-- bar -->\nold\n<!-- /bar -->\nb\n"
    assert put(text, "bar", r"new \1") == "a\n<!-- bar -->\nnew \\1\n<!-- /bar -->\nb\n"
    with pytest.raises(DataFileError, match="<!-- audit -->"):
        put(text, "audit", "")
