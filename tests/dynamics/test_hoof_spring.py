"""Hoofs on springs of their own, see `parts.HoofSpring`: drops, standing, energy, friction, limits, order.

What acts at one instant is compared with the oracle in test_trunk_engine.py.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import HoofSpring, Limb, Prescribed, Trunk
from hoof_env.gait import GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from tests.dynamics.scenes import LEG, LOWEST, NATURAL, THETA, WALK, drives_less_losses, energy, horse

MASS, HORSE = 135.0, 475.0  # of what one leg bears and of the horse [kg]
STILL, LEVEL = GaitParameters(0.0, 0.4, 0.0, 0.0), GaitParameters(0.0, 0.0, 0.0, 0.0)
SOFT_TO_HARD = (2e5, 6e5, 2e6, 1e7)  # K of the ground [N/m^1.5]
UNDER = tuple((x - 0.8, 0.0) for x in (-0.75, -0.65, 0.65, 0.75))  # hips so that the feet are under the trunk


def spring_of(stiffness, ratio=0.1, mass=MASS / 2):
    """None is a rigid hoof; the mass [kg] is that on each point."""
    return None if stiffness is None else HoofSpring.with_ratio(stiffness, mass, ratio)


def leg_over(ground, spring, **settings):
    """A leg that bears `MASS`, and nothing else holds it."""
    trunk = Trunk(mass=MASS - LEG.mass, share=1.0, stiffness=0.0, damping=0.0, drag=0.0, height=3.0)
    return TrunkEngine(Limb(LEG, drive=Prescribed(), spring=spring), trunk, ground, **settings)


def drop(engine, speed, above=1e-3):
    """Start with the hoof so far above the ground [m], downwards [m/s]."""
    engine.reset(STILL, 4.1, vy=-speed)
    low = min(engine.report[f"{point}_y"][0, 0] for point in ("toe", "heel"))
    engine.reset(STILL, 4.1, y=3.0 - low + above, vy=-speed)


def peak(stiffness, ground_stiffness, speed):
    """Largest force of a drop, of the weight [-]."""
    ground = Ground(stiffness=ground_stiffness, restitution=0.5, approach_floor=0.1)
    engine = leg_over(ground, spring_of(stiffness), strides=True)
    drop(engine, speed)
    assert not engine.advance(steps=400).any()
    return engine.strides["highest_grf"][0, 0] / (MASS * GRAVITY)


@pytest.mark.parametrize("speed", [0.3, 0.6, 1.0])
def test_the_peak_of_a_drop_is_the_springs_and_not_the_grounds(speed):
    for stiffness in (2e4, 4e4, 6e4):
        peaks = [peak(stiffness, ground, speed) for ground in SOFT_TO_HARD]
        assert max(peaks) < 1.15 * min(peaks), stiffness
    rigid = [peak(None, ground, speed) for ground in SOFT_TO_HARD]
    assert max(rigid) > 1.8 * min(rigid)


def soles(engine):
    """Places of the soles along the ground [m], as if it were level."""
    report, state = engine.report, engine.state
    given = (state.get(f"{point}_deflection_tangential", 0.0) for point in ("toe", "heel"))
    return np.array([report[f"{point}_x"] - give for point, give in zip(("toe", "heel"), given, strict=True)])


@pytest.mark.parametrize("stiffness", [4e4, None], ids=["spring", "rigid"])
def test_a_horse_stands_on_a_slope_for_a_minute(stiffness):
    slope = np.radians(3.0)
    engine = horse(
        Ground(restitution=0.5, approach_floor=0.1), Prescribed(), UNDER, {"substeps": 1},
        spring_of(stiffness, 0.1, HORSE / 8), Terrain.slope(slope), mass=HORSE - 4 * LEG.mass,
    )  # fmt: skip
    engine.reset(LEVEL, THETA, x=-np.sin(slope) * LOWEST, y=np.cos(slope) * LOWEST, pitch=slope)
    assert not engine.advance(steps=2000).any()
    before, stood = engine.report, soles(engine)
    assert not engine.advance(steps=60_000).any()
    after = engine.report
    moved = np.hypot(after["x"] - before["x"], after["y"] - before["y"])[0]
    if stiffness:
        assert moved < 1e-3
        assert np.abs(soles(engine) - stood).max() < 1e-3
    else:
        assert moved > 0.03


@pytest.mark.parametrize("integrator", ["midpoint", "rk4"])
def test_the_energy_account_closes_with_what_springs_store_and_lose(integrator):
    gaps = []
    for substeps in (1, 4, 16):
        settings = {"substeps": substeps, "integrator": integrator}
        engine = horse(NATURAL, Prescribed(), settings=settings, spring=spring_of(4e4, 0.1, HORSE / 8))
        engine.reset(WALK, THETA, y=LOWEST + 0.1)
        start = energy(engine)
        assert not engine.advance(steps=500).any()
        gaps.append(abs(energy(engine) - start - drives_less_losses(engine))[0])
        assert engine.account["hoof_loss"][0] > 50.0  # [J]
    assert gaps[1] < gaps[0] / 4
    assert gaps[2] < gaps[1] / 4


starts = {
    "theta": st.floats(0, 6.28), "pitch": st.floats(-0.2, 0.2), "vx": st.floats(-2, 2),
    "vy": st.floats(-2, 1), "pitch_rate": st.floats(-2, 2), "depth": st.floats(-0.05, 0.02),
}  # fmt: skip
CONE = horse(NATURAL, Prescribed(), spring=spring_of(4e4, 0.1, HORSE / 8))


@given(**starts)
def test_friction_stays_in_its_cone_and_the_ground_never_pulls(theta, depth, **start):
    engine = CONE
    engine.reset(WALK, THETA + theta, y=0.0, **start)
    low = min(engine.report["toe_y"].min(), engine.report["heel_y"].min())
    engine.reset(WALK, THETA + theta, y=-low - depth, **start)
    record = engine.run(steps=100)
    for point in ("toe", "heel"):
        normal, friction, slide = (record[f"{point}_{name}"] for name in ("normal", "friction", "slide"))
        grip = NATURAL.friction * normal
        assert normal.min() >= 0.0
        assert (np.abs(friction) <= grip * (1 + 1e-14)).all()
        assert (slide[np.abs(friction) < grip * (1 - 1e-12)] == 0.0).all()  # it sticks
        assert (friction * slide <= 0.0).all()


def test_a_stiff_spring_tends_to_a_rigid_hoof():
    def fall(spring):
        engine = leg_over(
            Ground(restitution=0.5, friction=0.0, approach_floor=0.1), spring, sim_dt=1e-4, substeps=10
        )
        drop(engine, 0.6)
        return engine.run(steps=2000, every=10)["y"][:, 0]

    rigid = fall(None)
    off = [np.abs(fall(spring_of(stiffness)) - rigid).max() for stiffness in (1e6, 1e7, 1e8)]
    assert off[1] < off[0] / 4
    assert off[2] < off[1] / 4
    assert off[2] < 1e-4


@pytest.mark.parametrize(("integrator", "order"), [("midpoint", 2), ("rk4", 4)])
def test_order_of_convergence_while_the_hoof_stands(integrator, order):
    def end(scheme, h):
        ground = Ground(stiffness=2e6, restitution=0.5, approach_floor=0.1)
        engine = leg_over(ground, spring_of(4e4), sim_dt=h, substeps=1, integrator=scheme)
        drop(engine, 0.1, above=-0.1)
        record = engine.run(steps=round(0.048 / h))
        assert all(record[f"{point}_normal"].min() > 0 for point in ("toe", "heel"))
        return np.array([engine.report[name][0] for name in ("x", "y", "vx", "vy")])

    exact = end("rk4", 1e-5)
    steps = 2e-3 / 2.0 ** np.arange(4)
    errors = [np.abs(end(integrator, h) - exact).max() for h in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.3)


def test_a_longer_spring_under_a_higher_trunk_moves_alike():
    """On level ground only distances to the soles matter; the sum is rounded elsewhere."""

    def fall(length):
        spring = HoofSpring(2e4, 300.0, length=length)
        trunk = Trunk("boom", mass=MASS - LEG.mass, drag=0.0, height=3.0)
        ground = Ground(stiffness=2e6, restitution=0.5, approach_floor=0.1)
        engine = TrunkEngine(Limb(LEG, drive=Prescribed(), spring=spring), trunk, ground)
        engine.reset(STILL, 4.1)
        low = min(engine.report[f"{point}_y"][0, 0] for point in ("toe", "heel"))
        engine.reset(STILL, 4.1, y=3.0 - low + length + 0.02, vx=0.5)
        return engine.run(steps=400, every=5)

    short, long = fall(0.0), fall(0.25)
    assert short["toe_normal"].max() > MASS * GRAVITY
    np.testing.assert_allclose(long["y"] - 0.25, short["y"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(long["x"], short["x"], rtol=0, atol=1e-9)
    depth = long["toe_penetration"]
    np.testing.assert_allclose(depth, short["toe_penetration"], rtol=0, atol=1e-9)
    assert min(short["toe_y"].min(), short["heel_y"].min()) < -0.03
    assert min(long["toe_y"].min(), long["heel_y"].min()) > 0.1  # the leg's points stay above the ground


def test_a_leg_bears_the_whole_weight_of_a_boom():
    spring = HoofSpring.with_ratio(2e4, MASS / 2, 1.0)
    trunk = Trunk("boom", mass=MASS - LEG.mass, drag=0.0, height=3.0)
    engine = TrunkEngine(Limb(LEG, drive=Prescribed(), spring=spring), trunk, Ground(stiffness=2e6))
    engine.reset(STILL, 4.1)
    low = min(engine.report[f"{point}_y"][0, 0] for point in ("toe", "heel"))
    engine.reset(STILL, 4.1, y=3.0 - low)
    assert not engine.advance(steps=6000).any()
    load = engine.report["toe_normal"] + engine.report["heel_normal"]
    assert load[0, 0] == pytest.approx(MASS * GRAVITY, rel=1e-6)
