"""Kernels of the observation: all entries of a task in one kernel."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hoof_env.dynamics.advance import LANES, MODEL
from hoof_env.dynamics.layout import Features
from hoof_env.envs.addresses import AT, BEGIN, END, memories
from hoof_env.envs.frames_kernel import publisher
from hoof_env.simd import full_like, loop, rows, set_lane, when, where, write
from hoof_env.simd.compile import Kernel, inline_llvm, inline_source
from hoof_env.simd.kept import Kernels
from hoof_env.simd.math import clip, tanh
from hoof_env.simd.memory import address, doubles, matrix_at, offset, record_at, singles_at
from hoof_env.simd.noise import uniform
from hoof_env.simd.user_functions import inline_foreign, number_of, scalar_part
from hoof_env.simd.values import Index
from hoof_env.tasks.body import BodyKernels
from hoof_env.tasks.episode import Memories, memories_of, task_type
from hoof_env.tasks.observation import Entry, ObservationInputs
from hoof_env.tasks.own_parts import Own


def slots_of(entries: tuple[Entry, ...]) -> tuple[list[int], int, int]:
    """Return the slots in which entries are scaled, the number of vectors of those that saturate, and the
    number of slots. Entries that saturate have the first slots, filled up to whole vectors."""
    saturating = [k for k, entry in enumerate(entries) if entry.scale.saturates]
    others = [k for k, entry in enumerate(entries) if not entry.scale.saturates]
    vectors = -(-len(saturating) // LANES)
    slots = {k: slot for slot, k in enumerate(saturating)}
    slots |= {k: vectors * LANES + slot for slot, k in enumerate(others)}
    return [slots[k] for k in range(len(entries))], vectors, vectors * LANES + len(others)


def room_of(slots: int) -> int:
    """Return the room for the numbers of all slots, whole vectors, so that what follows is aligned, too. An
    observation needs it twice."""
    return -(-slots // LANES) * LANES


def constants_reader(places: tuple[int, ...]) -> Callable[..., Any]:
    """Return a function for kernels that reads constants from the task's record, as a tuple."""
    if not places:
        return inline_llvm(lambda task: ())
    (first, *others) = places
    rest = constants_reader(tuple(others))
    return inline_llvm(lambda task: (task.constants[first], *rest(task)))


def _put_all(entries: tuple[Entry, ...], layouts: Memories, scaled: bool, constants: tuple[str, ...]) -> Any:
    """Return a part of kernels that puts the observed entries into their slots: scaled except for tanh, or as
    measured. It takes a tuple of `addresses, lanes, scene, numbers, n`."""
    puts = [
        (
            _put_foreign(entry, slot, layouts, scaled, constants)
            if is_foreign(entry)
            else _put(entry, slot, scaled)
        )
        for entry, slot in zip(entries, slots_of(entries)[0], strict=True)
    ]

    def put_all(*arguments):  # type: ignore[no-untyped-def]
        for put in puts:
            put(*arguments)

    return put_all


def _put(entry: Entry, slot: int, scaled: bool) -> Callable[..., Any]:
    """Return a part of kernels that puts one entry of this package into its slot."""
    measure = inline_llvm(entry.measure)
    scale = inline_llvm(entry.scale.apply) if scaled and entry.scale.apply is not None else None

    def put(addresses, lanes, scene, numbers, n):  # type: ignore[no-untyped-def]
        if scene.task.observation_columns[slot] >= 0:
            number = measure(scene)
            numbers[slot] = number if scale is None else scale(number, scene)

    return put


def _put_foreign(
    entry: Entry, slot: int, layouts: Memories, scaled: bool, constants: tuple[str, ...]
) -> Callable[..., Any]:
    """Return the same for an entry from outside this package, with checks that its functions return numbers;
    lane by lane if they take no lanes."""
    adapt = scalar_part if entry.scalar else (lambda function: function)
    measure = inline_foreign(adapt(entry.measure))
    given = constants_reader(tuple(constants.index(one.name) for one in entry.constants))
    apply = entry.scale.apply
    scale = inline_foreign(adapt(apply)) if scaled and apply is not None else inline_llvm(lambda x, scene: x)
    number = number_of(entry.title)
    scaled_number = number_of(f"the scale of {entry.title}")

    @inline_llvm
    def put_entry(addresses, lanes, scene, numbers, n):  # type: ignore[no-untyped-def]
        if scene.task.observation_columns[slot] >= 0:
            numbers[slot] = scaled_number(scale(number(measure(scene, *given(scene.task))), scene))

    # For users' functions of ordinary numbers: each lane has memory views of its own.
    @inline_llvm
    def put_one_by_one(addresses, lanes, scene, numbers, n):  # type: ignore[no-untyped-def]
        if scene.task.observation_columns[slot] >= 0:
            for lane in loop(Index(str(lanes))):
                trunk, leg, episode = memories(addresses, 0, layouts, n + lane)
                own = ObservationInputs(
                    trunk, leg, episode, scene.task, scene.ground, scene.ground_origin, scene.ground_per_metre
                )
                measured = number(measure(own, *given(own.task)))
                set_lane(numbers, slot, lane, scaled_number(scale(measured, own)))

    return put_one_by_one if entry.scalar else put_entry


class Observers(Kernels):
    """Kernels of the observation, which tasks with the same entries share; their arguments are those of
    `step.StepKernels`.

    Attributes:
        observe_one, observe_batch: kernels that observe without a step.
        measure_one: kernel that writes the entries before scaling into an array of doubles, shape (count,
            columns).
        observe: part of other kernels that observes row n and, with lanes, its neighbours.
    """

    observe_one: Any
    observe_batch: Any
    measure_one: Any
    observe: Any


def functions_of(entry: Entry) -> list[Callable[..., Any]]:
    """Return the functions of an entry: of its measurement and its scale."""
    return [part for part in (entry.measure, entry.scale.apply) if part]


def is_foreign(entry: Entry) -> bool:
    """True for an entry with a function that is not of this package."""
    return bool(from_outside(functions_of(entry)))


def from_outside(functions: list[Callable[..., Any]]) -> list[Callable[..., Any]]:
    """Return the functions that are not of this package."""
    return [function for function in functions if not str(function.__module__).startswith("hoof_env.")]


def observers_of(
    entries: tuple[Entry, ...],
    terms: int,
    features: Features,
    body: BodyKernels,
    own: Own,
    task: tuple[tuple[str, Any], ...],
    model: tuple[tuple[str, Any], ...],
) -> Observers:
    """Return the kernels of the observation for some entries.

    Args:
        entries: entries that can be observed.
        terms: number of the reward's terms, for the layout of the episode's memory.
        features: features of the engine.
        body: the body's own parts.
        own: what terms and entries declare.
        task, model: what is known of the records of task and engine when kernels are traced.
    """
    layouts = memories_of(body.episode, terms, features, body.legs, own)
    slots = slots_of(entries)[2]
    room = room_of(slots)
    task_record = task_type(terms, slots, layouts.gait, (*body.task_fields, *own.fields))
    put_measured = _put_all(entries, layouts, False, own.constants)
    inputs_of = inputs_reader(layouts, model)
    put_scaled = _put_all(entries, layouts, True, own.constants)
    observe = _observe(slots_of(entries)[1:], layouts, inputs_of, put_scaled)
    task_at = record_at(task_record, task)

    def observer(name: str, lanes: int) -> Kernel:
        def observe_all(addresses):  # type: ignore[no-untyped-def]
            task = task_at(addresses[AT.task])
            memory = doubles(2 * room * lanes)
            for n in loop(addresses[BEGIN], addresses[END], lanes):
                observe(addresses, lanes, task, n, memory, 0)

        observe_all.__name__ = name
        return Kernel(observe_all, ["addresses"])

    def measure_one(addresses, out, size):  # type: ignore[no-untyped-def]
        task = task_at(addresses[AT.task])
        numbers = rows(doubles(slots), 1, None)
        for n in loop(size):
            put_measured(addresses, 1, inputs_of(addresses, 1, task, n), numbers, n)
            for slot in range(slots):
                column = task.observation_columns[slot]
                if column >= 0:
                    write(numbers[slot], out, column * size + n, 1)

    return Observers(
        observe=observe,
        observe_one=observer("observe_one", 1),
        observe_batch=observer("observe_batch", LANES),
        measure_one=Kernel(measure_one, ["addresses", "pointer", "index"]),
    )


def inputs_reader(layouts: Memories, known: tuple[tuple[str, Any], ...]) -> Callable[..., Any]:
    """Return a part of kernels that makes the inputs of entries in row n and, with lanes, its neighbours."""
    model_at = record_at(MODEL, known)

    @inline_source
    def inputs_of(addresses, lanes, task, n):  # type: ignore[no-untyped-def]
        trunk, leg, episode = memories(addresses, lanes, layouts, n)
        model = model_at(addresses[AT.model])
        ground = matrix_at(addresses, AT.ground)
        return ObservationInputs(
            trunk, leg, episode, task, ground, model.ground_origin, model.ground_per_metre
        )

    return inputs_of


def _add_noise(slots: int, layouts: Memories) -> Callable[..., Any]:
    """Return a part of kernels that adds noise and bias to the numbers in all slots, before they saturate."""

    @inline_source
    def add_noise(addresses, lanes, task, n, numbers, ahead):  # type: ignore[no-untyped-def]
        _, _, episode = memories(addresses, lanes, layouts, n)
        key = full_like(numbers, episode.noise_key)
        now = full_like(numbers, episode.steps + ahead)
        strength = full_like(numbers, episode.strength)
        for slot in range(slots):

            @when(task.noise[slot] + task.bias[slot] > 0.0)
            def _() -> None:
                # A bias is the noise of a time that never comes.
                error = task.noise[slot] * uniform(key, now, slot)
                error = error + task.bias[slot] * uniform(key, -1.0, slot)
                numbers[slot] = numbers[slot] + strength * error

    return add_noise


def _saturate(vectors: int) -> Callable[..., Any]:
    """Return a part of kernels that takes tanh of the first vectors of slots."""

    @inline_llvm
    def saturate(memory, lanes):  # type: ignore[no-untyped-def]
        # All entries that saturate come first, so that one environment takes their tanh in vectors, too.
        if lanes == 1:
            together = rows(memory, LANES, None)
            for k in range(vectors):
                together[k] = tanh(together[k])
        else:
            numbers = rows(memory, lanes, None)
            for k in range(vectors * LANES):
                numbers[k] = tanh(numbers[k])

    return saturate


def _write_true(slots: int, saturate: Callable[..., Any]) -> Callable[..., Any]:
    """Return a part of kernels that observes true numbers, of which `spare` is room for a copy."""

    @inline_source
    def write_true(addresses, lanes, task, n, numbers, spare):  # type: ignore[no-untyped-def]
        true_numbers = rows(spare, lanes, None)
        for slot in range(slots):
            true_numbers[slot] = numbers[slot]
        saturate(spare, lanes)
        observations = singles_at(addresses[AT.observations])
        size = task.observation_size
        for slot in range(slots):
            column = task.privileged_columns[slot]
            if column >= 0:
                write(clip(true_numbers[slot], 1.0), observations, n * size + column, size)

    return write_true


def _observe(
    counts: tuple[int, ...],
    layouts: Memories,
    inputs_of: Callable[..., Any],
    put_scaled: Callable[..., Any],
) -> Callable[..., Any]:
    """Return a part of kernels that writes the observation of row n and, with lanes, of its neighbours. Its
    last argument is 0 at the end of a control step, 1 within it: then only a frame is kept."""
    (vectors, slots) = counts
    add_noise = _add_noise(slots, layouts)
    publish = publisher(layouts)
    room = room_of(slots)
    saturate = _saturate(vectors)
    write_true = _write_true(slots, saturate)

    @inline_source
    def observe(addresses, lanes, task, n, memory, within):  # type: ignore[no-untyped-def]
        numbers = rows(memory, lanes, None)
        # Entries that are not observed, and the slots that fill up vectors, also go through tanh.
        for slot in range(slots):
            numbers[slot] = 0.0
        put_scaled(addresses, lanes, inputs_of(addresses, lanes, task, n), numbers, n)
        if task.has_privileged and within == 0:
            write_true(addresses, lanes, task, n, numbers, offset(memory, room * lanes))
        if task.is_noisy:
            add_noise(addresses, lanes, task, n, numbers, within)
        saturate(memory, lanes)
        to = singles_at(addresses[AT.observations])
        size = task.observation_size
        begin = n * size
        if task.frames > 0:
            to = singles_at(addresses[AT.frames])
            size = task.frames * task.frame_size
            begin = n * size + within * task.frame_size
        for slot in range(slots):
            column = task.observation_columns[slot]
            if column >= 0:
                number = clip(numbers[slot], 1.0)
                # A state within a step that cannot be simulated is observed again only at its end.
                if within > 0:
                    number = where(number == number, number, 0.0)
                write(number, to, begin + column, size)
        if within == 0:
            publish(addresses, lanes, task, n)

    return observe
