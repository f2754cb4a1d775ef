"""What both solvers report about every substep: one record, one definition of each quantity."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.ground.contact import HEEL, TOE
from hoof_env.simd.compile import kernel

TRACE = np.dtype(
    [
        (name, "f8")
        for name in (
            "t",  # [s]
            "theta", "theta_rate", "theta_acc",  # crank angle, clockwise in the leg's frame [rad ...]
            "phi", "phi_rate", "phi_acc",  # swing angle of the leg's frame [rad ...]
            "trunk_x", "trunk_y", "trunk_vx", "trunk_vy",  # crank centre O in the world [m, m/s]
            # where it is, how fast it slides, penetration (negative in the air) and its rate [m, m/s];
            # approach speed [m/s] and forces [N], 0 outside the ground
            "toe_x", "toe_vx", "toe_penetration", "toe_rate", "toe_approach", "toe_normal", "toe_friction",
            "heel_x", "heel_vx", "heel_penetration", "heel_rate",
            "heel_approach", "heel_normal", "heel_friction",
            "hoof_angle",  # heel up positive [rad]
            "normal", "friction", "grf",  # sums over both points and their resultant [N]
            "cop_x",  # centre of pressure [m], NaN without load
            "crank_torque", "hip_torque",  # of the two drives, positive along theta and phi [N m]
            "crank_power", "hip_power",  # [W]
        )
    ]
)  # fmt: skip
"""One row a substep, taken at its end."""


@kernel
def record(row, t, motion, trunk, trunk_velocity, contacts, toe, heel, crank_torque, hip_torque):  # type: ignore[no-untyped-def]
    """Fill one record of dtype `TRACE`; `toe`, `heel`, `trunk` are positions in the world, complex [m]."""
    row.t = t
    row.theta, row.theta_rate, row.theta_acc = motion.theta, motion.theta_rate, motion.theta_acc
    row.phi, row.phi_rate, row.phi_acc = motion.phi, motion.phi_rate, motion.phi_acc
    row.trunk_x, row.trunk_y = trunk.real, trunk.imag
    row.trunk_vx, row.trunk_vy = trunk_velocity.real, trunk_velocity.imag
    one, two = contacts[TOE], contacts[HEEL]
    row.toe_x, row.toe_vx = one.x, one.vx
    row.toe_penetration, row.toe_rate, row.toe_approach = one.penetration, one.rate, one.approach
    row.toe_normal, row.toe_friction = one.normal, one.friction
    row.heel_x, row.heel_vx = two.x, two.vx
    row.heel_penetration, row.heel_rate, row.heel_approach = two.penetration, two.rate, two.approach
    row.heel_normal, row.heel_friction = two.normal, two.friction
    row.hoof_angle = np.arctan2(heel.imag - toe.imag, toe.real - heel.real)
    row.normal = one.normal + two.normal
    row.friction = one.friction + two.friction
    row.grf = np.sqrt(row.normal * row.normal + row.friction * row.friction)
    row.cop_x = np.nan
    if row.normal > 0.0:
        row.cop_x = (one.normal * one.x + two.normal * two.x) / row.normal
    row.crank_torque, row.hip_torque = crank_torque, hip_torque
    row.crank_power, row.hip_power = crank_torque * motion.theta_rate, hip_torque * motion.phi_rate


def new_trace(rows: int) -> NDArray[np.void]:
    """An empty trace of `rows` substeps."""
    return np.zeros(rows, dtype=TRACE)


def to_table(trace: NDArray[np.void]) -> dict[str, Any]:
    """A trace as columns, name to array, for people who do not want a structured array."""
    return {name: trace[name].copy() for name in TRACE.names or ()}
