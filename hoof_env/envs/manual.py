"""The manual page of each id, in Gymnasium's form: `manual.md.in` filled from what the environments run on.

`manual.toml` has units and meanings by name; defaults, limits and weights come from the data that has them.
"""

from __future__ import annotations

import inspect
import json
import math
import os
import re
import tomllib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from string import Template
from typing import Any

from hoof_env._output import markdown_table
from hoof_env.dynamics.constrained import INTEGRATORS
from hoof_env.dynamics.layout import Features
from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.dynamics.parts import ONE_LEG
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.envs.horse_leg import HorseLegMOEnv
from hoof_env.envs.infos import measured_names
from hoof_env.envs.manual_common import without_common
from hoof_env.envs.policies import STANDS_FOR
from hoof_env.errors import DataFileError, OutputError, ParameterError, check_choice
from hoof_env.gait import LIMITS, QUICK, WIDEST, FilterSettings
from hoof_env.ground.laws import FRICTION_LAWS, NORMAL_LAWS
from hoof_env.leg.geometry import preset_names
from hoof_env.render.renderer import USUAL_SIZE
from hoof_env.tasks import horse, leg_starts, observation
from hoof_env.tasks.horse import Horse
from hoof_env.tasks.horse_gaits import ACTED, COUNT, FASTEST, FOLLOWED, SIZES, horse_gaits
from hoof_env.tasks.one_leg import CARRIED, OneLeg
from hoof_env.tasks.parameters import HILLS, SPACING
from hoof_env.tasks.registry import TASKS, Task, task_of
from hoof_env.tasks.reward import BEARING, LONGEST_STRIDE, OBJECTIVES, check_weights
from hoof_env.tasks.settings import PER_EPISODE, Settings, check_effect, to_json

HERE = Path(__file__).parent
PAGE, MO_PAGE = (
    (HERE / f"{name}.md.in").read_text(encoding="utf-8") for name in ("manual", "multi_objective")
)
"""The page of a task, and that of the id with three rewards; `page` fills in what begins with $."""

_NAMES = {name: task.name for name, task in TASKS.items()} | {"mo": "HorseLegMO"}

PAGES = tuple(_NAMES)  # the tasks, and the id with three rewards

COMMON = _NAMES["leg"]
"""The page that the others refer to."""

GAIT = [entry for entry in observation.ENTRIES if entry.group == "gait"]


def tables() -> dict[str, dict[str, Any]]:
    """What `manual.toml` says, by table and name: unit and meaning, or the words of a page."""
    names = {
        "presets": preset_names(), "trunks": ONE_LEG, "schemes": SCHEMES, "paper_schemes": INTEGRATORS,
        "normal_laws": NORMAL_LAWS, "friction_laws": FRICTION_LAWS, "horse_gaits": horse_gaits(),
    }  # fmt: skip
    values = {name: ", ".join(f'\\"{one}\\"' for one in choices) for name, choices in names.items()}
    numbers = {
        "lowest": leg_starts.LOWEST, "highest": leg_starts.HIGHEST,
        "spacing": SPACING, "margin": leg_starts.MARGIN,
        "start_speed": leg_starts.START_SPEED, "horse_mass": horse.MASS, "fastest": FASTEST,
        "smallest_size": SIZES[0], "largest_size": SIZES[1],
        "speed_spread": 100 * horse.SPEED_SPREAD, "pitch_spread": horse.PITCH_SPREAD,
        "phase_spread": horse.PHASE_SPREAD, "fall_pitch": horse.PITCH, "fall_low": horse.HEIGHT[0],
        "fall_high": horse.HEIGHT[1], "clearance": 100 * horse.CLEARANCE, "followed": FOLLOWED,
        "carried": round(100 * CARRIED),
        "crank_bound": FilterSettings().crank_rate, "swing_bound": FilterSettings().swing_rate,
        "bearing": BEARING, "full_allowance": BEARING * LONGEST_STRIDE,
    }  # fmt: skip
    numbers |= {f"{name}_{end}": WIDEST[name][k] for name in WIDEST for k, end in enumerate(("low", "high"))}
    values |= {name: f"{number:g}" for name, number in numbers.items()}
    text = (HERE / "manual.toml").read_text(encoding="utf-8")
    return tomllib.loads(Template(text).safe_substitute(values))


TABLES = tables()
WORDS = TABLES["words"]


def page(task: str, film: str = "") -> str:
    """Write the manual page of a task in Markdown.

    Args:
        task: one of `PAGES`, or an id of one's own.
        film: where the page finds the film that it shows; "" for a page without one.
    """
    what = task_of("leg" if task == "mo" else task)
    film = _film(_NAMES[task], what.is_horse, film) if film else ""
    if task == "mo":
        objectives = _objectives(check_weights(what.settings({}).reward_weights))
        return _tidy(
            Template(MO_PAGE).substitute(
                film=film, observations=_observations(what, OneLeg(what.settings({}))), objectives=objectives
            )
        )
    s = what.settings({})
    kind = "horse" if what.is_horse else "leg"
    body = Horse(s) if what.is_horse else OneLeg(s)
    trunk = TABLES[s.trunk]
    groups = observation.groups_of(what.entries)
    weights = check_weights(s.reward_weights, what.terms)
    rewards = [(f"`{t.key}`", f"`{t.name}`", f"{weights[t.name]:g}", t.unit, t.meaning) for t in what.terms]
    defaults = {name: literal(value) for name, value in to_json(s).items()}
    defaults |= {name: f"**{defaults[name]}**" for name in what.defaults}
    hills = {name: literal(value) for name, value in HILLS.items()}
    head = ("Name", "Default", "Unit", "Meaning")
    module = what.module or ("hoof_env" if what.id.startswith("hoof_env/") else "my_module")
    text = Template(PAGE).substitute(
        name=what.name,
        id=what.id,
        module=module,
        module_words="the package" if module == "hoof_env" else "it",
        summary=what.summary,
        film=film,
        about=what.about,
        body=Template(WORDS[f"{kind}_body"].strip()).safe_substitute(trunk=trunk["moves"]),
        action_space=f"Box(-1, 1, ({len(body.action_names)},), float32)",
        actions=_horse_actions() if isinstance(body, Horse) else _actions(body),
        commands=WORDS[f"{kind}_commands"].strip(),
        observed=WORDS[f"{kind}_observed"].strip(),
        still="" if what.is_horse else " " + WORDS["leg_still"].strip(),
        share="a fourth of " if what.is_horse else "",
        legs=str(body.legs),
        of_legs="legs'" if what.is_horse else "leg's",
        prefixes=WORDS["prefixes"] if what.is_horse else "",
        example='"phase": 0.0' if what.is_horse else '"gait": "run", "crank_angle": 0.0',
        observation_space=f"Box(-1, 1, ({len(_observed(what))},), float32)",
        observations=_observations(what, body),
        other_groups=", ".join(f"`{group}`" for group in groups if group not in s.observation),
        rewards=markdown_table(("Term", "Weight", "Default", "Unit", "Meaning"), rewards),
        target_reward=WORDS["target_reward"] if s.target_speed and not what.is_horse else "",
        lift_off=f"{100 * LIFT_OFF:g}",
        start=_start(s, what.start),
        options=markdown_table(("Option", "Unit", "Range", "Meaning"), _options(what.is_horse)),
        parameters=", ".join(f"`{name}`" for name in PER_EPISODE if not what.is_horse or _can_be(name, s)),
        infos=markdown_table(("Key", "Unit", "Meaning"), _infos(what, s)),
        measured=str(len(measured_names(_features(s, body), body.legs))),
        quantities=markdown_table(("Name", "In", "Unit", "Meaning"), _quantities(what.is_horse)),
        leaves=Template(trunk["leaves"]).substitute(height=f"{body.height:.4g}"),
        seconds=literal(s.episode_seconds),
        figures=markdown_table(("Figure", "Unit", "Meaning"), _rows("summary")),
        vector_arguments=markdown_table(("Argument", "Default", "Meaning"), _vector_arguments()),
        bold=WORDS["bold"] if what.defaults else "",
        settings=markdown_table(head, [*_settings(what, defaults), *PICTURES]),
        terrain=WORDS["terrain"] + markdown_table(head, _rows("hills", hills)) if s.terrain else "",
    )
    return _tidy(text)


def page_of(id: str) -> str:
    """The manual page of a registered id, of one's own as "module:id", too; `ParameterError` of another."""
    ids = {f"hoof_env/{name}-v0": task for task, name in _NAMES.items()}
    if isinstance(id, str) and "/" in id and not id.startswith("hoof_env/"):
        return page(id)
    return page(ids[check_choice("id", id, ids)])


def index() -> str:
    """All ids in one table, in Markdown."""
    rows = []
    for task, name in _NAMES.items():
        what = TASKS.get(task, TASKS["leg"])
        native = "yes" if task in TASKS else "no"
        summary = what.summary if task in TASKS else str(HorseLegMOEnv.__doc__).splitlines()[0]
        link = f"[`hoof_env/{name}-v0`]({name}.md)"
        actions = str(ACTED * (COUNT if what.is_horse else 1))
        rows.append((link, summary, actions, str(len(_observed(what))), what.reference, native))
    head = ("id", "what it is", "action", "observation", "reference gait", "native vector environment")
    return Template(WORDS["index"]).substitute(table=markdown_table(head, rows))


def _can_be(name: str, settings: Settings) -> bool:
    """Whether a parameter of an episode is not refused, be the crank driven or turned by a motor."""
    for drive in ("prescribed", "motor"):
        with suppress(ParameterError):
            check_effect(name, replace(settings, drive=drive))
            return True
    return False


def write_pages(out: Path, films: Path | None = None) -> list[Path]:
    """Write all pages and the index into a folder, which is made if need be, and return the files.

    What a page shares with that of `HorseLeg` is a link to it (`without_common`); `page` has all of it.

    Args:
        out: the folder.
        films: folder of trained policies, as agents.ship writes it. Each page shows the film of its policy
            there. None for pages without films.

    Raises:
        DataFileError: a policy has no film.
        OutputError: the folder cannot be written.
    """
    shown = {name: "" if films is None else _find_film(films, name, out) for name in _NAMES.values()}
    texts = {f"{name}.md": page(task, shown[name]) for task, name in _NAMES.items()}
    texts["HorseLegMO.md"] = _tidy(
        texts["HorseLegMO.md"].replace(_observations(TASKS["leg"], OneLeg(TASKS["leg"].settings({}))), "")
    )
    for name in _NAMES.values():
        if name not in (COMMON, "HorseLegMO"):  # which says by itself what it shares
            common = texts[f"{COMMON}.md"].replace(f"/{COMMON}-v0", f"/{name}-v0")
            texts[f"{name}.md"] = without_common(texts[f"{name}.md"], COMMON, common)
    texts["README.md"] = index()
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (out / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"cannot write to {out}: {error.strerror or error}") from None
    return [out / name for name in texts]


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
    return re.sub(r"\n{3,}", "\n\n", text)


def _find_film(films: Path, name: str, out: Path) -> str:
    """Find the film of an id, or of the id whose policy stands for it, as a page in `out` links to it."""
    for id in (f"hoof_env/{name}-v0", STANDS_FOR.get(f"hoof_env/{name}-v0", "")):
        film = films / id.rpartition("/")[2] / "film.gif"
        if film.is_file():
            return Path(os.path.relpath(film, out)).as_posix()
    raise DataFileError(f"films {films}: expected {name}-v0/film.gif, as agents.ship writes it, found none")


def _film(name: str, is_of_horse: bool, film: str) -> str:
    shown = WORDS["horse_film" if is_of_horse else "leg_film"]
    return Template(WORDS["film"].strip()).substitute(name=name, film=film, shown=shown)


def _settings(what: Task, defaults: Mapping[str, str]) -> list[tuple[str, ...]]:
    """The settings that an id takes, with those `defaults`."""
    if not what.is_horse:
        return _rows("settings", defaults)
    s = what.settings({})
    own = TABLES["horse_settings"]
    contexts = s, replace(s, hoof_stiffness=None)  # what needs a rigid hoof can be, too
    return [
        (f"`{name}`", defaults[name], *own.get(name, cells))
        for name, cells in TABLES["settings"].items()
        if name not in horse.LEG_ONLY_SETTINGS and any(_can_be(name, context) for context in contexts)
    ]


def _rows(table: str, values: Mapping[str, str] | None = None) -> list[tuple[str, ...]]:
    """Rows of a table of `manual.toml`: names, what `values` has of them, and cells."""
    return [
        (", ".join(f"`{one}`" for one in name.split(", ")), *([values[name]] if values else []), *cells)
        for name, cells in TABLES[table].items()
    ]


def _observed(what: Task) -> list[observation.Entry]:
    settings = what.settings({})
    return observation.observed(settings.observation, settings.trunk, settings.drive, what.entries)


def _features(s: Settings, body: Horse | OneLeg) -> Features:
    return Features(body.harmonics, s.hoof_stiffness is not None, body.limits is not None)


def _quantities(of_horse: bool) -> list[tuple[str, ...]]:
    """What is measured and recorded; of a horse what its engine has beyond that of one leg, too."""
    own = {**TABLES["quantities"], **(TABLES["horse_quantities"] if of_horse else {})}
    return [(", ".join(f"`{one}`" for one in names.split(", ")), *cells) for names, cells in own.items()]


def _horse_actions() -> str:
    bounds = QUICK.to_array()[:, 1]
    rows = []
    for k, span in enumerate(horse.SPANS):
        what = ("times 1 + action", "-") if k == 0 else ("plus", "rad")
        fastest = f"{bounds[k]:g} {GAIT[len(LIMITS) + k].unit}"
        numbers = ", ".join(str(ACTED * leg + k) for leg in range(COUNT))
        rows.append((numbers, GAIT[k].name, what[0], f"{-span:g}", f"{span:g}", what[1], fastest))
    head = ("Num", "Offset of the reference's", "Is", "At -1", "At +1", "Unit", "Fastest change")
    return markdown_table(head, rows)


def _actions(body: OneLeg) -> str:
    rows = []
    for k, (low, high) in enumerate(zip(body.low, body.high, strict=True)):
        value = GAIT[k]
        rate = GAIT[len(LIMITS) + k]
        limits = f"{low:.5g} to {high:.5g} {value.unit}"
        ends = f"{-body.rates[k]:g}", f"{body.rates[k]:g}"
        rows.append((str(k), value.name, *ends, rate.unit, limits))
    return markdown_table(("Num", "Rate of", "At -1", "At +1", "Unit", "Limits of the value"), rows)


def _objectives(weights: Mapping[str, float]) -> str:
    """The three rewards of `HorseLegMO-v0`: the terms of each, and the weights of those that are not 0."""
    rows = []
    for number, objective in enumerate(OBJECTIVES):
        own = [term for term in TASKS["leg"].terms if term.objective == objective]
        each = ", ".join(f"{weights[term.name]:g} {term.unit}" for term in own if weights[term.name])
        rows.append((str(number), objective, " + ".join(f"`{term.key}`" for term in own), each))
    return markdown_table(("Num", "Objective", "Terms", "Weights by default"), rows)


def _observations(what: Task, body: Horse | OneLeg) -> str:
    entries = enumerate(_observed(what))
    rows = [(str(k), e.name, _scaling(e.scale, body), e.unit, e.group) for k, e in entries]
    return markdown_table(("Num", "Observation", "Scaling", "Unit before scaling", "Group"), rows)


def _scaling(scale: observation.Scale, body: Horse | OneLeg) -> str:
    """The formula of a scale; limits and bounds are those of the leg."""
    if isinstance(body, OneLeg) and scale in observation.IN_RANGE:
        k = observation.IN_RANGE.index(scale)
        return observation.range_text(body.low[k], body.high[k])
    if isinstance(body, OneLeg) and scale in observation.IN_RATE:
        return observation.rate_text(body.filters.to_array()[observation.IN_RATE.index(scale), 1])
    return scale.text


def _start(settings: Settings, options: Mapping[str, float]) -> str:
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


def _options(of_horse: bool) -> Iterable[tuple[str, ...]]:
    ranges = horse.OPTIONS if of_horse else leg_starts.OPTIONS
    for name, (unit, meaning) in TABLES["horse_options" if of_horse else "options"].items():
        low, high = ranges.get(name, (0.0, 0.0))
        within = "" if low == high else f"{low:.7g} to {high:.7g}" if math.isfinite(high) else f"from {low:g}"
        yield f"`{name}`", unit, within, meaning


def _infos(what: Task, s: Settings) -> list[tuple[str, ...]]:
    found = _rows("horse_info" if what.is_horse else "info")
    return [row for row in found if row[0] != "`target_speed`" or s.target_speed is not None]


def _vector_arguments() -> list[tuple[str, ...]]:
    from hoof_env.envs.vector import HorseLegVectorEnv

    arguments = inspect.signature(HorseLegVectorEnv).parameters
    defaults = {name: arguments[name].default for name in TABLES["vector"]}
    return _rows("vector", {name: literal(getattr(value, "name", value)) for name, value in defaults.items()})


def literal(value: Any) -> str:
    """A plain value as Python writes it, numbers short."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f'"{key}": {literal(item)}' for key, item in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(literal, value)) + "]"
    if isinstance(value, float):
        return f"{value:g}" if float(f"{value:g}") == value else repr(value)
    return "None" if value is None else json.dumps(value)
