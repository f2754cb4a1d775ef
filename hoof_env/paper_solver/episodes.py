"""Engine that solves as the paper does (Eq. 8, `paper_solver.solver`), with the interface of `TrunkEngine`.

It has the same memory, so that kernels which read commands, rewards and observations there are the same. It
solves one environment after the other and is some ten thousand times slower.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import astuple
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.layout import LEG_REPORT, LEG_STATE, TRUNK_REPORT, TRUNK_STATE, stride_sums
from hoof_env.dynamics.memory import LIFT_OFF, env_indices
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
        ("normal_force", "f8"),
        ("running", "f8"),
        ("count", "i8"),
        ("impulse", "f8"),
        ("loaded", "f8"),
    ]
)
"""Record type of a stance, fields of `dynamics.observables.StanceCounter`, and of the impulse of the normal
force [N s] and the time under load [s] over the episode."""

OWN_STATE = ("legs", "accounts", "last")
"""Parts of a state that are the solver's own."""

APART = 1.0
"""Largest violation of the constraints [m, rad]: beyond it the solution has diverged, even if its numbers are
finite, up to 1e300."""


class Scheme(NamedTuple):
    """Time step [s], Baumgarte's parameters [1/s] and name of the scheme with which Eq. 8 is integrated."""

    sim_dt: float
    alpha: float
    beta: float
    integrator: str


def check_settings(settings: object) -> None:
    """Check that the solver supports the settings of an environment, `tasks.settings.Settings`.

    Raises:
        ParameterError: it does not.
    """
    only = {
        "trunk": "fixed",
        "drive": "prescribed",
        "terrain": None,
        "randomize": None,
        "schedule": None,
        "hoof_stiffness": None,
    }
    for name, expected in only.items():
        value = getattr(settings, name)
        # An empty mapping is equivalent to None.
        if value != expected and not (expected is None and not value):
            raise ParameterError(f'{name}: expected {expected!r} with solver="paper", got {value!r}')


class PaperEngine(TrunkEngine):
    """Legs on a fixed trunk, solved as in the paper.

    Attributes:
        legs: solvers, one for each environment.
        traces: rows of the last control step of each leg; a single row after a start or a failure.
        apart: True for legs with a violation of the constraints above `APART` in the last control step, which
            then failed; shape (num_envs,).

    Args:
        scheme: how they are integrated.
        arguments, named: arguments of `TrunkEngine`.
    """

    in_kernels: ClassVar[bool] = False

    def __init__(self, scheme: Scheme, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self.scheme = scheme
        # Kernels beside the solver run one environment after the other, too, in one thread.
        self.runs_scalar = True
        self.blocks = [range(self.columns)]
        self.legs = [self._new_leg() for _ in range(self.num_envs)]
        self.traces = [new_trace(1) for _ in self.legs]
        self.apart = np.zeros(len(self.legs), bool)
        self._accounts: Records = np.zeros(len(self.legs), ACCOUNT)

    def _new_leg(self) -> ConstrainedLeg:
        """Make a solver for the present leg and ground."""
        scheme = self.scheme
        return ConstrainedLeg(
            self.limbs[0].geometry,
            self.ground,
            scheme.sim_dt,
            self.filters,
            scheme.alpha,
            scheme.beta,
            scheme.integrator,
            self.trunk.height,
        )

    def reset(
        self,
        gaits: Any,
        crank_angle: ArrayLike = 0.0,
        *,
        x: ArrayLike = 0.0,
        envs: ArrayLike | None = None,
        **trunk: Any,
    ) -> None:
        """Start environments; see `TrunkEngine.reset`."""
        super().reset(gaits, crank_angle, x=x, envs=envs, **trunk)
        where = env_indices(envs, self.num_envs)
        memory = self._memory
        self.adopt(where)
        angles = np.broadcast_to(crank_angle, (1, where.size))[0].tolist()
        places = np.broadcast_to(x, where.shape).tolist()
        for env, angle, place in zip(where.tolist(), angles, places, strict=True):
            gait = GaitParameters.from_array(memory.command[0, :, env])
            self.traces[env] = self.legs[env].reset(gait, angle, x=place)
            self._accounts[env] = np.zeros((), ACCOUNT)
            self._write(env)

    def adopt(self, envs: NDArray[np.int64]) -> None:
        """Solve environments on the present ground from now on, each from its present state."""
        for env in envs.tolist():
            leg = self._new_leg()
            leg.state = self.legs[env].state
            self.legs[env] = leg

    def take_step(self, steps: int) -> None:
        """Take a control step of `steps` time steps of all legs, under the commands in memory."""
        memory = self._memory
        for env, leg in enumerate(self.legs):
            trace = new_trace(steps)
            before = leg.state.copy()
            # Only the last row, which stays if the step fails.
            self.traces[env] = self.traces[env][-1:]
            result = leg.advance(memory.command[0, :, env], trace)
            self.apart[env] = result is Result.OK and np.abs(leg.closure().error).max() > APART
            if self.apart[env]:
                result = Result.NOT_FINITE
                leg.state = before
            memory.result[env] = result
            memory.stride_sums[:, :, env] = 0.0
            if result is Result.OK:
                self.traces[env] = trace
                sums = self._sum(env, trace)
                memory.stride_sums[0, :, env] = [sums[name] for name in stride_sums()]
                self._write(env)

    def snapshot(self) -> Any:
        """Return a copy of everything that changes, for `restore`."""
        states = [leg.state.copy() for leg in self.legs]
        own = [*self.legs], states, [*self.traces], self._accounts.copy(), self.apart.copy()
        return super().snapshot(), own

    def restore(self, snapshot: Any) -> None:
        """Restore what `snapshot` returned of this engine."""
        memory, own = snapshot
        super().restore(memory)
        self._restore(own, range(self.num_envs))

    def _restore(self, own: Any, envs: Sequence[int]) -> None:
        """Restore the solver's part of a snapshot in some environments."""
        legs, states, traces, accounts, apart = own
        for env in envs:
            self.legs[env] = legs[env]
            self.legs[env].state = states[env]
            self.traces[env] = traces[env]
            self._accounts[env] = accounts[env]
            self.apart[env] = apart[env]

    @contextmanager
    def only(self, envs: NDArray[np.int64]) -> Iterator[None]:
        """Restore all environments but some after a block."""
        _, own = self.snapshot()
        try:
            with super().only(envs):
                yield
        finally:
            self._restore(own, np.setdiff1d(np.arange(self.num_envs), envs).tolist())

    def observe_again(self, envs: NDArray[np.int64]) -> None:
        """Leave the report as it is: a step that failed has not changed it."""

    def observe(self) -> None:
        """Leave the report as it is: it is always of the present state."""

    def end_reader(self, env: int) -> Callable[[], Any]:
        """Return a function that returns the record of the last control step: the solver cannot run substeps
        again."""
        return lambda: self.record(env)

    def failure(self, env: int) -> str:
        """Return why the last step of an environment failed, "" if it did not."""
        if self.apart[env]:
            return "the linkage came apart; the state was put back to the last good one"
        return super().failure(env)

    def record(self, env: int) -> dict[str, Floats]:
        """Return the rows of the last control step by name, in the shapes of `TrunkEngine.run`; see
        `Recording.last`."""
        trace = self.traces[env]
        of_trunk = {*TRUNK_STATE, *TRUNK_REPORT}
        shapes = {name: (-1, 1) if name in of_trunk else (-1, 1, 1) for name in TRACE.names or ()}
        return {name: trace[name].reshape(shape).copy() for name, shape in shapes.items()}

    def get_state(self) -> dict[str, Any]:
        """Return copies of everything that changes."""
        return super().get_state() | {
            "legs": [leg.state.to_arrays() for leg in self.legs],
            "accounts": self._accounts.copy(),
            "last": np.array([trace[-1] for trace in self.traces]),
        }

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restore what `get_state` returned.

        Raises:
            ParameterError: see `TrunkEngine.set_state`; nothing has changed then.
        """
        legs, accounts, last = self._read(state)
        super().set_state({name: values for name, values in state.items() if name not in OWN_STATE})
        self._accounts = accounts
        for env, (leg, leg_state) in enumerate(zip(self.legs, legs, strict=True)):
            leg.state = leg_state
            self.traces[env] = last[env : env + 1]
            self._write(env)

    def _read(self, state: Any) -> tuple[list[ConstrainedState], Records, Records]:
        """Check the solver's part of a state and convert it.

        Raises:
            ParameterError: it is not one of as many legs.
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
                f"state: expected what get_state returns for {len(self.legs)} legs of the paper's solver, got"
                f" {state!r:.60}"
            ) from None
        return legs, accounts, last

    @staticmethod
    def repeated(state: Mapping[str, Any], n: int) -> dict[str, Any]:
        """Return the state of an engine of one environment as one of n environments."""
        arrays = {name: values for name, values in state.items() if name not in OWN_STATE}
        own: dict[str, Any] = {"legs": [*state["legs"]] * n}
        own |= {name: np.repeat(state[name], n) for name in ("accounts", "last")}
        return TrunkEngine.repeated(arrays, n) | own

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes of a copy, which has solvers of its own."""
        own = {"legs": self.legs, "traces": self.traces, "apart": self.apart, "_accounts": self._accounts}
        return super().__getstate__() | copy.deepcopy(own)

    def _write(self, env: int) -> None:
        """Write the present state and report of a leg into the engine's memory."""
        memory = self._memory
        last = self.traces[env][-1]
        memory.trunk[:, env] = [last[name] for name in TRUNK_STATE]
        memory.trunk_report[:, env] = [last[name] for name in TRUNK_REPORT]
        memory.limbs[0, :, env] = [last[name] for name in LEG_STATE]
        memory.limb_report[0, :, env] = [last[name] for name in LEG_REPORT]
        account = self._accounts[env]
        of_stance = ["open", "began", "peak", "steepest", "normal_force", "running"]
        memory.strides[0, :, env] = account[of_stance].item()

    def _sum(self, env: int, trace: Records) -> dict[str, float]:
        """Return the `layout.StrideSums` of a control step by name, and update the account of the episode.
        The engine's kernels have the same sums in `dynamics.observables.count_stride`."""
        h = self.legs[env].sim_dt
        *stance, impulse_before, loaded_before = self._accounts[env].item()
        threshold = LIFT_OFF * self.weight
        since = StanceCounter(threshold, *stance)
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
        growth = higher = steeper = work = backward_travel = slip = 0.0
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
                backward_travel -= h * slid / n
            # Sliding counts in stance only, not under the small forces of landing and lift-off.
            if n > threshold:
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
            "backward_travel": backward_travel,
            "slip": slip,
        }
