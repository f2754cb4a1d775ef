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
    assert 'pip install "hoof-env[plot]"' in capsys.readouterr().err


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


def test_an_interrupt_while_kernels_compile_is_one_line(tmp_path, monkeypatch, capsys):
    def compiling(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("hoof_env.paper.reproduce.reproduce", compiling)
    assert cli.main(["reproduce", "--out", str(tmp_path), "--no-figures"]) == 130
    assert capsys.readouterr().err == "interrupted\n"
