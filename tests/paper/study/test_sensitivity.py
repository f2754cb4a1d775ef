import copy
import json
import re

import numpy as np
import pytest

from hoof_env.paper.measure import measure_stance
from hoof_env.paper.published import load_published
from hoof_env.paper.reproduce import GAITS
from hoof_env.paper.study.by_construction import LAWS, confirm
from hoof_env.paper.study.replay import exact_cycle, ground_of, replay
from hoof_env.paper.study.sensitivity import PARAMETERS, examine_sensitivity


@pytest.fixture(scope="module")
def section(few_points):
    return examine_sensitivity(None, lambda line: None)


def test_what_follows_from_the_construction_holds(section):
    assert len(section.data["laws"]) == len(LAWS)
    for law in section.data["laws"]:
        assert law["holds"], law
        assert law["members"]


@pytest.mark.parametrize("number", range(len(LAWS)))
def test_a_law_that_is_broken_is_reported(section, number):
    law, rows = LAWS[number], copy.deepcopy(section.data["rows"])
    row = section.data["laws"][number]["members"][-1]
    rows[row][law.parameters[-1]]["elasticity"] += 1e-4
    assert not confirm(rows)[number]["holds"]


def test_every_row_and_resultant_answers_to_every_parameter(section):
    published = {row.id for row in load_published().rows}
    rows = section.data["rows"]
    assert published <= rows.keys()
    assert {row.removesuffix(".resultant") for row in rows} == published
    assert all(set(PARAMETERS) < set(entry) for entry in rows.values())


@pytest.mark.parametrize("gait", GAITS)
def test_elastic_peaks_answer_to_the_exponent_as_the_law_says(section, gait):
    """d log(sum K d^n) / d log n = n sum(d^n ln d) / sum(d^n) at the peak."""
    trace = replay(exact_cycle(gait, None), ground_of(None))
    top = trace[int(trace["normal"].argmax())]
    d = np.array([top[f"{name}_penetration"] for name in ("toe", "heel")])
    d = d[d > 0]
    n = ground_of(None).exponent
    expected = n * np.sum(d**n * np.log(d)) / np.sum(d**n)
    measured = section.data["rows"][f"{gait}.peak_elastic"]["exponent"]["elasticity"]
    assert measured == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("gait", GAITS)
def test_resultants_answer_to_friction_as_full_slip_says(section, gait):
    trace = replay(exact_cycle(gait, None), ground_of(None))
    top = trace[int(trace["grf"].argmax())]
    assert abs(top["friction"]) == pytest.approx(0.4 * top["normal"])  # both points slip one way
    resultant = section.data["rows"][f"{gait}.peak_elastic.resultant"]["friction"]["elasticity"]
    assert resultant == pytest.approx(0.16 / 1.16, rel=1e-3)


def test_changes_are_counted_in_bars(section):
    one = section.data["rows"]["walk.peak_elastic"]["stiffness"]
    assert one["change"] == pytest.approx(1, rel=1e-3)  # % of the force
    assert one["bars"] == pytest.approx(0.5, rel=1e-3)  # its bar is 2 %
    assert section.data["rows"]["walk.angle_variation"]["ground_level"]["bars"] is None


@pytest.mark.parametrize("gait", GAITS)
def test_a_rising_ground_is_met_earlier_by_its_rise_over_the_approach_speed(section, gait):
    trace = replay(exact_cycle(gait, None), ground_of(None))
    stance = measure_stance(trace)
    speed = max(trace[f"{name}_approach"].max() for name in stance.first_points)
    change = section.data["rows"][f"{gait}.contact_start"]["ground_level"]["change"]
    assert change == pytest.approx(-1e-3 / speed, rel=0.01)


def test_stiffer_grounds_keep_the_walking_peak_at_their_level(section):
    target = load_published().row("walk.peak_elastic").value
    rises = [entry["rise_mm"] for entry in section.data["stiffness"]]
    assert np.all(np.diff(rises) < 0)
    for entry in section.data["stiffness"]:
        ground = ground_of(None, stiffness=entry["stiffness"])
        peak = replay(exact_cycle("walk", None), ground, 1e-3 * entry["rise_mm"])["normal"].max()
        assert peak == pytest.approx(target, rel=2e-3)
        assert entry["rows"]["walk.peak_elastic"] == peak
        assert 0 <= entry["within"] <= entry["barred"]


def test_without_friction_resultant_and_normal_peak_are_one(section):
    for ratios in section.data["friction"]["by_friction"].values():
        assert ratios[0] == 1.0
        assert ratios[-1] == pytest.approx(np.sqrt(2), rel=1e-3)
    for ratios in section.data["friction"]["by_fast"].values():
        assert ratios[0] >= ratios[-1] >= 1.0


def test_pace_changes_no_normal_force(section):
    assert all(entry["normal"] < 1e-9 for entry in section.data["speed"].values())


def test_the_section_is_json_and_draws_all_figures_that_it_shows(section):
    pytest.importorskip("matplotlib")
    json.dumps(section.data, allow_nan=False)
    assert set(re.findall(r"\]\((\w+)\.png\)", section.markdown)) == section.figures.keys()
    for draw in section.figures.values():
        assert draw().axes
    assert "nan" not in section.markdown
