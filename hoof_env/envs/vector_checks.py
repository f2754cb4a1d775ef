"""Checks of the arguments of vector environments."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.envs.base import array_of
from hoof_env.errors import ParameterError, count

MOST_DRAWN = 16
"""Largest number of environments that are drawn by default; a picture takes as long as some hundred steps."""


def check_drawn(rendered: Any, n: int, render_mode: str | None) -> int:
    """Return the number of environments that are drawn.

    Args:
        rendered: argument of `HorseLegVectorEnv`.
        n: number of environments.
        render_mode: render mode.

    Raises:
        ParameterError: more environments than there are, a number without a render_mode, or no number for
            more than `MOST_DRAWN` environments.
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
    """Return the reset option "reset_mask" of n environments, shape (n,); None stands for all.

    Raises:
        ParameterError: not a bool array of that shape, or one without a True.
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
    """Convert actions to float32.

    Raises:
        ParameterError: another shape or type, or numbers that are not finite.
    """
    array = array_of(actions)
    if array.dtype.kind not in "fiu" or array.shape != shape:
        raise ParameterError(
            f"actions: expected finite numbers in [-1, 1], shape {shape}, "
            f"got {array.dtype} of shape {array.shape}"
        )
    # Too large numbers become infinite in float32, which is refused below.
    with np.errstate(over="ignore"):
        array = array.astype(np.float32, copy=False)
    # The kernel checks, too, but does not know which rows are wrong.
    if not np.isfinite(array).all():
        rows = np.flatnonzero(~np.isfinite(array).all(1)).tolist()
        raise ParameterError(f"actions: expected finite numbers in [-1, 1], got others in rows {rows[:8]}")
    return array
