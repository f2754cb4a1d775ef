"""Episodes of any policy on any environment of the package, substep by substep, for pictures and files.

Files are CSV, Parquet, OpenSim's .mot and .sto, and .c3d; `write` chooses by the suffix. `hoof_env.lab`
defines frame, signs and centre of pressure.
"""

from __future__ import annotations

import json
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

import hoof_env
from hoof_env._input import as_path
from hoof_env._output import check_folder, free_memory, staged
from hoof_env.envs.base import LegBase
from hoof_env.envs.make_env import make_env as make_named_env
from hoof_env.errors import (
    MissingExtraError,
    OutputError,
    ParameterError,
    brief,
    check_choice,
    check_number,
    parse_pairs,
)
from hoof_env.lab.c3d import ezc3d, write_c3d
from hoof_env.lab.forces import THRESHOLD, above_threshold, in_units, limbs_of, onto_surface
from hoof_env.lab.forces import UNITS as FORCE_UNITS
from hoof_env.lab.opensim import check_bodies, loads_path, write_mot
from hoof_env.lab.reactions import JointReactions, reaction_units
from hoof_env.policies.actor import Actor, lost_command
from hoof_env.policies.find import default_policy as default_policy
from hoof_env.policies.find import find_policy as find_policy
from hoof_env.record.columns import RECORD, Columns, body_units, joined
from hoof_env.record.surroundings import Surroundings

TELL_SECONDS = 5.0
"""Time between two lines about the progress of an episode [s]."""

COPIES = 3
"""Number of copies of a record in memory while it is assembled and written."""


def surroundings(env: Any) -> Surroundings:
    """Return the surroundings of a single environment of this package, wrapped or not; raise `ParameterError`
    for another environment."""
    leg = env.unwrapped
    if not isinstance(leg, LegBase) or isinstance(leg, gym.vector.VectorEnv):
        raise ParameterError(
            f"environment: expected a single one of this package behind it, got {type(leg).__name__}"
        )
    return leg.surroundings()


def substeps(env: Any, record: Columns | None = None) -> Columns:
    """Return the columns of the last control step of an environment of this package, commands included: one
    row for each substep, or one row after a reset. `record` is `env.record()`, if it is known."""
    columns: Columns = env.unwrapped.recording().columns(record=record)
    return columns


def make_env(env_id: str, arguments: Mapping[str, Any] | None = None) -> gym.Env[Any, Any]:
    """Make an environment of this package by `gymnasium.make`.

    Raises:
        ParameterError: the id or an argument is wrong, or the environment is of another package.
    """
    arguments = dict(arguments or {})
    if "render_mode" in arguments:
        raise ParameterError(
            f"render_mode: expected none, as recordings and films need no mode, got "
            f"{arguments['render_mode']!r}"
        )
    env = make_named_env(env_id, **arguments)
    # Raises for environments of other packages, which record no substeps.
    surroundings(env)
    return env


def episode(
    env: gym.Env[Any, Any],
    policy: Any,
    seed: int = 0,
    seconds: float | None = None,
    options: Mapping[str, Any] | None = None,
    joints: JointReactions | None = None,
) -> Iterator[Columns]:
    """Play an episode; yield the columns of its start (one row) and of every control step.

    Args:
        env: the environment.
        policy: what `load_policy` takes.
        seed, options: arguments of `reset`.
        seconds: time after which the episode is stopped [s]; None plays it to its end.
        joints: adds columns of joint reactions.
    """
    if seconds is not None:
        check_number("seconds", seconds, low=0, exclusive_low=True)
    actor = Actor(policy, env, seed)
    start = actor.start | dict(options or {})
    if "target_speed" not in (options or {}) and (lost := lost_command(start, env)):
        warnings.warn(f"policy: plays with its own {lost}", stacklevel=2)
    observation, _ = env.reset(seed=seed, options=start)
    columns = substeps(env)
    yield columns | (_named(env, joints.now()) if joints else {})
    ended = False
    # Times are sums of steps, and rounding must not add a step.
    while not ended and (seconds is None or columns["time"][-1] < seconds - 1e-9):
        action = actor.act(observation)
        began = joints.before() if joints else None
        observation, _, failed, truncated, _ = env.step(action)
        ended = failed or truncated
        before = columns["time"][-1]
        columns = substeps(env)
        # A step in which the simulation failed has no new substeps.
        if columns["time"][-1] > before:
            if joints and began is not None:
                columns |= _named(env, joints.after(began, len(columns["time"])))
            yield columns


def longest_of(env: gym.Env[Any, Any], seconds: float | None) -> float:
    """Return the longest duration of an episode that is stopped after `seconds` [s]."""
    episode_seconds = float(env.unwrapped.settings.episode_seconds)  # type: ignore[attr-defined]
    return episode_seconds if seconds is None else min(seconds, episode_seconds)


def check_memory(rows: float, columns: int) -> None:
    """Raise `ParameterError` if a record with `rows` and `columns` does not fit into the free memory."""
    needed = COPIES * 8.0 * rows * columns
    free = free_memory()
    if needed > free:
        raise ParameterError(
            f"seconds: {rows:.3g} rows of {columns} columns need {needed / 1e9:.3g} GB of memory, and "
            f"{free / 1e9:.3g} GB are free; expected a shorter episode: --seconds, or episode_seconds"
        )


def _with_progress(played: Iterator[Columns], longest: float) -> Iterator[Columns]:
    """Yield the parts of an episode of at most `longest` [s]; print a line on its progress to stderr every
    `TELL_SECONDS`."""
    printed = time.monotonic()
    for part in played:
        yield part
        if time.monotonic() - printed >= TELL_SECONDS:
            printed = time.monotonic()
            print(f"{part['time'][-1]:.1f} of at most {longest:g} s", file=sys.stderr, flush=True)


def _named(env: gym.Env[Any, Any], reactions: NDArray[np.float64]) -> Columns:
    """Return reactions of shape (n, legs, columns) as columns by name."""
    columns = {}
    for i, limb in enumerate(surroundings(env).hips):
        for k, name in enumerate(reaction_units(surroundings(env).geometry.mechanism)):
            columns[f"{limb}{name}"] = reactions[:, i, k]
    return columns


def record_episode(
    env: gym.Env[Any, Any],
    policy: Any,
    seed: int = 0,
    seconds: float | None = None,
    options: Mapping[str, Any] | None = None,
    reactions: bool = False,
    tell: bool = False,
) -> Columns:
    """Play an episode and return its record at every substep: columns of shape (n,), see `units_of`.

    `reactions` adds the forces in the joints, see `lab.reactions`; `tell` prints the progress to stderr. For
    other arguments and errors see `episode`; a record that does not fit into the memory raises
    `ParameterError`.
    """
    units = units_of(env, reactions)
    longest = longest_of(env, seconds)
    check_memory(longest / env.get_wrapper_attr("sim_dt"), len(units))
    joints = JointReactions(env) if reactions else None
    played = episode(env, policy, seed, seconds, options, joints)
    parts = list(_with_progress(played, longest) if tell else played)
    return onto_surface(joined(parts, units), surroundings(env).terrain)


def units_of(env: gym.Env[Any, Any], reactions: bool = False) -> dict[str, str]:
    """Return the units of a record by column.

    The columns are `record.columns.RECORD`, and with `reactions` also `reaction_units`. A horse has columns
    of its trunk, and the columns of each leg with its name as prefix: `left_fore_force_y`.
    """
    of_leg = RECORD | (reaction_units(surroundings(env).geometry.mechanism) if reactions else {})
    return body_units(of_leg, surroundings(env).hips)


def describe(env: gym.Env[Any, Any], **about: Any) -> dict[str, Any]:
    """Return the description of a record for its file, as JSON has it: version, units, leg, ground and the
    entries of `about`."""
    setting = surroundings(env)
    ground = asdict(env.unwrapped.engine.ground).items()  # type: ignore[attr-defined]
    return {
        "hoof_env": hoof_env.__version__,
        **about,
        "sim_dt_s": env.get_wrapper_attr("sim_dt"),
        "weight_n": setting.weight_n,
        "axes": "x forward, y up, z to the right; angles counter-clockwise",
        "units": units_of(env),
        "geometry": setting.geometry.to_dict(),
        "ground": {name: value.item() if isinstance(value, np.generic) else value for name, value in ground},
        "terrain": setting.terrain.to_dict(),
    }


def check_place(path: Path | str, suffixes: Iterable[str]) -> None:
    """Raise `ParameterError` unless the suffix of a path is one of `suffixes`, and `OutputError` if it is a
    folder or its folder cannot be written."""
    path = as_path("path", path)
    known = sorted(suffixes)
    if path.suffix.lower() not in known:
        raise ParameterError(f"out: expected a file that ends in {', '.join(known)}, got {brief(str(path))}")
    if path.is_dir():
        raise OutputError(f"cannot write to {str(path)!r}: expected a file, got a folder")
    check_folder(path.parent)


def write_csv(record: Columns, about: Mapping[str, Any], path: Path | str) -> None:
    """Write a CSV file with one row for each substep under one line of names and units.

    Numbers keep their bits. With forces in body weights there is a column `weight` [N], the same in all rows.
    """
    path = as_path("path", path)
    units = dict(about["units"])
    # A CSV file has no other place for the weight, which converts body weights to newtons.
    if "BW" in units.values():
        record = record | {"weight": np.full(len(record["time"]), about["weight_n"])}
        units["weight"] = "N"
    header = ",".join(f"{name} [{units[name]}]" for name in record)
    table = np.column_stack([*record.values()])
    # 17 digits bring back every bit of a float64.
    np.savetxt(path, table, "%.17g", delimiter=",", header=header, comments="", encoding="utf-8")


def write_parquet(record: Columns, about: Mapping[str, Any], path: Path | str) -> None:
    """Write a Parquet file of float64. The metadata of a field have its "unit", the schema's have `about` as
    JSON under "hoof_env"."""
    path = as_path("path", path)
    import pyarrow as pa
    from pyarrow import parquet

    schema = pa.schema(
        [pa.field(name, pa.float64(), False, {"unit": about["units"][name]}) for name in record],
        {"hoof_env": json.dumps(about)},
    )
    parquet.write_table(pa.table(dict(record), schema=schema), path)


WRITERS: dict[str, Callable[[Columns, Mapping[str, Any], Path], None]] = {
    ".csv": write_csv,
    ".parquet": write_parquet,
    ".mot": write_mot,
    ".sto": write_mot,
    ".c3d": write_c3d,
}
"""Writers by suffix."""

OPENSIM = (".mot", ".sto")
"""Formats with an ExternalLoads XML."""

NEWTONS = (*OPENSIM, ".c3d")
"""Formats with forces in newtons, which their readers expect."""


def check_export(path: Path | str) -> None:
    """Check that `write` can write to a path, before an episode is played. Raise the errors of `check_place`,
    and `MissingExtraError` if the format needs a package that is not installed."""
    path = as_path("path", path)
    check_place(path, WRITERS)
    if path.suffix.lower() == ".c3d":
        ezc3d()
    if path.suffix.lower() == ".parquet":
        try:
            import pyarrow.parquet  # noqa: F401
        except ImportError:
            raise MissingExtraError('Parquet needs pyarrow: pip install "hoof-env[export]"') from None


def files_of(path: Path | str) -> list[Path]:
    """Return the paths of the files that `write` writes: the record and, in OpenSim's formats, the
    ExternalLoads XML."""
    path = as_path("path", path)
    return [path, loads_path(path)] if path.suffix.lower() in OPENSIM else [path]


def write(record: Columns, about: Mapping[str, Any], path: Path | str) -> Path:
    """Write the results of `record_episode` and `describe` in the format of the path's suffix.

    Older files are replaced when all new ones are complete. Errors are as in `check_export`, and
    `ParameterError` if the record does not fit into the format.
    """
    path = as_path("path", path)
    check_export(path)
    with staged(path.parent) as stage:
        WRITERS[path.suffix.lower()](record, about, stage / path.name)
    return path


def export_episode(
    path: Path | str,
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
    """Play an episode and write its record, as `hoof-env export` does with the same options; return the
    number of rows and the weight [N].

    Args:
        path: the file.
        policy: name of a policy, see `find_policy`.
        env_id, arguments: id and arguments of the environment, key=value or JSON objects.
        seed, seconds, reactions: arguments of `record_episode`; `seed` also seeds the policy "random".
        threshold: force along the ground's normal below which a limb counts as unloaded [N].
        units: unit of forces, "N" or "BW".
        bodies: bodies of an OpenSim model that carry the forces, LIMB=BODY.

    Raises:
        HoofEnvError: a subclass, as in `make_env`, `find_policy` and, before the episode is played, `write`.
    """
    path = as_path("path", path)
    # All arguments are checked first: an episode may take long.
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
    env_arguments = parse_pairs("--env-kwargs", arguments)
    with make_env(env_id, env_arguments) as env:
        names = units_of(env, reactions)
        on = check_bodies(parse_pairs("--bodies", bodies), limbs_of(names))
        player = find_policy(policy, env, env_id, seed)
        record = record_episode(env, player, seed, seconds, reactions=reactions, tell=True)
        kept = above_threshold(record, threshold, surroundings(env).terrain)
        about = describe(env, environment=env_id, arguments=env_arguments, policy=policy, seed=seed)
        of_joints = tuple(reaction_units(surroundings(env).geometry.mechanism)) if reactions else ()
        about |= {
            "threshold_n": threshold,
            "bodies": on,
            "units": names,
            "reactions": [name for name in names if name.endswith(of_joints)],
        }
    written, description = in_units(kept, about, units)
    write(written, description, path)
    return len(record["time"]), about["weight_n"]
