"""How long a newcomer waits: the wheel into an empty environment, `gym.make`, a first learning curve.

    python scripts/first_minutes.py          prints seconds of each step; everything is in a temporary folder

It installs the tested versions (constraints.txt), PyTorch for the CPU (TORCH_INDEX), and runs
examples/first_curve.py.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from setup_venv import TORCH_INDEX

ROOT = Path(__file__).resolve().parents[1]
MAKE = (
    "import gymnasium as gym, hoof_env; env = gym.make('hoof_env/HorseLeg-v0'); env.reset(seed=0); "
    "env.step(env.action_space.sample())"
)


def main() -> int:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        python = folder / "venv" / "bin" / "python"
        install = [str(python), "-m", "pip", "install", "-qq", "-c", str(ROOT / "constraints.txt")]
        if TORCH_INDEX:
            install += ["--extra-index-url", TORCH_INDEX, "--retries", "1"]
        steps: dict[str, list[str]] = {
            "virtual environment": [sys.executable, "-m", "venv", str(folder / "venv")],
            "build of the wheel": [
                sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation",
                "-w", name, str(ROOT),
            ],
            "pip install": [],
            "gym.make, first step, kernels compiled": [str(python), "-c", MAKE],
            "first learning curve, 640,000 steps": [str(python), str(ROOT / "examples" / "first_curve.py")],
        }  # fmt: skip
        total = 0.0
        for title, command in steps.items():
            if title == "pip install":
                (wheel,) = folder.glob("*.whl")
                command = [*install, f"{wheel}[train,plot]"]
            begin = time.monotonic()
            shown = None if title.startswith("first") else subprocess.DEVNULL
            environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {"HOOF_ENV_QUIET": "1"}
            done = subprocess.run(command, cwd=folder, stdout=shown, env=environment)
            if done.returncode:
                print(f"{title}: {' '.join(command)} ended with {done.returncode}", file=sys.stderr)
                return 1
            seconds = time.monotonic() - begin
            total += seconds if title != "build of the wheel" else 0.0
            print(f"{title:<40} {seconds:6.0f} s", flush=True)
        print(f"{'from the empty environment':<40} {total:6.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
