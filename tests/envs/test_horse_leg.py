"""Starts, policies, the agreement with the reproduction, and the errors of the environments."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from family import substeps

from hoof_env.dynamics.layout import TRUNK_STATE
from hoof_env.envs.policies import make_policy, policy_names
from hoof_env.episodes.summaries import summary_of
from hoof_env.errors import ParameterError
from hoof_env.gait import GaitParameters, load_gait
from hoof_env.tasks.observation import MIDDLE

LEG, FIXED = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegFixed-v0"


@pytest.mark.parametrize("name", ["walk", "run"])
@pytest.mark.parametrize("restitution", [1.0, 0.0])
def test_a_gait_that_is_kept_elsewhere_agrees_with_the_reproduction(name, restitution):
    fixed = gym.make(FIXED, gait=name, restitution=restitution)
    fixed.reset(seed=0)
    paper = substeps(fixed)
    contact = {"restitution": restitution, "approach_floor": 1e-4, "friction_fast": 1e-2}
    leg = gym.make(LEG, trunk="fixed", sim_dt=1e-4, episode_seconds=1.0, **contact)
    leg.reset(seed=0, options={"gait": name, "crank_angle": 0.0})
    other = substeps(leg)
    for field in ("normal", "grf", "crank_torque", "hip_torque"):
        scale = np.abs(paper[field]).max()
        assert np.abs(other[field] - paper[field]).max() < 1e-5 * scale


def test_reset_options_set_the_start():
    env = gym.make(LEG)
    gait = {"crank_speed": 5.0, "swing_offset": 0.5, "swing_sin": -0.1, "swing_cos": 0.1}
    _, info = env.reset(seed=0, options={"gait": gait, "crank_angle": 1.0, "speed": 0.5, "height": 2.0})
    row = {name: values.item() for name, values in env.unwrapped.record().items()}
    assert (row["crank_angle"], row["y"], info["gait"]["swing_offset"]) == (1.0, pytest.approx(2.0), 0.5)
    assert row["vx"] == pytest.approx(0.5)
    assert row["crank_angle_rate"] == 5.0
    assert {name: info[name] for name in ("crank_angle", "speed", "height", "x")} == {
        "crank_angle": 1.0, "speed": 0.5, "height": 2.0, "x": 0.0
    }  # fmt: skip


@pytest.mark.parametrize("terrain", [None, {"kind": "hills"}, {"kind": "slope", "angle": 0.1}], ids=str)
@pytest.mark.parametrize("trunk", ["suspended", "rail", "fixed"])
def test_starts_are_in_the_air(trunk, terrain):
    if trunk != "fixed" and terrain and terrain["kind"] == "slope":
        terrain = {"height": [0.0, 0.3, 0.0]}  # the others keep their height and take no slope
    env = gym.make(LEG, trunk=trunk, terrain=terrain)
    for seed in range(40):
        env.reset(seed=seed)
        row = env.unwrapped.record()
        assert max(row["toe_penetration"], row["heel_penetration"]) <= 1e-12


def test_without_friction_and_drag_nothing_pushes_the_animal():
    env = gym.make(LEG, friction=0.0, trunk_drag=0.0)
    env.reset(seed=0, options={"gait": "run", "speed": 0.0})
    momentum = env.unwrapped.record()["momentum_x"].item()
    trace = substeps(env)
    assert trace["normal"].max() > 1000
    np.testing.assert_allclose(trace["momentum_x"], momentum, atol=1e-9)


def speed_and_peak(gait, **kwargs):
    env = gym.make(LEG, **kwargs)
    env.reset(seed=0, options={"gait": gait, "crank_angle": 0.0, "speed": 0.0})
    info = {}
    while "episode_summary" not in info:
        info = env.step(np.zeros(4, np.float32))[4]
    return info["episode_summary"]["speed_m_s"], info["episode_summary"]["highest_grf_n"]


@pytest.mark.parametrize("gait", [MIDDLE, [2 * np.pi, 0.7, 0.0, 0.0]], ids=["middle", "paper's"])
def test_the_middle_of_the_ranges_is_no_gait_for_without_swing_it_goes_backward(gait):
    """A policy has to find one."""
    assert speed_and_peak(GaitParameters.from_array(gait))[0] < -0.5


@pytest.mark.filterwarnings("ignore::hoof_env.dynamics.step_length.StepWarning")
@pytest.mark.parametrize(
    "change", [{"approach_floor": 1e-4}, {"friction_fast": 1e-2}, {"sim_dt": 1e-4}], ids=str
)
def test_assumed_contact_settings_hardly_matter_to_the_run(change):
    """As docs/task.md says of floor, friction threshold and substep."""
    run = load_gait("run")
    assert speed_and_peak(run, **change) == pytest.approx(speed_and_peak(run), rel=0.01)


def test_policies_have_names_and_do_what_they_say():
    env = gym.make(LEG)
    assert policy_names(env) == [
        "carrying_walk", "run", "walk", "zero", "idle", "random", "bang-bang", "drag", "airborne",
    ]  # fmt: skip
    duty = {}
    for name in ("drag", "airborne", "idle"):
        observation, _ = env.reset(seed=1)
        policy, done = make_policy(name, env), False
        while not done:
            observation, _, terminated, truncated, info = env.step(policy.predict(observation)[0])
            done = terminated or truncated
        duty[name] = info["episode_summary"]["duty_factor"]
    assert duty["drag"] > 0.9
    assert duty["airborne"] < 0.5
    with pytest.raises(ParameterError, match=r"expected .*walk.*got 'gallop'"):
        make_policy("gallop", env)


def test_a_step_that_could_not_be_simulated_pays_for_nothing_but_the_failure():
    env = gym.make(LEG).unwrapped
    env.reset(seed=0, options={"gait": "run"})
    keep = np.zeros(4, np.float32)
    for _ in range(20):
        _, reward, *_ = env.step(keep)
    assert reward != 0.0
    before, state = summary_of(env.batch, 0), env.get_state()
    state["engine"]["trunk"][TRUNK_STATE.index("momentum_x")] = 1e308
    there = env.set_state(state)
    seen, reward, terminated, _, info = env.step(keep)
    assert terminated
    np.testing.assert_array_equal(seen, there)
    assert "finite" in str(info["end"])
    rest = env.settings.episode_seconds - before["seconds"]
    assert reward == info["reward_failure"] == pytest.approx(-env.weights["failure"] * rest)
    assert info["episode_summary"] == {**before, "failed": 1.0}
    assert env.record()["time"].ravel().tolist() == [pytest.approx(0.4)]  # where it is
    assert np.isfinite(env.reset()[0]).all()


def test_the_papers_solver_can_be_made_exact():
    """rk4 instead of Euler removes the drift: the force curve is the closed form's."""
    forces = []
    for solver in ({"solver": "paper", "integrator": "rk4"}, {"solver": "paper"}, {"sim_dt": 1e-3}):
        env = gym.make(FIXED, gait="run", episode_seconds=0.4, **solver)
        env.reset(seed=0)
        env.unwrapped.record()
        forces.append(substeps(env)["normal"])
    assert np.abs(forces[0] - forces[2]).max() < 1e-6 * forces[2].max()
    assert np.abs(forces[1] - forces[2]).max() > 1e-3 * forces[2].max()
