import json
import math

import numpy as np
import pytest

from hoof_env.dynamics.engine import LegEngine
from hoof_env.dynamics.trace import new_trace
from hoof_env.dynamics.trunk import Trunk
from hoof_env.errors import OutputError, ParameterError
from hoof_env.gait.parameters import load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.paper import report
from hoof_env.paper.measure import measure_stance
from hoof_env.paper.published import CONDITIONS, load_published
from hoof_env.paper.reproduce import GAITS, SOLVERS, reproduce, run_cycle, write_reproduction
from hoof_env.paper.rows import compare, severity

ROW_KEYS = {"kind", "id", "gait", "quantity", "unit", "condition", "reading", "definition", "published",
            "bar", "solver", "simulated", "error", "within_bar", "beside"}  # fmt: skip
SHAPE_KEYS = {"kind", "id", "claim", "reading", "solver", "holds", "evidence", "figure"}


@pytest.fixture(scope="module")
def written(reproduction, tmp_path_factory):
    folder = tmp_path_factory.mktemp("written")
    paths = write_reproduction(reproduction, folder, figures=False, command="hoof-env reproduce --out here")
    assert sorted(paths) == sorted(folder.iterdir())
    return folder


def test_every_published_id_is_reported_for_both_solvers(written):
    entries = json.loads((written / "reproduction.json").read_text(encoding="utf-8"))
    published = load_published()
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
        assert row["within_bar"] is (None if limit == "reported" else abs(error) <= float(limit)), (
            row,
            measure,
        )


def test_rows_are_what_a_reader_would_measure_on_the_trace(reproduction):
    """Peaks, means and duty factors once more, from the samples alone."""
    value = {(row["id"], row["solver"]): row["simulated"] for row in reproduction.rows}
    for (gait, condition, solver), trace in reproduction.traces.items():
        normal = trace["toe_normal"] + trace["heel_normal"]
        assert value[f"{gait}.peak_{condition}", solver] == normal.max()
        assert value[f"{gait}.mean_{condition}", solver] == pytest.approx(normal[1:].mean(), rel=1e-6)
        inside = (trace["toe_penetration"] > 0) | (trace["heel_penetration"] > 0)
        step = trace["t"][1] - trace["t"][0]
        assert value[f"{gait}.duty", solver] == pytest.approx(inside[1:].mean(), abs=1.01 * step)
        assert value[f"{gait}.contact_start", solver] == pytest.approx(trace["t"][inside][0], abs=1.01 * step)


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


def test_the_zero_action_is_the_gait_to_the_last_bit(reproduction):
    geometry, gait = load_geometry(), load_gait("run")
    engine = LegEngine(
        geometry, Trunk(kind="fixed", height=geometry.hip_height), Ground(restitution=0.0), 1e-4
    )
    parts = [engine.reset(gait)]
    for _ in range(50):
        parts.append(new_trace(200))
        engine.advance(gait.to_array(), parts[-1])
    assert np.concatenate(parts).tobytes() == reproduction.traces["run", "inelastic", "exact"].tobytes()


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


def test_the_page_names_command_versions_worst_rows_and_identified_geometry(written, reproduction):
    page = (written / "reproduction.md").read_text(encoding="utf-8")
    assert "`hoof-env reproduce --out here`" in page
    assert "numba" in page
    assert "identified, not published" in page
    for row in reproduction.published.rows:
        assert f"| `{row.id}` |" in page
    for solver in SOLVERS:
        rows = [row for row in reproduction.rows if row["solver"] == solver and row["within_bar"] is False]
        if rows:
            worst = max(rows, key=lambda row: severity(row, reproduction.published))
            assert f"Worst: {worst['id']}" in page
    assert page.count("✗") == 1 + sum(row["within_bar"] is False for row in reproduction.rows)


def test_progress_tells_of_every_condition(monkeypatch, reproduction):
    def recorded(gait, solver, restitution, **_):
        return reproduction.traces[gait, "elastic" if restitution else "inelastic", solver]

    monkeypatch.setattr("hoof_env.paper.reproduce.run_cycle", recorded)
    lines = []
    again = reproduce(lines.append)
    assert all(any(f"{solver}, {gait}, {c}:" in line for line in lines) for gait, c, solver in again.traces)
    assert again.rows == reproduction.rows


def test_an_unknown_preset_is_refused():
    with pytest.raises(ParameterError, match="preset"):
        reproduce(preset="no_such_preset")


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
