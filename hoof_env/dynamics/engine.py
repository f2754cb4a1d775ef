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

import numpy as np
from numba.core.errors import NumbaError
from numpy.typing import ArrayLike, NDArray

from hoof_env.constants import GRAVITY
from hoof_env.dynamics import engine_states, layout, memory
from hoof_env.dynamics.advance import BY_LEGS, LANES, RESET_REQUESTED, advance_kernels
from hoof_env.dynamics.engine_memory import EngineMemory
from hoof_env.dynamics.layout import Features
from hoof_env.dynamics.limits import CHECK_EVERY
from hoof_env.dynamics.names import NamedColumns
from hoof_env.dynamics.parts import (
    Limb,
    Limits,
    Trunk,
    broken,
)
from hoof_env.dynamics.step_length import StepLength
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.errors import (
    Floats,
    NotStartedError,
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
from hoof_env.simd.threads import blocks, check_threads, limit_threads, run_together
from hoof_env.simd.user_functions import check_function, what_cannot_be_compiled

HEIGHT = layout.TrunkSettings.fields["height"].start
"""Row of a trunk's height at rest among its settings."""

MAX_SCALAR_ENVS = 6
"""Largest number of environments of one leg or of four that are run one by one: eight lanes would be mostly
empty."""

MOST_LEGS = 32
"""Largest number of legs: kernels work on the stack, where a leg takes 15 kB with eight lanes."""

MOST_STEPS = 10**12
"""Largest number of substeps of a call: they are counted in 64 bits."""

PART = 2_000_000
"""Number of substeps, those of all legs added up, that a long call runs in machine code at a time: at most
about a second. Ctrl-C takes effect between two parts. Sums have other last digits than in one part."""

LEAST_PART = 1000
"""Least number of substeps of each environment in such a part."""


class TrunkEngine(EngineMemory):
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
        contact_law: law of the normal force instead of the ground's, see `hoof.law_of`.

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
            cannot be compiled.
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
        springs = self.limbs[0].spring is not None
        order = count("harmonics", harmonics, most=MOST_HARMONICS)
        self.features = Features(order, springs, has_limits=limits is not None)
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
        self.reacts = flag("reactions", reactions)
        self.counts_strides = flag("strides", strides)
        self.runs_scalar = len(self.limbs) in BY_LEGS and self.num_envs <= MAX_SCALAR_ENVS
        self._choose_kernel()
        columns = self.num_envs if self.runs_scalar else memory.columns_for(self.num_envs)
        self.blocks = [range(columns)] if self.runs_scalar else blocks(columns, LANES, self.num_threads)
        self._memory = memory.new_memory(self, self.num_envs, columns, self.reacts)
        self._model = memory.new_model(self, self.filters, self.counts_strides)

    def _choose_kernel(self) -> None:
        which = BY_LEGS[len(self.limbs)] if self.runs_scalar else "batch"
        does = "react" if self.reacts else "advance"
        self._run = getattr(advance_kernels(self.contact_law, self.features), f"{does}_{which}")

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes of a copy, which has memory of its own even if it is shallow."""
        m = self._memory
        # the kernel is left out: the copy looks it up, perhaps in another process
        parts = {name: part for name, part in vars(self).items() if name != "_run"}
        return {
            **parts,
            "_memory": (m.data, self.num_envs, m.constants, m.reactions.copy(), m.features),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        data, *others = state["_memory"]
        vars(self).update(state, _memory=memory.memory_of(memory.copy_of(data), *others))
        # a pickle may have come from a machine with more processors
        self.num_threads = limit_threads(self.num_threads)
        self._choose_kernel()

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

    @property
    def substep(self) -> float:
        """Length of a substep [s]."""
        return self.sim_dt / self.substeps

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

    # Motion

    def advance(
        self, command: ArrayLike | None = None, steps: int = 1, *, account: bool = True
    ) -> NDArray[np.int64]:
        """Advance by `steps` of `sim_dt` under a command.

        Args:
            command: gait parameters as `command` takes them, for all environments; None keeps the last.
            steps: number of steps; 0 evaluates forces and accelerations at the present state.
            account: true to update `account`.

        Returns:
            Results of the environments, values of `parts.Result`, shape (num_envs,). An environment that
            could not be simulated has its state and its report from before this call.

        Raises:
            ParameterError: the command has a wrong shape or is not finite.
            NotStartedError: no environment was ever reset.
            KeyboardInterrupt: Ctrl-C during a long call, which then ends after a part of the steps.
        """
        steps = count("steps", steps, 0, MOST_STEPS // self.substeps)
        if command is not None:
            self.command(command)
        self._go_on(steps, account)
        if self._memory.result.any():
            if np.isnan(self._memory.trunk).all():
                raise NotStartedError("the engine was asked to move before reset(): expected reset() first")
            if steps:
                self.observe()
        return self._memory.result.astype(np.int64)

    def run(
        self,
        command: ArrayLike | None = None,
        steps: int = 1,
        every: int = 1,
        *,
        continue_past_limits: bool = False,
    ) -> dict[str, NDArray[Any]]:
        """Advance and record `state` and `report` at the start and after each `every` steps, for plots.

        Args:
            command, steps: as in `advance`.
            every: number of steps from one instant of the record to the next.
            continue_past_limits: true to continue beyond a limit, as `advance` does.

        Returns:
            Arrays by name, time on the first axis, and "result", values of `parts.Result`, shape (num_envs,).
            Once an environment does not end OK all stop, and the record ends there: with the instant where a
            limit was passed, without one that could not be simulated.

        Raises:
            ParameterError, NotStartedError: as `advance`.
        """
        steps = count("steps", steps, low=0)
        every = count("every", every)
        self.advance(command, 0)
        m = self._memory
        times = 1 + -(-steps // every)
        whole = np.empty((*m.data.shape, times))
        whole[..., 0] = m.data
        for k in range(1, times):
            self._go(min(every, steps - (k - 1) * every), True)
            if lost := broken(m.result).any():
                self.observe()
            whole[..., k] = m.data
            if lost or (m.result.any() and not continue_past_limits):
                times = k if lost else k + 1
                break
        kept = memory.memory_of(whole[..., :times], self.num_envs, m.constants, m.reactions, m.features)
        named = {name: np.moveaxis(values, -1, 0) for name, values in memory.named_rows(kept).items()}
        return NamedColumns(named | {"result": self.results})

    def _go_on(self, steps: int, account: bool) -> None:
        """Advance as `_go`, a long call in parts, so that Ctrl-C takes effect."""
        left = steps * self.substeps
        part = max(PART // (self.columns * len(self.limbs)), LEAST_PART) // CHECK_EVERY * CHECK_EVERY
        if left <= part:
            self._go(steps, account)
            return
        m = self._memory
        kept = self._copy((*engine_states.STATE, "stride_sums", "result"))
        first = np.zeros(self.num_envs)
        sums = np.zeros_like(m.stride_sums)
        are_peaks = np.array(layout.stride_peaks(self.features))
        while left and not broken(first).all():
            # the short part first: limits are checked at steps counted from the end
            length = left % part or part
            self._go_substeps(length, account)
            left -= length
            # a failure stays, and so does a limit unless a failure follows
            first = np.where(broken(first) | ((first != 0) & ~broken(m.result)), first, m.result)
            peaks = np.maximum(sums[:, are_peaks], m.stride_sums[:, are_peaks])
            sums += m.stride_sums
            sums[:, are_peaks] = peaks
        lost = broken(first)
        m.stride_sums[:] = sums
        # an environment that fails has its state from before the call, not from before the part
        for name, values in kept.items():
            getattr(m, name)[..., lost] = values[..., lost]
        m.result[:] = first

    def _go(self, steps: int, account: bool = False) -> None:
        self._go_substeps(steps * self.substeps, account)

    def _go_substeps(self, substeps: int, account: bool) -> None:
        try:
            common = (*self.arrays, self.substep, substeps, account)
            calls = [(*common, block.start, block.stop) for block in self.blocks]
            run_together(self._run, calls, self.num_threads)
        except NumbaError as error:
            if self.contact_law is None:
                raise
            raise ParameterError(f"contact_law: {what_cannot_be_compiled(error)}") from error

    # Reports
