"""Films of two policies in the same episode, one above the other: `python -m agents.film_pair`.

Without arguments it films the best gait without feedback above the shipped agent, on the leg that hops and on
the leg that balances. A policy whose episode is over stands still in its last picture, until both are. The
command also prints figures of the whole episode of each, which say what a film shows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.command import parse, run
from hoof_env import records
from hoof_env.errors import check_number
from hoof_env.film import check_film, frames, write_film
from hoof_env.policies.find import find_policy
from hoof_env.record.columns import Columns

Picture = NDArray[np.uint8]

OUT = Path(__file__).parents[1] / "docs" / "images"

FPS = 10.0
SIZE = (560, 315)
"""Frames a second [Hz], and width and height of each policy's picture [pixels]."""

BAND = 26
LETTERS = 22
INK = (30, 40, 50)
PAPER = (255, 255, 255)
"""Height of the line above each picture [pixels], size of its letters, their colour and the line's."""

SETTLED = 2.0
"""Time after which an agent has caught its start [s]."""

NAMES = {
    "open-loop": "sees nothing: the best gait with a clock",
    "reference": "sees nothing: the reference gait",
    "shipped": "sees: the agent of the package",
}
"""Lines above pictures, by policy; others have their names."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    env_ids: tuple[str, ...] = ("hoof_env/HorseLegHop-v0", "hoof_env/HorseLegBalance-v0")
    """registered environments, a film for each"""
    policies: tuple[str, str] = ("open-loop", "shipped")
    """the upper and the lower policy"""
    seed: int = 1000
    """of the episode, in which all begin"""
    seconds: float = 4.0
    """of the episode that are filmed"""
    out: Path = OUT
    """folder of the films, each with the name of its id and -pair"""


def figures_of(columns: Sequence[Columns]) -> str:
    """Write figures of an episode: its length, and how one leg hops once it is `SETTLED`; the former alone
    for a horse, or if there are no stances then."""

    def whole(name: str) -> NDArray[np.float64]:
        return np.concatenate([np.atleast_1d(each[name]) for each in columns])

    time, pitch = whole("time"), np.degrees(whole("pitch"))
    text = f"{time[-1]:.1f} s, pitch within {pitch.min():.0f} and {pitch.max():.0f} degrees"
    if "toe_x" not in columns[0]:
        return text
    ahead = whole("toe_x") - whole("x")
    is_loaded = whole("toe_normal") + whole("heel_normal") > 0.0
    is_settled = time > SETTLED
    changes = np.diff(is_loaded.astype(int), prepend=is_loaded[0])
    landed = np.flatnonzero((changes == 1) & is_settled)
    # The last instant with a load
    left = np.flatnonzero((changes == -1) & is_settled) - 1
    if not (len(landed) and len(left)):
        return text
    height, speed, rocked = (each[is_settled] for each in (whole("y"), whole("vx"), pitch))
    return (
        f"{text}; after {SETTLED:g} s {len(landed) / (time[-1] - SETTLED):.1f} hops a second, in the air for"
        f" {1 - is_loaded[is_settled].mean():.2f} of the time, the toe lands {ahead[landed].mean():+.2f} m"
        f" and leaves {ahead[left].mean():+.2f} m ahead of the hip, which is {height.min():.2f} to"
        f" {height.max():.2f} m high and goes at {speed.min():.1f} to {speed.max():.1f} m/s, pitch within"
        f" {rocked.min():.0f} and {rocked.max():.0f} degrees"
    )


def pictures_of(env_id: str, policy: str, seed: int, seconds: float) -> tuple[list[Picture], str]:
    """Return the pictures of an episode, each with a line that says who plays, and figures of the whole
    episode."""
    import pygame

    from hoof_env.render.brush import Brush
    from hoof_env.render.renderer import Renderer

    with records.make_env(env_id) as env:
        player = find_policy(policy, env, env_id)
        renderer = Renderer(records.surroundings(env), size=SIZE)
        filmed = list(frames(renderer, records.episode(env, player, seed, seconds), FPS))
        renderer.close()
        figures = figures_of(list(records.episode(env, player, seed, records.longest_of(env, None))))
    band: Any = pygame.Surface((SIZE[0], BAND), 0, 32)
    band.fill(PAPER)
    Brush((960, 540)).write(band, NAMES.get(policy, policy), (8, BAND / 2), LETTERS, INK)
    line = pygame.surfarray.array3d(band).transpose(1, 0, 2)
    return [np.concatenate([line, picture]) for picture in filmed], figures


def paired(upper: list[Picture], lower: list[Picture]) -> Iterator[Picture]:
    """Yield pictures with one above the other; the shorter list stays at its last picture."""
    for k in range(max(len(upper), len(lower))):
        yield np.concatenate([each[min(k, len(each) - 1)] for each in (upper, lower)])


def main(argv: list[str] | None = None) -> None:
    """Film pairs."""
    args = parse(Args, argv, "python -m agents.film_pair", __doc__)
    check_number("--seconds", args.seconds, low=0, exclusive_low=True)
    check_number("--seed", args.seed, low=0)
    for env_id in args.env_ids:
        path = args.out / f"{env_id.rpartition('/')[2].rpartition('-')[0]}-pair.gif"
        check_film(path, FPS)
        each = [pictures_of(env_id, name, args.seed, args.seconds) for name in args.policies]
        write_film(paired(*(pictures for pictures, _ in each)), path, FPS)
        print(f"written: {path}")
        for name, (_, figures) in zip(args.policies, each, strict=True):
            print(f"  {name}: {figures}")


if __name__ == "__main__":
    run(main)
