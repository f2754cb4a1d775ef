"""Scores: intervals against known cases, episodes against a loop by hand, models that do not fit."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from agents.evaluate import METRICS, Args, Score, estimate, evaluate, film_paths, main, table, to_json
from agents.runs import make_env
from agents.score import find_policy, play
from hoof_env.envs.policies import GAITS, start_of
from hoof_env.errors import DataFileError
from tests.agents.conftest import ENV_ID, SHORT, train_tiny

COLUMNS = set(METRICS)


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


def test_policies_meet_the_same_episodes_whatever_stands_beside_them(env):
    alone, _ = evaluate(Args(policy=("run",), episodes=2, env_kwargs=SHORT))
    beside, _ = evaluate(Args(policy=("walk", "run"), episodes=2, env_kwargs=SHORT))
    assert alone[0] == beside[1]


def test_table_json_and_video(trained, tmp_path, capsys):
    scores, video = tmp_path / "scores.json", tmp_path / "film.mp4"
    model = str(trained.folder)
    main(["--policy", "run", model, "--episodes", "2", "--json", str(scores), "--video", str(video)])
    printed = capsys.readouterr().out
    assert all(word in printed for title in ("return", "policy") for word in title.split())
    data = json.loads(scores.read_text())
    assert data["env_id"] == ENV_ID
    assert data["env_kwargs"] == {"episode_seconds": 0.4}  # those of the model
    assert set(data["policies"]) == {"run", model}
    for policy in data["policies"].values():
        assert set(policy["mean"]) == set(policy["interval95"]) == COLUMNS
        assert len(policy["episodes"]) == 2
        assert policy["mean"]["return"] == pytest.approx(
            np.mean([one["return"] for one in policy["episodes"]])
        )
    for name in ("run", trained.folder.name):
        check_film(tmp_path / f"film-{name}.mp4", seconds=0.4)


def check_film(path, seconds):
    """H.264 in yuv420p, with the index in front, and pictures that change."""
    import imageio_ffmpeg

    reader = imageio_ffmpeg.read_frames(str(path))
    meta = next(reader)
    frames = list(reader)
    assert meta["codec"] == "h264"
    assert meta["pix_fmt"].startswith("yuv420p")
    assert len(frames) == pytest.approx(seconds * meta["fps"], abs=1)
    assert len(set(frames)) > 1
    content = path.read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")


def test_json_has_no_infinity():
    score = Score("still", [{"return": 1.0, "cost_of_transport": math.inf}] * 2)
    data = to_json([score])
    assert data["policies"]["still"]["mean"]["cost_of_transport"] is None
    json.dumps(data, allow_nan=False)
    assert table([score]).row_count == 1


def test_the_file_of_a_gait_names_the_environment():
    _, setting = evaluate(Args(policy=("run", str(GAITS / "HorseLegRail-v0-constant.json")), episodes=1))
    assert setting["env_id"] == "hoof_env/HorseLegRail-v0"


@pytest.mark.parametrize("env_id", [ENV_ID, "hoof_env/HorseLegMO-v0"])
def test_open_loop_by_its_name(env_id):
    (score,), _ = evaluate(Args(policy=("open-loop",), env_id=env_id, env_kwargs=SHORT, episodes=1))
    assert math.isfinite(score.estimates["return"].mean)


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
    (score,), setting = evaluate(Args(policy=(str(folder),), episodes=1))
    assert setting["env_id"] == "Pendulum-v1"
    assert set(score.estimates) == {"return"}


def test_films_of_two_policies_never_share_a_file():
    paths = film_paths(Path("gait.mp4"), ["run", "a/ppo", "b/sac/model.zip"])
    assert [str(path) for path in paths.values()] == ["gait-run.mp4", "gait-ppo.mp4", "gait-sac.mp4"]
    assert film_paths(Path("gait"), ["run"]) == {"run": Path("gait.mp4")}
