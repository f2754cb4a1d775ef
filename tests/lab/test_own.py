"""Exports of this package are known by their content: their signs are right, though in fast gaits the model
propels before it brakes."""

from __future__ import annotations

import numpy as np
import pytest

from hoof_env import records
from hoof_env.lab.axis_checks import propelling_first
from hoof_env.lab.compare import compare
from hoof_env.lab.forces import in_units
from hoof_env.lab.picture import report
from hoof_env.lab.read import ForceRecord, read_record
from tests.lab.made import strides

EXTRAS = {".parquet": "pyarrow", ".c3d": "ezc3d"}


@pytest.fixture(params=[".csv", ".parquet", ".mot", ".sto", ".c3d"])
def suffix(request):
    if request.param in EXTRAS:
        pytest.importorskip(EXTRAS[request.param])
    return request.param


@pytest.mark.parametrize("which", ["of_fast_horse", "of_leg"])
def test_an_export_is_known_and_is_not_to_be_turned(which, suffix, request, tmp_path):
    record, about = request.getfixturevalue(which)
    found = read_record(records.write(record, about, tmp_path / f"x{suffix}"))
    assert found.own
    assert found.notes == ()
    said = report(compare(found, found))
    assert "an export of this package" in said
    assert "warning" not in said
    assert ("propulsion before braking, as legs of the model" in said) == (which == "of_fast_horse")


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_an_export_that_another_program_saved_again_is_known(of_horse, suffix, tmp_path):
    """A spreadsheet with semicolons and decimal commas, and a table without metadata."""
    path = records.write(*of_horse, tmp_path / f"x{suffix}")
    if suffix == ".csv":
        text = path.read_text()
        path.write_text(text.replace(",", ";").replace(".", ","))
    else:
        pytest.importorskip("pyarrow")
        from pyarrow import parquet

        parquet.write_table(parquet.read_table(path).replace_schema_metadata(None), path)
    found = read_record(path, unit="N")
    assert found.own
    assert found.notes == ()


def test_an_export_in_body_weights_is_known(of_horse, tmp_path):
    record, about = of_horse
    written, description = in_units(record, about, "BW")
    assert read_record(records.write(written, description, tmp_path / "x.csv")).own


def measured(model, turn):
    """A file's record with the vertical forces of the model, and its fore-aft forces times `turn`."""
    limbs = {limb: force * [turn, 1] for limb, force in model.limbs.items()}
    return ForceRecord("lab.csv", model.time, limbs, "N", model.weight)


def test_a_measurement_that_brakes_first_is_not_to_be_turned(of_fast_horse, tmp_path):
    record, about = of_fast_horse
    model = read_record(records.write(record, about, tmp_path / "horse.csv"))
    lab = measured(model, -1)
    assert propelling_first(model.limbs, model.time)
    assert not propelling_first(lab.limbs, lab.time)
    for pair in ((model, lab), (lab, model)):
        said = report(compare(*pair))
        assert (
            "fore-aft forces point opposite ways; braking and propulsion of horse.csv are the model's" in said
        )
        assert "--reverse" not in said
        assert "--forward" not in said


def test_a_measurement_that_propels_first_is_the_one_to_be_turned():
    model, lab = strides(), strides()
    model.own = True
    lab.limbs = {limb: force * [-1, 1] for limb, force in lab.limbs.items()}
    assert "opposite ways; --reverse-b x turns B" in report(compare(model, lab))
    assert "opposite ways; --reverse-a x turns A" in report(compare(lab, model))


def test_a_file_of_another_program_is_not_ours(tmp_path):
    lines = ["time,left_force_x [N],left_force_y [N]", *(f"{k / 100},0,{k % 7}" for k in range(300))]
    (tmp_path / "x.csv").write_text("\n".join(lines))
    assert not read_record(tmp_path / "x.csv").own


def test_two_exports_are_not_to_be_turned():
    one, other = strides(), strides()
    one.own = other.own = True
    other.limbs = {limb: force * [-1, 1] for limb, force in other.limbs.items()}
    assert "opposite ways; both records are exports of this package" in report(compare(one, other))
    assert np.isfinite(compare(one, other).shift)
