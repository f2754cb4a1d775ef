"""The contact laws as their sources print them, in plain Python."""

import math


def normal_force(penetration, rate, approach, stiffness, exponent, chi, dashpot):
    """Eq. 14, and Kelvin-Voigt's dashpot [N]; zero outside the ground, which does not pull."""
    if penetration <= 0.0:
        return 0.0
    force = stiffness * penetration**exponent * (1.0 + chi * rate / approach) + dashpot * rate
    return max(force, 0.0)


def friction_coefficient(speed, law, kinetic, slow, fast):
    """mu(|v|) of Ambrosio (0), Threlfall (1) and tanh (2) [-]."""
    if law == 0:
        correction = (speed - slow) / (fast - slow)
    elif law == 1:
        correction = 1.0 - math.exp(-3.0 * min(speed / fast, 1.0))
    else:
        correction = math.tanh(speed / fast)
    return kinetic * min(max(correction, 0.0), 1.0)


def friction_force(velocity, normal, law, kinetic, slow, fast):
    """Eq. 15 [N]."""
    if velocity == 0.0:
        return 0.0
    return -math.copysign(friction_coefficient(abs(velocity), law, kinetic, slow, fast) * normal, velocity)
