"""Contexts: fixed sets to train on and to be tested on, drawn by episodes, hidden or observed."""

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, IDS, actions, same

from hoof_env import Sb3VecEnv
from hoof_env.errors import ParameterError
from hoof_env.tasks.contexts import COUNT, FACTORS, SETS, SPLITS

LEG, RAIL, FIXED = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegRail-v0", "hoof_env/HorseLegFixed-v0"
SHORT = {"episode_seconds": 0.04}
ALL = [f"{split}/{name}" for split in SPLITS for name in SETS]


def made(env_id, context_set, **more):
    return gym.make(env_id, context_set=context_set, **more).unwrapped


def factors(env_id, context_set):
    """The contexts as factors of the environment's own values, shape (contexts, parameters)."""
    env = made(env_id, context_set)
    usual = env.batch.plan.settings
    return np.array([[value / getattr(usual, key) for key, value in row.items()] for row in env.contexts])


@pytest.mark.parametrize("env_id", [LEG, HORSE])
@pytest.mark.parametrize("split", SPLITS)
def test_sets_lie_where_their_names_say(env_id, split):
    names = [*made(env_id, f"{split}/train").contexts[0]]
    assert names == [name for name in SPLITS[split] if env_id == LEG or name != "trunk_share"]
    sets = {name: np.abs(np.log(factors(env_id, f"{split}/{name}"))) for name in SETS}
    inner, outer = np.log([FACTORS[name] for name in names]).T
    assert all(found.shape == (COUNT, len(names)) for found in sets.values())
    for name in ("train", "interpolation"):
        assert (sets[name] <= inner).all()
        assert (sets[name].max(axis=0) > 0.8 * inner).all()
    assert (sets["extrapolation"] > inner).all()
    assert (sets["extrapolation"] <= outer).all()
    every = np.concatenate([factors(env_id, f"{split}/{name}") for name in SETS])
    assert len(np.unique(every.round(9), axis=0)) == 3 * COUNT
    # Both sides of the usual values, and no parameter tied to another
    for found in np.split(every, 3):
        assert ((found > 1).mean(axis=0) > 0.3).all()
        assert ((found < 1).mean(axis=0) > 0.3).all()
        if len(names) > 1:
            tied = np.corrcoef(np.log(found).T) - np.eye(len(names))
            assert np.abs(tied).max() < 0.6


@pytest.mark.parametrize("env_id", IDS)
def test_an_episode_draws_one_of_the_set_and_plays_it(env_id):
    """Every context is met; an episode has the bits of one whose reset sets the same parameters."""
    kwargs = {"context_set": "all/extrapolation", **SHORT}
    drawing, usual = gym.make(env_id, **kwargs), gym.make(env_id, **kwargs)
    known = [tuple(context.values()) for context in drawing.unwrapped.contexts]
    met = set()
    action = actions(0, 2, env_id=env_id)
    for seed in range(150):
        seen, info = drawing.reset(seed=seed)
        chosen = info["parameters"]
        met.add(known.index(tuple(chosen.values())))
        if seed < 10:
            again = usual.reset(seed=seed, options={"parameters": dict(chosen.items())})[0]
            same(seen, again)
            for one in action:
                same(*(list(env.step(one)[:4]) for env in (drawing, usual)))
    assert len(met) > 0.9 * COUNT


def test_rows_have_the_contexts_of_single_environments_over_restarts():
    kwargs = {"context_set": "ground/train", "context_visible": True, "episode_seconds": 0.1}
    envs = gym.make_vec(LEG, 3, autoreset_mode="SAME_STEP", **kwargs)
    singles = [gym.make(LEG, **kwargs) for _ in range(3)]
    infos = envs.reset(seed=4)[1]
    alone = [env.reset(seed=4 + k)[1] for k, env in enumerate(singles)]
    for action in actions(0, 12, 3):
        for k in range(3):
            same(infos["parameters"][k], np.asarray(alone[k]["parameters"]))
        seen, rewards, _, truncated, infos = envs.step(action)
        for k, env in enumerate(singles):
            found, reward, _, ended, alone[k] = env.step(action[k])
            assert (reward, ended) == (rewards[k], truncated[k])
            if ended:
                found, alone[k] = env.reset()
            same(seen[k], found)
    assert len({tuple(row) for row in infos["parameters"]}) > 1


@pytest.mark.parametrize("env_id", IDS)
def test_a_visible_context_says_the_parameters_and_a_hidden_one_changes_nothing(env_id):
    kwargs = {"context_set": "all/extrapolation", **SHORT}
    hidden, visible = gym.make(env_id, **kwargs), gym.make(env_id, context_visible=True, **kwargs)
    usual = visible.unwrapped.batch.plan.settings
    names = visible.unwrapped.observation_names
    assert names[: hidden.observation_space.shape[0]] == hidden.unwrapped.observation_names
    for seed in range(12):
        (less, info), (more, again) = hidden.reset(seed=seed), visible.reset(seed=seed)
        same(less, more[: less.size])
        same(info["parameters"], again["parameters"])
        found = dict(zip(names[less.size :], more[less.size :].tolist(), strict=True))
        raw = visible.unwrapped.raw_observation()
        for name, key in (("stiffness of the ground", "stiffness"), ("friction", "friction")):
            value = info["parameters"][key]
            assert raw[name] == pytest.approx(value, rel=1e-6)
            expected = np.tanh(np.log(value / getattr(usual, key)) / 2)
            assert found[name] == pytest.approx(expected, abs=1e-6)
        assert raw["weight"] == pytest.approx(visible.unwrapped.weight, rel=1e-6)
        assert (found["weight"] > 0) == (info["parameters"]["trunk_mass"] > usual.trunk_mass)
        has_share = "trunk_share" in info["parameters"].names
        assert ("share of the weight to bear" in found) == has_share
        if has_share:
            share = found["share of the weight to bear"]
            assert share == pytest.approx(info["parameters"]["trunk_share"], rel=1e-6)


@pytest.mark.parametrize("context_set", ALL)
def test_all_sets_of_a_split_have_one_time_step(context_set):
    env = made(HORSE, context_set)
    first = made(HORSE, f"{context_set.partition('/')[0]}/train")
    assert env.batch.engine.substeps == first.batch.engine.substeps


def test_a_learner_s_environments_take_them():
    envs = Sb3VecEnv(LEG, 4, context_set="ground/train", context_visible=True)
    envs.reset()
    assert envs.observation_space.shape == (26,)
    assert {tuple(info["parameters"]) for info in envs.reset_infos} <= {
        tuple(context.values()) for context in envs.envs.contexts
    }


BAD = [
    ({"context_set": "moon/train"}, r"context_set: expected SPLIT/SET.*ground, body, all.*train, .*moon"),
    ({"context_set": "ground/test"}, r"context_set: .*interpolation, extrapolation.*'ground/test'"),
    ({"context_set": "ground"}, r"context_set: expected SPLIT/SET"),
    ({"context_set": 3}, r"context_set: expected SPLIT/SET.*got 3"),
    ({"context_visible": True}, r"context_visible: expected a context_set"),
    ({"context_set": "all/train", "context_visible": "yes"}, r"context_visible: expected"),
    (
        {"context_set": "ground/train", "randomize": {"friction": (0.2, 0.3)}},
        r"context_set: 'ground/train' sets friction.*none of these in randomize",
    ),
    ({"context_set": "ground/train", "schedule": {"friction": [0.2, 0.3, 9]}}, r"sets friction.*schedule"),
    ({"context_set": "body/train", "trunk_share": 1.0}, r"context_set.*trunk_share"),
]


@pytest.mark.parametrize(("settings", "words"), BAD, ids=str)
def test_bad_contexts_are_refused(settings, words):
    for make in (gym.make, lambda env_id, **more: gym.make_vec(env_id, 2, **more)):
        with pytest.raises(ParameterError, match=words):
            make(LEG, **settings)


def test_a_split_leaves_out_what_has_no_effect():
    with pytest.raises(ParameterError, match=r'context_set: expected None with solver="paper"'):
        gym.make(FIXED, context_set="ground/train", solver="paper")
    assert [*made(RAIL, "body/train").contexts[0]] == ["trunk_mass"]
    assert gym.make(LEG).unwrapped.contexts == ()
