"""Momentum, spin and energy of trunk and legs together, added up from their motion with NumPy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.parts import GRAVITY, Motor
from hoof_env.leg.profile import by_name

if TYPE_CHECKING:
    from hoof_env.dynamics.engine import TrunkEngine

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class Tally(NamedTuple):
    """What all bodies add up to, shape (n,) each.

    Attributes:
        centre, momentum: common centre of mass [m] and momentum [kg m/s], complex.
        spin: angular momentum about the centre [kg m^2/s].
        kinetic: kinetic energy, rotors included [J].
        potential: of weight and, on a suspended trunk, of spring and support [J].
    """

    centre: Complexes
    momentum: Complexes
    spin: Floats
    kinetic: Floats
    potential: Floats


def tally(
    engine: TrunkEngine,
    theta: Floats,
    theta_rate: Floats,
    phi: Floats,
    phi_rate: Floats,
    trunk: Mapping[str, Floats],
) -> Tally:
    """Add up.

    Args:
        engine: whose masses are meant.
        theta, theta_rate, phi, phi_rate: of crank and swing, shape (legs, n) [rad, rad/s].
        trunk: x, y, pitch, vx, vy, pitch_rate of the trunk's centre of mass, shape (n,) each [m, rad, s].
    """
    own = engine.trunk
    place: Complexes = trunk["x"] + 1j * trunk["y"]
    velocity: Complexes = trunk["vx"] + 1j * trunk["vy"]
    pitch_rate, turn = trunk["pitch_rate"], np.exp(1j * trunk["pitch"])
    moment, momentum = own.mass * place, own.mass * velocity  # first moment about the origin
    spin = own.pitch_inertia * pitch_rate + own.mass * _cross(place, velocity)  # about the origin
    kinetic = 0.5 * own.mass * np.abs(velocity) ** 2 + 0.5 * own.pitch_inertia * pitch_rate**2
    for i, limb in enumerate(engine.limbs):
        f = by_name(engine.profiles[i](theta[i])[0])
        a, b, c = f["crank_inertia"], f["coupling"], f["frame_inertia"]
        side = limb.geometry.travel
        if isinstance(limb.drive, Motor):
            rotor, gear = limb.drive.rotor_inertia, limb.drive.gear_ratio
            a, b, c = a + gear**2 * rotor, b - side * gear * rotor, c + rotor
        frame = turn * np.exp(1j * side * phi[i])
        frame_rate = pitch_rate + side * phi_rate[i]
        s = frame * (f["first_moment_x"] + 1j * f["first_moment_y"])
        slope = f["moment_slope_x"] + 1j * f["moment_slope_y"]
        own_rate = frame * slope * theta_rate[i] + 1j * s * frame_rate
        arm = turn * complex(*limb.hip)
        hip, hip_rate, mass = place + arm, velocity + 1j * arm * pitch_rate, limb.geometry.mass
        moment = moment + mass * hip + s
        momentum = momentum + mass * hip_rate + own_rate
        spin = (
            spin
            + _cross(hip, mass * hip_rate + own_rate)
            + _cross(s, hip_rate)
            + b * theta_rate[i]
            + c * frame_rate
        )
        kinetic = kinetic + 0.5 * mass * np.abs(hip_rate) ** 2 + (hip_rate.conj() * own_rate).real
        kinetic = kinetic + 0.5 * (
            a * theta_rate[i] ** 2 + 2 * b * theta_rate[i] * frame_rate + c * frame_rate**2
        )
    total = engine.total_mass
    centre = moment / total
    potential = GRAVITY * moment.imag
    if own.kind == "suspended":
        potential = potential + 0.5 * own.stiffness * (trunk["y"] - own.height) ** 2
        potential = potential - (1 - own.share) * total * GRAVITY * trunk["y"]
    return Tally(centre, momentum, spin - _cross(centre, momentum), kinetic, potential)


def _cross(a: Complexes, b: Complexes) -> Floats:
    return (np.conj(a) * b).imag
