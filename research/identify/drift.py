"""The paper's solver (Eq. 8, explicit Euler) for one cycle of a steady gait, fast enough for a search.

On a fixed trunk the second row of Eq. 8, Phi_q qdd = gamma - 2 alpha Phi_dot - beta^2 Phi, alone fixes the
motion. Every row of it says that a gap closes by gap'' + 2 alpha gap' + beta^2 gap = 0, so Phi_q is solved
in the order of `linkage.CONSTRUCTION`: each dyad is two angular accelerations from two equations, and no
matrix is built. At a pin of several bodies any tree of gaps between them gives the same accelerations as the
tree of `linkage.JOINTS`, because the gaps of one are sums of the gaps of the other.

All 42 coordinates drift as in `dynamics.constrained.ConstrainedLeg`, which stays the judge: tests compare.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.constrained import SOLE
from hoof_env.dynamics.constraints import Constraints
from hoof_env.errors import check_number
from hoof_env.gait.motion_law import MOTION, evaluate_motion, steady_filters
from hoof_env.gait.parameters import GaitParameters
from hoof_env.leg.geometry import Geometry, tables
from hoof_env.leg.kinematics import cross, dot, mirror, solve_points
from hoof_env.leg.linkage import BODIES, CONSTRUCTION, DRIVER, LOCK, POINTS, Dyad
from hoof_env.simd.compile import kernel

Array = NDArray[np.float64]

_NUMBER = {name: i for i, name in enumerate(POINTS)}
_O, _C, _P, _G = (_NUMBER[name] for name in "OCPG")
_TAIL = np.array([_NUMBER[body.tail] for body in BODIES])
_HEAD = np.array([_NUMBER[body.head] for body in BODIES])
_SIZE = len(POINTS)
_LOCKED, _HOLDER = LOCK


def _link(start: str, end: str) -> tuple[int, int]:
    """The body between two points and +1 if it points to `end`, else -1; (-1, 0) if there is none."""
    for number, body in enumerate(BODIES):
        if {body.tail, body.head} == {start, end}:
            return number, 1 if body.head == end else -1
    return -1, 0


# For each step of the construction, bodies and senses: a dyad's two links, each towards the point; an
# extension's own link (if any) from its origin to the point, and the link that it extends, first to second.
_LINKS = np.array(
    [
        (*_link(s.first, s.point), *_link(s.second, s.point))
        if isinstance(s, Dyad)
        else (*_link(s.origin, s.point), *_link(s.first, s.second))
        for s in CONSTRUCTION
    ]
)
_DRIVER_SENSE = _link("O", "P")[1]


@kernel
def half_link(q, body, sense, length):  # type: ignore[no-untyped-def]
    """From the centre of a body to its end (sense 1 for the head, -1 for the tail), complex [m]."""
    return 0.5 * length * sense * complex(np.cos(q[body, 2]), np.sin(q[body, 2]))


@kernel
def wanted(q, qd, body, arm, z, dz, ddz, damping, spring):  # type: ignore[no-untyped-def]
    """Acceleration of the point at `arm` of a body so that it joins the point (z, dz, ddz) by Baumgarte."""
    gap = complex(q[body, 0], q[body, 1]) + arm - z
    rate = complex(qd[body, 0], qd[body, 1]) + 1j * qd[body, 2] * arm - dz
    return ddz - damping * rate - spring * gap


@kernel
def carry(q, qd, qdd, body, spin, held, held_acc, arm, p, z, dz, ddz):  # type: ignore[no-untyped-def]
    """Set a body's acceleration: angular `spin`, and `held_acc` at the point at `held`; then the motion of
    its point at `arm`, which becomes that of point `p`."""
    turn = complex(-qd[body, 2] * qd[body, 2], spin)
    centre = held_acc - turn * held
    qdd[body, 0], qdd[body, 1], qdd[body, 2] = centre.real, centre.imag, spin
    z[p] = complex(q[body, 0], q[body, 1]) + arm
    dz[p] = complex(qd[body, 0], qd[body, 1]) + 1j * qd[body, 2] * arm
    ddz[p] = centre + turn * arm


@kernel
def accelerate(crank, pivot, steps, values, motion, damping, spring, q, qd, qdd, z, dz, ddz, lengths):  # type: ignore[no-untyped-def]
    """Fill `qdd`, shape (14, 3), by the second row of Eq. 8; returns False where it is singular.

    Args:
        crank, pivot, steps, values: the leg, as for `kinematics.solve_points`.
        motion: (theta, its rate, phi, its rate, its acceleration); the crank's acceleration is 0.
        damping, spring: 2 alpha [1/s] and beta^2 [1/s^2].
        q, qd: coordinates and rates, shape (14, 3), in the frame of the paper's drawing.
        z, dz, ddz: scratch, complex, shape (11,); returned with every point's motion in that frame.
        lengths: scratch, shape (14,).
    """
    theta, theta_rate, phi, phi_rate, phi_acc = motion
    z[_O], dz[_O], ddz[_O] = 0j, 0j, 0j
    z[_C] = pivot * complex(np.cos(phi), np.sin(phi))
    dz[_C] = 1j * phi_rate * z[_C]
    ddz[_C] = complex(-phi_rate * phi_rate, phi_acc) * z[_C]
    arm = half_link(q, DRIVER, _DRIVER_SENSE, crank)
    spin = phi_acc - damping * (qd[DRIVER, 2] + theta_rate - phi_rate)
    spin -= spring * (q[DRIVER, 2] + theta - phi)
    held = wanted(q, qd, DRIVER, -arm, z[_O], dz[_O], ddz[_O], damping, spring)
    carry(q, qd, qdd, DRIVER, spin, -arm, held, arm, _P, z, dz, ddz)
    for k in range(steps.shape[0]):
        p, a, b = steps[k, 1], steps[k, 2], steps[k, 3]
        i, j = _LINKS[k, 0], _LINKS[k, 2]
        if steps[k, 0] == 1:
            lengths[i], lengths[j] = values[k, 0], values[k, 1]
            one = half_link(q, i, _LINKS[k, 1], lengths[i])
            two = half_link(q, j, _LINKS[k, 3], lengths[j])
            held_i = wanted(q, qd, i, -one, z[a], dz[a], ddz[a], damping, spring)
            held_j = wanted(q, qd, j, -two, z[b], dz[b], ddz[b], damping, spring)
            at_i = complex(q[i, 0], q[i, 1]) + one
            rate_i = complex(qd[i, 0], qd[i, 1]) + 1j * qd[i, 2] * one
            joined = wanted(q, qd, j, two, at_i, rate_i, 0j, damping, spring)
            # 2i (spin_j two - spin_i one) = rest
            rest = joined - held_j + held_i + 2.0 * (qd[j, 2] ** 2 * two - qd[i, 2] ** 2 * one)
            area = 2.0 * cross(one, two)
            if area == 0.0:
                return False
            spin_i, spin_j = -dot(two, rest) / area, -dot(one, rest) / area
            if not np.isfinite(spin_i + spin_j):
                return False
            carry(q, qd, qdd, j, spin_j, -two, held_j, two, p, z, dz, ddz)
            carry(q, qd, qdd, i, spin_i, -one, held_i, one, p, z, dz, ddz)
        elif i >= 0:  # a link of its own, locked to the one that it extends
            o = steps[k, 4]
            lengths[i] = values[k, 0] * lengths[j]
            one = half_link(q, i, _LINKS[k, 1], lengths[i])
            held_i = wanted(q, qd, i, -one, z[o], dz[o], ddz[o], damping, spring)
            spin_i = qdd[j, 2] - damping * (qd[i, 2] - qd[j, 2]) - spring * (q[i, 2] - q[j, 2])
            carry(q, qd, qdd, i, spin_i, -one, held_i, one, p, z, dz, ddz)
        else:  # a point of the extended link itself
            along = half_link(q, j, _LINKS[k, 3], lengths[j])
            origin = along if steps[k, 4] == b else -along
            arm = origin + 2.0 * values[k, 0] * along
            centre = complex(qdd[j, 0], qdd[j, 1])
            carry(q, qd, qdd, j, qdd[j, 2], 0j, centre, arm, p, z, dz, ddz)
    return True


@kernel
def swing_law(theta, gait):  # type: ignore[no-untyped-def]
    """(theta, its rate, phi, its rate, its acceleration) of a steady gait: `motion_law.evaluate_motion`."""
    w, s, c = gait[0], np.sin(theta), np.cos(theta)
    wave, slope = gait[2] * s + gait[3] * c, gait[2] * c - gait[3] * s
    return theta, w, gait[1] + wave, slope * w, -wave * w * w


@kernel
def close_loops(theta, crank, pivot, steps, values, gait, q, qd):  # type: ignore[no-untyped-def]
    """Fill `q`, `qd`, shape (14, 3), with the closed form, as `constraints.closed_form`."""
    z, dz, ddz = (
        np.empty(_SIZE, np.complex128),
        np.empty(_SIZE, np.complex128),
        np.empty(_SIZE, np.complex128),
    )
    solve_points(theta, crank, pivot, steps, values, z, dz, ddz)
    _, w, phi, phi_rate, _ = swing_law(theta, gait)
    turn = complex(np.cos(phi), np.sin(phi))
    for p in range(_SIZE):
        dz[p] = turn * (dz[p] * w + 1j * phi_rate * z[p])
        z[p] *= turn
    for i in range(q.shape[0]):
        one, two, done, dtwo = z[_TAIL[i]], z[_HEAD[i]], dz[_TAIL[i]], dz[_HEAD[i]]
        link = two - one
        q[i, 0], q[i, 1], q[i, 2] = (one.real + two.real) / 2, (one.imag + two.imag) / 2, np.angle(link)
        qd[i, 0], qd[i, 1] = (done.real + dtwo.real) / 2, (done.imag + dtwo.imag) / 2
        qd[i, 2] = cross(link, dtwo - done) / dot(link, link)
    q[DRIVER, 2], q[_LOCKED, 2] = phi - theta, q[_HOLDER, 2]


@kernel
def euler_cycle(  # type: ignore[no-untyped-def]
    crank, pivot, steps, values, travel, toe, heel, gait, theta, h, alpha, beta, q, qd, at, velocity, ankle
):  # fmt: skip
    """Integrate one steady gait by explicit Euler from closed loops; returns whether all stayed finite.

    Args:
        crank: crank radius OP [m].
        pivot: C relative to O, complex [m].
        steps, values: the construction of the leg, `geometry.tables`.
        travel, toe, heel: as in `Geometry`, the corners as point numbers.
        gait: (crank speed [rad/s], offset, sine and cosine coefficient of the swing [rad]).
        theta: crank angle at the start [rad].
        h: time step [s].
        alpha, beta: Baumgarte's parameters [1/s].
        q, qd: outputs, shape (14, 3): coordinates and rates at the end, in the frame of the paper's drawing.
        at, velocity: outputs, complex, shape (2, n): toe and heel relative to O at n instants, the first at
            the start, in world axes [m, m/s].
        ankle: output, shape (n,): height of G relative to O [m].

    If a dyad does not close at the start or is singular, or anything stops being finite, all outputs are NaN.
    """
    n = at.shape[1]
    z, dz, ddz = (
        np.empty(_SIZE, np.complex128),
        np.empty(_SIZE, np.complex128),
        np.empty(_SIZE, np.complex128),
    )
    qdd, lengths = np.empty(q.shape), np.empty(q.shape[0])
    close_loops(theta, crank, pivot, steps, values, gait, q, qd)
    ok = True
    for k in range(n):
        if k > 0:
            for i in range(q.shape[0]):
                for c in range(3):
                    q[i, c] += h * qd[i, c]
                    qd[i, c] += h * qdd[i, c]
        motion = swing_law(theta + k * h * gait[0], gait)
        ok = accelerate(
            crank, pivot, steps, values, motion, 2.0 * alpha, beta * beta, q, qd, qdd, z, dz, ddz, lengths
        )
        if not ok:
            break
        for c in range(2):
            arm = half_link(q, SOLE, 1 if _HEAD[SOLE] == (toe if c == 0 else heel) else -1, lengths[SOLE])
            place = complex(q[SOLE, 0], q[SOLE, 1]) + arm
            rate = complex(qd[SOLE, 0], qd[SOLE, 1]) + 1j * qd[SOLE, 2] * arm
            at[c, k], velocity[c, k] = mirror(place, travel), mirror(rate, travel)
        ankle[k] = z[_G].imag
    if not ok:
        q[:], qd[:], ankle[:] = np.nan, np.nan, np.nan
        at[:], velocity[:] = complex(np.nan, np.nan), complex(np.nan, np.nan)
    return ok


@dataclass(frozen=True)
class DriftCycle:
    """What `drift_cycle` returns; n = steps + 1 instants. NaN everywhere unless `finite`.

    Attributes:
        t: shape (n,) [s].
        toe, heel, toe_velocity, heel_velocity: complex, shape (n,), relative to O in world axes [m, m/s].
        ankle: height of G relative to O, shape (n,) [m].
        q, qd: coordinates and rates at the end, shape (42,), in the frame of the paper's drawing.
        closure_error: largest constraint error max |Phi| at the end [m, rad].
        finite: whether the integration stayed finite and Eq. 8 regular.
    """

    t: Array
    toe: NDArray[np.complex128]
    heel: NDArray[np.complex128]
    toe_velocity: NDArray[np.complex128]
    heel_velocity: NDArray[np.complex128]
    ankle: Array
    q: Array
    qd: Array
    closure_error: float
    finite: bool


def drift_cycle(
    geometry: Geometry,
    gait: GaitParameters,
    *,
    theta: float = 0.0,
    sim_dt: float = 1e-3,
    steps: int = 1000,
    alpha: float = 15.0,
    beta: float = math.sqrt(30.0),
) -> DriftCycle:
    """The motion of `ConstrainedLeg(geometry, ..., sim_dt, alpha=alpha, beta=beta)` from crank angle `theta`.

    Units: rad, s, 1/s.

    Raises:
        ParameterError: a value is out of range.
    """
    theta, h = check_number("theta", theta), check_number("sim_dt", sim_dt, low=1e-7)
    n = int(check_number("steps", steps, low=1)) + 1
    alpha, beta = check_number("alpha", alpha, low=0), check_number("beta", beta, low=0)
    command = gait.to_array()
    q, qd, ankle = np.empty((len(BODIES), 3)), np.empty((len(BODIES), 3)), np.empty(n)
    at, velocity = np.empty((2, n), np.complex128), np.empty((2, n), np.complex128)
    finite = euler_cycle(
        geometry.lengths["OP"], complex(*geometry.pivot), *tables(geometry), float(geometry.travel),
        _NUMBER[geometry.toe], _NUMBER[geometry.heel], command, theta, h, alpha, beta,
        q, qd, at, velocity, ankle,
    )  # fmt: skip
    motion = np.zeros(1, MOTION)[0]
    motion["theta"] = theta + (n - 1) * h * command[0]
    evaluate_motion(motion, steady_filters(command))
    error = Constraints(geometry)(q.ravel(), qd.ravel(), motion).error
    t = np.arange(n, dtype=np.float64) * h
    return DriftCycle(
        t, at[0], at[1], velocity[0], velocity[1], ankle, q.ravel(), qd.ravel(),
        float(np.abs(error).max()), finite,
    )  # fmt: skip
