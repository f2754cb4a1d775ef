"""What a scheme keeps of a horse's momentum, energy and closed loops, and how it does on stiff ground."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Trunk
from hoof_env.dynamics.step_length import StepWarning
from hoof_env.gait.gait import load_gait
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.kinematics import pose
from hoof_env.leg.linkage import BODIES, POINTS
from tests.dynamics.crank_accuracy import NATURAL, STRONG, quiet

Floats = NDArray[np.float64]

MASS = 500.0
"""Of trunk and legs together [kg]."""

HIPS = ((0.6, 0.0), (0.6, 0.0), (-0.6, 0.0), (-0.6, 0.0))
STARTS: Floats = np.array([0.0, 0.5, 0.25, 0.75]) * 2 * np.pi
STIFF = replace(NATURAL, stiffness=1e6)
"""K = 1e6 N/m^1.5."""

GAP = 5e-3
"""Between the lowest hoof point and the ground at the start [m]."""

TIMES = (0.1, 0.2)
"""After which the states on stiff ground are compared [s]."""


def horse(preset: str, **settings: object) -> TrunkEngine:
    """Four legs on a free trunk, 500 kg in all."""
    leg = load_geometry(preset)
    trunk = Trunk("free", MASS - len(HIPS) * leg.mass, drag=0.0, height=leg.hip_height, pitch_inertia=90.0)
    return TrunkEngine([Limb(leg, hip, STRONG) for hip in HIPS], trunk, STIFF, **settings)  # type: ignore[arg-type]


# In the air


@dataclass(frozen=True)
class Kept:
    """What a scheme kept at one step.

    Attributes:
        closure: largest gap in a loop, and between the engine's hoof points and those of the links [m].
        momentum, spin: drift of linear and angular momentum, over the largest weight impulse and spin [-].
        energy: of the account, over the work of crank and swing drives [-].
    """

    closure: float
    momentum: float
    spin: float
    energy: float


def fly(preset: str, scheme: str, step: float, seconds: float = 0.5) -> Kept:
    """A horse in the air goes from walk to run."""
    with quiet():
        engine = horse(preset, integrator=scheme, sim_dt=step, substeps=1)
    engine.reset(load_gait("walk", preset), STARTS, y=20.0, vx=3.0, pitch_rate=0.5)
    command, first, weight = load_gait("run", preset).to_array(), engine.tally(), engine.weight
    closure, momentum, spin, energy, work, now = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for _ in range(10):
        steps = round(seconds / 10 / step)
        assert not engine.advance(command, steps=steps).any()
        now += steps * step
        t, account = engine.tally(), engine.account
        closure = max(closure, gap(engine))
        momentum = max(momentum, float(np.abs(t.momentum - first.momentum + 1j * weight * now)[0]))
        spin = max(spin, float(np.abs(t.spin / first.spin - 1)[0]))
        done = float((account["crank_work"] + account["swing_work"])[0])
        gain = t.kinetic + t.potential - first.kinetic - first.potential
        energy, work = max(energy, abs(float(gain[0]) - done)), max(work, abs(done))
    return Kept(closure, momentum / (weight * seconds), spin, energy / work)


def gap(engine: TrunkEngine) -> float:
    """Largest error of a link's length, or of a hoof point that the engine reports [m]."""
    report, state, largest = engine.report, engine.state, 0.0
    place = np.array([report["x"][0], report["y"][0]])
    turn = np.exp(1j * state["pitch"][0])
    for i, limb in enumerate(engine.limbs):
        leg, side = limb.geometry, limb.geometry.travel
        p = pose(leg, state["theta"][i, 0])
        points = dict(zip(POINTS, p.points, strict=True))
        lengths = [np.hypot(*(points[body.head] - points[body.tail])) for body in BODIES]
        largest = max(largest, float(np.abs(lengths - leg.body_lengths).max()))
        frame = turn * np.exp(1j * side * report["phi"][i, 0])
        for name, point in (("toe", leg.toe), ("heel", leg.heel)):
            z = complex(*place) + turn * complex(*limb.hip) + frame * complex(*points[point])
            found = complex(report[f"{name}_x"][i, 0], report[f"{name}_y"][i, 0])
            largest = max(largest, abs(found - z))
    return largest


# On the ground


def ground_account(preset: str, scheme: str, step: float, seconds: float = 2.0) -> float:
    """Error of the energy account of one walking leg under a suspended trunk, over what is spent [-]."""
    leg = load_geometry(preset)
    trunk = Trunk("suspended", height=leg.hip_height)
    with quiet():
        engine = TrunkEngine(Limb(leg), trunk, NATURAL, integrator=scheme, sim_dt=step, substeps=1)
    engine.reset(load_gait("walk", preset), 0.3)
    first = engine.tally()
    assert not engine.advance(steps=round(seconds / step)).any()
    t, a = engine.tally(), engine.account
    gain = t.kinetic + t.potential - first.kinetic - first.potential
    spent = sum(a[name] for name in a if name.endswith("_loss")) + a["ground_stored"]
    return float(np.abs(gain + spent - a["crank_work"] - a["swing_work"])[0] / spent[0])


def stand(engine: TrunkEngine, preset: str) -> None:
    """The horse in its walk, `GAP` above the ground."""
    gait = load_gait("walk", preset)
    engine.reset(gait, STARTS, y=10.0)
    lowest = min(engine.report["toe_y"].min(), engine.report["heel_y"].min())
    engine.reset(gait, STARTS, y=10.0 - lowest + GAP)


@dataclass(frozen=True)
class Step:
    """A run on stiff ground.

    Attributes:
        substeps: that were taken.
        warned: what the engine said, if anything.
        trunk, crank: largest error of the trunk's place [m] and of crank angle or pitch [rad] at `TIMES`.
    """

    substeps: int
    warned: str
    trunk: tuple[float, ...]
    crank: tuple[float, ...]


def states(engine: TrunkEngine, preset: str) -> Floats:
    """x, y, pitch and crank angles at `TIMES`, shape (2, 7); NaN after a run that broke off."""
    stand(engine, preset)
    rows, done = np.full((len(TIMES), 7), np.nan), 0
    for row, time in zip(rows, TIMES, strict=True):
        steps = round(time / engine.sim_dt)
        if engine.advance(steps=steps - done, account=False).any():
            break
        done = steps
        row[:] = (engine.report["x"][0], engine.report["y"][0], engine.state["pitch"][0],
                  *engine.state["theta"][:, 0])  # fmt: skip
    return rows


def converged(preset: str) -> Floats:
    """The states by steps of 2 us."""
    return states(horse(preset, integrator="rk4", sim_dt=1e-3, substeps=512), preset)


def stiff(preset: str, scheme: str, step: float, substeps: int | None, expected: Floats) -> Step:
    """A walk on stiff ground at one step, `substeps` of None leaving their choice to the engine."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", StepWarning)
        engine = horse(preset, integrator=scheme, sim_dt=step, substeps=substeps)
    error = np.abs(states(engine, preset) - expected)
    said = "; ".join(str(w.message) for w in caught)
    return Step(engine.substeps, said, tuple(error[:, :2].max(1)), tuple(error[:, 2:].max(1)))
