"""Cases of engines that compare_bits.py digests: the package's, one and nine at once, and the paper's solver.

Each part yields pairs of a case's name and its `Digests`, as in bits_cases.py.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from typing import Any

import numpy as np
from bits_digest import Cases, Digests


def engines() -> Cases:
    """States, reports, accounts, strides and reactions of engines of every kind, 1 and 9 at once."""
    from hoof_env import HarmonicGait, HoofSpring, Limits, Motor, Prescribed, load_gait, load_geometry

    leg = load_geometry("identified")
    walk = load_gait("walk", "identified")
    two = HarmonicGait(*walk.to_array(), higher=(0.05, -0.03))
    schemes = ("semi_implicit_euler", "midpoint", "rk3", "rk4")
    for kind in ("fixed", "rail", "suspended", "free"):
        for scheme in schemes:
            for legs in (1, 4):
                for drive in (Prescribed(), Motor()):
                    name = f"{kind}, {scheme}, {legs} legs, {type(drive).__name__}"
                    yield name, run_engine(leg, walk, kind, scheme, legs, drive=drive)
    spring = HoofSpring(24000.0, 400.0)
    limits = Limits(pitch=(-0.4, 0.4), height=(1.0, 2.5), clearance=0.01)
    turf = own_law()
    features: list[tuple[str, dict[str, Any]]] = [
        ("springs", {"spring": spring}),
        ("two harmonics", {"gait": two, "harmonics": 2}),
        ("limits and other sizes", {"limits": limits, "varies": True}),
        ("springs, harmonics, limits", {"spring": spring, "gait": two, "harmonics": 2, "limits": limits}),
        ("own law", {"contact_law": turf}),
        ("hills, two threads", {"hills": True, "num_threads": 2}),
        ("other settings in some", {"varies": True}),
    ]
    for name, extra in features:
        for legs in (1, 4):
            kind = "suspended" if legs == 1 else "free"
            gait = extra.get("gait", walk)
            rest = {key: value for key, value in extra.items() if key != "gait"}
            yield f"{name}, {legs} legs", run_engine(leg, gait, kind, "midpoint", legs, **rest)


def own_law() -> Callable[..., Any]:
    """The contact law of `OWN_TASK`."""
    import bits_own_task  # type: ignore[import-not-found]

    law: Callable[..., Any] = bits_own_task.turf
    return law


def run_engine(
    leg: Any,
    gait: Any,
    kind: str,
    scheme: str,
    legs: int,
    *,
    drive: Any = None,
    spring: Any = None,
    varies: bool = False,
    hills: bool = False,
    limits: Any = None,
    contact_law: Any = None,
    **more: Any,
) -> Digests:
    """Digests of a second of an engine, one environment and nine."""
    from hoof_env import Ground, Limb, Motor, Terrain, Trunk, TrunkEngine

    digests = Digests()
    drive = Motor() if drive is None else drive
    trunk = Trunk(kind, mass=60.0 * legs, pitch_inertia=40.0 * legs, height=leg.hip_height)
    hips = ((0.0,), (0.6, 0.6, -0.6, -0.6))[legs > 1]
    for count in (1, 9):
        reacts = not (varies and limits)
        engine = TrunkEngine(
            [Limb(leg, hip=(x, 0.0), drive=drive, spring=spring) for x in hips],
            trunk,
            Ground(exponent=1.5) if spring else Ground(exponent=1.375),
            Terrain.through([0.0, 1.0, 2.0, 4.0], [0.0, 0.03, -0.02, 0.0], 1.5) if hills else None,
            integrator=scheme,
            num_envs=count,
            reactions=reacts,
            strides=True,
            limits=limits,
            contact_law=contact_law,
            **more,
        )
        if varies:
            engine.vary(0, ground=Ground(exponent=1.375, friction=0.7, stiffness=2e5), drive=Motor(50.0))
            if limits:
                small = [Limb(leg.scaled(0.9), hip=(0.9 * x, 0.0), drive=drive) for x in hips]
                engine.vary(0, Trunk(kind, mass=50.0 * legs, height=0.9 * leg.hip_height), limbs=small)
        theta = np.add.outer(np.arange(len(hips)) * 1.7, 0.1 * np.arange(count))
        engine.reset(gait, theta)
        for k in range(5):
            digests.add("results", engine.advance(steps=40))
            for name in ("state", "report", "account", "strides"):
                digests.add(name, getattr(engine, name))
            if reacts:
                digests.add("reactions", engine.reactions())
            if k == 2:
                engine.command(gait.to_array() * 0.9)
        digests.add("run", engine.run(steps=30, every=3))
        kept = engine.get_state()
        digests.add("on", engine.advance(steps=20))
        engine.set_state(kept)
        digests.add("on", engine.advance(steps=20))
        digests.add("messages", engine.messages())
    return digests


SOLVERS = (
    ("paper_solver.solver", "paper_solver.integrators"),
    ("eq8.solver", "eq8.integrators"),
    ("dynamics.constrained", "dynamics.constrained"),
)
"""Modules of the paper's solver and of its integrators: at present, and in earlier commits."""


def solver_modules() -> tuple[Any, Any]:
    """Import the paper's solver and its integrators, by the names that the commit has for them."""
    for solver, integrators in SOLVERS:
        with suppress(ModuleNotFoundError):
            return import_module(f"hoof_env.{solver}"), import_module(f"hoof_env.{integrators}")
    raise ModuleNotFoundError(f"expected one of the modules {SOLVERS} in hoof_env, found none")


def solvers() -> Cases:
    """The paper's own solver, and the leg that the package has."""
    from hoof_env import ConstrainedLeg, Ground, load_gait, load_geometry

    solver, integrators = solver_modules()
    leg = load_geometry("identified")
    digests = Digests()
    digests.add("leg", leg.to_dict())
    digests.add("small", leg.scaled(0.3).to_dict())
    yield "geometry", digests
    for integrator in integrators.INTEGRATORS:
        for name in ("walk", "run"):
            gait = load_gait(name, "identified")
            leg_solver = ConstrainedLeg(leg, Ground(restitution=0.5), integrator=integrator)
            digests = Digests()
            digests.add("start", leg_solver.reset(gait))
            trace = solver.new_trace(200)
            digests.add("result", leg_solver.advance(gait.to_array(), trace))
            digests.add("trace", trace)
            digests.add("reactions", leg_solver.reactions())
            digests.add("closure", leg_solver.closure().error)
            yield f"ConstrainedLeg {integrator} {name}", digests
