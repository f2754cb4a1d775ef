"""Scene of the kernels of a control step: parts of a task's kernels, and the memory on which they work."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from hoof_env.dynamics.advance import ARRAYS, LANES, EngineKind
from hoof_env.dynamics.layout import LegMemory, TrunkMemory
from hoof_env.simd import Lanes, Pointer, Whole, columns, full_like
from hoof_env.simd.layout import Block
from hoof_env.simd.memory import Arrays, Given, RecordType
from hoof_env.tasks.body import BodyKernels
from hoof_env.tasks.episode import ACTIONS, Episode, Memories, memories_of, task_type
from hoof_env.tasks.observation import LATE, Entry, ObservationInputs
from hoof_env.tasks.reward import Term
from hoof_env.tasks.user_parts import ActionMap, Constant, Declarations, declared_by

STEP_ARRAYS = {
    "episode": "f8",
    "task": "",
    "actions": "f4",
    "observations": "f4",
    "rewards": "f8",
    "acted": "f4",
    "past_actions": "f4",
    "frames": "f4",
    "mapped": "f4",
    "unweighted": "f8",
}
"""Types of the arrays of a step, besides the engine's. `acted` are the actions that act now, the same
array as `actions` where nothing delays them; `mapped` are actions of the body, the same array as `acted`
without a user's map. `unweighted` are the reward's terms with a weight of 1, shape (terms, columns)."""

CHANGING = ("episode_steps", "substeps", "part_substeps", "is_noisy")
"""Whole numbers and booleans of a task's record that kernels read when they run: settings may change them."""


def known_of(record: Any) -> tuple[tuple[str, Any], ...]:
    """Return the fields of a task's record that are constants of its kernels: booleans and whole numbers."""
    kinds = record.dtype.fields
    names = [name for name in kinds if kinds[name][0].base.kind in "ib" and name not in CHANGING]
    values = [record[0][name] for name in names]
    return tuple(
        (name, tuple(value.tolist()) if value.shape else value.item())
        for name, value in zip(names, values, strict=True)
    )


@dataclass(frozen=True)
class TaskKind:
    """All that the code of a task's kernels follows from.

    Attributes:
        terms: terms of the reward.
        entries: entries that can be observed.
        body: the body's own parts.
        action_map: map from actions to actions of the body; None without one.
        engine: kind of the engine.
        known: fields of the task's record that are constants of kernels, with values; see `known_of`.
    """

    terms: tuple[Term, ...]
    entries: tuple[Entry, ...]
    body: BodyKernels
    action_map: ActionMap | None
    engine: EngineKind
    known: tuple[tuple[str, Any], ...]

    @cached_property
    def own(self) -> Declarations:
        """What terms and entries declare."""
        return declared_by(self.terms, self.entries)

    @cached_property
    def layouts(self) -> Memories:
        """Layouts of the memory of a step."""
        return memories_of(self.body.episode, len(self.terms), self.engine.features, self.body.legs, self.own)

    @cached_property
    def slots(self) -> Slots:
        """Places of the entries."""
        return Slots.of(self.entries)

    @property
    def action_size(self) -> int:
        """Number of actions of a row."""
        return len(self.action_map.names) if self.action_map else self.body.legs * ACTIONS

    @cached_property
    def arrays(self) -> Arrays:
        """Arrays that kernels take."""
        fields = (*self.body.task_fields, *self.own.fields)
        record = task_type(len(self.terms), self.slots.count, self.layouts.gait, fields)
        task = RecordType(record, dict(self.known))
        return Arrays({**self.engine.arrays, **STEP_ARRAYS, "task": task})

    @cached_property
    def functions(self) -> list[Callable[..., Any]]:
        """All functions that the task gives to its kernels."""
        parts: list[Any] = [term.compute for term in self.terms]
        parts += [part for entry in self.entries for part in functions_of(entry)]
        parts += [self.engine.contact_law] if self.engine.contact_law else []
        return [*parts, self.action_map.compute] if self.action_map else parts

    @cached_property
    def has_user_functions(self) -> bool:
        """True if any of these is from outside the package."""
        return any(map(is_from_outside, self.functions))


ALL_ARRAYS = (*ARRAYS, *STEP_ARRAYS)
"""Names of all arrays of a step; the first ones are `TrunkEngine.arrays` in their order."""


@dataclass(frozen=True)
class Slots:
    """Places in which entries are scaled. Entries that saturate have the first, filled up to whole vectors.

    Attributes:
        places: slot of each entry.
        vectors: number of vectors of values that saturate.
        count: number of slots.
    """

    places: tuple[int, ...]
    vectors: int
    count: int

    @classmethod
    def of(cls, entries: tuple[Entry, ...]) -> Slots:
        """Return the places of some entries."""
        saturating = [k for k, entry in enumerate(entries) if entry.scale.saturates]
        linear = [k for k, entry in enumerate(entries) if not entry.scale.saturates]
        linear.sort(key=lambda k: entries[k].group in LATE)
        vectors = -(-len(saturating) // LANES)
        slots = {k: slot for slot, k in enumerate(saturating)}
        slots |= {k: vectors * LANES + slot for slot, k in enumerate(linear)}
        places = tuple(slots[k] for k in range(len(entries)))
        return cls(places, vectors, vectors * LANES + len(linear))


def functions_of(entry: Entry) -> list[Callable[..., Any]]:
    """Return the functions of an entry: of its measurement and its scale."""
    return [part for part in (entry.measure, entry.scale.apply) if part]


def is_from_outside(function: Callable[..., Any]) -> bool:
    """Return True for a function that is not of this package. `functools.wraps` gives a function the
    `__module__` of another one, but not its globals."""
    space = getattr(function, "__globals__", {})
    return not str(space.get("__name__", function.__module__)).startswith("hoof_env.")


class Scene:
    """Arrays and records of a step inside a kernel, for rows n to n + lanes.

    Attributes:
        kind: kind of the task.
        layouts: layouts of its memory.
        lanes: number of rows side by side.
        given: arrays of the kernel.
        task: record of the task.
        actions, acted, mapped, past_actions, observations, frames, rewards, unweighted: pointers to the
            arrays.
    """

    def __init__(self, kind: TaskKind, given: Given, lanes: int) -> None:
        self.kind = kind
        self.layouts = kind.layouts
        self.lanes = lanes
        self.given = given
        self.task = given.task
        self._data = given.data
        self._episode = given.episode
        self._model = given.model
        self._ground = given.ground
        self.actions: Pointer = given.actions.first
        self.acted: Pointer = given.acted.first
        self.mapped: Pointer = given.mapped.first
        self.past_actions: Pointer = given.past_actions.first
        self.observations: Pointer = given.observations.first
        self.frames: Pointer = given.frames.first
        self.rewards: Pointer = given.rewards.first
        self.unweighted: Pointer = given.unweighted.first

    @property
    def columns(self) -> Whole:
        """Number of columns of all arrays."""
        width: Whole = self._data.shape[1]
        return width

    def trunk(self, n: Whole) -> TrunkMemory:
        """Return the memory of the trunks of rows n, n + 1, ..."""
        return columns(self._data, self.lanes, self.layouts.trunk, n)

    def leg(self, n: Whole) -> LegMemory:
        """Return the memory of their first legs."""
        return columns(self._data, self.lanes, self.layouts.leg, n, self.layouts.trunk_rows)

    def episode(self, n: Whole) -> Episode:
        """Return the memory of their episodes."""
        return columns(self._episode, self.lanes, self.layouts.episode, n)

    def episode_of(self, row: Whole) -> Episode:
        """Return the memory of the episode of one row, as ordinary numbers."""
        return columns(self._episode, 0, self.layouts.episode, row)

    def kept_rows(self, n: Whole) -> Block:
        """Return the rows that terms keep in the memory of the episodes, by number."""
        return columns(self._episode, self.lanes, None, n, self.layouts.own_first)

    def inputs(self, n: Whole) -> ObservationInputs:
        """Return the inputs of entries and of maps of actions."""
        is_terrain = dict(self.kind.engine.known)["is_terrain"]
        return ObservationInputs(
            self.trunk(n),
            self.leg(n),
            self.episode(n),
            self.task,
            self._ground,
            self._model.ground_origin if is_terrain else 0.0,
            self._model.ground_per_metre if is_terrain else 0.0,
        )

    def constants(self, taken: Sequence[Constant]) -> tuple[Any, ...]:
        """Return the values of constants that a term or an entry takes."""
        names = self.kind.own.constants
        return tuple(self.task.constants[names.index(constant.name)] for constant in taken)

    def zeros(self, n: Whole) -> Lanes:
        """Return 0 in each lane."""
        return full_like(self.episode(n), 0.0)
