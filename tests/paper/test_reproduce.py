import dataclasses
import json
import math
import re

import gymnasium
import numpy as np
import pytest

from hoof_env.errors import OutputError
from hoof_env.gait import load_gait
from hoof_env.ground.contact import load_ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.paper import report
from hoof_env.paper.details import UNITS
from hoof_env.paper.measure import integral, measure_stance
from hoof_env.paper.report import largest_drift, which_beta
from hoof_env.paper.reproduce import ENVIRONMENT, GAITS, SOLVERS, reproduce, run_cycle, write_reproduction
from hoof_env.paper.rows import (
    CONDITIONS,
    EULER,
    NOT_DETERMINABLE,
    betas,
    compare,
    counted,
    load_published,
    settings_of,
    severity,
    slowest_root,
)
from hoof_env.paper.shapes import BRAKING, HOOF_ON_GROUND
from tests.linkage import POINTS

ROW_KEYS = {"kind", "id", "gait", "quantity", "unit", "condition", "reading", "definition", "published",
            "bar", "solver", "simulated", "error", "spared", "within_bar", "beside"}  # fmt: skip
SHAPE_KEYS = {"kind", "id", "claim", "reading", "solver", "holds", "evidence", "readings", "used", "figure"}


@pytest.fixture(scope="module")
def written(reproduction, tmp_path_factory):
    folder = tmp_path_factory.mktemp("written")
    paths = write_reproduction(reproduction, folder, figures=False, command="hoof-env reproduce --out here")
    assert sorted(paths) == sorted(folder.iterdir())
    return folder


def test_every_published_id_is_reported_for_every_solver(written):
    entries = json.loads((written / "reproduction.json").read_text(encoding="utf-8"))
    published = load_published()
    assert len([entry for entry in entries if entry["kind"] == "level"]) == 22
    assert len([entry for entry in entries if entry["kind"] == "detail"]) == len(GAITS) * len(UNITS)
    for kind, expected, keys in (("row", published.rows, ROW_KEYS), ("shape", published.claims, SHAPE_KEYS)):
        found = [entry for entry in entries if entry["kind"] == kind]
        assert {(entry["id"], entry["solver"]) for entry in found} == {
            (item.id, solver) for item in expected for solver in SOLVERS
        }
        assert len(found) == len(SOLVERS) * len(expected)
        assert all(entry.keys() == keys for entry in found)
    assert all(type(e["holds"]) is bool and e["evidence"] for e in entries if e["kind"] == "shape")


def test_errors_and_bars_follow_from_the_numbers_beside_them(reproduction):
    for row in reproduction.rows:
        difference = row["simulated"] - row["published"]
        limit, _, measure = row["bar"].partition(" ")
        error = 100 * difference / row["published"] if row["unit"] == "N" else difference
        assert row["error"] == pytest.approx(error)
        assert math.isfinite(row["error"])
        lost = row["id"] in NOT_DETERMINABLE
        assert row["spared"] == ("reported" if limit == "reported" else "not determinable" if lost else "")
        assert row["within_bar"] is (None if row["spared"] else abs(error) <= float(limit)), (row, measure)


def test_three_rows_are_counted_apart_with_every_solver(reproduction):
    counts = {s: counted(reproduction.rows, reproduction.shapes, s) for s in SOLVERS}
    barred = sum(row.bar.limit is not None for row in reproduction.published.rows)
    determinable = barred - len(NOT_DETERMINABLE)
    for solver in SOLVERS:
        assert (
            f" of {determinable} determinable rows within their bar, 3 not determinable, " in counts[solver]
        )
    assert counts["exact"].startswith(f"{determinable} of ")
    spared = {(row["id"], row["solver"]) for row in reproduction.rows if row["spared"] == "not determinable"}
    assert spared == {(name, solver) for name in NOT_DETERMINABLE for solver in SOLVERS}
    for solver in SOLVERS:
        within = [row["within_bar"] for row in reproduction.rows if row["solver"] == solver].count(True)
        holds = [shape["holds"] for shape in reproduction.shapes if shape["solver"] == solver]
        assert counts[solver].startswith(f"{within} of ")
        told = re.findall(r"(\d+) of (\d+) (?:of the paper's|checks)", counts[solver])
        turned = int((re.search(r"and (\d+) with the sign turned", counts[solver]) or [0, "0"])[1])
        assert sum(int(count) for count, _ in told) + turned == sum(holds)
        assert sum(int(count) for _, count in told) == len(holds)


def test_the_papers_solvers_differ_in_beta_alone():
    """Alpha and step are the environment's own."""
    by_name = betas(load_published())
    made = {s: gymnasium.make(ENVIRONMENT, **settings_of(s)).unwrapped.engine.legs[0] for s in EULER}
    for solver, name in EULER.items():
        assert made[solver].beta == pytest.approx(by_name[name])
        assert (made[solver].alpha, made[solver].sim_dt) == (15.0, 1e-3)
    assert by_name["probable"] == pytest.approx(math.sqrt(2) * 15)


def test_closure_errors_decay_by_the_slowest_root():
    """Against the solution of the equation itself, s'' + 2 alpha s' + beta^2 s = 0 by small steps."""
    for beta in betas(load_published()).values():
        s, rate, h, envelope = 1.0, 0.0, 1e-5, []
        for k in range(100_000):
            rate -= h * (30 * rate + beta**2 * s)
            s += h * rate
            if k % 10_000 == 5_000:
                envelope.append(math.hypot(s, rate / 15))
        root = slowest_root(15.0, beta)
        assert math.log(envelope[-1] / envelope[2]) / 0.7 == pytest.approx(root, rel=0.1)


@pytest.fixture(scope="module")
def page(written):
    return (written / "reproduction.md").read_text(encoding="utf-8")


def test_the_page_says_which_beta_counts_with_the_numbers_of_the_run(reproduction, page):
    text = which_beta(reproduction)["drift"]
    assert all(words in page for words in which_beta(reproduction).values())
    for solver, name in EULER.items():
        cycle, stance = largest_drift(reproduction, solver)
        assert 0 < stance <= cycle
        assert f"{1e3 * cycle:.2f} mm, {1e3 * stance:.2f} mm in stance ({name} β)" in text
    assert largest_drift(reproduction, "paper, probable beta") < largest_drift(reproduction, "paper")
    for solvers, words in (
        (SOLVERS, "meets all of these with both"),
        (SOLVERS[1:], "with the probable β only"),
        (SOLVERS[2:], "with neither"),
    ):
        rows = [row | {"within_bar": row["solver"] in solvers} for row in reproduction.rows]
        assert words in which_beta(dataclasses.replace(reproduction, rows=rows))["verdict"]


def test_all_solvers_read_the_direction_of_the_force_alike(reproduction):
    found = [shape for shape in reproduction.shapes if shape["id"] == "walk.direction"]
    assert len({shape["used"] for shape in found}) == 1
    exact = reproduction.traces["walk", "elastic", "exact"]
    braked = integral(exact, exact["friction"], 0.0, 1.0) < 0
    assert found[0]["used"] == (BRAKING if braked else HOOF_ON_GROUND)
    assert all(shape["holds"] is shape["readings"][shape["used"]] for shape in found)


def test_the_page_names_the_rows_that_are_not_determinable_and_says_why(page, reproduction):
    section = page[page.index("## Rows that are not determinable") : page.index("## Other readings")]
    assert all(f"| `{name}` [" in section for name in NOT_DETERMINABLE)
    assert "The walking toe grazes the ground" in section
    rows = [row | {"spared": row["spared"] and "reported"} for row in reproduction.rows]
    none = report.markdown(dataclasses.replace(reproduction, rows=rows), command="c", figures=False)
    assert "## Rows that are not determinable" not in none


def test_rows_are_what_a_reader_would_measure_on_the_trace(reproduction):
    """Peaks and their resultants, means and duty factors once more, from the samples alone."""
    value = {(row["id"], row["solver"]): row["simulated"] for row in reproduction.rows}
    beside = {(row["id"], row["solver"]): row["beside"] for row in reproduction.rows}
    assert all("resultant_%" in found for (name, _), found in beside.items() if name.endswith("reduction"))
    for (gait, condition, solver), trace in reproduction.traces.items():
        normal = trace["toe_normal"] + trace["heel_normal"]
        resultant = np.hypot(normal, trace["toe_friction"] + trace["heel_friction"]).max()
        assert value[f"{gait}.peak_{condition}", solver] == normal.max() < resultant
        assert beside[f"{gait}.peak_{condition}", solver] == pytest.approx({"resultant_N": resultant})
        assert value[f"{gait}.mean_{condition}", solver] == pytest.approx(normal[1:].mean(), rel=1e-6)
        inside = (trace["toe_penetration"] > 0) | (trace["heel_penetration"] > 0)
        step = trace["time"][1] - trace["time"][0]
        assert value[f"{gait}.duty", solver] == pytest.approx(inside[1:].mean(), abs=1.01 * step)
        assert value[f"{gait}.contact_start", solver] == pytest.approx(
            trace["time"][inside][0], abs=1.01 * step
        )


def test_derived_rows_follow_from_the_others(reproduction):
    for solver in SOLVERS:
        value = {row["id"]: row["simulated"] for row in reproduction.rows if row["solver"] == solver}
        for gait in GAITS:
            left = value[f"{gait}.peak_elastic"] / value[f"{gait}.peak_inelastic"]
            assert value[f"{gait}.reduction"] == pytest.approx(100 * (1 - left))
            change = value[f"{gait}.angle_liftoff"] - value[f"{gait}.angle_contact"]
            assert value[f"{gait}.angle_variation"] == pytest.approx(change)
        ratio = value["run.angle_variation"] / value["walk.angle_variation"]
        assert value["ratio.angle_variation"] == pytest.approx(ratio)


def test_the_angle_at_lift_off_is_compared_heel_up_and_its_literal_print_is_kept(reproduction):
    for row in reproduction.rows:
        if row["id"] == "walk.angle_liftoff":
            assert row["published"] == 20.9
            assert row["beside"]["printed"] == -20.9
            assert row["beside"]["error_against_printed"] == pytest.approx(row["simulated"] + 20.9)


def test_motion_does_not_depend_on_the_contact_law(reproduction):
    for gait in GAITS:
        for solver in SOLVERS:
            elastic, inelastic = (reproduction.traces[gait, condition, solver] for condition in CONDITIONS)
            tolerance = 0 if solver == "exact" else 1e-9
            for name in ("toe_penetration", "heel_penetration", "hoof_angle"):
                np.testing.assert_allclose(elastic[name], inelastic[name], rtol=0, atol=tolerance)


@pytest.mark.parametrize("gait", GAITS)
def test_the_zero_action_is_the_gait(reproduction, gait):
    """Every hoof point is at its place in the pose under the motion law, and forces follow Eq. 14."""
    geometry, ground, own = load_geometry(), load_ground(restitution=0.0), load_gait(gait)
    trace = reproduction.traces[gait, "inelastic", "exact"][::7]
    for point, letter in (("toe", geometry.toe), ("heel", geometry.heel)):
        places, rates = [], []
        for t in trace["time"]:
            w = own.crank_speed
            s, c, a, b = np.sin(w * t), np.cos(w * t), own.swing_sin, own.swing_cos
            phi, phi_rate = own.swing_offset + a * s + b * c, w * (a * c - b * s)
            frame = FrameMotion(phi=phi, phi_rate=phi_rate, position=(0.0, geometry.hip_height))
            at = pose(geometry, w * t, w, 0.0, frame)
            places.append(at.point(letter))
            rates.append(at.point_velocities[POINTS.index(letter)])
        (x, y), (slide, rise) = np.transpose(places), np.transpose(rates)
        for name, expected in (("x", x), ("slide", slide), ("penetration", -y), ("penetration_rate", -rise)):
            np.testing.assert_allclose(trace[f"{point}_{name}"], expected, atol=1e-9, err_msg=name)
        spring = ground.stiffness * np.maximum(-y, 0) ** ground.exponent
        normal = np.maximum(spring * (1 - 0.75 * rise * trace[f"{point}_inverse_approach_speed"]), 0)
        slow, fast = ground.friction_slow, ground.friction_fast
        rubbed = np.sign(slide) * np.clip((np.abs(slide) - slow) / (fast - slow), 0, 1)
        np.testing.assert_allclose(trace[f"{point}_normal"], normal, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(
            trace[f"{point}_friction"], -ground.friction * normal * rubbed, rtol=1e-6, atol=1e-6
        )


def test_exact_rows_have_converged(reproduction):
    """Half the time step moves no row by more than a tenth of its bar."""
    published = reproduction.published
    finer = {
        (gait, condition): measure_stance(run_cycle(gait, "exact", restitution=cr, sim_dt=5e-5))
        for gait in GAITS
        for condition, cr in CONDITIONS.items()
    }
    coarse = {row["id"]: row for row in reproduction.rows if row["solver"] == "exact"}
    for row in compare(published, finer, "exact"):
        bar = published.row(row["id"]).bar
        if bar.limit is not None:
            assert abs(row["error"] - coarse[row["id"]]["error"]) < bar.limit / 10, row["id"]


def test_a_row_without_value_is_outside_its_bar_and_the_worst(cycle):
    published = load_published()
    apart = measure_stance(cycle((0.3, 0.4), (0.5, 0.6), toe_normal=1.0, hoof_angle=lambda t: t))
    stances = {(gait, condition): apart for gait in GAITS for condition in CONDITIONS}
    (row,) = (row for row in compare(published, stances, "exact") if row["id"] == "walk.angle_flat")
    assert (row["simulated"], row["error"], row["within_bar"]) == (None, None, False)
    assert severity(row, published) == math.inf


def test_the_page_names_command_versions_ground_worst_rows_and_identified_geometry(page, reproduction):
    ground = f"K = {reproduction.ground.stiffness:g} N/mⁿ and n = {reproduction.ground.exponent:g} in Eq. 14"
    for words in ("`hoof-env reproduce --out here`", "llvmlite", "identified, not published", ground):
        assert words in page
    assert "is the normal force summed over toe and heel throughout" in page
    for row in reproduction.published.rows:
        assert f"| `{row.id}` |" in page
    for solver in SOLVERS:
        rows = [row for row in reproduction.rows if row["solver"] == solver and row["within_bar"] is False]
        if rows:
            worst = max(rows, key=lambda row: severity(row, reproduction.published))
            assert f"Worst: {worst['id']}" in page
    lost = [entry for entry in reproduction.levels if entry["id"] in NOT_DETERMINABLE]
    outside = sum(not within for entry in lost for within in entry["within_bar"])
    assert page.count("✗") == 2 + outside + sum(row["within_bar"] is False for row in reproduction.rows)
    assert page.count("†") == 2 + len(SOLVERS) * len(NOT_DETERMINABLE)


def test_progress_tells_of_every_condition(monkeypatch, reproduction):
    def recorded(gait, solver, restitution, **_):
        return reproduction.traces[gait, "elastic" if restitution else "inelastic", solver]

    monkeypatch.setattr("hoof_env.paper.reproduce.run_cycle", recorded)
    lines = []
    again = reproduce(lines.append)
    assert all(any(f"{solver}, {gait}, {c}:" in line for line in lines) for gait, c, solver in again.traces)
    assert again.rows == reproduction.rows
    for shapes in zip(again.shapes, reproduction.shapes, strict=True):
        assert shapes[0] == shapes[1] or shapes[0]["id"].endswith(".walks")  # of which none was run deeper
    for solver in SOLVERS:
        assert f"{solver}: {counted(again.rows, again.shapes, solver)}" in lines


@pytest.mark.parametrize("trouble", [RuntimeError, KeyboardInterrupt])
def test_trouble_while_writing_leaves_the_older_result_whole(monkeypatch, tmp_path, reproduction, trouble):
    (tmp_path / "reproduction.json").write_text("older", encoding="utf-8")

    def fail(*_, **__):
        raise trouble

    monkeypatch.setattr(report, "markdown", fail)
    with pytest.raises(trouble):
        write_reproduction(reproduction, tmp_path, figures=False)
    assert [file.name for file in tmp_path.iterdir()] == ["reproduction.json"]
    assert (tmp_path / "reproduction.json").read_text(encoding="utf-8") == "older"


def test_a_folder_that_cannot_be_made_is_one_clear_error(tmp_path, reproduction):
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(OutputError, match="file"):
        write_reproduction(reproduction, tmp_path / "file", figures=False)
    with pytest.raises(OutputError, match="writable folder"):
        write_reproduction(reproduction, tmp_path / "file" / "below", figures=False)
