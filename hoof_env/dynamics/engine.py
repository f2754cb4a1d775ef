"""N legs on one trunk in minimal coordinates, for any number of environments at once: the fast, exact engine.

Only what can move freely is integrated: the trunk, as momentum and centre of mass of all bodies together,
and the crank of every leg that has a motor. Everything inside a leg follows from its crank angle in closed
form, so the loops of the linkage are closed to round-off at every step. `mechanics` has the equations,
`advance` runs them; this module checks arguments and holds the state. Results have the same bits alone and in
a batch of any size.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.constants import GRAVITY
from hoof_env.dynamics import layout, memory
from hoof_env.dynamics import state as state_parts
from hoof_env.dynamics.advance import ARRAYS, LANES, ONE_BY_ONE, RESET_REQUESTED, SIDE_BY_SIDE, EngineKind
from hoof_env.dynamics.engine_calls import EngineCalls
from hoof_env.dynamics.layout import engine_layout
from hoof_env.dynamics.limits import CHECK_EVERY
from hoof_env.dynamics.model import static_of
from hoof_env.dynamics.parts import (
    MAX_IMPULSE,
    Drive,
    Limb,
    Limits,
    Mechanics,
    Motor,
    Reactions,
    Result,
    Trunk,
    broken,
)
from hoof_env.dynamics.push import push_kernel
from hoof_env.dynamics.step_length import StepLength
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.errors import (
    Floats,
    NotStartedError,
    ParameterError,
    all_of,
    brief,
    check_choice,
    check_number,
    count,
    finite,
    flag,
    one_of,
    spread,
)
from hoof_env.gait import MAX_HARMONICS, FilterSettings, GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.profile import LegProfile, leg_profile
from hoof_env.simd.layout import views
from hoof_env.simd.threads import blocks, check_threads, limit_threads
from hoof_env.simd.user_functions import UserFunctionError, check_function, user_error

HEIGHT = layout.TrunkSettings.fields["height"].start
"""Row of a trunk's height at rest among its settings."""

MAX_SCALAR_ENVS = 6
"""Largest number of environments of one leg or of four that are run one by one: eight lanes would be mostly
empty."""

MAX_LEGS = 32
"""Largest number of legs: kernels work on the stack, where a leg takes 15 kB with eight lanes."""

MAX_STEPS = 10**12
"""Largest number of substeps of a call: they are counted in 64 bits."""

PART = 2_000_000
"""Number of substeps, summed over all legs, that a long call runs in machine code at a time: at most about a
second. Ctrl-C takes effect between two parts. The last digits of sums depend on the parts."""

MIN_PART = 1000
"""Least number of substeps of each environment in such a part."""


class TrunkEngine:
    """Legs on a trunk over the ground; see the module docstring.

    Args:
        limbs: the legs in their places, at most `MAX_LEGS`; arrays have them in this order.
        trunk: trunk that holds the legs. Its height is its centre of mass's.
        ground: laws of contact. Its exponent must be a multiple of 1/8, so that square roots are enough.
        terrain: heights, and where the ground is softer or more slippery; level if None.
        sim_dt: length of a step [s], after which results can be read.
        integrator: one of `stepping.SCHEMES`.
        substeps: number of substeps of `sim_dt`; contacts are remembered after each. By default as many as
            ground, motors and support need, up to `step_length.MAX_SUBSTEPS`.
        step_error: error of the state after a contact [-] on which that choice is based.
        num_envs: number of environments side by side, which share all of the above.
        num_threads: number of threads that share the environments; it changes no bit.
        harmonics: order of the swing law, 1 to `gait.MAX_HARMONICS`: gaits and commands have 2 + 2 harmonics
            numbers.
        filters: bounds of the command filters; `gait.QUICK` where the crank's speed changes within a stride.
        reactions: true to compute the joint reactions of every step; `reactions()` returns the last.
        strides: true to count stances, peak forces and work; `strides` has them.
        limits: where the motion should end; see `parts.Result`. An engine with limits, even `Limits()`,
            accepts legs of other sizes in `vary`, and its `strides` have horizontal impulses.
        contact_law: law of the normal force instead of the ground's; see `hoof.contact_force`.

    Attributes:
        runs_scalar: true if environments are run one by one in one thread, not side by side.
        blocks: columns of the memory for each thread.
        mechanics: legs, trunk, ground and scheme. It may be replaced between two calls by mechanics
            with the same features.

    Raises:
        ParameterError: a value is out of range or of the wrong type; or, at the first reset, the contact law
            cannot be part of a kernel.
        GeometryError: a leg has no place for its links at any crank angle.

    Warns:
        StepWarning: `substeps` is given and too small, or more would be needed than `MAX_SUBSTEPS`.
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
        legs = all_of("limbs", limbs, Limb)
        if len(legs) > MAX_LEGS:
            raise ParameterError(f"limbs: expected at most {MAX_LEGS}, got {len(legs)}")
        trunk = one_of("trunk", trunk, Trunk)
        limits = None if limits is None else one_of("limits", limits, Limits)
        order = count("harmonics", harmonics, most=MAX_HARMONICS)
        self.reacts = flag("reactions", reactions)
        features = memory.features_of(legs, order, limits is not None, self.reacts)
        memory.check_limbs(trunk, legs, features.has_springs)
        if contact_law is not None and features.has_springs:
            raise ParameterError(
                "contact_law: expected none together with springs of the hooves, whose speed follows from a"
                f" law that is linear in it, got {brief(contact_law)}"
            )
        ground = Ground() if ground is None else one_of("ground", ground, Ground)
        terrain = Terrain.flat() if terrain is None else one_of("terrain", terrain, Terrain)
        self.filters = FilterSettings() if filters is None else one_of("filters", filters, FilterSettings)
        integrator = check_choice("integrator", integrator, SCHEMES)
        self.sim_dt = check_number("sim_dt", sim_dt, low=1e-7, high=self.filters.longest_step)
        self.num_envs = count("num_envs", num_envs)
        self.num_threads = check_threads(num_threads)
        profiles = [leg_profile(limb.geometry) for limb in legs]
        step_error = check_number("step_error", step_error, low=0, high=1, exclusive_low=True)
        mechanics = Mechanics(
            legs, profiles, trunk, ground, terrain, integrator, features, limits, step_error=step_error
        )
        length = StepLength(mechanics)
        asked = None if substeps is None else count("substeps", substeps, most=MAX_STEPS)
        chosen = length.choose(self.sim_dt, asked)
        self.counts_strides = flag("strides", strides)
        model = memory.new_model(mechanics, self.filters, self.counts_strides)
        self.mechanics = replace(mechanics, substeps=chosen, step_limits=length.limits, model=model)
        self._allocate()

    def _allocate(self) -> None:
        """Find the kernel, and make the memory of all environments."""
        self.runs_scalar = len(self.limbs) in ONE_BY_ONE and self.num_envs <= MAX_SCALAR_ENVS
        columns = self.num_envs if self.runs_scalar else memory.columns_for(self.num_envs)
        self.blocks = [range(columns)] if self.runs_scalar else blocks(columns, LANES, self.num_threads)
        self._memory = memory.new_memory(self.mechanics, self.num_envs, columns, self.reacts)
        self._arrangement = ONE_BY_ONE[len(self.limbs)] if self.runs_scalar else SIDE_BY_SIDE
        self._calls: EngineCalls | None = None
        self._identity: tuple[Mechanics, dict[str, Any]] | None = None

    def __repr__(self) -> str:
        legs = f"{len(self.limbs)} leg{'s' * (len(self.limbs) > 1)}"
        masses = f"{self.total_mass:.1f} kg"
        return f"<TrunkEngine {self.trunk.kind}, {legs}, {masses}, {self.num_envs} environments>"

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes of a copy, with separate memory even if the copy is shallow."""
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
        """Return a copy that shares constant parts, such as the legs' tables."""
        return copy.copy(self)

    # Mechanics, memory and arguments of the kernels, for callers with their own kernels

    @property
    def limbs(self) -> Sequence[Limb]:
        """Legs in their places."""
        return self.mechanics.limbs

    @property
    def profiles(self) -> Sequence[LegProfile]:
        """Tables of the legs' motion."""
        return self.mechanics.profiles

    @property
    def trunk(self) -> Trunk:
        """Trunk that holds the legs."""
        return self.mechanics.trunk

    @property
    def ground(self) -> Ground:
        """Laws of contact."""
        return self.mechanics.ground

    @property
    def terrain(self) -> Terrain:
        """Heights of the ground, and where it is softer or more slippery."""
        return self.mechanics.terrain

    @property
    def integrator(self) -> str:
        """Scheme of a step, one of `stepping.SCHEMES`."""
        return self.mechanics.integrator

    @property
    def features(self) -> layout.Features:
        """Features on which the layout of the memory depends."""
        features: layout.Features = self.mechanics.features
        return features

    @property
    def motion_limits(self) -> Limits | None:
        """Limits where the motion should end."""
        return self.mechanics.motion_limits

    @property
    def step_error(self) -> float:
        """Error of the state after a contact [-] for which the number of substeps is chosen."""
        return self.mechanics.step_error

    @property
    def substeps(self) -> int:
        """Number of substeps of `sim_dt`."""
        return self.mechanics.substeps

    @property
    def step_limits(self) -> dict[str, float]:
        """Longest step [s] for each cause; see `step_length`. The limit of friction is reported and not used,
        because nothing diverges beyond it: on the ground of `HorseLeg-v0` it is 0.14 ms for a horse of 349
        kg. There forces at 1 ms agree with those at 16 us to 1 % under hooves that slide; under hooves that
        stand friction is off by 2.7 times its size and the normal force by half, at 0.5 ms by 0.4 % and 0.1
        %. For clean forces at rest use `substeps` of sim_dt / step_limits["friction"], or a larger
        `friction_fast`."""
        return self.mechanics.step_limits

    @property
    def total_mass(self) -> float:
        """Mass of trunk and legs [kg]."""
        return self.trunk.mass + sum(limb.geometry.mass for limb in self.limbs)

    @property
    def weight(self) -> float:
        """Weight of trunk and legs [N]."""
        return self.total_mass * GRAVITY

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """First arguments of the kernels of `advance`; their memory stays in place; a copy has separate
        memory."""
        return self.arrays_of(self.mechanics)

    def arrays_of(self, mechanics: Mechanics) -> tuple[NDArray[Any], ...]:
        """Return `arrays` with the model of other mechanics."""
        m = self._memory
        return (m.data, *mechanics.model, m.constants, m.reactions)

    @property
    def columns(self) -> int:
        """Number of columns of the memory: environments, idle ones included."""
        return int(self._memory.data.shape[1])

    @property
    def results(self) -> NDArray[np.int64]:
        """Results of the last call, values of `parts.Result`, shape (num_envs,)."""
        return self._memory.result.astype(np.int64)

    def alone(self, *, reactions: bool | None = None) -> TrunkEngine:
        """Return a new engine like this one for one environment; `reactions` selects whether it computes
        joint reactions; by default as this engine does."""
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
            reactions=self.reacts if reactions is None else reactions,
            strides=self.counts_strides,
            limits=self.motion_limits,
            contact_law=self.contact_law,
        )

    # What a batch of episodes asks of its engine. `paper_solver.episodes.PaperEngine` has other answers.

    in_kernels: ClassVar[bool] = True
    """True if kernels of control steps contain the engine; else its `take_step` runs between two kernels."""

    def take_step(self, steps: int) -> None:
        """Take a control step of `steps` times `sim_dt` under the commands in memory."""
        self.advance(None, steps)

    def adopt(self, envs: NDArray[np.int64]) -> None:
        """Simulate environments with the present mechanics from now on; kernels always do."""

    @contextmanager
    def only(self, envs: NDArray[np.int64]) -> Iterator[None]:
        """Restore all environments but some after a block."""
        m = self._memory
        arrays = [(m.data, -1), *([(m.reactions, -1)] if m.reactions.size else [])]
        with memory.only(envs, self.num_envs, arrays):
            yield

    def snapshot(self) -> Any:
        """Return a copy of everything that changes, for `restore`."""
        return self._memory.data.copy()

    def restore(self, snapshot: Any) -> None:
        """Restore what `snapshot` returned of this engine, bit by bit, reports included."""
        self._memory.data[:] = snapshot

    def observe_again(self, envs: NDArray[np.int64]) -> None:
        """Report the present state of environments whose report is still of the point at which their step
        failed."""
        data = self._memory.data
        form = engine_layout(self.features)
        # No step, but new reports of all environments, of which only `envs` keep theirs.
        before = data.copy()
        leg = form.leg_memory.rows("report")
        self._go(0)
        reports = [form.trunk_memory.rows("report")]
        for k in range(len(self.limbs)):
            first = form.trunk_rows + k * form.leg_rows
            reports.append(slice(first + leg.start, first + leg.stop))
        for rows in reports:
            before[rows, envs] = data[rows, envs]
        data[:] = before

    def end_reader(self, env: int) -> Callable[[], Any]:
        """Return a function that returns the end of a control step of an environment: the memory from which
        its substeps can be run again."""
        copy_of: Callable[[], Any] = self._memory.data[:, self._env(env)].copy
        return copy_of

    def failure(self, env: int) -> str:
        """Return why the last step of an environment failed, "" if it did not."""
        result = Result(int(self._memory.result[env]))
        return "" if result is Result.OK else result.message

    @staticmethod
    def repeated(state: Mapping[str, Any], n: int) -> dict[str, Any]:
        """Return the state of an engine of one environment as one of n environments.

        Raises:
            KeyError, TypeError, ValueError, IndexError: it is not such a state.
        """
        layout_of_one = state["layout"]
        if layout_of_one["num_envs"] != 1:
            raise ValueError
        arrays = {name: values for name, values in state.items() if name != "layout"}
        many = {name: np.repeat(np.asarray(values, np.float64), n, -1) for name, values in arrays.items()}
        return {**many, "layout": {**layout_of_one, "num_envs": n}}

    # Starts and motion

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
            envs: environments that start, as indices or as a mask of shape (num_envs,); None for all.

        Raises:
            ParameterError: a value is not finite, of the wrong shape or forbidden by the trunk's kind, an
                angle, place or rate is beyond `layout.MAX_STATE`, or a leg's links have no place there.
        """
        where = memory.env_indices(envs, self.num_envs)
        m = self._memory
        n = where.size
        values = memory.gaits_of(gaits, len(self.limbs), n, self.features.harmonics)
        heights = m.trunk_settings[HEIGHT, where]
        height = heights if y is None else y
        trunk = {"x": x, "y": height, "pitch": pitch, "vx": vx, "vy": vy, "pitch_rate": pitch_rate}
        m.trunk[:, where], m.limbs[:, :, where] = memory.start(
            self.mechanics, values, crank_angle, crank_angle_rate, trunk, heights
        )
        m.command[:, :, where] = values
        m.account[:, where] = 0.0
        m.strides[:, :, where] = 0.0
        m.result[where] = RESET_REQUESTED
        self._go(-1)

    def command(self, command: ArrayLike, envs: ArrayLike | None = None) -> None:
        """Command gaits from the next `advance` on, as after a `reset` of some environments.

        Args:
            command: gait parameters, P = 2 + 2 harmonics of them, of shape (P,), (legs, P) or (legs, P, n),
                where n is the number of environments that are commanded.
            envs: environments that are commanded, as indices or as a mask of shape (num_envs,); None for all.

        Raises:
            ParameterError: the command has a wrong shape or is not finite, or there are no such environments.
        """
        gaits = finite("command", command)
        where = memory.env_indices(envs, self.num_envs)
        legs = len(self.limbs)
        size = self.features.gait_size
        if gaits.shape == (size,) or gaits.shape == (legs, size):
            gaits = gaits[..., None]
        elif gaits.shape != (legs, size, where.size):
            raise ParameterError(
                f"command: expected shape ({size},), ({legs}, {size}) or {(legs, size, where.size)}, "
                f"got {gaits.shape}"
            )
        self._memory.command[:, :, where] = gaits

    @property
    def substep(self) -> float:
        """Length of a substep [s]."""
        return self.sim_dt / self.substeps

    def advance(
        self, command: ArrayLike | None = None, steps: int = 1, *, account: bool = True
    ) -> NDArray[np.int64]:
        """Advance by `steps` of `sim_dt` under a command.

        Args:
            command: gait parameters as for `command`, for all environments; None for the last command.
            steps: number of steps; 0 evaluates forces and accelerations at the present state.
            account: true to update `account`.

        Returns:
            Results of the environments, values of `parts.Result`, shape (num_envs,). An environment that
            could not be simulated has the state and report from before this call.

        Raises:
            ParameterError: the command has a wrong shape or is not finite.
            NotStartedError: no environment was ever reset.
            KeyboardInterrupt: Ctrl-C during a long call, which then ends after a part of the steps.
        """
        steps = count("steps", steps, 0, MAX_STEPS // self.substeps)
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
            if not m.result.any():
                whole[..., k] = m.data
                continue
            if lost := broken(m.result).any():
                self.observe()
            whole[..., k] = m.data
            if lost or not continue_past_limits:
                times = k if lost else k + 1
                break
        kept = memory.memory_of(whole[..., :times], self.num_envs, m.constants, m.reactions, m.features)
        # `np.moveaxis` would do the same, and takes longer than the motion of one environment.
        time_first = {2: (1, 0), 3: (2, 0, 1)}
        named = {
            name: values.transpose(time_first[values.ndim])
            for name, values in memory.named_rows(kept).items()
        }
        return named | {"result": self.results}

    def _go_on(self, steps: int, account: bool) -> None:
        """Advance as `_go`, a long call in parts, so that Ctrl-C takes effect."""
        left = steps * self.substeps
        part = max(PART // (self.columns * len(self.limbs)), MIN_PART) // CHECK_EVERY * CHECK_EVERY
        if left <= part:
            self._go(steps, account)
            return
        m = self._memory
        before = self._copy((*state_parts.STATE, "stride_sums", "result"))
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
        for name, values in before.items():
            getattr(m, name)[..., lost] = values[..., lost]
        m.result[:] = first

    def _go(self, steps: int, account: bool = False) -> None:
        self._go_substeps(steps * self.substeps, account)

    def _go_substeps(self, substeps: int, account: bool) -> None:
        """Advance by substeps; a negative number starts the environments that are to be started."""
        calls = self._present_calls()
        try:
            calls.run(substeps < 0, self.substep, max(substeps, 0), account)
        except UserFunctionError as error:
            raise user_error("contact_law", error) from None

    def compile(self) -> None:
        """Trace and compile the kernel that starts environments, or load it.

        Raises:
            ParameterError: the law of contact cannot be part of a kernel.
        """
        try:
            self._present_calls().kernel(is_start=True).compile()
        except UserFunctionError as error:
            raise user_error("contact_law", error) from None

    def _present_calls(self) -> EngineCalls:
        """Return the kernels and arguments for the present model, which another plan may have replaced."""
        if self._calls is None or self._calls.model is not self.mechanics.model:
            kind = EngineKind(
                self.features, self.contact_law, static_of(self.mechanics.model[0]), self.reacts
            )
            self._calls = EngineCalls(
                kind, self._arrangement, self.mechanics.model, self.arrays, self.blocks, self.num_threads
            )
        return self._calls

    def push(self, forward: ArrayLike, upward: ArrayLike = 0.0, envs: ArrayLike | None = None) -> None:
        """Push trunks at their centres of mass, and so motors' cranks. Reports show it from the next call on.

        Args:
            forward, upward: impulses [N s], one number, or one for each environment that is pushed.
            envs: environments that are pushed, as indices or as a mask of shape (num_envs,); None for all.

        Raises:
            ParameterError: an impulse beyond `MAX_IMPULSE` or of wrong shape, bad `envs`, or a fixed trunk.
            NotStartedError: no environment was ever reset.
        """
        where = memory.unique_env_indices(envs, self.num_envs)
        if np.isnan(self._memory.trunk).all():
            raise NotStartedError("the engine was asked to push before reset(): expected reset() first")
        if self.trunk.kind == "fixed":
            raise ParameterError("push: expected a trunk that moves, got a fixed one")
        pushed = {"forward": forward, "upward": upward}
        push = np.array([spread(name, given, where.shape, MAX_IMPULSE) for name, given in pushed.items()])
        m = self._memory
        moving = views(layout.Moving, m.trunk[layout.TrunkState.rows("moving")])
        place = views(layout.TrunkReport, m.trunk_report).place[:, where]
        if self.trunk.kind == "rail":
            push[1] = 0.0
        if any(isinstance(limb.drive, Motor) for limb in self.limbs):
            named = dict(zip(ARRAYS, self.arrays, strict=True))
            which = np.ascontiguousarray(where, np.int64)
            run = push_kernel(EngineKind(self.features, None, static_of(self.mechanics.model[0])))
            run(run.parameters[0].hold({**named, "impulses": push, "which": which}))
        moving.momentum[:, where] += push
        if self.trunk.pitches:
            off = place - moving.centre[:, where]
            moving.angular_momentum[where] += off[0] * push[1] - off[1] * push[0]

    def vary(
        self,
        env: int,
        trunk: Trunk | None = None,
        ground: Ground | None = None,
        drive: Drive | None = None,
        limbs: Sequence[Limb] | None = None,
    ) -> None:
        """Set masses, springs, ground, motors or legs of one environment; it must be reset afterwards.

        Args:
            env: index of the environment.
            trunk, ground, drive: parts of this environment, with the kinds, exponent and laws of the
                engine's parts; None for the engine's. `total_mass`, `weight` and `step_limits` do not
                change.
            limbs: legs of this environment, in other places, with other springs of the hooves or, in an
                engine with `limits`, of other sizes, similar to the engine's (`Geometry.scaled`); their trunk
                needs another height, too. None for the engine's. Joint reactions are not computed for legs of
                another size. The step is not adapted to these legs and springs.

        Raises:
            ParameterError: a setting that environments share differs, or there is no such environment.
        """
        env = self._env(env)
        trunk = self.trunk if trunk is None else one_of("trunk", trunk, Trunk)
        ground = self.ground if ground is None else one_of("ground", ground, Ground)
        varied = self.limbs if limbs is None else all_of("limbs", limbs, Limb)
        varied = [limb if drive is None else replace(limb, drive=drive) for limb in varied]
        memory.check_shared(self.mechanics, trunk, ground, varied)
        if self.reacts and any(
            limb.geometry != mine.geometry for limb, mine in zip(varied, self.limbs, strict=True)
        ):
            raise ParameterError("limbs: expected the engine's own geometries where it computes reactions")
        m = self._memory
        m.trunk_settings[:, env], m.limb_settings[:, :, env] = memory.settings_of(
            self.mechanics, trunk, ground, varied
        )

    # Reports

    @property
    def state(self) -> dict[str, Floats]:
        """State by name: rows of `layout.TRUNK_STATE`, shape (num_envs,), and of `leg_state`, shape (legs,
        num_envs)."""
        return self._named(layout.TRUNK_STATE + layout.leg_state(self.features))

    @property
    def report(self) -> dict[str, Floats]:
        """Forces, torques and motion at the present instant by name: `layout.TRUNK_REPORT`, shape
        (num_envs,), and `LEG_REPORT`, shape (legs, num_envs)."""
        return self._named(layout.TRUNK_REPORT + layout.LEG_REPORT)

    def _named(self, names: Sequence[str]) -> dict[str, Floats]:
        named = memory.named_rows(self._memory)
        return {name: named[name].copy() for name in names}

    @property
    def account(self) -> dict[str, Floats]:
        """Integrals since the reset by name, `layout.account`, shape (num_envs,)."""
        return {name: self._memory.account[k].copy() for k, name in enumerate(layout.account(self.features))}

    @property
    def strides(self) -> dict[str, Floats]:
        """Open stance and sums of the last call by name, `layout.STRIDES` and `stride_sums`, shape (legs,
        num_envs); see `observables`. Zeros for an engine without `strides=True`."""
        m = self._memory
        whole = np.concatenate([m.strides, m.stride_sums], axis=1)
        return {
            name: whole[:, k] for k, name in enumerate(layout.STRIDES + layout.stride_sums(self.features))
        }

    def reactions(self) -> Reactions:
        """Return the joint reactions at the present instant: of joints, shape (legs, 20, 2, num_envs), and
        the moments, shape (legs, num_envs).

        Raises:
            ParameterError: the engine is without `reactions=True`.
        """
        if not self.reacts:
            raise ParameterError("reactions: expected an engine made with reactions=True, got one without")
        rows = self._memory.reactions[:, :, : self.num_envs]
        legs, _, n = rows.shape
        form = layout.reactions_layout(self.features.structure)
        parts = {name: rows[:, form.rows(name)].copy() for name in form.fields}
        joints = parts.pop("joints").reshape(legs, -1, 2, n)
        # of one weld or moment the axis is left out
        moments = {name: part[:, 0] if part.shape[1] == 1 else part for name, part in parts.items()}
        return Reactions(joints, **moments)

    def messages(self) -> list[str]:
        """Return a sentence for each environment: how it ended."""
        never = np.isnan(self._memory.trunk).all(0)
        return [
            "this environment was never reset" if new else Result(int(code)).message
            for code, new in zip(self._memory.result, np.atleast_1d(never), strict=True)
        ]

    # States

    def get_state(self) -> dict[str, Any]:
        """Return copies of all arrays that change; a run that continues from them has the same bits."""
        return self._copy(state_parts.STATE) | {"layout": dict(self._layout)}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore a state from `get_state`, and evaluate forces and accelerations there.

        Raises:
            ParameterError: the state belongs to an engine that would continue differently, lacks a part, or
                has numbers that are not finite or beyond `layout.MAX_STATE` in environments that were reset
                once.
        """
        arrays, reset = state_parts.read_state(self._layout, self._memory, state)
        result = np.where(reset, 0.0, self._memory.result)
        self._put(arrays)
        self._memory.result[:] = result
        self._go(0)
        # again, because the evaluation also stores contacts and counts stances
        self._put(arrays)
        self._memory.result[:] = result
        self._memory.stride_sums[:] = 0.0

    @property
    def _layout(self) -> dict[str, Any]:
        """Settings that a state must share with the engine. Stored for the present mechanics, because its
        digests take as long as ten steps."""
        if self._identity is None or self._identity[0] is not self.mechanics:
            identity = state_parts.identity_of(
                self.mechanics,
                self.filters,
                num_envs=self.num_envs,
                sim_dt=self.sim_dt,
                substeps=self.substeps,
            )
            self._identity = (self.mechanics, identity)
        return self._identity[1]

    def observe(self) -> None:
        """Evaluate forces and accelerations at the present state; change only `report` and `reactions`."""
        before = self._copy((*state_parts.STATE, "stride_sums", "result"))
        self._go(0)
        self._put(before)

    def column(self, env: int) -> Floats:
        """Return a copy of all memory of one environment: state, settings, command, report; shape (rows,)."""
        return self._memory.data[:, self._env(env)].copy()

    def set_column(self, env: int, column: Floats) -> None:
        """Restore a column from `column`, of an engine like this one.

        Raises:
            ParameterError: another shape, or numbers that are not finite or beyond `layout.MAX_STATE` in an
                environment that was reset.
        """
        m = self._memory
        env = self._env(env)
        try:
            values = np.array(column, dtype=np.float64)
        except (TypeError, ValueError):
            raise ParameterError(f"column: expected numbers, got {brief(column)}") from None
        if values.shape != m.data.shape[:1]:
            raise ParameterError(f"column: expected shape {m.data.shape[:1]}, got {values.shape}")
        parts = memory.memory_of(values[:, None], 1, m.constants, m.reactions[..., :1], m.features)
        state_parts.check_column(parts, m.limb_settings[..., env : env + 1])
        m.data[:, env] = values

    def _env(self, env: Any) -> int:
        return count("env", env, low=0, most=self.num_envs - 1)

    def command_in(self, column: Floats) -> Floats:
        """Return the command in such a column, shape (legs, 2 + 2 harmonics)."""
        form = engine_layout(self.features)
        legs = column[form.trunk_rows :].reshape(len(self.limbs), form.leg_rows)
        return legs[:, form.leg_memory.rows("command")].copy()

    def _copy(self, names: Sequence[str]) -> dict[str, NDArray[Any]]:
        return {name: getattr(self._memory, name).copy() for name in names}

    def _put(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        for name, values in arrays.items():
            getattr(self._memory, name)[:] = values
