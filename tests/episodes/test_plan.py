"""Plans: what follows from settings, and which row is under which."""

from dataclasses import FrozenInstanceError

import gymnasium as gym
import numpy as np
import pytest

import hoof_env  # noqa: F401
from hoof_env.episodes.plan import make_plan
from hoof_env.episodes.row_plans import CHANGEABLE, RowPlans
from hoof_env.tasks.registry import TASKS
from hoof_env.tasks.settings import SETTINGS


def plan_with(task="speed", **changes):
    return make_plan(TASKS[task], TASKS[task].settings(changes))[0]


def test_a_plan_cannot_be_changed():
    plan = plan_with()
    with pytest.raises(FrozenInstanceError):
        plan.dt = 0.5


@pytest.mark.parametrize("task", TASKS)
def test_every_environment_has_the_plan_of_its_settings(task):
    env = gym.make(TASKS[task].id).unwrapped
    made = make_plan(TASKS[task], env.settings)[0]
    assert made.record.tobytes() == env.batch.plan.record.tobytes()
    assert made.observation_names == env.observation_names
    assert round(env.settings.episode_seconds / env.dt) == made.steps_per_episode


def test_a_limit_of_steps_shortens_episodes_and_never_lengthens_them():
    task = TASKS["leg"]
    usual = plan_with("leg").steps_per_episode
    for given, expected in ((None, usual), (7, 7), (10 * usual, usual)):
        plan = make_plan(task, task.settings({}), max_episode_steps=given)[0]
        assert plan.steps_per_episode == plan.record["episode_steps"] == expected


def test_rows_that_start_take_their_pending_plan():
    plans = RowPlans([plan_with()], 4)
    faster = plan_with(target_speed=[2.0, 3.0])
    plans.add(faster, np.array([1, 2]))
    assert not plans.are_mixed
    assert plans.are_due(np.array([2, 3]))
    assert not plans.are_due(np.array([0, 3]))
    plans.start(np.array([2, 3]))
    assert [plans.of(row) is faster for row in range(4)] == [False, False, True, False]
    assert [plans.pending_of(row) is faster for row in range(4)] == [False, True, True, False]
    plans.start(np.arange(4))
    plans.add(plan_with(), np.arange(4))
    plans.start(np.arange(4))
    assert len(plans.plans) == 1


def test_kernels_distinguish_plans_that_act_in_a_step():
    plans = RowPlans([plan_with()], 3)
    plans.add(plan_with(strength=0.5), np.array([0]))
    plans.start(np.arange(3))
    assert plans.are_mixed
    assert not plans.differ
    plans.add(plan_with(reward_weights={"peak": 1.0}), np.array([1]))
    plans.start(np.arange(3))
    assert plans.differ
    groups = {len(rows) for _, rows in plans.groups(np.arange(3), for_kernels=True)}
    assert groups == {1, 2}
    assert sorted(len(rows) for _, rows in plans.groups(np.arange(3))) == [1, 1, 1]


def test_settings_that_may_change_are_settings():
    assert set(CHANGEABLE) <= set(SETTINGS)
