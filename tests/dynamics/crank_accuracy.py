"""How far a motor-driven leg's crank angle is off after two seconds, beside a reference good to 1e-9 rad.

The leg hangs from a fixed trunk, walks, and starts at 24 crank angles at the speed of its gait.
`python -m tests.dynamics.crank_accuracy` makes the references anew.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Motor, Trunk
from hoof_env.dynamics.step_length import StepWarning
from hoof_env.errors import ParameterError
from hoof_env.gait import load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry
from tests.dynamics.scenes import NATURAL
from tests.legs import PRESETS
from tests.oracle.crank import PlainCrank

PHASES = np.arange(24) * 2 * np.pi / 24
DURATION = 2.0
GROUNDS = {"air": None, "natural": NATURAL, "elastic": Ground()}
ALOFT = 10.0
"""How much higher the leg hangs in air [m]."""

PATH = Path(__file__).parent / "data" / "crank_reference.json"


@dataclass(frozen=True)
class Case:
    """One leg over one ground, from all `PHASES`."""

    preset: str  # of `PRESETS`, by name
    ground: str

    @property
    def limb(self):
        return Limb(load_geometry(PRESETS[self.preset]))

    @property
    def gait(self):
        return load_gait("walk", PRESETS[self.preset])

    @property
    def height(self):
        return self.limb.geometry.hip_height + (ALOFT if self.ground == "air" else 0.0)

    @property
    def fingerprint(self):
        """Changes with any number that the reference depends on."""
        leg = self.limb.geometry
        # the presets here have the paper's mechanism, whose bodies are rods
        words = ("full_turn", "name", "provenance", "mechanism", "solids")
        numbers = [getattr(leg, part.name) for part in fields(leg) if part.name not in words]
        # the order of a mapping is no number
        numbers = [dict(sorted(each.items())) if isinstance(each, Mapping) else each for each in numbers]
        parts = (numbers, Motor(), self.gait, GROUNDS[self.ground], self.height, DURATION)
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:16]

    def end(self, start, pieces=64):
        """The reference: crank angle at the end [rad]."""
        crank = PlainCrank(self.limb, self.gait, GROUNDS[self.ground] or NATURAL, self.height, pieces)
        return crank.run(start, [0.0, DURATION])[0][-1]

    def errors(self, scheme, ends, step=1e-3, **ground):
        """How far the crank angle is off at the end, shape (24,) [rad]; infinite where a run breaks off."""
        ground = replace(GROUNDS[self.ground] or NATURAL, **ground)
        trunk = Trunk("fixed", height=self.height)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", StepWarning)
            engine = TrunkEngine(self.limb, trunk, ground, sim_dt=step, integrator=scheme, substeps=1,
                                 num_envs=len(PHASES))  # fmt: skip
        engine.reset(self.gait, PHASES[None])
        results = engine.advance(steps=round(DURATION / step), account=False)
        return np.where(results == 0, np.abs(engine.state["crank_angle"][0] - ends), np.inf)


CASES = tuple(Case(preset, ground) for preset in PRESETS for ground in GROUNDS)


def write_references():
    record = {
        "about": f"Crank angle [rad] after {DURATION:g} s from 24 equally spaced starts, by PlainCrank.",
        "command": "python -m tests.dynamics.crank_accuracy",
        "cases": [
            {"preset": case.preset, "gait": "walk", "ground": case.ground, "fingerprint": case.fingerprint,
             "ends": [case.end(start) for start in PHASES]}
            for case in CASES
        ],
    }  # fmt: skip
    PATH.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def read_references(path=PATH):
    """References that `write_references` stored; refused if a leg, a gait or a ground has changed since."""
    kept = {}
    for entry in json.loads(path.read_text(encoding="utf-8"))["cases"]:
        case = Case(entry["preset"], entry["ground"])
        if case.fingerprint != entry["fingerprint"]:
            raise ParameterError(
                f"{path.name}: {case} has changed, run python -m tests.dynamics.crank_accuracy"
            )
        kept[case] = np.array(entry["ends"])
    return kept


if __name__ == "__main__":
    write_references()
