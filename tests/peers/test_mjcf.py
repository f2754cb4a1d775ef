"""The models that legs are written as, in MuJoCo: loops stay closed, and the motion is this package's."""

import numpy as np
import pytest

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Motor, Trunk
from hoof_env.gait import GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.mjcf import Held, Options, PlacedLeg, write_mjcf
from tests.legs import PRESETS

mujoco = pytest.importorskip("mujoco")

THETA, SWING = 0.3, 0.4
LEGS = PRESETS | {name: name for name in ("jansen", "klann", "fourbar")}
LOOSE = Motor(speed_gain=0.0, torque_limit=0.0, rotor_inertia=0.0)
"""Motor that is not there."""


class Model:
    """A model with its data."""

    def __init__(self, text):
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)

    def at(self, joint):
        """Coordinate of a joint, 0 if there is none."""
        number = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_JOINT, joint)
        return self.data.qpos[number] if number >= 0 else 0.0

    def step(self, seconds):
        mujoco.mj_step(self.model, self.data, round(seconds / self.model.opt.timestep))
        mujoco.mj_forward(self.model, self.data)

    def sites(self):
        """Places of all sites, by the name of the point."""
        for k in range(self.model.nsite):
            yield self.model.site(k).name.split(" of ")[0], self.data.site_xpos[k][[0, 2]]

    def miss(self, leg, height=None):
        """Largest distance of a point from where this package has it, at the model's crank and swing."""
        there = FrameMotion(self.at("swing"), position=(self.at("x"), height or self.at("z")))
        expected = pose(leg, self.at("crank"), frame=there)
        return max(np.linalg.norm(place - expected.point(name)) for name, place in self.sites())


@pytest.mark.parametrize("preset", LEGS.values(), ids=LEGS)
def test_all_points_go_where_they_go_here_through_a_turn(preset):
    leg = load_geometry(preset)
    model = Model(leg.to_mjcf(theta=THETA, swing=SWING, motor=Motor()))
    assert model.miss(leg, leg.hip_height) < 1e-12
    model.data.ctrl[[model.model.actuator("swing").id, model.model.actuator("crank").id]] = SWING, 2 * np.pi
    for _ in range(20):
        model.step(0.06)
        assert model.miss(leg, leg.hip_height) < 3e-4 * leg.body_lengths.max()
    assert model.at("crank") > THETA + 2 * np.pi


@pytest.mark.parametrize("preset", LEGS.values(), ids=LEGS)
def test_a_crank_that_is_let_go_swings_as_here(preset):
    """The leg falls about its crank with nothing to hold it but the hip."""
    leg = load_geometry(preset)
    dt = 2.5e-4
    options = Options(timestep=dt, option=(("integrator", "RK4"),), loop_seconds=10 * dt, swings=False)
    model = Model(write_mjcf([PlacedLeg(leg, THETA, SWING)], Held(5.0), (0.0, 5.0), options))
    model.model.body_invweight0[:] *= 1e-4
    model.model.dof_invweight0[:] *= 1e-4
    engine = TrunkEngine([Limb(leg, drive=LOOSE)], Trunk(kind="fixed", height=5.0), Ground(), sim_dt=dt)
    engine.reset(GaitParameters(0.0, SWING, 0.0, 0.0), THETA, crank_angle_rate=0.0)
    there = []
    for _ in range(20):
        model.step(0.05)
        engine.advance(steps=round(0.05 / dt))
        there.append(engine.state["crank_angle"].item())
        assert model.at("crank") == pytest.approx(there[-1], abs=1e-4)
    assert np.ptp(there) > 0.5


@pytest.mark.parametrize("preset", LEGS.values(), ids=LEGS)
def test_a_leg_on_a_suspended_trunk_drops_and_bounces_as_here(preset):
    """With the servo of the swing, which gives way by a degree, and the loops of a plain export."""
    leg = load_geometry(preset)
    # links of four metres would push the servo aside at the speed of the others
    speed = 2.0 if leg.body_lengths.max() > 3 else 2 * np.pi
    trunk = Trunk(kind="suspended", height=leg.hip_height + 2.0)
    model = Model(leg.to_mjcf(theta=THETA, swing=SWING, trunk=trunk, motor=Motor()))
    model.data.ctrl[[model.model.actuator("swing").id, model.model.actuator("crank").id]] = SWING, speed
    engine = TrunkEngine([Limb(leg, drive=Motor())], trunk, Ground(), sim_dt=1e-3)
    engine.reset(GaitParameters(speed, SWING, 0.0, 0.0), THETA, crank_angle_rate=0.0)
    lowest = trunk.height
    for _ in range(20):
        model.step(0.05)
        engine.advance(steps=50)
        assert model.at("z") == pytest.approx(engine.report["y"].item(), abs=2e-3)
        assert model.at("x") == pytest.approx(engine.report["x"].item(), abs=5e-3)
        assert model.at("crank") == pytest.approx(engine.state["crank_angle"].item(), abs=0.03)
        assert model.at("swing") == pytest.approx(SWING, abs=0.02)
        lowest = min(lowest, model.at("z"))
    assert lowest < trunk.height - 0.05


@pytest.mark.parametrize("scale", [1.0, 0.3, 0.2, 0.1])
@pytest.mark.parametrize("preset", LEGS.values(), ids=LEGS)
def test_a_leg_of_any_size_keeps_together_and_holds_its_pose(preset, scale):
    leg = load_geometry(preset).scaled(scale)
    model = Model(leg.to_mjcf(theta=THETA, swing=SWING, motor=Motor()))
    mujoco.mj_resetDataKeyframe(model.model, model.data, model.model.key("pose").id)
    for _ in range(20):
        model.step(0.05)
        loops = np.abs(model.data.efc_pos[: model.data.ne]).max()
        assert loops < 1e-3 * leg.hip_height
        assert abs(model.at("swing") - SWING) < 0.1
    assert not model.data.warning[int(mujoco.mjtWarning.mjWARN_BADQACC)].number
