"""What the kernels of `TrunkEngine` work on: its memory, and its settings as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.advance import LANES, LEG_ROWS, MODEL, TRUNK_ROWS
from hoof_env.dynamics.layout import (
    LEG_REPORT,
    LEG_STATE,
    TRUNK_REPORT,
    TRUNK_STATE,
    LegMemory,
    LegSettings,
    TrunkMemory,
    TrunkSettings,
)
from hoof_env.dynamics.parts import GRAVITY, TRUNKS, Limb, Motor, Trunk
from hoof_env.dynamics.reactions import Reactions, leg_constants
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.errors import ParameterError
from hoof_env.ground.contact import Ground
from hoof_env.ground.laws import FRICTION_LAWS
from hoof_env.ground.terrain import Terrain
from hoof_env.simd.math import EXPONENT_UNIT
from hoof_env.simd.memory import aligned

if TYPE_CHECKING:
    from hoof_env.dynamics.engine import TrunkEngine

Floats = NDArray[np.float64]

LIFT_OFF = 0.05
"""Normal force that tells stance from swing, in a leg's part of the weight. A hoof that merely grazes the
ground between two pushes has lifted off: were any contact stance, a policy could hold one peak for ever and
push under it."""


class Memory(NamedTuple):
    """An engine's memory: `data` as the kernels take it, and views of its parts; the last axis is the
    environment.

    Attributes:
        data: all of it, shape (rows, columns): whole vectors of environments, so some columns may be idle.
        trunk, limbs: the state, shapes (7, n) and (legs, 16, n).
        trunk_settings, limb_settings: parameters, shapes (17, n) and (legs, 12, n).
        strides, stride_sums: of `layout`, shapes (legs, 3, n) and (legs, 7, n).
        command: shape (legs, 4, n).
        account: shape (9, n), added to.
        trunk_report, limb_report: at the end, shapes (8, n) and (legs, 18, n).
        result: how it ended, shape (n,), values of `parts.Result`; where it is not OK the state is left as
            it was.
        constants, reactions: of `reactions`, shapes (legs, LegConstants.size) and (legs, Reactions.size,
            columns).
    """

    data: Floats
    trunk: Floats
    limbs: Floats
    trunk_settings: Floats
    limb_settings: Floats
    strides: Floats
    stride_sums: Floats
    command: Floats
    account: Floats
    trunk_report: Floats
    limb_report: Floats
    result: Floats
    constants: Floats
    reactions: Floats


def memory_of(data: Floats, num_envs: int, constants: Floats, reactions: Floats) -> Memory:
    """`Memory` with the parts of `data`, whose last columns may be idle; more axes may follow."""
    legs = len(constants)
    trunk, limbs = (
        data[:TRUNK_ROWS, :num_envs],
        data[TRUNK_ROWS:].reshape(legs, LEG_ROWS, *data.shape[1:])[:, :, :num_envs],
    )
    t_parts = {name: trunk[TrunkMemory.rows(name)] for name in TrunkMemory.fields}
    l_parts = {name: limbs[:, LegMemory.rows(name)] for name in LegMemory.fields}
    return Memory(
        data, t_parts["state"], l_parts["state"], t_parts["settings"], l_parts["settings"],
        l_parts["strides"], l_parts["sums"], l_parts["command"], t_parts["account"],
        t_parts["report"], l_parts["report"], t_parts["result"][0], constants, reactions,
    )  # fmt: skip


def named_rows(memory: Memory) -> dict[str, Floats]:
    """State and report by name, as views."""
    parts = ((TRUNK_STATE, memory.trunk), (TRUNK_REPORT, memory.trunk_report))
    found = {name: rows[k] for names, rows in parts for k, name in enumerate(names)}
    limbs = ((LEG_STATE, memory.limbs), (LEG_REPORT, memory.limb_report))
    return found | {name: rows[:, k] for names, rows in limbs for k, name in enumerate(names)}


def columns_for(num_envs: int) -> int:
    """Whole groups of lanes; one more where rows of memory would begin in the same few sets of the cache."""
    columns = -(-num_envs // LANES) * LANES
    return columns + LANES if columns % 128 == 0 else columns


def new_memory(engine: TrunkEngine, columns: int) -> Memory:
    """Memory of an engine whose environments are nowhere, that is not a number, until they are reset."""
    legs = len(engine.limbs)
    constants = np.array([leg_constants(limb.geometry) for limb in engine.limbs])
    reactions = np.zeros((legs, Reactions.size, columns if engine.reacts else 0))
    whole = memory_of(np.zeros((TRUNK_ROWS + legs * LEG_ROWS, columns)), columns, constants, reactions)
    whole.trunk[:], whole.limbs[:] = np.nan, np.nan
    trunk, limbs = settings_of(engine, engine.trunk, engine.ground, engine.limbs)
    whole.trunk_settings[:], whole.limb_settings[:] = trunk[:, None], limbs[:, :, None]
    return memory_of(whole.data, engine.num_envs, constants, reactions)


def new_model(engine: TrunkEngine) -> tuple[NDArray[Any], Floats, Floats]:
    """What does not change while it runs: a record of dtype `MODEL`, the legs' tables, the terrain's
    cells."""
    ground, terrain = engine.ground, engine.terrain
    cells = max(profile.cells for profile in engine.profiles)
    tables = [profile.with_cells(cells).table for profile in dict.fromkeys(engine.profiles)]
    scheme, grid = SCHEMES[engine.integrator], terrain.to_grid()
    model = np.zeros(1, MODEL)
    record = model[0]
    record["legs"], record["cells"] = len(engine.limbs), cells
    record["kind"], record["eighths"] = (
        TRUNKS.index(engine.trunk.kind),
        round(ground.exponent * EXPONENT_UNIT),
    )
    record["friction_law"] = FRICTION_LAWS.index(ground.friction_law)
    record["interpolated"] = ground.approach == "interpolated"
    record["is_terrain"], record["new_rates"] = terrain != Terrain.flat(), scheme.new_rates
    record["strides"] = engine.counts_strides
    record["stages"] = len(scheme.weights)
    record["fractions"][: len(scheme.fractions)] = scheme.fractions
    record["weights"][: len(scheme.weights)] = scheme.weights
    record["settings"] = engine.filters.to_array().ravel()
    record["ground_origin"], record["ground_per_metre"] = grid.origin, grid.per_metre
    whole = aligned(sum(map(len, tables)), tables[0].shape[1])
    return model, np.concatenate(tables, out=whole), grid.cells


def check_shared(engine: TrunkEngine, trunk: Trunk, ground: Ground, limbs: Sequence[Limb]) -> None:
    """Raise where one environment's trunk, ground or drives differ in what the kernels take once for all.

    Raises:
        ParameterError: they do.
    """
    for name, given, own in (
        ("trunk.kind", trunk.kind, engine.trunk.kind),
        ("trunk.height", trunk.height, engine.trunk.height),
        *((name, getattr(ground, name), getattr(engine.ground, name))
          for name in ("exponent", "friction_law", "approach")),
    ):  # fmt: skip
        if given != own:
            raise ParameterError(f"{name}: expected {own!r}, which all environments share, got {given!r}")
    for limb, own_limb in zip(limbs, engine.limbs, strict=True):
        if type(limb.drive) is not type(own_limb.drive):
            raise ParameterError(f"drive: expected a {type(own_limb.drive).__name__}, got {limb.drive!r}")


def settings_of(
    engine: TrunkEngine, trunk: Trunk, ground: Ground, limbs: Sequence[Limb]
) -> tuple[Floats, Floats]:
    """Rows of `TrunkSettings`, shape (17,), and of `LegSettings`, shape (legs, 12), of an
    environment of this engine under a trunk of the same kind, on a ground with the same laws."""
    mass = trunk.mass + sum(limb.geometry.mass for limb in limbs)
    record, hangs = ground.to_record(), trunk.kind == "suspended"
    values = {
        "total_mass": mass, "inverse_mass": 1 / mass, "pitch_inertia": trunk.pitch_inertia,
        "support": (1 - trunk.share) * mass * GRAVITY if hangs else 0.0,
        "spring": trunk.stiffness if hangs else 0.0, "damper": trunk.damping if hangs else 0.0,
        "height": trunk.height, "drag": trunk.drag, "gravity": GRAVITY,
        "bottom": float(np.min(engine.terrain.height)),
    } | {name: record[name] for name in (
        "stiffness", "chi", "dashpot", "approach_floor", "friction", "friction_slow", "friction_fast"
    )}  # fmt: skip
    lift_off = LIFT_OFF * mass * GRAVITY / len(limbs)
    firsts = zip(limbs, _first_rows(engine), strict=True)
    each = [_limb_settings(limb, first, lift_off) for limb, first in firsts]
    return np.array([values[name] for name in TrunkSettings.names]), np.array(each)


def _first_rows(engine: TrunkEngine) -> list[int]:
    """Where the table of each leg begins in the model's."""
    unique, cells = list(dict.fromkeys(engine.profiles)), max(profile.cells for profile in engine.profiles)
    return [unique.index(profile) * cells for profile in engine.profiles]


def _limb_settings(limb: Limb, first_row: int, lift_off: float) -> Floats:
    motor = limb.drive if isinstance(limb.drive, Motor) else Motor(0.0, 0.0, 0.0, 0.0)
    side, rotor = float(limb.geometry.travel), motor.rotor_inertia
    values = {
        "hip_on_trunk_x": limb.hip[0], "hip_on_trunk_y": limb.hip[1], "mass": limb.geometry.mass,
        "side": side, "first_row": first_row, "is_motor": float(isinstance(limb.drive, Motor)),
        "speed_gain": motor.speed_gain, "torque_limit": motor.torque_limit,
        "rotor_crank": motor.reflected_inertia, "rotor_coupling": -side * motor.gear_ratio * rotor,
        "rotor_frame": rotor, "lift_off": lift_off,
    }  # fmt: skip
    return np.array([values[name] for name in LegSettings.names])
