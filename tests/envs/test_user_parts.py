"""Constants, rows of memory and actions of one's own: they act as asked, alone and among many, and are
refused in words."""

import runpy
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from family import actions, same

import hoof_env
from hoof_env import ActionMap, Constant, Entry, Scale, Term, TermState
from hoof_env.dynamics.layout import TRUNK_STATE
from hoof_env.envs.manual import tables_of
from hoof_env.errors import ParameterError
from hoof_env.policies.record import describe_actions
from hoof_env.tasks import registry as tasks

ID = "my_lab/Steps-v0"
EXAMPLE = Path(__file__).parents[2] / "examples" / "own_actions.py"


@pytest.fixture(scope="module")
def example():
    """What the example defines; its id is gone after the tests of this file."""
    known, own = dict(gym.registry), dict(tasks._OWN)
    yield runpy.run_path(str(EXAMPLE))
    for registry, before in ((gym.registry, known), (tasks._OWN, own)):
        registry.clear()
        registry.update(before)


def taken(seed, *shape):
    return actions(seed, *shape)[..., :3]


def test_rows_have_the_bits_of_one_with_delays_and_over_episodes(example):
    """Memory, constants and actions too, where episodes end and begin, and where actions are late."""
    settings = {
        "episode_seconds": 0.4, "constants": {"free": 500.0}, "action_delay": 1.5, "last_actions": 2,
    }  # fmt: skip
    envs = gym.make_vec(ID, 9, autoreset_mode="SAME_STEP", **settings)
    env = gym.make(ID, **settings)
    same(envs.reset(seed=3)[0][0], env.reset(seed=3)[0])
    for action in taken(1, 50, 9):
        rows = envs.step(action)
        observation, reward, terminated, truncated, _ = env.step(action[0])
        if terminated or truncated:
            observation = env.reset()[0]
        assert (rows[1][0], rows[2][0], rows[3][0]) == (reward, terminated, truncated)
        same(rows[0][0], observation)


@pytest.mark.parametrize("free", [400.0, 1e6])
def test_the_charges_of_an_episode_add_up_to_its_highest_force(example, free):
    """Whatever happens between: a term whose state is its highest force charges each newton once."""
    env = gym.make(ID, constants={"free": free}, episode_seconds=1.5)
    for seed in (0, 1):
        env.reset(seed=seed)
        charged = 0.0
        over = False
        for action in taken(seed, 75):
            _, _, *ends, info = env.step(action)
            charged += info["reward_impact"]
            over = any(ends)
            if over:
                break
        assert over
        highest = info["episode_summary"]["highest_grf_n"]
        assert charged == pytest.approx(-0.5e-3 * max(highest - free, 0.0), rel=1e-9, abs=1e-12)
        assert env.unwrapped.raw_observation()["highest force so far"] == pytest.approx(highest / free)


def test_a_state_carries_rows_and_form(example):
    env = gym.make(ID).unwrapped
    env.reset(seed=0)
    acts = taken(2, 60)
    for action in acts[:30]:
        env.step(action)
    state = env.get_state()
    rest = [env.step(action)[:2] for action in acts[30:]]
    env.set_state(state)
    same([env.step(action)[:2] for action in acts[30:]], rest)
    assert state["actions"] == "steps"
    assert describe_actions(env) == {"actions": "steps"}
    with pytest.raises(ParameterError, match="actions are steps, got 'rates'"):
        env.set_state({**state, "actions": "rates"})


def test_an_action_of_step_length_lengthens_the_step_and_keeps_its_height(example):
    """As derivatives of the path itself say, from the walk on and in both directions."""
    step_of = example["step_of"]
    env = gym.make(ID).unwrapped
    for which, sign in ((1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)):
        env.reset(seed=0, options={"gait": "walk"})
        action = np.zeros(3, np.float32)
        action[which] = sign
        before = step_of(*env.engine.state["swing_sin"][0], *env.engine.state["swing_cos"][0])
        for _ in range(2):
            env.step(action)
        state = env.engine.state
        change = step_of(*state["swing_sin"][0], *state["swing_cos"][0]) - before
        assert sign * change[which - 1] > 0.001
        assert abs(change[2 - which]) < 0.35 * abs(change[which - 1])


def test_what_needs_actions_of_the_leg_is_refused(example):
    env = gym.make(ID).unwrapped
    env.reset(seed=0)
    with pytest.raises(ParameterError, match=r"action_for: expected actions .*rates, got .*steps"):
        env.action_for("walk")
    with pytest.raises(ParameterError, match=r"policy 'run': expected actions .*leg"):
        hoof_env.make_policy("run", env)
    assert hoof_env.make_policy("random", env).predict(np.zeros(3))[0].shape == (3,)
    tables = tables_of(ID)
    assert len(tables["Actions"].rows) == 3
    assert any("rate of step length" in cells for cells in map(" ".join, tables["Actions"].rows))
    free = next(row for row in tables["Constants"].rows if row[0] == "free")
    assert free[1:3] == ("1000", "N")


def test_change_of_constants_acts_from_the_next_episode_on(example):
    env, made = gym.make(ID).unwrapped, gym.make(ID, constants={"free": 700.0}).unwrapped
    env.reset(seed=0)
    env.change_settings(constants={"free": 700.0})
    same(env.reset(seed=1)[0], made.reset(seed=1)[0])
    for action in taken(5, 40):
        same(env.step(action)[:2], made.step(action)[:2])


def test_constants_that_are_not_named_stay_as_registered(example):
    hoof_env.register("my_lab/Free-v0", base=ID, constants={"free": 700.0})
    for given in (None, {}, {"free": 700.0}):
        assert gym.make("my_lab/Free-v0", constants=given).unwrapped.batch.plan.constants == [700.0]
    assert gym.make("my_lab/Free-v0", constants={"free": 5.0}).unwrapped.batch.plan.constants == [5.0]


def with_constant(step, weight, free):
    return weight * free


def plain(step, weight):
    return weight


LIMIT = Constant("free", 1.0, "-", "a test's", low=0.0, high=2.0)


@pytest.mark.parametrize(
    ("words", "make"),
    [
        (r"constants: expected a mapping with some of free, got \{'fre': 1\}",
         lambda: gym.make(ID, constants={"fre": 1})),
        (r"constants\['free'\]: expected .*1.*, got 0.5", lambda: gym.make(ID, constants={"free": 0.5})),
        (r"constants\['free'\]: expected .*number.*, got nan",
         lambda: gym.make(ID, constants={"free": float("nan")})),
        (r"constants: expected a mapping with none, as no term or entry has one, got \{'free': 1\}",
         lambda: gym.make("hoof_env/HorseLeg-v0", constants={"free": 1})),
        (r"term 'mine': compute: expected a function of 3 arguments",
         lambda: Term("mine", 1.0, "-", "-", plain, constants=[LIMIT])),
        (r"compute: expected the constants limit as its last arguments, got \(free\)",
         lambda: Term("mine", 1.0, "-", "-", with_constant, constants=[Constant("limit", 1.0, "-", "-")])),
        (r"constants: expected a list of hoof_env.Constant",
         lambda: Term("mine", 1.0, "-", "-", plain, constants=[1.0])),
        (r"state: expected a list of hoof_env.TermState, each name once",
         lambda: Term("mine", 1.0, "-", "-", plain, state=[TermState("a", 0.0, "-", "-")] * 2)),
        (r"a term with state: expected the name of a variable",
         lambda: Term("my own", 1.0, "-", "-", plain, state=[TermState("a", 0.0, "-", "-")])),
        (r"constant: expected the name of a variable, got 'my own'",
         lambda: Constant("my own", 1.0, "-", "-")),
        (r"constant: expected the name of a variable, got 'lambda'",
         lambda: Constant("lambda", 1.0, "-", "-")),
        (r"state: expected the name of a variable, got 'class'", lambda: TermState("class", 0.0, "-", "-")),
        (r"constant 'free': expected .*2.*, got 3", lambda: Constant("free", 3.0, "-", "-", high=2.0)),
        (r"constant 'free': expected the one of another term or entry",
         lambda: hoof_env.register("my_lab/Other-v0", base=ID, terms=[
             Term("mine", 1.0, "-", "-", with_constant, constants=[LIMIT])])),
        (r"action_map: form: expected a name of its own, got 'rates'",
         lambda: ActionMap("rates", {"a": "-"}, lambda action, scene: (0.0,) * 4)),
        (r"action_map: form: expected a name of its own, got 'offsets of",
         lambda: ActionMap("offsets of 0.4 and 0.04 rad", {"a": "-"}, lambda action, scene: (0.0,) * 4)),
        (r"actions: expected a mapping of names to meanings, got \{\}",
         lambda: ActionMap("mine", {}, lambda action, scene: (0.0,) * 4)),
        (r"actions: expected a mapping of names to meanings, got \('abc',\)",
         lambda: ActionMap("mine", ("abc",), lambda action, scene: (0.0,) * 4)),
        (r"actions: expected a mapping of names to meanings, got \{'a': None\}",
         lambda: ActionMap("mine", {"a": None}, lambda action, scene: (0.0,) * 4)),
        (r"compute: expected a plain function of 2|compute: expected a function of 2",
         lambda: ActionMap("mine", {"a": "-"}, lambda action: (0.0,) * 4)),
        (r"action_map: expected ActionMap, got 'steps'",
         lambda: hoof_env.register("my_lab/Other-v0", action_map="steps")),
    ],
)  # fmt: skip
def test_refusals(example, words, make):
    with pytest.raises(ParameterError, match=words):
        make()


def spoils(step, weight):
    """Keep what is NaN where the engine failed: such a step has no duration."""
    step.episode.own.spoiler.seen = step.seconds / step.seconds
    return 0.0


def seen(scene):
    return scene.episode.own.spoiler.seen


def test_nan_of_a_failed_step_is_neither_kept_nor_observed(example):
    hoof_env.register(
        "my_lab/Spoilt-v0",
        terms=[Term("spoiler", 1.0, "-", "-", spoils, state=[TermState("seen", 0.5, "-", "-")])],
        entries=[Entry("seen", "own", "-", seen, Scale("none"))],
    )
    env = gym.make("my_lab/Spoilt-v0").unwrapped
    assert env.reset(seed=0)[0][-1] == 0.5
    assert env.step(np.zeros(4, np.float32))[0][-1] == 1.0
    state = env.get_state()
    state["engine"]["trunk"][TRUNK_STATE.index("momentum_x")] = 1e308
    env.set_state(state)
    observation, _, terminated, *_ = env.step(np.zeros(4, np.float32))
    assert terminated
    assert observation[-1] == 1.0
    assert np.isfinite(observation).all()


def no_number(scene):
    """Divide 0 by 0 at the start of an episode, and in no step."""
    return scene.episode.time / scene.episode.time


def test_nan_of_an_entry_is_reported(example):
    hoof_env.register(
        "my_lab/NoNumber-v0", entries=[Entry("no number", "own", "-", no_number, Scale("none"))]
    )
    env = gym.make("my_lab/NoNumber-v0").unwrapped
    with pytest.raises(ParameterError, match=r"entry 'no number': expected .*got NaN .*after 0 steps"):
        env.reset(seed=0)
    assert env.step(np.zeros(4, np.float32))[0][-1] == 1.0


def beyond(action, scene):
    return action[0], action[1], 0.0, 0.0


def undefined(action, scene):
    return action[0] / (action[0] - action[0]), 0.0, 0.0, 0.0


def test_a_map_that_reads_beyond_its_actions_is_refused():
    hoof_env.register("my_lab/Beyond-v0", action_map=ActionMap("one", {"a": "-"}, beyond))
    with pytest.raises(ParameterError, match=r"tuple index out of range, in beyond \("):
        gym.make("my_lab/Beyond-v0")


def test_nan_of_a_map_is_reported():
    hoof_env.register("my_lab/NaN-v0", action_map=ActionMap("one", {"a": "-"}, undefined))
    env = gym.make("my_lab/NaN-v0")
    env.reset(seed=0)
    with pytest.raises(ParameterError, match="action_map 'one': expected numbers, got NaN for action 0"):
        env.step(np.zeros(1, np.float32))
