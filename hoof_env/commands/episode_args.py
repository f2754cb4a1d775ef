"""Arguments of commands that play an episode."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import arg


@dataclass(frozen=True)
class Episode:
    """Policy, environment and seed of an episode that a command plays."""

    policy: str | None = None
    """a gait of the preset, or four gait parameters as 6.28,0.7,-0.2,-0.3, in which the episode starts; idle,
    random, bang-bang, drag or airborne; the .json of an open-loop gait, to which the policy goes, or
    open-loop for the best one of the package; or a trained model (only one that you trust: a model is code).
    The default is run, the reference gait of a horse, or zero actions where a task has a start gait."""
    env_id: str = "hoof_env/HorseLeg-v0"
    """id of the environment."""
    env_kwargs: tuple[str, ...] = ()
    """arguments of the environment: key=value ..., or one JSON object."""
    seed: int = 0
    """seed of the first episode and of "random"; others follow it."""


Played = Annotated[Episode, arg(name="")]
"""Parameter of a command whose fields are options of their own."""

USUAL = Episode()
"""Episode that is played where no option says otherwise."""
