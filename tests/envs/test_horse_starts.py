"""Where episodes of `Horse-v0` start: as the reference gait goes on, on level ground, slopes and hills."""

from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, make, same
from horses import SEEDS, SPEEDS

from hoof_env.episodes.plan import make_plan
from hoof_env.render.outline import LegOutline
from hoof_env.tasks.horse import GAP, PHASE_SPREAD, PITCH_SPREAD, SPEED_SPREAD
from hoof_env.tasks.horse_gaits import LEGS, _data, crank_angles, reference_gaits, trunk_motion
from hoof_env.tasks.registry import TASKS


def test_rates_of_the_trunk_are_derivatives_of_its_position():
    """By differences over the phase, on which the crank's angle in the mean is 2 pi a stride."""
    speeds, phase, step = np.array([1.3, 1.9, 2.7]), np.array([0.2, 0.5, 0.85]), 1e-6
    here, there = (trunk_motion(speeds, phase + way * step) for way in (-1, 1))
    for place, rate in (("y", "vy"), ("pitch", "pitch_rate")):
        slope = (there[place] - here[place]) / (2 * step * 2 * np.pi)
        np.testing.assert_allclose(trunk_motion(speeds, phase)[rate], slope, rtol=1e-6, atol=1e-9)


def test_gaits_are_mixed_between_the_stored_ones_and_beyond_them_the_rate_alone_changes():
    stored = _data()["reference"]
    ends, beyond, phase = np.array(stored["speeds"])[[0, -1]], np.array([0.2, 9.0]), np.array([0.3, 0.8])
    gaits, last = reference_gaits(beyond), reference_gaits(ends)
    np.testing.assert_allclose(gaits[:, 1:], last[:, 1:], rtol=1e-14)
    np.testing.assert_allclose(gaits[:, 0] / beyond, last[:, 0] / ends, rtol=1e-14)
    here, there = trunk_motion(beyond, phase), trunk_motion(ends, phase)
    for name in here:
        np.testing.assert_allclose(here[name], there[name], rtol=1e-13)
    between = np.random.default_rng(0).uniform(*ends, 200)
    columns = [np.interp(between, stored["speeds"], column) for column in np.transpose(stored["gaits"])]
    np.testing.assert_allclose(reference_gaits(between), np.transpose(columns), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("size", [1.0, 0.5])
def test_an_episode_starts_as_the_reference_gait_goes_on(size):
    """Where a horse is after some strides is where another one would start at that phase: heights within a
    hundredth of the hips' height, pitch within a hundredth of a radian, most of the time."""
    speed = SPEEDS[0] * size**0.5
    envs = gym.make_vec(HORSE, num_envs=64, target_speed=speed, size=size)
    envs.reset(seed=0)
    for _ in range(300):
        *_, infos = envs.step(np.zeros((64, 16), np.float32))
    measured, body = infos["measured"], envs.unwrapped.body
    gait = reference_gaits(np.array([SPEEDS[0]]))
    angles = crank_angles(np.tile(gait, (1000, 1)), np.arange(1000) / 1000, np.zeros((4, 1000)))[2]
    phase = np.interp(measured["left_hind_crank_angle"] % (2 * np.pi), *sorted_pairs(angles))
    motion = trunk_motion(np.full(64, SPEEDS[0]), phase)
    off = {"y": measured["y"] / body.height - motion["y"], "pitch": measured["pitch"] - motion["pitch"]}
    assert np.median(np.abs(off["y"])) < 0.01
    assert np.median(np.abs(off["pitch"])) < 0.01


def sorted_pairs(angles):
    """Angles that grow, with their phases."""
    order = np.argsort(angles)
    return angles[order], order / len(angles)


@pytest.mark.parametrize("speed", [1.3, *SPEEDS, 3.706])
def test_no_start_is_a_fall(speed):
    envs = gym.make_vec(HORSE, num_envs=256, target_speed=speed)
    envs.reset(seed=1)
    for _ in range(50):
        *_, failed, _, _ = envs.step(np.zeros((256, 16), np.float32))
        assert not failed.any()


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


def heights(measured, terrain):
    """Of the toes and heels over the ground under each [m], shape (8, ...)."""
    names = [f"{leg}_{point}" for leg in LEGS for point in ("toe", "heel")]
    return np.array([measured[f"{n}_y"] - terrain.height_at(measured[f"{n}_x"]) for n in names])


ANGLES = (-0.2, -0.1, -0.05, 0.05, 0.1, 0.2)


def started(seeds=SEEDS, options=None, **settings):
    """Horses at their start, heights of their hooves over the ground, and infos."""
    envs = gym.make_vec(HORSE, num_envs=seeds, **settings)
    infos = envs.reset(seed=0, options=options)[1]
    return envs, heights(infos["measured"], envs.unwrapped.engine.terrain), infos


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


START = {"phase": 0.3, "target_speed": SPEEDS[0]}


def test_softer_hooves_start_deeper():
    depth = {}
    for stiffness in (24000.0, 48000.0):
        env = make(HORSE, hoof_stiffness=stiffness)
        _, info = env.reset(seed=0, options=START)
        depth[stiffness] = -heights(info["measured"], env.engine.terrain).min()
    assert depth[24000.0] > 0.03
    assert depth[48000.0] == pytest.approx(depth[24000.0] / 2, rel=1e-6)


@pytest.mark.parametrize(("stiffness", "low", "high"), [(None, GAP, GAP), (48000.0, -0.06, -0.03)])
def test_rigid_hooves_start_above_the_ground_and_soft_ones_in_it(stiffness, low, high):
    """By the outline that pictures draw: kernels of rigid hooves, which this alone would need, take a third
    of a minute to compile."""
    task = TASKS["horse"]
    plan, engine = make_plan(task, task.settings({"hoof_stiffness": stiffness}))
    start = plan.body.draw(START, [np.random.default_rng(0)], engine)
    plan.body.complete_start(start, np.array([SPEEDS[0]]), START, engine)
    trunk = complex(start.trunk["x"][0], start.trunk["y"][0])
    pitch = float(start.trunk["pitch"][0])
    lowest = []
    legs = zip(engine.limbs, start.commands[..., 0], start.theta[:, 0], strict=True)
    for limb, (_, offset, *waves), theta in legs:
        sines = [a * np.sin(k * theta) for k, a in enumerate(waves[::2], 1)]
        cosines = [b * np.cos(k * theta) for k, b in enumerate(waves[1::2], 1)]
        hip = trunk + complex(*limb.hip) * np.exp(1j * pitch)
        now = SimpleNamespace(
            crank_angle=theta,
            swing_angle=offset + sum(sines + cosines),
            x=hip.real,
            y=hip.imag,
            pitch=pitch,
        )
        mechanism = limb.geometry.mechanism
        points = dict(zip(mechanism.points, LegOutline(limb.geometry).points(now), strict=True))
        lowest += [points[foot].imag for foot in mechanism.feet]
    assert low - 1e-9 <= min(lowest) <= high + 1e-9


def test_starts_are_as_far_from_the_gait_as_they_should():
    """The farthest of 256 nearly at the ends, none beyond them, and one leg is not another."""
    n, phase = 256, 0.3
    options = {"phase": phase, "target_speed": SPEEDS[0]}
    _, _, infos = started(n, options)
    motion = trunk_motion(np.full(n, SPEEDS[0]), np.full(n, phase))
    gaits = np.tile(reference_gaits(np.array([SPEEDS[0]])), (n, 1))
    far = 1e-3
    ahead, here, behind = (crank_angles(gaits, np.full(n, phase), np.full((4, n), d)) for d in (far, 0, -far))
    turned = np.array([infos["measured"][f"{leg}_crank_angle"] for leg in LEGS])
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
