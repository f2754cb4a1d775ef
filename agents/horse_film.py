"""Films of the horse's gaits with the forces of living horses: `python -m agents.horse_film`.

The animal is above, beside its footfall. Below are, over the strides that are filmed, the normal and the
horizontal force on each hoof over the mass of the animal. Bands are the published ranges of stance peaks in
`agents/judges.json`, and dashed lines are published peaks without a spread: a horse's normal force peaks
inside the band, and its horizontal force peaks at the line.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.command import parse, run
from agents.gait_figures import FORCES, SETTLED, forces_of, froude_of, stances_of
from agents.judge_pictures import COLOURS, DPI, LETTERS, WIDTH, ranges_of
from hoof_env import records
from hoof_env.constants import GRAVITY
from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.errors import ParameterError, brief, check_choice, check_number
from hoof_env.film import check_film, write_film
from hoof_env.policies.find import find_policy
from hoof_env.record.instant import instants
from hoof_env.tasks.horse_gaits import LEGS, PAIRS, HorseGait

Floats = NDArray[np.float64]

ENV_ID = "hoof_env/Horse-v0"
OUT = Path(__file__).parents[1] / "docs" / "images"
HEIGHT = 640
SCENE = (500, 350)
"""Height of the film, and width and height of the animal in it [pixels]."""
KINDS = ("walk", "trot")
"""Gaits of living horses whose forces are drawn."""
FPS = 10.0
SLOW = 2.0  # times slower than the horse
STRIDES = 2  # that are filmed
NOW = (200, 60, 20)  # colour of the present time


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    policies: tuple[str, ...] = ("kinematic-walk", "kinematic-trot")
    """policies that play one gait"""
    kinds: tuple[str, ...] = ("walk", "trot")
    """gait of living horses with which each is compared: walk or trot"""
    size: float = 1.0
    """length of the animal relative to a horse of 475 kg"""
    seed: int = 0
    """of the episode"""
    out: Path = OUT
    """folder of the films, each with the name of its policy"""


@dataclass
class Filmed:
    """Strides of an episode.

    Attributes:
        time: times from the first instant on [s], shape (n,).
        normal, push: normal and horizontal force on each hoof over the mass [N/kg], shape (n, 4).
        stances: leg, begin and end [s] of each stance.
        instants: what the scene draws, at the times of the frames.
        frames: times of the frames [s].
        speed: mean speed [m/s].
        here: surroundings.
        mass: of the animal [kg].
        height: of the hips [m].
    """

    time: Floats
    normal: Floats
    push: Floats
    stances: list[tuple[int, float, float]]
    instants: list[Any]
    frames: Floats
    speed: float
    here: Any
    mass: float
    height: float


def play(name: str, size: float, seed: int) -> Filmed:
    """Play a policy and keep `STRIDES` of its strides, once it is settled."""
    with records.make_env(ENV_ID, {"size": size}) as env:
        policy = find_policy(name, env, ENV_ID)
        if "gait" not in getattr(policy, "start", ()):
            raise ParameterError(
                f"--policies: expected policies that play one gait, as kinematic-walk, got {brief(name)}"
            )
        inner: Any = env.unwrapped
        here = records.surroundings(env)
        rate = HorseGait.from_array(inner.body.reference(np.ones(1), policy.start["gait"])[0]).rate
        until = SETTLED + STRIDES * 2 * np.pi / rate
        kept = []
        news: list[Any] = []
        for columns in records.episode(env, policy, seed, until):
            if columns["time"][0] > SETTLED:
                of_legs = {key: [columns[f"{leg}_{key}"] for leg in LEGS] for key in FORCES}
                record = {key: np.array(values).T[..., None] for key, values in of_legs.items()}
                kept.append(record | {"time": np.array(columns["time"])[:, None]})
                news += list(instants(columns, here.hips))
        mass = here.weight_n / GRAVITY
        height = float(inner.body.height)
    time, normal, push = forces_of(kept)
    began = float(time[0])
    lift_off = LIFT_OFF * mass * GRAVITY / len(LEGS)
    # Padded, so that a stance that the film cuts is drawn as far as it is seen
    loaded = np.pad(normal, ((1, 1), (0, 0)))
    padded = np.concatenate([[time[0] - 1e-3], time, [time[-1] + 1e-3]])
    stances = stances_of(padded, loaded, 0 * loaded, lift_off)
    step = 1 / (FPS * SLOW)
    frames = np.arange(0.0, time[-1] - began, step)
    at = np.searchsorted(time - began, frames)
    x = [one.x for one in news]
    return Filmed(
        time - began,
        normal / mass,
        push / mass,
        [(one.leg, one.began - began, one.ended - began) for one in stances],
        [news[k] for k in at],
        frames,
        (x[-1] - x[0]) / float(time[-1] - began),
        here,
        mass,
        height,
    )


def panel(filmed: Filmed, kind: str) -> tuple[Any, list[Any]]:
    """Draw footfall and forces; return the figure, of the film's size, and its axes, over which the present
    time moves."""
    from matplotlib.figure import Figure

    froude = froude_of(filmed.speed, filmed.height)
    found = ranges_of(kind, froude)
    figure = Figure((WIDTH / DPI, HEIGHT / DPI), dpi=DPI)
    grid = figure.add_gridspec(
        2, 4, left=0.075, right=0.99, top=0.405, bottom=0.075, hspace=0.12, wspace=0.09,
        height_ratios=(1.3, 1.0),
    )  # fmt: skip
    foot = figure.add_axes((0.69, 0.53, 0.29, 0.23))
    for leg, began, ended in filmed.stances:
        foot.barh(len(LEGS) - leg, ended - began, left=began, height=0.7, color=COLOURS[PAIRS[leg // 2]])
    letters = ["".join(word[0].upper() for word in leg.split("_")) for leg in LEGS]
    foot.set_yticks(range(len(LEGS), 0, -1), letters)
    foot.set_ylim(0.4, len(LEGS) + 0.6)
    foot.set_title("footfall", fontsize=LETTERS, pad=3)
    foot.set_xlabel("time [s]", fontsize=LETTERS, labelpad=1)
    numbers = (
        f"{kind}, {filmed.mass:.0f} kg",
        f"{filmed.speed:.2f} m/s, Froude number {froude:.2f}",
        f"{SLOW:g} times slower than the animal",
    )
    for k, line in enumerate(numbers):
        figure.text(0.645, 0.955 - 0.036 * k, line, fontsize=1.15 * LETTERS, weight="normal" if k else "bold")
    boxes = [foot]
    top = 1.15 * max(filmed.normal.max(), *(high for one in found.values() for _, high in one["bands"]))
    side = 1.15 * max(np.abs(filmed.push).max(), *(abs(x) for one in found.values() for x in one["lines"]))
    for k, name in enumerate(LEGS):
        pair = PAIRS[k // 2]
        for row, values in ((0, filmed.normal), (1, filmed.push)):
            axis = figure.add_subplot(grid[row, k])
            axis.plot(filmed.time, values[:, k], color=COLOURS[pair], lw=1.4)
            if row == 0:
                for low, high in found[pair]["bands"]:
                    axis.axhspan(low, high, color="0.5", alpha=0.28, lw=0)
                axis.set_ylim(0, top)
                axis.set_title(name.replace("_", " "), fontsize=LETTERS, pad=3, color=COLOURS[pair])
            else:
                for value in found[pair]["lines"]:
                    axis.axhline(value, color="0.35", ls="--", lw=1)
                axis.axhline(0, color="0.7", lw=0.7)
                axis.set_ylim(-side, side)
                axis.set_xlabel("time [s]", fontsize=LETTERS, labelpad=1)
            if k:
                axis.set_yticklabels([])
            else:
                axis.set_ylabel("up [N/kg]" if row == 0 else "forward", fontsize=LETTERS)
            boxes.append(axis)
    for axis in boxes:
        axis.set_xlim(0, filmed.time[-1])
        axis.tick_params(labelsize=LETTERS, length=2, pad=2)
        if axis in boxes[1::2]:
            axis.set_xticklabels([])
    return figure, boxes


def painted(figure: Any, axes: list[Any]) -> tuple[Any, list[Any]]:
    """Return the picture of a figure, shape (HEIGHT, WIDTH, 3), and the boxes of axes in it as left, top,
    width and height [pixels]."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    picture = np.asarray(canvas.buffer_rgba())[..., :3].copy()
    boxes = [axis.get_position() for axis in axes]
    places = [
        (box.x0 * WIDTH, (1 - box.y1) * HEIGHT, box.width * WIDTH, box.height * HEIGHT) for box in boxes
    ]
    return picture, places


def frames_of(filmed: Filmed, kind: str) -> Iterator[NDArray[np.uint8]]:
    """Yield pictures of shape (HEIGHT, WIDTH, 3)."""
    import pygame

    from hoof_env.render.brush import Brush
    from hoof_env.render.horse_scene import HorseScene

    still, places = painted(*panel(filmed, kind))
    wide, tall = SCENE
    canvas = pygame.Surface(SCENE, 0, 32)
    brush = Brush((WIDTH, WIDTH * 9 // 16))  # letters of a film of this width
    scene = HorseScene(brush, filmed.here.geometry, filmed.here.terrain, SCENE, 0)
    # The arrow of the key is a fifth of this
    full_scale = 5 * float(f"{4 * filmed.mass:.1g}")
    for time, instant in zip(filmed.frames, filmed.instants, strict=True):
        scene.draw(canvas, instant, full_scale)
        picture = still.copy()
        picture[:tall, :wide] = pygame.surfarray.array3d(canvas).transpose(1, 0, 2)
        for left, top, width, height in places:
            x = round(left + time / filmed.time[-1] * width)
            picture[round(top) : round(top + height), x] = NOW
        yield picture


def main(argv: list[str] | None = None) -> None:
    """Film gaits."""
    args = parse(Args, argv, "python -m agents.horse_film", __doc__)
    check_number("--size", args.size, low=0, exclusive_low=True)
    if not args.policies or len(args.policies) != len(args.kinds):
        raise ParameterError(
            f"--kinds: expected one of {', '.join(KINDS)} for each policy, got {len(args.kinds)} for"
            f" {len(args.policies)}"
        )
    for kind in args.kinds:
        check_choice("--kinds", kind, KINDS)
    for name, kind in zip(args.policies, args.kinds, strict=True):
        path = args.out / f"{name}.gif"
        check_film(path, FPS)
        filmed = play(name, args.size, args.seed)
        write_film(frames_of(filmed, kind), path, FPS)
        print(f"written: {path}")


if __name__ == "__main__":
    run(main)
