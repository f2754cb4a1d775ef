"""Rooms import from their left only: leg and ground, gait, dynamics, envs, and what stands at the end."""

import ast
from pathlib import Path

import pytest

import hoof_env

PACKAGE = Path(hoof_env.__file__).parent
ORDER = (
    {"_lanes"}, {"leg", "ground"}, {"gait"}, {"dynamics"}, {"envs"}, {"export"}, {"paper"}, {"identify"},
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


def test_every_room_has_its_place():
    rooms = {path.name for path in PACKAGE.iterdir() if path.is_dir() and any(path.glob("*.py"))}
    assert rooms == set(RANK)


def test_it_can_fail(tmp_path):
    path = tmp_path / "module.py"
    path.write_text("def f():\n    from hoof_env.envs.batch import EpisodeBatch\n")
    assert list(imported(path)) == [("envs", 2)]
