"""Set-up: what it says when something is missing, where packages come from, that it does nothing twice."""

import importlib.util
import os
import re
import shutil
import socket
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def checkout(tmp_path):
    """As much of a fresh clone as set-up looks at."""
    for name in "Makefile", "pyproject.toml", "constraints.txt", "scripts/setup_venv.py", "scripts/lock.py":
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


@pytest.fixture
def setup(checkout):
    spec = importlib.util.spec_from_file_location("setup_venv", checkout / "scripts" / "setup_venv.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def installs(setup, monkeypatch):
    """Set-up with the installing itself replaced by a note of what was asked for."""
    done = []

    def install(purpose, anew):
        done.append(f"{purpose} anew" if anew else f"{purpose} more")
        setup.venv("bin").mkdir(parents=True, exist_ok=True)
        setup.venv("bin/python").touch()
        return purpose

    monkeypatch.setattr(setup, "install", install)
    return done


# What is missing


def lack_python(patch, setup):
    patch.setattr(setup, "OLDEST", (3, 98))
    patch.setattr(setup, "NEWEST", (3, 99))


def lack_disk(patch, setup):
    patch.setattr(setup.shutil, "disk_usage", lambda _: SimpleNamespace(free=0.5e9))


def lack_ensurepip(patch, setup):
    patch.setattr(setup.importlib.util, "find_spec", lambda name: None if name == "ensurepip" else name)


def lack_a_folder(patch, setup):
    patch.setattr(setup, "ROOT", setup.ROOT / "Makefile" / "below-a-file")


def lack_permission(patch, setup):
    patch.setattr(setup.os, "access", lambda path, mode: False)


def ask_for_another_installer(patch, setup):
    patch.setenv("INSTALLER", "Pip")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lack_python, "Python 3.98 to 3.99 is needed"),
        (lack_disk, "0.5 GB are free"),
        (lack_ensurepip, "ensurepip"),
        (lack_a_folder, "below-a-file: Not a directory"),
        (lack_permission, "cannot be written to"),
        (ask_for_another_installer, "INSTALLER: expected pip or uv, got 'Pip'"),
    ],
)
def test_what_is_missing_or_wrong_is_one_line_before_anything_is_touched(
    setup, installs, monkeypatch, capsys, spoil, words
):
    spoil(monkeypatch, setup)
    assert setup.main() == 1
    (said,) = capsys.readouterr().err.splitlines()
    assert words in said
    assert not installs


def test_a_wrong_word_is_refused(setup, installs, capsys):
    assert setup.main("--help") == 1
    assert "expected demo or all or dependencies, got '--help'" in capsys.readouterr().err
    assert not installs


def test_unreachable_package_index(checkout):
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        nowhere = f"http://127.0.0.1:{unused.getsockname()[1]}/simple"
    ours = {name: value for name, value in os.environ.items() if not name.startswith(("PIP_", "UV_"))}
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
    assert "no uv here: the package index cannot be reached" in ended.stdout
    assert not (checkout / ".venv" / "set-up.stamp").exists()


@pytest.mark.skipif(shutil.which("make") is None, reason="no make here")
def test_make_without_a_suitable_python(checkout):
    ended = subprocess.run(
        ["make", "setup", "PYTHON=no-such-python"], cwd=checkout, capture_output=True, text=True, check=False
    )
    assert ended.returncode != 0
    ours = [line for line in ended.stderr.splitlines() if not line.startswith("make")]
    assert len(ours) == 1
    assert "no Python 3.11 to 3.14" in ours[0]


@pytest.mark.skipif(shutil.which("make") is None, reason="no make here")
def test_where_no_python_fits_uv_fetches_one(checkout, tmp_path):
    tools = {"uv": 'test "$2" = find && echo python-of-uv || true', "python-of-uv": 'echo "set-up by $0 $@"'}
    for name, text in tools.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / name).chmod(0o755)
    ours = os.environ | {"PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}
    command = ["make", "--no-print-directory", "setup", "PYTHONS=no-such-python"]
    ended = subprocess.run(command, cwd=checkout, env=ours, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    first, second = ended.stdout.splitlines()
    assert first == "no Python 3.11 to 3.14 here: uv fetches 3.13"
    assert second.startswith("set-up by ")
    assert second.rstrip().endswith("python-of-uv scripts/setup_venv.py")


def test_makefile_and_script_agree_on_the_pythons(setup):
    assert f"{setup.OLDEST} <= sys.version_info[:2] <= {setup.NEWEST}" in (ROOT / "Makefile").read_text()


# Where packages come from


@pytest.fixture
def asked(setup, monkeypatch):
    """What is asked of pip and uv, which have nothing."""
    words = []

    def packages(tool, title, *arguments, **environment):
        words.append(" ".join((tool, *(word for word in arguments if word not in setup.ONLY_WHEELS))))
        raise setup.Missing("nothing here")

    monkeypatch.setattr(setup, "packages", packages)
    return words


def test_pip_installs_where_uv_cannot_be_had(setup, asked, capsys):
    assert setup.installer() == "pip"
    assert asked == ["pip uv"]
    assert "no uv here: nothing here; pip installs the same" in capsys.readouterr().out


def test_pip_installs_where_it_is_asked_for(setup, asked, monkeypatch):
    monkeypatch.setenv("INSTALLER", "pip")
    assert setup.installer() == "pip"
    assert not asked


def test_places_of_pytorch_in_their_order(setup, asked, monkeypatch, capsys):
    monkeypatch.setattr(setup.sys, "platform", "linux")
    monkeypatch.setattr(setup, "TORCH_INDEX", "https://nowhere.example/cpu")
    monkeypatch.setattr(setup, "pip_settings", lambda: {"find-links": "wheels"})
    with pytest.raises(setup.Missing, match=r"PyTorch cannot be had for Python 3\.\d+: nothing here"):
        setup.install_torch("uv")
    first, second, last = asked
    assert first == "uv --no-deps torch --no-index"
    assert second == "uv --no-deps torch --default-index https://nowhere.example/cpu"
    assert last == "uv torch"
    assert "PyTorch with CUDA, some gigabytes" in capsys.readouterr().out


@pytest.fixture
def without_torch(setup, monkeypatch):
    """Packages of which PyTorch has no wheel for this Python, or cannot be had for the reason that is given;
    what is installed."""
    done, reason = [], [setup.LACKING]

    def packages(tool, title, *arguments, **environment):
        if any(word.partition(">=")[0] == "torch" for word in arguments):
            raise setup.Missing(f"{reason[0]} (more in .venv/set-up.log)")
        done.extend(word for word in arguments if word not in setup.ONLY_WHEELS)

    def step(title, command, environment=()):
        setup.venv("bin").mkdir(parents=True)
        setup.venv("bin/python").touch()

    monkeypatch.setattr(setup, "packages", packages)
    monkeypatch.setattr(setup, "step", step)
    monkeypatch.setattr(setup, "pip_settings", dict)
    return SimpleNamespace(done=done, reason=reason)


@pytest.mark.parametrize("platform", ["linux", "darwin"])
def test_without_a_wheel_of_pytorch_the_tests_get_all_else_and_a_line_says_so(
    setup, without_torch, monkeypatch, capsys, platform
):
    monkeypatch.setattr(setup.sys, "platform", platform)
    assert setup.main() == 0
    assert "left out: torch, stable-baselines3, sb3-contrib; the tests that" in capsys.readouterr().out
    installed = {re.split("[>=;]", one)[0] for one in without_torch.done}
    assert installed > {"numpy", "llvmlite", "gymnasium", "pytest", "scipy", "mypy", "--editable"}
    assert not installed & set(setup.NEED_TORCH)
    count = len(without_torch.done)
    assert setup.main() == 0  # nothing is tried again
    assert len(without_torch.done) == count
    assert setup.main("demo") == 1
    assert "PyTorch cannot be had for Python 3." in capsys.readouterr().err
    count = len(without_torch.done)
    assert setup.main() == 0  # what the tests have is still there
    assert len(without_torch.done) == count


def test_where_pytorch_cannot_be_reached_set_up_stops(setup, without_torch, capsys):
    without_torch.reason[0] = setup.UNREACHABLE
    assert setup.main() == 1
    assert "the package index cannot be reached" in capsys.readouterr().err
    assert not setup.stamp_path().exists()


def test_what_needs_pytorch_is_known(ours):
    """What is left brings no PyTorch."""
    asked = [one for one in ours.requirements("all") if not ours.needs_torch(one)]
    assert len(asked) == len(ours.requirements("all")) - len(ours.NEED_TORCH)
    check_wheels(ours, stdin="cycler\n")  # whether there is an index
    command = [sys.executable, "-m", "uv", "pip", "compile", "--quiet", "--only-binary", ":all:", "-"]
    environment = {**os.environ, **ours.uv_settings()}
    found = subprocess.run(
        command, input="\n".join(asked), env=environment, capture_output=True, text=True, cwd=ours.ROOT
    )
    assert found.returncode == 0, found.stderr
    assert "numpy==" in found.stdout
    assert not re.search(r"(?m)^torch==", found.stdout)


def test_uv_is_reported_what_pip_is_reported(setup, tmp_path, monkeypatch):
    for name in [name for name in os.environ if name.startswith(("PIP_", "UV_"))]:
        monkeypatch.delenv(name)
    monkeypatch.delenv("SSL_CERT_FILE", raising=False)
    config = tmp_path / "pip.conf"
    config.write_text(
        "[global]\nindex-url = https://one.example/simple\nfind-links = far\ncert = mine.pem\n"
        "[install]\nextra-index-url =\n  https://two.example/simple\n  https://three.example/simple\n"
        "[list]\nindex-url = https://other.example/simple\n"
    )
    monkeypatch.setenv("PIP_CONFIG_FILE", str(config))
    monkeypatch.setenv("PIP_FIND_LINKS", "near nearer")
    monkeypatch.setattr(setup, "venv", lambda path: Path(sys.executable))
    monkeypatch.setenv("UV_DEFAULT_INDEX", "https://uvs.own.example/simple")
    told = setup.uv_settings()
    assert told["UV_FIND_LINKS"] == "near,nearer"
    assert told["UV_INDEX"] == "https://two.example/simple https://three.example/simple"
    assert told["SSL_CERT_FILE"] == "mine.pem"
    assert "UV_DEFAULT_INDEX" not in told


def uv_pip_compile(setup, *options, stdin):
    """Run `uv pip compile` for wheels alone; return the process that has ended."""
    command = [sys.executable, "-m", "uv", "pip", "compile", "--only-binary", ":all:", *options, "-"]
    command += ["--python", sys.executable]  # no other Python is looked for, nor downloaded
    macos = {"MACOSX_DEPLOYMENT_TARGET": "14.0"}  # the oldest that PyTorch has a wheel for
    environment = {**os.environ, **setup.uv_settings(), **macos}
    return subprocess.run(
        command, input=stdin, env=environment, capture_output=True, text=True, cwd=setup.ROOT
    )


def check_wheels(setup, *options, stdin):
    """Fail where what is asked for cannot be had as wheels; skip where no index can be reached."""
    ended = uv_pip_compile(setup, *options, stdin=stdin)
    if ended.returncode != 0:
        reason = setup.why(ended.stderr.splitlines(keepends=True))
        if "No solution found" not in ended.stderr:  # the index is not there, or busy
            pytest.skip(reason)
        pytest.fail(ended.stderr)


@pytest.fixture(scope="module")
def known():
    """Facts for all tests of this file: "settings", which take pip half a second, and "lists" once uv has
    fetched the index's."""
    return {}


@pytest.fixture
def ours(setup, monkeypatch, known):
    """Set-up that asks the pip of the tests' own environment for its settings."""
    monkeypatch.setattr(
        setup, "venv", lambda path: Path(sys.executable) if path == "bin/python" else setup.ROOT / path
    )
    if "settings" not in known:
        known["settings"] = setup.uv_settings()
    monkeypatch.setattr(setup, "uv_settings", lambda: known["settings"])
    return setup


@pytest.mark.parametrize(
    "platform", ["x86_64-manylinux_2_28", "aarch64-manylinux_2_28", "aarch64-apple-darwin"]
)
@pytest.mark.parametrize("minor", [11, 12, 13, 14])
def test_everything_that_is_locked_has_a_wheel(ours, minor, platform, known):
    assert ours.OLDEST <= (3, minor) <= ours.NEWEST
    place = ("--python-version", f"3.{minor}", "--python-platform", platform)
    locked = (*place, "--constraints", "constraints.txt")
    asked = "\n".join(ours.requirements("all"))
    # A list of the index has the wheels of every place: those that were just fetched need not be asked for
    is_kept = "lists" in known and not uv_pip_compile(ours, *locked, "--offline", stdin=asked).returncode
    if not is_kept:
        check_wheels(ours, *locked, stdin=asked)
    known["lists"] = True


def test_what_has_no_wheel_is_refused(ours):
    with pytest.raises(pytest.fail.Exception, match="rliable"):
        check_wheels(ours, "--python-version", "3.12", stdin="rliable==1.2.0\n")


def test_the_lock_is_what_its_command_writes(ours):
    check_wheels(ours, stdin="hatchling\n")  # whether there is an index
    command = [sys.executable, "scripts/lock.py"]
    subprocess.run(command, cwd=ours.ROOT, check=True, env={**os.environ, **ours.uv_settings()})
    assert (ours.ROOT / "constraints.txt").read_text() == (ROOT / "constraints.txt").read_text()
    found, expected = (
        [(one["name"], one["version"]) for one in tomllib.loads(path.read_text())["packages"]]
        for path in (ours.ROOT / ours.LOCKED_FILES, ROOT / ours.LOCKED_FILES)
    )  # a version may get another wheel
    assert found == expected


# Nothing twice


def lose_python(setup):
    setup.venv("bin/python").unlink()


def add_a_pin(setup):
    with (setup.ROOT / "constraints.txt").open("a") as pins:
        pins.write("another==1.0\n")


def move(setup):
    setup.ROOT = setup.ROOT.rename(setup.ROOT.with_name("moved"))


@pytest.mark.parametrize(
    ("change", "second"),
    [(lambda setup: None, []), (lose_python, ["all anew"]), (add_a_pin, ["all more"]), (move, ["all anew"])],
)
def test_a_second_run_does_what_a_change_asks_for(setup, installs, change, second):
    assert setup.main() == 0
    change(setup)
    assert setup.main() == 0
    assert installs == ["all anew", *second]


def test_what_the_tests_need_is_added_to_the_demos(setup, installs):
    assert [setup.main(purpose) for purpose in ("demo", "demo", "all", "demo", "all")] == [0] * 5
    assert installs == ["demo anew", "all more"]
    assert set(setup.requirements("demo")) < set(setup.requirements("all"))


def test_dependencies_alone_are_installed_without_the_checkout(setup, without_torch, monkeypatch, capsys):
    monkeypatch.setenv("INSTALLER", "pip")
    project = setup.ROOT / "pyproject.toml"
    for _ in range(2):  # nothing is done twice
        assert setup.main("dependencies") == 0
        assert sorted(without_torch.done) == sorted(
            tomllib.loads(project.read_text())["project"]["dependencies"]
        )
    project.write_text('[project]\ndependencies = ["numpy", "torch>=2.5"]\n')
    assert setup.main("dependencies") == 1
    assert "PyTorch cannot be had" in capsys.readouterr().err


def test_interrupted_setup_is_made_anew(setup, installs, monkeypatch, capsys):
    def interrupted(purpose, anew):
        setup.venv("").mkdir()
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(setup, "install", interrupted)
        assert setup.main() == 130
    assert setup.main() == 0
    assert installs == ["all anew"]


# Hashes


def test_hashes_are_of_the_versions_that_are_locked(setup):
    """Without PyTorch, whose builds for the CPU are of another index."""
    locked = {
        line.split(" ;")[0] for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line
    }
    packages = tomllib.loads((ROOT / setup.LOCKED_FILES).read_text())["packages"]
    hashed = {f"{one['name']}=={one['version']}" for one in packages}
    assert len(hashed) == len(packages)
    assert hashed <= locked
    assert {name.split("==")[0] for name in hashed} > {"numpy", "llvmlite", "pillow", "stable-baselines3"}
    assert not [name for name in hashed if name.startswith("torch==")]
    for one in packages:
        assert all(re.fullmatch("[0-9a-f]{64}", wheel["hashes"]["sha256"]) for wheel in one["wheels"]), one


def test_every_hash_is_reported_to_uv(ours):
    text = (ROOT / ours.LOCKED_FILES).read_text()
    (ours.ROOT / ours.LOCKED_FILES).write_text(text)
    told = (ours.ROOT / ours.hashes()).read_text()
    assert told.count("--hash=sha256:") == text.count("sha256 = ")
    assert re.search(r"(?m)^numpy==\S+ --hash=sha256:[0-9a-f]{64} --hash=", told)


@pytest.mark.parametrize("is_changed", [False, True])
def test_uv_refuses_another_file_than_the_locked_one(ours, tmp_path, monkeypatch, is_changed):
    monkeypatch.setitem(ours.TOOLS, "uv", ("uv", "pip", "install", "--python", sys.executable))
    text = (ROOT / ours.LOCKED_FILES).read_text()
    at = text.index("sha256", text.index('name = "cycler"')) + len('sha256 = "')
    if is_changed:
        text = f"{text[:at]}{'01'[text[at] == '0']}{text[at + 1 :]}"
    (ours.ROOT / ours.LOCKED_FILES).write_text(text)
    check_wheels(ours, stdin="cycler\n")  # whether there is an index

    def install():
        ours.packages("uv", "one", *ours.ONLY_WHEELS, "--no-cache", "--target", str(tmp_path), "cycler")

    if not is_changed:
        install()
        assert (tmp_path / "cycler").is_dir()
        return
    with pytest.raises(ours.Missing, match="another file than the one that was locked"):
        install()
