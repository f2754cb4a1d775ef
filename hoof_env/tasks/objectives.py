"""Objectives of `HorseLegMO-v0`: reward and space of each, a reference point, and weights that add them up.

`reward.OBJECTIVES` names them, and each `reward.Term` says to which one it belongs.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from hoof_env.errors import ParameterError, brief
from hoof_env.tasks.reward import OBJECTIVES, TERMS, Term, check_weights

REFERENCE_POINT = (0.0, -100.0, -50.0)
"""Reference point of hypervolumes of undiscounted returns over whole episodes, in the order of `OBJECTIVES`:
no travel, and some more force and work than random actions are charged for. Policies below it in one
objective, such as falling ones, add nothing."""


def reward_space() -> spaces.Box:
    """Return the space of a vector reward, shape (3,). Forces and energy are only charged: their rewards are
    never positive."""
    high = np.array([np.inf, 0.0, 0.0], np.float32)
    return spaces.Box(np.full(len(OBJECTIVES), -np.inf, np.float32), high, high.shape, np.float32)


def vector_reward(info: Mapping[str, Any], terms: tuple[Term, ...] = TERMS) -> NDArray[np.float32]:
    """Return the reward of each objective from the terms that `info` holds, shape (3,), or (n, 3) where these
    are arrays of n environments.

    Energy includes the charge for sliding, which is lost to friction, peak force the charge for the loading
    rate, and progress the reward for bearing weight and the charge for speed beyond the commanded one. A term
    without an objective, such as the charge for a failure, is divided equally among all three: a fall costs
    the same under all preference weights that sum to 1, so that falling early to save force or energy is
    never worthwhile.

    Args:
        info: info of a step, or the terms alone by their keys.
        terms: terms of the reward of the task.
    """
    sums = [sum(info[term.key] for term in terms if term.objective == name) for name in OBJECTIVES]
    shared = np.asarray(sum(info[term.key] for term in terms if term.objective is None and not term.is_cost))
    part = np.asarray(shared / len(OBJECTIVES), np.float32)
    rewards: NDArray[np.float32] = np.stack(sums, axis=-1).astype(np.float32) + part[..., np.newaxis]
    return rewards


def check_weight(weight: ArrayLike) -> NDArray[np.float64]:
    """Return weights of the objectives as an array, shape (3,).

    Raises:
        ParameterError: not three finite numbers from 0 of which one is larger.
    """
    try:
        array = np.array(weight, np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if (
        array.shape != (len(OBJECTIVES),)
        or not (np.isfinite(array) & (array >= 0.0)).all()
        or not array.any()
    ):
        raise ParameterError(
            f"weight: expected {len(OBJECTIVES)} finite numbers from 0 and not all 0, for"
            f" {', '.join(OBJECTIVES)}, got {brief(weight)}"
        )
    return array


def scalar_weights(
    weight: ArrayLike, weights: Mapping[str, float] | None = None, terms: tuple[Term, ...] = TERMS
) -> dict[str, float]:
    """Return `reward_weights` with which `HorseLeg-v0` pays the weighted sum of the objectives, so that any
    learner with one number for a reward can optimise it.

    Args:
        weight: weights of the objectives, as of `LinearReward`.
        weights: `reward_weights` of the id with three rewards.
        terms: terms of the reward of the task.

    Raises:
        ParameterError: bad weights.
    """
    factors = check_weight(weight)
    by_objective: dict[str | None, float] = {None: float(factors.mean())}
    by_objective.update(zip(OBJECTIVES, factors.tolist(), strict=True))
    usual = check_weights(weights, terms)
    paid = [term for term in terms if not term.is_cost]
    return {term.name: by_objective[term.objective] * usual[term.name] for term in paid}
