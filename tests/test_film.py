"""Films: as many frames as asked for, of the right moments, and never half a file."""

from __future__ import annotations

import shlex
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from hoof_env import cli
from hoof_env import film as render_clip
from hoof_env.film import frames, write_film
from hoof_env.records import episode, find_policy, make_env, surroundings
from hoof_env.render.renderer import Renderer

pytest.importorskip("pygame")
iio = pytest.importorskip("imageio.v3")
pytest.importorskip("imageio_ffmpeg")

LEG = "hoof_env/HorseLeg-v0"
SMALL = ["--size", "480", "270"]


@pytest.mark.parametrize(
    ("name", "options", "count"),
    [
        ("run.mp4", ["--seconds", "0.2"], 11),
        ("run.MP4", ["--seconds", "0.1", "--slow", "4", "--fps", "25"], 11),
        ("walk.gif", ["--seconds", "0.2", "--fps", "25", "--policy", "walk"], 6),
        ("fast.gif", ["--seconds", "0.2", "--slow", "0.5", "--policy", "random"], 6),
        (
            "fixed.mp4",
            ["--seconds", "0.1", "--env-id", "hoof_env/HorseLegFixed-v0", "--env-kwargs", "gait=run"],
            6,
        ),
        (
            "short.mp4",
            ["--seconds", "9", "--env-kwargs", "episode_seconds=0.1", "--policy", "6,0.7,-0.2,-0.3"],
            6,
        ),
    ],
)
def test_a_film_has_its_frames(name, options, count, tmp_path, capsys):
    out = tmp_path / "new" / name
    assert cli.main(["render", "--out", str(out), *SMALL, *options]) == 0
    film = iio.imread(out)
    assert film.shape == (count, 270, 480, 3)
    assert (film[0] != film[-1]).any()
    assert f"{count} frames" in capsys.readouterr().out
    assert [file.name for file in out.parent.iterdir()] == [name]


def test_slow_motion_shows_the_substeps_between():
    with make_env(LEG) as env:
        renderer = Renderer(surroundings(env), size=(480, 270))

        def play(fps, slow):
            pictures = frames(renderer, episode(env, find_policy("run", env, LEG), 0, 0.1), fps, slow)
            return np.array([renderer.latest.time for _ in pictures])

        np.testing.assert_allclose(play(50, 1), np.arange(6) * 0.02, atol=1e-9)
        np.testing.assert_allclose(play(50, 4), np.arange(21) * 0.005, atol=1e-9)
        np.testing.assert_allclose(play(25, 1), np.arange(3) * 0.04, atol=1e-9)
        assert len(play(50, 40)) == pytest.approx(201, abs=1)  # finer than the substeps: repeated


def test_a_failure_leaves_the_old_film_as_it_was(tmp_path):
    out = tmp_path / "run.mp4"
    out.write_bytes(b"old")

    def broken():
        yield np.zeros((64, 64, 3), np.uint8)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_film(broken(), out, 50)
    assert out.read_bytes() == b"old"
    assert [file.name for file in tmp_path.iterdir()] == ["run.mp4"]


@pytest.mark.parametrize("is_terminal", [False, True])
def test_a_film_in_the_making_says_how_far_it_is(is_terminal, tmp_path, capsys, monkeypatch):
    if is_terminal:
        pytest.importorskip("tqdm")
    monkeypatch.setattr(render_clip, "TELL_SECONDS", 0.0)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: is_terminal)
    command = ["render", "--out", str(tmp_path / "x.mp4"), *SMALL, "--seconds", "0.1"]
    assert cli.main(command) == 0
    said = capsys.readouterr()
    assert ("/6 [" if is_terminal else "6 of 6 frames\n") in said.err
    assert said.out.count("\n") == 1


@pytest.mark.skipif(sys.platform != "linux", reason="no RLIMIT_FSIZE")
@pytest.mark.parametrize("name", ["x.mp4", "x.gif"])
def test_a_film_that_ffmpeg_could_not_end_is_an_error_not_a_film(name, tmp_path):
    """A limit on the size of files stands for a full disk: ffmpeg fails after it took the last picture."""
    command = [sys.executable, "-m", "hoof_env", "render", "--out", str(tmp_path / name), *SMALL]
    limited = f"ulimit -f 4; exec {shlex.join([*command, '--seconds', '0.5'])}"
    done = subprocess.run(["bash", "-c", limited], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 2, done.stderr
    assert "ffmpeg could not write the whole film; is the disk full?" in done.stderr.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []


def _is_begun(folder):
    """Whether a film is being written; the trial folder that the command makes first comes and goes."""
    try:
        return any(file.stat().st_size for file in folder.glob(".unfinished-*/*"))
    except FileNotFoundError:
        return False


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to another process")
def test_an_interrupt_is_one_line_and_leaves_nothing_behind(tmp_path):
    command = [sys.executable, "-m", "hoof_env.cli", "render", "--out", str(tmp_path / "x.mp4")]
    options = ["--seconds", "1000", "--env-kwargs", "episode_seconds=1000"]
    with subprocess.Popen([*command, *options], stderr=subprocess.PIPE, text=True) as process:
        while not _is_begun(tmp_path):
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=300)
    assert process.returncode == 130
    assert errors.splitlines()[-1].endswith("interrupted")
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []
