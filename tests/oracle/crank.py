"""One motor-driven leg on a fixed trunk, as exact as `run` and quick enough for many starts.

A reference for the crank angle under load: what the accuracy of a fixed-step scheme is measured against.
"""

import numpy as np

from hoof_env.dynamics.parts import Trunk
from tests.oracle.ground import PlainGround
from tests.oracle.horse import PlainHorse, servo
from tests.oracle.run import follow


class PlainCrank:
    """One motor-driven leg on a fixed trunk over level ground, in a steady gait, from tables in theta.

    All that moves is theta: I thetadd + I'/2 thetad^2 + V' = servo + ground. Inertia I, I'/2, V' and the hoof
    points are the plain horse's, at the nodes of Chebyshev polynomials on equal pieces of a revolution.

    `height` is the height of the crank centre above the ground [m], `pieces` and `order` are of the tables.
    """

    def __init__(self, limb, gait, ground, height, pieces=64, order=16):
        self.drive, self.speed, self.ground = limb.drive, gait.crank_speed, PlainGround(ground)
        self._pieces, self._orders = pieces, np.arange(order)
        horse, base = PlainHorse(Trunk("fixed", height=height), [limb]), gait.to_array()
        place = (np.array([0.0, height, 0.0]) - [*limb.hip, 0.0], np.zeros(3))
        nodes = np.cos((self._orders + 0.5) * np.pi / order)
        weights = np.cos(np.outer(self._orders, np.arccos(nodes))) * 2 / order
        weights[0] /= 2

        def row(theta):
            still, moving = (
                horse.at(*place, [theta], [w], [[w, *base[1:]]])
                for w in (0.0, 1.0)  # no servo torque
            )
            inertia, slope = moving.mass_matrix[0, 0], -still.load[0]
            hoof = np.concatenate([moving.hoof[0], moving.hoof_velocity[0]])
            return [inertia, -moving.load[0] - slope, slope, *hoof.real, *hoof.imag]

        middles = 2 * np.pi / pieces * (np.arange(pieces) + 0.5)
        self._tables = [
            (weights @ [row(middle + np.pi / pieces * x) for x in nodes]).T.copy() for middle in middles
        ]

    def at(self, theta):
        """I, I'/2, V', then x of toe and heel, their derivatives by theta, y and its derivatives likewise."""
        turns = theta / (2 * np.pi)
        piece, x = divmod((turns - np.floor(turns)) * self._pieces, 1.0)
        basis = np.cos(self._orders * np.arccos(min(max(2 * x - 1, -1.0), 1.0)))
        return self._tables[int(piece) % self._pieces] @ basis

    def rate(self, y, approach):
        """Of (theta, thetad)."""
        theta, w = y.tolist()
        row = self.at(theta).tolist()
        force = servo(self.drive, self.speed - w) - row[1] * w * w - row[2]
        for k in (0, 1):
            if approach[k] == approach[k]:  # a number
                x, y_, dx, dy = row[3 + k], row[7 + k], row[5 + k], row[9 + k]
                f = sum(self.ground.forces(complex(x, y_), complex(dx * w, dy * w), approach[k]))
                force += f.real * dx + f.imag * dy
        return np.array([w, force / row[0]])

    def depth(self, y):
        """Of toe and heel, and its rate."""
        row = self.at(float(y[0]))
        return -row[7:9], -row[9:11] * y[1]

    def run(self, theta, times, tolerance=1e-12):
        """Crank angle and speed at `times` from `theta` at the gait's speed, shapes (K,), and the touches."""
        start, floor = np.array([theta, self.speed]), self.ground.ground.approach_floor
        y, _, touches = follow(self.rate, self.depth, start, times, floor, tolerance)
        return y[:, 0], y[:, 1], touches
