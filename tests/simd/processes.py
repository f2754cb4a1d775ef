"""Processes that tests start, with a folder of machine code of their own."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import hoof_env
from hoof_env.simd.objects import FOLDER

ROOT = Path(hoof_env.__file__).parents[1]


def start_python(code, folder=None, **variables):
    """Start Python with some code; None for a variable that is not set there.

    Args:
        code: the code.
        folder: folder of its machine code, and of modules; None for the folders of this process.
        variables: variables of its environment.
    """
    usual = {"PYTHONPATH": f"{ROOT}{os.pathsep}{folder}"}
    usual |= {FOLDER: str(folder / "kernels")} if folder else {}
    environment = {**os.environ, **usual, **variables}
    return subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code)],
        env={name: value for name, value in environment.items() if value is not None},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(process, limit=120):
    """What a process wrote that ends well."""
    out, said = process.communicate(timeout=limit)
    assert process.returncode == 0, said
    return out.strip(), said
