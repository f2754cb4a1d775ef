"""Kernel of pushes on trunks whose legs have motors: a push turns their cranks, too."""

from __future__ import annotations

from functools import lru_cache

from hoof_env.dynamics.advance import EngineKind, leg_memory_of, read_leg, read_trunk
from hoof_env.dynamics.layout import LegRows, TrunkRows, engine_layout
from hoof_env.dynamics.mechanics import (
    accelerate_crank,
    accelerate_trunk,
    gather_legs,
    load_trunk,
    move_trunk,
    set_up_crank,
)
from hoof_env.dynamics.model import Model, unpack_model
from hoof_env.dynamics.stepping import begin_step
from hoof_env.simd import Plane, Whole, block_at, columns, full_like, loop, new_rows, vector
from hoof_env.simd.compile import Kernel
from hoof_env.simd.memory import Arrays, Given


def push_cranks(trunk: TrunkRows, legs: LegRows, leg_count: Whole, model: Model, impulse: Plane) -> None:
    """Add the instantaneous change by an `impulse` [N s] on the trunk's centre of mass to the speeds of
    motors' cranks: (E8) and (E9) with impulses for forces, and jumps of speeds for accelerations."""
    gather_legs(trunk, legs, leg_count, model)
    move_trunk(trunk, model.kind)
    for i in loop(leg_count):
        leg = block_at(legs, i)
        # results of `ground_forces` enter only finite forces, which have no impulse
        leg.beta_rate = 0.0
        leg.ground_force = vector(full_like(leg, 0.0), 0.0)
        leg.ground_moment_theta = 0.0
        leg.ground_moment_beta = 0.0
        set_up_crank(trunk, leg, True, 0.0)
        load_trunk(trunk, leg, model.kind, True, model.lanes_are_legs)
    # all other forces are finite, and have no impulse
    trunk.rates.force = impulse
    trunk.load = vector(full_like(trunk, 0.0), 0.0)
    trunk.load_moment = 0.0
    accelerate_trunk(trunk, model.kind)
    for i in loop(leg_count):
        leg = block_at(legs, i)
        leg.free_theta_acceleration = 0.0
        accelerate_crank(trunk, leg, True)
        leg.state.crank_angle_rate = leg.state.crank_angle_rate + leg.theta_acceleration


@lru_cache(maxsize=64)
def push_kernel(kind: EngineKind) -> Kernel:
    """Return the kernel that applies impulses to the trunks of some environments by changing crank speeds.

    Its arguments are the arrays of the engine and, for the n environments that are pushed, `impulses` [N s],
    forward and upward, shape (2, n), and `which`, their columns, shape (n,).
    """
    form = engine_layout(kind.features)
    count = kind.legs

    def push(given: Given) -> None:
        trunk = new_rows(form.trunk, 1)
        legs = new_rows(form.leg, 1, count)
        # pushes are rare: one environment after the other; no contact law, because contact is not evaluated
        model = unpack_model(given.model, given.tables, given.ground, False, None, form)
        data, impulses, which = given.data, given.impulses, given.which
        size = which.shape[0]
        for j in loop(size):
            n = which.first[j]
            read_trunk(trunk, columns(data, 1, form.trunk_memory, n))
            for i in loop(count):
                read_leg(block_at(legs, i), leg_memory_of(data, form, i, n, 1), form)
            begin_step(trunk, legs, count, model)
            forward, upward = impulses.first[j], impulses.first[size + j]
            impulse = vector(full_like(trunk, forward), full_like(trunk, upward))
            push_cranks(trunk, legs, count, model, impulse)
            for i in loop(count):
                memory = leg_memory_of(data, form, i, n, 1)
                memory.state.crank_angle_rate = block_at(legs, i).state.crank_angle_rate

    return Kernel(push, [Arrays({**kind.arrays, "impulses": "f8", "which": "i8"})])
