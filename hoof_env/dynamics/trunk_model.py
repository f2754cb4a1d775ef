"""What the kernels of `TrunkEngine` work on: its settings as arrays, and what makes one engine another."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics import trunk_rows as t
from hoof_env.dynamics.advance import LIMB, LIMB_ROWS, MODEL, TRUNK, TRUNK_ROWS
from hoof_env.dynamics.drive import Motor
from hoof_env.dynamics.engine import GRAVITY
from hoof_env.dynamics.limb import Limb
from hoof_env.dynamics.reactions import OUTPUTS, leg_constants
from hoof_env.dynamics.schemes import SCHEMES
from hoof_env.dynamics.trunk import TRUNKS
from hoof_env.errors import ParameterError
from hoof_env.ground.exact_math import EXPONENT_UNIT
from hoof_env.ground.friction import FRICTION_LAWS
from hoof_env.ground.terrain import Terrain

if TYPE_CHECKING:
    from hoof_env.dynamics.trunk_engine import TrunkEngine

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
        strides, stride_sums: of `limb_rows`, shapes (legs, 3, n) and (legs, 7, n).
        command: shape (legs, 4, n).
        account: shape (9, n), added to.
        trunk_report, limb_report: at the end, shapes (8, n) and (legs, 18, n).
        result: how it ended, shape (n,), values of `result.Result`; where it is not OK the state is left as
            it was.
        constants, reactions: of `reactions`, shapes (legs, CONSTANTS) and (legs, OUTPUTS, columns).
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


def new_memory(engine: TrunkEngine, columns: int) -> Memory:
    """Memory of an engine whose environments are nowhere, that is not a number, until they are reset."""
    n, legs = engine.num_envs, len(engine.limbs)
    data = np.zeros((TRUNK_ROWS + legs * LIMB_ROWS, columns))
    trunk, limbs = data[:TRUNK_ROWS], data[TRUNK_ROWS:].reshape(legs, LIMB_ROWS, columns)
    trunk[TRUNK["state"]], limbs[:, LIMB["state"]] = np.nan, np.nan
    trunk[TRUNK["settings"]] = _trunk_settings(engine)[:, None]
    lift_off = LIFT_OFF * engine.weight / legs
    firsts = zip(engine.limbs, _first_rows(engine), strict=True)
    settings = [_limb_settings(limb, first, lift_off) for limb, first in firsts]
    limbs[:, LIMB["settings"]] = np.array(settings)[:, :, None]
    ours, theirs = trunk[:, :n], limbs[:, :, :n]
    return Memory(
        data, ours[TRUNK["state"]], theirs[:, LIMB["state"]],
        ours[TRUNK["settings"]], theirs[:, LIMB["settings"]],
        theirs[:, LIMB["strides"]], theirs[:, LIMB["stride_sums"]], theirs[:, LIMB["command"]],
        ours[TRUNK["account"]], ours[TRUNK["report"]], theirs[:, LIMB["report"]], ours[TRUNK["result"]][0],
        np.array([leg_constants(limb.geometry)[:, 0] for limb in engine.limbs]),
        np.zeros((legs, OUTPUTS, columns if engine.reacts else 0)),
    )  # fmt: skip


def new_model(engine: TrunkEngine) -> tuple[NDArray[Any], Floats, Floats]:
    """What does not change while it runs: a record of dtype `MODEL`, the legs' tables, the terrain's cells.

    Raises:
        ParameterError: the ground's exponent is not a multiple of 1/8.
    """
    ground, terrain = engine.ground, engine.terrain
    eighths = ground.exponent * EXPONENT_UNIT
    if eighths != round(eighths):
        raise ParameterError(
            f"exponent: this engine takes multiples of 1/{EXPONENT_UNIT}, got {ground.exponent!r}"
        )
    cells = max(profile.cells for profile in engine.profiles)
    tables = [profile.with_cells(cells).table for profile in dict.fromkeys(engine.profiles)]
    scheme, grid = SCHEMES[engine.integrator], terrain.to_grid()
    model = np.zeros(1, MODEL)
    record = model[0]
    record["legs"], record["cells"] = len(engine.limbs), cells
    record["kind"], record["eighths"] = TRUNKS.index(engine.trunk.kind), int(eighths)
    record["friction_law"] = FRICTION_LAWS.index(ground.friction_law)
    record["interpolated"] = ground.approach == "interpolated"
    record["is_terrain"], record["new_rates"] = terrain != Terrain.flat(), scheme.new_rates
    record["strides"] = engine.counts_strides
    record["stages"] = len(scheme.weights)
    record["fractions"][: len(scheme.fractions)] = scheme.fractions
    record["weights"][: len(scheme.weights)] = scheme.weights
    record["settings"] = engine.filters.to_array().ravel()
    record["ground_origin"], record["ground_per_metre"] = grid.origin, grid.per_metre
    return model, np.concatenate(tables), grid.cells


def layout(engine: TrunkEngine) -> dict[str, Any]:
    """Everything on which the bits of a run depend, by name, as values that JSON can hold."""
    found: dict[str, Any] = {
        name: getattr(engine, name) for name in ("num_envs", "sim_dt", "substeps", "integrator")
    }
    for name in ("trunk", "ground", "filters"):
        found |= {f"{name}.{key}": value for key, value in asdict(getattr(engine, name)).items()}
    found["terrain"] = _digest(engine.terrain.to_dict())
    for i, limb in enumerate(engine.limbs):
        shape = {
            key: value for key, value in limb.geometry.to_dict().items() if key not in ("name", "provenance")
        }
        found |= {f"limbs[{i}].hip": list(limb.hip), f"limbs[{i}].drive": repr(limb.drive)}
        found[f"limbs[{i}].geometry"] = _digest(shape)
    return found


def differences(expected: dict[str, Any], given: dict[str, Any]) -> str:
    """Where two layouts differ, for people; empty if nowhere."""
    names = [name for name in {**expected, **given} if expected.get(name) != given.get(name)]
    return "; ".join(f"{name}: expected {expected.get(name)!r}, got {given.get(name)!r}" for name in names)


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:16]


def _trunk_settings(engine: TrunkEngine) -> Floats:
    trunk, ground, mass = engine.trunk, engine.ground.to_record(), engine.total_mass
    hangs = trunk.kind == "suspended"
    values = {
        "total_mass": mass, "per_mass": 1 / mass, "pitch_inertia": trunk.pitch_inertia,
        "support": (1 - trunk.share) * mass * GRAVITY if hangs else 0.0,
        "spring": trunk.stiffness if hangs else 0.0, "damper": trunk.damping if hangs else 0.0,
        "height": trunk.height, "drag": trunk.drag, "gravity": GRAVITY,
        "bottom": float(np.min(engine.terrain.height)),
    } | {name: ground[name] for name in (
        "stiffness", "chi", "dashpot", "approach_floor", "friction", "friction_slow", "friction_fast"
    )}  # fmt: skip
    return np.array([values[name] for name in t.PARAMETERS])


def _first_rows(engine: TrunkEngine) -> list[int]:
    """Where the table of each leg begins in the model's."""
    unique, cells = list(dict.fromkeys(engine.profiles)), max(profile.cells for profile in engine.profiles)
    return [unique.index(profile) * cells for profile in engine.profiles]


def _limb_settings(limb: Limb, first_row: int, lift_off: float) -> Floats:
    motor = limb.drive if isinstance(limb.drive, Motor) else Motor(0.0, 0.0, 0.0, 0.0)
    side, rotor = float(limb.geometry.travel), motor.rotor_inertia
    values = (
        *limb.hip, limb.geometry.mass, side, first_row, float(isinstance(limb.drive, Motor)),
        motor.speed_gain, motor.torque_limit,
        motor.reflected_inertia, -side * motor.gear_ratio * rotor, rotor, lift_off,
    )  # fmt: skip
    return np.array(values)
