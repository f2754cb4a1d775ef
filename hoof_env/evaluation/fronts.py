"""Fronts of several objectives: points that no other dominates, the volume that they dominate, and the front
that the agents of this package reached.

Objectives are in the order of `tasks.reward.OBJECTIVES`, and larger is better in each.
"""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.errors import ParameterError
from hoof_env.tasks.objectives import REFERENCE_POINT

Floats = NDArray[np.float64]


def read_front() -> dict[str, Any]:
    """Return the approximate front of `HorseLegMO-v0` as `python -m agents.front` wrote it: "front" has the
    returns of policies that no other dominates, with the weights and seed of their training, and
    "hypervolume" the hypervolume of the front of each seed and of all seeds together. A better front than
    this is possible."""
    text = files("hoof_env").joinpath("data", "fronts", "HorseLegMO-v0.json").read_text(encoding="utf-8")
    front: dict[str, Any] = json.loads(text)
    return front


def non_dominated(points: ArrayLike) -> NDArray[np.bool_]:
    """Return a mask of the points, shape (n, objectives), that no other point dominates: one that is as good
    in every objective and better in one. Of equal points the first counts.

    Raises:
        ParameterError: not an array of two axes of finite numbers.
    """
    values = _checked(points)
    dominated = np.zeros(len(values), bool)
    for k, point in enumerate(values):
        as_good = (values >= point).all(axis=1)
        equals_before = (values[:k] == point).all(axis=1).any()
        dominated[k] = (as_good & (values > point).any(axis=1)).any() or equals_before
    return ~dominated


def hypervolume(points: ArrayLike, reference: ArrayLike = REFERENCE_POINT) -> float:
    """Return the volume between a reference point and three-dimensional points: of all that some point
    dominates and that dominates the reference point. A point that is not better than the reference point in
    every objective adds nothing.

    Args:
        points: returns of policies, shape (n, 3).
        reference: reference point, shape (3,).

    Raises:
        ParameterError: points or a reference point of another shape, or numbers that are not finite.
    """
    values = _checked(points)
    low = _checked(np.reshape(np.asarray(reference, float), (1, -1)))[0]
    if values.shape[1] != 3 or low.shape != (3,):
        raise ParameterError(
            f"points, reference: expected shapes (n, 3) and (3,), got {values.shape} and {low.shape}"
        )
    values = values[(values > low).all(axis=1)]
    # Slabs between heights of the last objective: the points at least as high as a slab span its area.
    values = values[np.argsort(-values[:, 2], kind="stable")]
    bounds = [*values[:, 2], low[2]]
    slabs = ((bounds[k] - bounds[k + 1]) * _area(values[: k + 1, :2] - low[:2]) for k in range(len(values)))
    return float(sum(slabs))


def _area(sides: Floats) -> float:
    """Return the area of the union of rectangles with a corner at 0; `sides` are of shape (n, 2)."""
    area = reached = 0.0
    for width, height in sides[np.argsort(-sides[:, 0], kind="stable")]:
        area += width * max(height - reached, 0.0)
        reached = max(reached, height)
    return area


def _checked(points: ArrayLike) -> Floats:
    """Return points as an array; `ParameterError` if they are none."""
    try:
        values = np.asarray(points, np.float64)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.ndim != 2 or not np.isfinite(values).all():
        raise ParameterError(
            f"points: expected finite numbers of shape (n, objectives), got shape {values.shape}"
        )
    return values
