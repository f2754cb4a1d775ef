"""The constraint equations of the paper's Eq. 2 in 42 absolute coordinates, from the table in `leg.linkage`.

q holds (x, y, th) of the 14 bodies in the frame of the paper's drawing: O at the origin, crank turning
clockwise. The leg's frame, which carries the pivot C and turns by phi about O, is treated as a fifteenth body
whose motion is prescribed. So one expression serves every joint, and the Jacobian's column of the frame's
orientation is d Phi / d phi.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.linkage import BODIES, CONSTRUCTION, DRIVER, FRAME, JOINTS, LOCK, Extension

Vector = NDArray[np.float64]

SIZE = 3 * len(BODIES)
"""Number of coordinates, and of constraint equations: the crank is driven, so that nothing is free."""

JOINT_ROWS = 2 * len(JOINTS)
LOCK_ROW, DRIVER_ROW = JOINT_ROWS, JOINT_ROWS + 1
"""Order of the rows: x and y of every joint as in `JOINTS`, then the lock, then the driver."""

_I = np.array([joint.i for joint in JOINTS])
_J = np.array([joint.j for joint in JOINTS])  # FRAME is -1: the last of 15 bodies
_X, _Y = np.arange(0, JOINT_ROWS, 2), np.arange(1, JOINT_ROWS, 2)


class Closure(NamedTuple):
    """The constraint equations at one instant, 42 rows (joint rows in m, lock and driver in rad)."""

    error: Vector  # Phi(q, t)
    error_rate: Vector  # Phi_q qd + Phi_t
    jacobian: Vector  # Phi_q, shape (42, 42) (Eq. 3)
    by_phi: Vector  # d Phi / d phi; d Phi / d theta is 1 in the driver's row and 0 elsewhere
    gamma: Vector  # what Phi_q qdd must be, -(Phi_q qd)_q qd - 2 Phi_qt qd - Phi_tt


def body_coordinate(geometry: Geometry, point: str, body: int) -> complex:
    """Place of a named point on a body, in the body's own axes: from its centre, first axis along e_i [m]."""
    if body == FRAME:
        return {"O": 0j, "C": complex(*geometry.pivot)}[point]
    half = float(geometry.body_lengths[body]) / 2
    place = {BODIES[body].tail: -half, BODIES[body].head: half}
    if point not in place:  # A, on the line through the ends of link 8
        step = next(s for s in CONSTRUCTION if isinstance(s, Extension) and s.point == point)
        sense = np.sign(place[step.second] - place[step.first])
        place[point] = place[step.origin] + sense * geometry.lengths[step.distance]
    return complex(place[point])


class Constraints:
    """Eq. 2 of one leg."""

    def __init__(self, geometry: Geometry) -> None:
        self._place_i = np.array([body_coordinate(geometry, joint.point, joint.i) for joint in JOINTS])
        self._place_j = np.array([body_coordinate(geometry, joint.point, joint.j) for joint in JOINTS])
        constant = np.zeros((SIZE, SIZE + 3))
        for rows, axis in ((_X, 0), (_Y, 1)):
            constant[rows, 3 * _I + axis] = 1.0
            constant[rows, 3 * _J + axis] = -1.0
        one, other = LOCK
        constant[LOCK_ROW, 3 * one + 2], constant[LOCK_ROW, 3 * other + 2] = 1.0, -1.0
        constant[DRIVER_ROW, 3 * DRIVER + 2], constant[DRIVER_ROW, 3 * FRAME + 2] = 1.0, -1.0
        self._constant = constant

    def __call__(self, q: Vector, qd: Vector, motion: Any) -> Closure:
        """Evaluate everything at coordinates q, rates qd (shape (42,) each) and a `MOTION` record."""
        x = np.append(q, (0.0, 0.0, motion["phi"])).reshape(-1, 3)
        v = np.append(qd, (0.0, 0.0, motion["phi_rate"]))
        centre, e, rate = x[:, 0] + 1j * x[:, 1], np.exp(1j * x[:, 2]), v[2::3]
        arm_i, arm_j = self._place_i * e[_I], self._place_j * e[_J]

        error = np.empty(SIZE)
        gap = centre[_I] + arm_i - centre[_J] - arm_j
        error[_X], error[_Y] = gap.real, gap.imag
        error[LOCK_ROW] = x[LOCK[0], 2] - x[LOCK[1], 2]
        error[DRIVER_ROW] = x[DRIVER, 2] + motion["theta"] - motion["phi"]

        jacobian = self._constant.copy()
        for body, slope in ((_I, 1j * arm_i), (_J, -1j * arm_j)):
            jacobian[_X, 3 * body + 2], jacobian[_Y, 3 * body + 2] = slope.real, slope.imag
        by_phi = jacobian[:, 3 * FRAME + 2]

        error_rate = jacobian @ v
        error_rate[DRIVER_ROW] += motion["theta_rate"]

        gamma = -by_phi * motion["phi_acc"]
        turning = arm_i * rate[_I] ** 2 - arm_j * rate[_J] ** 2
        gamma[_X] += turning.real
        gamma[_Y] += turning.imag
        gamma[DRIVER_ROW] -= motion["theta_acc"]
        return Closure(error, error_rate, jacobian[:, :SIZE], by_phi, gamma)


def closed_form(geometry: Geometry, motion: Any) -> tuple[Vector, Vector]:
    """The q and qd, shape (42,) each, that solve Eq. 2 for a `MOTION` record, lock and driver included."""
    drawn = geometry.replace(travel=1)  # the paper's own frame, not the world's
    frame = FrameMotion(motion["phi"], motion["phi_rate"])
    p = pose(drawn, motion["theta"], motion["theta_rate"], frame=frame)
    angles = p.angles.copy()
    angles[DRIVER] = motion["phi"] - motion["theta"]  # pose returns angles but for whole turns
    angles[LOCK[0]] = angles[LOCK[1]]
    q = np.column_stack([p.centres, angles])
    qd = np.column_stack([p.centre_velocities, p.angular_velocities])
    return q.ravel(), qd.ravel()
