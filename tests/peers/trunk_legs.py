"""This project's engine with the face of a peer: the same start, the same record."""

import numpy as np

from benchmarks.common import Record
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Result
from hoof_env.gait import GaitParameters
from hoof_env.leg.kinematics import FrameMotion, pose

POINTS = ("toe", "heel")


class TrunkLegs:
    """A horse in `TrunkEngine`, which divides a step `dt` that is too long for the ground."""

    def __init__(self, limbs, trunk, start, dt=1e-4, ground=None, integrator="rk4"):
        self.limbs, self.start = tuple(limbs), start
        self.engine = TrunkEngine(limbs, trunk, ground, sim_dt=dt, integrator=integrator, reactions=True)
        a, b = start.swing_sin, start.swing_cos
        gaits = [
            GaitParameters(speed, swing - a * np.sin(theta) - b * np.cos(theta), a, b)
            for theta, speed, swing in zip(start.crank, start.crank_speed, start.swing, strict=True)
        ]
        x, y = start.position
        self.engine.reset(gaits, np.array(start.crank)[:, None], x=x, y=y)

    def run(self, duration, samples):
        """Advance by `duration` [s] and look `samples` times besides the beginning, evenly."""
        steps = round(duration / self.engine.sim_dt / samples)
        rows = [self.look()]
        for _ in range(samples):
            assert self.engine.advance(steps=steps)[0] == Result.OK, self.engine.messages()
            rows.append(self.look())
        return Record.of(rows)

    def look(self):
        """What `Record` has of the present instant."""
        s = {name: value[..., 0] for name, value in self.engine.state.items()}
        r = {name: value[..., 0] for name, value in self.engine.report.items()}
        body = np.array([r["x"], r["y"], s["pitch"], r["vx"], r["vy"], r["pitch_rate"]])
        return (
            s["time"], s["crank_angle"], s["crank_angle_rate"], body, r["crank_torque"], r["hip_torque"],
            self.engine.reactions().joints[..., 0],
            max(self._gap(i, s, r) for i in range(len(self.limbs))),
        )  # fmt: skip

    def _gap(self, i, s, r):
        """From where the engine has toe and heel to where the closed linkage has them [m]."""
        limb = self.limbs[i]
        at = complex(r["x"], r["y"]) + complex(*limb.hip) * np.exp(1j * s["pitch"])
        frame = FrameMotion(
            phi=r["swing_angle"][i] + limb.geometry.travel * s["pitch"], position=(at.real, at.imag)
        )
        closed = pose(limb.geometry, s["crank_angle"][i], frame=frame)
        names = (limb.geometry.toe, limb.geometry.heel)
        return max(
            float(np.hypot(*(closed.point(name) - (r[f"{point}_x"][i], r[f"{point}_y"][i]))))
            for name, point in zip(names, POINTS, strict=True)
        )
