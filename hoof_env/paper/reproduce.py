"""Reproduction of the paper's four conditions: walking and running, on elastic and inelastic ground.

The public environment simulates them. The trunk is fixed and the action is zero, so that the leg moves
exactly in its gait.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import hoof_env  # noqa: F401  (registers the environments)
from hoof_env._output import staged
from hoof_env.errors import HoofEnvError, ParameterError
from hoof_env.leg.geometry import Geometry
from hoof_env.leg.mechanism_list import PAPER
from hoof_env.paper import report
from hoof_env.paper.details import details
from hoof_env.paper.level import SHIFTS, compare_levels, level_line
from hoof_env.paper.measure import Stance, Trace, cycle_of, measure_stance
from hoof_env.paper.rows import CONDITIONS, EXACT, Published, compare, counted, load_published, settings_of
from hoof_env.paper.rows import SOLVERS as SOLVERS
from hoof_env.paper.rows import Reproduction as Reproduction
from hoof_env.paper.shapes import DEPTHS, judge, sole_velocity, walk_brakes

ENVIRONMENT = "hoof_env/HorseLegFixed-v0"
GAITS = ("walk", "run")

FIGURES = {
    "walk.order": "figure4",
    "walk.peaks": "figure5",
    "run.order": "figure4",
    "run.peaks": "figure5",
    "run.step": "figure3",
    "walk.direction": "figure6",
    "run.direction": "figure6",
    "walk.walks": "figure3",
    "run.walks": "figure3",
}
"""Pictures of the claims about shape, by the id of the claim."""


def run_cycle(gait: str, solver: str, **settings: Any) -> Trace:
    """Simulate one cycle of a gait on a fixed trunk under the zero action.

    Args:
        gait: "walk" or "run".
        solver: one of `SOLVERS`.
        **settings: further arguments of the environment.

    Returns:
        A row for t = 0 and one for each substep.

    Raises:
        HoofEnvError: the simulation failed before the end of the cycle.
    """
    with gymnasium.make(ENVIRONMENT, gait=gait, **settings_of(solver) | settings) as env:
        env.reset(seed=0)
        action = np.zeros(env.action_space.shape or (), np.float32)
        leg: Any = env.unwrapped
        parts = [cycle_of(leg.record())]
        terminated = False
        truncated = False
        while not truncated:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated:
                raise HoofEnvError(
                    f"{gait} with solver {solver!r}: the simulation failed before the end of its cycle"
                )
            parts.append(cycle_of(leg.record()))
    return np.concatenate(parts)


def reproduce(progress: Callable[[str], None] | None = None, *, preset: str | None = None) -> Reproduction:
    """Run the four conditions with every solver and compare them with the paper.

    Args:
        progress: function that is called with one line of text after each run.
        preset: name or file of a geometry; None for the environment's default.

    Raises:
        ParameterError: the preset is not a leg of the paper's mechanism, or lacks its gaits.
    """
    tell = progress or (lambda line: None)
    settings: dict[str, Any] = {} if preset is None else {"preset": preset}
    leg: Any = gymnasium.make(ENVIRONMENT, **settings).unwrapped
    geometry = leg.geometry
    _check_paper(preset, geometry, leg.gaits)
    ground = leg.engine.ground
    published = load_published()
    traces: dict[tuple[str, str, str], Trace] = {}
    rows: list[dict[str, Any]] = []
    medians: dict[str, dict[str, dict[float, float]]] = {}
    for solver in SOLVERS:
        stances = {}
        medians[solver] = {}
        for gait in GAITS:
            for condition, restitution in CONDITIONS.items():
                trace = run_cycle(gait, solver, restitution=restitution, **settings)
                traces[gait, condition, solver] = trace
                stance = stances[gait, condition] = measure_stance(trace)
                tell(f"{solver}, {gait}, {condition}: peak {stance.peak:.1f} N, mean {stance.mean:.1f} N")
            # Deeper legs, for the claims that the gaits move an animal; see `shapes.gait_walks`.
            cycles = {0.0: traces[gait, "elastic", solver]}
            for depth in DEPTHS[1:]:
                lower = {"restitution": CONDITIONS["elastic"], "hip_height": geometry.hip_height - depth}
                cycles[depth] = run_cycle(gait, solver, **lower, **settings)
            by_depth = {depth: sole_velocity(cycle) for depth, cycle in cycles.items()}
            medians[solver][gait] = by_depth
            values = ", ".join(f"{value:+.2f}" for value in by_depth.values())
            tell(f"{solver}, {gait}, 0, 5, 10 cm deep: sole moves at {values} m/s")
        rows += compare(published, stances, solver)
    shapes = _judge_all(traces, medians, published)
    levels = compare_levels(
        published, rows, {shift: stances_at(geometry.hip_height - shift, **settings) for shift in SHIFTS}
    )
    tell(level_line(levels))
    for solver in SOLVERS:
        tell(f"{solver}: {counted(rows, shapes, solver)}")
    found = details({key[:2]: trace for key, trace in traces.items() if key[2] == EXACT})
    return Reproduction(rows, shapes, traces, geometry, published, ground, levels, found)


def stances_at(hip_height: float, **settings: Any) -> dict[tuple[str, str], Stance]:
    """Measure the four conditions with the exact solver under a hip at another height [m].

    Args:
        hip_height: height of the hip above the ground [m]; ground that rises lowers it.
        **settings: further arguments of the environment.
    """
    return {
        (gait, condition): measure_stance(
            run_cycle(gait, EXACT, restitution=restitution, hip_height=hip_height, **settings)
        )
        for gait in GAITS
        for condition, restitution in CONDITIONS.items()
    }


def _check_paper(preset: str | None, geometry: Geometry, gaits: Collection[str]) -> None:
    """Raise `ParameterError` unless a leg has the paper's mechanism and gaits."""
    if geometry.mechanism != PAPER or not {*GAITS} <= {*gaits}:
        feet = ", ".join(geometry.mechanism.feet)
        raise ParameterError(
            f"preset: expected a leg of the paper's mechanism with the gaits {', '.join(GAITS)}, whose "
            f"stances the paper prints; {preset!r} has the feet {feet} and the gaits {', '.join(gaits)}"
        )


def _judge_all(
    traces: Mapping[tuple[str, str, str], Trace],
    medians: Mapping[str, Mapping[str, Mapping[float, float]]],
    published: Published,
) -> list[dict[str, Any]]:
    """Judge every claim with every solver; the reading of `walk.direction` is decided by the exact solver's
    walk for all solvers."""
    # One reading for all solvers, or a claim would mean different things in one row of the report.
    walk = traces["walk", "elastic", EXACT]
    brakes = walk_brakes(measure_stance(walk), walk)
    shapes: list[dict[str, Any]] = []
    for solver in SOLVERS:
        cycles = {key[:2]: trace for key, trace in traces.items() if key[2] == solver}
        verdicts = judge(cycles, medians[solver], brakes)
        shapes += [
            {
                "kind": "shape",
                "id": claim.id,
                "claim": claim.claim,
                "reading": claim.reading,
                "solver": solver,
                **asdict(verdicts[claim.id]),
                "figure": f"{FIGURES[claim.id]}.png",
            }
            for claim in published.claims
        ]
    return shapes


def write_reproduction(
    reproduction: Reproduction,
    out_dir: Path | str,
    *,
    figures: bool = True,
    command: str = "hoof-env reproduce --out DIR",
) -> list[Path]:
    """Write `reproduction.json`, `reproduction.md` and the figures into a folder.

    An older result is replaced only when all files could be written.

    Args:
        reproduction: the reproduction.
        out_dir: the folder, created if missing.
        figures: True draws the figures (needs matplotlib).
        command: command that is named in `reproduction.md`.

    Returns:
        Paths of the files.
    """
    out_dir = Path(out_dir)
    with staged(out_dir) as stage:
        entries = [
            *reproduction.rows,
            *reproduction.shapes,
            *reproduction.levels,
            *reproduction.details,
        ]
        text = json.dumps(entries, indent=1, ensure_ascii=False, allow_nan=False)
        (stage / "reproduction.json").write_text(text + "\n", encoding="utf-8")
        if figures:
            # Here, as matplotlib is an extra.
            from hoof_env.paper.figures import draw_all

            draw_all(reproduction, stage)
        markdown = report.markdown(reproduction, command=command, figures=figures)
        (stage / "reproduction.md").write_text(markdown, encoding="utf-8")
        names = sorted(file.name for file in stage.iterdir())
    return [out_dir / name for name in names]
