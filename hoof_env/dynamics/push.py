"""Kernel of pushes on trunks whose legs have motors: a push turns their cranks, too."""

from __future__ import annotations

from typing import Any

from hoof_env.dynamics.advance import MODEL, leg_memory_of, read_leg, read_trunk, unpack_model
from hoof_env.dynamics.form import engine_layout
from hoof_env.dynamics.layout import Features
from hoof_env.dynamics.mechanics import (
    accelerate_crank,
    accelerate_trunk,
    gather_legs,
    load_trunk,
    move_trunk,
    set_up_crank,
)
from hoof_env.dynamics.stepping import begin_step
from hoof_env.simd import block_at, columns, full_like, loop, rows, vector
from hoof_env.simd.compile import Kernel, inline_source
from hoof_env.simd.kept import Kept, Kernels
from hoof_env.simd.memory import address, doubles

_KEPT = Kept()


@inline_source
def push_cranks(trunk, legs, leg_count, model, impulse):  # type: ignore[no-untyped-def]
    """Add to the speeds of motors' cranks what an `impulse` [N s] on the trunk's centre of mass changes at
    once: (E8) and (E9) with impulses for forces, and jumps of speeds for accelerations."""
    gather_legs(trunk, legs, leg_count, model)
    move_trunk(trunk, model.kind)
    for i in loop(leg_count):
        leg = block_at(legs, i)
        set_up_crank(trunk, leg, True, 0.0)
        load_trunk(trunk, leg, model.kind, True, model.lanes_are_legs)
    # all other forces are finite, and do nothing in no time
    trunk.rates.force = impulse
    trunk.load = vector(full_like(trunk, 0.0), 0.0)
    trunk.load_moment = 0.0
    accelerate_trunk(trunk, model.kind)
    for i in loop(leg_count):
        leg = block_at(legs, i)
        leg.free_theta_acceleration = 0.0
        accelerate_crank(trunk, leg, True)
        leg.state.crank_angle_rate = leg.state.crank_angle_rate + leg.theta_acceleration


def push_kernel(features: Features, static: tuple[tuple[str, Any], ...]) -> Any:
    """Return the kernel that adds to the crank speeds of some environments what impulses on their trunks
    change at once.

    Its arguments are the engine's memory, model, tables and ground, the impulses [N s] forward and upward,
    and the columns of the environments that are pushed; the last three have the same shape (n,).
    """
    return _KEPT.get(
        (features, static), lambda: Kernels(push=_new_kernel(features, dict(static))), from_outside=False
    ).push


def _new_kernel(features: Features, static: dict[str, Any]) -> Any:
    form = engine_layout(features)

    def push(data, model, tables, ground, forward, upward, which, size):  # type: ignore[no-untyped-def]
        count = model.legs
        trunk = rows(doubles(form.trunk_size), 1, form.trunk)
        legs = rows(doubles(count * form.leg_size), 1, form.leg)
        # pushes are rare: one environment after the other; no law of contact, for none meets the ground here
        unpacked = unpack_model(model, tables, ground, False, None, form)
        at = address(data)
        row = data.shape[1]
        for j in loop(size):
            n = which[j]
            read_trunk(trunk, columns(at, 1, form.trunk_memory, n, row, 1))
            for i in loop(count):
                read_leg(block_at(legs, i), leg_memory_of(at, i, n, row, 1, 1, form), form)
            begin_step(trunk, legs, count, unpacked)
            impulse = vector(full_like(trunk, forward[j]), full_like(trunk, upward[j]))
            push_cranks(trunk, legs, count, unpacked, impulse)
            for i in loop(count):
                memory = leg_memory_of(at, i, n, row, 1, 1, form)
                memory.state.crank_angle_rate = block_at(legs, i).state.crank_angle_rate

    kinds = ["matrix", (MODEL, static), "matrix", "matrix", "pointer", "pointer", "addresses", "index"]
    return Kernel(push, kinds)
