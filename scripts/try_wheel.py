"""Try the built wheel as a new user does: python scripts/try_wheel.py FOLDER [pip options]

In FOLDER, which lies outside the checkout, a fresh environment gets the wheel, first alone and then with
extras, and runs the commands and the code of docs/project.md. Prints a table of wall and processor times, and
the output of each step on stderr; ends with what fails.
"""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "project.md"
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
OWN = "def act(observations):\n    return -0.1 * observations[:, :4]\n"


def processor() -> float:
    """Processor time of all processes that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def timed(title: str, command: list[str], folder: Path) -> None:
    """Run a command and print its line of the table."""
    env = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "HOOF_ENV_CACHE_DIR")}
    began, used = time.monotonic(), processor()
    done = subprocess.run(
        command, cwd=folder, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    print(f"| {title} | {time.monotonic() - began:.0f} | {processor() - used:.0f} |", flush=True)
    print(done.stdout, file=sys.stderr, flush=True)
    if done.returncode:
        sys.exit(f"{title}: exit code {done.returncode}")


def main(folder: Path, options: list[str]) -> None:
    """Build, install and run."""
    folder.mkdir(parents=True, exist_ok=True)
    blocks = BLOCK.findall(PAGE.read_text(encoding="utf-8"))
    shell = [line for kind, code in blocks if kind == "bash" for line in code.splitlines()]
    commands = [line.partition("  #")[0].split() for line in shell if line.startswith("hoof-env ")]
    python = "\n".join(code for kind, code in blocks if kind == "python")
    (folder / "my_module.py").write_text(OWN, encoding="utf-8")
    (folder / "project.py").write_text(python, encoding="utf-8")
    bin = folder / "venv" / "bin"
    pip = [str(bin / "python"), "-m", "pip", "install", "-q", *options]

    print("| step | wall s | processor s |\n|---|---|---|")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder / "dist")]
    timed("build the wheel", build, ROOT)
    wheel = str(next((folder / "dist").glob("*.whl")))
    timed("python -m venv", [sys.executable, "-m", "venv", "venv"], folder)
    timed("pip install WHEEL", [*pip, wheel], folder)
    extras = {"render": "render,video,plot", "mine.zip": "train,onnx"}
    for command in commands:
        for word, names in list(extras.items()):
            if word in command:
                timed(f"pip install WHEEL[{names}]", [*pip, f"{wheel}[{names}]"], folder)
                del extras[word]
        if "mine.zip" in command and not (folder / "mine.zip").exists():
            timed("the code of the page", [str(bin / "python"), "project.py"], folder)
        timed(f"`{' '.join(command)}`", [str(bin / command[0]), *command[1:]], folder)
    print(f"\n{folder}: {', '.join(sorted(path.name for path in folder.iterdir()))}")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), sys.argv[2:])
