"""The reward pays what it says."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from family import FALLS, actions, running_peak_charge, together
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.envs.policies import make_policy, start_of
from hoof_env.tasks.reward import BEARING, MAX_STRIDE, STEPPING
from hoof_env.tasks.reward import TERMS as TABLE

TERMS = [term.key for term in TABLE]
WEIGHTS = {term.name: term.weight for term in TABLE}
DT, H = 0.02, 1e-3


def rollout(env, policy, seed):
    """Infos of one episode, and its substeps by name."""
    observation, _ = env.reset(seed=seed, options=start_of(policy))
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
    for normal, theta, grf in zip(trace["normal"], trace["crank_angle"], trace["grf"], strict=True):
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


def borne(impulses):
    """What bearing is paid for, from the impulse of each control step divided by the weight [s]: a bucket
    fills with `BEARING` and holds what `MAX_STRIDE` gives; an impulse that finds it empty is deducted."""
    found, bucket = [], BEARING * MAX_STRIDE
    for impulse in impulses:
        bucket = min(bucket + BEARING * DT, BEARING * MAX_STRIDE)
        paid = min(impulse, bucket)
        bucket -= paid
        found.append(paid - (impulse - paid))
    return np.array(found)


def impulses_of(trace, weight):
    """Of the control steps, divided by the weight [s]."""
    return steps_of(H * trace["normal"]) / weight


def slides_of(trace, threshold):
    """Way that the hoof slides in stance in each control step, its points weighted with their loads [m]."""
    rubbed = sum(trace[f"{point}_normal"] * np.abs(trace[f"{point}_slide"]) for point in ("toe", "heel"))
    stance = trace["normal"] > threshold
    return steps_of(H * np.where(stance, rubbed, 0.0) / np.where(stance, trace["normal"], 1.0))


@pytest.mark.parametrize("name", ["walk", "run", "drag", "random"])
@pytest.mark.parametrize("trunk", ["suspended", "rail", "fixed"])
def test_terms_are_what_they_say_of_the_substeps(name, trunk):
    weights = {"overspeed": 3.0, "loading": 0.5, "slip": 0.7}
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
    assert paid["reward_peak"].sum() == pytest.approx(-WEIGHTS["peak"] * charge / 1000, rel=1e-9)
    assert paid["reward_loading"].sum() == pytest.approx(-0.5 * sum(rates) / 1e6, rel=1e-9)
    work = np.sum(np.maximum(trace["crank_power"], 0) + np.maximum(trace["hip_power"], 0)) * H
    assert paid["reward_energy"].sum() == pytest.approx(-WEIGHTS["energy"] * work / 1000, rel=1e-9)
    slides = slides_of(trace, threshold)
    np.testing.assert_allclose(paid["reward_slip"], -0.7 * slides, rtol=1e-9, atol=1e-12)
    assert slides.sum() > 0.1
    assert summary["slip_m"] == pytest.approx(slides.sum() / max(len(peaks), 1), rel=1e-9)
    if trunk == "fixed":
        slid = sum(trace[f"{point}_normal"] * trace[f"{point}_slide"] for point in ("toe", "heel"))
        down = trace["normal"] > 0
        progress = steps_of(-H * np.where(down, slid, 0.0) / np.where(down, trace["normal"], 1.0))
    else:
        progress = np.diff(ends_of(trace["x"]), prepend=0.0)
    commanded = 2.5 * DT
    pace = np.minimum(np.clip(progress / commanded, -1, 1), ends_of(trace["crank_angle_rate"]) / STEPPING)
    bore = borne(impulses_of(trace, env.unwrapped.weight))
    expected = {
        "reward_progress": WEIGHTS["progress"] * np.minimum(progress, commanded),
        "reward_overspeed": -3.0 * np.maximum(progress - commanded, 0.0),
        "reward_support": WEIGHTS["support"] * np.minimum(pace * bore, np.abs(pace) * bore),
    }
    for term, values in expected.items():
        np.testing.assert_allclose(paid[term], values, rtol=1e-9, atol=1e-12, err_msg=term)


def test_bearing_without_a_commanded_speed_pays_at_any():
    """But only a leg whose crank turns."""
    env = gym.make("hoof_env/HorseLegRail-v0", episode_seconds=4.0, reward_weights={"support": 2.0})
    infos, trace = rollout(env, make_policy("run", env), 4)
    pace = np.minimum(1.0, ends_of(trace["crank_angle_rate"]) / STEPPING)
    expected = pace * borne(impulses_of(trace, env.unwrapped.weight))
    found = [info["reward_support"] for info in infos]
    np.testing.assert_allclose(found, 2.0 * expected, rtol=1e-9, atol=1e-12)
    assert sum(info["reward_progress"] for info in infos) == pytest.approx(5.0 * trace["x"][-1], rel=1e-9)
    assert all(info["reward_overspeed"] == 0.0 for info in infos)


PRESSING = {"trunk_share": 1.0, "trunk_stiffness": 0.0}
"""A leg that alone holds up a suspended trunk bears the whole weight in the mean, more than is paid for."""


@given(
    held=st.sampled_from([{}, PRESSING, {"trunk": "rail", "hip_height": 1.6}]),
    target=st.sampled_from([None, 2.5, (1.0, 3.5)]),
    gait=st.sampled_from([None, "run", "walk", "carrying_walk"]),
    size=st.floats(0.0, 1.0),
    seed=st.integers(0, 1000),
)
@settings(max_examples=30, deadline=None)
def test_no_more_than_the_mean_allowance_is_paid_whatever_is_done(held, target, gait, size, seed):
    """In any episode and at any time of it, however much is borne."""
    env = gym.make("hoof_env/HorseLeg-v0", **held, target_speed=target, episode_seconds=6.0).unwrapped
    env.reset(seed=seed, options={"gait": gait} if gait else {})
    paid = np.cumsum([0.0])
    for action in size * actions(seed, 300):
        _, _, terminated, truncated, info = env.step(action.astype(np.float32))
        paid = np.append(paid, paid[-1] + info["reward_support"])
        time = env.episode_summary()["seconds"]
        assert paid.max() <= WEIGHTS["support"] * BEARING * (time + MAX_STRIDE) + 1e-9
        if terminated or truncated:
            break


def test_who_bears_too_much_has_the_excess_taken_off():
    """The bound is reached within a stride, and then pressing costs what it would have been paid."""
    env = gym.make("hoof_env/HorseLeg-v0", **PRESSING, target_speed=None, episode_seconds=20.0).unwrapped
    env.reset(seed=1, options={"gait": "run"})
    paid, impulses, allowances, done = [], [], [], False
    while not done:
        _, _, terminated, truncated, info = env.step(np.zeros(4, np.float32))
        paid.append(info["reward_support"] / WEIGHTS["support"])
        impulses.append(info["measured"]["normal_impulse"] / env.weight)
        allowances.append(env.raw_observation()["bearing allowance"])
        done = terminated or truncated
    assert truncated
    paid, impulses, allowances = np.array(paid), np.array(impulses), np.array(allowances)
    seconds, used = 20.0, (paid + impulses) / 2  # what was paid, of the impulse that was borne
    assert impulses.sum() > 0.95 * seconds > BEARING * (seconds + MAX_STRIDE)
    assert BEARING * seconds < used.sum() <= BEARING * (seconds + MAX_STRIDE)
    assert paid.sum() == pytest.approx(2 * used.sum() - impulses.sum())
    np.testing.assert_allclose(paid, borne(impulses), atol=1e-9)
    assert allowances.min() == 0.0
    assert allowances.max() <= BEARING * MAX_STRIDE
    assert (paid[allowances == 0.0] < impulses[allowances == 0.0]).any()


def test_a_collapse_terminates_and_is_charged_once():
    env = gym.make("hoof_env/HorseLeg-v0", **FALLS, reward_weights={"failure": 7.0})
    infos, trace = rollout(env, make_policy("airborne", env), 0)
    assert "height" in str(infos[-1]["end"])
    rest = 10.0 - infos[-1]["episode_summary"]["seconds"]
    assert 0.0 < rest < 10.0
    assert infos[-2]["reward_failure"] == 0.0
    assert infos[-1]["reward_failure"] == pytest.approx(-7.0 * rest)
    assert infos[-1]["episode_summary"]["failed"] == 1.0
    assert trace["y"][-1] < 0.6 * env.unwrapped.engine.trunk.height < trace["y"][-21]


def test_summary_agrees_with_the_substeps():
    env = gym.make("hoof_env/HorseLeg-v0")
    infos, trace = rollout(env, make_policy("run", env), 1)
    summary = infos[-1]["episode_summary"]
    assert summary["seconds"] == pytest.approx(10.0)
    assert summary["mean_normal_n"] == pytest.approx(trace["normal"].mean())
    assert summary["highest_grf_n"] == pytest.approx(trace["grf"].max(), rel=1e-12)
    peaks, rates = stances(trace, 0.05 * env.unwrapped.weight)
    assert summary["stances"] == len(peaks)
    assert summary["stance_peak_sum_n"] == pytest.approx(sum(peaks), rel=1e-9)
    assert summary["loading_rate_n_s"] == pytest.approx(np.mean(rates), rel=1e-9)
    assert summary["duty_factor"] == pytest.approx((trace["normal"] > 0).mean())
    assert summary["speed_m_s"] == pytest.approx(trace["x"][-1] / 10)
    work = summary["cost_of_transport"] * env.unwrapped.weight * summary["distance_m"]
    assert work == pytest.approx(summary["positive_work_j"])
