"""Tables of the pages of docs/environments: the tables of `hoof_env.envs.manual` and some for pages alone."""

from __future__ import annotations

import inspect
import math
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from string import Template
from typing import Any

from hoof_env.dynamics.layout import Features, StrideSums, stride_sums
from hoof_env.envs import manual
from hoof_env.envs.manual import Table, literal
from hoof_env.envs.manual_bodies import HorseTables, has_effect, tables_of_body
from hoof_env.envs.vector import HorseLegVectorEnv
from hoof_env.episodes.costs import COSTS
from hoof_env.episodes.summaries import SUMMARY
from hoof_env.tasks import horse, leg_starts
from hoof_env.tasks.body import Body
from hoof_env.tasks.registry import TASKS, Task
from hoof_env.tasks.reward import OBJECTIVES, check_weights
from hoof_env.tasks.settings import PER_EPISODE
from hoof_env.tasks.terrains import BUMPS, DITCHES, HILLS, SPACING, STEP

WORDS: dict[str, dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("words.toml").read_text(encoding="utf-8")
)
"""Units and meanings by table and name."""

HEAD = ("Name", "Default", "Unit", "Meaning")


def task(name: str) -> Task:
    """Return the task of a page, which is named as the id without its namespace and version."""
    return manual.task_of_id(f"hoof_env/{name}-v0")


def body_of(name: str) -> Body:
    """Return the body of a page's environment."""
    found = task(name)
    return found.body(found.settings({}))


def is_horse(name: str) -> bool:
    """True for the page of a horse."""
    return isinstance(tables_of_body(body_of(name)), HorseTables)


def quoted(names: str) -> str:
    """Return names, separated by commas, as code."""
    return ", ".join(f"`{name}`" for name in names.split(", "))


def with_code(table: Table) -> Table:
    """Return a table whose names, in the first column, are code."""
    return Table(table.head, [(quoted(first), *rest) for first, *rest in table.rows])


def arguments(name: str) -> Table:
    """Return the arguments of an environment; the task's own defaults are bold."""
    own = task(name).defaults
    table = manual.arguments(task(name))
    rows: list[tuple[str, ...]] = []
    for setting, default, *rest in table.rows:
        rows.append((setting, f"**{default}**" if setting in own else default, *rest))
    return with_code(Table(table.head, rows))


def options(name: str) -> Table:
    """Return the reset options."""
    ranges: Mapping[str, tuple[float, float]] = horse.OPTIONS if is_horse(name) else leg_starts.OPTIONS
    rows: list[tuple[str, ...]] = []
    for option, (unit, meaning) in WORDS["horse_options" if is_horse(name) else "options"].items():
        # Options that are no numbers, such as a gait, have no range.
        low, high = ranges.get(option, (0.0, 0.0))
        within = f"{low:.7g} to {high:.7g}" if math.isfinite(high) else f"from {low:g}"
        rows.append((option, unit, "" if low == high else within, meaning))
    return with_code(Table(("Option", "Unit", "Range", "Meaning"), rows))


def parameters(name: str) -> str:
    """Return the names of the settings that an episode can change."""
    settings = task(name).settings({})
    names = [one for one in PER_EPISODE if not is_horse(name) or has_effect(one, settings)]
    return f"Parameters: {', '.join(map(quoted, names))}."


def infos(name: str) -> Table:
    """Return the entries of infos besides the terms of the reward."""
    words = WORDS["horse_info" if is_horse(name) else "info"]
    is_commanded = task(name).settings({}).target_speed is not None
    rows = [(key, *cells) for key, cells in words.items() if is_commanded or key != "target_speed"]
    return with_code(Table(("Key", "Unit", "Meaning"), rows))


def features(name: str) -> Features:
    """Return the features of the engine of an environment."""
    body = body_of(name)
    is_soft = task(name).settings({}).hoof_stiffness is not None
    return Features(body.harmonics, is_soft, body.limits is not None)


def quantities(name: str) -> Table:
    """Return what is measured and recorded."""
    words = WORDS["quantities"] | (WORDS["horse_quantities"] if is_horse(name) else {})
    words |= WORDS["spring_quantities"] if features(name).has_springs else {}
    rows: list[tuple[str, ...]] = [(names, *cells) for names, cells in words.items()]
    sums = {field: StrideSums.notes[field] for field in stride_sums(features(name))}
    rows += [(field, "measured", quantity.unit, quantity.text) for field, quantity in sums.items()]
    return with_code(Table(("Name", "In", "Unit", "Meaning"), rows))


def figures(_: str) -> Table:
    """Return the figures of an episode's summary."""
    return with_code(
        Table(("Figure", "Unit", "Meaning"), [(key, *map(str, cells)) for key, cells in SUMMARY.items()])
    )


def costs(_: str) -> Table:
    """Return the costs that limits can have."""
    rows: list[tuple[str, ...]] = [(name, *cells) for name, cells in COSTS.items()]
    return with_code(Table(("Cost", "Unit", "Of a step"), rows))


def vector(_: str) -> Table:
    """Return the arguments that only the vector environment has."""
    known = inspect.signature(HorseLegVectorEnv).parameters
    rows: list[tuple[str, ...]] = []
    for name, (meaning,) in WORDS["vector"].items():
        default = known[name].default
        rows.append((name, literal(getattr(default, "name", default)), meaning))
    return with_code(Table(("Argument", "Default", "Meaning"), rows))


def hills(_: str) -> Table:
    """Return the parameters of hilly terrain."""
    numbers = {"spacing": f"{SPACING:g}", "bumps": f"{BUMPS:g}"}
    return _of_terrain("hills", HILLS, numbers)


def ditches(_: str) -> Table:
    """Return the parameters of ditches."""
    return _of_terrain("ditches", DITCHES, {"step": f"{STEP:g}"})


def _of_terrain(kind: str, defaults: Mapping[str, Any], numbers: Mapping[str, str]) -> Table:
    """Return the parameters of a kind of terrain."""
    rows: list[tuple[str, ...]] = []
    for name, (unit, meaning) in WORDS[kind].items():
        rows.append((name, literal(defaults[name]), unit, Template(meaning).substitute(numbers)))
    return with_code(Table(HEAD, rows))


def objectives(_: str) -> Table:
    """Return the rewards of the id with three of them: terms and weights of each."""
    weights = check_weights(TASKS["leg"].settings({}).reward_weights)
    rows: list[tuple[str, ...]] = []
    for number, objective in enumerate(OBJECTIVES):
        terms = [term for term in TASKS["leg"].terms if term.objective == objective]
        each = ", ".join(f"{weights[term.name]:g} {term.unit}" for term in terms)
        rows.append((str(number), objective, " + ".join(f"`{term.key}`" for term in terms), each))
    return Table(("Num", "Objective", "Terms", "Weights by default"), rows)


TABLES: dict[str, Callable[[str], Table | str]] = {
    "about": lambda name: task(name).about,
    "arguments": arguments,
    "actions": lambda name: manual.actions(task(name)),
    "observations": lambda name: manual.observations(task(name)),
    "rewards": lambda name: with_code(manual.rewards(task(name))),
    "options": options,
    "parameters": parameters,
    "infos": infos,
    "quantities": quantities,
    "figures": figures,
    "costs": costs,
    "vector": vector,
    "hills": hills,
    "ditches": ditches,
    "objectives": objectives,
}
"""Functions of the name of a page by the name of a mark."""


def difference(own: Table, other: Table) -> tuple[list[str], Table]:
    """Compare a table with another one of the same columns.

    Returns:
        The names that it lacks, and its rows that differ; if it has no further rows, only the columns that
        differ.
    """
    place = 1 if own.head[0] == "Num" else 0
    known = {row[place]: row for row in other.rows}
    names = {row[place] for row in own.rows}
    compared = range(place, len(own.head))  # numbers follow from the order
    added = [row for row in own.rows if row[place] not in known]
    changed = [
        row
        for row in own.rows
        if row[place] in known and any(row[k] != known[row[place]][k] for k in compared)
    ]
    shown = list(range(len(own.head)))
    if not added:
        shown = [k for k in compared if k == place or any(row[k] != known[row[place]][k] for row in changed)]
    rows = [tuple(row[k] for k in shown) for row in (*changed, *added)]
    return [name for name in known if name not in names], Table(tuple(own.head[k] for k in shown), rows)
