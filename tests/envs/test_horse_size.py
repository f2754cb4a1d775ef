"""A `size` of `Horse-v0` is a similar animal."""

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, ROUGH, actions, make, same
from horses import SEEDS, played
from hypothesis import given as of_any
from hypothesis import settings as run_with
from hypothesis import strategies as st

from hoof_env import register
from hoof_env.constants import GRAVITY
from hoof_env.errors import ParameterError
from hoof_env.tasks.horse_gaits import FASTEST, LEGS, HorseGait, horse_gaits, reference_gaits
from hoof_env.tasks.registry import _OWN


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
    size, found = env.body.size, []
    units = {"x": size, "y": size, "vx": size**0.5, "pitch": 1.0, "pitch_rate": size**-0.5}
    for leg in LEGS:
        units |= {f"{leg}_crank_angle": 1.0, f"{leg}_crank_speed": size**-0.5, f"{leg}_swing_sin": 1.0}
        units |= {f"{leg}_normal_force": size**3, f"{leg}_command_crank_speed": size**-0.5}
    found = [measured[name] / unit for name, unit in units.items()]
    return np.array(found)


@pytest.mark.parametrize("drive", ["prescribed", "motor"])
@pytest.mark.parametrize("size", [0.7, 2.0])
def test_in_a_similar_world_all_sizes_move_alike(size, drive):
    """Filters, the cap on a crank's speed, springs, dampers, motors and the approach floor are scaled: else
    this differs in the first digits. The commanded speed is so high that commands meet their cap."""
    worlds = [similar_world(each) | {"target_speed": 8.0 * each**0.5} for each in (1.0, size)]
    envs = [make(HORSE, drive=drive, **world) for world in worlds]
    for env in envs:
        env.reset(seed=3)
    capped, failed = 0, False
    for action in actions(4, 25, env_id=HORSE):
        action[::4] = 1.0
        steps = [env.step(action) for env in envs]
        one, other = (dimensionless(env, step[4]["measured"]) for env, step in zip(envs, steps, strict=True))
        np.testing.assert_allclose(other, one, rtol=1e-5, atol=1e-5)
        capped += int((one == FASTEST).sum())
        failed = steps[0][2]
        assert steps[1][2] == failed
        if failed:
            break
    assert capped > 3


@pytest.mark.parametrize("size", [0.5, 2.0])
def test_horses_of_all_sizes_fall_at_the_same_instant(size):
    """From a start that goes backward, to the thousandth of a second of a horse of size 1: limits go with the
    size."""
    last = []
    for each in (1.0, size):
        env = make(HORSE, **similar_world(each) | {"dt": 1e-3 * each**0.5, "target_speed": 1.5 * each**0.5})
        env.reset(seed=0, options={"speed": -1.0 * each**0.5})
        steps, failed = 0, False
        while not failed and steps < 1500:
            *_, failed, _, info = env.step(np.zeros(16, np.float32))
            steps += 1
        last.append((steps, *info.get("end", [""])))
    assert "joint" in last[0][1]
    assert last[1] == last[0]


def seen_while_moving(env_id, size, seed, phase, froude, pitch):
    """Observations at a start and after each of some steps of random actions and a push, for a size."""
    pace = size**0.5
    world = similar_world(size) | {"dt": 0.04 * pace, "target_speed": None, "terrain": None}
    env = make(env_id, **world)
    speed = pace * (froude * GRAVITY * 1.4) ** 0.5
    push = round(0.08 * pace, 9), 400.0 * size**3.5, 0.0
    options = {"phase": phase, "speed": 1.2 * speed, "pitch": pitch, "target_speed": speed, "pushes": [push]}
    frames = [env.reset(seed=seed, options=options)[0]]
    for action in actions(seed, 6, env_id=env_id):
        seen, _, failed, _, _ = env.step(action)
        if failed:
            break
        frames.append(seen)
    return np.array(frames)


@of_any(
    size=st.floats(0.4, 2.0), seed=st.integers(0, 2**31), phase=st.floats(0.0, 1.0),
    froude=st.floats(0.1, 1.0), pitch=st.floats(-0.1, 0.1),
)  # fmt: skip
@run_with(max_examples=12, deadline=None, derandomize=True)
def test_animals_of_all_sizes_see_rough_ground_alike(size, seed, phase, froude, pitch):
    """At similar states, reached by similar pushes on level ground, all entries are equal."""
    one, other = (seen_while_moving(ROUGH, each, seed, phase, froude, pitch) for each in (1.0, size))
    np.testing.assert_allclose(other, one, atol=1e-4)


def test_the_entries_of_level_ground_differ_with_the_size():
    """Speeds and rates are seen on scales that do not go with it, so the property above is one of its id."""
    one, other = (seen_while_moving(HORSE, each, 3, 0.2, 0.5, 0.0) for each in (1.0, 0.5))
    assert np.abs(other - one).max() > 0.1


def figures(size, froude, world=None):
    """What 40 horses that go at a Froude number for 8 sqrt(size) seconds show: speed over sqrt(g L), slip of
    a stance over L, peaks divided by the weight, stances."""
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


def test_a_pony_is_reported_the_speeds_of_its_size():
    one, half = make(HORSE), make(HORSE, size=0.5, target_seconds=(1.0, 2.0))
    np.testing.assert_allclose(
        half.batch.plan.commands.speeds, np.sqrt(0.5) * np.array(one.batch.plan.commands.speeds)
    )
    assert half.settings.target_speed == half.batch.plan.commands.speeds
    assert (
        make(HORSE, size=0.5, target_speed=None).batch.plan.commands.speeds == half.batch.plan.commands.speeds
    )


@pytest.mark.parametrize("given", [1.2, (1.172, 3.706), (1.0, 2.0)], ids=str)
def test_named_speeds_are_commanded(given):
    """Speeds of a horse of size 1, too."""
    found = make(HORSE, size=0.5, target_speed=given).batch.plan.commands.speeds
    assert found == (given if isinstance(given, tuple) else (given, given))


def test_own_tasks_keep_the_range_of_the_size_unless_they_name_one():
    names = "own/Horse-v0", "own/NamedHorse-v0"
    try:
        register(names[0], base="horse")
        register(names[1], base="horse", target_speed=(1.172, 3.706))
        plain, named = (make(name, size=0.5).batch.plan.commands.speeds for name in names)
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
    seen = env.batch.rows.observations[0].copy()
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
