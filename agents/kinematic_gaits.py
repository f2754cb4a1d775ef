"""Kinematic gaits of the horse, found by CMA-ES: `python -m agents.kinematic_gaits`.

The searches of `agents.horse_gaits` know the return alone. These are also given the kinematics of living
horses: the rows of `agents/judges.json` that are marked `searched`, which are lag, duty factors, number of
force peaks and length of the stride. Many gaits have these, and a criterion decides: the least mean square of
the forces on the hooves, which is high at peaks and where legs pull against each other. `--criterion` chooses
another one: the least positive work of single limbs on the centre of mass (Donelan, Kram and Kuo 2002, J.
Biomech. 35:117) or of the drives, the highest return, the lowest peaks or the slowest loading. No criterion
contains a figure of a horse, and the search is not given the figures that judge its gaits: peaks, braking,
propulsion, impulses and loading of horses.

A search begins with the reference gait of its speed, with a stride of 1.3 to 2.3 hip heights and several
leads of the fore pair. The best lead of each stride is improved, and then the best of these. Searches that
are in the file are not made again. A found gait is stored with its fore legs named as they land on a horse
(`agents.limb_names`).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.command import parse, run
from agents.gait_box import STRIDES
from agents.gait_costs import CRITERIA, FALL
from agents.gait_finder import STARTS, Finder
from agents.kept import check_shape, read_kept
from agents.kept_searches import Records
from agents.limb_names import named, within_quarter
from agents.start_phases import phase_of
from hoof_env._output import check_folder
from hoof_env.errors import ParameterError, check_choice, check_number, count
from hoof_env.tasks.horse_gaits import NAMES

Floats = NDArray[np.float64]

SPREAD = 0.15  # of a search that begins with a stride, in the box
AGAIN = 0.07  # of one that goes on


@dataclass
class Args:
    """Arguments of the command."""

    gaits: tuple[str, ...] = ("walk", "trot")
    """gaits to search for: walk, trot"""
    froude: tuple[float, ...] = (0.2, 0.85)
    """Froude number of each"""
    criterion: str = "force"
    """criterion between gaits with the wanted kinematics: force, limbs, work, return, peak or loading"""
    out: Path = Path("runs/kinematic.json")
    """file of the searches; one that exists is continued"""
    shipped: Path = Path("runs/kinematic-gaits.json")
    """file of the gaits found, in the form of hoof_env/data/horse/kinematic.json"""
    begin: Path | None = None
    """file of gaits from which searches start, in the form of `shipped`; otherwise from several strides"""
    first: int = 120
    """generations from each stride"""
    more: int = 300
    """generations from the best of these"""
    seed: int = 0
    """of searches and their episodes"""
    starts: int = STARTS
    """episodes of each candidate"""
    fall: float = FALL
    """cost of a gait that always falls"""
    spread: float = AGAIN
    """of a search that goes on, in the box of the gaits"""


def begun_gait(path: Path, kind: str) -> Floats:
    """Return the gait of a kind from which searches go on, shape (16,), of a file of gaits.

    Raises:
        DataFileError: the file cannot be read, or is another one.
        ParameterError: it has no gait of this kind.
    """

    def taken(content: Any) -> dict[str, Floats]:
        for name, one in content.items():
            check_shape(f"gait of {name}", one["gait"], (len(NAMES),))
        return {name: np.array(one["gait"]) for name, one in content.items()}

    known = read_kept(path, "gaits as agents.kinematic_gaits --shipped has them", taken)
    begun: Floats = within_quarter(known[check_choice("gait", f"kinematic-{kind}", known)][None])[0]
    return begun


def searches_of(kind: str, froude: float, args: Args) -> list[str]:
    """Return the names of the searches for a gait, in their order; the last one has the gait."""
    title = f"{kind} at {froude:g} by {args.criterion}, seed {args.seed}"
    if args.begin is not None:
        return [f"{title}, from {args.begin.name}"]
    return [*(f"{title}, stride {stride:g}" for stride in STRIDES), f"{title}, best"]


def find(kind: str, froude: float, args: Args, records: Records) -> dict[str, Any]:
    """Return the best gait of a kind at a Froude number: searches from each stride, and one from the best of
    these."""
    finder = Finder(kind, froude, args.seed, args.criterion, args.starts, args.fall)
    *firsts, last = searches_of(kind, froude, args)

    def improve(first: Floats, spread: float, count: int) -> Any:
        return lambda tick: finder.check(finder.improve(first, spread, count, tick))

    if args.begin is not None:
        return records.keep(last, improve(begun_gait(args.begin, kind), args.spread, args.more))
    begun = [
        records.keep(name, improve(finder.begin(stride), SPREAD, args.first))
        for name, stride in zip(firsts, STRIDES, strict=True)
    ]
    best = np.array(min(begun, key=lambda one: float(one["cost"]))["gait"])
    return records.keep(last, improve(best, args.spread, args.more))


def check_args(args: Args) -> None:
    """Check what the searches ask for, before the first of them; `ParameterError` if something is amiss."""
    for kind in args.gaits:
        check_choice("--gaits", kind, ("walk", "trot"))
    if len(args.froude) != len(args.gaits):
        raise ParameterError(
            f"--froude: expected {len(args.gaits)} Froude numbers, one for each of {' '.join(args.gaits)},"
            f" got {len(args.froude)}"
        )
    for froude in args.froude:
        check_number("--froude", froude, low=0, exclusive_low=True)
    check_choice("--criterion", args.criterion, CRITERIA)
    for name in ("first", "more", "starts"):
        count(f"--{name}", getattr(args, name))
    count("--seed", args.seed, low=0)
    if args.begin is not None:
        for kind in args.gaits:
            begun_gait(args.begin, kind)
    for path in (args.out, args.shipped):
        check_folder(path.parent)


def main(argv: list[str] | None = None) -> None:
    """Find gaits."""
    args = parse(Args, argv, "python -m agents.kinematic_gaits", __doc__)
    check_args(args)
    records = Records(args.out)
    asked = [name for one in zip(args.gaits, args.froude, strict=True) for name in searches_of(*one, args)]
    records.tell(asked)
    shipped = {}
    for kind, froude in zip(args.gaits, args.froude, strict=True):
        found = find(kind, froude, args, records)
        # A gait is filed under the speed that it reaches
        speed = round(found["reached"], 3)
        # Films and diagrams show names, which the search does not see
        gait = named(kind, np.array(found["gait"]), speed)
        phase = phase_of(gait, speed)
        start = {} if phase is None else {"phase": phase}
        shipped[f"kinematic-{kind}"] = {"speed": speed, **start, "gait": gait.tolist()}
    runs.write_text(args.shipped, json.dumps(shipped, indent=1) + "\n")
    print(f"written: {args.out}, {args.shipped}")


if __name__ == "__main__":
    run(main)
