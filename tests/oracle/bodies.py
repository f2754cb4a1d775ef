"""How every body of N legs on one trunk moves, in arithmetic that differentiates itself.

Nothing here is a formula for a speed: places of points and turns of links come from the construction of the
leg, and `Jet` carries their two derivatives by time along.
"""

import numpy as np

from hoof_env.dynamics.parts import Motor
from hoof_env.gait import OFFSET
from hoof_env.leg.assembly import coordinate
from tests.linkage import BODIES, CONSTRUCTION, Dyad
from tests.oracle.jet import Jet, concatenate, direction, inverse, root, stack, turn


class PlainBodies:
    """What moves: a trunk, N legs of 14 links and a rotor for each."""

    def __init__(self, trunk, limbs):
        self.limbs, self.size = tuple(limbs), len(limbs)
        legs = [limb.geometry for limb in limbs]
        # columns: one row a leg, against the many motions that are computed at a time
        self._lengths = {name: _column(leg.lengths[name] for leg in legs) for name in legs[0].lengths}
        self._side = {name: _column(leg.assembly[name] for leg in legs) for name in legs[0].assembly}
        self._pivot = _column(complex(*leg.pivot) for leg in legs)
        self._hips = _column(complex(*limb.hip) for limb in limbs)
        self._travel = _column(leg.travel for leg in legs)
        self._toe_is_i = _column(leg.toe == "I" for leg in legs)
        rotors = [limb.drive if isinstance(limb.drive, Motor) else Motor(0, 0, 0, 0) for limb in limbs]
        self._ratio = _column(rotor.gear_ratio for rotor in rotors)
        # bodies: trunk; first link of every leg, second ...; rotors, whose mass is in the trunk's
        links = np.transpose([leg.body_masses for leg in legs]).ravel()
        self.masses = np.concatenate([[trunk.mass], links, np.zeros(len(legs))])
        links = np.transpose([leg.body_inertias for leg in legs]).ravel()
        self.inertias = np.concatenate([[trunk.pitch_inertia], links, [r.rotor_inertia for r in rotors]])

    def motion(self, u, ud, udd):
        """Every body's centre (complex) and turn, and every hoof point, for B accelerations at a time.

        Args:
            u, ud: coordinates x, y, pitch, theta of each leg, phi of each leg, and rates, shape (3 + 2 N,).
            udd: accelerations, shape (B, 3 + 2 N).

        Returns:
            Jets of shapes (1 + 15 N, B), twice, and (N, 2, B).
        """
        n, count = self.size, len(udd)
        a = udd.T
        trunk = Jet(complex(u[0], u[1]), complex(ud[0], ud[1]), a[0] + 1j * a[1])
        pitch = Jet(u[2], ud[2], a[2])
        theta, phi = (Jet(u[k : k + n, None], ud[k : k + n, None], a[k : k + n]) for k in (3, 3 + n))
        z = {"O": Jet(np.zeros_like(self._pivot)), "C": Jet(self._pivot)}
        z["P"] = self._lengths["OP"] * turn(theta * -1.0)
        for step in CONSTRUCTION:
            ends = (step.first, step.second) if isinstance(step, Dyad) else (step.origin, step.toward)
            start, span = z[ends[0]], z[ends[1]] - z[ends[0]]
            if isinstance(step, Dyad):
                r1, r2 = self._lengths[step.from_first], self._lengths[step.from_second]
                per_d2 = inverse((span * span.part(np.conj)).part(np.real))
                along = 0.5 + per_d2 * ((r1**2 - r2**2) / 2)
                across = self._side[step.point] * root(per_d2 * r1**2 - along * along)
                z[step.point] = start + span * (along + 1j * across)
            else:
                part = coordinate(self._lengths, step.along) / self._lengths[step.span]
                z[step.point] = start + span * part

        def mirrored(w):
            return self._travel * np.real(w) + 1j * np.imag(w)

        swing, tilt = turn(phi), turn(pitch)
        at = {name: trunk + tilt * (self._hips + (swing * p).part(mirrored)) for name, p in z.items()}
        centres = stack([0.5 * (at[body.tail] + at[body.head]) for body in BODIES], (n, count))
        turns = stack([direction(at[body.head] - at[body.tail]) for body in BODIES], (n, count))
        rotors = stack([pitch + self._travel * (phi - self._ratio * theta)], (n, count))
        hooves = stack([at["I"], at["J"]], (n, count))

        def all_bodies(*jets):
            return concatenate([jet.part(lambda x: x.reshape(-1, count)) for jet in jets])

        return (
            all_bodies(stack([trunk], (count,)), centres, stack([Jet(0j)], (n, count))),
            all_bodies(stack([pitch], (count,)), turns, rotors),
            hooves.part(lambda x: np.where(self._toe_is_i, x, x[::-1]).swapaxes(0, 1)),
        )

    def swing(self, theta, filters):
        """phi = offset + A sin theta + B cos theta + A2 sin 2 theta ..., `filters` of shape (N, 4, 3) or with
        more harmonics."""
        phi = Jet(*filters[:, OFFSET].T)
        for k in range(1, filters.shape[1] // 2):
            a, b = (Jet(*filters[:, row].T) for row in (2 * k, 2 * k + 1))
            e = turn(theta * float(k))
            phi = phi + a * e.part(np.imag) + b * e.part(np.real)
        return phi

    def hooves(self, trunk, trunk_rate, theta, theta_rate, gaits):
        """Place and velocity [m, m/s] of hoof points under steady gaits (N, 4); complex, shapes (N, 2)."""
        phi = self.swing(Jet(np.asarray(theta), theta_rate), gaits[:, :, None] * [1.0, 0.0, 0.0])
        u, ud = np.concatenate([trunk, theta, phi.value]), np.concatenate([trunk_rate, theta_rate, phi.rate])
        at = self.motion(u, ud, np.zeros((1, len(u))))[2]
        return at.value[..., 0], at.rate[..., 0]


def _column(values):
    return np.array(list(values))[:, None]
