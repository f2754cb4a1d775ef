"""Arguments, options and assignments without effect are refused, those with one are not."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from family import IDS, OTHER, ROUGH, actions, same

from hoof_env import Sb3VecEnv
from hoof_env.dynamics.parts import ONE_LEG
from hoof_env.episodes.batch import EpisodeBatch
from hoof_env.errors import FixedSettingError, ParameterError
from hoof_env.ground.laws import FRICTION_LAWS, NORMAL_LAWS
from hoof_env.tasks.registry import TASKS
from hoof_env.tasks.reward import check_weights
from hoof_env.tasks.settings import NEEDED, PER_EPISODE, Settings, check_effect

LEG, RAIL, FIXED, SPEED, TERRAIN = (
    f"hoof_env/HorseLeg{name}-v0" for name in ("", "Rail", "Fixed", "Speed", "Terrain")
)
BALANCE = "hoof_env/HorseLegBalance-v0", "hoof_env/HorseLegBalanceSpeed-v0"
HORSE = "hoof_env/Horse-v0"


def dummy_vec_env(makers):
    from stable_baselines3.common.vec_env import DummyVecEnv

    return DummyVecEnv(makers)


def episode(settings, steps=150):
    """Observations and memory of random actions."""
    batch = EpisodeBatch(TASKS["leg"], settings, 1)
    generator = np.random.default_rng(1)
    batch.reset([0], [generator], {"crank_angle": 0.0})
    seen = [batch.rows.observations[0].copy()]
    for action in actions(3, steps):
        batch.rows.actions[0] = action
        batch.step([generator])
        seen += [batch.rows.observations[0].copy(), batch.rows.episode[:, 0].copy()]
    return np.concatenate(seen).tobytes()


CONTEXTS = [
    *itertools.product(ONE_LEG, ("ambrosio",), NORMAL_LAWS[:1], ("prescribed", "motor"), (None, (0.5, 3.0))),
    ("suspended", "ambrosio", NORMAL_LAWS[0], "prescribed", (2.5, 2.5)),
    *(
        ("suspended", friction, normal, "prescribed", None)
        for friction, normal in itertools.product(FRICTION_LAWS, NORMAL_LAWS)
    ),
]


@pytest.mark.parametrize("context", CONTEXTS, ids=str)
def test_a_setting_is_refused_if_and_only_if_it_changes_no_bit(context):
    """Each setting in each set-up: `check_effect` refuses it if and only if a run with it is the same."""
    trunk, friction, normal, drive, target = context
    settings = replace(
        Settings(), trunk=trunk, friction_law=friction, normal_law=normal, drive=drive, target_speed=target
    )
    plain = episode(settings)
    for name, value in OTHER.items():
        changes = episode(replace(settings, **{name: value})) != plain
        if changes:
            check_effect(name, settings)
        else:
            with pytest.raises(ParameterError, match=f"{name}: expected .*effect"):
                check_effect(name, settings)


def test_all_are_tried():
    pushes = {"push_impulse", "push_seconds", "pushes"}  # tried in `test_disturbances`
    assert set(PER_EPISODE) | set(NEEDED) <= set(OTHER) | pushes
    assert all(getattr(Settings(), name) != value for name, value in OTHER.items())


@pytest.mark.parametrize("env_id", IDS)
def test_what_an_environment_says_of_itself_makes_it_again(env_id):
    """All its settings as JSON, those without effect with the values that they have anyway; and its spec."""
    made = gym.make(env_id, restitution=0.7)
    env = made.unwrapped
    env.reset(seed=0)
    from_spec = gym.make(gym.envs.registration.EnvSpec.from_json(made.spec.to_json())).unwrapped
    same(from_spec.set_state(env.get_state()), env.batch.rows.observations[0])
    again = gym.make(env_id, **json.loads(json.dumps(env.get_state()["settings"]))).unwrapped
    same(again.set_state(env.get_state()), env.batch.rows.observations[0])


def test_a_friction_law_without_a_lower_threshold_does_not_compare_with_one():
    for law in ("tanh", "threlfall"):
        assert (
            gym.make(LEG, friction_law=law, friction_fast=5e-4).unwrapped.engine.ground.friction_fast == 5e-4
        )


@pytest.mark.parametrize("env_id", IDS)
def test_reward_weights_that_are_not_named_keep_the_values_of_the_task(env_id):
    task = TASKS[gym.spec(env_id).kwargs["task"]]
    terms, plain = task.terms, check_weights(task.defaults.get("reward_weights"), task.terms)
    has_own = env_id in (RAIL, FIXED, SPEED, TERRAIN, ROUGH, *BALANCE) or "cost" in task.defaults
    assert (plain != check_weights(None, terms)) == has_own
    assert gym.make(env_id).unwrapped.weights == plain
    for given in ({"peak": 1.0}, {}, None, {terms[0].name: 3.0, terms[1].name: 1.0}):
        for env in (gym.make(env_id, reward_weights=given), gym.make_vec(env_id, reward_weights=given)):
            leg = env.unwrapped
            assert leg.weights == {**plain, **(given or {})}
            shown = leg.settings.reward_weights or {}
            assert check_weights(shown, terms) == leg.weights
            leg.reset(seed=0)
            assert (leg.get_state()["settings"]["reward_weights"] or {}) == shown


@pytest.mark.parametrize("kind", ["single", "vector"])
def test_settings_and_what_follows_from_them_are_not_assigned(kind):
    env = (gym.make(LEG) if kind == "single" else gym.make_vec(LEG, num_envs=2)).unwrapped
    for name, how in (
        (
            "trunk_mass",
            r"set it by gymnasium.make\(id, \.\.\.\), or reset\(options={'parameters': {'trunk_mass'",
        ),
        (
            "reward_weights",
            r"gymnasium.make\(id, \.\.\.\), or .* by change_settings\(reward_weights=\.\.\.\)$",
        ),
        *(
            ((("terrain", "")), ("weight", "set it by the arguments of gymnasium.make$"))
            if kind == "single"
            else ()
        ),
    ):
        with pytest.raises(FixedSettingError, match=f"{name}: expected no assignment.*{how}"):
            setattr(env, name, 5)
        with pytest.raises(AttributeError):  # as of any property
            setattr(env, name, 5)
    env.note = "mine"
    assert env.note == "mine"


@pytest.mark.parametrize(
    "many",
    [
        lambda: dummy_vec_env([lambda: gym.make(LEG).unwrapped]),
        lambda: Sb3VecEnv(LEG, 2),
        lambda: gym.make_vec(LEG, num_envs=2, vectorization_mode="sync"),  # through Gymnasium's wrappers
    ],
    ids=["DummyVecEnv", "Sb3VecEnv", "SyncVectorEnv"],
)
def test_neither_by_the_libraries_that_set_attributes(many):
    env = many()
    with pytest.raises(FixedSettingError, match="trunk_mass: expected no assignment"):
        env.set_attr("trunk_mass", 5)
    env.set_attr("note", 5)
