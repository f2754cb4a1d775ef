"""Description of the machine of a benchmark, and of the machine code of kernels on it."""

from __future__ import annotations

import datetime
import os
import platform
import re
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path

from agents.runs import processor
from hoof_env.simd import Matrix, read, write
from hoof_env.simd.compile import host, optimised, target, traced

PACKAGES = ("hoof-env", "llvmlite", "numpy", "mujoco", "exudyn")


def machine() -> dict[str, str]:
    """Return processor, vector width, system, versions, date and commit."""
    installed = {d.metadata["Name"]: d.version for d in metadata.distributions()}
    return {
        "processor": f"{processor()}, {os.cpu_count()} cores",
        "compiled for": f"{compiled_for()}, vectors of {vector_bits()} bits",
        "system": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "versions": ", ".join(f"{package} {installed.get(package, 'not installed')}" for package in PACKAGES),
        "date": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "commit": _commit(),
    }


def compiled_for() -> str:
    """Return LLVM's name of the processor that kernels are compiled for; `HOOF_ENV_CPU` can name another."""
    return host()[0]


@cache
def vector_bits() -> int:
    """Return the bits of the widest vectors in the code of kernels here, read off the sum of eight lanes."""

    def add(x: Matrix) -> None:
        one = read(x.first, 0, 1, 8)
        write(one + one, x.first, 0, 1)

    # names of registers tell the width: `HOOF_ENV_CPU` may name another processor than this one
    code = target().emit_assembly(optimised(traced(add, [Matrix])[0]))
    if registers := re.findall(r"%([xyz])mm", code):  # registers of x86
        return {"x": 128, "y": 256, "z": 512}[max(registers)]
    return 128 if re.search(r"\bv\d+\.2d", code) else 64


def _commit() -> str:
    """Return the commit, and if the work tree differs from it."""

    def git(*arguments: str) -> str:
        here = Path(__file__).parent
        return subprocess.check_output(["git", *arguments], cwd=here, text=True, stderr=subprocess.DEVNULL)

    try:
        changed = git("status", "--porcelain", "--untracked-files=no", "--", "../hoof_env", ".", ":!results")
        return git("rev-parse", "--short", "HEAD").strip() + (" and changes" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
