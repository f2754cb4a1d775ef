"""Part of the kernels of a step that computes the reward: all terms of a task in one function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hoof_env.dynamics.limits import has_moved
from hoof_env.envs.addresses import AT, memories
from hoof_env.envs.observation_kernel import constants_reader, from_outside
from hoof_env.envs.outcome import outcome_of_one
from hoof_env.simd import columns, loop, where
from hoof_env.simd.compile import inline_llvm
from hoof_env.simd.memory import COLUMNS, doubles_at
from hoof_env.simd.user_functions import inline_foreign, number_of, scalar_part
from hoof_env.simd.values import Index
from hoof_env.tasks.episode import Memories
from hoof_env.tasks.reward import Term

EPISODE = 4
"""Position of the episode's memory in the arguments of a term's part of kernels."""


def is_user_term(term: Term) -> bool:
    """True for a user's term, which may not handle the NaN of a failed simulation. It may have the name of a
    term of this package, which it replaces."""
    return bool(from_outside([term.compute]))


def sum_of_terms(terms: tuple[Term, ...], layouts: Memories, constants: tuple[str, ...] = ()) -> Any:
    """Return a part of kernels that computes the terms, keeps them in `episode.terms` and returns their sum.
    It takes a tuple of `addresses, lanes, task, outcome, episode, n, spare` and the sum of no terms.

    Args:
        terms: terms of the task.
        layouts: layouts of the memory of a step.
        constants: names of the task's constants.
    """
    computes = [
        _foreign_term(term, k, layouts, constants) if is_user_term(term) else _term(term, k)
        for k, term in enumerate(terms)
    ]

    def compute_reward(*arguments):  # type: ignore[no-untyped-def]
        (*inputs, total) = arguments
        of_terms = inputs[EPISODE].terms
        for k, compute in enumerate(computes):
            compute(*inputs)
            total = of_terms[k] if k == 0 else total + of_terms[k]
        return total

    return compute_reward


def _term(term: Term, k: int) -> Callable[..., Any]:
    """Return a part of kernels that computes the k-th term, one of this package."""
    compute = inline_llvm(term.compute)

    def compute_term(addresses, lanes, task, outcome, episode, n, spare):  # type: ignore[no-untyped-def]
        # + 0.0 makes 0 of the -0 that a weight of 0 gives.
        episode.terms[k] = compute(outcome, task.weights[k]) + 0.0

    return compute_term


@inline_llvm
def _do_nothing(addresses, lanes, outcome, n, spare):  # type: ignore[no-untyped-def]
    """Do nothing: the term keeps no rows."""


def _keepers(layouts: Memories) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Return parts of kernels that save the rows which terms keep behind `spare`, and put them back where the
    engine failed: what a term read there may be NaN."""
    first = layouts.own_first
    count = layouts.own_rows
    sums = layouts.sums

    @inline_llvm
    def keep(addresses, lanes, outcome, n, spare):  # type: ignore[no-untyped-def]
        row = addresses[AT.data + COLUMNS]
        now = columns(doubles_at(addresses[AT.episode]), lanes, None, first * row + n, row, 1)
        saved = columns(spare, lanes, None, sums, lanes, 1)
        for k in range(count):
            saved[k] = now[k]

    @inline_llvm
    def put_back(addresses, lanes, outcome, n, spare):  # type: ignore[no-untyped-def]
        row = addresses[AT.data + COLUMNS]
        now = columns(doubles_at(addresses[AT.episode]), lanes, None, first * row + n, row, 1)
        saved = columns(spare, lanes, None, sums, lanes, 1)
        works = has_moved(outcome.trunk.result)
        for k in range(count):
            now[k] = where(works, now[k], saved[k])

    return keep, put_back


def _foreign_term(term: Term, k: int, layouts: Memories, constants: tuple[str, ...]) -> Callable[..., Any]:
    """Return the same for a term from outside this package, which may have constants and keep rows, with a
    check that its function returns a number; lane by lane if it takes no lanes."""
    compute = inline_foreign(scalar_part(term.compute) if term.scalar else term.compute)
    number = number_of(term.title)
    given = constants_reader(tuple(constants.index(one.name) for one in term.constants))
    keep, put_back = _keepers(layouts) if term.keeps else (_do_nothing, _do_nothing)

    @inline_llvm
    def clear_failed(outcome, episode):  # type: ignore[no-untyped-def]
        # Where the engine failed the reports that the term may read are of the point of failure.
        episode.terms[k] = where(has_moved(outcome.trunk.result), episode.terms[k], 0.0)

    @inline_llvm
    def compute_term(addresses, lanes, task, outcome, episode, n, spare):  # type: ignore[no-untyped-def]
        keep(addresses, lanes, outcome, n, spare)
        episode.terms[k] = number(compute(outcome, task.weights[k], *given(task))) + 0.0
        put_back(addresses, lanes, outcome, n, spare)
        clear_failed(outcome, episode)

    @inline_llvm
    def compute_one_by_one(addresses, lanes, task, outcome, episode, n, spare):  # type: ignore[no-untyped-def]
        sums = columns(spare, 0, layouts.stride_sums, 0, 1, 1)
        keep(addresses, lanes, outcome, n, spare)
        for lane in loop(Index(str(lanes))):
            trunk, leg, own = memories(addresses, 0, layouts, n + lane)
            one = outcome_of_one(outcome, lane, trunk, leg, own, layouts, sums)
            own.terms[k] = number(compute(one, task.weights[k], *given(task))) + 0.0
        put_back(addresses, lanes, outcome, n, spare)
        clear_failed(outcome, episode)

    return compute_one_by_one if term.scalar else compute_term
