"""The loading rate: on made forces, and as a figure of agents.evaluate."""

import numpy as np
import pytest

from agents.evaluate import Args, evaluate
from agents.runs import make_env
from agents.score import find_policy, loading_rates, play, stances, steepest
from hoof_env.errors import ParameterError

LEG = "hoof_env/HorseLeg-v0"
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


def test_an_environment_without_records_is_refused():
    with pytest.raises(
        ParameterError, match="--loading-rate: expected an environment of hoof_env, got Pendulum-v1"
    ):
        evaluate(Args(policy=("random",), env_id="Pendulum-v1", loading_rate=True))


def test_to_measure_it_changes_nothing_else():
    with make_env(LEG, episode_seconds=1.0) as env:
        (plain,) = play(env, find_policy("run", env, LEG), [7])
        (measured,) = play(env, find_policy("run", env, LEG), [7], loading_rate=True)
    assert measured == plain | {KEY: measured[KEY]}
