"""`make test` ends whatever a test does: one that kills its process or never ends is named, the run fails."""

import os
import re
import subprocess
import sys
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
TESTS = {
    "aborts": "import os\ndef test_it(): os.abort()",
    "leaves": "import ctypes\ndef test_it(): ctypes.CDLL(None).exit(1)",
    "sleeps": "import time\ndef test_it(): time.sleep(600)",
    "holds the interpreter's lock": "import ctypes\ndef test_it(): ctypes.PyDLL(None).sleep(600)",
}


def options():
    """Options of pytest in `make test`, with two processes."""
    (line,) = re.findall(r"-m pytest (-q -n auto .*)", (ROOT / "Makefile").read_text())
    return str(line).replace("-n auto", "-n 2").split()


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return when the runs of all of `TESTS` began, and them: all at once, because some wait for a limit."""
    quick = ["-p", "no:cacheprovider", "-o", "faulthandler_timeout=3"]
    command = [sys.executable, "-m", "pytest", *options(), *quick]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    with ExitStack() as ends:
        begun = {}
        started = time.monotonic()
        for what, test in TESTS.items():
            folder = tmp_path_factory.mktemp("lost")
            (folder / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text())
            (folder / "tests").mkdir()
            (folder / "tests" / "test_bad.py").write_text(test + "\n")
            (folder / "tests" / "test_good.py").write_text("def test_it(): pass\n")
            begun[what] = ends.enter_context(subprocess.Popen(command, cwd=folder, **pipes))
            ends.callback(begun[what].kill)
        yield started, begun


@pytest.mark.parametrize("what", TESTS)
def test_a_lost_worker_ends_the_run(what, runs):
    started, begun = runs
    said, _ = begun[what].communicate(timeout=max(0.0, started + 100 - time.monotonic()))
    assert begun[what].returncode == 1, said
    assert "crashed while running 'tests/test_bad.py::test_it'" in said
    assert "1 failed, 1 passed" in said


ABSENT = """
import sys

NAMES = "torch", "stable_baselines3", "sb3_contrib"
sys.modules.update(dict.fromkeys(NAMES))  # as if they were not installed

def pytest_collection():  # now the importing itself is asked
    for name in NAMES:
        del sys.modules[name]
"""


def test_without_pytorch_what_needs_it_is_left_out_and_a_line_says_so(tmp_path):
    """Of a file of which some tests need it, the others run."""
    (tmp_path / "absent.py").write_text(ABSENT)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "absent", "-p", "no:cacheprovider"]
    chosen = ["tests/envs/test_without_effect.py", "-k", "libraries"]
    ended = subprocess.run(
        [*command, *chosen], cwd=ROOT, env=os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}"},
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stdout + ended.stderr
    said = "no PyTorch here: left out tests/agents and tests/ecosystem, and 2 files or tests elsewhere that"
    assert said in ended.stdout
    assert "1 passed, 2 skipped" in ended.stdout


def test_a_test_has_a_limit_of_time(pytestconfig):
    assert float(pytestconfig.getini("faulthandler_timeout")) > 0
    assert pytestconfig.getini("faulthandler_exit_on_timeout")
