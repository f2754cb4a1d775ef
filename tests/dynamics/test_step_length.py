"""How long a step may be: slow touch-downs, servos, supports, and what friction asks for."""

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import TRUNKS, HoofSpring, Limb, Motor, Prescribed, Trunk
from hoof_env.dynamics.step_length import MAX_SUBSTEPS, StepWarning
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.gait import GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from tests.dynamics.scenes import LEG, LOWEST, NATURAL, THETA, WALK, drives_less_losses, energy, horse

FAR = 60.0  # above the ground [m]


def damped(floor, restitution=0.5):
    return Ground(restitution=restitution, approach_floor=floor, friction_fast=0.05)


def many(floor, **settings):
    """24 horses."""
    return horse(damped(floor), settings={"num_envs": 24} | settings)


def walk(engine):
    """How far the energy account is from closing after 0.5 s, over the work [-]; infinite for failures."""
    n = engine.num_envs
    engine.reset(WALK, np.linspace(0, 2 * np.pi, n, endpoint=False) + np.arange(4)[:, None] * 1.57)
    first = energy(engine)
    result, total = engine.advance(steps=500), engine.account
    gap = np.abs(energy(engine) - first - drives_less_losses(engine))
    losses = sum(total[name] for name in total if name.endswith("_loss"))
    size = np.abs(total["crank_work"]) + np.abs(total["swing_work"]) + losses
    return np.where(result == 0, gap / size, np.inf)


@pytest.mark.filterwarnings("ignore::hoof_env.dynamics.step_length.StepWarning")
def test_slow_touch_downs_get_the_substeps_that_they_need():
    chosen = many(1e-2)
    assert 5 < chosen.substeps < MAX_SUBSTEPS
    assert chosen.step_limits["damping"] * chosen.substeps >= 1e-3
    assert walk(chosen).max() < 1e-4
    assert walk(many(1e-2, substeps=1)).max() > 0.1


def test_a_floor_too_low_for_any_substeps_is_named_with_one_that_would_do():
    with pytest.warns(StepWarning, match=r"damping of this ground") as caught:
        engine = many(1e-4)
    assert engine.substeps == MAX_SUBSTEPS
    found = re.search(r"or an approach_floor of (\S+) m/s, not 0.0001$", str(caught[0].message))
    assert walk(engine).max() > 0.1  # the warning is true
    with warnings.catch_warnings():
        warnings.simplefilter("error", StepWarning)
        assert horse(damped(float(found[1]))).substeps <= MAX_SUBSTEPS


def test_without_damping_a_floor_asks_for_nothing():
    engine = horse(damped(1e-4, restitution=1.0))
    assert engine.step_limits["damping"] == np.inf
    assert engine.substeps == 1


def test_a_dashpot_does_not_hang_on_the_floor():
    floors = (1e-4, 1e-2)
    grounds = [Ground(normal_law="kelvin-voigt", restitution=0.5, approach_floor=floor) for floor in floors]
    one, other = (horse(ground).step_limits["damping"] for ground in grounds)
    assert one == pytest.approx(other)


def test_what_nothing_can_push_away_asks_for_nothing():
    limb = Limb(LEG, (0.0, 0.0), Prescribed())
    fixed = TrunkEngine(limb, Trunk("fixed"), damped(1e-4))
    assert set(fixed.step_limits.values()) == {np.inf}
    rail = TrunkEngine(limb, Trunk("rail"), damped(1e-4))
    assert rail.step_limits["damping"] == np.inf
    assert rail.step_limits["friction"] < 0.1
    with pytest.warns(StepWarning, match="damping"):
        TrunkEngine(limb, Trunk("rail"), damped(1e-4), Terrain((0.0, 0.1)))


def test_a_trunk_that_pitches_easily_asks_for_shorter_steps():
    limits = [horse(Ground(), Prescribed(), pitch_inertia=j).step_limits["elastic"] for j in (1e9, 10.0)]
    assert limits[1] < limits[0] / 2


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("motor", [Motor(1e4, 1e9), Motor(1e3, 1e9, 0.0)])
def test_a_servo_gets_the_substeps_that_it_needs(scheme, motor):
    def left(substeps=None, kind="free"):
        """How far the crank is from the commanded speed after 0.3 s in the air [rad/s]."""
        trunk = Trunk(kind, mass=80.0, height=FAR, drag=0.0)
        engine = TrunkEngine(Limb(LEG, drive=motor), trunk, integrator=scheme, substeps=substeps)
        engine.reset(WALK, 0.3, crank_angle_rate=0.0)
        failed = engine.advance(steps=300)[0]
        return engine, np.inf if failed else abs(engine.state["crank_angle_rate"][0, 0] - WALK.crank_speed)

    for kind in TRUNKS:
        engine, error = left(kind=kind)
        assert engine.substeps == np.ceil(1e-3 / engine.step_limits["servo"]) > 4
        assert error < 0.01
    with pytest.warns(StepWarning, match=f"speed gain of a motor .* substeps={engine.substeps} of"):
        assert left(1)[1] > 0.01 or scheme == "rk4"


@pytest.mark.parametrize("change", [{"stiffness": 3e8}, {"damping": 4e5}])
def test_a_stiff_support_gets_the_substeps_that_it_needs(change):
    def height(substeps=None):
        trunk = Trunk("suspended", height=FAR, **change)
        engine = TrunkEngine(Limb(LEG), trunk, substeps=substeps)
        engine.reset(WALK, y=FAR + 0.01)
        failed = engine.advance(steps=100)[0]
        return engine, np.inf if failed else abs(engine.report["y"][0] - FAR)

    engine, off = height()
    assert engine.substeps > 1
    assert off < 0.02
    with pytest.warns(StepWarning, match="spring, damper or drag of the trunk"):
        assert height(1)[1] > 0.02


@pytest.mark.filterwarnings("ignore::hoof_env.dynamics.step_length.StepWarning")
def test_standing_forces_are_clean_at_the_step_that_friction_asks_for():
    """The numbers in the docstring of `TrunkEngine`."""
    stand = GaitParameters(0.0, WALK.swing_offset, 0.0, 0.0)

    def forces(substeps):
        engine = horse(NATURAL, settings={"substeps": substeps})
        engine.reset(stand, THETA)
        engine.advance(steps=500)
        record = engine.run(steps=300)
        return engine, record["toe_friction"] + record["heel_friction"]

    engine, coarse = forces(1)
    asked = int(np.ceil(1e-3 / engine.step_limits["friction"]))
    assert asked == 8
    (_, fine), (_, finest) = forces(asked), forces(4 * asked)
    size = np.sqrt((finest**2).mean())
    assert np.sqrt(((fine - finest) ** 2).mean()) < 1e-3 * size
    assert np.sqrt(((coarse - finest) ** 2).mean()) > 0.5 * size


def stiff(scheme, substeps=None):
    """A horse of 500 kg comes down from 5 cm at a walk on 1 MN/m^1.5; height, pitch and cranks on the way."""
    hips = [(x, 0.0) for x in (-1.5, -1.4, -0.1, 0.0)]
    settings, mass = {"integrator": scheme, "substeps": substeps}, 500.0 - 4 * LEG.mass
    ground = replace(NATURAL, stiffness=1e6)
    e = horse(ground, None, hips, settings, mass=mass, height=LOWEST + 0.05, pitch_inertia=100.0)
    e.reset(WALK, THETA)
    way, most = [], 0.0
    for _ in range(30):
        assert not e.advance(steps=10).any()
        way.append([e.report["y"][0], e.state["pitch"][0], *e.state["crank_angle"][:, 0]])
        most = max(most, e.report["toe_normal"].max())
    assert most > e.weight / 4
    return e, np.array(way)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_stiff_ground_gets_the_substeps_that_it_needs(scheme):
    with warnings.catch_warnings():
        warnings.simplefilter("error", StepWarning)
        chosen, way = stiff(scheme)
        _, fine = stiff(scheme, 8 * chosen.substeps)
    needed = f"expected at most .* s, that is substeps={chosen.substeps} of sim_dt = 0.001 s"
    with pytest.warns(StepWarning, match=f"steps of 0.001 s are too long .*: {needed}"):
        _, coarse = stiff(scheme, 1)
    error, too_long = np.abs(way - fine), np.abs(coarse - fine)
    assert error.max() < 1e-3
    assert too_long.max() > 4 * error.max()


def dropped(ratio, stiffness, restitution, step=None):
    """Peak force divided by the weight of 135 kg dropped at 1 m/s on a sprung hoof, and the engine; `step` is
    part of the limit of the sole, None what the engine chooses."""
    spring, mass = HoofSpring.with_ratio(4e4, 135.0 / 2, ratio), 135.0
    trunk = Trunk(mass=mass - LEG.mass, share=1.0, stiffness=0.0, damping=0.0, drag=0.0, height=3.0)
    ground = Ground(stiffness=stiffness, restitution=restitution, approach_floor=0.1)
    limb, settings = Limb(LEG, drive=Prescribed(), spring=spring), {}
    if step:
        limit = TrunkEngine(limb, trunk, ground).step_limits["hoof"]
        settings = {"sim_dt": step * limit, "substeps": 1}
    engine, pose = TrunkEngine(limb, trunk, ground, strides=True, **settings), GaitParameters(0, 0.4, 0, 0)
    engine.reset(pose, 4.1, vy=-1.0)
    low = min(engine.report["toe_y"][0, 0], engine.report["heel_y"][0, 0])
    engine.reset(pose, 4.1, y=3.0 - low + 1e-3, vy=-1.0)
    engine.advance(steps=round(0.25 / engine.sim_dt))
    peak = engine.strides["highest_grf"][0, 0] / (mass * GRAVITY) if not engine.results.any() else np.inf
    return peak, engine


@pytest.mark.filterwarnings("ignore::hoof_env.dynamics.step_length.StepWarning")
@pytest.mark.parametrize(
    ("ratio", "stiffness", "restitution"), [(0.02, 1e7, 0.5), (0.02, 2e6, 1.0), (0.05, 1e7, 1.0)]
)
def test_a_sole_without_mass_gets_the_step_that_its_damping_allows(ratio, stiffness, restitution):
    """What is chosen is as good as a tenth of it; a step of five times the limit is not."""
    case = (ratio, stiffness, restitution)
    fine, chosen, coarse = (dropped(*case, step)[0] for step in (0.1, None, 5.0))
    assert chosen == pytest.approx(fine, rel=2e-3)
    assert abs(coarse / fine - 1) > 0.05


def test_a_sole_with_too_few_substeps_is_named():
    _, engine = dropped(0.02, 1e7, 0.5, 0.1)
    assert engine.step_limits["hoof"] == min(engine.step_limits.values())
    with pytest.warns(StepWarning, match="are too long for the damping of the hooves' springs against"):
        TrunkEngine(engine.limbs, engine.trunk, engine.ground, substeps=1)


def test_springs_ask_for_less_the_more_they_are_damped():
    limits = [dropped(ratio, 1e7, 0.5, 0.1)[1].step_limits["hoof"] for ratio in (0.02, 0.1, 0.5)]
    assert limits == sorted(limits)
    rigid = TrunkEngine(Limb(LEG), Trunk("fixed"))
    assert rigid.step_limits["hoof"] == np.inf
