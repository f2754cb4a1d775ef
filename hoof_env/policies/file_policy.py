"""Policies that are played from their files alone: what all formats share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from hoof_env._display import line_of
from hoof_env.errors import ParameterError
from hoof_env.policies.record import check_record


class FilePolicy(ABC):
    """Deterministic policy in a file, with Stable-Baselines3's `predict`.

    Attributes:
        path: the file, or the folder of its files.
        record: the policy's record: env_id, algo, settings, spaces and more, as far as the file has them.

    Args:
        path: the file or folder.
    """

    record: dict[str, Any]

    def __init__(self, path: Path) -> None:
        self.path = path
        self.record = {}

    def __repr__(self) -> str:
        env_id = self.record.get("env_id")
        return line_of(type(self).__name__, path=self.path, env_id=env_id, algo=self.record.get("algo"))

    def load(self, env: Any, env_id: str) -> Self:
        """Return this policy; raise `DataFileError` if it does not fit `env`, and warn if it was trained with
        other settings or another version of hoof-env."""
        check_record(self.path, self.record, env, env_id)
        return self

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[NDArray[np.float32], Any]:
        """Return deterministic actions, shape (..., n), for observations of shape (..., k), and `state`.

        Raises:
            ParameterError: observations that are no numbers, or of another size.
        """
        try:
            numbers = np.asarray(observation, self.number)
        except (TypeError, ValueError):
            raise ParameterError(
                f"observation: expected numbers for the policy {self.path.name}, got {observation!r:.100}"
            ) from None
        if self.size is not None and numbers.shape[-1:] != (self.size,):
            raise ParameterError(
                f"observation: expected shape (..., {self.size}) as the policy {self.path.name} takes, got"
                f" {numbers.shape}"
            )
        return self.act(numbers), state

    @property
    @abstractmethod
    def number(self) -> type[np.floating[Any]]:
        """Type of the numbers in observations that the policy takes."""

    @property
    @abstractmethod
    def size(self) -> int | None:
        """Length of an observation; None if the file does not say it."""

    @abstractmethod
    def act(self, observations: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
        """Return the actions, shape (..., n), for observations of shape (..., `size`)."""
