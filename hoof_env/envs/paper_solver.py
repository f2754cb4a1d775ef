"""The paper's solver (Eq. 8, `dynamics.constrained`) in the place of the engine's kernels.

It takes commands from the engine's memory and writes there what reward and observation read, so that they are
the same for both. One environment after the other, some ten thousand times slower.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import astuple
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.constrained import TRACE, ConstrainedLeg, ConstrainedState, new_trace
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.layout import LEG_REPORT, LEG_STATE, TRUNK_REPORT, TRUNK_STATE, stride_sums
from hoof_env.dynamics.memory import LIFT_OFF, Memory, memory_of
from hoof_env.dynamics.observables import StanceCounter
from hoof_env.dynamics.parts import Result
from hoof_env.errors import ParameterError
from hoof_env.gait import GaitParameters
from hoof_env.tasks.settings import Settings

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
"""A stance as `dynamics.observables.StanceCounter` has it, and over the episode the impulse of the normal
force [N s] and the time under load [s]."""

APART = 1.0
"""A linkage that violates its constraints by more [m, rad] has diverged, though its numbers may still be
finite, up to 1e300."""


def check_paper(settings: Settings) -> None:
    """`ParameterError` where settings ask of the paper's solver what it cannot do."""
    only = {
        "trunk": "fixed",
        "drive": "prescribed",
        "terrain": None,
        "randomize": None,
        "hoof_stiffness": None,
    }
    for name, expected in only.items():
        given = getattr(settings, name)
        if given != expected and not (expected is None and not given):
            raise ParameterError(f'{name}: expected {expected!r} with solver="paper", got {given!r}')


class PaperSolver:
    """Legs solved as in the paper, one for each environment of an engine.

    Attributes:
        legs: the solvers.
        traces: the rows of each one's last control step; the one where it is after a start or a failure.
        apart: whose loops came apart by more than `APART` in the last control step, which then failed.
    """

    def __init__(self, settings: Settings, engine: TrunkEngine, substeps: int) -> None:
        s = settings
        self.engine = engine
        self.substeps = substeps
        self.legs = [
            ConstrainedLeg(
                engine.limbs[0].geometry,
                engine.ground,
                s.sim_dt,
                engine.filters,
                s.baumgarte_alpha,
                s.baumgarte_beta,
                s.integrator,
                engine.trunk.height,
            )
            for _ in range(engine.num_envs)
        ]
        self.traces = [new_trace(1) for _ in self.legs]
        self.apart = np.zeros(len(self.legs), bool)
        self._accounts: Records = np.zeros(len(self.legs), ACCOUNT)
        self._threshold = LIFT_OFF * engine.weight

    def compile(self, gait: GaitParameters) -> None:
        """Have all kernels compiled, or loaded, by a step of a leg that is thrown away."""
        leg = copy.deepcopy(self.legs[0])
        trace = leg.reset(gait)
        leg.advance(gait.to_array(), trace)

    def start(self, envs: Sequence[int], gaits: Floats, crank_angle: Floats, x: Floats) -> None:
        """Start some environments; with gaits, crank angles and places as in `leg_starts.Start`."""
        for k, env in enumerate(envs):
            gait = GaitParameters.from_array(gaits[k])
            self.traces[env] = self.legs[env].reset(gait, float(crank_angle[k]), x=float(x[k]))
            self._accounts[env] = np.zeros((), ACCOUNT)
            self._put(env, self._memory())

    def advance(self) -> None:
        """One control step of all, under the commands in the engine's memory."""
        memory = self._memory()
        for env, leg in enumerate(self.legs):
            trace = new_trace(self.substeps)
            kept = leg.state.copy()
            self.traces[env] = self.traces[env][-1:]
            result = leg.advance(memory.command[0, :, env].copy(), trace)  # not strided, as alone
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
        """What `Recording.last` gives: the rows of the last control step by name, shaped as `TrunkEngine.run`
        shapes them."""
        trace = self.traces[env]
        of_trunk = {*TRUNK_STATE, *TRUNK_REPORT}
        shapes = {name: (-1, 1) if name in of_trunk else (-1, 1, 1) for name in TRACE.names or ()}
        return {name: trace[name].reshape(shape).copy() for name, shape in shapes.items()}

    def get_state(self) -> dict[str, Any]:
        """What changes besides the engine's memory."""
        states = [{name: array.copy() for name, array in vars(leg.state).items()} for leg in self.legs]
        return {
            "legs": states,
            "accounts": self._accounts.copy(),
            "last": np.array([trace[-1] for trace in self.traces]),
        }

    def read_state(self, state: Any) -> tuple[list[ConstrainedState], Records, Records]:
        """What `get_state` gave, as `set_state` takes it; `ParameterError` of anything else."""
        try:
            legs = [_state_like(leg.state, one) for leg, one in zip(self.legs, state["legs"], strict=True)]
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
        """Put back what `read_state` gave, after the engine's memory."""
        self._accounts = accounts
        memory = self._memory()
        for env, (leg, leg_state) in enumerate(zip(self.legs, legs, strict=True)):
            leg.state = leg_state
            self.traces[env] = last[env : env + 1]
            self._put(env, memory)

    def _memory(self) -> Memory:
        data, _, _, _, constants, reactions = self.engine.arrays
        return memory_of(data, self.engine.num_envs, constants, reactions, self.engine.features)

    def _put(self, env: int, memory: Memory) -> None:
        now = self.traces[env][-1]
        memory.trunk[:, env] = [now[name] for name in TRUNK_STATE]
        memory.trunk_report[:, env] = [now[name] for name in TRUNK_REPORT]
        memory.limbs[0, :, env] = [now[name] for name in LEG_STATE]
        memory.limb_report[0, :, env] = [now[name] for name in LEG_REPORT]
        account = self._accounts[env]
        memory.strides[0, :, env] = account[["open", "began", "peak", "steepest", "load", "running"]].item()

    def _sum(self, env: int, trace: Records) -> dict[str, float]:
        """Return the `layout.StrideSums` of a control step by name; the account goes on."""
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
        columns = trace["theta"], normal, force, sliding, rubbing, *powers
        growth = higher = steeper = work = travel = slip = 0.0
        rows = zip(*(values.tolist() for values in columns), strict=True)
        for theta, n, f, slid, rubbed, crank, hip in rows:
            grown = since.add(theta, n, f, h)
            growth = growth + grown[0]
            higher = higher + grown[1]
            steeper = steeper + grown[2]
            work += h * (max(crank, 0.0) + max(hip, 0.0))
            impulse += h * n
            if n > 0.0:
                loaded += h
                travel -= h * slid / n
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


def _state_like(own: ConstrainedState, given: Mapping[str, Any]) -> ConstrainedState:
    """A copy of a given state with the types and shapes of one's own: kernels take NumPy's records and write
    to them, but `np.array` makes arrays of them, and to those of a pickle nothing can be written."""
    parts = {name: np.array(given[name], v.dtype).reshape(v.shape)[()] for name, v in vars(own).items()}
    return ConstrainedState(**parts)
