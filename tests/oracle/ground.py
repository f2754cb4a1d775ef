"""The ground under the plain horse: one point at a time, on any terrain."""

import numpy as np
from scipy.optimize import brentq

from hoof_env.ground.laws import FRICTION_LAWS, damping
from tests.oracle.laws import friction_force, normal_force


class PlainGround:
    """The laws of a `Ground` (Eqs. 10-15) on a terrain, or on the level y = 0."""

    def __init__(self, ground, terrain=None):
        self.ground = ground
        self.chi, self.dashpot = damping(
            ground.normal_law, ground.restitution, ground.stiffness, ground.reference_mass
        )
        self.law = FRICTION_LAWS.index(ground.friction_law)
        self.terrain = terrain if terrain is not None and len(terrain.height) > 1 else None
        self.level = terrain.height[0] if terrain is not None else 0.0

    def surface(self, x):
        """Height [m] of the ground at `x` [m] and its unit normal."""
        if self.terrain is None:
            return self.level, 1j
        knots, height = self.terrain.x, self.terrain.height
        cell = int(np.searchsorted(knots, x, side="right"))
        slope = 0.0
        if 0 < cell < len(knots):
            slope = (height[cell] - height[cell - 1]) / (knots[cell] - knots[cell - 1])
        return float(np.interp(x, knots, height)), complex(-slope, 1.0) / abs(complex(-slope, 1.0))

    def depth(self, position, velocity):
        """Penetration of a point along the normal [m] and its rate [m/s]."""
        height, normal = self.surface(position.real)
        return (height - position.imag) * normal.imag, -(velocity * normal.conjugate()).real

    def forces(self, position, velocity, approach, less=(0.0, 0.0)):
        """Normal force and friction [N] on a point that touched down at `approach` [m/s]; `less` is how much
        less deep the sole is than the point [m], and its rate."""
        ground, (_, normal) = self.ground, self.surface(position.real)
        harder, rougher = 1.0, 1.0
        if self.terrain is not None:
            harder, rougher = (
                float(np.interp(position.real, self.terrain.x, factors))
                for factors in (self.terrain.stiffness, self.terrain.friction)
            )
        d, rate = np.subtract(self.depth(position, velocity), less)
        push = normal_force(
            d, rate, approach, ground.stiffness * harder, ground.exponent, self.chi, self.dashpot
        )
        along = normal / 1j
        grip = friction_force(
            (velocity * along.conjugate()).real, push,
            self.law, ground.friction * rougher, ground.friction_slow, ground.friction_fast,
        )  # fmt: skip
        return push * normal, grip * along

    def through_spring(self, position, velocity, approach, spring, give):
        """Normal force and friction [N] on a point with a sole on a spring, and the rates of what that gives
        along normal and tangent [m/s]: the balance of a sole without mass, solved as it is written."""
        _, normal = self.surface(position.real)
        along = normal / 1j
        ahead = (velocity * along.conjugate()).real
        k, c = spring.stiffness, spring.damping

        def ground_less_spring(slide_in):
            push = 0.0
            if not np.isnan(approach):
                push = abs(self.forces(position, velocity, approach, (give[0] - spring.length, slide_in))[0])
            return push - k * give[0] - c * slide_in

        wide = 1.0
        while ground_less_spring(-wide) < 0 or ground_less_spring(wide) > 0:
            wide *= 2
        sinking = brentq(ground_less_spring, -wide, wide, xtol=1e-15, rtol=1e-15)
        push = k * give[0] + c * sinking if not np.isnan(approach) else 0.0
        harder = 1.0
        if self.terrain is not None:
            harder = float(np.interp(position.real, self.terrain.x, self.terrain.friction))
        grip = self.ground.friction * harder * push
        k, c = spring.tangential_stiffness, spring.tangential_damping
        stretching, held = ahead, k * give[1] + c * ahead
        if abs(held) > grip:  # the sole slides: friction is known, the spring follows
            held = np.copysign(grip, held)
            stretching = (held - k * give[1]) / c
        return push * normal, -held * along, (sinking, stretching)
