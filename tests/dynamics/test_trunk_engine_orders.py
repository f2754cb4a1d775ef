"""Runs of the engine of several legs against the oracle's: each scheme converges at its order, in air."""

from functools import cache

import numpy as np
import pytest

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Motor, Prescribed, Trunk
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.gait import FilterSettings, GaitParameters
from tests.dynamics.scenes import FAR, LEG, RUN, WALK
from tests.oracle.horse import PlainHorse
from tests.oracle.run import simulate

OTHER = LEG.replace(travel=-LEG.travel, lengths={"FG": 0.6})
GAITS = (RUN, WALK)
MOTOR = Motor(speed_gain=60.0, torque_limit=1e4, rotor_inertia=4e-4)
THETA, RATE, SECONDS = (1.0, 4.0), (6.0, 9.0), 0.05
MOVES = {
    "fixed": ((0.0, 3.0, 0.0), (0.0, 0.0, 0.0)),
    "suspended": ((0.0, 3.2, 0.0), (1.0, -0.5, 0.0)),
    "free": ((0.0, 3.0, 0.2), (1.0, 0.5, -0.8)),
}
DRIVES = {"motor": (MOTOR, MOTOR), "prescribed": (Prescribed(), Prescribed()), "mixed": (MOTOR, Prescribed())}
CASES = (("fixed", "motor"), ("suspended", "mixed"), ("free", "motor"), ("free", "prescribed"))


def horse(kind, drives):
    limbs = (Limb(LEG, (0.5, 0.1), DRIVES[drives][0]), Limb(OTHER, (-0.4, -0.05), DRIVES[drives][1]))
    return limbs, Trunk(kind, mass=60.0, height=3.0, drag=25.0, pitch_inertia=8.0)


def spin(drives):
    return np.where([isinstance(d, Motor) for d in DRIVES[drives]], RATE, [g.crank_speed for g in GAITS])


@cache
def true_end(kind, drives):
    """Trunk, its rates, crank angles and rates after `SECONDS`."""
    limbs, trunk = horse(kind, drives)
    run = simulate(PlainHorse(trunk, limbs), GAITS, [0.0, SECONDS], THETA, spin(drives), *MOVES[kind])
    return np.concatenate([run.trunk[-1], run.trunk_rate[-1], run.theta[-1], run.theta_rate[-1]])


def end(kind, drives, scheme, steps):
    limbs, trunk = horse(kind, drives)
    engine = TrunkEngine(limbs, trunk, FAR, sim_dt=SECONDS / steps, integrator=scheme, substeps=1)
    place, rates = MOVES[kind]
    start = dict(zip(("x", "y", "pitch", "vx", "vy", "pitch_rate"), place + rates, strict=True))
    engine.reset(GAITS, THETA, crank_angle_rate=spin(drives), **start)
    assert not engine.advance(steps=steps).any()
    r, s = engine.report, engine.state
    trunk = [r["x"], r["y"], s["pitch"], r["vx"], r["vy"], r["pitch_rate"]]
    return np.concatenate([*trunk, s["crank_angle"][:, 0], s["crank_angle_rate"][:, 0]])


@pytest.mark.parametrize(("kind", "drives"), CASES)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_it_converges_to_the_oracle_at_the_order_of_the_scheme(scheme, kind, drives):
    order, finest = SCHEMES[scheme].order, 160
    if order > 2:
        finest = 12 if drives == "prescribed" else 48  # finer ones are as good as the oracle
    errors = [
        np.abs(end(kind, drives, scheme, n) - true_end(kind, drives)).max() for n in (finest // 2, finest)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15)
    assert errors[1] < 0.3 * (SECONDS / finest * 100) ** order


@pytest.mark.parametrize("scheme", SCHEMES)
def test_prescribed_motion_is_exact(scheme):
    limbs, trunk = horse("fixed", "prescribed")
    engine = TrunkEngine(limbs, trunk, FAR, sim_dt=5e-3, integrator=scheme, substeps=1)
    engine.reset(GAITS, THETA)
    engine.advance(steps=100)
    speeds = np.array([gait.crank_speed for gait in GAITS])
    assert engine.state["crank_angle"][:, 0] == pytest.approx(THETA + 0.5 * speeds, rel=1e-14)


def test_all_schemes_move_the_filters_alike():
    """Commands on the move: what the filters do is exact for the accelerations that each step holds."""
    limbs, trunk = horse("free", "prescribed")
    ends = []
    for scheme in SCHEMES:
        engine = TrunkEngine(limbs, trunk, FAR, integrator=scheme, substeps=1)
        engine.reset(GaitParameters(3.0, 0.5, 0.0, 0.0), y=3.0)
        engine.advance([g.to_array() for g in GAITS], 150)
        state = engine.state
        ends.append([state[k] for k in ("crank_angle", "crank_speed", "swing_sin", "swing_cos_rate")])
    for other in ends[1:]:
        np.testing.assert_array_equal(ends[0], other)


def test_semi_implicit_euler_moves_with_the_rates_of_the_end():
    limbs, trunk = horse("free", "motor")
    engine = TrunkEngine(limbs, trunk, FAR, sim_dt=1e-3, integrator="semi_implicit_euler", substeps=1)
    engine.reset(GAITS, THETA, y=3.0, vx=1.0, pitch_rate=0.5, crank_angle_rate=RATE)
    before = engine.state
    engine.advance(steps=1)
    after = engine.state
    assert (np.abs(after["crank_angle_rate"] - before["crank_angle_rate"]) > 1e-3).all()
    np.testing.assert_allclose(
        after["crank_angle"], before["crank_angle"] + 1e-3 * after["crank_angle_rate"], rtol=1e-15
    )
    speed = after["momentum_x"] / engine.total_mass
    np.testing.assert_allclose(after["centre_x"], before["centre_x"] + 1e-3 * speed, rtol=1e-14)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_it_converges_at_its_order_while_cranks_speed_up(scheme):
    """The commands are so far away that the filters accelerate evenly throughout, whatever the step."""

    def end_of(scheme, steps):
        limbs, trunk = horse("free", "prescribed")
        filters = FilterSettings(gain=1.0, crank_rate=1e3, crank_acc=1e3)
        engine = TrunkEngine(
            limbs, trunk, FAR, sim_dt=SECONDS / steps, integrator=scheme, substeps=1, filters=filters
        )
        engine.reset(GAITS, THETA, y=3.0, vx=1.0, vy=0.5, pitch_rate=-0.8)
        far = np.array([gait.to_array() for gait in GAITS])
        far[:, 0] += 1e3
        assert not engine.advance(far, steps).any()
        np.testing.assert_allclose(engine.state["crank_speed_rate"], 1e3 * SECONDS, rtol=1e-12)
        r = engine.report
        return np.concatenate([r["x"], r["y"], r["vx"], r["vy"], r["pitch_rate"]])

    true_end = end_of("rk4", 400)
    order = SCHEMES[scheme].order
    finest = 12 if order > 2 else 160
    errors = [np.abs(end_of(scheme, n) - true_end).max() for n in (finest // 2, finest)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)
