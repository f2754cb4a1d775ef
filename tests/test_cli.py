import json
import os
import signal
import subprocess
import sys

import pytest

from hoof_env import __version__, cli
from hoof_env.commands.options import names_of

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


def test_reproduce_writes_its_results(tmp_path, capsys, monkeypatch, reproduced):
    def reproduce(progress, *, preset):
        """Say and return what took other tests seconds."""
        assert preset is None
        result, said = reproduced
        for line in said:
            progress(line)
        return result

    monkeypatch.setattr("hoof_env.paper.reproduce.reproduce", reproduce)
    folder = tmp_path / "new" / "folder"
    assert cli.main(["reproduce", "--out", str(folder), "--no-figures"]) == 0
    assert "exact, run, inelastic: peak" in capsys.readouterr().out
    assert {file.name for file in folder.iterdir()} == {"reproduction.json", "reproduction.md"}
    assert len(json.loads((folder / "reproduction.json").read_text(encoding="utf-8"))) == 99 + 22 + 30
    page = (folder / "reproduction.md").read_text(encoding="utf-8")
    assert f"hoof-env reproduce --out {folder} --no-figures" in page


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to another process")
def test_an_interrupt_is_one_line_and_leaves_nothing_behind(tmp_path):
    command, pipe = [*HOOF_ENV, "reproduce", "--out", str(tmp_path)], subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as process:
        # The first condition is done, the others remain
        assert process.stdout.readline().startswith("paper, walk, elastic: peak 190.5 N")
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=300)
    assert process.returncode == 130
    assert errors == "interrupted\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGPIPE")
def test_a_reader_that_leaves_causes_no_error():
    read, write = os.pipe()
    os.close(read)
    command = [*HOOF_ENV, "manual"]
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True, timeout=300, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.parametrize(
    ("command", "name", "change"),
    [
        (["export", "--seconds", "0.1"], "x.csv", "--seed"),
        (["render", "--size", "480", "270", "--seconds", "0.1"], "x.mp4", "--seed"),
        (["mjcf"], "x.xml", "--theta"),
    ],
)
def test_a_file_is_replaced_on_demand_only_and_its_folder_is_reported(
    command, name, change, tmp_path, capsys
):
    out = tmp_path / "new" / name
    command = [*command, "--out", str(out)]
    assert cli.main(command) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"{out}: ")
    assert said.endswith(f"B; made the folder {out.parent}\n")
    first = out.read_bytes()
    assert cli.main([*command, change, "1"]) == 2
    refusal = capsys.readouterr().err
    assert refusal.startswith(f"hoof-env: error: {str(out)!r} ")
    assert "--overwrite" in refusal
    assert refusal.count("\n") == 1
    assert out.read_bytes() == first
    assert cli.main([*command, change, "1", "--overwrite"]) == 0
    assert out.read_bytes() != first
    assert "folder" not in capsys.readouterr().out


def test_a_warning_is_one_line():
    """In a process of its own: pytest keeps warnings."""
    warn = "cli.COMMANDS['list'] = lambda: warnings.warn('doubtful')"
    code = f"import sys, warnings; from hoof_env import cli; {warn}; sys.exit(cli.main(['list']))"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert (done.returncode, done.stderr) == (0, "hoof-env: warning: doubtful\n")


@pytest.mark.parametrize("columns", ["1", "5"])
def test_help_ends_in_a_narrow_terminal(columns):
    ours = os.environ | {"COLUMNS": columns}
    done = subprocess.run([*HOOF_ENV, "--help"], env=ours, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0
    assert "reproduce" in done.stdout


def test_what_the_encoding_lacks_is_replaced(tmp_path):
    ours = os.environ | {"PYTHONIOENCODING": "ascii"}
    command = [*HOOF_ENV, "mjcf", "--out", str(tmp_path / "Größe.xml")]
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
    assert done.stderr.startswith("hoof-env: error: ")
    assert done.stderr.endswith("No space left on device\n")
    assert done.stderr.count("\n") == 1


def test_an_id_of_a_module_in_the_current_folder(tmp_path):
    """The command finds it, as `python -m hoof_env` does; says which module registers it."""
    (tmp_path / "my_task.py").write_text(
        'import hoof_env\nhoof_env.register("mine/X-v0", base="rail", friction=0.7)\n'
    )
    bin = tmp_path / "bin"
    bin.mkdir()
    (bin / "hoof-env").write_text("import sys\nfrom hoof_env.cli import main\nsys.exit(main())\n")
    command = [sys.executable, str(bin / "hoof-env"), "manual", "--env-id", "my_task:mine/X-v0"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("mine/X-v0 (import my_task): ")


@pytest.mark.parametrize(
    ("words", "own", "other"),
    [
        (["export", "--out", "x.csv", "--idd", "3"], "--reactions", "--port"),
        (["view", "--policy-id", "x"], "--port", "--reactions"),
        (["render", "--out", "x.mp4", "--fps", "many"], "--slow", "--reactions"),
        (["compare", "a.csv", "b.csv", "--mapa", "x"], "--units-b", "--points"),
    ],
)
def test_a_wrong_option_shows_the_options_of_its_command(words, own, other, capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(words)
    assert end.value.code == 2
    told = capsys.readouterr().err
    assert told.splitlines()[-1].startswith(f"options of hoof-env {words[0]}: --")
    assert own in told
    assert other not in told


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_an_environment_has_the_same_options_everywhere(name):
    """As in commands of agents: `--env-id` and `--env-kwargs`."""
    names = names_of(cli.COMMANDS[name])
    assert not {"--id", "--args", "--env", "--kwargs"} & {*names}
    assert ("--env-kwargs" in names) <= ("--env-id" in names)
    assert ("--env-id" in names) == (name in ("render", "view", "export", "manual", "evaluate", "list"))
