"""The rule of a stance, beside one that splits the load anew; stances, peaks and work of a run are what its
record says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as draws
from hypothesis import strategies as st

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.observables import StanceCounter
from hoof_env.dynamics.parts import Limb, Prescribed, Trunk
from tests.dynamics.scenes import LEG, RUN

TRUNKS = {
    "suspended": Trunk(height=LEG.hip_height),
    "fixed": Trunk(kind="fixed", height=LEG.hip_height - 0.05),
}


def engine(kind="suspended", legs=1, strides=True):
    made = TrunkEngine([Limb(LEG, drive=Prescribed())] * legs, TRUNKS[kind], strides=strides)
    made.reset(RUN, 0.3 + np.arange(legs))
    return made


def stances_of(loads, angles, threshold):
    """Steps of all stances: split where the load ends or after a revolution."""
    stances, opened = [], None
    for k, (normal, theta) in enumerate(zip(loads, angles, strict=True)):
        if normal <= threshold:
            opened = None
        elif opened is None or theta - opened >= 2 * np.pi:
            opened = theta
            stances.append([k])
        else:
            stances[-1].append(k)
    return stances


def peaks_and_rates(loads, angles, forces, threshold, h=1e-3):
    """Peak and loading rate of all stances; before the first step nothing is loaded."""
    rises = np.diff(loads, prepend=0.0) / h
    peaks, rates = [], []
    for steps in stances_of(loads, angles, threshold):
        peaks.append(max(forces[k] for k in steps))
        grows = [k for i, k in enumerate(steps) if all(forces[k] > forces[j] for j in steps[:i])]
        rates.append(max(0.0, *(rises[k] for k in grows)))
    return peaks, rates


def running_charge(forces):
    """What the running peak rises: above the highest force before, each at most twice the lowest since."""
    charge, before = 0.0, np.empty(0)
    for force in forces:
        charge += max(0.0, force - before.max(initial=0.0))
        before = np.append(np.minimum(before, 2 * force), force)
    return charge


def play(loads, angles, forces, threshold, h=1e-3):
    """The stance after all, and what peaks, running peak and steepest rises have grown by."""
    stance = StanceCounter(threshold)
    grown = [stance.add(*now, h) for now in zip(angles, loads, forces, strict=True)]
    return stance, *(sum(column) for column in zip(*grown, strict=True))


@given(st.lists(st.floats(0, 1e4), min_size=1, max_size=60), st.floats(0.01, 1.5),
       st.sampled_from([0.0, 40.0, 2000.0]))  # fmt: skip
@draws(max_examples=100, deadline=None)
def test_over_any_load_the_increases_add_up_to_the_peaks(loads, turn, threshold):
    angles, forces = turn * np.arange(len(loads)), 1.1 * np.array(loads)
    stance, grown, higher, steeper = play(loads, angles, forces, threshold)
    peaks, rates = peaks_and_rates(loads, angles, forces, threshold)
    assert stance.count == len(peaks)
    assert np.isclose(grown, sum(peaks), rtol=1e-9, atol=1e-9)
    assert np.isclose(higher, running_charge(forces), rtol=1e-9, atol=1e-9)
    assert np.isclose(steeper, sum(rates), rtol=1e-9, atol=1e-6)
    assert stance.is_open == (loads[-1] > threshold)
    assert stance.peak == (peaks[-1] if stance.is_open else 0.0)
    assert stance.steepest == pytest.approx(rates[-1] if stance.is_open else 0.0, rel=1e-12)


def test_a_hoof_that_never_lifts_has_a_peak_every_revolution():
    stance, grown, higher, _ = play(
        [690.0] * 1000, np.linspace(0.0, 6 * np.pi - 1e-6, 1000), [700.0] * 1000, 40.0
    )
    assert (stance.count, grown, higher) == (3, 3 * 700.0, 700.0)


def test_grazing_the_ground_between_two_pushes_ends_a_stance():
    """Or a policy could hold one peak for ever and push under it."""
    loads = [900.0, 30.0, 900.0, 900.0]
    stance, grown, higher, _ = play(loads, [0.0] * 4, loads, 40.0)
    assert (stance.count, grown, higher) == (2, 1800.0, 900.0 + 840.0)


def test_a_rise_under_the_peak_does_not_count_as_loading_rate():
    """A hoof that rocks under a peak that it has had is not charged for it again."""
    loads = [100.0, 500.0, 300.0, 480.0, 700.0]
    *_, steeper = play(loads, [0.0] * 5, [100.0, 500.0, 300.0, 480.0, 490.0], 40.0, 0.5)
    assert steeper == 800.0


@pytest.mark.parametrize("kind", TRUNKS)
@pytest.mark.parametrize("legs", [1, 2])
def test_strides_agree_with_the_record(kind, legs):
    made = engine(kind, legs)
    record = {name: rows[1:, ..., 0] for name, rows in made.run(steps=2400).items() if rows.ndim > 1}
    made, sums = engine(kind, legs), []
    for _ in range(120):
        made.advance(steps=20)
        sums.append(made.strides)
    total = {name: np.sum([s[name][:, 0] for s in sums], axis=0) for name in sums[0]}
    toe, heel = record["toe_normal"], record["heel_normal"]
    load, down = toe + heel, toe + heel > 0
    force = np.hypot(load, record["toe_friction"] + record["heel_friction"])
    assert np.max([s["highest_grf"][:, 0] for s in sums], axis=0) == pytest.approx(force.max(0), rel=1e-12)
    power = np.maximum(record["crank_power"], 0) + np.maximum(record["hip_power"], 0)
    assert total["positive_work"] == pytest.approx(1e-3 * power.sum(0), rel=1e-12)
    assert total["normal_impulse"] == pytest.approx(1e-3 * load.sum(0), rel=1e-12)
    assert total["loaded_time"] == pytest.approx(1e-3 * down.sum(0))
    slid = (toe * record["toe_slide"] + heel * record["heel_slide"]) / np.where(down, load, np.inf)
    assert total["backward_travel"] == pytest.approx(-1e-3 * slid.sum(0), rel=1e-10)
    for leg in range(legs):
        history = load[:, leg], record["crank_angle"][:, leg], force[:, leg]
        peaks, rates = peaks_and_rates(*history, 0.05 * made.weight / legs)
        assert total["stances"][leg] == len(peaks) > 2
        assert total["peak_grf_increase"][leg] == pytest.approx(sum(peaks), rel=1e-12)
        running = running_charge(force[:, leg])
        assert total["running_peak_increase"][leg] == pytest.approx(running, rel=1e-12)
        assert total["loading_rate_increase"][leg] == pytest.approx(sum(rates), rel=1e-12)


def test_a_stance_goes_on_from_a_state_that_was_put_back():
    made = engine()
    while not made.strides["stance_open"][0, 0]:
        made.advance(steps=5)
    made.advance(steps=20)
    state, before = made.get_state(), made.strides["stance_peak"]
    made.advance(steps=20)
    after = made.strides
    made.reset(RUN, 2.0)
    made.set_state(state)
    assert made.strides["stance_peak"] == before > 0
    made.advance(steps=20)
    for name, value in made.strides.items():
        np.testing.assert_array_equal(value, after[name], err_msg=name)


def test_a_push_behind_a_fall_by_half_is_charged_without_a_lift_too():
    """Or a policy could keep the hoof down and hammer."""
    loads = [1000.0, 600.0, 1000.0, 300.0, 1000.0]
    stance, grown, higher, _ = play(loads, [0.0] * 5, loads, 40.0)
    assert (stance.count, grown, higher) == (1, 1000.0, 1000.0 + 400.0)


def test_strides_change_nothing_else():
    engines = [engine(strides=on) for on in (False, True)]
    for made in engines:
        made.advance(steps=400)
    for name, value in engines[0].state.items():
        np.testing.assert_array_equal(value, engines[1].state[name], err_msg=name)
