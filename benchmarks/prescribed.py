"""Force of any ground on a hoof that moves as a gait prescribes.

Under a fixed trunk the ground changes forces and no motion. A cycle of the crank is therefore simulated once,
and the package's own contact law is evaluated along it, on other ground or at another level.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hoof_env.ground.contact import Contact as Touch
from hoof_env.ground.contact import Ground, GroundRecord, new_contacts, touch
from hoof_env.paper.measure import POINTS, Trace
from hoof_env.paper.reproduce import run_cycle
from hoof_env.paper.rows import EXACT

Floats = NDArray[np.float64]

STEP = 1e-4
"""Time between samples of a cycle [s]."""


@dataclass(frozen=True)
class Contact:
    """Contact of toe and heel along a cycle, columns in this order.

    Attributes:
        time: instants [s], shape (n,).
        depth, rate: penetration and its rate [m, m/s], shape (n, 2).
        approach: speed at the touch-down of the present contact [m/s], 0 in the air, shape (n, 2).
        force: normal force [N], shape (n, 2).
    """

    time: Floats
    depth: Floats
    rate: Floats
    approach: Floats
    force: Floats

    @property
    def normal(self) -> Floats:
        """Normal force on the hoof [N], shape (n,)."""
        total: Floats = self.force.sum(axis=1)
        return total

    @property
    def peak(self) -> float:
        """Highest normal force on the hoof [N]."""
        return float(self.normal.max())

    @property
    def mean(self) -> float:
        """Mean normal force over the cycle [N]."""
        return float(np.trapezoid(self.normal, self.time) / (self.time[-1] - self.time[0]))

    def work(self) -> tuple[float, float]:
        """Return the work that the hoof does on the ground, and what the ground gives back [J]."""
        power = self.force * self.rate
        given, back = (
            float(np.trapezoid(np.clip(sign * power, 0.0, None).sum(axis=1), self.time)) for sign in (1, -1)
        )
        return given, back

    def stored(self, ground: Ground) -> float:
        """Return the most energy that the ground's springs hold at an instant [J]."""
        n = ground.exponent
        energy = ground.stiffness * np.clip(self.depth, 0.0, None) ** (n + 1) / (n + 1)
        return float(energy.sum(axis=1).max())


@lru_cache(maxsize=4)
def cycle_of_gait(gait: str) -> Trace:
    """Return a cycle of the paper's walk or run under the fixed trunk, sampled every `STEP`."""
    trace = run_cycle(gait, EXACT, sim_dt=STEP)
    trace.flags.writeable = False
    return trace


def contact_on(gait: str, ground: Ground, rise: float = 0.0, speed: float = 1.0) -> Contact:
    """Return the contact of a gait with ground that lies higher by `rise` [m], at `speed` times the pace."""
    trace = cycle_of_gait(gait)
    time = np.array(trace["time"]) / speed
    depth = np.stack([trace[f"{name}_penetration"] for name in POINTS], axis=1) + rise
    rate = np.stack([trace[f"{name}_penetration_rate"] for name in POINTS], axis=1) * speed
    approach = np.zeros_like(depth)
    force = np.zeros_like(depth)
    _follow(depth, rate, new_contacts(), ground.to_record(), approach, force)
    return Contact(time, depth, rate, approach, force)


def _follow(
    depth: Floats, rate: Floats, contacts: list[Touch], ground: GroundRecord, approach: Floats, force: Floats
) -> None:
    """Fill approach speeds and forces, instant by instant."""
    for k in range(depth.shape[0]):
        for point, contact in enumerate(contacts):
            pushed = touch(contact, complex(0.0, -depth[k, point]), complex(0.0, -rate[k, point]), ground)
            approach[k, point] = contact.approach
            force[k, point] = pushed.imag
