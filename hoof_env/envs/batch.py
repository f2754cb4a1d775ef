"""Episodes of a task, one or many at once: what the single and the vector environment share.

`EpisodeBatch` knows arrays and generators and nothing of Gymnasium. A row has the same bits whatever the
number of its neighbours: starts are drawn from a generator of its own, and the kernels are those of
`step`, compiled for one environment or for several side by side.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numba.core.errors import NumbaError
from numpy.typing import NDArray

from hoof_env.dynamics.advance import LANES
from hoof_env.dynamics.constrained import INTEGRATORS
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.form import engine_layout
from hoof_env.dynamics.layout import stride_sums
from hoof_env.dynamics.parts import GRAVITY, LARGEST, Result, broken
from hoof_env.dynamics.step_length import StepLength
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.envs import step as kernels
from hoof_env.envs.addresses import ADDRESSES, BEGIN, END
from hoof_env.envs.conditions import (
    RowConditions,
    conditions_of,
    enter,
    keep_others,
    under_each,
)
from hoof_env.envs.infos import InfoLayout, name_columns
from hoof_env.envs.observation_kernel import slots_of
from hoof_env.envs.paper_solver import PaperSolver, check_paper
from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.gait import GaitParameters
from hoof_env.leg.profile import leg_profile
from hoof_env.simd.layout import views
from hoof_env.simd.threads import run_together
from hoof_env.simd.user_functions import what_cannot_be_compiled
from hoof_env.tasks.episode import ACTIONS, FAILED, episode_layout, task_type
from hoof_env.tasks.observation import MIDDLE, check_groups, groups_of, observed
from hoof_env.tasks.parameters import (
    check_drift,
    check_parameters,
    check_range,
    draw_parameters,
    extremes,
    make_terrain,
    resolved,
    substeps_of,
)
from hoof_env.tasks.registry import Task
from hoof_env.tasks.reward import BEARING, LONGEST_STRIDE, check_weights
from hoof_env.tasks.settings import Settings

Floats = NDArray[np.float64]

LONGEST_EPISODE = 1e6  # seconds of an episode at most
MOST_BAUMGARTE = 1e6  # largest of his parameters [1/s]; a substep of 1 us integrates no larger one


class EpisodeBatch:
    """`num_envs` episodes of a task.

    Attributes:
        task, settings: what it is.
        engine: the mechanics of all.
        entries, names: of the observation.
        terms: keys of the reward's terms in infos.
        kernel, addresses: one control step of all is `kernel(addresses)`; then comes `follow`.
        episode: memory of the episodes, rows as in `episode.Episode`, shape (rows, columns).
        now: the same by name, shape (columns,) or (rows, columns) each.
        actions, observations, rewards: what a step takes and gives, shapes (columns, actions), (columns,
            entries),
            (columns,).
        body: the leg, or the horse, that they are about.
        measurements: what infos measure.
        start_values: the body's `start_names`, the gait and what `randomize` drew for them, a column
            an environment; not a number where a state does not say.

    Raises:
        ParameterError: a setting is out of range or of the wrong type.
    """

    def __init__(
        self, task: Task, settings: Settings, num_envs: int, num_threads: int = 1, *, runs: bool = True
    ) -> None:
        self.task = task
        self.num_envs = num_envs
        self.asked = settings
        self.conditions = RowConditions(num_envs)
        self._next: EpisodeBatch | None = None
        self.settings = s = resolved(settings)
        is_paper = s.solver == "paper"
        check_choice("integrator", s.integrator, INTEGRATORS if is_paper else SCHEMES)
        check_choice("drive", s.drive, ("prescribed", "motor"))
        for name in ("baumgarte_alpha", "baumgarte_beta"):
            check_number(name, getattr(s, name), low=0.0, high=MOST_BAUMGARTE)
        for name in ("motor_gain", "motor_torque", "motor_inertia"):
            check_number(name, getattr(s, name), low=0.0, high=LARGEST)
        self.randomize = {} if s.randomize is None else check_parameters("randomize", s.randomize, s)
        self._terrain = make_terrain(s.terrain)
        self._validated = ""
        if is_paper:
            check_paper(s)
        self.body = task.body(s)
        self.legs = self.body.kernels.legs
        check_drift(self._terrain, s.terrain, s.trunk, self.body.height)
        self.terms = tuple(term.key for term in task.terms)
        self.weights = check_weights(s.reward_weights, task.terms)
        self.substeps = substeps_of(s.dt, s.sim_dt)
        self.dt = s.sim_dt * self.substeps
        low = self.dt * (1 - 1e-9)
        self.episode_seconds = check_number(
            "episode_seconds", s.episode_seconds, low=low, high=LONGEST_EPISODE
        )
        self.steps_per_episode = round(s.episode_seconds / self.dt)
        self.groups = check_groups(s.observation, groups_of(task.entries))
        self.target_speed = self.body.commanded_speeds(s)
        self.speed_changes = self.target_speed is not None and self.target_speed[0] < self.target_speed[1]
        self.target_seconds = check_range(
            "target_seconds", s.target_seconds, self.dt if self.speed_changes else 0.0
        )
        for group, needed in (("target", "target_speed"), ("ground", "terrain")):
            given = getattr(s, needed)
            if group in self.groups and given in (None, {}):
                raise ParameterError(
                    f"observation: {group!r} is constant without {needed}, got {needed}={given!r}"
                )
        trunk, ground, limbs = self.body.parts(s)
        substeps = None
        if self.randomize:
            substeps = max(self._parts(corner, None) for corner in ({}, *extremes(self.randomize)))
        self.engine = TrunkEngine(
            limbs, trunk, ground, self._terrain, substeps=substeps,
            sim_dt=s.sim_dt, integrator="midpoint" if is_paper else s.integrator,
            num_envs=num_envs, num_threads=num_threads, strides=True, contact_law=task.contact_law,
            step_error=self.body.step_error, harmonics=self.body.harmonics, filters=self.body.filters,
            limits=self.body.limits,
        )  # fmt: skip
        self.paper = PaperSolver(s, self.engine, self.substeps) if is_paper else None
        self._has_overrides = np.zeros(num_envs, bool)
        self.start_values = np.full((self.start_row_count + len(self.randomize), num_envs), np.nan)
        self.names = [entry.name for entry in observed(self.groups, s.trunk, s.drive, task.entries)]
        if not self.names:
            raise ParameterError(f"observation: nothing of {s.observation!r} is observed on a fixed trunk")
        columns = self.engine.columns
        self.episode = np.zeros((self._episode_layout.size, columns))
        self.actions = np.zeros((columns, len(self.body.action_names)), np.float32)
        self.observations = np.zeros((columns, len(self.names)), np.float32)
        self.rewards = np.zeros(columns)
        self._task = self._task_record()
        self._open()
        self.episode_rows.weight[:] = self.engine.weight
        self.episode_rows.switch[:] = np.inf  # idle columns never switch
        if not runs:
            return
        try:
            self._compile()
        except NumbaError as error:
            raise ParameterError(f"{task.id}: {what_cannot_be_compiled(error)}") from error

    def _task_record(self) -> NDArray[Any]:
        slots, _, count = slots_of(self.task.entries)
        constants = np.zeros(
            1,
            task_type(
                len(self.task.terms),
                count,
                self.engine.features.gait_size,
                self.body.kernels.task_fields,
            ),
        )
        task = constants[0]
        for name, value in self.body.constants(self.engine, self.dt).items():
            task[name] = value
        task["rate_bound"][:ACTIONS] = self.engine.filters.to_array()[:, 1]
        task["weights"] = [self.weights[term.name] for term in self.task.terms]
        task["episode_seconds"] = self.episode_seconds
        task["h"] = self.engine.substep
        task["substeps"] = self.substeps * self.engine.substeps
        task["dt"] = self.dt
        task["episode_steps"] = self.steps_per_episode
        task["stays"] = self.settings.trunk == "fixed"
        task["observation_size"] = len(self.names)
        task["observation_columns"] = -1
        for entry, slot in zip(self.task.entries, slots, strict=True):
            if entry.name in self.names:
                task["observation_columns"][slot] = self.names.index(entry.name)
        return constants

    @property
    def _episode_layout(self) -> Any:
        terms = len(self.task.terms)
        return episode_layout(self.body.kernels.episode, terms, self.engine.features, self.legs)

    @property
    def start_row_count(self) -> int:
        """How many numbers an episode starts with, besides those drawn."""
        return len(self.body.start_names) + len(self.body.gait_names)

    def _open(self) -> None:
        """Find the kernels, and the arrays where they are now."""
        s = self.settings
        self.entries = observed(self.groups, s.trunk, s.drive, self.task.entries)
        self.measurements = InfoLayout(self.engine.features, self.body.leg_prefixes)
        self._kernels = k = kernels.step_kernels(
            self.task.terms, self.task.entries, self.task.contact_law, self.engine.features, self.body.kernels
        )
        runs_scalar = self.engine.runs_scalar or self.paper
        self.kernel, self._observe = (
            (k.step_one, k.observers.observe_one)
            if runs_scalar
            else (k.step_batch, k.observers.observe_batch)
        )
        if self.paper:
            self.kernel = self._step_paper
        self.find()

    def find(self) -> None:
        """Find the arrays where they are now."""
        self.episode_rows = views(self._episode_layout, self.episode)
        arrays = (
            *self.engine.arrays, self.episode, self._task, self.actions, self.observations, self.rewards
        )  # fmt: skip
        self.addresses = ADDRESSES.of(*arrays, columns=range(self.engine.columns))
        blocks = self.engine.blocks[:1] if self.paper else self.engine.blocks
        self._blocks = [(ADDRESSES.of(*arrays, columns=block),) for block in blocks]

    def _compile(self) -> None:
        """Have every kernel of a step compiled, or loaded, by running it on no environment."""
        if self.paper:
            self._run_idle(self._kernels.apply_one, self._kernels.finish_one)
            self.paper.compile(GaitParameters(*MIDDLE))
        else:
            self._run_idle(self.kernel)
        self._run_idle(self._observe)
        self.engine.reset(np.empty((self.legs, self.engine.features.gait_size, 0)), envs=[])

    def _run_idle(self, *step_kernels: Any) -> None:
        idle = self.addresses.copy()
        idle[END] = 0
        for run in step_kernels:
            run(idle)

    def direct_kernel(self) -> Any:
        """`kernel` without numba's choice by types, a hundredth of a single step: only for `addresses`."""
        if self.paper:
            return self.kernel
        if not self.kernel.overloads:  # as in a process that unpickled this
            self._run_idle(self.kernel)
        (compiled,) = self.kernel.overloads.values()
        return compiled.entry_point

    def _step_paper(self, addresses: NDArray[np.int64]) -> int:
        assert self.paper
        if not self._kernels.apply_one(addresses):
            return kernels.NOT_A_NUMBER
        self.paper.advance()
        happened: int = self._kernels.finish_one(addresses)
        return happened

    def measured(self) -> dict[str, Floats]:
        """What is observed now, before it is scaled: the entries by name, shape (num_envs,)."""
        out = np.zeros((len(self.names), self.num_envs))
        if self.conditions.are_mixed:

            def measure(rows: NDArray[np.int64]) -> None:
                found = np.zeros_like(out)
                self._kernels.observers.measure_one(self.addresses, found)
                out[:, rows] = found[:, rows]

            under_each(self, np.arange(self.num_envs), measure)
        else:
            self._kernels.observers.measure_one(self.addresses, out)
        return dict(zip(self.names, out, strict=True))

    # Conditions

    def change(self, settings: Settings) -> None:
        """Start every episode from now on with other settings, of those that `conditions.CHANGEABLE` names.

        Raises:
            ParameterError: a setting is out of range; nothing has changed then.
        """
        made = EpisodeBatch(self.task, settings, 1, runs=False)
        made.limit(self.steps_per_episode)
        made.num_envs = self.num_envs  # for which options are checked
        self._next = made

    def _adopt(self) -> None:
        """Work under the conditions that `change` asked for."""
        assert self._next is not None
        old = [*self.randomize]
        begun = self.start_values
        self.conditions.add(conditions_of(self), conditions_of(self._next))
        enter(self, self.conditions.all[-1])
        self._next = None
        first = self.start_row_count
        self.start_values = np.full((first + len(self.randomize), self.num_envs), np.nan)
        self.start_values[:first] = begun[:first]
        for k, name in enumerate(self.randomize):
            if name in old:
                self.start_values[first + k] = begun[first + old.index(name)]

    def alone(self, env: int) -> TrunkEngine:
        """An engine like that of one environment."""
        if not self.conditions.are_mixed:
            return self.engine.alone()
        (engine,) = under_each(self, np.array([env]), lambda rows: self.engine.alone())
        made: TrunkEngine = engine
        return made

    # Episodes

    def limit(self, steps: int) -> None:
        """Truncate episodes after so many control steps, if not before."""
        self.steps_per_episode = min(steps, self.steps_per_episode)
        self._task["episode_steps"] = self.steps_per_episode

    def check_options(self, options: Any) -> dict[str, Any]:
        """Reset options as `reset` takes them; `ParameterError` of whatever can be wrong with them, so that a
        refused reset changes nothing."""
        if self._next is not None:
            return self._next.check_options(options)
        checked = self.body.check_options(options, self.engine.trunk, self.settings)
        if self.paper and checked.get("parameters"):
            raise ParameterError(
                f"options['parameters']: expected none with solver=\"paper\", got {checked['parameters']!r}"
            )
        gaits = checked.get("gait")
        if isinstance(gaits, np.ndarray) and gaits.ndim == 2 and len(gaits) != self.num_envs:
            raise ParameterError(
                f"options['gait']: expected one gait or {self.num_envs}, one for each environment, got"
                f" {len(gaits)}"
            )
        self._check_extremes(self.randomize | checked.get("parameters", {}))
        return checked

    def _check_extremes(self, parameters: Mapping[str, float | tuple[float, float]]) -> None:
        """Raise where something that can be drawn is out of range, warn where it needs shorter substeps."""
        if parameters and self._validated != (words := repr(parameters)):
            for corner in extremes(parameters):
                self._parts(corner, self.engine.substeps)
            self._validated = words

    def _parts(self, changes: Mapping[str, float], asked: int | None) -> int:
        """Into how many parts `sim_dt` is cut with some settings changed, see `StepLength.choose`."""
        s: Any = replace(self.settings, **dict(changes))  # type: ignore[arg-type]
        trunk, ground, limbs = self.body.parts(s)
        profiles = [leg_profile(limb.geometry) for limb in limbs]
        length = StepLength(
            limbs, profiles, trunk, ground, self._terrain, s.integrator, step_error=self.body.step_error
        )
        return length.choose(s.sim_dt, asked, stacklevel=5)

    def reset(
        self,
        envs: Sequence[int] | NDArray[np.int64],
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> dict[str, Floats]:
        """Start episodes in `envs`, with a generator each and options as `check_options` gives them.

        Returns the "parameters" that were drawn or set, by name, shape (len(envs),).
        """
        which = np.asarray(envs, np.int64)
        if self._next is not None:
            self._adopt()
            self._has_overrides[:] = True  # rows of settings are of the old ones
        if self.conditions.all:
            self.conditions.start(which)
        if self.conditions.are_mixed:
            drawn: dict[str, Floats] = keep_others(
                self, which, lambda: self._start(which, generators, options)
            )
            return drawn
        return self._start(which, generators, options)

    def _start(
        self,
        which: NDArray[np.int64],
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> dict[str, Floats]:
        now = self.episode_rows
        options = {**self.task.start, **options}
        parameters = self.randomize | options.get("parameters", {})
        drawn = {name: np.zeros(len(which)) for name in parameters}
        if parameters or self._has_overrides[which].any():  # what was set for one episode is not for the next
            for k, (env, generator) in enumerate(zip(which, generators, strict=True)):
                values = draw_parameters(parameters, generator)
                for name, value in values.items():
                    drawn[name][k] = value
                self._vary(int(env), values)
            self._has_overrides[which] = bool(parameters)
        gaits: Any = options.get("gait")
        if np.ndim(gaits) == 2:  # one for each environment
            options = {**options, "gait": gaits[which]}
        start = self.body.draw(options, generators, self.engine)
        now.steps[which] = 0.0
        now.time[which] = 0.0
        now.distance[which] = 0.0
        now.sums[:, which] = 0.0
        self.rewards[which] = 0.0
        now.allowance[which] = BEARING * LONGEST_STRIDE
        now.terms[:, which] = 0.0
        now.target[which] = np.inf
        now.switch[which] = np.inf
        if self.target_speed:
            now.target[which] = self.target_speed[0]
        if self.target_speed and self.speed_changes:
            now.target[which] = [generator.uniform(*self.target_speed) for generator in generators]
            self._draw_targets(which, generators)
        if "target_speed" in options:  # for the whole episode
            now.target[which] = options["target_speed"]
            now.switch[which] = np.inf
        self.body.complete_start(start, now.target[which], options, self.engine)
        self.engine.reset(start.commands, start.theta, envs=which, **start.trunk)
        begun = [*(start.values[name] for name in self.body.start_names), *start.gaits.T]
        self.start_values[:, which] = [*begun, *(drawn[name] for name in self.randomize)]
        now.x_before[which] = start.trunk["x"]
        now.ended[which] = 0.0
        self.body.begin_episodes(now, which, start)
        if self.paper:
            self.paper.start(which.tolist(), start.gaits, start.values["crank_angle"], start.values["x"])
        near = self.addresses.copy()  # the groups of lanes from the first of them to the last
        near[BEGIN] = which.min() // LANES * LANES
        near[END] = min(self.engine.columns, (which.max() // LANES + 1) * LANES)
        self._observe(near)
        return drawn

    def _vary(self, env: int, values: Mapping[str, float]) -> None:
        """Give one environment settings of its own."""
        trunk, ground, limbs = self.body.parts(replace(self.settings, **dict(values)))  # type: ignore[arg-type]
        self.engine.vary(env, trunk, ground, limbs=limbs)
        self.episode_rows.weight[env] = (trunk.mass + sum(limb.geometry.mass for limb in limbs)) * GRAVITY

    def _draw_targets(self, envs: NDArray[np.int64], generators: Sequence[np.random.Generator]) -> None:
        """When other speeds are commanded, and which, with a generator for each of `envs`."""
        if self.conditions.are_mixed:
            each = dict(zip(envs.tolist(), generators, strict=True))
            for conditions, rows in self.conditions.groups(envs):
                self._draw_between(rows, [each[env] for env in rows.tolist()], conditions)
        else:
            self._draw_between(envs, generators, vars(self))

    def _draw_between(
        self,
        envs: NDArray[np.int64],
        generators: Sequence[np.random.Generator],
        conditions: Mapping[str, Any],
    ) -> None:
        when, which = np.array([generator.random(2) for generator in generators]).reshape(-1, 2).T
        (shortest, longest) = conditions["target_seconds"]
        (low, high) = conditions["target_speed"]
        steps = np.rint((shortest + (longest - shortest) * when) / self.dt)
        now = self.episode_rows.target[envs]
        step = self.body.command_step
        low = np.maximum(low, now - step)
        high = np.minimum(high, now + step)
        self.episode_rows.switch[envs] = self.episode_rows.steps[envs] + steps
        self.episode_rows.next_target[envs] = low + (high - low) * which

    def step(self, generators: Sequence[np.random.Generator], idle: NDArray[np.bool_] | None = None) -> bool:
        """One control step under `actions`; returns whether any episode ended.

        Nothing is drawn for environments that are `idle`, shape (num_envs,), as their episode is over. Where
        an action is not a number there is a `ParameterError`, and nothing has happened.
        """
        if self.conditions.are_mixed:
            all_rows = np.arange(self.num_envs)
            happened = np.bitwise_or.reduce(under_each(self, all_rows, lambda rows: self._step()))
        else:
            happened = self._step()
        return self.finish_step(int(happened), generators, idle)

    def _step(self) -> int:
        found: int = np.bitwise_or.reduce(run_together(self.kernel, self._blocks, self.engine.num_threads))
        return found

    def finish_step(
        self, happened: int, generators: Sequence[np.random.Generator], idle: NDArray[np.bool_] | None = None
    ) -> bool:
        """`step` after its kernel, which returned what happened."""
        if happened == kernels.NOT_A_NUMBER:
            raise ParameterError("action: expected finite numbers, got some that are not")
        if happened & kernels.SOME_ENDED and not self.paper:
            put_back = np.flatnonzero(broken(self.engine.results))
            if put_back.size and self.conditions.are_mixed:
                under_each(self, put_back, self._observe_broken)
            elif put_back.size:
                self._observe_broken(put_back)
        if happened & kernels.SOME_SWITCHED:
            due = (self.episode_rows.steps >= self.episode_rows.switch)[: self.num_envs]
            due = np.flatnonzero(due if idle is None else due & ~idle)
            self._draw_targets(due, [generators[env] for env in due.tolist()])
        return bool(happened & kernels.SOME_ENDED)

    def _observe_broken(self, envs: NDArray[np.int64]) -> None:
        """Observe the last good state of what could not be simulated, whose report is of where it broke."""
        data = self.engine.arrays[0]
        form = engine_layout(self.engine.features)
        kept = data.copy()
        leg = form.leg_memory.rows("report")
        self.engine.advance(None, 0)
        reports = [form.trunk_memory.rows("report")]
        for k in range(self.legs):
            first = form.trunk_rows + k * form.leg_rows
            reports.append(slice(first + leg.start, first + leg.stop))
        for rows in reports:
            kept[rows, envs] = data[rows, envs]
        data[:] = kept
        self._observe(self.addresses)

    def infos(self, ended: bool = True) -> dict[str, NDArray[Any]]:
        """What all started with, what is measured of them, and the terms of the last reward, by name: shape
        (num_envs,), but for "gait", "measured" and "parameters", which are `NamedArray`. `ended` says whether
        there may be environments that could not be simulated."""
        n = self.num_envs
        begun = self.start_values.copy()
        memory = self.engine.arrays[0]
        measured = self.measurements.read(memory[:, :n])
        if ended:
            nothing = broken(self.engine.results)
            measured[np.ix_(self.measurements.last_step, nothing)] = 0.0
        first = self.start_row_count
        names = self.body.start_names
        infos: dict[str, NDArray[Any]] = dict(zip(names, begun, strict=False))
        infos["gait"] = name_columns(begun[len(names) : first].T, self.body.gait_names)
        if self.randomize:
            infos["parameters"] = name_columns(begun[first:].T, tuple(self.randomize))
        if self.target_speed:
            infos["target_speed"] = self.episode_rows.target[:n].copy()
        infos["measured"] = measured.T.view(self.measurements.kind)
        infos.update(zip(self.terms, self.episode_rows.terms[:, :n].copy(), strict=True))
        return infos

    def summary(self, env: int) -> dict[str, float]:
        """Figures of an episode, see `summaries`."""
        return {name: float(values[0]) for name, values in self.summaries([env]).items()}

    def summaries(self, envs: Sequence[int] | NDArray[np.int64]) -> dict[str, Floats]:
        """Figures of the episodes of some environments, by name, shape (len(envs),) each.

        seconds, distance_m, speed_m_s, peak_grf_n (highest of the episode), mean_grf_n (normal force over the
        whole time), stance_peak_sum_n, stances, loading_rate_n_s (mean over stances), duty_factor,
        drive_work_j (braking is not recovered), cost_of_transport (work per weight and distance; infinite
        without forward progress), weight_share (mean normal force over weight: what the leg bore),
        support_share (the rest: what the rail or the suspension bore), slip_m (mean over stances), failed
        (0 or 1); of a horse mean, sum and duty factor are of all its legs.
        """
        seconds = self.episode_rows.time[envs]
        distance = self.episode_rows.distance[envs]
        names = stride_sums(self.engine.features)
        total = dict(zip(names, self.episode_rows.sums[:, envs], strict=True))
        work = total["positive_work"]
        stances = total["stances"]
        weight = self.episode_rows.weight[envs]
        time = np.maximum(seconds, 1e-12)
        mean = total["normal_impulse"] / time
        each = np.maximum(stances, 1.0)
        steps = np.rint(seconds / self.dt)
        cost = np.full(len(work), np.inf)
        np.divide(work, weight * distance, out=cost, where=distance > 0)
        return {
            "seconds": np.array([round(count * self.dt, 12) for count in steps]),  # sums of steps are 9.99...
            "distance_m": distance,
            "speed_m_s": distance / time,
            "peak_grf_n": total["highest_grf"],
            "mean_grf_n": mean,
            "stance_peak_sum_n": total["peak_grf_increase"],
            "stances": stances,
            "loading_rate_n_s": total["loading_rate_increase"] / each,
            "duty_factor": total["loaded_time"] / time / self.legs,
            "slip_m": total["slip"] / each,
            "drive_work_j": work,
            "cost_of_transport": cost,
            "weight_share": mean / weight,
            "support_share": 1 - mean / weight,
            "failed": (self.episode_rows.ended[envs] == FAILED).astype(np.float64),
        }

    def failure(self, env: int) -> str:
        """Why an episode failed, for people."""
        if self.paper and self.paper.apart[env]:
            return "the linkage came apart; the state was put back to the last good one"
        result = Result(int(self.engine.results[env]))
        return result.message if result is not Result.OK else "the trunk left its range of heights"

    # State

    def get_state(self) -> dict[str, Any]:
        """Everything that changes, but for the generators.

        Raises:
            ParameterError: some episodes are under older settings than others.
        """
        if self.conditions.are_mixed:
            raise ParameterError(
                "get_state: expected one set of settings for all, but some episodes began before they were"
                " changed; reset() starts all anew"
            )
        state = {"engine": self.engine.get_state(), "episode": self.episode[:, : self.num_envs].copy()}
        state["start_values"] = self.start_values.copy()
        return state | ({"paper": self.paper.get_state()} if self.paper else {})

    @property
    def ended_row(self) -> int:
        """Of the memory of episodes."""
        row: int = self._episode_layout.rows("ended").start
        return row

    def spread(self, state: Mapping[str, Any]) -> dict[str, Any]:
        """The state of one environment as one of `num_envs` that are where it is.

        Raises:
            ParameterError: it is no state of one.
        """
        n = self.num_envs

        def repeated(values: Any) -> Any:
            return np.repeat(np.asarray(values, np.float64), n, -1)

        try:
            engine = state["engine"]
            layout = state["engine"]["layout"]
            if layout["num_envs"] != 1 or np.shape(state["episode"])[-1] != 1:
                raise ValueError
            parts = {name: repeated(values) for name, values in engine.items() if name != "layout"}
            found = {**state, "engine": {**parts, "layout": {**layout, "num_envs": n}}}
            found |= {name: repeated(state[name]) for name in ("episode", "start_values") if name in state}
            if "paper" in state:
                paper = state["paper"]
                found["paper"] = {"legs": [*paper["legs"]] * n} | {
                    name: np.repeat(paper[name], n) for name in ("accounts", "last")
                }
        except (KeyError, TypeError, ValueError, IndexError):
            raise ParameterError(
                "state: expected what get_state gives of one environment, or of this vector environment"
            ) from None
        return found

    def _is_possible(self, episode: Floats) -> bool:
        """Whether weights, and the gaits of horses, are numbers that can be."""
        weight = episode[self._episode_layout.rows("weight")]
        if not self.body.finite_fields and (weight > 0).all():
            return True
        begun = ~np.isnan(self.start_values[0])
        rows = [episode[self._episode_layout.rows(name)][:, begun] for name in self.body.finite_fields]
        return bool((weight[:, begun] > 0).all() and all(np.isfinite(values).all() for values in rows))

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Put back what `get_state` gave; `ParameterError` for one of another task, geometry or setting."""
        expected = (len(self.episode), self.num_envs)
        try:
            episode = np.asarray(state["episode"], np.float64)
        except (TypeError, ValueError):
            episode = np.array(np.nan)
        if np.isnan(episode).any() or (episode.shape == expected and not self._is_possible(episode)):
            raise ParameterError(f"state['episode']: expected numbers, got {state['episode']!r:.60}")
        if episode.shape != expected:
            raise ParameterError(
                f"state['episode']: expected shape {expected} for {self.num_envs} environments, "
                f"got {episode.shape}"
            )
        begun = np.asarray(state.get("start_values", np.nan))  # older states do not say
        if begun.dtype.kind != "f" or begun.shape not in ((), self.start_values.shape):
            raise ParameterError(
                f"state['start_values']: expected numbers, shape {self.start_values.shape}, got"
                f" {state['start_values']!r:.60}"
            )
        of_paper = self.paper.read_state(state.get("paper")) if self.paper else None
        self.engine.set_state(state["engine"])
        if self.paper and of_paper:
            self.paper.set_state(*of_paper)
        self.episode[:, : self.num_envs] = episode
        self.start_values[:] = begun
        self._has_overrides[:] = True
        if self.conditions.all:
            self.conditions.start(np.arange(self.num_envs))
        self._observe(self.addresses)

    def __getstate__(self) -> dict[str, Any]:
        found_again = (
            "addresses",
            "_blocks",
            "entries",
            "kernel",
            "measurements",
            "episode_rows",
            "_kernels",
            "_observe",
        )
        return {key: value for key, value in vars(self).items() if key not in found_again}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.conditions = self.conditions.copied()
        self._open()

    def __deepcopy__(self, memo: dict[int, Any]) -> EpisodeBatch:
        """What never changes is shared: a planner copies at every node of its tree."""
        made = object.__new__(type(self))
        vars(made).update(vars(self))
        for name in (
            "engine",
            "_has_overrides",
            "start_values",
            "episode",
            "actions",
            "observations",
            "rewards",
            "_task",
        ):
            setattr(made, name, copy.deepcopy(getattr(self, name), memo))
        if self.paper:
            made.paper = copy.deepcopy(self.paper, memo | {id(self.engine): made.engine})
            made.kernel = made._step_paper
        made.conditions = self.conditions.copied()
        made.find()
        return made
