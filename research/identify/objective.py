"""How far a leg is from the paper: errors of its rows in bars, shortages of its plausibility, and one cost.

`Objective` measures a vector x (see `candidate.names`) by kinematics alone, a revolution for each gait, and
on demand once more through the paper's solver. The arithmetic is in kernels (`evaluate`), arrays are kept.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import HoofEnvError, ParameterError, check_choice, check_number
from hoof_env.leg.linkage import BODIES, POINTS
from hoof_env.paper.rows import ILL_CONDITIONED as ILL_CONDITIONED
from research.identify.candidate import SPEED, Choice, check_vector, names
from research.identify.cycle import DYAD
from research.identify.evaluate import (
    MISSED,
    MISSED_ROW,
    construction,
    measure_exact,
    measure_paper,
    rate_demands,
    rate_rows,
)
from research.identify.features import FEATURES, TOPS
from research.identify.minimax import Rating
from research.identify.plausibility import BOTH, LEG, LEG_DEMANDS, MEASURED, WALK_DEMANDS, demands
from research.identify.targets import Targets, load_targets

Array = NDArray[np.float64]

INSIDE = 0.01
"""By how much `rate` asks for more than a demand, because a descent ends on the border of it [bars].
Those that cannot be exceeded are 0 where they are met."""

LEVEL = 17
"""Where x holds the hip's height."""

BETAS = {"printed": math.sqrt(2 * 15.0), "probable": math.sqrt(2) * 15.0}
"""Baumgarte's beta of the paper's solver as Table 1 prints it, sqrt(2 alpha), and as it is probably meant,
sqrt(2) alpha [1/s]."""

PAPER_SAMPLES = 1001
"""Instants of the paper's solver in its one second."""


class _Measured:
    """Every measured number in one array, and the same as records for the kernels: leg, (walk, run), both."""

    def __init__(self) -> None:
        self.flat = np.full(len(MEASURED), np.nan)
        leg, gait = len(LEG.names or ()), len(FEATURES.names or ())
        parts = np.split(self.flat, [leg, leg + 2 * gait])
        self.records = parts[0].view(LEG)[0], parts[1].view(FEATURES), parts[2].view(BOTH)[0]


class Objective:
    """What a search minimises for one choice. It pickles, and one object serves one thread.

    Args:
        choice: assembly and law of the legs.
        targets: rows, bars and weights; the paper's own if None. A row without a bar does not count.
        samples: instants a revolution of the exact solver.
        paper_solver: the cost counts the paper's solver too, all rows but `ILL_CONDITIONED` and all demands
            on its gaits. Only where the full system has the leg: link 9 at "F" and swing "crank".
        walk: "walks", the sole goes back under load, or "brakes", the ground pushes back through stance.
        by_toe: x holds instead of the hip's height the time [s] at which the toe touches down in walking, and
            instead of the walk's offset the logarithm of the toe's approach speed there [log m/s]; level and
            offset follow: for searches. That contact grazes: a tenth of a millimetre of height, or a
            milliradian, is a large step of the inelastic force. See `to_touch_down`, `from_touch_down`.
        stiffness: of Eq. 14 [N/m^n].
        beta: Baumgarte's, of the paper's solver [1/s].

    Attributes:
        row_ids: the rows that `rows` gives, in order. demands: likewise of `plausibility`.

    Raises:
        ParameterError: a value out of range. HoofEnvError: the paper's solver for a variant that it lacks.
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
        stiffness: float = 2e4,
        beta: float = BETAS["probable"],
    ) -> None:
        self._settings: dict[str, Any] = {
            "choice": choice, "targets": targets, "samples": samples, "paper_solver": paper_solver,
            "walk": walk, "by_toe": by_toe, "stiffness": stiffness, "beta": beta,
        }  # fmt: skip
        self.choice, self.paper_solver, self.by_toe = choice, bool(paper_solver), bool(by_toe)
        self.names = names(choice)
        check_choice("walk", walk, WALK_DEMANDS)
        if paper_solver:
            self._check_simulable()
        n = int(check_number("samples", samples, low=21, high=100_001))
        self._law = (
            check_number("stiffness", stiffness, low=0, exclusive_low=True),
            choice.exponent,
        )
        self._beta = check_number("beta", beta, low=0)
        self._read_targets(load_targets() if targets is None else targets)
        self._read_demands(walk)
        self._build(n)

    def _check_simulable(self) -> None:
        if not self.choice.simulable:
            raise HoofEnvError(
                f"the paper's solver knows link 9 at 'F' and swing 'crank' only, got {self.choice.link9!r} "
                f"and {self.choice.swing!r}"
            )

    def _read_targets(self, targets: Targets) -> None:
        chosen = [
            (row, weight)
            for row, weight in zip(targets.rows, targets.weights, strict=True)
            if row.bar.limit is not None
        ]
        if not chosen:
            raise ParameterError("targets: expected at least one row with a bar")
        self.row_ids = tuple(row.id for row, _ in chosen)
        self._row = np.array([MEASURED.index(row.id.replace("ratio.", "both.")) for row, _ in chosen])
        self._target = np.array([row.value for row, _ in chosen])
        self._per_unit = np.array(
            [row.bar.error(row.value + 1.0, row.value) / (row.bar.limit or 1.0) for row, _ in chosen]
        )
        self._weight = np.array([float(weight) for _, weight in chosen])
        self._paper_weight = np.where(np.isin(self.row_ids, ILL_CONDITIONED), 0.0, self._weight)
        self._errors = np.empty(len(chosen))

    def _read_demands(self, walk: str) -> None:
        all_demands = demands(walk)
        self.demands = tuple(d.name for d in all_demands)
        if self.paper_solver:
            self.demands += tuple(f"paper.{d.name}" for d in all_demands[len(LEG_DEMANDS) :])
        self._shortages = np.empty(len(self.demands))
        columns = (
            np.array([MEASURED.index(d.measured) for d in all_demands]),
            np.array([float(d.sense) for d in all_demands]),
            np.array([d.bound for d in all_demands]),
            np.array([d.scale for d in all_demands]),
        )
        count, gaits = len(all_demands), slice(len(LEG_DEMANDS), None)
        self._demand: tuple[Any, ...] = (*columns, self._shortages[:count])
        self._paper_demand: tuple[Any, ...] = (*(c[gaits] for c in columns), self._shortages[count:])

    def _build(self, n: int) -> None:
        choice = self.choice
        steps, sources = construction(choice)
        points = len(POINTS) + (choice.link9 in ("6", "7"))
        extras = {"6": 1, "7": 3}.get(choice.link9, 0)
        corners = float(choice.travel), POINTS.index(choice.toe), POINTS.index(choice.heel)
        values, gaits, ovals = np.zeros((len(steps), 7)), np.zeros((2, 4)), np.zeros((2, 2), np.complex128)
        gaits[:, 0] = SPEED
        self._exact, self._paper = _Measured(), _Measured()
        self._steps, self._gaits, self._work = steps, gaits, np.zeros((2, 7, n))
        self._points, rates = np.zeros((2, points, n), np.complex128)
        self._exact_arguments: tuple[Any, ...] = (
            np.array(choice.assembly, dtype=np.float64), steps, sources, extras,
            choice.swing == "pivot", choice.swing == "oval", *corners, *self._law, self.by_toe,
            values, gaits, ovals,
            self._points, rates, *np.zeros((2, 2, n), np.complex128),
            np.zeros(n), self._work, *self._exact.records,
        )  # fmt: skip
        m = PAPER_SAMPLES
        self._paper_arguments: tuple[Any, ...] = (
            steps, values, gaits, *corners, *self._law, self._beta,
            *np.zeros((2, len(BODIES), 3)), *np.zeros((2, 2, m), np.complex128),
            np.zeros(m), np.zeros((7, m)), *self._paper.records[1:],
        )  # fmt: skip

    def __getstate__(self) -> dict[str, Any]:
        return self._settings

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state)  # type: ignore[misc]

    def _measure(self, x: Array, paper: bool) -> None:
        self._exact.flat[:] = np.nan
        measure_exact(x, *self._exact_arguments)
        if paper:
            self._paper.flat[:] = np.nan
            measure_paper(x, self._exact.records[0]["hip_height"], *self._paper_arguments)

    def _rate_rows(self, measured: Array, weights: Array) -> float:
        return rate_rows(measured, self._row, self._target, self._per_unit, weights, self._errors)

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
        rows, demands = self._errors.copy(), [_signed(self._exact.flat, self._demand), self._dyads()]
        if self.choice.link9 != "7":  # whose triad has a transmission too
            demands[0][self.demands.index("transmission")] = -np.inf
        peaks = {}
        force = np.maximum(self._work[0, TOPS], 1.0)
        for name, values in (
            ("walk.peak_inelastic", force),
            ("walk.reduction", 100 * (1 - self._exact.records[1][0]["peak_elastic"] / force)),
        ):
            if name in self.row_ids:
                row = self.row_ids.index(name)
                errors = (values - self._target[row]) * self._per_unit[row]
                peaks[row] = np.where(np.isfinite(errors), errors, MISSED_ROW)
                rows[row] = peaks[row].max()
        if self.paper_solver:
            self._rate_rows(self._paper.flat, self._paper_weight)
            rows = np.append(rows, self._errors[self._paper_weight > 0])
            demands.append(_signed(self._paper.flat, self._paper_demand))
        shortages = np.concatenate(demands)
        return Rating(rows, np.where(shortages == 0.0, 0.0, shortages + INSIDE), peaks)

    def _dyads(self) -> Array:
        """Shortage of each dyad's transmission; that of the leg is the largest of these."""
        steps, at, demand = self._steps, self._points, self.demands.index("transmission")
        _, sense, bound, scale = (column[demand] for column in self._demand[:4])
        dyads = steps[steps[:, 0] == DYAD]
        one, two = (at[dyads[:, 1]] - at[dyads[:, i]] for i in (2, 3))
        sine = np.abs((one.conj() * two).imag) / (np.abs(one) * np.abs(two) + 1e-12)
        return _finite(sense * (bound - sine.min(axis=1)) * scale)

    def rows(self, x: Array) -> Array:
        """Signed errors in bars, shape (rows,), with the exact solver; `MISSED_ROW` if there is no value."""
        self._measure(check_vector(x, self.choice), False)
        self._rate_rows(self._exact.flat, self._weight)
        return self._errors.copy()

    def paper_rows(self, x: Array) -> Array:
        """The same with the paper's solver.

        Raises:
            HoofEnvError: a variant that the paper's solver lacks.
        """
        self._check_simulable()
        self._measure(check_vector(x, self.choice), True)
        self._rate_rows(self._paper.flat, self._paper_weight)
        return self._errors.copy()

    def plausibility(self, x: Array) -> Array:
        """Shortages, shape (demands,), 0 where satisfied; those of the paper's solver last, if it counts."""
        self._measure(check_vector(x, self.choice), self.paper_solver)
        self._rate_demands()
        return self._shortages.copy()

    def measured(self, x: Array, *, paper_solver: bool = False) -> dict[str, float]:
        """Every number of `plausibility.MEASURED` by name, NaN where there is none."""
        if paper_solver:
            self._check_simulable()
        self._measure(check_vector(x, self.choice), paper_solver)
        flat = (self._paper if paper_solver else self._exact).flat
        return dict(zip(MEASURED, flat.tolist(), strict=True))

    def to_touch_down(self, x: Array) -> Array:
        """x as a search with `by_toe` has it.

        Raises:
            HoofEnvError: the toe does not touch down in walking.
        """
        found = self._other(by_toe=False).measured(x)
        time = found["walk.contact_start"] + max(found["walk.toe_after_heel_in"], 0.0)
        if not (0 <= time <= 1 and found["walk.toe_speed"] > 0):
            raise HoofEnvError("expected a walk whose toe touches down, got one whose toe stays in the air")
        return self._with(x, time, math.log(found["walk.toe_speed"]))

    def from_touch_down(self, y: Array) -> Array:
        """Inverse of `to_touch_down`, of a walk whose toe comes in once."""
        by_toe = self._other(by_toe=True)
        height = by_toe.measured(y)["leg.hip_height"]
        return self._with(y, height, float(by_toe._gaits[0, 1]))

    def _other(self, *, by_toe: bool) -> Objective:
        return Objective(**{**self._settings, "by_toe": by_toe, "paper_solver": False})

    def _with(self, x: Array, level: float, offset: float) -> Array:
        changed = np.array(x, dtype=np.float64)
        changed[LEVEL], changed[self.names.index("walk.swing_offset")] = level, offset
        return changed

    def report(self, x: Array) -> dict[str, Any]:
        """Where a candidate stands, JSON-serialisable.

        Returns:
            cost; rows and, if it counts, paper_rows: errors in bars by id; plausibility: shortages above 0 by
            name; within, of: rows within their bar among those that count; worst: id of the row furthest out,
            "paper." before one of the paper's solver, and worst_error.
        """
        cost = self.cost(check_vector(x, self.choice))
        rows = dict(zip(self.row_ids, self.rows(x).tolist(), strict=True))
        result: dict[str, Any] = {"cost": cost, "rows": rows}
        counted = dict(rows)
        if self.paper_solver:
            result["paper_rows"] = dict(zip(self.row_ids, self.paper_rows(x).tolist(), strict=True))
            counted |= {f"paper.{k}": v for k, v in result["paper_rows"].items() if k not in ILL_CONDITIONED}
        shortages = zip(self.demands, self.plausibility(x).tolist(), strict=True)
        result["plausibility"] = {name: shortage for name, shortage in shortages if shortage > 0}
        worst = max(counted, key=lambda name: abs(counted[name]))
        within = sum(abs(error) <= 1 for error in counted.values())
        return {**result, "within": within, "of": len(counted), "worst": worst, "worst_error": counted[worst]}


def _signed(measured: Array, demand: tuple[Any, ...]) -> Array:
    """Shortages, below 0 where satisfied."""
    where, sense, bound, scale, _ = demand
    return _finite(sense * (bound - measured[where]) * scale)


def _finite(shortages: Array) -> Array:
    return np.where(np.isfinite(shortages), shortages, MISSED)
