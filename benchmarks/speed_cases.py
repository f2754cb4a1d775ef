"""What `speed` times: the same leg and the same horse in this project's engine, in MuJoCo and in Exudyn.

All walk: contact, motors, steps of 1 ms. MuJoCo's legs keep their swing, so here all legs do; the engine has
no branch on a swing, so its cost is that of any gait. MuJoCo's contact is not in N/m: its time constant here
is chosen so that the cranks turn about as fast and the hoofs are down about as long as on this project's
ground. With the usual one, 0.02 s, a leg on a fixed trunk is jammed against the floor and stalls.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from benchmarks.common import Start
from benchmarks.speed_code import vector_bits
from hoof_env.dynamics.drive import Motor
from hoof_env.dynamics.limb import Limb
from hoof_env.dynamics.schemes import SCHEMES
from hoof_env.dynamics.step_length import StepWarning
from hoof_env.dynamics.trunk import Trunk
from hoof_env.dynamics.trunk_engine import TrunkEngine
from hoof_env.gait.parameters import GaitParameters, load_gait
from hoof_env.ground.preset import load_ground
from hoof_env.leg.geometry import load_geometry

DT = 1e-3
SPEED = 2 * np.pi
CRANK = 0.3  # the first leg's at the start
BATCH = 1024
CLOCK = "wall"
"""What cases are timed with; `speed --clock processor` is for a busy machine."""

BAR_SCHEME = "midpoint"


@dataclass(frozen=True)
class Scene:
    """Legs on a trunk, as all engines get them.

    Attributes:
        name: of the table's rows.
        limbs, trunk: the animal.
        cranks: angle of each at the start [rad].
        swing: of all [rad].
        softness: time constant of MuJoCo's contact [s].
    """

    name: str
    limbs: tuple[Limb, ...]
    trunk: Trunk
    cranks: tuple[float, ...]
    swing: float
    softness: float

    @property
    def gait(self) -> GaitParameters:
        return GaitParameters(SPEED, self.swing, 0.0, 0.0)

    @property
    def start(self) -> Start:
        n = len(self.limbs)
        return Start(self.cranks, (SPEED,) * n, (self.swing,) * n, position=(0.0, self.trunk.height))


def scenes(preset: str) -> dict[str, Scene]:
    """The leg on a fixed trunk, the leg on a suspended one, and the horse."""
    geometry, swing = load_geometry(preset), load_gait("walk", preset).swing_offset
    high, one = geometry.hip_height, (Limb(geometry, drive=Motor()),)
    hips = ((0.6, 0.0), (0.6, 0.0), (-0.6, 0.0), (-0.6, 0.0))
    four = tuple(Limb(geometry, hip=hip, drive=Motor()) for hip in hips)
    trot = tuple(CRANK + x for x in (0.0, np.pi, np.pi, 0.0))
    big = Trunk(kind="free", mass=200.0, pitch_inertia=150.0, height=high)
    return {
        scene.name: scene
        for scene in (
            Scene("leg", one, Trunk(kind="fixed", height=high - 0.05), (CRANK,), swing, 1.0),
            Scene("suspended leg", one, Trunk(kind="suspended", height=high), (CRANK,), swing, 0.1),
            Scene("horse", four, big, trot, swing, 0.1),
        )
    }


def engine(
    scene: Scene, preset: str, num_envs: int = 1, angles: str = "random", **options: Any
) -> TrunkEngine:
    """The scene in this project's engine. Crank angles are all round the circle, "random" in order or
    "sorted", or "equal"."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StepWarning)  # the cost of a step is asked, not its error
        made = TrunkEngine(
            scene.limbs, scene.trunk, load_ground(preset), sim_dt=DT, substeps=1, num_envs=num_envs, **options
        )
    order = np.random.default_rng(0).permutation(num_envs) if angles == "random" else np.arange(num_envs)
    turns = 2 * np.pi / num_envs * (order if angles != "equal" else 0 * order)
    made.reset(scene.gait, np.array(scene.cranks)[:, None] + turns)
    return made


@dataclass(frozen=True)
class Case:
    """Something to time.

    Attributes:
        name: unique.
        group: the scene; cases of one group have the same reference.
        run: does the work from the same state and returns the wall time that it took [s].
        units: steps of the whole animal that this is.
        note: for the table.
        required, aimed: bars of the ratio to the reference.
        bits: of the widest vectors in code that numba compiled.
    """

    name: str
    group: str
    run: Callable[[], float]
    units: int
    note: str = ""
    required: float | None = None
    aimed: float | None = None
    bits: int | None = None


CLOCKS = {"wall": time.perf_counter, "processor": time.thread_time}


def timed(before: Callable[[], Any], work: Callable[[], Any], clock: str | None = None) -> float:
    """Time of `work` [s], after `before`, which does not count; `clock` is one of CLOCKS, CLOCK if None."""
    now = CLOCKS[clock or CLOCK]
    before()
    begin = now()
    work()
    return now() - begin


worked = partial(timed, clock="processor")
"""For what is compared within this engine, where waiting for a busy machine is only noise."""


def _ours(made: TrunkEngine, steps: int, account: bool = False) -> Callable[[], float]:
    made.advance(steps=1, account=account)  # compiled from here on
    state = made.get_state()
    work = partial(made.advance, steps=steps, account=account)
    return partial(timed, partial(made.set_state, state), work)


BARS = {
    ("leg", 1): (35, 80),
    ("leg", BATCH): (150, 220),
    ("horse", 1): (60, None),
    ("horse", BATCH): (120, 170),
}
"""Required and aimed ratios to MuJoCo's `ALL`, of one and of a batch."""

NO_BARS = (None, None)

STEPS = {("leg", 1): 20000, ("leg", BATCH): 100, ("horse", 1): 1000, ("horse", BATCH): 40}
STEPS |= {("suspended leg", n): STEPS["leg", n] for n in (1, BATCH)}


def our_cases(preset: str, quick: bool) -> list[Case]:
    """Cases of this project's engine."""
    cases, found = [], scenes(preset)
    for (name, count), steps in STEPS.items():
        scene, bars = found[name], BARS.get((name, count))
        n, steps = (count, steps) if not quick else (min(count, 64), max(steps // 20, 4))
        title = f"{name}, " + ("one" if count == 1 else f"batch of {n}")
        variants: list[tuple[str, dict[str, Any], bool, Any]] = [("", {}, False, bars or NO_BARS)]
        if bars:
            half = tuple(bar / 2 if bar else None for bar in bars)
            variants.append((", all joint reactions", {"reactions": True}, False, half))
            variants.append((", energy account", {}, True, NO_BARS))
            if not quick:
                others = [s for s in SCHEMES if s != BAR_SCHEME]
                variants += [(f", {s}", {"integrator": s}, False, NO_BARS) for s in others]
        for what, options, account, (required, aimed) in variants:
            made = engine(scene, preset, n, **options)
            run = _ours(made, steps, account)
            required, aimed = NO_BARS if quick else (required, aimed)
            cases.append(Case(title + what, name, run, n * steps, "", required, aimed, vector_bits()))
    return cases
