"""OpenSim reads the motion file and the ExternalLoads that lie beside it, and applies the record's forces."""

from __future__ import annotations

from xml.etree import ElementTree as xml

import numpy as np
import pytest

from hoof_env import cli, records
from hoof_env.lab.opensim import MOT_COLUMNS, loads_path
from hoof_env.lab.read import read_record
from hoof_env.tasks.horse_gaits import LEGS

NEEDED = 'pip install "hoof-env[opensim]"'


def library():
    opensim = pytest.importorskip("opensim", reason=NEEDED)
    opensim.Logger.removeFileSink()  # it would leave opensim.log where tests run
    return opensim


@pytest.fixture(params=[".mot", ".sto"])
def written(request, of_horse, tmp_path):
    record, about = of_horse
    return record, records.write(
        record, about | {"bodies": {"left_fore": "LF"}}, tmp_path / f"h{request.param}"
    )


def test_the_loads_name_the_columns_the_bodies_and_the_file(written):
    _, path = written
    loads = xml.parse(loads_path(path)).getroot().find("ExternalLoads")
    assert loads.findtext("datafile") == path.name
    lines = path.read_text(encoding="utf-8").splitlines()
    columns = lines[lines.index("endheader") + 1].split("\t")
    said = {force.get("name"): force for force in loads.iter("ExternalForce")}
    assert list(said) == list(LEGS)
    named = [
        force.findtext(f"{kind}_identifier") + axis
        for force in said.values() for kind in ("force", "point", "torque") for axis in "xyz"
    ]  # fmt: skip
    assert ["time", *named] == columns
    bodies = [force.findtext("applied_to_body") for force in said.values()]
    assert bodies == ["LF", "right_fore_hoof", "left_hind_hoof", "right_hind_hoof"]


def test_our_own_reader_finds_the_same(written):
    record, path = written
    found = read_record(path)
    assert (found.unit, list(found.limbs), round(found.rate)) == ("N", list(LEGS), 1000)
    for leg in LEGS:
        both = np.column_stack([record[f"{leg}_force_{axis}"] for axis in "xy"])
        np.testing.assert_allclose(found.limbs[leg], both, rtol=1e-9, atol=1e-6)


def test_opensim_reads_every_column(written):
    opensim = library()
    record, path = written
    table = opensim.TimeSeriesTable(str(path))
    names = list(table.getColumnLabels())
    assert names == [f"{leg}_{name}" for leg in LEGS for name in MOT_COLUMNS]
    np.testing.assert_allclose(table.getIndependentColumn(), record["time"], atol=1e-9)
    values = dict(zip(names, table.getMatrix().to_numpy().T, strict=True))
    for leg in LEGS:
        for name, column in MOT_COLUMNS.items():
            expected = record[f"{leg}_{column}"] if column else 0 * record["time"]
            np.testing.assert_allclose(values[f"{leg}_{name}"], expected, rtol=1e-9, atol=1e-9)


def test_opensim_applies_the_loads_to_a_model(written):
    """A model whose only bodies are the hooves, all welded to the ground: at each time the external forces
    equal the record's, at its points."""
    opensim = library()
    record, path = written
    model = opensim.Model()
    for body in ("LF", "right_fore_hoof", "left_hind_hoof", "right_hind_hoof"):
        part = opensim.Body(body, 1.0, opensim.Vec3(0), opensim.Inertia(1))
        model.addBody(part)
        model.addJoint(opensim.WeldJoint(f"{body}_weld", model.getGround(), part))
        part.this.disown()
    loads = opensim.ExternalLoads(str(loads_path(path)), True)
    assert loads.getSize() == 4
    model.addModelComponent(loads)
    loads.this.disown()
    model.initSystem()
    for i, leg in enumerate(LEGS):
        force = loads.get(i)
        assert force.getName() == leg
        for row in range(0, len(record["time"]), 97):
            time = float(record["time"][row])
            for found, kind in ((force.getForceAtTime(time), "force"), (force.getPointAtTime(time), "cop")):
                expected = [record[f"{leg}_{kind}_{axis}"][row] for axis in "xy"]
                np.testing.assert_allclose([found.get(k) for k in range(3)], [*expected, 0.0], atol=1e-3)


def test_a_leg_has_plain_names(of_leg, tmp_path):
    record, about = of_leg
    path = records.write(record, about, tmp_path / "run.sto")
    loads = loads_path(path).read_text(encoding="utf-8")
    assert "<applied_to_body>hoof<" in loads
    assert "<force_identifier>ground_force_v<" in loads
    assert loads_path(path).name == "run_sto_loads.xml"
    assert "<datafile>run.sto<" in loads


def test_a_storage_file_leaves_the_loads_of_a_motion_file_alone(of_leg, tmp_path):
    record, about = of_leg
    motion, storage = (records.write(record, about, tmp_path / name) for name in ("run.mot", "run.sto"))
    for path in (motion, storage):
        assert f"<datafile>{path.name}<" in loads_path(path).read_text(encoding="utf-8")
    assert len(list(tmp_path.iterdir())) == 4


def test_loads_that_are_there_are_not_replaced_unasked(tmp_path, capsys):
    mine = tmp_path / "run_loads.xml"
    mine.write_text("mine", encoding="utf-8")
    command = ["export", "--out", str(tmp_path / "run.mot"), "--seconds", "0.1"]
    assert cli.main(command) == 2
    assert "run_loads.xml' exists already" in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["run_loads.xml"]
    assert cli.main([*command, "--overwrite", "--bodies", "leg=LF", "--threshold", "50", "--reactions"]) == 0
    assert "<applied_to_body>LF<" in mine.read_text(encoding="utf-8")
    assert "joint_G_11_10_x" in (tmp_path / "run.mot").read_text(encoding="utf-8")
    assert "1 BW = 565.0 N" in capsys.readouterr().out
