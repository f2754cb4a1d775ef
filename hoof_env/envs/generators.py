"""Generators and their states; a vector environment seeds its generators as Gymnasium's `SyncVectorEnv`
does."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding

from hoof_env.errors import ParameterError, all_of, count

UNKNOWN_SEED = -1
"""Gymnasium's value for a generator of unknown seed."""

# Asking the system for entropy takes as long as a step.
ANY_SEED = np.random.SeedSequence(0)
"""Seed of generators that get a state at once."""


BIT_GENERATORS: dict[str, Any] = {
    kind.__name__: kind
    for kind in (
        np.random.PCG64,
        np.random.PCG64DXSM,
        np.random.Philox,
        np.random.SFC64,
        np.random.MT19937,
    )
}
"""NumPy's bit generators by name, of which states can be restored. Gymnasium makes a PCG64."""


def state_of(generator: np.random.Generator) -> Any:
    """Return the state of a generator.

    Raises:
        ParameterError: its bit generator is not one of NumPy's, so that `generator_of` could not restore it.
    """
    state = generator.bit_generator.state
    if type(generator.bit_generator).__name__ not in BIT_GENERATORS:
        raise ParameterError(
            f"np_random: expected a generator with one of {', '.join(BIT_GENERATORS)}, whose states can be"
            f" restored, got {type(generator.bit_generator).__name__}"
        )
    return state


def generator_of(state: Any) -> np.random.Generator:
    """Make a generator from a state of `state_of`.

    Raises:
        ParameterError: `state` is not such a state.
    """
    try:
        generator = np.random.Generator(BIT_GENERATORS[state["bit_generator"]](ANY_SEED))
        generator.bit_generator.state = state
    except (TypeError, ValueError, KeyError, AttributeError):
        raise ParameterError(
            f"state['generator']: expected the state of a {' or '.join(BIT_GENERATORS)}, got {state!r:.80}"
        ) from None
    return generator


class Generators:
    """Generators of `num_envs` rows. There are none before the first seed, or the first use of `all`.

    Attributes:
        seeds: seed of each generator, `UNKNOWN_SEED` if the generator was assigned or restored from a state.
    """

    def __init__(self, num_envs: int) -> None:
        self.num_envs = num_envs
        self.seeds: list[int] = []
        self._each: list[np.random.Generator] = []

    def __getitem__(self, env: int) -> np.random.Generator:
        return self._each[env]

    def __len__(self) -> int:
        return len(self._each)

    @property
    def all(self) -> tuple[np.random.Generator, ...]:
        """Generator of each row."""
        if not self._each:
            self._new([None] * self.num_envs)
        return tuple(self._each)

    def assign(self, given: Any) -> None:
        """Take a generator for each row; one generator seeds all rows.

        Raises:
            ParameterError: neither a generator nor one for each row.
        """
        if isinstance(given, np.random.Generator):
            self._new(given.integers(2**63, size=self.num_envs).tolist())
        elif not isinstance(given, (list, tuple)) or len(given) != self.num_envs:
            raise ParameterError(
                f"np_random: expected a generator, or a list of {self.num_envs}, got {given!r:.80}"
            )
        else:
            self._each = list(all_of("np_random", given, np.random.Generator))
        self.seeds = [UNKNOWN_SEED] * self.num_envs

    def seed(self, given: Any, rows: Iterable[int]) -> list[int]:
        """Seed the generators of some rows; return the rows that have a new generator.

        Args:
            given: seed of the first row, of which the i-th has `given + i`; a seed for each row; or None.
            rows: the rows. The first call also seeds the rest, so that all have a generator.

        Raises:
            ParameterError: a bad seed; nothing has changed then.
        """
        n = self.num_envs
        if isinstance(given, (list, tuple, np.ndarray)):
            if len(given) != n:
                raise ParameterError(f"seed: expected one number or {n}, got {len(given)}")
            seeds = [None if value is None else count("seed", value, low=0) for value in given]
        else:
            seeds = [None if given is None else count("seed", given, low=0) + env for env in range(n)]
        if not self._each:
            self._new(seeds)
            return []
        seeded = [env for env in rows if seeds[env] is not None]
        for env in seeded:
            self._each[env], self.seeds[env] = seeding.np_random(seeds[env])
        return seeded

    def _new(self, seeds: Sequence[int | None]) -> None:
        """Make a generator for each row, from entropy for a seed of None."""
        pairs = [seeding.np_random(seed) for seed in seeds]
        self._each = [generator for generator, _ in pairs]
        self.seeds = [seed for _, seed in pairs]

    def states(self) -> list[Any]:
        """Return the states of all generators."""
        return [state_of(generator) for generator in self._each]
