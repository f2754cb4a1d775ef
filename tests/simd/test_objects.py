"""Files of machine code: written atomically, never out of date, not read if another user could have written
them."""

import ast
import os
import re
import shutil
import stat
import sys
import warnings
from pathlib import Path

import pytest

from hoof_env.simd import Number, objects
from hoof_env.simd import compile as compile_module
from hoof_env.simd.compile import PROCESSOR, kernel
from hoof_env.simd.objects import FOLDER, folder
from tests.simd.processes import ended, start_python

MODULE = """
from hoof_env.simd import Number
from hoof_env.simd.compile import COMPILED, kernel

@kernel
def tiny(x: Number) -> Number:
    return 2.0 * (x + 1.0)

@kernel
def other(x: Number) -> Number:
    return 3.0 * x
"""

CALL = "import tiny; print(tiny.tiny(3.0), tiny.COMPILED)"
COMPILED, LOADED = "8.0 ['tiny']", "8.0 []"

needs_modes = pytest.mark.skipif(os.name != "posix", reason="needs modes of files")
is_root = os.name == "posix" and os.geteuid() == 0


@pytest.fixture
def place(tmp_path):
    """A folder with a module of tiny kernels; their machine code will be below it."""
    (tmp_path / "tiny.py").write_text(MODULE)
    return tmp_path


@pytest.fixture
def own(tmp_path, monkeypatch):
    """The folder of machine code of this process, empty."""
    monkeypatch.setenv(FOLDER, str(tmp_path / "kernels"))
    monkeypatch.setattr(objects, "_WARNED", set())
    return tmp_path / "kernels"


def files(place):
    return sorted(path for path in place.rglob("*") if path.is_file() and path.suffix == ".o")


def forget():
    """Let this process have no machine code in memory that could stand in for files."""
    compile_module._RECENT.clear()
    compile_module._LOADED.clear()


def tiny():
    def work(x: Number) -> Number:
        return 2.0 * (x + 1.0)

    return kernel(work)


def compiles(made=tiny):
    """True if a kernel is compiled, not loaded, and in both cases right."""
    forget()
    before = len(compile_module.COMPILED)
    assert made()(3.0) == 8.0
    return len(compile_module.COMPILED) > before


def test_the_second_process_loads_what_the_first_compiled(place):
    assert ended(start_python(CALL, place)) == (COMPILED, "")
    assert ended(start_python(CALL, place)) == (LOADED, "")
    (file,) = files(place)
    assert re.fullmatch(r"tiny-[0-9a-f]{40}\.o", file.name)


def test_several_processes_at_once_all_have_it(place):
    found = [ended(process) for process in [start_python(CALL, place) for _ in range(4)]]
    assert {out for out, _ in found} <= {COMPILED, LOADED}
    assert {said for _, said in found} == {""}
    assert len(files(place)) == 1
    assert list((place / "kernels").iterdir()) == files(place)
    assert ended(start_python(CALL, place)) == (LOADED, "")


def test_an_edit_is_compiled_and_going_back_is_not(place):
    for change, wanted in (
        ("1.0", COMPILED),
        ("12.0", "30.0 ['tiny']"),
        ("1.0", LOADED),
        ("(0.5 + 0.5)", LOADED),
    ):
        (place / "tiny.py").write_text(MODULE.replace("x + 1.0", f"x + {change}"))
        assert ended(start_python(CALL, place))[0] == wanted
        shutil.rmtree(place / "__pycache__", ignore_errors=True)
    assert len(files(place)) == 2


ENVIRONMENTS = """
import hoof_env
import gymnasium as gym
from hoof_env.simd.compile import COMPILED

for name in ("HorseLeg", "HorseLegFixed"):
    env = gym.make(f"hoof_env/{name}-v0")
    env.reset(seed=0)
    env.step(env.action_space.sample())
print(hoof_env.__file__)
print(*COMPILED)
"""


def with_longer_docstrings(source):
    """Add a line to every docstring of a module."""
    lines = source.splitlines(keepends=True)
    nodes = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Expr))
    ends = {node.end_lineno for node in nodes if ast.get_source_segment(source, node).endswith('"""')}
    return "".join(
        line.replace('"""\n', '\n\nOne more line.\n"""\n')
        if number in ends and line.endswith('"""\n')
        else line
        for number, line in enumerate(lines, 1)
    )


def test_docstrings_and_line_numbers_compile_nothing(tmp_path):
    """Each docstring of the package gains a line, which also moves the code below it."""
    package = tmp_path / "hoof_env"
    shutil.copytree(
        objects.__file__.partition("simd")[0], package, ignore=shutil.ignore_patterns("__pycache__")
    )
    variables = {"PYTHONPATH": str(tmp_path), "PYTHONSAFEPATH": "1", "PYTHONDONTWRITEBYTECODE": "1"}

    def compiled():
        place, *names = ended(start_python(ENVIRONMENTS, tmp_path, **variables))[0].splitlines()
        assert Path(place).is_relative_to(tmp_path)
        return names[0].split() if names else []

    assert "step_one" in compiled()
    edited = 0
    for path in package.rglob("*.py"):
        source = path.read_text(encoding="utf-8")
        longer = with_longer_docstrings(source)
        edited += longer.count("One more line.")
        path.write_text(longer, encoding="utf-8")
    assert edited > 1000
    assert compiled() == []
    rewards = package / "tasks" / "reward.py"
    rewards.write_text(rewards.read_text(encoding="utf-8").replace("BEARING = 0.9", "BEARING = 0.8"), "utf-8")
    assert "step_one" in compiled()


def test_the_name_is_the_digest_of_text_processor_and_llvm(own, monkeypatch):
    names = set()

    def note(text):
        (name,) = {path.name for path in files(own)} - names
        names.add(name)

    assert compiles()
    note("first")
    assert not compiles()
    for part in ("another processor", "another version of LLVM"):
        monkeypatch.setattr(compile_module, "_identity", lambda part=part: part)
        assert compiles()
        note(part)
        assert not compiles()


def test_all_that_machine_code_depends_on_is_in_the_identity():
    import llvmlite.binding as llvm

    parts = compile_module._identity().split()
    assert parts[0] == llvm.get_process_triple()
    assert parts[1] == os.environ.get(PROCESSOR, llvm.get_host_cpu_name())
    assert ".".join(map(str, llvm.llvm_version_info)) in parts
    if PROCESSOR not in os.environ:
        assert llvm.get_host_cpu_features().flatten() in parts


def test_a_processor_that_llvm_does_not_know_is_refused(place):
    process = start_python(CALL, place, **{PROCESSOR: "Haswell"})
    said = process.communicate(timeout=120)[1].strip().splitlines()
    assert process.returncode == 1
    assert said[-1].endswith(
        "expected a processor by LLVM's name, such as haswell or x86-64-v3, got 'Haswell'"
    )
    assert not files(place)


def test_another_processor_has_files_of_its_own(place):
    assert ended(start_python(CALL, place))[0] == COMPILED
    import llvmlite.binding as llvm

    name = llvm.get_host_cpu_name()
    assert ended(start_python(CALL, place, **{PROCESSOR: name}))[0] == COMPILED
    assert ended(start_python(CALL, place, **{PROCESSOR: name}))[0] == LOADED
    assert len(files(place)) == 2


def test_files_are_plain_objects_behind_a_digest(own):
    """No pickle, no text that Python runs."""
    import hashlib

    compiles()
    (file,) = files(own)
    content = file.read_bytes()
    assert content[:32] == hashlib.sha256(content[32:]).digest()
    assert content[32:36] in (b"\x7fELF", b"\xcf\xfa\xed\xfe", b"\x64\x86\x06\x00") or os.name == "nt"
    room = Path(compile_module.__file__).parent
    assert not [
        path
        for path in room.glob("*.py")
        if re.search(r"\b(pickle|marshal|eval|exec)\b\(?", path.read_text())
    ]


@pytest.mark.parametrize("damage", ["empty", "cut", "one bit", "another's", "other content", "short"])
def test_a_damaged_file_is_compiled_again(own, damage):
    compiles()
    (file,) = files(own)
    whole = file.read_bytes()
    forget()

    def other(x: Number) -> Number:
        return 3.0 * x

    kernel(other)(1.0)
    (another,) = set(files(own)) - {file}
    middle = len(whole) // 2
    file.write_bytes(
        {
            "empty": b"",
            "cut": whole[:middle],
            "one bit": whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :],
            "another's": whole[:32] + another.read_bytes()[32:],
            "other content": b"x" * len(whole),
            "short": whole[:20],
        }[damage]
    )
    assert compiles()
    assert file.read_bytes() == whole
    assert not compiles()


def test_a_file_that_cannot_be_finished_is_removed(own, monkeypatch):
    """A full disk, and a process that is interrupted."""

    class Full:
        def __init__(self, number, mode):
            os.close(number)

        def __enter__(self):
            return self

        def __exit__(self, *error):
            return None

        def write(self, content):
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(objects, "open", Full, raising=False)
    assert compiles()
    assert list(own.iterdir()) == []
    monkeypatch.setattr(objects.os, "replace", lambda *paths: (_ for _ in ()).throw(KeyboardInterrupt))
    monkeypatch.delattr(objects, "open")
    with pytest.raises(KeyboardInterrupt):
        compiles()
    assert list(own.iterdir()) == []


def test_a_folder_that_cannot_be_made_is_not_used(own):
    """A file is in its place: each process compiles for itself, without a message."""
    own.write_text("")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert compiles()
        assert compiles()
    assert own.read_text() == ""


@needs_modes
@pytest.mark.skipif(is_root, reason="root writes everywhere")
def test_a_folder_that_cannot_be_written_is_read(own):
    assert compiles()
    own.chmod(0o500)
    try:
        assert not compiles()
        assert compiles(lambda: other_tiny())
        assert len(files(own)) == 1
    finally:
        own.chmod(0o700)


def other_tiny():
    def work(x: Number) -> Number:
        return 2.0 * x + 2.0

    return kernel(work)


def test_a_disk_that_cannot_be_written_is_read(own, monkeypatch):
    assert compiles()

    def refuse(*arguments, **named):
        raise PermissionError("read-only file system")

    monkeypatch.setattr(objects.tempfile, "mkstemp", refuse)
    assert not compiles()
    assert compiles(other_tiny)
    assert compiles(other_tiny)
    assert len(files(own)) == 1


@needs_modes
@pytest.mark.parametrize("what", ["folder", "file"])
@pytest.mark.parametrize("mode", [0o020, 0o002])
def test_what_others_may_write_is_not_used_and_that_is_reported_once(own, what, mode):
    assert compiles()
    (file,) = files(own)
    victim = own if what == "folder" else file
    victim.chmod(victim.stat().st_mode | mode)
    before = file.read_bytes()
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assert compiles()
        assert compiles() == (what == "folder")
    assert len(said) == 1
    text = str(said[0].message)
    assert f"{victim} belongs to others, or others may write there: machine code in it is not used" in text
    assert FOLDER in text
    # a file is written anew, and is this user's alone then; a folder is left as it is
    assert file.read_bytes() == before
    assert f"`chmod go-w {victim}` if it is yours" in text
    victim.chmod(victim.stat().st_mode & ~0o022)
    assert not compiles()


@needs_modes
@pytest.mark.skipif(not is_root, reason="needs root")
@pytest.mark.parametrize("what", ["folder", "file"])
def test_what_belongs_to_others_is_not_used(own, what):
    assert compiles()
    (file,) = files(own)
    victim = own if what == "folder" else file
    os.chown(victim, 65534, 65534)
    with pytest.warns(UserWarning, match="belongs to others"):
        assert compiles()


@needs_modes
def test_it_is_closed_to_others_whatever_the_umask(own):
    before = os.umask(0)
    try:
        assert compiles()
    finally:
        os.umask(before)
    (file,) = files(own)
    assert stat.S_IMODE(own.stat().st_mode) == 0o700
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not compiles()


@needs_modes
def test_a_folder_inside_one_that_others_may_write_is_used(tmp_path, monkeypatch):
    """Folders like ~/.cache/hoof-env under umask 002, and /tmp: owner and mode are this user's alone."""
    wide = tmp_path / "wide"
    wide.mkdir()
    wide.chmod(0o1777)
    monkeypatch.setenv(FOLDER, str(wide / "kernels"))
    monkeypatch.setattr(objects, "_WARNED", set())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert compiles()
        assert not compiles()


def test_the_least_recently_used_half_goes_and_other_files_stay(own, monkeypatch):
    monkeypatch.setattr(objects, "MAX_FILES", 10)
    own.mkdir(mode=0o700)
    (own / "letter.txt").write_text("a user's")
    (own / "lens.o").write_text("a user's")
    names = [f"kernel-{k:040x}.o" for k in range(11)]
    for k, name in enumerate(names):
        assert len(files(own)) == k + 1  # with lens.o
        objects.write(name, b"content")
        os.utime(own / name, (k, k)) if k < 10 else None
    kept = {path.name for path in own.iterdir()}
    assert kept == {"letter.txt", "lens.o", *names[5:]}
    assert objects.read(names[5]) == b"content"
    assert objects.read(names[4]) is None


def test_use_is_noted_once_a_day(own):
    objects.write("kernel-" + 40 * "0" + ".o", b"content")
    (file,) = files(own)
    now = file.stat().st_mtime
    for age, is_noted in ((objects.DAY / 2, False), (2 * objects.DAY, True)):
        os.utime(file, (now - age, now - age))
        assert objects.read(file.name) == b"content"
        assert (file.stat().st_mtime > now - 60) == is_noted


def test_the_folder_comes_from_the_variable_else_it_is_in_the_users_cache(monkeypatch, tmp_path):
    monkeypatch.setenv(FOLDER, str(tmp_path / "x"))
    assert folder() == tmp_path / "x"
    monkeypatch.delenv(FOLDER)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(objects.sys, "platform", "linux")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert folder() == Path.home() / ".cache" / "hoof-env" / "kernels"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert folder() == tmp_path / "cache" / "hoof-env" / "kernels"
    monkeypatch.setattr(objects.sys, "platform", "darwin")
    assert folder() == Path.home() / "Library" / "Caches" / "hoof-env" / "kernels"
    monkeypatch.setattr(objects.sys, "platform", "win32")
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "local"))
    assert folder() == tmp_path / "local" / "hoof-env" / "kernels"


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="names folders of Linux")
@pytest.mark.parametrize("home", [None, "/proc/nonexistent", "here"])
def test_a_process_without_a_home_that_it_can_write_works(place, home):
    """Without a home at all, as of an unknown user in a container, there is a folder of temporary files."""
    code = f"""
        import os, pwd, tempfile
        def unknown(number):
            raise KeyError(number)
        if {home is None}:
            pwd.getpwuid = unknown
        from hoof_env.simd.objects import folder
        import tiny
        print(tiny.tiny(3.0), tiny.COMPILED, folder())
    """
    variables = {FOLDER: None, "XDG_CACHE_HOME": None, "HOME": home, "TMPDIR": str(place)}
    if home == "here":
        variables["HOME"] = str(place / "home")
        (place / "home").mkdir(mode=0o700)
        (place / "home" / ".cache").write_text("not a folder")
    out, said = ended(start_python(code, place, **variables))
    assert out.startswith(COMPILED)
    assert said == ""
    kept = place / f"hoof-env-{os.geteuid()}"
    assert out.split()[-1] == (str(kept) if home is None else f"{variables['HOME']}/.cache/hoof-env/kernels")
    assert len(files(place)) == (home is None)


def test_an_empty_folder_and_a_full_one_give_the_same_bits(place):
    code = """
        import hashlib
        import gymnasium as gym, hoof_env
        import numpy as np
        from hoof_env.simd.compile import COMPILED
        found = hashlib.sha256()
        for env in (gym.make("hoof_env/HorseLeg-v0"), gym.make_vec("hoof_env/HorseLeg-v0", num_envs=9)):
            env.reset(seed=0)
            env.action_space.seed(0)
            for _ in range(5):
                observation, reward, *_ = env.step(env.action_space.sample())
                found.update(observation.tobytes() + np.asarray(reward).tobytes())
                found.update(env.unwrapped.engine._memory.data.tobytes())
        print(found.hexdigest(), len(COMPILED))
    """
    first, count = ended(start_python(code, place))[0].split()
    assert int(count) >= 4
    assert ended(start_python(code, place))[0].split() == [first, "0"]
    assert len(files(place)) == int(count)
    assert sum(path.stat().st_size for path in files(place)) < 1e6
