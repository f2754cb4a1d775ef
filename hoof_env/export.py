"""Records of forces as CSV, Parquet and OpenSim's .mot, one function each; `write` chooses by the suffix.

In swing, force and centre of pressure are 0 in all of them, as force plates and gait-lab tools have it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env._output import staged
from hoof_env.errors import HoofEnvError, check_number, parse_pairs
from hoof_env.records import check_place, describe, find_policy, make_env, record_episode

Record = Mapping[str, NDArray[np.float64]]

MOT_COLUMNS = (
    "time",
    "ground_force_vx", "ground_force_vy", "ground_force_vz",
    "ground_force_px", "ground_force_py", "ground_force_pz",
    "ground_torque_x", "ground_torque_y", "ground_torque_z",
)  # fmt: skip
"""OpenSim's names: force [N], point of application [m], free moment [N m]; x forward, y up, z right."""


def write_csv(record: Record, about: Mapping[str, Any], path: Path) -> None:
    """One row a substep under one header line with name and unit; numbers keep their bits."""
    units = about["units"]
    header = ",".join(f"{name} [{units[name]}]" for name in record)
    table = np.column_stack(list(record.values()))
    np.savetxt(path, table, fmt="%.17g", delimiter=",", header=header, comments="", encoding="utf-8")


def write_parquet(record: Record, about: Mapping[str, Any], path: Path) -> None:
    """Columns of float64; a field's metadata has its "unit", the schema's "hoof_env" has `about` as JSON."""
    import pyarrow as pa
    from pyarrow import parquet

    schema = pa.schema(
        [pa.field(name, pa.float64(), False, {"unit": about["units"][name]}) for name in record],
        {"hoof_env": json.dumps(about)},
    )
    parquet.write_table(pa.table(dict(record), schema=schema), path)


def write_mot(record: Record, about: Mapping[str, Any], path: Path) -> None:
    """OpenSim's motion file for external loads: `MOT_COLUMNS`, tab separated, under its header.

    The leg moves in the plane z = 0, so z of force and place and the moments about x and y are 0.
    """
    from_record = {
        "time": "time", "ground_force_vx": "force_x", "ground_force_vy": "force_y",
        "ground_force_px": "cop_x", "ground_force_py": "cop_y", "ground_torque_z": "free_moment",
    }  # fmt: skip
    rows = len(record["time"])
    table = np.zeros((rows, len(MOT_COLUMNS)))
    for k, name in enumerate(MOT_COLUMNS):
        if name in from_record:
            table[:, k] = record[from_record[name]] + 0.0  # no -0
    header = [
        path.name, "version=1", f"nRows={rows}", f"nColumns={len(MOT_COLUMNS)}", "inDegrees=yes", "endheader",
        "\t".join(MOT_COLUMNS),
    ]  # fmt: skip
    np.savetxt(
        path, table, fmt="%.10g", delimiter="\t", header="\n".join(header), comments="", encoding="utf-8"
    )


WRITERS: dict[str, Callable[[Record, Mapping[str, Any], Path], None]]
WRITERS = {".csv": write_csv, ".parquet": write_parquet, ".mot": write_mot}


def check_export(path: Path) -> None:
    """Raise unless `write` can write to `path`; before an episode is played.

    Raises:
        ParameterError, OutputError: as `records.check_place`. HoofEnvError: pyarrow is missing.
    """
    check_place(path, WRITERS)
    if path.suffix.lower() == ".parquet":
        try:
            import pyarrow.parquet  # noqa: F401
        except ImportError:
            raise HoofEnvError('Parquet needs pyarrow: pip install "hoof-env[export]"') from None


def write(record: Record, about: Mapping[str, Any], path: Path) -> Path:
    """Write what `records.record_episode` and `records.describe` return, in the format of the path's suffix;
    an older file is replaced when this is complete. Errors are those of `check_export`."""
    check_export(path)
    with staged(path.parent) as stage:
        WRITERS[path.suffix.lower()](record, about, stage / path.name)
    return path


def export_episode(
    path: Path,
    policy: str,
    env_id: str,
    arguments: Sequence[str] = (),
    seed: int = 0,
    seconds: float | None = None,
) -> int:
    """Play an episode and write its record; returns the number of rows. What `hoof-env export` does.

    Raises:
        ParameterError, DataFileError: as `records.make_env` and `records.find_policy`.
        ParameterError, OutputError, HoofEnvError: as `write`, and before the episode is played.
    """
    check_export(path)
    check_number("seed", seed, low=0)
    with make_env(env_id, given := parse_pairs("--args", arguments)) as env:
        record = record_episode(env, find_policy(policy, env, env_id, seed), seed, seconds)
        about = describe(env, environment=env_id, arguments=given, policy=policy, seed=seed)
    write(record, about, path)
    return len(record["time"])
