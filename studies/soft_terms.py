"""Charges for landings, and ids in which one of them stands for those of HorseLeg-v0; see
`agents.soft_landing`, which trains on them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

import hoof_env
from hoof_env.simd import Number
from hoof_env.tasks.reward import TERMS as LEG_TERMS
from hoof_env.tasks.reward import Outcome

THRESHOLD = 1.5
"""Running peak from which it is charged [weights of trunk and leg]: between the 1.3 of a soft gait and the 5
of the run."""

PRICE = 10.0
"""Charge of the run [1/s], about that of the terms of HorseLeg-v0."""

WEIGHTS: Mapping[str, float] = {"threshold": 16.4, "first_contact": 31.6, "approach": 6.18}
"""Weights of the charges [1/s, -, s^2/m^2] that `python -m agents.soft_landing weights` finds."""

GROUNDS = {"stiffness": (1e4, 4e4), "restitution": (0.2, 0.8)}
"""Ranges of the grounds: stiffness from a half to twice the usual one [N/m^1.375], restitution about it."""


def threshold(step: Outcome, weight: Number) -> Any:
    """Return the charge for the time in which the running peak is beyond a threshold, times the excess in
    weights."""
    excess = step.leg.strides.running_peak / step.weight - THRESHOLD
    return -weight * step.seconds * np.maximum(excess, 0.0)


def first_contact(step: Outcome, weight: Number) -> Any:
    """Return the charge for the normal force at the end of the step in which a stance begins, in weights."""
    load = step.leg.report.toe.normal + step.leg.report.heel.normal
    return -weight * np.where(step.sums.stances > 0.0, load / step.weight, 0.0)


def approach(step: Outcome, weight: Number) -> Any:
    """Return the charge for the squared approach speeds of the points in contact when a stance begins."""
    toe = step.leg.state.toe.inverse_approach_speed
    heel = step.leg.state.heel.inverse_approach_speed
    # The inner choice avoids a division by 0 of points that are not in contact
    faster = np.maximum(
        np.where(toe > 0.0, 1.0 / np.where(toe > 0.0, toe, 1.0), 0.0),
        np.where(heel > 0.0, 1.0 / np.where(heel > 0.0, heel, 1.0), 0.0),
    )
    return -weight * np.where(step.sums.stances > 0.0, faster * faster, 0.0)


TERMS = {
    "threshold": hoof_env.Term(
        "threshold", WEIGHTS["threshold"], "1/s", "minus the running peak beyond a threshold", threshold
    ),
    "first_contact": hoof_env.Term(
        "first_contact", WEIGHTS["first_contact"], "-", "minus the force at a first contact", first_contact
    ),
    "approach": hoof_env.Term(
        "approach", WEIGHTS["approach"], "s^2/m^2", "minus the squared speed of a landing", approach
    ),
}

HEAVIER: Mapping[str, float] = {"loading_2": 2.0, "loading_3": 3.0, "loading_4": 4.0}
"""Factors of the weight of the loading rate, with the other terms of HorseLeg-v0."""

CHARGES = (*TERMS, "own", *HEAVIER)


def id_of(charge: str) -> str:
    """Return the id in which a charge stands for those of HorseLeg-v0."""
    return f"soft/{charge.title().replace('_', '')}-v0"


def weights_of(charge: str) -> dict[str, float]:
    """Return the weights of an id that are not those of HorseLeg-v0."""
    if charge in TERMS:
        return {"peak": 0.0, "loading": 0.0}
    usual = next(term.weight for term in LEG_TERMS if term.name == "loading")
    return {"loading": HEAVIER.get(charge, 1.0) * usual}


for _charge in CHARGES:
    hoof_env.register(
        id_of(_charge),
        base="leg",
        terms=[TERMS[_charge]] if _charge in TERMS else [],
        reward_weights=weights_of(_charge),
        randomize=GROUNDS,
    )
