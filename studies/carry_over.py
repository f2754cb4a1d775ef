"""Play the policies that ship, unchanged, under one disturbance at a time: a table, and curves over strength.

    python -m agents.carry_over --out runs/carry_over
    python -m agents.carry_over agents/policies/Horse-v0 --episodes 20 --strengths 1

A policy plays on its own id, and episode i has the same start under each disturbance. `--out` gets table.md,
figures.csv and curves.png; what is in that file already is not played again. A cell is empty where the id
refuses the disturbance, such as pushes on a fixed trunk. `HorseLegMO-v0` has the policy and the episodes of
`HorseLeg-v0` and is left out.
"""

from __future__ import annotations

import csv
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tyro.conf import Positional

from agents import runs
from agents.cards import POLICIES
from agents.command import run
from hoof_env._output import check_folder, markdown_table
from hoof_env.envs.policies import STANDS_FOR
from hoof_env.errors import DataFileError, ParameterError, check_number, count
from hoof_env.evaluation.episodes import score_vector
from hoof_env.policies.find import read_policy_record
from hoof_env.policies.onnx_file import FILE
from hoof_env.policies.saved import own_id
from hoof_env.tasks.disturbances import MOST_STRENGTH, ROUGH_PUSH, ROUGH_SLOPE, ROUGHNESS, rough_ground

FIRST_SEED = 3_000_000  # on which nothing else is played
TABLE = "figures.csv"
COLUMNS = ("policy", "disturbance", "strength", "episodes", "return", "falls")

HILL_RISE = 0.05
"""Rise of hills under a trunk that does not follow them, that of HorseLegTerrain [m]."""

FREE_RISE = 10 * ROUGH_SLOPE
"""Rise of hills under a free trunk, that of `rough_ground` [m]."""


@dataclass(frozen=True)
class Place:
    """Environment that is disturbed.

    Attributes:
        rise: heights of its hills are within +- this at strength 1 [m].
        mass: mass of trunk and legs [kg].
        groups: groups that are observed.
    """

    rise: float
    mass: float
    groups: tuple[str, ...]


@dataclass(frozen=True)
class Disturbance:
    """Disturbance that grows with a factor, its strength.

    Attributes:
        size: size at strength 1, in units.
        settings: function of strength and place that returns the arguments of the environment.
    """

    size: str
    settings: Callable[[float, Place], dict[str, Any]]


def noise(strength: float, place: Place) -> dict[str, Any]:
    """Return errors of each step in all that is observed."""
    return {"noise": dict.fromkeys(place.groups, 0.1 * strength)}


def bias(strength: float, place: Place) -> dict[str, Any]:
    """Return errors of an episode in all that is observed."""
    return {"bias": dict.fromkeys(place.groups, 0.1 * strength)}


def pushes(strength: float, place: Place) -> dict[str, Any]:
    """Return pushes forward and back every 2 to 4 s."""
    largest = ROUGH_PUSH * place.mass * strength
    return {"push_impulse": [-largest, largest], "push_seconds": [2.0, 4.0]}


def late_observations(strength: float, place: Place) -> dict[str, Any]:
    """Return a delay of what is observed."""
    return {"observation_delay": 2.0 * strength}


def late_actions(strength: float, place: Place) -> dict[str, Any]:
    """Return a delay of what is done."""
    return {"action_delay": 2.0 * strength}


def ground(strength: float, place: Place) -> dict[str, Any]:
    """Return slopes and bumps."""
    hills = rough_ground(strength, place.mass)["terrain"]
    return {"terrain": {**hills, "rise": place.rise * strength}}


def stiffness(strength: float, place: Place) -> dict[str, Any]:
    """Return patches of harder and softer ground."""
    factor = 1.0 + strength
    level = {"kind": "hills", "rise": 0.0, "friction": [1.0, 1.0], "stiffness": [1.0 / factor, factor]}
    return {"terrain": level}


def friction(strength: float, place: Place) -> dict[str, Any]:
    """Return patches of more slippery ground."""
    lowest = 1.0 / (1.0 + strength)
    level = {"kind": "hills", "rise": 0.0, "friction": [lowest, 1.0], "stiffness": [1.0, 1.0]}
    return {"terrain": level}


DISTURBANCES: Mapping[str, Disturbance] = {
    "noise": Disturbance("up to 0.1 of a scaled number, in each step", noise),
    "bias": Disturbance("up to 0.1 of a scaled number, for an episode", bias),
    "pushes": Disturbance(f"up to {ROUGH_PUSH:g} m/s times the mass, every 2 to 4 s", pushes),
    "late observations": Disturbance("2 control steps", late_observations),
    "late actions": Disturbance("2 control steps", late_actions),
    "ground": Disturbance(
        f"bumps of {ROUGHNESS:g} m and slopes of {ROUGH_SLOPE:g}, under one leg within +-{HILL_RISE:g} m",
        ground,
    ),
    "stiffness": Disturbance("patches of a half to twice the stiffness", stiffness),
    "friction": Disturbance("patches of a half to all of the friction", friction),
}
"""Disturbances by name, each with its size at strength 1."""


CALM: Mapping[str, dict[str, Any]] = {"hoof_env/HorseRough-v0": {"push_impulse": None, "terrain": None}}
"""Settings that take an id's own disturbances away."""


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    policies: Positional[tuple[str, ...]] = ()
    """paths of policies; otherwise all that ship"""
    strengths: tuple[float, ...] = (0.25, 0.5, 1.0, 2.0)
    """factors of each disturbance"""
    episodes: int = 100
    """of each policy under each disturbance at each strength"""
    out: Path = Path("runs/carry_over")
    """folder of the table, the figures of all rows and the curves"""


@dataclass(frozen=True)
class Found:
    """Figures of a policy under a disturbance: mean return, and the share of episodes that fail."""

    policy: str
    disturbance: str
    strength: float
    episodes: int
    value: float
    falls: float

    def row(self) -> dict[str, Any]:
        """Return the row of figures.csv."""
        values = (self.policy, self.disturbance, self.strength, self.episodes, self.value, self.falls)
        return dict(zip(COLUMNS, values, strict=True))

    @classmethod
    def of_row(cls, row: Mapping[str, str]) -> Found:
        """Return what a row of figures.csv says."""
        strength, episodes, value, falls = (row[name] for name in COLUMNS[2:])
        return cls(
            row["policy"], row["disturbance"], float(strength), int(episodes), float(value), float(falls)
        )


def place_of(env_id: str) -> Place:
    """Return what disturbances need to know of an id."""
    env = runs.make_env(env_id)
    batch: Any = env.unwrapped.batch  # type: ignore[attr-defined]
    mass = batch.engine.trunk.mass + sum(limb.geometry.mass for limb in batch.engine.limbs)
    env.close()
    rise = FREE_RISE if batch.settings.trunk == "free" else HILL_RISE
    return Place(rise, float(mass), tuple(batch.settings.observation))


def settings_of(env_id: str, name: str, strength: float) -> dict[str, Any]:
    """Return the arguments with which an id has one disturbance alone."""
    disturbed = DISTURBANCES[name].settings(strength, place_of(env_id)) if strength else {}
    return {**CALM.get(env_id, {}), **disturbed}


def is_refused(env_id: str, settings: Mapping[str, Any]) -> bool:
    """Return True if an id refuses settings."""
    try:
        runs.make_env(env_id, **settings).close()
    except ParameterError:
        return True
    return False


def play(policy: str, name: str, strength: float, episodes: int) -> Found | None:
    """Play a policy under a disturbance of some strength; return None if its id refuses the disturbance."""
    env_id = own_id(read_policy_record(policy).get("env_id", ""))
    settings = settings_of(env_id, name, strength)
    if is_refused(env_id, settings):
        return None
    seeds = range(FIRST_SEED, FIRST_SEED + episodes)
    with warnings.catch_warnings():
        # That it was trained with other settings is what is asked here
        warnings.simplefilter("ignore", UserWarning)
        played = score_vector(policy, env_id, seeds, **settings)
    value, falls = (float(np.mean([each[key] for each in played])) for key in ("return", "failed"))
    return Found(Path(policy).name, name, strength, episodes, value, falls)


def shipped() -> tuple[str, ...]:
    """Return the paths of the policies that ship, but those that are another id's."""
    folders = sorted(path.parent for path in POLICIES.glob(f"*/{FILE}"))
    return tuple(str(folder) for folder in folders if f"hoof_env/{folder.name}" not in STANDS_FOR)


def read_found(path: Path) -> list[Found]:
    """Read what was played before; an empty list if there is no such file.

    Raises:
        DataFileError: it has other columns.
    """
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        if tuple(reader.fieldnames or ()) != COLUMNS:
            raise DataFileError(f"{path}: expected the columns {', '.join(COLUMNS)}")
        return [Found.of_row(row) for row in reader]


def play_all(args: Args, policies: Sequence[str]) -> list[Found]:
    """Play what is not in the file yet, and add each row to it as soon as it is known."""
    path = args.out / TABLE
    known = {(one.policy, one.disturbance, one.strength): one for one in read_found(path)}
    known = {key: one for key, one in known.items() if one.episodes == args.episodes}
    found = []
    for policy in policies:
        for name in DISTURBANCES:
            for strength in (0.0, *args.strengths):
                one = known.get((Path(policy).name, name, strength)) or play(
                    policy, name, strength, args.episodes
                )
                if one is None:
                    break
                found.append(one)
                runs.write_csv(path, COLUMNS, [one.row() for one in found])
            print(f"{Path(policy).name}: {name}", file=sys.stderr, flush=True)
    return found


def table(found: Sequence[Found], strength: float) -> str:
    """Return the table of returns, over that without a disturbance, and falls at one strength."""
    rows = []
    policies = list(dict.fromkeys(one.policy for one in found))
    at = {(one.policy, one.disturbance, one.strength): one for one in found}
    for policy in policies:
        cells = [policy]
        for name in DISTURBANCES:
            calm = at.get((policy, name, 0.0))
            disturbed = at.get((policy, name, strength))
            if calm is None or disturbed is None:
                cells.append("")
            else:
                cells.append(f"{disturbed.value / calm.value:.2f}, {100 * disturbed.falls:.0f} %")
        rows.append(cells)
    return markdown_table(["policy", *DISTURBANCES], rows)


def draw(found: Sequence[Found], path: Path) -> None:
    """Draw return over the undisturbed one, and falls, over the strength of each disturbance."""
    from matplotlib.figure import Figure

    from hoof_env._plotting import save_png

    policies = list(dict.fromkeys(one.policy for one in found))
    picture = Figure((2.1 * len(DISTURBANCES), 4.6), layout="constrained")
    panels = picture.subplots(2, len(DISTURBANCES), sharex=True, sharey="row", squeeze=False)
    for column, name in enumerate(DISTURBANCES):
        for k, policy in enumerate(policies):
            rows = sorted(
                (one for one in found if (one.policy, one.disturbance) == (policy, name)),
                key=lambda one: one.strength,
            )
            if not rows:
                continue
            strengths = [one.strength for one in rows]
            style = {"color": f"C{k}", "marker": "o", "ms": 3, "lw": 1.2}
            panels[0, column].plot(strengths, [one.value / rows[0].value for one in rows], **style)
            panels[1, column].plot(strengths, [100 * one.falls for one in rows], label=policy, **style)
        panels[0, column].set_title(name, fontsize=9)
        panels[1, column].set_xlabel("strength [-]")
        for row in range(2):
            panels[row, column].grid(alpha=0.3)
    panels[0, 0].set_ylim(-0.2, 1.2)
    panels[0, 0].set_ylabel("return over that\nwithout a disturbance [-]")
    panels[1, 0].set_ylabel("episodes that fail [%]")
    handles, labels = panels[1, 0].get_legend_handles_labels()
    picture.legend(handles, labels, loc="outside lower center", ncols=len(policies), fontsize=8)
    save_png(picture, path)


def main(argv: list[str] | None = None) -> None:
    """Play, print and draw."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m agents.carry_over", description=__doc__)
    count("--episodes", args.episodes)
    for strength in args.strengths:
        check_number("--strengths", strength, low=0.0, high=MOST_STRENGTH, exclusive_low=True)
    check_folder(args.out)
    args.out.mkdir(parents=True, exist_ok=True)
    found = play_all(args, args.policies or shipped())
    sizes = markdown_table(["disturbance", "at strength 1"], [[k, d.size] for k, d in DISTURBANCES.items()])
    tables = [f"At strength {strength:g}:\n\n{table(found, strength)}\n" for strength in args.strengths]
    text = "\n".join([sizes + "\n", *tables])
    runs.write_text(args.out / "table.md", text)
    draw(found, args.out / "curves.png")
    print(text)


if __name__ == "__main__":
    run(main)
