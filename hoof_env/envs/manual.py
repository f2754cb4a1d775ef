"""Manual page of each id, in Gymnasium's form: `manual.md.in`, filled with the data that environments run on.

`manual.toml` has units and meanings by name; defaults, limits and weights come from the modules that define
them.
"""

from __future__ import annotations

import inspect
import json
import os
import re
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from string import Template
from typing import Any

from hoof_env._display import Markdown
from hoof_env._output import markdown_table
from hoof_env.dynamics.layout import Features
from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.envs.horse_leg import HorseLegMOEnv
from hoof_env.envs.manual_bodies import page_of_body
from hoof_env.envs.manual_common import own_sections, sections_left, shared_sections, without_common
from hoof_env.envs.manual_words import HERE, TABLES, WORDS, rows_of
from hoof_env.envs.policies import STANDS_FOR
from hoof_env.envs.shipped import is_one_episode, shipped_returns
from hoof_env.episodes.infos import measured_names
from hoof_env.errors import DataFileError, OutputError, check_choice
from hoof_env.render.size import USUAL_SIZE
from hoof_env.tasks import observation
from hoof_env.tasks.body import Body
from hoof_env.tasks.own_parts import ActionMap, constants_of
from hoof_env.tasks.parameters import HILLS
from hoof_env.tasks.plain import to_json
from hoof_env.tasks.registry import TASKS, Task, task_of
from hoof_env.tasks.reward import OBJECTIVES, check_weights
from hoof_env.tasks.settings import Settings

PAGE, MO_PAGE = (
    (HERE / f"{name}.md.in").read_text(encoding="utf-8") for name in ("manual", "multi_objective")
)
"""Templates of the page of a task and of the page of the id with three rewards; `page` fills in words that
begin with $."""

_NAMES = {name: task.name for name, task in TASKS.items()} | {"mo": "HorseLegMO"}

PAGES = tuple(_NAMES)  # names of the tasks, and "mo" for the id with three rewards

COMMON = _NAMES["leg"]
"""Name of the page that the others refer to."""

NEAREST = {_NAMES["rough"]: (_NAMES["horse"], _NAMES["terrain"])}
"""Pages that refer to other pages first, by their names."""

HORSES = (_NAMES["horse"], _NAMES["rough"])
"""Pages that share `horses.md`, of which the first has its sections."""

SCORED = {
    "random": "random actions",
    "zero": "zero action",
    "run": "scripted run",
    "reference": "reference gait (zero action)",
    "constant": "best constant gait",
    "blind": "best policy without feedback",
    "stock": "stock PPO",
    "policy": "shipped agent",
}
"""Policies whose returns a page shows, from what is bad to what is good."""

RETURNS = "returns.json"
"""File of returns in a folder of policies, as agents.gallery writes it."""

STILL = "still.webp"
"""File of a policy's picture, as agents.gallery writes it."""


def page(task: str, film: str = "", score: str = "") -> str:
    """Write the manual page of a task in Markdown.

    Args:
        task: one of `PAGES`, or an id of one's own.
        film: path of the film, relative to the page; "" for a page without one.
        score: words about returns; "" for a page without them.
    """
    definition = task_of("leg" if task == "mo" else task)
    s = definition.settings({})
    body = definition.body(s)
    parts = page_of_body(body)
    film = _film(COMMON if task == "mo" else _NAMES[task], parts.kind, film) if film else ""
    if task == "mo":
        objectives = _objectives(check_weights(s.reward_weights))
        text = Template(MO_PAGE).substitute(film=film, score=score, objectives=objectives)
        return _tidy(text)
    trunk = TABLES[s.trunk]
    groups = observation.groups_of(definition.entries)
    weights = check_weights(s.reward_weights, definition.terms)
    defaults = {name: literal(value) for name, value in to_json(s).items()}
    defaults |= {name: f"**{defaults[name]}**" for name in definition.defaults}  # bold: this task's own
    head = ("Name", "Default", "Unit", "Meaning")
    module = definition.module or ("hoof_env" if definition.id.startswith("hoof_env/") else "my_module")
    text = Template(PAGE).substitute(
        name=definition.name,
        id=definition.id,
        module=module,
        module_words="the package" if module == "hoof_env" else "it",
        summary=definition.summary,
        film=film,
        score=score,
        about=definition.about,
        body=Template(WORDS[f"{parts.kind}_body"].strip()).safe_substitute(trunk=trunk["moves"]),
        action_space=f"Box(-1, 1, ({len(_actions(definition, body))},), float32)",
        actions=parts.actions(body) if definition.action_map is None else _mapped(definition.action_map),
        commands=WORDS[f"{parts.kind}_commands"].strip(),
        observed=WORDS[f"{parts.kind}_observed"].strip(),
        legs=str(body.kernels.legs),
        **parts.words,
        observation_space=f"Box(-1, 1, ({len(_observed(definition))},), float32)",
        observations=_observations(definition, body),
        other_groups=", ".join(f"`{group}`" for group in groups if group not in s.observation),
        rewards=_rewards(definition, weights) + _constants(definition),
        lift_off=f"{100 * LIFT_OFF:g}",
        start=_start(s, definition.start),
        options=markdown_table(("Option", "Unit", "Range", "Meaning"), parts.options()),
        parameters=", ".join(f"`{name}`" for name in parts.parameters(s)),
        infos=markdown_table(("Key", "Unit", "Meaning"), parts.infos(s)),
        measured=str(len(measured_names(_features(s, body), body.hips))),
        quantities=markdown_table(("Name", "In", "Unit", "Meaning"), parts.quantities(_features(s, body))),
        leaves=Template(trunk["leaves"]).substitute(height=f"{body.height:.4g}"),
        seconds=literal(s.episode_seconds),
        figures=markdown_table(("Figure", "Unit", "Meaning"), rows_of("summary")),
        vector_arguments=markdown_table(("Argument", "Default", "Meaning"), _vector_arguments()),
        bold=WORDS["bold"] if definition.defaults else "",
        settings=markdown_table(head, [*parts.settings(s, defaults), *PICTURES]),
        terrain=WORDS["terrain"] + markdown_table(head, rows_of("hills", _hills())) if s.terrain else "",
    )
    return _tidy(text)


def _hills() -> dict[str, str]:
    """Return the defaults of hilly terrain, as Python writes them."""
    return {name: literal(value) for name, value in HILLS.items()}


def _rewards(task: Task, weights: Mapping[str, float]) -> str:
    """Write the table of the reward's terms."""
    rows = [(f"`{t.name}`", f"{weights[t.name]:g}", t.unit, t.meaning) for t in task.terms]
    return markdown_table(("Term", "Weight", "Unit", "Meaning"), rows)


def _actions(task: Task, body: Body) -> tuple[str, ...]:
    """Return the names of the actions."""
    return task.action_map.names if task.action_map else body.action_names


def _mapped(action_map: ActionMap) -> str:
    """Write the table of actions of one's own."""
    rows = [(str(k), *pair) for k, pair in enumerate(dict(action_map.actions).items())]
    return markdown_table(("Num", "Action", "At +1"), rows)


def _constants(task: Task) -> str:
    """Write the table of the constants of terms and entries, and of what terms keep; "" without any."""
    constants = constants_of(task.terms, task.entries).values()
    rows = [(f"`{c.name}`", f"{c.value:g}", c.unit, c.meaning) for c in constants]
    rows += [
        (f"`{term.name}.{row.name}`", f"{row.begin:g}", row.unit, f"{row.meaning}; kept, from this value on")
        for term in task.terms
        for row in term.keeps
    ]
    table = markdown_table(("Constant", "Default", "Unit", "Meaning"), rows) if rows else ""
    return f"\n{table}" if table else ""


def page_of(id: str) -> str:
    """Return the manual page of a registered id, or of an id of one's own, which may be "module:id";
    notebooks render it.

    Raises:
        ParameterError: an unknown id.
    """
    ids = {f"hoof_env/{name}-v0": task for task, name in _NAMES.items()}
    if isinstance(id, str) and "/" in id and not id.startswith("hoof_env/"):
        return Markdown(page(id))
    return Markdown(page(ids[check_choice("id", id, ids)]))


def index(
    scores: Mapping[str, Mapping[str, Any]] | None = None, stills: Mapping[str, str] | None = None
) -> str:
    """Write the page that says which id is for what, in Markdown.

    Args:
        scores: by name of the page mean returns of policies, with the names of `SCORED`, and "learnt", as
            agents.gallery writes it; None for no returns.
        stills: paths of pictures by name of the page, relative to the index; None for no pictures.
    """
    rows = []
    for task, name in _NAMES.items():
        definition = TASKS.get(task, TASKS["leg"])
        summary = definition.summary if task in TASKS else str(HorseLegMOEnv.__doc__).splitlines()[0]
        link = f"[`{name}-v0`]({name}.md)"
        if stills:
            link = f"[![{name} at work]({stills[name]})]({name}.md)<br>{link}"
        use = f"{summary} For {TABLES['uses'][task]}."
        actions = _actions(definition, definition.body(definition.settings({})))
        found = (scores or {}).get(name, {})
        gaits = [key for key in SCORED if key in found]
        returns = "<br>".join(f"{SCORED[key]} {found[key]:.3g}" for key in gaits)
        numbers = f"{len(actions)}, {len(_observed(definition))}"
        rows.append((link, use, numbers, returns, _learnt(found.get("learnt", {}))))
    head = ("id", "what it asks, and what it is for", "actions, observations", "returns", "to learn it")
    return Template(WORDS["index"].lstrip()).substitute(table=markdown_table(head, rows))


def write_pages(out: Path, films: Path | None = None) -> list[Path]:
    """Write all pages and the index into a folder, which is made if it does not exist; return the files.

    Sections that hold for all ids are in common.md, and what differs for horses is in horses.md.
    What else a page shares with the page of `HorseLeg` is there alone (`without_common`).

    Args:
        out: folder of the pages.
        films: folder of trained policies, in the form of agents.ship. Each page shows film and scores of its
            policy. None for pages without them.

    Raises:
        DataFileError: a policy has no film, or no scores.
        OutputError: the folder cannot be written.
    """
    whole = {}
    returns = {}
    stills = {}
    for task, name in _NAMES.items():
        if films is None:
            whole[name] = page(task)
            continue
        policy = _find_policy(films, name)
        returns[name] = _returns(policy, films, name)
        film = Path(os.path.relpath(policy / "film.gif", out)).as_posix()
        if (policy / STILL).is_file():
            stills[name] = Path(os.path.relpath(policy / STILL, out)).as_posix()
        whole[name] = page(task, film, _score(returns[name]))
    texts = _shortened(whole)
    texts["README.md"] = index(returns, stills if len(stills) == len(whole) else None)
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (out / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"cannot write to {out}: {error.strerror or error}") from None
    return [out / name for name in texts]


def _shortened(whole: Mapping[str, str]) -> dict[str, str]:
    """Return the files of all pages by name: what they share, and what is left of each."""
    usual = shared_sections(whole[COMMON])
    horse = shared_sections(whole[HORSES[0]])
    of_horse = without_common(horse, {"common": _with_id(usual, COMMON, HORSES[0])})
    texts = {
        "common.md": WORDS["common"].lstrip() + usual,
        "horses.md": WORDS["horses"].lstrip() + of_horse,
    }
    for name, text in whole.items():
        # With the page's own id in the examples, so that these count as equal
        others = {}
        if name in HORSES:
            others["horses"] = _with_id(sections_left(horse, of_horse), HORSES[0], name)
        for key in NEAREST.get(name, ()):
            others[key] = _with_id(sections_left(whole[key], texts[f"{key}.md"]), key, name)
        if name != COMMON:
            others[COMMON] = _with_id(own_sections(whole[COMMON]), COMMON, name)
        others["common"] = _with_id(usual, COMMON, name)
        texts[f"{name}.md"] = without_common(text, others)
    return texts


def _with_id(text: str, name: str, other: str) -> str:
    """Return a text with the id of another page in its examples."""
    return text.replace(f"/{name}-v0", f"/{other}-v0")


# Parts of a page

PICTURES = (
    (
        "`render_mode`",
        "None",
        "",
        '"rgb_array" or "human"; a step costs more only where a picture is asked for',
    ),
    ("`width`", str(USUAL_SIZE[0]), "pixels", "of a picture, from 480"),
    ("`height`", str(USUAL_SIZE[1]), "pixels", "of a picture, from 270"),
)


def _tidy(text: str) -> str:
    """Remove the empty lines that words without content leave behind."""
    return re.sub(r"\n{3,}", "\n\n", text)


def _find_policy(films: Path, name: str) -> Path:
    """Return the folder of the policy of an id, or of the id with the same policy.

    Raises:
        DataFileError: there is no film.
    """
    for id in (f"hoof_env/{name}-v0", STANDS_FOR.get(f"hoof_env/{name}-v0", "")):
        folder = films / id.rpartition("/")[2]
        if (folder / "film.gif").is_file():
            return folder
    raise DataFileError(f"films {films}: expected {name}-v0/film.gif, as agents.ship writes it, found none")


def _learnt(learnt: Mapping[str, Any]) -> str:
    """Write what the best stock learner of an id takes to learn it; "" without one."""
    if not learnt:
        return ""
    seeds = f"{learnt['seeds']} seeds" if learnt["seeds"] > 1 else "1 seed"
    reached = f"reaches {learnt['return']:.3g} in " if "return" in learnt else ""
    spent = f"{learnt['steps']:,} steps, {learnt['seconds']:.0f} s"
    return f"{reached}{spent}<br>({learnt['algo'].upper()}, {seeds})"


def _returns(policy: Path, films: Path, name: str) -> dict[str, Any]:
    """Read the mean returns of a policy that ships and of others in the same episodes, and how fast a stock
    learner learns.

    Raises:
        DataFileError: the policy has no scores, or the file of returns cannot be read.
    """
    scored = shipped_returns(policy.name)
    found: dict[str, Any] = {key: scored[key] for key in SCORED if key in scored}
    found["one_episode"] = is_one_episode(policy.name)
    path = films / RETURNS
    try:
        others = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
        return found | others.get(f"hoof_env/{name}-v0", {})
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataFileError(f"returns {path}: expected those that agents.gallery writes: {error!r}") from None


def _score(returns: Mapping[str, Any]) -> str:
    """Write the table that says which returns are good."""
    titles = dict(SCORED)
    if "stock_steps" in returns:
        titles["stock"] = f"[stock PPO](../evidence/stock/README.md), {returns['stock_steps']:,.0f} steps"
    shown = [key for key in SCORED if key in returns]
    table = markdown_table([titles[key] for key in shown], [[f"{returns[key]:.3g}" for key in shown]])
    stock = "" if "stock" in returns else WORDS["no_stock"]
    words = WORDS["one_score" if returns.get("one_episode") else "score"]
    return Template(words.strip()).substitute(returns=table, stock=stock)


def _film(name: str, kind: str, film: str) -> str:
    """Write the paragraph that shows a film."""
    shown = WORDS[f"{kind}_film"]
    return Template(WORDS["film"].strip()).substitute(name=name, film=film, shown=shown)


def _observed(task: Task) -> list[observation.Entry]:
    """Return the entries that are observed by default."""
    settings = task.settings({})
    return observation.observed(settings.observation, settings.trunk, settings.drive, task.entries)


def _features(s: Settings, body: Body) -> Features:
    """Return the features of the engine of an environment, without making one."""
    return Features(body.harmonics, s.hoof_stiffness is not None, body.limits is not None)


def _objectives(weights: Mapping[str, float]) -> str:
    """Write the table of the rewards of `HorseLegMO-v0`: terms and weights of each."""
    rows = []
    for number, objective in enumerate(OBJECTIVES):
        terms = [term for term in TASKS["leg"].terms if term.objective == objective]
        each = ", ".join(f"{weights[term.name]:g} {term.unit}" for term in terms)
        rows.append((str(number), objective, " + ".join(f"`{term.key}`" for term in terms), each))
    return markdown_table(("Num", "Objective", "Terms", "Weights by default"), rows)


def _observations(task: Task, body: Body) -> str:
    """Write the table of the observation; neighbours with the same scaling, unit and group share a row, and
    so do the numbers of all legs."""
    parts = page_of_body(body)
    numbers: dict[tuple[str, ...], list[int]] = {}
    for k, entry in enumerate(_observed(task)):
        cells = (parts.name_of_any_leg(entry.name), parts.scaling(entry.scale, body), entry.unit, entry.group)
        numbers.setdefault(cells, []).append(k)
    rows = []
    for rest, alike in groupby(numbers, key=lambda cells: cells[1:]):
        names = list(alike)
        places = [parts.places(numbers[cells]) for cells in names]
        rows.append((", ".join(places), ", ".join(cells[0] for cells in names), *rest))
    return markdown_table(("Num", "Observation", "Scaling", "Unit before scaling", "Group"), rows)


def _start(settings: Settings, options: Mapping[str, float]) -> str:
    """Write the sentence about the start of an episode, with the task's reset options."""
    trunk = TABLES[settings.trunk]
    if settings.trunk == "free":
        return "; ".join((WORDS["start_horse"], trunk["speed"], trunk["height"], WORDS["start_target"]))
    return "; ".join(
        (
            f"Crank angle {options['crank_angle']:g}" if "crank_angle" in options else "Crank angle uniform",
            f"the {settings.gait}, at rest in the filters" if settings.gait else WORDS["start_gait"],
            trunk["speed"],
            trunk["height"],
            WORDS["start_terrain"] if settings.terrain else "at x = 0",
            *([WORDS["start_target"]] if settings.target_speed else []),
        )
    )


def _vector_arguments() -> list[tuple[str, ...]]:
    """Return the rows of the arguments that only the vector environment has."""
    from hoof_env.envs.vector import HorseLegVectorEnv

    arguments = inspect.signature(HorseLegVectorEnv).parameters
    defaults = {name: arguments[name].default for name in TABLES["vector"]}
    return rows_of(
        "vector", {name: literal(getattr(value, "name", value)) for name, value in defaults.items()}
    )


def literal(value: Any) -> str:
    """Write a plain value in Python, numbers with as few digits as identify them."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f'"{key}": {literal(item)}' for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(literal, value)) + "]"
    if isinstance(value, float):
        return f"{value:g}" if float(f"{value:g}") == value else repr(value)
    return "None" if value is None else json.dumps(value)
