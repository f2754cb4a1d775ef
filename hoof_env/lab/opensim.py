"""OpenSim's files: `.mot` and `.sto` with the ground reaction forces, and the ExternalLoads XML beside them.

OpenSim's ground frame is the world frame of `hoof_env.lab`. Of a horse each column has the limb's name before
it: `left_fore_ground_force_vx`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np

from hoof_env.errors import ParameterError
from hoof_env.lab.forces import Columns, limb_name, limbs_of

MOT_COLUMNS = {
    "ground_force_vx": "force_x", "ground_force_vy": "force_y", "ground_force_vz": "",
    "ground_force_px": "cop_x", "ground_force_py": "cop_y", "ground_force_pz": "",
    "ground_torque_x": "", "ground_torque_y": "", "ground_torque_z": "free_moment",
}  # fmt: skip
"""OpenSim's names: force [N], point of application [m], free moment [N m]; and the column of the record, none
for zeros."""

STATED = ("weight_n", "threshold_n")
"""What the header says beyond OpenSim's own entries, which keeps and ignores others [N]."""

IDENTIFIERS = {"force": "ground_force_v", "point": "ground_force_p", "torque": "ground_torque_"}
"""What the columns of a limb begin with; x, y and z follow."""


def write_mot(record: Columns, about: Mapping[str, Any], path: Path) -> None:
    """Write `time` and `MOT_COLUMNS` of each limb, then joint reactions, if any; and beside it `loads_of`.
    The header says the weight and the threshold of stances, too, in `STATED`."""
    limbs = limbs_of(record)
    nothing = np.zeros(len(record["time"]))
    columns = {"time": record["time"]} | {
        f"{limb}{name}": record[f"{limb}{column}"] if column else nothing
        for limb in limbs for name, column in MOT_COLUMNS.items()
    }  # fmt: skip
    columns |= {name: record[name] for name in about.get("reactions", ())}
    stated = "".join(f"{name}={about[name]:.10g}\n" for name in STATED if name in about)
    counts = f"nRows={len(nothing)}\nnColumns={len(columns)}"
    header = f"{path.name}\nversion=1\n{counts}\ninDegrees=yes\n{stated}endheader\n"
    table = np.column_stack([*columns.values()]) + 0.0  # no -0
    names = "\t".join(columns)
    np.savetxt(path, table, "%.10g", delimiter="\t", header=header + names, comments="", encoding="utf-8")
    tree = xml.ElementTree(loads_of(limbs, about.get("bodies", {}), path.name))
    xml.indent(tree)
    tree.write(loads_path(path), encoding="UTF-8", xml_declaration=True)


def loads_path(path: Path) -> Path:
    """The ExternalLoads XML of a motion file: `run.mot` has `run_loads.xml` beside it, and `run.sto`, which
    may be there, too, `run_sto_loads.xml`."""
    storage = "_sto" if path.suffix.lower() == ".sto" else ""
    return path.with_name(f"{path.stem}{storage}_loads.xml")


def body_of(limb: str) -> str:
    """The body of a model that carries a limb's force unless another is named: `left_fore_hoof`, `hoof`."""
    return f"{limb}hoof"


def check_bodies(bodies: Mapping[str, Any], limbs: list[str]) -> dict[str, str]:
    """Bodies by limb, checked. `ParameterError` of a limb that is not there."""
    names = [limb_name(limb) for limb in limbs]
    for name, body in bodies.items():
        if name not in names or not isinstance(body, str) or not body:
            raise ParameterError(f"bodies: expected {', '.join(names)}=BODY, got {name}={body!r}")
    return dict(bodies)


def loads_of(limbs: list[str], bodies: Mapping[str, str], motion: str) -> xml.Element:
    """OpenSim's document of the forces in the file `motion`, which lies beside it, on `bodies` by limb."""
    document = xml.Element("OpenSimDocument", Version="40000")
    loads = xml.SubElement(document, "ExternalLoads", name="ground_reaction_forces")
    objects = xml.SubElement(loads, "objects")
    for limb in limbs:
        force = xml.SubElement(objects, "ExternalForce", name=limb_name(limb))
        said = {
            "applied_to_body": bodies.get(limb_name(limb), body_of(limb)),
            "force_expressed_in_body": "ground", "point_expressed_in_body": "ground",
            **{f"{kind}_identifier": f"{limb}{start}" for kind, start in IDENTIFIERS.items()},
        }  # fmt: skip
        for name, text in said.items():
            xml.SubElement(force, name).text = text
    xml.SubElement(loads, "datafile").text = motion
    return document
