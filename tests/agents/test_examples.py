"""The example that a newcomer runs first does what it says."""

import subprocess
import sys
from pathlib import Path

EXAMPLE = Path(__file__).parents[2] / "examples" / "first_curve.py"


def test_first_curve(tmp_path):
    short = EXAMPLE.read_text()
    for long, less in (("200_000", "2_048"), ("episodes=20", "episodes=2")):
        assert long in short
        short = short.replace(long, less)
    done = subprocess.run(
        [sys.executable, "-W", "error::UserWarning:stable_baselines3", "-c", short],
        cwd=tmp_path, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "UserWarning" not in done.stderr
    assert {"first_curve.png", "first_curve.zip", "first_curve.monitor.csv"} == {
        path.name for path in tmp_path.iterdir()
    }
    assert "at the end: first_curve.png" in done.stdout
