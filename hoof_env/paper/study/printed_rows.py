"""Eq. 2 letter by letter: the 37 rows that the paper prints, evaluated as they stand, slips included.

The text of a row is its data: a sum of terms such as `x6`, `-2L5 sin5` or `Cy`. Link 10 is the paper's `L91`,
and from link 12 on its half-lengths are numbered differently from its links (`L10` belongs to link 12).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.constraints import DRIVER_ROW, LOCK_ROW, SIZE, Constraints, closed_form
from hoof_env.gait.motion_law import MOTION
from hoof_env.leg.geometry import Geometry

Vector = NDArray[np.float64]

ROWS = {
    1: "x1 - L1 cos1", 2: "y1 - L1 sin1",
    3: "x2 - L2 cos2 - x1 - L1 cos1", 4: "y2 - L2 sin2 - y1 - L1 sin1",
    5: "x3 + L3 cos3 - x2 - L2 cos2", 6: "y3 + L3 sin3 - y2 - L2 sin2",
    7: "x3 - L3 cos3 - Cx", 8: "y3 - L3 sin3 - Cy",
    9: "x4 + L4 cos4 - x2 - L2 cos2", 10: "y4 + L4 sin4 - y2 - L2 sin2",
    11: "x5 + L5 cos5 - x4 + L4 cos4", 12: "y5 + L5 sin5 - y4 + L4 sin4",
    13: "x5 - L5 cos5 - Cx", 14: "y5 - L5 sin5 - Cy",
    15: "x6 + L6 cos6 - x4 + L4 cos4", 16: "y6 + L6 sin6 - y4 + L4 sin4",
    17: "x7 + L7 cos7 - x6 + L6 cos6", 18: "y7 + L7 sin7 - y6 + L6 sin6",
    19: "x8 - L8 cos8 - x7 + L7 cos7",
    22: "y8 - L8 sin8 - Cy",
    23: "x9 + L9 cos9 + L6 cos6 - 2L5 sin5 - Cy", 24: "y9 + L9 sin9 + L6 sin6 - 2L5 sin5 - Cy",
    26: "y9 - L9 sin9 - y1 - L1 sin1",
    27: "x10 + L91 cos10 - x7 + L7 cos7", 28: "y10 + L91 sin10 - y7 + L7 sin7",
    29: "th10 - th7",
    30: "x11 - L11 cos11 - x10 + L91 cos10",
    33: "y12 - L10 sin12 - y11 - L11 sin11",
    32: "x12 + L10 cos12 - y11 - L11 sin11",
    34: "x12 + L10 cos12 + 2L81 sin8 - Cy",
    36: "x13 + L12 cos13 - x10 + L91 cos10", 37: "y13 + L12 sin13 - y10 + L91 sin10",
    38: "x14 - L13 cos13 - x13 + L12 cos13", 39: "y14 - L13 sin13 - y13 + L12 sin13",
    40: "x14 - L13 cos13 - x12 + L10 cos12", 41: "y14 - L13 sin13 - y12 + L10 sin12",
    42: "th1 + wt",
}  # fmt: skip
"""The printed rows by number, in the order of the print; 20, 21, 25, 31 and 35 are lost."""

HALF_LENGTHS = {f"L{i}": i for i in range(1, 10)} | {"L91": 10, "L11": 11, "L10": 12, "L12": 13, "L13": 14}
"""Number of the link whose half-length each symbol is."""

_TERM = re.compile(r"([+-]?)\s*(\d?)([A-Za-z]\w*)(?: (cos|sin)(\d+))?")
_AXES = {"x": 0, "y": 1, "th": 2}


def _index(axis: str, link: int) -> int:
    return 3 * (link - 1) + _AXES[axis]


@dataclass(frozen=True)
class Row:
    """One row of Eq. 2 as text."""

    text: str

    def __call__(self, q: Vector, geometry: Geometry, theta: float) -> tuple[float, Vector]:
        """The row's value [m, rad] and its derivatives by q, shape (42,), at crank angle `theta` [rad]."""
        half = {name: geometry.body_lengths[link - 1] / 2 for name, link in HALF_LENGTHS.items()}
        known = {**half, "L81": geometry.lengths["CA"] / 2, "wt": theta}
        known |= dict(zip(("Cx", "Cy"), geometry.pivot, strict=True))
        value, slope = 0.0, np.zeros(SIZE)
        for sign, factor, name, function, link in _TERM.findall(self.text):
            c = float(f"{sign}{factor or 1}")
            coordinate = re.fullmatch(r"(x|y|th)(\d+)", name)
            if coordinate:
                k = _index(coordinate[1], int(coordinate[2]))
                value, slope[k] = value + c * q[k], slope[k] + c
            elif function:
                k, c = _index("th", int(link)), c * known[name]
                sine, cosine = np.sin(q[k]), np.cos(q[k])
                value += c * (cosine if function == "cos" else sine)
                slope[k] += c * (-sine if function == "cos" else cosine)
            else:
                value += c * known[name]
        return float(value), slope


def row_index(number: int) -> int:
    """Where the paper's row `number` stands in `Constraints`, which keeps lock and driver for the end."""
    return {29: LOCK_ROW, 42: DRIVER_ROW}.get(number, number - 1 - (number > 29))


def at_rest(theta: float) -> np.void:
    """A `MOTION` record with the crank at `theta` [rad], the frame not turned and nothing moving."""
    motion = np.zeros(1, MOTION)[0]
    motion["theta"] = theta
    return motion


@dataclass(frozen=True)
class Assembly:
    """Whether a set of 42 rows holds together over a revolution.

    Attributes:
        closed: part of the crank angles at which all rows can be met [-].
        gap: largest row that is left at the worst crank angle [m].
        rank: smallest rank of the Jacobian where it was evaluated last.
        turned_deg: largest turn of a link against the decoded leg where all rows are met [deg], or None.
    """

    closed: float
    gap: float
    rank: int
    turned_deg: float | None


def assemble(geometry: Geometry, literal: Mapping[int, str], angles: int = 12) -> Assembly:
    """Replace rows of the decoded Eq. 2 by other text and solve it by Gauss-Newton, from the decoded pose on.

    Args:
        geometry: the leg.
        literal: text by row number.
        angles: number of crank angles.
    """
    gaps, ranks, turns = [], [], []
    for theta in np.arange(angles) / angles * 2 * np.pi:
        start = closed_form(geometry, at_rest(theta))[0]
        q, error, jacobian = _solve(geometry, literal, float(theta), start)
        gaps.append(float(np.abs(error).max()))
        ranks.append(int(np.linalg.matrix_rank(jacobian, tol=1e-8)))
        if gaps[-1] < 1e-9:
            turns.append(float(np.degrees(np.abs(q - start)[2::3].max())))
    return Assembly(len(turns) / angles, max(gaps), min(ranks), max(turns, default=None))


def _solve(
    geometry: Geometry, literal: Mapping[int, str], theta: float, q: Vector
) -> tuple[Vector, Vector, Vector]:
    constraints, motion = Constraints(geometry), at_rest(theta)
    damping = 1e-3  # Levenberg and Marquardt's, because a literal row may leave the Jacobian singular
    error, jacobian = _rows(constraints, geometry, literal, motion, q)
    for _ in range(200):
        system = np.vstack([jacobian, np.sqrt(damping) * np.eye(SIZE)])
        trial = q - np.linalg.lstsq(system, np.concatenate([error, np.zeros(SIZE)]))[0]
        new_error, new_jacobian = _rows(constraints, geometry, literal, motion, trial)
        if new_error @ new_error < error @ error:
            q, error, jacobian, damping = trial, new_error, new_jacobian, damping / 10
        else:
            damping *= 10
        if np.abs(error).max() < 1e-12 or damping > 1e8:
            break
    return q, error, jacobian


def _rows(
    constraints: Constraints, geometry: Geometry, literal: Mapping[int, str], motion: np.void, q: Vector
) -> tuple[Vector, Vector]:
    closure = constraints(q, np.zeros(SIZE), motion)
    error, jacobian = closure.error.copy(), closure.jacobian.copy()
    for number, text in literal.items():
        k = row_index(number)
        error[k], jacobian[k] = Row(text)(q, geometry, float(motion["theta"]))
    return error, jacobian


def misfits(geometry: Geometry, angles: int = 72) -> dict[int, float]:
    """By printed row, the largest value that it takes on the decoded leg over a revolution [m, rad]."""
    largest = dict.fromkeys(ROWS, 0.0)
    for theta in np.arange(angles) / angles * 2 * np.pi:
        q, _ = closed_form(geometry, at_rest(theta))
        for number, text in ROWS.items():
            largest[number] = max(largest[number], abs(Row(text)(q, geometry, float(theta))[0]))
    return largest


def printed_jacobian(geometry: Geometry, theta: float) -> Vector:
    """Derivatives of the printed rows at the decoded pose, shape (37, 42)."""
    q, _ = closed_form(geometry, at_rest(theta))
    return np.array([Row(text)(q, geometry, theta)[1] for text in ROWS.values()])
