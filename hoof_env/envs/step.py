"""A control step, in five verbs: apply the action, advance the engine, compute the reward, decide whether the
episode goes on, observe.

One source for one environment and for `LANES` side by side, so that a row of a batch has the bits of the
environment alone. The terms of the reward and the entries of the observation are those of a task (`reward`,
`observation`); all arrays are reached from one array of addresses, for a call from Python with as many
arguments costs more than a step."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from hoof_env.dynamics.advance import LANES, MODEL, advance_kernels
from hoof_env.dynamics.layout import PLAIN, Features
from hoof_env.dynamics.limits import has_moved
from hoof_env.envs.episode import ACTIONS, FAILED, TRUNCATED, Memories, memories_of, task_type
from hoof_env.envs.horse_rows import HORSE_TERMS
from hoof_env.envs.observation import Entry, Scene
from hoof_env.envs.outcome import add_up, decide, find_outcome, outcome_of_one
from hoof_env.envs.reference import ROOM, command_gait, refer_to_target
from hoof_env.envs.reward import TERMS, Term
from hoof_env.simd import anywhere, choose, columns, larger, level, read, rows, set_lane, size, smaller, write
from hoof_env.simd.compile import inlined, kernel, pasted
from hoof_env.simd.kept import Kept, Kernels
from hoof_env.simd.math import clip, tanh
from hoof_env.simd.memory import (
    COLUMNS,
    Addresses,
    address,
    cube_at,
    doubles,
    doubles_at,
    matrix_at,
    record_at,
    singles_at,
)
from hoof_env.simd.reach import fingerprint, refresh
from hoof_env.simd.user_functions import number_of

NOT_A_NUMBER, SOME_ENDED, SOME_SWITCHED = -1, 1, 2
"""What a step returns: an action is none, and nothing has happened; else the sum of what happened
somewhere."""

ADDRESSES = Addresses(
    "data", "model", "tables", "ground", "constants", "reactions", "episode", "task", "actions",
    "observations", "rewards",
)  # fmt: skip
"""The arrays of a step, those of the engine first."""

AT, BEGIN, END = ADDRESSES.slots, ADDRESSES.begin, ADDRESSES.end
SHIPPED = tuple(term.name for term in TERMS)


def is_own(term: Term) -> bool:
    """Whether a term is from outside the package, so that nobody knows what it does with broken reports."""
    return term.name not in SHIPPED and term not in HORSE_TERMS


@inlined
def apply_action(task, actions, leg, n):  # type: ignore[no-untyped-def]
    """Command the rates that an action asks for, from where the gait is heading and within the limits."""
    for k in range(ACTIONS):
        action = clip(read(leg, actions, n * ACTIONS + k, ACTIONS), 1.0)
        heading = leg.state.gait[k] + task.lead * leg.state.gait_rate[k]
        command = heading + task.reach[k] * action
        leg.command[k] = smaller(larger(command, task.low[k]), task.high[k])


@inlined
def memories(addresses, lanes, layouts, n):  # type: ignore[no-untyped-def]
    """Trunk, leg and episode of environments n, n + 1, ..., as `lanes` columns, see `simd.columns`."""
    row = addresses[AT.data + COLUMNS]
    data, episode = doubles_at(addresses[AT.data]), doubles_at(addresses[AT.episode])
    return (
        columns(data, lanes, layouts.trunk, n, row, 1),
        columns(data, lanes, layouts.leg, layouts.trunk_rows * row + n, row, 1),
        columns(episode, lanes, layouts.episode, n, row, 1),
    )


def _with_terms(terms: tuple[Term, ...], layouts: Memories, k: int = 0) -> Callable[..., Any]:
    """A function that computes terms, of which the first is the k-th, keeps them in `episode.terms` and
    returns the sum of all. Those of this package behind the last from outside are compiled once for all tasks
    that have them there."""
    if not terms:
        return inlined(lambda addresses, lanes, task, outcome, episode, n, total: total)
    is_ours = not _from_outside([term.compute for term in terms])
    return (_our_terms if is_ours else _first_and_rest)(terms, layouts, k)


def _first_and_rest(terms: tuple[Term, ...], layouts: Memories, k: int) -> Callable[..., Any]:
    """The same of one term at least. numba has no loop over functions, so each calls the next."""
    term, rest = terms[0], _with_terms(terms[1:], layouts, k + 1)
    compute, is_first, is_scalar = inlined(term.compute), k == 0, term.scalar
    from_outside, number = is_own(term), number_of(term.title)

    @inlined
    def add_term(addresses, lanes, task, outcome, episode, n, total):  # type: ignore[no-untyped-def]
        if from_outside:
            works = has_moved(outcome.trunk.result)  # else the reports that it may read are of where it broke
            episode.terms[k] = choose(works, episode.terms[k], 0.0)
        total = episode.terms[k] if is_first else total + episode.terms[k]
        return rest(addresses, lanes, task, outcome, episode, n, total)

    @inlined
    def compute_term(addresses, lanes, task, outcome, episode, n, total):  # type: ignore[no-untyped-def]
        episode.terms[k] = number(compute(outcome, task.weights[k])) + 0.0  # no -0 where it weighs nothing
        return add_term(addresses, lanes, task, outcome, episode, n, total)

    @inlined
    def compute_one_by_one(addresses, lanes, task, outcome, episode, n, total):  # type: ignore[no-untyped-def]
        for lane in range(lanes):
            trunk, leg, own = memories(addresses, 0, layouts, n + lane)
            one = outcome_of_one(outcome, lane, trunk, leg, own)
            own.terms[k] = number(compute(one, task.weights[k])) + 0.0
        return add_term(addresses, lanes, task, outcome, episode, n, total)

    return compute_one_by_one if is_scalar else compute_term


_our_terms = lru_cache(maxsize=64)(_first_and_rest)
"""The same for terms of this package."""


def slots_of(entries: tuple[Entry, ...]) -> tuple[list[int], int, int]:
    """Where the entries stand while they are scaled: those that saturate first, as whole vectors. Returns the
    slots of the entries, how many vectors they are, and how many slots there are."""
    saturating = [k for k, entry in enumerate(entries) if entry.scale.saturates]
    others = [k for k, entry in enumerate(entries) if not entry.scale.saturates]
    vectors = -(-len(saturating) // LANES)
    slots = {k: slot for slot, k in enumerate(saturating)}
    slots |= {k: vectors * LANES + slot for slot, k in enumerate(others)}
    return [slots[k] for k in range(len(entries))], vectors, vectors * LANES + len(others)


def _with_entries(entries: tuple[Entry, ...], layouts: Memories, scaled: bool) -> Callable[..., Any]:
    """A function that puts the entries that are observed into their slots: scaled but for tanh, or as they
    are measured. Those of this package are compiled once for all tasks that have them in these slots."""
    placed = tuple(zip(entries, slots_of(entries)[0], strict=True))
    ours = tuple(one for one in placed if not _from_outside(_functions_of(one[0])))
    own = tuple(one for one in placed if one not in ours)
    if not own or not ours:
        return (_put_ours if ours else _put_all)(placed, layouts, scaled)
    return _one_and_other(_put_ours(ours, layouts, scaled), _put_all(own, layouts, scaled))


def _put_all(placed: tuple[tuple[Entry, int], ...], layouts: Memories, scaled: bool) -> Callable[..., Any]:
    """A function that puts entries into the slots beside them. numba has no loop over functions, so each half
    is a function of its own."""
    if len(placed) == 1:
        return _with_entry(*placed[0], layouts, scaled)
    middle = len(placed) // 2
    halves = (_put_all(half, layouts, scaled) for half in (placed[:middle], placed[middle:]))
    return _one_and_other(*halves)


_put_ours = lru_cache(maxsize=32)(_put_all)
"""The same for entries of this package."""


def _one_and_other(one: Callable[..., Any], other: Callable[..., Any]) -> Callable[..., Any]:
    @inlined
    def put_both(addresses, lanes, scene, numbers, n):  # type: ignore[no-untyped-def]
        one(addresses, lanes, scene, numbers, n)
        other(addresses, lanes, scene, numbers, n)

    return put_both


def _with_entry(entry: Entry, slot: int, layouts: Memories, scaled: bool) -> Callable[..., Any]:
    measure, apply = inlined(entry.measure), entry.scale.apply
    scale = inlined(apply) if scaled and apply is not None else inlined(lambda x, scene: x)
    number, scaled_number = number_of(entry.title), number_of(f"the scale of {entry.title}")

    @inlined
    def put_entry(addresses, lanes, scene, numbers, n):  # type: ignore[no-untyped-def]
        if scene.task.places[slot] >= 0:
            numbers[slot] = scaled_number(scale(number(measure(scene)), scene))

    @inlined
    def put_one_by_one(addresses, lanes, scene, numbers, n):  # type: ignore[no-untyped-def]
        if scene.task.places[slot] >= 0:
            for lane in range(lanes):
                trunk, leg, episode = memories(addresses, 0, layouts, n + lane)
                own = Scene(
                    trunk, leg, episode, scene.task, scene.ground, scene.ground_origin, scene.ground_per_metre
                )
                set_lane(numbers, slot, lane, scaled_number(scale(number(measure(own)), own)))

    return put_one_by_one if entry.scalar else put_entry


class Observers(Kernels):
    """Kernels of the observation, which tasks with the same entries share; they take what those of
    `StepKernels` take.

    Attributes:
        observe_one, observe_batch: observations without a step.
        measure_one: puts what is observed, before it is scaled, into an array of doubles, shape (count,
            columns).
        observe: a part of other kernels; observes n and, with lanes, its neighbours.
    """

    observe_one: Any
    observe_batch: Any
    measure_one: Any
    observe: Any


class StepKernels(Kernels):
    """Kernels of a task: each takes the array of `ADDRESSES`. What ends in `_one` goes through the
    environments one by one, what ends in `_batch` takes `LANES` at a time.

    Attributes:
        step_one, step_batch: a control step; returns what `NOT_A_NUMBER` and the others say.
        apply_one, finish_one: what is before and behind the engine, for a solver that is not a kernel.
        observers: of the observation alone.
    """

    step_one: Any
    step_batch: Any
    apply_one: Any
    finish_one: Any
    observers: Observers


_KEPT, _OBSERVERS = Kept(), Kept()


def step_kernels(
    terms: tuple[Term, ...],
    entries: tuple[Entry, ...],
    contact_law: Callable[..., Any] | None,
    features: Features = PLAIN,
    legs: int = 1,
) -> StepKernels:
    """The kernels of tasks with these terms, entries and law of contact, on an engine of this kind with one
    leg, or with a horse's four. `ParameterError` where one of their functions reaches what cannot be read."""
    what = terms, entries, contact_law, features, legs
    own = _from_outside(_functions(terms, entries, contact_law))
    now = fingerprint(*own)  # what a function names may be another's by now, as in a notebook
    found: StepKernels = _KEPT.get((*what, now), lambda: _made(own, *what), bool(own))
    return found


def _functions(
    terms: tuple[Term, ...], entries: tuple[Entry, ...], contact_law: Callable[..., Any] | None
) -> list[Callable[..., Any]]:
    """All that a task gives to its kernels."""
    parts: list[Any] = [term.compute for term in terms]
    parts += [part for entry in entries for part in _functions_of(entry)]
    return [*parts, contact_law] if contact_law else parts


def _functions_of(entry: Entry) -> list[Callable[..., Any]]:
    return [part for part in (entry.measure, entry.scale.apply) if part]


def _from_outside(functions: list[Callable[..., Any]]) -> list[Callable[..., Any]]:
    """Those that are not of this package."""
    return [function for function in functions if not str(function.__module__).startswith("hoof_env.")]


def _observers(entries: tuple[Entry, ...], terms: int, features: Features, legs: int) -> Observers:
    """The kernels of entries, beside so many terms."""
    layouts = memories_of(terms, features, legs)
    _, vectors, slots = slots_of(entries)
    task_record = task_type(terms, slots, layouts.gait, legs)
    flags = [(entry.scalar, entry.scale.saturates) for entry in entries], (terms, features, legs)
    parts = [part for entry in entries for part in _functions_of(entry)]
    identity = fingerprint(*parts, flags, layouts.episode.names, str(task_record.descr))
    put_scaled, put_measured = (_with_entries(entries, layouts, scaled) for scaled in (True, False))
    task_at, model_at = record_at(task_record), record_at(MODEL)

    @pasted
    def scene_of(addresses, lanes, task, n):  # type: ignore[no-untyped-def]
        trunk, leg, episode = memories(addresses, lanes, layouts, n)
        model, ground = model_at(addresses[AT.model])[0], matrix_at(addresses, AT.ground)
        return Scene(trunk, leg, episode, task, ground, model.ground_origin, model.ground_per_metre)

    @pasted
    def observe(addresses, lanes, task, n, memory):  # type: ignore[no-untyped-def]
        numbers = rows(memory, lanes, None)
        for slot in range(slots):
            numbers[slot] = 0.0
        put_scaled(addresses, lanes, scene_of(addresses, lanes, task, n), numbers, n)
        if lanes == 1:  # the numbers of one environment, side by side
            together = rows(memory, LANES, None)
            for k in range(vectors):
                together[k] = tanh(together[k])
        else:
            for k in range(vectors * LANES):
                numbers[k] = tanh(numbers[k])
        observations = singles_at(addresses[AT.observations])
        for slot in range(slots):
            place = task.places[slot]
            if place >= 0:
                write(clip(numbers[slot], 1.0), observations, n * task.count + place, task.count)

    @pasted
    def observe_all(addresses, lanes):  # type: ignore[no-untyped-def]
        task, memory = task_at(addresses[AT.task])[0], doubles(slots * lanes)
        for n in range(addresses[BEGIN], addresses[END], lanes):
            observe(addresses, lanes, task, n, memory)

    def observe_one(addresses):  # type: ignore[no-untyped-def]
        observe_all(addresses, 1)

    def observe_batch(addresses):  # type: ignore[no-untyped-def]
        observe_all(addresses, LANES)

    def measure_one(addresses, out):  # type: ignore[no-untyped-def]
        task, numbers = task_at(addresses[AT.task])[0], rows(doubles(slots), 1, None)
        for n in range(out.shape[1]):
            put_measured(addresses, 1, scene_of(addresses, 1, task, n), numbers, n)
            for slot in range(slots):
                if task.places[slot] >= 0:
                    write(numbers[slot], address(out), task.places[slot] * out.shape[1] + n, 1)

    functions = observe_one, observe_batch, measure_one
    return Observers(
        observe=observe, **{function.__name__: kernel(function, identity) for function in functions}
    )


def _made(
    own: list[Callable[..., Any]],
    terms: tuple[Term, ...],
    entries: tuple[Entry, ...],
    contact_law: Callable[..., Any] | None,
    features: Features,
    legs: int,
) -> StepKernels:
    refresh(*own)
    flags = (
        [(term.scalar, not is_own(term)) for term in terms],
        [(entry.scalar, entry.scale.saturates) for entry in entries],
    )
    parts = _functions(terms, entries, contact_law)
    layouts = memories_of(len(terms), features, legs)
    identity = fingerprint(*parts, flags, layouts.episode.names, (FAILED, TRUNCATED))
    if features != PLAIN:
        identity += f" {tuple(features)}"
    slots = slots_of(entries)[2]
    task_record = task_type(len(terms), slots, layouts.gait, legs)
    if legs > 1:
        identity += f" {legs} legs, {task_record.descr}"  # how many gaits there are is data
    compute_reward = _with_terms(terms, layouts)
    of_entries = _from_outside([part for entry in entries for part in _functions_of(entry)])
    observers: Observers = _OBSERVERS.get(
        (entries, len(terms), features, legs, fingerprint(*of_entries)),
        lambda: _observers(entries, len(terms), features, legs), bool(of_entries),
    )  # fmt: skip
    observe = observers.observe
    advance = advance_kernels(contact_law, features)
    advance_one = advance.advance_leg if legs == 1 else advance.advance_four
    advance_batch = advance.advance_batch
    task_at, model_at = record_at(task_record), record_at(MODEL)

    @pasted
    def are_numbers(addresses):  # type: ignore[no-untyped-def]
        """Whether all actions are, those of other blocks, too."""
        actions, count, good = singles_at(addresses[AT.actions]), addresses[AT.data + COLUMNS], True
        for k in range(count * (legs * ACTIONS)):
            good &= size(float(actions[k])) < np.inf
        return good

    @pasted
    def apply_actions(addresses, lanes, task, n, room):  # type: ignore[no-untyped-def]
        _, leg, episode = memories(addresses, lanes, layouts, n)
        actions = singles_at(addresses[AT.actions])
        if legs == 1:
            apply_action(task, actions, leg, n)
        else:
            command_gait(task, actions, episode, leg, layouts.gait, n, rows(room, lanes, None))

    @pasted
    def finish(addresses, lanes, task, n, memory):  # type: ignore[no-untyped-def]
        """What follows the engine: reward, end and observation."""
        happened = 0
        trunk, leg, episode = memories(addresses, lanes, layouts, n)
        outcome = find_outcome(task, trunk, leg, episode, layouts)
        add_up(outcome, episode)
        ended, switched = decide(task, outcome, episode)
        if legs > 1:
            refer_to_target(task, episode, switched)
        nothing = level(episode, 0.0)
        reward = compute_reward(addresses, lanes, task, outcome, episode, n, nothing)
        write(reward, doubles_at(addresses[AT.rewards]), n, 1)
        if anywhere(ended):
            happened |= SOME_ENDED
        if anywhere(switched):
            happened |= SOME_SWITCHED
        observe(addresses, lanes, task, n, memory)
        return happened

    @pasted
    def step(addresses, lanes, advance):  # type: ignore[no-untyped-def]
        """One group of lanes after the other, whose memory stays in the cache from action to observation."""
        if not are_numbers(addresses):
            return NOT_A_NUMBER
        task, happened = task_at(addresses[AT.task])[0], 0
        room, memory = doubles(ROOM * lanes), doubles(slots * lanes)
        for n in range(addresses[BEGIN], addresses[END], lanes):
            apply_actions(addresses, lanes, task, n, room)
            advance(
                matrix_at(addresses, AT.data), model_at(addresses[AT.model]), matrix_at(addresses, AT.tables),
                matrix_at(addresses, AT.ground), matrix_at(addresses, AT.constants),
                cube_at(addresses, AT.reactions), task.h, task.substeps, False, n, n + lanes,
            )  # fmt: skip
            happened |= finish(addresses, lanes, task, n, memory)
        return happened

    def step_one(addresses):  # type: ignore[no-untyped-def]
        return step(addresses, 1, advance_one)

    def step_batch(addresses):  # type: ignore[no-untyped-def]
        return step(addresses, LANES, advance_batch)

    def apply_one(addresses):  # type: ignore[no-untyped-def]
        task, room, good = task_at(addresses[AT.task])[0], doubles(ROOM), are_numbers(addresses)
        if good:
            for n in range(addresses[BEGIN], addresses[END]):
                apply_actions(addresses, 1, task, n, room)
        return good

    def finish_one(addresses):  # type: ignore[no-untyped-def]
        task, memory, happened = task_at(addresses[AT.task])[0], doubles(slots), 0
        for n in range(addresses[BEGIN], addresses[END]):
            happened |= finish(addresses, 1, task, n, memory)
        return happened

    functions = step_one, step_batch, apply_one, finish_one
    return StepKernels(
        observers=observers,
        **{function.__name__: kernel(function, identity, function is step_batch) for function in functions},
    )
