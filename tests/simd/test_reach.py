"""What functions from outside reach: every edit of it changes the digest, nothing else does, and what cannot
be read is refused by name."""

import ctypes
import enum
import importlib
import sys
import textwrap

import numba
import numpy as np
import pytest

from hoof_env.errors import ParameterError
from hoof_env.simd import reach
from hoof_env.simd.compile import inline_llvm
from hoof_env.simd.reach import fingerprint, is_library, refresh, version_of

TASK = """
    import lab.numbers, lab.tools, lab.deep
    from lab import numbers as short, tools
    from lab.kinds import Gait, LIMITS, Legs

    def constant(x):
        return lab.numbers.GRIP * x

    def renamed(x):
        return short.GRIP * x

    def handed_on(x):
        n = lab.numbers
        return n.GRIP * x

    def helper(x):
        return lab.tools.scaled(x)

    def helper_of_helper(x):
        return lab.deep.twice(x)

    def member(x):
        return x * Gait.RUN.value

    def of_class(x):
        return x * Legs.count

    def named_tuple(x):
        return x * LIMITS.high

    def inner(x):
        return (lambda y: y * lab.numbers.GRIP)(x)

    def in_a_module(numbers):
        def enclosed(x):
            return x * numbers.GRIP
        return enclosed

    enclosed = in_a_module(lab.numbers)
"""
FILES = {
    "__init__": "",
    "numbers": "GRIP = 1.0\nOTHER = 1.0\n",
    "tools": "from hoof_env.simd.compile import inline_llvm\n@inline_llvm\ndef scaled(x):\n"
    "    return 1.0 * x\n",
    "deep": "from lab import tools, numbers\ndef twice(x):\n    return tools.scaled(numbers.GRIP * x)\n",
    "kinds": "import enum, typing\nclass Gait(enum.Enum):\n    RUN = 1.0\nclass Legs:\n    count = 1.0\n"
    "class L(typing.NamedTuple):\n    high: float\nLIMITS = L(1.0)\n",
}


@pytest.fixture
def digests(tmp_path, monkeypatch):
    """Fingerprints of the functions of a task, whose package `lab` has some text replaced."""
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab_task.py").write_text(textwrap.dedent(TASK))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def found(**edits):
        for name, text in FILES.items():
            (tmp_path / "lab" / f"{name}.py").write_text(text.replace(*edits.get(name, ("", ""))))
        for name in [name for name in sys.modules if name.split(".")[0] in ("lab", "lab_task")]:
            monkeypatch.delitem(sys.modules, name)
        importlib.invalidate_caches()
        task = importlib.import_module("lab_task")
        names = [name for name, value in vars(task).items() if callable(value) and name[0].islower()]
        return {name: fingerprint(getattr(task, name)) for name in names if name != "in_a_module"}

    return found


@pytest.mark.parametrize(
    ("edit", "changed"),
    [
        ({"numbers": ("GRIP = 1.0", "GRIP = 55.0")},
         {"constant", "renamed", "handed_on", "enclosed", "inner", "helper_of_helper"}),
        ({"tools": ("1.0 * x", "55.0 * x")}, {"helper", "helper_of_helper"}),
        ({"kinds": ("RUN = 1.0", "RUN = 2.0")}, {"member"}),
        ({"kinds": ("count = 1.0", "count = 2.0")}, {"of_class"}),
        ({"kinds": ("L(1.0)", "L(2.0)")}, {"named_tuple"}),
        ({"numbers": ("GRIP", "# moved\nGRIP")}, set()),
        ({"numbers": ("OTHER = 1.0", "OTHER = 2.0")}, {"handed_on"}),
    ],
)  # fmt: skip
def test_an_edit_of_what_is_reached_changes_the_digest_and_no_other_does(digests, edit, changed):
    before, after = digests(), digests(**edit)
    assert before == digests()
    assert {name for name in before if before[name] != after[name]} == changed


def test_a_member_of_an_enumeration_is_told_from_a_number():
    class Kind(enum.IntEnum):
        ONE = 1

    assert fingerprint(Kind.ONE) != fingerprint(1)


def test_the_options_of_a_helper_count():
    def double(x):
        return 2.0 * x

    assert fingerprint(numba.njit(double)) != fingerprint(numba.njit(fastmath=True)(double))


def test_what_is_installed_counts_by_its_version():
    assert is_library(np.linalg.norm)
    assert is_library(textwrap.dedent)
    assert not is_library(inline_llvm)
    assert version_of("numpy.linalg") == f"numpy {np.__version__}"
    assert version_of("textwrap") == sys.version.split()[0]


def test_a_module_of_ones_own_may_have_the_name_of_a_standard_one(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "this.py").write_text("GRIP = 1.0\n")
    monkeypatch.delitem(sys.modules, "this", raising=False)
    this = importlib.import_module("this")

    def made(module):
        def term(x):
            return module.GRIP * x

        return term  # fmt: skip

    before = fingerprint(made(this))
    this.GRIP = 2.0
    assert fingerprint(made(this)) != before
    monkeypatch.delitem(sys.modules, "this")


FOREIGN = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(abs)
TEXTS = np.array([object()], dtype=object)


@pytest.mark.parametrize("name", ["FOREIGN", "TEXTS"])
def test_what_cannot_be_read_is_refused_by_name(name):
    space = {"FOREIGN": FOREIGN, "TEXTS": TEXTS, "__name__": "mine"}
    exec(f"def term(x):\n    return {name}(x)", space)
    with pytest.raises(ParameterError, match=f"{name}: expected functions of Python"):
        fingerprint(space["term"])


def test_a_helper_is_compiled_again_once_what_it_reaches_has_changed():
    space = {"FACTOR": 3.0, "__name__": "mine", "numba": numba}
    exec("@numba.njit\ndef helper(x):\n    return FACTOR * x", space)
    helper = space["helper"]

    def term(x):
        return helper(x)

    for factor in (3.0, 7.0):
        space["FACTOR"] = factor
        refresh(term)
        refresh(term)
        assert helper(1.0) == factor


def made_by_a_factory(k):
    def law(x):
        return k * x

    return law


def with_a_default(x, k=2.0):
    return k * x


def test_functions_of_an_installed_factory_differ_in_what_they_enclose(monkeypatch):
    """Their version is the same, and so is their code."""
    monkeypatch.setattr(reach, "is_library", lambda value: True)
    monkeypatch.setattr(reach, "version_of", lambda name: "1.0")
    assert reach.fingerprint(made_by_a_factory(2.0)) != reach.fingerprint(made_by_a_factory(3.0))
    assert reach.fingerprint(made_by_a_factory(2.0)) == reach.fingerprint(made_by_a_factory(2.0))
    before = reach.fingerprint(with_a_default)
    monkeypatch.setattr(with_a_default, "__defaults__", (3.0,))
    assert reach.fingerprint(with_a_default) != before
