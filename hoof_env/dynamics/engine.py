"""N legs on one trunk in minimal coordinates, for any number of environments at once: the fast, exact engine.

What can move is integrated: the trunk, as momentum and centre of mass of all bodies together, and the crank
of every leg whose drive is a motor. Everything inside a leg follows from its crank angle in closed form, so
loops are closed to round-off at every step of any run. `mechanics` has the equations, `advance` runs them;
this module checks arguments and keeps the state. A number has the same bits alone and in a batch of any size.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numba.core.errors import NumbaError
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics import layout, memory
from hoof_env.dynamics.advance import BY_LEGS, LANES, RESET_REQUESTED, advance_kernels
from hoof_env.dynamics.form import engine_layout
from hoof_env.dynamics.layout import Features
from hoof_env.dynamics.limits import CHECK_EVERY
from hoof_env.dynamics.parts import (
    GRAVITY,
    Drive,
    Limb,
    Limits,
    Mechanics,
    Reactions,
    Result,
    Tally,
    Trunk,
    broken,
)
from hoof_env.dynamics.reactions import Reactions as ReactionRows
from hoof_env.dynamics.step_length import StepLength
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.dynamics.tally import tally_of
from hoof_env.errors import (
    Floats,
    NotStartedError,
    ParameterError,
    all_of,
    check_choice,
    check_number,
    count,
    finite,
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
"""Up to so many environments of one leg or four are run one by one: eight lanes would be mostly empty."""

MOST_LEGS = 32
"""Legs of an engine; its kernels work on the stack, where eight lanes take 15 kB a leg."""

MOST_STEPS = 10**12
"""Substeps of a call, which are counted in 64 bits."""

PART = 2_000_000
LEAST_PART = 1000
"""Substeps of all legs in machine code at a time, a second at most, and of each environment at least: between
two such parts of a long call Ctrl-C is heard. What is added up has other last digits than in one part."""


class TrunkEngine(Mechanics):
    """Legs on a trunk over the ground; see the module docstring.

    Args:
        limbs: the legs in their places, at most `MOST_LEGS`; in their order every array has them.
        trunk: what they hang from. Its height is that of its centre of mass.
        ground: laws of contact. Its exponent must be a multiple of 1/8, so that square roots are enough.
        terrain: heights, and where the ground is softer or more slippery; level if None.
        sim_dt: the step [s] after which results can be read.
        integrator: one of `stepping.SCHEMES`.
        substeps: parts of `sim_dt` that are integrated, contacts remembered after each; None chooses as many
            as ground, motors and support ask, up to `step_length.MOST_SUBSTEPS`.
        step_error: of the state after a contact [-], for which that choice is made.
        num_envs: environments side by side, which share all of the above.
        num_threads: threads that share the environments; they change no bit.
        harmonics: of the swing law, 1 to `gait.MOST_HARMONICS`: gaits and commands have 2 + 2 harmonics
            numbers.
        filters: bounds of the command filters; `gait.QUICK` where the crank's speed changes within a stride.
        reactions: compute the joint reactions of every step; `reactions()` has those of the last.
        strides: count stances, peak forces and work; `strides` has them.
        limits: where the motion should end, see `parts.Result`. An engine with limits, if only `Limits()`,
            takes legs of other sizes in `vary`, and its `strides` have horizontal impulses.
        contact_law: instead of the ground's normal law, see `hoof.law_of`.

    Attributes:
        runs_scalar: environments are run one by one, not side by side, and by one thread.
        blocks: columns of the memory that each thread works on.
        step_limits: longest step [s] for each cause, see `step_length`. Friction is not heeded, for nothing
            blows up: on the ground of `HorseLeg-v0` it asks a horse of 349 kg for 0.14 ms. There forces at
            1 ms agree with those at 16 us to 1 % under hoofs that slide; under hoofs that stand friction is
            off by 2.7 times its size and the normal force by half, at 0.5 ms by 0.4 % and 0.1 %. For clean
            forces at rest use `substeps` of sim_dt / step_limits["friction"], or more `friction_fast`.

    Raises:
        ParameterError: a value is out of range or of the wrong type; or, at the first reset, the contact law
            cannot be compiled.
        GeometryError: a leg has no place for its links at any crank angle.

    Warns:
        StepWarning: `substeps` is given and too few, or more would be needed than are chosen.
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
            self.limbs, self.profiles, self.trunk, self.ground, self.terrain, self.integrator,
            step_error=self.step_error,
        )  # fmt: skip
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
        """A copy has memory of its own, also a shallow one."""
        m = self._memory
        parts = {name: part for name, part in vars(self).items() if name != "_run"}
        return {
            **parts,
            "_memory": (m.data, self.num_envs, m.constants, m.reactions.copy(), m.features),
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        data, *others = state["_memory"]
        vars(self).update(state, _memory=memory.memory_of(memory.copy_of(data), *others))
        self.num_threads = limit_threads(self.num_threads)
        self._choose_kernel()

    def __deepcopy__(self, memo: Any) -> TrunkEngine:
        """What never changes, such as the legs' tables, is shared."""
        return copy.copy(self)

    # What it is like

    @property
    def total_mass(self) -> float:
        """Mass of trunk and legs [kg]."""
        return self.trunk.mass + sum(limb.geometry.mass for limb in self.limbs)

    @property
    def weight(self) -> float:
        """Weight of trunk and legs [N]."""
        return self.total_mass * GRAVITY

    # What the kernels take, for those that call them from kernels of their own

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """The first arguments of the kernels of `advance`; they stay where they are, but not in a copy."""
        m = self._memory
        return (m.data, *self._model, m.constants, m.reactions)

    @property
    def columns(self) -> int:
        """Of the memory: environments, idle ones included."""
        return int(self._memory.data.shape[1])

    @property
    def substep(self) -> float:
        """What is integrated at once [s]."""
        return self.sim_dt / self.substeps

    @property
    def results(self) -> NDArray[np.int64]:
        """How the last call ended in each environment, values of `parts.Result`, shape (num_envs,)."""
        return self._memory.result.astype(np.int64)

    def column(self, env: int) -> Floats:
        """All memory of one environment: state, settings, command, report; shape (rows,)."""
        return self._memory.data[:, self._env(env)].copy()

    def set_column(self, env: int, column: Floats) -> None:
        """Put back what `column` gave, of an engine like this one; where its legs' tables are stays its own.

        Raises:
            ParameterError: another shape, or numbers that are not finite or beyond `layout.MAX_STATE` in an
                environment that was reset.
        """
        m = self._memory
        env = self._env(env)
        try:
            given = np.array(column, dtype=np.float64)
        except (TypeError, ValueError):
            raise ParameterError(f"column: expected numbers, got {column!r}") from None
        if given.shape != m.data.shape[:1]:
            raise ParameterError(f"column: expected shape {m.data.shape[:1]}, got {given.shape}")
        parts = memory.memory_of(given[:, None], 1, m.constants, m.reactions[..., :1], m.features)
        memory.check_column(parts, m.limb_settings[..., env : env + 1])
        m.data[:, env] = given

    def _env(self, env: Any) -> int:
        return count("env", env, low=0, most=self.num_envs - 1)

    def command_in(self, column: Floats) -> Floats:
        """The command in such a column, shape (legs, 2 + 2 harmonics)."""
        form = engine_layout(self.features)
        legs = column[form.trunk_rows :].reshape(len(self.limbs), form.leg_rows)
        return legs[:, form.leg_memory.rows("command")].copy()

    def alone(self) -> TrunkEngine:
        """An engine like this one, for one environment."""
        return TrunkEngine(
            self.limbs, self.trunk, self.ground, self.terrain, sim_dt=self.sim_dt, integrator=self.integrator,
            substeps=self.substeps, step_error=self.step_error, harmonics=self.features.harmonics,
            filters=self.filters, reactions=self.reacts, strides=self.counts_strides,
            limits=self.motion_limits, contact_law=self.contact_law,
        )  # fmt: skip

    # State

    def reset(
        self,
        gaits: GaitParameters | Sequence[GaitParameters] | Floats,
        theta: ArrayLike = 0.0,
        *,
        x: ArrayLike = 0.0,
        y: ArrayLike | None = None,
        pitch: ArrayLike = 0.0,
        vx: ArrayLike = 0.0,
        vy: ArrayLike = 0.0,
        pitch_rate: ArrayLike = 0.0,
        theta_rate: ArrayLike | None = None,
        envs: ArrayLike | None = None,
    ) -> None:
        """Start with the filters at rest at a gait, the same for all legs or one each.

        A hoof point that starts inside the ground has entered it at its present rate.

        Args:
            gaits: gait parameters, one for all legs or one each; or as numbers, shape (legs, 2 + 2 harmonics,
                n).
            theta: crank angles [rad], of shape (), (legs,) or (legs, n) with n the environments that start.
            x, y, pitch, vx, vy, pitch_rate: of the trunk's centre of mass [m, rad, s], shape () or (n,); a
                `y` of None is the trunk's height.
            theta_rate: of motor-driven cranks [rad/s], as theta; None is the commanded speed.
            envs: which environments start, as indices or as a mask of shape (num_envs,); None is all.

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
            self, values, theta, theta_rate, trunk, heights
        )
        m.command[:, :, where] = values
        m.account[:, where] = 0.0
        m.strides[:, :, where] = 0.0
        m.result[where] = RESET_REQUESTED
        self._go(-1)

    def vary(
        self,
        env: int,
        trunk: Trunk | None = None,
        ground: Ground | None = None,
        drive: Drive | None = None,
        limbs: Sequence[Limb] | None = None,
    ) -> None:
        """Give one environment its own masses, springs, ground, motors or legs; it must be reset afterwards.

        Args:
            env: which.
            trunk, ground, drive: instead of the engine's, whose kinds, exponent and laws they share; None is
                the engine's own. `total_mass`, `weight`, `tally` and `step_limits` stay those of the
                engine.
            limbs: legs in other places, with other springs of the hoofs or, in an engine with `limits`, of
                other sizes, similar to its own (`Geometry.scaled`), whose trunk needs another height, too;
                None is the engine's own. Joint reactions are not computed of legs of another size. Steps
                are those that the engine's own legs and springs ask for.

        Raises:
            ParameterError: what environments share differs, or there is no such environment.
        """
        env = self._env(env)
        trunk = self.trunk if trunk is None else one_of("trunk", trunk, Trunk)
        ground = self.ground if ground is None else one_of("ground", ground, Ground)
        own = self.limbs if limbs is None else all_of("limbs", limbs, Limb)
        own = [limb if drive is None else replace(limb, drive=drive) for limb in own]
        memory.check_shared(self, trunk, ground, own)
        if self.reacts and any(
            limb.geometry != mine.geometry for limb, mine in zip(own, self.limbs, strict=True)
        ):
            raise ParameterError("limbs: expected the engine's own geometries where it computes reactions")
        m = self._memory
        m.trunk_settings[:, env], m.limb_settings[:, :, env] = memory.settings_of(self, trunk, ground, own)

    def get_state(self) -> dict[str, Any]:
        """Everything that changes, as arrays of their own: continuing from it is bit-identical."""
        return self._copy(memory.STATE) | {"layout": dict(self._layout)}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Put back what `get_state` gave, and evaluate forces and accelerations there.

        Raises:
            ParameterError: the state belongs to an engine that would go on differently, lacks a part, or has
                numbers that are not finite or beyond `layout.MAX_STATE`, in environments that were reset
                once.
        """
        arrays, reset = memory.read_state(self._layout, self._memory, state)
        result = np.where(reset, 0.0, self._memory.result)
        self._put(arrays)
        self._memory.result[:] = result
        self._go(0)
        self._put(arrays)
        self._memory.result[:] = result
        self._memory.stride_sums[:] = 0.0

    @cached_property
    def _layout(self) -> dict[str, Any]:
        """What a state must share; its digests take as long as ten steps."""
        return memory.identity_of(
            self, self.filters, num_envs=self.num_envs, sim_dt=self.sim_dt, substeps=self.substeps
        )

    # Motion

    def advance(
        self, command: ArrayLike | None = None, steps: int = 1, *, account: bool = True
    ) -> NDArray[np.int64]:
        """Advance by `steps` of `sim_dt` under a command.

        Args:
            command: gait parameters as `command` takes them, for all environments; None keeps the last.
            steps: how many; 0 evaluates forces and accelerations where the state is.
            account: whether to keep `account`.

        Returns:
            How each environment ended, shape (num_envs,), values of `parts.Result`. One that could not be
            simulated is left in its last good state, from which this call began; the report is of there.

        Raises:
            ParameterError: the command has a wrong shape or is not finite.
            NotStartedError: no environment was ever reset.
            KeyboardInterrupt: of a long call, which then ends after a part of the steps.
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
            command, steps: as of `advance`.
            every: steps from one instant of the record to the next.
            continue_past_limits: whether to go on beyond a limit, as `advance` does.

        Returns:
            Arrays by name, time on the first axis, and "result", how each environment ended, shape
            (num_envs,). Once one does not end OK all stop, and the record is that up to there: with the
            instant where a limit was passed, without one that could not be simulated.

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
        return named | {"result": self.results}

    def command(self, command: ArrayLike, envs: ArrayLike | None = None) -> None:
        """Command gaits from the next `advance` on, as after a `reset` of some environments.

        Args:
            command: gait parameters, P = 2 + 2 harmonics of them, of shape (P,), (legs, P) or (legs, P, n),
                n the environments that are commanded.
            envs: which, as indices or as a mask of shape (num_envs,); None is all.

        Raises:
            ParameterError: the command has a wrong shape or is not finite, or there are no such environments.
        """
        given = finite("command", command)
        where = memory.which(envs, self.num_envs)
        legs = len(self.limbs)
        size = self.features.gait_size
        if given.shape == (size,) or given.shape == (legs, size):
            given = given[..., None]
        elif given.shape != (legs, size, where.size):
            raise ParameterError(
                f"command: expected shape ({size},), ({legs}, {size}) or {(legs, size, where.size)}, "
                f"got {given.shape}"
            )
        self._memory.command[:, :, where] = given

    def _go_on(self, steps: int, account: bool) -> None:
        """As `_go`, with a long call in parts."""
        left = steps * self.substeps
        part = max(PART // (self.columns * len(self.limbs)), LEAST_PART) // CHECK_EVERY * CHECK_EVERY
        if left <= part:
            self._go(steps, account)
            return
        m = self._memory
        kept = self._copy((*memory.STATE, "stride_sums", "result"))
        first = np.zeros(self.num_envs)
        sums = np.zeros_like(m.stride_sums)
        highest = layout.stride_sums(self.features).index("highest_grf")
        while left and not broken(first).all():
            now = left % part or part  # the short one first: limits are looked at from the end
            self._go_substeps(now, account)
            left -= now
            first = np.where(broken(first) | ((first != 0) & ~broken(m.result)), first, m.result)
            peak = np.maximum(sums[:, highest], m.stride_sums[:, highest])
            sums += m.stride_sums
            sums[:, highest] = peak
        lost = broken(first)
        m.stride_sums[:] = sums
        for name, values in kept.items():  # as before the call
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

    def observe(self) -> None:
        """Evaluate forces and accelerations where the state is, and change nothing but `report` and
        `reactions`."""
        kept = self._copy((*memory.STATE, "stride_sums", "result"))
        self._go(0)
        self._put(kept)

    def _copy(self, names: Sequence[str]) -> dict[str, NDArray[Any]]:
        return {name: getattr(self._memory, name).copy() for name in names}

    def _put(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        for name, values in arrays.items():
            getattr(self._memory, name)[:] = values

    # What it reports

    @property
    def state(self) -> dict[str, Floats]:
        """The state by name: rows of `layout.TRUNK_STATE`, shape (num_envs,), and of `leg_state`, shape
        (legs, num_envs)."""
        return self._named(layout.TRUNK_STATE + layout.leg_state(self.features))

    @property
    def report(self) -> dict[str, Floats]:
        """What acts at the present instant: `layout.TRUNK_REPORT` and `LEG_REPORT` by name."""
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
        """The open stance and the sums of the last call by name, `layout.STRIDES` and `stride_sums`, shape
        (legs, num_envs); see `observables`. Zeros unless the engine was made with `strides=True`."""
        m = self._memory
        whole = np.concatenate([m.strides, m.stride_sums], axis=1)
        return {
            name: whole[:, k] for k, name in enumerate(layout.STRIDES + layout.stride_sums(self.features))
        }

    def reactions(self) -> Reactions:
        """Joint reactions at the present instant: of joints, shape (legs, 20, 2, num_envs), and the moments,
        shape (legs, num_envs).

        Raises:
            ParameterError: the engine was not made with `reactions=True`.
        """
        if not self.reacts:
            raise ParameterError("reactions: expected an engine made with reactions=True, got one without")
        rows = self._memory.reactions[:, :, : self.num_envs]
        legs, _, n = rows.shape
        parts = {name: rows[:, ReactionRows.rows(name)].copy() for name in ReactionRows.fields}
        joints = parts.pop("joints").reshape(legs, -1, 2, n)
        return Reactions(joints, **{name: part[:, 0] for name, part in parts.items()})

    def tally(self) -> Tally:
        """Momentum, spin and energy of all bodies at the present instant, added up anew from their motion."""
        return tally_of(self)

    def messages(self) -> list[str]:
        """How each environment ended, for people."""
        never = np.isnan(self._memory.trunk).all(0)
        return [
            "this environment was never reset" if new else Result(int(code)).message
            for code, new in zip(self._memory.result, np.atleast_1d(never), strict=True)
        ]
