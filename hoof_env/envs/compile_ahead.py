"""Compilation of the kernels of all environments before any is made."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from hoof_env.dynamics.advance import LANES
from hoof_env.envs.batch import EpisodeBatch
from hoof_env.simd.compile import COMPILED, folder
from hoof_env.tasks.registry import TASKS


def compile_task(name: str, num_envs: int, **settings: Any) -> None:
    """Compile or load the kernels of a task, by its name in `TASKS`, for one environment or many."""
    task = TASKS[name]
    # Making a batch compiles or loads its kernels.
    EpisodeBatch(task, task.settings(settings), num_envs).compile_measured()


KERNELS: dict[str, Callable[[], object]] = {
    "one environment": partial(compile_task, "leg", 1),
    "many side by side": partial(compile_task, "leg", LANES),
    "the paper's solver": partial(compile_task, "fixed", 1, solver="paper"),
    "one horse": partial(compile_task, "horse", 1),
    "many horses": partial(compile_task, "horse", LANES),
}
"""Functions that compile each set of kernels, by name. All ids share these kernels, and all settings
except `hoof_stiffness` of one leg, and `harmonics` and a rigid hoof of a horse."""


def compile_kernels(say: Callable[[str], None]) -> list[str]:
    """Compile the kernels that are not in numba's cache; return their names.

    Args:
        say: function that is called with a line of text after each of `KERNELS`, and at the end.

    Raises:
        OutputError: there is something to compile and the cache folder is not writable.
    """
    first = len(COMPILED)
    for name, make in KERNELS.items():
        start = time.monotonic()
        count = len(COMPILED)
        # Grows by the kernels that are not in the cache.
        make()
        if new := COMPILED[count:]:
            say(f"{name}: {time.monotonic() - start:.1f} s for {', '.join(new)}")
    place = folder()
    compiled = COMPILED[first:]
    say(f"{f'{len(compiled)} kernels compiled' if compiled else 'nothing to compile'}; they are in {place}")
    return compiled
