"""The upper linkage is Theo Jansen's, so his 'holy numbers' must give his foot.

Crank m = OP, couplers j = PB and k = PF, triangle b = CB, e = BD, d = CD, rocker c = CF and links f = DE and
g = EF are ours one for one. Below, the legs differ: Jansen's foot is the apex of a rigid triangle on E-F and
ours the hoof below the ankle G. So the upper points come from our closed form; the foot is set on them here.

Golden values: foot path of the holy numbers, computed independently by circle intersection at 720 steps:
stroke 67.9, lift 22.5, foot height -91.8 to -69.4 below the crank centre, and 43, 52 and 59 % of the cycle
within 1, 2 and 3 units of the lowest point.
"""

import numpy as np
import pytest

from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import pose

UPPER = {
    "OP": 15.0, "PB": 50.0, "PF": 61.9, "CB": 41.5, "BD": 55.8,
    "CD": 40.1, "CF": 39.3, "DE": 39.4, "EF": 36.7,
}  # fmt: skip
EDGE_E, EDGE_F = 65.7, 49.0  # h and i: foot to E and foot to F
LOWER = {"FG": 20.0, "CA": 10.0, "GJ": 45.0, "AJ": 45.0, "GI": 40.0, "IJ": 30.0}  # any that turns


@pytest.fixture(scope="module")
def foot():
    leg = Geometry(
        lengths=UPPER | LOWER, pivot=(-38.0, -7.8), toe="I", heel="J", travel=1, hip_height=95.0,
        assembly={"B": 1, "D": 1, "F": -1, "E": -1, "J": 1, "I": -1},
    )  # fmt: skip
    path = []
    for theta in np.linspace(0, 2 * np.pi, 720, endpoint=False):
        at = pose(leg, theta)
        e, f = at.point("E"), at.point("F")
        along = (EDGE_E**2 + UPPER["EF"] ** 2 - EDGE_F**2) / (2 * UPPER["EF"])
        across = np.sqrt(EDGE_E**2 - along**2)
        x, y = (f - e) / np.linalg.norm(f - e)
        path.append(e + along * np.array([x, y]) + across * np.array([y, -x]))  # below E-F
    return np.array(path)


def test_stroke_lift_and_height_below_the_crank(foot):
    assert np.ptp(foot[:, 0]) == pytest.approx(67.9, abs=0.05)
    assert np.ptp(foot[:, 1]) == pytest.approx(22.5, abs=0.05)
    assert foot[:, 1].min() == pytest.approx(-91.8, abs=0.05)
    assert foot[:, 1].max() == pytest.approx(-69.4, abs=0.05)


@pytest.mark.parametrize(("units", "share"), [(1, 0.43), (2, 0.52), (3, 0.59)])
def test_dwell_near_the_ground(foot, units, share):
    assert np.mean(foot[:, 1] < foot[:, 1].min() + units) == pytest.approx(share, abs=0.006)
