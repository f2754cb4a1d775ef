"""How far a leg is from the paper: errors of its rows in bars, shortages of its plausibility, and one cost.

`Objective` measures a vector x (see `leg.NAMES`) by kinematics alone, a revolution for each gait, and on
demand once more through the paper's solver. The arithmetic is in kernels (`measure`), arrays are kept.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import check_number
from hoof_env.ground.contact import Ground
from hoof_env.paper.rows import ILL_CONDITIONED, load_published
from research.identify.demands import BOTH, DEMANDS, GAIT_DEMANDS, LEG, LEG_DEMANDS, MEASURED, Demand
from research.identify.features import FEATURES, TOPS
from research.identify.leg import LEVEL, NUMBER, OFFSET, STEPS, Choice
from research.identify.measure import (
    PAPER_SAMPLES,
    Setup,
    measure_exact,
    measure_paper,
    new_arrays,
    new_bodies,
)
from research.identify.minimax import Rating

Array = NDArray[np.float64]
Columns = tuple[NDArray[np.int64], Array, Array, Array]

DEAD_ZONE = 0.6  # a smaller error costs nothing [bars]: no row is pressed while another is outside its bar
MISSED_ROW, MISSED = 300.0, 20.0  # error [bars] of a row, shortage of a demand, that cannot be measured

INSIDE = 0.01
"""By how much `rate` asks for more than a demand, because a descent ends on the border of it [bars].
Those that cannot be exceeded are 0 where they are met."""

TOE_DOWN = 0.35, -3.0  # when [s] and how fast [log m/s] a search puts down a toe that stays in the air
ALPHA = 15.0  # Baumgarte's, of the paper's solver [1/s]
BETA = math.sqrt(2) * ALPHA  # as it is probably meant


def _columns(demands: tuple[Demand, ...]) -> Columns:
    where = np.array([MEASURED.index(demand.measured) for demand in demands])
    sense, bound, scale = np.array([(d.sense, d.bound, d.scale) for d in demands]).T
    return where, sense, bound, scale


_DEMANDS, _OF_GAITS = _columns(DEMANDS), _columns(GAIT_DEMANDS)
_NAMES = [demand.name for demand in DEMANDS]
_TRANSMISSION = _NAMES.index("transmission")


class Standing(NamedTuple):
    """Whether every row is within its bar and nothing falls short; the furthest error [bars]; in words."""

    met: bool
    error: float
    words: str


class _Measured:
    """Every measured number in one array, and the same as records for the kernels: leg, (walk, run), both."""

    def __init__(self) -> None:
        self.flat = np.full(len(MEASURED), np.nan)
        leg, gait = len(LEG.names or ()), len(FEATURES.names or ())
        parts = np.split(self.flat, [leg, leg + 2 * gait])
        self.records = parts[0].view(LEG)[0], parts[1].view(FEATURES), parts[2].view(BOTH)[0]


class Objective:
    """What a search minimises for one choice. One object serves one thread.

    With `samples` instants a revolution of the exact solver; with `paper_solver` the paper's counts too, all
    rows but `ILL_CONDITIONED` and all demands on gaits. `by_toe`, for searches: x holds instead of the hip's
    height the time [s] at which the toe touches down in walking, and instead of the walk's offset the
    logarithm of its approach speed there [log m/s]. That contact grazes: a tenth of a millimetre of height,
    or a milliradian, is a large step of the inelastic force. `row_ids`: the paper's rows that have a bar.
    """

    def __init__(
        self, choice: Choice, *, samples: int = 201, paper_solver: bool = False, by_toe: bool = False
    ) -> None:
        samples = int(check_number("samples", samples, low=21, high=100_001))
        self.paper_solver = paper_solver
        rows = [row for row in load_published().rows if row.bar.limit is not None]
        self.row_ids = tuple(row.id for row in rows)
        self._row = (
            np.array([MEASURED.index(row.id.replace("ratio.", "both.")) for row in rows]),
            np.array([row.value for row in rows]),
            np.array([row.bar.error(row.value + 1.0, row.value) / (row.bar.limit or 1.0) for row in rows]),
        )
        self._counts = ~np.isin(self.row_ids, ILL_CONDITIONED)
        signs = iter(choice.assembly)
        self._setup = Setup(
            np.array([float(next(signs)) if step[0] == 1 else 0.0 for step in STEPS]),
            float(choice.travel), NUMBER[choice.toe], NUMBER[choice.heel],
            Ground().stiffness, choice.exponent, ALPHA, BETA, by_toe,
        )  # fmt: skip
        self._arrays, self._paper_arrays = new_arrays(samples), new_arrays(PAPER_SAMPLES)
        self._bodies, self._exact, self._paper = new_bodies(), _Measured(), _Measured()

    def _measure(self, x: Array, paper: bool = False) -> None:
        self._exact.flat[:] = np.nan
        measure_exact(x, self._setup, self._arrays, *self._exact.records)
        if paper:
            self._paper.flat[:] = np.nan
            height, records = self._exact.records[0]["hip_height"], self._paper.records[1:]
            measure_paper(x, height, self._setup, self._arrays, self._bodies, self._paper_arrays, *records)

    def _errors(self, measured: Array) -> Array:
        """Signed errors of the rows [bars]; `MISSED_ROW` if there is no value."""
        where, target, per_unit = self._row
        return _finite((measured[where] - target) * per_unit, MISSED_ROW)

    def cost(self, x: Array) -> float:
        """Cost of rows and demands with the exact solver; 0: every error within `DEAD_ZONE`, no shortage.

        An error costs a^2 / (1 + a / 2) beyond the dead zone; a shortage p^2 / (1 + p / 2) + 0.3 p, which
        closes even a small one.
        """
        self._measure(x)
        a = np.maximum(np.abs(self._errors(self._exact.flat)) - DEAD_ZONE, 0.0)
        p = np.maximum(_shortages(self._exact.flat, _DEMANDS), 0.0)
        rows, short = a * a / (1.0 + 0.5 * a), p * p / (1.0 + 0.5 * p) + 0.3 * p
        return float(rows.cumsum()[-1] + short.cumsum()[-1])  # in order: a sum's last bits depend on it

    def rate(self, x: Array) -> Rating:
        """What `minimax.descend` improves: all rows and demands with their signs.

        The inelastic force of walking has up to three peaks of much the same height, and a leg as many dyads:
        each sample and each dyad is a limit of its own, so that none turns up only when it is the highest.
        """
        self._measure(x, self.paper_solver)
        flat, rows = self._exact.flat, self._errors(self._exact.flat)
        shortages = [_shortages(flat, _DEMANDS), self._dyads()]
        shortages[0][_TRANSMISSION] = -np.inf
        peaks = {}
        force = np.maximum(self._arrays.work[0, TOPS], 1.0)
        for name, values in (
            ("walk.peak_inelastic", force),
            ("walk.reduction", 100 * (1 - self._exact.records[1][0]["peak_elastic"] / force)),
        ):
            row, (_, target, per_unit) = self.row_ids.index(name), self._row
            peaks[row] = _finite((values - target[row]) * per_unit[row], MISSED_ROW)
            rows[row] = peaks[row].max()
        if self.paper_solver:
            rows = np.append(rows, self._errors(self._paper.flat)[self._counts])
            shortages.append(_shortages(self._paper.flat, _OF_GAITS))
        short = np.concatenate(shortages)
        return Rating(rows, np.where(short == 0.0, 0.0, short + INSIDE), peaks)

    def _dyads(self) -> Array:
        at, (_, sense, bound, scale) = self._arrays.z, (column[_TRANSMISSION] for column in _DEMANDS)
        dyads = STEPS[STEPS[:, 0] == 1]
        one, two = (at[dyads[:, 1]] - at[dyads[:, i]] for i in (2, 3))
        sine = np.abs((one.conj() * two).imag) / (np.abs(one) * np.abs(two) + 1e-12)
        return _finite(sense * (bound - sine.min(axis=1)) * scale, MISSED)

    def rows(self, x: Array, *, paper_solver: bool = False) -> Array:
        """Signed errors in bars, shape (rows,), with one solver; `MISSED_ROW` if there is no value."""
        return self._errors(self._numbers(x, paper_solver))

    def _numbers(self, x: Array, paper_solver: bool) -> Array:
        self._measure(x, paper_solver)
        return (self._paper if paper_solver else self._exact).flat

    def plausibility(self, x: Array) -> dict[str, float]:
        """Shortages above 0 by name of the demand, those of the paper's solver after "paper."."""
        self._measure(x, self.paper_solver)
        short = dict(zip(_NAMES, _shortages(self._exact.flat, _DEMANDS).tolist(), strict=True))
        if self.paper_solver:
            names = (f"paper.{name}" for name in _NAMES[len(LEG_DEMANDS) :])
            short |= zip(names, _shortages(self._paper.flat, _OF_GAITS).tolist(), strict=True)
        return {name: shortage for name, shortage in short.items() if shortage > 0}

    def standing(self, x: Array) -> Standing:
        errors = dict(zip(self.row_ids, self.rows(x).tolist(), strict=True))
        if self.paper_solver:
            paper = zip(self.row_ids, self.rows(x, paper_solver=True).tolist(), self._counts, strict=True)
            errors |= {f"paper.{name}": error for name, error, counts in paper if counts}
        worst = max(errors, key=lambda name: abs(errors[name]))
        within, short = sum(abs(error) <= 1 for error in errors.values()), sum(self.plausibility(x).values())
        words = f"{within} of {len(errors)} rows within their bars, worst {worst} {errors[worst]:+.2f} bars"
        words += f", plausibility short by {short:.2g}" if short else ""
        return Standing(within == len(errors) and not short, errors[worst], words)

    def measured(self, x: Array, *, paper_solver: bool = False) -> dict[str, float]:
        """Every number of `demands.MEASURED` by name, NaN where there is none."""
        return dict(zip(MEASURED, self._numbers(x, paper_solver).tolist(), strict=True))

    def to_touch_down(self, x: Array) -> Array:
        """x as an objective `by_toe` has it, by one that is not; a walking toe that stays in the air is put
        down."""
        measured = self.measured(x)
        time = measured["walk.contact_start"] + max(measured["walk.toe_after_heel_in"], 0.0)
        if 0 <= time <= 1 and measured["walk.toe_speed"] > 0:
            return with_toe(x, time, math.log(measured["walk.toe_speed"]))
        return with_toe(x, *TOE_DOWN)

    def from_touch_down(self, y: Array) -> Array:
        """Inverse of `to_touch_down`, by an objective `by_toe`, of a walk whose toe comes in once."""
        height = self.measured(y)["leg.hip_height"]
        return _finite(with_toe(y, height, float(self._arrays.gaits[0, 1])), 0.0)


def with_toe(x: Array, level: float, offset: float) -> Array:
    """x with the two entries that `by_toe` replaces."""
    changed = np.array(x, dtype=np.float64)
    changed[LEVEL], changed[OFFSET] = level, offset
    return changed


def _shortages(measured: Array, columns: Columns) -> Array:
    """Of demands, below 0 where satisfied; `MISSED` where there is no value."""
    where, sense, bound, scale = columns
    return _finite(sense * (bound - measured[where]) * scale, MISSED)


def _finite(values: Array, otherwise: float) -> Array:
    return np.where(np.isfinite(values), values, otherwise)
