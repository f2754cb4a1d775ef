import json
import math

import numpy as np
import pytest

from hoof_env.dynamics.constrained import ConstrainedLeg
from hoof_env.dynamics.constraints import DRIVER_ROW, SIZE, Constraints
from hoof_env.dynamics.result import Result
from hoof_env.dynamics.trace import new_trace
from hoof_env.errors import HoofEnvError
from hoof_env.gait.parameters import GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.paper.study import slips
from hoof_env.paper.study.printed_rows import ROWS, Row, assemble, at_rest, misfits, row_index
from hoof_env.paper.study.slip import CHANGES, EFFECTS, HARMLESS, IMPOSSIBLE, Slip
from hoof_env.paper.study.slips_friction import friction_power
from hoof_env.paper.study.slips_linkage import linkage_slips
from hoof_env.paper.study.slips_motion import PrintedGamma, _gamma_facts, _gamma_words, drift

GARBLED = {22, 23, 24, 32, 34, 38, 39, 40, 41}
"""Rows of the print that are not those of the mechanism, found by reading."""


@pytest.fixture(scope="module")
def geometry():
    """One leg by name: what is tested holds for any, but not every leg turns with another hoof."""
    return load_geometry("first_fit")


@pytest.fixture(scope="module")
def section(reproduction):
    lines = []
    result = slips.examine_slips(None, lines.append, reproduction)
    assert any("Eq. 2" in line for line in lines)
    return result


@pytest.fixture(scope="module")
def found(section):
    return {slip["id"]: slip for slip in section.data["slips"]}


def test_good_rows_of_the_print_are_the_solvers_own_rows_at_any_configuration(geometry):
    """Text and `Constraints` were written apart; they must agree off the constraints too, up to sign."""
    q = np.random.default_rng(3).normal(size=SIZE)
    closure = Constraints(geometry)(q, np.zeros(SIZE), at_rest(0.4))
    for number in ROWS.keys() - GARBLED:
        value, slope = Row(ROWS[number])(q, geometry, 0.4)
        k = row_index(number)
        sign = np.sign(closure.jacobian[k] @ slope)
        assert value == pytest.approx(sign * closure.error[k], abs=1e-12), number
        np.testing.assert_allclose(slope, sign * closure.jacobian[k], atol=1e-12)


def test_derivatives_of_a_row_are_those_of_its_value(geometry):
    q, h = np.random.default_rng(4).normal(size=SIZE), 1e-6
    for text in ROWS.values():
        row = Row(text)
        numeric = [(row(q + h * e, geometry, 0.4)[0] - row(q - h * e, geometry, 0.4)[0]) / (2 * h)
                   for e in np.eye(SIZE)]  # fmt: skip
        np.testing.assert_allclose(row(q, geometry, 0.4)[1], numeric, atol=1e-8)


def test_exactly_the_garbled_rows_fail_on_the_decoded_leg(geometry):
    assert {number for number, value in misfits(geometry, 12).items() if value > 1e-9} == GARBLED


def test_the_decoded_rows_assemble_everywhere_and_stay_put(geometry):
    assembly = assemble(geometry, {}, angles=4)
    assert (assembly.closed, assembly.rank) == (1.0, SIZE)
    assert assembly.turned_deg < 1e-9


def test_a_sole_by_the_letter_closes_only_on_a_hoof_with_equal_sides(geometry):
    """Rows 38 to 41 lay I on J: possible once both are equally far from the ankle, and then singular."""
    literal = {number: ROWS[number] for number in (38, 39, 40, 41)}
    assert assemble(geometry, literal, angles=3).closed == 0
    equal = geometry.replace(lengths={"GI": geometry.lengths["GJ"]})
    assembly = assemble(equal, literal, angles=3)
    assert (assembly.closed, assembly.rank) == (1.0, SIZE - 1)


def test_gamma_by_the_letter_slows_the_crank_as_its_equation_says(geometry):
    """Without Baumgarte's terms the driver's row reads th1'' = -2 th1', so th1' falls by exp(-2 t)."""
    leg = ConstrainedLeg(geometry, Ground(), alpha=0.0, beta=0.0, integrator="rk4")
    leg.constraints = PrintedGamma(leg.constraints)
    gait = GaitParameters(2 * math.pi, 0.3, 0.0, 0.0)
    leg.reset(gait)
    leg.advance(gait.to_array(), new_trace(50))
    t = 0.05
    assert leg.state.qd[2] == pytest.approx(-2 * math.pi * math.exp(-2 * t), rel=1e-9)
    turned = 2 * math.pi * (1 - math.exp(-2 * t)) / 2
    assert leg.closure().error[DRIVER_ROW] == pytest.approx(2 * math.pi * t - turned, rel=1e-6)


def test_a_cycle_that_gamma_by_the_letter_does_not_survive_is_a_finding(monkeypatch, found):
    """One that fails half-way has half the instants; with gamma as it must be it is an error."""
    calls = []

    def fails(self, command, trace):
        calls.append(1)
        return Result.OK if len(calls) % 51 else Result.NOT_FINITE

    full = drift(None, "walk", 21.2, False)
    monkeypatch.setattr(ConstrainedLeg, "advance", fails)
    half = drift(None, "walk", 21.2, True)
    assert (half.failed, len(half.t), len(half.gap)) == (0.5, 50, 50)
    facts = _gamma_facts(half, full)
    assert facts["peak_change"] is facts["contact_later_s"] is None
    assert "fails after 0.50 s" in _gamma_words(facts)
    with pytest.raises(HoofEnvError, match=r"walk with beta 21\.2: the integration failed"):
        drift(None, "walk", 21.2, False)


def test_drives_pay_for_friction_and_would_be_paid_by_the_letter(reproduction, found):
    """Over a cycle the drives' work is what the ground takes; elastic ground takes it by friction alone."""
    for gait, facts in found["eq13.tangent"]["data"].items():
        trace = reproduction.traces[gait, "elastic", "exact"]
        assert friction_power(trace).max() <= 0
        assert facts["drives_J"] == pytest.approx(-facts["friction_J"], rel=1e-5)
        assert facts["drives_literal_J"] == pytest.approx(facts["friction_J"], rel=1e-5)


def test_inertia_changes_torques_and_no_motion(found):
    for gait, loads in found["eq5.inertia"]["data"]["loads"].items():
        assert loads["motion"]["acceleration"] < 1e-6, gait
        assert loads["printed"]["torque"] != loads["read"]["torque"]


def test_forces_by_the_letter_follow_from_the_read_ones(reproduction, found):
    for gait, facts in found["grf.root"]["data"].items():
        trace = reproduction.traces[gait, "elastic", "exact"]
        k = np.argmax(trace["normal"] + abs(trace["friction"]))
        assert facts["literal"] ** 2 == pytest.approx(trace["normal"][k] + abs(trace["friction"][k]))
    level = found["eq10.level"]["data"]
    deepest = max(
        reproduction.traces["run", "elastic", "exact"][f"{p}_penetration"].max() for p in ("toe", "heel")
    )
    assert level["depth_m"]["run"] == deepest
    assert level["run_peak_on_walk_level_N"] < level["run_peak_N"]


def test_rank_of_the_printed_system(found):
    facts = found["eq2.rows"]["data"]
    assert facts["printed_rows"] == len(ROWS) == 37
    assert facts["free"] == SIZE - facts["rank"] >= SIZE - len(ROWS)
    assert {int(number) for number in facts["largest_m"]} == GARBLED
    assert found["eq3.size"]["data"]["rank"] == SIZE
    assert {11, 13, 14} <= set(found["eq3.size"]["data"]["links_in_free_fall"])


def test_every_slip_says_everything_once(section, found):
    assert len(found) == len(section.data["slips"])
    for slip in found.values():
        assert slip["effect"] in EFFECTS
        assert all(slip[key] for key in ("where", "printed", "read_as", "why", "literal"))
        assert f"(`{slip['id']}`)" in section.markdown
    json.dumps(section.data, allow_nan=False)


def test_the_lead_counts_what_follows(section, found):
    lead = section.markdown.split("\n")[0]
    for effect in EFFECTS:
        assert f"{sum(slip['effect'] == effect for slip in found.values())} {effect}" in lead


def test_effects_come_from_the_numbers(geometry, found):
    """A hoof with equal sides makes the sole's rows possible, and the verdict follows."""
    assert found["eq2.sole"]["effect"] == IMPOSSIBLE
    equal = geometry.replace(lengths={"GI": geometry.lengths["GJ"]})
    sole = next(slip for slip in linkage_slips(equal) if slip.id == "eq2.sole")
    assert sole.effect != IMPOSSIBLE
    one = Slip("a", "w", "p", "r", "y", "l", CHANGES)
    assert "1 would change what" in slips._summary([one])
    assert "none" in slips._summary([Slip("a", "w", "p", "r", "y", "l", HARMLESS)])


def test_figures_are_drawn_and_named_in_the_text(section):
    pytest.importorskip("matplotlib")
    for name, draw in section.figures.items():
        assert f"({name}.png)" in section.markdown
        assert len(draw().axes) == 4
