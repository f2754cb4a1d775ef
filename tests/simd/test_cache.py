"""Compiled kernels: one process compiles and others wait; where they are kept, when they are made anew, and
what is said; folders without write access or locks."""

import os
import re
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from types import SimpleNamespace

import pytest

from tests.simd.processes import CALL, CALL_OR_SAY, ROOT, ended


def until(condition, process):
    limit = time.monotonic() + 120
    while not condition():
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < limit
        time.sleep(0.05)


def holder_and_waiter(start, tmp_path, code=CALL):
    """A process that compiles and one that waits for it."""
    first = start()
    until((tmp_path / "began").exists, first)
    second = start(code)
    assert second.stderr.readline() == "hoof-env: waiting for another process, which compiles tiny ...\n"
    return first, second


def test_one_process_compiles_while_another_waits_and_loads(start, tmp_path):
    first, second = holder_and_waiter(start, tmp_path)
    (tmp_path / "go").touch()
    assert ended(first)[0] == "8.0 ['inner', 'tiny']"
    assert ended(second)[0] == "8.0 []"
    assert ended(start())[0] == "8.0 []"


def test_four_at_once_compile_each_kernel_once(start, tmp_path):
    (tmp_path / "go").touch()
    found = sorted(ended(process)[0] for process in [start(HOOF_ENV_QUIET="1") for _ in range(4)])
    assert sum(line.count("tiny") for line in found) == sum(line.count("inner") for line in found) == 1
    assert len(list((tmp_path / "cache").rglob("*.nbc"))) == 2


@pytest.mark.skipif(os.name != "posix", reason="kills with SIGKILL")
def test_a_process_that_is_killed_while_it_compiles_lets_go(start, tmp_path):
    first, second = holder_and_waiter(start, tmp_path)
    first.send_signal(signal.SIGKILL)
    first.wait()
    (tmp_path / "go").touch()
    assert ended(second)[0] == "8.0 ['inner', 'tiny']"


def test_what_cannot_be_compiled_lets_go(start, tmp_path):
    (tmp_path / "go").touch()
    out, _ = ended(
        start("""
            import tiny
            from filelock import FileLock
            from numba import TypingError
            try:
                tiny.wrong(1.0)
            except TypingError:
                for path in (tiny.HERE / "cache").rglob("*.lock"):
                    FileLock(path).acquire(timeout=0)
                    print(path.name.split("-")[0], "is free", tiny.COMPILED)
        """)
    )
    assert out == "tiny.wrong is free []"


def test_an_edit_beside_a_kernel_recompiles_it_and_another_does_not(start, tmp_path):
    """A kernel's own file stays as it was; what it calls lies in a module of the same folder."""
    folder = tmp_path / "kernels"
    folder.mkdir()
    kernel = "from hoof_env.simd.compile import kernel\n\n@kernel\ndef "
    (folder / "caller.py").write_text(
        f"from helper import part\n{kernel}whole(x):\n    return 2.0 * part(x)\n"
    )
    code = "import caller; from hoof_env.simd.cache import COMPILED; print(caller.whole(3.0), COMPILED)"
    both = "['part', 'whole']"
    # The last text is longer: Python itself does not notice an edit of the same size within a second.
    for change, value, compiled in ((1.0, 8.0, both), (1.0, 8.0, "[]"), (12.0, 30.0, both)):
        (folder / "helper.py").write_text(f"{kernel}part(x):\n    return x + {change}\n")
        assert ended(start(code, PYTHONPATH=f"{ROOT}{os.pathsep}{folder}"))[0] == f"{value} {compiled}"
    (tmp_path / "elsewhere.py").write_text("x = 1\n")
    assert ended(start(code, PYTHONPATH=f"{ROOT}{os.pathsep}{folder}"))[0] == "30.0 []"


def test_a_stored_kernel_is_loaded_without_what_only_compiling_needs(start_anew, tmp_path):
    """Its machine code refers to numba's runtime, for the array, and to the secret of Python's hashes, which
    a module defines that its pickle names."""
    (tmp_path / "hashed.py").write_text(
        textwrap.dedent("""
            import numpy as np
            from hoof_env.simd.compile import kernel

            @kernel
            def total(x, word):
                numbers = np.empty(3)
                numbers[0] = x
                return numbers[0] + hash(word) % 1000
        """)
    )
    code = """
        import sys
        import hashed
        from hoof_env.simd.cache import COMPILED
        # A text of its own, of which Python has no hash yet
        found = hashed.total(2.0, "".join(["fore", "leg"]))
        print(found == 2.0 + hash("foreleg") % 1000, "numba.np.linalg" in sys.modules, COMPILED)
    """
    path = f"{ROOT}{os.pathsep}{tmp_path}"
    assert ended(start_anew(code, PYTHONPATH=path))[0] == "True True ['total']"
    assert ended(start_anew(code, PYTHONPATH=path))[0] == "True False []"


def test_who_waits_too_long_compiles_too(start, tmp_path):
    impatient = "from hoof_env.simd import cache; cache.LONGEST_WAIT = 0.2;" + CALL
    first, second = holder_and_waiter(start, tmp_path, impatient)
    assert second.stderr.readline() == "hoof-env: waited 0 s for tiny: compiling it here, too\n"
    (tmp_path / "go").touch()
    assert ended(first)[0] == "8.0 ['inner', 'tiny']"
    assert ended(second)[0].startswith("8.0")


def test_without_locks_it_compiles_all_the_same(start, tmp_path):
    (tmp_path / "go").touch()
    no_locks = """
        import errno, filelock
        def acquire(*args, **kwargs):
            raise OSError(errno.ENOLCK, "no locks available")
        filelock.FileLock.acquire = acquire
    """
    code = textwrap.dedent(no_locks) + CALL
    assert ended(start(code))[0] == "8.0 ['inner', 'tiny']"
    assert ended(start(code))[0] == "8.0 []"


def test_threads_and_forked_children_do_not_lock_each_other_out(start, tmp_path):
    (tmp_path / "go").touch()
    code = """
        import os, threading
        import tiny
        threads = [threading.Thread(target=tiny.tiny, args=(x,)) for x in (1.0, 2.0, 3)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
        if hasattr(os, "fork"):
            child = os.fork()
            if child == 0:
                os._exit(int(tiny.tiny(True) != 4.0))
            assert os.waitpid(child, 0)[1] == 0
        print(sorted(tiny.COMPILED))
    """
    assert ended(start(code))[0] == "['inner', 'inner', 'tiny', 'tiny']"


@pytest.mark.parametrize(
    "reason",
    [
        "a file is there", "read-only",
        pytest.param("no permission", marks=pytest.mark.skipif(
            os.name != "posix" or os.geteuid() == 0, reason="needs a folder that this user cannot write"
        )),
    ],
)  # fmt: skip
def test_a_folder_that_is_not_writable_is_named_with_the_remedy(start, tmp_path, reason):
    (tmp_path / "go").touch()
    folder = tmp_path / "parent" / "cache"
    if reason == "a file is there":
        folder.parent.write_text("")
    else:
        folder.parent.mkdir(0o500 if reason == "no permission" else 0o777)
    code = CALL_OR_SAY.format(read_only=reason == "read-only")
    out, _ = ended(start(code, NUMBA_CACHE_DIR=str(folder)))
    assert out.startswith(f"cannot keep compiled kernels in {str(folder)!r} (")
    assert out.endswith("expected a writable folder: set the environment variable NUMBA_CACHE_DIR to one")


def test_kernels_are_loaded_from_a_folder_that_is_not_writable(start, tmp_path):
    (tmp_path / "go").touch()
    ended(start())
    assert ended(start(CALL_OR_SAY.format(read_only=True)))[0] == "8.0 []"


def test_without_compilation_the_reason_is_named(start_anew):
    _, said = start_anew("import hoof_env.leg.kinematics", NUMBA_DISABLE_JIT="1").communicate()
    assert "HoofEnvError: NUMBA_DISABLE_JIT is set" in said


def test_an_edit_of_the_mechanics_makes_kernels_anew(start_anew, tmp_path):
    """`touch` calls `normal_force`, which lives in another file: numba alone would keep the old one."""
    package, code = tmp_path / "hoof_env", """
        import hoof_env
        from hoof_env.ground.contact import Ground, new_contacts, touch
        from hoof_env.simd.cache import COMPILED
        force = touch(new_contacts()[0], -0.04j, 0j, Ground().to_record()).imag
        print(hoof_env.__file__, force, "touch" in COMPILED)
    """  # fmt: skip
    shutil.copytree(ROOT / "hoof_env", package, ignore=shutil.ignore_patterns("__pycache__"))
    law = (package / "ground" / "laws.py").read_text()
    for factor, is_compiled in ((1.0, True), (1.0, False), (2.0, True)):
        changed = (
            law if factor == 1 else law.replace("return maximum(spring *", "return maximum(2.0 * spring *")
        )
        (package / "ground" / "laws.py").write_text(changed)
        where, force, found = ended(start_anew(code))[0].split()
        assert where == str(package / "__init__.py")
        assert float(force) == pytest.approx(factor * 2e4 * 0.04**1.5)
        assert found == str(is_compiled)


def test_compiling_is_said_once_and_only_when_it_happens(start_anew, tmp_path):
    code = """
        import numba
        numba.njit(lambda x: x + 1)(1)  # not ours
        import sys
        print("---", file=sys.stderr)
        from hoof_env.ground.contact import Ground, new_contacts, touch
        for _ in range(2):
            touch(new_contacts()[0], -0.04j, 0j, Ground().to_record())
    """
    before, *rest = ended(start_anew(code))[1].splitlines()
    assert before == "---"
    assert all(re.fullmatch(r"hoof-env: \w+ compiled in \d+\.\d s", line) for line in rest)
    assert ended(start_anew(code))[1] == "---\n"  # from the cache
    new = {"NUMBA_CACHE_DIR": str(tmp_path / "new"), "HOOF_ENV_QUIET": "1"}
    assert ended(start_anew(code, **new))[1] == "---\n"


def test_half_a_minute_is_told_of_kernels_that_take_as_long(capsys, monkeypatch):
    """It was told of one that took half a second, and then nothing."""
    from hoof_env.simd import compile

    said = "hoof-env: compiling kernels for this machine, once (about half a minute) ...\n"
    monkeypatch.delenv(compile.QUIET, raising=False)
    announcer = compile._Announcer()
    for name, expected in (("touch", ""), ("step_one", said), ("advance_leg", "")):
        function = SimpleNamespace(__name__=name, __module__="hoof_env.envs.step")
        event = SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=function)})
        announcer.on_start(event)
        announcer.on_end(event)
        assert capsys.readouterr().err == expected


def test_all_kernels_are_told_once_and_then_there_is_nothing_to_compile(start, tmp_path):
    (tmp_path / "go").touch()
    code = """
        from hoof_env.envs import compile_ahead
        import tiny
        compile_ahead.KERNELS = {"two kernels": lambda: tiny.tiny(3.0)}
        compile_ahead.compile_kernels(print)
    """
    out, _ = ended(start(code))
    first, second = out.splitlines()
    assert first.startswith("two kernels: ")
    assert first.endswith(" s for inner, tiny")
    assert second == f"2 kernels compiled; they are in {tmp_path / 'cache'}"
    assert ended(start(code))[0] == f"nothing to compile; they are in {tmp_path / 'cache'}"


def test_an_environment_has_all_its_kernels_once_it_is_made(start_anew):
    """So that one in a parent process warms the cache for workers; what is compiled ahead is all there is."""
    code = """
        import numpy as np
        from hoof_env.simd.cache import KernelCache
        from hoof_env.envs.compile_ahead import KERNELS
        from hoof_env.envs.horse_leg import HorseLegEnv
        from hoof_env.envs.vector import HorseLegVectorEnv
        wanted, load = [], KernelCache.load_overload
        def watch(self, *args):
            wanted.append(self._kernel)
            return load(self, *args)
        KernelCache.load_overload = watch
        makers = (
            HorseLegEnv, lambda: HorseLegVectorEnv(8), lambda: HorseLegEnv(task="fixed", solver="paper"),
            lambda: HorseLegEnv(task="horse"), lambda: HorseLegVectorEnv(8, task="horse"),
        )
        for compile_ahead, make in zip(KERNELS.values(), makers, strict=True):
            compile_ahead()
            print(len(wanted) > 0, end=" ")
            wanted.clear()
            env = make()
            env.reset(seed=0)
            for _ in range(2):
                env.step(env.action_space.sample())
            env.set_state(env.get_state())
            if isinstance(env, HorseLegEnv):
                env.record()
            print(wanted, end=" ")
            wanted.clear()
        for task in ("leg", "rail", "speed", "terrain", "fixed"):
            for env in (HorseLegEnv(task=task, drive="motor"), HorseLegVectorEnv(9, task=task)):
                env.reset(seed=0)
                env.step(env.action_space.sample())
        env = HorseLegVectorEnv(3, task="fixed", solver="paper")
        env.reset(seed=0)
        env.step(env.action_space.sample())
        print(wanted)
    """
    # the folder of all tests: these kernels are large
    shared = os.environ.get("NUMBA_CACHE_DIR", "")
    assert ended(start_anew(code, NUMBA_CACHE_DIR=shared), limit=550)[0] == "True [] " * 5 + "[]"


TWINS = """
import math, sys
from hoof_env.simd.compile import kernel

def twin(n):
    def part(y):
        if y > 1e9:
            return 0.0
{body}
        return n + 0.0 * y

    inner = kernel(part, f"part {n}")

    def whole(count):
        total = 0.0
        for k in range(count):
            total += inner(total + k)
        return total

    return kernel(whole, f"whole {n}")

print(*(twin(float(n))(2) for n in sys.argv[1:]))
"""


def test_kernels_of_one_source_are_told_apart_when_both_are_loaded(tmp_path):
    """Each was compiled by a process of its own; too large to be put in line, they are called by name."""
    body = [f"        y = y * {1 + k / 1000} + math.sin(y + {k}.0) / (1.0 + y * y)" for k in range(120)]
    (tmp_path / "twins.py").write_text(TWINS.replace("{body}", "\n".join(body)))
    settings = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(ROOT)}

    def said(*numbers):
        command = [sys.executable, str(tmp_path / "twins.py"), *numbers]
        return subprocess.run(command, env=settings, check=True, capture_output=True, text=True).stdout

    assert [said("1"), said("2")] == ["2.0\n", "4.0\n"]
    assert [said("1", "2"), said("2", "1")] == ["2.0 4.0\n", "4.0 2.0\n"]


NESTED = """
from hoof_env.simd.compile import kernel
from hoof_env.simd.types import instruction

inside = []

@instruction(lambda x: x(x))
def same(code, x):
    if not inside:
        inside.append("called")
        inside.append(make()(3.0))
    return x

def make():
    def twice(x):
        return 2.0 * same(x)
    return kernel(twice)

print(make()(1.0), inside)
"""


def test_a_kernel_that_is_needed_while_it_is_compiled_does_not_wait_for_itself(start, tmp_path):
    """As where a stored kernel asks for a module whose import makes an environment."""
    (tmp_path / "nested.py").write_text(NESTED)
    assert ended(start("import nested"), limit=60)[0].split() == ["2.0", "['called',", "6.0]"]
