"""Episodes as rows are the episodes one by one: returns and summaries, whatever the policy. The loading rate:
on made forces, and as a figure of agents.evaluate."""

from pathlib import Path

import numpy as np
import pytest

from agents import score
from agents.baselines_results import held
from agents.evaluate import Args, evaluate
from agents.runs import make_env
from agents.score import find_policy, loading_rates, play, score_vector, stances, steepest
from hoof_env.errors import ParameterError
from tests.agents.conftest import ENV_ID, KWARGS

SEEDS = [7, 3, 4, 11, 12]
FALLS = {"trunk_share": 1.0, "trunk_stiffness": 0.0, "trunk_damping": 0.0}


def one_by_one(name, env_id, seeds, **kwargs):
    with make_env(env_id, **kwargs) as env:
        return play(env, find_policy(name, env, env_id) if isinstance(name, str) else name, seeds)


@pytest.mark.parametrize("name", ["run", "idle", "bang-bang", "drag"])
def test_a_scripted_policy_to_the_bit(name, monkeypatch):
    monkeypatch.setattr(score, "ROWS", 3)  # two batches
    kwargs = {"episode_seconds": 0.8}
    assert score_vector(name, ENV_ID, SEEDS, **kwargs) == one_by_one(name, ENV_ID, SEEDS, **kwargs)


def test_episodes_that_fail_count_once_and_only_up_to_their_end():
    rows = score_vector("run", ENV_ID, SEEDS, **FALLS)
    assert len({one["seconds"] for one in rows}) > 1  # some went on while others were over
    assert all(one["failed"] for one in rows)
    assert rows == one_by_one("run", ENV_ID, SEEDS, **FALLS)


def test_a_trained_policy(trained):
    rows, alone = (
        found(str(trained.folder), ENV_ID, SEEDS, **KWARGS) for found in (score_vector, one_by_one)
    )
    for one, other in zip(rows, alone, strict=True):
        assert one == pytest.approx(other, rel=1e-3)


def test_held_actions_for_all_or_for_each():
    actions = np.random.default_rng(0).uniform(-1, 1, (len(SEEDS), 4)).astype(np.float32)
    rows = score_vector(held(actions), ENV_ID, SEEDS, **KWARGS)
    for seed, action, row in zip(SEEDS, actions, rows, strict=True):
        assert one_by_one(held(action), ENV_ID, [seed], **KWARGS) == [row]
        assert score_vector(held(action), ENV_ID, [seed], **KWARGS) == [row]


def test_an_environment_without_rows_is_played_one_by_one(monkeypatch):
    rows = score_vector("run", ENV_ID, SEEDS, **KWARGS)
    monkeypatch.setattr(score, "make_rows", lambda *_, **__: None)
    assert score_vector("run", ENV_ID, SEEDS, **KWARGS) == rows


@pytest.mark.parametrize("policy", [np.zeros(4), None, "gallop"])
def test_bad_policy(policy):
    with pytest.raises(ParameterError, match="policy"):
        score_vector(policy, ENV_ID, SEEDS)


# The loading rate

KEY = "loading_rate_n_s"


def test_the_steepest_rise_is_over_five_milliseconds():
    force = np.r_[np.zeros(10), np.arange(1.0, 11.0) * 20, np.full(10, 200.0)]
    assert steepest(force, 1e-3) == pytest.approx(20e3)
    assert steepest(np.r_[0.0, 0.0, 50.0, 50.0, 50.0, 50.0], 1e-3) == pytest.approx(10e3)  # a jump
    assert steepest(force[:1], 1e-3) == 0


def test_whole_stances_alone_count():
    force = np.zeros(100)
    force[:5] = force[95:] = 500.0  # began before, ends after
    force[20:30] = 300.0
    force[40] = 40.0  # grazes, less than the threshold
    force[60:80], force[65] = 200.0, 900.0
    assert stances(force, 50.0).tolist() == [[20, 30], [60, 80]]
    rates = loading_rates(force, np.zeros(100), 50.0, 1e-3)
    assert rates == pytest.approx([300 / 1e-3, 900 / 5e-3 - 200 / 5e-3])
    friction = np.zeros(100)
    friction[62] = 1e4  # the highest ground reaction force, and so the end of the rise
    assert loading_rates(force, friction, 50.0, 1e-3)[1] == pytest.approx(200 / 3e-3)


def rate_of(policy, **env_kwargs):
    kwargs = tuple(f"{name}={value}" for name, value in env_kwargs.items())
    (score,), _ = evaluate(Args(policy=(policy,), episodes=1, env_kwargs=kwargs, loading_rate=True))
    return score.episodes[0][KEY]


def test_a_harder_ground_loads_faster():
    soft, hard = (rate_of("run", episode_seconds=6.0, stiffness=by * 2e4) for by in (0.25, 4.0))
    assert hard > 1.5 * soft > 0


def test_without_a_stance_it_is_zero():
    assert rate_of("airborne", episode_seconds=0.4) == 0


def test_one_cycle_of_the_paper_is_not_left_out():
    fixed = "hoof_env/HorseLegFixed-v0"
    (score,), _ = evaluate(Args(policy=("run",), episodes=1, env_id=fixed, loading_rate=True))
    assert score.estimates[KEY].mean > 0


@pytest.mark.parametrize(
    ("option", "given"),
    [("--loading-rate", {"loading_rate": True}), ("--video", {"video": Path("film.mp4")})],
)
def test_an_environment_without_records_is_refused(option, given):
    with pytest.raises(
        ParameterError, match=f"{option}: expected an environment of hoof_env, got Pendulum-v1"
    ):
        evaluate(Args(policy=("random",), env_id="Pendulum-v1", **given))


def test_to_measure_it_changes_nothing_else():
    with make_env(ENV_ID, episode_seconds=1.0) as env:
        (plain,) = play(env, find_policy("run", env, ENV_ID), [7])
        (measured,) = play(env, find_policy("run", env, ENV_ID), [7], loading_rate=True)
    assert measured == plain | {KEY: measured[KEY]}
