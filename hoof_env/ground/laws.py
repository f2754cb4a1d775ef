"""Laws of contact: normal force and friction. One expression each, for the engine's lanes and for the paper's
solver.

Normal force (Eq. 14): F = K d^n (1 + chi v / v0) + c v with penetration d, penetration rate v and approach
speed v0 latched at touch-down; the laws differ in the damping factor chi as a function of the coefficient of
restitution cr (and Kelvin-Voigt in using a dashpot c instead). The paper's is Lankarani and Nikravesh's.

For a free impact of a mass, any K and n, a factor chi returns the restitution e that solves
chi (1 + e) = ln[(1 + chi) / (1 - chi e)]; only "exact" returns cr itself. Lankarani and Nikravesh's law at
cr = 0 bounces with e = 0.66.

Friction (Eq. 15): F_t = -mu(v) F_n v / |v|, Coulomb friction with a coefficient that depends on the sliding
speed. The paper's is Ambrosio's dynamic correction c_d; its c_f is read as the direction v / |v|, for
friction opposes sliding. A function of the sliding speed alone cannot hold a hoof at rest: it creeps.

Sources: Lankarani & Nikravesh 1990 (J Mech Des 112:369), Hunt & Crossley 1975 (J Appl Mech 42:440), Flores
et al. 2011 (Multibody Syst Dyn 25:357), Gonthier et al. 2004 (Multibody Syst Dyn 11:209), Hu & Guo 2015;
Skrinjar et al. 2018 (Int J Mech Sci 145:171), a review; Schwager & Poeschel 2007 (Granular Matter 9:465) for
the spring-dashpot that may not pull. Friction: Ambrosio 2003 (in Virtual Nonlinear Multibody Systems, 57-81);
Threlfall 1978 (Mech Mach Theory 13:475); hyperbolic tangent, common in robotics.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from hoof_env.errors import ParameterError, brief, check_choice, check_number
from hoof_env.simd import maximum, minimum
from hoof_env.simd.math import Real, exp_of_negative


def exact(cr: float) -> float:
    """Return the damping factor [-] with which a free impact returns exactly cr."""
    return 0.0 if cr == 1.0 else _bisect(lambda chi: restitution_of_factor(chi) - cr, 1e-12, 1e6)


FACTORS: dict[str, Callable[[float], float]] = {
    "lankarani-nikravesh": lambda cr: 3 * (1 - cr**2) / 4,
    "hunt-crossley": lambda cr: 3 * (1 - cr) / 2,
    "flores": lambda cr: 8 * (1 - cr) / (5 * cr),
    "gonthier": lambda cr: (1 - cr**2) / cr,
    "hu-guo": lambda cr: 3 * (1 - cr) / (2 * cr),
    "exact": exact,
}
"""Damping factor chi [-] of each law as a function of the coefficient of restitution cr."""

NORMAL_LAWS = (*FACTORS, "kelvin-voigt")
"""Names of the normal laws."""

MIN_RESTITUTION = 0.01
"""Smallest restitution [-] of laws with a damping that grows without bound towards 0."""

REGULAR_LAWS = ("lankarani-nikravesh", "hunt-crossley")
"""Laws with a finite damping at a restitution of 0."""


def damping(law: str, restitution: float, stiffness: float, reference_mass: float) -> tuple[float, float]:
    """Return the damping factor chi [-] and the dashpot coefficient c [N s/m] of a law.

    Args:
        law: one of `NORMAL_LAWS`.
        restitution: nominal coefficient of restitution, 0 to 1.
        stiffness: K [N/m^n]; used by "kelvin-voigt" only.
        reference_mass: mass [kg] for which "kelvin-voigt" with exponent 1 returns `restitution`; a linear
            dashpot has one restitution for each mass.

    Raises:
        ParameterError: an unknown law, or a restitution that it cannot represent.
    """
    check_choice("normal_law", law, NORMAL_LAWS)
    cr = check_number("restitution", restitution, low=0, high=1)
    if law not in REGULAR_LAWS and cr < MIN_RESTITUTION:
        raise ParameterError(
            f"restitution: expected a number in [{MIN_RESTITUTION}, 1] for {law!r}, whose damping grows "
            f"without bound towards 0, got {brief(restitution)}"
        )
    if law == "kelvin-voigt":
        return 0.0, 2 * kelvin_voigt_damping_ratio(cr) * math.sqrt(stiffness * reference_mass)
    return FACTORS[law](cr), 0.0


def restitution_of_factor(chi: float) -> float:
    """Return the restitution e [-] of a free impact under damping factor chi; see the module docstring."""
    # the equation has lost all its digits there
    if chi <= 1e-9:
        return 1.0
    return _bisect(
        lambda e: math.log1p(chi) - math.log1p(-chi * e) - chi * (1 + e), 0.0, min(1.0, (1 - 1e-15) / chi)
    )


def restitution_of_damping_ratio(zeta: float) -> float:
    """Return the restitution [-] of a linear spring-dashpot that may not pull, for damping ratio zeta
    (Schwager & Poeschel)."""
    if zeta < 1.0:
        w = math.sqrt(1 - zeta**2)
        return math.exp(-zeta / w * (math.pi - math.atan2(2 * zeta * w, 1 - 2 * zeta**2)))
    # the limit of the two remaining branches, which divide by 0 here
    if zeta == 1.0:
        return math.exp(-2.0)
    w = math.sqrt(zeta**2 - 1)
    return math.exp(-zeta / w * math.log((zeta + w) / (zeta - w)))


def kelvin_voigt_damping_ratio(cr: float) -> float:
    """Return the damping ratio [-] for which `restitution_of_damping_ratio` is cr."""
    return 0.0 if cr == 1.0 else _bisect(lambda zeta: restitution_of_damping_ratio(zeta) - cr, 0.0, 100.0)


def _bisect(f: Callable[[float], float], low: float, high: float) -> float:
    """Return the root of a function that changes sign once on [low, high], to the last bit."""
    sign = f(low) > 0
    while True:
        middle = (low + high) / 2
        # no number is left between the bounds
        if middle in (low, high):
            return middle
        if (f(middle) > 0) == sign:
            low = middle
        else:
            high = middle


def normal_force(spring: Real, chi: Real, dashpot: Real, rate: Real, inverse_speed: Real) -> Real:
    """Return the normal force [N] on a point inside the ground (Eq. 14) from K d^n [N], chi [-], c [N s/m], v
    [m/s] and 1 / v0 [s/m]. The ground does not pull."""
    return maximum(spring * (1.0 + chi * rate * inverse_speed) + dashpot * rate, 0.0)  # Eq. 14


FRICTION_LAWS = ("ambrosio", "threlfall", "tanh")
"""Names of the friction laws; kernels take the position in this tuple."""

AMBROSIO, THRELFALL, TANH = range(3)


def friction_part(speed: Real, law: int, slow: Real, fast: Real) -> Real:
    """Return the ratio of the friction coefficient to its kinetic value, mu(|v|) / mu_k [-], 0 to 1; 0 at
    rest.

    Speeds are |v| and the thresholds of `Ground` [m/s]; `law`, an index into `FRICTION_LAWS`, is the same in
    all lanes. Ambrosio: c_d = 0 below `slow`, 1 above `fast`, linear between. Threlfall: 1 - exp(-3 |v| / v0)
    up to v0 = `fast`, constant above. The last: tanh(|v| / `fast`).
    """
    if law == AMBROSIO:
        part = (speed - slow) / (fast - slow)  # c_d of Eq. 15
    elif law == THRELFALL:
        part = 1.0 - exp_of_negative(-3.0 * minimum(speed / fast, 1.0))
    else:
        # `simd.math.tanh` without its choice of a sign: a speed is not negative
        e = exp_of_negative(-2.0 * (speed / fast))
        part = (1.0 - e) / (1.0 + e)
    return minimum(maximum(part, 0.0), 1.0)
