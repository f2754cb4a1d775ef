"""Parts of a manual page that differ between one leg and a horse."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from hoof_env._output import markdown_table
from hoof_env.dynamics.layout import Features, StrideSums, stride_sums
from hoof_env.envs.manual_words import TABLES, WORDS, rows_of
from hoof_env.errors import ParameterError
from hoof_env.gait import LIMITS, QUICK
from hoof_env.tasks import horse, leg_starts, observation
from hoof_env.tasks.body import Body
from hoof_env.tasks.effects import check_effect
from hoof_env.tasks.horse import Horse
from hoof_env.tasks.horse_gaits import ACTED, COUNT, LEGS
from hoof_env.tasks.one_leg import OneLeg
from hoof_env.tasks.settings import PER_EPISODE, Settings

GAIT = [entry for entry in observation.ENTRIES if entry.group == "gait"]
"""Entries about the gait: the parameters, then their rates."""


class BodyPage(ABC):
    """Words and tables of a page that are a body's own.

    Attributes:
        kind: prefix of the body's words in `manual.toml`.
        words: words that fill in the page's template.
        option_ranges: ranges of the numeric reset options.
        table_prefix: prefix of the body's tables in `manual.toml`.
    """

    kind: str
    words: Mapping[str, str]
    option_ranges: Mapping[str, tuple[float, float]]
    table_prefix: str

    @abstractmethod
    def actions(self, body: Any) -> str:
        """Write the table of actions."""

    def scaling(self, scale: observation.Scale, body: Any) -> str:
        """Return the formula of a scale."""
        return scale.text

    def name_of_any_leg(self, name: str) -> str:
        """Return the name of an observation without that of its leg."""
        return name

    def places(self, numbers: list[int]) -> str:
        """Write the numbers of an observation; of one for each leg i as a formula, as in "50+4i"."""
        if len(numbers) < COUNT:
            return ", ".join(map(str, numbers))
        step = numbers[1] - numbers[0]
        return f"{numbers[0]}+{step if step > 1 else ''}i"

    def settings(self, s: Settings, defaults: Mapping[str, str]) -> list[tuple[str, ...]]:
        """Return the rows of the settings that the body takes, with those defaults."""
        return rows_of("settings", defaults)

    def parameters(self, s: Settings) -> list[str]:
        """Return the names of the settings that an episode can change."""
        return list(PER_EPISODE)

    def quantities(self, features: Features) -> list[tuple[str, ...]]:
        """Return the rows of measured and recorded quantities."""
        table = TABLES["quantities"] | TABLES.get(f"{self.table_prefix}quantities", {})
        rows: list[tuple[str, ...]] = []
        for names, cells in table.items():
            rows.append((", ".join(f"`{name}`" for name in names.split(", ")), *cells))
        # Sums of a control step have their units and meanings where they are declared.
        for name in stride_sums(features):
            quantity = StrideSums.notes[name]
            rows.append((f"`{name}`", "measured", quantity.unit, quantity.text))
        return rows

    def options(self) -> Iterable[tuple[str, ...]]:
        """Yield the rows of the reset options."""
        for name, (unit, meaning) in TABLES[f"{self.table_prefix}options"].items():
            # Options that are no numbers, such as a gait, have no range.
            low, high = self.option_ranges.get(name, (0.0, 0.0))
            within = f"{low:.7g} to {high:.7g}" if math.isfinite(high) else f"from {low:g}"
            yield f"`{name}`", unit, "" if low == high else within, meaning

    def infos(self, s: Settings) -> list[tuple[str, ...]]:
        """Return the rows of the entries of infos."""
        rows = rows_of(f"{self.table_prefix}info")
        return [row for row in rows if row[0] != "`target_speed`" or s.target_speed is not None]


class LegPage(BodyPage):
    """Parts of the page of one leg."""

    kind = "leg"
    table_prefix = ""
    option_ranges = leg_starts.OPTIONS
    words = MappingProxyType(
        {
            "still": WORDS["leg_still"].strip(),
            "reasons": WORDS["leg_reasons"].strip(),
            "size": "",
            "share": "",
            "of_legs": "leg's",
            "prefixes": "",
            "example": '"gait": "run", "crank_angle": 0.0',
        }
    )

    def actions(self, body: OneLeg) -> str:
        """Write the table of actions."""
        rows = []
        for k, (low, high) in enumerate(zip(body.low, body.high, strict=True)):
            value = GAIT[k]
            rate = GAIT[len(LIMITS) + k]
            limits = f"{low:.5g} to {high:.5g} {value.unit}"
            ends = f"{-body.rates[k]:g}", f"{body.rates[k]:g}"
            rows.append((str(k), value.name, *ends, rate.unit, limits))
        return markdown_table(("Num", "Rate of", "At -1", "At +1", "Unit", "Limits of the value"), rows)

    def scaling(self, scale: observation.Scale, body: OneLeg) -> str:
        """Return the formula of a scale, with limits and bounds of the leg."""
        if scale in observation.IN_RANGE:
            k = observation.IN_RANGE.index(scale)
            return observation.range_text(body.low[k], body.high[k])
        if scale in observation.IN_RATE:
            return observation.rate_text(body.filters.to_array()[observation.IN_RATE.index(scale), 1])
        return scale.text


class HorsePage(BodyPage):
    """Parts of the page of a horse."""

    kind = "horse"
    table_prefix = "horse_"
    option_ranges = horse.OPTIONS
    words = MappingProxyType(
        {
            "still": "",
            "reasons": WORDS["horse_reasons"].strip(),
            "size": WORDS["horse_size"].strip(),
            "share": "a fourth of ",
            "of_legs": "legs'",
            "prefixes": WORDS["prefixes"],
            "example": '"phase": 0.0',
        }
    )

    def actions(self, body: Horse) -> str:
        """Write the table of actions."""
        bounds = QUICK.to_array()[:, 1]
        rows = []
        for k, span in enumerate(horse.SPANS):
            # The first action of a leg scales the crank's speed, see `horse_gaits.command_gait`.
            operation, unit = ("times 1 + action", "-") if k == 0 else ("plus", "rad")
            fastest = f"{bounds[k]:g} {GAIT[len(LIMITS) + k].unit}"
            numbers = self.places([ACTED * leg + k for leg in range(COUNT)])
            rows.append((numbers, GAIT[k].name, operation, f"{-span:g}", f"{span:g}", unit, fastest))
        head = ("Num", "Offset of the reference's", "Is", "At -1", "At +1", "Unit", "Fastest change")
        return markdown_table(head, rows)

    def name_of_any_leg(self, name: str) -> str:
        """Return the name of an observation without that of its leg."""
        return re.sub(rf"({'|'.join(LEGS).replace('_', ' ')})[:,] ", "", name)

    def settings(self, s: Settings, defaults: Mapping[str, str]) -> list[tuple[str, ...]]:
        """Return the rows of the settings that a horse accepts, with those defaults."""
        of_horse = TABLES["horse_settings"]
        # Some settings need a rigid hoof, or pushes.
        contexts = (s, replace(s, hoof_stiffness=None), replace(s, push_impulse=1.0))
        rows: list[tuple[str, ...]] = []
        for name, cells in TABLES["settings"].items():
            if name not in horse.LEG_ONLY_SETTINGS and any(_can_be(name, each) for each in contexts):
                rows.append((f"`{name}`", defaults[name], *of_horse.get(name, cells)))
        return rows

    def parameters(self, s: Settings) -> list[str]:
        """Return the names of the settings that an episode can change."""
        return [name for name in PER_EPISODE if _can_be(name, s)]


PAGES: Mapping[Any, BodyPage] = MappingProxyType({OneLeg: LegPage(), Horse: HorsePage()})
"""Parts of pages by the class of a body."""


def page_of_body(body: Body) -> BodyPage:
    """Return the parts of a page for a body: those of its class, or of the class that it inherits.

    Raises:
        ParameterError: a body of a class of one's own that inherits none of this package.
    """
    found = next((PAGES[kind] for kind in type(body).__mro__ if kind in PAGES), None)
    if found is None:
        known = " or ".join(kind.__name__ for kind in PAGES)
        raise ParameterError(f"page: expected a body that inherits {known}, got {type(body).__name__}")
    return found


def _can_be(name: str, settings: Settings) -> bool:
    """True if a setting has an effect with one of the drives."""
    for drive in ("prescribed", "motor"):
        with suppress(ParameterError):
            check_effect(name, replace(settings, drive=drive))
            return True
    return False
