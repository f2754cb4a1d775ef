"""Ids of one's own: the same bits alone and among many, whole in every front door, exact refusals."""

from __future__ import annotations

import re
import subprocess
import sys
import textwrap
from pathlib import Path
from types import FunctionType

import gymnasium as gym
import numpy as np
import pytest
from family import actions, roll, same

import hoof_env
from hoof_env import Scale, Term, register
from hoof_env.cli import main
from hoof_env.dynamics.hoof import GroundHere
from hoof_env.dynamics.layout import TRUNK_STATE, LegMemory, TrunkMemory
from hoof_env.envs.manual import page_of
from hoof_env.envs.step import step_kernels
from hoof_env.simd.reach import fingerprint
from hoof_env.simd.user_functions import what_cannot_be_compiled
from hoof_env.tasks import registry as tasks
from hoof_env.tasks.episode import Episode
from hoof_env.tasks.observation import ENTRIES, ObservationInputs
from hoof_env.tasks.reward import TERMS, Outcome

PAGE = (Path(__file__).parents[2] / "docs" / "own_task.md").read_text(encoding="utf-8")
PAGE = PAGE.split("## A leg of your own", 1)[0]  # tests/envs/test_own_leg.py has the rest
LEG = "hoof_env/HorseLeg-v0"
HILLS = {"kind": "hills", "seed": 3, "stiffness": [0.25, 2.0]}
NAMES = ("rising", "load angle", "episode seconds")
PLAIN = Scale("none")


pytestmark = pytest.mark.usefixtures("registered")


@pytest.mark.parametrize("settings", [{}, {"terrain": HILLS}, {"exponent": 1.25}], ids=str)
@pytest.mark.parametrize(
    "make", [gym.make, lambda *a, **k: gym.make_vec(*a, num_envs=9, **k)], ids=["1", "9"]
)
def test_a_law_that_states_equation_14_has_the_bits_of_the_built_in_one(own, make, settings):
    mine, plain = make(own.ID, **settings), make(LEG, episode_seconds=2.0, **settings)
    shape = mine.action_space.shape[:-1]
    mine.reset(seed=1)
    plain.reset(seed=1)
    for acts in actions(4, 60, *shape):
        (one, *_, info), (two, *_, other) = mine.step(acts), plain.step(acts)
        same(one[..., :-3], two)
        same(np.asarray(info["measured"]), np.asarray(other["measured"]))
        for key in (key for key in other if key.startswith("reward_")):
            same(info[key], other[key])


def test_infos_sums_weights_names_and_units(own):
    env = gym.make(own.ID, reward_weights={"friction": 2.0}).unwrapped
    observation, info = env.reset(seed=0)
    terms = [key for key in info if key.startswith("reward_")]
    assert terms[-2:] == ["reward_friction", "reward_comfort"]
    assert env.observation_names[-3:] == NAMES
    assert env.observation_units[-3:] == ("m/s^2", "rad", "s")
    assert env.observation_space.shape == observation.shape == (len(env.observation_names),)
    rubbed = set()
    for action in actions(1, 60):
        observation, reward, *_, info = env.step(action)
        assert [key for key in info if key.startswith("reward_")] == terms
        assert reward == sum(info[key] for key in terms)
        record = {name: values.ravel()[-1] for name, values in env.record().items()}
        power = sum(record[f"{p}_friction"] * record[f"{p}_slide"] for p in ("toe", "heel"))
        assert info["reward_friction"] == pytest.approx(0.001 * 2.0 * power, rel=1e-12)
        rubbed.add(info["reward_friction"])
        assert info["reward_comfort"] == pytest.approx(0.1 * np.exp(-abs(record["ay"]) / 9.81), rel=1e-12)
        raw = env.raw_observation()
        assert raw["rising"] == (record["ay"] if record["vy"] > 0 else 0.0)
        assert observation[-3] == pytest.approx(np.tanh(raw["rising"] / 9.81), abs=1e-6)
        assert observation[-2] == pytest.approx(raw["load angle"] / np.pi, abs=1e-6)
        assert observation[-1] == pytest.approx(raw["episode seconds"] / 10, abs=1e-6)
    assert len(rubbed) > 10


def test_spawned_workers_import_the_module(own):
    """Twice: named by "module:id", and by the id alone, whose spec names the module."""
    settings = {"num_envs": 1, "vectorization_mode": "async", "vector_kwargs": {"context": "spawn"}}
    env = gym.make(own.ID)
    expected = env.reset(seed=0)[0], env.step(actions(0, 1)[0])[0]
    for name in (own.MODULE_ID, own.ID):
        envs = gym.make_vec(name, **settings)
        try:
            same(envs.reset(seed=0)[0][0], expected[0])
            same(envs.step(actions(0, 1))[0][0], expected[1])
        finally:
            envs.close()


def test_stable_baselines_sees_it(own):
    pytest.importorskip("stable_baselines3")
    envs = hoof_env.Sb3VecEnv(own.MODULE_ID, num_envs=9)
    plain = gym.make(own.ID)
    same(plain.reset(seed=0)[0], (envs.seed(0), envs.reset())[1][0])
    _, rewards, *_ = envs.step(np.zeros((9, 4), np.float32))
    assert np.float32(plain.step(np.zeros(4, np.float32))[1]) == rewards[0]
    assert {"reward_friction", "reward_comfort"} < set(envs.terms)


def test_a_spec_makes_it_again(own):
    env = gym.make(own.ID, stiffness=3e4, trunk_share=0.7)
    assert env.spec.kwargs["task"] == own.MODULE_ID
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    for twin in (env, again):
        twin.reset(seed=0)
    for one, two in zip(roll(env, 5), roll(again, 5), strict=True):
        same(one, two)


def test_its_manual_page_has_its_rows(own, capsys):
    page = page_of(own.ID)
    assert page == page_of(own.MODULE_ID)
    assert "| `friction` | 0.5 | 1/kJ | power of friction |" in page
    assert re.search(r"\| \d+ \| load angle \| / pi \| rad \| feel \|", page)
    assert "`own_functions.equation_14`" in page
    assert f'gym.make("{own.ID}"' in page
    assert main(["manual", "--id", own.MODULE_ID]) == 0
    assert "| `comfort` |" in capsys.readouterr().out


NO_FUNCTION = "No implementation of function Function"
OF_NUMBA = {
    f"{NO_FUNCTION}(<built-in function sin>) found for signature": "sin()",
    f"{NO_FUNCTION}(<ufunc 'exp'>) found": "exp()",
    f"{NO_FUNCTION}(<function max at 0x7f>) found": "max()",
    f"{NO_FUNCTION}(<class 'bool'>) found": "`if`, `and`, `or` or `not` of numbers",
    "Untyped global name 'f': Cannot determine Numba type of <class 'function'>": "f, a function without",
    "Failed in nopython mode pipeline (step: x)\nCannot unify int64 and none\n\nDuring: y": "Cannot unify",
    "Unknown attribute 'pace' of type Columns(1, x.LegMemory)": ".pace, which Columns has not,",
    "something else": "something else",
}


@pytest.mark.parametrize(("text", "found"), OF_NUMBA.items())
def test_the_operation_is_that_of_numbas_message(text, found):
    assert f"cannot compile {found}" in what_cannot_be_compiled(Exception(text))


def test_the_same_id_again_replaces_it_with_gymnasiums_warning(own):
    register("own/Again-v0", episode_seconds=3.0)
    with pytest.warns(UserWarning, match="Overriding environment own/Again-v0 already in registry"):
        register("own/Again-v0", base=own.ID, episode_seconds=4.0)
    env = gym.make("own/Again-v0").unwrapped
    assert env.settings.episode_seconds == 4.0
    assert env.observation_names[-3:] == NAMES, "one may begin with an id of one's own"


def test_a_term_takes_the_place_of_one_of_the_base(own):
    mine = Term("progress", 2.0, "1/m", "of x", lambda step, weight: weight * step.progress)
    register("own/Instead-v0", base="speed", terms=[mine], reward_weights={"peak": 0.5})
    task = tasks._OWN["own/Instead-v0"]
    assert [term.name for term in task.terms] == [term.name for term in tasks.TASKS["speed"].terms]
    assert task.terms[0] is mine
    kept = dict(tasks.TASKS["speed"].defaults["reward_weights"])
    assert task.settings({}).reward_weights == {**kept, "peak": 0.5}, "those of the base stay"


def test_a_step_that_could_not_be_simulated_pays_for_nothing_but_the_failure(own):
    env = gym.make(own.ID).unwrapped
    env.reset(seed=0)
    state = env.get_state()
    state["engine"]["trunk"][TRUNK_STATE.index("momentum_x")] = 1e308
    env.set_state(state)
    observation, reward, terminated, _, info = env.step(np.zeros(4, np.float32))
    assert terminated
    assert info["reward_friction"] == info["reward_comfort"] == 0.0
    assert reward == info["reward_failure"]
    rest = env.settings.episode_seconds - env.batch.episode_rows.time[0]
    assert reward == -env.batch.weights["failure"] * rest < -1.0
    assert np.isfinite(observation).all()


def test_a_term_with_the_name_of_a_built_in_one_is_the_users():
    """It may not handle what a failed step leaves, so it counts 0 there."""
    register(
        "own/Slip-v0", terms=[Term("slip", 1.0, "-", "of x", lambda step, weight: weight * step.trunk.result)]
    )
    env = gym.make("own/Slip-v0").unwrapped
    env.reset(seed=0)
    state = env.get_state()
    state["engine"]["trunk"][TRUNK_STATE.index("momentum_x")] = 1e308
    env.set_state(state)
    _, reward, terminated, _, info = env.step(np.zeros(4, np.float32))
    assert terminated
    assert info["measured"]["result"] != 0.0
    assert info["reward_slip"] == 0.0
    assert reward == info["reward_failure"]


def test_a_sum_that_a_leg_does_not_have_is_not_a_number():
    def braking(step, weight):
        return weight * step.sums.braking

    register("own/Braking-v0", terms=[Term("braking", 1.0, "-", "of x", braking)])
    env = gym.make("own/Braking-v0")
    env.reset(seed=0)
    assert np.isnan(env.step(np.zeros(4, np.float32))[4]["reward_braking"])


# What is compiled, and when


def function_of(text, **names):
    """The last function of some source, whose module has other names too."""
    space = {"__name__": "mine", **names}
    exec(compile(text, "mine.py", "exec"), space)
    return [value for value in space.values() if isinstance(value, FunctionType)][-1]


BEFORE = textwrap.dedent("""
    GRIP, TABLE = 0.5, (1, 2)
    def helper(x):
        return 2.0 * x
    def compute(step, weight=1.0):
        inner = lambda x: x + 1.0
        return GRIP * helper(step.progress) + inner(TABLE[0]) + np.float64(3.0) + constants.LIMIT
""")


@pytest.mark.parametrize(
    "edit",
    [
        ("0.5", "0.6"), ("2.0 * x", "3.0 * x"), ("step.progress", "step.weight"), ("x + 1.0", "x + 2.0"),
        ("(1, 2)", "(1, 3)"), ("weight=1.0", "weight=2.0"), ("+ inner", "- inner"),
    ],
    ids=" to ".join,
)  # fmt: skip
def test_an_edit_changes_the_fingerprint(edit):
    def digest(text, limit=1.0):
        constants = type(np)("mine_too")
        constants.LIMIT = limit
        return fingerprint(function_of(text, np=np, constants=constants))

    assert digest(BEFORE) == digest(BEFORE)
    assert digest(BEFORE) == digest("\n\n# moved\n" + BEFORE)
    assert digest(BEFORE.replace(*edit)) != digest(BEFORE)
    assert digest(BEFORE, limit=2.0) != digest(BEFORE)


def test_what_a_function_encloses_is_in_the_fingerprint():
    def made(x):
        return lambda step, weight: x

    values = (1.0, 2.0, 1, True, "a", np.zeros(2), np.ones(2), np.zeros(2, np.float32), made(1.0), (1.0, 2.0))
    assert len({fingerprint(made(value)) for value in values}) == len(values)


# The page


def test_the_example_has_the_same_bits_alone_and_among_many():
    example = Path(__file__).parents[2] / "examples" / "own_task.py"
    run = subprocess.run([sys.executable, str(example)], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    found = re.fullmatch(r"reward .*, of which (.*) for friction and (.*) for comfort\n", run.stdout)
    assert found
    assert float(found[1]) < 0.0 < float(found[2])


def rows_under(heading):
    """Names in the first column of the tables of a section."""
    part = PAGE.split(heading, 1)[1].split("\n## ", 1)[0]
    cells = re.findall(r"^\| (`.*?) \|", part, re.MULTILINE)
    return [name for cell in cells for name in re.findall(r"`([\w.]+)`", cell)]


def test_tasks_with_the_same_entries_share_the_kernels_of_the_observation():
    def kernels(*terms):
        return step_kernels(terms, ENTRIES, None)

    one, other = (Term("own", 1.0, "-", "x", function) for function in (lambda s, w: w, lambda s, w: 2.0 * w))
    a, b, c = kernels(*TERMS, one), kernels(*TERMS, other), kernels(*TERMS, one, other)
    assert a is not b
    assert a.observers is b.observers
    assert a.observers is not c.observers  # an episode's memory is larger


def test_the_page_has_every_name_that_functions_reach():
    """What environments keep no account of, and what is the engine's own, is left out."""
    assert rows_under("## What `step` has") == list(Outcome._fields)
    assert rows_under("## What `scene` has") == list(ObservationInputs._fields)
    assert rows_under("## What `ground` has") == list(GroundHere._fields)
    reached = set(rows_under("## What the memory has"))
    expected = set()
    for name, layout, hidden in (
        ("trunk", TrunkMemory, {"account"}), ("leg", LegMemory, set()), ("episode", Episode, set())
    ):  # fmt: skip
        for key, field in layout.fields.items():
            if key not in hidden:
                is_table = name != "trunk" and key == "sums"  # the manual pages list those
                inner = {} if is_table else getattr(field.kind, "fields", {})
                expected |= {f"{name}.{key}.{k}" for k, part in inner.items() if part.size}
                expected |= set() if inner else {f"{name}.{key}"}
    assert reached == expected


def test_the_page_shows_the_examples():
    """All but the program at the end of the first, in its order; the parts of the second; the rest runs."""
    folder = Path(__file__).parents[2] / "examples"
    first, second = ((folder / f"own_{name}.py").read_text(encoding="utf-8") for name in ("task", "actions"))
    blocks = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    shown = [block for block in blocks if block in first]
    places = [first.index(block) for block in shown]
    assert places == sorted(places)
    assert len("".join(shown).split()) > 0.6 * len(first.split())
    rest = [block for block in blocks if block not in first]
    assert len([block for block in rest if block in second]) == 3
    (curricula,) = (block for block in rest if block not in second)
    known = {}
    exec(compile(curricula, "own_task.md", "exec"), known)
    assert known["envs"].call("settings")[1].target_speed == [3.0, 3.5]
