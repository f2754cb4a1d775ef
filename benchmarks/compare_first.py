"""Processor seconds of what a user waits for, of two commits: imports, first steps, an edited reward term,
`hoof-env reproduce`. `python -m benchmarks.compare --base COMMIT --first` prints them.

Each is a whole process, imports and the processes that it starts included, once with empty caches and once
with those that the first has filled. Of an edited term only the time from the edit to the next step counts,
within the process that had the term before.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from benchmarks.rounds import describe, spread
from hoof_env._output import markdown_table

SCRIPT = Path(__file__).with_name("compare_first_cases.py")

EXTRAS = ("plot",)
"""Extras of the package that the cases need: `reproduce` draws figures."""

LEG, HORSE = "hoof_env/HorseLeg-v0", "hoof_env/Horse-v0"
MANY = 64
REPRODUCE = "hoof-env reproduce"

WHOLE: dict[str, tuple[str, ...]] = {
    "`import hoof_env`": ("import",),
    "first step, HorseLeg-v0": ("step", LEG, "1"),
    f"first step, HorseLeg-v0, {MANY} at once": ("step", LEG, str(MANY)),
    "first step, Horse-v0": ("step", HORSE, "1"),
    f"first step, Horse-v0, {MANY} at once": ("step", HORSE, str(MANY)),
    f"`{REPRODUCE}`": (REPRODUCE,),
}
"""Words of the cases that are whole processes, by name."""

EDITED: dict[str, tuple[str, ...]] = {
    "edited term to the next step": ("edit", "1"),
    f"edited term to the next step, {MANY} at once": ("edit", str(MANY)),
}
"""Words of the cases that time a part of their process."""

EMPTY, FULL = "empty caches", "full caches"

Side = tuple[Path, str]
"""Folder of a commit's package, and the interpreter that has its dependencies."""

Seconds = dict[str, dict[str, list[float]]]
"""Processor seconds by case and side, one a round."""


def run(side: Side, words: tuple[str, ...], caches: Path) -> float:
    """Return the processor time [s] of a case in a process of its own.

    Args:
        side: the commit.
        words: of the case.
        caches: folder of all that the process keeps for later ones.

    Raises:
        RuntimeError: the process took the package from elsewhere.
    """
    import resource  # POSIX has it

    tree, python = side
    # Wherever a commit keeps its machine code: numba's folder, or the user's cache
    kept = dict.fromkeys(("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME"), str(caches))
    settings = {"PYTHONPATH": str(tree), "HOOF_ENV_QUIET": "1", **kept}
    with tempfile.TemporaryDirectory() as folder:
        command = [python, "-P", str(SCRIPT), *words]
        if words == (REPRODUCE,):
            command = [python, "-P", "-m", "hoof_env", "reproduce", "--out", folder]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            command, cwd=folder, env=os.environ | settings, stdout=subprocess.PIPE, text=True, check=True
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if words != (REPRODUCE,):
        package, *seconds = done.stdout.split("\n")[:-1]
        if not Path(package).is_relative_to(tree):
            raise RuntimeError(f"expected hoof_env in {tree}, got {package}")
        if seconds:
            return float(seconds[0])
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def run_case(side: Side, name: str) -> dict[str, float]:
    """Return the processor time [s] of a case with empty caches and, where that is another, with full ones,
    by the name of a row."""
    with tempfile.TemporaryDirectory() as folder:
        caches = Path(folder)
        if name in EDITED:
            return {f"{name}, {EMPTY}": run(side, EDITED[name], caches)}
        return {f"{name}, {state}": run(side, WHOLE[name], caches) for state in (EMPTY, FULL)}


def compare(base: Side, now: Side, rounds: int) -> Seconds:
    """Return the seconds of both commits, which take turns in changing order. A first step before the rounds
    makes the bytes of all modules, so that no case has that to do."""
    sides = {"base": base, "now": now}
    order = np.random.default_rng(0)
    found: Seconds = {}
    for side in sides.values():
        run_case(side, "first step, HorseLeg-v0")
    for k in range(rounds):
        for name in (*WHOLE, *EDITED):
            print(f"round {k + 1} of {rounds}: {name}", file=sys.stderr, flush=True)
            for which in order.permutation(list(sides)):
                for row, seconds in run_case(sides[which], name).items():
                    found.setdefault(row, {"base": [], "now": []})[str(which)].append(seconds)
    return found


def table(found: Seconds, base: str) -> str:
    """Return the seconds of both commits and the ratios of each round as Markdown.

    Args:
        found: seconds by case.
        base: name of the base.
    """
    rows = [[case, *map(cell, ratios_of(seconds))] for case, seconds in found.items()]
    return markdown_table(["processor seconds", base, "work tree", f"{base} over work tree"], rows)


def ratios_of(seconds: Mapping[str, list[float]]) -> tuple[list[float], list[float], list[float]]:
    """Return the seconds of base and work tree, and their ratio in each round."""
    base, now = seconds["base"], seconds["now"]
    return base, now, [b / n for b, n in zip(base, now, strict=True)]


def cell(values: list[float]) -> str:
    """Return the median of some rounds with its spread, or the one value."""
    return describe(spread(np.array(values))) if len(values) > 1 else f"{values[0]:.3g}"
