"""Reward of one leg: a table of terms. A new term is a row of the table, with its objective in
`HorseLegMO-v0`, and needs no other change.

The reward is the sum of all terms; `info["reward_<name>"]` holds each. `docs/task.md` gives the reasons for
the weights and their consequences."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from hoof_env.errors import ParameterError, brief, check_choice, check_number, flag
from hoof_env.simd import Lanes, Number, absolute, maximum, minimum, where
from hoof_env.simd.user_functions import inputs
from hoof_env.tasks.user_parts import Constant, TermState, check_arguments, check_parts

if TYPE_CHECKING:
    from hoof_env.dynamics.layout import LegMemory, StrideSums, TrunkMemory
    from hoof_env.tasks.episode import Episode


@inputs
class Outcome(NamedTuple):
    """Outcome of a control step, the argument of the terms. Where the engine failed, `failed` is 1 and the
    step's sums are 0.

    Attributes:
        seconds: simulated time [s].
        progress: forward travel [m].
        commanded_progress: forward travel at the commanded speed; infinite without one [m].
        sums: `dynamics.layout.StrideSums` of the step, `sums.slip` and so on; sums over all legs, of peaks
            the highest.
        credited: impulse divided by the weight that is credited as bearing [s]; see `BEARING`.
        failed: 1 where the episode ends by failure, else 0.
        episode_seconds: duration of a whole episode [s].
        weight: weight of trunk and legs [N].
        trunk, leg, episode: memory of the engine and the episode after the step, with fields as in
            `dynamics.layout.TrunkMemory`, `LegMemory` and `episode.Episode`; `block_at(leg, i)` is a horse's
            i-th leg.
    """

    seconds: Lanes
    progress: Lanes
    commanded_progress: Lanes
    sums: StrideSums
    credited: Lanes
    failed: Lanes
    episode_seconds: Lanes
    weight: Lanes
    trunk: TrunkMemory
    leg: LegMemory
    episode: Episode


BEARING = 0.9
"""Largest mean share of the weight for which bearing is rewarded [-]: between the share that the leg must
bear, by default 0.8, and 1, above which the suspension would pull the animal down."""

MAX_STRIDE = 1.0
"""Time over which that mean is taken [s]: an older deficit cannot be made up for."""

STEPPING = 0.5
"""Rate of the crank from which a leg counts as stepping [rad/s], a twelfth of the rate of the paper's gaits:
agents slow the crank down in a stance, and with a stopped crank a leg can only oscillate its swing."""


# Arguments of all terms: an `Outcome`, and the weight of the term in the unit of its row in `TERMS`.


def progress(step: Outcome, weight: Number) -> Lanes:
    """Return the reward for forward travel, up to the commanded speed; weight in 1/m."""
    return weight * minimum(step.progress, step.commanded_progress)


def overspeed(step: Outcome, weight: Number) -> Lanes:
    """Return the charge for travel beyond the commanded speed; weight in 1/m."""
    return -weight * maximum(step.progress - step.commanded_progress, 0.0)


def peak(step: Outcome, weight: Number) -> Lanes:
    """Return the charge for the increase of the running peak GRF; weight in 1/kN."""
    return -0.001 * weight * step.sums.running_peak_increase


def loading(step: Outcome, weight: Number) -> Lanes:
    """Return the charge for the increase of the stance's loading rate; weight in s/MN."""
    return -1e-6 * weight * step.sums.loading_rate_increase


def energy(step: Outcome, weight: Number) -> Lanes:
    """Return the charge for positive work of the drives; weight in 1/kJ."""
    return -0.001 * weight * step.sums.positive_work


def slip(step: Outcome, weight: Number) -> Lanes:
    """Return the charge for the distance that the hoof slides in stance; weight in 1/m."""
    return -weight * step.sums.slip


def failure(step: Outcome, weight: Number) -> Lanes:
    """Return the charge for a failure, once, in proportion to the rest of the episode; weight in 1/s."""
    # For the rest, so that an early failure cannot be cheaper than the charges of continuing.
    return where(step.failed > 0.0, -weight * (step.episode_seconds - step.episode.time), 0.0)


def support(step: Outcome, weight: Number) -> Lanes:
    """Return the reward for bearing weight, in proportion to the speed, up to the commanded one, and to the
    crank's rate, up to `STEPPING`; weight in 1/s. There is no reward for standing still under load, for
    oscillating the swing, or for moving back and forth."""
    commanded = maximum(step.commanded_progress, 1e-9)
    pace = minimum(maximum(step.progress / commanded, -1.0), 1.0)
    # Without a commanded speed the ratio above is 0: then only the crank counts.
    pace = minimum(where(commanded < np.inf, pace, 1.0), step.leg.state.crank_angle_rate * (1.0 / STEPPING))
    # The minimum, because two negative factors would reward too much bearing in backward motion.
    return weight * minimum(pace * step.credited, absolute(pace) * step.credited)


OBJECTIVES = ("progress", "peak force", "energy")
"""Objectives of `HorseLegMO-v0`, in the order of its vector reward; larger is better in each."""

PROGRESS, PEAK_FORCE, ENERGY = OBJECTIVES


@dataclass(frozen=True)
class Term:
    """Term of the reward.

    Attributes:
        name: name of the term and of its weight; the key in infos is "reward_" followed by it.
        weight: default weight.
        unit: unit of the weight.
        meaning: quantity that is weighted, for the manual page.
        compute: plain function of an `Outcome` and the weight that returns the term, in Python's operators
            and NumPy's functions, with np.where instead of `if`; see docs/own_task.md.
        constants: further arguments of `compute`, which the setting `constants` changes.
        state: numbers that last from step to step of an episode: `compute` reads and sets them, as
            `step.episode.own.<term>.<name>`; entries read them, too.
        is_cost: True for a cost, which is no part of the reward: the key in infos is "cost_" followed by the
            name, and `reward_weights` cannot change its weight.
        objective: one of `OBJECTIVES`, to which `HorseLegMO-v0` adds the term; None divides it among all in
            equal parts.

    Where the engine fails, a term from outside the package counts 0.

    Raises:
        ParameterError: the name is missing, the weight is out of range, `compute` is not a function of two
            arguments, the objective is unknown, or a cost has one.
    """

    name: str
    weight: float
    unit: str
    meaning: str
    compute: Callable[..., Any]
    objective: str | None = None
    constants: Sequence[Constant] = ()
    state: Sequence[TermState] = ()
    is_cost: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ParameterError(f"name: expected a string, got {brief(self.name)}")
        if flag(f"{self.title}: is_cost", self.is_cost) and self.objective is not None:
            raise ParameterError(f"{self.title}: objective: expected none of a cost, got {self.objective!r}")
        check_number(f"{self.title}: weight", self.weight, low=0, high=1e6)
        # Without one the term is divided among all objectives.
        if self.objective is not None:
            check_choice(f"{self.title}: objective", self.objective, OBJECTIVES)
        # Tuples, because kernels are looked up by a hash of their terms.
        constants = check_parts(f"{self.title}: constants", Constant, self.constants)
        object.__setattr__(self, "constants", constants)
        object.__setattr__(self, "state", check_parts(f"{self.title}: state", TermState, self.state))
        if self.state and not self.name.isidentifier():
            raise ParameterError(f"{self.title}: a term with state: expected the name of a variable")
        check_arguments(f"{self.title}: compute", self.compute, 2, constants)

    @property
    def title(self) -> str:
        """Name of the term in messages."""
        return f"term {self.name!r}"

    @property
    def key(self) -> str:
        """Key of the term in infos."""
        return f"cost_{self.name}" if self.is_cost else f"reward_{self.name}"


TERMS = (
    Term(
        "progress",
        2.5,
        "1/m",
        "forward travel, up to the commanded speed",
        progress,
        objective=PROGRESS,
    ),
    Term(
        "peak",
        0.5,
        "1/kN",
        "minus the increase of the running peak GRF: the highest so far, at most twice the present one",
        peak,
        objective=PEAK_FORCE,
    ),
    Term(
        "energy",
        1.0,
        "1/kJ",
        "minus the positive work of both drives; braking is not recovered",
        energy,
        objective=ENERGY,
    ),
    Term(
        "slip",
        1.0,
        "1/m",
        "minus the distance that the hoof slides in stance, in both directions",
        slip,
        objective=ENERGY,
    ),
    Term("failure", 25.0, "1/s", "once, minus the rest of `episode_seconds`, if the episode fails", failure),
    Term(
        "support",
        17.0,
        "1/s",
        f"normal impulse divided by the weight, less twice what exceeds a mean of {BEARING:g}; times the"
        " ratio of the speed to the commanded one, within +-1 and at most the crank's rate divided by"
        f" {STEPPING:g} rad/s",
        support,
        objective=PROGRESS,
    ),
    Term(
        "overspeed",
        0.0,
        "1/m",
        "minus the travel beyond the commanded speed",
        overspeed,
        objective=PROGRESS,
    ),
    Term(
        "loading",
        75.0,
        "s/MN",
        "minus the increase of the stance's steepest rise of the normal force, while its peak grows",
        loading,
        objective=PEAK_FORCE,
    ),
)
"""Terms of all ids of one leg, in the order in which they are added."""


def check_weights(changes: Mapping[str, float] | None, terms: tuple[Term, ...] = TERMS) -> dict[str, float]:
    """Return the weights of all terms by name, costs included: the terms' defaults with `changes`.

    Raises:
        ParameterError: an unknown term, a cost, or a weight out of range.
    """
    weights = {term.name: term.weight for term in terms}
    if changes is None:
        return weights
    paid = [term.name for term in terms if not term.is_cost]
    if not isinstance(changes, Mapping) or not set(changes) <= set(paid):
        raise ParameterError(
            f"reward_weights: expected a mapping with some of {', '.join(paid)}, got {brief(changes)}"
        )
    weights |= changes
    return {
        name: check_number(f"reward_weights[{name!r}]", value, low=0, high=1e6)
        for name, value in weights.items()
    }
