"""The reward pays what it says."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from family import FALLS, running_peak_charge, together

from hoof_env.envs.policies import make_policy
from hoof_env.envs.reward import TERMS as TABLE

TERMS = [term.key for term in TABLE]
DT, H = 0.02, 1e-3


def rollout(env, policy, seed):
    """Infos of one episode, and its substeps by name."""
    observation, _ = env.reset(seed=seed)
    infos, records, done = [], [env.unwrapped.record()], False
    while not done:
        action, _ = policy.predict(observation, episode_start=not infos)
        observation, reward, terminated, truncated, info = env.step(action)
        assert reward == sum(info[term] for term in TERMS)
        done = terminated or truncated
        infos.append(info)
        records.append(env.unwrapped.record())
    return infos, together(records[1:])


def stances(trace, threshold):
    """Peaks and loading rates of all stances, independently of the account: split where the load ends or
    after a turn; a rate is the steepest rise of the normal force among the substeps that raise the peak."""
    peaks, rates, opened, before = [], [], None, 0.0
    for normal, theta, grf in zip(trace["normal"], trace["theta"], trace["grf"], strict=True):
        if normal <= threshold:
            opened = None
        elif opened is None or theta - opened >= 2 * np.pi:
            opened = theta
            peaks.append(grf)
            rates.append(max((normal - before) / H, 0.0))
        elif grf > peaks[-1]:
            peaks[-1] = grf
            rates[-1] = max(rates[-1], (normal - before) / H)
        before = normal
    return peaks, rates


def steps_of(values):
    """Sums over the substeps of each control step."""
    return values.reshape(-1, round(DT / H)).sum(axis=1)


def ends_of(values):
    """At the end of each control step."""
    return values[round(DT / H) - 1 :: round(DT / H)]


def borne(trace, weight):
    """Impulse over the weight, at most 1.2 of it, of each control step."""
    return np.minimum(steps_of(H * trace["normal"]) / weight, 1.2 * DT)


@pytest.mark.parametrize("name", ["walk", "run", "drag", "random"])
@pytest.mark.parametrize("trunk", ["suspended", "rail", "fixed"])
def test_terms_are_what_they_say_of_the_substeps(name, trunk):
    weights = {"overspeed": 3.0, "loading": 0.5}
    env = gym.make("hoof_env/HorseLeg-v0", trunk=trunk, episode_seconds=4.0, reward_weights=weights)
    infos, trace = rollout(env, make_policy(name, env), 4)
    assert len(trace["time"]) == 4000
    paid = {term: np.array([info[term] for info in infos]) for term in TERMS}
    threshold = 0.05 * env.unwrapped.weight
    peaks, rates = stances(trace, threshold)
    summary = infos[-1]["episode_summary"]
    assert summary["stance_peak_sum_n"] == pytest.approx(sum(peaks), rel=1e-9)
    charge = running_peak_charge(trace["grf"])
    assert charge > sum(peaks) - 2.2 * threshold * len(peaks)  # what is left at lift-off counts twice
    assert paid["reward_peak"].sum() == pytest.approx(-0.75 * charge / 1000, rel=1e-9)
    assert paid["reward_loading"].sum() == pytest.approx(-0.5 * sum(rates) / 1e6, rel=1e-9)
    work = np.sum(np.maximum(trace["crank_power"], 0) + np.maximum(trace["hip_power"], 0)) * H
    assert paid["reward_energy"].sum() == pytest.approx(-2.0 * work / 1000, rel=1e-9)
    if trunk == "fixed":
        slid = sum(trace[f"{point}_normal"] * trace[f"{point}_slide"] for point in ("toe", "heel"))
        down = trace["normal"] > 0
        progress = steps_of(-H * np.where(down, slid, 0.0) / np.where(down, trace["normal"], 1.0))
    else:
        progress = np.diff(ends_of(trace["x"]), prepend=0.0)
    commanded = 2.5 * DT
    pace = np.minimum(np.clip(progress / commanded, -1, 1), ends_of(trace["theta_rate"]))
    expected = {
        "reward_progress": 2.5 * np.minimum(progress, commanded),
        "reward_overspeed": -3.0 * np.maximum(progress - commanded, 0.0),
        "reward_support": 17.0 * pace * borne(trace, env.unwrapped.weight),
    }
    for term, values in expected.items():
        np.testing.assert_allclose(paid[term], values, rtol=1e-9, atol=1e-12, err_msg=term)


def test_bearing_without_a_commanded_speed_pays_at_any():
    """But only a leg whose crank turns."""
    env = gym.make("hoof_env/HorseLegRail-v0", episode_seconds=4.0, reward_weights={"support": 2.0})
    infos, trace = rollout(env, make_policy("run", env), 4)
    expected = np.minimum(1.0, ends_of(trace["theta_rate"])) * borne(trace, env.unwrapped.weight)
    found = [info["reward_support"] for info in infos]
    np.testing.assert_allclose(found, 2.0 * expected, rtol=1e-9, atol=1e-12)
    assert sum(info["reward_progress"] for info in infos) == pytest.approx(trace["x"][-1], rel=1e-9)
    assert all(info["reward_overspeed"] == 0.0 for info in infos)


def test_action_term_is_the_mean_square_of_the_change():
    env = gym.make("hoof_env/HorseLeg-v0").unwrapped
    env.reset(seed=0, options={"gait": "run"})
    before = env.action_for(env.gaits["run"]).astype(float)
    for action in (np.full(4, 5.0), np.array([0.5, -0.25, 0.0, 1.0]), np.array([0.5, -0.25, 0.0, 1.0])):
        info, now = env.step(action)[4], np.clip(action, -1, 1)
        assert info["reward_action"] == pytest.approx(-0.03 * np.mean((now - before) ** 2), rel=1e-9)
        before = now


def test_a_collapse_terminates_and_is_charged_once():
    env = gym.make("hoof_env/HorseLeg-v0", **FALLS, reward_weights={"failure": 7.0})
    infos, trace = rollout(env, make_policy("airborne", env), 0)
    assert "height" in infos[-1]["failure"]
    assert [info["reward_failure"] for info in infos[-2:]] == [0.0, -70.0]
    assert infos[-1]["episode_summary"]["failed"] == 1.0
    assert trace["y"][-1] < 0.6 * env.unwrapped.engine.trunk.height < trace["y"][-21]


def test_summary_agrees_with_the_substeps():
    env = gym.make("hoof_env/HorseLeg-v0")
    infos, trace = rollout(env, make_policy("run", env), 1)
    summary = infos[-1]["episode_summary"]
    assert summary["seconds"] == pytest.approx(10.0)
    assert summary["mean_grf_n"] == pytest.approx(trace["normal"].mean())
    assert summary["peak_grf_n"] == pytest.approx(trace["grf"].max(), rel=1e-12)
    peaks, rates = stances(trace, 0.05 * env.unwrapped.weight)
    assert summary["stances"] == len(peaks)
    assert summary["stance_peak_sum_n"] == pytest.approx(sum(peaks), rel=1e-9)
    assert summary["loading_rate_n_s"] == pytest.approx(np.mean(rates), rel=1e-9)
    assert summary["duty_factor"] == pytest.approx((trace["normal"] > 0).mean())
    assert summary["speed_m_s"] == pytest.approx(trace["x"][-1] / 10)
    work = summary["cost_of_transport"] * env.unwrapped.weight * summary["distance_m"]
    assert work == pytest.approx(summary["drive_work_j"])
