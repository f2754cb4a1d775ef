"""Momentum, angular momentum, weight and energy of the engine of several legs: what nature keeps."""

import numpy as np
import pytest

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import FREEDOMS, TRUNKS, Limb, Prescribed, Trunk
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.gait import GaitParameters, load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from tests.dynamics.scenes import HIPS, LOWEST, NATURAL, RUN, THETA, WALK, drives_less_losses, energy, horse
from tests.dynamics.tally import tally_of

SMOOTH = Ground(restitution=0.9, approach_floor=0.3, friction_law="tanh", friction_fast=0.5)
STRIDE = GaitParameters(5.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_flight(scheme):
    """Four motors, commands on the move, 2 s in the air: momentum and spin stay to the last bit."""
    engine = horse(height=60.0, settings={"integrator": scheme})
    engine.reset([RUN, WALK, RUN, WALK], [0.0, 1.5, 3.0, 4.5], vx=3.0, vy=8.0, pitch=0.1, pitch_rate=-0.4)
    first, start, pitches, before = tally_of(engine), engine.state, [], energy(engine)
    for k in range(20):
        command = np.array(
            [
                [9.0, 0.3 + 0.04 * k, -0.4, 0.1],
                [5.0, 0.6, -0.1, -0.3],
                [11.0, 0.5, 0.3, 0.0],
                [0.0, 0.4, 0.0, -0.5],
            ]
        )
        assert not engine.advance(np.roll(command, k, axis=0), 100).any()
        pitches.append(engine.state["pitch"][0])
    now, last, t = engine.state, tally_of(engine), 2.0
    assert now["momentum_x"] == start["momentum_x"]
    assert now["angular_momentum"] == start["angular_momentum"]
    fallen = last.momentum[0] - first.momentum[0] + 1j * engine.weight * t
    assert abs(fallen) < 1e-11 * abs(first.momentum[0])
    assert last.angular_momentum[0] == pytest.approx(first.angular_momentum[0], rel=1e-11)
    late = engine.substep if SCHEMES[scheme].uses_new_rates else 0.0  # the new rates lead by a step
    parabola = first.momentum[0] / engine.total_mass * t - 0.5j * GRAVITY * t * (t + late)
    assert last.centre[0] - first.centre[0] == pytest.approx(parabola, rel=1e-11)
    assert np.ptp(np.diff(pitches)) > 0.01  # the legs turn the trunk
    gap = energy(engine) - before - drives_less_losses(engine)  # of some 440 J
    assert abs(gap) < (400, 0.6, 3e-3, 7e-4)[SCHEMES[scheme].order - 1]


@pytest.mark.filterwarnings("ignore::hoof_env.dynamics.step_length.StepWarning")
@pytest.mark.parametrize("depth", [0.04, -1.0], ids=["ground", "air"])
@pytest.mark.parametrize("kind", TRUNKS)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_the_energy_account_closes_at_the_order_of_the_scheme(scheme, kind, depth):
    """Kinetic and potential energy and what the ground stores change by the drives' work less the losses."""
    order, gaps = SCHEMES[scheme].order, []
    for steps in (20, 40):  # in 20 ms
        settings = {"sim_dt": 0.02 / steps, "integrator": scheme, "substeps": 1}
        engine = horse(SMOOTH, kind=kind, height=LOWEST - depth, drag=25.0, settings=settings)
        moves = {"vx": 1.0, "vy": -0.05, "pitch_rate": 0.1}
        engine.reset(STRIDE, THETA, crank_angle_rate=5.0, **dict(list(moves.items())[: FREEDOMS[kind]]))
        before = energy(engine)
        assert not engine.advance([8.0, 0.3, -0.2, 0.1], steps).any()
        gaps.append(abs(energy(engine) - before - drives_less_losses(engine))[0])
    total, legs = engine.account, engine.report
    assert total["crank_work"] > 20
    assert ((legs["toe_normal"] > 0) & (legs["heel_normal"] > 0) == (depth > 0)).all()  # smooth all the time
    if depth > 0:
        assert min(total[name] for name in ("ground_stored", "ground_loss", "friction_loss")) > 10
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(order, abs=0.1)
    assert gaps[1] < (10, 0.02, 1e-4, 1e-6)[order - 1]


@pytest.mark.filterwarnings("ignore::hoof_env.dynamics.step_length.StepWarning")
def test_the_energy_account_closes_over_touch_downs():
    leg, walk, errors = load_geometry("identified"), load_gait("walk", "identified"), []
    for step in (2e-3, 1e-3):
        engine = TrunkEngine(Limb(leg), Trunk(height=leg.hip_height), NATURAL, sim_dt=step, substeps=1)
        engine.reset(walk, 0.3)
        before = energy(engine)
        assert not engine.advance(steps=round(1.0 / step)).any()
        total = engine.account
        spent = sum(total[name] for name in total if name.endswith("_loss")) + total["ground_stored"]
        errors.append(abs(energy(engine) - before - drives_less_losses(engine)) / spent)
    assert errors[1] < 5e-6
    assert errors[1] < errors[0] / 3


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_trot_keeps_its_books(scheme):
    """Touch-downs and all: impulse is the change of momentum and weight, and no loss is a gain."""
    engine = horse(NATURAL, settings={"integrator": scheme, "sim_dt": 5e-4})
    engine.reset(WALK, THETA + np.pi * np.arange(4), vx=0.5)
    start, losses = engine.state, np.zeros(4)
    names = ("ground_loss", "friction_loss", "drag_loss", "damper_loss")
    for _ in range(12):
        assert not engine.advance(steps=50).any()
        now, total = engine.state, {name: row[0] for name, row in engine.account.items()}
        gain = [now[k][0] - start[k][0] for k in ("momentum_x", "momentum_y", "time")]
        size = engine.weight * gain[2]
        assert gain[0] == pytest.approx(total["impulse_x"], rel=0, abs=1e-12 * size)
        assert gain[1] == pytest.approx(total["impulse_y"] - size, rel=0, abs=1e-12 * size)
        assert all(np.array([total[name] for name in names]) >= losses)
        losses = np.array([total[name] for name in names])
    assert total["impulse_y"] > 0.3 * size
    assert min(total["friction_loss"], total["ground_loss"]) > 1
    assert total["drag_loss"] == total["damper_loss"] == 0


def test_drag_takes_its_part():
    """Impulse and drag are the change of momentum: the drag's is the trunk's way times it."""
    engine = horse(SMOOTH, kind="rail", height=LOWEST - 0.03, drag=200.0, settings={"integrator": "rk4"})
    engine.reset(STRIDE, THETA, vx=1.0)
    start, x = engine.state["momentum_x"], engine.report["x"]
    engine.advance([8.0, 0.3, -0.2, 0.1], 20)
    drag = 200.0 * (engine.report["x"] - x)
    assert drag > 2
    assert engine.state["momentum_x"] - start == pytest.approx(engine.account["impulse_x"] - drag, abs=1e-6)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_at_rest_the_ground_carries_the_weight(scheme):
    """Dropped from a centimetre with its cranks held, the horse settles, and eight hoof points bear it."""
    ground = Ground(restitution=0.5, approach_floor=0.1, friction_law="tanh", friction_fast=0.5)
    under = [(x - 0.75, y) for x, y in HIPS]  # hoofs are ahead of their hips
    engine = horse(ground, Prescribed(), under, {"integrator": scheme}, height=LOWEST + 0.01)
    engine.reset(GaitParameters(0.0, 0.0, 0.0, 0.0), THETA)  # nothing but viscous friction holds it along x
    assert not engine.advance(steps=8000).any()
    r = {name: row[..., 0] for name, row in engine.report.items()}
    for name in ("vx", "vy", "pitch_rate", "ax", "ay", "pitch_acceleration"):
        assert abs(r[name]) < 1e-9
    assert r["toe_normal"].sum() + r["heel_normal"].sum() == pytest.approx(engine.weight, rel=1e-9)
    assert r["toe_friction"].sum() + r["heel_friction"].sum() == pytest.approx(0, abs=1e-9 * engine.weight)
    before = engine.account["impulse_y"]
    engine.advance(steps=1000)
    assert engine.account["impulse_y"] - before == pytest.approx(engine.weight, rel=1e-9)
