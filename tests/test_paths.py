"""Functions that take a path take it as text, too, and refuse what is none."""

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

import hoof_env
from hoof_env import records
from hoof_env.envs.open_loop import GAITS, load_open_loop, open_loop_record
from hoof_env.errors import ParameterError
from hoof_env.evaluation import scores
from hoof_env.film import render_episode, write_film
from hoof_env.lab.average import average, write_table
from hoof_env.lab.compare import compare
from hoof_env.lab.picture import draw
from hoof_env.lab.read import read_record
from hoof_env.policies.catalogue import SHIPPED
from hoof_env.policies.onnx_file import OnnxPolicy
from hoof_env.policies.plain import NumpyPolicy, read_tensors
from hoof_env.policies.record import read_record as read_run

ID = "hoof_env/HorseLeg-v0"


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A record, its description and its file."""
    with gym.make(ID) as env:
        record = records.record_episode(env, "run", 0, seconds=2.0)
        about = records.describe(env, threshold_n=20.0)
    file = records.write(record, about, tmp_path_factory.mktemp("stored") / "a.csv")
    return record, about, file


def calls(record, about, file):
    """Functions of a path by name, with the name of the file."""
    trial = read_record(file)
    found = scores.evaluate(["run"], ID, {"episode_seconds": 0.1}, episodes=1)
    pictures = [np.zeros((270, 480, 3), np.uint8)] * 2
    weights = SHIPPED / "HorseLeg-v0" / "policy.safetensors"
    return {
        "records.write": ("r.csv", lambda path: records.write(record, about, path)),
        "records.write of OpenSim": (
            "r.mot",
            lambda path: records.write(record, about | {"bodies": {}}, path),
        ),
        "records.write_csv": ("w.csv", lambda path: records.write_csv(record, about, path)),
        "export_episode": ("e.csv", lambda path: records.export_episode(path, "run", ID, seconds=0.1)),
        "write_film": ("f.gif", lambda path: write_film(pictures, path, 10)),
        "render_episode": ("e.gif", lambda path: render_episode(path, "run", ID, seconds=0.1, fps=10)),
        "write_table": ("t.csv", lambda path: write_table(average([trial]), path)),
        "draw": ("c.png", lambda path: draw(compare(trial, trial), path)),
        "scores.write_json": ("s.json", lambda path: scores.write_json(found, path)),
        "scores.write_csv": ("s.csv", lambda path: scores.write_csv(found, path)),
        "read_record": (file, read_record),
        "NumpyPolicy": (SHIPPED / "HorseLeg-v0", NumpyPolicy),
        "read_tensors": (weights, read_tensors),
        "read_run": (weights.parent, read_run),
        "open_loop_record": (GAITS / "HorseLeg-v0-phase.json", open_loop_record),
        "load_open_loop": (
            GAITS / "HorseLeg-v0-phase.json",
            lambda path: load_open_loop(path, gym.make(ID)),
        ),
        "load_geometry": (Path("mine.json"), hoof_env.load_geometry),
        "Geometry.to_mjcf": ("m.xml", lambda path: hoof_env.load_geometry().to_mjcf(path)),
    }


def test_text_and_path_alike(stored, tmp_path, monkeypatch):
    pytest.importorskip("imageio_ffmpeg")
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    hoof_env.load_geometry().save("mine.json")
    for name, (file, call) in calls(*stored).items():
        for kind in (str, Path):
            call(kind(file))
            assert Path(file).exists(), name


@pytest.mark.parametrize("what", [3, None, ["a.csv"]])
def test_arguments_other_than_paths_are_refused(stored, what):
    pytest.importorskip("imageio_ffmpeg")
    for name, (_, call) in calls(*stored).items():
        # Without a path there is no file, or the run folder's default.
        if what is None and name in ("Geometry.to_mjcf", "load_geometry"):
            continue
        if name in ("load_open_loop", "read_record", "load_geometry"):
            continue
        with pytest.raises(ParameterError, match=r"path|folder"):
            call(what)


def test_a_page_that_stands_alone(tmp_path):
    pytest.importorskip("bokeh")
    from hoof_env.view.playback import Playback

    page = Playback.of_policy(ID, "walk", seconds=0.2)
    assert page.write(str(tmp_path / "p.html")) == page.write(tmp_path / "p.html") == tmp_path / "p.html"


def test_a_file_name_in_place_of_a_record_is_refused(stored):
    name = str(stored[2])
    for call in (lambda: compare(name, name), lambda: average([name]), lambda: average(name)):
        with pytest.raises(ParameterError, match=r"record.*read_record returns"):
            call()


def test_onnx(tmp_path):
    pytest.importorskip("onnxruntime")
    from agents.cards import POLICIES

    file = POLICIES / "HorseLeg-v0" / "policy.onnx"
    assert OnnxPolicy(str(file)).path == OnnxPolicy(file).path == file
    assert OnnxPolicy(str(file.parent)).path == file
