"""Tables of the manual pages: `manual.toml`, filled with the numbers that environments run on."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from string import Template
from typing import Any

from hoof_env.dynamics.parts import ONE_LEG
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.episodes.summaries import SUMMARY
from hoof_env.gait import WIDEST, FilterSettings
from hoof_env.ground.laws import FRICTION_LAWS, NORMAL_LAWS
from hoof_env.leg.presets import preset_names, presets_of_paper
from hoof_env.paper_solver.integrators import INTEGRATORS
from hoof_env.tasks import horse, leg_starts
from hoof_env.tasks.body_settings import About
from hoof_env.tasks.horse_gaits import FASTEST, FOLLOWED, SIZES, horse_gaits
from hoof_env.tasks.one_leg import CARRIED
from hoof_env.tasks.parameters import BUMPS, SPACING
from hoof_env.tasks.reward import BEARING, LONGEST_STRIDE
from hoof_env.tasks.settings import ABOUT

HERE = Path(__file__).parent


def tables() -> dict[str, dict[str, Any]]:
    """Return the tables of `manual.toml`, and those of the settings, by table and name: unit and meaning, or
    the words of a page. Words that begin with $ are replaced by numbers and choices."""
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
    # Escaped, because they are put into strings of TOML.
    values = {name: ", ".join(f'\\"{choice}\\"' for choice in choices) for name, choices in names.items()}
    numbers = {
        "lowest": leg_starts.LOWEST,
        "highest": leg_starts.HIGHEST,
        "spacing": SPACING,
        "bumps": BUMPS,
        "margin": leg_starts.MARGIN,
        "start_speed": leg_starts.START_SPEED,
        "horse_mass": horse.MASS,
        "fastest": FASTEST,
        "smallest_size": SIZES[0],
        "largest_size": SIZES[1],
        "speed_spread": 100 * horse.SPEED_SPREAD,
        "pitch_spread": horse.PITCH_SPREAD,
        "phase_spread": horse.PHASE_SPREAD,
        "fall_pitch": horse.PITCH,
        "fall_low": horse.HEIGHT[0],
        "fall_high": horse.HEIGHT[1],
        "clearance": 100 * horse.CLEARANCE,
        "followed": FOLLOWED,
        "carried": round(100 * CARRIED),
        "crank_bound": FilterSettings().crank_rate,
        "swing_bound": FilterSettings().swing_rate,
        "bearing": BEARING,
        "full_allowance": BEARING * LONGEST_STRIDE,
    }
    numbers |= {f"{name}_{end}": WIDEST[name][k] for name in WIDEST for k, end in enumerate(("low", "high"))}
    values |= {name: f"{number:g}" for name, number in numbers.items()}
    text = (HERE / "manual.toml").read_text(encoding="utf-8")
    # Before parsing; safe_substitute, because `page` fills in the words that are left.
    filled_tables = tomllib.loads(Template(text).safe_substitute(values))
    plain = {name: value.replace('\\"', '"') for name, value in values.items()}

    def filled(about: About, text: str) -> list[str]:
        """Return unit and meaning of a setting."""
        return [about.unit, Template(text).safe_substitute(plain)]

    filled_tables["settings"] = {name: filled(about, about.text) for name, about in ABOUT.items()}
    filled_tables["horse_settings"] = {
        name: filled(about, about.of_horse) for name, about in ABOUT.items() if about.of_horse
    }
    filled_tables["summary"] = {name: list(cells) for name, cells in SUMMARY.items()}
    return filled_tables


TABLES = tables()
WORDS = TABLES["words"]


def rows_of(table: str, values: Mapping[str, str] | None = None) -> list[tuple[str, ...]]:
    """Return the rows of a table of `manual.toml`: names, values of these names if there are `values`, and
    the cells of the table."""
    rows: list[tuple[str, ...]] = []
    for names, cells in TABLES[table].items():
        quoted = ", ".join(f"`{name}`" for name in names.split(", "))
        rows.append((quoted, *([values[names]] if values else []), *cells))
    return rows
