"""Audit of an engine: momentum, angular momentum and energy, summed over the motion of all bodies,
independently of the integrated quantities."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Motor
from hoof_env.leg.profile import by_name, cross


class Tally(NamedTuple):
    """Sums over all bodies of an engine, shape (num_envs,) each."""

    centre: Any  # common centre of mass, complex [m]
    momentum: Any  # complex [kg m/s]
    angular_momentum: Any  # about the centre [kg m^2/s]
    kinetic: Any  # rotors included [J]
    potential: Any  # of weight and, on a suspended trunk, of spring and support [J]


def tally_of(engine: TrunkEngine) -> Tally:
    """Return momentum, angular momentum and energy of all bodies at the present instant of an engine."""
    r = engine.report
    s = engine.state
    trunk = engine.trunk
    place = r["x"] + 1j * r["y"]
    velocity = r["vx"] + 1j * r["vy"]
    pitch_rate = r["pitch_rate"]
    turn = np.exp(1j * s["pitch"])
    # first moment about the origin
    moment = trunk.mass * place
    momentum = trunk.mass * velocity
    spin = trunk.pitch_inertia * pitch_rate + trunk.mass * cross(place, velocity)  # about the origin
    kinetic = 0.5 * trunk.mass * np.abs(velocity) ** 2 + 0.5 * trunk.pitch_inertia * pitch_rate**2
    for i, limb in enumerate(engine.limbs):
        theta_rate = s["crank_angle_rate"][i]
        f = by_name(engine.profiles[i](s["crank_angle"][i])[0])
        a = f["crank_inertia"]
        b = f["coupling"]
        c = f["frame_inertia"]
        side = limb.geometry.travel
        if isinstance(limb.drive, Motor):
            rotor = limb.drive.rotor_inertia
            gear = limb.drive.gear_ratio
            a = a + gear**2 * rotor
            b = b - side * gear * rotor
            c = c + rotor
        frame = turn * np.exp(1j * side * r["swing_angle"][i])
        frame_rate = pitch_rate + side * r["swing_angle_rate"][i]
        first_moment = frame * (f["first_moment_x"] + 1j * f["first_moment_y"])
        slope = f["moment_slope_x"] + 1j * f["moment_slope_y"]
        own_rate = frame * slope * theta_rate + 1j * first_moment * frame_rate
        arm = turn * complex(*limb.hip)
        hip = place + arm
        hip_rate = velocity + 1j * arm * pitch_rate
        mass = limb.geometry.mass
        moment = moment + mass * hip + first_moment
        momentum = momentum + mass * hip_rate + own_rate
        spin = spin + cross(hip, mass * hip_rate + own_rate) + cross(first_moment, hip_rate)
        spin = spin + b * theta_rate + c * frame_rate
        kinetic = kinetic + 0.5 * mass * np.abs(hip_rate) ** 2 + (hip_rate.conj() * own_rate).real
        rates = a * theta_rate**2 + 2 * b * theta_rate * frame_rate + c * frame_rate**2
        kinetic = kinetic + 0.5 * rates
    total = engine.total_mass
    centre = moment / total
    potential = GRAVITY * moment.imag
    if trunk.kind == "suspended":
        potential = potential + 0.5 * trunk.stiffness * (r["y"] - trunk.height) ** 2
        potential = potential - (1 - trunk.share) * total * GRAVITY * r["y"]
    return Tally(centre, momentum, spin - cross(centre, momentum), kinetic, potential)
