"""Forces and energy of the paper's gaits over stiffness, exponent and damping of the ground.

    python -m benchmarks.parameters                 half a minute
    python -m benchmarks.parameters --draw          tables and picture alone, from the data

Writes docs/evidence/parameters.json, the tables of docs/parameters.md and its picture. Under the fixed trunk
a cycle is moved once and put on other ground (`benchmarks.prescribed`). Under the suspended trunk of
HorseLeg-v0, the steady gait is simulated on each ground, with friction; its energy is the engine's account.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from agents import runs
from agents.command import run
from benchmarks.elasticity_runs import DT, GAITS, LEG, PAPER_FLOOR, PAPER_LAW, SUSPENDED, nominal
from benchmarks.pages import DOCS, fill
from benchmarks.prescribed import contact_on
from hoof_env._output import check_folder, markdown_table
from hoof_env._plotting import BLUE, GREEN, ORANGE, PURPLE, STYLE, check_matplotlib, save_png
from hoof_env.constants import GRAVITY
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Prescribed, broken
from hoof_env.gait import load_gait
from hoof_env.ground.contact import Ground, load_ground
from hoof_env.ground.laws import FACTORS, MIN_RESTITUTION, restitution_of_factor
from hoof_env.leg.presets import DEFAULT_PRESET
from hoof_env.paper.rows import load_published

DATA = DOCS / "evidence" / "parameters.json"
PAGE = DOCS / "parameters.md"
PICTURE = DOCS / "images" / "parameters.png"

Data = dict[str, Any]

PART = 0.01
RISE = 1e-4
"""Parameters are varied by this part to either side, the level of the ground by this much [m]."""

STIFFER = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0)
STIFFNESSES = (0.25, 0.5, 1.0, 2.0, 4.0, 16.0)
"""Stiffness over the preset's [-], under the fixed and under the suspended trunk."""

EXPONENTS = (1.0, 1.375, 1.5, 2.0)
FLOORS = (1e-4, 0.01, 0.03, 0.1, 0.3, 1.0)
NOMINAL = (0.0, MIN_RESTITUTION, 0.1, 0.3, 0.5, 0.7, 0.9)
RESTITUTIONS = (1.0, 0.75, 0.5, 0.25, 0.0)
DAMPED = (1.0, 0.5, 0.0)
"""Restitutions in the tables of energy, and of the suspended trunk."""

SETTLE = 10
"""Turns of the crank before the energy of one is taken."""

SAMPLE = 5
"""Steps between samples of the energy that the ground stores."""

DELETED = {
    "walk, elastic peak, K +1 % [%]": 1.0,
    "walk, elastic peak, n +1 % [%]": -5.41,
    "run, elastic peak, n +1 % [%]": -1.95,
    "walk, elastic peak, ground +1 mm [%]": 7.05,
    "run, elastic peak, ground +1 mm [%]": 0.567,
    "walk, inelastic peak, ground +1 mm [%]": 3.65,
    "walk, elastic peak, n = 1.5 [N]": 108.8,
    "run, elastic peak, n = 2 [N]": 2350.5,
    "walk, change, n = 1 [%]": -64.7,
    "run, change, n = 2 [%]": -31.2,
    "walk, inelastic peak, floor 0.1 m/s [N]": 233.0,
    "walk, change, Hunt and Crossley, 0.5 [%]": -61.5,
    "run, change, exact, 0.5 [%]": -54.1,
    "run, change, Gonthier, 0.3 [%]": -73.0,
    "run, inelastic peak, 10 K at its level [N]": 75600.1,
    "10 K, level of the ground [mm]": -19.8,
    "walk, inelastic, given back [%]": 9.0,
    "run, inelastic, given back [%]": 4.0,
    "walk, damper [J]": 8.0,
    "run, damper [J]": 1075.0,
}
"""Numbers of the deleted tables, `git show 2c7c248:docs/evidence/paper.md`."""


def ground_of(law: str = PAPER_LAW, restitution: float = 1.0, **changes: float) -> Ground:
    """Return the paper's ground with a law, a restitution and other changes."""
    ground = load_ground(DEFAULT_PRESET, approach_floor=PAPER_FLOOR)
    ground = replace(ground, normal_law=law, restitution=nominal(law, restitution))
    return replace(ground, **changes)  # type: ignore[arg-type]


def rows_of(
    gait: str, ground: Mapping[str, float], rise: float = 0.0, speed: float = 1.0
) -> dict[str, float]:
    """Return the forces [N] of a gait on elastic and inelastic ground, and their change [%]."""
    elastic, inelastic = (
        contact_on(gait, ground_of(PAPER_LAW, cr, **ground), rise, speed) for cr in (1.0, 0.0)
    )
    return {
        "elastic peak": elastic.peak,
        "elastic mean": elastic.mean,
        "inelastic peak": inelastic.peak,
        "inelastic mean": inelastic.mean,
        "change": 100.0 * (elastic.peak / inelastic.peak - 1.0),
    }


def answers() -> list[Data]:
    """Return by how much [%], the change by how many points, each row grows with each parameter."""
    base = ground_of()
    found: list[Data] = []
    for gait in GAITS:
        middle = rows_of(gait, {})
        ends: dict[str, list[dict[str, float]]] = {}
        for name in ("stiffness", "approach_floor"):
            value = float(getattr(base, name))
            ends[name] = [rows_of(gait, {name: value * (1 + sign * PART)}) for sign in (-1, 1)]
        ends["crank speed"] = [rows_of(gait, {}, 0.0, 1 + sign * PART) for sign in (-1, 1)]
        ends["level"] = [rows_of(gait, {}, sign * RISE) for sign in (-1, 1)]
        for row, value in middle.items():
            entry: Data = {"gait": gait, "row": row, "value": value}
            for name, (low, high) in ends.items():
                steps = 2 * RISE / 1e-3 if name == "level" else 2 * PART / 0.01
                slope = (high[row] - low[row]) / steps
                entry[name] = slope if row == "change" else 100.0 * slope / value
            entry["exponent"] = _answer_to_exponent(gait, row, value)
            found.append(entry)
    return found


def _answer_to_exponent(gait: str, row: str, middle: float) -> float:
    """Return by how much a row of this value grows as the exponent grows by 1 %."""
    n = ground_of().exponent
    values = []
    for sign in (-1, 1):
        peaks = [_with_exponent(gait, cr, n * (1 + sign * PART)) for cr in (1.0, 0.0)]
        change = 100.0 * (peaks[0][0] / peaks[1][0] - 1.0)
        values.append(
            {
                "elastic peak": peaks[0][0],
                "elastic mean": peaks[0][1],
                "inelastic peak": peaks[1][0],
                "inelastic mean": peaks[1][1],
                "change": change,
            }[row]
        )
    slope = (values[1] - values[0]) / 2
    return slope if row == "change" else 100.0 * slope / middle


def _with_exponent(gait: str, restitution: float, exponent: float) -> tuple[float, float]:
    """Return peak and mean [N] for an exponent that is no multiple of 1/8: forces scale with d^(n - n0)."""
    ground = ground_of(PAPER_LAW, restitution)
    contact = contact_on(gait, ground)
    depth = np.clip(contact.depth, 0.0, None)
    scale = np.where(depth > 0.0, np.where(depth > 0.0, depth, 1.0) ** (exponent - ground.exponent), 0.0)
    moved = replace(contact, force=contact.force * scale)
    return moved.peak, moved.mean


def stiffer() -> list[Data]:
    """Return the peaks on stiffer ground, at its level and at the one that keeps the walk's elastic peak."""
    target = load_published().row("walk.peak_elastic").value
    deepest = float(contact_on("walk", ground_of()).depth.max())
    rises = np.linspace(-0.98 * deepest, deepest, 401)
    peaks = [contact_on("walk", ground_of(), float(rise)).peak for rise in rises]
    rows: list[Data] = []
    for factor in STIFFER:
        rise = float(np.interp(target / factor, peaks, rises))
        stiffness = factor * ground_of().stiffness
        row: Data = {"factor": factor, "rise_mm": 1e3 * rise}
        for gait in GAITS:
            row[f"{gait}, kept"] = rows_of(gait, {"stiffness": stiffness})
            row[gait] = rows_of(gait, {"stiffness": stiffness}, rise)
        rows.append(row)
    return rows


def exponents() -> list[Data]:
    """Return peaks and changes over the exponent, with K kept."""
    return [{"exponent": n} | {gait: rows_of(gait, {"exponent": n}) for gait in GAITS} for n in EXPONENTS]


def floors() -> list[Data]:
    """Return peaks and changes over the floor of the approach speed."""
    return [
        {"floor": floor} | {gait: rows_of(gait, {"approach_floor": floor}) for gait in GAITS}
        for floor in FLOORS
    ]


def laws() -> list[Data]:
    """Return what each law returns, and the change of the peak, over the nominal restitution."""
    rows: list[Data] = []
    for law in FACTORS:
        for restitution in NOMINAL:
            if nominal(law, restitution) != restitution:
                continue
            row: Data = {"law": law, "restitution": restitution}
            row["returned"] = restitution_of_factor(FACTORS[law](restitution))
            for gait in GAITS:
                elastic = contact_on(gait, ground_of()).peak
                row[gait] = 100.0 * (elastic / contact_on(gait, ground_of(law, restitution)).peak - 1.0)
            rows.append(row)
    return rows


def energy() -> list[Data]:
    """Return the energy in the contact of a cycle under the fixed trunk, by restitution."""
    rows: list[Data] = []
    for gait in GAITS:
        for restitution in RESTITUTIONS:
            ground = ground_of(PAPER_LAW, restitution)
            contact = contact_on(gait, ground)
            given, back = contact.work()
            row = {"gait": gait, "restitution": restitution, "stored": contact.stored(ground)}
            rows.append(row | {"given": given, "back": back, "lost": given - back})
    return rows


def suspended() -> list[Data]:
    """Return forces and energy of a turn of the steady gait under the suspended trunk."""
    rows: list[Data] = []
    for gait in GAITS:
        for factor in STIFFNESSES:
            for restitution in DAMPED:
                stiffness = factor * ground_of().stiffness
                found = turn(gait, ground_of(PAPER_LAW, restitution, stiffness=stiffness))
                rows.append({"gait": gait, "factor": factor, "restitution": restitution, **found})
    return rows


def turn(gait: str, ground: Ground) -> Data:
    """Return forces and energy of one turn of the crank, when the gait has settled."""
    engine = TrunkEngine(Limb(LEG, drive=Prescribed()), SUSPENDED, ground, sim_dt=DT, strides=True)
    parameters = load_gait(gait, DEFAULT_PRESET)
    engine.reset(parameters, 0.0)
    steps = round(2 * math.pi / parameters.crank_speed / DT)
    failed = broken(engine.advance(steps=SETTLE * steps)).any()
    begin = {name: float(engine.account[name].item()) for name in ACCOUNT}
    start = float(engine.report["x"].item())
    stored = 0.0
    impulse = 0.0
    peak = 0.0
    depth = 0.0
    for _ in range(steps // SAMPLE):
        failed |= broken(engine.advance(steps=SAMPLE)).any()
        stored = max(stored, float(engine.account["ground_stored"].item()))
        impulse += float(engine.strides["normal_impulse"].item())
        peak = max(peak, sum(float(engine.report[f"{foot}_normal"].item()) for foot in ("toe", "heel")))
        depth = max(depth, *(-float(engine.report[f"{foot}_y"].item()) for foot in ("toe", "heel")))
    spent = {name: float(engine.account[name].item()) - begin[name] for name in ACCOUNT}
    seconds = steps * DT
    return {
        "failed": bool(failed),
        "seconds": seconds,
        "peak": peak,
        "depth_mm": 1e3 * depth,
        "share": impulse / seconds / (GRAVITY * engine.total_mass),
        "speed": (float(engine.report["x"].item()) - start) / seconds,
        "stored": stored,
        **spent,
    }


ACCOUNT = ("crank_work", "swing_work", "ground_loss", "friction_loss", "drag_loss", "damper_loss")


def measure() -> Data:
    """Return all data."""
    return {
        "command": runs.command(),
        "versions": runs.versions(),
        "answers": answers(),
        "stiffer": stiffer(),
        "exponents": exponents(),
        "floors": floors(),
        "laws": laws(),
        "energy": energy(),
        "suspended": suspended(),
    }


def find(rows: list[Data], **key: Any) -> Data:
    """Return the row with these entries."""
    return next(row for row in rows if all(row[name] == value for name, value in key.items()))


def today(data: Data) -> dict[str, float]:
    """Return today's values of `DELETED`, by name."""
    walk, run_ = (find(data["answers"], gait=gait, row="elastic peak") for gait in GAITS)
    n = {row["exponent"]: row for row in data["exponents"]}
    energies = {gait: find(data["energy"], gait=gait, restitution=0.0) for gait in GAITS}
    ten = find(data["stiffer"], factor=10.0)
    return {
        "walk, elastic peak, K +1 % [%]": walk["stiffness"],
        "walk, elastic peak, n +1 % [%]": walk["exponent"],
        "run, elastic peak, n +1 % [%]": run_["exponent"],
        "walk, elastic peak, ground +1 mm [%]": walk["level"],
        "run, elastic peak, ground +1 mm [%]": run_["level"],
        "walk, inelastic peak, ground +1 mm [%]": find(data["answers"], gait="walk", row="inelastic peak")[
            "level"
        ],
        "walk, elastic peak, n = 1.5 [N]": n[1.5]["walk"]["elastic peak"],
        "run, elastic peak, n = 2 [N]": n[2.0]["run"]["elastic peak"],
        "walk, change, n = 1 [%]": n[1.0]["walk"]["change"],
        "run, change, n = 2 [%]": n[2.0]["run"]["change"],
        "walk, inelastic peak, floor 0.1 m/s [N]": find(data["floors"], floor=0.1)["walk"]["inelastic peak"],
        "walk, change, Hunt and Crossley, 0.5 [%]": find(data["laws"], law="hunt-crossley", restitution=0.5)[
            "walk"
        ],
        "run, change, exact, 0.5 [%]": find(data["laws"], law="exact", restitution=0.5)["run"],
        "run, change, Gonthier, 0.3 [%]": find(data["laws"], law="gonthier", restitution=0.3)["run"],
        "run, inelastic peak, 10 K at its level [N]": ten["run"]["inelastic peak"],
        "10 K, level of the ground [mm]": ten["rise_mm"],
        **{
            f"{gait}, inelastic, given back [%]": 100.0 * energies[gait]["back"] / energies[gait]["given"]
            for gait in GAITS
        },
        **{f"{gait}, damper [J]": energies[gait]["lost"] for gait in GAITS},
    }


def number(value: float) -> str:
    """Return a cell with four digits."""
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def signed(value: float, decimals: int = 2) -> str:
    """Return a cell with a sign; 0 is one without."""
    text = f"{value:+.{decimals}f}"
    return "0" if float(text) == 0.0 else text


def tables(data: Data) -> dict[str, str]:
    """Return the tables of the page, by name."""
    return {
        "answers": _answers(data),
        "stiffer": _stiffer(data),
        "exponents": _over(data["exponents"], "exponent", "n"),
        "floors": _over(data["floors"], "floor", "floor [m/s]"),
        "laws": _laws(data),
        "energy": _energy(data),
        "suspended": _suspended(data),
        "then": _then(data),
    }


def _answers(data: Data) -> str:
    parameters = {
        "stiffness": "K +1 %",
        "exponent": "n +1 %",
        "approach_floor": "floor +1 %",
        "crank speed": "crank speed +1 %",
        "level": "ground +1 mm",
    }
    rows = []
    for row in data["answers"]:
        unit = "points" if row["row"] == "change" else "%"
        value = f"{row['value']:.1f} " + ("%" if row["row"] == "change" else "N")
        rows.append(
            [f"{row['gait']}: {row['row']}", value, unit, *(signed(row[name]) for name in parameters)]
        )
    return markdown_table(["row", "value", "answers in", *parameters.values()], rows)


def _stiffer(data: Data) -> str:
    head = ["K over the preset's"]
    head += [f"{gait}: {kind} [N]" for gait in GAITS for kind in ("elastic", "inelastic")]
    head += ["level for the walk's peak [mm]"]
    head += [f"there, {gait}: {kind} [N]" for gait in GAITS for kind in ("elastic", "inelastic")]
    rows = []
    for row in data["stiffer"]:
        cells = [f"{row['factor']:g}"]
        for name in ("{}, kept", "{}"):
            cells += [signed(row["rise_mm"], 1)] if name == "{}" else []
            cells += [
                number(row[name.format(gait)][f"{kind} peak"])
                for gait in GAITS
                for kind in ("elastic", "inelastic")
            ]
        rows.append(cells)
    return markdown_table(head, rows)


def _over(found: list[Data], name: str, title: str) -> str:
    kinds = ("elastic peak", "inelastic peak", "change")
    units = ("[N]", "[N]", "[%]")
    head = [
        title,
        *(f"{gait}: {kind} {unit}" for gait in GAITS for kind, unit in zip(kinds, units, strict=True)),
    ]
    rows = []
    for row in found:
        cells = [f"{row[name]:g}"]
        for gait in GAITS:
            cells += [number(row[gait]["elastic peak"]), number(row[gait]["inelastic peak"])]
            cells += [signed(row[gait]["change"], 1)]
        rows.append(cells)
    return markdown_table(head, rows)


def _laws(data: Data) -> str:
    rows = []
    for restitution in NOMINAL:
        cells = [f"{restitution:g}"]
        for law in FACTORS:
            found = [row for row in data["laws"] if (row["law"], row["restitution"]) == (law, restitution)]
            cells += [f"{one['returned']:.2f}: {one['walk']:.1f} / {one['run']:.1f}" for one in found] or [""]
        rows.append(cells)
    return markdown_table(["restitution", *FACTORS], rows)


def _energy(data: Data) -> str:
    head = [
        "gait",
        "restitution",
        "most stored [J]",
        "work on the ground [J]",
        "given back [J]",
        "given back [%]",
        "lost [J]",
    ]
    rows = []
    for row in data["energy"]:
        part = 100.0 * row["back"] / row["given"]
        cells = [row["gait"], f"{row['restitution']:g}"]
        cells += [number(row[name]) for name in ("stored", "given", "back")]
        rows.append([*cells, f"{part:.0f}", f"{abs(row['lost']):.1f}"])
    return markdown_table(head, rows)


def _suspended(data: Data) -> str:
    head = [
        "gait",
        "K over the preset's",
        "restitution",
        "peak [N]",
        "depth [mm]",
        "weight borne",
        "speed [m/s]",
    ]
    head += [
        "most stored [J]",
        "lost in the ground [J]",
        "friction [J]",
        "suspension [J]",
        "drives [J]",
        "drives [J/m]",
    ]
    rows = []
    for row in data["suspended"]:
        cells = [row["gait"], f"{row['factor']:g}", f"{row['restitution']:g}"]
        if row["failed"]:
            rows.append([*cells, "falls", *[""] * 9])
            continue
        cells += [
            f"{row['peak']:.0f}",
            f"{row['depth_mm']:.0f}",
            f"{row['share']:.2f}",
            f"{row['speed']:.2f}",
        ]
        cells += [number(row[name]) for name in ("stored", "ground_loss", "friction_loss", "damper_loss")]
        work = row["crank_work"] + row["swing_work"]
        rows.append([*cells, number(work), f"{work / (row['speed'] * row['seconds']):.0f}"])
    return markdown_table(head, rows)


def _then(data: Data) -> str:
    now = today(data)
    rows = [[name, number(value), number(now[name])] for name, value in DELETED.items()]
    return markdown_table(["number", "deleted table", "today"], rows)


def draw(data: Data) -> None:
    """Draw peaks and energy over the stiffness."""
    check_matplotlib()
    import matplotlib.pyplot as plt

    with plt.rc_context(STYLE):
        figure, (peaks, energies) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
        for gait, colour in zip(GAITS, (BLUE, ORANGE), strict=True):
            for restitution, style in ((1.0, "-"), (0.0, "--")):
                kind = "elastic" if restitution else "inelastic"
                found = [
                    find(data["suspended"], gait=gait, factor=factor, restitution=restitution)
                    for factor in STIFFNESSES
                ]
                values = [row["peak"] for row in found]
                label = f"{gait}, {kind}, suspended"
                peaks.loglog(STIFFNESSES, values, f"o{style}", color=colour, ms=4, label=label)
                held = find(data["stiffer"], factor=1.0)[f"{gait}, kept"][f"{kind} peak"]
                values = [factor * held for factor in STIFFNESSES]
                peaks.loglog(STIFFNESSES, values, style, color=colour, lw=0.8, alpha=0.6)
        peaks.text(1.1, 1.25e4, "thin: fixed trunk, in proportion", fontsize=8, rotation=32, color=ORANGE)
        peaks.set_ylabel("highest normal force in a turn [N]")
        peaks.set_title("peak over stiffness")
        peaks.legend(loc="lower right")
        names = {"stored": ("most stored", GREEN), "ground_loss": ("lost in the ground", PURPLE)}
        for name, (label, colour) in names.items():
            for restitution, style in ((1.0, "-"), (0.5, ":"), (0.0, "--")):
                if name == "ground_loss" and restitution == 1.0:
                    continue
                values = [
                    find(data["suspended"], gait="run", factor=factor, restitution=restitution)[name]
                    for factor in STIFFNESSES
                ]
                title = f"{label}, restitution {restitution:g}"
                energies.semilogx(STIFFNESSES, values, f"o{style}", color=colour, ms=4, label=title)
        energies.set_ylabel("energy of a turn [J]")
        energies.set_ylim(bottom=0.0)
        energies.set_title("run, suspended trunk: energy in the contact")
        energies.legend(loc="upper right")
        for axis in (peaks, energies):
            axis.set_xlabel("stiffness over the paper's [-]")
            axis.set_xticks(STIFFNESSES, [f"{factor:g}" for factor in STIFFNESSES])
            axis.minorticks_off()
        save_png(figure, PICTURE)
        plt.close(figure)


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    draw: bool = False
    """tables and picture alone, from the data that is there"""


def main(argv: list[str] | None = None) -> None:
    """Measure, write, draw."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m benchmarks.parameters", description=__doc__)
    check_folder(DATA.parent)
    if not args.draw:
        runs.write_text(DATA, json.dumps(measure(), indent=1) + "\n")
    data = json.loads(DATA.read_text(encoding="utf-8"))
    fill(PAGE, tables(data))
    draw(data)


if __name__ == "__main__":
    run(main)
