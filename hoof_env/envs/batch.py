"""Episodes of a task, one or many at once: what the single and the vector environment share.

`EpisodeBatch` knows arrays and generators and nothing of Gymnasium. A row has the same bits whatever the
number of its neighbours: starts are drawn from a generator of its own, and the kernels are those of
`episode`, compiled for one environment or for several side by side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.advance import LIMB, TRUNK, TRUNK_ROWS
from hoof_env.dynamics.drive import LARGEST, Drive
from hoof_env.dynamics.integrators import INTEGRATORS
from hoof_env.dynamics.limb import Limb
from hoof_env.dynamics.result import Result
from hoof_env.dynamics.schemes import SCHEMES
from hoof_env.dynamics.step_length import StepLength
from hoof_env.dynamics.trunk import GRAVITY, ONE_LEG, Trunk
from hoof_env.dynamics.trunk_engine import TrunkEngine
from hoof_env.envs import episode as e
from hoof_env.envs.grounds import make_terrain
from hoof_env.envs.infos import AT_MEASURED, BEGUN, GAIT, MEASUREMENTS, START, SUMS, named
from hoof_env.envs.observation import GROUPS, HALF_RANGE, HIGH, LOW, MIDDLE, check_groups, entries, places
from hoof_env.envs.paper_solver import PaperSolver, check_paper
from hoof_env.envs.parameters import (
    check_parameters,
    draw_parameters,
    extremes,
    pair,
    physics,
    resolved,
    substeps_of,
)
from hoof_env.envs.reward import RewardWeights
from hoof_env.envs.start import HIGHEST, LOWEST, check_options, draw_starts
from hoof_env.envs.summary import summary_of
from hoof_env.envs.tasks import Settings, Task
from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.gait.parameters import GaitParameters, gait_names, load_gait
from hoof_env.ground.contact import Ground
from hoof_env.ground.preset import load_ground
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.profile import leg_profile

Floats = NDArray[np.float64]

LONGEST_EPISODE = 1e6
"""Seconds of an episode at most."""

MOST_BAUMGARTE = 1e6
"""Largest parameter of Baumgarte's [1/s]; a substep of 1 us integrates no larger one."""


class EpisodeBatch:
    """`num_envs` episodes of a task.

    Attributes:
        task, settings: what it is.
        engine: the mechanics of all.
        names: of the observation's entries.
        kernel, desk: one control step of all is `kernel(desk)`; then comes `follow`.
        episode: memory of the episodes, rows as in `episode`, shape (EPISODE_ROWS, columns).
        begun: what they started with: rows `infos.START`, the gait and what `randomize` drew, a column an
            environment; not a number where a state does not say.

    Raises:
        ParameterError: a setting is out of range or of the wrong type.
    """

    def __init__(self, task: Task, settings: Settings, num_envs: int) -> None:
        self.task, self.num_envs = task, num_envs
        self.settings = s = resolved(settings)
        is_paper = s.solver == "paper"
        check_choice("trunk", s.trunk, ONE_LEG)
        check_choice("integrator", s.integrator, INTEGRATORS if is_paper else SCHEMES)
        check_choice("drive", s.drive, ("prescribed", "motor"))
        for name in ("baumgarte_alpha", "baumgarte_beta"):
            check_number(name, getattr(s, name), low=0.0, high=MOST_BAUMGARTE)
        for name in ("motor_gain", "motor_torque", "motor_inertia"):
            check_number(name, getattr(s, name), low=0.0, high=LARGEST)
        self.randomize = {} if s.randomize is None else check_parameters("randomize", s.randomize, s)
        self._terrain, self._found_good = make_terrain(s.terrain), ""
        if is_paper:
            check_paper(s)
        self.geometry = load_geometry(s.preset)
        load_ground(s.preset)  # what is wrong with it is said, also where the settings replace it
        self.gaits = {name: load_gait(name, s.preset) for name in gait_names(s.preset)}
        self.gait = None if s.gait is None else self.gaits[check_choice("gait", s.gait, self.gaits)]
        self._base = MIDDLE if self.gait is None else self.gait.to_array()
        self.weights = RewardWeights.of(s.reward_weights)
        self.substeps = substeps_of(s.dt, s.sim_dt)
        self.dt = s.sim_dt * self.substeps
        low = self.dt * (1 - 1e-9)
        self.episode_seconds = check_number(
            "episode_seconds", s.episode_seconds, low=low, high=LONGEST_EPISODE
        )
        self.steps_per_episode = round(s.episode_seconds / self.dt)
        nominal = self.geometry.hip_height
        height = nominal if s.hip_height is None else s.hip_height
        self.height = check_number("hip_height", height, low=LOWEST * nominal, high=HIGHEST * nominal)
        self.groups = check_groups(s.observation, GROUPS)
        self.target_speed = None if s.target_speed is None else pair("target_speed", s.target_speed, -20.0)
        self.target_seconds = pair("target_seconds", s.target_seconds, self.dt if self.target_speed else 0.0)
        for group, needed in (("target", "target_speed"), ("ground", "terrain")):
            given = getattr(s, needed)
            if group in self.groups and given in (None, {}):
                raise ParameterError(
                    f"observation: {group!r} is constant without {needed}, got {needed}={given!r}"
                )
        trunk, ground, drive = self._physics({})
        substeps = None
        if self.randomize:
            substeps = max(self._parts(corner, None) for corner in ({}, *extremes(self.randomize)))
        self.engine = TrunkEngine(
            Limb(self.geometry, drive=drive), trunk, ground, self._terrain, substeps=substeps,
            sim_dt=s.sim_dt, integrator="midpoint" if is_paper else s.integrator,
            num_envs=num_envs, strides=True,
        )  # fmt: skip
        self.paper = PaperSolver(s, self.engine, self.substeps) if is_paper else None
        self._varied = np.zeros(num_envs, bool)
        self.begun = np.full((BEGUN + len(self.randomize), num_envs), np.nan)
        self.names = [entry[0] for entry in entries(self.groups, s.trunk)]
        if not self.names:
            raise ParameterError(f"observation: nothing of {s.observation!r} is observed on a fixed trunk")
        columns = self.engine.columns
        self.episode = np.zeros((e.EPISODE_ROWS, columns))
        self.episode[e.ACTION : e.ACTION + e.ACTIONS] = 0.0
        self.episode[e.WEIGHT] = self.engine.weight
        self.actions = np.zeros((columns, e.ACTIONS), np.float32)
        self.seen = np.zeros((columns, len(self.names)), np.float32)
        self._task = self._task_record()
        self._open()
        self._compile()

    def _physics(self, changes: Mapping[str, float]) -> tuple[Trunk, Ground, Drive]:
        """Trunk, ground and drive with some settings changed."""
        return physics(self.settings, self.height, changes)

    def _task_record(self) -> NDArray[Any]:
        found = np.zeros(1, e.TASK)
        task = found[0]
        task["base"], task["middle"] = self._base, MIDDLE
        task["half"], task["low"], task["high"] = HALF_RANGE, LOW, HIGH
        task["rate_bound"] = self.engine.filters.to_array()[:, 1]
        w = self.weights
        task["weights"] = w.progress, w.peak, w.energy, w.action, w.failure, w.support
        task["failure_seconds"] = self.episode_seconds
        task["h"], task["substeps"] = self.engine.substep, self.substeps * self.engine.substeps
        task["dt"], task["episode_steps"] = self.dt, self.steps_per_episode
        task["height"] = self.height
        task["lowest"], task["highest"] = LOWEST * self.height, HIGHEST * self.height
        task["stays"], task["sees_ground"] = self.settings.trunk == "fixed", "ground" in self.groups
        task["count"], task["places"] = len(self.names), places(self.names, e.ENTRIES)
        return found

    def _open(self) -> None:
        """Make the desk: addresses of the arrays as they are now."""
        one, many = (e.step_one, e.look_one), (e.step_batch, e.look_batch)
        self.kernel, self._look = one if self.engine.is_few or self.paper else many
        if self.paper:
            self.kernel = self._step_paper
        arrays = (*self.engine.arrays, self.episode, self._task, self.actions, self.seen)
        slots = [[a.ctypes.data, *a.shape, *[0] * (3 - a.ndim)] for a in arrays]
        self.desk = np.array(slots, np.int64).ravel()

    def _compile(self) -> None:
        """Have every kernel of a step compiled, or loaded, by running it on no environment: what a parent
        makes warms the cache for its workers."""
        nobody, gait = self.desk.copy(), GaitParameters.from_array(MIDDLE)
        nobody[2] = 0  # columns
        for run in (e.take_one, e.judge_one) if self.paper else (self.kernel,):
            run(nobody)
        if self.paper:
            self.paper.compile(gait)
        self._look(nobody)
        self.engine.reset(gait, envs=[])

    def _step_paper(self, desk: NDArray[np.int64]) -> int:
        """As `episode.step_one`, with the paper's solver."""
        assert self.paper
        if not e.take_one(desk):
            return e.NOT_A_NUMBER
        self.paper.advance()
        said: int = e.judge_one(desk)
        return said

    # Episodes

    def limit(self, steps: int) -> None:
        """Truncate episodes after so many control steps, if not before."""
        self.steps_per_episode = min(steps, self.steps_per_episode)
        self._task["episode_steps"] = self.steps_per_episode

    def check_options(self, options: Any) -> dict[str, Any]:
        """Reset options as `reset` takes them; whatever can be wrong with them is found here, so that a
        refused reset changes nothing.

        Raises:
            ParameterError: an unknown option, or a value out of range.
        """
        s = self.settings
        checked = check_options(options, self.gaits, self.engine.trunk, s)
        if self.paper and checked.get("parameters"):
            raise ParameterError(
                f"options['parameters']: expected none with solver=\"paper\", got {checked['parameters']!r}"
            )
        self._check_extremes(self.randomize | checked.get("parameters", {}))
        return checked

    def _check_extremes(self, parameters: Mapping[str, float | tuple[float, float]]) -> None:
        """Raise where something that can be drawn is out of range, warn where it needs shorter substeps."""
        if parameters and self._found_good != (words := repr(parameters)):
            for corner in extremes(parameters):
                self._parts(corner, self.engine.substeps)
            self._found_good = words

    def _parts(self, changes: Mapping[str, float], asked: int | None) -> int:
        """Into how many parts `sim_dt` is cut with some settings changed, see `StepLength.choose`."""
        trunk, ground, drive = self._physics(changes)
        limb, s = Limb(self.geometry, drive=drive), self.settings
        profiles = [leg_profile(self.geometry)]
        length = StepLength((limb,), profiles, trunk, ground, self._terrain, s.integrator)
        return length.choose(s.sim_dt, asked, stacklevel=5)

    def reset(
        self,
        envs: Sequence[int] | NDArray[np.int64],
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> dict[str, Any]:
        """Start episodes in some environments.

        Args:
            envs: which.
            generators: of each of them.
            options: as `check_options` gives them.

        Returns:
            What was drawn, by name, one row an environment: gaits, crank_angle, speed, height, x; and
            "parameters", those of this episode by name.
        """
        which, columns = np.asarray(envs, np.int64), self.episode
        options = {**self.task.start, **options}
        parameters = self.randomize | options.get("parameters", {})
        drawn = {name: np.zeros(len(which)) for name in parameters}
        if parameters or self._varied[which].any():  # what was set for one episode is not for the next
            for k, (env, generator) in enumerate(zip(which, generators, strict=True)):
                values = draw_parameters(parameters, generator)
                for name, value in values.items():
                    drawn[name][k] = value
                trunk, ground, drive = self._physics(values)
                self.engine.vary(int(env), trunk, ground, drive)
                columns[e.WEIGHT, env] = (trunk.mass + self.geometry.mass) * GRAVITY
            self._varied[which] = bool(parameters)
        start = draw_starts(
            options, generators, self.engine.profiles[0], self.engine.trunk, self.gaits, self.engine.terrain,
            self.gait,
        )  # fmt: skip
        self.engine.reset(
            start.gaits.T[None],
            start.crank_angle[None],
            x=start.x,
            y=start.height,
            vx=start.speed,
            envs=which,
        )
        begun = [*(getattr(start, name) for name in START), *start.gaits.T]
        self.begun[:, which] = [*begun, *(drawn[name] for name in self.randomize)]
        columns[e.ACTION : e.ACTION + 4, which] = self.action_for(start.gaits).T
        columns[e.STEPS, which], columns[e.BEFORE, which], columns[e.ENDED, which] = 0.0, start.x, 0.0
        columns[e.TIME : e.HIGHEST + 1, which] = 0.0
        columns[e.TERM : e.TERM + len(e.TERMS), which] = 0.0
        columns[e.TARGET, which], columns[e.SWITCH, which] = np.inf, np.inf
        if self.target_speed:
            for env, generator in zip(which, generators, strict=True):
                columns[e.TARGET, env] = generator.uniform(*self.target_speed)
                self._draw_target(int(env), generator)
        if self.paper:
            self.paper.start(which.tolist(), start.gaits, start.crank_angle, start.x)
        self._look(self.desk)
        return {**vars(start), "parameters": drawn}

    def _draw_target(self, env: int, generator: np.random.Generator) -> None:
        """Draw the next commanded speed, and when."""
        assert self.target_speed
        now = self.episode[e.STEPS, env]
        self.episode[e.SWITCH, env] = now + round(generator.uniform(*self.target_seconds) / self.dt)
        self.episode[e.NEXT_TARGET, env] = generator.uniform(*self.target_speed)

    def step(self, generators: Sequence[np.random.Generator], idle: NDArray[np.bool_] | None = None) -> bool:
        """One control step under `actions`; returns whether any episode ended.

        Args:
            generators: of all environments.
            idle: those whose episode is over, shape (num_envs,): nothing is drawn for them.

        Raises:
            ParameterError: an action is not a number; nothing has happened then.
        """
        return self.follow(self.kernel(self.desk), generators, idle)

    def follow(
        self, said: int, generators: Sequence[np.random.Generator], idle: NDArray[np.bool_] | None = None
    ) -> bool:
        """`step` after its kernel, which said so."""
        if said < 0:
            raise ParameterError("action: expected finite numbers, got some that are not")
        if said & 1 and not self.paper and self.engine.results.any():
            self._look_again()
        if said & e.SWITCHED:
            due = self.episode[e.STEPS, : self.num_envs] >= self.episode[e.SWITCH, : self.num_envs]
            for env in np.flatnonzero(due if idle is None else due & ~idle):
                self._draw_target(int(env), generators[int(env)])
        return bool(said & 1)

    def _look_again(self) -> None:
        """Observe the last good state of what could not be simulated, whose report is of where it broke."""
        data, broken = self.engine.arrays[0], np.flatnonzero(self.engine.results)
        kept, limb = data.copy(), LIMB["report"]
        self.engine.advance(None, 0)
        for rows in (TRUNK["report"], slice(TRUNK_ROWS + limb.start, TRUNK_ROWS + limb.stop)):
            kept[rows, broken] = data[rows, broken]
        data[:] = kept
        self._look(self.desk)

    def infos(self, ended: bool = True) -> dict[str, NDArray[Any]]:
        """What all started with, what is measured of them, and the terms of the last reward, by name: shape
        (num_envs,), but for "gait", "measured" and "parameters", which are `Named`. `ended` says whether
        there may be environments that could not be simulated."""
        n, begun, memory = self.num_envs, self.begun.copy(), self.engine.arrays[0]
        measured = memory[AT_MEASURED, :n].copy()
        if ended:
            broken = self.engine.results != 0
            measured[-SUMS:, broken] = 0.0  # nothing happened there
        found: dict[str, NDArray[Any]] = dict(zip(START, begun, strict=False))
        found["gait"] = begun[len(START) : BEGUN].T.view(GAIT)
        if self.randomize:
            found["parameters"] = named(begun[BEGUN:].T, tuple(self.randomize))
        found["measured"] = measured.T.view(MEASUREMENTS)
        found.update(zip(e.TERMS, self.episode[e.TERM : e.TERM + len(e.TERMS), :n].copy(), strict=True))
        return found

    def summary(self, env: int) -> dict[str, float]:
        """Figures of an episode, see `summary.summary_of`."""
        return summary_of(self.episode[:, env].tolist(), self.dt)

    def failure(self, env: int) -> str:
        """Why an episode failed, for people."""
        if self.paper and self.paper.apart[env]:
            return "the linkage came apart; the state was put back to the last good one"
        result = Result(int(self.engine.results[env]))
        return result.message if result is not Result.OK else "the trunk left its range of heights"

    # Actions

    def command_of(self, action: Any) -> Floats:
        """Gait parameters that an action commands, shape (4,); the action is clipped to [-1, 1], and they to
        their limits."""
        wanted = self._base + HALF_RANGE * np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        return np.clip(wanted, LOW, HIGH)

    def action_for(self, gaits: str | GaitParameters | Floats) -> NDArray[np.float32]:
        """The action that commands a gait, or gaits of shape (n, 4), to float32 precision; the nearest one if
        it is out of reach.

        Raises:
            ParameterError: neither a gait of the preset nor four parameters each.
        """
        if isinstance(gaits, str):
            gaits = self.gaits[check_choice("gait", gaits, self.gaits)]
        try:
            values = gaits.to_array() if isinstance(gaits, GaitParameters) else np.asarray(gaits, np.float64)
        except (TypeError, ValueError):
            values = np.empty(0)
        if values.shape[-1:] != (e.ACTIONS,) or not np.isfinite(values).all():
            raise ParameterError(
                f"gait: expected one of {', '.join(self.gaits)}, GaitParameters or an array of shape (4,) or "
                f"(n, 4), got {gaits!r}"
            )
        return np.clip((values - self._base) / HALF_RANGE, -1, 1).astype(np.float32)

    # State

    def get_state(self) -> dict[str, Any]:
        """Everything that changes, but for the generators."""
        found = {"engine": self.engine.get_state(), "episode": self.episode[:, : self.num_envs].copy()}
        found["begun"] = self.begun.copy()
        return found | ({"paper": self.paper.get_state()} if self.paper else {})

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Put back what `get_state` gave.

        Raises:
            ParameterError: the state is of another task, geometry or setting.
        """
        expected = (e.EPISODE_ROWS, self.num_envs)
        try:
            episode = np.asarray(state["episode"], np.float64)
        except (TypeError, ValueError):
            raise ParameterError(f"state['episode']: expected numbers, got {state['episode']!r}") from None
        if episode.shape != expected:
            raise ParameterError(
                f"state['episode']: expected shape {expected} for {self.num_envs} environments, "
                f"got {episode.shape}"
            )
        if np.isnan(episode).any():
            raise ParameterError(f"state['episode']: expected numbers, got {episode.tolist()!r:.60}")
        begun = np.asarray(state.get("begun", np.nan))  # older states do not say
        if begun.dtype.kind != "f" or begun.shape not in ((), self.begun.shape):
            raise ParameterError(
                f"state['begun']: expected numbers, shape {self.begun.shape}, got {state['begun']!r:.60}"
            )
        of_paper = self.paper.read_state(state.get("paper")) if self.paper else None
        self.engine.set_state(state["engine"])
        if self.paper and of_paper:
            self.paper.set_state(*of_paper)
        self.episode[:, : self.num_envs], self.begun[:] = episode, begun
        self._varied[:] = True
        self._look(self.desk)

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in vars(self).items() if key not in ("desk", "kernel", "_look")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._open()
