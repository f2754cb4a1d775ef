"""Files of compiled kernels that are damaged, or that others could have written."""

import os
import shutil
import subprocess
import textwrap
from types import SimpleNamespace

import pytest

from hoof_env.simd import trust
from tests.simd.processes import CALL, CALL_OR_SAY, ended


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_a_damaged_file_is_noticed_and_compiled_again(start, tmp_path, kind):
    """Each damage in a copy of the same files, by two processes of which the second finds all in order."""
    (tmp_path / "go").touch()
    ended(start())
    for damage in ("empty", "cut", "one bit", "another's", "no pickle"):
        folder = tmp_path / damage
        shutil.copytree(tmp_path / "cache", folder)
        spoil(folder, kind, damage)
        out, said = ended(start(NUMBA_CACHE_DIR=str(folder)))
        assert out.startswith("8.0 ["), damage
        assert "tiny" in out, damage
        assert "compiling" in said, damage
        assert ended(start(NUMBA_CACHE_DIR=str(folder))) == ("8.0 []", ""), damage


def spoil(folder, kind, damage):
    """Damage the file of a kernel, of those that end in `kind`."""
    files = sorted(folder.rglob(f"*.{kind}"))
    (file,) = [path for path in files if "tiny.tiny" in path.name]
    (other,) = [path for path in files if path != file]
    whole = file.read_bytes()
    middle = len(whole) // 2
    file.write_bytes(
        {
            "empty": b"",
            "cut": whole[:middle],
            "one bit": whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :],
            "another's": other.read_bytes(),
            "no pickle": b"x" * len(whole),
        }[damage]
    )


def test_a_file_that_asks_for_a_module_that_is_gone_is_compiled_again(start, tmp_path):
    """As the kernel of a module that was loaded by its path; its digest is right."""
    (tmp_path / "go").touch()
    code = """
        import importlib.util, sys
        spec = importlib.util.spec_from_file_location("gone_by_now", "tiny.py")
        module = importlib.util.module_from_spec(spec)
        if sys.argv[1:]:
            sys.modules["gone_by_now"] = module
        spec.loader.exec_module(module)
        print(module.tiny(3.0))
    """
    for first in ("sys.argv.append('x');", "", ""):
        assert ended(start(f"import sys; {first}\n" + textwrap.dedent(code)))[0] == "8.0"


@pytest.mark.skipif(os.name != "posix", reason="needs modes of files")
@pytest.mark.parametrize("what", ["folder", "file"])
@pytest.mark.parametrize("fault", ["mode", "owner"])
def test_a_folder_or_file_of_somebody_else_is_refused_before_it_is_read(start, tmp_path, what, fault):
    (tmp_path / "go").touch()
    ended(start())
    index = next((tmp_path / "cache").rglob("*tiny.tiny*.nbi"))
    (tmp_path / "mark.py").write_text("print('ran')")
    index.write_bytes(b"cmark\n.")  # a pickle that imports
    victim = index.parent if what == "folder" else index
    if fault == "mode":
        victim.chmod(victim.stat().st_mode | 0o002)
    elif os.geteuid():
        pytest.skip("needs root")
    else:
        os.chown(victim, 65534, 65534)
    code = CALL_OR_SAY.format(read_only=False)
    out, _ = ended(start(code))
    assert "cannot be trusted, for it" in out
    assert ("writable by everybody" in out) == (fault == "mode")
    assert str(victim) in out
    assert "ran" not in out
    assert "NUMBA_CACHE_DIR" in out


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="needs root")
def test_the_remedy_of_folders_from_a_generous_umask_and_a_group_with_others_in_it_works(start, tmp_path):
    """As an older version left them under umask 002."""
    (tmp_path / "go").touch()
    ended(start())
    cache = tmp_path / "cache"
    for path in (cache, *cache.rglob("*")):
        os.chown(path, -1, 12345)
        path.chmod(path.stat().st_mode | 0o020)
    code = CALL_OR_SAY.format(read_only=False)
    out, _ = ended(start(code))
    assert "for it is writable by group 12345" in out
    remedy = f"chmod -R go-w {cache}"
    assert f"run `{remedy}` if all in it is yours" in out
    subprocess.run(remedy.split(), check=True)
    assert ended(start())[0] == "8.0 []"


@pytest.mark.skipif(os.name != "posix", reason="needs modes of files")
def test_what_is_made_here_is_closed_to_others_whatever_the_umask(start, tmp_path):
    (tmp_path / "go").touch()
    ended(start("import os; os.umask(0)\n" + CALL))
    made = [tmp_path / "cache", *(tmp_path / "cache").rglob("*")]
    assert not [path for path in made if path.stat().st_mode & 0o022 and path.suffix != ".lock"]
    assert ended(start())[0] == "8.0 []"


@pytest.mark.skipif(os.name != "posix", reason="needs groups")
@pytest.mark.parametrize(
    ("name", "members", "number", "is_ours"),
    [
        ("ann", [], 1000, True),
        ("ann", ["ann"], 1000, True),
        ("ann", ["ann", "ben"], 1000, False),
        (
            "staff",
            [],
            1000,
            False,
        ),  # the first group of all users of a system, whose list of members is empty
        ("ann", [], 1001, False),  # not the user's own
        ("root", [], 0, True),
    ],
)
def test_a_group_may_write_that_has_no_other_members(monkeypatch, name, members, number, is_ours):
    import grp
    import pwd

    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(pwd, "getpwuid", lambda _: SimpleNamespace(pw_name="ann", pw_gid=1000))
    monkeypatch.setattr(grp, "getgrgid", lambda _: SimpleNamespace(gr_name=name, gr_mem=members))
    assert trust._is_ours(number) is is_ours


@pytest.mark.skipif(os.name != "posix", reason="needs groups")
def test_root_lets_no_group_write(monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert not trust._is_ours(0)
