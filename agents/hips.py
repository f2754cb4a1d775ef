"""Kinematic gaits over the place of the hips: `python -m agents.hips`.

The crank centres of all legs are moved forward on the trunk, which is the same as moving the trunk's centre
of mass backward between the legs, and the kinematic gaits are played unchanged. No gait is searched again.
The command writes `docs/evidence/hips.md`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from agents import runs
from agents.command import parse, run
from agents.gait_figures import play
from agents.judge import ENV_ID
from agents.judges import read_judges
from agents.rules import rejection_reason
from hoof_env._output import markdown_table
from hoof_env.envs.policies import make_policy
from hoof_env.errors import count
from hoof_env.evaluation.episodes import make_rows
from hoof_env.simd.threads import limit_threads
from hoof_env.tasks import horse
from hoof_env.tasks.horse_gaits import PAIRS, kinematic_speeds

EVIDENCE = Path(__file__).parents[1] / "docs" / "evidence"
NAME = "hips"
FORWARD = (0.0, 0.05, 0.1, 0.15, 0.2)  # [m]

PAGE = """# Where the hips of the horse are

Written by `{command}` at commit `{commit}`.

**Asked.** Whether the place of the hips explains what the kinematic gaits miss: too high fore peaks, and fore
legs that propel.

**Played.** The crank centres of all legs moved forward on the trunk, as far as the first column says; that is
the trunk's centre of mass moved backward. The gaits are unchanged, {episodes} starts each.

**Found.** {found}

{table}

Bars are those of [the judges](../../agents/judges.json): fore peak of the walk {walk}, of the trot {trot}
N/kg. A horse's fore legs bear {share} of the impulse, and brake.

{meaning}

```bash
{command}
```
"""

MEANING = """**Why.** The share of the weight that the fore legs bear follows from moments about the centre
of mass alone: it is the distance of the hind hooves behind it over the distance between fore and hind hooves,
both as means over the load. Moving all hips forward takes the fore hooves away from it and the hind hooves to
it. With 1.2 m between the hooves, as between the hips, and the trunk's share of the mass, as the legs move
along, the fore share falls by 0.06 for each 0.1 m, and peaks follow it. The *sign* of the net horizontal
force does not follow from the hips. Fore and hind legs pull against each other through cranks that move as
they are commanded, and only their sum has to be zero on average. Which pair brakes is a question of the gait,
which no criterion of the search asks.

Hips are an input of the model ([the animal](../horse.md#the-animal)), and `Horse-v0` keeps its own: with
others its reference gaits, its agents and all their figures would be of another animal."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    episodes: int = 64
    """starts of each gait"""
    out: Path = EVIDENCE
    """folder of the page"""


@contextmanager
def hips_forward(distance: float) -> Iterator[None]:
    """Have environments that are made within it with hips that are further forward [m]."""
    before = dict(horse.HIPS)
    horse.HIPS.update({pair: x + distance for pair, x in before.items()})
    try:
        yield
    finally:
        horse.HIPS.update(before)


def played(distance: float, name: str, episodes: int) -> dict[str, Any]:
    """Return the figures of a kinematic gait with hips further forward [m]."""
    with hips_forward(distance):
        envs = make_rows(ENV_ID, episodes, num_threads=limit_threads(2))
        return play(envs, make_policy(name, envs), kinematic_speeds()[name])


def rows_of(figures: dict[str, list[dict[str, Any]]]) -> list[list[str]]:
    """Return the table's rows."""
    rows = []
    for name, of_gait in figures.items():
        for distance, one in zip(FORWARD, of_gait, strict=True):
            rows.append(
                [
                    f"{distance:g}",
                    name,
                    f"{one['fell']:.2f}",
                    f"{one['reached']:.2f}",
                    f"{one['peak_fore']:.1f}, {one['peak_hind']:.1f}",
                    f"{one['impulse_fore']:.2f}",
                    f"{one['net_fore']:+.2f}, {one['net_hind']:+.2f}",
                    f"{one['slip_fore']:.2f}, {one['slip_hind']:.2f}",
                    f"{one['duty_fore']:.2f}, {one['duty_hind']:.2f}",
                    f"{one['lag']:.2f}",
                    f"{one['stances_per_turn_fore']:.2f}, {one['stances_per_turn_hind']:.2f}",
                ]
            )
    return rows


def summary(figures: dict[str, list[dict[str, Any]]]) -> str:
    """Return what the hips change, in a sentence for each gait."""
    judges = read_judges()
    told = []
    for name, of_gait in figures.items():
        first, last = of_gait[0], of_gait[-1]
        low, high = judges[name.removeprefix("kinematic-")]["peak_fore"]["bar"]
        inside = []
        for distance, one in zip(FORWARD, of_gait, strict=True):
            if low <= one["peak_fore"] <= high:
                why = rejection_reason(one, PAIRS)
                inside.append(f"{distance:g} m" + (f" (does not count: {why})" if why else ""))
        propelling = sum(one["net_fore"] > 0 for one in of_gait)
        told.append(
            f"With hips {FORWARD[-1]:g} m forward the fore peak of `{name}` falls from "
            f"{first['peak_fore']:.1f} to {last['peak_fore']:.1f} N/kg and the fore share of impulse from "
            f"{first['impulse_fore']:.2f} to {last['impulse_fore']:.2f}. The peak is inside of its bar "
            + (f"at {', '.join(inside)}" if inside else "at no place")
            + f", and fore legs propel at {propelling} of {len(of_gait)} places."
        )
    return " ".join(told)


HEAD = (
    "hips forward by [m]",
    "gait",
    "fell",
    "reached [m/s]",
    "peak, fore and hind [N/kg]",
    "fore share of impulse",
    "net force, fore and hind [N/kg]",
    "slip, fore and hind [m]",
    "duty, fore and hind",
    "lag",
    "stances a turn",
)


def write(args: Args) -> None:
    """Play and write the page."""
    episodes = count("--episodes", args.episodes)
    figures = {
        name: [played(distance, name, episodes) for distance in FORWARD] for name in kinematic_speeds()
    }
    judges = read_judges()
    bars = {kind: "{:g} to {:g}".format(*judges[kind]["peak_fore"]["bar"]) for kind in ("walk", "trot")}
    page = PAGE.format(
        command="python -m agents.hips",
        commit=runs.versions().get("commit", "unknown"),
        episodes=episodes,
        found=summary(figures),
        table=markdown_table(HEAD, rows_of(figures)),
        share=f"{judges['reported']['impulse_fore']['horse']:g}",
        meaning=MEANING,
        **bars,
    )
    args.out.mkdir(parents=True, exist_ok=True)
    runs.write_text(args.out / f"{NAME}.md", page)
    print(f"written: {args.out / NAME}.md")


def main(argv: list[str] | None = None) -> None:
    """Write the page."""
    write(parse(Args, argv, "python -m agents.hips", __doc__))


if __name__ == "__main__":
    run(main)
