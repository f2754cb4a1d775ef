"""How steeply the force on the hoof rises when it meets the ground.

The first seconds of an episode, in which a gait settles, are left out.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.records import setting

Floats = NDArray[np.float64]

SETTLED = 3.0
"""Seconds of an episode that are left out, where it is at least twice as long."""

WINDOW = 0.005
"""The loading rate is the steepest rise of the force over so many seconds."""

FORCES = ("toe_normal", "heel_normal", "toe_friction", "heel_friction")


class LoadingRate:
    """The mean loading rate of an episode, from the substeps that the environment records.

    Args:
        env: an environment of this package that was just reset. Call `add` after each step.
    """

    def __init__(self, env: Any) -> None:
        self._leg, self._setting = env.unwrapped, setting(env)
        self._parts: list[dict[str, Floats]] = []
        self._leg.record()  # substeps are kept from here on

    def add(self) -> None:
        """Keep the substeps of the last step."""
        record = self._leg.record()
        self._parts.append({name: record[name].ravel() for name in ("time", *FORCES)})

    def mean(self) -> float:
        """Mean over the whole stances of the episode [N/s], 0 without a stance."""
        columns = {name: np.concatenate([part[name] for part in self._parts]) for name in self._parts[0]}
        is_long = self._leg.settings.episode_seconds >= 2 * SETTLED
        late = columns["time"] > (SETTLED if is_long else 0.0)
        toe, heel, toe_friction, heel_friction = (columns[name][late] for name in FORCES)
        friction = toe_friction + heel_friction
        rates = loading_rates(toe + heel, friction, self._setting.lift_off_n, self._setting.sim_dt)
        return float(rates.mean()) if len(rates) else 0.0


def loading_rates(normal: Floats, friction: Floats, lift_off: float, dt: float) -> Floats:
    """Loading rate of each whole stance [N/s], shape (stances,): the steepest rise of the normal force from
    touch-down to the highest ground reaction force.

    Args:
        normal, friction: forces on the hoof, `dt` apart, shape (substeps,) [N].
        lift_off: normal force that separates stance from swing [N].
        dt: substep [s].
    """
    grf = np.hypot(normal, friction)
    rates = []
    for first, end in stances(normal, lift_off):
        top = first + int(np.argmax(grf[first:end]))
        rates.append(steepest(normal[max(first - 1, 0) : top + 1], dt))
    return np.array(rates)


def stances(normal: Floats, lift_off: float) -> NDArray[np.int64]:
    """First substep of each whole stance and the first after it, shape (stances, 2)."""
    loaded = np.concatenate([[True], normal > lift_off, [True]])
    down, up = (np.flatnonzero(np.diff(loaded.astype(int)) == sign) for sign in (1, -1))
    return np.stack([down[:-1], up[1:]], 1) if len(down) > 1 else np.zeros((0, 2), np.int64)


def steepest(force: Floats, dt: float) -> float:
    """Steepest rise over `WINDOW` [N/s], or over all of the force where that is shorter.

    Args:
        force: shape (n,), `dt` [s] apart [N].
        dt: see there.
    """
    width = min(max(1, round(WINDOW / dt)), len(force) - 1)
    return float((force[width:] - force[:-width]).max() / (width * dt)) if width > 0 else 0.0
