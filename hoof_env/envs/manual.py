"""The manual page of each id, in Gymnasium's form: `manual.md.in` filled from what the environments run on.

`manual.toml` has units and meanings by name; defaults, limits and weights come from the data that has them.
"""

from __future__ import annotations

import inspect
import json
import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from string import Template
from typing import Any

from hoof_env._output import markdown_table
from hoof_env.dynamics.constrained import INTEGRATORS
from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.dynamics.parts import ONE_LEG
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.envs import observation, start
from hoof_env.envs.infos import MEASURED
from hoof_env.envs.multi_objective import HorseLegMOEnv
from hoof_env.envs.parameters import HILLS, SPACING
from hoof_env.envs.reward import Term, check_weights
from hoof_env.envs.tasks import PER_EPISODE, TASKS, Settings, Task, task_of, to_json
from hoof_env.errors import OutputError, check_choice
from hoof_env.gait.gait import LIMITS, FilterSettings
from hoof_env.ground.laws import FRICTION_LAWS, NORMAL_LAWS
from hoof_env.leg.geometry import load_geometry, preset_names

HERE = Path(__file__).parent
PAGE, MO_PAGE = (
    (HERE / f"{name}.md.in").read_text(encoding="utf-8") for name in ("manual", "multi_objective")
)
"""The page of a task, and that of the id with three rewards; `page` fills in what begins with $."""

_NAMES = {name: task.name for name, task in TASKS.items()} | {"mo": "HorseLegMO"}

PAGES = tuple(_NAMES)
"""The tasks, and the id with three rewards."""

INDEX = "README.md"

GAIT = [entry for entry in observation.ENTRIES if entry.group == "gait"]


def tables() -> dict[str, dict[str, list[str]]]:
    """What `manual.toml` says, by table and name: unit and meaning."""
    names = {
        "presets": preset_names(), "trunks": ONE_LEG, "schemes": SCHEMES, "paper_schemes": INTEGRATORS,
        "normal_laws": NORMAL_LAWS, "friction_laws": FRICTION_LAWS,
    }  # fmt: skip
    values = {name: ", ".join(f'"{one}"' for one in choices) for name, choices in names.items()}
    numbers = {"lowest": start.LOWEST, "highest": start.HIGHEST, "spacing": SPACING}
    values |= {name: f"{number:g}" for name, number in numbers.items()}
    return {
        table: {name: [Template(cell).substitute(values) for cell in cells] for name, cells in rows.items()}
        for table, rows in tomllib.loads((HERE / "manual.toml").read_text(encoding="utf-8")).items()
    }


TABLES = tables()

MOVES = "The trunk moves by what friction gives it and feels every link swing. "


def page(task: str) -> str:
    """The manual page of a task in Markdown; `task` is one of `PAGES`, or an id of one's own.

    Raises:
        ParameterError: there is no such page.
    """
    what = task_of("leg" if task == "mo" else task)
    settings = what.settings({})
    if task == "mo":
        return Template(MO_PAGE).substitute(observations=_observations(what))
    groups = observation.groups_of(what.entries)
    text = Template(PAGE).substitute(
        name=what.name,
        id=what.id,
        summary=what.summary,
        about=what.about,
        trunk="" if settings.trunk == "fixed" else MOVES,
        action_space=f"Box(-1, 1, ({len(LIMITS)},), float32)",
        actions=_actions(settings),
        offsets=_offsets(settings.gait) if settings.gait else "",
        observation_space=f"Box(-1, 1, ({len(_observed(what))},), float32)",
        observations=_observations(what),
        other_groups=", ".join(f"`{group}`" for group in groups if group not in settings.observation),
        rewards=_rewards(settings, what.terms),
        target_reward="Progress counts up to the commanded speed; what goes beyond it is subtracted."
        if settings.target_speed
        else "",
        lift_off=f"{100 * LIFT_OFF:g}",
        start=_start(settings, what.start),
        options=markdown_table(("Option", "Unit", "Range", "Meaning"), _options()),
        parameters=", ".join(f"`{name}`" for name in PER_EPISODE),
        infos=markdown_table(("Key", "Unit", "Meaning"), _quoted("info")),
        measured=str(len(MEASURED)),
        quantities=markdown_table(("Name", "In", "Unit", "Meaning"), _quantities()),
        leaves=_leaves(settings),
        seconds=literal(settings.episode_seconds),
        figures=markdown_table(("Figure", "Unit", "Meaning"), _quoted("summary")),
        vector_arguments=markdown_table(("Argument", "Default", "Meaning"), _vector_arguments()),
        bold=", **bold** where they are not those of [HorseLeg](HorseLeg.md)" if what.defaults else "",
        settings=markdown_table(("Name", "Default", "Unit", "Meaning"), _settings(settings, what.defaults)),
        terrain=_terrain() if settings.terrain else "",
    )
    return re.sub(r"\n{3,}", "\n\n", text)


def page_of(id: str) -> str:
    """The manual page of a registered id, of one's own as "module:id", too.

    Raises:
        ParameterError: not an id of this package, or one's own that is not registered.
    """
    ids = {f"hoof_env/{name}-v0": task for task, name in _NAMES.items()}
    if isinstance(id, str) and "/" in id and not id.startswith("hoof_env/"):
        return page(id)
    return page(ids[check_choice("id", id, ids)])


def index() -> str:
    """All ids in one table, in Markdown."""
    rows = []
    for task, name in _NAMES.items():
        what, native = TASKS.get(task, TASKS["leg"]), "yes" if task in TASKS else "no"
        summary = what.summary if task in TASKS else str(HorseLegMOEnv.__doc__).splitlines()[0]
        link = f"[`hoof_env/{name}-v0`]({name}.md)"
        rows.append((link, summary, str(len(_observed(what))), what.reference, native))
    head = ("id", "what it is", "observation", "reference gait", "native vector environment")
    return (
        "# Environments\n\nWritten by `hoof-env manual --out docs/environments`.\n\n"
        f"{markdown_table(head, rows)}\n\n"
        "Actions are `Box(-1, 1, (4,), float32)`, observations boxes of so many numbers in [-1, 1]. Idle,"
        " airborne, foot-dragging and bang-bang policies must stay below the reference gait.\n"
    )


def write_pages(out: Path) -> list[Path]:
    """Write all pages and the index into a folder, which is made if need be; returns the files.

    Raises:
        OutputError: the folder cannot be made or written to.
    """
    texts = {INDEX: index(), **{f"{name}.md": page(task) for task, name in _NAMES.items()}}
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (out / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"cannot write to {out}: {error.strerror or error}") from None
    return [out / name for name in texts]


# Parts of a page


def _observed(what: Task) -> list[observation.Entry]:
    settings = what.settings({})
    return observation.observed(settings.observation, settings.trunk, what.entries)


def _actions(settings: Settings) -> str:
    bounds = FilterSettings().to_array()[:, 1]
    rows = []
    for k, (low, high) in enumerate(LIMITS.values()):
        name, unit = GAIT[k].name, GAIT[k].unit
        if settings.gait:
            low, high = -(high - low) / 2, (high - low) / 2
        fastest = f"{bounds[k]:g} {GAIT[len(LIMITS) + k].unit}"
        rows.append((str(k), name, f"{low:.5g}", f"{high:.5g}", unit, fastest))
    return markdown_table(
        ("Num", "Offset of" if settings.gait else "Command", "At -1", "At +1", "Unit", "Fastest change"), rows
    )


def _offsets(gait: str) -> str:
    limits = (f"{low:.5g} to {high:.5g} {GAIT[k].unit}" for k, (low, high) in enumerate(LIMITS.values()))
    return (
        f'It is added to the {gait}, and the sums are clipped to {", ".join(limits)}. What is observed "as'
        ' action" is -1 and 1 at these limits. A gait out of reach has the nearest action.\n\n'
    )


def _observations(what: Task) -> str:
    rows = [(e.name, e.scale.text, e.unit, e.group) for e in _observed(what)]
    head = ("Num", "Observation", "Scaling", "Unit before scaling", "Group")
    return markdown_table(head, [(str(k), *row) for k, row in enumerate(rows)])


def _rewards(settings: Settings, terms: tuple[Term, ...]) -> str:
    weights = check_weights(settings.reward_weights, terms)
    rows = [(f"`{t.key}`", f"`{t.name}`", f"{weights[t.name]:g}", t.unit, t.meaning) for t in terms]
    return markdown_table(("Term", "Weight", "Default", "Unit", "Meaning"), rows)


def _start(settings: Settings, options: Mapping[str, float]) -> str:
    between = "gait parameters on the line between the preset's walk and run"
    parts = [
        f"Crank angle {options['crank_angle']:g}" if "crank_angle" in options else "Crank angle uniform",
        f"{'the ' + settings.gait if settings.gait else between}, at rest in the filters",
        "at rest" if settings.trunk == "fixed" else f"speed uniform in 0 to {start.START_SPEED:g} m/s",
        {
            "suspended": "the trunk at its nominal height, or higher where the hoof would be in the ground",
            "rail": "a crank angle with the hoof in the ground is drawn again",
            "fixed": "the trunk at its nominal height",
        }[settings.trunk],
        f"anywhere on the terrain but within {start.MARGIN:g} m of its ends"
        if settings.terrain
        else "at x = 0",
    ]
    if settings.target_speed:
        parts.append(
            "commanded speeds uniform in `target_speed`, each for a time uniform in `target_seconds`"
        )
    return "; ".join(parts)


def _leaves(settings: Settings) -> str:
    if settings.trunk == "fixed":
        return ' the linkage comes apart, which `solver="paper"` does not rule out, or'
    if settings.trunk != "suspended":
        return ""
    height = settings.hip_height or load_geometry(settings.preset).hip_height
    return f" O leaves {start.LOWEST:g} to {start.HIGHEST:g} times its nominal height, {height:.4g} m, or"


def _options() -> Iterable[tuple[str, ...]]:
    for name, (unit, meaning) in TABLES["options"].items():
        low, high = start.OPTIONS.get(name, (0.0, 0.0))
        within = "" if low == high else f"{low:.7g} to {high:.7g}" if math.isfinite(high) else f"from {low:g}"
        yield f"`{name}`", unit, within, meaning


def _quantities() -> Iterable[tuple[str, ...]]:
    for names, cells in TABLES["quantities"].items():
        yield ", ".join(f"`{name}`" for name in names.split(", ")), *cells


def _vector_arguments() -> Iterable[tuple[str, ...]]:
    from hoof_env.envs.vector import HorseLegVectorEnv

    for name, item in inspect.signature(HorseLegVectorEnv).parameters.items():
        if name in TABLES["vector"]:
            default = literal(getattr(item.default, "name", item.default))
            yield f"`{name}`", default, TABLES["vector"][name][1]


def _settings(settings: Settings, changed: Iterable[str]) -> Iterable[tuple[str, ...]]:
    for name, value in to_json(settings).items():
        default = f"**{literal(value)}**" if name in changed else literal(value)
        yield f"`{name}`", default, *TABLES["settings"][name]
    yield "`render_mode`", "None", "", '"rgb_array" or "human"'


def _terrain() -> str:
    rows = [(f"`{name}`", literal(value), *TABLES["hills"][name]) for name, value in HILLS.items()]
    return (
        "### Terrain\n\nHills go straight from one random height to the next, each at its own slope, over"
        " patches of random stiffness and friction. They take:\n\n"
        f"{markdown_table(('Name', 'Default', 'Unit', 'Meaning'), rows)}"
    )


# Markdown


def literal(value: Any) -> str:
    """A plain value as Python writes it, numbers short."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f'"{key}": {literal(item)}' for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(literal, value)) + "]"
    if isinstance(value, float):
        return f"{value:g}" if float(f"{value:g}") == value else repr(value)
    return "None" if value is None else json.dumps(value)


def _quoted(table: str) -> Iterable[tuple[str, ...]]:
    return ((f"`{name}`", *cells) for name, cells in TABLES[table].items())
