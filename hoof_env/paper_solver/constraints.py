"""The constraints of a leg, Eq. 2, with their Jacobian (Eq. 3), and the coordinates that satisfy them.

q holds (x, y, th) of the bodies of the leg's mechanism in the frame of the paper's drawing: O at the origin,
crank turning clockwise. The leg's frame, which carries the pivot C and turns by phi about O, is treated as
a further body with prescribed motion, so that one expression serves every joint, and the Jacobian's column of
the frame's orientation is d Phi / d phi.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.gait import Motion
from hoof_env.leg.assembly import body_coordinate, weld_angles
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.mechanism import FRAME

Vector = NDArray[np.float64]


class Closure(NamedTuple):
    """The constraint equations at one instant: rows x, y of every joint [m], then welds and driver [rad]."""

    error: Vector  # Phi(q, t)
    error_rate: Vector  # Phi_q qd + Phi_t
    jacobian: Vector  # Phi_q, square (Eq. 3)
    by_phi: Vector  # d Phi / d phi; d Phi / d theta is 1 in the driver's row and 0 elsewhere
    gamma: Vector  # required Phi_q qdd: -(Phi_q qd)_q qd - 2 Phi_qt qd - Phi_tt


class Constraints:
    """Eq. 2 of one leg: rows x and y of every joint in the order of the mechanism's list, its welds, and the
    driver."""

    def __init__(self, geometry: Geometry) -> None:
        mechanism = geometry.mechanism
        joints = mechanism.joints
        self.size = 3 * len(mechanism.bodies)  # of coordinates and of equations, which are equal in number
        self.joint_rows = 2 * len(joints)
        self.driver_row = self.size - 1
        self.crank = mechanism.crank
        self._x_rows = np.arange(0, self.joint_rows, 2)
        self._y_rows = self._x_rows + 1
        self._i = np.array([joint.i for joint in joints])
        self._j = np.array([joint.j for joint in joints])  # FRAME is -1: the last of all bodies
        self._place_i = np.array([body_coordinate(geometry, joint.point, joint.i) for joint in joints])
        self._place_j = np.array([body_coordinate(geometry, joint.point, joint.j) for joint in joints])
        self._welds = np.array(mechanism.welds, dtype=np.int64).reshape(-1, 2)
        self._weld_angles = np.array(weld_angles(geometry))
        self._weld_rows = self.joint_rows + np.arange(len(self._welds))
        constant = np.zeros((self.size, self.size + 3))
        for rows, axis in ((self._x_rows, 0), (self._y_rows, 1)):
            constant[rows, 3 * self._i + axis] = 1.0
            constant[rows, 3 * self._j + axis] = -1.0
        for bodies, sign in ((self._welds[:, 0], 1.0), (self._welds[:, 1], -1.0)):
            constant[self._weld_rows, 3 * bodies + 2] = sign
        constant[self.driver_row, 3 * self.crank + 2] = 1.0
        constant[self.driver_row, 3 * FRAME + 2] = -1.0
        self._constant = constant

    def __call__(self, q: Vector, qd: Vector, motion: Motion) -> Closure:
        """Evaluate everything at coordinates q, rates qd (shape (size,) each) and the motion law's angles."""
        x = np.append(q, (0.0, 0.0, motion.phi)).reshape(-1, 3)
        v = np.append(qd, (0.0, 0.0, motion.phi_rate))
        i = self._i
        j = self._j
        x_rows = self._x_rows
        y_rows = self._y_rows
        centre = x[:, 0] + 1j * x[:, 1]
        e = np.exp(1j * x[:, 2])
        rate = v[2::3]
        arm_i = self._place_i * e[i]
        arm_j = self._place_j * e[j]

        error = np.empty(self.size)
        gap = centre[i] + arm_i - centre[j] - arm_j
        error[x_rows] = gap.real
        error[y_rows] = gap.imag
        error[self._weld_rows] = x[self._welds[:, 0], 2] - x[self._welds[:, 1], 2] - self._weld_angles
        error[self.driver_row] = x[self.crank, 2] + motion.theta - motion.phi

        jacobian = self._constant.copy()
        for body, slope in ((i, 1j * arm_i), (j, -1j * arm_j)):
            jacobian[x_rows, 3 * body + 2] = slope.real
            jacobian[y_rows, 3 * body + 2] = slope.imag
        by_phi = jacobian[:, 3 * FRAME + 2]

        error_rate = jacobian @ v
        error_rate[self.driver_row] += motion.theta_rate

        gamma = -by_phi * motion.phi_acc
        turning = arm_i * rate[i] ** 2 - arm_j * rate[j] ** 2
        gamma[x_rows] += turning.real
        gamma[y_rows] += turning.imag
        gamma[self.driver_row] -= motion.theta_acc
        return Closure(error, error_rate, jacobian[:, : self.size], by_phi, gamma)


def closed_form(geometry: Geometry, motion: Motion) -> tuple[Vector, Vector]:
    """The q and qd, shape (size,) each, that solve Eq. 2 for angles of the motion law, welds and driver
    included."""
    drawn = geometry.replace(travel=1)  # the paper's own frame, not the world's
    frame = FrameMotion(motion.phi, motion.phi_rate)
    p = pose(drawn, motion.theta, motion.theta_rate, frame=frame)
    angles = p.angles.copy()
    # pose returns angles up to whole turns
    angles[geometry.mechanism.crank] = motion.phi - motion.theta
    for (one, other), angle in zip(geometry.mechanism.welds, weld_angles(geometry), strict=True):
        angles[one] = angles[other] + angle
    q = np.column_stack([p.centres, angles])
    qd = np.column_stack([p.centre_velocities, p.angular_velocities])
    return q.ravel(), qd.ravel()
