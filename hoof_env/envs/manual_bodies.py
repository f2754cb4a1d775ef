"""Parts of the tables of an environment that differ between one leg and a horse."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from hoof_env.errors import ParameterError
from hoof_env.gait import LIMITS, QUICK
from hoof_env.tasks import horse, observation
from hoof_env.tasks.body import Body
from hoof_env.tasks.horse import Horse
from hoof_env.tasks.horse_gaits import ACTED, COUNT, LEGS
from hoof_env.tasks.one_leg import OneLeg
from hoof_env.tasks.settings import Settings, check_effect

GAIT = [entry for entry in observation.ENTRIES if entry.group == "gait"]
"""Entries about the gait: the parameters, then their rates."""

Words = Mapping[str, Sequence[str]]
"""Unit, meaning, and meaning for a horse, "" for the same, by name of a setting."""


class BodyTables(ABC):
    """Parts of tables that are a body's own."""

    @abstractmethod
    def actions(self, body: Any) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Return the head and rows of the table of actions."""

    @abstractmethod
    def settings(self, s: Settings, words: Words, body: Any) -> dict[str, tuple[str, str]]:
        """Return the unit and meaning of the settings that the body takes, by name."""

    def scaling(self, scale: observation.Scale, body: Any) -> str:
        """Return the formula of a scale."""
        return scale.text

    def name_of_any_leg(self, name: str) -> str:
        """Return the name of an observation without its leg's name."""
        return name

    def places(self, numbers: list[int]) -> str:
        """Return the numbers of an observation; of one for each leg i as a formula, as in "50+4i"."""
        if len(numbers) < COUNT:
            return ", ".join(map(str, numbers))
        step = numbers[1] - numbers[0]
        return f"{numbers[0]}+{step if step > 1 else ''}i"


class LegTables(BodyTables):
    """Parts of the tables of one leg."""

    def actions(self, body: OneLeg) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Return the head and rows of the table of actions."""
        rows: list[tuple[str, ...]] = []
        for k, (low, high) in enumerate(zip(body.low, body.high, strict=True)):
            value = GAIT[k]
            rate = GAIT[len(LIMITS) + k]
            limits = f"{low:.5g} to {high:.5g} {value.unit}"
            ends = f"{-body.rates[k]:g}", f"{body.rates[k]:g}"
            rows.append((str(k), value.name, *ends, rate.unit, limits))
        return ("Num", "Rate of", "At -1", "At +1", "Unit", "Limits of the value"), rows

    def settings(self, s: Settings, words: Words, body: OneLeg) -> dict[str, tuple[str, str]]:
        """Return the unit and meaning of all settings, by name; for rates also the values of this leg."""
        found = {name: (unit, text) for name, (unit, text, _) in words.items()}
        if body.speed_scale != 1.0:
            for name, rate in zip(("crank_rate", "swing_rate"), body.rates, strict=False):
                unit, text = found[name]
                found[name] = unit, f"{text}: {rate:.4g} of this leg"
        return found

    def scaling(self, scale: observation.Scale, body: OneLeg) -> str:
        """Return the formula of a scale, with limits and bounds of the leg."""
        if scale in observation.IN_RANGE:
            k = observation.IN_RANGE.index(scale)
            return observation.range_text(body.low[k], body.high[k])
        if scale in observation.IN_RATE:
            return observation.rate_text(body.filters.to_array()[observation.IN_RATE.index(scale), 1])
        return scale.text


class HorseTables(BodyTables):
    """Parts of the tables of a horse."""

    def actions(self, body: Horse) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Return the head and rows of the table of actions."""
        bounds = QUICK.to_array()[:, 1]
        rows: list[tuple[str, ...]] = []
        for k, span in enumerate(horse.SPANS):
            # The first action of a leg scales the crank's speed; see `horse_gaits.command_gait`.
            operation, unit = ("times 1 + action", "-") if k == 0 else ("plus", "rad")
            fastest = f"{bounds[k]:g} {GAIT[len(LIMITS) + k].unit}"
            numbers = self.places([ACTED * leg + k for leg in range(COUNT)])
            rows.append((numbers, GAIT[k].name, operation, f"{-span:g}", f"{span:g}", unit, fastest))
        return ("Num", "Offset of the reference's", "Is", "At -1", "At +1", "Unit", "Fastest change"), rows

    def name_of_any_leg(self, name: str) -> str:
        """Return the name of an observation without its leg's name."""
        return re.sub(rf"({'|'.join(LEGS).replace('_', ' ')})[:,] ", "", name)

    def settings(self, s: Settings, words: Words, body: Horse) -> dict[str, tuple[str, str]]:
        """Return the unit and meaning of the settings that a horse takes, by name."""
        # Some settings need a rigid hoof, or pushes.
        contexts = (s, replace(s, hoof_stiffness=None), replace(s, push_impulse=1.0))
        return {
            name: (unit, of_horse or text)
            for name, (unit, text, of_horse) in words.items()
            if name not in horse.LEG_ONLY_SETTINGS and any(has_effect(name, each) for each in contexts)
        }


TABLES: Mapping[Any, BodyTables] = MappingProxyType({OneLeg: LegTables(), Horse: HorseTables()})
"""Parts of tables by the class of a body."""


def tables_of_body(body: Body) -> BodyTables:
    """Return the parts of tables for a body: the parts of its class, or of the class that it inherits.

    Raises:
        ParameterError: a body of a user's class that inherits from no body of this package.
    """
    found = next((TABLES[kind] for kind in type(body).__mro__ if kind in TABLES), None)
    if found is None:
        known = " or ".join(kind.__name__ for kind in TABLES)
        raise ParameterError(f"manual: expected a body that inherits {known}, got {type(body).__name__}")
    return found


def has_effect(name: str, settings: Settings) -> bool:
    """True if a setting has an effect with one of the drives."""
    for drive in ("prescribed", "motor"):
        with suppress(ParameterError):
            check_effect(name, replace(settings, drive=drive))
            return True
    return False
