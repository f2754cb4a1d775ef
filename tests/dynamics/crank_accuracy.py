"""How far a motor-driven leg's crank angle is off after two seconds, beside a reference good to 1e-9 rad.

The leg hangs from a fixed trunk and starts at 24 crank angles at the speed of its gait.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Motor, Trunk
from hoof_env.dynamics.step_length import StepWarning
from hoof_env.errors import ParameterError
from hoof_env.gait.gait import GaitParameters, load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from tests.oracle.crank import PlainCrank

Floats = NDArray[np.float64]

PHASES: Floats = np.arange(24) * 2 * np.pi / 24
"""Crank angles at the start [rad]."""

DURATION = 2.0
"""[s]"""

NATURAL = Ground(restitution=0.5, approach_floor=0.1, friction_fast=0.05)
"""The ground of the environment `HorseLeg-v0`."""

GROUNDS: dict[str, Ground | None] = {
    "air": None,
    "natural": NATURAL,
    "elastic": Ground(),
}
"""Grounds by name; "elastic" has the defaults of `Ground`: restitution 1, friction within 1 to 10 mm/s."""

ALOFT = 10.0
"""How much higher the leg hangs in air [m]."""

STRONG = Motor(speed_gain=500.0, torque_limit=3000.0)
"""A motor that keeps the run of some legs turning, where the default one stalls."""

PATH = Path(__file__).parent / "data" / "crank_reference.json"
"""The kept references, made by `python -m tests.dynamics.crank_accuracy`."""


BARS = {"midpoint": (3e-5, 2e-5), "rk3": (1.5e-5, np.inf)}
"""Worst and median error on the ground at 1 ms [rad]."""


@contextmanager
def quiet() -> Iterator[None]:
    """No word of steps that are too long: they are part of the study."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StepWarning)
        yield


@dataclass(frozen=True)
class Case:
    """One leg under one gait over one ground, from all `PHASES`."""

    preset: str
    gait: str
    ground: str
    motor: Motor = field(default_factory=Motor)

    @property
    def limb(self) -> Limb:
        """The leg with its motor."""
        return Limb(load_geometry(self.preset), drive=self.motor)

    @property
    def parameters(self) -> GaitParameters:
        """Of the gait."""
        return load_gait(self.gait, self.preset)

    @property
    def height(self) -> float:
        """Of the crank centre [m]."""
        return self.limb.geometry.hip_height + (ALOFT if GROUNDS[self.ground] is None else 0.0)

    @property
    def fingerprint(self) -> str:
        """Changes with any number that the reference depends on."""
        leg = self.limb.geometry
        words = ("full_turn", "name", "provenance")
        numbers = [getattr(leg, part.name) for part in fields(leg) if part.name not in words]
        parts = (numbers, self.motor, self.parameters, GROUNDS[self.ground], self.height, DURATION)
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]

    def crank(self, pieces: int = 64) -> PlainCrank:
        """The reference, not yet run."""
        return PlainCrank(self.limb, self.parameters, GROUNDS[self.ground] or NATURAL, self.height, pieces)

    def reference(self) -> Floats:
        """Crank angles at the end, shape (24,) [rad]."""
        crank = self.crank()
        return np.array([crank.run(start, [0.0, DURATION])[0][-1] for start in PHASES])

    def engine(self, scheme: str, step: float = 1e-3, substeps: int = 1, approach: str = "") -> TrunkEngine:
        """All starts side by side; `approach` other than the ground's replaces it."""
        ground = GROUNDS[self.ground] or NATURAL
        ground = replace(ground, approach=approach or ground.approach)
        with quiet():
            return TrunkEngine(
                self.limb, Trunk("fixed", height=self.height), ground,
                sim_dt=step, integrator=scheme, substeps=substeps, num_envs=len(PHASES),
            )  # fmt: skip

    def errors(
        self, scheme: str, ends: Floats, step: float = 1e-3, substeps: int = 1, approach: str = ""
    ) -> Floats:
        """How far the crank angle is off at the end, shape (24,) [rad]; infinite where a run breaks off."""
        engine = self.engine(scheme, step, substeps, approach)
        engine.reset(self.parameters, PHASES[None])
        results = engine.advance(steps=round(DURATION / step), account=False)
        found: Floats = np.where(results == 0, np.abs(engine.state["theta"][0] - ends), np.inf)
        return found


BARRED = tuple(
    Case(preset, "walk", ground)
    for preset in ("first_fit", "identified")
    for ground in ("air", "natural", "elastic")
)
"""The cases whose references the tests keep."""


def write_references() -> None:
    """Compute and keep the references of `BARRED`."""
    record = {
        "about": f"Crank angle [rad] after {DURATION:g} s from 24 equally spaced starts, by PlainCrank.",
        "command": "python -m tests.dynamics.crank_accuracy",
        "cases": [
            {
                "preset": case.preset,
                "gait": case.gait,
                "ground": case.ground,
                "fingerprint": case.fingerprint,
                "ends": case.reference().tolist(),
            }
            for case in BARRED
        ],
    }
    PATH.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def read_references(path: Path = PATH) -> dict[Case, Floats]:
    """What `write_references` kept.

    Raises:
        ParameterError: a leg, a gait or a ground has changed since.
    """
    kept = {}
    for entry in json.loads(path.read_text(encoding="utf-8"))["cases"]:
        case = Case(entry["preset"], entry["gait"], entry["ground"])
        if case.fingerprint != entry["fingerprint"]:
            raise ParameterError(
                f"{path.name}: expected {case} with fingerprint {entry['fingerprint']}, got "
                f"{case.fingerprint}: it has changed, run python -m tests.dynamics.crank_accuracy"
            )
        kept[case] = np.array(entry["ends"])
    return kept


if __name__ == "__main__":
    write_references()
