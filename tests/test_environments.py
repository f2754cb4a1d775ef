"""Two commits are compared each with its own packages: which environment that is, and when there is none."""

import re
import sys
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import pytest

from scripts import environments
from scripts.environments import Asked, NoEnvironment

ROOT = Path(__file__).resolve().parent.parent

INSTALLED = [f"{name}=={metadata.version(name)}" for name in ("numpy", "gymnasium")]


@pytest.fixture
def checkout(tmp_path):
    """A function that writes what a commit depends on."""

    def write(name="base", dependencies=("gymnasium>=1",), pins=INSTALLED, **extras):
        tree = tmp_path / name
        tree.mkdir()
        optional = "".join(f"{extra} = {list(needs)}\n" for extra, needs in extras.items())
        text = f"[project]\ndependencies = {list(dependencies)}\n[project.optional-dependencies]\n{optional}"
        (tree / "pyproject.toml").write_text(text)
        (tree / "constraints.txt").write_text("# tested\n" + "\n".join(pins) + "\n")
        return tree

    return write


@pytest.fixture
def made(monkeypatch, tmp_path):
    """Keys of the environments that are made, in a folder for tests."""
    keys = []

    def make(asked, place):
        keys.append(place.name)
        return f"python of {asked.tree.name}"

    monkeypatch.setattr(environments, "MADE", tmp_path / "environments")
    monkeypatch.setattr(environments, "made", make)
    return keys


# Which environment


def test_what_both_commits_need_is_here(checkout, made):
    before, after = environments.environments(checkout(), checkout("now"))
    assert before == after
    assert before.python == sys.executable
    assert not made


def test_each_has_its_own_where_one_is_not_here(checkout, made):
    now = checkout("now", dependencies=["gymnasium>=1", "no-such-package"])
    before, after = environments.environments(checkout(), now)
    assert (before.python, after.python) == ("python of base", "python of now")
    assert made == [before.key, after.key]
    assert before.key != after.key


def test_commits_that_agree_share_one(checkout):
    key = Asked.of(checkout(), ()).key
    reordered = checkout("reordered", pins=[*INSTALLED[::-1], "", "# more", "ruff==1 ; python_version < '3'"])
    assert Asked.of(reordered, ()).key == key
    others = [
        checkout("pin", pins=[*INSTALLED, "tyro==1.0"]),
        checkout("requirement", dependencies=["gymnasium>=1", "tyro"]),
        extra := checkout("extra", render=["pygame-ce"]),
    ]
    keys = {Asked.of(tree, ("render",)).key for tree in others}
    assert len(keys | {key}) == 4
    assert Asked.of(extra, ()).key == key


def test_an_extra_that_a_commit_lacks_is_left_out(checkout):
    asked = Asked.of(checkout(render=["pygame-ce>=2"]), ("view", "render"))
    assert asked.requirements == ("gymnasium>=1", "pygame-ce>=2")


# What is installed


def test_a_dependency_of_another_version_counts(checkout):
    """NumPy is not asked for here, but Gymnasium needs it."""
    assert Asked.of(checkout(), ()).is_installed()
    assert not Asked.of(checkout("other", pins=["numpy==0.1", INSTALLED[1]]), ()).is_installed()
    assert not Asked.of(checkout("newer", dependencies=["gymnasium>=1000"]), ()).is_installed()


def test_a_build_and_markers_are_reported_apart(checkout, monkeypatch):
    packages = {
        "torch": ("2.13.0+cpu", ["absent; python_version < '3'", "absent; extra == 'cuda'", "part[fast]"]),
        "part": ("1.0", ["fast-part; extra == 'fast'"]),
        "fast-part": ("3.0", None),
    }

    def distribution(name):
        if name not in packages:
            raise metadata.PackageNotFoundError(name)
        return SimpleNamespace(version=packages[name][0], requires=packages[name][1])

    monkeypatch.setattr(metadata, "distribution", distribution)
    pins = ["torch==2.13.0", "fast_part==3.0"]
    assert Asked.of(checkout(dependencies=["torch"], pins=pins), ()).is_installed()
    assert not Asked.of(checkout("cuda", dependencies=["torch[cuda]"], pins=pins), ()).is_installed()
    pins[1] = "fast_part==4.0"
    assert not Asked.of(checkout("other", dependencies=["torch"], pins=pins), ()).is_installed()


# When there is none


def test_two_numpys_are_refused_by_their_versions(checkout, made):
    base, now = checkout(pins=["numpy==2.3.1"]), checkout("now", pins=["numpy==2.4.6"])
    with pytest.raises(NoEnvironment, match=r"one version of NumPy .*got 2\.3\.1 in .*and 2\.4\.6 in "):
        environments.environments(base, now)
    with pytest.raises(NoEnvironment, match="got none in"):
        environments.environments(checkout("old", pins=[]), checkout("older", pins=[]))
    assert not made


@pytest.mark.parametrize("name", environments.NEEDED)
def test_a_checkout_that_does_not_say_what_it_needs_is_refused(checkout, made, name):
    base, now = checkout(), checkout("now")
    (base / name).unlink()
    with pytest.raises(NoEnvironment, match=f"expected {name} .*checkout"):
        environments.environments(base, now)


SET_UP = """
import sys
from pathlib import Path

place = Path(__file__).parent.parent
texts = [(place / name).read_text() for name in ("pyproject.toml", "constraints.txt")]
(place / "asked").write_text("\\n".join([*sys.argv[1:], *texts]))
print("a step")
sys.exit("{name}" == "broken")
"""


@pytest.fixture
def set_up(monkeypatch, tmp_path):
    """A function that puts a set-up in the place of the true one."""

    def replace(name):
        (tmp_path / "setup_venv.py").write_text(SET_UP.format(name=name))
        monkeypatch.setattr(environments, "HERE", tmp_path)

    return replace


def test_set_up_makes_what_the_commit_asks_for(checkout, set_up, tmp_path, capfd):
    set_up("whole")
    place = tmp_path / "made"
    python = environments.made(Asked.of(checkout(render=["pygame-ce"]), ("render",)), place)
    assert python == str(place / ".venv" / "bin" / "python")
    first = (place / "asked").read_text()
    assert first.splitlines() == [
        "dependencies", "[project]", 'dependencies = ["gymnasium>=1", "pygame-ce"]', "", *sorted(INSTALLED)
    ]  # fmt: skip
    out, said = capfd.readouterr()
    assert not out  # it may be a table
    assert "base go to" in said
    assert "a step" in said
    # A commit that agrees in these finds the same files, whatever else its own say
    other = checkout("other", ["pygame-ce", "gymnasium>=1"], INSTALLED[::-1], lab=["ezc3d"])
    environments.made(Asked.of(other, ()), place)
    assert (place / "asked").read_text() == first


def test_a_set_up_that_stops_is_reported(checkout, set_up, tmp_path):
    set_up("broken")
    with pytest.raises(NoEnvironment, match="but set-up stopped"):
        environments.made(Asked.of(checkout(), ()), tmp_path / "made")


def test_this_checkout_says_what_it_needs():
    asked = Asked.of(ROOT, ("train",))
    names = {re.split("[>=]", line)[0] for line in asked.requirements}
    assert {"numpy", "gymnasium", "torch"} <= names <= set(asked.pins)
