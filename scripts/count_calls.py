"""Count the functions and files that making, resetting and stepping an environment run, and the modules
of the package that they load: how far a reader has to go. Tracing of kernels is left out.

    python scripts/count_calls.py --env-id hoof_env/HorseLeg-v0
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

PACKAGE = str(Path(__file__).parents[1] / "hoof_env")


def called(act: Callable[[], Any]) -> tuple[Any, set[tuple[str, str]]]:
    """Call a function; return its result, and files and names of the package's functions that ran, without
    those called while kernels are traced."""
    found: set[tuple[str, str]] = set()
    depth = 0

    def watch(frame: Any, event: str, _: Any) -> None:
        nonlocal depth
        path, name = frame.f_code.co_filename, frame.f_code.co_name
        if not path.startswith(PACKAGE):
            return
        is_tracing = path.endswith("simd/compile.py") and name == "compile"
        if event == "call":
            depth += is_tracing
            if not depth and not name.startswith("<"):
                found.add((path, f"{frame.f_code.co_qualname}"))
        elif event == "return":
            depth -= is_tracing

    sys.setprofile(watch)
    try:
        return act(), found
    finally:
        sys.setprofile(None)


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--env-id", default="hoof_env/HorseLeg-v0")
    env_id = parser.parse_args().env_id
    import gymnasium as gym

    import hoof_env  # noqa: F401

    gym.make(env_id).reset(seed=0)  # kernels and tables are there then
    env, made = called(lambda: gym.make(env_id))
    _, started = called(lambda: env.reset(seed=0))
    action = env.action_space.sample()
    _, stepped = called(lambda: env.step(action))
    for name, found in (("make", made), ("reset", started), ("step", stepped)):
        print(f"{name:6} {len(found):4} functions in {len({path for path, _ in found}):3} files")
    print(f"modules of hoof_env loaded: {sum(name.split('.')[0] == 'hoof_env' for name in sys.modules)}")


if __name__ == "__main__":
    main()
