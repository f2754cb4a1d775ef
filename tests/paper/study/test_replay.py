"""A replayed cycle is the simulator's own, on any ground, level and pace."""

import dataclasses
import json
import math
from importlib import resources

import numpy as np
import pytest

from hoof_env.errors import HoofEnvError
from hoof_env.ground.contact import Ground
from hoof_env.paper.measure import measure_stance
from hoof_env.paper.published import load_published
from hoof_env.paper.reproduce import GAITS, run_cycle
from hoof_env.paper.study.replay import (
    at_speed,
    closure_error,
    euler_cycle,
    exact_cycle,
    ground_of,
    replay,
)

PRINTED = math.sqrt(30.0)
MADE = ("t", "toe_x", "toe_vx", "toe_penetration", "toe_rate", "toe_approach", "toe_normal", "toe_friction",
        "heel_x", "heel_vx", "heel_penetration", "heel_rate", "heel_approach", "heel_normal", "heel_friction",
        "hoof_angle", "normal", "friction", "grf", "trunk_y")  # fmt: skip

LAWS = (
    {"restitution": 1.0},
    {"restitution": 0.0},
    {"normal_law": "flores", "restitution": 0.3, "exponent": 1.25, "stiffness": 7e4, "friction": 0.8},
)


@pytest.mark.parametrize("gait", GAITS)
@pytest.mark.parametrize("settings", LAWS)
def test_on_the_exact_motion_it_is_the_environment(gait, settings):
    """Two contact kernels, written twice."""
    made, run = (
        replay(exact_cycle(gait, None), ground_of(None, **settings)),
        run_cycle(gait, "exact", **settings),
    )
    for name in MADE:
        atol = 1e-9 * max(np.abs(run[name]).max(), 1.0)
        np.testing.assert_allclose(made[name], run[name], rtol=0, atol=atol, err_msg=name)
    assert np.isnan(made["crank_torque"]).all()


@pytest.mark.parametrize("gait", GAITS)
def test_a_rising_ground_is_a_lower_hip(gait):
    cycle = exact_cycle(gait, None)
    run = run_cycle(gait, "exact", restitution=0.0, hip_height=float(cycle["trunk_y"][0]) - 0.01)
    made = replay(cycle, ground_of(None, restitution=0.0), 0.01)
    for name in MADE:
        np.testing.assert_allclose(made[name], run[name], rtol=1e-9, atol=1e-9, err_msg=name)


@pytest.mark.parametrize("gait", GAITS)
def test_euler_cycles_are_those_of_the_papers_solver(gait):
    made = replay(
        euler_cycle(gait, None, 1000, PRINTED), ground_of(None, restitution=0.0, approach="sampled")
    )
    run = run_cycle(gait, "paper", restitution=0.0, baumgarte_beta=PRINTED)
    for name in MADE:
        np.testing.assert_allclose(made[name], run[name], rtol=1e-7, atol=1e-8, err_msg=name)


def test_another_pace_is_the_motion_of_a_faster_crank(tmp_path):
    data = json.loads(resources.files("hoof_env.data").joinpath("first_fit.json").read_text())
    data["gaits"]["run"]["crank_speed"] *= 1.6
    (tmp_path / "fast.json").write_text(json.dumps(data))
    run = run_cycle("run", "exact", preset=str(tmp_path / "fast.json"), sim_dt=1.25e-4, dt=0.025,
                    episode_seconds=0.625, restitution=0.0)  # fmt: skip
    made = replay(at_speed(exact_cycle("run", "first_fit", 2e-4), 1.6), Ground(restitution=0.0))
    for name in (*MADE, "theta_rate", "phi_rate", "phi_acc"):
        np.testing.assert_allclose(made[name], run[name], rtol=1e-7, atol=1e-7, err_msg=name)


def test_cached_cycles_cannot_be_written_to():
    for cycle in (exact_cycle("walk", None), euler_cycle("walk", None, 1000, PRINTED)):
        with pytest.raises(ValueError, match="read-only"):
            cycle["t"] = 0.0


def test_a_cycle_that_diverges_is_refused_with_its_settings():
    with pytest.raises(HoofEnvError, match="20 Euler steps a second with beta 1e"):
        euler_cycle("walk", None, 20, 1e6)


@pytest.mark.parametrize("gait", GAITS)
def test_closure_errors_are_of_first_order_and_smaller_with_the_probable_beta(gait):
    alpha = load_published().parameters["baumgarte_alpha"]
    coarse, fine = (closure_error(gait, None, steps, PRINTED) for steps in (1000, 4000))
    assert coarse / fine == pytest.approx(4, rel=0.1)
    assert closure_error(gait, None, 1000, math.sqrt(2) * alpha) < coarse


def test_mean_force_is_independent_of_friction_and_the_resultant_is_not():
    cycle = exact_cycle("run", None)
    one, two = (measure_stance(replay(cycle, Ground(friction=mu))) for mu in (0.0, 0.9))
    assert one.mean == two.mean
    assert one.peak == one.peak_resultant
    assert two.peak_resultant == pytest.approx(one.peak * math.sqrt(1 + 0.9**2), rel=1e-6)


def test_normal_forces_are_proportional_to_stiffness():
    cycle = exact_cycle("walk", None)
    for cr in (1.0, 0.0):
        soft = Ground(restitution=cr)
        stiff = dataclasses.replace(soft, stiffness=10 * soft.stiffness)
        np.testing.assert_allclose(
            replay(cycle, stiff)["normal"], 10 * replay(cycle, soft)["normal"], rtol=1e-12
        )
