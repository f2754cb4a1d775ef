"""Drive torques against Lagrange's equations in crank angle, swing angle and the trunk's x and y.

Nothing of the engine's virtual power is used: the inertia matrix is read off the velocities of `pose` at unit
rates and differentiated numerically, and the trunk's acceleration follows from its own two equations.
"""

import numpy as np
import pytest

from hoof_env.dynamics.engine import LegEngine
from hoof_env.dynamics.trace import new_trace
from hoof_env.dynamics.trunk import GRAVITY, Trunk
from hoof_env.gait.parameters import LIMITS, load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.linkage import POINTS

WALK, RUN = load_gait("walk", "first_fit"), load_gait("run", "first_fit")
FASTEST = np.array([high for _, high in LIMITS.values()])
HEAVY = load_geometry("first_fit").replace(masses=tuple(np.linspace(3.0, 0.5, 14)))
FREE = {"fixed": [], "rail": [2], "suspended": [2, 3]}

STEP, OFFSETS = 1e-3, (-2, -1, 1, 2)  # central differences of fourth order
FIRST = np.array([1, -8, 8, -1]) / (12 * STEP)


def unit_poses(leg, theta, phi):
    """The leg moving at unit rate of theta, phi, x and y in turn."""
    for rates in np.eye(4):
        frame = FrameMotion(phi=phi, phi_rate=rates[1], velocity=tuple(rates[2:]))
        yield pose(leg, theta, rates[0], frame=frame)


def inertia(leg, trunk, theta, phi):
    """Inertia matrix (4, 4): products of the momenta that unit rates give."""
    parts = [
        np.concatenate(
            [
                (np.sqrt(leg.body_masses)[:, None] * at.centre_velocities).ravel(),
                np.sqrt(leg.body_inertias) * at.angular_velocities,
                np.sqrt(trunk.mass) * at.point_velocities[POINTS.index("O")],
            ]
        )
        for at in unit_poses(leg, theta, phi)
    ]
    return np.array(parts) @ np.array(parts).T


def lagrange(leg, trunk, row):
    """Torques (crank, swing) that the motion in a trace row takes."""
    q = np.array([row["theta"], row["phi"]])
    rates = np.array([row[name] for name in ("theta_rate", "phi_rate", "trunk_vx", "trunk_vy")])

    def derivative(function):
        """By theta and by phi."""
        return [np.tensordot(FIRST, [function(*(q + STEP * k * e)) for k in OFFSETS], 1) for e in np.eye(2)]

    def height(theta, phi):
        return leg.body_masses @ pose(leg, theta, frame=FrameMotion(phi=phi)).centres[:, 1]

    slopes = derivative(lambda *x: inertia(leg, trunk, *x))
    load = (slopes[0] * rates[0] + slopes[1] * rates[1]) @ rates
    load[:2] -= [rates @ slope @ rates / 2 for slope in slopes]
    load[:2] += GRAVITY * np.array(derivative(height))
    load[2] += trunk.drag * rates[2]
    load[3] += trunk.share * (trunk.mass + leg.mass) * GRAVITY
    load[3] += trunk.stiffness * (row["trunk_y"] - trunk.height) + trunk.damping * rates[3]
    for point, name in (("toe", leg.toe), ("heel", leg.heel)):
        force = np.array([row[f"{point}_friction"], row[f"{point}_normal"]])
        load -= [force @ at.point_velocities[POINTS.index(name)] for at in unit_poses(leg, *q)]

    matrix, free = inertia(leg, trunk, *q), FREE[trunk.kind]
    acc = np.array([row["theta_acc"], row["phi_acc"], 0.0, 0.0])
    if free:
        acc[free] = np.linalg.solve(matrix[np.ix_(free, free)], -(matrix @ acc + load)[free])
    return (matrix @ acc + load)[:2]


@pytest.mark.parametrize("kind", FREE)
@pytest.mark.parametrize("travel", [-1, 1])
@pytest.mark.parametrize(("gait", "theta"), [(WALK, 1.3), (RUN, 0.9)])
def test_drive_torques_are_lagranges(kind, travel, gait, theta):
    leg, trunk = HEAVY.replace(travel=travel), Trunk(kind, height=HEAVY.hip_height)
    engine = LegEngine(leg, trunk, Ground(restitution=0.5, approach_floor=0.1), 1e-3)
    engine.reset(gait, theta=theta, speed=0.0 if kind == "fixed" else 2.0)
    stood = 0.0
    for command, substeps in (
        (RUN.to_array(), 90),
        (WALK.to_array(), 90),
        (FASTEST, 50),
        (RUN.to_array(), 90),
    ):
        trace = new_trace(substeps)
        engine.advance(command, trace)
        stood = max(stood, trace["normal"].max())
        for row in trace[::15]:
            torques = (row["crank_torque"], row["hip_torque"])
            scale = max(1.0, *np.abs(torques))
            assert torques == pytest.approx(lagrange(leg, trunk, row), abs=1e-8 * scale)
            assert row["crank_power"] == row["crank_torque"] * row["theta_rate"]
            assert row["hip_power"] == row["hip_torque"] * row["phi_rate"]
    assert stood > 100


def test_masses_cost_nothing_but_torque_on_a_fixed_trunk():
    light = HEAVY.replace(masses=tuple(np.full(14, 1e-6)))
    traces = []
    for leg in (HEAVY, light):
        engine = LegEngine(leg, Trunk("fixed", height=leg.hip_height), Ground(), 1e-3)
        engine.reset(RUN)
        traces.append(new_trace(500))
        engine.advance(RUN.to_array(), traces[-1])
    heavy, light_trace = traces
    for name in ("grf", "toe_penetration", "hoof_angle"):
        assert (heavy[name] == light_trace[name]).all()
    assert np.abs(heavy["crank_torque"] - light_trace["crank_torque"]).max() > 10
