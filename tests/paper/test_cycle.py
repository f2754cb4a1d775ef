"""What a row of a cycle says is what its name says."""

import numpy as np
import pytest

from hoof_env.paper.measure import measure_stance
from hoof_env.paper.reproduce import GAITS, run_cycle
from tests.legs import FIRST_FIT


@pytest.fixture(scope="module", params=GAITS)
def trace(request):
    """A cycle of the leg, of which `test_reproduce` says that every point is where the pose has it."""
    return run_cycle(request.param, "exact", restitution=0.0)


def test_the_hoof_angle_is_the_soles_heel_up_positive(trace):
    heel, toe = (np.stack([trace[f"{name}_x"], trace[f"{name}_y"]]) for name in ("heel", "toe"))
    rise = (heel - toe)[1] / np.linalg.norm(heel - toe, axis=0)
    np.testing.assert_allclose(np.sin(trace["hoof_angle"]), rise, atol=1e-12)
    flat = trace[np.argmin(np.abs(np.sin(trace["hoof_angle"])))]
    assert flat["hoof_angle"] == pytest.approx(0.0, abs=0.1)
    assert flat["toe_x"] > flat["heel_x"]


def test_a_hoof_outside_the_ground_bears_nothing_and_has_no_approach_speed(trace):
    for point in ("toe", "heel"):
        outside = trace[f"{point}_penetration"] <= 0
        assert outside.any()
        assert not outside.all()
        for name in ("normal", "friction", "inverse_approach_speed"):
            assert (trace[f"{point}_{name}"][outside] == 0).all()
        assert (trace[f"{point}_inverse_approach_speed"][~outside] > 0).all()


def test_the_centre_of_pressure_lies_between_the_points_that_bear(trace):
    loaded = trace["normal"] > 0
    assert np.isnan(trace["cop_x"][~loaded]).all()
    at = trace[loaded]
    ends = np.sort([at["toe_x"], at["heel_x"]], axis=0)
    assert (at["cop_x"] >= ends[0] - 1e-12).all()
    assert (at["cop_x"] <= ends[1] + 1e-12).all()
    alone = {point: at[f"{point}_normal"] == at["normal"] for point in ("toe", "heel")}
    assert any(rows.any() for rows in alone.values())
    for point, rows in alone.items():
        assert at["cop_x"][rows] == pytest.approx(at[f"{point}_x"][rows], rel=1e-14)
    moment = at["toe_normal"] * (at["toe_x"] - at["cop_x"]) + at["heel_normal"] * (at["heel_x"] - at["cop_x"])
    assert moment == pytest.approx(np.zeros(len(at)), abs=1e-9)


def test_friction_changes_the_resultant_and_not_the_mean_force():
    one, two = (measure_stance(run_cycle("run", "exact", friction=mu)) for mu in (0.0, 0.9))
    assert one.mean == two.mean
    assert one.peak == one.peak_resultant
    assert two.peak_resultant == pytest.approx(one.peak * np.sqrt(1 + 0.9**2), rel=1e-6)


# Golden: what the search that identified `first_fit` reported of it, an independent program, at 1 ms. Contact
# from the first sample inside to the first outside; hoof angle at the first and the last sample inside, least
# and greatest; peak and mean over the cycle of the normal force, with backward differences as rates.
IDENTIFIED = {
    "walk": {
        "contact": (0.247, 0.583), "angle_deg": (-3.251, 20.393, -10.346, 20.479),
        "elastic": (176.025, 35.378), "inelastic": (477.671, 74.964),
    },
    "run": {
        "contact": (0.205, 0.484), "angle_deg": (6.014, 70.25, 2.965, 70.25),
        "elastic": (5885.621, 803.919), "inelastic": (8816.767, 928.29),
    },
}  # fmt: skip


def inelastic_force(penetrations, h):
    """Eq. 14 on one point with rates by backward differences, written anew."""
    forces, approach = [], None
    for d, v in zip(penetrations, np.diff(penetrations, prepend=penetrations[-1]) / h, strict=True):
        approach = None if d <= 0 else max(v, 1e-4) if approach is None else approach
        forces.append(0.0 if d <= 0 else max(2e4 * d**1.5 * (1 + 0.75 * v / approach), 0.0))
    return np.array(forces)


@pytest.mark.parametrize("name", GAITS)
def test_the_leg_is_the_one_that_was_identified(name):
    golden, h = IDENTIFIED[name], 1e-3
    cycle = run_cycle(name, "exact", preset=FIRST_FIT, restitution=1.0, sim_dt=h)[1:]
    inside = np.flatnonzero((cycle["toe_penetration"] > 0) | (cycle["heel_penetration"] > 0))
    assert (np.diff(inside) == 1).all()
    assert cycle["time"][[inside[0], inside[-1] + 1]] == pytest.approx(golden["contact"], abs=1e-9)
    angle = np.degrees(cycle["hoof_angle"][inside])
    assert (angle[0], angle[-1], angle.min(), angle.max()) == pytest.approx(golden["angle_deg"], abs=6e-4)
    elastic = cycle["normal"].max(), cycle["normal"].mean()
    assert elastic == pytest.approx(golden["elastic"], rel=1e-4)  # lengths had six digits
    force = sum(inelastic_force(cycle[f"{point}_penetration"], h) for point in ("toe", "heel"))
    assert (force.max(), force.mean()) == pytest.approx(golden["inelastic"], rel=2e-4)
