"""The slow, obvious horse: N legs on one trunk from d'Alembert's principle, with a dense mass matrix.

The oracle of the fast engine; it shares neither that engine's formulas nor its kernels. Accelerations are
affine in the generalised accelerations, so a body's partial velocity by a coordinate is what its acceleration
(`bodies`) gains when that coordinate's is raised by one. With these, J for centres and W for turns,

    sum over bodies of J . m (a + g) + W J_c alpha = generalised force of ground, drives, support and drag

is solved for what is free, and gives the torques of what is not. Coordinates are the trunk's x, y and pitch
and each leg's crank angle theta and swing phi; the motion law binds phi to theta and time afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.parts import FREEDOMS, Motor
from hoof_env.gait import SPEED
from tests.oracle.bodies import PlainBodies
from tests.oracle.ground import PlainGround
from tests.oracle.jet import Jet

Array = NDArray[np.generic]

WORKS = ("crank", "hip", "normal", "friction", "drag", "damping")
"""Who gives power to the horse: the drives, the ground's two forces (its damping included), the drag and the
support's damper. Weight and the support's spring are in the potential energy."""


@dataclass(frozen=True)
class Moment:
    """The horse at one instant; planar vectors are complex, x + i y. N legs, toe first, then heel."""

    trunk_acc: Array  # of x, y and pitch, (3,) [m/s^2, rad/s^2]
    theta_acc: Array  # of each crank, (N,) [rad/s^2]
    phi: Array  # each swing and its derivatives by time, (N,) [rad, s]
    phi_rate: Array
    phi_acc: Array
    mass_matrix: Array  # M and f of M qdd = f for what is free, trunk first, then the motors' cranks
    load: Array
    centre: complex  # of the whole [m]
    momentum: complex  # [kg m/s]
    angular_momentum: float  # about `centre` [kg m^2/s]
    kinetic: float  # [J]
    potential: float  # of weight, support's spring and weight share [J]
    crank_torque: Array  # along theta, (N,) [N m]; a motor's is the servo's
    hip_torque: Array  # along phi; a motor's is what the gearing between crank and swing carries
    hoof: Array  # of the hoof points in the world, (N, 2), complex [m, m/s, N]
    hoof_velocity: Array
    hoof_force: Array
    give_rate: Array  # of springs at the hoof points along normal and tangent, (N, 2, 2) [m/s]
    power: dict[str, float]  # [W] of each of `WORKS`; a motor's hip gives what the gearing does not take


class PlainHorse(PlainBodies):
    """N legs on one trunk over the ground, on y = 0 or on `terrain`; where None, nothing."""

    def __init__(self, trunk, limbs, ground=None, terrain=None):
        super().__init__(trunk, limbs)
        self.trunk = trunk
        self.ground = None if ground is None else PlainGround(ground, terrain)
        self.motors = np.array([isinstance(limb.drive, Motor) for limb in limbs])
        self.trunk_freedom = ((), (0,), (0, 1), (0, 1, 2))[FREEDOMS[trunk.kind]]

    def at(self, trunk, trunk_rate, theta, theta_rate, filters, approach=None, give=None):
        """Everything about one instant.

        Args:
            trunk, trunk_rate: x, y, pitch and their rates, shape (3,) [m, rad, s].
            theta, theta_rate: of each crank, shape (N,) [rad, rad/s]; a prescribed rate is the filter's.
            filters: value, rate and acceleration of each leg's gait parameters, shape (N, 4, 3) in the order
                of `gait.PARAMETERS`; shape (N, 4) where they are steady; or with higher harmonics.
            approach: v0 of each hoof point in the ground, NaN of one that is not, shape (N, 2) [m/s]; None
                where all are in the air.
            give: of the springs at the hoof points along normal and tangent, shape (N, 2, 2) [m]; None of
                rigid hoofs.
        """
        n = self.size
        filters = np.asarray(filters, float)
        if filters.ndim == 2:
            filters = np.stack([filters, 0 * filters, 0 * filters], axis=-1)
        approach = np.full((n, 2), np.nan) if approach is None else np.asarray(approach, float)
        theta = np.asarray(theta, float)
        rate = np.where(self.motors, theta_rate, filters[:, SPEED, 0])
        given = np.where(self.motors, 0.0, filters[:, SPEED, 1])  # accelerations, but for what will be found
        phi = self.swing(Jet(theta, rate, given), filters)
        slope = self.swing(Jet(theta, 1.0), filters * [1.0, 0.0, 0.0]).rate
        u, ud = np.concatenate([trunk, theta, phi.value]), np.concatenate([trunk_rate, rate, phi.rate])
        count = 3 + 2 * n
        centres, turns, hooves = self.motion(u, ud, np.vstack([np.zeros(count), np.eye(count)]))

        # partial velocities; then mass matrix and inertia forces of all coordinates as if each were free
        move = (centres.acc[:, 1:] - centres.acc[:, :1]).T
        spin = (turns.acc[:, 1:] - turns.acc[:, :1]).T
        step = np.moveaxis(hooves.acc[..., 1:] - hooves.acc[..., :1], -1, 0)
        m, inertia = self.masses, self.inertias
        mass = (move.conj() * m @ move.T).real + spin * inertia @ spin.T
        bias = (move.conj() @ (m * (centres.acc[:, 0] + 1j * GRAVITY))).real
        bias += spin @ (inertia * turns.acc[:, 0])

        hoof, hoof_velocity = hooves.value[..., 0], hooves.rate[..., 0]
        normal, friction, give_rate = self.ground_forces(hoof, hoof_velocity, approach, give)
        force = normal + friction
        support, springs = self.support(u[1])
        damper = -self.trunk.damping * ud[1] if self.trunk.kind == "suspended" else 0.0
        drag = -self.trunk.drag * ud[0] if self.trunk.kind != "fixed" else 0.0
        outer = np.einsum("dnp,np->d", step.conj(), force).real
        outer[:2] += drag, support + damper

        # what is free: udd = free qdd + known
        free = np.zeros((count, len(self.trunk_freedom) + self.motors.sum()))
        for column, k in enumerate(self.trunk_freedom):
            free[k, column] = 1.0
        for column, i in enumerate(np.flatnonzero(self.motors), start=len(self.trunk_freedom)):
            free[3 + i, column], free[3 + n + i, column] = 1.0, slope[i]
        known = np.concatenate([np.zeros(3), given, phi.acc])
        torque = np.array(
            [servo(limb.drive, filters[i, SPEED, 0] - rate[i]) for i, limb in enumerate(self.limbs)]
        )
        drives = np.concatenate([np.zeros(3), torque, np.zeros(n)])
        dense, load = free.T @ mass @ free, free.T @ (outer + drives - bias - mass @ known)
        udd = known + free @ np.linalg.solve(dense, load)
        needed = mass @ udd + bias - outer  # by the drives

        crank, hip = np.where(self.motors, torque, needed[3 : 3 + n]), needed[3 + n :]
        by_time = np.where(self.motors, phi.rate - slope * rate, phi.rate)
        v, w = centres.rate[:, 0], turns.rate[:, 0]
        centre, momentum = complex(m @ centres.value[:, 0] / m.sum()), complex(m @ v)
        arm, relative = centres.value[:, 0] - centre, v - momentum / m.sum()
        return Moment(
            trunk_acc=udd[:3], theta_acc=udd[3 : 3 + n],
            phi=phi.value, phi_rate=phi.rate, phi_acc=udd[3 + n :],
            mass_matrix=dense, load=load, centre=centre, momentum=momentum,
            angular_momentum=float(m @ (arm.conj() * relative).imag + inertia @ w),
            kinetic=float(m @ np.abs(v) ** 2 + inertia @ w**2) / 2,
            potential=float(GRAVITY * m @ centres.value[:, 0].imag) + springs,
            crank_torque=crank, hip_torque=hip,
            hoof=hoof, hoof_velocity=hoof_velocity, hoof_force=force, give_rate=give_rate,
            power=dict(zip(WORKS, map(float, (
                crank @ rate, hip @ by_time, np.sum(normal.conj() * hoof_velocity).real,
                np.sum(friction.conj() * hoof_velocity).real, drag * ud[0], damper * ud[1],
            )), strict=True)),
        )  # fmt: skip

    def support(self, y):
        """The rest of the animal under a suspended trunk at height `y`, but for its damper: force [N] and
        potential [J]."""
        trunk = self.trunk
        if trunk.kind != "suspended":
            return 0.0, 0.0
        weight, stretch = (1 - trunk.share) * self.masses.sum() * GRAVITY, y - trunk.height
        return weight - trunk.stiffness * stretch, trunk.stiffness * stretch**2 / 2 - weight * y

    def ground_forces(self, hoof, velocity, approach, give=None):
        """Normal force and friction on each hoof point that is in the ground, complex [N], and the rates of
        their springs [m/s]."""
        forces, rates = np.zeros((2, *hoof.shape), complex), np.zeros((*hoof.shape, 2))
        if give is not None:
            for k in np.ndindex(hoof.shape):
                where = complex(hoof[k]), complex(velocity[k]), float(approach[k])
                spring = self.limbs[k[0]].spring
                found = self.ground.through_spring(*where, spring, give[k])
                forces[(slice(None), *k)], rates[k] = found[:2], found[2]
        elif self.ground is not None:
            for k in zip(*np.nonzero(~np.isnan(approach)), strict=True):
                where = complex(hoof[k]), complex(velocity[k]), float(approach[k])
                forces[(slice(None), *k)] = self.ground.forces(*where)
        return forces[0], forces[1], rates


def servo(drive, lag):
    """Torque of a drive [N m] on a crank that is `lag` [rad/s] too slow; 0 if it is prescribed."""
    if not isinstance(drive, Motor):
        return 0.0
    return min(max(drive.speed_gain * lag, -drive.torque_limit), drive.torque_limit)
