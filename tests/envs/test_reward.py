"""The reward pays what it says."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from family import FALLS, together

from hoof_env.envs.policies import make_policy

TERMS = [f"reward_{name}" for name in ("progress", "peak", "energy", "action", "failure", "support")]


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


def stance_peaks(trace, threshold):
    """Peaks of all stances, independently of the account: split where the load ends or after a turn."""
    peaks, opened = [], None
    for normal, theta, grf in zip(trace["normal"], trace["theta"], trace["grf"], strict=True):
        if normal <= threshold:
            opened = None
        elif opened is None or theta - opened >= 2 * np.pi:
            opened = theta
            peaks.append(grf)
        else:
            peaks[-1] = max(peaks[-1], grf)
    return peaks


@pytest.mark.parametrize("name", ["walk", "run", "drag", "random"])
@pytest.mark.parametrize("trunk", ["suspended", "rail", "fixed"])
def test_terms_add_up_and_each_stance_pays_its_peak(name, trunk):
    weights = {"support": 2.0}
    env = gym.make("hoof_env/HorseLeg-v0", trunk=trunk, episode_seconds=4.0, reward_weights=weights)
    infos, trace = rollout(env, make_policy(name, env), 4)
    assert len(trace["time"]) == 4000
    paid = {term: sum(info[term] for info in infos) for term in TERMS}
    peaks = sum(stance_peaks(trace, 0.05 * env.unwrapped.weight))
    assert paid["reward_peak"] == pytest.approx(-0.3 * peaks / 1000, rel=1e-9)
    work = np.sum(np.maximum(trace["crank_power"], 0) + np.maximum(trace["hip_power"], 0)) * 1e-3
    assert paid["reward_energy"] == pytest.approx(-0.1 * work / 1000, rel=1e-9)
    borne = np.sum(trace["normal"]) * 1e-3 / env.unwrapped.weight
    assert paid["reward_support"] == pytest.approx(2.0 * borne, rel=1e-9)
    progress = paid["reward_progress"]
    if trunk == "fixed":
        slid = sum(trace[f"{point}_normal"] * trace[f"{point}_slide"] for point in ("toe", "heel"))
        down = trace["normal"] > 0
        assert progress == pytest.approx(-1e-3 * np.sum(slid[down] / trace["normal"][down]), rel=1e-9)
    else:
        assert progress == pytest.approx(trace["x"][-1], rel=1e-9, abs=1e-12)


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
    assert summary["stances"] == len(stance_peaks(trace, 0.05 * env.unwrapped.weight))
    assert summary["duty_factor"] == pytest.approx((trace["normal"] > 0).mean())
    assert summary["speed_m_s"] == pytest.approx(trace["x"][-1] / 10)
    work = summary["cost_of_transport"] * env.unwrapped.weight * summary["distance_m"]
    assert work == pytest.approx(summary["drive_work_j"])
