"""`Horse-v0`: what it commands and what it may be told, how its reference gait goes, and how episodes end."""

import copy
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, ROUGH, actions, make, same
from horses import SPEEDS, played, random_gaits, stride_phases

from hoof_env import Sb3VecEnv
from hoof_env.dynamics.advance import EngineKind
from hoof_env.dynamics.layout import Features
from hoof_env.episodes.scene import TaskKind
from hoof_env.episodes.step import step_kernels
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.gait import PARAMETERS, WIDEST
from hoof_env.leg.limb_masses import segment_masses, trunk_mass
from hoof_env.policies.record import describe, refuse_misfit
from hoof_env.tasks import horse_gaits as reference
from hoof_env.tasks.horse import COMMAND_STEP, HORSE_KERNELS, MASS, SPANS
from hoof_env.tasks.horse_gaits import (
    COUPLING,
    FASTEST,
    FOLLOWED,
    FOLLOWED_IN,
    LEGS,
    NAMES,
    HorseGait,
    commands_of,
    crank_angles,
    horse_gaits,
    reference_gaits,
)
from hoof_env.tasks.registry import TASKS


def commands(gait, theta, offset):
    """What the legs are commanded under offsets from a gait, written out: shape (4, 6)."""
    found, phases = np.zeros((4, 6)), np.zeros(4)
    grid = np.linspace(0, 2 * np.pi, 20001)
    for i in range(4):
        cosine, sine, *swing = gait[2 + 7 * (i // 2) : 9 + 7 * (i // 2)]
        slowness = 1 / (1 + cosine * np.cos(grid) + sine * np.sin(grid))
        mean = np.trapezoid(slowness, grid) / (2 * np.pi)
        here = 1 + cosine * np.cos(theta[i]) + sine * np.sin(theta[i])
        found[i, 0] = gait[0] * mean * here
        found[i, 1:] = swing
        passed = np.concatenate([[0], np.cumsum((slowness[1:] + slowness[:-1]) / 2) * grid[1]]) / mean
        phases[i] = np.interp(theta[i] % (2 * np.pi), grid, passed) - np.pi * (i % 2)
        phases[i] -= 2 * np.pi * gait[1] * (i < 2)
    found[:, 0] *= 1 + COUPLING / 4 * np.sin(phases - phases[:, None]).sum(1)
    each = SPANS * offset.reshape(4, 4)
    found[:, 0] *= 1 + each[:, 0]
    found[:, 1:4] += each[:, 1:]
    return found


@pytest.mark.parametrize("seed", range(4))
def test_the_command_is_the_reference_with_the_offset_and_the_pull(seed):
    """Against the sums written out, with the phase by quadrature."""
    env, rng = make(HORSE, target_speed=1.85), np.random.default_rng(seed)
    gait, action = random_gaits(1, seed)[0], rng.uniform(-1, 1, 16).astype(np.float32)
    env.reset(seed=seed, options={"gait": gait})
    theta = env.engine.state["crank_angle"][:, 0]
    measured = env.step(action)[4]["measured"]
    expected = commands(gait, theta, FOLLOWED * action.astype(float))
    names = ("crank_speed", "swing_offset", "swing_sin", "swing_cos", "swing_sin_2", "swing_cos_2")
    found = np.array([[measured[f"{leg}_command_{name}"] for name in names] for leg in LEGS])
    np.testing.assert_allclose(found[:, 1:], expected[:, 1:], atol=1e-6)
    np.testing.assert_allclose(found[:, 0], expected[:, 0], rtol=1e-6)


def test_offsets_follow_actions_and_fade_under_zeros():
    """Each goes its part of the way to the action in every step, none beyond 1, and starts at nothing."""
    env = make(HORSE, target_speed=1.85)
    places = [k for k, name in enumerate(env.observation_names) if name.startswith("offset: ")]
    seen, _ = env.reset(seed=0)
    expected = np.zeros(16)
    same(seen[places], expected.astype(np.float32))
    taken = np.concatenate([actions(1, 10, env_id=HORSE), np.full((10, 16), 5.0), np.zeros((30, 16))])
    for k, action in enumerate(taken):
        seen, *_ = env.step(action.astype(np.float32))
        expected += FOLLOWED * (np.clip(action, -1.0, 1.0) - expected)
        np.testing.assert_allclose(env.batch.rows.named.offset[:, 0], expected, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(seen[places], expected, atol=1e-6)
        if k == 19:
            assert 0.3 < expected.min() < expected.max() < 1.0
    assert 0.0 < np.abs(expected).max() < 0.05
    env.reset(seed=0)
    assert not env.batch.rows.named.offset.any()


@pytest.mark.parametrize("dt", [0.01, 0.02, 0.04])
def test_offsets_follow_actions_alike_in_time(dt):
    """However often a policy acts, an action that is held moves the offsets as far."""
    env = make(HORSE, target_speed=1.85, dt=dt)
    env.reset(seed=0)
    action = np.linspace(-1, 1, 16, dtype=np.float32)
    for _ in range(round(0.2 / dt)):
        env.step(action)
    expected = (1 - (1 - FOLLOWED) ** (0.2 / FOLLOWED_IN)) * action.astype(float)
    np.testing.assert_allclose(env.batch.rows.named.offset[:, 0], expected, rtol=1e-12)


def test_rough_ground_is_seen_as_what_it_changes():
    """The error of the speed and the loads of whole hooves are those that other entries add up to."""
    groups = ("trunk", "target", "load", "hoof", "offset")
    env = make(ROUGH, observation=groups)
    same_env = {
        name: getattr(env.settings, name) for name in ("terrain", "push_impulse", "push_seconds", "dt")
    }
    coarse = make(HORSE, observation=groups, **same_env)
    for each in (env, coarse):
        each.reset(seed=3)
    for action in actions(1, 30, env_id=ROUGH):
        fine, rough = (each.step(action.astype(np.float32))[0] for each in (env, coarse))
    raw, other = env.raw_observation(), coarse.raw_observation()
    assert raw["speed error"] == other["forward speed"] - other["commanded speed"]
    for leg in LEGS:
        leg = leg.replace("_", " ")
        assert raw[f"{leg}: load"] == pytest.approx(raw[f"{leg}: toe load"] + raw[f"{leg}: heel load"])
    names, places = env.observation_names, coarse.observation_names
    for name, ratio in (("vertical speed", 1 / 0.3), ("pitch", 5.0), ("pitch rate", 5.0)):
        seen = np.arctanh(float(rough[places.index(name)]))
        assert fine[names.index(name)] == pytest.approx(np.tanh(ratio * seen), abs=1e-5)


def test_zeros_from_the_start_are_the_reference_gait():
    env, gait = make(HORSE, target_speed=1.85), reference_gaits(np.array([1.85]))[0]
    env.reset(seed=0)
    for _ in range(20):
        theta = env.engine.state["crank_angle"][:, 0]
        measured = env.step(np.zeros(16, np.float32))[4]["measured"]
        expected = commands(gait, theta, np.zeros(16))[:, 0]
        found = [measured[f"{leg}_command_crank_speed"] for leg in LEGS]
        np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_the_motors_of_a_horse_are_observed_beside_what_they_are_asked_for():
    names = [f"{leg.replace('_', ' ')}: true rate of the crank" for leg in LEGS]
    plain = make(HORSE, drive="prescribed")
    assert not set(names) & set(plain.observation_names)
    plain.reset(seed=0)
    env = make(HORSE, drive="motor")
    assert set(names) <= set(env.observation_names)
    env.reset(seed=0)
    apart = 0.0
    for action in actions(0, 30, env_id=HORSE):
        for one in (plain, env):
            one.step(action)
        state = plain.engine.state
        np.testing.assert_array_equal(state["crank_angle_rate"], state["crank_speed"])
        raw, state = env.raw_observation(), env.engine.state
        np.testing.assert_array_equal([raw[name] for name in names], state["crank_angle_rate"][:, 0])
        apart = max(apart, np.abs(state["crank_angle_rate"] - state["crank_speed"]).max())
    assert apart > 0.01


def test_an_action_changes_the_command_of_its_name():
    env, names, commands_of = make(HORSE), make(HORSE).action_names, {}
    for k in (None, *range(16)):
        action = np.zeros(16, np.float32)
        action[slice(k, k if k is None else k + 1)] = 0.0 if k is None else 0.2
        env.reset(seed=0)
        measured = env.step(action)[4]["measured"]
        commands_of[k] = {name: value for name, value in measured.items() if "_command_" in name}
    assert len(names) == 16
    for k, name in enumerate(names):
        parameter = next(part for part in PARAMETERS if name.endswith(part))
        changed = {key for key, value in commands_of[k].items() if value != commands_of[None][key]}
        assert changed == {f"{name.removesuffix(parameter)}command_{parameter}"}


def test_the_phase_grows_evenly_in_time():
    gaits, phase = random_gaits(3), np.array([0.1, 0.4, 0.9])
    theta = crank_angles(gaits, phase, np.zeros((4, 3)))
    speed = commands_of(gaits, theta, 2)[::2, 0]
    later = crank_angles(gaits, phase + 1e-6, np.zeros((4, 3)))
    passed = (later - theta)[::2] / (1e-6 * 2 * np.pi / gaits[:, 0])
    np.testing.assert_allclose(passed, speed, rtol=1e-5)


def test_cranks_that_are_out_of_step_come_back():
    """A leg 0.1 strides ahead: the difference falls with the rate times the coupling, as sines do."""
    env = make(HORSE, target_speed=1.5)
    env.reset(seed=0, options={"phase": 0.0})
    rate = reference_gaits(np.array([1.5]))[0, 0]

    def ahead():
        """Of the other legs' mean phase [rad], by the gait that the kernels follow."""
        found = stride_phases(env)
        return np.angle(found[0] / np.sum(found[1:]))

    state = env.get_state()
    state["engine"]["limbs"][0, 0] += 0.4
    env.set_state(state)
    before, steps = ahead(), 150
    for _ in range(steps):
        *_, failed, _, _ = env.step(np.zeros(16, np.float32))
        assert not failed
    expected = before * np.exp(-rate * COUPLING * 0.02 * steps)
    assert abs(before) > 0.2
    assert abs(ahead()) < 0.5 * abs(before)
    assert ahead() == pytest.approx(expected, abs=0.1 * abs(before) + 0.05)


def test_what_has_the_former_spans_is_refused():
    env = make(HORSE)
    env.reset(seed=0)
    with pytest.raises(ParameterError, match=r"are offsets of 0\.4 and 0\.04 rad, got 'offsets'"):
        env.set_state({**env.get_state(), "actions": "offsets"})
    here = describe(env)
    with pytest.raises(DataFileError, match=r"actions offsets, expected offsets of 0\.4 and 0\.04 rad"):
        refuse_misfit(Path("policy"), {**here, "actions": "offsets"}, here)


def test_the_trunk_is_the_horse_without_its_limbs():
    assert TASKS["horse"].defaults["trunk_mass"] == pytest.approx(trunk_mass(MASS), abs=0.01)


@pytest.mark.parametrize("speed", SPEEDS)
def test_peaks_hang_on_the_hoof_and_not_on_how_hard_the_ground_is(speed):
    """The same commands on ground five times as stiff: stance peaks within 15 %."""
    peaks = []
    for stiffness in (2e6, 1e7):
        _, summaries = played(lambda seen, time: np.zeros(16), target_speed=speed, stiffness=stiffness)
        total, stances = (sum(one[name] for one in summaries) for name in ("stance_peak_sum_n", "stances"))
        peaks.append(total / stances)
    assert peaks[1] == pytest.approx(peaks[0], rel=0.15)


@pytest.mark.parametrize("speed", SPEEDS)
def test_semi_implicit_euler_is_exact_enough(speed):
    """The reference gait in a fifth of the step by a scheme of second order: speed, peak and duty factor."""
    found = []
    for settings in ({}, {"integrator": "midpoint", "sim_dt": 2e-4}):
        _, summaries = played(lambda seen, time: np.zeros(16), target_speed=speed, **settings)
        peak = np.mean([one["stance_peak_sum_n"] / one["stances"] for one in summaries])
        found.append([peak, *(np.mean([one[k] for one in summaries]) for k in ("speed_m_s", "duty_factor"))])
    np.testing.assert_allclose(found[0], found[1], rtol=0.01)


@pytest.mark.parametrize("speed", SPEEDS)
def test_zeros_travel_and_stay_upright(speed):
    _totals, summaries = played(lambda seen, time: np.zeros(16), target_speed=speed)
    assert not any(one["failed"] for one in summaries)
    assert np.mean([one["slip_m"] for one in summaries]) < 0.10
    assert np.mean([one["speed_m_s"] for one in summaries]) > 0.85 * speed


@pytest.mark.parametrize("size", [1.0, 0.5])
def test_commands_change_a_little_at_a_time(size):
    env = make(HORSE, target_speed=(0.9, 2.6), target_seconds=(0.1, 0.1), size=size, episode_seconds=20.0)
    env.reset(seed=1)
    seen = [float(env.batch.rows.named.target[0])]
    for _ in range(500):
        *_, failed, _, _ = env.step(np.zeros(16, np.float32))
        seen.append(float(env.batch.rows.named.target[0]))
        if failed:
            break
    steps = np.abs(np.diff(seen))
    assert 0.3 * size**0.5 < steps.max() <= 0.5 * size**0.5
    assert np.count_nonzero(steps) > 10
    assert 0.9 <= min(seen) <= max(seen) <= 2.6


@pytest.mark.parametrize("size", [1.0, 0.6])
def test_the_reference_follows_the_command(size):
    """Between the stored speeds and beyond them, for an animal of any size; not while the command stays."""
    envs = Sb3VecEnv(HORSE, 16, size=size, target_speed=(0.5, 4.0), target_seconds=(0.2, 0.5))
    envs.seed(1)
    envs.reset()
    now, seen = envs.unwrapped.envs.batch.rows.named, set()
    for _ in range(60):
        envs.step(np.zeros((16, 16), np.float32))
        expected = reference_gaits(now.target[:16] / size**0.5)
        expected[:, 0] /= size**0.5
        np.testing.assert_allclose(now.gait[:, :16].T, expected, rtol=1e-13, atol=1e-15)
        seen |= set(now.target[:16].tolist())
    assert len(seen) >= 48
    assert min(seen) < SPEEDS[0] * size**0.5 < max(seen)


def test_commands_are_drawn_as_numbers_between_their_bounds():
    """One draw for the time and one for the speed, as `Generator.uniform` makes them."""
    env = make(HORSE, target_speed=(1.3, 2.6), target_seconds=(0.5, 1.0))
    env.reset(seed=3)
    now, twin = env.batch.rows.named, copy.deepcopy(env.np_random)
    for _ in range(50):
        if now.steps[0] + 1 == now.switch[0]:
            break
        env.step(np.zeros(16, np.float32))
    env.step(np.zeros(16, np.float32))
    steps, target = now.steps[0], now.target[0]
    assert now.switch[0] == steps + round(twin.uniform(0.5, 1.0) / 0.02)
    low, high = max(1.3, target - COMMAND_STEP), min(2.6, target + COMMAND_STEP)
    assert now.next_target[0] == pytest.approx(twin.uniform(low, high), rel=1e-15)


def test_kernels_are_others_where_the_number_of_stored_gaits_is(monkeypatch):
    def kernels():
        task, features = TASKS["horse"], Features(2, has_springs=True, has_limits=True)
        body = HORSE_KERNELS._replace(task_fields=tuple(reference.reference_type()))
        engine = EngineKind(features, None, known=())
        return step_kernels(TaskKind(task.terms, task.entries, body, None, engine, known=()), is_scalar=False)

    before, stored = kernels(), reference._reference()
    assert kernels() is before
    monkeypatch.setattr(reference, "_reference", lambda: tuple(values[::2] for values in stored))
    assert kernels() is not before


def test_a_gait_that_is_given_lasts_while_commands_change():
    env = make(HORSE, gait="walk", target_speed=(1.3, 1.8), target_seconds=(0.1, 0.2))
    env.reset(seed=1)
    seen = set()
    for _ in range(40):
        env.step(np.zeros(16, np.float32))
        same(env.batch.rows.named.gait[:, 0], horse_gaits()["walk"].to_array())
        seen.add(float(env.batch.rows.named.target[0]))
    assert len(seen) >= 4


def test_gaits_by_name_class_and_numbers_are_the_same():
    name, gait = next(iter(horse_gaits().items()))
    seen = [make(HORSE).reset(seed=0, options={"gait": given})[0] for given in (name, gait, gait.to_array())]
    same(seen[0], seen[1]), same(seen[0], seen[2])
    assert HorseGait.from_array(gait.to_array()) == gait
    assert len(gait.to_array()) == len(NAMES)
    with pytest.raises(ParameterError, match="fore: expected 7 numbers"):
        HorseGait(6.0, 0.0, (0.0,), (0.0,))
    with pytest.raises(ParameterError, match=r"fore\['speed_cos'\]"):
        HorseGait(6.0, 0.0, (2.0, *[0.0] * 6), (0.0,) * 7)


def test_gaits_given_for_each_environment_go_to_the_rows_that_start():
    envs, gaits = gym.make_vec(HORSE, num_envs=3), random_gaits(3, seed=5)
    envs.reset(seed=0, options={"gait": gaits})
    same(envs.unwrapped.batch.rows.start_values[-len(NAMES) :, :], gaits.T)
    changed = gaits[::-1].copy()
    envs.reset(options={"gait": changed, "reset_mask": np.array([False, False, True])})
    same(
        envs.unwrapped.batch.rows.start_values[-len(NAMES) :, :], np.array([gaits[0], gaits[1], changed[2]]).T
    )


def test_commands_are_clipped_to_what_the_page_says():
    env, gait = make(HORSE), reference_gaits(np.array([SPEEDS[0]]))[0]
    gait[0], gait[[4, 11]] = FASTEST, 2.0  # swing offsets
    env.reset(seed=0, options={"gait": gait})
    measured = env.step(np.ones(16, np.float32))[4]["measured"]
    assert max(measured[f"{leg}_command_crank_speed"] for leg in LEGS) == FASTEST
    assert all(measured[f"{leg}_command_swing_offset"] == WIDEST["swing_offset"][1] for leg in LEGS)


def test_motors_of_the_task_carry_a_horse():
    _, summaries = played(lambda seen, time: np.zeros(16), drive="motor")
    assert not any(one["failed"] for one in summaries)


def test_a_fall_ends_the_episode_and_says_why():
    env = make(HORSE)
    env.reset(seed=0, options={"pitch": 0.39, "target_speed": 0.5})
    for _ in range(100):
        *_, failed, _, info = env.step(np.zeros(16, np.float32))
        if failed:
            break
    assert failed
    assert "joint" in str(info["end"])
    assert info["reward_fall"] == pytest.approx(-15.0)


def test_nothing_but_legs_and_weight_acts_on_the_trunk():
    trunk = make(HORSE).engine.trunk
    assert (trunk.kind, trunk.drag) == ("free", 0.0)


def test_fore_limbs_bear_the_masses_of_fore_limbs():
    limbs = make(HORSE).engine.limbs
    for k, limb in enumerate(limbs):
        own = sum(segment_masses(LEGS[k].partition("_")[2], 475.0).values())
        assert limb.geometry.mass == pytest.approx(own, rel=1e-6)
    assert limbs[0].geometry.mass != pytest.approx(limbs[2].geometry.mass, rel=0.01)


def test_sums_of_the_legs_are_the_summary():
    env = make(HORSE, episode_seconds=1.0, target_speed=1.85)
    env.reset(seed=2)
    stances = slip = work = 0.0
    done = False
    while not done:
        *_, failed, truncated, info = env.step(np.zeros(16, np.float32))
        measured, done = info["measured"], failed or truncated
        stances += sum(measured[f"{leg}_stances"] for leg in LEGS)
        slip += sum(measured[f"{leg}_slip"] for leg in LEGS)
        work += sum(measured[f"{leg}_positive_work"] for leg in LEGS)
    figures = info["episode_summary"]
    assert figures["stances"] == stances > 3
    assert figures["slip_m"] == pytest.approx(slip / stances)
    assert figures["positive_work_j"] == pytest.approx(work)


def test_stable_baselines_takes_it():
    envs = Sb3VecEnv(HORSE, 8, episode_seconds=0.5)
    assert envs.reset().shape == (8, 66)
    for taken in actions(0, 60, 8, env_id=HORSE):
        _observations, rewards, _dones, _infos = envs.step(taken)
    assert np.isfinite(rewards).all()
