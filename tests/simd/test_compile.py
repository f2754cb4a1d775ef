"""Compiled kernels: where they are kept, what happens where they cannot be, and when they are made anew."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import hoof_env

PACKAGE = Path(hoof_env.__file__).parent

CALL = """
from hoof_env.errors import OutputError
import hoof_env.envs.manual  # no folder is needed before something is compiled
from hoof_env.ground.contact import Ground, new_contacts, touch
try:
    touch(new_contacts()[0], -0.04j, 0j, Ground().to_record())
except OutputError as error:
    print(error)
"""

FORCE = """
import hoof_env
from hoof_env.ground.contact import Ground, new_contacts, touch
assert hoof_env.__file__.startswith({root!r}), hoof_env.__file__
print(touch(new_contacts()[0], -0.04j, 0j, Ground().to_record()).imag)
"""


SOUNDS = """
import numba
numba.njit(lambda x: x + 1)(1)  # not ours
import sys
print("---", file=sys.stderr)
from hoof_env.ground.contact import Ground, new_contacts, touch
for _ in range(2):
    touch(new_contacts()[0], -0.04j, 0j, Ground().to_record())
"""


def python(code, cwd, **environment):
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=cwd,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
    )


def test_a_cache_folder_that_cannot_be_is_named_with_the_remedy(tmp_path):
    (tmp_path / "file").write_text("")
    folder = str(tmp_path / "file" / "cache")
    result = python(CALL, PACKAGE.parent, NUMBA_CACHE_DIR=folder)
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith(f"cannot keep compiled kernels in {folder!r} (")
    assert "expected a writable folder: set the environment variable NUMBA_CACHE_DIR to one" in result.stdout


def test_without_compilation_the_reason_is_named():
    result = python("import hoof_env.leg.kinematics", PACKAGE.parent, NUMBA_DISABLE_JIT="1")
    assert "HoofEnvError: NUMBA_DISABLE_JIT is set" in result.stderr


@pytest.mark.skipif(
    os.name != "posix" or os.geteuid() == 0, reason="needs a folder that this user cannot write"
)
def test_a_cache_folder_without_permission(tmp_path):
    tmp_path.chmod(0o500)
    result = python(CALL, PACKAGE.parent, NUMBA_CACHE_DIR=str(tmp_path))
    assert "cannot keep compiled kernels in" in result.stdout


def test_kernels_are_kept_and_made_anew_when_a_kernel_they_call_changes(tmp_path):
    """`touch` calls `normal_force`, which lives in another file: numba alone would keep the old one."""
    shutil.copytree(PACKAGE, tmp_path / "hoof_env", ignore=shutil.ignore_patterns("__pycache__"))
    cache = tmp_path / "cache"

    def force():
        result = python(FORCE.format(root=str(tmp_path)), tmp_path, NUMBA_CACHE_DIR=str(cache), PYTHONPATH="")
        assert result.returncode == 0, result.stderr
        return float(result.stdout)

    def compiled():
        return {path: path.stat().st_mtime_ns for path in cache.rglob("*.nbc")}

    assert force() == pytest.approx(2e4 * 0.04**1.5)
    kept = compiled()
    assert kept
    assert force() == pytest.approx(2e4 * 0.04**1.5)
    assert compiled() == kept  # taken from the folder, not compiled again
    law = tmp_path / "hoof_env" / "ground" / "laws.py"
    law.write_text(law.read_text().replace("return larger(spring *", "return larger(2.0 * spring *"))
    assert force() == pytest.approx(2 * 2e4 * 0.04**1.5)


def test_compiling_is_said_once_and_only_when_it_happens(tmp_path):
    def said(**environment):
        settings = {"NUMBA_CACHE_DIR": str(tmp_path), "HOOF_ENV_QUIET": "0"} | environment
        result = python(SOUNDS, PACKAGE.parent, **settings)
        assert result.returncode == 0, result.stderr
        return result.stderr.splitlines()

    before, first, *rest = said()
    assert before == "---"
    assert first == "hoof-env: compiling kernels for this machine, once (about half a minute) ..."
    assert all(re.fullmatch(r"hoof-env: \w+ compiled in \d+\.\d s", line) for line in rest)
    assert said() == ["---"]  # from the cache
    assert said(NUMBA_CACHE_DIR=str(tmp_path / "new"), HOOF_ENV_QUIET="1") == ["---"]
