"""The loops of the engine of several legs stay closed, whatever it does."""

import numpy as np
import pytest

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Motor, Prescribed, Trunk
from hoof_env.gait import LIMITS
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from tests.dynamics.scenes import LEG, RUN
from tests.linkage import BODIES, SOLE

LEGS = (LEG, load_geometry("identified"), LEG.replace(travel=-LEG.travel))
LOW, HIGH = np.array(list(LIMITS.values())).T


@pytest.mark.parametrize("drive", [Motor(), Prescribed()], ids=["motor", "prescribed"])
@pytest.mark.parametrize("kind", ["fixed", "free"])
@pytest.mark.parametrize("geometry", LEGS, ids=["first_fit", "identified", "mirrored"])
def test_loops_stay_closed(geometry, kind, drive):
    """Half a minute under commands on the move: links keep their lengths, toe and heel are in place."""
    hips = (0.6, 0.1), (-0.6, -0.1)
    trunk = Trunk(kind, mass=300.0, height=50.0, drag=0.0, pitch_inertia=50.0)
    engine = TrunkEngine([Limb(geometry, hip, drive) for hip in hips], trunk, Ground(stiffness=1e-3))
    engine.reset(RUN, (0.4, 2.0))
    sole = np.abs(geometry.body_lengths[SOLE])
    for command in np.random.default_rng(2).uniform(LOW, HIGH, (30, 4)):
        assert not engine.advance(command, 1000).any()
        if kind == "free":  # caught and thrown up again
            engine.reset(RUN, engine.state["crank_angle"], pitch=0.3, vy=2.0)
            engine.advance(command, 3)
        r, s = engine.report, engine.state
        for i, hip in enumerate(hips):
            o = complex(r["x"][0], r["y"][0]) + np.exp(1j * s["pitch"][0]) * complex(*hip)
            turn = r["swing_angle"][i, 0] + geometry.travel * s["pitch"][0]
            at = pose(geometry, s["crank_angle"][i, 0], frame=FrameMotion(turn, position=(o.real, o.imag)))
            links = [np.hypot(*(at.point(body.head) - at.point(body.tail))) for body in BODIES]
            np.testing.assert_allclose(links, geometry.body_lengths, rtol=0, atol=1e-12)
            toe, heel = (np.array([r[f"{p}_x"][i, 0], r[f"{p}_y"][i, 0]]) for p in ("toe", "heel"))
            np.testing.assert_allclose(toe, at.point(geometry.toe), rtol=0, atol=1e-12 + 1e-14 * abs(o))
            np.testing.assert_allclose(heel, at.point(geometry.heel), rtol=0, atol=1e-12 + 1e-14 * abs(o))
            assert np.hypot(*(toe - heel)) == pytest.approx(sole, rel=0, abs=1e-12)
    if kind == "fixed":
        assert s["crank_angle"].min() > 100
