"""The house has one direction: what stands further down may import what stands further up, and nothing else.

Imports within functions and for types count as well.
"""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

FLOORS = (
    ("hoof_env/_version.py", "hoof_env/constants.py", "hoof_env/errors.py"),
    ("hoof_env/_collector.py", "hoof_env/_output.py", "hoof_env/_plotting.py"),
    ("hoof_env/simd",),
    ("hoof_env/leg",),
    ("hoof_env/ground", "hoof_env/gait.py"),
    ("hoof_env/dynamics",),
    ("hoof_env/record",),
    ("hoof_env/eq8",),
    ("hoof_env/tasks",),
    ("hoof_env/render",),
    ("hoof_env/envs", "hoof_env/__init__.py"),
    ("hoof_env/paper", "hoof_env/policies"),
    ("hoof_env/lab",),
    ("hoof_env/records.py",),
    ("hoof_env/film.py", "hoof_env/evaluation"),
    ("hoof_env/demo",),
    ("hoof_env/view",),
    ("hoof_env/commands",),
    ("hoof_env/cli.py",),
    ("hoof_env/__main__.py",),
    ("agents", "examples"),
    ("benchmarks",),
)
"""Rooms from the foundation up; those of a floor do not import each other. `import hoof_env` registers the
environments, so it stands beside them, although by name it has everything."""

FLOOR = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}
NAMES = {room.removesuffix(".py").replace("/", "."): room for room in FLOOR}
PUBLIC = "hoof_env/__init__.py"


def room_of(module):
    """The room of a module of this repository by its dotted name, or None."""
    if module == "hoof_env":
        return PUBLIC
    fits = [name for name in NAMES if module == name or module.startswith(f"{name}.")]
    return NAMES[max(fits, key=len)] if fits else None


def imported(path):
    """Modules that a file imports anywhere, with the line."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)


def files_of(room):
    path = ROOT / room
    return [path] if path.is_file() else sorted(path.rglob("*.py"))


def wrong_imports(path, room):
    """Imports of a file that go back up, or across a floor."""
    for module, line in imported(path):
        other = room_of(module)
        if other and other != room and FLOOR[other] >= FLOOR[room]:
            yield f"{path.name}:{line} imports {module}"


@pytest.mark.parametrize("room", FLOOR)
def test_a_room_imports_what_stands_above_it(room):
    if room != PUBLIC:  # what it names is loaded when somebody asks for it
        assert [wrong for path in files_of(room) for wrong in wrong_imports(path, room)] == []


def test_every_file_has_its_room():
    tops = ("hoof_env", "agents", "benchmarks", "examples")
    files = {path for top in tops for path in (ROOT / top).rglob("*.py")}
    assert files == {path for room in FLOOR for path in files_of(room)} | {ROOT / PUBLIC}


def test_it_can_fail(tmp_path):
    path = tmp_path / "module.py"
    path.write_text("def f():\n    from hoof_env.envs.batch import EpisodeBatch\n    import agents.train\n")
    assert list(wrong_imports(path, "hoof_env/ground")) == [
        "module.py:2 imports hoof_env.envs.batch.EpisodeBatch",
        "module.py:3 imports agents.train",
    ]
    assert not list(wrong_imports(path, "agents"))
