"""One step in time, by an explicit scheme; see `mechanics`.

In a scheme each stage takes the derivatives of the one before: stage j + 1 is taken at fraction a_j of the
step, from the step's start with the derivatives f_j of stage j,

    y_(j+1) = y_0 + a_j h f_j,    y(t + h) = y_0 + h sum of w_j f_j,

which needs one derivative in memory and one sum. Semi-implicit Euler has one stage and moves the coordinates
with the new rates. Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from hoof_env.dynamics.hoof import begin_springs, clear_springs, end_springs, move_springs, weigh_springs
from hoof_env.dynamics.mechanics import MOVING
from hoof_env.dynamics.parts import FIXED, FREE
from hoof_env.gait import INNER, SPEED
from hoof_env.simd import block_at, where
from hoof_env.simd.compile import inline_llvm
from hoof_env.simd.math import clip


@inline_llvm
def filter_accelerations(leg, count, settings):  # type: ignore[no-untyped-def]
    """Accelerations of the command filters: bounded, towards a bounded rate, towards the command."""
    for k in range(count):
        gain = settings[3 * k]
        rate_bound = settings[3 * k + 1]
        acc_bound = settings[3 * k + 2]
        wanted = clip(gain * (leg.command[k] - leg.state.gait[k]), rate_bound)
        leg.gait_acceleration[k] = clip(INNER * gain * (wanted - leg.state.gait_rate[k]), acc_bound)


@inline_llvm
def advance_rows(kind, to, start, factor, slope):  # type: ignore[no-untyped-def]
    """to = start + factor slope for all rows that move; two are of the pitch."""
    for k in range(MOVING - 2):
        to[k] = start[k] + factor * slope[k]
    if kind == FREE:
        for k in range(MOVING - 2, MOVING):
            to[k] = start[k] + factor * slope[k]


@inline_llvm
def begin_step(trunk, legs, leg_count, model):  # type: ignore[no-untyped-def]
    """The first stage is at the state itself."""
    if model.kind != FIXED:
        for k in range(MOVING):
            trunk.stage[k] = trunk.state.moving[k]
        if model.averages:
            for k in range(MOVING):
                trunk.mean_rates[k] = 0.0
    for i in range(leg_count):
        leg = block_at(legs, i)
        filter_accelerations(leg, model.form.gait, model.settings)
        leg.theta = leg.state.theta
        leg.theta_rate = leg.state.theta_rate
        begin_springs(leg, model.form.springs)
        if model.averages:
            leg.mean_theta_rate = 0.0
            leg.mean_theta_acceleration = 0.0
            clear_springs(leg, model.form.springs)


@inline_llvm
def weigh_stage(trunk, legs, leg_count, model, weight):  # type: ignore[no-untyped-def]
    """Add the derivatives at the present stage to their means; where the last stage's are those of the step
    there is nothing to do."""
    if not model.averages or weight == 0.0:
        return
    if model.kind != FIXED:
        advance_rows(model.kind, trunk.mean_rates, trunk.mean_rates, weight, trunk.rates)
    for i in range(leg_count):
        leg = block_at(legs, i)
        leg.mean_theta_rate = leg.mean_theta_rate + weight * leg.theta_rate
        leg.mean_theta_acceleration = leg.mean_theta_acceleration + weight * leg.theta_acceleration
        weigh_springs(leg, model.form.springs, weight)


@inline_llvm
def prescribed(leg, elapsed):  # type: ignore[no-untyped-def]
    """Angle and rate of a prescribed crank `elapsed` [s] into the step, exactly as the filter moves them."""
    value = leg.state.gait[SPEED]
    rate = leg.state.gait_rate[SPEED]
    bend = leg.gait_acceleration[SPEED]
    theta = leg.state.theta + elapsed * (value + elapsed * (0.5 * rate + elapsed * (1 / 6) * bend))
    return theta, value + elapsed * (rate + 0.5 * elapsed * bend)


@inline_llvm
def next_stage(trunk, legs, leg_count, model, elapsed):  # type: ignore[no-untyped-def]
    """Go `elapsed` [s] from the step's start with the derivatives of the present stage."""
    if model.kind != FIXED:
        advance_rows(model.kind, trunk.stage, trunk.state.moving, elapsed, trunk.rates)
    for i in range(leg_count):
        leg = block_at(legs, i)
        is_motor = leg.settings.is_motor > 0.0
        angle, spin = prescribed(leg, elapsed)
        leg.theta = where(is_motor, leg.state.theta + elapsed * leg.theta_rate, angle)
        leg.theta_rate = where(is_motor, leg.state.theta_rate + elapsed * leg.theta_acceleration, spin)
        move_springs(leg, model.form.springs, elapsed)


@inline_llvm
def use_new_rates(trunk, h):  # type: ignore[no-untyped-def]
    """Semi-implicit Euler: centre and pitch go with the velocities that the step ends with."""
    rates = trunk.rates
    rates.velocity = rates.velocity + h * rates.force * trunk.settings.inverse_mass
    rates.pitch_rate = rates.pitch_rate + h * trunk.pitch_acceleration


@inline_llvm
def end_step(trunk, legs, leg_count, model, h):  # type: ignore[no-untyped-def]
    """The state a step later; the filters advance exactly."""
    if model.kind != FIXED:
        if model.new_rates:
            use_new_rates(trunk, h)
        rates = trunk.mean_rates if model.averages else trunk.rates
        advance_rows(model.kind, trunk.state.moving, trunk.state.moving, h, rates)
    trunk.state.time = trunk.state.time + h
    for i in range(leg_count):
        leg = block_at(legs, i)
        is_motor = leg.settings.is_motor > 0.0
        angle, spin = prescribed(leg, h)
        rate = leg.theta_rate
        acceleration = leg.theta_acceleration
        if model.averages:
            rate = leg.mean_theta_rate
            acceleration = leg.mean_theta_acceleration
        omega = leg.state.theta_rate + h * acceleration
        if model.new_rates:
            rate = omega
        leg.state.theta = where(is_motor, leg.state.theta + h * rate, angle)
        leg.state.theta_rate = where(is_motor, omega, spin)
        end_springs(leg, model.form.springs, model.averages, h)
        for k in range(model.form.gait):
            rate = leg.state.gait_rate[k]
            bend = leg.gait_acceleration[k]
            leg.state.gait[k] = leg.state.gait[k] + h * (rate + 0.5 * h * bend)
            leg.state.gait_rate[k] = rate + h * bend


@dataclass(frozen=True)
class Scheme:
    """One scheme."""

    order: int  # of convergence
    fractions: tuple[float, ...]  # a_j, one less than stages
    weights: tuple[float, ...]  # w_j
    new_rates: bool = False  # coordinates move with the rates of the step's end

    @property
    def averages(self) -> bool:
        """Whether a step goes with the mean of several stages' rates, and not with those of the last."""
        return self.weights[-1] != 1.0


SCHEMES = MappingProxyType(
    {
        "semi_implicit_euler": Scheme(1, (), (1.0,), new_rates=True),
        "midpoint": Scheme(2, (1 / 2,), (0.0, 1.0)),
        "rk3": Scheme(3, (1 / 3, 2 / 3), (1 / 4, 0.0, 3 / 4)),  # Heun
        "rk4": Scheme(4, (1 / 2, 1 / 2, 1.0), (1 / 6, 1 / 3, 1 / 3, 1 / 6)),
    }
)
"""The schemes by name."""
