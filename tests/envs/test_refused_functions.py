"""Functions that cannot be part of a kernel: each is refused in one line, with place and advice."""

# ruff: noqa: E501 (a table with one case a line)

from __future__ import annotations

import functools
import itertools
import linecache
import textwrap
import traceback
from types import FunctionType

import gymnasium as gym
import numpy as np
import pytest

import hoof_env
from hoof_env import ActionMap, Constant, Entry, Scale, Term, TermState, TrunkEngine, register
from hoof_env.dynamics.parts import Limb, Trunk
from hoof_env.errors import ParameterError
from hoof_env.simd.values import perpendicular
from hoof_env.tasks import registry as tasks

pytestmark = pytest.mark.usefixtures("registered")

BAD = "own/Bad-v0"
PLAIN = Scale("none")
FILES = itertools.count()

ARGUMENTS = {"term": "step, weight", "entry": "scene", "map": "action, scene"}
ARGUMENTS |= {"law": "depth, rate, inverse_speed, ground", "scale": "x, scene"}


def defined(kind, text):
    """The function of a case, and the place that its message should name: the line with `#!`, in the last
    function above it; else the function's own."""
    body = textwrap.dedent(text).strip("\n")
    if f"def compute({ARGUMENTS[kind]})" not in body:
        body = f"def compute({ARGUMENTS[kind]}):\n{textwrap.indent(body, '    ')}"
    file = f"case_{next(FILES)}.py"
    source = (
        f"import math\nimport random\nimport time\nimport numpy as np\nfrom hoof_env import simd\n{body}\n"
    )
    linecache.cache[file] = (len(source), None, source.splitlines(True), file)
    space = {"__name__": "mine"}
    exec(compile(source, file, "exec"), space)
    lines = source.splitlines()
    where = next((k for k, line in enumerate(lines) if "#!" in line), None)
    if where is None:
        where = next(k for k, line in enumerate(lines) if "def compute" in line)
    inner = next((word for word in ("lambda", "genexpr") if word in lines[where]), None)
    above = (line.split("def ")[1].split("(")[0] for line in lines[where::-1] if "def " in line)
    name = f"<{inner}>" if inner else next(above)
    return space["compute"], rf"{name} ({file}, line {where + 1})"


def registration(kind, function, state=()):
    """Arguments of `register` with a function."""
    if kind == "term":
        return {"terms": [Term("mine", 1.0, "-", "a test's", function, state=state)]}
    if kind == "entry":
        return {"entries": [Entry("mine", "mine", "-", function, PLAIN)]}
    if kind == "scale":
        return {
            "entries": [Entry("mine", "mine", "-", lambda scene: scene.episode.time, Scale("odd", function))]
        }
    return (
        {"action_map": ActionMap("mine", {"a": "-"}, function)}
        if kind == "map"
        else {"contact_law": function}
    )


CASES = [
    # what is not known when the kernel is made
    ("term", "if step.progress > 0.0: #!\n    return weight\nreturn 0.0", "`if` | np.where(condition, yes, no)"),
    ("term", "while step.progress < 1.0: #!\n    pass", "`while` | np.where"),
    ("term", "return weight if step.failed else 0.0 #!", "np.where"),
    ("term", "return step.progress and weight #!", "`and` | `&`"),
    ("term", "return step.progress or weight #!", "`or`"),
    ("term", "return not step.progress #!", "`not` | `~`"),
    ("term", "return np.where(0.0 < step.progress < 1.0, 1.0, 0.0) #!", "`&`"),
    ("term", "return np.where(0.0 < step.progress & step.progress < 1.0, 1.0, 0.0) #!", "parentheses"),
    ("term", "return min(step.progress, 1.0) #!", "min() | np.minimum"),
    ("term", "return max(0.0, step.progress) #!", "max() | np.maximum"),
    ("term", "return sorted([step.progress, weight])[0] #!", "np.where"),
    ("term", "assert step.progress > 0.0 #!\nreturn 0.0", "np.where"),
    ("term", "return any([step.progress > 0.0, step.failed > 0.0]) * 1.0 #!", "`|`"),
    ("term", "return 1.0 if step.failed in (0.0, 1.0) else 0.0 #!", "np.where"),
    ("term", "return next(x for x in (1.0, 2.0) if x > step.progress) #! genexpr", "np.where"),
    ("term", "match step.failed:\n    case 1.0: #!\n        return 0.0\nreturn 1.0", "np.where"),
    ("term", "if step.leg: #!\n    return 0.0\nreturn 1.0", "`if` | memory"),
    ("term", "for x in step.progress: #!\n    return x", "a loop over a number"),
    ("term", "return sum(step.progress) #!", "a loop over a number"),
    ("term", "a, b = step.trunk.report.place #!\nreturn a", "a loop over a planar vector"),
    ("term", "return len(step.progress) #!", "len() of a number"),
    ("term", "for k in range(step.sums.stances): #!\n    pass\nreturn 1.0", "range()"),
    ("term", "return float(step.progress) #!", "float() | np.exp"),
    ("term", "return int(step.progress) #!", "int()"),
    ("term", "return float(step.progress > 0.0) #!", "float() | a boolean"),
    ("term", "return float(step.trunk.report.place) #!", "float() | a planar vector"),
    ("term", "return bool(step.progress) * 1.0 #!", "np.where"),
    ("term", "return complex(step.progress) #!", "float()"),
    ("term", "return round(step.progress) #!", "round() | np.floor(x + 0.5)"),
    ("term", "return math.exp(step.progress) #!", "`math` | np.exp"),
    ("term", "return math.floor(step.progress) #!", "`math`"),
    ("term", "return math.hypot(step.progress, 1.0) #!", "`math`"),
    ("term", "return math.sqrt(step.leg.report.toe.normal) #!", "`math`"),
    ("term", "return 1.0 if math.isnan(step.progress) else 0.0 #!", "`math`"),
    ("term", "return (1.0, 2.0)[step.failed] #!", "an index | np.where"),
    ("term", "return {1.0: 2.0}[step.failed] #!", "TypeError | unhashable"),
    ("term", "return f'{step.progress:.2f}' #!", "TypeError | format"),
    ("term", "return step.progress[0] #!", "a number is not subscriptable"),
    ("term", "return step.progress() #!", "a number is not callable"),
    ("term", "return np.where(step.progress == None, 1.0, 0.0) #!", "comparison of a number with nothing"),
    ("term", "return np.where('fast' == step.progress, 1.0, 0.0) #!", "comparison of a number with str 'fast'"),
    ("term", "return step.progress > 'fast' #!", "a number | str"),
    # fields
    ("term", "return step.pace #!", "no field 'pace' | Outcome has seconds, progress"),
    ("term", "return step.highest #!", "no field 'highest' | Outcome has seconds"),
    ("term", "return step.sums.highest #!", "no field 'highest' | StrideSums has peak_grf_increase"),
    ("term", "return step.leg.lode #!", "no field 'lode' | LegMemory has state"),
    ("term", "return step.leg.report.toe.load #!", "no field 'load' | PointReport has x, y, slide"),
    ("term", "return step.episode.own.mine #!", "no field 'own' | Episode has steps"),
    ("term", "return step.leg.state.gait.speed #!", "no field 'speed' | numbers only"),
    ("term", "return step.progress.mean() #!", "a number has no field 'mean' | none"),
    ("term", "return (step.progress > 0.0).sum() #!", "a boolean has no field 'sum'"),
    ("term", "return step.trunk.report.place.x #!", "a planar vector has no field 'x' | real, imag"),
    ("entry", "return scene.progress #!", "no field 'progress' | ObservationInputs has trunk, leg"),
    ("entry", "return scene.task.speed #!", "no field 'speed' | reach, lead"),
    ("law", "return ground.exponent * depth #!", "no field 'exponent' | GroundHere has stiffness, eighths"),
    ("term", "return step.leg.state.gait[4] #!", "no element 4: there are 4"),
    ("term", "return step.leg.state.gait[0:2] #!", "an index that is slice"),
    ("term", "return step.leg.state.gait[1.0] #!", "an index that is float 1.0"),
    ("term", "return step.leg.state.gait[step.failed] #!", "an index that is a number"),
    ("term", "return step.leg.state.gait['speed'] #!", "an index that is str 'speed'"),
    ("term", "return hoof_env.simd.block_at(step.leg, 1).state.crank_angle #!", "NameError"),
    ("entry", "return scene.task.weights[99] #!", "no element 99"),
    ("map", "return action[0], action[1], 0.0, 0.0 #!", "IndexError: tuple index out of range"),
    ("map", "return action.rate, 0.0, 0.0, 0.0 #!", "'tuple' object has no attribute 'rate'"),
    # NumPy
    ("term", "return np.gamma(step.progress) #!", "module 'numpy' has no attribute 'gamma'"),
    ("term", "return np.cbrt(step.progress) + np.spacing(step.progress) #!", "np.spacing | np.arctan2 | np.clip"),
    ("term", "return np.interp(step.progress, [0.0, 1.0], [0.0, 2.0]) #!", "np.interp | np.where"),
    ("term", "return np.round(step.progress) #!", "np.round | np.floor"),
    ("term", "return np.add.reduce(step.progress) #!", "np.add.reduce"),
    ("term", "return np.add(step.progress, 1.0, where=True) #!", "np.add with where"),
    ("term", "return np.clip(step.progress, 0.0, 1.0, out=None) #!", "np.clip | out"),
    ("term", "return np.sum([step.progress, weight]) #!", "a NumPy array | write out"),
    ("term", "return np.max([step.progress, weight]) #!", "a NumPy array"),
    ("term", "return np.array([step.progress, 1.0]).sum() #!", "a NumPy array"),
    ("term", "return np.asarray(step.progress) #!", "a NumPy array"),
    ("term", "return np.linalg.norm([step.progress, 1.0]) #!", "a NumPy array"),
    ("term", "return np.float64(step.progress) #!", "a NumPy array"),
    ("term", "return np.sum(step.leg.state.gait) #!", "a NumPy function of memory"),
    ("term", "return np.sqrt(step.leg) #!", "a NumPy function of memory"),
    ("term", "return step.progress * np.ones(3) #!", "a NumPy array, of shape (3,)"),
    ("term", "return np.ones(3) * step.progress #!", "a NumPy array, of shape (3,)"),
    ("term", "return np.arange(3) @ step.progress #!", "np.matmul"),
    ("term", "return np.where(np.ones(2) > 0.0, step.progress, 0.0) #!", "a NumPy array, of shape (2,)"),
    ("term", "return np.where(step.progress, 1.0, 0.0) #!", "where() of a number | x > 0.0"),
    ("term", "return np.where(step.progress > 0.0, 'a', 'b') #!", "where() of str 'a'"),
    ("term", "return np.where(step.progress > 0.0) #!", "np.where | argument"),
    ("term", "return np.maximum(step.progress, None) #!", "nothing where a number is expected"),
    ("term", "return np.exp(step.trunk.report.place) #!", "a planar vector where a number is expected"),
    ("term", "return np.sqrt(step.trunk.report.place) #!", "np.sqrt of a planar vector"),
    ("term", "return step.progress + step.trunk.report.place #!", "+: a number and a planar vector"),
    ("term", "return step.progress + '1' #!", "+: a number and 'str'"),
    ("term", "return step.leg * 2.0 #!", "*: memory and a number"),
    ("term", "return (step.progress > 0.0) - (step.failed > 0.0) #!", "-: a boolean and a boolean"),
    ("term", "return 1.0 if step.leg == step.trunk else 0.0 #!", "a comparison of memory with memory"),
    ("term", "return divmod(step.progress, 2)[0] #!", "divmod(): a number and a number"),
    ("term", "return step.leg.state.gait.mean() #!", "no field 'mean': these rows have numbers only"),
    # results
    ("term", "pass", "returns nothing; expected a number"),
    ("term", "return step.progress > 0.0", "returns a boolean | np.where(condition, 1.0, 0.0)"),
    ("term", "return True", "returns a boolean"),
    ("term", "return np.True_", "returns a boolean"),
    ("term", "return step.progress, weight", "returns a tuple of 2"),
    ("term", "return [step.progress]", "returns a list of 1"),
    ("term", "return step.trunk.report.velocity", "returns a planar vector | .real"),
    ("term", "return step.leg", "returns memory"),
    ("term", "return step", "returns a Outcome of 11"),
    ("term", "return 'much'", "returns str 'much'"),
    ("term", "return np.ones(3)", "returns a NumPy array, of shape (3,)"),
    ("term", "return 1j", "returns complex 1j"),
    ("term", "return {'reward': step.progress}", "returns dict"),
    ("term", "return math.nan", "returns float nan; expected a number"),
    ("term", "return -np.inf", "returns float -inf"),
    ("term", "return 10**400", "returns int 1000"),
    ("term", "yield step.progress", "expected a plain function of 2 arguments"),
    ("term", "async def compute(step, weight):\n    return 1.0", "expected a plain function of 2 arguments"),
    ("term", "return lambda: 1.0", "returns function"),
    ("scale", "return x > 0.0", "the scale of entry 'mine' returns a boolean"),
    ("scale", "if x > 0.5: #!\n    return 1.0\nreturn x", "the scale of entry 'mine'"),
    ("law", "return depth, rate", "the contact law mine.compute returns a tuple of 2"),
    ("law", "return max(depth, 0.0) * 1e5 #!", "max() | np.maximum"),
    ("map", "return action", "returns a tuple of 1; expected a tuple of 4 numbers"),
    ("map", "return action[0], 0.0, 0.0", "returns a tuple of 3"),
    ("map", "return (action[0],) * 5", "returns a tuple of 5"),
    ("map", "return action[0]", "returns a number; expected a tuple of 4"),
    ("map", "return action[0], 0.0, None, 0.0", "returns nothing at [2]"),
    ("map", "return action[0], action[0] > 0.0, 0.0, 0.0", "returns a boolean"),
    ("map", "return np.zeros(4)", "returns a NumPy array, of shape (4,)"),
    ("map", "return np.array([action[0], 0.0, 0.0, 0.0]) #!", "a NumPy array"),
    # imports, random numbers, clocks, counters
    ("term", "import math #!\nreturn weight", "`import` | top of the file"),
    ("term", "from math import pi #!\nreturn pi", "`import`"),
    ("term", "def helper():\n    import math #!\n    return math.pi\ndef compute(step, weight):\n    return helper()",
     "`import`"),
    ("term", "def deep():\n    import math #!\ndef helper():\n    deep()\ndef compute(step, weight):\n    helper()",
     "`import`"),
    ("term", "def made():\n    def helper():\n        import math #!\n    return lambda: helper()\n"
     "inner = made()\ndef compute(step, weight):\n    return inner()", "`import`"),
    ("term", "return weight * random.random()", "something else at each call | random numbers"),
    ("term", "return step.progress * np.random.default_rng().normal()", "random numbers"),
    ("term", "return step.progress + time.perf_counter()", "clocks"),
    ("term", "count = [0]\ndef compute(step, weight):\n    count[0] += 1\n    return weight * count[0]", "counters"),
    ("term", "count = 0\ndef compute(step, weight):\n    global count\n    count += 1\n    return step.progress * count",
     "counters"),
    ("term", "last = {}\ndef compute(step, weight):\n    return last.setdefault('x', step.progress)",
     "keeps a value in 'last' | state"),
    ("term", "def helper(x, kept=[]):\n    kept[:] = [x]\ndef compute(step, weight):\n    helper(step.progress)\n"
     "    return weight", "keeps a value in 'kept'"),
    ("term", "class State:\n    x = 0.0\ndef compute(step, weight):\n    State.x = step.progress\n    return weight",
     "keeps a value in 'State'"),
    ("term", "kept = {'a': []}\ndef compute(step, weight):\n    kept['a'][:] = [(step.leg,)]\n    return weight",
     "keeps a value in 'kept'"),
    ("term", "kept = {'a': {'b': [{'c': {'d': []}}]}}\nkept['itself'] = kept\ndef compute(step, weight):\n"
     "    kept['a']['b'][0]['c']['d'][:] = [step.progress]\n    return weight", "keeps a value in 'kept'"),
    ("term", "all_of = []\ndef compute(step, weight):\n    all_of.append(step.progress)\n    return sum(all_of)",
     "something else at each call"),
    # without end
    ("term", "return compute(step, weight) #!", "a recursion, or a loop, whose end is not known"),
    ("term", "x = step.progress\nwhile True:\n    x = 0.5 * x #!", "a loop, whose end is not known"),
    # what is given is not written
    ("term", "step.progress = 3.0 #!", "assignment to 'progress' | `state`"),
    ("term", "step.leg = None #!", "assignment to 'leg'"),
    ("term", "step.speed = 3.0 #!", "assignment to 'speed'"),
    ("term", "step.trunk.result = 0.0 #!", "assignment to 'result' | `state`"),
    ("term", "step.leg.strides.normal_force = 3.0 #!", "assignment to 'normal_force'"),
    ("term", "step.leg.strides.normal_force *= 2.0 #!", "assignment to 'normal_force'"),
    ("term", "step.leg.lode = 3.0 #!", "no field 'lode'"),
    ("term", "step.leg.state.gait[0] = 3.0 #!", "assignment to [0]"),
    ("term", "step.leg.state[0] = 3.0 #!", "assignment to [0]"),
    ("term", "step.episode.time = 0.0 #!", "assignment to 'time'"),
    ("term", "step.episode.terms[0] += 1.0 #!", "assignment to [0]"),
    ("term", "step.sums.slip = 0.0 #!", "assignment to 'slip'"),
    ("term", "setattr(step.leg.report, 'crank_torque', 0.0) #!", "assignment to 'crank_torque'"),
    ("term", "step.trunk.report.place.real = 0.0 #!", "real"),
    ("term", "step.trunk.report.place += 1.0 #!", "+=: a planar vector and a number"),
    ("term", "step.progress.best = 1.0 #!", "best"),
    ("term", "del step.leg.strides.normal_force #!", "'normal_force'"),
    ("term", "del step.progress #!", "'progress'"),
    ("term", "del step.leg.state.gait[0] #!", "assignment to a row"),
    ("entry", "scene.episode.time = 0.0 #!", "assignment to 'time'"),
    ("entry", "scene.task.height = 0.0 #!", "assignment to 'height'"),
    ("entry", "scene.task.half[0] = 0.0 #!", "item assignment"),
    ("entry", "scene.ground.first[0] = 0.0 #!", "assignment to this array"),
    ("entry", "(scene.ground.first + 1)[0] = 0.0 #!", "assignment to this array"),
    ("entry", "from_simd = simd.write\nfrom_simd(scene.episode.time, scene.ground.first, 0, 1) #!", "this array"),
    ("entry", "simd.columns(scene.ground, 1, None, 0)[0] = 0.0 #!", "assignment to [0]"),
    ("entry", "simd.load_rows(scene.leg.state, scene.leg.state) #!", "assignment to 'rows'"),
    ("entry", "simd.store_vectors(scene.leg.state.gait, (scene.trunk.report.place,)) #!", "assignment to [0]"),
    ("entry", "simd.apply_to_rows(scene.leg.state.gait, 4, np.sqrt, 8) #!", "assignment to 'rows'"),
    ("map", "scene.leg.command[0] = action[0] #!", "assignment to [0]"),
    ("map", "action[0] = 0.0 #!", "item assignment"),
    ("law", "ground.chi = 0.0 #!", "assignment to 'chi'"),
    # what the user's own code raises
    ("term", "return weight / 0 * (1 // 0) #!", "ZeroDivisionError: integer division or modulo by zero"),
    ("term", "raise ValueError('no such\\n  gait') #!", "ValueError: no such gait"),
    ("term", "raise KeyError #!", "KeyError"),
    ("term", "raise Exception('no' * 1000) #!", "Exception: nono | no..."),
    ("term", "return wait * step.progress #!", "NameError: name 'wait' is not defined"),
    ("term", "def helper(x):\n    return x.y #!\ndef compute(step, weight):\n    return helper(None)",
     "'NoneType' object has no attribute 'y'"),
    ("term", "def helper(x):\n    return math.exp(x) #!\ndef compute(step, weight):\n    return helper(step.progress)",
     "`math`"),
    ("term", "return step.progress.__bogus__ #!", "__bogus__"),
    ("term", "return (lambda x: 1.0 if x > 0.0 else 0.0)(step.progress) #!", "np.where"),
]  # fmt: skip
"""What the function is, its source with `#!` at the line that the message should name, and words."""


def message(call, *arguments, **named):
    """The message of the `ParameterError` that a call raises, which is short and in one line."""
    with pytest.raises(ParameterError) as caught:
        call(*arguments, **named)
    words = str(caught.value)
    assert "\n" not in words
    assert caught.value.__cause__ is None
    assert caught.value.__suppress_context__ or caught.value.__context__ is None
    assert len(traceback.format_exception(caught.value)) < 20, "the message is not lost"
    return words


def made_from(kind, function, **declared):
    register(BAD, **registration(kind, function, **declared))
    gym.make(BAD)


@pytest.mark.parametrize(("kind", "text", "words"), CASES, ids=[case[1] for case in CASES])
def test_refused_with_place_and_advice(kind, text, words):
    function, place = defined(kind, text)
    found = message(made_from, kind, function)
    for word in words.split(" | "):
        assert word in found
    if "plain function" not in words:
        assert place in found


def test_a_wrapper_of_a_function_of_the_package_is_the_users():
    @functools.wraps(perpendicular)
    def wrong(step, weight):
        step.leg.report.crank_torque = 0.0
        return weight

    assert wrong.__module__.startswith("hoof_env.")
    assert "assignment to 'crank_torque'" in message(made_from, "term", wrong)


def changes_another(step, weight):
    step.episode.own.other.rows = 1.0
    return 0.0


def changes_all(step, weight):
    step.episode.own.mine = 1.0
    return 0.0


def keeps_a_truth(step, weight):
    step.episode.own.mine.row = step.progress > 0.0
    return 0.0


def keeps_a_vector(step, weight):
    step.episode.own.mine.row = step.trunk.report.place
    return 0.0


def keeps_nothing(step, weight):
    step.episode.own.mine.row = None
    return 0.0


def keeps_elsewhere(step, weight):
    step.episode.own.mine.rows = 1.0
    return 0.0


def keeps_beyond(step, weight):
    step.episode.own.mine[1] = 1.0
    return 0.0


def keeps_beside(step, weight):
    hoof_env.simd.block_at(step.episode.own.mine, 1).row = 1.0
    return 0.0


KEPT = {
    changes_another: "assignment to 'rows'",
    changes_all: "assignment to 'mine'",
    keeps_a_truth: "a boolean where a number is expected: write np.where",
    keeps_a_vector: "a planar vector where a number",
    keeps_nothing: "nothing where a number",
    keeps_elsewhere: "no field 'rows'; mine has row",
    keeps_beyond: "no element 1: there are 1",
    keeps_beside: "no element 1",
}


@pytest.mark.parametrize(("function", "words"), KEPT.items(), ids=[f.__name__ for f in KEPT])
def test_a_term_sets_its_own_rows_alone(function, words):
    rows = [TermState("row", 0.0, "-", "-")]
    other = Term("other", 1.0, "-", "-", lambda step, weight: 0.0, state=[TermState("rows", 0.0, "-", "-")])
    terms = [Term("mine", 1.0, "-", "-", function, state=rows), other]
    register(BAD, terms=terms)
    found = message(gym.make, BAD)
    assert words in found
    assert f"in {function.__name__} ({__file__}, line {function.__code__.co_firstlineno + 1})" in found


def test_legs_that_there_are_not():
    block_at = hoof_env.simd.block_at

    def fifth(scene):
        return block_at(scene.leg, 4).report.crank_torque

    def last(scene):
        return block_at(block_at(scene.leg, 1), 2).report.crank_torque

    for base, function, words in (
        ("horse", fifth, "no element 4: there are 4"),
        ("leg", last, "no element 1"),
    ):
        register(f"own/Bad_{base}-v0", base=base, entries=[Entry("mine", "mine", "N m", function, PLAIN)])
        assert words in message(gym.make, f"own/Bad_{base}-v0")


# Every front door


def negative(depth, rate, inverse_speed, ground):
    return -max(depth, rate)


def test_every_front_door_refuses_and_the_next_make_works():
    function, place = defined("term", "return 1.0 if step.progress > 0.0 else 0.0 #!")
    register(BAD, **registration("term", function))
    doors = [gym.make, lambda id: gym.make_vec(id, num_envs=9), lambda id: hoof_env.HorseLegEnv(task=id)]
    doors += [
        lambda id: gym.make(id, action_delay=0.5),
        lambda id: gym.make_vec(id, 2, autoreset_mode="SAME_STEP"),
    ]
    for make in doors:
        found = message(make, BAD)
        assert found.startswith(f"{BAD}: term 'mine': `if`")
        assert found.endswith(f"in {place}")
    pytest.importorskip("stable_baselines3")
    assert place in message(hoof_env.Sb3VecEnv, BAD, num_envs=2)
    register("own/Good-v0", **registration("term", lambda step, weight: weight))
    env = gym.make("own/Good-v0")
    env.reset(seed=0)
    assert env.step(np.zeros(4, np.float32))[4]["reward_mine"] == 1.0


def test_an_engine_refuses_a_law():
    engine = TrunkEngine(Limb(hoof_env.load_geometry()), Trunk("fixed"), contact_law=negative)
    for _ in range(2):
        found = message(engine.reset, hoof_env.load_gait("walk"))
    assert found.startswith("contact_law: the contact law ")
    assert f"in negative ({__file__}, line {negative.__code__.co_firstlineno + 1})" in found


def helper(x):
    return x


def with_helper(scene):
    return helper(scene.episode.time)


def test_a_kernel_that_is_made_later_refuses_too(monkeypatch):
    """Ground that is no longer level has kernels of its own; where they are refused nothing has changed."""
    register(BAD, **registration("entry", with_helper))
    env = gym.make(BAD).unwrapped
    env.reset(seed=0)
    hills = {"kind": "hills", "rise": 0.02}
    monkeypatch.setitem(globals(), "helper", lambda x: float(x))
    assert "float()" in message(env.change_settings, terrain=hills)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    monkeypatch.undo()
    env.change_settings(terrain=hills)
    env.reset(seed=0)
    assert env.raw_observation()["mine"] == 0.0


def test_what_registration_refuses_leaves_nothing():
    def importing(step, weight):
        import math

        return math.pi

    before = dict(gym.registry), dict(tasks._OWN)
    found = message(lambda: register(BAD, terms=[Term("mine", 1.0, "-", "-", importing)]))
    assert "`import` in importing" in found
    assert (dict(gym.registry), dict(tasks._OWN)) == before


@pytest.mark.parametrize("value", ["1", None, True, np.nan, np.inf, [1.0], 1j])
def test_constants_are_numbers(value):
    with pytest.raises(ParameterError, match=r"constant 'c': expected a finite number"):
        Constant("c", value, "-", "-")


# What is right


ALLOWED = [
    ("term", "return 3"), ("term", "return 0.5"), ("term", "return np.float32(2.0)"), ("term", "return np.int64(2)"),
    ("term", "return step.progress * np.float64(2.0) + np.int32(1)"),
    ("term", "return np.where(True, 1.0, 2.0)"), ("map", "return np.array(1.0), 0.0, np.where(True, 0.5, 0.0), 0.0"),
    ("term", "return np.where(True, 1.0, 2.0) * step.progress"),
    ("term", "return np.array(2.0) * step.progress"), ("term", "return step.progress * np.array(2.0)"),
    ("term", "return sum(x * x for x in step.leg.state.gait)"),
    ("term", "return sum([step.progress, weight, 1.0])"),
    ("entry", "return scene.episode.steps / scene.task.episode_steps"),
    ("entry", "return 2.0 / scene.task.episode_steps + 0.5 ** scene.task.episode_steps"),
    ("law", "return ground.stiffness * np.maximum(depth, 0.0) ** (ground.eighths / 8)"),
    ("term", "return step.leg.state.gait[-1] - step.leg.state.gait[len(step.leg.state.gait) - 1]"),
    ("term", "for k in range(3):\n    weight = weight * 0.5\nreturn weight"),
    ("term", "if math.pi > 3.0 and step is not None:\n    return math.sqrt(2.0) * weight\nreturn 0.0"),
    ("term", "def helper(x, k=2):\n    return x if k == 0 else helper(x * 0.5, k - 1)\n"
     "def compute(step, weight):\n    return helper(step.progress)"),
    ("term", "class Price:\n    per = 2.0\n    def __call__(self, x):\n        return self.per * x\nprice = Price()\n"
     "def compute(step, weight):\n    return price(step.progress)"),
    ("term", "print(end='')\nreturn weight"),
    ("term", "try:\n    return {}['a']\nexcept KeyError:\n    return weight"),
    ("term", "return (step.progress > 0.0) * weight + (1.0 - (step.failed > 0.0))"),
    ("term", "return abs(step.trunk.report.velocity)"),
    ("map", "return [action[0], 0, np.float32(0.5), 1.0]"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "text"), ALLOWED, ids=[case[1] for case in ALLOWED])
def test_allowed(kind, text):
    function, _ = defined(kind, text)
    assert isinstance(function, FunctionType)
    register("own/Good-v0", **registration(kind, function))
    env = gym.make("own/Good-v0")
    env.reset(seed=0)
    assert np.isfinite(env.step(np.zeros(env.action_space.shape, np.float32))[1])
