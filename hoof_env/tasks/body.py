"""Interface of bodies: one leg under a trunk (`one_leg.OneLeg`), or a horse (`horse.Horse`).

Environments know bodies by this interface alone. A body defines the meaning of actions, the starts of
episodes, the parts of its engine, and its own functions in the kernels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Limits, Trunk
from hoof_env.gait import FilterSettings
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import Geometry
from hoof_env.record.surroundings import Hips
from hoof_env.tasks.leg_starts import Start
from hoof_env.tasks.settings import ResolvedSettings, Settings

Floats = NDArray[np.float64]


class BodyKernels(NamedTuple):
    """Parts of the kernels of a step that are a body's own. Bodies with equal parts share their kernels.

    Attributes:
        legs: number of legs.
        episode: layout of an episode's memory, `episode.Episode` or a subclass with more fields.
        task_fields: further fields of the task's record, in the form that `numpy.dtype` takes.
        scratch_size: size of the scratch memory that `command` needs for each row, in numbers.
        command: inlined function of task, actions, episode, first leg, number of gait parameters, row n and
            scratch memory, which turns the actions of row n into commands.
        on_switch: inlined function of task, episode and the mask of rows in which another speed is commanded.
    """

    # Functions and plain values only: kernels are cached under the hash of this tuple.
    legs: int
    episode: Any
    task_fields: tuple[Any, ...]
    scratch_size: int
    command: Callable[..., None]
    on_switch: Callable[..., None]


class Body(Protocol):
    """Trunk on one leg or several.

    Attributes:
        kernels: parts of the kernels of a step; see `BodyKernels`.
        geometry: geometry of a leg; all legs have the same linkage.
        height: nominal height of the trunk [m].
        hips: crank centre of each leg from the place of the trunk [m], by the prefix of the leg's quantities,
            which is "" for a single leg.
        picture: kind of its picture, a key of `render.picture.PICTURES`.
        gaits: gaits by name.
        policy_starts: reset options of the scripted policies that are zero actions in a stored gait at its
            own speed, by name.
        harmonics, filters, limits, step_error: arguments of the engine.
        command_step: largest change from one commanded speed to the next [m/s].
        start_names, gait_names: names of the numbers with which infos describe an episode's start.
        action_names: names of the actions, leg after leg.
        renamed: names of entries of the observation, by the task's names for them, that under the body's
            settings measure another quantity.
        action_form: tag of the meaning of actions, "rates", or of a horse offsets and their spans.
    """

    # Fixed when a body is made: settings that change later (`row_plans.CHANGEABLE`) do not affect them.
    kernels: BodyKernels
    geometry: Geometry
    height: float
    hips: Hips
    picture: str
    gaits: Mapping[str, Any]
    policy_starts: Mapping[str, dict[str, Any]]
    harmonics: int
    filters: FilterSettings
    limits: Limits | None
    step_error: float
    command_step: float
    start_names: tuple[str, ...]
    gait_names: tuple[str, ...]
    action_names: tuple[str, ...]
    action_form: str
    renamed: Mapping[str, str]

    @property
    def policy_names(self) -> list[str]:
        """Names of the scripted policies."""

    def parts(self, s: ResolvedSettings) -> tuple[Trunk, Ground, tuple[Limb, ...]]:
        """Make trunk, ground and legs from settings of `parameters.resolved`."""

    def scale_of(self, name: str) -> float:
        """Return the ratio of the body's own value of a setting to the setting's value, 1 for most."""

    def commanded_speeds(self, s: Settings) -> tuple[float, float] | None:
        """Return the lowest and highest commanded speed [m/s]; None if no speed is commanded."""

    def constants(self, engine: TrunkEngine, dt: float) -> dict[str, Any]:
        """Return the body's part of the task's record by field, for a control step of `dt` [s]."""

    def check_options(self, options: Any, trunk: Trunk, settings: Settings) -> dict[str, Any]:
        """Check reset options; return them with numbers and gaits converted.

        Raises:
            ParameterError: an unknown option or a bad value.
        """

    def startable_share(self, options: Mapping[str, Any], trunk: Trunk) -> float:
        """Return at what share of the crank angles of checked options an episode can start: raised out of
        level ground, the trunk is still below the height at which an episode fails [-]."""

    def draw(
        self, options: Mapping[str, Any], generators: Sequence[np.random.Generator], engine: TrunkEngine
    ) -> Start:
        """Draw starts of episodes, one for each generator, except for values that the options set."""

    def complete_start(
        self, start: Start, targets: Floats, options: Mapping[str, Any], engine: TrunkEngine
    ) -> None:
        """Complete starts with values that depend on the commanded speeds [m/s], shape (n,)."""

    def begin_episodes(
        self, episode: Mapping[str, Any] | Any, which: NDArray[np.int64], start: Start
    ) -> None:
        """Write the body's own fields of the episodes' memory, in the rows `which`."""

    def action_for(self, gaits: Any, engine: TrunkEngine, dt: float) -> NDArray[np.float32]:
        """Return the actions that move towards gaits; see `LegBase.action_for`."""
