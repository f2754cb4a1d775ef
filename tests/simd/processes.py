"""Processes that tests start: copies of one that has numba and the package imported, or fresh ones.

A fresh one takes nearly a second of processor time until its first kernel runs, a copy a thirtieth of that.
"""

import multiprocessing
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import hoof_env

ROOT = Path(hoof_env.__file__).parents[1]

CALL = "import tiny; print(tiny.tiny(3.0), tiny.COMPILED)"
"""Code that calls the kernels of `conftest`."""

CALL_OR_SAY = """
from hoof_env.errors import OutputError
import hoof_env.envs.manual  # no folder is needed before something is compiled
import tempfile, tiny
def refuse(*args, **kwargs):
    raise PermissionError("read-only")
if {read_only}:
    tempfile.TemporaryFile = refuse
try:
    print(tiny.tiny(3.0), tiny.COMPILED)
except OutputError as error:
    print(error)
"""
"""The same, or the reason why the folder is refused."""

CAN_COPY = "forkserver" in multiprocessing.get_all_start_methods()


def environment_of(folder, settings):
    """Return the variables of a process whose modules lie in a folder, and its compiled kernels below it."""
    usual = {
        "HOOF_ENV_QUIET": "0",
        "NUMBA_CACHE_DIR": str(folder / "cache"),
        "PYTHONPATH": f"{ROOT}{os.pathsep}{folder}",
    }
    return {**os.environ, **usual, **settings}


def start_fresh(code, folder, settings):
    """Start Python with some code."""
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code)],
        cwd=folder,
        env=environment_of(folder, settings),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def start_copy(code, folder, settings):
    """Start a copy with some code; a fresh process where the system cannot copy one."""
    if not CAN_COPY:
        return start_fresh(code, folder, settings)
    return Copy(textwrap.dedent(code), folder, environment_of(folder, settings))


class Copy:
    """Copy of a process, with what tests need of `subprocess.Popen`."""

    def __init__(self, code, folder, environment):
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["tests.simd.warmed"])
        out, to_out = context.Pipe(duplex=False)
        err, to_err = context.Pipe(duplex=False)
        self._process = context.Process(target=run, args=(code, folder, environment, to_out, to_err))
        self._process.start()
        # The copy alone holds the ends that it writes to, so that reading ends with it.
        to_out.close()
        to_err.close()
        self.stdout = os.fdopen(os.dup(out.fileno()))
        self.stderr = os.fdopen(os.dup(err.fileno()))

    @property
    def returncode(self):
        return self._process.exitcode

    def poll(self):
        return self._process.exitcode

    def wait(self, timeout=None):
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise subprocess.TimeoutExpired(str(self._process), timeout)

    def communicate(self, timeout=None):
        """Return what it wrote, less than a pipe holds, once it has ended."""
        self.wait(timeout)
        if self.stdout.closed:
            return "", ""
        with self.stdout, self.stderr:
            return self.stdout.read(), self.stderr.read()

    def send_signal(self, number):
        os.kill(self._process.pid, number)

    def kill(self):
        self._process.kill()


def run(code, folder, environment, to_out, to_err):
    """Run code in a copy as Python would with these variables."""
    from numba.core import config

    os.dup2(to_out.fileno(), 1)
    os.dup2(to_err.fileno(), 2)
    to_out.close()
    to_err.close()
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    config.reload_config()
    sys.path[:0] = environment["PYTHONPATH"].split(os.pathsep)
    sys.argv = ["-c"]
    exec(code, {"__name__": "__main__"})


def ended(process, limit=120):
    out, said = process.communicate(timeout=limit)
    assert process.returncode == 0, said
    return out.strip(), said
