"""Picture of `agents.legs`: each leg with the path of its foot, and the force on the foot in its gaits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.foot_paths import path_of
from agents.stock_plan import LEG
from hoof_env.envs.policies import constant_gait
from hoof_env.evaluation.episodes import FINAL_SEEDS
from hoof_env.gait import GaitParameters
from hoof_env.leg.assembly import solve
from hoof_env.leg.geometry import Geometry, load_geometry

Gaits = Mapping[str, Mapping[str, GaitParameters]]

SETTLED = 6.0  # time from which forces are drawn [s]


def draw(presets: Sequence[str], gaits: Gaits, path: Path) -> None:
    """Draw a column for each leg: above it, in the middle of its stance, below the force over two turns."""
    import matplotlib
    from matplotlib.figure import Figure

    from hoof_env._plotting import STYLE, save_png

    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(2.6 * len(presets), 5.4), layout="constrained")
        above, below = figure.subplots(2, len(presets), sharey="row", height_ratios=(1.7, 1.0))
        for preset, top, bottom in zip(presets, above, below, strict=True):
            draw_leg(top, load_geometry(preset), gaits[preset]["walk"])
            top.set_title(preset)
            draw_forces(bottom, preset, gaits[preset])
        above[0].legend(loc="upper right")
        above[0].set_ylabel("height, hip heights")
        below[0].set_ylabel("normal force, weights")
        below[-1].legend(loc="upper right")
        save_png(figure, path)


def draw_leg(axes: Any, leg: Geometry, gait: GaitParameters) -> None:
    """Draw a leg with its frame at rest in mid-stance, the foot's path, and the path in a gait."""
    from hoof_env._plotting import BLUE, GREY, ORANGE, SKY

    foot, _, stance = path_of(leg)
    middle = float(stance[len(stance) // 2]) * 2 * np.pi / len(foot)
    hip = -foot.imag.min()
    points = solve(leg, [middle])[0][0]
    at = {
        name: complex(leg.travel * z.real, z.imag) / hip
        for name, z in zip(leg.mechanism.points, points, strict=True)
    }
    for plate in leg.mechanism.plates:
        corners = np.array([at[name] for name in plate[:3]])
        axes.fill(corners.real, corners.imag, color=GREY, alpha=0.25, linewidth=0)
    for k, body in enumerate(leg.mechanism.bodies):
        ends = np.array([at[body.tail], at[body.head]])
        is_crank = k == leg.mechanism.crank
        axes.plot(ends.real, ends.imag, color=ORANGE if is_crank else GREY, linewidth=2 if is_crank else 1.4)
    for name in leg.mechanism.fixed:
        axes.plot(at[name].real, at[name].imag, "o", color="black", markersize=3.5)
    axes.axhline(-1.0, color=GREY, linewidth=0.8)
    in_gait = path_of(leg, gait)[0]
    for z, colour, label in ((foot, SKY, "frame at rest"), (in_gait, BLUE, "in the walk")):
        closed = np.append(z, z[0]) / hip
        axes.plot(leg.travel * closed.real, closed.imag, color=colour, label=label)
    axes.set_aspect("equal")
    axes.set_xlabel("hip heights")


def draw_forces(axes: Any, preset: str, gaits: Mapping[str, GaitParameters]) -> None:
    """Draw the normal force on the foot over two turns of the crank in each gait."""
    from hoof_env._plotting import BLUE, ORANGE

    for (name, gait), colour in zip(gaits.items(), (BLUE, ORANGE), strict=True):
        turns, force = forces_of(preset, gait)
        axes.plot(turns, force, color=colour, label=name, linewidth=1)
    axes.set_xlabel("turns of the crank")


def forces_of(preset: str, gait: GaitParameters) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return turns of the crank, from 0 to 2, and the normal force over the weight, from `SETTLED` s on."""
    turns = []
    forces = []
    with runs.make_env(LEG, preset=preset, render_mode="rgb_array") as env:
        leg: Any = env.unwrapped
        policy = constant_gait(gait, env, starts_in_it=True)
        observation, _ = env.reset(seed=FINAL_SEEDS[0], options=policy.start)
        truncated = False
        first = True
        while not truncated:
            action, _ = policy.predict(observation, episode_start=first)
            observation, _, _, truncated, _ = env.step(action)
            first = False
            record = leg.record()
            if record["time"][0, 0] >= SETTLED:
                turns.append(record["crank_angle"][:, 0, 0] / (2 * np.pi))
                forces.append((record["toe_normal"] + record["heel_normal"])[:, 0, 0] / leg.weight)
    turn = np.concatenate(turns)
    turn -= np.ceil(turn[0])
    shown = (turn >= 0) & (turn <= 2)
    return turn[shown], np.concatenate(forces)[shown]
