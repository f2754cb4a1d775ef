"""Contexts of episodes: each draws one of a fixed set of physical parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hoof_env.errors import ParameterError
from hoof_env.tasks.contexts import bounds_of, check_context_set, contexts_of
from hoof_env.tasks.parameters import check_parameters
from hoof_env.tasks.settings import ResolvedSettings


@dataclass(frozen=True)
class Contexts:
    """Contexts that episodes draw from, with equal chances.

    Attributes:
        known: parameters by name, for each context; empty without a `context_set`.
        bounds: lowest and highest value of each parameter in all sets of the split.
    """

    known: tuple[dict[str, float], ...]
    bounds: Mapping[str, tuple[float, float]]

    @classmethod
    def of(cls, s: ResolvedSettings, drawn: Mapping[str, Any]) -> Contexts:
        """Return the contexts from settings.

        Args:
            s: settings.
            drawn: parameters that `randomize` and a schedule set.

        Raises:
            ParameterError: an unknown set, or a parameter that is set elsewhere, too, or out of range.
        """
        chosen = check_context_set(s)
        if chosen is None:
            return cls((), {})
        bounds = bounds_of(chosen[0], s)
        if twice := sorted(set(bounds) & set(drawn)):
            raise ParameterError(
                f"context_set: {s.context_set!r} sets {', '.join(twice)}; expected none of these in randomize"
                " or schedule"
            )
        check_parameters("context_set", bounds, s)
        return cls(contexts_of(*chosen, s), bounds)

    def draw(self, generator: Any) -> dict[str, float]:
        """Return the parameters of a context that an episode draws; without contexts draw nothing."""
        return self.known[int(generator.integers(len(self.known)))] if self.known else {}
