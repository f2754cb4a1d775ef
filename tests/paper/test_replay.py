"""A replayed cycle is the simulator's own, on any ground and at any level."""

import numpy as np
import pytest

from hoof_env.ground.contact import Ground, load_ground
from hoof_env.paper.measure import SUMS, measure_stance, replay
from hoof_env.paper.reproduce import GAITS, run_cycle

PARTS = ("x", "y", "slide", "penetration", "rate", "slowness", "normal", "friction")
MADE = (
    "time",
    "y",
    *(f"{point}_{part}" for point in ("toe", "heel") for part in PARTS),
    *SUMS[:3],
    "hoof_angle",
)

LAWS = (
    {"restitution": 1.0},
    {"restitution": 0.0},
    {"normal_law": "flores", "restitution": 0.3, "exponent": 1.25, "stiffness": 7e4, "friction": 0.8},
)


@pytest.fixture(scope="module")
def cycles():
    return {gait: run_cycle(gait, "exact") for gait in GAITS}


@pytest.mark.parametrize("gait", GAITS)
@pytest.mark.parametrize("settings", LAWS)
def test_on_the_exact_motion_it_is_the_environment(cycles, gait, settings):
    """Two contact kernels, written twice."""
    made, run = replay(cycles[gait], load_ground(**settings)), run_cycle(gait, "exact", **settings)
    for name in MADE:
        atol = 1e-9 * max(np.abs(run[name]).max(), 1.0)
        np.testing.assert_allclose(made[name], run[name], rtol=0, atol=atol, err_msg=name)
    assert np.isnan(made["crank_torque"]).all()


@pytest.mark.parametrize("gait", GAITS)
def test_a_rising_ground_is_a_lower_hip(cycles, gait):
    height = float(cycles[gait]["y"][0]) - 0.01
    run = run_cycle(gait, "exact", restitution=0.0, hip_height=height)
    made = replay(cycles[gait], load_ground(restitution=0.0), 0.01)
    for name in MADE:
        np.testing.assert_allclose(made[name], run[name], rtol=1e-9, atol=1e-9, err_msg=name)


def test_friction_changes_the_resultant_and_not_the_mean_force(cycles):
    one, two = (measure_stance(replay(cycles["run"], Ground(friction=mu))) for mu in (0.0, 0.9))
    assert one.mean == two.mean
    assert one.peak == one.peak_resultant
    assert two.peak_resultant == pytest.approx(one.peak * np.sqrt(1 + 0.9**2), rel=1e-6)
