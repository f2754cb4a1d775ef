"""Rooms import from their left only: leg and ground, gait, dynamics, envs, and what stands at the end."""

import ast
from pathlib import Path

import pytest

import hoof_env

PACKAGE = Path(hoof_env.__file__).parent
ORDER = (
    {"simd"}, {"leg", "ground"}, {"gait"}, {"dynamics"}, {"render"}, {"envs"}, {"export"}, {"paper"},
)  # fmt: skip
AT_THE_END = {"cli.py", "play.py", "records.py", "__init__.py", "__main__.py"}
"""Modules that use the public names as any user would."""

RANK = {room: rank for rank, rooms in enumerate(ORDER) for room in rooms}


def imported(path):
    """Rooms of this package that a module imports when it is loaded, with the line; types are no import."""
    tree = ast.parse(path.read_text())
    for_types = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for inner in ast.walk(node)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node not in for_types and node.module:
            parts = node.module.split(".")
            names = [parts[1]] if len(parts) > 1 else [alias.name for alias in node.names]
            if parts[0] == "hoof_env":
                yield from ((name, node.lineno) for name in names if name in RANK)


@pytest.mark.parametrize("room", sorted(RANK))
def test_a_room_imports_from_its_left(room):
    wrong = [
        f"{path.relative_to(PACKAGE)}:{line} imports {name}"
        for path in (PACKAGE / room).rglob("*.py")
        for name, line in imported(path)
        if RANK[name] > RANK[room]
    ]
    assert not wrong


def everything_imported(path):
    """Top-level modules that a module imports anywhere, also within functions, with the line."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name.split(".")[0], node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module.split(".")[0], node.lineno


def test_nothing_imports_what_only_the_repository_has(tmp_path):
    """Under those names a user has modules of somebody else."""
    wrong = [
        f"{path.relative_to(PACKAGE)}:{line} imports {name}"
        for path in PACKAGE.rglob("*.py")
        for name, line in everything_imported(path)
        if name in {"agents", "benchmarks", "research", "scripts", "tests"}
    ]
    assert not wrong
    (tmp_path / "module.py").write_text("def f():\n    import agents.runs\n    from agents import runs\n")
    assert list(everything_imported(tmp_path / "module.py")) == [("agents", 2), ("agents", 3)]


def test_every_room_has_its_place():
    rooms = {path.name for path in PACKAGE.iterdir() if path.is_dir() and any(path.glob("*.py"))}
    assert rooms == set(RANK)


def test_it_can_fail(tmp_path):
    path = tmp_path / "module.py"
    path.write_text("def f():\n    from hoof_env.envs.batch import EpisodeBatch\n")
    assert list(imported(path)) == [("envs", 2)]
