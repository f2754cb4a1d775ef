"""What a spring in the hoof does: drops on soft and hard ground, a horse on a slope, errors of time steps.

Each table is a csv; the picture has the force of drops on rigid hoofs and on springs. SI units.
"""

from __future__ import annotations

import csv
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.optimize import brentq

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import GRAVITY, HoofSpring, Limb, Prescribed, Result, Trunk
from hoof_env.dynamics.step_length import StepWarning
from hoof_env.gait import GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import load_geometry
from hoof_env.paper.measure import measure_stance
from hoof_env.paper.reproduce import run_cycle
from hoof_env.paper.rows import CONDITIONS
from research.identify.leg import FIRST_FIT

Vector = NDArray[np.float64]
Row = dict[str, Any]

LEG = load_geometry(FIRST_FIT)
MASS, HORSE = 135.0, 475.0  # what one leg bears, a horse [kg]
GROUNDS = (2e5, 6e5, 2e6, 1e7)  # K of Eq. 14 [N/m^1.5]
SPRINGS, SPEEDS = (None, 2e4, 4e4, 6e4), (0.3, 0.6, 1.0)  # None is rigid [N/m]; touch-down [m/s]
POSE, CRANK = GaitParameters(0.0, 0.4, 0.0, 0.0), 4.1  # of a leg that drops, toe first
STANDING = np.array([4.02, 4.18, 4.1, 4.14])  # cranks of a horse with level soles [rad]
HIPS = ((-1.55, 0.0), (-1.45, 0.0), (-0.15, 0.0), (-0.05, 0.0))  # the feet under the trunk [m]
HIP_HEIGHT = 1.389  # over level soles [m]


def spring_of(stiffness: float | None, mass: float, ratio: float = 0.1) -> HoofSpring | None:
    """The spring under half a leg's load [kg] with this damping ratio; None stays rigid."""
    return None if stiffness is None else HoofSpring.with_ratio(stiffness, mass / 2, ratio)


def ground_of(stiffness: float) -> Ground:
    """Of all studies: restitution 0.5, friction 0.4; K in N/m^1.5."""
    return Ground(stiffness=stiffness, restitution=0.5, approach_floor=0.1)


def leg_over(ground: Ground, spring: HoofSpring | None, **settings: Any) -> TrunkEngine:
    """A leg that bears `MASS`, and nothing else holds it."""
    trunk = Trunk(mass=MASS - LEG.mass, share=1.0, stiffness=0.0, damping=0.0, drag=0.0, height=3.0)
    return TrunkEngine(Limb(LEG, drive=Prescribed(), spring=spring), trunk, ground, strides=True, **settings)


def level_crank() -> float:
    """Crank angle [rad] at which a leg in `POSE` sets its sole down level."""

    def slant(crank: float) -> float:
        engine = leg_over(ground_of(GROUNDS[0]), None)
        engine.reset(POSE, crank, y=30.0)
        return float((engine.report["toe_y"] - engine.report["heel_y"])[0, 0])

    return float(brentq(slant, 2.5, 3.25))


def lift(engine: TrunkEngine, speed: float, above: float = 1e-3, crank: float = CRANK) -> None:
    """Start with the hoof so far over the ground [m], downwards [m/s]."""
    engine.reset(POSE, crank, vy=-speed)
    low = min(engine.report[f"{point}_y"][0, 0] for point in ("toe", "heel"))
    engine.reset(POSE, crank, y=3.0 - low + above, vy=-speed)


def drops(crank: float = CRANK) -> list[Row]:
    """Largest force of drops, of the weight, toe first or at another crank angle [rad]."""
    rows = []
    for stiffness in SPRINGS:
        for speed in SPEEDS:
            peaks = []
            for ground in GROUNDS:
                engine = leg_over(ground_of(ground), spring_of(stiffness, MASS))
                lift(engine, speed, crank=crank)
                engine.advance(steps=400)
                peaks.append(float(engine.strides["highest"][0, 0]) / (MASS * GRAVITY))
            row: Row = {"spring_N_m": stiffness or "rigid", "speed_m_s": speed}
            row |= {f"peak_K_{ground:.0e}_weights": peak for ground, peak in zip(GROUNDS, peaks, strict=True)}
            rows.append(row | {"change_percent": 100 * (max(peaks) / min(peaks) - 1)})
    return rows


def standing() -> list[Row]:
    """How far a horse on a slope of 3 degrees goes in a minute, once it has settled for 2, 10 or 30 s."""
    slope, rows = np.radians(3.0), []
    for stiffness in SPRINGS:
        for settling in (2000, 10_000, 30_000):
            spring = spring_of(stiffness, HORSE / 4)
            trunk = Trunk("free", mass=HORSE - 4 * LEG.mass, height=HIP_HEIGHT, drag=0.0, pitch_inertia=80.0)
            limbs = [Limb(LEG, hip, Prescribed(), spring) for hip in HIPS]
            engine = TrunkEngine(limbs, trunk, ground_of(2e6), Terrain.slope(slope), substeps=1)
            place = {"x": -np.sin(slope) * HIP_HEIGHT, "y": np.cos(slope) * HIP_HEIGHT, "pitch": slope}
            engine.reset(GaitParameters(0.0, 0.0, 0.0, 0.0), STANDING, **place)
            engine.advance(steps=settling)
            before, stood = engine.report, soles(engine)
            engine.advance(steps=60_000)
            after = engine.report
            trunk_moved = float(np.hypot(after["x"] - before["x"], after["y"] - before["y"])[0])
            row: Row = {"spring_N_m": stiffness or "rigid", "settled_s": settling / 1000}
            row |= {"trunk_mm": 1e3 * trunk_moved, "soles_mm": 1e3 * np.abs(soles(engine) - stood).max()}
            rows.append(row)
    return rows


def soles(engine: TrunkEngine) -> Vector:
    """Places of the soles along x [m], as if the ground were level."""
    report, state = engine.report, engine.state
    ends = [report[f"{end}_x"] - state.get(f"{end}_give_tangential", 0.0) for end in ("toe", "heel")]
    return np.array(ends)


def stance(scheme: str, h: float) -> Vector:
    """Places and speeds [m, m/s] after 48 ms of a hoof that stands in the ground all the time."""
    engine = leg_over(ground_of(2e6), spring_of(4e4, MASS), sim_dt=h, substeps=1, integrator=scheme)
    lift(engine, 0.1, above=-0.1)
    engine.advance(steps=round(0.048 / h))
    return np.array([engine.report[name][0] for name in ("x", "y", "vx", "vy")])


def orders() -> list[Row]:
    """Errors of time steps where the motion is smooth."""
    exact, rows = stance("rk4", 1e-5), []
    for h in 2e-3 / 2.0 ** np.arange(4):
        errors = {f"{each}_error": np.abs(stance(each, h) - exact).max() for each in ("midpoint", "rk4")}
        rows.append({"h_ms": 1e3 * h, **errors})
    return rows


def damped() -> list[Row]:
    """Drops at 1 m/s on the hardest ground at 1 ms, by damping ratio and substeps, and whether a warning
    came; the error is that of the height [mm] against steps of 10 us."""
    rows = []
    for ratio in (0.005, 0.01, 0.02, 0.1, 0.3):
        spring, heights = spring_of(4e4, MASS, ratio), {}
        for substeps in (100, 1, 2, 4, 8):
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always", StepWarning)
                engine = leg_over(ground_of(1e7), spring, substeps=substeps)
            lift(engine, 1.0)
            record = engine.run(steps=200)
            heights[substeps] = record["y"][:, 0]
            peak = engine_peak(record)
            fits = len(heights[substeps]) == len(heights[100])
            off = np.abs(heights[substeps] - heights[100]).max() if fits else np.inf
            row: Row = {"ratio": ratio, "substeps": substeps, "limit_ms": 1e3 * engine.step_limits["hoof"]}
            row |= {"warned": any(issubclass(each.category, StepWarning) for each in caught)}
            row |= {"peak_weights": peak, "height_off_mm": 1e3 * off}
            rows.append(row | {"result": Result(int(record["result"][0])).name})
    return rows


def conditions() -> list[Row]:
    """The paper's four conditions with springs under its hoof: peaks [N], their share of the rigid one's,
    stance [s] and the elastic peak over the inelastic one."""
    rows = []
    for gait in ("walk", "run"):
        for stiffness in (None, 1e6, 1e5, 4e4, 2e4):
            spring = {} if stiffness is None else {"hoof_stiffness": stiffness}
            found = {
                name: measure_stance(run_cycle(gait, "exact", restitution=cr, **spring))
                for name, cr in CONDITIONS.items()
            }
            row: Row = {"gait": gait, "hoof_n_m": stiffness or "rigid"}
            for name, stance_of in found.items():
                row |= {f"{name}_peak_n": stance_of.peak, f"{name}_mean_n": stance_of.mean}
                row[f"{name}_stance_s"] = stance_of.end - stance_of.start
            rows.append(row | {"inelastic_over_elastic": found["inelastic"].peak / found["elastic"].peak})
    return rows


def engine_peak(record: dict[str, NDArray[Any]]) -> float:
    """Largest normal force of a record, of the weight."""
    return float((record["toe_normal"] + record["heel_normal"]).max()) / (MASS * GRAVITY)


def draw(path: Path) -> None:
    """Force over time of drops at 1 m/s, rigid and on a spring."""
    figure = Figure(figsize=(9, 3.8), layout="constrained", dpi=100)
    for axes, stiffness in zip(figure.subplots(1, 2, sharex=True, sharey=True), (None, 4e4), strict=True):
        for ground in GROUNDS:
            engine = leg_over(ground_of(ground), spring_of(stiffness, MASS), substeps=8)
            lift(engine, 1.0)
            record = engine.run(steps=250)
            force = (record["toe_normal"] + record["heel_normal"])[:, 0, 0] / 1e3
            axes.plot(np.arange(len(force)), force, lw=1.2, label=f"K = {ground:.0e} N/m$^{{1.5}}$")
        name = "rigid hoof" if stiffness is None else f"hoof on {stiffness / 1e3:.0f} kN/m, damping ratio 0.1"
        axes.set(title=name, xlabel="time [ms]", ylabel="normal force [kN]", ylim=(0, None))
        axes.legend(fontsize=8)
    figure.savefig(path)


def compliance(out: Path = Path("docs/evidence/compliance")) -> None:
    """Write a csv of each table and drops.png to the folder `out`."""
    out.mkdir(parents=True, exist_ok=True)
    tables = {"drops": drops(), "creep": standing(), "order": orders(), "damping": damped()}
    tables |= {"level_drops": drops(level_crank()), "conditions": conditions()}
    for name, rows in tables.items():
        lines = [[f"{v:.4g}" if isinstance(v, float) else v for v in row.values()] for row in rows]
        with (out / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows([list(rows[0]), *lines])
        print(name, list(rows[0]), *lines, sep="\n")
    draw(out / "drops.png")


if __name__ == "__main__":
    tyro.cli(compliance)
