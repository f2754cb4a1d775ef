"""Force plates that lie, are turned and are zeroed as in other laboratories: the forces are those that were
put in, in whatever axes; and what cannot be known is said."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from hoof_env import cli
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.lab.average import average
from hoof_env.lab.compare import compare
from hoof_env.lab.picture import report
from hoof_env.lab.read import read_record
from tests.lab.made import ASIDE, AXES, FORWARD, OFFSETS, RATE, TIME, UP, ezc3d, plate

pytest.importorskip("ezc3d", reason='pip install "hoof-env[lab]"')


@pytest.mark.parametrize(("up", "forward"), [(u, f) for u in AXES for f in AXES if u[-1] != f[-1]])
def test_forces_are_found_in_every_frame(up, forward, tmp_path):
    """The upward axis by the corners alone, the direction of travel by an option."""
    found = read_record(plate(tmp_path / "x.c3d", up, forward), forward=forward)
    assert found.turned == ()
    assert found.notes == ()
    np.testing.assert_allclose(found.limbs["plate_1"], np.column_stack([FORWARD, UP]), atol=1e-3)


def test_markers_decide_where_corners_have_another_order(tmp_path):
    path = plate(tmp_path / "x.c3d", other_order=True, markers=np.array([0.0, 0.0, 900.0]))
    np.testing.assert_allclose(read_record(path).limbs["plate_1"][:, 1], UP, atol=1e-3)


def test_travel_along_another_axis_and_backward_are_reported(tmp_path):
    aside = read_record(plate(tmp_path / "y.c3d", forward="y"))
    assert "plate_1: the horizontal force along y is larger than the force along x" in aside.notes[0]
    assert "--forward-a=y or --forward-b=y (or =-y) changes that" in aside.notes[0]
    assert f"warning: y.c3d: {aside.notes[0]}" in report(compare(aside, aside))
    right = read_record(tmp_path / "y.c3d", forward="y")
    assert "; --forward-b=y (or =-y) changes that" in report(compare(right, aside))
    assert "; --forward-a=y (or =-y) changes that" in report(compare(aside, right))
    assert "; --forward=y (or =-y) changes that" in average([aside, right]).warnings[0]
    back = read_record(plate(tmp_path / "x.c3d", forward="-x"))
    assert "plate_1: propulsion before braking" in back.notes[0]
    assert "--forward-a=-x or --forward-b=-x" in back.notes[0]
    assert read_record(tmp_path / "x.c3d", forward="-x").notes == ()
    wrong = read_record(tmp_path / "x.c3d", up="y")
    assert "the force along z is larger than the force along y" not in "".join(
        wrong.notes
    )  # what the option says


def test_a_text_with_z_up_is_reported(tmp_path):
    rows = np.column_stack([TIME, FORWARD, ASIDE, UP])
    names = ["time [s]", *(f"left_force_{axis} [N]" for axis in "xyz")]
    np.savetxt(tmp_path / "x.csv", rows, delimiter=",", header=",".join(names), comments="")
    found = read_record(tmp_path / "x.csv")
    assert "left: the force along z is larger than the force along y" in found.notes[0]
    assert "--up-a=z or --up-b=z" in found.notes[0]
    found = read_record(tmp_path / "x.csv", up="z")
    assert found.notes == ()
    np.testing.assert_allclose(found.limbs["left"], np.column_stack([FORWARD, UP]))


def test_an_axis_with_a_minus_is_not_read_as_an_option(tmp_path, capsys):
    path = str(plate(tmp_path / "x.c3d", forward="-x"))
    for option in (["--forward", "-x"], ["--forward=-x"]):
        out = str(tmp_path / "x.csv")
        assert cli.main(["average", path, "--out", out, "--overwrite", *option]) == 0
        assert "warning" not in capsys.readouterr().out


def test_the_baseline_is_subtracted(tmp_path):
    found = read_record(plate(tmp_path / "x.c3d", zero=(1, 10), offsets=OFFSETS))
    assert (found.turned, found.notes) == ((), ())
    np.testing.assert_allclose(found.limbs["plate_1"], np.column_stack([FORWARD, UP]), atol=1e-3)
    np.testing.assert_allclose(found.limbs["plate_2"], 0.0, atol=1e-3)


@pytest.mark.parametrize("noise", [2.0, 15.0])
def test_the_baseline_of_noisy_plates_is_subtracted(noise, tmp_path):
    found = read_record(plate(tmp_path / "x.c3d", zero=(1, 35), offsets=OFFSETS, noise=noise))
    assert (found.turned, found.notes) == ((), ())
    for limb, truth in (("plate_1", UP), ("plate_2", 0 * UP)):
        assert abs((found.limbs[limb][:, 1] - truth).mean()) < 0.5 * noise


@pytest.mark.parametrize("zero", [(0, 0), (1, 0)])
def test_without_frames_for_it_there_is_no_baseline(zero, tmp_path):
    found = read_record(plate(tmp_path / "x.c3d", zero=zero, offsets=OFFSETS))
    assert found.notes == ()
    np.testing.assert_allclose(found.limbs["plate_1"], np.column_stack([FORWARD + 7, UP + 30]), atol=1e-3)


@pytest.mark.parametrize(("zero", "words"), [
    ((45, 85), "plate_1 bore a load"),
    ((60, 70), "plate_1 bore a load"),
    ((64, 66), "plate_1 bore a load"),
    ((1, 43), "plate_1 bore a load"),
    ((1, 400), "the file has 300 frames"),
])  # fmt: skip
def test_a_baseline_of_a_loaded_plate_is_not_used(zero, words, tmp_path):
    found = read_record(plate(tmp_path / "x.c3d", zero=zero, offsets=OFFSETS))
    assert words in found.notes[0]
    assert f"FORCE_PLATFORM:ZERO names frames {zero[0]} to {zero[1]}" in found.notes[0]
    np.testing.assert_allclose(found.limbs["plate_1"][:, 1], UP + 30, atol=1e-3)


def test_the_clock_of_a_file_begins_at_its_first_frame(tmp_path):
    whole = read_record(plate(tmp_path / "a.c3d"))
    later = read_record(plate(tmp_path / "b.c3d", first=51, zero=(51, 60), offsets=OFFSETS[:1]))
    assert later.notes == ()
    assert (whole.time[0], later.time[0]) == (0.0, 0.5)
    assert compare(whole, later).shift == pytest.approx(-0.5)
    assert read_record(tmp_path / "b.c3d", rate=RATE).time[0] == pytest.approx(0.5)


def test_plates_are_given_to_limbs_and_added(tmp_path):
    path = plate(tmp_path / "x.c3d", offsets=OFFSETS)
    added = np.column_stack([FORWARD + 2, UP - 16])
    for mapping in (
        {"left": "plate_1+plate_2"},
        {f"left_force_{a}": f"plate_1_force_{a} + plate_2_force_{a}" for a in "xy"},
        {"left_force_x": "plate_1_x+plate_2_x", "left_force_y": "plate_1_z+plate_2_z"},
    ):
        found = read_record(path, mapping, reverse="none")
        assert list(found.limbs) == ["left"]
        np.testing.assert_allclose(found.limbs["left"], added, atol=1e-3)
    found = read_record(path, {"right_force_y": "plate_1_z - plate_2_z", "left": "plate_2"}, reverse="none")
    np.testing.assert_allclose(found.limbs["right"][:, 1], UP + 76, atol=1e-3)
    assert list(found.limbs) == ["right", "left"]


@pytest.mark.parametrize("seed", range(12))
def test_a_damaged_file_is_one_line(seed, tmp_path):
    """In the places where ezc3d ran for ever or ended the process, among others."""
    content = bytearray(plate(tmp_path / "x.c3d").read_bytes())
    rng = np.random.default_rng(seed)
    at = 512 + 2 * int(rng.integers(600))
    content[at : at + 2] = (b"\xff\xff", b"\xff\x7f", b"\0\x80")[seed % 3]
    (tmp_path / "y.c3d").write_bytes(content)
    said = "y.c3d"
    try:
        read_record(tmp_path / "y.c3d")
    except (DataFileError, ParameterError) as error:
        said = str(error)
    assert "y.c3d" in said
    assert "issue" not in said
    assert "\n" not in said


def test_frames_are_counted_by_the_cameras(tmp_path):
    """Plates are sampled ten times as often: frames 1 to 3 are 30 samples."""
    path = plate(tmp_path / "x.c3d", zero=(1, 3), offsets=OFFSETS)
    file = ezc3d().c3d(str(path))
    file["parameters"]["POINT"]["RATE"]["value"] = [RATE / 10]
    file["data"]["points"] = file["data"]["points"][:, :, ::10]
    file["data"]["meta_points"]["residuals"] = file["data"]["meta_points"]["residuals"][:, :, ::10]
    file["data"]["meta_points"]["camera_masks"] = file["data"]["meta_points"]["camera_masks"][:, :, ::10]
    file.write(str(path))
    content = bytearray(path.read_bytes())
    struct.pack_into("<2H", content, 6, 6, 35)  # the trial's frames from the 6th on
    path.write_bytes(content)
    found = read_record(path)
    assert (found.notes, found.rate, found.time[0]) == ((), pytest.approx(RATE), pytest.approx(0.5))
    np.testing.assert_allclose(found.limbs["plate_1"], np.column_stack([FORWARD, UP]), atol=1e-3)
