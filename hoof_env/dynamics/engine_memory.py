"""Memory of an engine as its users see it: states, reports, columns, commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics import engine_states, layout, memory
from hoof_env.dynamics.advance import ARRAYS, EngineKind
from hoof_env.dynamics.form import engine_layout
from hoof_env.dynamics.model import static_of
from hoof_env.dynamics.names import NamedColumns
from hoof_env.dynamics.parts import (
    MOST_IMPULSE,
    Drive,
    Limb,
    Mechanics,
    Motor,
    Reactions,
    Result,
    Trunk,
)
from hoof_env.dynamics.push import push_kernel
from hoof_env.errors import (
    Floats,
    NotStartedError,
    ParameterError,
    all_of,
    count,
    finite,
    one_of,
    spread,
)
from hoof_env.gait import FilterSettings
from hoof_env.ground.contact import Ground
from hoof_env.simd.layout import views


def each_once(envs: ArrayLike | None, num_envs: int) -> NDArray[np.int64]:
    """Return indices as `memory.which` does, of environments that are named once.

    Raises:
        ParameterError: other environments, or one twice: NumPy would add the last of its two values alone.
    """
    where = memory.which(envs, num_envs)
    if np.unique(where).size < where.size:
        raise ParameterError(f"envs: expected each environment once, got {envs!r}")
    return where


class EngineMemory(Mechanics):
    """State, settings and reports of the environments of a `TrunkEngine`."""

    num_envs: int
    sim_dt: float
    substeps: int
    reacts: bool
    filters: FilterSettings
    _memory: memory.Memory
    _model: Any
    _go: Any

    @property
    def arrays(self) -> tuple[NDArray[Any], ...]:
        """First arguments of the kernels of `advance`; their memory stays in place, but a copy has its
        own."""
        m = self._memory
        return (m.data, *self._model, m.constants, m.reactions)

    @property
    def columns(self) -> int:
        """Number of columns of the memory: environments, idle ones included."""
        return int(self._memory.data.shape[1])

    @property
    def results(self) -> NDArray[np.int64]:
        """Results of the last call, values of `parts.Result`, shape (num_envs,)."""
        return self._memory.result.astype(np.int64)

    def column(self, env: int) -> Floats:
        """Return a copy of all memory of one environment: state, settings, command, report; shape (rows,)."""
        return self._memory.data[:, self._env(env)].copy()

    def set_column(self, env: int, column: Floats) -> None:
        """Restore what `column` returned, of an engine like this one.

        Raises:
            ParameterError: another shape, or numbers that are not finite or beyond `layout.MAX_STATE` in an
                environment that was reset.
        """
        m = self._memory
        env = self._env(env)
        try:
            values = np.array(column, dtype=np.float64)
        except (TypeError, ValueError):
            raise ParameterError(f"column: expected numbers, got {column!r}") from None
        if values.shape != m.data.shape[:1]:
            raise ParameterError(f"column: expected shape {m.data.shape[:1]}, got {values.shape}")
        parts = memory.memory_of(values[:, None], 1, m.constants, m.reactions[..., :1], m.features)
        engine_states.check_column(parts, m.limb_settings[..., env : env + 1])
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
        return NamedColumns({name: named[name].copy() for name in names})

    @property
    def account(self) -> dict[str, Floats]:
        """Integrals since the reset by name, `layout.account`, shape (num_envs,)."""
        return {name: self._memory.account[k].copy() for k, name in enumerate(layout.account(self.features))}

    @property
    def strides(self) -> dict[str, Floats]:
        """Open stance and sums of the last call by name, `layout.STRIDES` and `stride_sums`, shape (legs,
        num_envs); see `observables`. Zeros unless the engine was made with `strides=True`."""
        m = self._memory
        whole = np.concatenate([m.strides, m.stride_sums], axis=1)
        return {
            name: whole[:, k] for k, name in enumerate(layout.STRIDES + layout.stride_sums(self.features))
        }

    def reactions(self) -> Reactions:
        """Return the joint reactions at the present instant: of joints, shape (legs, 20, 2, num_envs), and
        the moments, shape (legs, num_envs).

        Raises:
            ParameterError: the engine was not made with `reactions=True`.
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

    def command(self, command: ArrayLike, envs: ArrayLike | None = None) -> None:
        """Command gaits from the next `advance` on, as after a `reset` of some environments.

        Args:
            command: gait parameters, P = 2 + 2 harmonics of them, of shape (P,), (legs, P) or (legs, P, n),
                where n is the number of environments that are commanded.
            envs: environments that are commanded, as indices or as a mask of shape (num_envs,); None is all.

        Raises:
            ParameterError: the command has a wrong shape or is not finite, or there are no such environments.
        """
        gaits = finite("command", command)
        where = memory.which(envs, self.num_envs)
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

    def get_state(self) -> dict[str, Any]:
        """Return copies of all arrays that change; a run that continues from them has the same bits."""
        return self._copy(engine_states.STATE) | {"layout": dict(self._layout)}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned, and evaluate forces and accelerations there.

        Raises:
            ParameterError: the state belongs to an engine that would continue differently, lacks a part, or
                has numbers that are not finite or beyond `layout.MAX_STATE` in environments that were reset
                once.
        """
        arrays, reset = engine_states.read_state(self._layout, self._memory, state)
        result = np.where(reset, 0.0, self._memory.result)
        self._put(arrays)
        self._memory.result[:] = result
        self._go(0)
        # again, because the evaluation also stores contacts and counts stances
        self._put(arrays)
        self._memory.result[:] = result
        self._memory.stride_sums[:] = 0.0

    @cached_property
    def _layout(self) -> dict[str, Any]:
        """Settings that a state must share with the engine. Cached, because its digests take as long as ten
        steps."""
        return engine_states.identity_of(
            self, self.filters, num_envs=self.num_envs, sim_dt=self.sim_dt, substeps=self.substeps
        )

    def observe(self) -> None:
        """Evaluate forces and accelerations at the present state; change only `report` and `reactions`."""
        kept = self._copy((*engine_states.STATE, "stride_sums", "result"))
        self._go(0)
        self._put(kept)

    def push(self, forward: ArrayLike, upward: ArrayLike = 0.0, envs: ArrayLike | None = None) -> None:
        """Push trunks at their centres of mass, and so motors' cranks. Reports show it from the next call on.

        Args:
            forward, upward: impulses [N s], one number, or one for each environment that is pushed.
            envs: environments that are pushed, as indices or as a mask of shape (num_envs,); None is all.

        Raises:
            ParameterError: an impulse beyond `MOST_IMPULSE` or of wrong shape, bad `envs`, or a fixed trunk.
            NotStartedError: no environment was ever reset.
        """
        where = each_once(envs, self.num_envs)
        if np.isnan(self._memory.trunk).all():
            raise NotStartedError("the engine was asked to push before reset(): expected reset() first")
        if self.trunk.kind == "fixed":
            raise ParameterError("push: expected a trunk that moves, got a fixed one")
        pushed = {"forward": forward, "upward": upward}
        push = np.array([spread(name, given, where.shape, MOST_IMPULSE) for name, given in pushed.items()])
        m = self._memory
        moving = views(layout.Moving, m.trunk[layout.TrunkState.rows("moving")])
        place = views(layout.TrunkReport, m.trunk_report).place[:, where]
        if self.trunk.kind == "rail":
            push[1] = 0.0
        if any(isinstance(limb.drive, Motor) for limb in self.limbs):
            named = dict(zip(ARRAYS, self.arrays, strict=True))
            which = np.ascontiguousarray(where, np.int64)
            run = push_kernel(EngineKind(self.features, None, static_of(self._model[0])))
            run(run.parameters[0].hold({**named, "impulses": push, "which": which}))
        moving.momentum[:, where] += push
        if self.trunk.kind == "free":
            off = place - moving.centre[:, where]
            moving.spin[where] += off[0] * push[1] - off[1] * push[0]

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
            env: index of the environment.
            trunk, ground, drive: those of this environment, with the kinds, exponent and laws of the
                engine's; None is the engine's own. `total_mass`, `weight` and `step_limits` stay
                those of the engine.
            limbs: legs of this environment, in other places, with other springs of the hooves or, in an
                engine with `limits`, of other sizes, similar to the engine's (`Geometry.scaled`); their trunk
                needs another height, too. None is the engine's own. Joint reactions are not computed for legs
                of another size. The step stays the one that the engine's own legs and springs need.

        Raises:
            ParameterError: a setting that environments share differs, or there is no such environment.
        """
        env = self._env(env)
        trunk = self.trunk if trunk is None else one_of("trunk", trunk, Trunk)
        ground = self.ground if ground is None else one_of("ground", ground, Ground)
        varied = self.limbs if limbs is None else all_of("limbs", limbs, Limb)
        varied = [limb if drive is None else replace(limb, drive=drive) for limb in varied]
        memory.check_shared(self, trunk, ground, varied)
        if self.reacts and any(
            limb.geometry != mine.geometry for limb, mine in zip(varied, self.limbs, strict=True)
        ):
            raise ParameterError("limbs: expected the engine's own geometries where it computes reactions")
        m = self._memory
        m.trunk_settings[:, env], m.limb_settings[:, :, env] = memory.settings_of(self, trunk, ground, varied)
