"""The paper's solver (Eq. 8, `paper_solver.solver`) in place of the engine's kernels.

It reads commands from the engine's memory and writes there the values that reward and observation read, so
that these are the same for both. It solves one environment after the other and is some ten thousand times
slower.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.layout import LEG_REPORT, LEG_STATE, TRUNK_REPORT, TRUNK_STATE, stride_sums
from hoof_env.dynamics.memory import LIFT_OFF, Memory, memory_of
from hoof_env.dynamics.observables import StanceCounter
from hoof_env.dynamics.parts import Result
from hoof_env.errors import ParameterError
from hoof_env.gait import GaitParameters
from hoof_env.paper_solver.solver import TRACE, ConstrainedLeg, ConstrainedState, new_trace

Floats = NDArray[np.float64]
Records = NDArray[np.void]

ACCOUNT = np.dtype(
    [
        ("open", "?"),
        ("began", "f8"),
        ("peak", "f8"),
        ("steepest", "f8"),
        ("load", "f8"),
        ("running", "f8"),
        ("count", "i8"),
        ("impulse", "f8"),
        ("loaded", "f8"),
    ]
)
"""Record type of a stance, fields of `dynamics.observables.StanceCounter`, and of the impulse of the normal
force [N s] and the time under load [s] over the episode."""

APART = 1.0
"""Largest violation of the constraints [m, rad]: beyond it the solution has diverged, even if its numbers are
finite, up to 1e300."""


class Scheme(NamedTuple):
    """Time step [s], Baumgarte's parameters [1/s] and name of the scheme with which Eq. 8 is integrated."""

    sim_dt: float
    alpha: float
    beta: float
    integrator: str


class PaperSolver:
    """Legs solved as in the paper, one for each environment of an engine.

    Attributes:
        legs: solvers, one for each environment.
        traces: rows of the last control step of each leg; a single row after a start or a failure.
        apart: True for legs with a violation of the constraints above `APART` in the last control step, which
            then failed; shape (num_envs,).

    Args:
        scheme: how they are integrated.
        engine: engine with the memory that the solver reads and writes.
        substeps: substeps of a control step.
    """

    def __init__(self, scheme: Scheme, engine: TrunkEngine, substeps: int) -> None:
        self.engine = engine
        self.substeps = substeps
        self.legs = [
            ConstrainedLeg(
                engine.limbs[0].geometry,
                engine.ground,
                scheme.sim_dt,
                engine.filters,
                scheme.alpha,
                scheme.beta,
                scheme.integrator,
                engine.trunk.height,
            )
            for _ in range(engine.num_envs)
        ]
        self.traces = [new_trace(1) for _ in self.legs]
        self.apart = np.zeros(len(self.legs), bool)
        self._accounts: Records = np.zeros(len(self.legs), ACCOUNT)
        self._threshold = LIFT_OFF * engine.weight

    def start(self, envs: Sequence[int], gaits: Floats, crank_angle: Floats, x: Floats) -> None:
        """Start some environments.

        Args:
            envs: environments that start.
            gaits: gait parameters, shape (len(envs), 4).
            crank_angle: crank angles [rad], shape (len(envs),).
            x: places of O [m], shape (len(envs),).
        """
        for k, env in enumerate(envs):
            gait = GaitParameters.from_array(gaits[k])
            self.traces[env] = self.legs[env].reset(gait, float(crank_angle[k]), x=float(x[k]))
            self._accounts[env] = np.zeros((), ACCOUNT)
            self._put(env, self._memory())

    def advance(self) -> None:
        """Take one control step of all legs, under the commands in the engine's memory."""
        memory = self._memory()
        for env, leg in enumerate(self.legs):
            trace = new_trace(self.substeps)
            kept = leg.state.copy()
            # Only the last row, which stays if the step fails.
            self.traces[env] = self.traces[env][-1:]
            result = leg.advance(memory.command[0, :, env], trace)
            self.apart[env] = result is Result.OK and np.abs(leg.closure().error).max() > APART
            if self.apart[env]:
                result = Result.NOT_FINITE
                leg.state = kept
            memory.result[env] = result
            memory.stride_sums[:, :, env] = 0.0
            if result is Result.OK:
                self.traces[env] = trace
                sums = self._sum(env, trace)
                memory.stride_sums[0, :, env] = [sums[name] for name in stride_sums()]
                self._put(env, memory)

    def record(self, env: int) -> dict[str, Floats]:
        """Return the rows of the last control step by name, in the shapes of `TrunkEngine.run`; see
        `Recording.last`."""
        trace = self.traces[env]
        of_trunk = {*TRUNK_STATE, *TRUNK_REPORT}
        shapes = {name: (-1, 1) if name in of_trunk else (-1, 1, 1) for name in TRACE.names or ()}
        return {name: trace[name].reshape(shape).copy() for name, shape in shapes.items()}

    def get_state(self) -> dict[str, Any]:
        """Return everything that changes outside the engine's memory."""
        return {
            "legs": [leg.state.to_arrays() for leg in self.legs],
            "accounts": self._accounts.copy(),
            "last": np.array([trace[-1] for trace in self.traces]),
        }

    def read_state(self, state: Any) -> tuple[list[ConstrainedState], Records, Records]:
        """Check a state of `get_state` and convert it to the arguments of `set_state`.

        Raises:
            ParameterError: `state` is not one of as many legs.
        """
        try:
            pairs = zip(self.legs, state["legs"], strict=True)
            legs = [ConstrainedState.from_arrays(values, len(leg.state.q)) for leg, values in pairs]
            accounts = np.array(state["accounts"], ACCOUNT)
            last = np.array(state["last"], TRACE)
            if not len(accounts) == len(last) == len(legs):
                raise ValueError
            if not np.isfinite([(leg.q, leg.qd) for leg in legs]).all():
                raise ValueError
        except (KeyError, TypeError, ValueError, AttributeError, IndexError):
            raise ParameterError(
                f"state['paper']: expected what get_state gives of {len(self.legs)} legs, got {state!r:.60}"
            ) from None
        return legs, accounts, last

    def set_state(self, legs: Sequence[ConstrainedState], accounts: Records, last: Records) -> None:
        """Restore the results of `read_state`, after the engine's memory."""
        self._accounts = accounts
        memory = self._memory()
        for env, (leg, leg_state) in enumerate(zip(self.legs, legs, strict=True)):
            leg.state = leg_state
            self.traces[env] = last[env : env + 1]
            self._put(env, memory)

    def _memory(self) -> Memory:
        """Return views of the engine's memory by name."""
        data, _, _, _, constants, reactions = self.engine.arrays
        return memory_of(data, self.engine.num_envs, constants, reactions, self.engine.features)

    def _put(self, env: int, memory: Memory) -> None:
        """Write the present state and report of a leg into the engine's memory."""
        last = self.traces[env][-1]
        memory.trunk[:, env] = [last[name] for name in TRUNK_STATE]
        memory.trunk_report[:, env] = [last[name] for name in TRUNK_REPORT]
        memory.limbs[0, :, env] = [last[name] for name in LEG_STATE]
        memory.limb_report[0, :, env] = [last[name] for name in LEG_REPORT]
        account = self._accounts[env]
        memory.strides[0, :, env] = account[["open", "began", "peak", "steepest", "load", "running"]].item()

    def _sum(self, env: int, trace: Records) -> dict[str, float]:
        """Return the `layout.StrideSums` of a control step by name, and update the account of the episode.
        The engine's kernels have the same sums in `dynamics.observables.count_stride`."""
        h = self.legs[env].sim_dt
        *stance, impulse_before, loaded_before = self._accounts[env].item()
        since = StanceCounter(self._threshold, *stance)
        impulse = impulse_before
        loaded = loaded_before
        stances = since.count
        normal = trace["toe_normal"] + trace["heel_normal"]
        friction = trace["toe_friction"] + trace["heel_friction"]
        force = np.sqrt(normal * normal + friction * friction)
        sliding = trace["toe_normal"] * trace["toe_slide"] + trace["heel_normal"] * trace["heel_slide"]
        rubbing = trace["toe_normal"] * np.abs(trace["toe_slide"])
        rubbing = rubbing + trace["heel_normal"] * np.abs(trace["heel_slide"])
        powers = trace["crank_power"], trace["hip_power"]
        columns = trace["crank_angle"], normal, force, sliding, rubbing, *powers
        growth = higher = steeper = work = travel = slip = 0.0
        # Substep by substep, in the order in which the engine adds.
        rows = zip(*(values.tolist() for values in columns), strict=True)
        for theta, n, f, slid, rubbed, crank, hip in rows:
            increases = since.add(theta, n, f, h)
            growth = growth + increases[0]
            higher = higher + increases[1]
            steeper = steeper + increases[2]
            work += h * (max(crank, 0.0) + max(hip, 0.0))
            impulse += h * n
            if n > 0.0:
                loaded += h
                travel -= h * slid / n
            # Sliding counts in stance only, not under the small forces of landing and lift-off.
            if n > self._threshold:
                slip += h * rubbed / n
        self._accounts[env] = *astuple(since)[1:], impulse, loaded
        return {
            "peak_grf_increase": growth,
            "running_peak_increase": higher,
            "loading_rate_increase": steeper,
            "highest_grf": force.max(),
            "positive_work": work,
            "normal_impulse": impulse - impulse_before,
            "loaded_time": loaded - loaded_before,
            "stances": since.count - stances,
            "travel": travel,
            "slip": slip,
        }
