"""Physical parameters that episodes draw: of `randomize`, of a schedule, of contexts and of a reset's
options; with the check that the engine's substeps suit all of them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from hoof_env.constants import GRAVITY
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Mechanics
from hoof_env.dynamics.step_length import StepLength
from hoof_env.episodes.contexts import Contexts
from hoof_env.episodes.rows import Rows
from hoof_env.errors import ParameterError
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.profile import leg_profile
from hoof_env.tasks.body import Body
from hoof_env.tasks.parameters import draw_parameters, extremes
from hoof_env.tasks.schedules import Ramp, drawn_names
from hoof_env.tasks.settings import ResolvedSettings

Parameters = Mapping[str, float | tuple[float, float]]


class Randomization:
    """Physical parameters of episodes.

    Attributes:
        ranges: numbers, or ranges to draw from, by name, of `randomize`, and of a schedule and of contexts,
            there with all values that they ever take.
        ramps: ramps of scheduled parameters by name.
        contexts: sets of parameters of which an episode draws one.

    Args:
        s: settings.
        body: body.
        terrain: ground.
        given: ranges of the setting `randomize`.
        schedule: ramps of all scheduled settings.
        contexts: contexts.
    """

    def __init__(
        self,
        s: ResolvedSettings,
        body: Body,
        terrain: Terrain,
        given: Parameters,
        schedule: Mapping[str, Ramp],
        contexts: Contexts,
    ) -> None:
        self._settings = s
        self._body = body
        self._terrain = terrain
        self.ramps = {name: schedule[name] for name in drawn_names(schedule)}
        ramps = {name: ramp.bounds for name, ramp in self.ramps.items()}
        self.ranges: Parameters = {**given, **ramps, **contexts.bounds}
        self.contexts = contexts
        self._last_checked = ""

    def substeps(self) -> int | None:
        """Return the number of substeps of `sim_dt` that all parameters need; None if there are none, so that
        the engine chooses. All episodes have the same: rows with different numbers cannot run side by side.

        Raises:
            ParameterError: a parameter, or a combination of them, is out of range.
        """
        if not self.ranges:
            return None
        most = self.substeps_under({}, None)
        with self._naming(self.ranges):
            return max([most, *(self.substeps_under(corner, None) for corner in extremes(self.ranges))])

    def substeps_under(self, changes: Mapping[str, float], asked: int | None) -> int:
        """Return the number of substeps of `sim_dt` with some settings changed.

        Args:
            changes: changed settings by name.
            asked: number of substeps; None for as many as are needed. With a number that is too low there is
                a warning; see `StepLength.choose`.

        Raises:
            ParameterError: a changed setting is out of range.
        """
        s = self._with(changes)
        trunk, ground, limbs = self._body.parts(s)
        profiles = [leg_profile(limb.geometry) for limb in limbs]
        mechanics = Mechanics(
            limbs, profiles, trunk, ground, self._terrain, s.integrator, step_error=self._body.step_error
        )
        return StepLength(mechanics).choose(s.sim_dt, asked, stacklevel=5)

    def _with(self, changes: Mapping[str, Any]) -> ResolvedSettings:
        """Return the settings with changes."""
        return replace(self._settings, **dict(changes))

    def check(self, of_options: Parameters, substeps: int) -> None:
        """Check everything that can be drawn, with the parameters of a reset's options; warn if it needs
        more substeps than the engine has.

        Raises:
            ParameterError: a parameter, or a combination of them, is out of range.
        """
        if of_options and self._settings.solver == "paper":
            raise ParameterError(
                f"options['parameters']: expected none with solver=\"paper\", got {of_options!r}"
            )
        parameters = {**self.ranges, **of_options}
        # The last ones are remembered: learners pass the same options at every reset.
        if parameters and self._last_checked != (words := repr(parameters)):
            with self._naming(parameters):
                for corner in extremes(parameters):
                    self.substeps_under(corner, substeps)
            self._last_checked = words

    def fits(self, parameters: Mapping[str, float], engine: TrunkEngine) -> bool:
        """True if an engine can run with other parameters without shorter substeps.

        Raises:
            ParameterError: a parameter is out of range.
        """
        return engine.in_kernels and self.substeps_under(parameters, None) <= engine.substeps

    @contextmanager
    def _naming(self, parameters: Parameters) -> Iterator[None]:
        """Name in an error the settings or options that its parameters come from.

        Raises:
            ParameterError: the error, named.
        """
        try:
            yield
        except ParameterError as error:
            sources: dict[str, Iterable[str]] = {
                "randomize": self._settings.randomize or (),
                "schedule": self.ramps,
                "context_set": self.contexts.bounds,
                "options['parameters']": [n for n in parameters if parameters[n] != self.ranges.get(n)],
            }
            named = set(re.findall(r"\w+", str(error)))
            given = [source for source, names in sources.items() if names]
            at_fault = [source for source in given if named & {*sources[source]}]
            raise ParameterError(f"{' and '.join(at_fault or given)}: {error}") from None

    def draw(
        self, rows: Rows, env: int, generator: Any, of_options: Parameters, engine: TrunkEngine
    ) -> dict[str, float]:
        """Draw the parameters of an episode that starts, and put them into the engine; return them by name.

        Args:
            rows: rows of the batch.
            env: row that starts.
            generator: its generator.
            of_options: parameters of the reset's options, which take precedence.
            engine: engine of the batch.
        """
        parameters = {**self.ranges, **self.contexts.draw(generator), **of_options}
        for name, ramp in self.ramps.items():
            if name not in of_options:
                low, high = map(float, ramp.range_at(rows.steps_before[env]))
                parameters[name] = (low, high) if ramp.is_range else low
        values = draw_parameters(parameters, generator)
        self.put(rows, env, values, engine)
        return values

    def put(self, rows: Rows, env: int, values: Mapping[str, float], engine: TrunkEngine) -> None:
        """Give one row physical parameters by name, and the settings' values of the rest."""
        trunk, ground, limbs = self._body.parts(self._with(values))
        engine.vary(env, trunk, ground, limbs=limbs)
        mass = trunk.mass + sum(limb.geometry.mass for limb in limbs)
        rows.named.weight[env] = mass * GRAVITY
