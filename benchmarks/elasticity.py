"""Peak force on the hoof on elastic against inelastic ground, as the trunk is held, suspended or free.

    python -m benchmarks.elasticity                 needs the extra "peers"; some ten minutes
    python -m benchmarks.elasticity --draw          tables and picture alone, from the data

Writes docs/evidence/elasticity.json, the tables of docs/elasticity.md and its picture. The gaits are the
paper's walk and run. `benchmarks.elasticity_runs` says what a landing and a steady gait are.
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from agents import runs
from agents.command import run
from benchmarks.elasticity_runs import (
    GAITS,
    HELD,
    MASSES,
    PAPER_FLOOR,
    PAPER_LAW,
    RESTITUTIONS,
    RISES,
    SETUPS,
    STEADY,
    balanced,
    delivered,
    free_mass,
    ground_of,
    landing,
    nominal,
    steady,
)
from benchmarks.pages import DOCS, fill
from benchmarks.prescribed import contact_on
from hoof_env._output import check_folder, markdown_table
from hoof_env.evaluation.episodes import play
from hoof_env.ground.laws import FACTORS, NORMAL_LAWS
from hoof_env.policies.find import find_policy
from hoof_env.tasks.settings import Settings

DATA = DOCS / "evidence" / "elasticity.json"
PAGE = DOCS / "elasticity.md"
PICTURE = DOCS / "images" / "elasticity.png"

FLOORS = {"paper": PAPER_FLOOR, "HorseLeg-v0": Settings().approach_floor}
"""Smallest approach speeds that Eq. 14 divides by [m/s]."""

EPISODES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("HorseLegRail-v0", "run", {}),
    ("HorseLegRail-v0", "policy", {}),
    ("HorseLeg-v0", "walk", {}),
    ("HorseLeg-v0", "carrying_walk", {}),
    ("HorseLeg-v0", "run", {}),
    ("HorseLeg-v0", "policy", {}),
    ("Horse-v0", "reference", {"target_speed": 1.85}),
    ("Horse-v0", "policy", {"target_speed": 1.85}),
    ("Horse-v0", "reference", {"target_speed": 3.6}),
    ("Horse-v0", "policy", {"target_speed": 3.6}),
)
"""Episodes with motors and friction: id, policy, settings."""

MIDDLE = 0.5
"""Restitution at which the steady gaits are simulated under all laws."""

SEEDS = range(30_000, 30_012)

Data = dict[str, Any]


def change(elastic: float, inelastic: float) -> float:
    """Return how much higher the elastic peak is than the inelastic one [%]."""
    return 100.0 * (elastic / inelastic - 1.0)


def grounds() -> Iterator[tuple[str, float]]:
    """Return laws and nominal restitutions below 1."""
    for law in NORMAL_LAWS:
        for restitution in RESTITUTIONS[1:]:
            yield law, nominal(law, restitution)


def median_change(peak: Callable[[float, float], float], restitution: float) -> dict[str, float]:
    """Return median, lowest and highest change over rises of the ground; `peak` has restitution and rise."""
    found = [change(peak(1.0, rise), peak(restitution, rise)) for rise in RISES]
    return {"median": float(np.median(found)), "lowest": min(found), "highest": max(found)}


def measure_landings() -> list[Data]:
    """Return the peaks of landings, of every gait, set-up and ground."""
    rows: list[Data] = []
    for gait in GAITS:
        for name, trunk in SETUPS.items():
            print(f"landings: {gait}, {name}", flush=True)
            elastic = landing(gait, trunk, ground_of(PAPER_LAW, 1.0))
            for law, restitution in grounds():
                peak = landing(gait, trunk, ground_of(law, restitution))
                row = {"gait": gait, "setup": name, "law": law, "restitution": restitution}
                row |= {"elastic": elastic, "peak": peak, "change": change(elastic, peak)}
                if law == PAPER_LAW and restitution == 0.0:
                    row |= median_change(
                        lambda cr, rise, g=gait, t=trunk: landing(g, t, ground_of(PAPER_LAW, cr), rise),  # type: ignore[misc]
                        0.0,
                    )
                elif name in HELD:
                    row |= median_change(
                        lambda cr, rise, g=gait, one=law: contact_on(g, ground_of(one, cr), rise).peak,  # type: ignore[misc]
                        restitution,
                    )
                rows.append(row)
    return rows


def measure_masses() -> list[Data]:
    """Return the peaks of landings under balanced trunks, over their mass."""
    rows: list[Data] = []
    for gait in GAITS:
        for mass in MASSES:
            peaks = [landing(gait, balanced(mass), ground_of(PAPER_LAW, cr)) for cr in (1.0, 0.0)]
            rows.append({"gait": gait, "mass": mass, "elastic": peaks[0], "inelastic": peaks[1]})
            rows[-1] |= {"change": change(*peaks)}
    return rows


def measure_steady() -> list[Data]:
    """Return the peaks of steady gaits, of every gait and set-up, under the paper's law and, at the middle
    restitution, under all laws."""
    rows: list[Data] = []
    for gait in GAITS:
        for name in STEADY:
            print(f"steady gait: {gait}, {name}", flush=True)
            elastic = steady(gait, SETUPS[name], ground_of(PAPER_LAW, 1.0))
            for law, restitution in grounds():
                if law != PAPER_LAW and restitution != MIDDLE:
                    continue
                found = steady(gait, SETUPS[name], ground_of(law, restitution))
                row = {"gait": gait, "setup": name, "law": law, "restitution": restitution}
                row |= {"elastic": asdict(elastic), "inelastic": asdict(found)}
                rows.append(row | {"change": change(elastic.peak, found.peak)})
    return rows


def measure_floors() -> list[Data]:
    """Return the change of the paper's inelastic ground on a fixed trunk, by floor of the approach speed."""
    rows: list[Data] = []
    for gait in GAITS:
        for name, floor in FLOORS.items():

            def peak(cr: float, rise: float, gait: str = gait, floor: float = floor) -> float:
                return contact_on(gait, ground_of(PAPER_LAW, cr, floor), rise).peak

            row = {
                "gait": gait,
                "floor": name,
                "m_s": floor,
                "change": change(peak(1.0, 0.0), peak(0.0, 0.0)),
            }
            rows.append(row | median_change(peak, 0.0))
    return rows


def measure_free_mass() -> list[Data]:
    """Return restitution and change of the impact of a free mass, by law."""
    exponent = ground_of(PAPER_LAW, 1.0).exponent
    return [
        {
            "law": law,
            "restitution": restitution,
            "delivered": delivered(law, restitution),
            "change": change(1.0, free_mass(FACTORS[law](restitution), exponent)),
        }
        for law, restitution in grounds()
        if law in FACTORS
    ]


def measure_episodes() -> list[Data]:
    """Return the mean stance peaks of episodes of the environments, by restitution."""
    rows: list[Data] = []
    for name, policy, settings in EPISODES:
        print(f"episodes: {name}, {policy}", flush=True)
        env_id = f"hoof_env/{name}"
        peaks: dict[str, float] = {}
        highest: dict[str, float] = {}
        failed: dict[str, float] = {}
        for restitution in RESTITUTIONS:
            with runs.make_env(env_id, restitution=restitution, **settings) as env:
                chosen = policy if policy != "policy" else f"agents/policies/{name}"
                with warnings.catch_warnings():
                    # The agents were trained on other ground, which is the point
                    warnings.simplefilter("ignore", UserWarning)
                    found = find_policy(chosen, env, env_id)
                episodes = play(env, found, SEEDS)
            peaks[f"{restitution:g}"] = float(np.mean([one["stance_peak_n"] for one in episodes]))
            highest[f"{restitution:g}"] = float(np.mean([one["highest_grf_n"] for one in episodes]))
            failed[f"{restitution:g}"] = float(np.mean([one["failed"] for one in episodes]))
        row = {
            "id": name,
            "policy": policy,
            "settings": settings,
            "peaks": peaks,
            "highest": highest,
            "failed": failed,
        }
        rows.append(row | {"change": change(peaks["1"], peaks["0"])})
    return rows


def measure_mujoco() -> Data:
    """Return the landings in MuJoCo, and episodes with its own contact."""
    import mujoco

    from benchmarks import elasticity_mujoco as there
    from benchmarks.mujoco_transfer import ENV_ID, POLICY

    rows: list[Data] = []
    for gait in GAITS:
        for name, trunk in SETUPS.items():
            print(f"MuJoCo: {gait}, {name}", flush=True)
            peaks = {f"{cr:g}": there.landing(gait, trunk, ground_of(PAPER_LAW, cr)) for cr in RESTITUTIONS}
            rows.append(
                {"gait": gait, "setup": name, "peaks": peaks, "change": change(peaks["1"], peaks["0"])}
            )
    own: list[Data] = []
    with runs.make_env(ENV_ID) as env:
        for policy in ("walk", "run", POLICY):
            print(f"MuJoCo's contact: {policy}", flush=True)
            found = find_policy(policy, env, ENV_ID)
            peaks = {f"{d:g}": there.own_contact(env, found, d, 6) for d in there.DAMPINGS}
            own.append({"policy": "policy" if policy == POLICY else policy, "peaks": peaks})
    returned = {f"{d:g}": there.own_restitution(d) for d in there.DAMPINGS}
    return {"version": mujoco.__version__, "landings": rows, "own": own, "own_restitution": returned}


def measure() -> Data:
    """Return all data."""
    return {
        "command": runs.command(),
        "versions": runs.versions(),
        "landings": measure_landings(),
        "masses": measure_masses(),
        "floors": measure_floors(),
        "free_mass": measure_free_mass(),
        "steady": measure_steady(),
        "mujoco": measure_mujoco(),
        "episodes": measure_episodes(),
    }


def find(rows: list[Data], **key: Any) -> Data:
    """Return the row with these entries."""
    return next(row for row in rows if all(row[name] == value for name, value in key.items()))


def percent(value: float | None) -> str:
    """Return a change as a cell, empty for None and for no number."""
    return "" if value is None or math.isnan(value) else f"{value:+.1f} %".replace("-0.0", "0.0")


def tables(data: Data) -> dict[str, str]:
    """Return the tables of the page, by name."""
    return {
        "setups": _setups(data),
        "masses": _masses(data),
        "laws": _laws(data),
        "steady": _steady(data),
        "mujoco": _mujoco(data),
        "own": _own(data),
        "episodes": _episodes(data),
    }


def _setups(data: Data) -> str:
    head = ["set-up"]
    for gait in GAITS:
        head += [f"{gait}: elastic [N]", "inelastic [N]", f"{gait}: change", "median over 1 mm"]
    rows = []
    for name in SETUPS:
        cells = [name]
        for gait in GAITS:
            row = find(data["landings"], gait=gait, setup=name, law=PAPER_LAW, restitution=0.0)
            cells += [f"{row['elastic']:.0f}", f"{row['peak']:.0f}", percent(row["change"])]
            cells.append(percent(row["median"]))
        rows.append(cells)
    return markdown_table(head, rows)


def _masses(data: Data) -> str:
    free = find(data["free_mass"], law=PAPER_LAW, restitution=0.0)["change"]
    rows = [["a free mass without a leg", percent(free), percent(free)]]
    for mass in MASSES:
        found = [percent(find(data["masses"], gait=gait, mass=mass)["change"]) for gait in GAITS]
        rows.append([f"{mass:,.0f} kg", *found])
    held = [
        percent(find(data["landings"], gait=gait, setup="fixed", law=PAPER_LAW, restitution=0.0)["change"])
        for gait in GAITS
    ]
    return markdown_table(["trunk", *GAITS], [*rows, ["fixed", *held]])


LAW_SETUPS = ("fixed", "suspended", "free")


def _laws(data: Data) -> str:
    head = ["law", "restitution", "returned", "a free mass"]
    head += [f"{gait}: {name}" for gait in GAITS for name in LAW_SETUPS]
    rows = []
    for law, restitution in grounds():
        cells = [law, f"{restitution:g}"]
        if law in FACTORS:
            free = find(data["free_mass"], law=law, restitution=restitution)
            cells += [f"{free['delivered']:.2f}", percent(free["change"])]
        else:
            cells += ["", ""]
        for gait in GAITS:
            for name in LAW_SETUPS:
                row = find(data["landings"], gait=gait, setup=name, law=law, restitution=restitution)
                cells.append(percent(row["median"] if name in HELD else row["change"]))
        rows.append(cells)
    return markdown_table(head, rows)


def _steady(data: Data) -> str:
    head = [
        "set-up",
        *(f"{gait}: {word}" for gait in GAITS for word in ("elastic [N]", "inelastic [N]", "change")),
    ]
    rows = []
    for name in STEADY:
        cells = [name]
        for gait in GAITS:
            row = find(data["steady"], gait=gait, setup=name, law=PAPER_LAW, restitution=0.0)
            cells += [
                f"{row['elastic']['peak']:.0f}",
                f"{row['inelastic']['peak']:.0f}",
                percent(row["change"]),
            ]
        rows.append(cells)
    return markdown_table(head, rows)


def _mujoco(data: Data) -> str:
    head = [
        "set-up",
        *(f"{gait}: {word}" for gait in GAITS for word in ("elastic [N]", "inelastic [N]", "change")),
    ]
    rows = []
    for name in SETUPS:
        cells = [name]
        for gait in GAITS:
            row = find(data["mujoco"]["landings"], gait=gait, setup=name)
            cells += [f"{row['peaks']['1']:.1f}", f"{row['peaks']['0']:.1f}", percent(row["change"])]
        rows.append(cells)
    return markdown_table(head, rows)


def _own(data: Data) -> str:
    found = data["mujoco"]
    dampings = list(found["own_restitution"])
    head = [
        "policy",
        *(f"returned {found['own_restitution'][d]:.2f} [N]" for d in dampings),
        "first against last",
    ]
    rows = []
    for row in found["own"]:
        peaks = [row["peaks"][d] for d in dampings]
        name = "shipped agent" if row["policy"] == "policy" else row["policy"]
        rows.append([name, *(f"{peak:.0f}" for peak in peaks), percent(change(peaks[0], peaks[-1]))])
    return markdown_table(head, rows)


def _episodes(data: Data) -> str:
    head = ["id", "gait", *(f"{cr:g} [N]" for cr in RESTITUTIONS), "1 against 0", "highest force"]
    rows = []
    for row in data["episodes"]:
        name = "shipped agent" if row["policy"] == "policy" else row["policy"]
        speed = row["settings"].get("target_speed")
        rows.append(
            [
                f"`{row['id']}`",
                name if speed is None else f"{name}, {speed:g} m/s",
                *(f"{row['peaks'][f'{cr:g}']:.0f}" for cr in RESTITUTIONS),
                percent(row["change"]),
                percent(change(row["highest"]["1"], row["highest"]["0"])),
            ]
        )
    return markdown_table(head, rows)


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    draw: bool = False
    """tables and picture alone, from the data that is there"""


def main(argv: list[str] | None = None) -> None:
    """Measure, write, draw."""
    import tyro

    from benchmarks.elasticity_picture import draw

    args = tyro.cli(Args, args=argv, prog="python -m benchmarks.elasticity", description=__doc__)
    check_folder(DATA.parent)
    if not args.draw:
        runs.write_text(DATA, json.dumps(measure(), indent=1) + "\n")
    data = json.loads(DATA.read_text(encoding="utf-8"))
    fill(PAGE, tables(data))
    draw(data, PICTURE)


if __name__ == "__main__":
    run(main)
