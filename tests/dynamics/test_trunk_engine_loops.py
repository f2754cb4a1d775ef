"""The engine of several legs against Eq. 8's exact solution; its loops stay closed."""

import numpy as np
import pytest

from hoof_env.dynamics.constrained import SOLE, ConstrainedLeg
from hoof_env.dynamics.constraints import DRIVER_ROW, closed_form
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Motor, Prescribed, Trunk
from hoof_env.gait.gait import LIMITS, PARAMETERS, command_filters, evaluate_motion, load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, mirror, pose
from hoof_env.leg.linkage import BODIES

FIRST, IDENTIFIED = load_geometry("first_fit"), load_geometry("identified")
LEGS = {
    "first fit": FIRST,
    "identified": IDENTIFIED,
    "mirrored": FIRST.replace(travel=-FIRST.travel),
    "own masses": IDENTIFIED.replace(masses=tuple(np.linspace(3, 0.2, 14)), inertia="paper"),
}
RUN = load_gait("run", "first_fit")
LOW, HIGH = np.array(list(LIMITS.values())).T


def commands(count):
    return np.random.default_rng(2).uniform(LOW, HIGH, (count, 4))


def eq_8(geometry, ground, engine, command):
    """Crank torque, hip torque, toe and heel from Eq. 8 with the loops closed where the engine is."""
    leg = ConstrainedLeg(geometry, ground, height=engine.trunk.height)
    state, report = engine.state, engine.report
    leg.reset(RUN, float(state["theta"][0, 0]))
    for k, name in enumerate(PARAMETERS):
        leg.state.filters[k]["value"] = state[name][0, 0]
        leg.state.filters[k]["rate"] = state[f"{name}_rate"][0, 0]
    command_filters(leg.state.filters, command, engine.filters.to_array())
    evaluate_motion(leg.state.motion, leg.state.filters)
    leg.state.q, leg.state.qd = closed_form(geometry, leg.state.motion)
    for contact, point in zip(leg.state.contacts, ("toe", "heel"), strict=True):
        contact["friction"] = report[f"{point}_friction"][0, 0]
        contact["normal"] = report[f"{point}_normal"][0, 0]
    multipliers = leg.solve()[1]
    at = complex(*leg.state.q[3 * SOLE : 3 * SOLE + 2]) + leg._corner_arms()
    hoofs = [mirror(z, float(geometry.travel)) + 1j * leg.trunk.height for z in at]
    return multipliers[DRIVER_ROW], multipliers @ leg.closure().by_phi, hoofs


@pytest.mark.parametrize("geometry", LEGS.values(), ids=LEGS)
def test_torques_are_the_multipliers_of_eq_8(geometry):
    ground = Ground(restitution=0.5, approach_floor=0.1, friction_fast=0.05)
    trunk = Trunk("fixed", height=geometry.hip_height)
    engine = TrunkEngine(Limb(geometry, (0.0, 0.0), Prescribed()), trunk, ground)
    engine.reset(RUN, 0.4)
    most = 0.0
    for command in np.repeat(commands(8), 6, axis=0):
        assert not engine.advance(command, 23).any()
        crank, hip, hoofs = eq_8(geometry, ground, engine, command)
        r = {name: row[0, 0] for name, row in engine.report.items() if row.ndim == 2}
        push = abs(
            complex(r["toe_friction"], r["toe_normal"]) + complex(r["heel_friction"], r["heel_normal"])
        )
        scale = max(100.0, push, abs(crank), abs(hip))
        assert r["crank_torque"] == pytest.approx(crank, rel=0, abs=1e-9 * scale)
        assert r["hip_torque"] == pytest.approx(hip, rel=0, abs=1e-9 * scale)
        found = [complex(r["toe_x"], r["toe_y"]), complex(r["heel_x"], r["heel_y"])]
        assert found == pytest.approx(hoofs, rel=0, abs=1e-12)
        most = max(most, push)
    assert most > 500


@pytest.mark.parametrize("drive", [Motor(), Prescribed()], ids=["motor", "prescribed"])
@pytest.mark.parametrize("kind", ["fixed", "free"])
@pytest.mark.parametrize("geometry", list(LEGS.values())[:3], ids=list(LEGS)[:3])
def test_loops_stay_closed(geometry, kind, drive):
    """Half a minute under commands on the move: links keep their lengths, toe and heel are in place."""
    hips = (0.6, 0.1), (-0.6, -0.1)
    trunk = Trunk(kind, mass=300.0, height=50.0, drag=0.0, pitch_inertia=50.0)
    engine = TrunkEngine([Limb(geometry, hip, drive) for hip in hips], trunk, Ground(stiffness=1e-3))
    engine.reset(RUN, (0.4, 2.0))
    sole = np.abs(geometry.body_lengths[SOLE])
    for command in commands(30):
        assert not engine.advance(command, 1000).any()
        if kind == "free":  # caught and thrown up again
            engine.reset(RUN, engine.state["theta"], pitch=0.3, vy=2.0)
            engine.advance(command, 3)
        r, s = engine.report, engine.state
        for i, hip in enumerate(hips):
            o = complex(r["x"][0], r["y"][0]) + np.exp(1j * s["pitch"][0]) * complex(*hip)
            turn = r["phi"][i, 0] + geometry.travel * s["pitch"][0]
            at = pose(geometry, s["theta"][i, 0], frame=FrameMotion(turn, position=(o.real, o.imag)))
            links = [np.hypot(*(at.point(body.head) - at.point(body.tail))) for body in BODIES]
            np.testing.assert_allclose(links, geometry.body_lengths, rtol=0, atol=1e-12)
            toe, heel = (np.array([r[f"{p}_x"][i, 0], r[f"{p}_y"][i, 0]]) for p in ("toe", "heel"))
            np.testing.assert_allclose(toe, at.point(geometry.toe), rtol=0, atol=1e-12 + 1e-14 * abs(o))
            np.testing.assert_allclose(heel, at.point(geometry.heel), rtol=0, atol=1e-12 + 1e-14 * abs(o))
            assert np.hypot(*(toe - heel)) == pytest.approx(sole, rel=0, abs=1e-12)
    if kind == "fixed":
        assert s["theta"].min() > 100
