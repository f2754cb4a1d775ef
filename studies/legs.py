"""Legs of other mechanisms compared with the leg that ships.

    python -m agents.legs                  page and picture from the gaits that were found; two minutes
    python -m agents.legs --search         the gaits first; an hour, in runs/legs, can be interrupted

All legs are as high and as heavy as `identified`, under the trunk of `HorseLeg-v0`. The search is that of
`agents.open_loop`: "walk" keeps the Froude number 0.25 in `HorseLegSpeed-v0`, "run" has the highest return in
`HorseLeg-v0`. `python -m agents.stock --preset LEG` trains what the last table shows.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents import open_loop, runs
from agents.command import run
from agents.foot_paths import figures
from agents.legs_picture import draw
from agents.stock import LEGS_OUT
from agents.stock_page import at
from agents.stock_plan import HALF_RATES, LEG, LEGS, SPEED, leg_folder, read_curves
from hoof_env._output import markdown_table, staged
from hoof_env.constants import GRAVITY
from hoof_env.envs.policies import constant_gait
from hoof_env.errors import DataFileError
from hoof_env.evaluation.episodes import FINAL_SEEDS, make_rows, play_rows
from hoof_env.evaluation.statistics import iqm
from hoof_env.gait import GaitParameters
from hoof_env.leg.geometry import Geometry, load_geometry
from hoof_env.leg.presets import DEFAULT_PRESET

COMPARED = (DEFAULT_PRESET, *LEGS)

GAITS = LEGS_OUT / "gaits.json"
"""File of the gaits that were found, by leg and name."""

FROUDE = 0.25
"""Froude number of the walk, v^2 / (g h); h is the height of the hip."""

SETTLED = 2.0
"""Time from which torques count [s]."""

STRICT = {"progress": 40.0, "overspeed": 40.0}
"""Weights of the speed for the walk: with those of the id some legs return most at another speed."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    search: bool = False
    """search for the gaits, which takes an hour"""
    restarts: int = 3
    """searches for each gait"""
    out: Path = LEGS_OUT
    """folder of README.md, legs.png and, with --search, gaits.json"""


def walking_speed(leg: Geometry) -> float:
    """Return the speed at `FROUDE` [m/s], in hundredths."""
    return round(math.sqrt(FROUDE * GRAVITY * leg.hip_height), 2)


def tasks_of(preset: str) -> dict[str, tuple[str, dict[str, Any]]]:
    """Return id and arguments of the environments in which the gaits of a leg are searched, by gait."""
    speed = walking_speed(load_geometry(preset))
    walk = {"preset": preset, "target_speed": speed, "reward_weights": STRICT}
    return {"walk": (SPEED, walk), "run": (LEG, {"preset": preset})}


def search(restarts: int) -> dict[str, dict[str, Any]]:
    """Search for the gaits of all legs, and return them by leg and name."""
    found: dict[str, dict[str, Any]] = {}
    for preset in COMPARED:
        found[preset] = {}
        for name, (env_id, env_kwargs) in tasks_of(preset).items():
            args = open_loop.Args(
                env_id=env_id,
                env_kwargs=(json.dumps(env_kwargs),),
                family="constant",
                restarts=restarts,
                out=Path("runs/legs", f"{preset}-{name}.json"),
            )
            gait = open_loop.optimise(args)["gait"]
            found[preset][name] = {key: round(value, 5) for key, value in gait.items()}
            print(f"{preset}, {name}: {found[preset][name]}", flush=True)
    return found


def read_gaits(path: Path = GAITS) -> dict[str, dict[str, GaitParameters]]:
    """Return the gaits that were found, by leg and name; `DataFileError` if there are none."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        return {
            preset: {name: GaitParameters(**values) for name, values in data[preset].items()}
            for preset in COMPARED
        }
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataFileError(
            f"{path}: expected the gaits of agents.legs --search for {', '.join(COMPARED)}: {error!r}"
        ) from None


class Watched:
    """Policy that keeps the torques of the crank [N m], and otherwise is another."""

    def __init__(self, policy: Any, envs: Any) -> None:
        self._policy = policy
        self._envs = envs
        self.start = policy.start
        self.torques: list[NDArray[np.float64]] = []

    def predict(self, *args: Any, **kwargs: Any) -> Any:
        """Return the policy's actions."""
        self.torques.append(self._envs.batch.engine.report["crank_torque"][0].copy())
        return self._policy.predict(*args, **kwargs)


def measure(preset: str, gait: GaitParameters) -> dict[str, float]:
    """Play a gait in `HorseLeg-v0` on the starts of the final scores; return the means of the figures, and
    of torques the root of the mean square and the mean of the highest of an episode."""
    envs: Any = make_rows(LEG, len(FINAL_SEEDS), preset=preset)
    with runs.make_env(LEG, preset=preset) as env:
        policy = Watched(constant_gait(gait, env, starts_in_it=True), envs)
        hip = env.unwrapped.geometry.hip_height  # type: ignore[attr-defined]
        weight = env.unwrapped.weight  # type: ignore[attr-defined]
        settled = round(SETTLED / env.unwrapped.dt)  # type: ignore[attr-defined]
    episodes = play_rows(envs, policy, FINAL_SEEDS)
    means = {name: float(np.mean([episode[name] for episode in episodes])) for name in episodes[0]}
    torques = np.array(policy.torques[settled:])
    return means | {
        "froude": means["speed_m_s"] ** 2 / (GRAVITY * hip),
        "peak_weights": means["stance_peak_n"] / weight,
        "torque_rms": float(np.sqrt(np.mean(torques**2))),
        "torque_peak": float(np.abs(torques).max(0).mean()),
    }


PATHS = {
    "stroke": ("stroke", 2),
    "lift": ("step height", 2),
    "level": ("range of height in stance", 3),
    "uneven": ("spread of speed in stance", 2),
    "margin": ("margin", 2),
    "longest": ("longest link", 2),
}
"""Columns of the first table: title and digits by the key of `foot_paths.figures`."""

MEASURED = {
    "speed_m_s": ("speed m/s", 2, 1.0),
    "froude": ("Froude number", 2, 1.0),
    "peak_weights": ("peak GRF, weights", 2, 1.0),
    "loading_rate_n_s": ("loading rate kN/s", 0, 1e-3),
    "cost_of_transport": ("cost of transport", 2, 1.0),
    "torque_rms": ("crank torque N m, rms", 0, 1.0),
    "torque_peak": ("highest", 0, 1.0),
    "weight_share": ("weight share", 2, 1.0),
    "return": ("return", 0, 1.0),
}
"""Columns of the second table: title, digits and factor."""

LEARNT = ("return", "speed_m_s", "stance_peak_n", "cost_of_transport", "weight_share")


def path_table(gaits: Mapping[str, Mapping[str, GaitParameters]]) -> str:
    """Return two lines for each leg: figures of its foot's path with the frame at rest and in the walk."""
    rows = []
    for preset in COMPARED:
        leg = load_geometry(preset)
        for name, gait in (("at rest", None), ("walk", gaits[preset]["walk"])):
            found = figures(leg, gait)
            cells = [f"{found[key]:.{digits}f}" for key, (_, digits) in PATHS.items()]
            rows.append([f"`{preset}`", str(len(leg.mechanism.bodies)), name, *cells])
    return markdown_table(["leg", "links", "frame", *(title for title, _ in PATHS.values())], rows)


def measured_table(gaits: Mapping[str, Mapping[str, GaitParameters]]) -> str:
    """Return a line for each gait of each leg."""
    rows = []
    for name in ("walk", "run"):
        for preset in COMPARED:
            means = measure(preset, gaits[preset][name])
            cells = [f"{factor * means[key]:.{digits}f}" for key, (_, digits, factor) in MEASURED.items()]
            rows.append([name, f"`{preset}`", *cells])
    return markdown_table(["gait", "leg", *(title for title, *_ in MEASURED.values())], rows)


def learnt_table(out: Path) -> str:
    """Return a line for each learner of each leg that is trained; "" if none is."""
    rows = []
    for preset, half_rates in itertools.product(LEGS, (False, True)):
        curves = read_curves(out / leg_folder(preset, half_rates))
        for algo in dict.fromkeys(row["algo"] for row in curves):
            of_algo = [row for row in curves if row["algo"] == algo]
            last = max(row["steps"] for row in of_algo)
            ends = [row for row in of_algo if row["steps"] == last]
            returns = at(of_algo, last)
            spread = f"{float(iqm(returns)[0]):.0f} ({min(returns):.0f} to {max(returns):.0f})"
            means = {key: float(np.mean([row[key] for row in ends])) for key in LEARNT}
            rows.append(
                [
                    f"`{preset}`" + (", half the rates" if half_rates else ""),
                    f"{algo.upper()}, {len(ends)} seeds, {last:,} steps",
                    spread,
                    f"{means['speed_m_s']:.2f}",
                    f"{means['stance_peak_n'] / 1000:.2f}",
                    f"{means['cost_of_transport']:.2f}",
                    f"{means['weight_share']:.2f}",
                ]
            )
    titles = ["leg", "learner", "return", "speed m/s", "peak GRF kN", "cost of transport", "weight share"]
    return markdown_table(titles, rows) if rows else ""


PAGE = """# Legs compared

Written by `python -m agents.legs`. Reference [15] of the paper (Komoda and Wagatsuma 2017) compares legs of
closed chains; here are four under one trunk, that of `HorseLeg-v0`, at one height of the hip ({hip} m) and
one mass ({mass} kg). `jansen` and `klann` have published lengths; `python -m agents.four_bar` found
`fourbar`. Chebyshev's lambda is not among them: under a hip its level stretch is the upper part of the path.

![Legs with the paths of their feet, and the force on the foot](legs.png)

## Paths of the feet

With the frame at rest, and with the swing of the walk below; lengths in heights of the hip over the lowest
point of the foot. The stance is the half turn of the crank in which the foot is lowest. The margin is the
least sine of the angle between the links of a dyad, 0 at a dead point. A rigid triangle counts as three
links.

{paths}

## Open loop

Constant gaits that `python -m agents.legs --search` found ([gaits.json](gaits.json)): the walk keeps the
Froude number {froude}, the run has the highest return. Means of {starts} episodes of `HorseLeg-v0`, which
start in the gait; the cost of transport is work over weight and distance, and torques are those from
{settled:g} s on.

{measured}
"""

LEARNT_PAGE = """
## Learnt

Stock learners (`python -m agents.stock --preset LEG`): interquartile mean of the return with the lowest and
highest seed, means of the other figures. With half the rates (`--half-rates`) actions change the gait by
`crank_rate={crank}` and `swing_rate={swing}`: the foot of `klann` is farther from its crank and swings
farther than those of the others, so that the first, random actions of a learner with the usual rates cost
more than standing still does.

{learnt}
"""


def write(out: Path, gaits: Mapping[str, Mapping[str, GaitParameters]]) -> None:
    """Write page and picture."""
    leg = load_geometry()
    text = PAGE.format(
        hip=f"{leg.hip_height:.2f}",
        mass=f"{leg.mass:.1f}",
        paths=path_table(gaits),
        froude=FROUDE,
        starts=len(FINAL_SEEDS),
        settled=SETTLED,
        measured=measured_table(gaits),
    )
    learnt = learnt_table(out)
    with staged(out) as stage:
        draw(COMPARED, gaits, stage / "legs.png")
        text += (
            LEARNT_PAGE.format(learnt=learnt, crank=HALF_RATES["crank_rate"], swing=HALF_RATES["swing_rate"])
            if learnt
            else ""
        )
        (stage / "README.md").write_text(text, encoding="utf-8")


def main(argv: Sequence[str] | None = None) -> None:
    """Search if that is asked for, then write."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.legs", description=__doc__)
    if args.search:
        found = search(args.restarts)
        args.out.mkdir(parents=True, exist_ok=True)
        runs.write_text(args.out / GAITS.name, json.dumps(found, indent=1) + "\n")
    write(args.out, read_gaits(args.out / GAITS.name))
    print(f"written: {args.out / 'README.md'}")


if __name__ == "__main__":
    run(main)
