"""The paper's solver (Eq. 8, explicit Euler) for one cycle of a steady gait, fast enough for a search.

On a fixed trunk the second row of Eq. 8, Phi_q qdd = gamma - 2 alpha Phi_dot - beta^2 Phi, alone fixes the
motion. Every row of it says that a gap closes by gap'' + 2 alpha gap' + beta^2 gap = 0, so Phi_q is solved
in the order of `linkage.CONSTRUCTION`: each dyad is two angular accelerations from two equations, and no
matrix is built. At a pin of several bodies any tree of gaps between them gives the same accelerations as the
tree of `linkage.JOINTS`, because the gaps of one are sums of the gaps of the other.

All 42 coordinates drift as in `dynamics.constrained.ConstrainedLeg`, whose dense system takes a hundred times
as long and stays the judge: tests compare.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.leg.kinematics import cross, dot, mirror, solve_points
from hoof_env.leg.linkage import BODIES, CONSTRUCTION, DRIVER, LOCK, POINTS, Dyad
from hoof_env.simd.compile import kernel
from research.identify.leg import NUMBER, STEPS

_O, _C, _P, _G = (NUMBER[name] for name in "OCPG")
_TAIL = np.array([NUMBER[body.tail] for body in BODIES])
_HEAD = np.array([NUMBER[body.head] for body in BODIES])
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
_SOLE = _link("I", "J")[0]


class Bodies(NamedTuple):
    """The 14 links in the frame of the paper's drawing: centre and orientation (x, y, angle), rates and
    accelerations, shape (14, 3) [m, rad, s]."""

    q: NDArray[np.float64]
    qd: NDArray[np.float64]
    qdd: NDArray[np.float64]
    length: NDArray[np.float64]  # shape (14,) [m]; `accelerate` fills all but the crank's


class Points(NamedTuple):
    """The motion of every point, complex, shape (11,) [m, s]."""

    z: NDArray[np.complex128]
    dz: NDArray[np.complex128]
    ddz: NDArray[np.complex128]


@kernel
def half_link(bodies, i, sense):  # type: ignore[no-untyped-def]
    """From the centre of body i to its end (sense 1 for the head, -1 for the tail), complex [m]."""
    angle = bodies.q[i, 2]
    return 0.5 * bodies.length[i] * sense * complex(np.cos(angle), np.sin(angle))


@kernel
def place_arm(bodies, i, arm):  # type: ignore[no-untyped-def]
    """Position and velocity of the point at `arm` from the centre of body i [m, m/s]."""
    q, qd = bodies.q, bodies.qd
    return complex(q[i, 0], q[i, 1]) + arm, complex(qd[i, 0], qd[i, 1]) + 1j * qd[i, 2] * arm


@kernel
def join(bodies, i, arm, z, dz, ddz, damping, spring):  # type: ignore[no-untyped-def]
    """Acceleration of the point at `arm` of body i so that it joins the point (z, dz, ddz) by Baumgarte."""
    at, rate = place_arm(bodies, i, arm)
    return ddz - damping * (rate - dz) - spring * (at - z)


@kernel
def carry(bodies, i, spin, held, held_acc, arm, p, points):  # type: ignore[no-untyped-def]
    """Set the acceleration of body i: angular `spin`, and `held_acc` at the point at `held`; then the motion
    of its point at `arm`, which becomes that of point `p`."""
    turn = complex(-bodies.qd[i, 2] * bodies.qd[i, 2], spin)
    centre = held_acc - turn * held
    bodies.qdd[i, 0], bodies.qdd[i, 1], bodies.qdd[i, 2] = centre.real, centre.imag, spin
    points.z[p], points.dz[p] = place_arm(bodies, i, arm)
    points.ddz[p] = centre + turn * arm


@kernel
def accelerate(pivot, values, motion, damping, spring, bodies, points):  # type: ignore[no-untyped-def]
    """Fill `bodies.qdd` by the second row of Eq. 8, and `points`; returns False where it is singular.

    `pivot`, `values`: as in `measure.leg_paths`; `motion`: from `swing_motion`, at a steady crank; `damping`,
    `spring`: 2 alpha [1/s] and beta^2 [1/s^2].
    """
    theta, theta_rate, phi, phi_rate, phi_acc = motion
    q, qd, qdd, length = bodies.q, bodies.qd, bodies.qdd, bodies.length
    z, dz, ddz = points.z, points.dz, points.ddz
    z[_O], dz[_O], ddz[_O] = 0j, 0j, 0j
    z[_C] = pivot * complex(np.cos(phi), np.sin(phi))
    dz[_C] = 1j * phi_rate * z[_C]
    ddz[_C] = complex(-phi_rate * phi_rate, phi_acc) * z[_C]
    arm = half_link(bodies, DRIVER, _DRIVER_SENSE)
    spin = phi_acc - damping * (qd[DRIVER, 2] + theta_rate - phi_rate)
    spin -= spring * (q[DRIVER, 2] + theta - phi)
    held = join(bodies, DRIVER, -arm, z[_O], dz[_O], ddz[_O], damping, spring)
    carry(bodies, DRIVER, spin, -arm, held, arm, _P, points)
    for k in range(STEPS.shape[0]):
        p, a, b, origin = STEPS[k, 1], STEPS[k, 2], STEPS[k, 3], STEPS[k, 4]
        i, j = _LINKS[k, 0], _LINKS[k, 2]
        if STEPS[k, 0] == 1:
            length[i], length[j] = values[k, 0], values[k, 1]
            one, two = half_link(bodies, i, _LINKS[k, 1]), half_link(bodies, j, _LINKS[k, 3])
            held_i = join(bodies, i, -one, z[a], dz[a], ddz[a], damping, spring)
            held_j = join(bodies, j, -two, z[b], dz[b], ddz[b], damping, spring)
            at, rate = place_arm(bodies, i, one)
            joined = join(bodies, j, two, at, rate, 0j, damping, spring)
            # 2i (spin_j two - spin_i one) = rest
            rest = joined - held_j + held_i + 2.0 * (qd[j, 2] ** 2 * two - qd[i, 2] ** 2 * one)
            area = 2.0 * cross(one, two)
            if area == 0.0:
                return False
            spin_i, spin_j = -dot(two, rest) / area, -dot(one, rest) / area
            if not np.isfinite(spin_i + spin_j):
                return False
            carry(bodies, j, spin_j, -two, held_j, two, p, points)
            carry(bodies, i, spin_i, -one, held_i, one, p, points)
        elif i >= 0:  # a link of its own, locked to the one that it extends
            length[i] = values[k, 0] * length[j]
            one = half_link(bodies, i, _LINKS[k, 1])
            held_i = join(bodies, i, -one, z[origin], dz[origin], ddz[origin], damping, spring)
            spin_i = qdd[j, 2] - damping * (qd[i, 2] - qd[j, 2]) - spring * (q[i, 2] - q[j, 2])
            carry(bodies, i, spin_i, -one, held_i, one, p, points)
        else:  # a point of the extended link itself
            along = half_link(bodies, j, _LINKS[k, 3])
            arm = (along if origin == b else -along) + 2.0 * values[k, 0] * along
            carry(bodies, j, qdd[j, 2], 0j, complex(qdd[j, 0], qdd[j, 1]), arm, p, points)
    return True


@kernel
def swing_motion(theta, gait):  # type: ignore[no-untyped-def]
    """(theta, its rate, phi, its rate, its acceleration) of a steady gait: `gait.evaluate_motion`."""
    w, s, c = gait[0], np.sin(theta), np.cos(theta)
    wave, slope = gait[2] * s + gait[3] * c, gait[2] * c - gait[3] * s
    return theta, w, gait[1] + wave, slope * w, -wave * w * w


@kernel
def close_loops(theta, crank, pivot, values, gait, bodies, points):  # type: ignore[no-untyped-def]
    """Fill `bodies.q`, `bodies.qd` with the closed form, as `constrained.closed_form`."""
    z, dz, q, qd = points.z, points.dz, bodies.q, bodies.qd
    solve_points(theta, crank, pivot, STEPS, values, z, dz, points.ddz)
    _, w, phi, phi_rate, _ = swing_motion(theta, gait)
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
def euler_cycle(crank, pivot, values, setup, gait, theta, h, bodies, at, velocity, ankle):  # type: ignore[no-untyped-def]
    """Integrate one steady gait by explicit Euler from closed loops; returns whether all stayed finite.

    `theta`: crank angle at the start [rad]; `h`: time step [s]; `bodies`: the state at the end; all else as
    in `measure.leg_paths` and `swing_hoof`, at n instants from the start. If a dyad does not close at the
    start or is singular, or anything stops being finite, all outputs are NaN.
    """
    q, qd = bodies.q, bodies.qd
    empty = np.empty((3, _SIZE), np.complex128)
    points = Points(empty[0], empty[1], empty[2])
    bodies.length[DRIVER] = crank
    close_loops(theta, crank, pivot, values, gait, bodies, points)
    damping, spring = 2.0 * setup.alpha, setup.beta * setup.beta
    for k in range(at.shape[1]):
        if k > 0:
            for i in range(q.shape[0]):
                for c in range(3):
                    q[i, c] += h * qd[i, c]
                    qd[i, c] += h * bodies.qdd[i, c]
        motion = swing_motion(theta + k * h * gait[0], gait)
        if not accelerate(pivot, values, motion, damping, spring, bodies, points):
            q[:], qd[:], ankle[:] = np.nan, np.nan, np.nan
            at[:], velocity[:] = complex(np.nan, np.nan), complex(np.nan, np.nan)
            return False
        for c in range(2):
            corner = setup.toe if c == 0 else setup.heel
            arm = half_link(bodies, _SOLE, 1 if _HEAD[_SOLE] == corner else -1)
            place, rate = place_arm(bodies, _SOLE, arm)
            at[c, k], velocity[c, k] = mirror(place, setup.travel), mirror(rate, setup.travel)
        ankle[k] = points.z[_G].imag
    return True
