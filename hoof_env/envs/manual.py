"""Tables of an environment: its settings, actions, observation and rewards, with units and meanings.

`hoof-env manual` prints them, and the pages of docs/environments show them.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from itertools import groupby
from string import Template
from typing import Any, NamedTuple

from hoof_env.dynamics.parts import ONE_LEG
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.envs.manual_bodies import tables_of_body
from hoof_env.errors import check_choice
from hoof_env.gait import FilterSettings
from hoof_env.ground.laws import FRICTION_LAWS, NORMAL_LAWS
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.presets import preset_label, preset_names, presets_of_paper
from hoof_env.paper_solver.integrators import INTEGRATORS
from hoof_env.render.size import USUAL_SIZE
from hoof_env.tasks import horse, leg_starts, observation
from hoof_env.tasks.horse_gaits import SIZES, horse_gaits
from hoof_env.tasks.registry import TASKS, Task, task_of
from hoof_env.tasks.reward import check_weights
from hoof_env.tasks.settings import ABOUT, to_json
from hoof_env.tasks.user_parts import constants_of

MULTI_OBJECTIVE = "hoof_env/HorseLegMO-v0"
"""Id of the leg's task with a reward for each objective."""

PICTURES = (
    (
        "render_mode",
        "None",
        "",
        '"rgb_array" or "human"; a step costs more only where a picture is asked for',
    ),
    ("width", str(USUAL_SIZE[0]), "pixels", "of a picture, from 480"),
    ("height", str(USUAL_SIZE[1]), "pixels", "of a picture, from 270"),
)
"""Rows of the arguments that are not settings."""


class Table(NamedTuple):
    """A table of text.

    Attributes:
        head: titles of the columns.
        rows: cells of each row; the first column has the names, the second where rows are numbered.
    """

    head: tuple[str, ...]
    rows: list[tuple[str, ...]]


def task_of_id(id: str) -> Task:
    """Find the task of an environment.

    Args:
        id: an id of the package, or one's own, which may be "module:id".

    Raises:
        ParameterError: an unknown id.
    """
    ids = {task.id: name for name, task in TASKS.items()} | {MULTI_OBJECTIVE: "leg"}
    if isinstance(id, str) and "/" in id and not id.startswith("hoof_env/"):
        return task_of(id)
    return TASKS[ids[check_choice("id", id, ids)]]


def tables_of(id: str) -> dict[str, Table]:
    """Return the tables of an environment by title; without constants there is no table of them.

    Args:
        id: an id of the package, or one's own, which may be "module:id".

    Raises:
        ParameterError: an unknown id, or a body of another kind than the package's.
    """
    task = task_of_id(id)
    tables = {
        "Arguments": arguments(task),
        "Actions": actions(task),
        "Observation": observations(task),
        "Rewards": with_objectives(rewards(task), task) if id == MULTI_OBJECTIVE else rewards(task),
        "Constants": constants(task),
    }
    return {title: table for title, table in tables.items() if table.rows}


def leg_of(task: Task) -> str:
    """Return a line about the leg of a task: its preset, its hips, and where its lengths come from."""
    settings = task.settings({})
    geometry = task.body(settings).geometry
    source = load_geometry(settings.preset).provenance
    first = re.split(r"(?<=\w{3}\.) (?=[A-Z])", source, maxsplit=1)[0]
    return f"{preset_label(settings.preset)}, hips {geometry.hip_height:.5g} m high. {first}"


def arguments(task: Task) -> Table:
    """Return the settings of a task that its body takes, and the arguments of pictures."""
    settings = task.settings({})
    body = task.body(settings)
    defaults = {name: literal(value) for name, value in to_json(settings).items()}
    words = {name: (about.unit, about.text, about.of_horse) for name, about in ABOUT.items()}
    filled = {
        name: [Template(cell).safe_substitute(choices()) for cell in row] for name, row in words.items()
    }
    rows = [
        (name, defaults[name], *cells)
        for name, cells in tables_of_body(body).settings(settings, filled, body).items()
    ]
    return Table(("Name", "Default", "Unit", "Meaning"), [*rows, *PICTURES])


def actions(task: Task) -> Table:
    """Return the actions of a task: their effects, ranges and units."""
    if task.action_map is not None:
        named = enumerate(dict(task.action_map.actions).items())
        return Table(("Num", "Action", "At +1"), [(str(k), *pair) for k, pair in named])
    body = task.body(task.settings({}))
    return Table(*tables_of_body(body).actions(body))


def observations(task: Task) -> Table:
    """Return the observation; neighbours with the same scaling, unit and group share a row, and so do the
    numbers of all legs."""
    body = task.body(task.settings({}))
    tables = tables_of_body(body)
    numbers: dict[tuple[str, ...], list[int]] = {}
    for k, entry in enumerate(observed(task)):
        cells = (
            tables.name_of_any_leg(entry.name),
            tables.scaling(entry.scale, body),
            entry.unit,
            entry.group,
        )
        numbers.setdefault(cells, []).append(k)
    rows: list[tuple[str, ...]] = []
    for rest, alike in groupby(numbers, key=lambda cells: cells[1:]):
        names = list(alike)
        places = [tables.places(numbers[cells]) for cells in names]
        rows.append((", ".join(places), ", ".join(cells[0] for cells in names), *rest))
    return Table(("Num", "Observation", "Scaling", "Unit before scaling", "Group"), rows)


def observed(task: Task) -> list[observation.Entry]:
    """Return the entries that are observed by default."""
    settings = task.settings({})
    return observation.observed(settings.observation, settings.trunk, settings.drive, task.entries)


def rewards(task: Task) -> Table:
    """Return the terms of the reward with their weights."""
    weights = check_weights(task.settings({}).reward_weights, task.terms)
    rows: list[tuple[str, ...]] = []
    for term in task.terms:
        also = "; a cost, no part of the reward" if term.is_cost else ""
        rows.append((term.name, f"{weights[term.name]:g}", term.unit, term.meaning + also))
    return Table(("Term", "Weight", "Unit", "Meaning"), rows)


def with_objectives(table: Table, task: Task) -> Table:
    """Return a table of rewards with the objective of each term, "each" if all share it."""
    rows = [(*row, term.objective or "each") for row, term in zip(table.rows, task.terms, strict=True)]
    return Table((*table.head, "Objective"), rows)


def constants(task: Task) -> Table:
    """Return the constants of terms and entries, and the state that terms keep."""
    found = constants_of(task.terms, task.entries).values()
    rows = [(c.name, f"{c.value:g}", c.unit, c.meaning) for c in found]
    rows += [
        (f"{term.name}.{row.name}", f"{row.initial:g}", row.unit, f"{row.meaning}; state, initial value")
        for term in task.terms
        for row in term.state
    ]
    return Table(("Constant", "Default", "Unit", "Meaning"), list(rows))


def choices() -> dict[str, str]:
    """Return the texts for the words with $ in the meanings of settings: choices and limits."""
    names = {
        "presets": preset_names(),
        "horse_presets": presets_of_paper(),
        "trunks": ONE_LEG,
        "schemes": SCHEMES,
        "paper_schemes": INTEGRATORS,
        "normal_laws": NORMAL_LAWS,
        "friction_laws": FRICTION_LAWS,
        "horse_gaits": horse_gaits(),
    }
    numbers = {
        "lowest": leg_starts.MIN_HEIGHT,
        "highest": leg_starts.MAX_HEIGHT,
        "horse_mass": horse.MASS,
        "smallest_size": SIZES[0],
        "largest_size": SIZES[1],
        "crank_bound": FilterSettings().crank_rate,
        "swing_bound": FilterSettings().swing_rate,
    }
    found = {name: ", ".join(f'"{choice}"' for choice in each) for name, each in names.items()}
    return found | {name: f"{number:g}" for name, number in numbers.items()}


def literal(value: Any) -> str:
    """Write a plain value in Python, numbers with as few digits as identify them."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f'"{key}": {literal(item)}' for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(literal, value)) + "]"
    if isinstance(value, float):
        return f"{value:g}" if float(f"{value:g}") == value else repr(value)
    return repr(value) if value is None or isinstance(value, bool) else json.dumps(value)
