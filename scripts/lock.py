"""Write constraints.txt anew, by `uv pip compile`: python scripts/lock.py [options of it, such as --upgrade]

The versions that stand there stay unless pyproject.toml or an option asks for others. One list serves each
supported Python and platform. Of PyTorch's CUDA build, which asks for exact versions itself, nothing is kept.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from setup_venv import EXTRAS, OLDEST, ROOT, dotted

LOCK = ROOT / "constraints.txt"
CUDA = ("nvidia-", "cuda-", "triton")
HEAD = """\
# The tested version of every package that set-up and `make test-peers` install: pyproject.toml keeps the wide
# bounds. Made by `python scripts/lock.py`; `pip install -c constraints.txt` takes it, too.
"""
APART = """
# Libraries that tests/ecosystem installs in environments of their own, and EnvPool, which few platforms have;
# what they bring is left open.
"""


def main(*options: str) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    together = [*EXTRAS["all"], "peers"]
    apart = [extra for extra in project["optional-dependencies"] if extra not in together]
    lines = compiled(together, *options)
    known = {name(line) for line in lines}
    others = [
        line for line in compiled(apart, "--no-deps", *options, more="envpool\n") if name(line) not in known
    ]
    LOCK.write_text(HEAD + "\n".join(lines) + "\n" + APART + "\n".join(others) + "\n", encoding="utf-8")


def compiled(extras: list[str], *options: str, more: str = "") -> list[str]:
    """Lines of the lock for these extras, and for what `more` asks for, a requirement on each line."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / LOCK.name
        out.write_text(LOCK.read_text(encoding="utf-8"), encoding="utf-8")  # uv keeps what stands there
        command = [sys.executable, "-m", "uv", "pip", "compile", "--quiet", "--universal"]
        command += ["--fork-strategy", "fewest"]  # one version of a package for all
        command += ["--only-binary", ":all:"]
        command += [
            "--python",
            sys.executable,
            "--python-version",
            dotted(OLDEST),
            "--no-annotate",
            "--no-header",
            "-o",
            str(out),
        ]
        command += [word for extra in extras for word in ("--extra", extra)]
        subprocess.run(
            [*command, *options, "pyproject.toml", "-"], input=more, text=True, check=True, cwd=ROOT
        )
        lines = out.read_text(encoding="utf-8").splitlines()
    return [line.replace("+cpu", "") for line in lines if not line.startswith(CUDA)]


def name(line: str) -> str:
    return line.split("==")[0]


if __name__ == "__main__":
    main(*sys.argv[1:])
