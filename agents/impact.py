"""How steeply the force on the hoof rises when it meets the ground.

A stance lasts while the normal force is above 5 % of the weight, as on a force plate. The first seconds of an
episode, in which a gait settles, are left out.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.memory import LIFT_OFF

Floats = NDArray[np.float64]

SETTLED = 3.0
"""Seconds of an episode that are left out, where it is at least twice as long."""

WINDOW = 0.005
"""The loading rate is the steepest rise of the force over so many seconds."""

_FORCES = ("toe_normal", "heel_normal", "toe_friction", "heel_friction")


class LoadingRate:
    """The mean loading rate of an episode, from the substeps that the environment records.

    Args:
        env: an environment of this package that was just reset. Call `add` after each step.
    """

    def __init__(self, env: Any) -> None:
        self._leg = env.unwrapped
        self._parts: list[dict[str, Floats]] = []
        self._leg.record()  # substeps are kept from here on

    def add(self) -> None:
        """Keep the substeps of the last step."""
        record = self._leg.record()
        self._parts.append({name: record[name].ravel() for name in ("time", *_FORCES)})

    def mean(self) -> float:
        """Mean over the whole stances of the episode [N/s], 0 without a stance."""
        leg = self._leg
        whole = {name: np.concatenate([part[name] for part in self._parts]) for name in self._parts[0]}
        settled = leg.settings.episode_seconds >= 2 * SETTLED
        late = whole["time"] > (SETTLED if settled else 0.0)
        toe, heel, toe_friction, heel_friction = (whole[name][late] for name in _FORCES)
        rates = loading_rates(toe + heel, toe_friction + heel_friction, leg.weight, leg.sim_dt)
        return float(rates.mean()) if len(rates) else 0.0


def loading_rates(normal: Floats, friction: Floats, weight: float, dt: float) -> Floats:
    """Loading rate of each whole stance [N/s], shape (stances,): the steepest rise of the normal force from
    touch-down to the highest ground reaction force.

    Args:
        normal, friction: forces on the hoof, `dt` apart, shape (substeps,) [N].
        weight: of trunk and leg [N].
        dt: substep [s].
    """
    grf = np.hypot(normal, friction)
    rates = []
    for first, end in stances(normal, weight):
        top = first + int(np.argmax(grf[first:end]))
        rates.append(steepest(normal[max(first - 1, 0) : top + 1], dt))
    return np.array(rates)


def stances(normal: Floats, weight: float) -> NDArray[np.int64]:
    """First substep of each whole stance and the first after it, shape (stances, 2)."""
    loaded = np.concatenate([[True], normal > LIFT_OFF * weight, [True]])
    down, up = (np.flatnonzero(np.diff(loaded.astype(int)) == sign) for sign in (1, -1))
    return np.stack([down[:-1], up[1:]], 1) if len(down) > 1 else np.zeros((0, 2), np.int64)


def steepest(force: Floats, dt: float) -> float:
    """Steepest rise of a force over `WINDOW`, over all of it where it is shorter [N/s].

    Args:
        force: shape (n,), `dt` [s] apart [N].
        dt: see there.
    """
    width = min(max(1, round(WINDOW / dt)), len(force) - 1)
    return float((force[width:] - force[:-width]).max() / (width * dt)) if width > 0 else 0.0
