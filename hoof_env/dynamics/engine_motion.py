"""Motion of an engine: calls that advance its environments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics import engine_states, layout, memory
from hoof_env.dynamics.advance import ARRAYS, Arrangement, EngineKind, engine_kernel
from hoof_env.dynamics.engine_memory import EngineMemory
from hoof_env.dynamics.limits import CHECK_EVERY
from hoof_env.dynamics.model import static_of
from hoof_env.dynamics.names import NamedColumns
from hoof_env.dynamics.parts import broken
from hoof_env.errors import NotStartedError, count
from hoof_env.simd.compile import Kernel
from hoof_env.simd.memory import Arrays
from hoof_env.simd.threads import run_together
from hoof_env.simd.user_functions import UserFunctionError, user_error

MOST_STEPS = 10**12
"""Largest number of substeps of a call: they are counted in 64 bits."""

PART = 2_000_000
"""Number of substeps, those of all legs added up, that a long call runs in machine code at a time: at most
about a second. Ctrl-C takes effect between two parts. Sums have other last digits than in one part."""

LEAST_PART = 1000
"""Least number of substeps of each environment in such a part."""


class EngineMotion(EngineMemory):
    """Motion of the environments of a `TrunkEngine`."""

    num_threads: int
    blocks: list[range]
    contact_law: Callable[..., Any] | None
    reacts: bool
    _arrangement: Arrangement
    _calls: EngineCalls | None

    @property
    def substep(self) -> float:
        """Length of a substep [s]."""
        return self.sim_dt / self.substeps

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
        """Return kernels and arguments for the present model, which other conditions may have replaced."""
        if self._calls is None or self._calls.model is not self._model:
            kind = EngineKind(self.features, self.contact_law, static_of(self._model[0]), self.reacts)
            self._calls = EngineCalls(
                kind, self._arrangement, self._model, self.arrays, self.blocks, self.num_threads
            )
        return self._calls


class EngineCalls:
    """Kernels of an engine, and their arguments.

    Args:
        kind: kind of the engine.
        arrangement: environments that are advanced at once.
        model: arrays of the model, by which calls are known to be those of the present conditions.
        arrays: all arrays, `TrunkEngine.arrays`.
        blocks: columns of each call.
        num_threads: number of calls at once.
    """

    def __init__(
        self,
        kind: EngineKind,
        arrangement: Arrangement,
        model: Any,
        arrays: tuple[NDArray[Any], ...],
        blocks: list[range],
        num_threads: int,
    ) -> None:
        self.model = model
        self._kind = kind
        self._arrangement = arrangement
        self._num_threads = num_threads
        self._kernels: dict[bool, Kernel] = {}
        named = dict(zip(ARRAYS, arrays, strict=True))
        self._held = [Arrays(kind.arrays).hold(named, block) for block in blocks]

    def kernel(self, is_start: bool) -> Kernel:
        """Return the kernel that advances environments, or that starts them."""
        if is_start not in self._kernels:
            self._kernels[is_start] = engine_kernel(self._kind, self._arrangement, is_start)
        return self._kernels[is_start]

    def run(self, is_start: bool, *arguments: Any) -> None:
        """Run a kernel on all blocks, with the arguments that follow the arrays."""
        kernel = self.kernel(is_start)
        if len(self._held) == 1:
            kernel(self._held[0], *arguments)
        else:
            run_together(kernel, [(held, *arguments) for held in self._held], self._num_threads)
