"""Every claim of the paper on cycles made to fulfil it and on cycles made to break it."""

import re

import numpy as np
import pytest
import scipy.signal
from hypothesis import given
from hypothesis import strategies as st

from hoof_env.paper import shapes
from hoof_env.paper.measure import measure_stance

TURNING = {"hoof_angle": lambda t: np.radians(100 * (t - 0.4))}  # flat at 0.4 s
LEVEL = {"hoof_angle": 0.2}  # 11 deg throughout


@given(st.lists(st.integers(0, 50), min_size=1, max_size=60))
def test_peaks_agree_with_scipy(heights):
    force = np.array([0, *heights, 0], dtype=float)
    if force.max() == 0:
        return
    theirs, _ = scipy.signal.find_peaks(force, prominence=shapes.PROMINENCE * force.max(), plateau_size=1)
    assert force[shapes.find_peaks(force)].tolist() == force[theirs].tolist()


@pytest.mark.parametrize(
    ("parts", "holds"),
    [
        ({"toe": (0.3, 0.6), "heel": (0.25, 0.5), **TURNING}, True),
        ({"toe": (0.25, 0.6), "heel": (0.3, 0.5), **TURNING}, False),  # toe first
        ({"toe": (0.3, 0.5), "heel": (0.25, 0.6), **TURNING}, False),  # heel last
        ({"toe": (0.45, 0.6), "heel": (0.25, 0.42), **TURNING}, False),  # never both
        ({"toe": (0.3, 0.6), "heel": (0.25, 0.5), **LEVEL}, False),  # never flat
    ],
)
def test_walk_order(cycle, parts, holds):
    trace = cycle(**parts)
    assert shapes.walk_order(measure_stance(trace), trace).holds is holds


TWO_HALVES = {"heel_normal": [(0.25, 0.45, 100)], "toe_normal": [(0.4, 0.6, 80)]}


@pytest.mark.parametrize(
    ("loads", "holds"),
    [
        (TWO_HALVES, True),
        # nobody bears in the dip; one peak; two in one half; three
        ({"heel_normal": [(0.25, 0.45, 100)], "toe_normal": [(0.47, 0.6, 80)]}, False),
        ({"heel_normal": [(0.25, 0.5, 100)], "toe_normal": [(0.4, 0.6, 10)]}, False),
        ({"heel_normal": [(0.25, 0.33, 100), (0.32, 0.4, 100)], "toe_normal": [(0.3, 0.6, 5)]}, False),
        ({"heel_normal": [(0.25, 0.4, 100), (0.39, 0.5, 100)], "toe_normal": [(0.49, 0.6, 80)]}, False),
        # the point that bears in the dip bears alone
        ({"toe_normal": [(0.25, 0.45, 100), (0.4, 0.6, 80)]}, False),
    ],
)
def test_walk_peaks(cycle, bump, loads, holds):
    trace = cycle(**{name: bump(*bumps) for name, bumps in loads.items()})
    assert shapes.walk_peaks(measure_stance(trace), trace).holds is holds


@pytest.mark.parametrize(
    ("toe", "heel", "walk_toe", "holds"),
    [
        ((0.2, 0.5), (0.25, 0.4), (0.3, 0.55), True),  # heel 0.1 m up at toe-off, walking 0.05 m
        ((0.25, 0.5), (0.2, 0.4), (0.3, 0.55), False),  # heel first
        ((0.2, 0.4), (0.25, 0.5), (0.3, 0.55), False),  # heel last
        ((0.2, 0.5), None, (0.3, 0.55), False),  # no roll-over
        ((0.2, 0.5), (0.25, 0.4), (0.3, 0.75), False),  # the gap is larger in walking
    ],
)
def test_run_order(cycle, toe, heel, walk_toe, holds):
    run, walk = cycle(toe, heel), cycle(walk_toe, (0.25, 0.5))
    assert shapes.run_order(measure_stance(run), measure_stance(walk), run, walk).holds is holds


@pytest.mark.parametrize(
    ("elastic", "inelastic", "holds"),
    [
        ([(0.2, 0.6, 100)], [(0.2, 0.5, 150)], True),
        ([(0.2, 0.5, 100)], [(0.2, 0.6, 150)], True),  # apart, whichever comes first
        ([(0.2, 0.6, 100)], [(0.2, 0.602, 150)], False),  # 1 ms apart
        ([(0.2, 0.4, 100), (0.38, 0.6, 100)], [(0.2, 0.5, 150)], False),
        ([(0.2, 0.6, 100)], [(0.2, 0.4, 100), (0.38, 0.6, 100)], False),
    ],
)
def test_run_peaks(cycle, bump, elastic, inelastic, holds):
    traces = [cycle((0.2, 0.6), None, toe_normal=bump(*bumps)) for bumps in (elastic, inelastic)]
    assert shapes.run_peaks(*traces).holds is holds


def test_the_verdict_on_peaks_says_when_each_force_is_highest(cycle, bump):
    traces = [cycle((0.2, 0.6), None, toe_normal=bump(one)) for one in ((0.2, 0.6, 100), (0.2, 0.5, 150))]
    found = shapes.run_peaks(*traces).evidence
    times = [trace["time"][trace["normal"].argmax()] for trace in traces]
    assert times[0] > times[1]
    told = [float(number) for number in re.findall(r"at ([0-9.]+) s", found)]
    assert told == pytest.approx(times, abs=1e-4)
    assert f"{1e3 * (times[0] - times[1]):+.1f} ms later" in found


@pytest.mark.parametrize(("run_speed", "holds"), [(-3.0, True), (-0.5, False), (3.0, False)])
def test_run_step(cycle, run_speed, holds):
    def sweep(speed):
        return cycle((0.3, 0.6), None, toe_x=lambda t: speed * t + 0.2, heel_x=lambda t: speed * t)

    run, walk = sweep(run_speed), sweep(-1.0)
    assert shapes.run_step(measure_stance(run), measure_stance(walk), run, walk).holds is holds
    assert shapes.step_length(run, measure_stance(run)) == pytest.approx((-0.3 * run_speed, abs(run_speed)))


def friction(first, second):
    """A force along x: `first` before the middle of stance at 0.45 s, `second` after it."""
    return lambda t: np.where((t > 0.3) & (t < 0.6), np.where(t < 0.45, first, second), 0.0)


@pytest.mark.parametrize(
    ("first", "second", "braking", "hoof_on_ground", "used"),
    [
        (-10, -20, True, False, shapes.BRAKING),
        (10, 20, False, True, shapes.HOOF_ON_GROUND),
        (-10, 20, False, False, shapes.HOOF_ON_GROUND),
        (10, -20, False, False, shapes.BRAKING),
    ],
)
def test_walk_direction_has_a_verdict_per_reading_and_the_leg_chooses(
    cycle, first, second, braking, hoof_on_ground, used
):
    trace = cycle((0.3, 0.6), None, friction=friction(first, second))
    walk = measure_stance(trace)
    verdict = shapes.walk_direction(walk, trace, shapes.walk_brakes(walk, trace))
    assert verdict.readings == {shapes.BRAKING: braking, shapes.HOOF_ON_GROUND: hoof_on_ground}
    assert verdict.used == used
    assert verdict.holds is verdict.readings[used]
    for reading, holds in verdict.readings.items():
        assert f"'{reading}' {'holds' if holds else 'does not hold'}" in verdict.evidence
    assert f"used is '{used}'" in verdict.evidence
    impulses = [horizontal for horizontal, _ in shapes.half_impulses(trace, measure_stance(trace))]
    assert impulses == pytest.approx([0.15 * first, 0.15 * second], rel=0.02)


@pytest.mark.parametrize(
    ("first", "second", "holds"),
    [(-10, 20, True), (10, 20, True), (20, 10, False), (-20, -10, False), (10, -20, False)],
)
def test_run_direction(cycle, bump, first, second, holds):
    trace = cycle((0.3, 0.6), None, toe_normal=bump((0.3, 0.6, 100)), friction=friction(first, second))
    assert shapes.run_direction(measure_stance(trace), trace).holds is holds


def test_the_median_velocity_of_the_sole_is_weighted_by_load(cycle):
    def trace(toe_load, heel_load):
        return cycle(toe_slide=-2.0, heel_slide=1.0, toe_normal=toe_load, heel_normal=heel_load)

    assert shapes.sole_velocity(trace(60.0, 40.0)) == -2.0
    assert shapes.sole_velocity(trace(40.0, 60.0)) == 1.0
    assert np.isnan(shapes.sole_velocity(trace(0.0, 0.0)))


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(0.1, 100)), min_size=1, max_size=30))
def test_under_coulomb_friction_the_median_gives_the_direction_of_the_impulse(cycle, samples):
    velocity, load = np.array(samples).T
    trace = cycle(samples=len(samples) - 1) if len(samples) > 1 else cycle(samples=1)[:1]
    trace["toe_slide"], trace["toe_normal"], trace["heel_normal"] = velocity, load, 0.0
    impulse = -np.sum(np.sign(velocity) * load)
    median = shapes.sole_velocity(trace)
    if abs(impulse) > 1e-9 and not np.any(velocity == 0):
        assert np.sign(median) == -np.sign(impulse)


def test_the_reading_of_the_leg_counts_also_where_a_solver_sees_the_other_one(cycle):
    trace = cycle((0.3, 0.6), None, friction=friction(-10, -20))
    verdict = shapes.walk_direction(measure_stance(trace), trace, False)
    assert (verdict.holds, verdict.readings[shapes.BRAKING]) == (False, True)


@pytest.mark.parametrize(
    ("medians", "holds"),
    [
        ((-0.3, -0.4, -5.0), True),
        ((-0.29, -0.4, -5.0), False),
        ((-0.3, -0.29, -5.0), False),
        ((-0.3, -0.4, 5.0), False),
        ((float("nan"), -0.4, -0.5), False),
    ],
)
def test_a_gait_walks_if_its_sole_goes_back_fast_enough_at_every_level(medians, holds):
    verdict = shapes.gait_walks(dict(zip(shapes.DEPTHS, medians, strict=True)))
    assert verdict.holds is holds
    for words in (f"{medians[0]:+.2f} m/s,", f"{medians[1]:+.2f} m/s 5 cm", f"{medians[2]:+.2f} m/s 10 cm"):
        assert words in verdict.evidence
    assert "-0.3 m/s or less" in verdict.evidence
