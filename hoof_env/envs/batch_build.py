"""Construction of the parts of a batch of episodes: checks of settings, the engine, the task's record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hoof_env.dynamics.constrained import INTEGRATORS
from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import LARGEST
from hoof_env.dynamics.step_length import StepLength
from hoof_env.dynamics.stepping import SCHEMES
from hoof_env.envs.observation_kernel import slots_of
from hoof_env.errors import check_choice, check_number
from hoof_env.leg.profile import leg_profile
from hoof_env.tasks.episode import ACTIONS, task_type
from hoof_env.tasks.parameters import extremes
from hoof_env.tasks.settings import Settings

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


def make_engine(batch: Any, num_threads: int) -> TrunkEngine:
    """Make the engine of an `EpisodeBatch`, with as many substeps as all drawn parameters need."""
    s = batch.settings
    body = batch.body
    trunk, ground, limbs = body.parts(s)
    substeps = None
    # For all episodes alike: environments with different numbers of substeps cannot run side by side.
    if batch.randomize:
        corners = ({}, *extremes(batch.randomize))
        substeps = max(substeps_under(batch, corner, None) for corner in corners)
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
    slots, _, count = slots_of(entries)
    kind = task_type(
        len(batch.task.terms), count, batch.engine.features.gait_size, batch.body.kernels.task_fields
    )
    constants = np.zeros(1, kind)
    task = constants[0]
    for name, value in batch.body.constants(batch.engine, batch.dt).items():
        task[name] = value
    task["rate_bound"][:ACTIONS] = batch.engine.filters.to_array()[:, 1]
    task["weights"] = [batch.weights[term.name] for term in batch.task.terms]
    task["episode_seconds"] = batch.episode_seconds
    task["h"] = batch.engine.substep
    task["substeps"] = batch.substeps * batch.engine.substeps
    task["dt"] = batch.dt
    task["episode_steps"] = batch.steps_per_episode
    task["stays"] = batch.settings.trunk == "fixed"
    task["observation_size"] = len(batch.names)
    # One kernel serves all choices of groups: it skips entries without a column.
    task["observation_columns"] = -1
    for entry, slot in zip(entries, slots, strict=True):
        if entry.name in batch.names:
            task["observation_columns"][slot] = batch.names.index(entry.name)
    return constants
