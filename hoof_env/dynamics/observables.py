"""Measured quantities of the motion: drive torques and powers, energy account, stances; see `mechanics`. At
the end the rule of a stance for solvers without kernels.

A stance opens when the normal force on the hoof rises above a threshold, as on a force plate. It closes when
the force falls below it (lift-off), or after one crank revolution, whichever comes first, so that a hoof that
never lifts has a peak every revolution. While it is open its peak is the highest resultant ground reaction
force of any step; its increases add up to that peak. Its loading rate is the steepest rise of the normal
force from one step to the next among the steps that raise the peak.

The running peak is the highest force so far, but at most twice the present one: a force that rises, falls by
more than half and rises again is charged again, whether the hoof lifts or not, and a stance with one peak is
charged just that.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hoof_env.dynamics.layout import (
    Account,
    Contact,
    EngineLayout,
    LegReport,
    LegRows,
    PointReport,
    TrunkReport,
    TrunkRows,
)
from hoof_env.dynamics.mechanics import add
from hoof_env.dynamics.model import Model
from hoof_env.errors import Floats
from hoof_env.simd import (
    Lanes,
    Number,
    Plane,
    Whole,
    absolute,
    block_at,
    dot,
    loop,
    maximum,
    minimum,
    perpendicular,
    sqrt,
    where,
)

REVOLUTION = 2 * math.pi
"""One revolution of the crank [rad]."""


def find_drives(trunk: TrunkRows, leg: LegRows) -> None:
    """Compute torques and powers of crank and swing from the accelerations (E2 to E4)."""
    w = leg.theta_rate
    acc = leg.theta_acceleration
    k = leg.beta_by_theta
    sway = leg.swing_rate
    frame = leg.frame_inertia
    pitch_acc = trunk.pitch_acceleration
    coupling = leg.crank_coupling - k * frame  # b
    turning = pitch_acc + k * acc  # beta_tt of (E1) without a_phi, which is in the rest moments
    lift = trunk.acceleration + pitch_acc * perpendicular(leg.hip)
    by_frame = (  # (E3) - Q_beta
        coupling * acc
        + frame * turning
        + leg.rest_moment_beta
        + dot(lift, perpendicular(leg.first_moment))
        - leg.ground_moment_beta
    )
    needed = (  # (E2) - Q_theta
        (leg.functions.crank_inertia + leg.settings.rotor_crank) * acc
        + coupling * turning
        + leg.rest_moment_theta
        + dot(lift, leg.moment_by_theta)
        - leg.ground_moment_theta
    )
    is_motor = leg.settings.is_motor > 0.0
    # (E4) if prescribed; the servo's torque otherwise
    torque = where(is_motor, leg.crank_torque, needed)
    leg.frame_torque = by_frame
    leg.crank_torque = torque
    leg.crank_power = torque * w
    # of a motor-driven leg the gear transmits the part k w, which is in the crank's power
    leg.swing_power = by_frame * where(is_motor, sway, k * w + sway)


def keep_account(
    trunk: TrunkRows, legs: LegRows, leg_count: Whole, model: Model, account: Account, weight: Number
) -> None:
    """Add the present stage's powers and forces, times `weight` [s], to an `Account`."""
    velocity = trunk.velocity
    lanes_are_legs = model.lanes_are_legs
    drag = trunk.settings.drag * (velocity.real * velocity.real)
    damper = trunk.settings.damper * (velocity.imag * velocity.imag)
    account.drag_loss = account.drag_loss + weight * drag
    account.damper_loss = account.damper_loss + weight * damper
    for i in loop(leg_count):
        leg = block_at(legs, i)
        find_drives(trunk, leg)
        toe = leg.toe.penetration_rate
        heel = leg.heel.penetration_rate
        stored = leg.toe.spring_force * toe + leg.heel.spring_force * heel
        spent = leg.toe.normal * toe + leg.heel.normal * heel - stored
        rubbed = leg.toe.friction * leg.toe.slide + leg.heel.friction * leg.heel.slide
        account.crank_work = add(account.crank_work, weight * leg.crank_power, lanes_are_legs)
        account.swing_work = add(account.swing_work, weight * leg.swing_power, lanes_are_legs)
        account.ground_stored = add(account.ground_stored, weight * stored, lanes_are_legs)
        account.ground_loss = add(account.ground_loss, weight * spent, lanes_are_legs)
        account.friction_loss = add(account.friction_loss, -weight * rubbed, lanes_are_legs)
        account.impulse = add(account.impulse, weight * leg.ground_force, lanes_are_legs)
        if model.form.springs:
            elastic = 0.0 * stored
            lost = 0.0 * stored
            for k in range(model.form.springs):
                stiffness = leg.settings.hoof_stiffness[k]
                damping = leg.settings.hoof_damping[k]
                toe = leg.toe.deflection_rate[k]
                heel = leg.heel.deflection_rate[k]
                elastic = elastic + stiffness * (leg.toe.deflection[k] * toe + leg.heel.deflection[k] * heel)
                lost = lost + damping * (toe * toe + heel * heel)
            # one sum per leg, so that the order of additions is the same where lanes are legs
            account.hoof[0] = add(account.hoof[0], weight * elastic, lanes_are_legs)
            account.hoof[1] = add(account.hoof[1], weight * lost, lanes_are_legs)


def report_trunk(trunk: TrunkRows, report: TrunkReport) -> None:
    """Fill a `TrunkReport`."""
    report.place = trunk.place
    report.velocity = trunk.velocity
    report.acceleration = trunk.acceleration
    report.pitch_rate = trunk.rates.pitch_rate
    report.pitch_acceleration = trunk.pitch_acceleration


def report_leg(trunk: TrunkRows, leg: LegRows, report: LegReport, form: EngineLayout) -> None:
    """Fill a `LegReport`. The rows of a heel that is not there stay 0."""
    find_drives(trunk, leg)
    side = leg.settings.side
    k = leg.beta_by_theta
    w = leg.theta_rate
    acc = leg.theta_acceleration
    report.crank_angle_acceleration = acc
    report.swing_angle = leg.phi
    report.swing_angle_rate = side * (k * w + leg.swing_rate)
    report.swing_angle_acceleration = side * (k * acc + leg.swing_acceleration)
    report.crank_torque = leg.crank_torque
    report.hip_torque = side * leg.frame_torque
    report.crank_power = leg.crank_power
    report.hip_power = leg.swing_power
    hip = trunk.place + leg.hip
    report_point(leg.toe, hip + leg.turn * leg.functions.toe, report.toe)
    if form.feet == 2:
        report_point(leg.heel, hip + leg.turn * leg.functions.heel, report.heel)


def report_point(point: Contact, place: Plane, report: PointReport) -> None:
    """Fill a `PointReport`."""
    report.x = place.real
    report.y = place.imag
    report.slide = point.slide
    report.normal = point.normal
    report.friction = point.friction


def count_stride(trunk: TrunkRows, leg: LegRows, form: EngineLayout, h: Lanes | float) -> None:
    """Update the open stance and the sums with a whole step of `h` [s] that ends here."""
    find_drives(trunk, leg)
    push = leg.ground_force
    load = leg.toe.normal + leg.heel.normal
    force = sqrt(dot(push, push))
    loaded = load > leg.settings.lift_off
    was_open = (leg.strides.stance_open > 0.0) & (
        leg.state.crank_angle - leg.strides.stance_began < REVOLUTION
    )
    goes_on = loaded & was_open
    # 1 in the first step of a stance; a stance longer than a revolution is followed by another
    begins = where(loaded, 1.0, 0.0) - where(goes_on, 1.0, 0.0)
    peak = where(goes_on, leg.strides.stance_peak, 0.0)
    higher = where(loaded, maximum(peak, force), 0.0)
    leg.strides.stance_open = where(loaded, 1.0, 0.0)
    leg.strides.stance_began = where(begins > 0.0, leg.state.crank_angle, leg.strides.stance_began)
    leg.strides.stance_peak = higher
    rise = where(higher > peak, (load - leg.strides.normal_force) * (1.0 / h), 0.0)
    steepest = where(goes_on, leg.strides.steepest_rise, 0.0)
    steeper = where(loaded, maximum(steepest, rise), 0.0)
    leg.strides.steepest_rise = steeper
    leg.strides.normal_force = load
    leg.sums.loading_rate_increase = leg.sums.loading_rate_increase + (steeper - steepest)
    leg.sums.stances = leg.sums.stances + begins
    leg.sums.peak_grf_increase = leg.sums.peak_grf_increase + (higher - peak)
    running = minimum(leg.strides.running_peak, 2.0 * force)
    leg.strides.running_peak = maximum(running, force)
    leg.sums.running_peak_increase = leg.sums.running_peak_increase + maximum(force - running, 0.0)
    leg.sums.highest_grf = maximum(leg.sums.highest_grf, force)
    work = maximum(leg.crank_power, 0.0) + maximum(leg.swing_power, 0.0)
    leg.sums.positive_work = leg.sums.positive_work + h * work
    leg.sums.normal_impulse = leg.sums.normal_impulse + h * load
    down = load > 0.0
    leg.sums.loaded_time = leg.sums.loaded_time + where(down, h, 0.0)
    per_load = h / where(down, load, 1.0)  # 1 avoids a division by 0; the result is not used there
    slid = leg.toe.normal * leg.toe.slide + leg.heel.normal * leg.heel.slide
    leg.sums.backward_travel = leg.sums.backward_travel - where(down, slid * per_load, 0.0)
    rubbed = leg.toe.normal * absolute(leg.toe.slide)
    rubbed = rubbed + leg.heel.normal * absolute(leg.heel.slide)
    # in stance alone: a sole without mass flies back as it is unloaded, which is not slip of the hoof
    leg.sums.slip = leg.sums.slip + where(loaded, rubbed * per_load, 0.0)
    if form.has_limits:
        leg.sums.braking = leg.sums.braking + h * maximum(-push.real, 0.0)
        leg.sums.propulsion = leg.sums.propulsion + h * maximum(push.real, 0.0)


@dataclass
class StanceCounter:
    """Stances and running peak of one leg so far, by the rule of `count_stride`."""

    threshold: float  # normal force that tells stance from swing [N]
    is_open: bool = False  # true if the hoof is in stance
    began: float = 0.0  # crank angle where the last stance opened [rad]
    peak: float = 0.0  # highest resultant force of the open stance [N], 0 between stances
    steepest: float = 0.0  # rise of the normal force while that peak grew [N/s]
    normal_force: float = 0.0  # of the last substep [N]
    running: float = 0.0  # running peak [N]
    count: int = 0  # number of stances that have opened

    def add(self, theta: float, normal: float, force: float, h: float = math.inf) -> tuple[float, ...]:
        """Take the next substep.

        Args:
            theta: crank angle [rad].
            normal, force: normal and resultant force on the hoof [N].
            h: length of the substep [s].

        Returns:
            Increases of the stance's peak [N], of the running peak [N] and of the steepest rise [N/s].
        """
        loaded = normal > self.threshold
        goes_on = loaded and self.is_open and theta - self.began < REVOLUTION
        before, steepest = (self.peak, self.steepest) if goes_on else (0.0, 0.0)
        if loaded and not goes_on:
            self.began = theta
            self.count = self.count + 1
        self.is_open = loaded
        self.peak = max(before, force) if loaded else 0.0
        rise = (normal - self.normal_force) * (1.0 / h) if self.peak > before else 0.0
        self.steepest = max(steepest, rise) if loaded else 0.0
        self.normal_force = normal
        running = min(self.running, 2 * force)
        self.running = max(running, force)
        return self.peak - before, max(force - running, 0.0), self.steepest - steepest


def stance_figures(sums: Mapping[str, Floats], seconds: ArrayLike, turns: ArrayLike) -> dict[str, Floats]:
    """Return figures of limbs from sums of `TrunkEngine.strides` over some time, each of shape (legs,
    num_envs).

    Args:
        sums: sums by name, added up over the calls of `advance`.
        seconds: duration of these calls [s].
        turns: revolutions of the cranks meanwhile [-], shape as of the sums.

    Returns:
        "peak", mean of the stances' highest resultant forces, and "mean", of the normal force while the hoof
        bears load [N]; "duty", part of the time that it does [-]; "stances_per_turn" [-]; "slip" of a
        stance [m]; and of an engine with limits "braking" and "propulsion", mean horizontal forces backward
        and forward while the hoof bears load [N]. NaN where there was no stance.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        # NaN instead of 0: 0 / 0
        stances = sums["stances"] / (sums["stances"] > 0)
        loaded = sums["loaded_time"]
        figures = {
            "peak": sums["peak_grf_increase"] / stances,
            "mean": sums["normal_impulse"] / loaded,
            "duty": loaded / np.asarray(seconds),
            "stances_per_turn": sums["stances"] / np.asarray(turns),
            "slip": sums["slip"] / stances,
        }
        if "braking" in sums:
            figures |= {name: sums[name] / loaded for name in ("braking", "propulsion")}
    return figures
