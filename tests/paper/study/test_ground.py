"""Every part of the study stands on the preset's ground: its base values are the reproduction's rows."""

import json

import pytest

from hoof_env.leg.geometry import preset_names, read_preset
from hoof_env.paper.reproduce import GAITS, reproduce
from hoof_env.paper.solvers import EULER, betas
from hoof_env.paper.study import conditions, laws, sensitivity
from hoof_env.paper.study.case import Case
from hoof_env.paper.study.claims_force import force_claims
from hoof_env.paper.study.conditions import euler_rows
from hoof_env.paper.study.laws import free_peak
from hoof_env.paper.study.numerics import _causes
from hoof_env.paper.study.replay import exact_cycle, ground_of, row_values, stances_on
from hoof_env.paper.study.slips_contact import contact_slips

K, N = 2.5e4, 1.25


@pytest.fixture(scope="module")
def preset(tmp_path_factory):
    data = {**read_preset(preset_names()[0]), "ground": {"exponent": N, "stiffness": K}}
    path = tmp_path_factory.mktemp("soft") / "soft.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    return str(path)


@pytest.fixture(scope="module")
def result(preset):
    return reproduce(preset=preset)


@pytest.fixture(scope="module")
def rows(result):
    return {(row["id"], row["solver"]): row["simulated"] for row in result.rows}


def test_the_reproduction_knows_its_ground(result, preset):
    assert (result.ground.stiffness, result.ground.exponent) == (K, N)
    assert result.ground == ground_of(preset)


def test_replays_are_the_rows_of_all_solvers(result, preset, rows):
    published = result.published
    found = row_values(published, stances_on({g: exact_cycle(g, preset) for g in GAITS}, ground_of(preset)))
    for (name, solver), value in rows.items():
        if solver == "exact":
            assert found[name] == pytest.approx(value, rel=1e-9, nan_ok=True), name
    for solver, reading in EULER.items():
        by_euler = euler_rows(published, preset, conditions.STEPS, betas(published)[reading])
        for (name, of), value in rows.items():
            if of == solver:
                assert by_euler[name] == pytest.approx(value, rel=1e-6, abs=1e-9)


def test_causes_are_taken_apart_on_it(result, preset, rows):
    for gait, peaks in _causes(preset, betas(result.published)).items():
        assert peaks["printed"]["sampled"] == pytest.approx(rows[f"{gait}.peak_inelastic", "paper"])


def test_laws_begin_with_it(monkeypatch, preset, rows):
    monkeypatch.setattr(laws, "FLOORS", laws.FLOORS[::30])
    monkeypatch.setattr(laws, "RESTITUTIONS", laws.RESTITUTIONS[[0, 1, 12, 40]])
    section = laws.examine_laws(preset, lambda line: None)
    assert list(section.data["exponents"]) == ["1", "1.25", "1.5", "2"]
    for gait in GAITS:
        entry = section.data["exponents"][section.data["exponent"]]
        assert entry["elastic"][gait]["peak"] == pytest.approx(
            rows[f"{gait}.peak_elastic", "exact"], rel=1e-9
        )
        floor = section.data["floor"]["peak"][gait][0]
        assert floor == pytest.approx(rows[f"{gait}.peak_inelastic", "exact"], rel=1e-9)
    assert "this preset has n = 1.25" in section.markdown
    pytest.importorskip("matplotlib")
    assert section.figures["laws_free"]().axes


def test_sensitivity_is_about_it(monkeypatch, preset, rows):
    for name, every in (("LEVELS", 50), ("FRICTIONS", 20), ("FAST", 20)):
        monkeypatch.setattr(sensitivity, name, getattr(sensitivity, name)[::every])
    section = sensitivity.examine_sensitivity(preset, lambda line: None)
    value = section.data["rows"]["run.peak_inelastic"]["value"]
    assert value == pytest.approx(rows["run.peak_inelastic", "exact"], rel=1e-9)
    assert (section.data["parameters"]["exponent"], section.data["stiffness"][0]["stiffness"]) == (N, K)
    assert "this preset has 25000 N/mⁿ with n = 1.25" in section.markdown
    assert all(law["holds"] for law in section.data["laws"])


def test_claims_and_slips_are_held_against_it(result, rows):
    stiffness, reduction, _ = force_claims(Case.of(result))
    assert all("2.00 (walking) and 2.00 (running)" in finding.evidence for finding in stiffness.findings)
    assert reduction.data["free_impact_ratio"] == free_peak(0.75, N)
    traces = {key[:2]: trace for key, trace in result.traces.items() if key[2] == "exact"}
    slips = {slip.id: slip for slip in contact_slips(traces, result.published, result.ground)}
    for gait in GAITS:
        linear, read = slips["table1.stiffness"].data["peaks_N"][gait]
        assert read == rows[f"{gait}.peak_elastic", "exact"]
        depths = sum(traces[gait, "elastic"][f"{p}_penetration"].clip(0) for p in ("toe", "heel"))
        assert linear == pytest.approx(K * depths.max())
    assert slips["table1.stiffness"].read_as.startswith("n = 1.25, identified")
    assert slips["eq10.level"].data["run_peak_N"] == rows["run.peak_elastic", "exact"]
