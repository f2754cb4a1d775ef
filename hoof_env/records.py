"""Episodes of any policy on any environment of the package, substep by substep: for pictures, and for files.

`surroundings` and `substeps` are all that is read from behind an environment; the rest is written against
them. The files are CSV, Parquet, OpenSim's .mot and .sto, and .c3d; `write` chooses by the suffix. Frame,
signs and centre of pressure are those of `hoof_env.lab`.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import hoof_env
from hoof_env._output import check_folder, free_memory, staged
from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.envs.policies import constant_gait, load_open_loop, make_policy, policy_names, start_of
from hoof_env.errors import (
    MissingExtraError,
    OutputError,
    ParameterError,
    check_choice,
    check_number,
    parse_pairs,
)
from hoof_env.gait import PARAMETERS, GaitParameters
from hoof_env.ground.terrain import Terrain
from hoof_env.lab.c3d import ezc3d, write_c3d
from hoof_env.lab.forces import THRESHOLD, above_threshold, in_units, limbs_of, onto_surface
from hoof_env.lab.forces import UNITS as FORCE_UNITS
from hoof_env.lab.opensim import check_bodies, loads_path, write_mot
from hoof_env.lab.reactions import REACTION_UNITS, JointReactions
from hoof_env.render import instant
from hoof_env.render.instant import UNITS, Columns, Surroundings, columns_of, units_of_legs
from hoof_env.saved_policy import find_saved

RECORD = {name: unit for name, unit in UNITS.items() if name not in PARAMETERS[1:]} | {"free_moment": "N m"}
"""Columns of a record and their units: fields of `Instant` but for the swing's parameters, which are known at
the end of a control step only. The free moment about the centre of pressure is 0."""


TELL_SECONDS = 5.0
"""Time between two lines about how far an episode is [s]."""

COPIES = 3
"""Of a record, while it is put together and written."""


def surroundings(env: Any) -> Surroundings:
    """The setting of an environment of this package, wrapped or not; `ParameterError` of another."""
    leg = env.unwrapped
    try:
        hips = leg.batch.body.hips
        return Surroundings(
            leg.geometry,
            getattr(leg, "terrain", None) or Terrain.flat(),
            leg.weight,
            leg.engine.trunk.kind,
            LIFT_OFF * leg.weight / max(len(hips), 1),
            leg.dt,
            leg.sim_dt,
            hips,
        )
    except AttributeError:
        raise ParameterError(
            f"environment: expected one leg of this package behind it, got {type(leg).__name__}"
        ) from None


def substeps(env: Any) -> Columns:
    """What happened in the last control step of an environment of this package, one row a substep, or the
    start after a reset, with what was commanded."""
    leg = env.unwrapped
    command = leg.engine.command_in(leg.engine.column(0))
    return columns_of(leg.record(), leg.batch.body.hips, leg.terrain, command)


def instants_of(env: Any, columns: Columns) -> list[Any]:
    """Records of the rows of `columns` of an environment, `Instant`s or `HorseInstant`s."""
    return instant.instants_of(columns, env.unwrapped.batch.body.hips)


def make_env(env_id: str, arguments: Mapping[str, Any] | None = None) -> gym.Env[Any, Any]:
    """`gymnasium.make`, refusals in our words, environments of other packages among them."""
    arguments = dict(arguments or {})
    if "render_mode" in arguments:
        raise ParameterError("render_mode: expected none here, where the environment need not draw itself")
    try:
        env = gym.make(env_id, **arguments)
    except ParameterError:
        raise
    except (gym.error.Error, ModuleNotFoundError, TypeError) as error:
        raise ParameterError(f"environment {env_id!r} with {arguments or 'no arguments'}: {error}") from None
    surroundings(env)
    return env


def find_policy(name: str | None, env: gym.Env[Any, Any], env_id: str, seed: int = 0) -> Any:
    """A policy for an environment by its name: a gait or another scripted one, "6.28,0.7,-0.2,-0.3" (crank
    speed [rad/s], swing offset, sine and cosine coefficient [rad]), "open-loop", the best gait that comes
    with this package for the id, or a path; None is "run", or a horse's "reference".

    The .zip or run folder of a model is a pickle: it can run code. A policy's .onnx file, the folder of one
    that is shipped, or a gait's .json are data. `seed` is that of "random".
    """
    names = policy_names(env)
    if name is None:
        name = "reference" if "reference" in names else "run"
    if name in names:
        return make_policy(name, env, seed)
    if name.endswith(".json"):
        return load_open_loop(name, env)
    if name == "open-loop":
        return load_open_loop(env_id, env)
    if name.lower().endswith((".zip", ".onnx")) or Path(name).is_dir():
        return find_saved(Path(name)).load(env, env_id)
    try:
        numbers = [float(number) for number in name.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) == len(PARAMETERS):
        return constant_gait(GaitParameters(*numbers), env, starts_in_it=True)
    raise ParameterError(
        f"policy: expected a name ({', '.join(names)}, open-loop), four gait parameters as "
        f"6.28,0.7,-0.2,-0.3, or the path of a trained model or a gait's .json, got {name!r}"
    )


def episode(
    env: gym.Env[Any, Any],
    policy: Any,
    seed: int = 0,
    seconds: float | None = None,
    options: Mapping[str, Any] | None = None,
    joints: JointReactions | None = None,
) -> Iterator[Columns]:
    """Play an episode; yields the columns of its start (one row) and of every control step.

    `policy` is anything with Stable-Baselines3's `predict`; `seed` and `options` are those of `reset`. It
    stops after some `seconds`, or at its own end. With `joints` the columns have their reactions, too.
    """
    if seconds is not None:
        check_number("seconds", seconds, low=0, exclusive_low=True)
    observation, _ = env.reset(seed=seed, options=start_of(policy) | dict(options or {}))
    here = substeps(env)
    yield here | (_named(env, joints.now()) if joints else {})
    start = np.ones(1, bool)
    ended = False
    while not ended and (seconds is None or here["time"][-1] < seconds - 1e-9):
        action, _ = policy.predict(observation, episode_start=start, deterministic=True)
        began = joints.before() if joints else None
        observation, _, failed, truncated, _ = env.step(action)
        start = np.zeros(1, bool)
        ended = failed or truncated
        before = here["time"][-1]
        here = substeps(env)
        if here["time"][-1] > before:  # else the simulation failed and nothing happened
            if joints and began is not None:
                here |= _named(env, joints.after(began, len(here["time"])))
            yield here


def longest_of(env: gym.Env[Any, Any], seconds: float | None) -> float:
    """How long an episode that is stopped after some `seconds`, if not before, lasts at most [s]."""
    own = float(env.unwrapped.settings.episode_seconds)  # type: ignore[attr-defined]
    return own if seconds is None else min(seconds, own)


def check_memory(rows: float, columns: int) -> None:
    """`ParameterError` where a record of so many rows would not fit into the memory that is free."""
    needed = COPIES * 8.0 * rows * columns
    free = free_memory()
    if needed > free:
        raise ParameterError(
            f"seconds: {rows:.3g} rows of {columns} columns need {needed / 1e9:.3g} GB of memory, and "
            f"{free / 1e9:.3g} GB are free; expected a shorter episode: --seconds, or episode_seconds"
        )


def _with_progress(played: Iterator[Columns], longest: float) -> Iterator[Columns]:
    """The same; every `TELL_SECONDS` a line says how far it is."""
    told = time.monotonic()
    for part in played:
        yield part
        if time.monotonic() - told >= TELL_SECONDS:
            told = time.monotonic()
            print(f"{part['time'][-1]:.1f} of at most {longest:g} s", file=sys.stderr, flush=True)


def _named(env: gym.Env[Any, Any], reactions: NDArray[np.float64]) -> Columns:
    """Reactions of shape (n, legs, columns) by name."""
    limbs = [f"{leg}_" for leg in surroundings(env).hips] or [""]
    return {
        f"{limb}{name}": reactions[:, i, k]
        for i, limb in enumerate(limbs)
        for k, name in enumerate(REACTION_UNITS)
    }


def record_episode(
    env: gym.Env[Any, Any],
    policy: Any,
    seed: int = 0,
    seconds: float | None = None,
    options: Mapping[str, Any] | None = None,
    reactions: bool = False,
    tell: bool = False,
) -> Columns:
    """The record of an episode at every substep: arrays of shape (n,), names and units as `units_of` says.
    Arguments and errors are those of `episode`; `reactions` adds the forces in the joints, see
    `lab.reactions`; `tell` says now and then on stderr how far it is. `ParameterError` where the memory of
    this machine cannot hold it."""
    units = units_of(env, reactions)
    longest = longest_of(env, seconds)
    check_memory(longest / surroundings(env).sim_dt, len(units))
    joints = JointReactions(env) if reactions else None
    played = episode(env, policy, seed, seconds, options, joints)
    parts = list(_with_progress(played, longest) if tell else played)
    moments = [name for name in units if name.endswith("free_moment")]
    record = {name: np.concatenate([part[name] for part in parts]) for name in units if name in parts[0]}
    record |= {name: np.zeros(len(record["time"])) for name in moments}
    return onto_surface(record, surroundings(env).terrain)


def units_of(env: gym.Env[Any, Any], reactions: bool = False) -> dict[str, str]:
    """Columns of a record and their units: `RECORD`, with `reactions` also `REACTION_UNITS`; of a horse those
    of the trunk, and each leg's under its name, `left_fore_force_y`."""
    of_leg = RECORD | (REACTION_UNITS if reactions else {})
    return units_of_legs(of_leg, surroundings(env).hips)


def describe(env: gym.Env[Any, Any], **about: Any) -> dict[str, Any]:
    """What a file says about its record, JSON-serialisable: version, units, leg, ground and `about`."""
    here = surroundings(env)
    ground = asdict(env.unwrapped.engine.ground).items()  # type: ignore[attr-defined]
    return {
        "hoof_env": hoof_env.__version__,
        **about,
        "sim_dt_s": here.sim_dt,
        "weight_n": here.weight_n,
        "axes": "x forward, y up, z to the right; angles counter-clockwise",
        "units": units_of(env),
        "geometry": here.geometry.to_dict(),
        "ground": {name: value.item() if isinstance(value, np.generic) else value for name, value in ground},
        "terrain": here.terrain.to_dict(),
    }


def check_place(path: Path, suffixes: Iterable[str]) -> None:
    """Raise unless a file can be written at `path` and its suffix is one of `suffixes`."""
    known = sorted(suffixes)
    if path.suffix.lower() not in known:
        raise ParameterError(f"out: expected a file that ends in {', '.join(known)}, got {str(path)!r}")
    if path.is_dir():
        raise OutputError(f"cannot write to {str(path)!r}: expected a file, got a folder")
    check_folder(path.parent)


def write_csv(record: Columns, about: Mapping[str, Any], path: Path) -> None:
    """One row a substep under one header line with name and unit; numbers keep their bits. Beside forces in
    body weights stands the column `weight`, the same in all rows: there is no other place for it."""
    units = dict(about["units"])
    if "BW" in units.values():
        record = record | {"weight": np.full(len(record["time"]), about["weight_n"])}
        units["weight"] = "N"
    header = ",".join(f"{name} [{units[name]}]" for name in record)
    table = np.column_stack([*record.values()])
    np.savetxt(path, table, "%.17g", delimiter=",", header=header, comments="", encoding="utf-8")


def write_parquet(record: Columns, about: Mapping[str, Any], path: Path) -> None:
    """Columns of float64; a field's metadata has its "unit", the schema's "hoof_env" has `about` as JSON."""
    import pyarrow as pa
    from pyarrow import parquet

    schema = pa.schema(
        [pa.field(name, pa.float64(), False, {"unit": about["units"][name]}) for name in record],
        {"hoof_env": json.dumps(about)},
    )
    parquet.write_table(pa.table(dict(record), schema=schema), path)


WRITERS: dict[str, Callable[[Columns, Mapping[str, Any], Path], None]]
WRITERS = {
    ".csv": write_csv, ".parquet": write_parquet, ".mot": write_mot, ".sto": write_mot, ".c3d": write_c3d
}  # fmt: skip
OPENSIM = (".mot", ".sto")
"""Formats with ExternalLoads beside them."""

NEWTONS = (*OPENSIM, ".c3d")
"""Formats whose readers take forces for newtons."""


def check_export(path: Path) -> None:
    """Raise unless `write` can write to `path`; before an episode is played."""
    check_place(path, WRITERS)
    if path.suffix.lower() == ".c3d":
        ezc3d()
    if path.suffix.lower() == ".parquet":
        try:
            import pyarrow.parquet  # noqa: F401
        except ImportError:
            raise MissingExtraError('Parquet needs pyarrow: pip install "hoof-env[export]"') from None


def files_of(path: Path) -> list[Path]:
    """What `write` writes: the record and, of OpenSim's formats, the ExternalLoads XML."""
    return [path, loads_path(path)] if path.suffix.lower() in OPENSIM else [path]


def write(record: Columns, about: Mapping[str, Any], path: Path) -> Path:
    """Write what `record_episode` and `describe` return, in the format of the path's suffix;
    older files are replaced when these are complete. Errors are those of `check_export`, and `ParameterError`
    of a record that does not fit into the format."""
    check_export(path)
    with staged(path.parent) as stage:
        WRITERS[path.suffix.lower()](record, about, stage / path.name)
    return path


def export_episode(
    path: Path,
    policy: str | None,
    env_id: str,
    arguments: Sequence[str] = (),
    seed: int = 0,
    seconds: float | None = None,
    threshold: float = THRESHOLD,
    units: str = "N",
    reactions: bool = False,
    bodies: Sequence[str] = (),
) -> tuple[int, float]:
    """Play an episode and write its record; returns the number of rows and the weight [N]. What
    `hoof-env export` does; errors are those of `make_env`, `find_policy` and, before the episode is played,
    `write`."""
    check_export(path)
    suffix = path.suffix.lower()
    check_number("seed", seed, low=0)
    check_number("threshold", threshold, low=0.0, high=1e6)
    check_choice("units", units, FORCE_UNITS)
    if units != "N" and suffix in NEWTONS:
        raise ParameterError(f"units: expected N in {suffix}, which is read as newtons, got {units}")
    if bodies and suffix not in OPENSIM:
        raise ParameterError(
            f"bodies: expected a {' or '.join(OPENSIM)}, which have ExternalLoads, got {suffix}"
        )
    if reactions and suffix == ".c3d":
        raise ParameterError("reactions: expected a .csv, .parquet, .mot or .sto, got .c3d")
    with make_env(env_id, given := parse_pairs("--args", arguments)) as env:
        names = units_of(env, reactions)
        on = check_bodies(parse_pairs("--bodies", bodies), limbs_of(names))
        player = find_policy(policy, env, env_id, seed)
        record = record_episode(env, player, seed, seconds, reactions=reactions, tell=True)
        kept = above_threshold(record, threshold, surroundings(env).terrain)
        about = describe(env, environment=env_id, arguments=given, policy=policy, seed=seed) | {
            "threshold_n": threshold, "bodies": on, "units": names,
            "reactions": [name for name in names if reactions and name.endswith(tuple(REACTION_UNITS))],
        }  # fmt: skip
    written, said = in_units(kept, about, units)
    write(written, said, path)
    return len(record["time"]), about["weight_n"]
