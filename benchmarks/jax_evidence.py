"""Evidence for what runs inside JAX: learners, gaits by derivatives, derivatives through windows, speed.

    python -m benchmarks.jax_evidence                    measures everything: one to two hours
    python -m benchmarks.jax_evidence --parts shac       measures that part again
    python -m benchmarks.jax_evidence --parts            writes the page again, from what was measured

Writes docs/evidence/jax.md, and the data and pictures of docs/evidence/jax. Needs
`pip install "hoof-env[jax,train,plot,identify]"`. Seconds are processor time, on which other programs on the
machine have little influence.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401  # isort: skip

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax

from benchmarks import jax_gaits, jax_learners, jax_speed
from benchmarks.jax_page import draw, page
from benchmarks.machine import machine
from examples import jax_gradient

FOLDER = Path(__file__).parents[1] / "docs" / "evidence" / "jax"


def derivatives() -> dict[str, Any]:
    """Return the table of derivatives by windows of a leg and of a horse."""
    ids = {"leg": "hoof_env/HorseLeg-v0", "horse": "hoof_env/Horse-v0"}
    jax.config.update("jax_enable_x64", True)
    try:
        return {name: jax_gradient.compare(id, 16) for name, id in ids.items()}
    finally:
        jax.config.update("jax_enable_x64", False)


PARTS: dict[str, Callable[[], Any]] = {
    "blind": jax_learners.measure_blind,
    "shac": jax_learners.measure_shac,
    "ppo": jax_learners.measure_ppo,
    "gaits": jax_gaits.measure,
    "derivatives": derivatives,
    "speed": jax_speed.measure,
}


def about() -> dict[str, str]:
    """Return versions, machine, date and commit."""
    return {"jax": jax.__version__, **machine()}


def main() -> None:
    """Measure parts, and write the page."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--parts", nargs="*", choices=[*PARTS], default=[*PARTS], help="what to measure")
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder of results and pictures")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    for part in given.parts:
        result = {"about": about(), "result": PARTS[part]()}
        (given.out / f"{part}.json").write_text(json.dumps(result, indent=1) + "\n")
    found = {
        part: json.loads(file.read_text()) for part in PARTS if (file := given.out / f"{part}.json").is_file()
    }
    draw(found, given.out)
    given.out.with_suffix(".md").write_text(page(found))


if __name__ == "__main__":
    main()
