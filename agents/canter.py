"""A canter of the horse with a free footfall: `python -m agents.canter`.

Left and right are half a stride apart in every gait of the model. With `footfall="free"` constant actions
move each leg in the stride, so that a canter is within reach. CMA-ES looks for a gait with the footfall of a
right lead: left hind, then right hind with left fore, then right fore; with a horse's speed and stride; and
with the least mean square of the forces on the hooves. What judges it, the peaks of the leading and the other
fore limb (McGuigan and Wilson 2003), is not known to the search. The command writes
`docs/evidence/canter.md`.
"""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.command import parse, run
from agents.evolution import generations, make_strategy, require
from agents.gait_box import decode, encode
from agents.gait_costs import CRITERIA, misses_of
from agents.gait_rig import Rig
from agents.horse_gaits import speed_of
from agents.judges import Bars, read_judges
from agents.kept import EVIDENCE, check_numbers, check_shape, file_of, read_kept
from agents.rules import rejection_reason
from hoof_env._output import check_folder, markdown_table
from hoof_env.constants import GRAVITY
from hoof_env.errors import count
from hoof_env.tasks.horse import HIP_HEIGHT, PHASE_SPAN
from hoof_env.tasks.horse_gaits import ACTED, LEGS, NAMES, PAIRS, horse_gaits

Floats = NDArray[np.float64]

NAME = "canter"
FROUDE = 1.82  # of 5.0 m/s
STRIDE = 2.68 / HIP_HEIGHT
"""Speed and stride of a canter [hip heights]: Arabians at 5.0 m/s have strides of 2.68 m (Wickler and others
2002); the horse of the model is about as tall."""
FOOTFALL = {"right_hind": (0.25, 0.3), "left_fore": (0.25, 0.3), "right_fore": (0.5, 0.6)}
"""Landings after the left hind leg's, as shares of the stride: of a right lead."""
LEADING, OTHER = "right_fore", "left_fore"
FIGURES = (
    "fell",
    "speed_ratio",
    "stride_over_hip",
    "transport",
    *(f"{name}_{pair}" for name in ("slip", "duty", "stances_per_turn") for pair in PAIRS),
    *(f"touch_{leg}" for leg in FOOTFALL),
    *(f"peak_{leg}" for leg in (LEADING, OTHER)),
)
"""Figures of a canter that the page shows."""
SCALE = 0.03  # of a distance from these [strides]
MISS = 4.0  # cost of a scale beyond them

SPLIT = -0.11  # first shift of the left leg of each pair, the right one's the other way [strides]
LEADS = np.arange(0.0, 1.0, 0.0625)  # of the first gaits [strides]
SPREAD = 0.04
POPULATION = 16
STARTS = 3
SECONDS = 4.0
SETTLED = 1.5
CHECKED = 1000  # starts by which what is found is measured
FALL = 20.0

PAGE = """# A canter with a free footfall

Written by `{command}` at commit `{commit}`, with [what was found]({name}/found.json).

**Asked.** Whether the model canters once left and right need not be half a stride apart.

**Searched.** Constant actions under `footfall="free"`, which shift the legs in the stride, around gaits at
{speed:.2f} m/s (Froude number {froude:g}) with a stride of {stride:.2f} hip heights, as Arabians have
(Wickler and others 2002); the least mean square of the forces on the hooves decides. {seeds} searches by
CMA-ES of {generations} generations each. What it was given is printed as searched and is no result.

**Found.** {found}

{table}

Landings are in strides after the left hind leg's, {starts} starts each; the lead is the right one. Peaks
judge: they were not given, and count of a gait with all three landings in their ranges that keeps the rules
of `agents.judge`: it falls in at most a tenth of its starts, is within 15 % of the speed, slips less than
0.10 m a stance and lands about once a turn. Episodes start with left and right half a stride apart, and the
actions bring the canter about in the first strides, in which some of the horses fall.

```bash
{command}
```
"""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    seeds: int = 2
    """searches"""
    generations: int = 250
    """of each"""
    found: Path | None = None
    """file of what is found, which is gone on with; by default that of the page in --out"""
    out: Path = EVIDENCE
    """folder of the page"""


def bars() -> Bars:
    """Return what a search is given besides the footfall."""
    return {"stride_over_hip": [(STRIDE - 0.15, STRIDE + 0.15)]}


def actions_of(shifts: Floats) -> Floats:
    """Return constant actions, shape (m, 16), that shift the left legs of fore and hind pair [strides], shape
    (m, 2), and the right ones the other way."""
    actions = np.zeros((len(shifts), len(LEGS), ACTED))
    for k, leg in enumerate(LEGS):
        actions[:, k, 0] = shifts[:, k // 2] / PHASE_SPAN * (1 if leg.startswith("left") else -1)
    return np.clip(actions, -1, 1).reshape(len(shifts), -1)


def missed_footfall(figures: dict[str, Floats]) -> Floats:
    """Return distances of landings from `FOOTFALL` in `SCALE`, their sum, shape (m,)."""
    total = np.zeros(len(figures["fell"]))
    for leg, (low, high) in FOOTFALL.items():
        middle = (low + high) / 2
        off = (figures[f"touch_{leg}"] - middle + 0.5) % 1 - 0.5
        far = np.maximum(np.abs(off) - (high - low) / 2, 0.0) / SCALE
        total += np.where(np.isfinite(far), far / (1 + far / 20), 20.0)
    return total


def costs_of(figures: dict[str, Floats]) -> Floats:
    """Return the cost of canters, shape (m,)."""
    name, price = CRITERIA["force"]
    forces = price * np.nan_to_num(figures[name], nan=10.0)
    costs: Floats = misses_of(figures, bars(), FALL) + MISS * missed_footfall(figures) + forces
    return costs


def split(points: Floats) -> tuple[Floats, Floats]:
    """Return the gaits, shape (m, 16), and the shifts [strides], (m, 2), of points, (m, 18)."""
    return decode(points[:, : len(NAMES)]), np.clip(points[:, len(NAMES) :], -1, 1) * PHASE_SPAN


def search(seed: int, length: int) -> dict[str, Any]:
    """Return a canter and its figures."""
    require("agents.canter", "cma", "tqdm")
    from tqdm import tqdm

    began = time.monotonic()
    speed = speed_of(FROUDE)
    rig = Rig(POPULATION * STARTS, num_threads=1, footfall="free")
    played = 0

    def play(points: Floats, starts: int = STARTS) -> dict[str, Floats]:
        nonlocal played
        played += 1
        gaits, shifts = split(points)
        number = 400_000_000 + 1_000_000 * seed + 32 * played
        return rig.play(gaits, speed, number, starts, SECONDS, SETTLED, actions_of(shifts))

    first = []
    for name in ("kinematic-trot", "trot-like"):
        gait = horse_gaits()[name].to_array()
        gait[0] = 2 * np.pi * speed / (STRIDE * HIP_HEIGHT)
        for lead in LEADS:
            moved = gait.copy()
            moved[1] = (gait[1] + lead + 0.5) % 1 - 0.5
            first.append(np.append(encode(moved[None])[0], [SPLIT / PHASE_SPAN] * 2))
    costs = [costs_of(play(np.array(part))) for part in np.array_split(first, 2)]
    best = first[int(np.argmin(np.concatenate(costs)))]
    strategy = make_strategy(best, SPREAD, POPULATION, seed + 1)
    improved = generations(strategy, lambda points: costs_of(play(np.array(points))).tolist(), length)
    for _ in tqdm(improved, f"seed {seed}", length, unit=" generations", leave=False, disable=None):
        pass
    point = strategy.result.xfavorite[None]
    gaits, shifts = split(point)
    return {
        "seed": seed,
        "gait": gaits[0].round(5).tolist(),
        "shifts": shifts[0].round(5).tolist(),
        "wall_s": round(time.monotonic() - began, 1),
    }


def measured(found: dict[str, Any]) -> dict[str, Any]:
    """Return what a search found with its figures over `CHECKED` starts that no search met, measured once."""
    if found.get("starts") == CHECKED:
        return found
    rig = Rig(CHECKED, footfall="free")
    gaits, shifts = np.array([found["gait"]]), np.array([found["shifts"]])
    played = rig.play(gaits, speed_of(FROUDE), 10**9, CHECKED, 6.0, 2.0, actions_of(shifts))
    return found | {name: round(float(values[0]), 4) for name, values in played.items()} | {"starts": CHECKED}


def counts(one: dict[str, Any]) -> bool:
    """Return True if a canter's figures count."""
    return not rejection_reason(one)


def lands(one: dict[str, Any]) -> bool:
    """Return True if a canter has the footfall that was given."""
    return all(low <= one[f"touch_{leg}"] <= high for leg, (low, high) in FOOTFALL.items())


def rows_of(found: list[dict[str, Any]]) -> list[list[str]]:
    """Return the table's rows."""
    judges = read_judges()["canter"]
    rows = []
    for leg, (low, high) in FOOTFALL.items():
        cells = [
            f"{one[f'touch_{leg}']:.2f}: searched, "
            + ("inside" if low <= one[f"touch_{leg}"] <= high else "outside")
            for one in found
        ]
        rows.append([f"landing, {leg.replace('_', ' ')}", f"{low:g} to {high:g}", *cells])
    low, high = bars()["stride_over_hip"][0]
    cells = [
        f"{one['stride_over_hip']:.2f}: searched, "
        + ("inside" if low <= one["stride_over_hip"] <= high else "outside")
        for one in found
    ]
    rows.append(["stride [hip heights]", f"{low:.2f} to {high:.2f}", *cells])
    for leg, name in ((LEADING, "peak_lead_fore"), (OTHER, "peak_non_lead_fore")):
        low, high = judges[name]["bar"]
        cells = []
        for one in found:
            ours = one[f"peak_{leg}"] * GRAVITY
            verdict = "met" if low <= ours <= high else "missed"
            cells.append(f"{ours:.1f}: " + (verdict if counts(one) and lands(one) else "does not count"))
        rows.append([f"{name.replace('_', ' ')} [N/kg]", f"{low:g} to {high:g}", *cells])
    for name, text in (("fell", "share that fell"), ("speed_ratio", "speed over the command")):
        rows.append([text, "", *(f"{one[name]:.2f}" for one in found)])
    rows.append(
        ["slip, fore and hind [m]", "", *(f"{o['slip_fore']:.2f}, {o['slip_hind']:.2f}" for o in found)]
    )
    rows.append(["duty, fore and hind", "", *(f"{o['duty_fore']:.2f}, {o['duty_hind']:.2f}" for o in found)])
    rows.append(
        [
            "stances a turn, fore and hind",
            "",
            *(f"{o['stances_per_turn_fore']:.2f}, {o['stances_per_turn_hind']:.2f}" for o in found),
        ]
    )
    rows.append(["shift of left fore and hind [strides]", "", *(str(one["shifts"]) for one in found)])
    rows.append(["transport, mechanical", "", *(f"{one['transport']:.2f}" for one in found)])
    return rows


def summary(found: list[dict[str, Any]]) -> str:
    """Return what was found, in a sentence."""
    whole = sum(lands(one) and counts(one) for one in found)
    only = sum(lands(one) for one in found)
    standing = sum(counts(one) for one in found)
    return (
        f"Of {len(found)} searches {whole} ended in a canter that counts: {only} have all three landings in "
        f"their ranges, and {standing} keep the rules of a gait that counts."
    )


def content_of_file(content: Any) -> dict[str, Any]:
    """Return the content of a file of canters; raise KeyError, TypeError or ValueError for another file's."""
    for k, one in enumerate(content["found"]):
        check_numbers(f"canter {k}", one, ("seed", *(FIGURES if one.get("starts") == CHECKED else ())))
        check_shape(f"gait of canter {k}", one["gait"], (len(NAMES),))
        check_shape(f"shifts of canter {k}", one["shifts"], (len(PAIRS),))
    return dict(content)


def write(args: Args) -> None:
    """Search for what is missing and write the page."""
    seeds, length = count("--seeds", args.seeds), count("--generations", args.generations)
    check_folder(args.out)
    path = file_of(args.found, args.out, NAME, "found.json")
    content: dict[str, Any] = {"found": []}
    if path.is_file():
        content = read_kept(path, "canters that agents.canter found", content_of_file)
    known = {one["seed"] for one in content["found"]}
    to_do = [seed for seed in range(seeds) if seed not in known]
    print(f"{path}: has {seeds - len(to_do)} of {seeds} searches", flush=True)
    if to_do:
        print(f"{len(to_do)} searches to do, of {length} generations each: minutes to hours", flush=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    for seed in to_do:
        one = search(seed, length)
        content["found"].append(one)
        content["versions"] = runs.versions()
        runs.write_text(path, json.dumps(content, indent=1) + "\n")
        print({name: value for name, value in one.items() if not isinstance(value, list)}, flush=True)
    found = [measured(one) for one in content["found"]]
    if found != content["found"]:
        content["found"] = found
        runs.write_text(path, json.dumps(content, indent=1) + "\n")
    head = ("figure", "horse", *(f"seed {one['seed']}" for one in found))
    page = PAGE.format(
        command="python -m agents.canter",
        commit=runs.versions().get("commit", "unknown"),
        name=NAME,
        speed=speed_of(FROUDE),
        froude=FROUDE,
        stride=STRIDE,
        seeds=len(found),
        generations=args.generations,
        found=summary(found),
        table=markdown_table(head, rows_of(found)),
        starts=CHECKED,
    )
    runs.write_text(args.out / f"{NAME}.md", page)
    print(f"written: {args.out / NAME}.md")


def main(argv: list[str] | None = None) -> None:
    """Search and write the page."""
    write(parse(Args, argv, "python -m agents.canter", __doc__))


if __name__ == "__main__":
    run(main)
