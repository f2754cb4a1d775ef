"""Parts of the kernels of a step that observe: all entries of a task, scaled, with noise, and saturated."""

from __future__ import annotations

from typing import Any

from hoof_env.dynamics.advance import LANES
from hoof_env.episodes.frames_kernel import publish
from hoof_env.episodes.scene import Scene, functions_of, is_from_outside
from hoof_env.simd import Lanes, Whole, apply_to_rows, full_like, loop, new_rows, rolled, when, where, write
from hoof_env.simd.math import clip, tanh
from hoof_env.simd.noise import uniform
from hoof_env.simd.user_functions import foreign
from hoof_env.simd.values import rounded
from hoof_env.tasks.observation import Entry, ObservationInputs


def is_user_entry(entry: Entry) -> bool:
    """Return True for an entry with a function that is not of this package."""
    return any(map(is_from_outside, functions_of(entry)))


def put_entries(scene: Scene, numbers: Any, n: Whole, scaled: bool) -> None:
    """Put the observed entries into their slots: scaled except for tanh, or as measured."""
    inputs = scene.inputs(n)
    for entry, slot in zip(scene.kind.entries, scene.kind.slots.places, strict=True):
        if scene.task.observation_columns[slot] >= 0:
            numbers[slot] = measure(scene, entry, inputs, scaled)


def measure(scene: Scene, entry: Entry, inputs: ObservationInputs, scaled: bool) -> Any:
    """Return an entry, scaled except for tanh, or as measured; what a user's function returns is checked."""
    compute, scale = entry.measure, entry.scale.apply if scaled else None
    if not is_user_entry(entry):
        number = rounded(compute(inputs))
        return number if scale is None else scale(number, inputs)
    legs = scene.layouts.legs
    number = foreign(entry.title, compute, legs=legs)(inputs, *scene.constants(entry.constants))
    if scale is None:
        return number
    return foreign(f"the scale of {entry.title}", scale, legs=legs)(number, inputs)


def add_noise(scene: Scene, numbers: Any, n: Whole, ahead: int) -> None:
    """Add noise and bias to the numbers in all slots, before they saturate."""
    task = scene.task
    episode = scene.episode(n)
    key = full_like(numbers, episode.noise_key)
    now = full_like(numbers, episode.steps + float(ahead))
    strength = full_like(numbers, episode.strength)
    for slot in loop(rolled(scene.kind.slots.count)):

        @when(task.noise[slot] + task.bias[slot] > 0.0)
        def _(slot: Whole = slot) -> None:
            # a bias is the noise of a time that never comes
            error = task.noise[slot] * uniform(key, now, slot)
            error = error + task.bias[slot] * uniform(key, -1.0, slot)
            numbers[slot] = numbers[slot] + strength * error


def saturate(scene: Scene, numbers: Any) -> None:
    """Take tanh of the first slots: one environment takes it in vectors, too."""
    apply_to_rows(numbers, scene.kind.slots.vectors * LANES, tanh, LANES)


def write_true(scene: Scene, numbers: Any, n: Whole, spare: Any) -> None:
    """Observe true numbers, of which `spare` is room for a copy."""
    slots = scene.kind.slots.count
    for slot in range(slots):
        spare[slot] = numbers[slot]
    saturate(scene, spare)
    size = scene.task.observation_size
    for slot in range(slots):
        column = scene.task.privileged_columns[slot]
        if column >= 0:
            write(clip(spare[slot], 1.0), scene.observations, n * size + column, size)


class Observer:
    """Observation of row n and, with lanes, of its neighbours.

    Args:
        scene: scene of the step.
    """

    def __init__(self, scene: Scene) -> None:
        # whole vectors, for `saturate`
        room = -(-scene.kind.slots.count // LANES) * LANES
        self.scene = scene
        self.numbers = new_rows(None, scene.lanes, room)
        self.spare = new_rows(None, scene.lanes, room) if scene.task.has_privileged else None

    def __call__(self, n: Whole, within: bool = False) -> None:
        """Observe at the end of a control step or, if `within`, in it, for a frame alone."""
        scene, numbers = self.scene, self.numbers
        task = scene.task
        slots = scene.kind.slots.count
        # entries that are not observed, and the slots that fill up vectors, also go through tanh
        for slot in range(slots):
            numbers[slot] = 0.0
        put_entries(scene, numbers, n, scaled=True)
        if self.spare is not None and not within:
            write_true(scene, numbers, n, self.spare)
        when(task.is_noisy)(lambda: add_noise(scene, numbers, n, int(within)))
        saturate(scene, numbers)
        to, size, begin = scene.observations, task.observation_size, n * task.observation_size
        if task.frames > 0:
            to, size = scene.frames, task.frames * task.frame_size
            begin = n * size + int(within) * task.frame_size
        for slot in range(slots):
            column = task.observation_columns[slot]
            if column >= 0:
                number: Lanes = clip(numbers[slot], 1.0)
                # a state within a step that cannot be simulated is observed again only at its end
                if within:
                    number = where(number == number, number, 0.0)
                write(number, to, begin + column, size)
        if not within:
            publish(scene, n)
