import json
import os
import signal
import subprocess
import sys

import pytest

from hoof_env import __version__, cli

HOOF_ENV = [sys.executable, "-m", "hoof_env.cli"]


@pytest.mark.parametrize("module", ["hoof_env", "hoof_env.cli"])
def test_the_package_runs_as_the_command(module):
    command = [sys.executable, "-m", module, "--version"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"hoof-env {__version__}\n", "")


@pytest.mark.parametrize(
    ("arguments", "words"), [(["--help"], cli.COMMANDS), (["reproduce", "--help"], ["--no-figures"])]
)
def test_help_lists_the_sub_commands_and_explains_their_options(arguments, words, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(arguments)
    assert stop.value.code == 0
    said = capsys.readouterr().out
    assert all(word in said for word in words)


@pytest.mark.parametrize(
    "arguments", [["reproduec"], [], ["reproduce"], ["reproduce", "--out", "x", "--speed", "2"]]
)
def test_wrong_arguments_exit_with_2(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(arguments)
    assert stop.value.code == 2
    assert "Traceback" not in capsys.readouterr().err


def test_reproduce_writes_its_results(tmp_path, capsys):
    folder = tmp_path / "new" / "folder"
    assert cli.main(["reproduce", "--out", str(folder), "--no-figures"]) == 0
    assert "exact, run, inelastic: peak" in capsys.readouterr().out
    assert {file.name for file in folder.iterdir()} == {"reproduction.json", "reproduction.md"}
    assert len(json.loads((folder / "reproduction.json").read_text(encoding="utf-8"))) == 99
    page = (folder / "reproduction.md").read_text(encoding="utf-8")
    assert f"hoof-env reproduce --out {folder} --no-figures" in page


def test_a_folder_that_cannot_be_written_is_one_line_before_anything_runs(tmp_path, capsys):
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    assert cli.main(["reproduce", "--out", str(tmp_path / "file")]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("hoof-env: error: cannot write to")
    assert said.err.count("\n") == 1
    assert (tmp_path / "file").read_text(encoding="utf-8") == "mine"


def test_an_error_on_the_way_is_one_line(tmp_path, capsys):
    assert cli.main(["reproduce", "--out", str(tmp_path), "--preset", "nobody"]) == 2
    assert capsys.readouterr().err.startswith("hoof-env: error: preset: expected one of")
    assert list(tmp_path.iterdir()) == []


def test_figures_without_matplotlib_are_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert cli.main(["reproduce", "--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert 'pip install "hoof-env[plot]", or leave them out with --no-figures' in said


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to another process")
def test_an_interrupt_is_one_line_and_leaves_nothing_behind(tmp_path):
    command, pipe = [*HOOF_ENV, "reproduce", "--out", str(tmp_path)], subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as process:
        process.stdout.readline()  # the first condition is done, the others remain
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=300)
    assert process.returncode == 130
    assert errors == "interrupted\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGPIPE")
def test_a_reader_that_leaves_is_no_error():
    read, write = os.pipe()
    os.close(read)
    command = [*HOOF_ENV, "manual"]
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True, timeout=300, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, "")


BAD_REQUESTS = {
    "export": [
        (["--out", "{}/x.txt"], "expected a file that ends in .c3d, .csv, .mot, .parquet, .sto"),
        (["--out", "{}/x.csv", "--policy", "gallop"], "policy: expected a name"),
        (["--out", "{}/x.csv", "--policy", "1,0.2,0.3,nan"], "swing_cos: expected"),
        (["--out", "{}/x.csv", "--policy", "99,0,0,0"], "expected crank_speed from 0 to 12.5664"),
        (["--out", "{}/x.csv", "--policy", "no.zip"], "model no.zip"),
        (["--out", "{}/x.csv", "--id", "hoof_env/Nobody-v0"], "environment 'hoof_env/Nobody-v0'"),
        (["--out", "{}/x.csv", "--id", "CartPole-v1"], "expected one leg of this package"),
        (["--out", "{}/x.csv", "--args", "wings=2"], "wings"),
        (["--out", "{}/x.csv", "--args", "trunk"], "--args: expected a JSON object or key=value"),
        (["--out", "{}/x.csv", "--args", "trunk=cloud"], "trunk: expected one of"),
        (["--out", "{}/x.csv", "--seconds", "0"], "seconds: expected"),
        (["--out", "{}/x.csv", "--seed", "-1"], "seed: expected"),
        (["--out", "{}"], "expected a file that ends in"),
        (["--out", "{}/taken/x.csv"], "cannot write to"),
        (["--out", "{}/x.csv", "--threshold", "-1"], "threshold: expected"),
        (["--out", "{}/x.csv", "--units", "lb"], "units: expected one of BW, N"),
        (["--out", "{}/x.mot", "--units", "BW"], "units: expected N in .mot"),
        (["--out", "{}/x.mot", "--bodies", "tail=x"], "bodies: expected leg=BODY"),
    ],
    "render": [
        (["--out", "{}/x.avi"], "expected a file that ends in .gif, .mp4"),
        (["--out", "{}/x.gif", "--fps", "60"], "fps: expected 50, 25"),
        (["--out", "{}/x.mp4", "--fps", "0"], "fps: expected"),
        (["--out", "{}/x.mp4", "--slow", "0"], "slow: expected"),
        (["--out", "{}/x.mp4", "--seconds", "-1"], "seconds: expected"),
        (["--out", "{}/x.mp4", "--seconds", "nan"], "seconds: expected"),
        (["--out", "{}/x.mp4", "--size", "10", "10"], "size: expected"),
        (["--out", "{}/x.mp4", "--policy", "gallop"], "policy: expected"),
        (["--out", "{}/a/b/x.mp4", "--policy", "gallop"], "policy: expected"),
        (["--out", "{}/x.mp4", "--args", "render_mode=human"], "render_mode: expected"),
    ],
    "mjcf": [
        (["--out", "{}/x.urdf"], "expected a file that ends in .xml"),
        (["--out", "{}/x.xml", "--trunk", "cloud"], "trunk: expected one of"),
        (["--out", "{}/x.xml", "--preset", "nothing"], "preset: expected"),
        (["--out", "{}/x.xml", "--theta", "nan"], "theta: expected"),
        (["--out", "{}/taken/x.xml"], "cannot write to"),
    ],
}


@pytest.mark.parametrize(
    ("command", "options", "words"), [(name, *row) for name, rows in BAD_REQUESTS.items() for row in rows]
)
def test_a_bad_request_is_one_line_and_leaves_nothing(command, options, words, tmp_path, capsys):
    (tmp_path / "taken").write_text("mine", encoding="utf-8")
    assert cli.main([command, *(text.format(tmp_path) for text in options)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert [file.name for file in tmp_path.iterdir()] == ["taken"]


@pytest.mark.parametrize(
    ("command", "name", "change"),
    [
        (["export", "--seconds", "0.1"], "x.csv", "--seed"),
        (["render", "--size", "480", "270", "--seconds", "0.1"], "x.mp4", "--seed"),
        (["mjcf"], "x.xml", "--theta"),
    ],
)
def test_a_file_is_replaced_on_demand_only_and_its_folder_is_told(command, name, change, tmp_path, capsys):
    out = tmp_path / "new" / name
    command = [*command, "--out", str(out)]
    assert cli.main(command) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"{out}: ")
    assert said.endswith(f"B; made the folder {out.parent}\n")
    first = out.read_bytes()
    assert cli.main([*command, change, "1"]) == 2
    refusal = f"hoof-env: error: {str(out)!r} exists already; name another file, or add --overwrite\n"
    assert capsys.readouterr().err == refusal
    assert out.read_bytes() == first
    assert cli.main([*command, change, "1", "--overwrite"]) == 0
    assert out.read_bytes() != first
    assert "folder" not in capsys.readouterr().out


@pytest.mark.parametrize("columns", ["1", "5"])
def test_help_ends_in_a_narrow_terminal(columns):
    ours = os.environ | {"COLUMNS": columns}
    done = subprocess.run([*HOOF_ENV, "--help"], env=ours, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0
    assert "reproduce" in done.stdout


def test_what_the_encoding_lacks_is_replaced(tmp_path):
    ours = os.environ | {"PYTHONIOENCODING": "ascii"}
    command = [*HOOF_ENV, "manual", "--out", str(tmp_path / "Größe")]
    done = subprocess.run(command, env=ours, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
    assert "Gr??e" in done.stdout


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a disk that is always full")
def test_a_full_disk_is_one_line():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*HOOF_ENV, "manual"], stdout=full, stderr=subprocess.PIPE, text=True, timeout=120
        )
    assert done.returncode == 2
    assert done.stderr == "hoof-env: error: cannot write the output: No space left on device\n"


def test_an_id_of_a_module_in_the_current_folder(tmp_path):
    """The command finds it, as `python -m hoof_env` does; its page says which module registers it."""
    (tmp_path / "my_task.py").write_text(
        'import hoof_env\nhoof_env.register("mine/X-v0", base="rail", friction=0.7)\n'
    )
    bin = tmp_path / "bin"
    bin.mkdir()
    (bin / "hoof-env").write_text("import sys\nfrom hoof_env.cli import main\nsys.exit(main())\n")
    command = [sys.executable, str(bin / "hoof-env"), "manual", "--id", "my_task:mine/X-v0"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[0] == "# mine/X-v0"
    assert "import my_task  # registers the ids" in lines
    assert 'A worker process that has not imported it takes `"my_task:mine/X-v0"`.' in lines
