import json
import math
import re
from importlib import resources

import numpy as np
import pytest

from hoof_env.errors import HoofEnvError
from hoof_env.paper.measure import measure_stance
from hoof_env.paper.published import load_published
from hoof_env.paper.reproduce import GAITS
from hoof_env.paper.solvers import betas
from hoof_env.paper.study import numerics
from hoof_env.paper.study.conditions import conditions
from hoof_env.paper.study.conditions_text import bars_spanned, conditions_text
from hoof_env.paper.study.numerics_text import _failures, observed_order
from hoof_env.paper.study.replay import euler_cycle, exact_cycle, ground_of, replay


@pytest.fixture(scope="module")
def section(few_points):
    return numerics.examine_numerics(None, lambda line: None)


@pytest.fixture(scope="module")
def answers():
    return conditions()


@pytest.mark.parametrize("beta", betas(load_published()).values(), ids=betas(load_published()).keys())
def test_euler_converges_with_first_order_under_either_beta(beta):
    """On a leg whose dyads keep clear of their dead points."""
    ladder = [numerics._drift("first_fit", steps, beta) for steps in numerics.LADDER]
    for gait in GAITS:
        for measure in ("cycle_mm", "stance_mm"):
            assert observed_order([entry[gait][measure] for entry in ladder]) == pytest.approx(1, abs=0.05)


def test_near_a_dead_point_it_comes_to_first_order_as_the_step_shrinks(section):
    for ladder in section.data["drift"].values():
        for gait in GAITS:
            for measure in ("cycle_mm", "stance_mm"):
                errors = [entry[gait][measure] for entry in ladder]
                first, last = (abs(observed_order(pair) - 1) for pair in (errors[:2], errors[-2:]))
                assert last < max(0.6 * first, 0.05)


def test_order_of_known_errors():
    assert observed_order([8.0, 2.0, 0.5]) == pytest.approx(2)
    assert math.isnan(observed_order([1.0, 0.0]))


def test_rows_approach_the_exact_ones_as_the_step_falls(section):
    """All but the rows on the spike of a grazing touch-down do so step by step."""
    for row in load_published().rows:
        if row.gait == "walk" and (row.condition == "inelastic" or row.id.endswith("reduction")):
            continue
        entry = section.data["rows"][row.id]
        for name in section.data["betas"]:
            first, last = (abs(row.bar.error(entry[name][k], entry["exact"])) for k in (0, -1))
            assert last < 0.3 * first + 0.02 * (row.bar.limit or 1), (row.id, name)


def test_betas_are_the_two_readings():
    printed, probable = betas(load_published()).values()
    assert printed == pytest.approx(math.sqrt(2 * 15))
    assert probable == pytest.approx(math.sqrt(2) * 15)


def test_causes_are_those_of_the_motion_and_of_the_sampling(section):
    for gait in GAITS:
        exact = section.data["causes"][gait]["exact"]
        peak = replay(exact_cycle(gait, None, 1e-3), ground_of(None, restitution=0.0))["normal"].max()
        assert exact["interpolated"] == peak
        assert exact["sampled"] != peak


def test_conditions_know_every_row_with_the_value_of_the_reproduction(answers, reproduction):
    for row in reproduction.rows:
        value = answers[row["id"]][row["solver"]]["value"]
        assert value == pytest.approx(row["simulated"], rel=1e-6), row["id"]
    assert answers.keys() == {row["id"] for row in reproduction.rows}


def test_slopes_over_the_ground_level_are_those_of_the_law(answers):
    """An elastic peak K d^n grows by K n d^(n - 1) as d does; touch-down is earlier by 1 / approach speed."""
    ground = ground_of(None)
    for gait in GAITS:
        trace = replay(exact_cycle(gait, None), ground)
        top = trace[int(trace["normal"].argmax())]
        slope = sum(
            ground.stiffness * ground.exponent * max(top[f"{name}_penetration"], 0.0) ** (ground.exponent - 1)
            for name in ("toe", "heel")
        )
        peak = answers[f"{gait}.peak_elastic"]["exact"]["ground"]
        assert peak["slope"] == pytest.approx(1e-3 * slope, rel=1e-3)
        first = "toe" if "toe" in measure_stance(trace).first_points else "heel"
        speed = trace[f"{first}_approach"].max()
        start = answers[f"{gait}.contact_start"]["exact"]["ground"]
        assert start["slope"] == pytest.approx(-1e-3 / speed, rel=0.01)
        height = float(trace["trunk_y"][0])
        assert peak["relative"] == pytest.approx(-slope * height / top["normal"], rel=1e-3)


def test_slopes_over_the_step_are_those_of_the_first_order_error(section, answers):
    """Elastic peaks have no sampled approach speed: what 1 ms adds is about the slope times 1 ms."""
    for gait in GAITS:
        row = f"{gait}.peak_elastic"
        entry = section.data["rows"][row]
        answer = answers[row]["paper"]["step"]
        assert answer["slope"] == pytest.approx(entry["printed"][0] - entry["exact"], rel=0.1)
        assert answer["scatter"] < 1e-3 * entry["exact"]


def test_steps_that_fail_are_gaps_and_are_named():
    """With half its steps an integration of this kind may not come to the end; its neighbours still count."""
    sweep = {
        "step_ms": [2.0, 1.5, 1.0],
        "peaks": {"run": {"printed": [None, None, 9.0], "probable": [8.0, 8.5, 9.0]}},
    }
    (line,) = _failures(sweep)
    assert "steps from 1.50 ms (running, printed β) on" in line
    sweep["peaks"]["run"]["printed"] = [8.0, 8.5, 9.0]
    assert _failures(sweep) == []


def test_a_step_sweep_survives_an_integration_that_fails(monkeypatch):
    def fails(gait, preset, steps, beta):
        if steps < 500:
            raise HoofEnvError("it diverged")
        return euler_cycle(gait, preset, steps, beta)

    monkeypatch.setattr(numerics, "euler_cycle", fails)
    monkeypatch.setattr(numerics, "STEP_SWEEP", np.array([400, 2000]))
    sweep = numerics._step_sweep(None, {"printed": 5.0})
    for gait in GAITS:
        failed, peak = sweep["peaks"][gait]["printed"]
        assert math.isnan(failed)
        assert peak > 0


def test_windows_hold_the_values_and_count_in_bars(answers):
    published = load_published()
    for row in published.rows:
        for solver, answer in answers[row.id].items():
            if solver == "unit":
                continue
            for parameter in answer.keys() - {"value"}:
                assert answer[parameter]["low"] <= answer["value"] <= answer[parameter]["high"]
    peak = published.row("walk.peak_elastic")
    two_percent = {"low": peak.value, "high": 1.02 * peak.value}
    assert bars_spanned(peak, two_percent) == pytest.approx(1)
    assert bars_spanned(published.row("walk.angle_variation"), two_percent) is None


def test_the_section_is_json_and_draws_all_figures_that_it_shows(section):
    pytest.importorskip("matplotlib")
    json.dumps(section.data, allow_nan=False)
    assert set(re.findall(r"\]\((\w+)\.png\)", section.markdown)) == section.figures.keys()
    for draw in section.figures.values():
        assert draw().axes
    assert "nan" not in section.markdown


def test_a_row_without_a_value_is_none_and_not_an_error(tmp_path):
    data = json.loads(resources.files("hoof_env.data").joinpath("first_fit.json").read_text())
    data["geometry"]["hip_height"] += 0.036  # so high that walking has no double support
    (tmp_path / "high.json").write_text(json.dumps(data))
    answers = conditions(str(tmp_path / "high.json"))
    flat = answers["walk.angle_flat"]["exact"]
    assert flat["value"] is None
    assert set(flat["ground"].values()) == {None}
    assert "| none |" in conditions_text(load_published(), answers)
