"""Writer of OpenSim's files: `.mot` and `.sto` with the ground reaction forces, and their ExternalLoads XML.

OpenSim's ground frame is the world frame of `hoof_env.lab`. A horse's columns have the limb's name as prefix:
`left_fore_ground_force_vx`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as xml

import numpy as np

from hoof_env.errors import ParameterError, brief
from hoof_env.lab.forces import Columns, limb_name, limbs_of

MOT_COLUMNS = {
    "ground_force_vx": "force_x",
    "ground_force_vy": "force_y",
    "ground_force_vz": "",
    "ground_force_px": "cop_x",
    "ground_force_py": "cop_y",
    "ground_force_pz": "",
    "ground_torque_x": "",
    "ground_torque_y": "",
    "ground_torque_z": "free_moment",
}
"""Columns of a record by OpenSim's names: force [N], point of application [m] and free moment [N m]; "" gives
zeros."""

STATED = ("weight_n", "threshold_n")
"""Entries of the header in addition to OpenSim's own, in N; OpenSim keeps and ignores them."""

IDENTIFIERS = {"force": "ground_force_v", "point": "ground_force_p", "torque": "ground_torque_"}
"""Beginnings of the columns of a limb, which x, y and z follow."""


def write_mot(record: Columns, about: Mapping[str, Any], path: Path) -> None:
    """Write `time` and `MOT_COLUMNS` of each limb, then joint reactions, if any, and the document of
    `loads_of` to `loads_path`.

    Args:
        record: columns of shape (n,), see `hoof_env.records`.
        about: description of the record: `STATED` entries of the header, "reactions", the names of columns of
            joint reactions, and "bodies" by limb.
        path: the motion file.
    """
    limbs = limbs_of(record)
    nothing = np.zeros(len(record["time"]))
    columns = {"time": record["time"]}
    for limb in limbs:
        for name, column in MOT_COLUMNS.items():
            columns[f"{limb}{name}"] = record[f"{limb}{column}"] if column else nothing
    columns |= {name: record[name] for name in about.get("reactions", ())}
    stated = "".join(f"{name}={about[name]:.10g}\n" for name in STATED if name in about)
    counts = f"nRows={len(nothing)}\nnColumns={len(columns)}"
    header = f"{path.name}\nversion=1\n{counts}\ninDegrees=yes\n{stated}endheader\n"
    # Adding 0 turns -0 into 0, which would be written with its sign.
    table = np.column_stack([*columns.values()]) + 0.0
    names = "\t".join(columns)
    np.savetxt(path, table, "%.10g", delimiter="\t", header=header + names, comments="", encoding="utf-8")
    tree = xml.ElementTree(loads_of(limbs, about.get("bodies", {}), path.name))
    xml.indent(tree)
    tree.write(loads_path(path), encoding="UTF-8", xml_declaration=True)


def loads_path(path: Path) -> Path:
    """Return the path of a motion file's ExternalLoads XML: `run_loads.xml` of `run.mot`, and
    `run_sto_loads.xml` of `run.sto`, in the same folder."""
    # Two names, as both motion files may lie in one folder.
    storage = "_sto" if path.suffix.lower() == ".sto" else ""
    return path.with_name(f"{path.stem}{storage}_loads.xml")


def body_of(limb: str) -> str:
    """Return the default name of a model's body that carries a limb's force: `left_fore_hoof`, or `hoof`."""
    return f"{limb}hoof"


def check_bodies(bodies: Mapping[str, Any], limbs: list[str]) -> dict[str, str]:
    """Check and return the names of bodies by limb.

    Raises:
        ParameterError: a limb is not one of `limbs`, or a body is not a name.
    """
    names = [limb_name(limb) for limb in limbs]
    for name, body in bodies.items():
        # XML has no control characters, nor halves of pairs.
        if name not in names or not isinstance(body, str) or not body or not body.isprintable():
            raise ParameterError(f"bodies: expected {', '.join(names)}=BODY, got {name}={brief(body)}")
    return dict(bodies)


def loads_of(limbs: list[str], bodies: Mapping[str, str], motion: str) -> xml.Element:
    """Build OpenSim's document of external forces.

    Args:
        limbs: prefixes of the limbs' columns.
        bodies: bodies by limb; `body_of` is the default.
        motion: name of the motion file, which lies in the same folder.
    """
    document = xml.Element("OpenSimDocument", Version="40000")
    loads = xml.SubElement(document, "ExternalLoads", name="ground_reaction_forces")
    objects = xml.SubElement(loads, "objects")
    for limb in limbs:
        force = xml.SubElement(objects, "ExternalForce", name=limb_name(limb))
        properties = {
            "applied_to_body": bodies.get(limb_name(limb), body_of(limb)),
            "force_expressed_in_body": "ground",
            "point_expressed_in_body": "ground",
            **{f"{kind}_identifier": f"{limb}{start}" for kind, start in IDENTIFIERS.items()},
        }
        for name, text in properties.items():
            xml.SubElement(force, name).text = text
    xml.SubElement(loads, "datafile").text = motion
    return document
