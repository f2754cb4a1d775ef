"""Requests that `hoof-env` refuses, by the words of each error: by sub-command (`REQUESTS`), arguments that
it does not take (`UNKNOWN`), missing packages (`MISSING`). Records are in tests/lab/test_refusals.py."""

from __future__ import annotations

import re
import sys

import pytest

from hoof_env import cli
from hoof_env.errors import MissingExtraError
from hoof_env.records import export_episode

CSV = ("--out", "{}/x.csv")
XML = ("--out", "{}/x.xml")
MP4 = ("--out", "{}/x.mp4")
PAIRS = "--env-kwargs: expected a JSON object or key=value, got"

REQUESTS = {
    "reproduce": [
        (["--out", "{}/taken", "--no-figures"], "cannot write to '.*taken'"),
        (["--out", "{}", "--no-figures", "--preset", "nobody"], "preset: expected .*, got 'nobody'"),
    ],
    "export": [
        (["--out", "{}/x.txt"], "expected .*.c3d, .csv, .mot, .parquet, .sto, got"),
        ([*CSV, "--policy", "gallop"], "policy: expected a name .*, open-loop.*, got 'gallop'"),
        ([*CSV, "--policy", "1,0.2,0.3,nan"], "swing_cos: expected .*got nan"),
        ([*CSV, "--policy", "99,0,0,0"], "expected crank_speed from 0 to 12.5664.* got 99"),
        ([*CSV, "--policy", "no.zip"], "model no.zip"),
        (
            [*CSV, "--env-id", "hoof_env/Nobody-v0"],
            "environment 'hoof_env/Nobody-v0' with no arguments: expected a registered id",
        ),
        *(
            ([*CSV, "--env-id", given], r"did you mean hoof_env/HorseLegRail-v0\?")
            for given in ("HorseLegRail", "horselegrail-v0", "hoof_env/HorseLegRial-v0")
        ),
        (
            [*CSV, "--env-id", "nothing/Like-v0"],
            "with no arguments: expected a registered id (?!.*did you mean)",
        ),
        ([*CSV, "--env-id", "CartPole-v1"], "expected a single one of this package .* got CartPole"),
        ([*CSV, "--env-kwargs", "wings=2"], "unexpected keyword argument 'wings'(?!.*creator)"),
        *(
            ([*CSV, "--env-kwargs", given], f"{PAIRS} '{given.format()}'")
            for given in ("trunk", "=3", "{{trunk: 1}}")
        ),
        ([*CSV, "--env-kwargs", "trunk=cloud"], "trunk: expected one of .*, got 'cloud'"),
        ([*CSV, "--seconds", "0"], "seconds: expected .* got 0"),
        ([*CSV, "--seed", "-1"], "seed: expected .* got -1"),
        (["--out", "{}"], "expected a file that ends in .*, got"),
        (["--out", "{}/taken/x.csv"], "cannot write to '.*taken'"),
        (["--out", "{}/folder.csv"], "cannot write to '.*folder.csv': expected .*got a folder"),
        ([*CSV, "--threshold", "-1"], "threshold: expected .*got -1"),
        ([*CSV, "--units", "lb"], "units: expected .*BW, N, got 'lb'"),
        (["--out", "{}/x.mot", "--units", "BW"], "units: expected N in .mot, .*got BW"),
        *(
            (
                ["--out", f"{{}}/x{suffix}", "--bodies", "leg=LF"],
                f"bodies: expected a .mot or .sto, .*ExternalLoads, got {suffix}",
            )
            for suffix in (".csv", ".c3d", ".parquet")
        ),
        (
            ["--out", "{}/x.c3d", "--reactions"],
            "reactions: expected a .csv, .parquet, .mot or .sto, got .c3d",
        ),
        (["--out", "{}/x.mot", "--bodies", "tail=x"], "bodies: expected leg=BODY, got tail='x'"),
        (
            [*CSV, "--policy", "idle", "--env-kwargs", "episode_seconds=1e6"],
            "GB of memory, and .* are free; expected a shorter .*--seconds",
        ),
    ],
    "render": [
        (["--out", "{}/x.avi"], "expected .*.gif, .mp4, got"),
        (["--out", "{}/x.gif", "--fps", "60"], "fps: expected 50, 25.* got 60"),
        ([*MP4, "--fps", "0"], "fps: expected .* got 0"),
        ([*MP4, "--slow", "0"], "slow: expected .* got 0"),
        ([*MP4, "--seconds", "-1"], "seconds: expected .* got -1"),
        ([*MP4, "--seconds", "nan"], "seconds: expected .* got nan"),
        ([*MP4, "--size", "10", "10"], "size: expected .* got"),
        ([*MP4, "--policy", "gallop"], "policy: expected .* got 'gallop'"),
        (["--out", "{}/a/b/x.mp4", "--policy", "gallop"], "policy: expected .* got 'gallop'"),
        ([*MP4, "--env-kwargs", "render_mode=human"], "render_mode: expected none, as"),
    ],
    "mjcf": [
        ([*XML, "--theta", "1e308"], r"theta: expected .*1000.*got 1e\+308"),
        ([*XML, "--swing", "-1e308"], r"swing: expected .* got -1e\+308"),
        (["--out", "{}/x.urdf"], "expected .*.xml, got"),
        ([*XML, "--trunk", "cloud"], "trunk: expected .*, got 'cloud'"),
        ([*XML, "--preset", "nothing"], "preset: expected .*got 'nothing'"),
        ([*XML, "--theta", "nan"], "theta: expected .*got nan"),
        (["--out", "{}/taken/x.xml"], "cannot write to '.*taken'"),
    ],
}
"""Options, in which {} is a folder, and words, by sub-command."""


def refused(command, tmp_path, capsys):
    """The one line that a command says before anything runs or is written."""
    (tmp_path / "taken").write_text("mine", encoding="utf-8")
    (tmp_path / "folder.csv").mkdir()
    assert cli.main(command) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("hoof-env: error: ")
    assert said.err.count("\n") == 1
    assert sorted(file.name for file in tmp_path.iterdir()) == ["folder.csv", "taken"]
    assert not list((tmp_path / "folder.csv").iterdir())
    assert (tmp_path / "taken").read_text(encoding="utf-8") == "mine"
    return said.err


@pytest.mark.parametrize(
    ("command", "options", "words"), [(name, *row) for name, rows in REQUESTS.items() for row in rows]
)
def test_requests(command, options, words, tmp_path, capsys):
    if command == "render":
        pytest.importorskip("imageio_ffmpeg")
    for suffix, package in ((".c3d", "ezc3d"), (".parquet", "pyarrow")):
        if options[1].endswith(suffix):
            pytest.importorskip(package)
    said = refused([command, *(text.format(tmp_path) for text in options)], tmp_path, capsys)
    assert re.search(words, said), said


UNKNOWN = [["reproduec"], [], ["reproduce"], ["reproduce", "--out", "x", "--speed", "2"]]
"""Arguments that no sub-command takes, or too few."""


@pytest.mark.parametrize("arguments", UNKNOWN)
def test_unknown_arguments(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(arguments)
    assert stop.value.code == 2
    assert "Traceback" not in capsys.readouterr().err


MISSING = [
    ("matplotlib", ["reproduce", "--out", "{}"],
     r'pip install "hoof-env\[plot\]", or leave them out with --no-figures'),
    ("pygame", ["render", *MP4], r'pip install "hoof-env\[render\]"'),
    ("imageio_ffmpeg", ["render", *MP4], r'pip install "hoof-env\[video\]"'),
    ("pyarrow", ["export", "--out", "{}/x.parquet"], r'pip install "hoof-env\[export\]"'),
    *((package, ["demo", "--out", "{}/demo"], rf'needs more: pip install "hoof-env\[{extra}\]"$')
      for package, extra in (("matplotlib", "plot"), ("pygame", "render"), ("imageio_ffmpeg", "video"))),
]  # fmt: skip
"""Package, command and words."""


@pytest.mark.parametrize(("package", "command", "words"), MISSING)
def test_missing_packages(package, command, words, tmp_path, capsys, monkeypatch):
    """Named with the extra that has them, before anything runs."""
    monkeypatch.setitem(sys.modules, package, None)
    said = refused([text.format(tmp_path) for text in command], tmp_path, capsys)
    assert re.search(words, said), said


def test_a_missing_package_is_named_before_the_environment_is_made(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r'pip install "hoof-env\[export\]"'):
        export_episode(tmp_path / "x.parquet", "run", "asked for by none")


@pytest.mark.parametrize("kind", ["a path that leads nowhere", "no program"])
def test_a_missing_ffmpeg(kind, tmp_path, capsys, monkeypatch):
    """It was "cannot write to '.'", or a traceback."""
    pytest.importorskip("imageio_ffmpeg")
    import imageio_ffmpeg._io

    def nothing():
        raise RuntimeError("No ffmpeg exe could be found.")

    if kind == "no program":
        monkeypatch.setattr(imageio_ffmpeg._io, "get_ffmpeg_exe", nothing)
    else:
        monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/nowhere/ffmpeg")
    said = refused(["render", "--seconds", "0.1", "--out", str(tmp_path / "film.mp4")], tmp_path, capsys)
    assert said.startswith("hoof-env: error: films need the program ffmpeg, and ")
