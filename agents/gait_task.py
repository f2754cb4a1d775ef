"""Task of a horse that chooses its footfall, and what it is to spare: `agents.gait_agents` trains on it.

It is `HorseRough-v0` on level ground without pushes, where actions shift the legs in the stride in place of
scaling their cranks' speeds. An episode has one command. Rewards are the commanded speed, staying up, little
slip and one of the objectives of `agents.gait_map`. Two ids differ in the gaits around which actions move,
and so in the lag with which a learner begins: searched walks, or searched trots.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import hoof_env
from agents.gait_map import OBJECTIVES, SCALES
from agents.horse_gaits import speed_of
from agents.searched_horse import TrottingHorse, WalkingHorse
from hoof_env.tasks.horse_gaits import LEGS

STARTS = {"walk": WalkingHorse, "trot": TrottingHorse}
"""Horses by the lag with which learners begin."""
COMMANDS = (0.1, 1.1)  # least and largest Froude number of a command
SPARED = 1.0  # weight of the objective [1/s]
KEPT = {"alive": 0.9, "tracking": 1.28, "slip": 2.0, "fall": 2.0}
"""Other weights of the reward: those of `HorseRough-v0`, but more for slip, without which hind hooves slip
too far for a gait to count."""


def stance_peaks(step: Any, weight: float) -> Any:
    """Charge the stances' peaks over the weight, as a mean over stances times the time."""
    return -weight * _per_stance(step) * step.sums.peak_grf_increase / step.weight


def steepest_rises(step: Any, weight: float) -> Any:
    """Charge the stances' steepest rises over the weight [1/s], as a mean over stances times the time."""
    return -weight * _per_stance(step) * step.sums.loading_rate_increase / step.weight


def _per_stance(step: Any) -> Any:
    """Return the time of a stride over the number of legs: each of them has a stance in it [s]."""
    return 2.0 * np.pi / (len(LEGS) * step.episode.gait.rate)


TERMS = {"transport": "work", "peak": "stance_peaks", "loading": "steepest_rises"}
"""Term that charges a figure."""


def weights_of(objective: str) -> dict[str, float]:
    """Return the weights of the reward with which a learner spares one of `OBJECTIVES`, or nothing."""
    names = OBJECTIVES.get(objective, ())
    charged = {TERMS[name]: SPARED / SCALES[name] / len(names) for name in names}
    return dict.fromkeys(("peak", "landing", "pitch", *TERMS.values()), 0.0) | KEPT | charged


def id_of(start: str) -> str:
    """Return the id of the task that begins with one of `STARTS`."""
    return f"gait_agents/From{start.title()}-v0"


for _start, _horse in STARTS.items():
    hoof_env.register(
        id_of(_start),
        base="rough",
        terms=[
            hoof_env.Term("stance_peaks", 0.0, "1/s", "minus the mean of the stances' peaks", stance_peaks),
            hoof_env.Term("steepest_rises", 0.0, "-", "minus the mean of their rises", steepest_rises),
        ],
        body=_horse,
        terrain=None,
        push_impulse=None,
        dt=0.02,
        footfall="free",
        target_speed=[speed_of(froude) for froude in COMMANDS],
        target_seconds=[20.0, 20.0],  # longer than an episode
        reward_weights=weights_of("mixture"),
    )
