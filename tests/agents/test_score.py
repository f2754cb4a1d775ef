"""Episodes as rows are the episodes one by one: returns and summaries, whatever the policy."""

import numpy as np
import pytest

from agents import score
from agents.runs import make_env
from agents.score import Held, find_policy, play, score_vector
from hoof_env.errors import ParameterError

ENV_ID = "hoof_env/HorseLeg-v0"
SEEDS = [7, 3, 4, 11, 12]
FALLS = {"trunk_share": 1.0, "trunk_stiffness": 0.0, "trunk_damping": 0.0}


def one_by_one(name, env_id, seeds, **kwargs):
    with make_env(env_id, **kwargs) as env:
        return play(env, find_policy(name, env, env_id) if isinstance(name, str) else name, seeds)


@pytest.mark.parametrize("name", ["run", "idle", "bang-bang", "drag"])
def test_a_scripted_policy_to_the_bit(name, monkeypatch):
    monkeypatch.setattr(score, "ROWS", 3)  # two batches
    kwargs = {"episode_seconds": 0.8}
    ticks = []
    assert score_vector(name, ENV_ID, SEEDS, ticks.append, **kwargs) == one_by_one(
        name, ENV_ID, SEEDS, **kwargs
    )
    assert ticks == [3, 2]


def test_episodes_that_fail_count_once_and_only_up_to_their_end():
    rows = score_vector("run", ENV_ID, SEEDS, **FALLS)
    assert len({one["seconds"] for one in rows}) > 1  # some went on while others were over
    assert all(one["failed"] for one in rows)
    assert rows == one_by_one("run", ENV_ID, SEEDS, **FALLS)


def test_a_trained_policy(trained):
    kwargs = {"episode_seconds": 0.4}  # as it was trained
    rows, alone = (
        found(str(trained.folder), ENV_ID, SEEDS, **kwargs) for found in (score_vector, one_by_one)
    )
    for one, other in zip(rows, alone, strict=True):
        assert one == pytest.approx(other, rel=1e-3)


def test_held_actions_for_all_or_for_each():
    kwargs = {"episode_seconds": 0.4}
    actions = np.random.default_rng(0).uniform(-1, 1, (len(SEEDS), 4)).astype(np.float32)
    rows = score_vector(actions, ENV_ID, SEEDS, **kwargs)
    for seed, action, row in zip(SEEDS, actions, rows, strict=True):
        assert one_by_one(Held(action), ENV_ID, [seed], **kwargs) == [row]
        assert score_vector(action, ENV_ID, [seed], **kwargs) == [row]


def test_an_environment_without_rows_is_played_one_by_one(monkeypatch):
    kwargs = {"episode_seconds": 0.4}
    rows = score_vector("run", ENV_ID, SEEDS, **kwargs)
    monkeypatch.setattr(score, "make_rows", lambda *_, **__: None)
    assert score_vector("run", ENV_ID, SEEDS, **kwargs) == rows


@pytest.mark.parametrize("actions", [np.zeros(3), np.zeros((4, 4)), np.full(4, np.nan), None, "gallop"])
def test_bad_policy(actions):
    with pytest.raises(ParameterError, match="policy"):
        score_vector(actions, ENV_ID, SEEDS)
