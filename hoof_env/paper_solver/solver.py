"""A leg as the paper solves it (Eqs. 2-9): 42 coordinates, 42 multipliers, Baumgarte stabilisation. A leg of
B bodies has 3 B of them; the numbers here are the paper's.

    [ M      Phi_q^T ] [ qdd    ]   [ h                                    ]
    [ Phi_q  0       ] [ lambda ] = [ gamma - 2 alpha Phi_dot - beta^2 Phi ]      (Eq. 8)

Crank angle and swing follow the motion law exactly; q and qd are integrated numerically and drift. The
solver exists to show this property of the paper's method. `TrunkEngine` computes the same motion in
closed form.

Phi_q is square, so the second row of Eq. 8 alone fixes qdd: contact, masses and weight change the multipliers
(joint reactions, drive torques) and never the motion.

The coordinates q are as in `constraints`. Hoof points go to the world, and ground forces come back,
through one mirror.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.layout import LEG_REPORT, LEG_STATE, TRUNK_REPORT, TRUNK_STATE
from hoof_env.dynamics.parts import Reactions, Result, Trunk
from hoof_env.errors import ParameterError, check_choice, check_number, finite, one_of
from hoof_env.gait import (
    PARAMETERS,
    Filter,
    FilterSettings,
    GaitParameters,
    Motion,
    advance_motion,
    command_filters,
    evaluate_motion,
    gait_array,
    steady_filters,
)
from hoof_env.ground.contact import Contact, Ground, new_contacts, touch
from hoof_env.leg.assembly import body_coordinate, check_full_revolution
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.kinematics import mirror
from hoof_env.leg.profile import cross
from hoof_env.paper_solver.constraints import Closure, Constraints, Vector, closed_form
from hoof_env.paper_solver.integrators import INTEGRATORS

MOTION_NAMES = LEG_STATE[:2] + LEG_REPORT[:4]
"""Names of the fields of `Motion`, which are symbols of Eq. 8's motion law there."""

TRACE = np.dtype([(name, "f8") for name in (*TRUNK_STATE, *TRUNK_REPORT, *LEG_STATE, *LEG_REPORT)])
"""State and report of one leg at the end of a substep, by the names of `TrunkEngine`. On a fixed
trunk its velocity, momentum and pitch are 0."""


def new_trace(rows: int) -> NDArray[np.void]:
    """An empty trace of `rows` substeps, of dtype `TRACE`."""
    return np.zeros(rows, dtype=TRACE)


@dataclass(slots=True)
class Body:
    """Time [s] and place of O [m]."""

    time: float = 0.0
    x: float = 0.0


def record_type(kind: type) -> np.dtype[np.void]:
    """Return the type of a record with the fields of a dataclass of numbers and booleans."""
    return np.dtype([(item.name, "b1" if item.type == "bool" else "f8") for item in fields(kind)])


BODY, MOTION, FILTER, CONTACT = map(record_type, (Body, Motion, Filter, Contact))
"""Record types of the parts of a state."""


@dataclass
class ConstrainedState:
    """Everything that changes."""

    body: Body
    motion: Motion
    filters: list[Filter]  # (4,)
    contacts: list[Contact]  # (2,), toe first
    q: Vector  # coordinates in the frame of the paper's drawing, (3 bodies,)
    qd: Vector  # and their rates

    def copy(self) -> ConstrainedState:
        """An independent copy."""
        return ConstrainedState(
            replace(self.body),
            replace(self.motion),
            [replace(one) for one in self.filters],
            [replace(one) for one in self.contacts],
            self.q.copy(),
            self.qd.copy(),
        )

    def to_arrays(self) -> dict[str, Any]:
        """Return all as records and arrays of their own, by name."""
        return {
            "body": np.array(astuple(self.body), BODY)[()],
            "motion": np.array(astuple(self.motion), MOTION)[()],
            "filters": np.array([astuple(one) for one in self.filters], FILTER),
            "contacts": np.array([astuple(one) for one in self.contacts], CONTACT),
            "q": self.q.copy(),
            "qd": self.qd.copy(),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any], size: int) -> ConstrainedState:
        """Return the state of a leg with `size` coordinates from the result of `to_arrays`.

        Raises:
            KeyError, TypeError, ValueError: a part is missing or has another shape.
        """

        def part(name: str, kind: Any, *shape: int) -> Any:
            return np.array(arrays[name], kind).reshape(shape)

        return cls(
            Body(*part("body", BODY).item()),
            Motion(*part("motion", MOTION).item()),
            [Filter(*one) for one in part("filters", FILTER, len(PARAMETERS)).tolist()],
            [Contact(*one) for one in part("contacts", CONTACT, 2).tolist()],
            part("q", np.float64, size),
            part("qd", np.float64, size),
        )


class ConstrainedLeg:
    """One leg on a fixed trunk over the ground, by Eq. 8; see the module docstring.

    It reports by the names of `TrunkEngine`, and every quantity has the same meaning.

    Args:
        geometry: the leg.
        ground: the ground.
        sim_dt: time step h [s].
        filters: bounds of the command filters.
        alpha, beta: Baumgarte's parameters [1/s]; the paper's 15 and sqrt(2 * 15). A closure error decays by
            the roots of s^2 + 2 alpha s + beta^2.
        integrator: one of `INTEGRATORS`.
        height: height of O above the ground [m]; the geometry's if None.

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
        self.geometry = one_of("geometry", geometry, Geometry)
        if not geometry.full_turn:
            check_full_revolution(geometry)
        self.ground = one_of("ground", ground, Ground)
        filters = FilterSettings() if filters is None else one_of("filters", filters, FilterSettings)
        self.sim_dt = check_number("sim_dt", sim_dt, low=1e-7, high=filters.longest_step)
        self.alpha = check_number("alpha", alpha, low=0)
        self.beta = check_number("beta", beta, low=0)
        self.integrator = check_choice("integrator", integrator, INTEGRATORS)
        self.trunk = Trunk(kind="fixed", height=geometry.hip_height if height is None else height)
        self.constraints = Constraints(geometry)
        self._settings = filters.to_array().tolist()
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
        # the constraints at the end of the last substep, and qdd if no ground force was in it
        self._present: tuple[Closure, Vector | None] | None = None
        self.state = ConstrainedState(
            Body(),
            Motion(),
            steady_filters([0.0] * len(PARAMETERS)),
            new_contacts(),
            np.zeros(size),
            np.zeros(size),
        )

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
            ParameterError: no gait, theta or x is not finite, or `height` or `speed` differs from the fixed
                trunk's.
        """
        theta, x = check_number("theta", theta), check_number("x", x)
        own = self.trunk.height
        if check_number("height", own if height is None else height) != own or check_number("speed", speed):
            raise ParameterError(
                f"height, speed: a fixed trunk rests at {self.trunk.height:g} m, got {height!r} and {speed!r}"
            )
        state = self.state
        command = gait_array(one_of("gait", gait, GaitParameters), 1).tolist()
        state.body = Body(0.0, x)
        state.motion.theta = theta
        state.filters = steady_filters(command)
        state.contacts = new_contacts()
        evaluate_motion(state.motion, state.filters)
        state.q, state.qd = closed_form(self.geometry, state.motion)
        trace = new_trace(1)
        self._evaluate(command, trace[0])
        return trace

    def advance(self, command: NDArray[np.float64], trace: NDArray[np.void]) -> Result:
        """Advance `len(trace)` substeps under a command (four gait parameters), filling one trace row each.

        If q, qd or the multipliers stop being finite, or Eq. 8 is singular, the state is unchanged,
        `trace` is meaningless, and the result is the failure.

        Raises:
            ParameterError: the command is not four finite numbers, or `trace` is not from `new_trace`.
        """
        command = finite("command", command)
        if command.shape != (4,):
            raise ParameterError(f"command: expected 4 values {PARAMETERS}, got shape {command.shape}")
        if one_of("trace", trace, np.ndarray).dtype != TRACE:
            raise ParameterError(f"trace: expected rows of new_trace, got an array of {trace.dtype}")
        numbers = command.tolist()
        before = self.state.copy()
        self._present = None  # it belongs to another command or state
        result = Result.OK
        try:
            with np.errstate(all="ignore"):  # a diverging integration is a result, not a warning
                for k, row in enumerate(trace):
                    if not self._substep(numbers, before.body.time + (k + 1) * self.sim_dt, row):
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
        closure = self.closure()
        travel = self._travel
        _, multipliers = self._solve(closure, self._ground_load())
        load = -multipliers  # the constraints load the bodies with -Phi_q^T lambda; Phi_q is +1 at body i
        rows = self.constraints.joint_rows
        joints = load[:rows].reshape(-1, 2) * (travel, 1.0)
        hip = float(travel * (multipliers @ closure.by_phi))
        welds = travel * load[rows:-1]
        lock = float(welds[0]) if len(welds) == 1 else welds
        return Reactions(joints, lock, float(travel * load[-1]), hip)

    def _substep(self, command: Sequence[float], t: float, row: np.void) -> bool:
        """One step of h to time t; fills `row` and returns whether all is finite."""
        state = self.state
        command_filters(state.filters, command, self._settings)

        def acceleration(elapsed: float, q: Vector, qd: Vector) -> Vector:
            if elapsed == 0.0 and self._present is not None:
                closure, qdd = self._present
                return self._solve(closure)[0] if qdd is None else qdd
            # Ground forces stay out: they do not change qdd, and a contact must not latch at a stage.
            motion = replace(state.motion)
            filters = [replace(one) for one in state.filters]
            advance_motion(motion, filters, elapsed)
            evaluate_motion(motion, filters)
            return self._solve(self.constraints(q, qd, motion))[0]

        state.q, state.qd = INTEGRATORS[self.integrator](acceleration, state.q, state.qd, self.sim_dt)
        advance_motion(state.motion, state.filters, self.sim_dt)
        state.body.time = t
        return bool(np.isfinite([state.q, state.qd]).all()) and self._evaluate(command, row)

    def _evaluate(self, command: Sequence[float], row: np.void) -> bool:
        """Contact and multipliers at the present instant; fills `row`, returns whether these are finite."""
        state = self.state
        travel = self._travel
        command_filters(state.filters, command, self._settings)
        evaluate_motion(state.motion, state.filters)
        trunk = complex(state.body.x, self.trunk.height)
        arms = self._corner_arms()
        x, y, _ = state.q[self._columns].T
        vx, vy, turning = state.qd[self._columns].T
        at = x + 1j * y + arms
        velocity = vx + 1j * vy + 1j * turning * arms
        # a heel that is not there stays above the ground: `contacts` has one for it
        for contact, place, rate in zip(state.contacts, at.tolist(), velocity.tolist(), strict=False):
            touch(contact, trunk + mirror(place, travel), mirror(rate, travel), self._ground)
        closure = self.closure()
        load = self._ground_load()
        qdd, multipliers = self._solve(closure, load)
        self._present = closure, None if load.any() else qdd
        # The drives bring in lambda . Phi_t, so the torques are lambda . dPhi/dtheta and lambda . dPhi/dphi.
        crank = multipliers[-1]
        hip = multipliers @ closure.by_phi
        self._report(row, float(crank), float(hip))
        return bool(np.isfinite(multipliers).all())

    def _report(self, row: np.void, crank: float, hip: float) -> None:
        """Fill a row of dtype `TRACE`; `crank` and `hip` are the torques of the drives [N m]."""
        body = self.state.body
        motion = self.state.motion
        row["time"] = body.time
        row["x"] = body.x
        row["y"] = self.trunk.height
        row["centre_x"] = row["x"]
        row["centre_y"] = row["y"]
        for name, symbol in zip(MOTION_NAMES, MOTION.names or (), strict=True):
            row[name] = getattr(motion, symbol)
        for name, one in zip(PARAMETERS, self.state.filters, strict=True):
            row[name] = one.value
            row[f"{name}_rate"] = one.rate
        row["crank_torque"] = crank
        row["crank_power"] = crank * motion.theta_rate
        row["hip_torque"] = hip
        row["hip_power"] = hip * motion.phi_rate
        for point, contact in zip(("toe", "heel"), self.state.contacts, strict=True):
            row[f"{point}_x"] = contact.x
            row[f"{point}_penetration"] = contact.penetration
            row[f"{point}_normal"] = contact.normal
            row[f"{point}_friction"] = contact.friction
            row[f"{point}_penetration_rate"] = contact.rate
            row[f"{point}_y"] = -contact.penetration
            row[f"{point}_slide"] = contact.vx
            row[f"{point}_inverse_approach_speed"] = 1 / contact.approach if contact.approach > 0 else 0.0

    def _corner_arms(self) -> NDArray[np.complex128]:
        """Toe and heel relative to the centres of their links, in the frame of q [m]."""
        return self._corners * np.exp(1j * self.state.q[self._columns[:, 2]])

    def _ground_load(self) -> Vector:
        """Return the part of h from the present contact forces: force and moment on the links of the feet."""
        load = np.zeros(self._size)
        arms = self._corner_arms()
        for contact, columns, arm in zip(self.state.contacts, self._columns, arms, strict=False):
            force = mirror(complex(contact.friction, contact.normal), self._travel)
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
