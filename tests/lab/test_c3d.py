"""ezc3d finds in our c3d files what a laboratory expects: plates, channels, units and rate."""

from __future__ import annotations

import numpy as np
import pytest

from hoof_env import records
from hoof_env.ground.terrain import Terrain
from hoof_env.lab.c3d import CHANNELS, MARKERS, plane_of
from hoof_env.lab.forces import loaded
from hoof_env.lab.read import read_record
from hoof_env.tasks.horse_gaits import LEGS


def read(path):
    ezc3d = pytest.importorskip("ezc3d", reason='pip install "hoof-env[lab]"')
    return ezc3d.c3d(str(path), extract_forceplat_data=True)


@pytest.fixture
def need_ezc3d():
    pytest.importorskip("ezc3d", reason='pip install "hoof-env[lab]"')


@pytest.mark.usefixtures("need_ezc3d")
def test_every_limb_has_a_plate(of_horse, tmp_path):
    record, about = of_horse
    file = read(records.write(record, about, tmp_path / "horse.c3d"))
    p = {group: {name: one["value"] for name, one in rows.items() if name != "__METADATA__"}
         for group, rows in file["parameters"].items()}  # fmt: skip
    assert list(p["FORCE_PLATFORM"]["USED"]) == [4]
    assert list(p["FORCE_PLATFORM"]["TYPE"]) == [2] * 4
    assert p["FORCE_PLATFORM"]["CORNERS"].shape == (3, 4, 4)
    np.testing.assert_array_equal(p["FORCE_PLATFORM"]["CHANNEL"].T.ravel(), np.arange(1, 25))
    assert p["ANALOG"]["LABELS"] == [f"{leg}_{name}" for leg in LEGS for name in CHANNELS]
    assert p["ANALOG"]["UNITS"] == [*CHANNELS.values()] * 4
    assert p["POINT"]["LABELS"] == [*(f"{leg}_{name}" for leg in LEGS for name in MARKERS), "trunk"]
    assert p["POINT"]["UNITS"] == ["mm"]
    assert p["ANALOG"]["RATE"][0] == p["POINT"]["RATE"][0] == pytest.approx(1000.0)
    assert p["HOOF_ENV"]["LIMBS"] == list(LEGS)
    assert list(p["HOOF_ENV"]["THRESHOLD"]) == [about["threshold_n"]]
    assert file["data"]["points"].shape == (4, 9, len(record["time"]))
    np.testing.assert_allclose(file["data"]["points"][0, 0], 1e3 * record["left_fore_toe_x"], rtol=1e-6)
    np.testing.assert_allclose(file["data"]["points"][2, -1], 1e3 * record["y"], rtol=1e-6)


@pytest.mark.usefixtures("need_ezc3d")
@pytest.mark.parametrize("which", ["of_horse", "of_leg", "of_slope"])
def test_ezc3d_finds_force_and_centre_of_pressure(which, request, tmp_path):
    """In the laboratory's frame, x forward, y left, z up; the force of the ground on the limb points up. On a
    slope this turns by the corners of the plate, which lies in the slope."""
    record, about = request.getfixturevalue(which)
    limbs = [f"{leg}_" for leg in LEGS] if which == "of_horse" else [""]
    file = read(records.write(record, about, tmp_path / "x.c3d"))
    for limb, plate in zip(limbs, file["data"]["platform"], strict=True):
        assert (plate["unit_force"], plate["unit_moment"], plate["unit_position"]) == ("N", "Nmm", "mm")
        bears = loaded(record, limb)
        size = record[f"{limb}force_y"].max()
        assert plate["force"][2].max() == pytest.approx(size, rel=1e-6)
        for axis, row in (("x", 0), ("y", 2)):
            np.testing.assert_allclose(plate["force"][row], record[f"{limb}force_{axis}"], atol=1e-6 * size)
            centre = plate["center_of_pressure"][row, bears]
            np.testing.assert_allclose(centre, 1e3 * record[f"{limb}cop_{axis}"][bears], atol=0.05)
        np.testing.assert_allclose(plate["force"][1], 0, atol=1e-6 * size)
        np.testing.assert_allclose(plate["Tz"][:, bears], 0, atol=1e-2)
        assert not plate["force"][:, ~bears].any()


@pytest.mark.usefixtures("need_ezc3d")
def test_our_own_reader_finds_the_same(of_horse, tmp_path):
    record, about = of_horse
    found = read_record(records.write(record, about, tmp_path / "horse.c3d"))
    assert list(found.limbs) == list(LEGS)
    assert found.weight == pytest.approx(about["weight_n"], rel=1e-6)
    for leg in LEGS:
        both = np.column_stack([record[f"{leg}_force_{axis}"] for axis in "xy"])
        np.testing.assert_allclose(found.limbs[leg], both, atol=1e-2)


def test_the_plate_lies_in_the_slope_and_is_level_under_hills():
    middle, along = plane_of(Terrain.slope(0.1), -1.0, 3.0)
    assert middle == pytest.approx(1.0 + 1j * np.tan(0.1))
    assert along == pytest.approx(np.exp(0.1j))
    hills = Terrain.through([0.0, 1.0, 2.0], [0.0, 0.2, 0.0])
    assert plane_of(hills, -1.0, 3.0) == (1.0 + 0j, 1.0 + 0j)


def changed(path, change):
    """The c3d file once more, after `change(file)`."""
    file = read(path)
    change(file)
    file.write(str(path))
    return path


@pytest.mark.usefixtures("need_ezc3d")
def test_units_come_from_the_channels(of_leg, tmp_path):
    path = records.write(*of_leg, tmp_path / "x.c3d")
    newtons = read_record(path)

    def name(unit):
        return changed(path, lambda file: file["parameters"]["ANALOG"]["UNITS"].update(value=unit))

    name(["kN"] * 3 + ["kNm"] * 3)
    thousands = read_record(path)
    assert (newtons.unit, thousands.unit, thousands.per("N")) == ("N", "kN", 1000.0)
    np.testing.assert_allclose(thousands.limbs["leg"], newtons.limbs["leg"])
    name(["V"] * 6)
    assert read_record(path, unit="N").unit == "N"
