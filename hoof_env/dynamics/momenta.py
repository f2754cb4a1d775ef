"""From the velocities of a start to the momenta that the engine integrates."""

from __future__ import annotations

from hoof_env.dynamics.layout import LegRows, TrunkRows
from hoof_env.dynamics.mechanics import gather_legs
from hoof_env.dynamics.model import Model
from hoof_env.dynamics.parts import FREE, RAIL
from hoof_env.simd import Truth, Whole, cross, dot, full_like, perpendicular, vector, where


def velocities_to_momenta(
    trunk: TrunkRows, legs: LegRows, leg_count: Whole, model: Model, starts: Truth
) -> None:
    """Compute centre of mass, momentum and spin of all bodies at a start, as `mechanics.move_trunk` inverts
    it (E7).

    Their rows hold the trunk's place, velocity and pitch rate before, and keep them in lanes not in `starts`.
    """
    gather_legs(trunk, legs, leg_count, model)
    place = trunk.state.moving.centre
    velocity = trunk.state.moving.momentum
    rate = trunk.state.moving.spin
    moment = trunk.first_moment
    drift = trunk.relative_momentum
    per_mass = trunk.settings.inverse_mass
    centre = place + per_mass * moment
    momentum = trunk.settings.total_mass * velocity + drift
    spin = full_like(trunk, 0.0)
    if model.kind == RAIL:
        centre = vector(centre.real, place.imag)
        momentum = vector(momentum.real, 0.0)
    if model.kind == FREE:
        momentum = momentum + rate * perpendicular(moment)
        about = trunk.composite_inertia - dot(moment, moment) * per_mass
        spin = rate * about + trunk.relative_angular_momentum - cross(moment, drift) * per_mass
    trunk.state.moving.centre = where(starts, centre, place)
    trunk.state.moving.momentum = where(starts, momentum, velocity)
    trunk.state.moving.spin = where(starts, spin, rate)
