"""This project's engine with the face of a peer: the same start, the same record."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.common import ALL, Assembly, Record, Start
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Result, Trunk
from hoof_env.gait.gait import GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.leg.kinematics import FrameMotion, pose

POINTS = ("toe", "heel")


class TrunkLegs:
    """A horse in `TrunkEngine`.

    Args:
        limbs, trunk, start: as for the peers.
        dt, integrator: of the engine, which divides a step that is too long for the ground.
        ground: the default if None; to be in the air, hang the trunk high.
    """

    assembly: Assembly = ALL

    def __init__(
        self,
        limbs: Sequence[Limb],
        trunk: Trunk,
        start: Start,
        dt: float = 1e-4,
        ground: Ground | None = None,
        integrator: str = "rk4",
    ) -> None:
        self.limbs, self.start = tuple(limbs), start
        self.engine = TrunkEngine(limbs, trunk, ground, sim_dt=dt, integrator=integrator, reactions=True)
        a, b = start.swing_sin, start.swing_cos
        gaits = [
            GaitParameters(speed, swing - a * np.sin(theta) - b * np.cos(theta), a, b)
            for theta, speed, swing in zip(start.crank, start.crank_speed, start.swing, strict=True)
        ]
        x, y = start.position
        self.engine.reset(gaits, np.array(start.crank)[:, None], x=x, y=y)

    def run(self, duration: float, samples: int) -> Record:
        """Advance by `duration` [s] and look `samples` times besides the beginning, evenly.

        Raises:
            RuntimeError: the engine stopped, with its message.
        """
        steps = round(duration / self.engine.sim_dt / samples)
        rows = [self.look()]
        for _ in range(samples):
            if self.engine.advance(steps=steps)[0] != Result.OK:
                raise RuntimeError(self.engine.messages()[0])
            rows.append(self.look())
        return Record.of(rows)

    def look(self) -> tuple[Any, ...]:
        """What `Record` has of the present instant."""
        s = {name: value[..., 0] for name, value in self.engine.state.items()}
        r = {name: value[..., 0] for name, value in self.engine.report.items()}
        body = np.array([r["x"], r["y"], s["pitch"], r["vx"], r["vy"], r["pitch_rate"]])
        return (
            s["time"], s["theta"], s["theta_rate"], body, r["crank_torque"], r["hip_torque"],
            self.engine.reactions().joints[..., 0],
            max(self._gap(i, s, r) for i in range(len(self.limbs))),
        )  # fmt: skip

    def _gap(self, i: int, s: dict[str, Any], r: dict[str, Any]) -> float:
        """From where the engine has toe and heel to where the closed linkage has them [m]."""
        limb = self.limbs[i]
        at = complex(r["x"], r["y"]) + complex(*limb.hip) * np.exp(1j * s["pitch"])
        frame = FrameMotion(phi=r["phi"][i] + limb.geometry.travel * s["pitch"], position=(at.real, at.imag))
        closed = pose(limb.geometry, s["theta"][i], frame=frame)
        names = (limb.geometry.toe, limb.geometry.heel)
        return max(
            float(np.hypot(*(closed.point(name) - (r[f"{point}_x"][i], r[f"{point}_y"][i]))))
            for name, point in zip(names, POINTS, strict=True)
        )
