"""Construction of the parts of a batch of episodes: checks of settings, the engine, the task's record."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import LARGEST
from hoof_env.dynamics.step_length import StepLength
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.envs.scene import Slots
from hoof_env.errors import ParameterError, check_choice, check_number
from hoof_env.leg.profile import leg_profile
from hoof_env.paper_solver.episodes import PaperSolver, Scheme
from hoof_env.paper_solver.integrators import INTEGRATORS
from hoof_env.tasks.delays import check_delay, check_kept, parts_of
from hoof_env.tasks.episode import ACTIONS, task_type
from hoof_env.tasks.observation import check_groups, groups_of, observed
from hoof_env.tasks.own_parts import own_of
from hoof_env.tasks.parameters import extremes
from hoof_env.tasks.schedules import drawn_names
from hoof_env.tasks.settings import ResolvedSettings, Settings

MOST_BAUMGARTE = 1e6
"""Largest of Baumgarte's parameters [1/s]; larger ones are unstable even with a substep of 1 us."""


def check_choices(s: Settings) -> None:
    """Check the settings of solver, drive and motor.

    Raises:
        ParameterError: a value is unknown or out of range.
    """
    check_choice("integrator", s.integrator, INTEGRATORS if s.solver == "paper" else SCHEMES)
    check_choice("drive", s.drive, ("prescribed", "motor"))
    for name in ("baumgarte_alpha", "baumgarte_beta"):
        check_number(name, getattr(s, name), low=0.0, high=MOST_BAUMGARTE)
    for name in ("motor_gain", "motor_torque", "motor_inertia"):
        check_number(name, getattr(s, name), low=0.0, high=LARGEST)


def check_paper(settings: Settings) -> None:
    """Check that the paper's solver supports the settings.

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
        # An empty mapping is as good as None.
        if value != expected and not (expected is None and not value):
            raise ParameterError(f'{name}: expected {expected!r} with solver="paper", got {value!r}')


def make_paper(s: ResolvedSettings, engine: TrunkEngine, substeps: int) -> PaperSolver | None:
    """Make the paper's solver for an engine, if the settings ask for it."""
    if s.solver != "paper":
        return None
    scheme = Scheme(s.sim_dt, s.baumgarte_alpha, s.baumgarte_beta, s.integrator)
    return PaperSolver(scheme, engine, substeps)


def make_engine(batch: Any, num_threads: int) -> TrunkEngine:
    """Make the engine of an `EpisodeBatch`, with as many substeps as all drawn parameters need."""
    s = batch.settings
    body = batch.body
    trunk, ground, limbs = body.parts(s)
    substeps = None
    # For all episodes alike: environments with different numbers of substeps cannot run side by side.
    if batch.randomize:
        substeps = substeps_under(batch, {}, None)
        with name_source(batch, batch.randomize):
            for corner in extremes(batch.randomize):
                substeps = max(substeps, substeps_under(batch, corner, None))
    return TrunkEngine(
        limbs,
        trunk,
        ground,
        batch.terrain,
        substeps=substeps,
        sim_dt=s.sim_dt,
        # The paper's solver has schemes of its own; the engine then holds memory and takes no step.
        integrator="midpoint" if s.solver == "paper" else s.integrator,
        num_envs=batch.num_envs,
        num_threads=num_threads,
        strides=True,
        contact_law=batch.task.contact_law,
        step_error=body.step_error,
        harmonics=body.harmonics,
        filters=body.filters,
        limits=body.limits,
    )


@contextmanager
def name_source(batch: Any, parameters: Mapping[str, Any]) -> Iterator[None]:
    """Name in an error the settings or options that its parameters come from.

    Args:
        batch: an `EpisodeBatch`.
        parameters: parameters by name, those of `batch.randomize` and of a reset's options.

    Raises:
        ParameterError: the error, named.
    """
    try:
        yield
    except ParameterError as error:
        drawn = batch.randomize
        sources: dict[str, Iterable[str]] = {
            "randomize": batch.settings.randomize or (),
            "schedule": drawn_names(batch.schedule),
            "options['parameters']": [n for n in parameters if parameters[n] != drawn.get(n)],
        }
        said = set(re.findall(r"\w+", str(error)))
        given = [source for source, names in sources.items() if names]
        at_fault = [source for source in given if said & {*sources[source]}]
        raise ParameterError(f"{' and '.join(at_fault or given)}: {error}") from None


def substeps_under(batch: Any, changes: Mapping[str, float], asked: int | None) -> int:
    """Return the number of substeps of `sim_dt` with some settings changed.

    Args:
        batch: an `EpisodeBatch`.
        changes: changed settings by name.
        asked: number of substeps; None for as many as are needed. With a number that is too low there is a
            warning, see `StepLength.choose`.

    Raises:
        ParameterError: a changed setting is out of range.
    """
    s: Any = replace(batch.settings, **dict(changes))
    trunk, ground, limbs = batch.body.parts(s)
    profiles = [leg_profile(limb.geometry) for limb in limbs]
    length = StepLength(
        limbs, profiles, trunk, ground, batch.terrain, s.integrator, step_error=batch.body.step_error
    )
    return length.choose(s.sim_dt, asked, stacklevel=5)


def task_record(batch: Any) -> NDArray[Any]:
    """Return the record of the constants that the kernels of an `EpisodeBatch` read, shape (1,)."""
    entries = batch.task.entries
    slots = Slots.of(entries)
    own = own_of(batch.task.terms, entries)
    fields = (*batch.body.kernels.task_fields, *own.fields)
    kind = task_type(len(batch.task.terms), slots.count, batch.engine.features.gait_size, fields)
    constants = np.zeros(1, kind)
    task = constants[0]
    for name, value in batch.body.constants(batch.engine, batch.dt).items():
        task[name] = value
    task["rate_bound"][:ACTIONS] = batch.engine.filters.to_array()[:, 1]
    task["weights"] = [batch.weights[term.name] for term in batch.task.terms]
    if own.constants:
        task["constants"] = batch.constants
    task["episode_seconds"] = batch.episode_seconds
    task["h"] = batch.engine.substep
    task["substeps"] = batch.substeps * batch.engine.substeps
    task["dt"] = batch.dt
    task["episode_steps"] = batch.steps_per_episode
    task["stays"] = batch.settings.trunk == "fixed"
    task["observation_size"] = len(batch.names)
    # One kernel serves all choices of groups: it skips entries without a column.
    task["observation_columns"] = -1
    task["privileged_columns"] = -1
    frame = [entry.name for entry in batch.entries]
    behind = len(batch.names) - len(batch.true_entries)
    privileged = [entry.name for entry in batch.true_entries]
    for entry, slot in zip(entries, slots.places, strict=True):
        if entry.name in frame:
            task["observation_columns"][slot] = frame.index(entry.name)
            task["noise"][slot] = batch.noise.get(entry.group, 0.0)
            task["bias"][slot] = batch.bias.get(entry.group, 0.0)
        if entry.name in privileged:
            task["privileged_columns"][slot] = behind + privileged.index(entry.name)
    task["is_noisy"] = bool(task["noise"].any() or task["bias"].any())
    task["has_privileged"] = bool(privileged)
    fill_delays(batch, task)
    return constants


def fill_delays(batch: Any, task: Any) -> None:
    """Fill in the part of the task's record that is about frames, actions and parts of a step."""
    task["frame_size"] = len(batch.entries)
    task["frames"] = batch.frames.shape[1]
    task["first_frame"] = int(batch.observation_delay.substeps > 0)
    task["history"] = batch.history
    task["action_size"] = batch.actions.shape[1]
    task["kept_actions"] = batch.past_actions.shape[1]
    task["keeps_actions"] = bool(batch.past_actions.size)
    task["last_actions"] = batch.last_actions
    parts = parts_of(batch.substeps, batch.action_delay.substeps, batch.observation_delay.substeps)
    task["parts"] = len(parts.substeps)
    task["part_substeps"][: len(parts.substeps)] = np.array(parts.substeps) * batch.engine.substeps
    task["acting_part"] = parts.acting
    task["seeing_part"] = parts.seeing


def check_delays(batch: Any) -> None:
    """Check the settings of delays, histories and true numbers of an `EpisodeBatch`, and set the attributes
    that follow from them.

    Raises:
        ParameterError: a setting is out of range.
    """
    s = batch.settings
    for name in ("observation_delay", "action_delay"):
        delay = check_delay(name, getattr(s, name), batch.substeps, batch.steps_per_episode)
        if delay.substeps and s.solver == "paper":
            raise ParameterError(
                f'{name}: expected whole steps with solver="paper", got {getattr(s, name)!r}'
            )
        setattr(batch, name, delay)
    batch.history = check_kept("observation_history", s.observation_history, 1)
    batch.last_actions = check_kept("last_actions", s.last_actions, 0)
    batch.privileged = ()
    if not isinstance(s.privileged, (list, tuple)) or s.privileged:
        batch.privileged = check_groups(s.privileged, groups_of(batch.task.entries), "privileged")


def check_vary(batch: Any) -> None:
    """Check that groups that an `EpisodeBatch` observes are not constant, and that those which settings name
    are observed.

    Raises:
        ParameterError: a group is constant without another setting, or has nothing on this trunk.
    """
    s = batch.settings
    for group, needed in (("target", "target_speed"), ("ground", "terrain")):
        value = getattr(s, needed)
        for name, groups in (("observation", batch.groups), ("privileged", batch.privileged)):
            if group in groups and value in (None, {}):
                raise ParameterError(
                    f"{name}: {group!r} is constant without {needed}, got {needed}={value!r}"
                )
    for name in ("noise", "bias", "privileged"):
        for group in getattr(batch, name):
            if not observed([group], s.trunk, s.drive, batch.task.entries):
                raise ParameterError(f"{name}: nothing of {group!r} is observed on a {s.trunk} trunk")


def find_entries(batch: Any) -> None:
    """Find the entries that an `EpisodeBatch` observes, and those of which it observes the true numbers."""
    s = batch.settings
    for name, groups in (("entries", batch.groups), ("true_entries", batch.privileged)):
        setattr(batch, name, observed(groups, s.trunk, s.drive, batch.task.entries))


def _ago(steps: int) -> str:
    return "1 step ago" if steps == 1 else f"{steps} steps ago"


def make_memory(batch: Any) -> None:
    """Make the arrays of an `EpisodeBatch` that hold actions and observations, and name its columns.

    `frames`, shape (columns, number, entries), are observations of one instant each, `past_actions`, shape
    (columns, number, actions), the last actions; both the newest first, and empty if none are kept. `acted`
    are the actions that act now, shape (columns, actions); it is `actions` where nothing delays them.
    `mapped` are those of the body; it is `acted` without a map of one's own.
    """
    find_entries(batch)
    frame = [entry.name for entry in batch.entries]
    if not frame:
        raise ParameterError(f"observation: nothing of {list(batch.groups)} is observed on a fixed trunk")
    actions = batch.action_names
    batch.names = [
        *frame,
        *(f"{name}, {_ago(k)}" for k in range(1, batch.history) for name in frame),
        *(f"action {_ago(k)}: {name}" for k in range(1, batch.last_actions + 1) for name in actions),
        *(f"true {entry.name}" for entry in batch.true_entries),
    ]
    columns = batch.engine.columns
    batch.actions = np.zeros((columns, len(actions)), np.float32)
    batch.observations = np.zeros((columns, len(batch.names)), np.float32)
    delay = batch.observation_delay
    kept = int(delay.substeps > 0) + delay.most + batch.history
    # One frame that is not kept is the observation itself; with anything behind it, it has columns in it.
    has_frames = kept > 1
    batch.frames = np.zeros((columns, kept if has_frames else 0, len(frame)), np.float32)
    delay = batch.action_delay
    keeps_actions = bool(delay.most or delay.substeps or batch.last_actions)
    kept = max(delay.most + 1, batch.last_actions) if keeps_actions else 0
    batch.past_actions = np.zeros((columns, kept, len(actions)), np.float32)
    batch.acted = np.zeros_like(batch.actions) if keeps_actions else batch.actions
    of_body = len(batch.body.action_names)
    batch.mapped = np.zeros((columns, of_body), np.float32) if batch.task.action_map else batch.acted
