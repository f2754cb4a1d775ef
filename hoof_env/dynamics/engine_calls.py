"""Kernels of an engine, with the arguments that they are called with."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from hoof_env.dynamics.advance import ARRAYS, Arrangement, EngineKind, engine_kernel
from hoof_env.simd.compile import Kernel
from hoof_env.simd.memory import Arrays
from hoof_env.simd.threads import run_together


class EngineCalls:
    """Kernels of an engine, and their arguments.

    Args:
        kind: kind of the engine.
        arrangement: environments that are advanced at once.
        model: arrays of the model; calls are reused as long as these are the engine's.
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
