"""Cases of `compare --first`, as a script that knows only what every commit has: public names and ids.

    compare_first_cases.py import
    compare_first_cases.py step ID COUNT    up to the first step of an environment, alone or many at once
    compare_first_cases.py edit COUNT       an own term of the reward, edited, up to the next step

It prints the file of the package, and for `edit` the processor time [s] from the edit on. What it imports
itself would count as the package's, so functions import what they need.
"""

from __future__ import annotations

import sys
from typing import Any

TASK = """
import hoof_env

def effort(step, weight):
    return -{factor} * weight * step.leg.report.toe.normal

hoof_env.register(
    "first/Own-v0", terms=[hoof_env.Term("effort", 0.5, "1/kN", "normal force of the toe", effort)]
)
"""
EDITS = ("0.001", "0.004 * 0.5")  # the second doubles the term


def step(env_id: str, count: int) -> dict[str, Any]:
    """Make an environment, or `count` at once, take a step and return its `info`."""
    import gymnasium as gym

    import hoof_env  # noqa: F401

    many = {"num_envs": count, "vectorization_mode": "vector_entry_point"}
    env = gym.make(env_id) if count == 1 else gym.make_vec(env_id, **many)  # type: ignore[arg-type]
    env.reset(seed=0)
    info: dict[str, Any] = env.step(0.0 * env.action_space.sample())[4]
    return info


def edit(count: int) -> float:
    """Return the processor time [s] from an edit of a module with an own term to the next step.

    Raises:
        RuntimeError: the step was taken with the term as it was before.
    """
    import importlib
    import resource
    import tempfile
    import warnings
    from pathlib import Path

    import numpy as np

    def spent() -> float:
        used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        return sum(one.ru_utime + one.ru_stime for one in used)

    warnings.filterwarnings("ignore", message=".*Overriding environment")
    with tempfile.TemporaryDirectory() as folder:
        module = Path(folder) / "first_own_task.py"
        sys.path.insert(0, folder)
        # Bytecode of the first text would pass for the second text's if this follows within a second
        sys.dont_write_bytecode = True
        module.write_text(TASK.format(factor=EDITS[0]))
        task = importlib.import_module(module.stem)
        before = step("first/Own-v0", count)["reward_effort"]
        module.write_text(TASK.format(factor=EDITS[1]))
        begin = spent()
        importlib.reload(task)
        after = step("first/Own-v0", count)["reward_effort"]
        seconds = spent() - begin
    if not np.allclose(after, 2.0 * before, rtol=1e-9, atol=0.0) or not np.any(before):
        raise RuntimeError(f"expected twice the reward_effort of {before} after the edit, got {after}")
    return seconds


def main(case: str, *words: str) -> None:
    """Run a case and print what it has to tell."""
    seconds = None
    if case == "step":
        step(words[0], int(words[1]))
    elif case == "edit":
        seconds = edit(int(words[0]))
    import hoof_env

    print(hoof_env.__file__)
    if seconds is not None:
        print(seconds)


if __name__ == "__main__":
    main(*sys.argv[1:])
