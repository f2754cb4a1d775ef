"""How well this project's engine agrees with MuJoCo and Exudyn, and with itself at other steps.

    python -m benchmarks.agreement --out benchmarks/results

Ground forces are this project's, given to the peers from outside. Every engine runs twice, at a fine step
and at twice that; the difference of the two is called its own and bounds what it can be trusted with. MuJoCo
has no swing that moves: those cases are Exudyn's alone.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.cases import CASES, Case
from benchmarks.common import ALL, Assembly, Record
from benchmarks.exudyn_legs import ExudynLegs
from benchmarks.mujoco_legs import MujocoLegs
from hoof_env._output import staged
from hoof_env.dynamics.drive import Motor
from hoof_env.dynamics.trunk import TRUNKS

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
    """One quantity of one case in one engine against this project's at its fine step.

    Attributes:
        engine, quantity, unit: what is compared.
        size: rms of the quantity; of coordinates, of what they moved by.
        largest, relative: of the differences: the largest, and their rms as a share of `size`.
        own: the largest difference between the engine's runs at its fine step and at twice that.
        ours: the same of this project's engine.
        closure: the widest gap of a loop in that engine [m].
    """

    preset: str
    case: str
    engine: str
    quantity: str
    unit: str
    size: float
    largest: float
    relative: float
    own: float
    ours: float
    closure: float

    @property
    def share(self) -> float:
        """The largest difference as a share of what both engines differ from themselves by."""
        return self.largest / (self.own + self.ours) if self.largest else 0.0


def quantities(case: Case, record: Record, has: Assembly, wanted: Assembly) -> dict[str, NDArray[np.float64]]:
    """What of a record is compared, by name; `has` is its assembly, `wanted` the other's."""
    late = slice(round(EARLY * case.samples), None)
    pins = record.pins if has is wanted else wanted.pin_forces(record.pins)
    kind = TRUNKS.index(case.kind)
    found = {name: record.body[late, k] for k, name in enumerate(("x", "y", "pitch")) if k < kind}
    if isinstance(case.drive, Motor):
        found["crank angle"] = record.crank[late]
    return found | {
        "crank torque": record.crank_torque[late],
        "hip torque": record.hip_torque[late],
        "reactions": pins[late],
    }


def compare(preset: str, case: Case, steps: dict[str, float] | None = None) -> list[Row]:
    """All rows of a case; `steps` are fine steps [s] other than `AIR` or `GROUND`."""
    horse, steps = case.horse(preset), steps or (GROUND if case.ground else AIR)
    fine, coarse = (horse.ours(k * steps["ours"]) for k in (1, 2))
    users = horse.ours(USERS[1], USERS[0])
    runs: dict[str, tuple[Record, Record, Assembly]] = {f"ours, {USERS[0]} 1 ms": (users, users, ALL)}
    for name, engine in PEERS.items():
        if name == "MuJoCo" and case.swung:
            continue
        found = []
        for k, constant in zip((1, 2), SPRING, strict=True):
            dt = k * steps[name]
            settings = {"solref": (constant * dt, 1.0)} if name == "MuJoCo" else {}
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


def rms(x: NDArray[np.float64]) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


def largest(x: NDArray[np.float64]) -> float:
    """Largest magnitude."""
    return float(np.abs(x).max())


def table(rows: Sequence[Row]) -> str:
    """Markdown: a table for each preset and case, a line for each quantity."""
    lines: list[str] = []
    for preset, case in dict.fromkeys((row.preset, row.case) for row in rows):
        here = [row for row in rows if (row.preset, row.case) == (preset, case)]
        engines = list(dict.fromkeys(row.engine for row in here))
        users, peers = engines[0], engines[1:]
        gaps = {row.engine: row.closure for row in here}
        lines += [f"### {preset}: {case}", ""]
        lines += ["Loops gape by at most " + ", ".join(f"{g:.0e} m ({e})" for e, g in gaps.items()) + ".", ""]
        heads = ["quantity", "rms", "ours: own", f"{users}: largest", "relative"]
        for peer in peers:
            heads += [f"{peer}: largest", "relative", "own", "share"]
        lines += ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
        for quantity in dict.fromkeys(row.quantity for row in here):
            of = {row.engine: row for row in here if row.quantity == quantity}
            user = of[users]
            cells = [f"{quantity} [{user.unit}]", f"{user.size:.3g}", f"{user.ours:.1e}"]
            cells += [f"{user.largest:.1e}", f"{user.relative:.1e}"]
            for peer in peers:
                row = of[peer]
                cells += [f"{row.largest:.1e}", f"{row.relative:.1e}", f"{row.own:.1e}", f"{row.share:.2f}"]
            lines.append("| " + " | ".join(cells) + " |")
        lines.append("")
    return "\n".join(lines)


def summary(rows: Sequence[Row]) -> str:
    """Markdown: the worst of each case and engine."""
    heads = ["preset", "case", "engine", "crank torque", "hip torque", "reactions", "largest share", "of"]
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for key in dict.fromkeys((row.preset, row.case, row.engine) for row in rows):
        here = {row.quantity: row for row in rows if (row.preset, row.case, row.engine) == key}
        cells = [f"{here[q].relative:.1e}" for q in ("crank torque", "hip torque", "reactions")]
        if key[2] in PEERS:
            worst = max(here.values(), key=lambda row: row.share)
            cells += [f"{worst.share:.2f}", worst.quantity]
        else:
            cells += ["", ""]
        lines.append("| " + " | ".join([*key, *cells]) + " |")
    return "\n".join(lines)


def versions() -> dict[str, str]:
    """Of all that has a part in the numbers."""
    packages = ("hoof-env", "mujoco", "exudyn", "numpy", "numba")
    return {"python": platform.python_version()} | {name: version(name) for name in packages}


PREFACE = """# Agreement with engines that others wrote

{versions}. Written by `python -m benchmarks.agreement`.

*Largest* and *relative* (rms of the difference over rms of the quantity) are differences from this
project's engine with rk4 at its fine step. *Own* is what an engine's runs at its fine step and at twice that
differ by; fine steps in ms, air and ground: {steps}.
*Share* is the largest difference over the sum of both engines' own: where it is below 1, the engines agree
as well as they agree with themselves. The first {early:.0%} of a run is left out: Exudyn settles. Loops of
this project's engine: toe and heel against the closed linkage at the same crank angle.

Where a hoof stands, 1 ms tracks the motion but not the forces: friction that sets in between 1 and 10 mm/s
is too stiff for such a step (`TrunkEngine.step_limits["friction"]`) and changes sign from step to step.

## Relative differences and the worst share

{summary}

## All quantities

{table}"""


def report(rows: Sequence[Row]) -> str:
    """The whole page in Markdown."""
    steps = ", ".join(f"{name} {1e3 * AIR[name]:g} and {1e3 * GROUND[name]:g}" for name in AIR)
    found = ", ".join(f"{name} {number}" for name, number in versions().items())
    return PREFACE.format(versions=found, steps=steps, early=EARLY, summary=summary(rows), table=table(rows))


@dataclass
class Arguments:
    """Compare this project's engine with MuJoCo and Exudyn; print the table and write it."""

    out: Path = Path("benchmarks/results")
    """Folder for agreement.md and agreement.json."""
    presets: tuple[str, ...] = ("first_fit", "identified")
    """Legs, by name or file."""


def main(arguments: Arguments) -> None:
    """The command."""
    rows: list[Row] = []
    for preset in arguments.presets:
        for case in CASES:
            print(f"{preset}: {case.name} ...", flush=True)
            rows += compare(preset, case)
    page = report(rows)
    lines = ",\n".join(json.dumps(row.__dict__ | {"share": row.share}) for row in rows)
    head = json.dumps({"versions": versions(), "steps": {"air": AIR, "ground": GROUND}})
    with staged(arguments.out) as folder:
        (folder / "agreement.md").write_text(page, encoding="utf-8")
        (folder / "agreement.json").write_text(f'{head[:-1]}, "rows": [\n{lines}\n]}}\n', encoding="utf-8")
    print(page)


if __name__ == "__main__":
    import tyro

    main(tyro.cli(Arguments))
