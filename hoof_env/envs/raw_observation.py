"""What is observed, before it is scaled: angles, speeds, heights and forces in their units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hoof_env.envs import episode as e
from hoof_env.envs.batch import EpisodeBatch
from hoof_env.envs.observation import GROUPS
from hoof_env.gait.parameters import PARAMETERS

Floats = NDArray[np.float64]
UNITS = {name: unit for group in GROUPS.values() for name, _, unit in group}


def raw_observation(batch: EpisodeBatch) -> dict[str, Floats]:
    """The entries of the observation by name, in its order and in the units of `UNITS`, shape (num_envs,)."""
    engine, memory = batch.engine, batch.episode[:, : batch.num_envs]
    state, report, terrain = engine.state, engine.report, engine.terrain
    theta, x, target = state["theta"][0], report["x"], memory[e.TARGET].copy()
    values = [np.sin(theta), np.cos(theta), *(state[name][0] for name in PARAMETERS)]
    values += [state[f"{name}_rate"][0] for name in PARAMETERS]
    values += [report["vx"], report["vy"], report["y"]]
    values += [(state[f"{point}_penetration"][0] > 0.0).astype(float) for point in ("toe", "heel")]
    values += [report[f"{point}_normal"][0] for point in ("toe", "heel")]
    slow = [state[f"{point}_slowness"][0] for point in ("toe", "heel")]
    values += [np.divide(1.0, s, out=np.zeros_like(s), where=s > 0.0) for s in slow]
    values += [engine.strides["stance_peak"][0], *memory[e.ACTION : e.ACTION + e.ACTIONS].copy(), target]
    values += [terrain.height_at(x + ahead) - terrain.height_at(x) for ahead in e.AHEAD]
    known = dict(zip(UNITS, values, strict=True))
    return {name: known[name] for name in batch.names}
