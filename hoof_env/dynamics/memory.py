"""What the kernels of `TrunkEngine` work on: its memory, its settings as arrays, where it starts, and
whether a state that was kept fits it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics import layout
from hoof_env.dynamics.advance import LANES, LEG_ROWS, MODEL, TRUNK_ROWS
from hoof_env.dynamics.layout import FARTHEST, LegMemory, LegState, Moving, TrunkMemory, TrunkState
from hoof_env.dynamics.parts import FREE, GRAVITY, RAIL, SUSPENDED, TRUNKS, Limb, Motor, Scene, Trunk
from hoof_env.dynamics.reactions import Reactions, leg_constants
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.errors import Floats, ParameterError, all_of, finite, spread
from hoof_env.gait import FilterSettings, GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.ground.laws import FRICTION_LAWS
from hoof_env.ground.terrain import Terrain
from hoof_env.simd.math import EXPONENT_UNIT
from hoof_env.simd.memory import aligned

LIFT_OFF = 0.05
"""Normal force that tells stance from swing, in a leg's part of the weight. A hoof that merely grazes the
ground between two pushes has lifted off: were any contact stance, a policy could hold one peak for ever and
push under it."""


class Memory(NamedTuple):
    """An engine's memory as the kernels take it, and views of its parts; the last axis is the environment."""

    data: Floats  # all of it, (rows, columns): whole vectors of environments, so some columns may be idle
    trunk: Floats  # the state, (7, n)
    limbs: Floats  # (legs, 16, n)
    trunk_settings: Floats  # (17, n)
    limb_settings: Floats  # (legs, 12, n)
    strides: Floats  # (legs, 6, n)
    stride_sums: Floats  # (legs, 9, n)
    command: Floats  # (legs, 4, n)
    account: Floats  # (9, n), added to
    trunk_report: Floats  # at the end, (8, n)
    limb_report: Floats  # (legs, 18, n)
    result: Floats  # values of `parts.Result`, (n,); where it is not OK the state is left as it was
    constants: Floats  # `reactions.LegConstants`, (legs, size)
    reactions: Floats  # `reactions.Reactions`, (legs, size, columns)


def memory_of(data: Floats, num_envs: int, constants: Floats, reactions: Floats) -> Memory:
    """`Memory` with the parts of `data`, whose last columns may be idle; more axes may follow."""
    trunk = data[:TRUNK_ROWS, :num_envs]
    limbs = data[TRUNK_ROWS:].reshape(len(constants), LEG_ROWS, *data.shape[1:])[:, :, :num_envs]
    t_parts = {name: trunk[TrunkMemory.rows(name)] for name in TrunkMemory.fields}
    l_parts = {name: limbs[:, LegMemory.rows(name)] for name in LegMemory.fields}
    return Memory(
        data, t_parts["state"], l_parts["state"], t_parts["settings"], l_parts["settings"],
        l_parts["strides"], l_parts["sums"], l_parts["command"], t_parts["account"],
        t_parts["report"], l_parts["report"], t_parts["result"][0], constants, reactions,
    )  # fmt: skip


def named_rows(memory: Memory) -> dict[str, Floats]:
    """State and report by name, as views."""
    parts = ((layout.TRUNK_STATE, memory.trunk), (layout.TRUNK_REPORT, memory.trunk_report))
    columns = {name: values[k] for names, values in parts for k, name in enumerate(names)}
    limbs = ((layout.LEG_STATE, memory.limbs), (layout.LEG_REPORT, memory.limb_report))
    return columns | {name: values[:, k] for names, values in limbs for k, name in enumerate(names)}


def columns_for(num_envs: int) -> int:
    """Whole groups of lanes; one more where rows of memory would begin in the same few sets of the cache."""
    columns = -(-num_envs // LANES) * LANES
    return columns + LANES if columns % 128 == 0 else columns


def new_memory(scene: Scene, num_envs: int, columns: int, reacts: bool) -> Memory:
    """Memory of an engine whose environments are nowhere, that is not a number, until they are reset."""
    legs = len(scene.limbs)
    constants = np.array([leg_constants(limb.geometry) for limb in scene.limbs])
    reactions = np.zeros((legs, Reactions.size, columns if reacts else 0))
    whole = memory_of(np.zeros((TRUNK_ROWS + legs * LEG_ROWS, columns)), columns, constants, reactions)
    whole.trunk[:], whole.limbs[:] = np.nan, np.nan
    trunk, limbs = settings_of(scene, scene.trunk, scene.ground, scene.limbs)
    whole.trunk_settings[:], whole.limb_settings[:] = trunk[:, None], limbs[:, :, None]
    return memory_of(whole.data, num_envs, constants, reactions)


def new_model(scene: Scene, filters: FilterSettings, strides: bool) -> tuple[NDArray[Any], Floats, Floats]:
    """What does not change while it runs: a record `MODEL`, the legs' tables, the terrain's cells."""
    ground, terrain = scene.ground, scene.terrain
    cells = max(profile.cells for profile in scene.profiles)
    tables = [profile.with_cells(cells).table for profile in dict.fromkeys(scene.profiles)]
    scheme, grid = SCHEMES[scene.integrator], terrain.to_grid()
    model = np.zeros(1, MODEL)
    record = model[0]
    record["legs"], record["cells"] = len(scene.limbs), cells
    record["kind"], record["eighths"] = TRUNKS.index(scene.trunk.kind), round(ground.exponent * EXPONENT_UNIT)
    record["friction_law"] = FRICTION_LAWS.index(ground.friction_law)
    record["interpolated"] = ground.approach == "interpolated"
    record["is_terrain"], record["new_rates"] = terrain != Terrain.flat(), scheme.new_rates
    record["strides"] = strides
    record["stages"] = len(scheme.weights)
    record["fractions"][: len(scheme.fractions)] = scheme.fractions
    record["weights"][: len(scheme.weights)] = scheme.weights
    record["settings"] = filters.to_array().ravel()
    record["ground_origin"], record["ground_per_metre"] = grid.origin, grid.per_metre
    whole = aligned(sum(map(len, tables)), tables[0].shape[1])
    return model, np.concatenate(tables, out=whole), grid.cells


def check_shared(scene: Scene, trunk: Trunk, ground: Ground, limbs: Sequence[Limb]) -> None:
    """Raise where one environment's trunk, ground or drives differ in what the kernels take once for all."""
    for name, given, own in (
        ("trunk.kind", trunk.kind, scene.trunk.kind),
        ("trunk.height", trunk.height, scene.trunk.height),
        *((name, getattr(ground, name), getattr(scene.ground, name))
          for name in ("exponent", "friction_law", "approach")),
    ):  # fmt: skip
        if given != own:
            raise ParameterError(f"{name}: expected {own!r}, which all environments share, got {given!r}")
    for limb, own_limb in zip(limbs, scene.limbs, strict=True):
        if type(limb.drive) is not type(own_limb.drive):
            raise ParameterError(f"drive: expected a {type(own_limb.drive).__name__}, got {limb.drive!r}")


def settings_of(scene: Scene, trunk: Trunk, ground: Ground, limbs: Sequence[Limb]) -> tuple[Floats, Floats]:
    """Rows of `TrunkSettings`, shape (17,), and of `LegSettings`, shape (legs, 12), of an environment under a
    trunk of the same kind, on a ground with the same laws."""
    mass = trunk.mass + sum(limb.geometry.mass for limb in limbs)
    record, hangs = ground.to_record(), trunk.kind == "suspended"
    values = {
        "total_mass": mass, "inverse_mass": 1 / mass, "pitch_inertia": trunk.pitch_inertia,
        "support": (1 - trunk.share) * mass * GRAVITY if hangs else 0.0,
        "spring": trunk.stiffness if hangs else 0.0, "damper": trunk.damping if hangs else 0.0,
        "height": trunk.height, "drag": trunk.drag, "gravity": GRAVITY,
        "bottom": float(np.min(scene.terrain.height)),
    } | {name: record[name] for name in (
        "stiffness", "chi", "dashpot", "approach_floor", "friction", "friction_slow", "friction_fast"
    )}  # fmt: skip
    lift_off = LIFT_OFF * mass * GRAVITY / len(limbs)
    unique, cells = list(dict.fromkeys(scene.profiles)), max(profile.cells for profile in scene.profiles)
    firsts = [unique.index(profile) * cells for profile in scene.profiles]  # where each leg's table begins
    each = [_limb_settings(limb, first, lift_off) for limb, first in zip(limbs, firsts, strict=True)]
    return np.array([values[name] for name in layout.TrunkSettings.names]), np.array(each)


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
    return np.array([values[name] for name in layout.LegSettings.names])


def which(envs: ArrayLike | None, num_envs: int) -> NDArray[np.int64]:
    """Environments of `num_envs` as indices; they are given as such, as a mask, or as None for all."""
    if envs is None:
        return np.arange(num_envs)
    given = np.asarray(envs)
    if given.dtype == bool and given.shape == (num_envs,):
        return np.flatnonzero(given)
    if given.shape == (0,):
        return np.arange(0)
    if given.dtype.kind in "iu" and given.ndim == 1 and np.all((given >= 0) & (given < num_envs)):
        return given.astype(np.int64)
    raise ParameterError(
        f"envs: expected indices below {num_envs} or a mask of shape ({num_envs},), got {envs!r}"
    )


def gaits_of(gaits: Any, legs: int, n: int) -> Floats:
    """`gaits` of `TrunkEngine.reset` as numbers of shape (legs, 4, n)."""
    if isinstance(gaits, np.ndarray):
        given = finite("gaits", gaits, FARTHEST)
        if given.shape != (legs, 4, n):
            raise ParameterError(f"gaits: expected shape {(legs, 4, n)}, got {given.shape}")
        return given
    each = all_of("gaits", [gaits] * legs if isinstance(gaits, GaitParameters) else gaits, GaitParameters)
    if len(each) != legs:
        raise ParameterError(f"gaits: expected one or {legs}, got {len(each)}")
    return np.repeat(np.array([gait.to_array() for gait in each])[:, :, None], n, 2)


def start(
    scene: Scene,
    gaits: Floats,
    theta: ArrayLike,
    theta_rate: ArrayLike | None,
    trunk: Mapping[str, ArrayLike],
    n: int,
) -> tuple[Floats, Floats]:
    """State of `n` environments with filters at rest: of the trunk, shape (7, n), and legs, (legs, 16, n).

    In the place of centre of mass, momentum and spin of all are the trunk's place, velocity and rate of
    pitch: the kernels make the one of the other (`mechanics.settle`). `TrunkEngine.reset` says what `trunk`
    holds and what is refused.
    """
    legs = len(scene.limbs)
    angle = spread("theta", theta, (legs, n), FARTHEST)
    spin = spread("theta_rate", gaits[:, 0] if theta_rate is None else theta_rate, (legs, n), FARTHEST)
    for i, limb in enumerate(scene.limbs):
        if not isinstance(limb.drive, Motor) and (spin[i] != gaits[i, 0]).any():
            raise ParameterError(
                f"theta_rate: leg {i} is prescribed to turn at {gaits[i, 0]} rad/s, got {spin[i]}"
            )
        turns = limb.geometry.full_turn  # then its links have a place everywhere
        if not turns and not np.isfinite(scene.profiles[i](angle[i])[0]).all():
            raise ParameterError(f"theta: the links of leg {i} have no place at some of {angle[i]} rad")
    at = {name: spread(name, value, (n,), FARTHEST) for name, value in trunk.items()}
    kind = TRUNKS.index(scene.trunk.kind)
    for name, kinds in (
        ("vx", (RAIL, SUSPENDED, FREE)), ("vy", (SUSPENDED, FREE)), ("pitch", (FREE,)),
        ("pitch_rate", (FREE,)),
    ):  # fmt: skip
        if kind not in kinds and at[name].any():
            raise ParameterError(f"{name}: expected 0 of a {scene.trunk.kind} trunk, got {at[name]}")
    if kind <= RAIL and (at["y"] != scene.trunk.height).any():
        raise ParameterError(f"y: a {scene.trunk.kind} trunk is at {scene.trunk.height:g} m, got {at['y']}")
    state = np.zeros((TrunkState.size, n))
    moving = state[TrunkState.rows("moving")]  # the kernels make of these what they integrate
    moving[Moving.rows("centre")], moving[Moving.rows("momentum")] = (at["x"], at["y"]), (at["vx"], at["vy"])
    moving[Moving.rows("pitch")], moving[Moving.rows("spin")] = at["pitch"], at["pitch_rate"]
    leg = np.zeros((legs, LegState.size, n))
    leg[:, LegState.rows("theta")], leg[:, LegState.rows("theta_rate")] = angle[:, None], spin[:, None]
    leg[:, LegState.rows("gait")] = gaits
    return state, leg


STATE = ("trunk", "limbs", "strides", "command", "account", "trunk_settings", "limb_settings")
"""Arrays that hold what changes."""

_FIRST_ROW = layout.LegSettings.rows("first_row")


def read_state(
    expected: dict[str, Any], memory: Memory, state: Any
) -> tuple[dict[str, Floats], NDArray[np.bool_]]:
    """The arrays of a state by the names of `STATE`, and which environments were ever reset in it; `expected`
    is the layout of the engine, and `TrunkEngine.set_state` says what is refused."""
    parts = (*STATE, "layout")
    missing = sorted(set(parts) - set(state)) if isinstance(state, Mapping) else parts
    if missing or not isinstance(state["layout"], Mapping):
        lack = ", ".join(missing) or "a layout by name"
        raise ParameterError(f"state: expected what get_state gives, but {lack} is missing")
    if unlike := _differences(expected, dict(state["layout"])):
        raise ParameterError(f"state: of another engine; {unlike}")
    arrays = {}
    for name in STATE:
        shape = getattr(memory, name).shape
        try:
            arrays[name] = np.array(state[name], dtype=np.float64)
        except (TypeError, ValueError):
            raise ParameterError(f"state[{name!r}]: expected numbers, got {state[name]!r}") from None
        if arrays[name].shape != shape:
            raise ParameterError(f"state[{name!r}]: expected shape {shape}, got {arrays[name].shape}")
    trunk, limbs = arrays["trunk"], arrays["limbs"]
    reset: NDArray[np.bool_] = np.logical_not(np.isnan(trunk).all(0) & np.isnan(limbs).all((0, 1)))
    for name in STATE:
        finite(f"state[{name!r}]", arrays[name][..., reset])
    moving = trunk[TrunkState.rows("moving")]
    for name in ("centre", "pitch"):
        finite("state['trunk'], places and pitch", moving[Moving.rows(name)][:, reset], FARTHEST)
    finite("state['limbs'], crank angles", limbs[:, LegState.rows("theta")][..., reset], FARTHEST)
    arrays["limb_settings"][:, _FIRST_ROW] = memory.limb_settings[:, _FIRST_ROW]  # an address
    return arrays, reset


def identity_of(scene: Scene, filters: FilterSettings, **numbers: float) -> dict[str, Any]:
    """Everything on which the bits of a run depend, by name, as values that JSON can hold."""
    identity: dict[str, Any] = {**numbers, "integrator": scene.integrator}
    for name, part in (("trunk", scene.trunk), ("ground", scene.ground), ("filters", filters)):
        identity |= {f"{name}.{key}": value for key, value in asdict(part).items()}
    identity["terrain"] = _digest(scene.terrain.to_dict())
    for i, limb in enumerate(scene.limbs):
        shape = limb.geometry.to_dict()
        identity |= {f"limbs[{i}].hip": list(limb.hip), f"limbs[{i}].drive": repr(limb.drive)}
        identity[f"limbs[{i}].geometry"] = _digest(
            {key: value for key, value in shape.items() if key not in ("name", "provenance")}
        )
    return identity


def _differences(expected: dict[str, Any], given: dict[str, Any]) -> str:
    """Where two layouts differ, for people; empty if nowhere."""
    names = [name for name in {**expected, **given} if expected.get(name) != given.get(name)]
    return "; ".join(f"{name}: expected {expected.get(name)!r}, got {given.get(name)!r}" for name in names)


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:16]
