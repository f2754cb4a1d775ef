"""The measure of learning: what it writes, that it goes on where it stopped, and that its audit closes."""

import json

import numpy as np
import pytest

from agents import learning_bar
from agents.evaluate import find_policy, play
from agents.learned_gait import POINTS, audit, strides, watch
from agents.learning_bar import EPISODES, FIRST_SEED, Args, gait_returns, measure, read_rows, time_to_beat
from agents.learning_report import put
from agents.runs import make_env
from hoof_env.errors import DataFileError, ParameterError
from tests.agents.conftest import SHORT, TINY

ENV_ID = "hoof_env/HorseLeg-v0"


@pytest.fixture(scope="module")
def args(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bar")
    return Args(env_kwargs=SHORT, seeds=2, every=100, steps=256, params=("n_envs=4", *TINY), out=folder)


@pytest.fixture(scope="module")
def found(args):
    return measure(args)


def test_scores_of_every_seed(args, found):
    rows = read_rows(args.out / "curve.csv")
    assert [(row["seed"], row["steps"]) for row in rows] == [(s, n) for s in (0, 1) for n in (0, 128, 256)]
    for seed in (0, 1):
        one = read_rows(args.out / "curve.csv", seed)
        assert one[0]["wall_s"] < one[1]["wall_s"] < one[2]["wall_s"]
        assert (args.out / str(seed) / "model.zip").is_file()
    assert json.loads((args.out / "bar.json").read_text()) == found
    assert set(found["seeds"]) == {"0", "1"}


def test_a_seed_that_is_there_is_not_trained_again(args, found, monkeypatch):
    monkeypatch.setattr(learning_bar, "train", lambda *_: pytest.fail("was trained"))
    again = measure(args)
    assert again["seeds"] == found["seeds"]


def test_gaits_are_scored_as_evaluate_scores_them():
    scored = gait_returns(ENV_ID, {"episode_seconds": 0.4})
    with make_env(ENV_ID, episode_seconds=0.4) as env:
        for name, value in scored.items():
            episodes = play(env, find_policy(name, env, ENV_ID), range(FIRST_SEED, FIRST_SEED + EPISODES))
            assert value == pytest.approx(np.mean([one["return"] for one in episodes]), abs=1e-5)
    assert set(scored) == {"run", "walk"}


def test_the_first_score_above_counts():
    returns = [1.0, 5.0, 7.0, 6.0]
    rows = [{"seed": 0, "steps": k, "wall_s": 10.0 * k, "cpu_s": 1.0 * k, "return": r}
            for k, r in enumerate(returns)]  # fmt: skip
    assert time_to_beat(rows, 5.0) == {
        "steps": 2, "wall_s": 20.0, "cpu_s": 2.0, "return": 7.0, "last_return": 6.0
    }  # fmt: skip
    assert time_to_beat(rows, 7.0) is None


def test_an_environment_without_gaits():
    with pytest.raises(ParameterError, match="scripted gaits"):
        gait_returns("Pendulum-v1", {})


@pytest.fixture(scope="module")
def episode():
    return watch("run")


def test_the_audit_closes(episode):
    rows = audit(episode)
    assert abs(rows["not accounted for [of the weight]"]) < 5e-3
    weight = rows["ground bears [of the weight]"]
    assert weight == pytest.approx(episode.summary["weight_share"], abs=5e-3)
    with make_env(ENV_ID) as env:
        (one,) = play(env, find_policy("run", env, ENV_ID), [FIRST_SEED])
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
