"""Part of the kernels of a step that computes the reward: all terms of a task."""

from __future__ import annotations

from hoof_env.dynamics.limits import has_moved
from hoof_env.episodes.scene import Scene, is_from_outside
from hoof_env.simd import Lanes, Number, Whole, full, where, write
from hoof_env.simd.user_functions import foreign
from hoof_env.tasks.episode import Episode
from hoof_env.tasks.reward import Outcome, Term


def is_user_term(term: Term) -> bool:
    """Return True for a user's term, which may not handle the NaN of a failed simulation. It may have the
    name of a term of this package, which it replaces."""
    return is_from_outside(term.compute)


def compute_reward(scene: Scene, outcome: Outcome, n: Whole) -> Lanes:
    """Compute the terms, keep them in `episode.terms`, and with a weight of 1 in the array `unweighted`;
    return the sum of all but the costs."""
    episode = scene.episode(n)
    total: Lanes | None = None
    for k, term in enumerate(scene.kind.terms):
        weight = scene.task.weights[k]
        one = full(1.0, 0)
        if is_user_term(term):
            number, unweighted = compute_user_term(scene, term, (weight, one), outcome, n)
        else:
            number, unweighted = (term.compute(outcome, each) for each in (weight, one))
        # + 0.0 makes 0 of the -0 that a weight of 0 gives
        episode.terms[k] = number + 0.0
        if is_user_term(term):
            clear_failed(outcome, episode, k)
            unweighted = where(has_moved(outcome.trunk.result), unweighted, 0.0)
        # a term may be a number that is known before the kernel runs
        write(scene.zeros(n) + unweighted, scene.unweighted, k * scene.columns + n, 1)
        if not term.is_cost:
            total = episode.terms[k] if total is None else total + episode.terms[k]
    return scene.zeros(n) if total is None else total


def compute_user_term(
    scene: Scene, term: Term, weights: tuple[Number, Number], outcome: Outcome, n: Whole
) -> tuple[Lanes, Lanes]:
    """Return a term from outside this package, which may have constants and rows of its own, under two
    weights. The rows are written under the first.

    Its rows have their former values where the engine failed: its inputs may be NaN there.
    """
    now = scene.kept_rows(n)
    count = scene.layouts.own_rows if term.state else 0
    before = [now[row] for row in range(count)]
    stateful = term.name if term.state else ""
    compute = foreign(term.title, term.compute, stateful=stateful, legs=scene.layouts.legs)
    found: Lanes = compute(outcome, weights[0], *scene.constants(term.constants))
    after = [now[row] for row in range(count)]
    for row in range(count):
        now[row] = before[row]
    other: Lanes = compute(outcome, weights[1], *scene.constants(term.constants))
    works = has_moved(outcome.trunk.result)
    for row in range(count):
        now[row] = where(works, after[row], before[row])
    return found, other


def clear_failed(outcome: Outcome, episode: Episode, k: int) -> None:
    """Set a term to 0 where the engine failed: reports that it may read are of the point of failure."""
    episode.terms[k] = where(has_moved(outcome.trunk.result), episode.terms[k], 0.0)
