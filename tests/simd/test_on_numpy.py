"""`on_numpy`: kernels of a block run on NumPy, in this thread and nowhere else."""

import sys
import threading
from typing import Annotated

import gymnasium as gym
import numpy as np
import pytest

from benchmarks.scenes import engine, scenes
from hoof_env import Limb, Trunk, TrunkEngine, load_gait, load_geometry
from hoof_env.dynamics import hoof
from hoof_env.simd import Matrix, Number, loop, new_rows, on_numpy, read, vector, where, write
from hoof_env.simd import compile as compile_module
from hoof_env.simd.compile import Kernel, is_on_machine, kernel
from hoof_env.simd.layout import Block, Layout, Row, Vector
from hoof_env.simd.machines import CURRENT, Eager


def watched(seen):
    """A kernel that notes of which type its numbers are."""

    @kernel
    def work(x: Number) -> Number:
        y = x * 3.0
        seen.append("text" if isinstance(y.x, str) else "number")
        return y

    return work


def test_a_kernel_runs_on_numpy_in_the_block_only():
    seen = []
    work = watched(seen)
    assert work(2.0) == 6.0
    with on_numpy():
        assert is_on_machine()
        assert work(2.0) == 6.0
        assert type(work(2.0)) is float
    assert not is_on_machine()
    assert work(2.0) == 6.0
    assert seen == ["text", "number", "number"]


def test_a_kernel_is_not_compiled_there():
    seen = []
    work = watched(seen)
    with on_numpy():
        assert work(2.0) == 6.0
    assert work.call is None
    with on_numpy():
        work.compile()
        assert work(1.0) == 3.0
    assert work(1.0) == work.call(1.0) == 3.0
    assert seen == ["number", "text", "number"]


def test_blocks_inside_blocks_and_errors_leave_it_as_it_was():
    seen = []
    work = watched(seen)
    work(1.0)
    with on_numpy():
        with on_numpy(exact=False):
            assert work(1.0) == 3.0
        assert is_on_machine()
        with pytest.raises(ZeroDivisionError), on_numpy():
            raise ZeroDivisionError
        assert is_on_machine()
        assert work(1.0) == 3.0
    assert not is_on_machine()
    assert compile_module.BLOCKS == []
    assert work(1.0) == 3.0
    assert seen == ["text", "number", "number"]


def test_another_thread_runs_machine_code_meanwhile():
    seen = []
    work = watched(seen)
    work(1.0)
    seen.clear()
    found = []
    with on_numpy():
        other = threading.Thread(target=lambda: found.append((work(2.0), is_on_machine())))
        other.start()
        other.join()
        assert seen == []
        work(2.0)
    assert found == [(6.0, False)]
    assert seen == ["number"]


def test_blocks_of_two_threads_end_in_any_order():
    seen = []
    work = watched(seen)
    work(1.0)
    inside, leave = threading.Event(), threading.Event()

    def stay():
        with on_numpy():
            inside.set()
            leave.wait(60)

    other = threading.Thread(target=stay)
    with on_numpy():
        other.start()
        inside.wait(60)
    assert len(compile_module.BLOCKS) == 1
    assert work(2.0) == 6.0
    leave.set()
    other.join()
    assert compile_module.BLOCKS == []
    assert seen == ["text"]


def test_products_are_fused_unless_asked_otherwise():
    @kernel
    def sums(x: Matrix) -> None:
        a, b, c = (read(x.first, 8 * k, 1, 8) for k in range(3))
        write(a * b + c, x.first, 0, 1)

    given = np.random.default_rng(0).normal(size=(3, 8))
    given[2] = -given[0] * given[1] * (1 + 1e-13)
    fused, same, rounded = given.copy(), given.copy(), given.copy()
    sums(fused)
    with on_numpy():
        sums(same)
    with on_numpy(exact=False):
        sums(rounded)
    assert same.tobytes() == fused.tobytes()
    np.testing.assert_array_equal(rounded[0], given[0] * given[1] + given[2])
    assert rounded.tobytes() != fused.tobytes()


def test_an_error_shows_the_traced_function_in_its_traceback():
    def refuse(given):
        for n in loop(given.begin, given.end):
            raise ValueError(f"at {n}")

    arrays = compile_module.Arrays({"x": "f8"})
    held = arrays.hold({"x": np.zeros(3)}, range(1, 3))
    with on_numpy(), pytest.raises(ValueError, match="at 1") as seen:
        Kernel(refuse, [arrays])(held)
    assert seen.traceback[-1].name == "refuse"


def test_an_error_in_a_users_function_keeps_its_traceback():
    failing = []

    def law(penetration, rate, inverse_approach_speed, ground):
        if failing:
            raise ArithmeticError("of mine")
        return ground.stiffness * penetration

    made = TrunkEngine(Limb(load_geometry("identified")), Trunk("fixed"), contact_law=law)
    made.reset(load_gait("walk", "identified"), 0.3)
    failing.append(1)
    with on_numpy(), pytest.raises(ArithmeticError, match="of mine") as seen:
        made.run(steps=1000)
    assert seen.traceback[-1].name == "law"


def test_a_row_that_was_never_written_is_an_error_where_it_is_used():
    @kernel
    def careless(x: Matrix) -> None:
        rows = new_rows(None, 8, 2)
        a = read(x.first, 0, 1, 8)
        write(where(a > 0.0, rows[0], a), x.first, 0, 1)

    x = -np.ones(8)
    careless.run_now(x)  # chosen nowhere
    assert (x == -1).all()
    x[3] = 1.0
    with pytest.raises(ValueError, match="a row is chosen that was never written"):
        careless.run_now(x)

    @kernel
    def more_careless(x: Matrix) -> None:
        write(new_rows(None, 8, 2)[1] + 1.0, x.first, 0, 1)

    with pytest.raises(TypeError, match="NoneType"):
        more_careless.run_now(x)


def test_a_debugger_sees_arrays_in_the_contact_of_an_environments_step():
    """A breakpoint at a line of the law of contact, as `pdb` sets it: by a trace of this thread."""
    env = gym.make("hoof_env/HorseLeg-v0").unwrapped
    env.reset(seed=0)
    seen = []

    def trace(frame, event, argument):
        if frame.f_code is not hoof.rigid_contact.__code__:
            return None

        def line(frame, event, argument):
            if event == "return":
                seen.append((frame.f_locals["penetration"].x, frame.f_locals["force"].x))
            return line

        return line

    before = sys.gettrace()
    with on_numpy():
        sys.settrace(trace)
        try:
            env.step(env.action_space.sample())
        finally:
            sys.settrace(before)
    stages = env.engine.substeps * round(env.dt / env.engine.sim_dt) * 2
    assert len(seen) == 2 * (stages + 1)  # toe and heel
    assert all(isinstance(x, np.ndarray) and x.shape == (1,) for pair in seen for x in pair)
    assert any(depth[0] > 0 and force[0] > 0 for depth, force in seen)
    assert all(force[0] == 0 for depth, force in seen if depth[0] <= 0)


class Point(Layout):
    place: Vector
    depth: Row


class Hoof(Layout):
    toe: Point
    loads: Annotated[Block, 2]


def test_values_and_rows_are_printed_with_what_they_hold():
    """Where a kernel is traced there is nothing to print yet but names."""
    said = []

    @kernel
    def work(x: Matrix) -> None:
        rows = new_rows(Hoof, 2)
        rows.toe.place = vector(read(x.first, 0, 1, 2), 1.0)
        rows.toe.depth = 0.5
        said.extend(map(repr, (rows, rows.toe.place, rows.toe.depth, rows.toe.depth > 0.0)))

    work.run_now(np.array([3.0, 4.0]))
    assert said == [
        "toe: \n  place: Plane([3. 4.], [1. 1.])\n  depth: Lanes([0.5 0.5])\nloads: rows of numbers",
        "Plane([3. 4.], [1. 1.])",
        "Lanes([0.5 0.5])",
        "Mask([ True  True])",
    ]
    said.clear()
    work(np.array([3.0, 4.0]))
    assert said[0] == "rows of toe, loads"
    assert said[1].startswith("Plane(%")


@pytest.mark.parametrize("num_threads", [1, 2])
def test_many_environments_on_threads_run_in_this_one(num_threads, monkeypatch):
    monkeypatch.setattr("hoof_env.simd.threads.available", lambda: 8)
    made = engine(scenes("identified")["leg"], "identified", 17, num_threads=num_threads)
    same = engine(scenes("identified")["leg"], "identified", 17, num_threads=1)
    machines = []
    inner = hoof.ground_forces

    def ground_forces(*arguments):
        machines.append((type(CURRENT.machine), threading.get_ident()))
        return inner(*arguments)

    monkeypatch.setattr("hoof_env.dynamics.mechanics.ground_forces", ground_forces)
    with on_numpy():
        made.advance(steps=2)
    # three groups of eight, of which each has two stages in each substep, and one at the end
    assert machines == [(Eager, threading.get_ident())] * 3 * (2 * 2 * made.substeps + 1)
    same.advance(steps=2)
    assert made._memory.data[:, :17].tobytes() == same._memory.data[:, :17].tobytes()


def test_an_environment_is_made_and_runs_in_the_block():
    with on_numpy():
        env = gym.make("hoof_env/HorseLeg-v0", disable_env_checker=True).unwrapped
        first = env.reset(seed=0)[0]
        found = env.step(np.zeros(4, np.float32))
    again = gym.make("hoof_env/HorseLeg-v0").unwrapped
    assert again.reset(seed=0)[0].tobytes() == first.tobytes()
    wanted = again.step(np.zeros(4, np.float32))
    assert found[0].tobytes() == wanted[0].tobytes()
    assert found[1] == wanted[1]
    on = env.step(np.ones(4, np.float32))[0]
    assert on.tobytes() == again.step(np.ones(4, np.float32))[0].tobytes()
