"""Kernels become machine code: one trace for each text, in any process and thread, and for other machines."""

import copy
import ctypes
import gc
import inspect
import os
import pickle
import platform
import subprocess
import sys
import weakref

import gymnasium as gym
import llvmlite.binding as llvm
import numpy as np
import pytest

from benchmarks.scenes import engine, scenes
from hoof_env.dynamics.advance import ONE_BY_ONE, SIDE_BY_SIDE, EngineKind, new_kernel
from hoof_env.dynamics.model import static_of
from hoof_env.simd import (
    Matrix,
    Number,
    Whole,
    loop,
    new_rows,
    read,
    rolled,
    where,
    write,
)
from hoof_env.simd import compile as compile_module
from hoof_env.simd.compile import CompilerError, kernel, traced
from hoof_env.simd.values import TraceError
from tests.simd.assembly import assembly_of, object_for, text_of
from tests.simd.processes import ended, start_python


@kernel
def twice(x: Number) -> Number:
    return x + x


def test_a_kernel_takes_and_returns_numbers_whole_numbers_and_truths():
    @kernel
    def mixed(x: Number, k: Whole) -> Number:
        return x * k + 1

    @kernel
    def whole_result(x: Number, k: Whole) -> Whole:
        return 2 * k - 5

    @kernel
    def truth(x: Number) -> Whole:
        return x > 0.5

    for run, arguments, wanted in (
        (mixed, (0.5, 4), 3.0), (whole_result, (0.5, 4), 3), (truth, (0.75,), 1), (truth, (0.5,), 0),
        (twice, (2,), 4.0),
    ):  # fmt: skip
        assert run(*arguments) == run.run_now(*arguments) == wanted
        assert type(run(*arguments)) is type(run.run_now(*arguments))


@pytest.mark.parametrize("arguments", [(), ("x",), (None,), ([1.0],)])
def test_wrong_arguments_are_refused(arguments):
    with pytest.raises((TypeError, ctypes.ArgumentError), match=r"at least 1 argument|argument 1"):
        twice(*arguments)


@pytest.mark.parametrize("array", [np.zeros(3, np.float32), np.zeros((4, 4))[:, ::2], np.zeros((1, 1, 1, 1))])
def test_an_array_that_it_would_misread_is_refused(array):
    @kernel
    def fill(x: Matrix) -> None:
        x.first[0] = 1.0

    for run in (fill, fill.run_now):
        with pytest.raises(TypeError, match="expected a contiguous array of doubles"):
            run(array)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda x: 1.0 if x > 0.0 else 2.0, "`if`, `while`, `and`.*a boolean.*np.where"),
        (lambda x: x > 0.0 and 1.0, "`if`, `while`, `and`"),
        (lambda x: max(x, 1.0), "max.*np.minimum and np.maximum"),
        (lambda x: float(x), "float.*write NumPy's function"),
        (lambda x: round(x), "round"),
        (lambda x: [1.0, 2.0][x], "float.., int"),
        (lambda x: sum(x), "a loop over a number"),
        (lambda x: len(x), "len.. of a number"),
        (lambda x: np.array(x), "a NumPy array with a number"),
        (lambda x: np.sort(x), "np.sort of a number: kernels have np.absolute"),
        (lambda x: np.add.reduce(x), "np.add.reduce of a number: kernels have"),
        (lambda x: np.add(x, 1.0, where=True), "np.add with where of a number"),
        (lambda x: where(x, 1.0, 2.0), "where.. of a number: expected a condition"),
        (lambda x: where(x > 0.0, None, 2.0), "where.. of nothing: expected two numbers"),
        (lambda x: x + np.arange(3.0), "a NumPy array, of shape .3,., in an operation"),
    ],
)
def test_what_a_kernel_cannot_do_is_refused_in_words(wrong, words):
    def refused(x: Number) -> Number:
        return wrong(x)

    with pytest.raises(TraceError, match=words):
        kernel(refused).compile()


@pytest.mark.parametrize("power", [0.5, 1, 2, 3, 7.0, 16, 17, 0, -1, 2.5, np.float64(3.0), np.int64(2)])
def test_powers(power):
    def work(x: Matrix, out: Matrix) -> None:
        write(read(x.first, 0, 1, 8) ** power, out.first, 0, 1)
        write(2.5 ** read(x.first, 0, 1, 8), out.first, 8, 1)

    x, out, now = np.linspace(0.1, 4.0, 8), np.zeros((2, 8)), np.zeros((2, 8))
    made = kernel(work)
    made(x, out)
    made.run_now(x, now)
    np.testing.assert_array_equal(out, now)
    np.testing.assert_allclose(out, [x**power, 2.5**x], rtol=2e-15)


def test_a_kernel_without_an_end_is_refused_before_memory_is_gone(monkeypatch):
    monkeypatch.setattr("hoof_env.simd.machines.MAX_INSTRUCTIONS", 5000)  # of the machine that is made next

    @kernel
    def endless(x: Number) -> Number:
        while True:
            x = x + 1.0

    with pytest.raises(RecursionError, match="a loop or a recursion without end"):
        endless(1.0)


def test_what_llvm_refuses_says_why():
    with pytest.raises(CompilerError, match=r"LLVM refuses a kernel: .*error: expected type"):
        compile_module.optimised("define double @kernel( {")


# Machine code in memory


def test_equal_texts_share_machine_code():
    def adding(constant):
        def work(x: Number) -> Number:
            return x + constant

        return kernel(work)

    one, same, other = adding(4.25), adding(4.25), adding(4.5)
    assert [made(1.0) for made in (one, same, other)] == [5.25, 5.25, 5.5]
    assert one.call.code is same.call.code
    assert one.call.code is not other.call.code


def test_machine_code_lives_as_long_as_its_call_and_no_longer(monkeypatch):
    monkeypatch.setattr(compile_module, "_RECENT", [])  # what keeps some in any case

    def work(x: Number) -> Number:
        return x * 1.0625

    made = kernel(work)
    made.compile()
    call, code = made.call, weakref.ref(made.call.code)
    compile_module._RECENT.clear()
    del made
    gc.collect()
    assert call(2.0) == 2.125
    assert code() is not None
    del call
    gc.collect()
    assert code() is None


def test_recent_machine_code_is_found_again(monkeypatch):
    before = len(compile_module.COMPILED)

    def work(x: Number) -> Number:
        return x * 1.03125 + os.getpid()

    kernel(work)(1.0)
    gc.collect()
    monkeypatch.setattr(compile_module.objects, "read", lambda name: pytest.fail("read from a file"))
    assert kernel(work)(1.0) == 1.03125 + os.getpid()
    assert compile_module.COMPILED[before:] == ["work"]


def test_a_large_memory_on_the_stack():
    """More than a page that guards the stack, and more than the first pages of a thread's."""

    @kernel
    def fill(out: Matrix) -> None:
        rows = new_rows(None, 8, 10_000)  # 640 kB
        for k in loop(rolled(10_000)):
            rows[k] = read(out.first, 0, 1, 8) + k
        for k in loop(rolled(9_999)):
            rows[9_999] = rows[9_999] + rows[9_998 - k]
        write(rows[9_999], out.first, 0, 1)

    out = np.ones(8)
    fill(out)
    assert (out == 10_000 + 9_999 * 10_000 / 2).all()


def test_the_interpreter_ends_well_with_live_kernels():
    code = """
        import gymnasium as gym, hoof_env, threading
        from hoof_env.simd.threads import _workers
        envs = [gym.make("hoof_env/HorseLeg-v0"), gym.make_vec("hoof_env/HorseLeg-v0", num_envs=20)]
        for env in envs:
            env.reset(seed=0)
            env.step(env.action_space.sample())
        envs.append(envs)  # a cycle, which only the collector ends
        again = envs[0].unwrapped
        import atexit
        atexit.register(lambda: print(again.step(again.action_space.sample())[0].shape))
        def serve():
            while True:
                again.action_space.sample()
        threading.Thread(target=serve, daemon=True).start()
    """
    out, said = ended(start_python(code))
    assert out.startswith("(")
    assert "Error" not in said


# Copies and processes


needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork")


@needs_fork
def test_a_child_calls_and_compiles_kernels():
    """Also where another thread of its parent compiles, with locks of the room and of llvmlite."""
    code = """
        import os, signal, threading
        from hoof_env.simd import Number
        from hoof_env.simd.compile import kernel
        def adding(constant):
            def work(x: Number) -> Number:
                return x + constant
            return kernel(work)
        before = adding(2.0)
        assert before(1.0) == 3.0
        ends = threading.Event()
        def compile_many():
            constant = 100.0
            while not ends.is_set():
                constant += 1.0
                adding(constant)(1.0)
        thread = threading.Thread(target=compile_many)
        thread.start()
        codes = set()
        for _ in range(20):
            child = os.fork()
            if child == 0:
                signal.alarm(20)  # ends a child that waits for ever
                good = before(1.0) == 3.0 and adding(5.0 + os.getpid())(1.0) == 6.0 + os.getpid()
                os._exit(0 if good else 7)
            codes.add(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
            if codes != {0}:
                break
        ends.set()
        thread.join()
        print(codes, adding(8.0)(1.0), before(2.0))
    """
    assert ended(start_python(code))[0] == "{0} 9.0 4.0"


@needs_fork
def test_an_environment_goes_on_in_a_child():
    code = """
        import os
        import gymnasium as gym, hoof_env
        env = gym.make("hoof_env/HorseLeg-v0", disable_env_checker=True)
        env.reset(seed=0)
        action = env.action_space.sample()
        child = os.fork()
        found = env.step(action)[0].tobytes()
        again = gym.make("hoof_env/HorseLegTerrain-v0").reset(seed=0)[0].tobytes()
        name = "child" if child == 0 else "parent"
        os.write(1, f"{name} {(found + again).hex()}\\n".encode())  # at once, not mixed with the other's
        if child == 0:
            os._exit(0)
        assert os.waitpid(child, 0)[1] == 0
    """
    lines = ended(start_python(code))[0].splitlines()
    assert sorted(line.split()[0] for line in lines) == ["child", "parent"]
    assert len({line.split()[1] for line in lines}) == 1


@pytest.mark.parametrize("how", ["pickle", "deepcopy", "copy"])
@pytest.mark.parametrize("num_envs", [1, 9])
def test_copies_of_an_engine_go_on_alike(how, num_envs):
    made = engine(scenes("identified")["horse"], "identified", num_envs)
    made.advance(steps=20)
    copied = {
        "pickle": lambda: pickle.loads(pickle.dumps(made)),
        "deepcopy": lambda: copy.deepcopy(made),
        "copy": lambda: copy.copy(made),
    }[how]()
    made.advance(steps=20)
    kept = copied.state["centre_x"].copy()
    copied.advance(steps=20)
    assert (copied.state["centre_x"] != kept).all()
    assert copied._memory.data.tobytes() == made._memory.data.tobytes()


@pytest.mark.parametrize("id", ["HorseLeg-v0", "Horse-v0"])
@pytest.mark.parametrize("how", ["pickle", "deepcopy"])
def test_copies_of_environments_go_on_alike(id, how):
    for make in (gym.make, lambda id: gym.make_vec(id, num_envs=9)):
        made = make(f"hoof_env/{id}").unwrapped
        made.reset(seed=3)
        made.action_space.seed(0)
        for _ in range(3):
            made.step(made.action_space.sample())
        copied = pickle.loads(pickle.dumps(made)) if how == "pickle" else copy.deepcopy(made)
        gc.collect()
        action = made.action_space.sample()
        one, other = made.step(action), copied.step(action)
        assert one[0].tobytes() == other[0].tobytes()
        assert np.array_equal(one[1], other[1])
        assert made.engine._memory.data is not copied.engine._memory.data


def test_a_pickle_is_opened_in_a_new_process():
    code = """
        import pickle, sys
        made = pickle.loads(bytes.fromhex(sys.stdin.read()))
        made.advance(steps=5)
        print(made.state["centre_x"].tobytes().hex())
    """
    made = engine(scenes("identified")["suspended leg"], "identified", 3)
    made.advance(steps=3)
    packed = pickle.dumps(made).hex()
    done = subprocess.run(
        [sys.executable, "-c", inspect.cleandoc(code)],
        input=packed,
        capture_output=True,
        text=True,
        timeout=120,
    )
    made.advance(steps=5)
    assert done.stdout.strip() == made.state["centre_x"].tobytes().hex(), done.stderr


# Other machines


TRIPLES = (
    "aarch64-unknown-linux-gnu",
    "arm64-apple-macosx13.0",
    "x86_64-pc-windows-msvc",
    "x86_64-unknown-linux-gnu",
)
MAGIC = {"linux": b"\x7fELF", "apple": b"\xcf\xfa\xed\xfe", "windows": b"\x64\x86"}


def real_kernel(arrangement):
    made = engine(scenes("identified")["horse"], "identified")
    kind = EngineKind(made.features, None, static_of(made.arrays[1]))
    return new_kernel(kind, arrangement)


@pytest.fixture(scope="module")
def real_kernels():
    return [real_kernel(arrangement) for arrangement in (ONE_BY_ONE[4], SIDE_BY_SIDE)]


@pytest.mark.parametrize("triple", TRIPLES)
def test_kernels_compile_for_other_machines(real_kernels, triple):
    """To objects, which are not run here."""
    llvm.initialize_all_targets()
    try:
        llvm.Target.from_triple(triple)
    except RuntimeError:
        pytest.skip(f"this LLVM has no {triple}")
    magic = next(begin for system, begin in MAGIC.items() if system in triple)
    for made in (twice, *real_kernels):
        found = object_for(made, triple)
        assert found.startswith(magic)
        assert b"kernel" in found
        assert len(found) > (15_000 if made in real_kernels else 100)


def test_a_kernel_is_one_function_that_calls_nothing_outside():
    """Neither Python's runtime nor, but for functions of the C library that a user wrote, any library."""
    made = real_kernel(SIDE_BY_SIDE)
    text = text_of(made)
    declared = {line.split("@")[1].split("(")[0] for line in text.splitlines() if line.startswith("declare")}
    assert declared
    assert all(name.startswith("llvm.") for name in declared)
    assert text.count("define ") == 1


def test_the_same_function_has_the_same_text_at_each_trace():
    made = real_kernel(ONE_BY_ONE[4])
    assert traced(made.function, made.parameters) == traced(made.function, made.parameters)
    assert text_of(made) == text_of(real_kernel(ONE_BY_ONE[4]))


def test_assembly_is_made_for_the_processor():
    assert "kernel" in assembly_of(twice)


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads assembly of x86")
def test_machine_code_reaches_constants_anywhere():
    """Memory for code and for constants may be far from each other: no distance of 32 bits between them."""

    @kernel
    def scaled(x: Matrix) -> None:
        write(read(x.first, 0, 1, 8) * 1.7 + 0.3, x.first, 0, 1)

    code = assembly_of(scaled)
    assert "LCPI" in code
    assert "(%rip)" not in code
