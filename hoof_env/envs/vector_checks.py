"""Checks of what callers give to vector environments."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.envs.base import array_of
from hoof_env.errors import ParameterError, count

MOST_DRAWN = 16
"""Environments that are drawn by default, at most; a picture takes as long as some hundred steps."""


def check_drawn(rendered: Any, n: int, render_mode: str | None) -> int:
    """Return how many of n environments are drawn.

    Raises:
        ParameterError: more than there are, some without a render_mode, or a number is needed.
    """
    if render_mode is None:
        if rendered is not None:
            raise ParameterError(f"rendered: expected none without a render_mode, got {rendered!r}")
        return 0
    if rendered is None and n > MOST_DRAWN:
        raise ParameterError(
            f"rendered: expected how many of the {n} environments to draw, as they are more than"
            f" {MOST_DRAWN}; for Gymnasium's RecordVideo rendered=1 goes with record_first_only=True"
        )
    drawn = n if rendered is None else count("rendered", rendered)
    if drawn > n:
        raise ParameterError(f"rendered: expected at most num_envs={n}, got {drawn}")
    return drawn


def check_mask(given: Any, n: int) -> NDArray[np.bool_]:
    """Return the reset option "reset_mask", shape (n,); None is all.

    Raises:
        ParameterError: no bool array of that shape, or one without a True.
    """
    if given is None:
        return np.ones(n, bool)
    good = isinstance(given, np.ndarray) and given.dtype == bool and given.shape == (n,)
    if not (good and given.any()):
        raise ParameterError(
            f"options['reset_mask']: expected a bool array of shape ({n},) with at least one True, "
            f"got {given!r}"
        )
    mask: NDArray[np.bool_] = given
    return mask


def check_actions(actions: Any, shape: tuple[int, int]) -> NDArray[np.float32]:
    """Return actions as float32.

    Raises:
        ParameterError: another shape or type, or numbers that are not finite.
    """
    given = array_of(actions)
    if given.dtype.kind not in "fiu" or given.shape != shape:
        raise ParameterError(
            f"actions: expected finite numbers in [-1, 1], shape {shape}, "
            f"got {given.dtype} of shape {given.shape}"
        )
    with np.errstate(over="ignore"):  # to infinity, which is refused
        given = given.astype(np.float32, copy=False)
    if not np.isfinite(given).all():
        rows = np.flatnonzero(~np.isfinite(given).all(1)).tolist()
        raise ParameterError(f"actions: expected finite numbers in [-1, 1], got others in rows {rows[:8]}")
    return given
