"""What environments refuse once they are made, and go on as if nothing had been: resets, steps, states, and
other calls (`CALLS`), by the words of each error. A new option or method adds its rows here."""

from __future__ import annotations

import collections.abc
import copy
import itertools

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, IDS, actions, same
from gymnasium.error import ClosedEnvironmentError, ResetNeeded

from hoof_env import RandomizeParameters, Sb3VecEnv, read_preset
from hoof_env.errors import FixedSettingError, ParameterError, UnknownArgumentError
from hoof_env.gait import HarmonicGait, load_gait

LEG, NAN = "hoof_env/HorseLeg-v0", float("nan")
HARMONIC = HarmonicGait(5.0, 0.4, 0.1, -0.2, (0.1, 0.05))
OTHER_LEG = {**read_preset("identified"), "provenance": "another"}


BOTH = {"single": lambda **kwargs: gym.make(LEG, **kwargs).unwrapped,
        "vector": lambda **kwargs: gym.make_vec(LEG, num_envs=3, **kwargs).unwrapped}  # fmt: skip

OPTIONS = [
    ({"phase": 1.0}, "options: expected .*gait, parameters, crank_angle, speed, height"),
    (["gait"], r"options: expected .*got \['gait'\]"),
    (7, "options: expected .*got 7"),
    ({"gait": "trot"}, r"options\['gait'\]: expected .*carrying_walk, run, walk, got 'trot'"),
    (
        {"gait": {"speed": 1}},
        r"options\['gait'\]: expected a gait name \(carrying_walk, run, walk\) .*mapping",
    ),
    ({"gait": 7}, r"options\['gait'\]: expected a gait name"),
    ({"gait": {**vars(load_gait("run")), "crank_speed": 99.0}}, "expected crank_speed.*got 99"),
    ({"gait": HARMONIC}, "gait: expected a swing .*1 harmonic, got HarmonicGait"),
    ({"crank_angle": NAN}, r"options\['crank_angle'\]: expected.*got nan"),
    ({"speed": 1e3}, r"options\['speed'\]: expected.*got 1000.0"),
    ({"x": "here"}, r"options\['x'\]: expected.*got 'here'"),
    ({"height": -1}, r"options\['height'\]: expected.*got -1"),
    ({"height": 9.0}, r"options\['height'\]: expected 0.6 to 2 times 1.6975 m, .*got 9"),
    ({"parameters": 5}, r"options\['parameters'\]: expected .*trunk_mass.*got 5"),
    ({"parameters": {"wings": 2}}, r"options\['parameters'\]: expected .*trunk_mass"),
    ({"parameters": {"trunk_mass": -5.0}}, r"^options\['parameters'\]: trunk_mass: expected.*got -5.0"),
    ({"parameters": {"trunk_mass": (-5.0, 90.0)}}, "trunk_mass: expected.*got -5.0"),
    ({"parameters": {"trunk_mass": None}}, r"options\['parameters'\]\['trunk_mass'\]: expected.*got None"),
    ({"parameters": {"approach_floor": 1e300}}, "approach_floor: expected.*got 1e.300"),
    ({"parameters": {"friction_slow": 1.0}}, "friction_fast: expected .*friction_slow = 1"),
]
RESETS = [(({"options": options}), message) for options, message in OPTIONS] + [
    ({"seed": -1}, "seed: expected .*0 .*got -1"),
    ({"seed": 1.5}, "seed: expected .*0 .*got 1.5"),
    ({"seed": True}, "seed: expected .*0 .*got True"),
    ({"seed": "zero"}, "seed: expected .*0 .*got 'zero'"),
    ({"seed": 1, "options": {"gait": "trot"}}, "expected .*carrying_walk, run, walk"),
]
MASKS = [
    ({"seed": [1, 2]}, "seed: expected .*3, got 2"),
    ({"seed": [1, 2, -3]}, "seed: expected .*0 .*got -3"),
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
    (np.full((3, 4), 1e300), r"NaN or infinity in rows \[0, 1, 2\]|expected 4"),
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
    message = rf"options\['height'\]: a {trunk} trunk .*1.6975 m, got 3 m"
    check_nothing_lost(env, twin, lambda e: e.reset(options={"height": 3.0}), message)
    if trunk == "fixed":
        message = r"options\['speed'\]: expected 0 .*fixed trunk, got 1"
        check_nothing_lost(env, twin, lambda e: e.reset(options={"speed": 1.0}), message)


@pytest.mark.parametrize("kind", BOTH)
@pytest.mark.parametrize(("action", "message"), ACTIONS, ids=[str(given)[:40] for given, _ in ACTIONS])
def test_actions(kind, action, message):
    check_nothing_lost(*going(kind), lambda env: env.step(action), f"actions?: .*{message}")


def test_one_bad_row_is_named():
    env, twin = going("vector")
    given = actions(0, 3)
    given[1, 2] = NAN
    message = r"actions: expected .*\[-1, 1\], got .*rows \[1\]"
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


def test_a_step_needs_a_reset_of_every_row():
    env = BOTH["vector"]()
    observations, _ = env.reset(seed=0, options={"reset_mask": np.array([True, False, True])})
    assert np.isfinite(observations).all()
    with pytest.raises(ResetNeeded, match=r"environments \[1\] .*episode yet: expected reset"):
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
    "nothing": (lambda state: None, "state: expected what get_state returns, but id, settings.* is missing"),
    "a part": (lambda state: without(state, "episode"), "but episode is missing"),
    "no form": (
        lambda state: without(state, "actions"), "actions are rates, got None",
    ),
    "a form": (lambda state: {**state, "actions": "offsets"}, "whose actions are rates, got 'offsets'"),
    "an id": (lambda state: {**state, "id": IDS[1]}, f"expected .*{LEG}, got .*{IDS[1]}"),
    "a version": (
        lambda state: {**state, "id": "hoof_env/HorseLeg-v1"}, "got .*hoof_env/HorseLeg-v1",
    ),
    "no settings": (
        lambda state: {**state, "settings": 5},
        "made with other settings; preset: 'identified' here",
    ),
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


@pytest.mark.parametrize(
    ("row", "value"),
    [("weight", 0.0), ("gait", np.inf), ("x_before", np.inf), ("target", np.inf)],
)
def test_states_of_a_horse_that_cannot_be(row, value):
    """A weight of 0 or a number without end would be found only as a failure of the next step."""
    env = gym.make(HORSE).unwrapped
    env.reset(seed=0)
    state, before = env.get_state(), env.get_state()
    state["episode"][env.batch.rows.layout.rows(row).start] = value
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
    message = f"state: .*settings; {message}"
    check_nothing_lost(*going(kind), lambda env: env.set_state(state), message)


def test_states_of_other_numbers_of_environments():
    vector = going("vector")[0].get_state()
    two = gym.make_vec(LEG, num_envs=2).unwrapped
    two.reset(seed=0)
    cases = [
        ("vector", two.get_state(), "a state of 3 environments.*of 2"),
        ("single", vector, "state"),
    ]
    message = r"state\['ended'\]: expected a bool array of shape \(3,\), got"
    wrong = (None, "yes", [[True], [True, False]], np.zeros(3))
    cases += [("vector", {**vector, "ended": ended}, message) for ended in wrong]
    for kind, state, message in cases:
        check_nothing_lost(*going(kind), lambda env, s=state: env.set_state(s), message)


# All other calls


def single(env_id=LEG, **settings):
    env = gym.make(env_id, **settings).unwrapped
    env.reset(seed=0)
    return env


def three(**settings):
    envs = gym.make_vec(LEG, num_envs=3, **settings).unwrapped
    envs.reset(seed=0)
    return envs


def wrapped():
    env = RandomizeParameters(gym.make(LEG), {"friction": 0.3})
    env.reset(seed=0)
    return env


KINDS = {
    "single": single,
    "vector": three,
    "horse": lambda: single(HORSE),
    "rail": lambda: single("hoof_env/HorseLegRail-v0"),
    "terrain": lambda: single("hoof_env/HorseLegTerrain-v0"),
    "wrapper": wrapped,
}


def asks(name, *arguments):
    """A call of a method."""
    return lambda env: getattr(env, name)(*arguments)


def assigns(name, value):
    return lambda env: setattr(env, name, value)


def changes(**settings):
    return lambda env: env.change_settings(**settings)


def resets(**options):
    return lambda env: env.reset(options=options)


def state_with(**entries):
    """A state of a single environment with some entries changed, or functions of those that it has."""

    def set_state(envs):
        good = single().get_state()
        envs.set_state({**good, **{k: v(good[k]) if callable(v) else v for k, v in entries.items()}})

    return set_state


NO_GAIT = r"gait: expected .*carrying_walk, run, walk.*got"
NO_GAITS = (
    "trot", None, 3, [1.0, 2.0], [1.0, 2.0, 3.0, NAN], HarmonicGait(5.0, 0.4, 0.1, -0.2), HARMONIC,
    {"crank_speed": 1.0},
)  # fmt: skip
OF_ONE = "state: expected what get_state returns for one"
BESIDE = r"options\['parameters'\]: 'trunk_damping': expected trunk='suspended'"
CALLS = [
    # gaits to go to
    *(
        ("single", asks("action_for", gait), ParameterError, NO_GAIT)
        for gait in (*NO_GAITS, np.zeros((2, 4)))
    ),
    *(
        ("vector", asks("action_for", gait), ParameterError, NO_GAIT)
        for gait in (*NO_GAITS, np.zeros((4, 4)), np.zeros((3, 1, 4)))
    ),
    # resets
    ("horse", resets(crank_angle=0.0), ParameterError, "mapping with some of gait, parameters, phase"),
    ("horse", resets(phase="early"), ParameterError, r"options\['phase'\]"),
    ("horse", resets(gait="canter"), ParameterError, r"options\['gait'\]: expected one of"),
    ("horse", resets(gait=[1.0, 2.0]), ParameterError, "a HorseGait, or finite numbers of shape"),
    (
        "horse",
        resets(gait=np.full(16, 5.0)),
        ParameterError,
        r"options\['gait'\]: expected fore_speed_cos from -0.6 to 0.6, got 5",
    ),
    (
        "horse",
        resets(gait=np.r_[-5.0, np.zeros(15)]),
        ParameterError,
        r"options\['gait'\]: expected rate from 0.1 to",
    ),
    (
        "horse",
        resets(gait=np.tile(np.r_[4.0, np.zeros(15)], (3, 1))),
        ParameterError,
        r"options\['gait'\]: expected one gait or 1",
    ),
    ("horse", resets(pitch=1.0), ParameterError, r"options\['pitch'\]"),
    ("rail", resets(parameters={"trunk_damping": 1.0}), ParameterError, BESIDE),
    (
        "rail",
        resets(target_speed=2.0),
        ParameterError,
        r"options\['target_speed'\]: expected none .*speed",
    ),
    *(
        ("wrapper", lambda env, options=options: env.reset(options=options), ParameterError,
         r"options.*: expected .*, got")
        for options in ("fast", ["gait"], {"parameters": 5}, {"parameters": None})
    ),
    # settings from the next reset on
    *(
        (kind, changes(**{name: value}), ParameterError, name)
        for kind in ("single", "vector")
        for name, value in (
            ("target_speed", "fast"),
            ("terrain", {"kind": "moon"}),
            ("terrain", {"kind": "slope", "angle": 0.1}),
            ("reward_weights", {"speed": 1.0}),
            ("randomize", {"friction": (0.3, 0.1)}),
        )
    ),
    ("single", changes(dt=0.01), FixedSettingError, "expected .*target_speed.*got 'dt'"),
    ("single", changes(target_sped=1.0), UnknownArgumentError, "did you mean target_speed"),
    (
        "single",
        assigns("terrain", None),
        FixedSettingError,
        r"from the next reset on by change_settings\(terrain=...\)",
    ),
    ("terrain", changes(terrain=None), ParameterError, "'ground' is constant without terrain"),
    # states of a single environment for all of many
    ("vector", state_with(settings=lambda s: {**s, "friction": 0.1}), ParameterError, "friction: 0.4 here"),
    ("vector", state_with(engine=lambda s: {**s, "layout": 3}), ParameterError, OF_ONE),
    ("vector", state_with(episode=np.zeros((3, 2))), ParameterError, OF_ONE),
    ("vector", state_with(generator={"state": 3}), ParameterError, "state.*generator"),
    (
        "single",
        lambda env: env.set_state(three().get_state()),
        ParameterError,
        "state: expected .*single environment, got .*3 environments",
    ),
    ("single", state_with(id="own/Everything-v0"), ParameterError, f"a state of {LEG}, got .*own"),
    # attributes, methods, records and generators of rows
    *(
        ("vector", asks("set_attr", name, 5), FixedSettingError, f"{name}: expected no assignment.*m.make")
        for name in ("trunk_mass", "dt", "weight", "gaits", "step")
    ),
    (
        "vector",
        asks("set_attr", "trunk_mass", 5),
        ParameterError,
        r"reset\(options=\{'parameters': \{'trunk_mass': \.\.\.\}\}\)",
    ),
    ("vector", asks("set_attr", "mark", [1, 2]), ParameterError, "values: expected .*3, got 2"),
    *(
        ("vector", asks("call", name), ParameterError, f"'{name}' .*together; expected envs.{name}")
        for name in ("reset", "step")
    ),
    *(("vector", asks("record", row), ParameterError, "env: expected") for row in (3, -1, 1.5)),
    *(
        ("vector", assigns("np_random", value), ParameterError, "np_random: expected")
        for value in (3, [np.random.default_rng(0)], [1, 2, 3])
    ),
]  # fmt: skip
"""Kind of environment, call, class and words of the error."""


@pytest.mark.parametrize(
    ("kind", "call", "error", "words"), CALLS, ids=[f"{row[0]}-{row[3]}" for row in CALLS]
)
def test_calls(kind, call, error, words):
    """Nothing changes, the settings included."""
    env = KINDS[kind]()
    before, settings = env.unwrapped.get_state(), env.unwrapped.settings
    with pytest.raises(error, match=words):
        call(env)
    same(env.unwrapped.get_state(), before)
    assert env.unwrapped.settings == settings


def test_the_adapter_has_no_method_of_one_environment():
    env = Sb3VecEnv(LEG, 2)
    with pytest.raises(ParameterError, match=r"expected all environments, .*got"):
        env.env_method("close", indices=0)


def test_gaits_go_by_name_or_number():
    env = gym.make(LEG)
    leg, run = env.unwrapped, load_gait("run")
    env.reset(seed=0, options={"gait": "walk"})
    for gait in ("run", run.to_array(), run.to_array().tolist()):
        same(leg.action_for(gait), leg.action_for(run))


@pytest.mark.parametrize("kind", [np.random.PCG64, np.random.Philox, np.random.SFC64, np.random.MT19937])
def test_a_state_holds_any_generator_of_numpy(kind):
    env = gym.make("hoof_env/HorseLeg-v0").unwrapped
    env.np_random = np.random.Generator(kind(3))
    env.reset()
    state = env.get_state()
    following = env.reset()[0]
    env.set_state(state)
    assert (env.reset()[0] == following).all()


@pytest.mark.parametrize("num_envs", [1, 2])
def test_an_action_that_numpy_cannot_convert_is_named_with_the_remedy(num_envs):
    torch = pytest.importorskip("torch")
    env = gym.make_vec(LEG, num_envs=2) if num_envs == 2 else gym.make(LEG)
    env.reset(seed=0)
    shape = env.action_space.shape
    for action in (torch.zeros(shape, dtype=torch.bfloat16), torch.zeros(shape, requires_grad=True)):
        with pytest.raises(ParameterError, match=rf"got a Tensor of {action.dtype} .*detach\(\)\.float\(\)"):
            env.step(action)


class Sequence(collections.abc.Sequence):
    """Sequence of a configuration library."""

    def __init__(self, *values):
        self.values = values

    def __getitem__(self, key):
        return self.values[key]

    def __len__(self):
        return len(self.values)


def test_any_sequence_is_as_good_as_a_list():
    given = {"observation": Sequence("crank", "gait"), "randomize": {"friction": Sequence(0.2, 0.6)}}
    listed = {"observation": ["crank", "gait"], "randomize": {"friction": [0.2, 0.6]}}
    made, same_with_lists = (gym.make("hoof_env/HorseLeg-v0", **each).unwrapped for each in (given, listed))
    assert made.settings == same_with_lists.settings
    assert made.observation_names == same_with_lists.observation_names


@pytest.mark.parametrize("env_id", [LEG, HORSE])
def test_a_damaged_number_is_refused_or_steps_stay_finite(env_id):
    """Each number of a state in turn: too large, infinite, or 0."""
    env = gym.make(env_id).unwrapped
    env.reset(seed=0)
    idle = np.zeros(env.action_space.shape, np.float32)
    for _ in range(9):
        env.step(idle)
    state = env.get_state()
    generator = np.random.default_rng(0)
    refused = 0
    for part in ("trunk", "limbs", "command", "trunk_settings", "limb_settings", "episode"):
        values = (state if part == "episode" else state["engine"])[part].reshape(-1)
        rows = range(values.size) if values.size < 40 else generator.choice(values.size, 40, replace=False)
        for row, value in itertools.product(rows, (0.0, 1e150, np.inf)):
            before, values[row] = values[row], value
            try:
                seen = [env.set_state(state)]
                for _ in range(2):
                    observation, reward, terminated, *_ = env.step(idle)
                    seen += [observation, reward]
                    if terminated:
                        break
            except ParameterError:
                refused += 1
            else:
                assert all(np.isfinite(each).all() for each in seen), (part, row, value)
            values[row] = before
    assert refused > 100
