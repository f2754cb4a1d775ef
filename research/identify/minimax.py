"""Making the largest error as small as it gets: sequential linear programming in a trust region.

The bars are limits on every row at once, so what counts is the largest error, which has a crease wherever two
rows are equally bad: at the best leg a dozen are. CMA-ES crawls along such creases. A linear programme has no
trouble with them: with rows r(y), demands d(y) and their derivatives at y, a step s solves

    minimise t + penalty * sum(e)   over |s| <= radius (in scales), t >= 0, e >= 0
    subject to |r + r' s| <= t  and  d + d' s <= e,

an l-infinity and exact-penalty version of Fletcher & Sainz de la Maza 1989 (Math. Prog. 43:235), with their
second-order correction: the programme is solved once more with the rows as they are after the step and the
derivatives as before it, because the rows bend within micrometres of path. HiGHS solves the programmes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CORRECTIONS = 3  # second-order corrections of a step, at most
NEAR = 6.0  # demands that are satisfied by more than this are left out of the programme [bars]
TOP = 10.0  # likewise samples further below the highest [bars]
SMALLEST = 1e-5  # radius at which a descent ends
STEP = 2e-5  # of the difference quotients, in scales


@dataclass(frozen=True)
class Rating:
    """How far a candidate is from its goal: signed errors of the rows [bars]; shortages, at most 0 where a
    demand is satisfied; and by index of a row that is the largest of many values, which makes creases, these
    values as errors [bars]."""

    rows: Array
    demands: Array
    peaks: dict[int, Array]

    def merit(self, penalty: float) -> float:
        """Largest error plus `penalty` per shortage."""
        return float(np.abs(self.rows).max() + penalty * np.maximum(self.demands, 0.0).sum())


@dataclass(frozen=True)
class Descent:
    y: Array
    rating: Rating
    evaluations: int


Rate = Callable[[Array], Rating]


def descend(
    rate: Rate,
    y: Array,
    scales: Array,
    *,
    radius: float = 0.03,
    penalty: float = 2.0,
    central: bool = False,
    iterations: int = 60,
    goal: float = 0.0,
) -> Descent:
    """Go down from y until nothing improves, `iterations` are over or the merit is at or below `goal`.

    `radius`, of the first trust region, is in `scales`, shape as y; `penalty`: of a shortage, in bars;
    `central`: difference quotients of second order, at twice the price.
    """
    here = rate(y)
    merit, spent = here.merit(penalty), 1
    for _ in range(iterations):
        if merit <= goal:
            break
        model = _Model(rate, y, here, scales, penalty, central)
        spent += model.evaluations
        improved = False
        while radius > SMALLEST and not improved:
            move, value = model.solve(here, np.zeros_like(y), radius)
            predicted = merit - value
            if move is None:
                radius *= 0.3
                continue
            if predicted < 1e-5:
                break
            best, move_merit, there = y, np.inf, here
            for correction in range(1 + CORRECTIONS):
                rating = rate(y + move)
                spent += 1
                if rating.merit(penalty) < move_merit:
                    best, move_merit, there = y + move, rating.merit(penalty), rating
                elif correction > 1:
                    break
                if merit - move_merit > 0.6 * predicted:
                    break
                more, _ = model.solve(rating, move, radius)
                if more is None:
                    break
                move = move + more
            gain = (merit - move_merit) / predicted
            improved = gain > 0.1
            radius *= 0.35 if not improved else 0.6 if gain < 0.3 else 2.0 if gain > 0.6 else 1.0
            radius = min(radius, 0.3)
        if not improved:
            break
        y, here, merit = best, there, move_merit
    return Descent(y, here, spent)


class _Model:
    """Rows and demands linearised at y."""

    def __init__(
        self, rate: Rate, y: Array, here: Rating, scales: Array, penalty: float, central: bool
    ) -> None:
        n = y.size
        self.scales, self.penalty = scales, penalty
        self.tops = {row: np.flatnonzero(values > values.max() - TOP) for row, values in here.peaks.items()}
        self.highest = {row: int(np.argmax(values)) for row, values in here.peaks.items()}
        self.near = here.demands > -NEAR
        self.plain = np.array([row not in here.peaks for row in range(here.rows.size)])
        base = self._parts(here)
        upper, lower, demands = (np.empty((n, v.size)) for v in base)
        for i in range(n):
            h = STEP * scales[i]
            moved = y.copy()
            moved[i] = y[i] + h
            ahead, back, span = self._parts(rate(moved)), base, h
            if central:
                moved[i] = y[i] - h
                back, span = self._parts(rate(moved)), 2 * h
            upper[i], lower[i], demands[i] = ((a - b) / span for a, b in zip(ahead, back, strict=True))
        self.evaluations = (1 + central) * n
        m, k = lower.shape[1], int(self.near.sum())
        self.matrix = np.block(
            [
                [upper.T, -np.ones((upper.shape[1], 1)), np.zeros((upper.shape[1], k))],
                [-lower.T, -np.ones((m, 1)), np.zeros((m, k))],
                [demands.T, np.zeros((k, 1)), -np.eye(k)],
            ]
        ).clip(-1e5, 1e5)
        self.costs = np.concatenate([np.zeros(n), [1.0], np.full(k, penalty)])

    def _parts(self, rating: Rating) -> tuple[Array, Array, Array]:
        """What must be at most t, at least -t, and at most 0."""
        lower = rating.rows.copy()
        for row, top in self.highest.items():
            lower[row] = rating.peaks[row][top]
        upper = [lower[self.plain], *(rating.peaks[row][tops] for row, tops in self.tops.items())]
        return np.concatenate(upper), lower, rating.demands[self.near]

    def solve(self, rating: Rating, moved: Array, radius: float) -> tuple[Array | None, float]:
        """The next step and the merit that it promises, `moved` away from y; None if there is none."""
        from scipy.optimize import linprog

        upper, lower, demands = self._parts(rating)
        limits = np.concatenate([-upper, lower, -demands]).clip(-1e3, 1e3)
        bounds = [(-radius * s - d, radius * s - d) for s, d in zip(self.scales, moved, strict=True)]
        bounds += [(0.0, None)] * (self.costs.size - len(bounds))
        solution = linprog(self.costs, A_ub=self.matrix, b_ub=limits, bounds=bounds, method="highs-ds")
        return (solution.x[: moved.size], float(solution.fun)) if solution.status == 0 else (None, np.inf)
