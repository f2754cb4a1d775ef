"""Machines below the values: a third one needs no change of any kernel, for all that a kernel does to numbers
goes through its machine."""

import copy
import math
import re
from fractions import Fraction
from pathlib import Path
from typing import ClassVar

import gymnasium as gym
import numpy as np
import pytest

from benchmarks.scenes import engine, scenes
from hoof_env.simd import compile as compile_module
from hoof_env.simd.compile import Kernel, on_machine
from hoof_env.simd.machines import CURRENT, Eager, Writer, constant, fma, running_on


class Box:
    """A number, or lanes of them, that only its machine can open: Python's operators and NumPy fail."""

    __slots__ = ("inner",)
    __array_ufunc__ = None
    __hash__ = None

    def __init__(self, inner):
        self.inner = inner

    def __eq__(self, other):
        raise TypeError("a comparison that is not the machine's")

    def __bool__(self):
        raise TypeError("a branch that is not the machine's")


def opened(value):
    if isinstance(value, (list, tuple)):
        return type(value)(map(opened, value))
    return value.inner if isinstance(value, Box) else value


NUMBERS = (
    "number", "spread", "single", "spread_truth", "pick", "gathered", "binary", "negative", "fma", "unary",
    "library", "steady", "compare", "logic", "invert", "select", "bits", "of_bits", "whole", "load_real",
    "whole_of", "table_rows",
)  # fmt: skip
OTHERS = ("any_lane", "truth", "truth_to_index", "real_to_index", "store", "store_real", "load_truth")


class Sealed(Eager):
    """Machine whose numbers are boxes."""

    used: ClassVar[set[str]] = set()

    def load(self, pointer, kind, n=0, align=0):
        found = super().load(pointer, kind, n)
        return found if kind == "i64" else Box(found)

    def load_real(self, pointer, kind, n=0, align=0):
        return Box(super().load(pointer, kind, n))


def seal(name, boxes):
    inner = getattr(Eager, name)

    def method(self, *arguments):
        Sealed.used.add(name)
        found = inner(self, *map(opened, arguments))
        if not boxes:
            return found
        return [Box(x) for x in found] if isinstance(found, list) else Box(found)

    setattr(Sealed, name, method)


for name in (*NUMBERS, *OTHERS):
    if name not in vars(Sealed):
        seal(name, name in NUMBERS)


@pytest.mark.parametrize(("scene", "count"), [("leg", 1), ("suspended leg", 9), ("horse", 1), ("horse", 9)])
def test_an_engine_runs_on_a_machine_whose_numbers_nothing_else_can_open(scene, count):
    made = engine(scenes("identified")[scene], "identified", count)
    made.advance(steps=30)
    other = copy.deepcopy(made)
    made.advance(steps=2)
    with on_machine(Sealed()):
        other.advance(steps=2)
    np.testing.assert_array_equal(other._memory.data[:, :count], made._memory.data[:, :count])
    assert {"fma", "select", "any_lane", "bits"} <= Sealed.used


@pytest.mark.parametrize(("id", "count"), [("HorseLegSpeed", 1), ("HorseLegTerrain", 9), ("HorseRough", 1)])
def test_a_control_step_does_too(id, count):
    id = f"hoof_env/{id}-v0"
    made = (gym.make(id) if count == 1 else gym.make_vec(id, num_envs=count)).unwrapped
    made.reset(seed=0)
    batch = made.batch
    arrays = batch.engine._memory.data, batch.rows.episode, batch.rows.observations, batch.rows.rewards
    kept = [x.copy() for x in arrays]
    batch.calls.kernels.step(batch.calls.held)
    wanted = [x.copy() for x in arrays]
    for array, before in zip(arrays, kept, strict=True):
        array[:] = before
    with on_machine(Sealed()):
        batch.calls.kernels.step(batch.calls.held)
    for array, after in zip(arrays, wanted, strict=True):
        np.testing.assert_array_equal(array[..., :count], after[..., :count])
    assert (wanted[0] != kept[0])[..., :count].any()


def test_machines_have_the_same_operations():
    """Except the operations that write control flow and text, and whole numbers, which are Python's own."""

    def operations(machine):
        return {name for name, part in vars(machine).items() if callable(part) and not name.startswith("_")}

    text = {"new", "do", "label", "begin", "call", "text", "pointer", "shuffle", "widened"}
    whole = {"index_binary", "index_compare", "index_to_real"}
    at_once = {"table_rows", "whole_of", "truth"}
    assert operations(Writer) - operations(Eager) == text | whole
    assert operations(Eager) - operations(Writer) == at_once


def test_the_page_names_all_that_a_third_machine_replaces():
    page = (Path(compile_module.__file__).parent / "README.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`(\w+)`", page.partition("**A third machine**")[2].partition("\n## ")[0]))
    operations = {name for name, part in vars(Eager).items() if callable(part) and not name.startswith("_")}
    assert operations - named == {"at", "field", "slot"}  # places in memory, which are Python's


def test_the_machine_of_a_thread_comes_back_after_an_error():
    before = CURRENT.machine
    with (
        pytest.raises(AttributeError, match="'Writer' object has no attribute 'truth'"),
        running_on(Writer()),
    ):
        CURRENT.machine.truth("%v1")
    assert CURRENT.machine is before


def test_a_trace_that_fails_leaves_nothing_behind():
    def wrong(given):
        raise LookupError("no")

    for _ in range(2):
        with pytest.raises(LookupError):
            Kernel(wrong, [compile_module.Arrays({})]).compile()
    assert isinstance(CURRENT.machine, Eager)


@pytest.mark.parametrize(
    "x", [0.0, -0.0, 1.0, -1.5, math.pi, 5e-324, 1.7976931348623157e308, math.inf, math.nan]
)
def test_constants_have_all_bits(x):
    assert constant(x).startswith("0x")
    assert np.array([int(constant(x), 16)], np.uint64).tobytes() == np.array([x]).tobytes()


def test_fused_operations_of_python_round_once():
    a, b, c = np.random.default_rng(0).normal(size=(3, 200))
    c[:100] = -(a * b)[:100] * (1 + 1e-14)
    for x, y, z in zip(a.tolist(), b.tolist(), c.tolist(), strict=True):
        assert fma(x, y, z) == float(Fraction(x) * Fraction(y) + Fraction(z))
    assert math.isnan(fma(math.inf, 0.0, 1.0))
    assert fma(1e200, 1e200, 1.0) == math.inf
    assert fma(math.inf, 1.0, -1.0) == math.inf
    assert math.isnan(fma(1.0, math.nan, 1.0))
