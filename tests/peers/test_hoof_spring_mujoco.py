"""A hoof without mass on a spring against MuJoCo, whose hoof has a mass m_h that goes to zero.

MuJoCo has the mass above and the hoof on two vertical slides, spring and damper between them. Eq. 14's force
on the hoof is applied here at each of MuJoCo's steps.
"""

import numpy as np
import pytest

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import HoofSpring, Limb, Prescribed, Trunk
from hoof_env.gait import GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from tests.legs import FIRST_FIT

mujoco = pytest.importorskip("mujoco")

MASS, SECONDS, EVERY = 135.0, 0.15, 1e-3  # of all bodies [kg], of a drop [s], of its record [s]
ABOVE, STEP = 1e-3, 1e-5  # of the hoof over the ground at the start [m], of MuJoCo [s]
HOOFS = (3.0, 1.0, 0.3, 0.1)  # m_h [kg]
SPRING = HoofSpring.with_ratio(4e4, MASS, 0.1)

MODEL = """
<mujoco>
  <option timestep="{step}" gravity="0 0 -{gravity}" integrator="RK4"><flag contact="disable"/></option>
  <worldbody>
    <body name="mass">
      <joint type="slide" axis="0 0 1"/><inertial pos="0 0 0" mass="{above}" diaginertia="1 1 1"/>
      <body name="hoof">
        <joint type="slide" axis="0 0 1" stiffness="{stiffness}" damping="{damping}"/>
        <inertial pos="0 0 0" mass="{hoof}" diaginertia="1 1 1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def ours(ground, speed):
    """How far the mass is under its start [m] and the ground's force [N], every `EVERY`. Only the
    toe lands."""
    leg = load_geometry(FIRST_FIT)
    trunk = Trunk(mass=MASS - leg.mass, share=1.0, stiffness=0.0, damping=0.0, drag=0.0, height=3.0)
    limb = Limb(leg, drive=Prescribed(), spring=SPRING)
    engine = TrunkEngine(limb, trunk, ground, sim_dt=STEP, substeps=1, integrator="rk4")
    pose = GaitParameters(0.0, 0.9, 0.0, 0.0), 4.1
    engine.reset(*pose, vy=-speed)
    toe, heel = engine.report["toe_y"][0, 0], engine.report["heel_y"][0, 0]
    assert heel > toe + 0.1
    engine.reset(*pose, y=3.0 - toe + ABOVE, vy=-speed)
    record = engine.run(steps=round(SECONDS / STEP), every=round(EVERY / STEP))
    assert not record["heel_normal"].any()
    return record["y"][0, 0] - record["y"][:, 0], record["toe_normal"][:, 0, 0]


def theirs(ground, speed, hoof):
    """The same of MuJoCo with a hoof of some mass [kg]."""
    text = MODEL.format(
        step=STEP, gravity=GRAVITY, above=MASS - hoof, hoof=hoof,
        stiffness=SPRING.stiffness, damping=SPRING.damping,
    )  # fmt: skip
    model = mujoco.MjModel.from_xml_string(text)
    data, chi = mujoco.MjData(model), ground.damping[0]
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "hoof")
    data.qvel[0] = -speed
    approach, fallen, forces = 0.0, [], []
    for k in range(round(SECONDS / STEP) + 1):
        depth, rate = -(ABOVE + data.qpos.sum()), -data.qvel.sum()
        force = 0.0
        if depth > 0.0:
            approach = approach or max(rate, ground.approach_floor)
            force = max(ground.stiffness * depth**ground.exponent * (1 + chi * rate / approach), 0.0)
        else:
            approach = 0.0
        if k % round(EVERY / STEP) == 0:
            fallen.append(-data.qpos[0])
            forces.append(force)
        data.xfrc_applied[body, 2] = force
        mujoco.mj_step(model, data)
    return np.array(fallen), np.array(forces)


@pytest.mark.peers
@pytest.mark.parametrize("stiffness", [2e5, 2e6, 1e7])
@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_a_hoof_without_mass_is_the_limit_of_light_ones(stiffness, speed):
    ground = Ground(stiffness=stiffness, restitution=0.5, approach_floor=0.1, friction=0.0)
    fallen, force = ours(ground, speed)
    off, off_force = [], []
    for hoof in HOOFS:
        other, other_force = theirs(ground, speed, hoof)
        off.append(np.abs(other - fallen).max() / np.ptp(fallen))
        off_force.append(np.sqrt(np.mean((other_force - force) ** 2)) / force.max())
    for errors, least in ((off, 1e-3), (off_force, 2e-3)):
        assert (np.divide(errors[1:], errors[:-1]) < 0.4).all(), errors  # in proportion to m_h
        assert errors[-1] < least
