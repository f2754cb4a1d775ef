"""All kernels of the environments, compiled ahead of time: for images, and before workers begin."""

from __future__ import annotations

import time
from collections.abc import Callable

from hoof_env.dynamics.advance import LANES
from hoof_env.envs.horse_leg import HorseLegEnv
from hoof_env.envs.vector import HorseLegVectorEnv
from hoof_env.simd.cache import COMPILED, given_folder

CASES: dict[str, Callable[[], object]] = {
    "one environment": HorseLegEnv,
    "many side by side": lambda: HorseLegVectorEnv(LANES),
    "the paper's solver": lambda: HorseLegEnv(task="fixed", solver="paper"),
}
"""What uses kernels of its own; all ids and all settings share these."""


def compile_kernels(say: Callable[[str], None]) -> list[str]:
    """Compile what is not in numba's cache, telling of each of `CASES`; returns the names of those kernels.

    Raises:
        OutputError: there is something to compile, and the cache folder is not writable.
    """
    first = len(COMPILED)
    for name, make in CASES.items():
        begun, count = time.monotonic(), len(COMPILED)
        make()
        if found := COMPILED[count:]:
            say(f"{name}: {time.monotonic() - begun:.1f} s for {', '.join(found)}")
    folder = given_folder() or "numba's own folders; NUMBA_CACHE_DIR names another"
    compiled = COMPILED[first:]
    say(f"{f'{len(compiled)} kernels compiled' if compiled else 'nothing to compile'}; they are in {folder}")
    return compiled
