"""Set-up: what it says when something is missing, and that it does nothing twice."""

from __future__ import annotations

import importlib.util
import os
import shutil
import socket
import subprocess
import sys
from collections import namedtuple
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """As much of a fresh clone as set-up looks at."""
    for name in "Makefile", "pyproject.toml", "constraints.txt", "scripts/setup_venv.py":
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


@pytest.fixture
def setup(checkout: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("setup_venv", checkout / "scripts" / "setup_venv.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def installs(setup: ModuleType, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Set-up with the installing itself replaced by a note of what was asked for."""
    done: list[str] = []

    def install(anew: bool) -> None:
        done.append("anew" if anew else "update")
        setup.venv("").mkdir(exist_ok=True)

    monkeypatch.setattr(setup, "install", install)
    return done


def the_one_line(capsys: pytest.CaptureFixture[str]) -> str:
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    return said[0]


# What is missing


def test_wrong_python(
    setup: ModuleType,
    installs: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(setup, "OLDEST", (3, 98))
    monkeypatch.setattr(setup, "NEWEST", (3, 99))
    assert setup.main() == 1
    assert "Python 3.98 to 3.99 is needed" in the_one_line(capsys)
    assert not installs


def test_full_disk(
    setup: ModuleType,
    installs: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    usage = namedtuple("usage", "free")
    monkeypatch.setattr(setup.shutil, "disk_usage", lambda _: usage(0.5e9))
    assert setup.main() == 1
    assert "0.5 GB are free" in the_one_line(capsys)
    assert not installs


def test_python_without_ensurepip(
    setup: ModuleType,
    installs: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(setup.importlib.util, "find_spec", lambda name: None if name == "ensurepip" else name)
    assert setup.main() == 1
    assert "ensurepip" in the_one_line(capsys)
    assert not installs


def test_folder_that_cannot_be_used(
    setup: ModuleType,
    installs: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(setup, "ROOT", setup.ROOT / "Makefile" / "below-a-file")
    assert setup.main() == 1
    assert "below-a-file: Not a directory" in the_one_line(capsys)
    assert not installs


def test_folder_that_cannot_be_written_to(
    setup: ModuleType,
    installs: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(setup.os, "access", lambda path, mode: False)
    assert setup.main() == 1
    assert "cannot be written to" in the_one_line(capsys)
    assert not installs


def test_unreachable_package_index(checkout: Path) -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        nowhere = f"http://127.0.0.1:{unused.getsockname()[1]}/simple"
    ours = {name: value for name, value in os.environ.items() if not name.startswith("PIP_")}
    ours |= {
        "PIP_CONFIG_FILE": os.devnull,
        "PIP_INDEX_URL": nowhere,
        "TORCH_INDEX": nowhere,
        "PIP_RETRIES": "1",
    }
    command = [sys.executable, "scripts/setup_venv.py"]
    ended = subprocess.run(command, cwd=checkout, env=ours, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 1
    assert len(ended.stderr.splitlines()) == 1
    assert "the package index cannot be reached" in ended.stderr
    assert not (checkout / ".venv" / "set-up.stamp").exists()


@pytest.mark.skipif(shutil.which("make") is None, reason="no make here")
def test_make_without_a_suitable_python(checkout: Path) -> None:
    ended = subprocess.run(
        ["make", "setup", "PYTHON=no-such-python"], cwd=checkout, capture_output=True, text=True, check=False
    )
    assert ended.returncode != 0
    ours = [line for line in ended.stderr.splitlines() if not line.startswith("make")]
    assert len(ours) == 1
    assert "no Python 3.11 to 3.13" in ours[0]


def test_makefile_and_script_agree_on_the_pythons(setup: ModuleType) -> None:
    assert f"{setup.OLDEST} <= sys.version_info[:2] <= {setup.NEWEST}" in (ROOT / "Makefile").read_text()


# Nothing twice


def test_second_run_does_nothing(setup: ModuleType, installs: list[str]) -> None:
    assert [setup.main(), setup.main()] == [0, 0]
    assert installs == ["anew"]


def test_changed_pins_update_what_is_there(setup: ModuleType, installs: list[str]) -> None:
    setup.main()
    with (setup.ROOT / "constraints.txt").open("a") as pins:
        pins.write("another==1.0\n")
    assert setup.main() == 0
    assert installs == ["anew", "update"]


def test_moved_checkout_is_set_up_anew(setup: ModuleType, installs: list[str]) -> None:
    setup.main()
    setup.ROOT = setup.ROOT.rename(setup.ROOT.with_name("moved"))
    assert setup.main() == 0
    assert installs == ["anew", "anew"]


def test_interrupted_setup_is_made_anew(
    setup: ModuleType,
    installs: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def interrupted(anew: bool) -> None:
        setup.venv("").mkdir()
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(setup, "install", interrupted)
        assert setup.main() == 130
    assert setup.main() == 0
    assert installs == ["anew"]
