"""Part of the kernels of a step that turns actions of one's own into those of a body."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hoof_env.envs.addresses import AT
from hoof_env.envs.observation_kernel import inputs_reader
from hoof_env.simd import full_like, loop, read, rows, write
from hoof_env.simd.compile import inline_llvm, inline_source
from hoof_env.simd.math import clip
from hoof_env.simd.memory import singles_at
from hoof_env.simd.values import Index
from hoof_env.simd.user_functions import inline_foreign, number_of, numbers_of
from hoof_env.tasks.body import BodyKernels
from hoof_env.tasks.episode import ACTIONS, Memories
from hoof_env.tasks.own_parts import ActionMap


def _writer(k: int, size: int, number: Any) -> Callable[..., Any]:
    """Return a function that writes the actions of a tuple from the k-th on, clipped. numba has no loop over
    tuples of numbers and lanes, so each calls the next."""
    if k == size:
        return inline_llvm(lambda like, actions, to, n: None)
    rest = _writer(k + 1, size, number)

    @inline_llvm
    def write_from(like, actions, to, n):  # type: ignore[no-untyped-def]
        write(clip(full_like(like, number(actions[k])), 1.0), to, n * size + k, size)
        rest(like, actions, to, n)

    return write_from


def _reader(k: int, size: int, scalar: bool) -> Callable[..., Any]:
    """Return a function that reads the actions from the k-th on as a tuple, of which the compiler knows the
    length: reading beyond it is refused."""
    if k == size:
        return inline_llvm(lambda like, acted, n: ())
    rest = _reader(k + 1, size, scalar)

    @inline_llvm
    def read_lanes(like, acted, n):  # type: ignore[no-untyped-def]
        return (clip(read(like, acted, n * size + k, size), 1.0), *rest(like, acted, n))

    @inline_llvm
    def read_number(like, acted, n):  # type: ignore[no-untyped-def]
        return (clip(acted[n * size + k], 1.0), *rest(like, acted, n))

    return read_number if scalar else read_lanes


def converter(
    action_map: ActionMap | None, layouts: Memories, body: BodyKernels, model: Any
) -> Callable[..., Any]:
    """Return a part of kernels that writes the body's actions of row n and, with lanes, of its neighbours;
    `scratch` is room for as many numbers as the map has actions, for each lane."""
    if action_map is None:

        @inline_source
        def nothing(addresses, lanes, task, n, scratch):  # type: ignore[no-untyped-def]
            """Do nothing: `mapped` is `acted`."""

        return nothing
    compute = inline_foreign(action_map.compute)
    given = len(action_map.names)
    of_body = body.legs * ACTIONS
    all_of = numbers_of(action_map.title, of_body)
    write_all = _writer(0, of_body, number_of(action_map.title))
    read_all = _reader(0, given, action_map.scalar)
    inputs_of = inputs_reader(layouts, model)

    @inline_source
    def convert(addresses, lanes, task, n, scratch):  # type: ignore[no-untyped-def]
        acted = singles_at(addresses[AT.acted])
        like = rows(scratch, lanes, None)
        actions = read_all(like, acted, n)
        scene = inputs_of(addresses, lanes, task, n)
        write_all(like, all_of(compute(actions, scene)), singles_at(addresses[AT.mapped]), n)

    @inline_source
    def convert_one_by_one(addresses, lanes, task, n, scratch):  # type: ignore[no-untyped-def]
        acted = singles_at(addresses[AT.acted])
        for lane in loop(Index(str(lanes))):
            row = n + lane
            like = rows(scratch, 1, None)
            actions = read_all(like, acted, row)
            scene = inputs_of(addresses, 0, task, row)
            write_all(like, all_of(compute(actions, scene)), singles_at(addresses[AT.mapped]), row)

    return convert_one_by_one if action_map.scalar else convert
