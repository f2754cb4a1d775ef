"""Searches in a file, which is written after each of them."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from agents import runs
from agents.kept import check_numbers, check_shape, read_kept
from hoof_env.tasks.horse_gaits import NAMES


def searches_of_file(content: Any) -> dict[str, Any]:
    """Return a file of searches; raise KeyError, TypeError or ValueError for the content of another one."""
    for name, one in content["searches"].items():
        check_numbers(name, one, ("cost", "reached"))
        check_shape(f"gait of {name}", one["gait"], (len(NAMES),))
    return dict(content)


class Records:
    """Searches in a file, which is written after each of them.

    Args:
        out: the file; one that exists is gone on with.

    Raises:
        DataFileError: it exists and is no such file.
    """

    def __init__(self, out: Path) -> None:
        self.out = out
        self.content: dict[str, Any] = {"searches": {}}
        if out.is_file():
            self.content = read_kept(out, "searches of agents.kinematic_gaits", searches_of_file)

    def tell(self, asked: Sequence[str]) -> None:
        """Print how many of the searches that are asked for there are, and how many are to be made."""
        to_do = [name for name in asked if name not in self.content["searches"]]
        print(f"{self.out}: has {len(asked) - len(to_do)} of {len(asked)} searches", flush=True)
        if to_do:
            print(f"{len(to_do)} searches to do, minutes to hours each", flush=True)

    def keep(self, name: str, look: Any) -> dict[str, Any]:
        """Return what a search found under this name, or finds now."""
        from tqdm import tqdm

        if name not in self.content["searches"]:
            began = time.monotonic()
            with tqdm(desc=name, unit=" generations", leave=False, disable=None) as bar:

                def tick(best: float) -> None:
                    bar.update()
                    bar.set_postfix(best=f"{best:.2f}")

                found = look(tick)
            found["wall_s"] = round(time.monotonic() - began, 1)
            self.content["searches"][name] = found
            self.content |= {"command": runs.command(), "versions": runs.versions()}
            self.out.parent.mkdir(parents=True, exist_ok=True)
            runs.write_text(self.out, json.dumps(self.content, indent=1) + "\n")
            print(name, {key: value for key, value in found.items() if key != "gait"}, flush=True)
        kept: dict[str, Any] = self.content["searches"][name]
        return kept
