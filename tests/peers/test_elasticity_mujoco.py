"""Landings on elastic and inelastic ground have the same peaks in MuJoCo."""

import pytest

pytest.importorskip("mujoco")

from benchmarks import elasticity_mujoco as there
from benchmarks.elasticity_runs import GAITS, PAPER_LAW, SETUPS, ground_of, landing

pytestmark = pytest.mark.peers


@pytest.mark.parametrize("gait", GAITS)
@pytest.mark.parametrize("setup", ["fixed", "suspended", "free"])
def test_a_landing_has_the_same_peak_in_both_engines(gait, setup):
    for restitution in (1.0, 0.0):
        ground = ground_of(PAPER_LAW, restitution)
        peak = landing(gait, SETUPS[setup], ground)
        assert there.landing(gait, SETUPS[setup], ground) == pytest.approx(peak, rel=2e-4)


def test_a_contact_without_damping_returns_all_speed_and_more_damping_less():
    returned = [there.own_restitution(damping) for damping in there.DAMPINGS]
    assert returned[0] == pytest.approx(1.0, abs=1e-3)
    assert returned == sorted(returned, reverse=True)
