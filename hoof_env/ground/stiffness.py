"""Rates of a contact, and the longest step with which an explicit scheme still follows it.

A mass m on the ground has three rates. The spring's is the frequency w = sqrt(n K d^(n - 1) / m) at the
deepest penetration. Damping is chi K d^n / (v0 m) + c / m, where v0 is the approach speed. Friction is the
slope of its law times F / m: between the threshold speeds, a few millimetres a second apart, it rises from
zero to its full value, which makes it the fastest of the three under a light hoof.

The spring decides on accuracy. tests/ground/test_stiffness.py drops a mass on the contact of Eq. 14 and
measures the error e of its state after it has left, the larger of the errors of the speed, relative to the
touch-down speed, and of the place, relative to the deepest penetration, against an adaptive scheme of eighth
order. For n from 1 to 3, chi from 0 to 3, weights up to 0.3 of the peak force, steps h w of 0.025 to 0.4 and
16 places of the touch-down within a step, all errors obey one law:

    e < C (h w)^p,   p = min(order, n + 1),

because d^n has a kink at touch-down that limits the order. `SCHEME_LIMITS` holds the largest C, at n = 1,
rounded up; at n = 1.5 less than 0.7 of it is enough for semi-implicit Euler and the midpoint rule, less than
0.4 for the remaining schemes.

A hoof with a spring k and a damper c has a sole without mass. Its penetration d follows the leg's with the
rate (k + n K d^(n - 1)) / (c + chi K d^n / v0): the stiff ground against all damping. It is largest somewhere
on the way in. The mass then has the frequency of both springs in series, at most the damping of c, and
friction needs no sliding speed.

Damping and friction decay: explicit schemes are stable up to h rate = 2 (Euler, midpoint), 2.51 (third order)
and 2.79 (RK4), and half of that is the limit here. Past its limit friction does not diverge, because its
force is bounded, but leaves the point sliding back and forth with a speed of up to some 1.5 mu F h / m.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from hoof_env.errors import check_choice, check_number
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain


class SchemeLimits(NamedTuple):
    """Limits of a fixed-step scheme in a contact."""

    order: int  # of the scheme on a smooth force
    error: float  # C of the module's docstring [-]
    decay: float  # longest step times the rate of a damped motion [-]


SCHEME_LIMITS: Mapping[str, SchemeLimits] = MappingProxyType(
    {
        "semi_implicit_euler": SchemeLimits(1, 0.8, 1.0),
        "midpoint": SchemeLimits(2, 0.65, 1.0),
        "rk3": SchemeLimits(3, 0.2, 1.25),
        "rk4": SchemeLimits(4, 0.2, 1.39),
    }
)
"""Schemes by name; "rk3" is Heun's of third order, "rk4" the classical one."""

DEPTHS = 65
"""Number of penetrations at which the rate of a sole is evaluated."""

MAX_ANGLE = 0.4
"""Largest h w [-], up to which the errors were measured."""


@dataclass(frozen=True)
class ContactRates:
    """Rates of a contact [1/s], and the exponent n of its force [-]."""

    elastic: float
    damping: float
    friction: float
    exponent: float

    def longest_steps(self, scheme: str, tolerance: float = 1e-2) -> dict[str, float]:
        """Return the longest step [s] that each of the three rates allows; infinite for a rate of zero.
        `tolerance` is the error of the state after a contact [-]; see the module's docstring."""
        limits = SCHEME_LIMITS[check_choice("scheme", scheme, SCHEME_LIMITS)]
        tolerance = check_number("tolerance", tolerance, low=0, high=1, exclusive_low=True)
        order = min(limits.order, self.exponent + 1)
        # e < C (h w)^p of the module's docstring, solved for h w
        angle = min((tolerance / limits.error) ** (1 / order), MAX_ANGLE)
        allowed = {"elastic": angle, "damping": limits.decay, "friction": limits.decay}
        rates = {name: getattr(self, name) for name in allowed}
        return {name: allowed[name] / rate if rate > 0 else math.inf for name, rate in rates.items()}


def spring_rates(
    ground: Ground,
    spring: tuple[float, float],
    mass: float,
    load: float,
    speed: float,
    terrain: Terrain | None = None,
) -> tuple[ContactRates, float]:
    """Return the rates of a mass on a hoof's spring on the ground, and the rate of the sole [1/s].

    Args:
        ground: laws of contact.
        spring: stiffness [N/m] and damping [N s/m] along the normal.
        mass, load, speed, terrain: as in `contact_rates`; a contact is assumed to be pressed by at most twice
            the load and the force of spring and damper in the touch-down.
    """
    k, c = spring
    speed = max(speed, ground.approach_floor)
    n = ground.exponent
    stiffness = ground.stiffness * float(np.max((terrain or Terrain()).stiffness))
    chi, dashpot = ground.damping
    force = 2 * load + speed * (math.sqrt(k * mass) + c)
    depth = (force / stiffness) ** (1 / n) * np.linspace(0.0, 1.0, DEPTHS)
    slope = n * stiffness * depth ** (n - 1)
    # the largest rate is somewhere on the way in, so all depths count
    sole = (k + slope) / (c + chi * stiffness * depth**n / speed + dashpot)
    series = k * slope[-1] / (k + slope[-1])
    return ContactRates(math.sqrt(series / mass), c / mass, 0.0, n), float(sole.max())


def contact_rates(
    ground: Ground,
    mass: float,
    load: float,
    speed: float = 0.1,
    sliding_mass: float | None = None,
    terrain: Terrain | None = None,
) -> ContactRates:
    """Return the rates of the contact of one hoof point at its deepest.

    Args:
        ground: laws of contact.
        mass: mass that the hoof point sets against a normal force [kg].
        load: force that presses the point down from outside [N], as a part of the weight; the spring is
            assumed to overshoot under it.
        speed: speed at which the point touches down [m/s]. Fast points go deep, slow ones are damped
            strongly: where both occur, compute both and use the larger rates.
        sliding_mass: mass that it sets against friction [kg]; None for `mass`.
        terrain: shape of the ground, whose stiffest and roughest places count; None for flat ground.
    """
    mass = check_number("mass", mass, low=0, exclusive_low=True)
    load = check_number("load", load, low=0)
    speed = max(check_number("speed", speed, low=0), ground.approach_floor)
    sliding_mass = mass if sliding_mass is None else sliding_mass
    sliding_mass = check_number("sliding_mass", sliding_mass, low=0, exclusive_low=True)
    terrain = terrain or Terrain()
    n = ground.exponent
    stiffness = ground.stiffness * float(np.max(terrain.stiffness))
    mu = ground.friction * float(np.max(terrain.friction))
    chi, dashpot = ground.damping
    # d of K d^(n+1) / (n+1) = m v^2 / 2 + load d is at most the sum of the depths of either term alone
    depth = ((n + 1) * mass * speed**2 / (2 * stiffness)) ** (1 / (n + 1))
    depth += ((n + 1) * load / stiffness) ** (1 / n)
    force = stiffness * depth**n
    # slopes of the laws at their steepest: 3 / v0 of Threlfall's, 1 / v0 of tanh, both at rest
    slow = ground.friction_slow if ground.friction_law == "ambrosio" else 0.0
    steepest = (3 if ground.friction_law == "threlfall" else 1) / (ground.friction_fast - slow)
    return ContactRates(
        elastic=math.sqrt(n * force / depth / mass),
        damping=(chi * force / speed + dashpot) / mass,
        friction=mu * force * steepest / sliding_mass,
        exponent=n,
    )
