"""The solvers that reproduce the paper, by the names that rows and tables give them.

"paper" is the paper's Eq. 8 in explicit Euler at 1 ms with Baumgarte's beta as printed, sqrt(2 alpha), and
"paper, probable beta" the same with the beta that is probably meant, sqrt(2) alpha. "exact" is the closed
form at a step at which the results no longer change.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hoof_env.paper.published import Published, load_published

PRINTED, PROBABLE, EXACT = "paper", "paper, probable beta", "exact"

EULER = {PRINTED: "printed", PROBABLE: "probable"}
"""The reading of beta by solver, of those that integrate as the paper does."""

SOLVERS = (*EULER, EXACT)


def betas(published: Published) -> dict[str, float]:
    """Baumgarte's beta [1/s] by its reading, in the order of `EULER`."""
    parameters = published.parameters
    return {"printed": parameters["baumgarte_beta"], "probable": math.sqrt(2) * parameters["baumgarte_alpha"]}


def slowest_root(alpha: float, beta: float) -> float:
    """Real part of the root of s^2 + 2 alpha s + beta^2, by which a closure error decays slowest [1/s]."""
    return max(float(root.real) for root in np.roots([1, 2 * alpha, beta**2]))


def settings_of(solver: str) -> dict[str, Any]:
    """The arguments of `hoof_env/HorseLegFixed-v0` that make it this solver, one of `SOLVERS`."""
    if solver == PROBABLE:
        return {"solver": "paper", "baumgarte_beta": betas(load_published())["probable"]}
    return {"solver": solver}
