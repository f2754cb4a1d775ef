"""An id of one's own for `test_own_task.py`: a user's module, which other processes import too.

Its law is Eq. 14 again, so that what it adds can be compared with the id it begins with.
"""

import math

import numpy as np

from hoof_env import Entry, Scale, Term, register
from hoof_env.simd.math import root_power

ID = "own/Everything-v0"
MODULE_ID = f"own_functions:{ID}"


def friction_power(point):
    return point.friction * point.slide


def friction(step, weight):
    report = step.leg.report
    return 0.001 * weight * (friction_power(report.toe) + friction_power(report.heel))


def comfort(step, weight):
    smooth = np.exp(-abs(step.trunk.report.acceleration.imag) / 9.81)
    return np.where(step.failed > 0.0, 0.0, weight * smooth)


def rising(scene):
    return np.where(scene.trunk.report.velocity.imag > 0.0, scene.trunk.report.acceleration.imag, 0.0)


def load_angle(scene):
    toe = scene.leg.report.toe
    return np.where(toe.normal > 0.0, np.arctan2(toe.friction, toe.normal), 0.0)


def equation_14(penetration, rate, inverse_approach_speed, ground):
    spring = ground.stiffness * root_power(penetration, ground.eighths)
    damping = ground.chi * rate * inverse_approach_speed
    return np.maximum(spring * (1.0 + damping) + ground.dashpot * rate, 0.0)


TERMS = (
    Term("friction", 0.5, "1/kJ", "power of friction", friction),
    Term("comfort", 0.1, "-", "per step without acceleration", comfort),
)
ENTRIES = (
    Entry(
        "rising", "feel", "m/s^2", rising, Scale("tanh(x / 9.81)", lambda x, scene: x / 9.81, saturates=True)
    ),
    Entry("load angle", "feel", "rad", load_angle, Scale("/ pi", lambda x, s: x / math.pi)),
    Entry("episode seconds", "watch", "s", lambda s: s.episode.time, Scale("/ 10", lambda x, s: 0.1 * x)),
)

register(ID, terms=TERMS, entries=ENTRIES, contact_law=equation_14, episode_seconds=2.0)
