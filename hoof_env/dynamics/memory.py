"""What the kernels of `TrunkEngine` work on: its memory, its settings as arrays, where it starts, and
whether a state that was kept fits it."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics import layout
from hoof_env.dynamics.advance import LANES, MODEL
from hoof_env.dynamics.form import engine_layout
from hoof_env.dynamics.layout import (
    MAX_STATE,
    Features,
    LegSettings,
    LegState,
    Moving,
    TrunkSettings,
    TrunkState,
)
from hoof_env.dynamics.parts import (
    FREE,
    GRAVITY,
    RAIL,
    SUSPENDED,
    TRUNKS,
    Limb,
    Limits,
    Mechanics,
    Motor,
    Trunk,
)
from hoof_env.dynamics.reactions import Reactions, leg_constants
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.errors import Floats, ParameterError, all_of, finite, spread
from hoof_env.gait import FilterSettings, GaitParameters, gait_array
from hoof_env.ground.contact import Ground
from hoof_env.ground.laws import FRICTION_LAWS
from hoof_env.ground.terrain import Terrain
from hoof_env.simd.math import EXPONENT_UNIT
from hoof_env.simd.memory import aligned

LIFT_OFF = 0.05
"""Normal force that tells stance from swing, in a leg's part of the weight. A hoof that merely grazes the
ground between two pushes has lifted off: were any contact stance, a policy could hold one peak for ever and
push under it."""


NOWHERE = 1e30
"""A bound that nothing reaches, in the place of an infinite one."""


class Memory(NamedTuple):
    """An engine's memory as the kernels take it, and views of its parts; the last axis is the environment.
    Shapes are those without `Features`."""

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
    features: Features


def memory_of(
    data: Floats, num_envs: int, constants: Floats, reactions: Floats, features: Features
) -> Memory:
    """`Memory` with the parts of `data`, whose last columns may be idle; more axes may follow."""
    form = engine_layout(features)
    trunk = data[: form.trunk_rows, :num_envs]
    limbs = data[form.trunk_rows :].reshape(len(constants), form.leg_rows, *data.shape[1:])[:, :, :num_envs]
    t_parts = {name: trunk[form.trunk_memory.rows(name)] for name in form.trunk_memory.fields}
    l_parts = {name: limbs[:, form.leg_memory.rows(name)] for name in form.leg_memory.fields}
    return Memory(
        data, t_parts["state"], l_parts["state"], t_parts["settings"], l_parts["settings"],
        l_parts["strides"], l_parts["sums"], l_parts["command"], t_parts["account"],
        t_parts["report"], l_parts["report"], t_parts["result"][0], constants, reactions, features,
    )  # fmt: skip


def named_rows(memory: Memory) -> dict[str, Floats]:
    """State and report by name, as views."""
    parts = ((layout.TRUNK_STATE, memory.trunk), (layout.TRUNK_REPORT, memory.trunk_report))
    columns = {name: values[k] for names, values in parts for k, name in enumerate(names)}
    limbs = ((layout.leg_state(memory.features), memory.limbs), (layout.LEG_REPORT, memory.limb_report))
    return columns | {name: values[:, k] for names, values in limbs for k, name in enumerate(names)}


def columns_for(num_envs: int) -> int:
    """Whole groups of lanes; one more where rows of memory would begin in the same few sets of the cache."""
    columns = -(-num_envs // LANES) * LANES
    return columns + LANES if columns % 128 == 0 else columns


def copy_of(data: Floats) -> Floats:
    """A copy where the kernels like it best."""
    copy = aligned(*data.shape)
    copy[:] = data
    return copy


def new_memory(scene: Mechanics, num_envs: int, columns: int, reacts: bool) -> Memory:
    """Memory of an engine whose environments are nowhere, that is not a number, until they are reset."""
    legs = len(scene.limbs)
    constants = np.array([leg_constants(limb.geometry) for limb in scene.limbs])
    reactions = np.zeros((legs, Reactions.size, columns if reacts else 0))
    form = engine_layout(scene.features)
    data = copy_of(np.zeros((form.trunk_rows + legs * form.leg_rows, columns)))
    whole = memory_of(data, columns, constants, reactions, scene.features)
    whole.trunk[:] = np.nan
    whole.limbs[:] = np.nan
    trunk, limbs = settings_of(scene, scene.trunk, scene.ground, scene.limbs)
    whole.trunk_settings[:] = trunk[:, None]
    whole.limb_settings[:] = limbs[:, :, None]
    return memory_of(data, num_envs, constants, reactions, scene.features)


def new_model(
    scene: Mechanics, filters: FilterSettings, strides: bool
) -> tuple[NDArray[Any], Floats, Floats]:
    """What does not change while it runs: a record `MODEL`, the legs' tables, the terrain's cells."""
    ground = scene.ground
    terrain = scene.terrain
    cells = max(profile.cells for profile in scene.profiles)
    tables = [profile.with_cells(cells).table for profile in dict.fromkeys(scene.profiles)]
    tables = [np.concatenate([table, table[:1]]) for table in tables]
    scheme = SCHEMES[scene.integrator]
    grid = terrain.to_grid()
    model = np.zeros(1, MODEL)
    record = model[0]
    record["legs"] = len(scene.limbs)
    record["cells"] = cells
    record["kind"] = TRUNKS.index(scene.trunk.kind)
    record["eighths"] = round(ground.exponent * EXPONENT_UNIT)
    record["friction_law"] = FRICTION_LAWS.index(ground.friction_law)
    record["interpolated"] = ground.approach == "interpolated"
    record["is_terrain"] = terrain != Terrain.flat()
    record["new_rates"] = scheme.new_rates
    record["strides"] = strides
    record["motors"] = any(isinstance(limb.drive, Motor) for limb in scene.limbs)
    record["averages"] = scheme.averages
    record["stages"] = len(scheme.weights)
    record["fractions"][: len(scheme.fractions)] = scheme.fractions
    record["weights"][: len(scheme.weights)] = scheme.weights
    record["settings"] = filters.to_array().ravel()
    record["ground_origin"] = grid.origin
    record["ground_per_metre"] = grid.per_metre
    whole = aligned(sum(map(len, tables)), tables[0].shape[1])
    return model, np.concatenate(tables, out=whole), grid.cells


def check_shared(scene: Mechanics, trunk: Trunk, ground: Ground, limbs: Sequence[Limb]) -> None:
    """Raise where one environment's trunk, ground or legs differ in what the kernels take once for all."""
    for name, given, own in (
        ("trunk.kind", trunk.kind, scene.trunk.kind),
        *((name, getattr(ground, name), getattr(scene.ground, name))
          for name in ("exponent", "friction_law", "approach")),
    ):  # fmt: skip
        if given != own:
            raise ParameterError(f"{name}: expected {own!r}, which all environments share, got {given!r}")
    if len(limbs) != len(scene.limbs):
        raise ParameterError(f"limbs: expected {len(scene.limbs)}, got {len(limbs)}")
    check_limbs(trunk, limbs, scene.features.springs)
    for k, (limb, own_limb) in enumerate(zip(limbs, scene.limbs, strict=True)):
        if type(limb.drive) is not type(own_limb.drive):
            raise ParameterError(f"drive: expected a {type(own_limb.drive).__name__}, got {limb.drive!r}")
        if scales_of(f"limbs[{k}]", limb, own_limb) != (1.0, 1.0) and not scene.features.has_limits:
            raise ParameterError(
                f"limbs[{k}].geometry: expected that of the engine, which was made without limits; with "
                f"limits, if only Limits(), legs may have sizes of their own"
            )


def check_limbs(trunk: Trunk, limbs: Sequence[Limb], springs: bool) -> None:
    """Raise where a hip is beyond the trunk, or some hoofs have springs and others none."""
    for k, limb in enumerate(limbs):
        if trunk.length is not None and abs(limb.hip[0]) > trunk.length / 2:
            raise ParameterError(
                f"limbs[{k}].hip: expected within the trunk, {trunk.length / 2:g} m of its centre of mass "
                f"forward or back, got {limb.hip[0]:g}"
            )
        if (limb.spring is not None) != springs:
            expected, given = ("a HoofSpring", "none") if springs else ("none", repr(limb.spring))
            raise ParameterError(
                f"limbs[{k}].spring: expected {expected}, as the engine's first leg has, got {given}"
            )


def scales_of(name: str, limb: Limb, own: Limb) -> tuple[float, float]:
    """Length and mass of a leg over those of the engine's, to which it must be similar."""
    if limb.geometry == own.geometry:
        return 1.0, 1.0
    one = limb.geometry.to_dict()
    other = own.geometry.to_dict()
    length = one["hip_height"] / other["hip_height"]
    mass = limb.geometry.mass / own.geometry.mass
    pairs = [
        (limb.geometry.body_lengths, length * own.geometry.body_lengths),
        (one["pivot"], length * np.array(other["pivot"])),
        (limb.geometry.body_masses, mass * own.geometry.body_masses),
        (limb.geometry.body_inertias, mass * length**2 * own.geometry.body_inertias),
    ]
    unlike = [key for key in ("assembly", "toe", "heel", "travel") if one[key] != other[key]]
    parts = ("lengths", "pivot", "masses", "inertias")
    unlike += [
        part for part, (a, b) in zip(parts, pairs, strict=True) if not np.allclose(a, b, rtol=1e-9, atol=0)
    ]
    if unlike:
        raise ParameterError(
            f"{name}.geometry: expected one similar to the engine's {own.geometry.name!r}, of uniform rods "
            f"with masses in the same proportions, got {limb.geometry.name!r} with other {', '.join(unlike)}"
        )
    return length, mass


def settings_of(
    scene: Mechanics, trunk: Trunk, ground: Ground, limbs: Sequence[Limb]
) -> tuple[Floats, Floats]:
    """Rows of `TrunkSettings` and of `LegSettings`, (legs, rows), of an environment under a trunk of the same
    kind, on a ground with the same laws."""
    mass = trunk.mass + sum(limb.geometry.mass for limb in limbs)
    record = ground.to_record()
    hangs = trunk.kind == "suspended"
    limits = scene.motion_limits or Limits()
    values = {
        "total_mass": mass, "inverse_mass": 1 / mass, "pitch_inertia": trunk.pitch_inertia,
        "support": (1 - trunk.share) * mass * GRAVITY if hangs else 0.0,
        "spring": trunk.stiffness if hangs else 0.0, "damper": trunk.damping if hangs else 0.0,
        "height": trunk.height, "drag": trunk.drag, "gravity": GRAVITY,
        "bottom": float(np.min(scene.terrain.height)),
    } | {name: record[name] for name in (
        "stiffness", "chi", "dashpot", "approach_floor", "friction", "friction_slow", "friction_fast"
    )}  # fmt: skip
    bounds = np.clip((*limits.pitch, *limits.height, limits.clearance), -NOWHERE, NOWHERE)
    values |= _numbered("limits", bounds.tolist())
    lift_off = LIFT_OFF * mass * GRAVITY / len(limbs)
    unique = list(dict.fromkeys(scene.profiles))
    cells = max(profile.cells for profile in scene.profiles)
    firsts = [unique.index(profile) * (cells + 1) for profile in scene.profiles]  # where a leg's table begins
    names = scene.features.of(LegSettings).names
    each = []
    for k, (limb, own, first) in enumerate(zip(limbs, scene.limbs, firsts, strict=True)):
        rows = _limb_settings(limb, first, lift_off, scales_of(f"limbs[{k}]", limb, own))
        each.append([rows[name] for name in names])
    return np.array([values[name] for name in scene.features.of(TrunkSettings).names]), np.array(each)


def _limb_settings(
    limb: Limb, first_row: int, lift_off: float, scales: tuple[float, float]
) -> dict[str, float]:
    motor = limb.drive if isinstance(limb.drive, Motor) else Motor(0.0, 0.0, 0.0, 0.0)
    side = float(limb.geometry.travel)
    rotor = motor.rotor_inertia
    spring = limb.spring
    values = {
        "hip_on_trunk_x": limb.hip[0], "hip_on_trunk_y": limb.hip[1], "mass": limb.geometry.mass,
        "side": side, "first_row": first_row, "is_motor": float(isinstance(limb.drive, Motor)),
        "speed_gain": motor.speed_gain, "torque_limit": motor.torque_limit,
        "rotor_crank": motor.reflected_inertia, "rotor_coupling": -side * motor.gear_ratio * rotor,
        "rotor_frame": rotor, "lift_off": lift_off,
        "length_scale_0": scales[0], "mass_scale_0": scales[1],
    }  # fmt: skip
    if spring is None:
        return values
    stiffness = _numbered("hoof_stiffness", (spring.stiffness, spring.tangential_stiffness))
    damping = _numbered("hoof_damping", (spring.damping, spring.tangential_damping))
    return values | stiffness | damping


def _numbered(name: str, values: Sequence[float | None]) -> dict[str, Any]:
    """The rows of a block by name."""
    return {f"{name}_{k}": value for k, value in enumerate(values)}


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


def gaits_of(gaits: Any, legs: int, n: int, harmonics: int) -> Floats:
    """`gaits` of `TrunkEngine.reset` as numbers of shape (legs, 2 + 2 harmonics, n)."""
    if isinstance(gaits, np.ndarray):
        given = finite("gaits", gaits, MAX_STATE)
        size = 2 + 2 * harmonics
        if given.shape != (legs, size, n):
            raise ParameterError(f"gaits: expected shape {(legs, size, n)}, got {given.shape}")
        return given
    each = all_of("gaits", [gaits] * legs if isinstance(gaits, GaitParameters) else gaits, GaitParameters)
    if len(each) != legs:
        raise ParameterError(f"gaits: expected one or {legs}, got {len(each)}")
    return np.repeat(np.array([gait_array(gait, harmonics) for gait in each])[:, :, None], n, 2)


def start(
    scene: Mechanics,
    gaits: Floats,
    theta: ArrayLike,
    theta_rate: ArrayLike | None,
    trunk: Mapping[str, ArrayLike],
    heights: Floats,
) -> tuple[Floats, Floats]:
    """State of n environments whose trunks have these heights at rest, with filters at rest and springs that
    bear nothing: of the trunk, shape (7, n), and legs, (legs, rows of a `LegState`, n).

    In the place of centre of mass, momentum and spin of all are the trunk's place, velocity and rate of
    pitch: the kernels make the one of the other (`mechanics.velocities_to_momenta`). `TrunkEngine.reset` says
    what `trunk` holds and what is refused.
    """
    legs = len(scene.limbs)
    n = len(heights)
    angle = spread("theta", theta, (legs, n), MAX_STATE)
    spin = spread("theta_rate", gaits[:, 0] if theta_rate is None else theta_rate, (legs, n), MAX_STATE)
    for i, limb in enumerate(scene.limbs):
        if not isinstance(limb.drive, Motor) and (spin[i] != gaits[i, 0]).any():
            raise ParameterError(
                f"theta_rate: leg {i} is prescribed to turn at {gaits[i, 0]} rad/s, got {spin[i]}"
            )
        turns = limb.geometry.full_turn  # then its links have a place everywhere
        if not turns and not np.isfinite(scene.profiles[i](angle[i])[0]).all():
            raise ParameterError(f"theta: the links of leg {i} have no place at some of {angle[i]} rad")
    at = {name: spread(name, value, (n,), MAX_STATE) for name, value in trunk.items()}
    kind = TRUNKS.index(scene.trunk.kind)
    for name, kinds in (
        ("vx", (RAIL, SUSPENDED, FREE)), ("vy", (SUSPENDED, FREE)), ("pitch", (FREE,)),
        ("pitch_rate", (FREE,)),
    ):  # fmt: skip
        if kind not in kinds and at[name].any():
            raise ParameterError(f"{name}: expected 0 of a {scene.trunk.kind} trunk, got {at[name]}")
    if kind <= RAIL and (off := at["y"] != heights).any():
        raise ParameterError(f"y: a {scene.trunk.kind} trunk is at {heights[off][0]:g} m, got {at['y']}")
    state = np.zeros((TrunkState.size, n))
    moving = state[TrunkState.rows("moving")]  # the kernels make of these what they integrate
    moving[Moving.rows("centre")] = (at["x"], at["y"])
    moving[Moving.rows("momentum")] = (at["vx"], at["vy"])
    moving[Moving.rows("pitch")] = at["pitch"]
    moving[Moving.rows("spin")] = at["pitch_rate"]
    rows = scene.features.of(LegState)
    leg = np.zeros((legs, rows.size, n))
    leg[:, rows.rows("theta")] = angle[:, None]
    leg[:, rows.rows("theta_rate")] = spin[:, None]
    leg[:, rows.rows("gait")] = gaits
    return state, leg


STATE = ("trunk", "limbs", "strides", "command", "account", "trunk_settings", "limb_settings")
"""Arrays that hold what changes."""

_MOVING = TrunkState.rows("moving").start
_PLACES = [
    _MOVING + row for name in ("centre", "pitch") for row in range(*Moving.rows(name).indices(Moving.size))
]
_ANGLES = LegState.rows("theta")
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
            arrays[name] = np.asarray(state[name], np.float64)
        except (TypeError, ValueError):
            raise ParameterError(f"state[{name!r}]: expected numbers, got {state[name]!r}") from None
        if arrays[name].shape != shape:
            raise ParameterError(f"state[{name!r}]: expected shape {shape}, got {arrays[name].shape}")
    reset = _check_numbers("state", arrays)
    arrays["limb_settings"] = arrays["limb_settings"].copy()  # the caller's
    arrays["limb_settings"][:, _FIRST_ROW] = memory.limb_settings[:, _FIRST_ROW]  # an address
    return arrays, reset


def check_column(column: Memory, settings: Floats) -> None:
    """Refuse a column that cannot be gone on from, as `read_state` does a state, and put into it where the
    legs' tables are, which is an address, from an engine's `settings` of legs."""
    _check_numbers("column", {name: getattr(column, name) for name in STATE})
    column.limb_settings[:, _FIRST_ROW] = settings[:, _FIRST_ROW]


def _check_numbers(title: str, arrays: Mapping[str, Floats]) -> NDArray[np.bool_]:
    """Which environments were ever reset; `ParameterError` where a number of theirs is not finite, or a place
    or an angle too far away to be looked up."""
    trunk = arrays["trunk"]
    limbs = arrays["limbs"]
    reset: NDArray[np.bool_] = np.ones(trunk.shape[-1], bool)
    places = trunk[_PLACES], limbs[:, _ANGLES]
    squares = sum(float(np.vdot(part, part)) for part in arrays.values())
    farthest = max(float(np.vdot(part, part)) for part in places)
    if not (math.isfinite(squares) and farthest <= MAX_STATE**2):  # else all is good, found in no time
        reset = np.logical_not(np.isnan(trunk).all(0) & np.isnan(limbs).all((0, 1)))
        for name in STATE:
            finite(f"{title}[{name!r}]", arrays[name][..., reset])
        finite(f"{title}['trunk'], places and pitch", places[0][:, reset], MAX_STATE)
        finite(f"{title}['limbs'], crank angles", places[1][..., reset], MAX_STATE)
    return reset


def identity_of(scene: Mechanics, filters: FilterSettings, **numbers: float) -> dict[str, Any]:
    """Everything on which the bits of a run depend, by name, as values that JSON can hold."""
    identity: dict[str, Any] = {**numbers, "integrator": scene.integrator}
    for name, part in (("trunk", scene.trunk), ("ground", scene.ground), ("filters", filters)):
        identity |= {f"{name}.{key}": value for key, value in asdict(part).items()}
    identity["terrain"] = _digest(scene.terrain.to_dict())
    if scene.trunk.length is None:
        del identity["trunk.length"]  # as in states from before there was one
    if scene.features.harmonics > 1:
        identity["harmonics"] = scene.features.harmonics
    if scene.motion_limits:
        identity["limits"] = repr(scene.motion_limits)
    for i, limb in enumerate(scene.limbs):
        shape = limb.geometry.to_dict()
        identity |= {f"limbs[{i}].hip": list(limb.hip), f"limbs[{i}].drive": repr(limb.drive)}
        if limb.spring:
            identity[f"limbs[{i}].spring"] = repr(limb.spring)
        identity[f"limbs[{i}].geometry"] = _digest(
            {key: value for key, value in shape.items() if key not in ("name", "provenance")}
        )
    return identity


def _differences(expected: dict[str, Any], given: dict[str, Any]) -> str:
    """Where two layouts differ, for people; empty if nowhere."""
    if expected == given:
        return ""
    names = [name for name in {**expected, **given} if expected.get(name) != given.get(name)]
    return "; ".join(f"{name}: expected {expected.get(name)!r}, got {given.get(name)!r}" for name in names)


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:16]
