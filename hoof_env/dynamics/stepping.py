"""One step in time by an explicit scheme; see `mechanics`.

In a scheme each stage takes the derivatives of the one before: stage j + 1 is taken at fraction a_j of the
step, from the step's start with the derivatives f_j of stage j,

    y_(j+1) = y_0 + a_j h f_j,    y(t + h) = y_0 + h sum of w_j f_j,

which needs one derivative in memory and one sum. Semi-implicit Euler has one stage and moves the coordinates
with the new rates. Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType

from hoof_env.dynamics.hoof import begin_springs, clear_springs, end_springs, move_springs, weigh_springs
from hoof_env.dynamics.layout import LegRows, TrunkRows
from hoof_env.dynamics.mechanics import MOVING
from hoof_env.dynamics.model import Model
from hoof_env.dynamics.parts import FIXED, FREE
from hoof_env.gait import INNER, SPEED
from hoof_env.simd import Lanes, Number, Whole, block_at, loop, when, where
from hoof_env.simd.layout import Layout
from hoof_env.simd.math import clip


def filter_accelerations(leg: LegRows, count: int, settings: Sequence[Number]) -> None:
    """Set the accelerations of the command filters: bounded, towards a bounded rate, towards the command."""
    for k in range(count):
        gain = settings[3 * k]
        rate_bound = settings[3 * k + 1]
        acc_bound = settings[3 * k + 2]
        # a cascade: the outer loop sets a rate, the inner loop, `INNER` times as fast, follows it
        wanted = clip(gain * (leg.command[k] - leg.state.gait[k]), rate_bound)
        leg.gait_acceleration[k] = clip(INNER * gain * (wanted - leg.state.gait_rate[k]), acc_bound)


def advance_rows(kind: int, to: Layout, start: Layout, factor: Number, slope: Layout) -> None:
    """Set to = start + factor slope for all rows that move."""
    # the last two rows, pitch and angular momentum, move only with a free trunk
    for k in range(MOVING if kind == FREE else MOVING - 2):
        to[k] = start[k] + factor * slope[k]


def begin_step(trunk: TrunkRows, legs: LegRows, leg_count: Whole, model: Model) -> None:
    """Set the first stage to the state itself, and the filters' accelerations for the whole step."""
    if model.kind != FIXED:
        for k in range(MOVING):
            trunk.stage[k] = trunk.state.moving[k]
        if model.averages:
            for k in range(MOVING):
                trunk.mean_rates[k] = 0.0
    for i in loop(leg_count):
        leg = block_at(legs, i)
        filter_accelerations(leg, model.form.gait, model.settings)
        leg.theta = leg.state.crank_angle
        leg.theta_rate = leg.state.crank_angle_rate
        begin_springs(leg, model.form.springs)
        if model.averages:
            leg.mean_theta_rate = 0.0
            leg.mean_theta_acceleration = 0.0
            clear_springs(leg, model.form.springs)


def weigh_stage(trunk: TrunkRows, legs: LegRows, leg_count: Whole, model: Model, weight: Number) -> None:
    """Add the derivatives at the present stage to their means, if the scheme averages: otherwise the step
    uses the last stage's derivatives."""
    if not model.averages:
        return

    @when(weight != 0.0)
    def _() -> None:
        if model.kind != FIXED:
            advance_rows(model.kind, trunk.mean_rates, trunk.mean_rates, weight, trunk.rates)
        for i in loop(leg_count):
            leg = block_at(legs, i)
            leg.mean_theta_rate = leg.mean_theta_rate + weight * leg.theta_rate
            leg.mean_theta_acceleration = leg.mean_theta_acceleration + weight * leg.theta_acceleration
            weigh_springs(leg, model.form.springs, weight)


def prescribed(leg: LegRows, elapsed: Number) -> tuple[Lanes, Lanes]:
    """Return the angle and rate of a prescribed crank `elapsed` [s] into the step, exactly as its filter
    moves."""
    value = leg.state.gait[SPEED]
    rate = leg.state.gait_rate[SPEED]
    acceleration = leg.gait_acceleration[SPEED]
    theta = leg.state.crank_angle + elapsed * (
        value + elapsed * (0.5 * rate + elapsed * (1 / 6) * acceleration)
    )
    return theta, value + elapsed * (rate + 0.5 * elapsed * acceleration)


def next_stage(trunk: TrunkRows, legs: LegRows, leg_count: Whole, model: Model, elapsed: Number) -> None:
    """Set the next stage: the state `elapsed` [s] after the step's start, by the present derivatives."""
    if model.kind != FIXED:
        advance_rows(model.kind, trunk.stage, trunk.state.moving, elapsed, trunk.rates)
    for i in loop(leg_count):
        leg = block_at(legs, i)
        is_motor = leg.settings.is_motor > 0.0
        # at each stage a prescribed crank is at its filter's angle, not at the scheme's
        angle, spin = prescribed(leg, elapsed)
        leg.theta = where(is_motor, leg.state.crank_angle + elapsed * leg.theta_rate, angle)
        leg.theta_rate = where(is_motor, leg.state.crank_angle_rate + elapsed * leg.theta_acceleration, spin)
        move_springs(leg, model.form.springs, elapsed)


def use_new_rates(trunk: TrunkRows, h: Number) -> None:
    """Set the rates of centre and pitch to the values at the step's end (semi-implicit Euler)."""
    rates = trunk.rates
    rates.velocity = rates.velocity + h * rates.force * trunk.settings.inverse_mass
    rates.pitch_rate = rates.pitch_rate + h * trunk.pitch_acceleration


def end_step(trunk: TrunkRows, legs: LegRows, leg_count: Whole, model: Model, h: Number) -> None:
    """Advance the state by a step; the filters advance exactly."""
    if model.kind != FIXED:
        if model.uses_new_rates:
            use_new_rates(trunk, h)
        rates = trunk.mean_rates if model.averages else trunk.rates
        advance_rows(model.kind, trunk.state.moving, trunk.state.moving, h, rates)
    trunk.state.time = trunk.state.time + h
    for i in loop(leg_count):
        leg = block_at(legs, i)
        is_motor = leg.settings.is_motor > 0.0
        angle, spin = prescribed(leg, h)
        rate = leg.theta_rate
        acceleration = leg.theta_acceleration
        if model.averages:
            rate = leg.mean_theta_rate
            acceleration = leg.mean_theta_acceleration
        omega = leg.state.crank_angle_rate + h * acceleration
        if model.uses_new_rates:  # semi-implicit Euler
            rate = omega
        leg.state.crank_angle = where(is_motor, leg.state.crank_angle + h * rate, angle)
        leg.state.crank_angle_rate = where(is_motor, omega, spin)
        end_springs(leg, model.form.springs, model.averages, h)
        # exact with every scheme: a filter's acceleration is constant during a step
        for k in range(model.form.gait):
            rate = leg.state.gait_rate[k]
            gait_acceleration = leg.gait_acceleration[k]
            leg.state.gait[k] = leg.state.gait[k] + h * (rate + 0.5 * h * gait_acceleration)
            leg.state.gait_rate[k] = rate + h * gait_acceleration


@dataclass(frozen=True)
class Scheme:
    """Coefficients of one explicit scheme, named as in the module's docstring."""

    order: int  # of convergence
    fractions: tuple[float, ...]  # a_j, one fewer than stages
    weights: tuple[float, ...]  # w_j
    uses_new_rates: bool = False  # coordinates move with the rates of the step's end

    @property
    def averages(self) -> bool:
        """True if a step uses the mean of several stages' rates, not the rates of the last stage."""
        return self.weights[-1] != 1.0


SCHEMES = MappingProxyType(
    {
        "semi_implicit_euler": Scheme(1, (), (1.0,), uses_new_rates=True),
        "midpoint": Scheme(2, (1 / 2,), (0.0, 1.0)),
        "rk3": Scheme(3, (1 / 3, 2 / 3), (1 / 4, 0.0, 3 / 4)),  # Heun
        "rk4": Scheme(4, (1 / 2, 1 / 2, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
    }
)
"""Schemes by name."""
