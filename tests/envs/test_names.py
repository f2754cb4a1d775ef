"""One name for a quantity in kernels, engines, infos, records, summaries and files.

`python tests/envs/test_names.py` prints the names by place.
"""

from __future__ import annotations

import re

import gymnasium as gym
import numpy as np

from hoof_env.dynamics import layout
from hoof_env.gait import PARAMETERS
from hoof_env.record.columns import RECORD
from hoof_env.record.instant import Instant
from hoof_env.records import substeps

LEG = "hoof_env/HorseLeg-v0"
HORSE = "hoof_env/Horse-v0"

OF_FILES = {
    "depth": "depth of a hoof point, negative in the air; beyond the penetration by a spring's deflection",
    "force_x": "normal and friction in the world's axes",
    "force_y": "likewise",
    "cop_x": "centre of pressure, of normals, frictions and places",
    "cop_y": "likewise",
    "free_moment": "0, which laboratories expect",
}
"""Quantities of files alone, with what they are made of."""

OF_EPISODES = {
    "seconds": "time",
    "distance_m": "x, or travel on a fixed trunk",
    "speed_m_s": "distance_m over seconds",
    "mean_normal_n": "normal_impulse over seconds",
    "stance_peak_sum_n": "sum of stance_peak at the ends of stances, which is the sum of peak_grf_increase",
    "loading_rate_n_s": "loading_rate_increase over stances",
    "duty_factor": "loaded_time over seconds",
    "cost_of_transport": "positive_work divided by weight and distance_m",
    "weight_share": "mean_normal_n divided by the weight",
    "support_share": "1 less weight_share",
    "failed": "1 after a failure",
    "success": "1 if it lasted, at nearly the commanded speed",
}
"""Statistics of episodes, with what they are made of; the other figures are sums with their unit."""

OF_STARTS = {"speed": "vx at the start", "height": "y at the start", "phase": "of a stride"}
"""Values of a start, which are told and set in words that a horse has, too."""

UNIT = re.compile(r"_(n|j|m|s|m_s|n_s)$")


def places() -> dict[str, set[str]]:
    """Return the names of quantities by place, of one leg."""
    env = gym.make(LEG, episode_seconds=0.06).unwrapped
    _, info = env.reset(seed=0)
    while "episode_summary" not in info:
        _, _, _, _, info = env.step(np.zeros(4, np.float32))
    kernel = {
        *layout.LegReport.names,
        *layout.Strides.names,
        *layout.StrideSums.names,
        *layout.TrunkReport.names,
    }
    kernel |= {*layout.LegState.names, *layout.Moving.names}
    return {
        "kernel": kernel,
        "engine": {*env.engine.state, *env.engine.report},
        "info": {*info["measured"].keys()},
        "start": {*env.body.start_names},
        "record": {*env.record()},
        "summary": {*info["episode_summary"]},
        "file": {*RECORD, *Instant._fields, *substeps(env)},
    }


def vector_parts(name: str) -> str:
    """Return the name of a row of a planar vector by the names of its two numbers in records."""
    for vector, letter in (("place", ""), ("velocity", "v"), ("acceleration", "a")):
        name = re.sub(f"^{vector}_([xy])$", rf"{letter}\1", name)
    return name


def test_a_quantity_has_one_name():
    named = places()
    gait = {f"{part}_{k}" for part in ("gait", "gait_rate") for k in range(4)}
    kernel = {vector_parts(name) for name in named["kernel"]} - gait
    parameters = {*PARAMETERS, *(f"{name}_rate" for name in PARAMETERS)}
    commands = {f"command_{name}" for name in PARAMETERS}
    assert named["engine"] <= kernel | parameters | {"time"}
    assert named["info"] <= kernel | parameters | commands | {"result"}
    assert named["record"] == named["engine"]
    assert named["start"] <= kernel | {*OF_STARTS}
    for name in named["file"] - named["record"] - commands:
        assert re.sub(r"^(toe|heel)_", "", name) in OF_FILES
    for name in named["summary"] - {*OF_EPISODES}:
        assert UNIT.sub("", name) in layout.StrideSums.names


if __name__ == "__main__":
    for place, names in places().items():
        print(f"{place}: {', '.join(sorted(names))}")
