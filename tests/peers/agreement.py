"""How well this project's engine agrees with MuJoCo and Exudyn, and with itself at other steps.

Ground forces are this project's, given to the peers from outside. Every engine runs twice, at a fine step
and at twice that; the difference of the two is called its own and bounds what it can be trusted with. MuJoCo
has no swing that moves: those cases are Exudyn's alone. All quantities of all cases on two legs:
docs/evidence/README.md.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.common import ALL
from benchmarks.exudyn_legs import ExudynLegs
from benchmarks.mujoco_legs import MujocoLegs
from hoof_env.dynamics.parts import FREEDOMS, Motor

PEERS = {"MuJoCo": MujocoLegs, "Exudyn": ExudynLegs}

AIR, GROUND = {"ours": 1e-4, "MuJoCo": 1e-4, "Exudyn": 1e-4}, {"ours": 2e-5, "MuJoCo": 5e-5, "Exudyn": 1e-4}
"""Fine steps [s]. Friction near standstill is stiff: on the ground explicit schemes need shorter ones."""

SPRING = (14, 10)
"""Steps in the time constant of MuJoCo's loops at the fine step and at twice that. Gaps fall with the square
of the constant, the error of forces with the fourth power of the steps in it: so either shows in its own."""

USERS = ("midpoint", 1e-3)

UNITS = {
    "x": "m", "y": "m", "pitch": "rad", "crank angle": "rad",
    "crank torque": "N m", "hip torque": "N m", "reactions": "N",
}  # fmt: skip

EARLY = 0.1
"""Share of the run that is not compared: Exudyn starts without the acceleration of a swing."""


@dataclass(frozen=True)
class Row:
    """One quantity of one case in one engine against this project's at its fine step."""

    preset: str
    case: str
    engine: str
    quantity: str
    unit: str
    size: float  # rms of the quantity; of coordinates, of what they moved by
    largest: float  # of the differences
    relative: float  # their rms as a share of `size`
    own: float  # the largest difference between the engine's runs at its fine step and at twice that
    ours: float  # the same of this project's engine
    closure: float  # the widest gap of a loop in that engine [m]

    @property
    def share(self):
        """The largest difference as a share of what both engines differ from themselves by."""
        return self.largest / (self.own + self.ours) if self.largest else 0.0


def quantities(case, record, has, wanted):
    """What of a record is compared, by name; `has` is its assembly, `wanted` the other's."""
    late = slice(round(EARLY * case.samples), None)
    pins = record.pins if has is wanted else wanted.pin_forces(record.pins)
    kind = FREEDOMS[case.kind]
    found = {name: record.body[late, k] for k, name in enumerate(("x", "y", "pitch")) if k < kind}
    if isinstance(case.drive, Motor):
        found["crank angle"] = record.crank[late]
    return found | {
        "crank torque": record.crank_torque[late],
        "hip torque": record.hip_torque[late],
        "reactions": pins[late],
    }


def compare(preset, case, steps=None):
    """All rows of a case; `steps` are fine steps [s] other than `AIR` or `GROUND`."""
    horse, steps = case.horse(preset), steps or (GROUND if case.ground else AIR)
    fine, coarse = (horse.ours(k * steps["ours"]) for k in (1, 2))
    users = horse.ours(USERS[1], USERS[0])
    runs = {f"ours, {USERS[0]} 1 ms": (users, users, ALL)}
    for name, engine in PEERS.items():
        if name == "MuJoCo" and case.swung:
            continue
        found = []
        for k, constant in zip((1, 2), SPRING, strict=True):
            dt = k * steps[name]
            settings = {"loop_seconds": constant * dt} if name == "MuJoCo" else {}
            found.append(horse.peer(engine, dt, **settings))
        runs[name] = (found[0][0], found[1][0], found[0][1])
    rows = []
    for name, (one, two, assembly) in runs.items():
        ours, ours_coarse = (quantities(case, record, ALL, assembly) for record in (fine, coarse))
        theirs, theirs_coarse = (quantities(case, record, assembly, assembly) for record in (one, two))
        for quantity, expected in ours.items():
            off = theirs[quantity] - expected
            moves = expected - expected[:1] if UNITS[quantity] in ("m", "rad") else expected
            size = rms(moves)
            rows.append(
                Row(
                    preset, case.name, name, quantity, UNITS[quantity], size,
                    largest(off), rms(off) / size,
                    largest(theirs[quantity] - theirs_coarse[quantity]),
                    largest(expected - ours_coarse[quantity]),
                    float(one.closure.max()),
                )
            )  # fmt: skip
    return rows


def rms(x):
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


def largest(x):
    """Largest magnitude."""
    return float(np.abs(x).max())
