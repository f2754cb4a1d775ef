"""The rule of a stance, beside one that splits the load anew."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hoof_env.dynamics.observables import StanceCounter


def peaks_of(loads, angles, forces, threshold):
    """Peaks of all stances: split where the load ends or after a turn."""
    peaks, opened = [], None
    for normal, theta, grf in zip(loads, angles, forces, strict=True):
        if normal <= threshold:
            opened = None
        elif opened is None or theta - opened >= 2 * np.pi:
            opened = theta
            peaks.append(grf)
        else:
            peaks[-1] = max(peaks[-1], grf)
    return peaks


def play(loads, angles, forces, threshold):
    """The stance after all, and what its running peaks have grown by."""
    stance = StanceCounter(threshold)
    return stance, sum(stance.add(*now) for now in zip(angles, loads, forces, strict=True))


@given(st.lists(st.floats(0, 1e4), min_size=1, max_size=60), st.floats(0.01, 1.5),
       st.sampled_from([0.0, 40.0, 2000.0]))  # fmt: skip
@settings(max_examples=100, deadline=None)
def test_over_any_load_the_increases_add_up_to_the_peaks(loads, turn, threshold):
    angles, forces = turn * np.arange(len(loads)), 1.1 * np.array(loads)
    stance, grown = play(loads, angles, forces, threshold)
    peaks = peaks_of(loads, angles, forces, threshold)
    assert stance.count == len(peaks)
    assert np.isclose(grown, sum(peaks), rtol=1e-9, atol=1e-9)
    assert stance.is_open == (loads[-1] > threshold)
    assert stance.peak == (peaks[-1] if stance.is_open else 0.0)


def test_a_hoof_that_never_lifts_pays_every_revolution():
    stance, grown = play([690.0] * 1000, np.linspace(0.0, 6 * np.pi - 1e-6, 1000), [700.0] * 1000, 40.0)
    assert (stance.count, grown) == (3, 3 * 700.0)


def test_grazing_the_ground_between_two_pushes_ends_a_stance():
    """Or a policy could hold one peak for ever and push under it."""
    loads = [900.0, 30.0, 900.0, 900.0]
    stance, grown = play(loads, [0.0] * 4, loads, 40.0)
    assert (stance.count, grown) == (2, 1800.0)
