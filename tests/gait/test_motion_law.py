"""Commands become motion that a machine could make, and every derivative of it is a derivative."""

from copy import deepcopy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.gait import (
    LIMITS,
    FilterSettings,
    Motion,
    advance_motion,
    command_filters,
    evaluate_motion,
    steady_filters,
)

LOW, HIGH = np.array(list(LIMITS.values())).T
SETTINGS = FilterSettings()
TABLE = SETTINGS.to_array()

commands = st.tuples(
    *(st.floats(low, high) | st.sampled_from([low, high]) for low, high in LIMITS.values())
).map(np.array)
sequences = st.lists(st.tuples(commands, st.integers(1, 60)), min_size=1, max_size=8)

OFFSETS = np.arange(-4, 5)  # central differences of eighth order
FIRST = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840
SECOND = np.array([-9, 128, -1008, 8064, -14350, 8064, -1008, 128, -9]) / 5040


def start(gait, theta=0.0):
    return Motion(theta), steady_filters(gait)


def of(filters, name):
    """What all filters have by one name, shape (4,)."""
    return np.array([getattr(one, name) for one in filters])


def play(sequence, h, gait, theta=0.0):
    """Every state (motion, filters) that a sequence of (command, substeps) leads through."""
    motion, filters = start(gait, theta)
    for command, substeps in sequence:
        for _ in range(substeps):
            command_filters(filters, command.tolist(), TABLE.tolist())
            advance_motion(motion, filters, h)
            evaluate_motion(motion, filters)
            yield motion, filters


@given(sequence=sequences, gait=commands, h=st.sampled_from([1e-4, 1e-3, 4e-3, SETTINGS.longest_step]))
@settings(deadline=None, max_examples=80)
def test_rates_and_accelerations_are_bounded_and_values_stay_in_range(sequence, gait, h):
    for _, filters in play(sequence, h, gait):
        assert (np.abs(of(filters, "rate")) <= TABLE[:, 1] * (1 + 1e-12)).all()
        assert (np.abs(of(filters, "acc")) <= TABLE[:, 2]).all()
        assert (of(filters, "value") >= LOW - 1e-9).all()
        assert (of(filters, "value") <= HIGH + 1e-9).all()


@given(gait=commands, command=commands, h=st.sampled_from([1e-3, SETTINGS.longest_step]))
@settings(deadline=None, max_examples=30)
def test_a_command_is_reached_without_overshoot(gait, command, h):
    way = np.sign(command - gait)
    before = gait
    for _, filters in play([(command, round(4.0 / h))], h, gait):
        now = of(filters, "value")
        assert (way * (now - before) >= -1e-12).all()  # never back
        assert (way * (command - now) >= -1e-9).all()  # never beyond
        before = now
    assert before == pytest.approx(command, abs=1e-9)
    assert of(filters, "rate") == pytest.approx(np.zeros(4), abs=1e-8)


@given(sequence=sequences, gait=commands, theta=st.floats(-10, 10))
@settings(deadline=None, max_examples=60)
def test_derivatives_follow_the_motion_while_commands_change(sequence, gait, theta):
    motion, filters = list(play(sequence, 1e-3, gait, theta))[-1]
    path = []  # the accelerations of the filters are constant over a substep: go on and back with them
    for k in OFFSETS:
        there, moved = deepcopy((motion, filters))
        advance_motion(there, moved, 1e-3 * k)
        evaluate_motion(there, moved)
        path.append((there.theta, there.phi))
    evaluate_motion(motion, filters)
    rates, accelerations = FIRST @ path / 1e-3, SECOND @ path / 1e-6
    assert (motion.theta_rate, motion.phi_rate) == pytest.approx(rates, rel=1e-8, abs=1e-8)
    assert (motion.theta_acc, motion.phi_acc) == pytest.approx(accelerations, rel=1e-6, abs=1e-5)


@given(sequence=sequences, gait=commands, h=st.floats(1e-4, 0.05))
@settings(deadline=None, max_examples=40)
def test_a_step_is_exact(sequence, gait, h):
    """Under constant filter accelerations a value is quadratic in time: Simpson's rule sums it exactly."""
    motion, filters = list(play(sequence, 1e-3, gait))[-1]
    values, angle = [], float(motion.theta)
    for part in (0.0, 0.5, 1.0):
        there, moved = deepcopy((motion, filters))
        advance_motion(there, moved, h * part)
        start_value, rate, acc = (of(filters, name) for name in ("value", "rate", "acc"))
        assert of(moved, "value") == pytest.approx(start_value + h * part * rate + (h * part) ** 2 / 2 * acc)
        assert of(moved, "rate") == pytest.approx(rate + h * part * acc)
        values.append(moved[0].value)
    advance_motion(motion, filters, h)
    simpson = h * (values[0] + 4 * values[1] + values[2]) / 6
    assert motion.theta - angle == pytest.approx(simpson, abs=1e-12)


@given(sequence=sequences, gait=commands)
@settings(deadline=None, max_examples=20)
def test_the_recorded_rates_add_up_to_the_recorded_motion(sequence, gait):
    """Trapezoidal sums over the whole history, command changes included; the difference is of order h^2."""
    h = 5e-5  # with 1e-4 eight changes of the command can leave a little more than the bound
    sequence = [(command, 2 * substeps) for command, substeps in sequence]
    rows = [(m.theta, m.theta_rate, m.phi, m.phi_rate) for m, _ in play(sequence, h, gait)]
    theta, theta_rate, phi, phi_rate = np.transpose(rows)
    for value, rate in ((theta, theta_rate), (phi, phi_rate)):
        assert value[-1] - value[0] == pytest.approx(h * (rate[1:] + rate[:-1]).sum() / 2, abs=2e-7)


def test_a_kept_command_keeps_every_bit():
    gait = np.array([2 * np.pi, 0.3434509445955683, 0.10151325708757945, -0.15539461237071284])
    for _, filters in play([(gait, 3000)], 1e-3, gait):
        assert (of(filters, "value") == gait).all()
        assert (of(filters, "rate") == 0).all()


def test_without_amplitude_the_frame_stands_still_and_the_crank_angle_is_not_wrapped():
    gait = np.array([4 * np.pi, 0.7, 0.0, 0.0])
    for motion, _ in play([(gait, 10000)], 1e-3, gait):
        assert (motion.phi, motion.phi_rate, motion.phi_acc) == (0.7, 0.0, 0.0)
    assert motion.theta == pytest.approx(40 * np.pi, rel=1e-12)
