"""The same animals in MuJoCo and Exudyn, for `speed`; and whether they walk."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.common import ALL, RIGID, GroundForces
from benchmarks.speed_cases import DT, SPEED, Case, Scene, engine, scenes, timed
from hoof_env.ground.preset import load_ground


def has(package: str) -> bool:
    """Whether it is installed."""
    return importlib.util.find_spec(package) is not None


ASSEMBLIES = {"ALL": ALL, "RIGID": RIGID}


def mujoco_legs(scene: Scene, assembly: str, **options: Any) -> Any:
    """The scene in MuJoCo with its own contact."""
    from benchmarks.mujoco_legs import MujocoLegs

    legs = MujocoLegs(
        scene.limbs, scene.trunk, scene.start, dt=DT, contact=True, assembly=ASSEMBLIES[assembly], **options
    )
    legs.model.geom_solref[:] = scene.softness, 1.0
    return legs


def _mujoco(legs: Any, steps: int) -> Callable[[], float]:
    import mujoco

    model, data, what = legs.model, legs.data, mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(model, what))
    mujoco.mj_getState(model, data, state, what)
    before = partial(mujoco.mj_setState, model, data, state, what)
    return partial(timed, before, partial(mujoco.mj_step, model, data, steps))


def mujoco_cases(preset: str, quick: bool) -> list[Case]:
    """MuJoCo's `mj_step`, with its own contact and the Jacobian that is faster here; and with our law."""
    cases = []
    for name, scene in scenes(preset).items():
        steps = 50 if quick else 1000
        for assembly in ASSEMBLIES:
            found = {}
            for jacobian, number in (("dense", 0), ("sparse", 1)):
                legs = mujoco_legs(scene, assembly)
                legs.model.opt.jacobian = number
                run = _mujoco(legs, steps)
                found[jacobian] = (min(run() for _ in range(2 if quick else 7)), run)
            best = min(found, key=lambda jacobian: found[jacobian][0])
            title = f"{name}, MuJoCo {assembly}"
            cases.append(Case(title, name, found[best][1], steps, f"{best} Jacobian"))
    for name in ("leg", "horse"):
        scene = scenes(preset)[name]
        steps, title = 10 if quick else 100, f"{name}, MuJoCo RIGID with our contact law from Python"
        run = partial(_outside, scene, preset, steps)
        cases.append(Case(title, name, run, steps, "RK4"))
    return cases


def _outside(scene: Scene, preset: str, steps: int) -> float:
    from benchmarks.mujoco_legs import MujocoLegs

    law = GroundForces(load_ground(preset), len(scene.limbs))
    legs = MujocoLegs(scene.limbs, scene.trunk, scene.start, dt=DT, outside=law)
    return timed(lambda: None, partial(legs.step, steps))


def exudyn_cases(preset: str, quick: bool) -> list[Case]:
    """Exudyn at its fastest, with our contact law and our motor in Python."""
    cases = []
    for name in ("leg", "horse"):
        scene = scenes(preset)[name]
        steps, title = 5 if quick else 50, f"{name}, Exudyn with our contact law from Python"
        run = partial(_exudyn, scene, preset, steps)
        cases.append(Case(title, name, run, steps, "modified Newton"))
    return cases


def _exudyn(scene: Scene, preset: str, steps: int) -> float:
    from benchmarks.exudyn_legs import ExudynLegs

    law = GroundForces(load_ground(preset), len(scene.limbs))
    legs = ExudynLegs(scene.limbs, scene.trunk, scene.start, dt=DT, outside=law)
    return timed(lambda: None, partial(legs.run, steps * DT, 1, fast=True))


def walking(preset: str, peers: bool, steps: int) -> list[dict[str, Any]]:
    """What each engine's animal does in so many steps: how long the hoofs are down, how the cranks turn."""
    rows: list[dict[str, Any]] = []
    for scene in scenes(preset).values():
        made, down = engine(scene, preset), []
        begin = made.state["theta"][:, 0]
        for _ in range(steps):
            made.advance(steps=1)
            report = made.report
            down.append(report["toe_normal"] + report["heel_normal"] > 0)
        end = made.state
        turned = end["theta"][:, 0] - begin
        rows.append(_walk(scene, "this engine", np.mean(down), turned, steps, end["pitch"][0]))
        rows += [_mujoco_walk(scene, assembly, steps) for assembly in ASSEMBLIES if peers]
    return rows


def _mujoco_walk(scene: Scene, assembly: str, steps: int) -> dict[str, Any]:
    import mujoco

    legs = mujoco_legs(scene, assembly)
    model, data, down = legs.model, legs.data, 0.0
    begin = legs.crank
    for _ in range(steps):
        mujoco.mj_step(model, data)
        bodies = {int(model.geom_bodyid[g]) for c in range(data.ncon) for g in data.contact[c].geom}
        down += len(bodies - {0})
    down /= steps * len(scene.limbs)
    row = _walk(scene, f"MuJoCo {assembly}", down, legs.crank - begin, steps, legs.body[2])
    legs.evaluate()
    return row | {"closure_m": legs.closure()}


def _walk(
    scene: Scene, who: str, down: Any, turned: NDArray[np.float64], steps: int, pitch: float
) -> dict[str, Any]:
    speeds = turned / (steps * DT * SPEED)
    return {
        "scene": scene.name, "engine": who, "contact_fraction": float(down),
        "crank_speed_mean": float(speeds.mean()), "crank_speed_slowest_leg": float(speeds.min()),
        "pitch_rad": float(pitch),
    }  # fmt: skip
