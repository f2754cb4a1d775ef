"""N legs on one trunk in minimal coordinates, for any number of environments at once: the fast, exact engine.

Only what can move freely is integrated: the trunk, as momentum and centre of mass of all bodies together,
and the crank of every leg that has a motor. Everything inside a leg follows from its crank angle in closed
form, so the loops of the linkage are closed to round-off at every step. `mechanics` has the equations,
`advance` runs them; this module checks arguments and keeps the state. Results have the same bits alone and in
a batch of any size.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any

from numpy.typing import ArrayLike

from hoof_env.constants import GRAVITY
from hoof_env.dynamics import layout, memory
from hoof_env.dynamics.advance import LANES, ONE_BY_ONE, RESET_REQUESTED, SIDE_BY_SIDE
from hoof_env.dynamics.engine_motion import MOST_STEPS, EngineMotion
from hoof_env.dynamics.parts import (
    Limb,
    Limits,
    Trunk,
)
from hoof_env.dynamics.step_length import StepLength
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.errors import (
    Floats,
    ParameterError,
    all_of,
    check_choice,
    check_number,
    count,
    flag,
    one_of,
)
from hoof_env.gait import MOST_HARMONICS, FilterSettings, GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.profile import leg_profile
from hoof_env.simd.threads import blocks, check_threads, limit_threads
from hoof_env.simd.user_functions import check_function

HEIGHT = layout.TrunkSettings.fields["height"].start
"""Row of a trunk's height at rest among its settings."""

MAX_SCALAR_ENVS = 6
"""Largest number of environments of one leg or of four that are run one by one: eight lanes would be mostly
empty."""

MOST_LEGS = 32
"""Largest number of legs: kernels work on the stack, where a leg takes 15 kB with eight lanes."""


class TrunkEngine(EngineMotion):
    """Legs on a trunk over the ground; see the module docstring.

    Args:
        limbs: the legs in their places, at most `MOST_LEGS`; arrays have them in this order.
        trunk: trunk that holds the legs. Its height is that of its centre of mass.
        ground: laws of contact. Its exponent must be a multiple of 1/8, so that square roots are enough.
        terrain: heights, and where the ground is softer or more slippery; level if None.
        sim_dt: length of a step [s], after which results can be read.
        integrator: one of `stepping.SCHEMES`.
        substeps: number of substeps of `sim_dt`; contacts are remembered after each. None chooses as many as
            ground, motors and support need, up to `step_length.MOST_SUBSTEPS`.
        step_error: error of the state after a contact [-] for which that choice is made.
        num_envs: number of environments side by side, which share all of the above.
        num_threads: number of threads that share the environments; it changes no bit.
        harmonics: order of the swing law, 1 to `gait.MOST_HARMONICS`: gaits and commands have 2 + 2 harmonics
            numbers.
        filters: bounds of the command filters; `gait.QUICK` where the crank's speed changes within a stride.
        reactions: true to compute the joint reactions of every step; `reactions()` has those of the last.
        strides: true to count stances, peak forces and work; `strides` has them.
        limits: where the motion should end, see `parts.Result`. An engine with limits, if only `Limits()`,
            takes legs of other sizes in `vary`, and its `strides` have horizontal impulses.
        contact_law: law of the normal force instead of the ground's, see `hoof.contact_force`.

    Attributes:
        runs_scalar: true if environments are run one by one in one thread, not side by side.
        blocks: columns of the memory that each thread works on.
        step_limits: longest step [s] for each cause, see `step_length`. The limit of friction is reported and
            not used, because nothing diverges beyond it: on the ground of `HorseLeg-v0` it is 0.14 ms for a
            horse of 349 kg. There forces at 1 ms agree with those at 16 us to 1 % under hooves that slide;
            under hooves that stand friction is off by 2.7 times its size and the normal force by half, at 0.5
            ms by 0.4 % and 0.1 %. For clean forces at rest use `substeps` of sim_dt /
            step_limits["friction"], or a larger `friction_fast`.

    Raises:
        ParameterError: a value is out of range or of the wrong type; or, at the first reset, the contact law
            cannot be part of a kernel.
        GeometryError: a leg has no place for its links at any crank angle.

    Warns:
        StepWarning: `substeps` is given and too small, or more would be needed than are chosen.
    """

    def __init__(
        self,
        limbs: Limb | Sequence[Limb],
        trunk: Trunk,
        ground: Ground | None = None,
        terrain: Terrain | None = None,
        *,
        sim_dt: float = 1e-3,
        integrator: str = "midpoint",
        substeps: int | None = None,
        step_error: float = 0.01,
        num_envs: int = 1,
        num_threads: int = 1,
        harmonics: int = 1,
        filters: FilterSettings | None = None,
        reactions: bool = False,
        strides: bool = False,
        limits: Limits | None = None,
        contact_law: Callable[..., Any] | None = None,
    ) -> None:
        if contact_law is not None:
            check_function("contact_law", contact_law, 4)
        self.contact_law = contact_law
        self.limbs = all_of("limbs", limbs, Limb)
        if len(self.limbs) > MOST_LEGS:
            raise ParameterError(f"limbs: expected at most {MOST_LEGS}, got {len(self.limbs)}")
        self.trunk = one_of("trunk", trunk, Trunk)
        self.motion_limits = None if limits is None else one_of("limits", limits, Limits)
        order = count("harmonics", harmonics, most=MOST_HARMONICS)
        self.reacts = flag("reactions", reactions)
        self.features = memory.features_of(self.limbs, order, limits is not None, self.reacts)
        memory.check_limbs(self.trunk, self.limbs, self.features.springs)
        if contact_law is not None and self.features.springs:
            raise ParameterError(
                "contact_law: expected none beside springs of the hoofs, whose speed follows from a law that "
                f"is linear in it, got {contact_law!r}"
            )
        self.ground = Ground() if ground is None else one_of("ground", ground, Ground)
        self.terrain = Terrain.flat() if terrain is None else one_of("terrain", terrain, Terrain)
        self.filters = FilterSettings() if filters is None else one_of("filters", filters, FilterSettings)
        self.integrator = check_choice("integrator", integrator, SCHEMES)
        self.sim_dt = check_number("sim_dt", sim_dt, low=1e-7, high=self.filters.longest_step)
        self.num_envs = count("num_envs", num_envs)
        self.num_threads = check_threads(num_threads)
        self.profiles = [leg_profile(limb.geometry) for limb in self.limbs]
        self.step_error = check_number("step_error", step_error, low=0, high=1, exclusive_low=True)
        length = StepLength(
            self.limbs,
            self.profiles,
            self.trunk,
            self.ground,
            self.terrain,
            self.integrator,
            step_error=self.step_error,
        )
        self.step_limits = length.limits
        asked = None if substeps is None else count("substeps", substeps, most=MOST_STEPS)
        self.substeps = length.choose(self.sim_dt, asked)
        self.counts_strides = flag("strides", strides)
        self._allocate()

    def _allocate(self) -> None:
        """Find the kernel, and make the memory of all environments."""
        self.runs_scalar = len(self.limbs) in ONE_BY_ONE and self.num_envs <= MAX_SCALAR_ENVS
        columns = self.num_envs if self.runs_scalar else memory.columns_for(self.num_envs)
        self.blocks = [range(columns)] if self.runs_scalar else blocks(columns, LANES, self.num_threads)
        self._memory = memory.new_memory(self, self.num_envs, columns, self.reacts)
        self._model = memory.new_model(self, self.filters, self.counts_strides)
        self._arrangement = ONE_BY_ONE[len(self.limbs)] if self.runs_scalar else SIDE_BY_SIDE
        self._calls = None

    def __repr__(self) -> str:
        legs = f"{len(self.limbs)} leg{'s' * (len(self.limbs) > 1)}"
        masses = f"{self.total_mass:.1f} kg"
        return f"<TrunkEngine {self.trunk.kind}, {legs}, {masses}, {self.num_envs} environments>"

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes of a copy, which has memory of its own even if it is shallow."""
        m = self._memory
        # kernels are left out: the copy finds them, perhaps in another process
        parts = {**vars(self), "_calls": None}
        return {
            **parts,
            "_memory": (m.data, self.num_envs, m.constants, m.reactions.copy(), m.features),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        data, *others = state["_memory"]
        vars(self).update(state, _memory=memory.memory_of(memory.copy_of(data), *others))
        # a pickle may have come from a machine with more processors
        self.num_threads = limit_threads(self.num_threads)

    def __deepcopy__(self, memo: Any) -> TrunkEngine:
        """Return a copy that shares what never changes, such as the legs' tables."""
        return copy.copy(self)

    # Properties

    @property
    def total_mass(self) -> float:
        """Mass of trunk and legs [kg]."""
        return self.trunk.mass + sum(limb.geometry.mass for limb in self.limbs)

    @property
    def weight(self) -> float:
        """Weight of trunk and legs [N]."""
        return self.total_mass * GRAVITY

    # Arguments of the kernels, for callers with kernels of their own

    def alone(self) -> TrunkEngine:
        """Return a new engine like this one for one environment."""
        return TrunkEngine(
            self.limbs,
            self.trunk,
            self.ground,
            self.terrain,
            sim_dt=self.sim_dt,
            integrator=self.integrator,
            substeps=self.substeps,
            step_error=self.step_error,
            harmonics=self.features.harmonics,
            filters=self.filters,
            reactions=self.reacts,
            strides=self.counts_strides,
            limits=self.motion_limits,
            contact_law=self.contact_law,
        )

    # State

    def reset(
        self,
        gaits: GaitParameters | Sequence[GaitParameters] | Floats,
        crank_angle: ArrayLike = 0.0,
        *,
        x: ArrayLike = 0.0,
        y: ArrayLike | None = None,
        pitch: ArrayLike = 0.0,
        vx: ArrayLike = 0.0,
        vy: ArrayLike = 0.0,
        pitch_rate: ArrayLike = 0.0,
        crank_angle_rate: ArrayLike | None = None,
        envs: ArrayLike | None = None,
    ) -> None:
        """Start environments with their filters at rest at a gait.

        A hoof point that starts inside the ground is taken to have entered it at its present rate.

        Args:
            gaits: gait parameters, one set for all legs or one for each; or an array of shape (legs, 2 + 2
                harmonics, n).
            crank_angle: crank angles [rad], of shape (), (legs,) or (legs, n), where n is the number of
                environments that start.
            x, y, pitch, vx, vy, pitch_rate: place, pitch, velocity and pitch rate of the trunk's centre of
                mass [m, rad, s], shape () or (n,); a `y` of None is the trunk's height.
            crank_angle_rate: speeds of motor-driven cranks [rad/s], shaped as `crank_angle`; None is the
                commanded speed.
            envs: environments that start, as indices or as a mask of shape (num_envs,); None is all.

        Raises:
            ParameterError: a value is not finite, of the wrong shape or forbidden by the trunk's kind, an
                angle, place or rate is beyond `layout.MAX_STATE`, or a leg's links have no place there.
        """
        where = memory.which(envs, self.num_envs)
        m = self._memory
        n = where.size
        values = memory.gaits_of(gaits, len(self.limbs), n, self.features.harmonics)
        heights = m.trunk_settings[HEIGHT, where]
        height = heights if y is None else y
        trunk = {"x": x, "y": height, "pitch": pitch, "vx": vx, "vy": vy, "pitch_rate": pitch_rate}
        m.trunk[:, where], m.limbs[:, :, where] = memory.start(
            self, values, crank_angle, crank_angle_rate, trunk, heights
        )
        m.command[:, :, where] = values
        m.account[:, where] = 0.0
        m.strides[:, :, where] = 0.0
        m.result[where] = RESET_REQUESTED
        self._go(-1)
