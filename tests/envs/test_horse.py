"""`Horse-v0`: what it commands, where it starts and ends, and that tricks stay below the reference gait."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, actions, make, same

from hoof_env import Sb3VecEnv, register
from hoof_env.dynamics.parts import GRAVITY
from hoof_env.envs.horse import GAP, MASS, PHASE_SPREAD, PITCH_SPREAD, SPEED_SPREAD
from hoof_env.envs.policies import make_policy
from hoof_env.envs.reference import (
    COUPLING,
    FASTEST,
    LEGS,
    LIMITS,
    NAMES,
    HorseGait,
    PairReference,
    crank_angles,
    horse_gaits,
    reference_gaits,
    rows_of,
    trunk_motion,
)
from hoof_env.envs.tasks import _OWN, TASKS
from hoof_env.errors import ParameterError
from hoof_env.gait import WIDEST
from hoof_env.leg.limb_masses import segment_masses, trunk_mass

SPEEDS = (1.853, 2.62)  # Froude numbers 0.25 and 0.5
SEEDS = 40
MARGIN = 100.0
"""Return over ten seconds by which the reference gait is ahead of what is no gait."""


def random_gaits(n, seed=0):
    """Some that a search might try."""
    rng = np.random.default_rng(seed)
    gaits = np.tile(reference_gaits(np.array([1.85]))[0], (n, 1))
    low, high = np.transpose([(0.1, FASTEST), (-10.0, 10.0), *[*LIMITS.values()] * 2])
    return np.clip(gaits + rng.uniform(-0.05, 0.05, gaits.shape), low, high)


def commands(gait, theta, action):
    """What the legs are commanded, written out: shape (4, 6)."""
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
    each = action.reshape(4, 4)
    found[:, 0] *= 1 + each[:, 0]
    found[:, 1:4] += 0.2 * each[:, 1:]
    return found


@pytest.mark.parametrize("seed", range(4))
def test_the_command_is_the_reference_with_the_action_and_the_pull(seed):
    """Against the sums written out, with the phase by quadrature."""
    env, rng = make(HORSE, target_speed=1.85), np.random.default_rng(seed)
    gait, action = random_gaits(1, seed)[0], rng.uniform(-1, 1, 16).astype(np.float32)
    env.reset(seed=seed, options={"gait": gait})
    theta = env.engine.state["theta"][:, 0]
    measured = env.step(action)[4]["measured"]
    expected = commands(gait, theta, action.astype(float))
    names = ("crank_speed", "swing_offset", "swing_sin", "swing_cos", "swing_sin_2", "swing_cos_2")
    found = np.array([[measured[f"{leg}_command_{name}"] for name in names] for leg in LEGS])
    np.testing.assert_allclose(found[:, 1:], expected[:, 1:], atol=1e-6)
    np.testing.assert_allclose(found[:, 0], expected[:, 0], rtol=1e-6)


def test_the_phase_grows_evenly_in_time():
    gaits, phase = random_gaits(3), np.array([0.1, 0.4, 0.9])
    theta = crank_angles(gaits, phase, np.zeros((4, 3)))
    rows = rows_of(gaits).reshape(2, -1, 3)
    speed = rows[:, 0] * (1 + rows[:, 1] * np.cos(theta[::2]) + rows[:, 2] * np.sin(theta[::2]))
    later = crank_angles(gaits, phase + 1e-6, np.zeros((4, 3)))
    passed = (later - theta)[::2] / (1e-6 * 2 * np.pi / gaits[:, 0])
    np.testing.assert_allclose(passed, speed, rtol=1e-5)


def test_cranks_that_are_out_of_step_come_back():
    """A leg 0.1 strides ahead: the difference falls with the rate times the coupling, as sines do."""
    env = make(HORSE, target_speed=1.5)
    env.reset(seed=0, options={"phase": 0.0})
    rate = reference_gaits(np.array([1.5]))[0, 0]

    def ahead():
        """Of the other legs' mean phase [rad], by the kernels' own rows."""
        theta, rows = env.engine.state["theta"][:, 0], env.batch.episode[-2 * PairReference.size :, 0]
        found = []
        for i in range(4):
            _, u, v, f, g, half, turn_x, turn_y, *_ = rows[PairReference.size * (i // 2) :]
            z, w = np.exp(1j * theta[i]), u + 1j * v
            phase = (half * z + (f + 1j * g) * z.conj() + w) / (1 + (w.conjugate() * z).real)
            found.append(phase * (turn_x + 1j * turn_y) * (-1) ** i)
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


def test_rates_of_the_trunk_are_those_of_its_places():
    """By differences over the phase, on which the crank's angle in the mean is 2 pi a stride."""
    speeds, phase, step = np.array([1.3, 1.9, 2.7]), np.array([0.2, 0.5, 0.85]), 1e-6
    here, there = (trunk_motion(speeds, phase + way * step) for way in (-1, 1))
    for place, rate in (("y", "vy"), ("pitch", "pitch_rate")):
        slope = (there[place] - here[place]) / (2 * step * 2 * np.pi)
        np.testing.assert_allclose(trunk_motion(speeds, phase)[rate], slope, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("size", [1.0, 0.5])
def test_an_episode_starts_as_the_reference_gait_goes_on(size):
    """Where a horse is after some strides is where another one would start at that phase: heights within a
    hundredth of the hips' height, pitch within a hundredth of a radian, most of the time."""
    speed = SPEEDS[0] * size**0.5
    envs = gym.make_vec(HORSE, num_envs=64, target_speed=speed, size=size)
    envs.reset(seed=0)
    for _ in range(300):
        *_, infos = envs.step(np.zeros((64, 16), np.float32))
    measured, body = infos["measured"], envs.unwrapped.batch.body
    gait = reference_gaits(np.array([SPEEDS[0]]))
    angles = crank_angles(np.tile(gait, (1000, 1)), np.arange(1000) / 1000, np.zeros((4, 1000)))[2]
    phase = np.interp(measured["left_hind_theta"] % (2 * np.pi), *sorted_pairs(angles))
    motion = trunk_motion(np.full(64, SPEEDS[0]), phase)
    off = {"y": measured["y"] / body.height - motion["y"], "pitch": measured["pitch"] - motion["pitch"]}
    assert np.median(np.abs(off["y"])) < 0.01
    assert np.median(np.abs(off["pitch"])) < 0.01


def sorted_pairs(angles):
    """Angles that grow, with their phases."""
    order = np.argsort(angles)
    return angles[order], order / len(angles)


def test_the_trunk_is_what_the_limbs_leave_of_the_horse():
    assert TASKS["horse"].defaults["trunk_mass"] == pytest.approx(trunk_mass(MASS), abs=0.01)


@pytest.mark.parametrize("speed", [1.3, *SPEEDS, 3.706])
def test_no_start_is_a_fall(speed):
    envs = gym.make_vec(HORSE, num_envs=256, target_speed=speed)
    envs.reset(seed=1)
    for _ in range(50):
        *_, failed, _, _ = envs.step(np.zeros((256, 16), np.float32))
        assert not failed.any()


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


def played(act, **settings):
    """Returns and summaries of `SEEDS` episodes of ten seconds side by side."""
    envs = gym.make_vec(HORSE, num_envs=SEEDS, autoreset_mode="SAME_STEP", **settings)
    seen, _ = envs.reset(seed=0)
    total, ended, found = np.zeros(SEEDS), np.zeros(SEEDS, bool), [None] * SEEDS
    for step in range(500):
        taken = np.broadcast_to(np.asarray(act(seen, 0.02 * step), np.float32), (SEEDS, 16))
        seen, rewards, failed, truncated, infos = envs.step(taken)
        total += np.where(ended, 0.0, rewards)
        for env in np.flatnonzero((failed | truncated) & ~ended):
            figures = infos["final_info"]["episode_summary"]
            found[env] = {name: figures[name][env] for name in figures if not name.startswith("_")}
        ended |= failed | truncated
    return total, found


def bang_bang(pace):
    return lambda seen, time: np.full(16, 1.0 if round(time / 0.02) // pace % 2 else -1.0)


def hop(seen, time):
    """All cranks stopped, all legs swung together."""
    action = np.zeros((4, 4))
    action[:, 0], action[:, 1] = -1.0, np.sin(2 * np.pi * 3 * time)
    return action.ravel()


def brake(seen, time):
    """The fore legs against the hind legs."""
    action = np.zeros((4, 4))
    action[:2, 1], action[2:, 1] = 1.0, -1.0
    return action.ravel()


def skate(seen, time):
    """Cranks slowed down, hoofs dragged by the swing."""
    action = np.zeros((4, 4))
    action[:, 0] = -0.5
    action[::2, 1] = np.sin(2 * np.pi * time)
    action[1::2, 1] = -np.sin(2 * np.pi * time)
    return action.ravel()


def die(seen, time):
    """The fore legs folded: the sooner it falls, the less else it pays."""
    action = np.zeros((4, 4))
    action[:2] = (1.0, -1.0, -1.0, 1.0)
    return action.ravel()


TRICKS = {"hop": hop, "brake": brake, "skate": skate, "die": die} | {
    f"bang-bang {pace}": bang_bang(pace) for pace in (3, 6, 12, 25)
}


@pytest.fixture(scope="module")
def reference():
    return played(lambda seen, time: np.zeros(16))[0].mean()


@pytest.mark.parametrize("name", TRICKS)
def test_tricks_stay_below_the_reference(reference, name):
    assert played(TRICKS[name])[0].mean() < reference - MARGIN


def terms_of(act):
    """Of the reward, by name, for a second of 40 horses that have not fallen."""
    envs = gym.make_vec(HORSE, num_envs=SEEDS, autoreset_mode="SAME_STEP", target_speed=SPEEDS[0])
    envs.reset(seed=0)
    standing, total, count = np.ones(SEEDS, bool), {}, 0
    for step in range(250):
        taken = np.broadcast_to(np.asarray(act(None, 0.02 * step), np.float32), (SEEDS, 16))
        _, _, failed, truncated, infos = envs.step(taken)
        standing &= ~(failed | truncated)
        count += standing.sum()
        for name in (name for name in infos if name.startswith("reward_")):
            total[name] = total.get(name, 0.0) + infos[name][standing].sum()
    return {name: 50 * value / count for name, value in total.items()}


@pytest.fixture(scope="module")
def own_terms():
    return terms_of(lambda seen, time: np.zeros(16))


@pytest.mark.parametrize(
    ("name", "term", "factor"),
    [
        ("hop", "peak", 3), ("hop", "landing", 3), ("skate", "slip", 8), ("brake", "slip", 5),
        ("brake", "pitch", 3), ("bang-bang 3", "work", 10), ("bang-bang 3", "peak", 8),
    ],
)  # fmt: skip
def test_a_trick_is_charged_for_what_it_does(own_terms, name, term, factor):
    """So many times what the reference gait is charged for it."""
    charged, usual = terms_of(TRICKS[name])[f"reward_{term}"], own_terms[f"reward_{term}"]
    assert charged < factor * usual < 0


@pytest.mark.parametrize("size", [1.0, 0.5])
def test_the_trunk_starts_with_the_rates_of_its_motion(size):
    """By differences over a thousandth of a stride."""
    env, phase, speed, step = make(HORSE, size=size), 0.3, SPEEDS[0] * size**0.5, 1e-3
    env.reset(seed=0, options={"phase": phase, "target_speed": speed})
    now, then = (trunk_motion(np.array([SPEEDS[0]]), np.array([at])) for at in (phase, phase + step))
    seconds = step * 2 * np.pi / reference_gaits(np.array([SPEEDS[0]]))[0, 0] * size**0.5
    report = env.engine.report
    rise = float((then["y"] - now["y"])[0]) * 1.4 * size / seconds
    turn = float((then["pitch"] - now["pitch"])[0]) / seconds
    assert report["vy"][0] == pytest.approx(rise, rel=0.02, abs=0.003)
    assert report["pitch_rate"][0] == pytest.approx(turn, rel=0.02, abs=0.003)
    assert abs(rise) > 0.02 * size**0.5


@pytest.mark.parametrize("name", ["idle", "random"])
def test_simple_policies_stay_below_the_reference(reference, name):
    policy = make_policy(name, gym.make(HORSE))
    assert played(lambda seen, time: policy.predict(seen)[0])[0].mean() < reference - MARGIN


def test_a_pony_is_a_similar_horse():
    """Half the length: masses go with the cube; the legs' own laws hold, whatever the size."""
    one, half = make(HORSE), make(HORSE, size=0.5)
    assert half.weight == pytest.approx(one.weight / 8)
    assert half.geometry.hip_height == pytest.approx(one.geometry.hip_height / 2)
    assert half.engine.limbs[0].spring.stiffness == pytest.approx(one.engine.limbs[0].spring.stiffness / 4)
    assert one.weight == pytest.approx(475 * GRAVITY, rel=1e-4)


def similar_world(size):
    """Settings under which a horse of some size moves as one of size 1 does, in time that goes with the root:
    what the animal does not scale is scaled here."""
    pace = size**0.5
    return {
        "size": size, "stiffness": 2e6 * size**1.5, "sim_dt": 1e-3 * pace, "dt": 0.02 * pace,
        "episode_seconds": 10.0 * pace, "target_speed": 3.0 * pace,
    }  # fmt: skip


def dimensionless(env, measured):
    """Places, speeds and loads of the instant."""
    size, found = env.batch.body.size, []
    units = {"x": size, "y": size, "vx": size**0.5, "pitch": 1.0, "pitch_rate": size**-0.5}
    for leg in LEGS:
        units |= {f"{leg}_theta": 1.0, f"{leg}_crank_speed": size**-0.5, f"{leg}_swing_sin": 1.0}
        units |= {f"{leg}_load": size**3, f"{leg}_command_crank_speed": size**-0.5}
    found = [measured[name] / unit for name, unit in units.items()]
    return np.array(found)


@pytest.mark.parametrize("drive", ["prescribed", "motor"])
@pytest.mark.parametrize("size", [0.7, 2.0])
def test_in_a_similar_world_all_sizes_move_alike(size, drive):
    """Filters, the cap on a crank's speed, springs, dampers, motors and the approach floor are scaled: else
    this differs in the first digits. Actions are large enough for commands to meet their cap."""
    envs = [make(HORSE, drive=drive, **similar_world(each)) for each in (1.0, size)]
    for env in envs:
        env.reset(seed=3)
    capped = 0
    for action in 0.5 * actions(4, 25, env_id=HORSE):
        action[::4] += 0.5
        one, other = (dimensionless(env, env.step(action)[4]["measured"]) for env in envs)
        np.testing.assert_allclose(other, one, rtol=1e-5, atol=1e-5)
        capped += int((one == FASTEST).sum())
    assert capped > 3


@pytest.mark.parametrize("size", [0.5, 2.0])
def test_horses_of_all_sizes_fall_at_the_same_instant(size):
    """The fore legs folded, to the thousandth of a second of a horse of size 1: limits go with the size."""
    last = []
    for each in (1.0, size):
        env = make(HORSE, **similar_world(each) | {"dt": 1e-3 * each**0.5, "target_speed": 1.5 * each**0.5})
        env.reset(seed=0)
        steps, failed = 0, False
        while not failed and steps < 1500:
            *_, failed, _, info = env.step(die(None, 0.0).astype(np.float32))
            steps += 1
        last.append((steps, info.get("failure", "")))
    assert "joint" in last[0][1]
    assert last[1] == last[0]


def figures(size, froude, world=None):
    """What 40 horses that go at a Froude number for 8 sqrt(size) seconds show: speed over sqrt(g L), slip of
    a stance over L, peaks over the weight, stances."""
    hips = 1.4 * size
    settings = {**(world or {}), "size": size, "episode_seconds": 30.0}
    settings["target_speed"] = (froude * GRAVITY * hips) ** 0.5
    envs = gym.make_vec(HORSE, num_envs=SEEDS, **settings)
    envs.reset(seed=0)
    for _ in range(round(8 * size**0.5 / envs.unwrapped.dt)):
        *_, failed, _, _ = envs.step(np.zeros((SEEDS, 16), np.float32))
        assert not failed.any()
    shown = envs.unwrapped.episode_summary()
    peaks = shown["stance_peak_sum_n"] / shown["stances"] / envs.unwrapped.weight
    found = shown["speed_m_s"] / (GRAVITY * hips) ** 0.5, shown["slip_m"] / hips, peaks, shown["stances"]
    return np.mean(found, axis=1)


@pytest.mark.parametrize("size", [0.7, 2.0])
def test_fast_gaits_of_all_sizes_are_alike_in_a_similar_world(size):
    """To a hundredth; if filters are not scaled one of size 2 slips 10 % more, one of size 0.7 2 % less."""
    np.testing.assert_allclose(figures(size, 1.0, similar_world(size)), figures(1.0, 1.0), rtol=0.01)


@pytest.mark.parametrize("size", [0.7, 2.0])
def test_walks_of_all_sizes_are_alike_on_the_same_ground(size):
    """As far as ground and time steps that are not scaled allow. A horse of size 2 slips 3 % more, with peaks
    that are 2.4 % lower, one of size 0.7 slips 1 % more; with filters that are not scaled that one slips 6 %
    more."""
    found = figures(size, 0.25) / figures(1.0, 0.25)
    assert (np.abs(found - 1) < [0.01, 0.045, 0.04, 0.01]).all(), found


@pytest.mark.parametrize("size", [0.7, 1.2])
def test_ponies_travel(size):
    speed = 1.853 * size**0.5
    _, summaries = played(lambda seen, time: np.zeros(16), target_speed=speed, size=size)
    assert np.mean([one["failed"] for one in summaries]) < 0.1
    assert np.mean([one["speed_m_s"] for one in summaries]) == pytest.approx(speed, rel=0.2)


@pytest.mark.parametrize("size", [1.0, 0.5])
def test_commands_change_a_little_at_a_time(size):
    env = make(HORSE, target_speed=(0.9, 2.6), target_seconds=(0.1, 0.1), size=size, episode_seconds=20.0)
    env.reset(seed=1)
    seen = [float(env.batch.now.target[0])]
    for _ in range(500):
        *_, failed, _, _ = env.step(np.zeros(16, np.float32))
        seen.append(float(env.batch.now.target[0]))
        if failed:
            break
    steps = np.abs(np.diff(seen))
    assert 0.3 * size**0.5 < steps.max() <= 0.5 * size**0.5
    assert np.count_nonzero(steps) > 10
    assert 0.9 <= min(seen) <= max(seen) <= 2.6


def test_the_reference_follows_the_command():
    env = make(HORSE, target_speed=(1.3, 2.6), target_seconds=(0.5, 1.0))
    env.reset(seed=1)
    seen = set()
    for _ in range(150):
        env.step(np.zeros(16, np.float32))
        rows = env.batch.episode[env.batch._episode_layout.rows("fore").start :, 0]
        same(rows, rows_of(reference_gaits(env.batch.now.target[:1]))[:, 0])
        seen.add(float(env.batch.now.target[0]))
    assert len(seen) >= 3


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"trunk": "rail"}, 'trunk: expected "free" of a horse, got'),
        ({"size": 3.0}, "size: expected"),
        ({"harmonics": 3}, "harmonics: expected"),
        ({"filters": "fast"}, "filters: expected one of quick, slow, got 'fast'"),
        ({"gait": "canter"}, "gait: expected one of"),
        ({"hoof_stiffness": None, "hoof_damping": 100.0}, "hoof_damping: expected a hoof_stiffness"),
        ({"trunk_share": 0.5}, "trunk_share: expected none of a horse"),
        ({"solver": "paper"}, "solver|trunk"),
        ({"hip_height": 1.5}, "hip_height: expected none of a horse"),
        ({"harmonics": 0}, "harmonics: expected a whole number"),
        ({"harmonics": 1.5}, "harmonics: expected a whole number"),
        ({"filters": ""}, "filters: expected one of"),
        ({"hoof_stiffness": 0.0}, "hoof_stiffness: expected"),
        ({"hoof_stiffness": "soft"}, "hoof_stiffness: expected"),
        ({"target_speed": "fast"}, r"target_speed\[0\]: expected"),
        ({"size": "small"}, "size: expected"),
        ({"target_speed": 2.0, "target_seconds": (1.0, 2.0)}, "target_seconds: expected a range of target"),
        ({"target_speed": -2.0}, r"target_speed\[0\]: expected"),
        ({"target_speed": (0.0, 2.0)}, r"target_speed\[0\]: expected"),
    ],
    ids=str,
)
def test_bad_settings(settings, message):
    with pytest.raises(ParameterError, match=message):
        gym.make(HORSE, **settings)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"crank_angle": 0.0}, "options: expected a mapping with some of gait, parameters, phase"),
        ({"phase": "early"}, r"options\['phase'\]"),
        ({"gait": "canter"}, r"options\['gait'\]: expected one of"),
        ({"gait": [1.0, 2.0]}, "a HorseGait, or finite numbers of shape"),
        ({"gait": np.full(16, 5.0)}, r"options\['gait'\]: expected fore_speed_cos from -0.6 to 0.6, got 5"),
        ({"gait": np.r_[-5.0, np.zeros(15)]}, r"options\['gait'\]: expected rate from 0.1 to"),
        ({"gait": np.tile(np.r_[4.0, np.zeros(15)], (3, 1))}, r"options\['gait'\]: expected one gait or 1"),
        ({"pitch": 1.0}, r"options\['pitch'\]"),
    ],
    ids=str,
)
def test_bad_options_change_nothing(options, message):
    env = make(HORSE)
    env.reset(seed=0)
    before = env.get_state()
    with pytest.raises(ParameterError, match=message):
        env.reset(options=options)
    same(env.get_state(), before)


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


def test_a_gait_for_each_environment_is_that_of_those_that_start():
    envs, gaits = gym.make_vec(HORSE, num_envs=3), random_gaits(3, seed=5)
    envs.reset(seed=0, options={"gait": gaits})
    same(envs.unwrapped.batch.begun[-len(NAMES) :, :], gaits.T)
    changed = gaits[::-1].copy()
    envs.reset(options={"gait": changed, "reset_mask": np.array([False, False, True])})
    same(envs.unwrapped.batch.begun[-len(NAMES) :, :], np.array([gaits[0], gaits[1], changed[2]]).T)


def test_a_pony_is_told_the_speeds_of_its_size():
    one, half = make(HORSE), make(HORSE, size=0.5, target_seconds=(1.0, 2.0))
    np.testing.assert_allclose(half.batch.target_speed, np.sqrt(0.5) * np.array(one.batch.target_speed))
    assert half.settings.target_speed == half.batch.target_speed
    assert make(HORSE, size=0.5, target_speed=None).batch.target_speed == half.batch.target_speed


@pytest.mark.parametrize("given", [1.2, (1.172, 3.706), (1.0, 2.0)], ids=str)
def test_speeds_that_are_named_are_what_is_commanded(given):
    """Those of a horse of size 1, too."""
    found = make(HORSE, size=0.5, target_speed=given).batch.target_speed
    assert found == (given if isinstance(given, tuple) else (given, given))


def test_own_tasks_keep_the_range_of_the_size_unless_they_name_one():
    names = "own/Horse-v0", "own/NamedHorse-v0"
    try:
        register(names[0], base="horse")
        register(names[1], base="horse", target_speed=(1.172, 3.706))
        plain, named = (make(name, size=0.5).batch.target_speed for name in names)
    finally:
        for name in names:
            gym.registry.pop(name, None), _OWN.pop(name, None)
    np.testing.assert_allclose(plain, np.sqrt(0.5) * np.array([1.172, 3.706]))
    assert named == (1.172, 3.706)


@pytest.mark.parametrize("size", [0.5, 1.0, 2.0])
def test_a_gait_of_an_info_is_the_same_gait_as_an_option(size):
    env, options = make(HORSE, size=size), {"phase": 0.2, "speed": 1.0, "pitch": 0.0, "target_speed": 1.5}
    _, info = env.reset(seed=0, options=options | {"gait": "walk"})
    assert info["gait"]["rate"] == pytest.approx(horse_gaits()["walk"].rate / size**0.5)
    seen = env.batch.observations[0].copy()
    for given in (info["gait"], HorseGait.from_array(info["gait"]), env.gaits["walk"]):
        again, told = env.reset(seed=0, options=options | {"gait": given})
        same(again, seen)
        same(np.asarray(told["gait"]), np.asarray(info["gait"]))


def test_a_pony_takes_the_rates_of_its_size():
    quick, env = reference_gaits(np.array([1.85]))[0], make(HORSE, size=0.5)
    quick[0] = 1.2 * FASTEST
    env.reset(seed=0, options={"gait": quick})
    with pytest.raises(ParameterError, match=r"options\['gait'\]: expected rate from 0.1 to 18.8"):
        make(HORSE).reset(seed=0, options={"gait": quick})


def heights(measured, terrain):
    """Of the toes and heels over the ground under each [m], shape (8, ...)."""
    names = [f"{leg}_{point}" for leg in LEGS for point in ("toe", "heel")]
    return np.array([measured[f"{n}_y"] - terrain.height_at(measured[f"{n}_x"]) for n in names])


ANGLES = (-0.2, -0.1, -0.05, 0.05, 0.1, 0.2)


def started(seeds=SEEDS, options=None, **settings):
    """Horses at their start, heights of their hoofs over the ground, and infos."""
    envs = gym.make_vec(HORSE, num_envs=seeds, **settings)
    infos = envs.reset(seed=0, options=options)[1]
    return envs, heights(infos["measured"], envs.unwrapped.batch.engine.terrain), infos


@pytest.mark.parametrize("size", [1.0, 0.5])
@pytest.mark.parametrize("angle", ANGLES)
def test_on_a_slope_horses_start_as_on_the_level(angle, size):
    """Each hoof as far from the ground, each trunk turned with it, and speed along it."""
    slope = {"kind": "slope", "angle": angle}
    (_, level, flat), (_, high, steep) = (started(size=size, terrain=one) for one in (None, slope))
    np.testing.assert_allclose(high * np.cos(angle), level, atol=1e-9)
    now, then = steep["measured"], flat["measured"]
    np.testing.assert_allclose(now["pitch"], then["pitch"] + angle, atol=1e-12)
    np.testing.assert_allclose(now["vy"], then["vy"] + np.tan(angle) * now["vx"], atol=1e-12)
    same(steep["speed"], flat["speed"])


@pytest.mark.parametrize("angle", ANGLES)
def test_no_start_on_a_slope_is_a_fall(angle):
    envs, _, _ = started(terrain={"kind": "slope", "angle": angle})
    for _ in range(15):
        *_, failed, _, _ = envs.step(np.zeros((SEEDS, 16), np.float32))
        assert not failed.any()


def test_on_hills_the_lowest_hoof_is_as_low_as_on_the_level():
    hills, speed = {"kind": "hills", "seed": 1}, SPEEDS[0]
    (_, level, _), (envs, high, infos) = (started(terrain=one, target_speed=speed) for one in (None, hills))
    assert np.ptp(infos["x"]) > 100
    np.testing.assert_allclose(high.min(0), level.min(0), atol=0.005)
    for _ in range(15):
        *_, failed, _, _ = envs.step(np.zeros((SEEDS, 16), np.float32))
        assert not failed.any()


def test_softer_hoofs_start_deeper_and_rigid_ones_above_the_ground():
    options, depth = {"phase": 0.3, "target_speed": SPEEDS[0]}, {}
    for stiffness in (24000.0, 48000.0, None):
        env = make(HORSE, hoof_stiffness=stiffness)
        _, info = env.reset(seed=0, options=options)
        depth[stiffness] = -heights(info["measured"], env.engine.terrain).min()
    assert depth[24000.0] > 0.03
    assert depth[48000.0] == pytest.approx(depth[24000.0] / 2, rel=1e-6)
    assert depth[None] == pytest.approx(-GAP, abs=1e-9)


def test_starts_are_as_far_from_the_gait_as_they_should():
    """The farthest of 256 nearly at the ends, none beyond them, and one leg is not another."""
    n, phase = 256, 0.3
    options = {"phase": phase, "target_speed": SPEEDS[0]}
    _, _, infos = started(n, options)
    motion = trunk_motion(np.full(n, SPEEDS[0]), np.full(n, phase))
    gaits = np.tile(reference_gaits(np.array([SPEEDS[0]])), (n, 1))
    far = 1e-3
    ahead, here, behind = (crank_angles(gaits, np.full(n, phase), np.full((4, n), d)) for d in (far, 0, -far))
    turned = np.array([infos["measured"][f"{leg}_theta"] for leg in LEGS])
    off = {
        SPEED_SPREAD: infos["speed"] / (SPEEDS[0] * motion["vx"]) - 1,
        PITCH_SPREAD: infos["pitch"] - motion["pitch"],
    }
    for spread, values in off.items():
        assert 0.95 * spread < np.abs(values).max() <= spread * (1 + 1e-9)
        assert abs(values.mean()) < 0.2 * spread
    strides = np.angle(np.exp(1j * (turned - here))) / (np.angle(np.exp(1j * (ahead - behind))) / (2 * far))
    assert (np.abs(strides).max(1) > 0.8 * PHASE_SPREAD).all()
    assert np.abs(strides).max() < 1.2 * PHASE_SPREAD
    assert np.abs(np.corrcoef(strides) - np.eye(4)).max() < 0.3


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
    assert "joint" in info["failure"]
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
    assert figures["drive_work_j"] == pytest.approx(work)


def test_stable_baselines_takes_it():
    envs = Sb3VecEnv(HORSE, 8, episode_seconds=0.5)
    assert envs.reset().shape == (8, 66)
    for taken in actions(0, 60, 8, env_id=HORSE):
        _observations, rewards, _dones, _infos = envs.step(taken)
    assert np.isfinite(rewards).all()
