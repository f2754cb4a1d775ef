"""What several tests of the engines stand on."""

import numpy as np

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Motor, Trunk
from hoof_env.gait import load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.mechanism import FRAME
from tests.dynamics.tally import tally_of
from tests.legs import FIRST_FIT

LEG = load_geometry(FIRST_FIT)
RUN, WALK = load_gait("run", FIRST_FIT), load_gait("walk", FIRST_FIT)
NATURAL = Ground(restitution=0.5, approach_floor=0.1, friction_fast=0.05)  # of `HorseLeg-v0`
FAR = Ground(stiffness=100.0)  # out of reach, and soft enough for any step
THETA, LOWEST = np.array([4.02, 4.18, 4.1, 4.14]), 1.389  # soles level, and how far they are below O [m]
HIPS = ((-0.75, 0.0), (-0.65, 0.0), (0.65, 0.0), (0.75, 0.0))


def horse(ground=FAR, drive=None, hips=HIPS, settings=(), spring=None, terrain=None, **trunk):
    """Four legs on one trunk, free unless told otherwise."""
    trunk = {"kind": "free", "mass": 320.0, "height": LOWEST, "drag": 0.0, "pitch_inertia": 80.0} | trunk
    limbs = [Limb(LEG, hip, drive or Motor(), spring) for hip in hips]
    return TrunkEngine(limbs, Trunk(**trunk), ground, terrain, **dict(settings))


def energy(engine):
    """Kinetic and potential [J], shape (num_envs,)."""
    tally = tally_of(engine)
    return tally.kinetic + tally.potential


def drives_less_losses(engine):
    """What the account says of the change of `energy` [J]."""
    total = engine.account
    gains = total["crank_work"] + total["swing_work"] - total["ground_stored"] - total.get("hoof_stored", 0.0)
    return gains - sum(total[name] for name in total if name.endswith("_loss"))


def same(one, other, env=slice(None)):
    """Whether states or reports by name are alike, bit for bit."""
    return all(np.array_equal(one[name][..., env], other[name][..., env]) for name in one)


def cross(arms, forces):
    """Moments, shape (...), of forces at arms, shape (..., 2)."""
    return arms[..., 0] * forces[..., 1] - arms[..., 1] * forces[..., 0]


def loads(geometry, motion, joints, lock, driver, hip, toe, heel):
    """Forces, shape (bodies + 1, 2), and moments about the centres, shape (bodies + 1,), of joints and ground
    on each body of a leg; the last is the leg's frame, about O."""
    mechanism = geometry.mechanism
    count = len(mechanism.bodies) + 1
    force, moment = np.zeros((count, 2)), np.zeros(count)
    centres = np.vstack([motion.centres, motion.point(mechanism.centre)])

    def push(body, point, pushed):
        force[body] += pushed
        moment[body] += cross(motion.point(point) - centres[body], pushed)

    for joint, pushed in zip(mechanism.joints, joints, strict=True):
        push(joint.i, joint.point, pushed)
        push(joint.j, joint.point, -pushed)
    for foot, pushed in zip((geometry.toe, geometry.heel), (toe, heel), strict=True):
        if foot is not None:
            push(mechanism.body_of_foot(foot), foot, pushed)
    for weld, turned in zip(mechanism.welds, np.atleast_1d(lock), strict=True):
        moment[list(weld)] += turned, -turned
    moment[mechanism.crank] += driver
    moment[FRAME] += hip - driver
    return force, moment


def inertia(geometry, motion):
    """Forces, shape (bodies, 2), and moments, shape (bodies,), that move the links against their weight."""
    force = geometry.body_masses[:, None] * np.add(motion.centre_accelerations, (0, GRAVITY))
    return force, geometry.body_inertias * motion.angular_accelerations
