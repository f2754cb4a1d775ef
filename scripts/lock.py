"""Write constraints.txt and hashes.txt anew, by `uv pip compile`: python scripts/lock.py [options of it, such
as --upgrade]

The versions that stand there stay unless pyproject.toml or an option asks for others. One list serves each
supported Python and platform. Of PyTorch's CUDA build, which asks for exact versions itself, nothing is kept.
hashes.txt has the SHA-256 of each file of what set-up installs, but for PyTorch, whose builds for the CPU are
of another index. uv checks them; pip would refuse an editable install beside hashes: hence a file apart.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from setup_venv import EXTRAS, HASHES, OLDEST, ROOT, dotted

LOCK = ROOT / "constraints.txt"
HASHES_HEAD = """\
# Hashes of the files of constraints.txt, which uv checks in set-up. Made by `python scripts/lock.py`.
"""
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
    text = hashes(compiled(together, "--generate-hashes"))  # of the versions that now stand there
    (ROOT / HASHES).write_text(HASHES_HEAD + text, encoding="utf-8")


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
        lines = out.read_text(encoding="utf-8").replace("\\\n", "\\\0").splitlines()  # an entry each
    return [line.replace("+cpu", "") for line in lines if not line.startswith(CUDA)]


def hashes(entries: list[str]) -> str:
    """The text of a lock with hashes, without PyTorch."""
    kept = [entry for entry in entries if "--hash" in entry and not entry.startswith("torch==")]
    return "\n".join(kept).replace("\0", "\n") + "\n"


def name(line: str) -> str:
    return line.split("==")[0]


if __name__ == "__main__":
    main(*sys.argv[1:])
