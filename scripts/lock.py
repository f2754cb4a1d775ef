"""Write constraints.txt and pylock.toml anew, by `uv pip compile`: python scripts/lock.py [options of it,
such as --upgrade]

The versions that stand there stay unless pyproject.toml or an option asks for others. One list serves each
supported Python and platform. Of PyTorch's CUDA build, which asks for exact versions itself, nothing is kept.
pylock.toml, in the form of PEP 751, has the SHA-256 of each file of what set-up installs, but for PyTorch,
whose builds for the CPU are of another index. Set-up has uv check them; pip would refuse an editable install
beside hashes in constraints.txt: hence a file apart.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from setup_venv import EXTRAS, LOCKED_FILES, OLDEST, ROOT, dotted

LOCK = ROOT / "constraints.txt"
FILES_HEAD = """\
# Files of the versions in constraints.txt that set-up installs, without PyTorch, and their hashes, which uv
# checks. Made by `python scripts/lock.py`.
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
    text = written(together, "pylock.toml", "--constraints", str(LOCK))
    (ROOT / LOCKED_FILES).write_text(FILES_HEAD + without_torch(text), encoding="utf-8")


def compiled(extras: list[str], *options: str, more: str = "") -> list[str]:
    """Lines of the lock for these extras, and for what `more` asks for, a requirement on each line."""
    lines = written(extras, LOCK.name, *options, more=more).splitlines()
    return [line.replace("+cpu", "") for line in lines if not line.startswith(CUDA)]


def written(extras: list[str], file: str, *options: str, more: str = "") -> str:
    """What uv writes to a file of this name, from which it takes the form."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / file
        if file == LOCK.name:
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
        return out.read_text(encoding="utf-8")


def without_torch(text: str) -> str:
    """A pylock.toml without PyTorch and what its CUDA build brings."""
    head, *packages = text.split("[[packages]]\n")
    left_out = tuple(f'name = "{name}' for name in (*CUDA, 'torch"'))
    return "[[packages]]\n".join([head, *(one for one in packages if not one.startswith(left_out))])


def name(line: str) -> str:
    return line.split("==")[0]


if __name__ == "__main__":
    main(*sys.argv[1:])
