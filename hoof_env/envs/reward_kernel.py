"""Part of the kernels of a step that computes the reward: all terms of a task in one function."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

from hoof_env.dynamics.limits import has_moved
from hoof_env.envs.addresses import AT, memories
from hoof_env.envs.observation_kernel import constants_reader, from_outside
from hoof_env.envs.outcome import outcome_of_one
from hoof_env.simd import columns, where
from hoof_env.simd.compile import inline_llvm
from hoof_env.simd.memory import COLUMNS, doubles_at
from hoof_env.simd.user_functions import number_of
from hoof_env.tasks.episode import Memories
from hoof_env.tasks.reward import Term


def is_user_term(term: Term) -> bool:
    """True for a user's term, which may not handle the NaN of a failed simulation. It may have the name of a
    term of this package, which it replaces."""
    return bool(from_outside([term.compute]))


def sum_of_terms(
    terms: tuple[Term, ...], layouts: Memories, constants: tuple[str, ...] = (), k: int = 0
) -> Callable[..., Any]:
    """Return a function that computes terms, of which the first is the k-th, keeps them in `episode.terms`
    and returns their sum.

    Terms of this package behind the last one from outside are compiled once for all tasks with them.

    Args:
        terms: terms of the task, from the k-th on.
        layouts: layouts of the memory of a step.
        constants: names of the task's constants.
        k: number of the first term.
    """
    if not terms:
        return inline_llvm(lambda addresses, lanes, task, outcome, episode, n, spare, total: total)
    is_ours = not from_outside([term.compute for term in terms])
    return (_our_terms if is_ours else _first_and_rest)(terms, layouts, () if is_ours else constants, k)


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


def _first_and_rest(
    terms: tuple[Term, ...], layouts: Memories, constants: tuple[str, ...], k: int
) -> Callable[..., Any]:
    """Return the function for at least one term. numba has no loop over functions, so each calls the next."""
    term = terms[0]
    rest = sum_of_terms(terms[1:], layouts, constants, k + 1)
    compute = inline_llvm(term.compute)
    is_first = k == 0
    is_scalar = term.scalar
    is_from_outside = is_user_term(term)
    number = number_of(term.title)
    given = constants_reader(tuple(constants.index(one.name) for one in term.constants))
    keep, put_back = _keepers(layouts) if term.keeps else (_do_nothing, _do_nothing)

    @inline_llvm
    def add_term(addresses, lanes, task, outcome, episode, n, spare, total):  # type: ignore[no-untyped-def]
        # Where the engine failed the reports that a user's term may read are of the point of failure.
        if is_from_outside:
            works = has_moved(outcome.trunk.result)
            episode.terms[k] = where(works, episode.terms[k], 0.0)
        total = episode.terms[k] if is_first else total + episode.terms[k]
        return rest(addresses, lanes, task, outcome, episode, n, spare, total)

    @inline_llvm
    def compute_term(addresses, lanes, task, outcome, episode, n, spare, total):  # type: ignore[no-untyped-def]
        # + 0.0 makes 0 of the -0 that a weight of 0 gives.
        keep(addresses, lanes, outcome, n, spare)
        episode.terms[k] = number(compute(outcome, task.weights[k], *given(task))) + 0.0
        put_back(addresses, lanes, outcome, n, spare)
        return add_term(addresses, lanes, task, outcome, episode, n, spare, total)

    @inline_llvm
    def compute_one_by_one(addresses, lanes, task, outcome, episode, n, spare, total):  # type: ignore[no-untyped-def]
        sums = columns(spare, 0, layouts.stride_sums, 0, 1, 1)
        keep(addresses, lanes, outcome, n, spare)
        for lane in range(lanes):
            trunk, leg, own = memories(addresses, 0, layouts, n + lane)
            one = outcome_of_one(outcome, lane, trunk, leg, own, layouts, sums)
            own.terms[k] = number(compute(one, task.weights[k], *given(task))) + 0.0
        put_back(addresses, lanes, outcome, n, spare)
        return add_term(addresses, lanes, task, outcome, episode, n, spare, total)

    return compute_one_by_one if is_scalar else compute_term


_our_terms = lru_cache(maxsize=64)(_first_and_rest)
"""Functions for terms of this package, which tasks share."""
