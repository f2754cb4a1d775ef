"""Ids of one's own: the same bits alone and among many, whole in every front door, exact refusals."""

from __future__ import annotations

import copy
import gc
import os
import pickle
import re
import runpy
import subprocess
import sys
import textwrap
from collections import deque
from pathlib import Path
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from family import actions, roll, same

import hoof_env
from hoof_env import Scale, Term, register
from hoof_env.cli import main
from hoof_env.dynamics.hoof import GroundHere
from hoof_env.dynamics.layout import TRUNK_STATE, LegMemory, TrunkMemory
from hoof_env.envs.manual import tables_of
from hoof_env.simd import compile as compile_room
from hoof_env.tasks import registry as tasks
from hoof_env.tasks.episode import Episode
from hoof_env.tasks.observation import ObservationInputs
from hoof_env.tasks.reward import Outcome

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


def test_its_tables_have_its_rows(own, capsys):
    tables = tables_of(own.ID)
    assert tables == tables_of(own.MODULE_ID)
    assert ("friction", "0.5", "1/kJ", "power of friction") in tables["Rewards"].rows
    assert ("load angle", "/ pi", "rad", "feel") in [row[1:] for row in tables["Observation"].rows]
    assert main(["manual", "--env-id", own.MODULE_ID]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"{own.ID} (import own_functions): ")
    assert re.search(r"^comfort ", printed, re.MULTILINE)


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
    assert task.settings({}).reward_weights == {**kept, "peak": 0.5}, "the weights of the base stay"


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
    rest = env.settings.episode_seconds - env.batch.rows.named.time[0]
    assert reward == -env.weights["failure"] * rest < -1.0
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


# What is made anew, and when


def take(env_id, key="reward_mine", **settings):
    """A number of the first step of a new environment."""
    env = gym.make(env_id, **settings)
    env.reset(seed=0)
    return env.step(np.zeros(4, np.float32))[4][key]


def cell(space, text):
    """Run a cell of a notebook."""
    exec(compile(textwrap.dedent(text), "<cell>", "exec"), space)


NOTEBOOK = """
    from hoof_env import Term, register
    PRICE = 2.0
    def helper(x):
        return 10.0 * x
    def mine(step, weight):
        return helper(PRICE) + 0.0 * step.progress
    register("own/Notebook-v0", terms=[Term("mine", 1.0, "-", "a test's", mine)])
"""


def test_a_changed_helper_or_constant_acts_at_the_next_make():
    space = {"__name__": "__main__"}
    cell(space, NOTEBOOK)
    assert take("own/Notebook-v0") == 20.0
    old = gym.make("own/Notebook-v0")
    cell(space, "PRICE = 3.0")
    assert take("own/Notebook-v0") == 30.0
    cell(space, "def helper(x):\n    return 100.0 * x")
    assert take("own/Notebook-v0") == 300.0
    old.reset(seed=0)
    assert old.step(np.zeros(4, np.float32))[4]["reward_mine"] == 20.0, "what is made stays as it is"


def test_an_environment_measures_with_the_constants_of_its_observation():
    space = {"__name__": "__main__"}
    cell(
        space,
        """
        from hoof_env import Entry, Scale, register
        SIZE = 2.0
        def size(scene):
            return SIZE + 0.0 * scene.episode.time
        register("own/Size-v0", entries=[Entry("size", "mine", "-", size, Scale("none"))])
        """,
    )
    env = gym.make("own/Size-v0").unwrapped
    env.reset(seed=0)
    cell(space, "SIZE = 200.0")
    assert env.raw_observation()["size"] == 2.0


def test_an_edited_function_of_the_same_name_acts_when_it_is_registered_again():
    space = {"__name__": "__main__"}
    cell(space, NOTEBOOK)
    assert take("own/Notebook-v0") == 20.0
    with pytest.warns(UserWarning, match="Overriding environment"):
        cell(space, NOTEBOOK.replace("10.0", "20.0"))
    assert take("own/Notebook-v0") == 40.0


def test_a_changed_helper_of_a_law_acts_at_the_next_make():
    space = {"__name__": "__main__"}
    cell(
        space,
        """
        import numpy as np
        from hoof_env import register
        STIFFNESS = 2e4
        def law(depth, rate, inverse_speed, ground):
            return STIFFNESS * np.maximum(depth, 0.0)
        register("own/Law-v0", contact_law=law)
        """,
    )
    soft = take("own/Law-v0", "measured")["highest_grf"]
    space["STIFFNESS"] = 2e5
    assert take("own/Law-v0", "measured")["highest_grf"] != soft


def resident():
    """Resident memory of this process [MB], 0 where the system does not tell."""
    pages = Path("/proc/self/statm")
    return int(pages.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6 if pages.exists() else 0.0


def test_edits_do_not_pile_up_machine_code(monkeypatch):
    """Of each function that is tried only the last few stay, whatever their number."""
    monkeypatch.setattr(compile_room, "_RECENT", deque(maxlen=4))
    counts, sizes = [], []
    for k in range(30):
        register(f"own/Edit{k}-v0", terms=[Term("mine", 1.0, "-", "-", lambda step, weight, k=k: weight * k)])
        assert take(f"own/Edit{k}-v0") == k
        gc.collect()
        counts.append(len(compile_room._LOADED))
        sizes.append(resident())
    assert max(counts[10:]) <= max(counts[:10])
    assert sizes[-1] - sizes[9] < 8, "one and a half for each, if LLVM's passes are kept"


def test_copies_share_their_kernels(own):
    """A planner copies at every node of its tree."""
    env = gym.make(own.ID).unwrapped
    env.reset(seed=0)
    made = copy.deepcopy(env)
    assert made.batch.calls.kernels is env.batch.calls.kernels
    twin = pickle.loads(pickle.dumps(env))
    for action in actions(2, 3):
        expected = env.step(action)[:2]
        same(expected, made.step(action)[:2])
        same(expected, twin.step(action)[:2])


# Functions on arrays


def test_functions_run_on_arrays(own):
    """As docs/own_task.md tells a user to test them."""
    toe = SimpleNamespace(normal=np.array([0.0, 1.0, 2.0]), friction=np.array([1.0, 1.0, 0.0]))
    scene = SimpleNamespace(leg=SimpleNamespace(report=SimpleNamespace(toe=toe)))
    np.testing.assert_allclose(own.load_angle(scene), [0.0, np.pi / 4, 0.0])
    report = SimpleNamespace(acceleration=np.array([0.0, 9.81j]))
    step = SimpleNamespace(failed=np.zeros(2), trunk=SimpleNamespace(report=report))
    np.testing.assert_allclose(own.comfort(step, 2.0), [2.0, 2.0 / np.e])


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
                is_table = name != "trunk" and key == "sums"  # docs/environments/common.md lists those
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
    (own_cost,) = (block for block in rest if "is_cost=True" in block)
    exec(compile(own_cost, "own_task.md", "exec"), {})
    assert gym.make("my_lab/Grip-v0").unwrapped.costs == ("cost_slide",)
    curricula, on_arrays, *_ = sorted((block for block in rest if block not in second), key=len)
    exec(compile(on_arrays, "own_task.md", "exec"), runpy.run_path(str(folder / "own_task.py")))
    known = {}
    exec(compile(curricula, "own_task.md", "exec"), known)
    assert known["envs"].call("settings")[1].target_speed == [3.0, 3.5]
