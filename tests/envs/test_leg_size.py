"""Limits and filters of commands go with the size of a leg, by dynamic similarity: lengths as f, times as
sqrt(f), masses as f^3, forces as f^3."""

from __future__ import annotations

from dataclasses import asdict, replace

import gymnasium as gym
import numpy as np
import pytest

import hoof_env
from hoof_env.envs.manual import tables_of
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.gait import LIMITS, FilterSettings, GaitParameters, gait_names, limits_of, speed_scale_of
from hoof_env.ground.contact import load_ground
from hoof_env.records import find_policy
from hoof_env.tasks.registry import _OWN

LEG, RAIL, FIXED = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegRail-v0", "hoof_env/HorseLegFixed-v0"
PUBLISHED = hoof_env.load_geometry()
GROUND = load_ground("identified")
POWERS = {
    "x": 1.0, "y": 1.0, "vx": 0.5, "vy": 0.5, "crank_angle": 0.0, "crank_speed": -0.5,
    "crank_speed_rate": -1.0,
    "swing_offset": 0.0, "swing_sin": 0.0, "swing_cos": 0.0, "swing_offset_rate": -0.5,
    "swing_sin_rate": -0.5, "swing_cos_rate": -0.5, "toe_penetration": 1.0, "normal_force": 3.0,
    "running_peak": 3.0,
}  # fmt: skip
"""Of the size, with which quantities of similar motions go."""


def gait_of_size(name: str, f: float) -> GaitParameters:
    gait = hoof_env.load_gait(name)
    return replace(gait, crank_speed=gait.crank_speed * f**-0.5)


def preset(f: float) -> dict:
    """The published leg at f times its size and one density, with its gaits at their Froude numbers."""
    leg = PUBLISHED.scaled(f, PUBLISHED.linear_density * f**2)
    gaits = {name: asdict(gait_of_size(name, f)) for name in gait_names()}
    stiffness = GROUND.stiffness * f ** (3 - GROUND.exponent)
    return {
        "provenance": f"identified times {f:g}", "geometry": leg.to_dict(), "gaits": gaits,
        "ground": {"stiffness": stiffness, "exponent": GROUND.exponent},
    }  # fmt: skip


def world(f: float, env_id: str = LEG, **more: object) -> dict:
    """Settings under which that leg moves as the published one does, in time that goes as sqrt(f). Friction
    begins so gently that a hoof that stands does not tremble, which would make any two runs differ."""
    powers = {
        "trunk_mass": 3.0, "trunk_stiffness": 2.0, "trunk_damping": 2.5, "trunk_drag": 2.5,
        "approach_floor": 0.5, "sim_dt": 0.5, "dt": 0.5,
    }  # fmt: skip
    if env_id != LEG:
        powers = {k: v for k, v in powers.items() if k not in ("trunk_stiffness", "trunk_damping")}
    if env_id == FIXED:
        powers = {k: v for k, v in powers.items() if k != "trunk_drag"}
    plain = gym.make(env_id).unwrapped.resolved_settings
    scaled = {name: getattr(plain, name) * f**power for name, power in powers.items()}
    gentle = {"friction_slow": 0.05 * f**0.5, "friction_fast": 0.5 * f**0.5}
    return scaled | gentle | {"preset": preset(f), "episode_seconds": 10.0 * f**0.5} | more


def dimensionless(measured, f: float) -> np.ndarray:
    """Some of what is measured, over what a leg of size f has of it."""
    return np.array([measured[name] / f**power for name, power in POWERS.items()])


MOTOR = {"motor_gain": 4.5, "motor_torque": 4.0, "motor_inertia": 5.0}


@pytest.mark.parametrize("drive", ["prescribed", "motor"])
@pytest.mark.parametrize("f", [0.3, 2.5])
def test_a_leg_of_another_size_moves_alike_in_a_similar_world(f, drive):
    """Rates of actions, filters, limits and the lead of a command are scaled: else this differs in the first
    digits. The crank is driven into its limit, and actions are as quick as the filters."""
    envs = []
    for each in (1.0, f):
        own = {"crank_rate": 20.0, "swing_rate": 6.0, "drive": drive}
        if drive == "motor":
            plain = gym.make(LEG).unwrapped.settings
            own |= {name: getattr(plain, name) * each**power for name, power in MOTOR.items()}
        env = gym.make(LEG, **world(each, **own)).unwrapped
        at = {"crank_angle": 0.5, "speed": 1.0 * each**0.5, "height": env.geometry.hip_height, "gait": "run"}
        env.reset(seed=0, options=at)
        envs.append(env)
    generator, fastest = np.random.default_rng(1), 0.0
    for step in range(60):
        action = generator.uniform(-0.3, 0.3, 4).astype(np.float32)
        action[0] = 1.0 if step < 40 else -1.0
        steps = [env.step(action) for env in envs]
        one, other = (
            dimensionless(each[4]["measured"], size) for each, size in zip(steps, (1.0, f), strict=True)
        )
        np.testing.assert_allclose(other, one, rtol=1e-5, atol=1e-5)
        fastest = max(fastest, one[list(POWERS).index("crank_speed")])
        assert steps[0][2] == steps[1][2]
        if steps[0][2]:
            break
    assert step > 25
    assert fastest == pytest.approx(LIMITS["crank_speed"][1], rel=0.02)


@pytest.mark.parametrize("env_id", [LEG, RAIL, FIXED])
@pytest.mark.parametrize("f", [0.3, 3.0])
def test_scripted_gaits_of_all_sizes_are_alike(env_id, f):
    """A policy that starts in a scaled gait, and one that goes to it from what it sees."""
    found = []
    for each in (1.0, f):
        env = gym.make(env_id, **world(each, env_id))
        policy = hoof_env.make_policy("carrying_walk", env)
        at = {"crank_angle": 0.5, "gait": "walk"} | ({"speed": 0.5 * each**0.5} if env_id != FIXED else {})
        seen, _ = env.reset(seed=0, options=at)
        for _ in range(80):
            seen, _, *ended, info = env.step(policy.predict(seen)[0])
            assert not any(ended)
        wanted = gait_of_size("carrying_walk", each).to_array()
        reached = [info["measured"][name] for name in LIMITS]
        np.testing.assert_allclose(reached, wanted, atol=1e-3)
        found.append(dimensionless(info["measured"], each))
    np.testing.assert_allclose(found[1], found[0], rtol=1e-3, atol=1e-3)


def test_the_published_leg_keeps_its_limits_and_filters_to_the_bit():
    body = gym.make(LEG).unwrapped.body
    assert speed_scale_of(PUBLISHED) == 1.0
    assert limits_of(PUBLISHED) == LIMITS
    assert body.filters == FilterSettings()
    assert [*zip(body.low, body.high, strict=True)] == [*LIMITS.values()]
    np.testing.assert_array_equal(body.rates, [18.0, 1.2, 1.2, 1.2])


def test_the_crank_of_a_leg_at_a_third_turns_faster_by_the_root_of_three():
    body = gym.make(LEG, preset=preset(1 / 3), trunk_mass=2.0).unwrapped.body
    assert body.high[0] == pytest.approx(4 * np.pi * 3**0.5)
    np.testing.assert_allclose(body.rates, np.array([54.0, *[1.2 * 3**0.5] * 3]))
    assert body.filters.gain == pytest.approx(20.0 * 3**0.5)
    np.testing.assert_allclose([*limits_of(body.geometry).values()][1:], [*LIMITS.values()][1:])


def test_a_gait_beyond_the_leg_is_refused_with_the_legs_own_limit(tmp_path):
    fast = GaitParameters(20.0, 0.7, 0.0, 0.0)
    beyond = r"expected crank_speed from 0 to 12.5664 of a leg of 1.697 m, beyond which .* got 20"
    env = gym.make(LEG)
    with pytest.raises(ParameterError, match=rf"options\['gait'\]: {beyond}"):
        env.reset(seed=0, options={"gait": fast})
    env.reset(seed=0)
    with pytest.raises(ParameterError, match=f"gait: {beyond}"):
        env.unwrapped.action_for(fast)
    with pytest.raises(ParameterError, match=f"gait: {beyond}"):
        find_policy("20,0.7,0,0", env, LEG)
    small = gym.make(LEG, preset=preset(0.3), trunk_mass=2.0)
    small.reset(seed=0, options={"gait": fast})
    small.unwrapped.action_for(fast)

    PUBLISHED.save(tmp_path / "own.json", gaits={"walk": fast}, ground={"stiffness": 2e4, "exponent": 1.375})
    with pytest.raises(DataFileError, match=rf"own.json, gait 'walk': {beyond}"):
        gym.make(LEG, preset=tmp_path / "own.json")


def test_the_manual_and_the_picture_of_a_small_leg_have_its_limits():
    name = "own/SmallLeg-v0"
    try:
        hoof_env.register(name, base="leg", preset=preset(0.25), trunk_mass=1.0)
        tables = tables_of(name)
        env = gym.make(name, render_mode="rgb_array")
    finally:
        gym.registry.pop(name, None), _OWN.pop(name, None)
    assert tables["Actions"].rows[0][1:] == ("crank speed", "-72", "72", "rad/s^2", "0 to 25.133 rad/s")
    scalings = {row[2] for row in tables["Observation"].rows}
    assert {"linear, -1 at 0 and 1 at 25.132741", "/ 80", "/ 12"} <= scalings
    high = 8 * np.pi
    env.reset(seed=0, options={"gait": {**asdict(gait_of_size("walk", 0.25)), "crank_speed": high}})
    env.render()
    assert env.unwrapped._watched[0].renderer._panel._limits["crank_speed"][1] == pytest.approx(high)
