"""Properties of the single and the vector environment that follow from their settings."""

from __future__ import annotations

from typing import Any

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.envs.batch import EpisodeBatch
from hoof_env.envs.shown import html_table, line_of
from hoof_env.gait import GaitParameters
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import Geometry


class LegProperties:
    """Leg, engine, ground and names of an environment.

    Attributes:
        batch: episodes, a batch of one in the single environment.
    """

    batch: EpisodeBatch

    def __repr__(self) -> str:
        return line_of(type(self).__name__, id=self.batch.task.id, environments=self.batch.num_envs)

    def _repr_html_(self) -> str:
        """Return what is observed and what actions do, as a table."""
        both = [("observation", *pair) for pair in zip(self.batch.names, self.observation_units, strict=True)]
        both += [("action", name, "-1 to 1") for name in self.action_names]
        return html_table(
            ("space", "entry", "unit"), both, f"{self.batch.task.id}: {self.batch.task.summary}"
        )

    @property
    def geometry(self) -> Geometry:
        """Geometry of a leg."""
        return self.batch.body.geometry

    @property
    def gaits(self) -> dict[str, GaitParameters]:
        """Gaits of the preset by name; of a horse they are `HorseGait`s."""
        of_body: Any = self.batch.body.gaits
        gaits: dict[str, GaitParameters] = of_body
        return gaits

    @property
    def engine(self) -> TrunkEngine:
        """Engine that simulates all environments."""
        return self.batch.engine

    @property
    def terrain(self) -> Terrain:
        """Terrain under the legs."""
        return self.batch.engine.terrain

    @property
    def dt(self) -> float:
        """Control step [s]."""
        return self.batch.dt

    @property
    def sim_dt(self) -> float:
        """Substep of the settings [s], which the engine may divide."""
        return self.batch.settings.sim_dt

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the observation's entries, in order."""
        return tuple(self.batch.names)

    @property
    def action_names(self) -> tuple[str, ...]:
        """Names of the actions; a horse's carry the leg as prefix."""
        return self.batch.action_names

    @property
    def observation_units(self) -> tuple[str, ...]:
        """Units of `raw_observation`, in the order of its names."""
        return tuple(entry.unit for entry in self.batch.entries)

    @property
    def action_form(self) -> str:
        """Meaning of actions: "rates" of the gait parameters of one leg, offsets from a horse's
        gait and their spans, as in "offsets of 0.4 and 0.04 rad", or the form of a map of one's own.
        States and files of policies contain it, so that those of another form are refused."""
        return self.batch.action_form
