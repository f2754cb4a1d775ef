"""A file that a user names is read if it is a file, and a name of any characters can be shown."""

import os
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import pytest

import hoof_env
from hoof_env import cli
from hoof_env._input import MAX_BYTES, read_text
from hoof_env.errors import DataFileError, OutputError

needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")


@pytest.fixture
def special(tmp_path):
    """A pipe, a link to a device and a file of no end, by name."""
    os.mkfifo(tmp_path / "pipe.json")
    (tmp_path / "zero.json").symlink_to("/dev/zero")
    with (tmp_path / "endless.json").open("wb") as file:
        file.truncate(MAX_BYTES + 1)
    return tmp_path


@needs_pipes
@pytest.mark.parametrize("name", ["pipe.json", "zero.json", "endless.json"])
def test_a_file_that_has_no_end_is_refused_at_once(special, name):
    path = special / name
    with pytest.raises(OSError, match="expected "):
        read_text(path)
    for read in (lambda: hoof_env.load_geometry(path), lambda: gym.make("hoof_env/HorseLeg-v0", preset=path)):
        with pytest.raises(DataFileError, match=f"{name}: expected "):
            read()
    env = gym.make("hoof_env/HorseLeg-v0")
    with pytest.raises(DataFileError, match=rf"{name}: expected "):
        hoof_env.load_policy(path, env)


@needs_pipes
@pytest.mark.parametrize("name", ["policy.json", "policy.safetensors", "policy.onnx"])
def test_a_policy_that_is_a_pipe_is_refused(tmp_path, name):
    shipped = Path(hoof_env.__file__).parent / "data/policies/HorseLeg-v0"
    for file in ("policy.json", "policy.safetensors", "run.json"):
        if name not in (file, "policy.onnx"):
            (tmp_path / file).write_bytes((shipped / file).read_bytes())
    os.mkfifo(tmp_path / name)
    with pytest.raises(DataFileError, match=r"expected|found no"):
        hoof_env.load_policy(
            tmp_path / name if name.endswith("onnx") else tmp_path, gym.make("hoof_env/HorseLeg-v0")
        )


@needs_pipes
def test_a_pipe_is_not_replaced_by_a_result(tmp_path):
    out = tmp_path / "record.csv"
    os.mkfifo(out)
    assert cli.main(["export", "--out", str(out), "--seconds", "0.1", "--overwrite"]) == 2
    assert out.is_fifo()


@pytest.mark.parametrize("name", ["a\x1b[31mred", "b\x9b1m", "c\u202etxt"])
def test_the_control_characters_of_a_name_do_not_reach_the_terminal(tmp_path, capsys, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    record = f"{name}.csv"
    made = ["export", "--out", record, "--policy", "run", "--seconds", "1"]
    assert cli.main(made) == 0
    assert cli.main(made) == 2
    assert cli.main(["average", record, "--out", f"{name} mean.csv"]) == 0
    assert cli.main(["compare", record, record, "--out", f"{name}.png"]) == 0
    assert cli.main(["render", "--policy", f"{name}.json", "--out", "x.gif"]) == 2
    shown = "".join(capsys.readouterr())
    assert name[1] not in shown
    assert name[1].encode("unicode_escape").decode() in shown


@pytest.mark.skipif(sys.platform != "linux", reason="needs file names of any bytes")
def test_a_name_in_no_encoding_is_shown_with_its_bytes(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = os.fsdecode(b"\xff leg.csv")
    assert cli.main(["export", "--out", name, "--policy", "run", "--seconds", "2"]) == 0
    assert cli.main(["compare", name, name, "--out", "x.png"]) == 0
    assert "\\udcff leg.csv" in capsys.readouterr().out


@pytest.mark.parametrize("option", [["--out", ""], ["--out="]])
def test_an_argument_without_a_value_is_not_the_working_folder(option, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["manual", *option]) == 2
    assert "--out: expected a value, got an empty string" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_body_with_a_name_that_xml_cannot_hold_is_refused(tmp_path, capsys):
    out = tmp_path / "run.mot"
    assert (
        cli.main(["export", "--out", str(out), "--seconds", "0.1", "--bodies", '{"leg": "a\\u0001b"}']) == 2
    )
    assert "bodies: expected leg=BODY, got leg='a\\x01b'" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    "what",
    [
        "from hoof_env.cli import main; sys.exit(main(['view', '--port', '0', '--no-open']))",
        "from hoof_env.view.playback import Playback",
    ],
)
def test_a_process_without_a_home_is_reported_to_set_one(tmp_path, what):
    pytest.importorskip("bokeh")
    code = (
        "import os, pwd, sys\n"
        "os.environ.pop('HOME', None)\n"
        "def nobody(_): raise KeyError('no such user')\n"
        "pwd.getpwuid = nobody\n"
        f"{what}"
    )
    bare = {key: value for key, value in os.environ.items() if key != "HOME"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=bare, capture_output=True, timeout=60
    )
    assert done.stderr.splitlines()[-1].endswith(b"as in HOME=. hoof-env view")
    if "cli" in what:
        assert done.returncode == 2
        assert len(done.stderr.splitlines()) == 1


def test_a_film_of_any_length_ends_with_its_episode(tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    short = ["--env-kwargs", "episode_seconds=0.1", "--fps", "10", "--seconds", "1e308"]
    assert cli.main(["render", "--out", str(tmp_path / "x.gif"), *short]) == 0
    with pytest.raises(OutputError):
        hoof_env._output.check_new(tmp_path / "x.gif", overwrite=False)
