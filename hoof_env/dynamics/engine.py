"""N legs on one trunk in minimal coordinates, for any number of environments at once: the fast, exact engine.

What can move is integrated: the trunk, as momentum and centre of mass of all bodies together, and the crank
of every leg whose drive is a motor. Everything inside a leg follows from its crank angle in closed form, so
loops are closed to round-off at every step of any run. `mechanics` has the equations, `advance` runs them;
this module checks arguments and keeps the state. A number has the same bits alone and in a batch of any size.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics import reactions as r
from hoof_env.dynamics.advance import (
    LEG_ROWS,
    STARTS,
    TRUNK_ROWS,
    advance_kernels,
)
from hoof_env.dynamics.engine_state import STATE, gaits_of, layout, read_state, start, which
from hoof_env.dynamics.layout import (
    ACCOUNT,
    LEG_REPORT,
    LEG_STATE,
    STRIDE_SUMS,
    STRIDES,
    TRUNK_REPORT,
    TRUNK_STATE,
    LegMemory,
)
from hoof_env.dynamics.memory import (
    check_shared,
    columns_for,
    memory_of,
    named_rows,
    new_memory,
    new_model,
    settings_of,
)
from hoof_env.dynamics.observables import Tally, tally
from hoof_env.dynamics.parts import GRAVITY, Drive, Limb, Result, Trunk
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
    finite,
    flag,
    one_of,
)
from hoof_env.gait.gait import FilterSettings, GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.profile import leg_profile
from hoof_env.simd.user_functions import check_function

FEW = 6
"""Up to so many environments of one leg or four are run one by one: eight lanes would be mostly empty."""

MOST_LEGS = 32
"""Legs of an engine; its kernels work on the stack, where eight lanes take 15 kB a leg."""

MOST_STEPS = 10**12
"""Substeps of a call, which are counted in 64 bits."""


class Reactions(NamedTuple):
    """What joints and drives do to the links, in the world; a motor's rotor is not among the links.

    Attributes:
        joints: force on body `i` of each joint of `linkage.JOINTS`, shape (legs, 20, 2, num_envs) [N].
        lock: moment on body 10 by body 7, shape (legs, num_envs) [N m].
        driver: moment on the crank by the leg's frame, shape (legs, num_envs) [N m].
        hip: moment on the leg's frame by the trunk, about O, shape (legs, num_envs) [N m].
    """

    joints: Floats
    lock: Floats
    driver: Floats
    hip: Floats


class TrunkEngine:
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
        num_envs: environments side by side, which share all of the above.
        filters: bounds of the command filters.
        reactions: compute the joint reactions of every step; `reactions()` has those of the last.
        strides: count stances, peak forces and work; `strides` has them.
        contact_law: instead of the ground's normal law, see `hoof.law_of`.

    Attributes:
        is_few: environments are run one by one, not side by side.
        step_limits: longest step [s] for each cause, see `step_length`. Friction is not heeded, for nothing
            blows up: on the ground of `HorseLeg-v0` it asks a horse of 349 kg for 0.14 ms. There forces at
            1 ms agree with those at 16 us to 1 % under hoofs that slide; under hoofs that stand friction is
            off by 2.7 times its size and the normal force by half, at 0.5 ms by 0.4 % and 0.1 %. For clean
            forces at rest use `substeps` of sim_dt / step_limits["friction"], or more `friction_fast`.

    Raises:
        ParameterError: a value is out of range or of the wrong type.
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
        num_envs: int = 1,
        filters: FilterSettings | None = None,
        reactions: bool = False,
        strides: bool = False,
        contact_law: Callable[..., Any] | None = None,
    ) -> None:
        if contact_law is not None:
            check_function("contact_law", contact_law, 4)
        self.contact_law = contact_law
        self.limbs = all_of("limbs", limbs, Limb)
        if len(self.limbs) > MOST_LEGS:
            raise ParameterError(f"limbs: expected at most {MOST_LEGS}, got {len(self.limbs)}")
        self.trunk = one_of("trunk", trunk, Trunk)
        self.ground = Ground() if ground is None else one_of("ground", ground, Ground)
        self.terrain = Terrain.flat() if terrain is None else one_of("terrain", terrain, Terrain)
        self.filters = FilterSettings() if filters is None else one_of("filters", filters, FilterSettings)
        self.integrator = check_choice("integrator", integrator, SCHEMES)
        self.sim_dt = check_number("sim_dt", sim_dt, low=1e-7, high=self.filters.longest_step)
        self.num_envs = count("num_envs", num_envs)
        self.profiles = [leg_profile(limb.geometry) for limb in self.limbs]
        length = StepLength(self.limbs, self.profiles, self.trunk, self.ground, self.terrain, self.integrator)
        self.step_limits = length.limits
        asked = None if substeps is None else count("substeps", substeps, most=MOST_STEPS)
        self.substeps = length.choose(self.sim_dt, asked)
        self.reacts, self.counts_strides = flag("reactions", reactions), flag("strides", strides)
        self.is_few = len(self.limbs) in (1, 4) and self.num_envs <= FEW
        self._choose_kernel()
        self._memory = new_memory(self, self.num_envs if self.is_few else columns_for(self.num_envs))
        self._model = new_model(self)

    def _choose_kernel(self) -> None:
        kernels = advance_kernels(self.contact_law)
        one, four, many = kernels[3:] if self.reacts else kernels[:3]
        self._run = (one if len(self.limbs) == 1 else four) if self.is_few else many

    def __getstate__(self) -> dict[str, Any]:
        """A copy has memory of its own, also a shallow one."""
        m, parts = self._memory, {name: part for name, part in vars(self).items() if name != "_run"}
        return {**parts, "_memory": (m.data.copy(), self.num_envs, m.constants, m.reactions.copy())}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _memory=memory_of(*state["_memory"]))
        self._choose_kernel()

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
        """Put back what `column` gave, of an engine like this one."""
        whole = self._memory.data
        given = finite("column", np.nan_to_num(column))  # numbers; those that are none stay so
        if given.shape != whole.shape[:1]:
            raise ParameterError(f"column: expected shape {whole.shape[:1]}, got {given.shape}")
        whole[:, self._env(env)] = column

    def _env(self, env: Any) -> int:
        return count("env", env, low=0, most=self.num_envs - 1)

    def command_in(self, column: Floats) -> Floats:
        """The command in such a column, shape (legs, 4)."""
        return column[TRUNK_ROWS:].reshape(len(self.limbs), LEG_ROWS)[:, LegMemory.rows("command")].copy()

    def alone(self) -> TrunkEngine:
        """An engine like this one, for one environment."""
        return TrunkEngine(
            self.limbs, self.trunk, self.ground, self.terrain, sim_dt=self.sim_dt, integrator=self.integrator,
            substeps=self.substeps, filters=self.filters, reactions=self.reacts, strides=self.counts_strides,
            contact_law=self.contact_law,
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
            gaits: gait parameters, one for all legs or one each; or as numbers, shape (legs, 4, n).
            theta: crank angles [rad], of shape (), (legs,) or (legs, n) with n the environments that start.
            x, y, pitch, vx, vy, pitch_rate: of the trunk's centre of mass [m, rad, s], shape () or (n,); a
                `y` of None is the trunk's height.
            theta_rate: of motor-driven cranks [rad/s], as theta; None is the commanded speed.
            envs: which environments start, as indices or as a mask of shape (num_envs,); None is all.

        Raises:
            ParameterError: a value is not finite, of the wrong shape or forbidden by the trunk's kind, an
                angle, place or rate is beyond `layout.FARTHEST`, or a leg's links have no place there.
        """
        where, a = which(envs, self.num_envs), self._memory
        values = gaits_of(gaits, len(self.limbs), where.size)
        height = self.trunk.height if y is None else y
        at = {"x": x, "y": height, "pitch": pitch, "vx": vx, "vy": vy, "pitch_rate": pitch_rate}
        a.trunk[:, where], a.limbs[:, :, where] = start(self, values, theta, theta_rate, at, where.size)
        a.command[:, :, where] = values
        a.account[:, where], a.strides[:, :, where] = 0.0, 0.0
        a.result[where] = STARTS
        self._go(-1)

    def vary(
        self, env: int, trunk: Trunk | None = None, ground: Ground | None = None, drive: Drive | None = None
    ) -> None:
        """Give one environment its own masses, springs, ground or motors; it must be reset afterwards.

        Args:
            env: which.
            trunk, ground, drive: instead of the engine's, whose kinds, height, exponent and laws they share;
                None is the engine's own. `total_mass`, `weight`, `tally` and `step_limits` stay those of the
                engine.

        Raises:
            ParameterError: what environments share differs, or there is no such environment.
        """
        env = self._env(env)
        trunk = self.trunk if trunk is None else one_of("trunk", trunk, Trunk)
        ground = self.ground if ground is None else one_of("ground", ground, Ground)
        limbs = [limb if drive is None else replace(limb, drive=drive) for limb in self.limbs]
        check_shared(self, trunk, ground, limbs)
        m = self._memory
        m.trunk_settings[:, env], m.limb_settings[:, :, env] = settings_of(self, trunk, ground, limbs)

    def get_state(self) -> dict[str, Any]:
        """Everything that changes, as arrays of their own: continuing from it is bit-identical."""
        return self._copy(STATE) | {"layout": layout(self)}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Put back what `get_state` gave, and evaluate forces and accelerations there.

        Raises:
            ParameterError: the state belongs to an engine that would go on differently, lacks a part, or has
                numbers that are not finite or beyond `FARTHEST`, in environments that were reset once.
        """
        arrays, reset = read_state(self, self._memory, state)
        self._put(arrays)
        self._memory.result[reset], self._memory.stride_sums[:] = 0.0, 0.0
        self._look()

    # Motion

    def advance(
        self, command: ArrayLike | None = None, steps: int = 1, *, account: bool = True
    ) -> NDArray[np.int64]:
        """Advance by `steps` of `sim_dt` under a command.

        Args:
            command: gait parameters, of shape (4,), (legs, 4) or (legs, 4, num_envs); None keeps the last.
            steps: how many; 0 evaluates forces and accelerations where the state is.
            account: whether to keep `account`.

        Returns:
            How each environment ended, shape (num_envs,), values of `parts.Result`. One that did not end OK
            is left in its last good state, from which this call began; the report is of there.

        Raises:
            ParameterError: the command has a wrong shape or is not finite.
            NotStartedError: no environment was ever reset.
        """
        steps = count("steps", steps, 0, MOST_STEPS // self.substeps)
        if command is not None:
            self._command(command)
        self._go(steps, account)
        if self._memory.result.any():
            if np.isnan(self._memory.trunk).all():
                raise NotStartedError("the engine was asked to move before reset(): expected reset() first")
            if steps:
                self._look()
        return self._memory.result.astype(np.int64)

    def run(
        self, command: ArrayLike | None = None, steps: int = 1, every: int = 1
    ) -> dict[str, NDArray[Any]]:
        """Advance and record `state` and `report` at the start and after each `every` steps, for plots.

        Returns:
            Arrays by name, time on the first axis, and "result", how each environment ended, shape
            (num_envs,). Once one does not end OK all stop, and the record is that up to there.

        Raises:
            ParameterError, NotStartedError: as `advance`.
        """
        steps, every = count("steps", steps, low=0), count("every", every)
        self.advance(command, 0)
        m, rows = self._memory, 1 + -(-steps // every)
        whole = np.empty((*m.data.shape, rows))
        whole[..., 0] = m.data
        for row in range(1, rows):
            self._go(min(every, steps - (row - 1) * every), True)
            if m.result.any():
                self._look()
                rows = row
                break
            whole[..., row] = m.data
        kept = memory_of(whole[..., :rows], self.num_envs, m.constants, m.reactions)
        named = {name: np.moveaxis(values, -1, 0) for name, values in named_rows(kept).items()}
        return named | {"result": self.results}

    def _command(self, command: ArrayLike) -> None:
        given, whole = finite("command", command), self._memory.command
        legs = len(self.limbs)
        if given.shape == (4,) or given.shape == (legs, 4):
            given = given[..., None]
        elif given.shape != whole.shape:
            raise ParameterError(
                f"command: expected shape (4,), ({legs}, 4) or {whole.shape}, got {given.shape}"
            )
        whole[:] = given

    def _go(self, steps: int, account: bool = False) -> None:
        run: Any = self._run
        run(*self.arrays, self.substep, steps * self.substeps, account)

    def _look(self) -> None:
        """Evaluate where the state is, and change nothing but the report."""
        kept = self._copy((*STATE, "stride_sums", "result"))
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
        """The state by name: rows of `layout.TRUNK_STATE`, shape (num_envs,), and of `LEG_STATE`, shape
        (legs, num_envs)."""
        named = named_rows(self._memory)
        return {name: named[name].copy() for name in (*TRUNK_STATE, *LEG_STATE)}

    @property
    def report(self) -> dict[str, Floats]:
        """What acts at the present instant: `layout.TRUNK_REPORT` and `LEG_REPORT` by name."""
        named = named_rows(self._memory)
        return {name: named[name].copy() for name in (*TRUNK_REPORT, *LEG_REPORT)}

    @property
    def account(self) -> dict[str, Floats]:
        """Integrals since the reset by name, `layout.ACCOUNT`, shape (num_envs,)."""
        return {name: self._memory.account[k].copy() for k, name in enumerate(ACCOUNT)}

    @property
    def strides(self) -> dict[str, Floats]:
        """The open stance and the sums of the last call by name, `layout.STRIDES` and `STRIDE_SUMS`, shape
        (legs, num_envs); see `observables`. Zeros unless the engine was made with `strides=True`."""
        names, m = (*STRIDES, *STRIDE_SUMS), self._memory
        whole = np.concatenate([m.strides, m.stride_sums], axis=1)
        return {name: whole[:, k] for k, name in enumerate(names)}

    def reactions(self) -> Reactions:
        """Joint reactions at the present instant.

        Raises:
            ParameterError: the engine was not made with `reactions=True`.
        """
        if not self.reacts:
            raise ParameterError("reactions: expected an engine made with reactions=True, got one without")
        found = self._memory.reactions[:, :, : self.num_envs]
        legs, _, n = found.shape
        parts = {name: found[:, r.Reactions.rows(name)].copy() for name in r.Reactions.fields}
        joints = parts.pop("joints").reshape(legs, -1, 2, n)
        return Reactions(joints, **{name: part[:, 0] for name, part in parts.items()})

    def tally(self) -> Tally:
        """Momentum, spin and energy of all bodies at the present instant, added up anew from their motion."""
        r, s = self.report, self.state
        at = {"x": r["x"], "y": r["y"], "pitch": s["pitch"]} | {k: r[k] for k in ("vx", "vy", "pitch_rate")}
        return tally(self, s["theta"], s["theta_rate"], r["phi"], r["phi_rate"], at)

    def messages(self) -> list[str]:
        """How each environment ended, for people."""
        never = np.isnan(self._memory.trunk).all(0)
        return [
            "this environment was never reset" if new else Result(int(code)).message
            for code, new in zip(self._memory.result, np.atleast_1d(never), strict=True)
        ]
