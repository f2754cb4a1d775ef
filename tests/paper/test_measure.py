import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hoof_env.errors import ParameterError
from hoof_env.paper.measure import contact_intervals, integral, measure_stance, overlap


def test_contact_instants_are_interpolated_between_samples(cycle):
    stance = measure_stance(cycle(toe=(0.3034, 0.6071), heel=(0.2512, 0.5099), samples=100))
    assert stance.start == pytest.approx(0.2512, abs=1e-12)
    assert stance.end == pytest.approx(0.6071, abs=1e-12)
    assert stance.duty == pytest.approx(0.3559, abs=1e-12)
    assert stance.double == pytest.approx((0.3034, 0.5099), abs=1e-12)
    assert (stance.first_points, stance.last_points) == ({"heel"}, {"toe"})


def test_both_points_at_once_are_first_and_last_together(cycle):
    stance = measure_stance(cycle(toe=(0.3, 0.6), heel=(0.3, 0.6)))
    assert stance.first_points == stance.last_points == {"toe", "heel"}


def test_every_touch_of_a_bouncing_point_counts():
    t = np.linspace(0, 1, 1001)
    penetration = np.minimum(np.abs(t - 0.5) - 0.1, 0.2 - np.abs(t - 0.5))
    assert np.array(contact_intervals(t, penetration)) == pytest.approx(np.array([(0.3, 0.4), (0.6, 0.7)]))


def test_overlap_is_the_longest_common_interval():
    assert overlap(((0.1, 0.3), (0.5, 0.9)), ((0.2, 0.53),)) == (0.2, 0.3)
    assert overlap(((0.1, 0.2),), ((0.2, 0.6),)) is None
    assert overlap((), ((0.2, 0.6),)) is None


def test_a_half_sine_has_its_known_peak_and_means(cycle, bump):
    force = bump((0.3, 0.5, 1000))
    stance = measure_stance(
        cycle((0.3, 0.5), None, samples=10_000, toe_normal=force, toe_friction=lambda t: 0.4 * force(t))
    )
    assert stance.peak == pytest.approx(1000, rel=1e-6)
    assert stance.peak_time == pytest.approx(0.4)
    assert stance.peak_resultant == pytest.approx(1000 * np.sqrt(1.16), rel=1e-6)
    assert stance.mean == pytest.approx(1000 * 2 / np.pi * 0.2, rel=1e-5)
    assert stance.mean_stance == pytest.approx(1000 * 2 / np.pi, rel=1e-5)


def test_peak_is_of_the_sum_over_both_points_not_of_one(cycle, bump):
    stance = measure_stance(cycle(toe_normal=bump((0.3, 0.6, 100)), heel_normal=bump((0.25, 0.5, 100))))
    assert 150 < stance.peak < 200


def test_angles_are_read_at_the_interpolated_instants(cycle):
    stance = measure_stance(
        cycle((0.3034, 0.6071), (0.2512, 0.5099), samples=100, hoof_angle=lambda t: np.radians(100 * t - 30))
    )
    assert stance.angle_start_deg == pytest.approx(100 * 0.2512 - 30)
    assert stance.angle_end_deg == pytest.approx(100 * 0.6071 - 30)
    assert stance.angle_flat_deg == pytest.approx(100 * (0.3034 + 0.5099) / 2 - 30)
    assert stance.angle_variation_deg == pytest.approx(100 * (0.6071 - 0.2512))


def test_the_range_of_angles_is_not_their_net_change(cycle):
    stance = measure_stance(cycle((0.2, 0.6), None, hoof_angle=lambda t: np.radians(100 * np.abs(t - 0.3))))
    assert stance.angle_variation_deg == pytest.approx(20)  # from 10 to 30 deg
    assert stance.angle_range_deg == pytest.approx(30)  # down to 0 between
    assert stance.angle_flat_deg is None


@given(shift=st.floats(-0.15, 0.3), factor=st.floats(0.1, 100))
def test_time_shifts_times_alone_and_force_scales_forces_alone(cycle, bump, shift, factor):
    one = measure_stance(cycle(toe_normal=bump((0.3, 0.6, 100))))
    two = measure_stance(
        cycle((0.3 + shift, 0.6 + shift), (0.25 + shift, 0.5 + shift),
              toe_normal=bump((0.3 + shift, 0.6 + shift, 100 * factor)))
    )  # fmt: skip
    assert two.start - one.start == pytest.approx(shift, abs=1e-9)
    assert two.end - one.end == pytest.approx(shift, abs=1e-9)
    assert two.duty == pytest.approx(one.duty)
    assert two.peak == pytest.approx(factor * one.peak, rel=1e-4)
    assert two.mean == pytest.approx(factor * one.mean, rel=1e-4)


def test_integrals_of_a_line_are_exact_between_samples(cycle):
    trace = cycle(samples=10)
    assert integral(trace, 3 * trace["time"] + 1, 0.123, 0.789) == pytest.approx(
        1.5 * (0.789**2 - 0.123**2) + 0.666
    )


def test_a_cycle_without_contact_is_refused(cycle):
    with pytest.raises(ParameterError, match="got none"):
        measure_stance(cycle(None, None))


@pytest.mark.parametrize("toe", [(-0.1, 0.2), (0.8, 1.1)])
def test_a_stance_cut_in_two_by_the_cycle_is_refused(cycle, toe):
    with pytest.raises(ParameterError, match="in stance"):
        measure_stance(cycle(toe))
