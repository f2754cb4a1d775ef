"""A command that refuses, and one that is killed."""

from __future__ import annotations

import os
import subprocess
import sys
import time


def refusal(main, arguments, capsys):
    """What a command says that ends with an error: one line."""
    assert main([str(argument) for argument in arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    return error


def wait_until(is_so, process):
    deadline = time.monotonic() + 300
    while not is_so():
        assert process.poll() is None, "it ended too soon"
        assert time.monotonic() < deadline
        time.sleep(0.01)


def wait_for_end(process):
    """Until no process of the group of an ended process is there."""
    deadline = time.monotonic() + 300
    while True:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            return
        assert time.monotonic() < deadline, "a worker outlived its parent"
        time.sleep(0.05)


def kill_when(code, module, folder, files, count):
    """Run `code` after all of a test module, kill it as soon as `count` of the `files` are in `folder`,
    wait for its workers to end by themselves, and return what the files hold."""
    script = folder / "script.py"
    body = "".join(f"    {line}\n" for line in code)
    script.write_text(f"from {module} import *\nif __name__ == '__main__':\n{body}")
    path = os.pathsep.join([os.path.dirname(__file__), *sys.path])
    environment = {**os.environ, "PYTHONPATH": path}
    process = subprocess.Popen([sys.executable, str(script)], env=environment, start_new_session=True)
    wait_until(lambda: len(list(folder.glob(files))) >= count, process)
    process.kill()
    process.wait()
    wait_for_end(process)
    return {file: file.read_bytes() for file in folder.glob(files)}
