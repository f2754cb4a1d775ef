import dataclasses
import json

import numpy as np
import pytest

from hoof_env.ground.normal_force import restitution_of_factor
from hoof_env.paper.reproduce import SOLVERS
from hoof_env.paper.shapes import BRAKING, HOOF_ON_GROUND
from hoof_env.paper.study.case import Case
from hoof_env.paper.study.claim import (
    CONFIRMED,
    CONTRADICTED,
    PUBLISHED,
    READING,
    SOLVER,
    STATUSES,
    UNTESTABLE,
    Examined,
    Finding,
)
from hoof_env.paper.study.claims import examine_claims
from hoof_env.paper.study.claims_motion import slip_speed
from hoof_env.paper.study.claims_peaks import _rivals, peak_times


@pytest.fixture(scope="module")
def case(reproduction):
    return Case.of(reproduction)


@pytest.fixture(scope="module")
def section(reproduction):
    return examine_claims(None, lambda line: None, reproduction)


@pytest.fixture(scope="module")
def found(section):
    return {claim["id"]: claim for claim in section.data["claims"]}


def examined(*verdicts):
    """A claim with these (reading, source, holds)."""
    return Examined("id", "quote", "section 3", "", tuple(Finding(*v, "evidence") for v in verdicts))


@pytest.mark.parametrize(
    ("verdicts", "status"),
    [
        ([("a", "paper", True), ("a", "exact", True), ("b", PUBLISHED, True)], CONFIRMED),
        ([("a", "paper", False), ("a", "exact", False)], CONTRADICTED),
        ([("a", "paper", True), ("b", "paper", False)], READING),
        ([("a", "paper", True), ("a", "exact", False)], SOLVER),
        ([("a", "paper", None)], UNTESTABLE),
        ([("a", "paper", None), ("b", "paper", True)], CONFIRMED),
    ],
)
def test_a_status_needs_every_reading_and_source(verdicts, status):
    assert examined(*verdicts).status == status


def test_every_shape_of_the_paper_is_among_the_claims(reproduction, found):
    """The verdicts are those of `judge`, taken over and not made again."""
    evidence = {f["evidence"]: f["holds"] for claim in found.values() for f in claim["findings"]}
    ours, apart = ("walk.walks", "run.walks"), ("run.peaks", "walk.direction")
    for shape in reproduction.shapes:
        if shape["id"] not in ours + apart:
            assert evidence[shape["evidence"]] == shape["holds"], shape["id"]
    peaks = [found[name]["findings"] for name in ("run.peaks", "run.delay")]
    for shape in (s for s in reproduction.shapes if s["id"] == "run.peaks"):
        parts = [next(f["holds"] for f in findings if f["source"] == shape["solver"]) for findings in peaks]
        assert all(parts) == shape["holds"]
    for shape in (s for s in reproduction.shapes if s["id"] == "walk.direction"):
        by_reading = [f["holds"] for f in found[shape["id"]]["findings"] if f["source"] == shape["solver"]]
        assert by_reading[:2] == [shape["readings"][name] for name in (BRAKING, HOOF_ON_GROUND)]


def test_every_solver_speaks_wherever_the_leg_is_asked(found):
    for claim in found.values():
        for reading in {f["reading"] for f in claim["findings"]}:
            sources = {f["source"] for f in claim["findings"] if f["reading"] == reading}
            assert not sources & set(SOLVERS) or set(SOLVERS) <= sources, (claim["id"], reading)


def test_what_was_asked_for_is_marked_and_what_was_only_reported_is_not(case, found):
    """Every claim of the paper is a demand of the search; rows count if they have a bar."""
    assert case.asked("walk.order", "walk.angle_variation", "walk.peak_elastic", "walk.direction") == (
        "walk.order",
        "walk.peak_elastic",
        "walk.direction",
    )
    assert found["stiffness"]["asked"] == []
    assert found["run.delay"]["asked"] == ["run.peaks"]
    free = {f["reading"] for f in found["run.delay"]["findings"] if not f["asked"]}
    assert any(reading.startswith("the shift grows") for reading in free)


def test_damping_lowers_the_peak_of_a_free_mass(found, reproduction):
    """Against the equation of motion once more; an elastic law stops the mass at d^(n+1) = (n+1)/2."""
    n = reproduction.ground.exponent

    def force(depth, rate):
        return max(depth, 0.0) ** n * (1 + 0.75 * rate)

    depth, rate, top, h = 0.0, 1.0, 0.0, 1e-3
    for _ in range(4000):  # midpoint rule
        middle = depth + h / 2 * rate, rate - h / 2 * force(depth, rate)
        depth, rate = depth + h * middle[1], rate - h * force(*middle)
        top = max(top, force(depth, rate))
    assert rate == pytest.approx(-restitution_of_factor(0.75), abs=1e-3)
    ratio = found["reduction"]["data"]["free_impact_ratio"]
    assert ratio == pytest.approx(top / ((n + 1) / 2) ** (n / (n + 1)), abs=1e-3)
    assert ratio < 1


def test_under_prescribed_motion_the_damper_adds_force_and_brings_the_peak_forward(case, found):
    """Where the hoof sinks Eq. 14 grows with 1 - cr^2, and the highest force moves towards touch-down."""
    assert not any(
        f["holds"]
        for f in found["reduction"]["findings"]
        if f["reading"].startswith("the damping of the contact")
    )
    times = list(peak_times(case, "run", "exact").values())
    assert times == sorted(times, reverse=True)
    trace = case.trace("run", "exact")
    assert times[0] == trace["t"][np.argmax(trace["normal"])]


def test_the_best_trunk_speed_cannot_be_beaten(case):
    for gait in ("walk", "run"):
        trace = case.trace(gait, "exact")
        speed, slides = slip_speed(trace)
        load = np.concatenate([trace["toe_normal"], trace["heel_normal"]])
        velocity = np.concatenate([trace["toe_vx"], trace["heel_vx"]])
        for other in speed + np.array([-0.5, -0.05, 0.05, 0.5]):
            assert np.sum(load * abs(velocity + other)) / load.sum() > slides


def test_verdicts_follow_the_traces(reproduction):
    """A run whose friction is turned round brakes, and the verdicts say so."""
    traces = {key: trace.copy() for key, trace in reproduction.traces.items()}
    for key in traces:
        traces[key]["friction"] *= -1
    turned = dataclasses.replace(reproduction, traces=traces)
    claims = {c["id"]: c for c in examine_claims(None, lambda line: None, turned).data["claims"]}
    reading = "force of the ground on the leg, forward in both halves of stance"
    holds = {f["holds"] for f in claims["run.direction"]["findings"] if f["reading"] == reading}
    assert holds == {False}


def test_weights_come_from_the_print(found, reproduction):
    finding = next(f for f in found["body.weight"]["findings"] if f["source"] == PUBLISHED)
    walk, run = (reproduction.published.row(f"{gait}.mean_elastic").value for gait in ("walk", "run"))
    assert f"{walk / 9.81:.1f} kg" in finding["evidence"]
    assert f"{run / 9.81:.0f} kg" in finding["evidence"]
    assert finding["holds"] is False


def test_the_page_has_every_claim_reading_and_the_counts(section, found):
    lead = section.markdown.split("\n")[0].lower()
    for status in STATUSES:
        assert f"{status}: {sum(claim['status'] == status for claim in found.values())}" in lead
    for claim in found.values():
        assert f"| `{claim['id']}` |" in section.markdown
        assert claim["quote"] in section.markdown
        assert all(f["reading"][1:] in section.markdown for f in claim["findings"])
    json.dumps(section.data, allow_nan=False)


def test_figures_are_drawn_and_named_in_the_text(section):
    pytest.importorskip("matplotlib")
    for name, draw in section.figures.items():
        assert f"({name}.png)" in section.markdown
        assert all(ax.get_xlabel() or ax.get_title() for ax in draw().axes)


def test_maxima_as_high_as_the_highest_are_named(case):
    trace = case.trace("walk", "exact", "inelastic").copy()
    t = trace["t"]
    bumps = ((100, 0.3), (99.5, 0.45), (90, 0.6))
    trace["normal"] = sum(height * np.exp(-(((t - at) / 0.02) ** 2)) for height, at in bumps)
    assert _rivals(trace) == "100 N at 0.450 s"
    trace["normal"] = np.exp(-(((t - 0.3) / 0.02) ** 2))
    assert _rivals(trace) == ""


def test_the_horizontal_force_goes_one_way_or_both_as_its_impulses_say(case, found):
    trace, stance = case.trace("walk", "exact"), case.stance("walk", "exact")
    inside = (trace["t"] >= stance.start) & (trace["t"] <= stance.end)
    force = trace["friction"][inside]
    parts = np.abs([force[force < 0].sum(), force[force > 0].sum()])
    (finding,) = (
        f
        for f in found["walk.direction"]["findings"]
        if f["reading"].startswith("one way") and f["source"] == "exact"
    )
    assert finding["holds"] == (parts.min() / parts.sum() <= 0.02)


def test_the_walking_hoof_turns_gradually_only_if_it_never_turns_back(case, found):
    (finding,) = (
        f
        for f in found["walk.order"]["findings"]
        if f["reading"].startswith("gradually") and f["source"] == "exact"
    )
    stance = case.stance("walk", "exact")
    net = abs(stance.angle_end_deg - stance.angle_start_deg)
    assert finding["holds"] == (stance.angle_range_deg <= 1.05 * net)
