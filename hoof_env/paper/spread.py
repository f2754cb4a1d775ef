"""What the published numbers do not determine: how far the legs of an ensemble differ that all meet them.

Every member runs one cycle of each gait, elastic and inelastic, with the exact solver in the set-up of
`hoof_env.paper.reproduce`. What is measured on each leg is summarised over the members by median, quartiles
(the middle half) and extremes; curves are compared pair by pair at equal times.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.errors import HoofEnvError
from hoof_env.gait.parameters import load_gait
from hoof_env.identify.ensemble import Ensemble, load_ensemble
from hoof_env.leg.geometry import Geometry, load_geometry
from hoof_env.leg.linkage import LENGTHS
from hoof_env.paper.figure_ensemble import EnsembleCurves
from hoof_env.paper.measure import measure_stance
from hoof_env.paper.published import CONDITIONS, Published, load_published
from hoof_env.paper.reproduce import GAITS, run_cycle
from hoof_env.paper.shapes import step_length
from hoof_env.paper.spread_limits import held_by_demands, one_sided
from hoof_env.paper.spread_names import COORDINATES, FOLLOWING, GAIT_NAMES, IDENTIFIED, SWING, ZEROED

Array = NDArray[Any]

SAMPLES = 1001
"""Instants of a cycle at which curves are kept."""


@dataclass(frozen=True)
class Spread:
    """How far the members of an ensemble differ.

    Attributes:
        data: ready for JSON, see `measure_spread`.
        curves: of the members, for the figures.
    """

    data: dict[str, Any]
    curves: EnsembleCurves


@dataclass(frozen=True)
class _Leg:
    """One leg measured: `values` by id; curves of shape (SAMPLES,), path relative to O."""

    geometry: Geometry
    values: dict[str, float]
    normal: dict[tuple[str, str], Array]
    torque: dict[tuple[str, str], Array]
    path: dict[str, Array]


def measure_spread(
    ensemble: Ensemble | str, preset: str | None = None, progress: Callable[[str], None] | None = None
) -> Spread:
    """Simulate every member and summarise how far they differ.

    Args:
        ensemble: it, or the name of the preset that it belongs to.
        preset: what it is shown beside, a name or a file; by default the preset that it belongs to.
        progress: called with a line at the end; on a terminal a bar is drawn too.

    Returns:
        `data` holds preset, members, walk, bar (by solver), short (members that miss a demand on
        plausibility), provenance, assemblies (how many members share signs, toe and direction); quantities:
        by id of `IDENTIFIED` and `FOLLOWING`, name, unit, preset, median, middle_half and range (two numbers
        each), relative (width of the range over |median|, None where zero is arbitrary); differences:
        by id, name, unit, largest and rms over all pairs and instants, relative (rms over a scale, or None);
        held and one_sided, see `hoof_env.paper.spread_limits`.

    Raises:
        HoofEnvError: no such ensemble or preset, or a member that does not step on the ground once a cycle.
    """
    if isinstance(ensemble, str):
        ensemble = load_ensemble(ensemble)
    preset = preset or ensemble.name
    time = np.linspace(0, 1, SAMPLES)
    own = _measure(preset, time)
    legs = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "member.json"
        for number, member in enumerate(_bar(ensemble.members, progress), 1):
            file.write_text(json.dumps(member.to_preset()), encoding="utf-8")
            try:
                legs.append(_measure(str(file), time))
            except HoofEnvError as error:
                raise HoofEnvError(f"ensemble {ensemble.name}, member {number}: {error}") from None
    curves = EnsembleCurves(
        time,
        normal={key: np.array([leg.normal[key] for leg in legs]) for key in own.normal},
        path={gait: np.array([leg.path[gait] for leg in legs]) for gait in GAITS},
        hip_height=np.array([leg.geometry.hip_height for leg in legs]),
        crank_torque={key: np.array([leg.torque[key] for leg in legs]) for key in own.torque},
        lengths={name: np.array([leg.geometry.lengths[name] for leg in legs]) for name in LENGTHS},
    )
    values = {key: [leg.values[key] for leg in legs] for key in IDENTIFIED | FOLLOWING}
    quantities = {
        key: {"name": name, "unit": unit, "preset": own.values[key]}
        | summarise(values[key], unit in ZEROED and key not in COORDINATES)
        for key, (name, unit) in (IDENTIFIED | FOLLOWING).items()
    }
    published = load_published()
    data = {
        "preset": Path(preset).name,
        "members": len(legs),
        "walk": ensemble.walk,
        "bar": ensemble.bar,
        "short": sum(bool(member.short) for member in ensemble.members),
        "provenance": ensemble.provenance,
        "assemblies": _assemblies(leg.geometry for leg in legs),
        "linear_density": sorted({leg.geometry.linear_density for leg in legs}),
        "quantities": quantities,
        "differences": _differences(curves, published),
        "held": held_by_demands(values),
        "one_sided": one_sided(values, published),
    }
    if progress:
        progress(f"ensemble: {len(legs)} legs simulated in the four conditions")
    return Spread(data, curves)


def summarise(values: Iterable[float], has_zero: bool = True) -> dict[str, Any]:
    """Median, middle half (quartiles), range and its width over |median| of some values."""
    low, first, median, third, high = np.quantile(list(values), [0, 0.25, 0.5, 0.75, 1]).tolist()
    relative = (high - low) / abs(median) if has_zero and median else None
    return {"median": median, "middle_half": [first, third], "range": [low, high], "relative": relative}


def compare_pairs(curves: Array) -> tuple[float, float]:
    """Largest and rms distance of two members at one instant, over all pairs and instants; curves of shape
    (members, n), real or complex. Both are 0 for a single member."""
    apart = [np.abs(curves[k + 1 :] - curves[k]).ravel() for k in range(len(curves) - 1)]
    if not apart:
        return 0.0, 0.0
    distances = np.concatenate(apart)
    return float(distances.max()), float(np.sqrt(np.mean(distances**2)))


def _bar(members: Iterable[Any], progress: Callable[[str], None] | None) -> Iterable[Any]:
    """The members, with a bar on a terminal if progress is wanted and tqdm is there (no dependency of
    `reproduce`)."""
    if progress is None or not sys.stderr.isatty():
        return members
    try:
        from tqdm import tqdm
    except ImportError:
        return members
    return tqdm(members, desc="ensemble", unit="leg", leave=False)


def _measure(preset: str, time: Array) -> _Leg:
    """Run a preset (a name or a file) through the four conditions."""
    geometry = load_geometry(preset)
    values = {f"length.{name}": length for name, length in geometry.lengths.items()}
    values |= {"length.OC": abs(complex(*geometry.pivot)), "hip_height": geometry.hip_height}
    values["mass"] = geometry.mass
    values |= dict(zip(COORDINATES, geometry.pivot, strict=True))
    leg = _Leg(geometry, values, {}, {}, {})
    for gait in GAITS:
        parameters = load_gait(gait, preset)
        values |= {f"{gait}.{name}": getattr(parameters, name) for name in SWING}
        for condition, restitution in CONDITIONS.items():
            trace = run_cycle(gait, "exact", preset=preset, restitution=restitution)
            stance = measure_stance(trace)
            torque, t = trace["crank_torque"], trace["t"]
            values |= {
                f"{gait}.{condition}.crank_peak": float(np.abs(torque).max()),
                f"{gait}.{condition}.crank_rms": float(np.sqrt(np.mean(torque[1:] ** 2))),
                f"{gait}.{condition}.peak": stance.peak,
                f"{gait}.{condition}.peak_time": stance.peak_time,
                f"{gait}.{condition}.impulse": stance.mean * stance.period,
            }
            leg.normal[gait, condition] = np.interp(time, t, trace["normal"])
            leg.torque[gait, condition] = np.interp(time, t, torque)
        x = (trace["toe_x"] + trace["heel_x"]) / 2 - trace["trunk_x"]
        height = -(trace["toe_penetration"] + trace["heel_penetration"]) / 2
        step, reach = step_length(trace, stance)
        values |= {f"{gait}.step": step, f"{gait}.reach": reach, f"{gait}.lift": float(height.max())}
        leg.path[gait] = np.interp(time, t, x) + 1j * np.interp(time, t, height - trace["trunk_y"])
    return leg


def _assemblies(geometries: Iterable[Geometry]) -> list[dict[str, Any]]:
    """How many legs share the signs of their dyads, toe and direction of travel, most common first."""
    kinds = Counter(
        (tuple(geometry.assembly.items()), geometry.toe, geometry.travel) for geometry in geometries
    )
    return [
        {"assembly": dict(signs), "toe": toe, "travel": travel, "members": count}
        for (signs, toe, travel), count in kinds.most_common()
    ]


def _differences(curves: EnsembleCurves, published: Published) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}

    def add(key: str, name: str, unit: str, values: Array, scale: float | None = None) -> None:
        largest, rms = compare_pairs(values)
        relative = rms / scale if scale else None
        found[key] = {"name": name, "unit": unit, "largest": largest, "rms": rms, "relative": relative}

    for gait, label in GAIT_NAMES.items():
        x, y = curves.height_paths(gait, 0.0)
        sole = x + 1j * y
        start, end = (published.row(f"{gait}.contact_{edge}").value for edge in ("start", "end"))
        stance = sole[:, (curves.time >= start) & (curves.time <= end)]
        moved = stance - stance.real.mean(axis=1, keepdims=True)
        add(f"{gait}.path", f"{label}, path of the sole over the cycle", "m", sole)
        add(f"{gait}.path_stance", f"{label}, path in stance", "m", stance)
        add(f"{gait}.path_stance_shape", f"{label}, path in stance, its middle under O", "m", moved)
    for key, name, unit, which in (
        ("crank_torque", "crank torque", "N m", curves.crank_torque),
        ("normal", "normal force", "N", curves.normal),
    ):
        for (gait, condition), values in which.items():
            scale = (
                published.row(f"{gait}.mean_{condition}").value
                if key == "normal"
                else float(np.sqrt(np.mean(values**2)))
            )
            label = f"{GAIT_NAMES[gait]}, {condition}, {name}"
            add(f"{gait}.{condition}.{key}", label, unit, values, scale)
    return found
