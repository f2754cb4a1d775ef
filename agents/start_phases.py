"""Phase of the stride at which episodes in a gait should start, so that no horse falls at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.gait_rig import ENV_ID
from hoof_env.errors import HoofEnvError
from hoof_env.evaluation.episodes import make_rows
from hoof_env.simd.threads import limit_threads

Floats = NDArray[np.float64]

PHASES = np.arange(0.0, 0.5, 0.025)  # of starts that are tried [strides]
DROPPED = 512  # starts from each
AT_ONCE = 1.4  # [s]


def phase_of(gait: Floats, speed: float) -> float | None:
    """Return the phase of the stride at which episodes in a gait should start: the middle of the longest run
    of `PHASES` from which no horse falls at once; None if none falls from any.

    A start is level and at rest but for its speed, which a gait with flight may not take at any phase.

    Raises:
        HoofEnvError: horses fall from each phase.
    """
    envs: Any = make_rows(ENV_ID, DROPPED, num_threads=limit_threads(2))
    idle = np.zeros((DROPPED, 16), np.float32)
    falls = []
    for phase in PHASES:
        options = {"gait": gait, "target_speed": speed, "phase": float(phase)}
        envs.reset(seed=[2 * 10**6 + k for k in range(DROPPED)], options=options)
        fell = np.zeros(DROPPED, bool)
        for _ in range(round(AT_ONCE / envs.dt)):
            fell |= envs.step(idle)[2]
        falls.append(int(fell.sum()))
    if not any(falls):
        return None
    # Twice around, for the run may pass the end; left and right are alike half a stride apart
    runs_of = [0]
    for count in falls * 2:
        runs_of.append(runs_of[-1] + 1 if count == 0 else 0)
    longest = min(max(runs_of), len(PHASES))
    if longest == 0:
        raise HoofEnvError(
            f"the gait at {speed:.2f} m/s: expected a phase from which no horse falls, got none"
        )
    last = runs_of.index(max(runs_of)) - 1
    middle: float = round((last - (longest - 1) / 2) / len(PHASES) / 2 % 0.5, 4)
    return middle
