"""The leg in minimal coordinates: what moves is computed in closed form, the trunk alone is integrated.

Crank and swing are prescribed by the motion law, so every link follows without iteration and the loops are
closed to round-off. The trunk's state is the momentum and the centre of mass of trunk and leg together; the
trunk itself follows from them and the pose of the leg. So the trunk feels every link swing, and momentum in
flight is conserved to round-off. Momentum and centre of mass advance by semi-implicit Euler.

The two drives (crank and swing) do what the motion needs; their torques come from virtual power, with
inertia, weight and ground force of every body. Power is torque times rate of each drive; braking power is
negative and is reported as it is (what a cost makes of it is the environment's business).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.result import Result
from hoof_env.dynamics.trace import new_trace, record
from hoof_env.dynamics.trunk import FIXED, GRAVITY, ONE_LEG, SUSPENDED, Trunk
from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.gait.motion_law import (
    MOTION,
    FilterSettings,
    advance_motion,
    command_filters,
    evaluate_motion,
    steady_filters,
)
from hoof_env.gait.parameters import PARAMETERS, GaitParameters
from hoof_env.ground.contact import HEEL, TOE, Ground, new_contacts, touch
from hoof_env.leg.geometry import Geometry, check_full_revolution, tables
from hoof_env.leg.kinematics import dot, place, solve_points
from hoof_env.leg.linkage import BODIES, POINTS
from hoof_env.simd.compile import kernel

BODY = np.dtype([(name, "f8") for name in ("t", "px", "py", "cx", "cy", "fx", "fy")])
"""Time [s]; momentum [kg m/s], centre of mass [m] and outer force [N] of trunk and leg together, in the
directions that are free (on a fixed trunk cx is the place of O)."""

_NUMBER = {name: i for i, name in enumerate(POINTS)}
_TAIL = np.array([_NUMBER[body.tail] for body in BODIES])
_HEAD = np.array([_NUMBER[body.head] for body in BODIES])


@dataclass
class State:
    """Everything that changes: copying its four arrays copies the state.

    Attributes:
        body: record of dtype `BODY`. motion: record of dtype `MOTION`.
        filters: shape (4,). contacts: shape (2,), toe first.
    """

    body: Any
    motion: Any
    filters: NDArray[np.void]
    contacts: NDArray[np.void]

    def copy(self) -> State:
        """An independent copy."""
        return State(self.body.copy(), self.motion.copy(), self.filters.copy(), self.contacts.copy())

    def __setstate__(self, state: dict[str, Any]) -> None:
        # A record that was pickled has memory that writing by name misses; one taken from an array has not.
        vars(self).update({name: np.array(values)[()] for name, values in state.items()})


@dataclass
class Tables:
    """A leg as arrays for the kernels, and their scratch space."""

    crank: float
    pivot: complex
    travel: float
    steps: NDArray[np.int64]
    values: NDArray[np.float64]
    masses: NDArray[np.float64]
    inertias: NDArray[np.float64]
    toe: int
    heel: int
    z: NDArray[np.complex128] = field(
        repr=False, default_factory=lambda: np.zeros((3, len(POINTS)), np.complex128)
    )
    moving: NDArray[np.complex128] = field(
        repr=False, default_factory=lambda: np.zeros((5, len(POINTS)), np.complex128)
    )

    @classmethod
    def of(cls, geometry: Geometry) -> Tables:
        """The tables of a leg."""
        steps, values = tables(geometry)
        return cls(
            geometry.lengths["OP"],
            complex(*geometry.pivot),
            float(geometry.travel),
            steps,
            values,
            geometry.body_masses,
            geometry.body_inertias,
            _NUMBER[geometry.toe],
            _NUMBER[geometry.heel],
        )

    def args(self) -> tuple[Any, ...]:
        """In the order that the kernels take them."""
        return (self.crank, self.pivot, self.travel, self.steps, self.values, self.masses, self.inertias,
                self.toe, self.heel, self.z, self.moving)  # fmt: skip


@kernel
def move_points(motion, crank, pivot, travel, steps, values, z, moving):  # type: ignore[no-untyped-def]
    """Fill `moving`, shape (5, 11): each point's position, velocity, acceleration and partial velocities."""
    solve_points(motion.theta, crank, pivot, steps, values, z[0], z[1], z[2])
    for k in range(z.shape[1]):
        moving[0, k], moving[1, k], moving[2, k], moving[3, k], moving[4, k] = place(
            z[0, k], z[1, k], z[2, k], motion.theta_rate, motion.theta_acc,
            motion.phi, motion.phi_rate, motion.phi_acc, travel,
        )  # fmt: skip


@kernel
def first_moments(moving, masses):  # type: ignore[no-untyped-def]
    """Sums over the links of mass times position, velocity and acceleration relative to O [kg m ...]."""
    s, p, f = 0j, 0j, 0j
    for i in range(masses.shape[0]):
        tail, head, half = _TAIL[i], _HEAD[i], 0.5 * masses[i]
        s += half * (moving[0, tail] + moving[0, head])
        p += half * (moving[1, tail] + moving[1, head])
        f += half * (moving[2, tail] + moving[2, head])
    return s, p, f


@kernel
def drive_torques(moving, masses, inertias, lift, toe, heel, toe_force, heel_force):  # type: ignore[no-untyped-def]
    """Torques of crank and swing drive [N m] by virtual power.

    Each is the power per unit rate that inertia and weight of every link take, less what the ground gives.
    `lift` is the acceleration of O plus g upward, complex [m/s^2].
    """
    crank = -dot(toe_force, moving[3, toe]) - dot(heel_force, moving[3, heel])
    hip = -dot(toe_force, moving[4, toe]) - dot(heel_force, moving[4, heel])
    for i in range(masses.shape[0]):
        tail, head = _TAIL[i], _HEAD[i]
        load = masses[i] * (0.5 * (moving[2, tail] + moving[2, head]) + lift)
        crank += dot(load, 0.5 * (moving[3, tail] + moving[3, head]))
        hip += dot(load, 0.5 * (moving[4, tail] + moving[4, head]))
        link = moving[0, head] - moving[0, tail]
        length2 = dot(link, link)
        turn = inertias[i] * (np.conj(link) * (moving[2, head] - moving[2, tail])).imag / length2
        crank += turn * (np.conj(link) * (moving[3, head] - moving[3, tail])).imag / length2
        hip += turn * (np.conj(link) * (moving[4, head] - moving[4, tail])).imag / length2
    return crank, hip


@kernel
def trunk_force(trunk, y, vx, vy):  # type: ignore[no-untyped-def]
    """External force on trunk and leg other than the ground's: weight, support, drag; complex [N]."""
    fy = 0.0
    if trunk.kind == SUSPENDED:
        fy = (
            -trunk.share * trunk.total_mass * trunk.gravity
            - trunk.stiffness * (y - trunk.height)
            - trunk.damping * vy
        )
    return complex(-trunk.drag * vx, fy)


@kernel
def trunk_motion(body, trunk, s, p):  # type: ignore[no-untyped-def]
    """Position and velocity of O from the motion of the common centre of mass and the leg's first moments."""
    if trunk.kind == FIXED:
        return complex(body.cx, trunk.height), 0j
    position = complex(body.cx, body.cy) - s / trunk.total_mass
    velocity = (complex(body.px, body.py) - p) / trunk.total_mass
    if trunk.kind == SUSPENDED:
        return position, velocity
    return complex(position.real, trunk.height), complex(velocity.real, 0.0)


@kernel
def evaluate(body, motion, filters, contacts, command, settings, trunk, ground, row,  # type: ignore[no-untyped-def]
             crank, pivot, travel, steps, values, masses, inertias, toe, heel, z, moving):  # fmt: skip
    """From the state at one instant: motion of every point, contact, outer force, torques; fills `row`."""
    command_filters(filters, command, settings)
    evaluate_motion(motion, filters)
    move_points(motion, crank, pivot, travel, steps, values, z, moving)
    s, p, f = first_moments(moving, masses)
    origin, velocity = trunk_motion(body, trunk, s, p)
    toe_at, heel_at = origin + moving[0, toe], origin + moving[0, heel]
    toe_force = touch(contacts[TOE], toe_at, velocity + moving[1, toe], ground)
    heel_force = touch(contacts[HEEL], heel_at, velocity + moving[1, heel], ground)
    force = toe_force + heel_force + trunk_force(trunk, origin.imag, velocity.real, velocity.imag)
    acceleration = (force - f) / trunk.total_mass
    if trunk.kind == FIXED:
        acceleration = 0j
    elif trunk.kind != SUSPENDED:
        acceleration = complex(acceleration.real, 0.0)
    lift = acceleration + complex(0.0, trunk.gravity)
    crank_torque, hip_torque = drive_torques(moving, masses, inertias, lift, toe, heel, toe_force, heel_force)
    body.fx, body.fy = force.real, force.imag
    record(row, body.t, motion, origin, velocity, contacts, toe_at, heel_at, crank_torque, hip_torque)


@kernel
def advance(body, motion, filters, contacts, command, settings, trunk, ground, h, trace,  # type: ignore[no-untyped-def]
            crank, pivot, travel, steps, values, masses, inertias, toe, heel, z, moving):  # fmt: skip
    """Advance by `len(trace)` substeps of `h` [s], one row each."""
    start = body.t
    for k in range(trace.shape[0]):
        command_filters(filters, command, settings)
        advance_motion(motion, filters, h)
        if trunk.kind != FIXED:
            body.px += h * body.fx
            body.cx += h * body.px / trunk.total_mass
        if trunk.kind == SUSPENDED:
            body.py += h * body.fy
            body.cy += h * body.py / trunk.total_mass
        body.t = start + (k + 1) * h
        evaluate(body, motion, filters, contacts, command, settings, trunk, ground, trace[k],
                 crank, pivot, travel, steps, values, masses, inertias, toe, heel, z, moving)  # fmt: skip


class LegEngine:
    """One leg on one trunk on the ground, in closed form; see the module docstring.

    Args:
        geometry: the leg.
        trunk, ground: what it hangs from and stands on.
        sim_dt: time step h [s].
        filters: bounds of the command filters.

    Raises:
        ParameterError: `sim_dt` is out of range or too long for the filters or the suspension, or the trunk
            is free.
    """

    def __init__(
        self,
        geometry: Geometry,
        trunk: Trunk,
        ground: Ground,
        sim_dt: float = 1e-3,
        filters: FilterSettings | None = None,
    ) -> None:
        check_choice("trunk", trunk.kind, ONE_LEG)
        if not geometry.full_turn:
            check_full_revolution(geometry)
        self.geometry, self.trunk, self.ground = geometry, trunk, ground
        filters = filters or FilterSettings()
        self.sim_dt = check_number("sim_dt", sim_dt, low=1e-7, high=filters.longest_step)
        self.tables = Tables.of(geometry)
        self._settings = filters.to_array()
        trunk.check_step(self.sim_dt, geometry.mass)
        self._trunk, self._ground = trunk.to_record(geometry.mass, GRAVITY), ground.to_record()
        self.state = State(  # nowhere, until reset
            np.full(1, np.nan, BODY)[0], np.zeros(1, MOTION)[0], steady_filters(np.zeros(4)), new_contacts()
        )

    def reset(
        self,
        gait: GaitParameters,
        theta: float = 0.0,
        height: float | None = None,
        speed: float = 0.0,
        x: float = 0.0,
    ) -> NDArray[np.void]:
        """Start with the filters at rest at `gait`, crank at `theta` [rad] and O at (x, height) [m], moving
        forward at `speed` [m/s]. A `height` of None is the trunk's own.

        A hoof point that starts inside the ground has entered it at its present rate. Returns one trace row.

        Raises:
            ParameterError: a value is not finite, or asks of the trunk what its kind forbids.
        """
        kind, state = self.trunk.kind, self.state
        theta, speed, x = check_number("theta", theta), check_number("speed", speed), check_number("x", x)
        y = check_number("height", self.trunk.height if height is None else height)
        if kind != "suspended" and y != self.trunk.height:
            raise ParameterError(f"height: a {kind} trunk is at {self.trunk.height:g} m, got {y:g} m")
        if kind == "fixed" and speed != 0.0:
            raise ParameterError(f"speed: expected 0 of a fixed trunk, got {speed:g} m/s")
        state.filters[:] = steady_filters(gait.to_array())
        state.contacts[:] = new_contacts()
        state.motion["theta"] = theta
        evaluate_motion(state.motion, state.filters)
        t = self.tables
        move_points(state.motion, t.crank, t.pivot, t.travel, t.steps, t.values, t.z, t.moving)
        s, p, _ = first_moments(t.moving, t.masses)
        body, total = state.body, float(self._trunk["total_mass"])
        body["t"] = 0.0
        if kind == "fixed":
            body["cx"], body["cy"], body["px"], body["py"] = x, 0.0, 0.0, 0.0
        else:
            body["cx"], body["cy"] = x + s.real / total, y + s.imag / total
            body["px"], body["py"] = total * speed + p.real, p.imag
        trace = new_trace(1)
        evaluate(
            body, state.motion, state.filters, state.contacts, gait.to_array(), self._settings,
            self._trunk, self._ground, trace[0], *t.args(),
        )  # fmt: skip
        return trace

    def advance(self, command: NDArray[np.float64], trace: NDArray[np.void]) -> Result:
        """Advance `len(trace)` substeps under a command (four gait parameters), filling one trace row each.

        If anything is not finite at the end, the state stays as it was, the result says so and `trace` is
        without meaning.

        Raises:
            ParameterError: the command is not four numbers.
        """
        command = np.asarray(command, dtype=np.float64)
        if command.shape != (4,):
            raise ParameterError(f"command: expected 4 values {PARAMETERS}, got shape {command.shape}")
        state, before = self.state, self.state.copy()
        advance(
            state.body, state.motion, state.filters, state.contacts, command, self._settings,
            self._trunk, self._ground, self.sim_dt, trace, *self.tables.args(),
        )  # fmt: skip
        seen = float(trace["grf"].sum() + trace["crank_power"].sum() + trace["hip_power"].sum())
        if math.isfinite(sum(state.body.item()) + sum(state.motion.item()) + seen):
            return Result.OK
        self.state = before
        return Result.NOT_FINITE
