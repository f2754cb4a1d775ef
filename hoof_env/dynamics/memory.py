"""Memory and settings of `TrunkEngine` as its kernels take them, starts of environments, and checks of stored
states."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.constants import GRAVITY
from hoof_env.dynamics import layout
from hoof_env.dynamics.advance import LANES
from hoof_env.dynamics.layout import (
    MAX_STATE,
    Features,
    LegSettings,
    LegState,
    Moving,
    TrunkSettings,
    TrunkState,
    engine_layout,
)
from hoof_env.dynamics.leg_constants import PAPER_STRUCTURE, leg_constants, structure_of
from hoof_env.dynamics.model import MODEL
from hoof_env.dynamics.parts import (
    FREE,
    FREEDOMS,
    RAIL,
    UPRIGHT,
    Limb,
    Limits,
    Mechanics,
    Motor,
    Trunk,
)
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.errors import Floats, ParameterError, all_of, finite, spread
from hoof_env.gait import FilterSettings, GaitParameters, gait_array
from hoof_env.ground.contact import Ground
from hoof_env.ground.laws import FRICTION_LAWS
from hoof_env.ground.terrain import Terrain
from hoof_env.simd.math import EXPONENT_UNIT
from hoof_env.simd.memory import aligned

LIFT_OFF = 0.05
"""Normal force that separates stance from swing, as a fraction of a leg's part of the weight. A hoof that
grazes the ground between two pushes has lifted off: if any contact were stance, a policy could hold one peak
for ever and push under it."""


NOWHERE = 1e30
"""Finite number in place of an infinite bound."""


class Memory(NamedTuple):
    """An engine's memory in the form of the kernels' arguments, and views of its parts; the last axis is the
    environment. Shapes are for an engine without `Features`."""

    data: Floats  # all of it, (rows, columns): whole vectors of environments, so some columns may be idle
    trunk: Floats  # the state, (7, n)
    limbs: Floats  # (legs, 16, n)
    trunk_settings: Floats  # (17, n)
    limb_settings: Floats  # (legs, 12, n)
    strides: Floats  # (legs, 6, n)
    stride_sums: Floats  # (legs, rows of `StrideSums`, n)
    command: Floats  # (legs, 4, n)
    account: Floats  # (9, n), added up over calls
    trunk_report: Floats  # at the end of the last call, (8, n)
    limb_report: Floats  # (legs, 18, n)
    result: Floats  # values of `parts.Result`, (n,); where not OK the state is unchanged
    constants: Floats  # `leg_constants.constants_layout`, (legs, size); 0 if unused
    reactions: Floats  # `reactions.Reactions`, (legs, size, columns)
    features: Features


def memory_of(
    data: Floats, num_envs: int, constants: Floats, reactions: Floats, features: Features
) -> Memory:
    """Return a `Memory` with views of `data`. Its last columns may be idle; more axes may follow."""
    form = engine_layout(features)
    trunk = data[: form.trunk_rows, :num_envs]
    limbs = data[form.trunk_rows :].reshape(len(constants), form.leg_rows, *data.shape[1:])[:, :, :num_envs]
    trunk_parts = {name: trunk[form.trunk_memory.rows(name)] for name in form.trunk_memory.fields}
    limb_parts = {name: limbs[:, form.leg_memory.rows(name)] for name in form.leg_memory.fields}
    return Memory(
        data=data,
        trunk=trunk_parts["state"],
        limbs=limb_parts["state"],
        trunk_settings=trunk_parts["settings"],
        limb_settings=limb_parts["settings"],
        strides=limb_parts["strides"],
        stride_sums=limb_parts["sums"],
        command=limb_parts["command"],
        account=trunk_parts["account"],
        trunk_report=trunk_parts["report"],
        limb_report=limb_parts["report"],
        result=trunk_parts["result"][0],
        constants=constants,
        reactions=reactions,
        features=features,
    )


def named_rows(memory: Memory) -> dict[str, Floats]:
    """Return the state and report by name, as views."""
    views = {}
    parts: list[tuple[tuple[str, ...], Floats]]
    parts = [(layout.TRUNK_STATE, memory.trunk), (layout.TRUNK_REPORT, memory.trunk_report)]
    for names, values in parts:
        for k, name in enumerate(names):
            views[name] = values[k]
    parts = [(layout.leg_state(memory.features), memory.limbs), (layout.LEG_REPORT, memory.limb_report)]
    for names, values in parts:
        for k, name in enumerate(names):
            views[name] = values[:, k]
    return views


def columns_for(num_envs: int) -> int:
    """Return the number of columns for some environments: whole groups of lanes."""
    columns = -(-num_envs // LANES) * LANES
    # one more group where all rows would start in the same few sets of the cache
    return columns + LANES if columns % 128 == 0 else columns


def copy_of(data: Floats) -> Floats:
    """Copy into cache-aligned memory."""
    copy = aligned(*data.shape)
    copy[:] = data
    return copy


def new_memory(scene: Mechanics, num_envs: int, columns: int, reacts: bool) -> Memory:
    """Allocate the memory of an engine; states are NaN until reset."""
    legs = len(scene.limbs)
    form = engine_layout(scene.features)
    constants = np.zeros((legs, form.constants.size))
    if reacts or scene.features.has_limits:
        constants = np.array([leg_constants(limb.geometry) for limb in scene.limbs])
    reactions = np.zeros((legs, form.reactions.size, columns if reacts else 0))
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
    """Return the kernels' constant arrays: a record `MODEL`, the legs' tables, the terrain's cells."""
    ground = scene.ground
    terrain = scene.terrain
    cells = max(profile.cells for profile in scene.profiles)
    # legs of the same shape share a table
    tables = [profile.with_cells(cells).table for profile in dict.fromkeys(scene.profiles)]
    # cell 0 begins before the turn does: its row again at the end; see `profile.locate`
    tables = [np.concatenate([table, table[:1]]) for table in tables]
    scheme = SCHEMES[scene.integrator]
    grid = terrain.to_grid()
    model = np.zeros(1, MODEL)
    record = model[0]
    record["legs"] = len(scene.limbs)
    record["cells"] = cells
    record["kind"] = FREEDOMS[scene.trunk.kind]
    record["eighths"] = round(ground.exponent * EXPONENT_UNIT)
    record["friction_law"] = FRICTION_LAWS.index(ground.friction_law)
    record["is_interpolated"] = ground.approach == "interpolated"
    record["is_terrain"] = terrain != Terrain.flat()
    record["uses_new_rates"] = scheme.uses_new_rates
    record["counts_strides"] = strides
    record["has_motors"] = any(isinstance(limb.drive, Motor) for limb in scene.limbs)
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
    """Raise `ParameterError` if one environment's trunk, ground or legs differ in what all environments
    share."""
    shared = [("trunk.kind", trunk.kind, scene.trunk.kind)]
    laws = ("exponent", "friction_law", "approach")
    shared += [(name, getattr(ground, name), getattr(scene.ground, name)) for name in laws]
    for name, value, engine_value in shared:
        if value != engine_value:
            raise ParameterError(
                f"{name}: expected {engine_value!r}, which all environments share, got {value!r}"
            )
    if len(limbs) != len(scene.limbs):
        raise ParameterError(f"limbs: expected {len(scene.limbs)}, got {len(limbs)}")
    check_limbs(trunk, limbs, scene.features.has_springs)
    for k, (limb, own_limb) in enumerate(zip(limbs, scene.limbs, strict=True)):
        if type(limb.drive) is not type(own_limb.drive):
            raise ParameterError(f"drive: expected a {type(own_limb.drive).__name__}, got {limb.drive!r}")
        if scales_of(f"limbs[{k}]", limb, own_limb) != (1.0, 1.0) and not scene.features.has_limits:
            raise ParameterError(
                f"limbs[{k}].geometry: expected the geometry of the engine, which was made without limits; an"
                " engine made with limits, even Limits(), takes legs of other sizes"
            )


def features_of(limbs: Sequence[Limb], harmonics: int, has_limits: bool, reacts: bool) -> Features:
    """Return the features of an engine with these legs.

    Raises:
        ParameterError: the legs have different structures.
    """
    first = limbs[0].geometry
    structure = structure_of(first)
    for k, limb in enumerate(limbs):
        if structure_of(limb.geometry) != structure:
            raise ParameterError(
                f"limbs[{k}].geometry: expected the mechanism of the first leg, {first.name!r}, and the same "
                f"bodies with a centre of mass of their own, since legs on one trunk share their kernels; "
                f"{limb.geometry.name!r} has another; give all legs lengths of one mechanism"
            )
    needed = structure if has_limits or reacts else PAPER_STRUCTURE
    springs = limbs[0].spring is not None
    return Features(harmonics, springs, has_limits, needed, len(first.mechanism.feet))


def check_limbs(trunk: Trunk, limbs: Sequence[Limb], springs: bool) -> None:
    """Raise `ParameterError` if a hip is beyond the trunk, or only some hooves have springs."""
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
    """Return the length and mass of a leg relative to the engine's leg, to which it must be similar."""
    if limb.geometry == own.geometry:
        return 1.0, 1.0
    shape = limb.geometry.to_dict()
    own_shape = own.geometry.to_dict()
    length = shape["hip_height"] / own_shape["hip_height"]
    mass = limb.geometry.mass / own.geometry.mass
    if structure_of(limb.geometry) != structure_of(own.geometry):
        raise ParameterError(f"{name}.geometry: expected the mechanism of the engine's geometry, got another")
    scaled = own.geometry.scaled(length)
    pairs: dict[str, tuple[Any, Any]] = {
        "lengths": (limb.geometry.body_lengths, length * own.geometry.body_lengths),
        "pivot": (list(limb.geometry.fixed.values()), list(scaled.fixed.values())),
        "centres": (limb.geometry.body_centres, own.geometry.body_centres),
        "masses": (limb.geometry.body_masses, mass * own.geometry.body_masses),
        "inertias": (limb.geometry.body_inertias, mass * length**2 * own.geometry.body_inertias),
    }
    unlike = [key for key in ("assembly", "toe", "heel", "travel") if shape[key] != own_shape[key]]
    unlike += [part for part, (a, b) in pairs.items() if not np.allclose(a, b, rtol=1e-9, atol=0)]
    if unlike:
        raise ParameterError(
            f"{name}.geometry: expected one similar to the engine's {own.geometry.name!r}, of uniform rods "
            f"with masses in the same proportions, got {limb.geometry.name!r} with other {', '.join(unlike)}"
        )
    return length, mass


def settings_of(
    scene: Mechanics, trunk: Trunk, ground: Ground, limbs: Sequence[Limb]
) -> tuple[Floats, Floats]:
    """Return the rows of `TrunkSettings`, and of `LegSettings`, shape (legs, rows), of an environment under a
    trunk of the engine's kind, on a ground with its laws."""
    mass = trunk.mass + sum(limb.geometry.mass for limb in limbs)
    record = ground.to_record()
    hangs = trunk.kind == "suspended"
    limits = scene.motion_limits or Limits()
    values = {
        "total_mass": mass,
        "inverse_mass": 1 / mass,
        "pitch_inertia": trunk.pitch_inertia,
        "support": (1 - trunk.share) * mass * GRAVITY if hangs else 0.0,
        "spring": trunk.stiffness if hangs else 0.0,
        "damper": trunk.damping if hangs else 0.0,
        "height": trunk.height,
        "drag": trunk.drag,
        "gravity": GRAVITY,
        "bottom": float(np.min(scene.terrain.height)),
        "stiffness": record.stiffness,
        "chi": record.chi,
        "dashpot": record.dashpot,
        "approach_floor": record.approach_floor,
        "friction": record.friction,
        "friction_slow": record.friction_slow,
        "friction_fast": record.friction_fast,
    }
    # settings are checked to be finite like a state (`read_state`), so infinite bounds are replaced
    bounds = np.clip((*limits.pitch, *limits.height, limits.clearance), -NOWHERE, NOWHERE)
    values |= _numbered("limits", bounds.tolist())
    lift_off = LIFT_OFF * mass * GRAVITY / len(limbs)
    unique = list(dict.fromkeys(scene.profiles))
    cells = max(profile.cells for profile in scene.profiles)
    firsts = [unique.index(profile) * (cells + 1) for profile in scene.profiles]  # where a leg's table begins
    names = scene.features.of(LegSettings).names
    limb_rows = []
    for k, (limb, own, first) in enumerate(zip(limbs, scene.limbs, firsts, strict=True)):
        rows = _limb_settings(limb, first, lift_off, scales_of(f"limbs[{k}]", limb, own))
        limb_rows.append([rows[name] for name in names])
    trunk_rows = [values[name] for name in scene.features.of(TrunkSettings).names]
    return np.array(trunk_rows), np.array(limb_rows)


def _limb_settings(
    limb: Limb, first_row: int, lift_off: float, scales: tuple[float, float]
) -> dict[str, float]:
    # a prescribed crank has no rotor
    motor = limb.drive if isinstance(limb.drive, Motor) else Motor(0.0, 0.0, 0.0, 0.0)
    side = float(limb.geometry.travel)
    rotor = motor.rotor_inertia
    spring = limb.spring
    values = {
        "hip_on_trunk_x": limb.hip[0],
        "hip_on_trunk_y": limb.hip[1],
        "mass": limb.geometry.mass,
        "side": side,
        "first_row": first_row,
        "is_motor": float(isinstance(limb.drive, Motor)),
        "speed_gain": motor.speed_gain,
        "torque_limit": motor.torque_limit,
        "rotor_crank": motor.reflected_inertia,
        "rotor_coupling": -side * motor.gear_ratio * rotor,
        "rotor_frame": rotor,
        "lift_off": lift_off,
        "length_scale_0": scales[0],
        "mass_scale_0": scales[1],
    }
    if spring is None:
        return values
    stiffness = _numbered("hoof_stiffness", (spring.stiffness, spring.tangential_stiffness))
    damping = _numbered("hoof_damping", (spring.damping, spring.tangential_damping))
    return values | stiffness | damping | {"hoof_length": spring.length}


def _numbered(name: str, values: Sequence[float | None]) -> dict[str, Any]:
    """Return the rows of a block by name."""
    return {f"{name}_{k}": value for k, value in enumerate(values)}


@contextmanager
def only(
    envs: NDArray[np.int64], num_envs: int, arrays: Iterable[tuple[NDArray[Any], int]]
) -> Iterator[None]:
    """Restore all environments but some after a block.

    Args:
        envs: environments that the block may change.
        num_envs: number of environments.
        arrays: arrays that the block writes, each with the axis of the environments, 0 or -1.
    """
    rest = np.setdiff1d(np.arange(num_envs), envs)
    before = [(array, axis, np.take(array, rest, axis)) for array, axis in arrays]
    # Also if Ctrl-C ends the block, so that no environment has a result that is not its own.
    try:
        yield
    finally:
        for array, axis, values in before:
            if axis == 0:
                array[rest] = values
            else:
                array[..., rest] = values


def env_indices(envs: ArrayLike | None, num_envs: int) -> NDArray[np.int64]:
    """Return the indices of environments out of `num_envs`, from indices, a mask, or None for all."""
    if envs is None:
        return np.arange(num_envs)
    chosen = np.asarray(envs)
    if chosen.dtype == bool and chosen.shape == (num_envs,):
        return np.flatnonzero(chosen)
    # NumPy makes an empty list an array of floats
    if chosen.shape == (0,):
        return np.arange(0)
    if chosen.dtype.kind in "iu" and chosen.ndim == 1 and np.all((chosen >= 0) & (chosen < num_envs)):
        return chosen.astype(np.int64)
    raise ParameterError(
        f"envs: expected indices below {num_envs} or a mask of shape ({num_envs},), got {envs!r}"
    )


def unique_env_indices(envs: ArrayLike | None, num_envs: int) -> NDArray[np.int64]:
    """Return indices like `env_indices`, each at most once.

    Raises:
        ParameterError: not environments, or one twice: NumPy would add only the last of its values.
    """
    where = env_indices(envs, num_envs)
    if np.unique(where).size < where.size:
        raise ParameterError(f"envs: expected each environment once, got {envs!r}")
    return where


def gaits_of(gaits: Any, legs: int, n: int, harmonics: int) -> Floats:
    """Return `gaits` of `TrunkEngine.reset` as an array of shape (legs, 2 + 2 harmonics, n)."""
    if isinstance(gaits, np.ndarray):
        numbers = finite("gaits", gaits, MAX_STATE)
        size = 2 + 2 * harmonics
        if numbers.shape != (legs, size, n):
            raise ParameterError(f"gaits: expected shape {(legs, size, n)}, got {numbers.shape}")
        return numbers
    each = all_of("gaits", [gaits] * legs if isinstance(gaits, GaitParameters) else gaits, GaitParameters)
    if len(each) != legs:
        raise ParameterError(f"gaits: expected one or {legs}, got {len(each)}")
    return np.repeat(np.array([gait_array(gait, harmonics) for gait in each])[:, :, None], n, 2)


def start(
    scene: Mechanics,
    gaits: Floats,
    crank_angle: ArrayLike,
    crank_angle_rate: ArrayLike | None,
    trunk: Mapping[str, ArrayLike],
    heights: Floats,
) -> tuple[Floats, Floats]:
    """Return the state of n environments with filters at rest and unloaded springs: of the trunk, shape (7,
    n), and of the legs, (legs, rows of a `LegState`, n). `heights` are the trunks' heights at rest.

    The rows for centre of mass, momentum and angular momentum of all bodies hold the trunk's place, velocity
    and pitch rate, from which the kernels compute the former (`mechanics.velocities_to_momenta`). See
    `TrunkEngine.reset` for the entries of `trunk` and for errors.
    """
    legs = len(scene.limbs)
    n = len(heights)
    angle = spread("crank_angle", crank_angle, (legs, n), MAX_STATE)
    spin = spread(
        "crank_angle_rate",
        gaits[:, 0] if crank_angle_rate is None else crank_angle_rate,
        (legs, n),
        MAX_STATE,
    )
    for i, limb in enumerate(scene.limbs):
        if not isinstance(limb.drive, Motor) and (spin[i] != gaits[i, 0]).any():
            raise ParameterError(
                f"crank_angle_rate: leg {i} is prescribed to turn at {gaits[i, 0]} rad/s, got {spin[i]}"
            )
        # a crank that turns fully has a place for its links everywhere: no look-up needed
        turns = limb.geometry.full_turn
        if not turns and not np.isfinite(scene.profiles[i](angle[i])[0]).all():
            raise ParameterError(
                f"crank_angle: the links of leg {i} cannot be assembled at some of {angle[i]} rad"
            )
    at = {name: spread(name, value, (n,), MAX_STATE) for name, value in trunk.items()}
    kind = FREEDOMS[scene.trunk.kind]
    movable = {
        "vx": (RAIL, UPRIGHT, FREE),
        "vy": (UPRIGHT, FREE),
        "pitch": (FREE,),
        "pitch_rate": (FREE,),
    }
    for name, kinds in movable.items():
        if kind not in kinds and at[name].any():
            raise ParameterError(f"{name}: expected 0 for a {scene.trunk.kind} trunk, got {at[name]}")
    if kind <= RAIL and (off := at["y"] != heights).any():
        raise ParameterError(f"y: a {scene.trunk.kind} trunk is at {heights[off][0]:g} m, got {at['y']}")
    state = np.zeros((TrunkState.size, n))
    moving = state[TrunkState.rows("moving")]
    moving[Moving.rows("centre")] = (at["x"], at["y"])
    moving[Moving.rows("momentum")] = (at["vx"], at["vy"])
    moving[Moving.rows("pitch")] = at["pitch"]
    moving[Moving.rows("angular_momentum")] = at["pitch_rate"]
    rows = scene.features.of(LegState)
    leg = np.zeros((legs, rows.size, n))
    leg[:, rows.rows("crank_angle")] = angle[:, None]
    leg[:, rows.rows("crank_angle_rate")] = spin[:, None]
    leg[:, rows.rows("gait")] = gaits
    return state, leg
