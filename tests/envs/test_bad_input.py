"""One clear error for each thing that can be wrong, and the environment goes on as if nothing had been."""

from __future__ import annotations

import copy
from decimal import Decimal

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, IDS, actions, same
from gymnasium.error import ClosedEnvironmentError, ResetNeeded

from hoof_env import Sb3VecEnv, make_policy, read_preset
from hoof_env.errors import ParameterError
from hoof_env.gait import load_gait

LEG, NAN = "hoof_env/HorseLeg-v0", float("nan")
OTHER_LEG = {**read_preset("identified"), "provenance": "another"}

ARGUMENTS = [
    ({"trunk_mas": 80.0}, "HorseLeg-v0: unexpected keyword argument 'trunk_mas'; did you mean trunk_mass?"),
    ({"wings": 2}, r"unexpected keyword argument 'wings' \(known: preset, gait, trunk, "),
    ({"task": "fly"}, "task: expected one of fixed, horse, leg, .*got 'fly'"),
    ({"preset": "no_such_leg"}, "preset: expected one of identified, got 'no_such_leg'"),
    ({"trunk": "floating"}, "trunk: expected one of fixed, rail, suspended, got 'floating'"),
    ({"trunk": "free"}, "trunk: expected one of fixed, rail, suspended, got 'free'"),
    ({"trunk": 3}, "trunk: expected one of fixed, rail, suspended, got 3"),
    ({"gait": "trot"}, "gait: expected one of carrying_walk, run, walk, got 'trot'"),
    ({"solver": "fast"}, "solver: expected one of exact, paper, got 'fast'"),
    ({"solver": "paper", "integrator": "euler"}, "trunk: expected 'fixed' with solver=\"paper\""),
    (
        {"observation": ["crank", "target"], "target_speed": None},
        "observation: 'target' is constant without target_speed",
    ),
    ({"observation": ["crank", "ground"]}, "observation: 'ground' is constant without terrain"),
    *(
        ({name: value}, rf"{name}: expected .*\(0, {bound}\].*got {value!r}")
        for name, bound in (("crank_rate", 20), ("swing_rate", 6))
        for value in (0.0, -1.0, NAN, float("inf"), 1.001 * bound, "fast", None)
    ),
    ({"drive": "belt"}, "drive: expected one of motor, prescribed, got 'belt'"),
    ({"normal_law": "hertz"}, "normal_law: expected one of .*lankarani-nikravesh.*got 'hertz'"),
    ({"friction_law": "stick"}, "friction_law: expected one of ambrosio.*got 'stick'"),
    ({"integrator": "leapfrog"}, "integrator: expected one of .*midpoint.*got 'leapfrog'"),
    ({"render_mode": "ansi"}, "render_mode: expected one of .*rgb_array, got 'ansi'"),
    ({"dt": 0.0205}, "dt: expected a whole multiple of sim_dt = 0.001 s, got 0.0205 s"),
    ({"dt": 0.0005}, "dt: expected a whole multiple"),
    ({"dt": 1e300, "sim_dt": 1e-9}, "dt: expected.* got 1e.300 s .ratio inf; at most 100000"),
    ({"sim_dt": 1e-300}, "sim_dt: expected 1e-12 or more, got 1e-300"),
    ({"dt": NAN}, "dt: expected.*got nan"),
    ({"sim_dt": 0.0}, "sim_dt: expected"),
    ({"sim_dt": 0.2, "dt": 0.2}, "sim_dt: expected.*got 0.2"),
    ({"trunk_mass": -80.0}, "trunk_mass: expected.*got -80.0"),
    ({"trunk_mass": "heavy"}, "trunk_mass: expected.*got 'heavy'"),
    ({"trunk_share": 1.5}, "trunk_share: expected.*got 1.5"),
    ({"trunk_stiffness": -1.0}, "trunk_stiffness: expected.*got -1.0"),
    ({"hip_height": 0.0}, "hip_height: expected.*got 0.0"),
    ({"hip_height": "low"}, "hip_height: expected.*got 'low'"),
    ({"stiffness": float("inf")}, "stiffness: expected.*got inf"),
    ({"restitution": 1.1}, "restitution: expected.*got 1.1"),
    ({"restitution": 0.0, "normal_law": "flores"}, "restitution: expected a number in .0.01, 1."),
    ({"exponent": 0.0}, "exponent: expected.*got 0.0"),
    ({"exponent": 1.51}, "exponent: expected a multiple of 1/8, .*, got 1.51"),
    ({"friction": -0.1}, "friction: expected.*got -0.1"),
    ({"friction_fast": 1e-4}, "friction_fast: expected more than friction_slow"),
    ({"drive": "motor", "motor_gain": -1.0}, "motor_gain: expected.*got -1.0"),
    ({"drive": "motor", "motor_torque": "strong"}, "motor_torque: expected.*got 'strong'"),
    ({"approach_floor": 1e300}, "approach_floor: expected.*got 1e.300"),
    ({"episode_seconds": -1.0}, "episode_seconds: expected.*got -1.0"),
    ({"episode_seconds": 1e308}, "episode_seconds: expected.*got 1e.308"),
    ({"episode_seconds": 10.0, "dt": 20.0}, r"episode_seconds: expected.*\[20, .*got 10.0"),
    ({"target_speed": "fast"}, "target_speed.*: expected.*got 'fast'"),
    ({"target_speed": [3.0, 1.0]}, r"target_speed\[1\]: expected.*\[3, .*got 1.0"),
    ({"target_speed": [1.0, 2.0, 3.0]}, r"target_speed: expected two numbers, got \[1.0, 2.0, 3.0\]"),
    ({"target_speed": (1.0, 2.0), "target_seconds": 0.0}, r"target_seconds\[0\]: expected.*got 0.0"),
    ({"observation": ["tail"]}, r"observation: expected a list of some of crank, .*got \['tail'\]"),
    ({"observation": []}, r"observation: expected a list of some of crank, .*got \[\]"),
    ({"observation": ["hoof", "hoof"]}, "observation: expected a list"),
    ({"observation": "hoof"}, "observation: expected a list of some of crank, .*got 'hoof'"),
    ({"observation": [["hoof"]]}, "observation: expected a list of some of crank"),
    ({"reward_weights": {"speed": 1.0}}, "reward_weights: expected a mapping with some of progress.*got"),
    ({"reward_weights": {"peak": NAN}}, "reward_weights.'peak'.: expected.*got nan"),
    ({"reward_weights": 3}, "reward_weights: expected a mapping"),
    ({"terrain": 3}, "terrain: expected None or a mapping, got 3"),
    ({"terrain": {"kind": "moon"}}, r"terrain\['kind'\]: expected one of hills, slope, got 'moon'"),
    ({"terrain": {"kind": "hills", "steep": 1}}, "terrain: hills has no steep; expected some of seed"),
    ({"terrain": {"kind": "hills", "rise": -1}}, r"terrain\['rise'\]: expected.*got -1"),
    ({"terrain": {"kind": "hills", "stiffness": 2}}, r"terrain\['stiffness'\]: expected two numbers, got 2"),
    ({"terrain": {"kind": "slope", "angle": 2}}, "angle.*: expected.*got 2"),
    ({"terrain": {"bumps": 1}}, "terrain.*"),
    ({"terrain": {"kind": "slope", "angle": 0.001}}, "terrain: expected ground whose mean height.*suspended"),
    ({"terrain": {"kind": "hills", "rise": 0.5}}, r"terrain\['rise'\]: expected at most 0.339 m.*got 0.5 m"),
    ({"terrain": np.zeros(2)}, r"terrain: expected None or a mapping, got \[0.0, 0.0\]"),
    ({"friction": Decimal("0.5")}, "friction: expected a number of Python or NumPy.*Decimal"),
    ({"randomize": 3}, "randomize: expected a mapping with some of trunk_mass.*got 3"),
    ({"randomize": []}, r"randomize: expected a mapping with some of trunk_mass.*got \[\]"),
    ({"randomize": np.zeros(2)}, r"randomize: expected a mapping with some of trunk_mass.*got \[0.0"),
    ({"observation": ["ground"], "terrain": {}}, "'ground' is constant without terrain, got terrain={}"),
    ({"randomize": {"preset": "x"}}, "randomize: expected a mapping with some of trunk_mass"),
    ({"randomize": {"friction": (0.1, 0.2, 0.3)}}, r"randomize\['friction'\]: expected a number or two"),
    ({"randomize": {"friction": (0.3, 0.1)}}, r"randomize\['friction'\]: expected the lower one first"),
    ({"randomize": {"friction": (0.3, NAN)}}, r"randomize\['friction'\]\[1\]: expected.*got nan"),
    ({"randomize": {"trunk_mass": (-1.0, 80.0)}}, "trunk_mass: expected.*got -1.0"),
    ({"randomize": {"friction_slow": (0.0, 0.1)}}, "friction_fast: expected more than friction_slow"),
]


@pytest.mark.parametrize("make", [gym.make, gym.make_vec], ids=["single", "vector"])
@pytest.mark.parametrize(("kwargs", "message"), ARGUMENTS, ids=[str(kwargs) for kwargs, _ in ARGUMENTS])
def test_arguments(make, kwargs, message):
    with pytest.raises(ParameterError, match=message):
        make(LEG, **kwargs)


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        *(({"num_envs": n}, "num_envs: expected a whole number, 1 or more, got") for n in (0, -1, 1.5, True)),
        ({"num_envs": 10**9}, "num_envs: expected at most 1e.06, got 1000000000"),
        ({"autoreset_mode": "LATER"}, "autoreset_mode: expected one of NEXT_STEP, SAME_STEP, DISABLED, got"),
        (
            {"autoreset_mode": None},
            "autoreset_mode: expected one of NEXT_STEP, SAME_STEP, DISABLED, got None",
        ),
        ({"autoreset_mode": []}, r"autoreset_mode: expected one of.*got \[\]"),
        ({"max_episode_steps": 0}, "max_episode_steps: expected a whole number, 1 or more, got 0"),
        ({"max_episode_steps": 2.5}, "max_episode_steps: expected a whole number, 1 or more, got 2.5"),
        ({"render_mode": "human"}, "render_mode: expected one of rgb_array, got 'human'"),
        ({"render_mode": "rgb_array", "rendered": 0}, "rendered: expected a whole number, 1 or more, got 0"),
        ({"render_mode": "rgb_array", "rendered": 3}, "rendered: expected at most num_envs=2, got 3"),
        (
            {"render_mode": "rgb_array", "num_envs": 17},
            "rendered: expected how many of the 17 environments to draw, .* record_first_only=True",
        ),
    ],
    ids=str,
)
def test_arguments_of_the_vector_environment(kwargs, message):
    with pytest.raises(ParameterError, match=message):
        gym.make_vec(LEG, **{"num_envs": 2, **kwargs})


BOTH = {"single": lambda **kwargs: gym.make(LEG, **kwargs).unwrapped,
        "vector": lambda **kwargs: gym.make_vec(LEG, num_envs=3, **kwargs).unwrapped}  # fmt: skip

OPTIONS = [
    ({"phase": 1.0}, "options: expected a mapping with some of gait, parameters, crank_angle, speed, height"),
    (["gait"], r"options: expected a mapping with some of.*got \['gait'\]"),
    (7, "options: expected a mapping.*got 7"),
    ({"gait": "trot"}, r"options\['gait'\]: expected one of carrying_walk, run, walk, got 'trot'"),
    (
        {"gait": {"speed": 1}},
        r"options\['gait'\]: expected a gait name \(carrying_walk, run, walk\) or a mapping",
    ),
    ({"gait": 7}, r"options\['gait'\]: expected a gait name"),
    ({"gait": {**vars(load_gait("run")), "crank_speed": 99.0}}, "expected crank_speed.*got 99"),
    ({"crank_angle": NAN}, r"options\['crank_angle'\]: expected.*got nan"),
    ({"speed": 1e3}, r"options\['speed'\]: expected.*got 1000.0"),
    ({"x": "here"}, r"options\['x'\]: expected.*got 'here'"),
    ({"height": -1}, r"options\['height'\]: expected.*got -1"),
    ({"height": 9.0}, r"options\['height'\]: expected 0.6 to 2 times 1.6975 m, .*got 9"),
    ({"parameters": 5}, r"options\['parameters'\]: expected a mapping with some of trunk_mass.*got 5"),
    ({"parameters": {"wings": 2}}, r"options\['parameters'\]: expected a mapping with some of trunk_mass"),
    ({"parameters": {"trunk_mass": -5.0}}, "trunk_mass: expected.*got -5.0"),
    ({"parameters": {"trunk_mass": (-5.0, 90.0)}}, "trunk_mass: expected.*got -5.0"),
    ({"parameters": {"trunk_mass": None}}, r"options\['parameters'\]\['trunk_mass'\]: expected.*got None"),
    ({"parameters": {"approach_floor": 1e300}}, "approach_floor: expected.*got 1e.300"),
    ({"parameters": {"friction_slow": 1.0}}, "friction_fast: expected more than friction_slow = 1"),
]
RESETS = [(({"options": options}), message) for options, message in OPTIONS] + [
    ({"seed": -1}, "seed: expected a whole number, 0 or more, got -1"),
    ({"seed": 1.5}, "seed: expected a whole number, 0 or more, got 1.5"),
    ({"seed": True}, "seed: expected a whole number, 0 or more, got True"),
    ({"seed": "zero"}, "seed: expected a whole number, 0 or more, got 'zero'"),
    ({"seed": 1, "options": {"gait": "trot"}}, "expected one of carrying_walk, run, walk"),
]
MASKS = [
    ({"seed": [1, 2]}, "seed: expected one number or 3, got 2"),
    ({"seed": [1, 2, -3]}, "seed: expected a whole number, 0 or more, got -3"),
    ({"options": {"reset_mask": np.zeros(3, bool)}}, r"reset_mask'\]: expected a bool array of shape \(3,\)"),
    ({"options": {"reset_mask": np.ones(2, bool)}}, "reset_mask.*got array"),
    ({"options": {"reset_mask": np.ones(3)}}, r"reset_mask'\]: expected a bool array.*got array"),
    ({"options": {"reset_mask": [True, False, True]}}, r"reset_mask'\]: expected a bool array.*got \[True"),
    ({"options": {"reset_mask": np.ones(3, bool), "wings": 2}}, "options: expected a mapping"),
]
ACTIONS = [
    (np.zeros(3), "expected"), (np.zeros((1, 4)), "expected"), ([0, 0, 0, NAN], "expected"),
    (np.full(4, np.inf), "expected"), ("go", "expected"), (None, "expected"), (1.0, "expected"),
    ([1, [2, 3], 4, 5], "expected"), (np.zeros(4, bool), "expected"), (np.zeros(4, complex), "expected"),
    ({"a": 1}, "expected"), (np.full((3, 4), NAN, np.float32), "rows|expected 4"),
    (np.zeros((3, 3)), "expected"), (np.full(4, 1e300), "expected"),
    (np.full((3, 4), 1e300), r"others in rows \[0, 1, 2\]|expected 4"),
]  # fmt: skip


def check_nothing_lost(env, twin, goes_wrong, message):
    """`goes_wrong(env)` raises, and `env` goes on as its `twin` does to which it did not happen."""
    with pytest.raises(ParameterError, match=message):
        goes_wrong(env)
    shape = env.action_space.shape[:-1]
    for taken in actions(2, 5, *shape):
        same(env.step(taken), twin.step(taken))
    same(env.reset(), twin.reset())  # from the same generator


def going(kind, **kwargs):
    env = BOTH[kind](**kwargs)
    env.reset(seed=4)
    for taken in actions(1, 20, *env.action_space.shape[:-1]):
        env.step(taken)
    return env, copy.deepcopy(env)


@pytest.mark.parametrize("kind", BOTH)
@pytest.mark.parametrize(("arguments", "message"), RESETS, ids=[str(given) for given, _ in RESETS])
def test_resets(kind, arguments, message):
    check_nothing_lost(*going(kind), lambda env: env.reset(**arguments), message)


@pytest.mark.parametrize(("arguments", "message"), MASKS, ids=[str(given) for given, _ in MASKS])
def test_resets_of_the_vector_environment(arguments, message):
    check_nothing_lost(*going("vector"), lambda env: env.reset(**arguments), message)


@pytest.mark.parametrize("trunk", ["rail", "fixed"])
@pytest.mark.parametrize("kind", BOTH)
def test_a_trunk_that_cannot_rise_or_move_refuses_it(kind, trunk):
    env, twin = going(kind, trunk=trunk)
    message = rf"options\['height'\]: a {trunk} trunk is at 1.6975 m, got 3 m"
    check_nothing_lost(env, twin, lambda e: e.reset(options={"height": 3.0}), message)
    if trunk == "fixed":
        message = r"options\['speed'\]: expected 0 of a fixed trunk, got 1"
        check_nothing_lost(env, twin, lambda e: e.reset(options={"speed": 1.0}), message)


@pytest.mark.parametrize("kind", BOTH)
@pytest.mark.parametrize(("action", "message"), ACTIONS, ids=[str(given)[:40] for given, _ in ACTIONS])
def test_actions(kind, action, message):
    check_nothing_lost(*going(kind), lambda env: env.step(action), f"actions?: .*{message}")


def test_one_bad_row_is_named():
    env, twin = going("vector")
    given = actions(0, 3)
    given[1, 2] = NAN
    message = r"actions: expected finite numbers in \[-1, 1\], got others in rows \[1\]"
    check_nothing_lost(env, twin, lambda e: e.step(given), message)


def test_a_refused_action_leaves_the_record_of_the_last_step():
    env, _ = going("single")
    env.record()
    env.step(np.zeros(4, np.float32))
    before = env.record()
    for action in (np.full(4, NAN, np.float32), np.zeros(3)):
        with pytest.raises(ParameterError):
            env.step(action)
        same(env.record(), before)


@pytest.mark.parametrize("given", [np.float64, np.float32, np.int64, np.uint8, list], ids=str)
@pytest.mark.parametrize("kind", BOTH)
def test_actions_of_any_number_type_are_taken(kind, given):
    env, twin = going(kind)
    whole = np.ones(env.action_space.shape, np.float32)
    same(env.step(whole.tolist() if given is list else whole.astype(given)), twin.step(whole))


@pytest.mark.parametrize("kind", BOTH)
def test_actions_beyond_the_box_are_clipped(kind):
    env, twin = going(kind)
    same(env.step(np.full(env.action_space.shape, 1e30)), twin.step(np.ones(env.action_space.shape)))


@pytest.mark.parametrize("kind", BOTH)
def test_nothing_goes_before_reset_or_after_close(kind):
    env = BOTH[kind](render_mode="rgb_array")
    taken = env.action_space.sample()
    figures = (env.record, env.episode_summary, env.raw_observation, lambda: env.action_for("run"))
    for call in (lambda: env.step(taken), env.render, env.get_state, *figures):
        with pytest.raises(ResetNeeded, match=r"\(\) was called before reset\(\): expected reset\(\)"):
            call()
    env.reset(seed=0)
    state = env.get_state()
    env.close()
    env.close()
    others = (env.reset, env.render, env.get_state, *figures)
    for call in (lambda: env.step(taken), lambda: env.set_state(state), *others):
        with pytest.raises(ClosedEnvironmentError, match=r"\(\) was called after close\(\): make a new one"):
            call()


def test_a_first_reset_of_some_needs_the_others():
    env = BOTH["vector"]()
    observations, _ = env.reset(seed=0, options={"reset_mask": np.array([True, False, True])})
    assert np.isfinite(observations).all()
    with pytest.raises(ResetNeeded, match=r"environments \[1\] have no episode yet: expected reset"):
        env.step(actions(0, 3))
    env.reset(seed=[None, 1, None], options={"reset_mask": np.array([False, True, False])})
    whole = BOTH["vector"]()
    same(env.step(actions(0, 3)), (whole.reset(seed=0), whole.step(actions(0, 3)))[1])


def test_an_episode_that_ended_is_not_stepped_with_autoreset_disabled():
    env = BOTH["vector"](autoreset_mode="DISABLED", episode_seconds=0.04)
    env.reset(seed=0)
    env.step(actions(0, 3))
    env.reset(options={"reset_mask": np.array([True, False, False])})
    env.step(actions(0, 3))
    with pytest.raises(ResetNeeded, match=r"episodes \[1, 2\] ended: expected reset.*reset_mask"):
        env.step(actions(0, 3))
    env.reset(options={"reset_mask": np.array([False, True, True])})
    env.step(actions(0, 3))


def without(state, name):
    return {key: value for key, value in state.items() if key != name}


def foreign(kind, **kwargs):
    return lambda state: going(kind, **kwargs)[0].get_state()


STATES = {
    "nothing": (lambda state: None, "state: expected what get_state gives, but id, settings.* is missing"),
    "a part": (lambda state: without(state, "episode"), "but episode is missing"),
    "no form": (
        lambda state: without(state, "actions"), r"actions are rates, got one of an older form \(positions",
    ),
    "a form": (lambda state: {**state, "actions": "offsets"}, "whose actions are rates, got 'offsets'"),
    "an id": (lambda state: {**state, "id": IDS[1]}, f"expected one of {LEG}, got one of {IDS[1]}"),
    "a version": (
        lambda state: {**state, "id": "hoof_env/HorseLeg-v1"}, "got one of hoof_env/HorseLeg-v1",
    ),
    "no settings": (lambda state: {**state, "settings": 5}, "of other settings; preset: 'identified' here"),
    "no engine": (lambda state: {**state, "engine": {}}, "state: .* is missing"),
    "not a number": (
        lambda state: {**state, "engine": {**state["engine"], "trunk": state["engine"]["trunk"] * NAN}},
        "expected|state",
    ),
    "a shape": (lambda state: {**state, "episode": state["episode"][:, :0]}, "episode.*expected shape"),
    "words": (lambda state: {**state, "episode": "long"}, "episode.*expected numbers, got 'long'"),
    "no number": (lambda state: {**state, "episode": state["episode"] * NAN}, "episode.*expected numbers"),
    "no generators": (lambda state: {**state, "generator": 5}, "generator.*expected.*got 5"),
    "a generator": (lambda state: {**state, "generator": [{"a": 1}] * 3}, "generator.*PCG64"),
}  # fmt: skip


@pytest.mark.parametrize("name", STATES)
@pytest.mark.parametrize("kind", BOTH)
def test_states(kind, name):
    env, twin = going(kind)
    change, message = STATES[name]
    given = change(env.get_state())
    check_nothing_lost(env, twin, lambda e: e.set_state(given), message)


@pytest.mark.parametrize(("row", "value"), [("weight", 0.0), ("gait", np.inf)])
def test_states_of_a_horse_that_cannot_be(row, value):
    """Of no weight, or of a gait without end, which would be found only as a failure of the next step."""
    env = gym.make(HORSE).unwrapped
    env.reset(seed=0)
    state, before = env.get_state(), env.get_state()
    state["episode"][env.batch.layout.rows(row).start] = value
    with pytest.raises(ParameterError, match=r"state\['episode'\]: expected numbers"):
        env.set_state(state)
    same(env.get_state(), before)
    with pytest.raises(ParameterError, match=r"state\['episode'\]: expected numbers"):
        gym.make(HORSE).unwrapped.set_state(state)  # one that has had no episode yet


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"preset": OTHER_LEG}, "preset: 'identified' here, .*'provenance': 'another'.* there"),
        ({"trunk_mass": 90.0}, "trunk_mass: 50.0 here, 90.0 there"),
        ({"observation": ["hoof"]}, "observation: .* here, .'hoof'. there"),
        ({"terrain": {"kind": "hills"}}, "terrain: None here, .*hills.* there"),
    ],
)
@pytest.mark.parametrize("kind", BOTH)
def test_states_of_other_settings(kind, settings, message):
    state = going(kind, **settings)[0].get_state()
    message = f"state: of other settings; {message}"
    check_nothing_lost(*going(kind), lambda env: env.set_state(state), message)


def test_states_of_other_numbers_of_environments():
    vector = going("vector")[0].get_state()
    two = gym.make_vec(LEG, num_envs=2).unwrapped
    two.reset(seed=0)
    cases = [
        ("vector", two.get_state(), "one of 3 environments.*of 2"),
        ("single", vector, "state"),
    ]
    message = r"state\['ended'\]: expected a bool array of shape \(3,\), got"
    wrong = (None, "yes", [[True], [True, False]], np.zeros(3))
    cases += [("vector", {**vector, "ended": ended}, message) for ended in wrong]
    for kind, state, message in cases:
        check_nothing_lost(*going(kind), lambda env, s=state: env.set_state(s), message)


def test_gaits_and_policies_by_name_or_refused_in_words():
    env = gym.make(LEG)
    leg, run = env.unwrapped, load_gait("run")
    env.reset(seed=0, options={"gait": "walk"})
    for gait in ("run", run.to_array(), run.to_array().tolist()):
        same(leg.action_for(gait), leg.action_for(run))
    for gait in ("trot", None, 3, [1.0, 2.0], {"crank_speed": 1.0}, [1.0, 2.0, 3.0, NAN]):
        with pytest.raises(ParameterError, match=r"gait: expected one of carrying_walk, run, walk.*got"):
            leg.action_for(gait)
    for arguments in ((env, "run"), ("run", "walk"), ("run", gym.make("CartPole-v1"))):
        with pytest.raises(ParameterError, match=r"env: expected an environment of this package, make_pol"):
            make_policy(*arguments)
    with pytest.raises(ParameterError, match=r"policy: expected one of .*got 3"):
        make_policy(3, env)


def test_adapter():
    for env_id in ("hoof_env/HorseLegMO-v0", "CartPole-v1", "Nobodys-v0", "no_such_module:Leg-v0"):
        with pytest.raises(ParameterError, match="env_id: expected an id of this package with many at once"):
            Sb3VecEnv(env_id, 2)
    with pytest.raises(ParameterError, match="unexpected keyword argument 'trunck'; did you mean trunk"):
        Sb3VecEnv(LEG, 2, trunck="rail")
    with pytest.raises(ParameterError, match="autoreset_mode: expected SAME_STEP, got 'NEXT_STEP'"):
        Sb3VecEnv(LEG, 2, autoreset_mode="NEXT_STEP")
    env = Sb3VecEnv(LEG, 2)
    with pytest.raises(ParameterError, match="expected all environments, which are one, got"):
        env.env_method("close", indices=0)
