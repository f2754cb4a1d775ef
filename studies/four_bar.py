"""Search for a four-bar leg: a crank, a coupler that carries the foot, and a rocker.

    python -m agents.four_bar                          writes runs/four_bar.json, a preset; four minutes

A leg of hip height 1 is measured in the half turn of its crank in which the foot is lowest, the stance. Asked
for are a level and even stance, a stroke, a foot that comes back above the ground, a distance from the dead
points, joints above the ground and short links; see `TARGETS`. CMA-ES searches from
`--restarts` random places for each way of assembly, and the best leg is written with the hip height and mass
of the leg that ships. The same arguments give the same leg.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.command import run
from agents.evolution import generations, make_strategy, require
from agents.foot_paths import figures, path_of
from hoof_env.errors import GeometryError, ParameterError, check_number
from hoof_env.gait import GaitParameters
from hoof_env.leg.geometry import Geometry, load_geometry

Floats = NDArray[np.float64]

MECHANISM: Mapping[str, Any] = {
    "fixed": ["O", "B"],
    "crank": {"point": "P", "length": "OP"},
    "points": [
        {"point": "C", "dyad": ["B", "P"], "lengths": ["BC", "PC"]},
        {"point": "G", "dyad": ["P", "C"], "lengths": ["PG", "CG"]},
    ],
    "bodies": [
        {"name": "OP", "tail": "O", "head": "P", "role": "crank"},
        {"name": "PC", "tail": "P", "head": "C", "role": "coupler"},
        {"name": "BC", "tail": "B", "head": "C", "role": "rocker"},
        {"name": "PG", "tail": "P", "head": "G", "role": "coupler"},
        {"name": "CG", "tail": "C", "head": "G", "role": "coupler"},
    ],
    "joints": [
        ["O", "OP", "frame"],
        ["P", "PC", "OP"],
        ["P", "PG", "OP"],
        ["B", "BC", "frame"],
        ["C", "BC", "PC"],
        ["C", "CG", "PC"],
        ["G", "CG", "PG"],
    ],
    "feet": ["G"],
}
"""Structure of the leg: the coupler is a triangle of three rods, as those of Jansen's leg are."""

RANGES = {
    "PC": (1.2, 6.0),
    "BC": (1.2, 6.0),
    "OB": (1.2, 6.0),
    "turn_of_OB": (-np.pi, np.pi),
    "PG": (1.0, 10.0),
    "turn_of_PG": (-np.pi, np.pi),
}
"""Lowest and highest value of what is searched: lengths in cranks, the angle of OB from the horizontal and of
PG from PC [rad]."""

SCREENED = 400  # random legs, of which the best begins a search
POPULATION = 16  # legs of a generation
SPREAD = 0.2  # first standard deviation; the box of every number is 2 wide

TARGETS = {
    "level": (0.0, 0.02),
    "uneven": (0.0, 0.2),
    "stroke": (0.7, -0.1),
    "passes": (0.1, -0.03),
    "lift": (0.15, -0.05),
    "margin": (0.5, -0.1),
    "clearance": (0.25, -0.05),
    "longest": (1.0, 0.2),
}
"""Wanted value of each of the `figures`, and the miss that costs 1: a higher figure is none where that is
negative, else a lower one."""

LOCKED = 1e3  # cost of a leg that does not turn


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    restarts: int = 8
    """searches for each way of assembly"""
    generations: int = 250
    """of each search"""
    out: Path = Path("runs/four_bar.json")
    """file of the leg"""


def make_leg(x: Floats, side: int) -> Geometry:
    """Return the leg of a point of [-1, 1], shape (6,), with a crank of 1 m and a point C on one side.

    Raises:
        GeometryError: it does not turn.
    """
    low, high = np.array([*RANGES.values()]).T
    coupler, rocker, base, turn, reach, bend = low + (high - low) * (np.asarray(x) + 1) / 2
    foot = reach * np.exp(1j * bend)
    lengths = {"OP": 1.0, "PC": coupler, "BC": rocker, "PG": reach, "CG": abs(foot - coupler)}
    return Geometry(
        lengths,
        (base * np.cos(turn), base * np.sin(turn)),
        # left of the line from P to C, as the angle of PG says
        {"C": side, "G": 1 if bend > 0 else -1},
        toe="G",
        heel=None,
        travel=1,
        hip_height=1.0,
        mechanism=MECHANISM,  # type: ignore[arg-type]
    )


def cost(x: Floats, side: int) -> float:
    """Return how much a point misses `TARGETS`, squared and summed."""
    try:
        leg = make_leg(x, side)
    except (GeometryError, ParameterError):
        return LOCKED
    found = figures(leg)
    hip = -path_of(leg)[0].imag.min()
    # the hip is over the foot, else its height is no scale
    if hip < 1.0:
        return LOCKED / 2 - hip
    misses = [max((found[name] - wanted) / unit, 0.0) for name, (wanted, unit) in TARGETS.items()]
    return float(np.square(misses).sum())


class Found(NamedTuple):
    """Best point of a search, its cost, and the number of legs that were looked at."""

    cost: float
    x: Floats
    side: int
    looked_at: int


def search(side: int, seed: int, count: int, tick: Callable[[], Any]) -> Found:
    """Search for `count` generations among the legs with the point C on one side."""
    generator = np.random.default_rng([seed, side + 1])
    tried = generator.uniform(-1, 1, (SCREENED, len(RANGES)))
    costs = [cost(x, side) for x in tried]
    looked_at = SCREENED
    best = int(np.argmin(costs))
    found = Found(costs[best], tried[best], side, looked_at)
    strategy = make_strategy(found.x, SPREAD, POPULATION, int(generator.integers(1, 2**31)))
    for points, values in generations(strategy, lambda points: [cost(x, side) for x in points], count):
        looked_at += len(points)
        tick()
        k = int(np.argmin(values))
        if values[k] < found.cost:
            found = Found(values[k], np.array(points[k]), side, looked_at)
        if strategy.stop():
            break
    return found._replace(looked_at=looked_at)


def search_all(args: Args) -> list[Found]:
    """Search on both sides from all seeds, and print what each search finds."""
    from tqdm import tqdm

    found = []
    with tqdm(total=2 * args.restarts * args.generations, leave=False, disable=None) as bar:
        for side, seed in product((1, -1), range(args.restarts)):
            found.append(search(side, seed, args.generations, bar.update))
            bar.write(f"C on side {side:+d}, search {seed}: cost {found[-1].cost:.3f}")
    return found


def at_size(leg: Geometry, looked_at: int) -> Geometry:
    """Return a leg with the hip height and the mass of the leg that ships, in whole tenths of millimetres."""
    shipped = load_geometry()
    height = round(shipped.hip_height, 4)
    foot, moved, stance = path_of(leg)
    factor = height / -foot.imag.min()
    lengths = {name: round(factor * length, 4) for name, length in leg.lengths.items()}
    density = round(shipped.mass / sum(lengths[name] for name in leg.mechanism.body_lengths), 4)
    return leg.replace(
        lengths=lengths,
        travel=1 if moved[stance].real.sum() < 0 else -1,
        pivot=tuple(round(factor * c, 4) for c in leg.pivot),
        hip_height=height,
        linear_density=density,
        name="fourbar",
        provenance=(
            f"Found, not published: the best of {looked_at} four-bar legs that python -m agents.four_bar of "
            f"hoof-env {runs.versions()['hoof-env']} looked at, for a level and even stance of half a turn, "
            "a stroke of 0.7 hip heights and a foot that comes back 0.1 above the ground."
        ),
    )


def main(argv: list[str] | None = None) -> None:
    """Search, print the figures and write the leg."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.four_bar", description=__doc__)
    require("agents.four_bar", "cma", "tqdm")
    check_number("restarts", args.restarts, low=1, high=1000)
    check_number("generations", args.generations, low=1, high=1e6)
    searches = search_all(args)
    best = min(searches, key=lambda found: found.cost)
    looked_at = sum(found.looked_at for found in searches)
    leg = at_size(make_leg(best.x, best.side), looked_at)
    for name, value in figures(leg).items():
        print(f"{name:10} {value:.3f}")
    args.out.parent.mkdir(parents=True, exist_ok=True)
    leg.save(args.out, gaits={"walk": GaitParameters(5.0, 0.0, 0.0, 0.0)})
    print(f"{looked_at} legs looked at; written: {args.out}")


if __name__ == "__main__":
    run(main)
