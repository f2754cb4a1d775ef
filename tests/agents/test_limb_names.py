"""Names of legs: stored gaits land as a horse does, and forces do not depend on the names."""

import numpy as np
import pytest

from agents import gait_box
from agents.gait_rig import Rig
from agents.limb_names import LANDS, named, within_quarter
from hoof_env.tasks.horse_gaits import LEGS, horse_gaits, kinematic_speeds, reference_gaits


def other(gait):
    """The gait with the names of its fore legs swapped."""
    moved = gait.copy()
    moved[1] += 0.5
    return moved


@pytest.fixture(scope="module")
def played():
    """Figures of each kinematic gait and of the same by other names, from simulation."""
    rig = Rig(32, num_threads=1)
    found = {}
    for name, speed in kinematic_speeds().items():
        gait = horse_gaits()[name].to_array()
        found[name.removeprefix("kinematic-")] = rig.play(np.array([gait, other(gait)]), speed, 0, 16)
    return found


def landings(figures, row=0):
    """Landings after that of the left hind hoof [strides], by leg."""
    return {leg: float(figures[f"touch_{leg}"][row]) for leg in LEGS}


def test_the_walk_lands_in_lateral_sequence(played):
    touched = landings(played["walk"])
    touched["left_hind"] = 0.0
    assert sorted(touched, key=touched.get) == ["left_hind", "left_fore", "right_hind", "right_fore"]
    assert 0.2 < touched["left_fore"] < 0.3
    assert 0.2 < touched["right_fore"] - touched["right_hind"] < 0.3


def test_diagonal_legs_of_the_trot_land_together(played):
    touched = landings(played["trot"])
    assert touched["left_fore"] == pytest.approx(touched["right_hind"], abs=0.05)
    assert (touched["right_fore"] + 0.5) % 1 == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("kind", LANDS)
def test_other_names_swap_the_fore_legs_and_leave_forces_as_they_are(kind, played):
    """But for the noise of starts, which is drawn for each leg."""
    here, there = landings(played[kind]), landings(played[kind], 1)
    assert there["left_fore"] == pytest.approx(here["right_fore"], abs=0.01)
    assert there["right_fore"] == pytest.approx(here["left_fore"], abs=0.01)
    crossed = {"left_fore": "right_fore", "right_fore": "left_fore"}
    for leg in LEGS:
        ours, theirs = (played[kind][f"peak_{name}"] for name in (leg, crossed.get(leg, leg)))
        assert theirs[1] == pytest.approx(ours[0], rel=0.02)
    for figure in ("force", "transport", "duty_fore", "duty_hind", "reached", "lag"):
        assert played[kind][figure][1] == pytest.approx(played[kind][figure][0], rel=0.02, abs=0.005)


def test_gaits_of_searches_have_names_that_no_horse_has(played):
    """As docs/horse.md and docs/decisions.md say: a diagonal sequence, and a pace."""
    assert landings(played["walk"], 1)["left_fore"] == pytest.approx(0.71, abs=0.01)
    assert landings(played["trot"], 1)["left_fore"] == pytest.approx(0.04, abs=0.01)
    rig = Rig(8, num_threads=1)
    stored = [reference_gaits(np.array([1.8]))[0], horse_gaits()["walk"].to_array()]
    assert rig.play(np.array(stored), 1.8, 0, 4)["touch_left_fore"] == pytest.approx(0.6, abs=0.05)
    faster = [horse_gaits()[name].to_array() for name in ("fast", "trot-like")]
    touched = rig.play(np.array(faster), 3.6, 0, 4)["touch_left_fore"]
    assert (touched + 0.5) % 1 == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("kind", LANDS)
def test_a_found_gait_is_named_as_it_lands_on_a_horse(kind):
    name = f"kinematic-{kind}"
    gait, speed = horse_gaits()[name].to_array(), kinematic_speeds()[name]
    for found in (gait, other(gait)):
        np.testing.assert_allclose(named(kind, found, speed), gait, atol=1e-9)
    assert abs(gait[1]) <= gait_box.LEAD[1]


def test_a_search_goes_on_from_the_middle_of_its_box():
    leads = np.array([0.29023, -0.20977, -0.48511, 0.01489, 0.00398])
    gaits = np.repeat(horse_gaits()["walk"].to_array()[None], len(leads), axis=0)
    gaits[:, 1] = leads
    found = within_quarter(gaits)[:, 1]
    np.testing.assert_allclose(found, [-0.20977, -0.20977, 0.01489, 0.01489, 0.00398], atol=1e-12)
    assert found[-1] == leads[-1]
