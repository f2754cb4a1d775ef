"""A leg as the paper solves it (Eqs. 2-9): 42 coordinates, 42 multipliers, Baumgarte stabilisation. A leg of
B bodies has 3 B of them; the numbers here are those of the paper's.

    [ M      Phi_q^T ] [ qdd    ]   [ h                                    ]
    [ Phi_q  0       ] [ lambda ] = [ gamma - 2 alpha Phi_dot - beta^2 Phi ]      (Eq. 8)

Crank angle and swing follow the motion law exactly; q and qd are integrated numerically and drift. That is
what this solver is for: it shows what the paper's method does. `TrunkEngine` computes the same motion in
closed form.

Phi_q is square, so the second row of Eq. 8 alone fixes qdd: contact, masses and weight change the multipliers
(joint reactions, drive torques) and never the motion.

q holds (x, y, th) of the bodies of the leg's mechanism in the frame of the paper's drawing: O at the origin,
crank turning clockwise; hoof points go to the world, and ground forces come back, through one mirror. The
leg's frame, which carries the pivot C and turns by phi about O, is treated as one more body whose motion
is prescribed. So one expression serves every joint, and the Jacobian's column of the frame's orientation is
d Phi / d phi.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.layout import LEG_REPORT, LEG_STATE, TRUNK_REPORT, TRUNK_STATE
from hoof_env.dynamics.parts import Reactions, Result, Trunk
from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.gait import (
    MOTION,
    PARAMETERS,
    FilterSettings,
    GaitParameters,
    advance_motion,
    command_filters,
    evaluate_motion,
    gait_array,
    steady_filters,
)
from hoof_env.ground.contact import Ground, new_contacts, touch
from hoof_env.leg.assembly import body_coordinate, check_full_revolution, weld_angles
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import FrameMotion, mirror, pose
from hoof_env.leg.mechanism import FRAME
from hoof_env.leg.profile import cross

Vector = NDArray[np.float64]


class Closure(NamedTuple):
    """The constraint equations at one instant: rows x, y of every joint [m], then welds and driver [rad]."""

    error: Vector  # Phi(q, t)
    error_rate: Vector  # Phi_q qd + Phi_t
    jacobian: Vector  # Phi_q, square (Eq. 3)
    by_phi: Vector  # d Phi / d phi; d Phi / d theta is 1 in the driver's row and 0 elsewhere
    gamma: Vector  # what Phi_q qdd must be, -(Phi_q qd)_q qd - 2 Phi_qt qd - Phi_tt


class Constraints:
    """Eq. 2 of one leg: rows x and y of every joint in the order of the mechanism's list, its welds, and the
    driver."""

    def __init__(self, geometry: Geometry) -> None:
        mechanism = geometry.mechanism
        joints = mechanism.joints
        self.size = 3 * len(mechanism.bodies)  # of coordinates and of equations: nothing is free
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

    def __call__(self, q: Vector, qd: Vector, motion: Any) -> Closure:
        """Evaluate everything at coordinates q, rates qd (shape (size,) each) and a `MOTION` record."""
        x = np.append(q, (0.0, 0.0, motion["phi"])).reshape(-1, 3)
        v = np.append(qd, (0.0, 0.0, motion["phi_rate"]))
        i, j, x_rows, y_rows = self._i, self._j, self._x_rows, self._y_rows
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
        error[self.driver_row] = x[self.crank, 2] + motion["theta"] - motion["phi"]

        jacobian = self._constant.copy()
        for body, slope in ((i, 1j * arm_i), (j, -1j * arm_j)):
            jacobian[x_rows, 3 * body + 2] = slope.real
            jacobian[y_rows, 3 * body + 2] = slope.imag
        by_phi = jacobian[:, 3 * FRAME + 2]

        error_rate = jacobian @ v
        error_rate[self.driver_row] += motion["theta_rate"]

        gamma = -by_phi * motion["phi_acc"]
        turning = arm_i * rate[i] ** 2 - arm_j * rate[j] ** 2
        gamma[x_rows] += turning.real
        gamma[y_rows] += turning.imag
        gamma[self.driver_row] -= motion["theta_acc"]
        return Closure(error, error_rate, jacobian[:, : self.size], by_phi, gamma)


def closed_form(geometry: Geometry, motion: Any) -> tuple[Vector, Vector]:
    """The q and qd, shape (size,) each, that solve Eq. 2 for a `MOTION` record, welds and driver included."""
    drawn = geometry.replace(travel=1)  # the paper's own frame, not the world's
    frame = FrameMotion(motion["phi"], motion["phi_rate"])
    p = pose(drawn, motion["theta"], motion["theta_rate"], frame=frame)
    angles = p.angles.copy()
    # pose returns angles but for whole turns
    angles[geometry.mechanism.crank] = motion["phi"] - motion["theta"]
    for (one, other), angle in zip(geometry.mechanism.welds, weld_angles(geometry), strict=True):
        angles[one] = angles[other] + angle
    q = np.column_stack([p.centres, angles])
    qd = np.column_stack([p.centre_velocities, p.angular_velocities])
    return q.ravel(), qd.ravel()


MOTION_NAMES = LEG_STATE[:2] + LEG_REPORT[:4]
"""Names of the fields of `MOTION`, whose own are the symbols of Eq. 8's motion law."""

TRACE = np.dtype([(name, "f8") for name in (*TRUNK_STATE, *TRUNK_REPORT, *LEG_STATE, *LEG_REPORT)])
"""State and report of one leg at the end of a substep, by the names that `TrunkEngine` gives them. On a fixed
trunk its velocity, momentum and pitch are 0."""

BODY = np.dtype([("time", "f8"), ("x", "f8")])
"""Time [s] and place of O [m]."""


def new_trace(rows: int) -> NDArray[np.void]:
    """An empty trace of `rows` substeps, of dtype `TRACE`."""
    return np.zeros(rows, dtype=TRACE)


@dataclass
class ConstrainedState:
    """Everything that changes: copying its arrays copies the state."""

    body: Any  # record of dtype `BODY`
    motion: Any  # record of dtype `MOTION`
    filters: NDArray[np.void]  # (4,)
    contacts: NDArray[np.void]  # (2,), toe first
    q: Vector  # coordinates in the frame of the paper's drawing, (3 bodies,)
    qd: Vector  # and their rates

    def copy(self) -> ConstrainedState:
        """An independent copy."""
        return ConstrainedState(**{name: array.copy() for name, array in vars(self).items()})

    def __setstate__(self, state: dict[str, Any]) -> None:
        # A record that was pickled has memory that writing by name misses; one taken from an array has not.
        vars(self).update({name: np.array(values)[()] for name, values in state.items()})


class ConstrainedLeg:
    """One leg on a fixed trunk over the ground, by Eq. 8; see the module docstring.

    It reports by the names of `TrunkEngine`, and every quantity has the same meaning.

    Args:
        geometry: the leg.
        ground: what it stands on.
        sim_dt: time step h [s].
        filters: bounds of the command filters.
        alpha, beta: Baumgarte's parameters [1/s]; the paper's 15 and sqrt(2 * 15). A closure error decays by
            the roots of s^2 + 2 alpha s + beta^2.
        integrator: one of `INTEGRATORS`.
        height: of O above the ground [m]; the geometry's own if None.

    Raises:
        ParameterError: a value out of range or an unknown integrator.
    """

    def __init__(
        self,
        geometry: Geometry,
        ground: Ground,
        sim_dt: float = 1e-3,
        filters: FilterSettings | None = None,
        alpha: float = 15.0,
        beta: float = math.sqrt(30.0),
        integrator: str = "euler",
        height: float | None = None,
    ) -> None:
        if not geometry.full_turn:
            check_full_revolution(geometry)
        self.geometry, self.ground = geometry, ground
        filters = filters or FilterSettings()
        self.sim_dt = check_number("sim_dt", sim_dt, low=1e-7, high=filters.longest_step)
        self.alpha = check_number("alpha", alpha, low=0)
        self.beta = check_number("beta", beta, low=0)
        self.integrator = check_choice("integrator", integrator, INTEGRATORS)
        self.trunk = Trunk(kind="fixed", height=geometry.hip_height if height is None else height)
        self.constraints = Constraints(geometry)
        self._settings = filters.to_array()
        self._ground = ground.to_record()
        self._travel = float(geometry.travel)
        feet = [foot for foot in (geometry.toe, geometry.heel) if foot is not None]
        self._feet = [geometry.mechanism.body_of_foot(foot) for foot in feet]
        pairs = zip(feet, self._feet, strict=True)
        self._corners = np.array([body_coordinate(geometry, foot, body) for foot, body in pairs])
        self._columns = 3 * np.array(self._feet)[:, None] + np.arange(3)
        masses = geometry.body_masses
        inertias = geometry.body_inertias
        self._size = size = self.constraints.size
        self._system = np.zeros((2 * size, 2 * size))
        self._system[:size, :size] = np.diag(np.column_stack([masses, masses, inertias]).ravel())  # Eqs. 4, 5
        self._weight = np.zeros(size)
        self._weight[1::3] = -masses * GRAVITY  # Eq. 7
        self.state = ConstrainedState(
            np.zeros(1, BODY)[0], np.zeros(1, MOTION)[0], steady_filters(np.zeros(4)), new_contacts(),
            np.zeros(size), np.zeros(size),
        )  # fmt: skip

    def reset(
        self,
        gait: GaitParameters,
        theta: float = 0.0,
        height: float | None = None,
        speed: float = 0.0,
        x: float = 0.0,
    ) -> NDArray[np.void]:
        """Start with the filters at rest at `gait`, crank at `theta` [rad], O at x [m] and the loops closed.

        A hoof point that starts inside the ground has entered it at its present rate. Returns one trace row.

        Raises:
            ParameterError: theta or x is not finite, or `height` or `speed` is not that of the fixed trunk.
        """
        theta, x = check_number("theta", theta), check_number("x", x)
        if height not in (None, self.trunk.height) or speed != 0.0:
            raise ParameterError(
                f"height, speed: a fixed trunk rests at {self.trunk.height:g} m, got {height!r} and {speed!r}"
            )
        state, command = self.state, gait_array(gait, 1)
        state.body["time"], state.body["x"], state.motion["theta"] = 0.0, x, theta
        state.filters[:] = steady_filters(command)
        state.contacts[:] = new_contacts()
        evaluate_motion(state.motion, state.filters)
        state.q, state.qd = closed_form(self.geometry, state.motion)
        trace = new_trace(1)
        self._evaluate(command, trace[0])
        return trace

    def advance(self, command: NDArray[np.float64], trace: NDArray[np.void]) -> Result:
        """Advance `len(trace)` substeps under a command (four gait parameters), filling one trace row each.

        If q, qd or the multipliers stop being finite, or Eq. 8 is singular, the state stays as it was, the
        result says so and `trace` is without meaning.

        Raises:
            ParameterError: the command is not four numbers.
        """
        command = np.asarray(command, dtype=np.float64)
        if command.shape != (4,):
            raise ParameterError(f"command: expected 4 values {PARAMETERS}, got shape {command.shape}")
        before, result = self.state.copy(), Result.OK
        try:
            with np.errstate(all="ignore"):  # a diverging integration is a result, not a warning
                for k, row in enumerate(trace):
                    if not self._substep(command, before.body["time"] + (k + 1) * self.sim_dt, row):
                        result = Result.NOT_FINITE
                        break
        except np.linalg.LinAlgError:
            result = Result.SINGULAR
        if result is not Result.OK:
            self.state = before
        return result

    def closure(self) -> Closure:
        """The constraint equations at the present state; `closure().error` is the drift."""
        return self.constraints(self.state.q, self.state.qd, self.state.motion)

    def solve(self, ground: bool = True) -> tuple[Vector, Vector]:
        """qdd and lambda of Eq. 8 at the present state, shape (size,) each, with or without ground forces."""
        return self._solve(self.closure(), self._ground_load() if ground else 0.0)

    def reactions(self) -> Reactions:
        """Joint forces and moments at the present state, ground included."""
        closure, travel = self.closure(), self._travel
        _, multipliers = self._solve(closure, self._ground_load())
        load = -multipliers  # the constraints load the bodies with -Phi_q^T lambda; Phi_q is +1 at body i
        rows = self.constraints.joint_rows
        joints = load[:rows].reshape(-1, 2) * (travel, 1.0)
        hip = float(travel * (multipliers @ closure.by_phi))
        welds = travel * load[rows:-1]
        lock = float(welds[0]) if len(welds) == 1 else welds
        return Reactions(joints, lock, float(travel * load[-1]), hip)

    def _substep(self, command: NDArray[np.float64], t: float, row: np.void) -> bool:
        """One step of h to time t; fills `row` and returns whether all is finite."""
        state = self.state
        command_filters(state.filters, command, self._settings)

        def acceleration(elapsed: float, q: Vector, qd: Vector) -> Vector:
            # Ground forces stay out: they do not change qdd, and a contact must not latch at a stage.
            motion, filters = state.motion.copy(), state.filters.copy()
            advance_motion(motion, filters, elapsed)
            evaluate_motion(motion, filters)
            return self._solve(self.constraints(q, qd, motion))[0]

        state.q, state.qd = INTEGRATORS[self.integrator](acceleration, state.q, state.qd, self.sim_dt)
        advance_motion(state.motion, state.filters, self.sim_dt)
        state.body["time"] = t
        return bool(np.isfinite([state.q, state.qd]).all()) and self._evaluate(command, row)

    def _evaluate(self, command: NDArray[np.float64], row: np.void) -> bool:
        """Contact and multipliers at the present instant; fills `row`, returns whether these are finite."""
        state, travel = self.state, self._travel
        command_filters(state.filters, command, self._settings)
        evaluate_motion(state.motion, state.filters)
        trunk = complex(state.body["x"], self.trunk.height)
        arms = self._corner_arms()
        x, y, _ = state.q[self._columns].T
        vx, vy, turning = state.qd[self._columns].T
        at = x + 1j * y + arms
        velocity = vx + 1j * vy + 1j * turning * arms
        # a heel that is not there stays above the ground: `contacts` has one for it
        for contact, place, rate in zip(state.contacts, at, velocity, strict=False):
            touch(contact, trunk + mirror(place, travel), mirror(rate, travel), self._ground)
        closure = self.closure()
        _, multipliers = self._solve(closure, self._ground_load())
        # The drives bring in lambda . Phi_t, so the torques are lambda . dPhi/dtheta and lambda . dPhi/dphi.
        crank, hip = multipliers[-1], multipliers @ closure.by_phi
        self._report(row, float(crank), float(hip))
        return bool(np.isfinite(multipliers).all())

    def _report(self, row: np.void, crank: float, hip: float) -> None:
        """Fill a row of dtype `TRACE`; `crank` and `hip` are the torques of the drives [N m]."""
        body, motion = self.state.body, self.state.motion
        row["time"], row["x"], row["y"] = body["time"], body["x"], self.trunk.height
        row["centre_x"], row["centre_y"] = row["x"], row["y"]
        for name, symbol in zip(MOTION_NAMES, MOTION.names or (), strict=True):
            row[name] = motion[symbol]
        for name, command in zip(PARAMETERS, self.state.filters, strict=True):
            row[name], row[f"{name}_rate"] = command["value"], command["rate"]
        row["crank_torque"], row["crank_power"] = crank, crank * motion["theta_rate"]
        row["hip_torque"], row["hip_power"] = hip, hip * motion["phi_rate"]
        for point, contact in zip(("toe", "heel"), self.state.contacts, strict=True):
            for name in ("x", "penetration", "normal", "friction"):
                row[f"{point}_{name}"] = contact[name]
            row[f"{point}_penetration_rate"] = contact["rate"]
            row[f"{point}_y"], row[f"{point}_slide"] = -contact["penetration"], contact["vx"]
            row[f"{point}_inverse_approach_speed"] = (
                1 / contact["approach"] if contact["approach"] > 0 else 0.0
            )

    def _corner_arms(self) -> NDArray[np.complex128]:
        """Toe and heel relative to the centres of their links, in the frame of q [m]."""
        return self._corners * np.exp(1j * self.state.q[self._columns[:, 2]])

    def _ground_load(self) -> Vector:
        """Return the part of h from the present contact forces: force and moment on the links of the feet."""
        load = np.zeros(self._size)
        arms = self._corner_arms()
        for contact, columns, arm in zip(self.state.contacts, self._columns, arms, strict=False):
            force = mirror(complex(contact["friction"], contact["normal"]), self._travel)
            load[columns] += force.real, force.imag, cross(arm, force)
        return load

    def _solve(self, closure: Closure, load: Vector | float = 0.0) -> tuple[Vector, Vector]:
        """qdd and lambda of Eq. 8, shape (size,) each."""
        size = self._size
        self._system[size:, :size] = closure.jacobian
        self._system[:size, size:] = closure.jacobian.T
        stabilised = closure.gamma - 2 * self.alpha * closure.error_rate - self.beta**2 * closure.error
        solution = np.linalg.solve(self._system, np.concatenate([self._weight + load, stabilised]))
        return solution[:size], solution[size:]


Acceleration = Callable[[float, Vector, Vector], Vector]
Scheme = Callable[[Acceleration, Vector, Vector, float], tuple[Vector, Vector]]


def euler(acceleration: Acceleration, q: Vector, qd: Vector, h: float) -> tuple[Vector, Vector]:
    """Explicit Euler, first order: the paper's scheme (Eq. 9)."""
    return q + h * qd, qd + h * acceleration(0.0, q, qd)


def semi_implicit_euler(acceleration: Acceleration, q: Vector, qd: Vector, h: float) -> tuple[Vector, Vector]:
    """Semi-implicit Euler, first order: the new rate moves the coordinates."""
    qd = qd + h * acceleration(0.0, q, qd)
    return q + h * qd, qd


def midpoint(acceleration: Acceleration, q: Vector, qd: Vector, h: float) -> tuple[Vector, Vector]:
    """Explicit midpoint rule, second order."""
    q1, v1 = euler(acceleration, q, qd, h / 2)
    return q + h * v1, qd + h * acceleration(h / 2, q1, v1)


def rk4(acceleration: Acceleration, q: Vector, qd: Vector, h: float) -> tuple[Vector, Vector]:
    """The classical Runge-Kutta scheme, fourth order."""
    a0 = acceleration(0.0, q, qd)
    v1 = qd + h / 2 * a0
    a1 = acceleration(h / 2, q + h / 2 * qd, v1)
    v2 = qd + h / 2 * a1
    a2 = acceleration(h / 2, q + h / 2 * v1, v2)
    v3 = qd + h * a2
    a3 = acceleration(h, q + h * v2, v3)
    return q + h / 6 * (qd + 2 * v1 + 2 * v2 + v3), qd + h / 6 * (a0 + 2 * a1 + 2 * a2 + a3)


INTEGRATORS = MappingProxyType(
    {"euler": euler, "semi_implicit_euler": semi_implicit_euler, "midpoint": midpoint, "rk4": rk4}
)
"""The schemes by name."""
