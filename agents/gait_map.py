"""Search for the horse's best gaits over speed: with the lag of a walk, with that of a trot, and with any.

At each of `FROUDES` and for each of `OBJECTIVES` CMA-ES looks for the gait that spares most: work, peak
force, loading, or all three. Of a horse's kinematics it is given the length of the stride, which does not
jump where a horse changes gait, and the lag by kind. Duty factors and number of peaks are free, and no figure
of a horse's forces enters. What gaits need so that figures count is `NEEDED` of
`agents.gait_costs`.

Walks begin with the stored kinematic walk and go on to slower and faster ones, trots likewise. At each speed
the mixture comes first, and the others go on from it. A search with any lag goes on from the best walk or
trot of its speed and objective.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.evolution import make_strategy, require
from agents.gait_box import decode, encode
from agents.gait_costs import misses_of
from agents.gait_figures import froude_of
from agents.gait_rig import Rig
from agents.horse_gaits import speed_of
from agents.judges import Bars, read_judges
from agents.kept import check_numbers, read_kept
from agents.limb_names import within_quarter
from agents.rules import rejection_reason
from hoof_env.errors import brief
from hoof_env.tasks.horse import HIP_HEIGHT
from hoof_env.tasks.horse_gaits import NAMES, horse_gaits, kinematic_speeds

Floats = NDArray[np.float64]

FROUDES = (0.1, 0.15, 0.2, 0.275, 0.35, 0.45, 0.6, 0.8, 1.1, 1.5, 2.0, 2.75)
KINDS = {"walk": 0.2, "trot": 0.8}
"""Kinds of gaits, and the Froude number with which the search for each begins: about its stored gait's."""
FREE = "free"
SCALES = {"transport": 1.0, "peak": 1.0, "loading": 30.0}
"""Scales of what is spared, about those of the kinematic gaits: positive work of the drives over weight and
distance [-], mean of the stances' peaks over the weight [-] and of their steepest rises [1/s]."""
MIXTURE = "mixture"
OBJECTIVES = {
    MIXTURE: ("transport", "peak", "loading"),
    "work": ("transport",),
    "peak": ("peak",),
    "loading": ("loading",),
}
"""What is spared: the mean of these figures over their `SCALES`."""
TITLES = {"work": "work", "peak": "peak force", "loading": "loading", "mixture": "mixture"}
CHANGES = {"walk to trot": (0.35, 0.5), "trot to canter": (2.0, 3.0)}
"""Froude numbers at which horses change gait: from walk to trot Griffin and others (2004) print 0.35 at any
size, and foals change at 0.37 to 0.69 (doi 10.1016/j.jbiomech.2025.113078)."""
JUMP = 0.1  # smallest change of the lag from one speed to the next that is one of gait [strides]
CLOSE = 0.02  # least difference of what is spared that makes one gait better than another, relative
SINGLE = [name for name in OBJECTIVES if name != MIXTURE]
PRICE = 10.0  # cost of an objective of 1
FALL = 20.0  # cost of a gait that always falls

STRIDE = (1.66, 0.215)
"""Stride of a horse at Froude number 1 [hip heights], and the power of the Froude number with which it grows:
fitted to the published 1.43 at 0.5 and 1.66 at 1 (Bullimore and Burn 2006); at 0.25 it is 1.23."""
STRIDE_BAR = 0.15  # half the width of the range that is given [hip heights]


@dataclass(frozen=True)
class Effort:
    """Size of a search: candidates of a generation, starts of each, generations from a gait of another
    speed, and from one of this speed."""

    population: int
    starts: int
    far: int
    near: int


FIRST = Effort(16, 3, 60, 24)  # for the mixture
EACH = Effort(12, 2, 50, 20)  # for each of the others
SPREAD = 0.03  # of a search from a gait of another speed, in the box
NEAR = 0.03  # of one from a gait of this speed
SECONDS = 4.0  # of a start
SETTLED = 1.5  # from which on figures count [s]
FINALISTS = 2  # best candidates for each objective, and known gaits, beside the found ones in the end
CHECKED = 24  # starts by which a found gait is measured

FIGURES = (
    "reached",
    "fell",
    "speed_ratio",
    "slip_fore",
    "slip_hind",
    "stances_per_turn_fore",
    "stances_per_turn_hind",
    "stride_over_hip",
    "duty_fore",
    "duty_hind",
    "lag",
    "transport",
    "peak",
    "loading",
)
"""Figures of a found gait that are kept."""


def stride_at(froude: float) -> float:
    """Return the stride of a horse at a Froude number [hip heights]."""
    length, power = STRIDE
    return length * froude**power


def bars_of(kind: str, froude: float) -> Bars:
    """Return what a search for gaits of a kind is given at a Froude number."""
    stride = stride_at(froude)
    bars: Bars = {"stride_over_hip": [(stride - STRIDE_BAR, stride + STRIDE_BAR)]}
    if kind != FREE:
        bars["lag"] = [tuple(read_judges()[kind]["lag"]["bar"])]
    return bars


def value_of(figures: dict[str, Any], objective: str) -> Any:
    """Return what is spared [-]: the mean of an objective's figures over their scales."""
    names = OBJECTIVES[objective]
    return sum(figures[name] / SCALES[name] for name in names) / len(names)


def turned(lag: float, least: float = -0.1) -> float:
    """Return a lag within half a stride from the least one on [strides]: half a stride more is the same."""
    return (lag - least) % 0.5 + least


def apart(a: float, b: float) -> float:
    """Return by how much one lag is larger than another, from -0.25 to 0.25 [strides]."""
    return (a - b + 0.25) % 0.5 - 0.25


def jumps_between(lags: Sequence[tuple[float, float]]) -> list[tuple[float, float, float, float]]:
    """Return where a lag jumps, of pairs of a Froude number and a lag [strides]: two Froude numbers, and the
    lags at them."""
    return [
        (a, b, before, after)
        for (a, before), (b, after) in pairwise(lags)
        if abs(apart(after, before)) > JUMP
    ]


def costs_of(figures: dict[str, Floats], kind: str, objective: str, froude: float) -> Floats:
    """Return the cost of gaits, shape (m,): what they miss and what they do not spare."""
    # Without an upright episode there is no figure
    spared = np.nan_to_num(value_of(figures, objective), nan=10.0)
    costs: Floats = misses_of(figures, bars_of(kind, froude), FALL) + PRICE * spared
    return costs


def stands(figures: dict[str, Any], kind: str, froude: float) -> bool:
    """Return True if a gait's figures count, and as of its kind, with the stride that was given."""
    ours = float(figures["lag"])
    for low, high in bars_of(kind, froude).get("lag", []):
        middle = (low + high) / 2
        if abs((ours - middle + 0.25) % 0.5 - 0.25) > (high - low) / 2:
            return False
    # Written so that NaN is a reason, too
    keeps_stride = bool(abs(figures["stride_over_hip"] - stride_at(froude)) <= 2 * STRIDE_BAR)
    return keeps_stride and not rejection_reason(figures)


def paced(gaits: Floats, froude: float, before: float) -> Floats:
    """Return gaits of one Froude number for another, shape (3 m, 16): as they are, with the rate that keeps
    their strides, and with that of a horse's stride, within the box of the search."""
    speed = speed_of(froude)
    kept, own = gaits.copy(), gaits.copy()
    kept[:, 0] *= speed / speed_of(before)
    own[:, 0] = 2 * np.pi * speed / (stride_at(froude) * HIP_HEIGHT)
    return decode(encode(np.concatenate([gaits, kept, own])))


def order_of(kind: str) -> list[tuple[float, float | None]]:
    """Return Froude numbers in the order of the searches for a kind, each with the neighbour from which it
    goes on."""
    begin = KINDS[kind]
    up = [froude for froude in FROUDES if froude >= begin]
    down = [froude for froude in FROUDES[::-1] if froude <= begin]
    first: list[tuple[float, float | None]] = [(begin, None)]
    return first + [(there, here) for way in (up, down) for here, there in pairwise(way)]


def rows_of_file(content: Any) -> tuple[dict[str, str], list[dict[str, Any]]]:
    """Return the versions with which gaits were found, and the gaits, of a file's content; raise KeyError,
    TypeError or ValueError for another file's."""
    rows = [dict(zip(content["columns"], row, strict=True)) for row in content["rows"]]
    for k, row in enumerate(rows):
        check_numbers(f"row {k}", row, ("froude", "seed", "wall_s", *NAMES))
        check_numbers(f"row {k}", row, FIGURES, missing=True)
        for name, known in (("kind", (*KINDS, FREE)), ("objective", OBJECTIVES), ("froude", FROUDES)):
            if row[name] not in known:
                raise ValueError(f"{name} of row {k} is {brief(row[name])}")
    return dict(content["versions"]), rows


class Map:
    """Found gaits in a file, which is written after each speed of each seed.

    Args:
        path: the file; one that exists is gone on with.

    Raises:
        DataFileError: it exists and is no such file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.about: dict[str, str] = {}
        self.rows: list[dict[str, Any]] = []
        if path.is_file():
            self.about, self.rows = read_kept(path, "gaits that agents.gait_change found", rows_of_file)

    def at(self, froude: float, seed: int, kinds: Sequence[str]) -> list[dict[str, Any]]:
        """Return what a seed found at a Froude number with gaits of some kinds."""
        return [
            row
            for row in self.rows
            if row["froude"] == froude and row["seed"] == seed and row["kind"] in kinds
        ]

    def keep(self, rows: list[dict[str, Any]]) -> None:
        """Add rows and write the file."""
        self.rows += rows
        self.about = self.about or runs.versions()
        columns = [*self.rows[0]]
        lines = [json.dumps([row[name] for name in columns]) for row in self.rows]
        head = f'{{"versions": {json.dumps(self.about)},\n"columns": {json.dumps(columns)},\n"rows": [\n'
        self.path.parent.mkdir(parents=True, exist_ok=True)
        runs.write_text(self.path, head + ",\n".join(lines) + "\n]}\n")


class Leading:
    """The cheapest of candidates, `FINALISTS` at most."""

    def __init__(self) -> None:
        self.gaits: list[Floats] = []
        self.costs: list[float] = []

    def see(self, gaits: Floats, costs: Floats) -> None:
        """Take candidates, shape (m, 16), and their costs, shape (m,), into account."""
        known = [*zip(self.costs, self.gaits, strict=True), *zip(costs.tolist(), gaits, strict=True)]
        first = sorted(known, key=lambda one: one[0])[:FINALISTS]
        self.costs = [cost for cost, _ in first]
        self.gaits = [gait for _, gait in first]


class Searcher:
    """Searches for the gaits of one seed.

    Args:
        seed: of the searches and their episodes.
        first, each: sizes of the searches for the mixture and for the others.
        **settings: arguments of the environment.
    """

    def __init__(self, seed: int, first: Effort = FIRST, each: Effort = EACH, **settings: Any) -> None:
        require("agents.gait_change", "cma")
        # Threads cost more than they bring for so few horses
        settings = {"num_threads": 1, **settings}
        self.seed = seed
        self.first = first
        self.each = each
        self.few = Rig(first.population * first.starts, **settings)
        self.many = Rig(len(SINGLE) * each.population * each.starts, **settings)
        self.played = 0

    def play(self, rig: Rig, gaits: Floats, froude: float, starts: int) -> dict[str, Floats]:
        """Return figures of gaits, shape (m, 16), from starts that are others in every call."""
        self.played += 1
        seed = 200_000_000 + 10_000_000 * self.seed + 32 * self.played
        return rig.play(gaits, speed_of(froude), seed, starts, SECONDS, SETTLED)

    def search(self, kind: str, froude: float, known: Floats, is_near: bool) -> list[dict[str, Any]]:
        """Return the best gaits of a kind at a Froude number, as a row for each objective.

        Args:
            kind: one of `KINDS`, or `FREE`.
            froude: Froude number.
            known: gaits from which the search goes on, shape (m, 16).
            is_near: True if they are of this Froude number.
        """
        began = time.monotonic()
        # Starts and draws depend on seed, kind and speed alone, so that a search that goes on finds the same
        place = [*KINDS, FREE].index(kind) * len(FROUDES) + FROUDES.index(froude)
        self.played = 1000 * place
        number = 1 + len(OBJECTIVES) * (self.seed * 1000 + place)
        spread = NEAR if is_near else SPREAD
        first, each = self.first, self.each

        def cost(figures: dict[str, Floats], objective: str) -> Floats:
            return costs_of(figures, kind, objective, froude)

        # The mixture
        figures = self.play(self.few, known, froude, first.starts)
        ranks = np.argsort(cost(figures, MIXTURE))
        best, finalists = known[ranks[0]], known[ranks[:FINALISTS]]
        # Candidates of one objective are candidates of all
        leading = {objective: Leading() for objective in OBJECTIVES}

        def seen(gaits: Floats, figures: dict[str, Floats]) -> None:
            for objective, of_objective in leading.items():
                of_objective.see(gaits, cost(figures, objective))

        strategy = make_strategy(encode(best[None])[0], spread, first.population, number)
        for _ in range(first.near if is_near else first.far):
            points = strategy.ask()
            gaits = decode(np.array(points))
            figures = self.play(self.few, gaits, froude, first.starts)
            seen(gaits, figures)
            strategy.tell(points, cost(figures, MIXTURE).tolist())
        found = [strategy.result.xfavorite]
        # The others, side by side
        begin = np.concatenate([known, decode(found[0][None])])
        figures = self.play(self.many, begin, froude, each.starts)
        strategies = []
        for k, objective in enumerate(SINGLE):
            best = begin[int(np.argmin(cost(figures, objective)))]
            strategies.append(make_strategy(encode(best[None])[0], NEAR, each.population, number + 1 + k))
        for _ in range(each.near if is_near else each.far):
            asked = [one.ask() for one in strategies]
            gaits = decode(np.concatenate(asked))
            figures = self.play(self.many, gaits, froude, each.starts)
            seen(gaits, figures)
            for k, objective in enumerate(SINGLE):
                own = slice(k * each.population, (k + 1) * each.population)
                of_one = {name: values[own] for name, values in figures.items()}
                strategies[k].tell(asked[k], cost(of_one, objective).tolist())
        found += [one.result.xfavorite for one in strategies]
        # Means of the distributions, and what may be better: a candidate may have been lucky
        best_seen = [gait for one in leading.values() for gait in one.gaits]
        finalists = np.concatenate([decode(np.array(found)), best_seen, finalists]).round(4)
        figures = self.play(self.many, finalists, froude, self.many.envs.num_envs // len(finalists))
        best_of = [int(np.argmin(cost(figures, objective))) for objective in OBJECTIVES]
        return self.rows(kind, froude, finalists[best_of], time.monotonic() - began)

    def rows(self, kind: str, froude: float, gaits: Floats, seconds: float) -> list[dict[str, Any]]:
        """Return the gaits of all objectives, shape (4, 16), with their figures over starts of their own."""
        starts = min(CHECKED, self.many.envs.num_envs // len(gaits))
        figures = self.many.play(gaits, speed_of(froude), 10**9, starts)
        rows = []
        for k, objective in enumerate(OBJECTIVES):
            of_gait = {name: round(float(figures[name][k]), 4) for name in FIGURES}
            rows.append(
                {"froude": froude, "seed": self.seed, "kind": kind, "objective": objective}
                | {name: None if np.isnan(value) else value for name, value in of_gait.items()}
                | {"wall_s": round(seconds, 1)}
                | dict(zip(NAMES, gaits[k].tolist(), strict=True))
            )
        return rows


def gaits_of(rows: Sequence[dict[str, Any]]) -> Floats:
    """Return the numbers of kept gaits, shape (m, 16)."""
    return np.array([[row[name] for name in NAMES] for row in rows])


def stands_of(row: dict[str, Any], kind: str | None = None) -> bool:
    """Return True if a kept gait counts as of its kind, or of another."""
    figures = {name: np.nan if row[name] is None else row[name] for name in FIGURES}
    return stands(figures, kind or row["kind"], row["froude"])


def search_all(path: Path, seeds: int, first: Effort = FIRST, each: Effort = EACH) -> Map:
    """Search at all speeds with each of some seeds, leaving out what is in the file; return the map."""
    found = Map(path)
    order = [(kind, froude, near) for kind in KINDS for froude, near in order_of(kind)]
    order += [(FREE, froude, froude) for froude in FROUDES]
    all_of_them = [(seed, *one) for seed in range(seeds) for one in order]
    to_do = [one for one in all_of_them if not found.at(one[2], one[0], [one[1]])]
    print(f"{path}: has {len(all_of_them) - len(to_do)} of {len(all_of_them)} searches", flush=True)
    if to_do:
        spent = [row["wall_s"] for row in found.rows]
        each_takes = f"about {np.mean(spent) / 60:.0f} minutes each" if spent else "minutes each"
        print(f"{len(to_do)} searches to do, {each_takes}; Ctrl-C loses the present one alone", flush=True)
    searcher: Searcher | None = None
    for number, (seed, kind, froude, near) in enumerate(to_do, 1):
        if searcher is None or searcher.seed != seed:
            searcher = Searcher(seed, first, each)
        if near is None:
            stored = within_quarter(horse_gaits()[f"kinematic-{kind}"].to_array()[None])
            known = paced(stored, froude, froude_of(kinematic_speeds()[f"kinematic-{kind}"], HIP_HEIGHT))
        elif kind == FREE:
            known = gaits_of(found.at(froude, seed, [*KINDS]))
        else:
            known = paced(gaits_of(found.at(near, seed, [kind])), froude, near)
        rows = searcher.search(kind, froude, known, near == froude)
        found.keep(rows)
        standing = sum(stands_of(row) for row in rows)
        place = f"{number} of {len(to_do)}: seed {seed}, {kind}, Froude number {froude:g}"
        print(f"{place}: {standing} of {len(rows)} gaits count", flush=True)
    return found
