"""Cycles made by hand."""

import numpy as np
import pytest

from hoof_env.paper.measure import CYCLE


@pytest.fixture(scope="session")
def cycle():
    """A function that makes one cycle of 1 s from its parts.

    `toe` and `heel` are (enter, leave) [s] or None: penetration is a tent of unit slope, linear around its
    zeros. Every other keyword is a column, a number or a function of time; the sums follow.
    """

    def make(toe=(0.3, 0.6), heel=(0.25, 0.5), samples=1000, **columns):
        trace = np.zeros(samples + 1, CYCLE)
        t = trace["time"] = np.linspace(0, 1, samples + 1)
        for name, interval in (("toe", toe), ("heel", heel)):
            enter, leave = interval or (2.0, -1.0)
            trace[f"{name}_penetration"] = np.minimum(t - enter, leave - t)
        for name, column in columns.items():
            trace[name] = column(t) if callable(column) else column
        if "normal" not in columns:
            trace["normal"] = trace["toe_normal"] + trace["heel_normal"]
        trace["friction"] += trace["toe_friction"] + trace["heel_friction"]
        trace["grf"] = np.hypot(trace["normal"], trace["friction"])
        return trace

    return make


@pytest.fixture(scope="session")
def bump():
    """A function that makes half sines: bump((start, end, height), ...) is a function of time."""

    def make(*bumps):
        def force(t):
            return sum(
                height * np.sin(np.pi * np.clip((t - start) / (end - start), 0, 1))
                for start, end, height in bumps
            )

        return force

    return make
