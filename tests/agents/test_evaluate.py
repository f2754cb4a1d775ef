"""Scores: intervals against known cases, episodes against a loop by hand, models that do not fit."""

import csv
import json
import math
import warnings

import numpy as np
import pytest

from agents.runs import make_env
from hoof_env import cli
from hoof_env.envs.open_loop import GAITS
from hoof_env.envs.policies import start_of
from hoof_env.errors import DataFileError
from hoof_env.evaluation.episodes import play
from hoof_env.evaluation.scores import METRICS, Score, cell, evaluate, text_table, to_json
from hoof_env.evaluation.statistics import estimate, iqm
from hoof_env.policies.find import find_policy
from tests.agents.conftest import ENV_ID, KWARGS, train_tiny

COLUMNS = set(METRICS) - {"cost"}  # which ids without a limit do not have


def test_interval_of_a_normal_sample():
    sample = np.random.default_rng(0).normal(5.0, 2.0, 400)
    found = estimate(sample)
    half = 1.96 * sample.std(ddof=1) / math.sqrt(len(sample))
    assert found.mean == pytest.approx(sample.mean())
    assert found.low == pytest.approx(sample.mean() - half, abs=0.1 * half)
    assert found.high == pytest.approx(sample.mean() + half, abs=0.1 * half)


@pytest.mark.parametrize("values", [[3.0, 3.0, 3.0], [0.0, 0.0], [1 / 3] * 7])
def test_no_variance_no_width(values):
    found = estimate(values)
    assert (found.low, found.mean, found.high) == pytest.approx((values[0],) * 3)


@pytest.mark.parametrize("values", [[3.0], [1.0, math.inf]])
def test_no_interval(values):
    found = estimate(values)
    assert found.mean == values[-1]
    assert np.isnan([found.low, found.high]).all()
    assert found.parts()[1] == ""


@pytest.mark.parametrize("name", ["run", "idle"])
def test_a_return_is_the_sum_of_its_rewards(env, name):
    (episode,) = play(env, find_policy(name, env, ENV_ID), [7])
    policy, total, done = find_policy(name, env, ENV_ID), 0.0, False
    observation, _ = env.reset(seed=7, options=start_of(policy))
    while not done:
        observation, reward, terminated, truncated, info = env.step(policy.predict(observation)[0])
        total, done = total + reward, terminated or truncated
    assert episode["return"] == pytest.approx(total, abs=1e-9)
    summary = info["episode_summary"]
    assert summary.items() <= episode.items()
    assert episode["stance_peak_n"] * max(summary["stances"], 1) == pytest.approx(
        summary["stance_peak_sum_n"]
    )


def test_policies_meet_the_same_episodes_whatever_stands_beside_them():
    alone = evaluate(["run"], ENV_ID, KWARGS, episodes=2)
    beside = evaluate(["walk", "run"], ENV_ID, KWARGS, episodes=2)
    assert alone.scores[0] == beside.scores[1]


def test_intervals_agree_with_scipy():
    """The bootstrap that the published tables were made with, and the interval of a skewed sample."""
    from scipy.stats import bootstrap, trim_mean

    for count in (2, 5, 40):
        sample = np.random.default_rng(count).gamma(1.5, size=(count, 2))
        rng = np.random.default_rng(0)
        bounds = bootstrap((sample[:, 0],), np.mean, rng=rng).confidence_interval
        found = estimate(sample[:, 0])
        assert (found.low, found.high) == pytest.approx(tuple(bounds), rel=1e-12)

        def middle(values, axis):
            return np.asarray(trim_mean(values, 0.25, axis=axis))

        options = {"axis": 0, "n_resamples": 5000, "method": "percentile", "rng": np.random.default_rng(0)}
        bounds = bootstrap((sample,), middle, **options).confidence_interval
        np.testing.assert_allclose(iqm(sample), [middle(sample, 0), *bounds], rtol=1e-12)


def test_table_and_files(trained, tmp_path, capsys):
    model = str(trained.folder)
    for name in ("scores.json", "scores.csv"):
        command = ["evaluate", "run", model, "--episodes", "2", "--out", str(tmp_path / name)]
        assert cli.main(command) == 0
        where, _, head, means, intervals, *_ = capsys.readouterr().out.splitlines()
        assert where == f"{ENV_ID} with {KWARGS}, episodes 1,000 to 1,001"  # the arguments of the model
        assert head.startswith("policy ")
        assert "return" in head
        assert means.startswith("run ")
        assert intervals.split()[0].startswith("[")
    data = json.loads((tmp_path / "scores.json").read_text())
    assert (data["env_id"], data["env_kwargs"]) == (ENV_ID, KWARGS)
    assert set(data["policies"]) == {"run", model}
    for policy in data["policies"].values():
        assert set(policy["mean"]) == set(policy["interval95"]) == COLUMNS
        assert len(policy["episodes"]) == 2
        returns = [one["return"] for one in policy["episodes"]]
        assert policy["mean"]["return"] == pytest.approx(np.mean(returns))
    with (tmp_path / "scores.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["policy"], row["seed"]) for row in rows[:2]] == [("run", "1000"), ("run", "1001")]
    episodes = [episode for policy in data["policies"].values() for episode in policy["episodes"]]
    assert [float(row["return"]) for row in rows] == [episode["return"] for episode in episodes]
    assert cli.main(command) == 2
    assert "exists already" in capsys.readouterr().err


def test_terminal_report_and_file_have_one_cost_of_transport():
    """The cost of an episode that went backward is infinite; the cost of several is work over distance."""
    forward = {"return": 1.0, "distance_m": 10.0, "positive_work_j": 800.0, "mean_normal_n": 400.0,
               "weight_share": 0.5, "cost_of_transport": 0.1}  # fmt: skip
    back = forward | {"distance_m": -5.0, "cost_of_transport": math.inf}
    score = Score("run", [forward, forward | {"distance_m": 20.0, "cost_of_transport": 0.05}, back])
    mean = 2400 / 800 / 25
    assert score.estimates["cost_of_transport"].mean == pytest.approx(mean)
    assert to_json([score])["policies"]["run"]["mean"]["cost_of_transport"] == pytest.approx(mean)
    shown = cell("cost_of_transport", score.estimates["cost_of_transport"])
    assert shown[0] == f"{mean:.2f}"
    _, line, below = text_table([score]).splitlines()
    assert shown[0] in line.split()
    assert shown[1] in below
    still = Score("idle", [back])
    assert cell("cost_of_transport", still.estimates["cost_of_transport"]) == ("", "")
    assert "∞" not in text_table([still])


def test_json_has_no_infinity():
    score = Score("still", [{"return": 1.0, "cost_of_transport": math.inf}] * 2)
    data = to_json([score])
    assert data["policies"]["still"]["mean"]["cost_of_transport"] is None
    json.dumps(data, allow_nan=False)


def test_an_episode_of_a_figure_that_is_missing_has_no_column():
    head, *_ = text_table([Score("other", [{"return": 1.0}] * 2)]).splitlines()
    assert head.split() == ["policy", "return"]


def test_the_file_of_a_gait_names_the_environment():
    found = evaluate(["run", str(GAITS / "HorseLegRail-v0-constant.json")], episodes=1)
    assert found.env_id == "hoof_env/HorseLegRail-v0"


@pytest.mark.parametrize("env_id", [ENV_ID, "hoof_env/HorseLegMO-v0"])
def test_the_open_loop_and_the_shipped_policy_by_their_names(env_id):
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*trained with episode_seconds")
        found = evaluate(["open-loop", "shipped"], env_id, KWARGS, episodes=1)
    assert all(math.isfinite(score.estimates["return"].mean) for score in found.scores)


def test_model_of_another_environment_is_refused_unopened(trained, monkeypatch):
    monkeypatch.setattr("stable_baselines3.PPO.load", lambda *_, **__: pytest.fail("was unpickled"))
    with (
        make_env("Pendulum-v1") as pendulum,
        pytest.raises(DataFileError, match="HorseLeg-v0, expected Pendulum-v1"),
    ):
        find_policy(str(trained.folder), pendulum, "Pendulum-v1")
    with make_env(ENV_ID, trunk="rail") as rail, pytest.raises(DataFileError, match="observation_space"):
        find_policy(str(trained.folder), rail, ENV_ID)


def test_an_environment_without_summaries(tmp_path):
    folder = train_tiny(tmp_path / "run", env_id="Pendulum-v1", env_kwargs=()).folder
    found = evaluate([str(folder)], episodes=1)
    assert found.env_id == "Pendulum-v1"
    assert set(found.scores[0].estimates) == {"return"}
