"""How far a leg is from the paper: errors of its rows in bars, shortages of its plausibility, and one cost.

`Objective` measures a vector x (see `leg.NAMES`) by kinematics alone, a revolution for each gait, and on
demand once more through the paper's solver. The arithmetic is in kernels (`measure`), arrays are kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import HoofEnvError, ParameterError, check_choice, check_number
from hoof_env.ground.contact import Ground
from hoof_env.paper.rows import ILL_CONDITIONED
from research.identify.demands import BOTH, LEG, LEG_DEMANDS, MEASURED, WALK_DEMANDS, demands
from research.identify.features import FEATURES, TOPS
from research.identify.leg import LEVEL, OFFSET, Choice, check_vector
from research.identify.measure import (
    MISSED,
    MISSED_ROW,
    PAPER_SAMPLES,
    Setup,
    measure_exact,
    measure_paper,
    new_arrays,
    new_bodies,
    rate_demands,
    rate_rows,
)
from research.identify.minimax import Rating
from research.identify.motion import NUMBER, STEPS
from research.identify.targets import Targets, load_targets

Array = NDArray[np.float64]

INSIDE = 0.01
"""By how much `rate` asks for more than a demand, because a descent ends on the border of it [bars].
Those that cannot be exceeded are 0 where they are met."""

ALPHA = 15.0
BETAS = {"printed": math.sqrt(2 * ALPHA), "probable": math.sqrt(2) * ALPHA}
"""Baumgarte's alpha of the paper's solver [1/s], and its beta as Table 1 prints it, sqrt(2 alpha), and as it
is probably meant, sqrt(2) alpha [1/s]."""


@dataclass(frozen=True)
class Standing:
    """How far a candidate is from its goal.

    Attributes:
        within, of: rows within their bar, and rows that have one.
        worst, error: the row that is furthest out, and its error in bars.
        short: the sum of the plausibility shortages, 0 if there is none.
    """

    within: int
    of: int
    worst: str
    error: float
    short: float

    @property
    def met(self) -> bool:
        """Every row is within its bar and nothing falls short."""
        return self.within == self.of and self.short <= 0

    def __str__(self) -> str:
        parts = [f"{self.within} of {self.of} rows within their bars"]
        if self.within < self.of:
            parts.append(f"worst {self.worst} {self.error:+.2f} bars")
        if self.short > 0:
            parts.append(f"plausibility short by {self.short:.2g}")
        return ", ".join(parts)


class _Measured:
    """Every measured number in one array, and the same as records for the kernels: leg, (walk, run), both."""

    def __init__(self) -> None:
        self.flat = np.full(len(MEASURED), np.nan)
        leg, gait = len(LEG.names or ()), len(FEATURES.names or ())
        parts = np.split(self.flat, [leg, leg + 2 * gait])
        self.records = parts[0].view(LEG)[0], parts[1].view(FEATURES), parts[2].view(BOTH)[0]


class Objective:
    """What a search minimises for one choice. One object serves one thread.

    Args:
        choice: assembly and law of the legs.
        targets: rows, bars and weights; the paper's own if None. A row without a bar does not count.
        samples: instants a revolution of the exact solver.
        paper_solver: the cost counts the paper's solver too, all rows but `ILL_CONDITIONED` and all demands
            on its gaits.
        walk: "walks", the sole goes back under load, or "brakes", the ground pushes back through stance.
        by_toe: x holds instead of the hip's height the time [s] at which the toe touches down in walking, and
            instead of the walk's offset the logarithm of the toe's approach speed there [log m/s]; level and
            offset follow: for searches. That contact grazes: a tenth of a millimetre of height, or a
            milliradian, is a large step of the inelastic force. See `to_touch_down`, `from_touch_down`.
        beta: Baumgarte's, of the paper's solver, a key of `BETAS`.

    Attributes:
        row_ids: the rows that `rows` gives, in order. demands: likewise of `plausibility`.

    Raises:
        ParameterError: a value out of range, or no row with a bar.
    """

    def __init__(
        self,
        choice: Choice,
        targets: Targets | None = None,
        *,
        samples: int = 201,
        paper_solver: bool = False,
        walk: str = "walks",
        by_toe: bool = False,
        beta: str = "probable",
    ) -> None:
        check_choice("walk", walk, WALK_DEMANDS)
        check_choice("beta", beta, BETAS)
        samples = int(check_number("samples", samples, low=21, high=100_001))
        self.choice, self.paper_solver = choice, bool(paper_solver)
        self._settings = {"targets": targets, "samples": samples, "walk": walk, "beta": beta}
        self._read_targets(load_targets() if targets is None else targets)
        self._read_demands(walk)
        signs = iter(choice.assembly)
        self._setup = Setup(
            np.array([float(next(signs)) if step[0] == 1 else 0.0 for step in STEPS]),
            float(choice.travel), NUMBER[choice.toe], NUMBER[choice.heel],
            Ground().stiffness, choice.exponent, ALPHA, BETAS[beta], bool(by_toe),
        )  # fmt: skip
        self._arrays, self._paper_arrays = new_arrays(samples), new_arrays(PAPER_SAMPLES)
        self._bodies, self._exact, self._paper = new_bodies(), _Measured(), _Measured()

    def _read_targets(self, targets: Targets) -> None:
        pairs = zip(targets.rows, targets.weights, strict=True)
        chosen = [(row, weight) for row, weight in pairs if row.bar.limit is not None]
        if not chosen:
            raise ParameterError("targets: expected at least one row with a bar")
        self.row_ids = tuple(row.id for row, _ in chosen)
        where = np.array([MEASURED.index(row.id.replace("ratio.", "both.")) for row, _ in chosen])
        target = np.array([row.value for row, _ in chosen])
        limits = [row.bar.error(row.value + 1.0, row.value) / (row.bar.limit or 1.0) for row, _ in chosen]
        self._row = where, target, np.array(limits)
        self._weight = np.array([float(weight) for _, weight in chosen])
        self._counts = ~np.isin(self.row_ids, ILL_CONDITIONED)
        self._paper_weight = np.where(self._counts, self._weight, 0.0)
        self._errors = np.empty(len(chosen))

    def _read_demands(self, walk: str) -> None:
        wanted = demands(walk)
        self.demands = tuple(demand.name for demand in wanted)
        if self.paper_solver:
            self.demands += tuple(f"paper.{demand.name}" for demand in wanted[len(LEG_DEMANDS) :])
        self._shortages = np.empty(len(self.demands))
        columns = (
            np.array([MEASURED.index(demand.measured) for demand in wanted]),
            *np.array([(float(d.sense), d.bound, d.scale) for d in wanted]).T.copy(),
        )
        of_gaits = tuple(column[len(LEG_DEMANDS) :] for column in columns)
        self._demand: tuple[Any, ...] = (*columns, self._shortages[: len(wanted)])
        self._paper_demand: tuple[Any, ...] = (*of_gaits, self._shortages[len(wanted) :])

    def _measure(self, x: Array, paper: bool) -> None:
        self._exact.flat[:] = np.nan
        measure_exact(x, self._setup, self._arrays, *self._exact.records)
        if paper:
            self._paper.flat[:] = np.nan
            height, records = self._exact.records[0]["hip_height"], self._paper.records[1:]
            measure_paper(x, height, self._setup, self._arrays, self._bodies, self._paper_arrays, *records)

    def _rate_rows(self, measured: Array, weights: Array) -> float:
        return rate_rows(measured, *self._row, weights, self._errors)

    def _rate_demands(self) -> float:
        cost = rate_demands(self._exact.flat, *self._demand)
        if self.paper_solver:
            cost += rate_demands(self._paper.flat, *self._paper_demand)
        return cost

    def cost(self, x: Array) -> float:
        """Weighted cost of rows and demands; 0: every error within `DEAD_ZONE`, no shortage."""
        self._measure(x, self.paper_solver)
        cost = self._rate_rows(self._exact.flat, self._weight)
        if self.paper_solver:
            cost += self._rate_rows(self._paper.flat, self._paper_weight)
        return cost + self._rate_demands()

    def rate(self, x: Array) -> Rating:
        """What `minimax.descend` improves: all rows and demands with their signs.

        The inelastic force of walking has up to three peaks of much the same height, and a leg as many dyads:
        each sample and each dyad is a limit of its own, so that none turns up only when it is the highest.
        """
        self._measure(x, self.paper_solver)
        self._rate_rows(self._exact.flat, self._weight)
        rows, shortages = self._errors.copy(), [_signed(self._exact.flat, self._demand), self._dyads()]
        shortages[0][self.demands.index("transmission")] = -np.inf
        peaks = {}
        force = np.maximum(self._arrays.work[0, TOPS], 1.0)
        for name, values in (
            ("walk.peak_inelastic", force),
            ("walk.reduction", 100 * (1 - self._exact.records[1][0]["peak_elastic"] / force)),
        ):
            if name in self.row_ids:
                row, (_, target, per_unit) = self.row_ids.index(name), self._row
                errors = (values - target[row]) * per_unit[row]
                peaks[row] = np.where(np.isfinite(errors), errors, MISSED_ROW)
                rows[row] = peaks[row].max()
        if self.paper_solver:
            self._rate_rows(self._paper.flat, self._weight)
            rows = np.append(rows, self._errors[self._counts])
            shortages.append(_signed(self._paper.flat, self._paper_demand))
        short = np.concatenate(shortages)
        return Rating(rows, np.where(short == 0.0, 0.0, short + INSIDE), peaks)

    def _dyads(self) -> Array:
        """Shortage of each dyad's transmission; that of the leg is the largest of these."""
        at, demand = self._arrays.z, self.demands.index("transmission")
        _, sense, bound, scale = (column[demand] for column in self._demand[:4])
        dyads = STEPS[STEPS[:, 0] == 1]
        one, two = (at[dyads[:, 1]] - at[dyads[:, i]] for i in (2, 3))
        sine = np.abs((one.conj() * two).imag) / (np.abs(one) * np.abs(two) + 1e-12)
        return _finite(sense * (bound - sine.min(axis=1)) * scale)

    def rows(self, x: Array) -> Array:
        """Signed errors in bars, shape (rows,), with the exact solver; `MISSED_ROW` if there is no value."""
        self._measure(check_vector(x), False)
        self._rate_rows(self._exact.flat, self._weight)
        return self._errors.copy()

    def paper_rows(self, x: Array) -> Array:
        """The same with the paper's solver."""
        self._measure(check_vector(x), True)
        self._rate_rows(self._paper.flat, self._weight)
        return self._errors.copy()

    def errors(self, x: Array) -> dict[str, float]:
        """Signed errors in bars by the id of the row, those that count; "paper." before one of the paper's
        solver."""
        errors = dict(zip(self.row_ids, self.rows(x).tolist(), strict=True))
        if self.paper_solver:
            paper = zip(self.row_ids, self.paper_rows(x).tolist(), self._counts, strict=True)
            errors |= {f"paper.{name}": error for name, error, counts in paper if counts}
        return errors

    def plausibility(self, x: Array) -> dict[str, float]:
        """Shortages above 0 by name of the demand; with "paper." before one of the paper's solver."""
        self._measure(check_vector(x), self.paper_solver)
        self._rate_demands()
        shortages = zip(self.demands, self._shortages.tolist(), strict=True)
        return {name: shortage for name, shortage in shortages if shortage > 0}

    def standing(self, x: Array) -> Standing:
        """Where a candidate stands."""
        errors = self.errors(x)
        worst = max(errors, key=lambda name: abs(errors[name]))
        within = sum(abs(error) <= 1 for error in errors.values())
        return Standing(within, len(errors), worst, errors[worst], float(sum(self.plausibility(x).values())))

    def measured(self, x: Array, *, paper_solver: bool = False) -> dict[str, float]:
        """Every number of `demands.MEASURED` by name, NaN where there is none."""
        self._measure(check_vector(x), paper_solver)
        flat = (self._paper if paper_solver else self._exact).flat
        return dict(zip(MEASURED, flat.tolist(), strict=True))

    def to_touch_down(self, x: Array) -> Array:
        """x as a search with `by_toe` has it.

        Raises:
            HoofEnvError: the toe does not touch down in walking.
        """
        measured = Objective(self.choice, **self._settings).measured(x)
        time = measured["walk.contact_start"] + max(measured["walk.toe_after_heel_in"], 0.0)
        if not (0 <= time <= 1 and measured["walk.toe_speed"] > 0):
            raise HoofEnvError("expected a walk whose toe touches down, got one whose toe stays in the air")
        return with_toe(x, time, math.log(measured["walk.toe_speed"]))

    def from_touch_down(self, y: Array) -> Array:
        """Inverse of `to_touch_down`, of a walk whose toe comes in once."""
        by_toe = Objective(self.choice, by_toe=True, **self._settings)
        height = by_toe.measured(y)["leg.hip_height"]
        return with_toe(y, height, float(by_toe._arrays.gaits[0, 1]))


def with_toe(x: Array, level: float, offset: float) -> Array:
    """x with the two entries that `by_toe` replaces."""
    changed = np.array(x, dtype=np.float64)
    changed[LEVEL], changed[OFFSET] = level, offset
    return changed


def _signed(measured: Array, demand: tuple[Any, ...]) -> Array:
    """Shortages, below 0 where satisfied."""
    where, sense, bound, scale, _ = demand
    return _finite(sense * (bound - measured[where]) * scale)


def _finite(shortages: Array) -> Array:
    return np.where(np.isfinite(shortages), shortages, MISSED)
