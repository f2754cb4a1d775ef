"""The laws of `hoof_env.ground.laws` for plain numbers, as the paper's solver calls them."""

import math

from hoof_env.ground import laws


def friction_coefficient(speed, law, kinetic, slow, fast):
    return kinetic * laws.friction_part(speed, law, slow, fast)


def friction_force(velocity, normal, law, kinetic, slow, fast):
    return -math.copysign(friction_coefficient(abs(velocity), law, kinetic, slow, fast) * normal, velocity)


def normal_force(penetration, rate, approach, stiffness, exponent, chi, dashpot):
    if penetration <= 0.0:
        return 0.0
    spring = stiffness * penetration**exponent
    return laws.normal_force(spring, chi, dashpot, rate, 1.0 / approach)
