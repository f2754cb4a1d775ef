"""The house has one direction: a room imports only rooms above it in the table, and no modules import each
other in a circle.

Imports within functions count as well. Between rooms imports for types alone count, too; inside a room they
do not, as a function may name the type of its argument in a module that calls the function.
"""

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

FLOORS = (
    ("hoof_env/_version.py", "hoof_env/constants.py", "hoof_env/errors.py"),
    (
        "hoof_env/_collector.py",
        "hoof_env/_display.py",
        "hoof_env/_input.py",
        "hoof_env/_output.py",
        "hoof_env/_plotting.py",
    ),
    ("hoof_env/simd",),
    ("hoof_env/leg",),
    ("hoof_env/ground", "hoof_env/gait.py"),
    ("hoof_env/dynamics",),
    ("hoof_env/record",),
    ("hoof_env/paper_solver",),
    ("hoof_env/tasks",),
    ("hoof_env/render", "hoof_env/episodes"),
    ("hoof_env/envs", "hoof_env/__init__.py"),
    ("hoof_env/paper", "hoof_env/policies", "hoof_env/jax"),
    ("hoof_env/lab",),
    ("hoof_env/records.py",),
    ("hoof_env/film.py", "hoof_env/evaluation"),
    ("hoof_env/demo",),
    ("hoof_env/view",),
    ("hoof_env/commands",),
    ("hoof_env/cli.py",),
    ("hoof_env/__main__.py",),
    ("docs/_manual",),
    ("agents", "examples"),
    ("benchmarks",),
)
"""Rooms from the foundation up; rooms of one floor do not import each other. `import hoof_env` registers the
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


def is_for_types(node):
    """True for `if TYPE_CHECKING:`."""
    return isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")


def run_time_imports(path):
    """Modules that a file imports anywhere but for types alone."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for_types = {line for node in ast.walk(tree) if is_for_types(node) for line in lines_of(node.body)}
    return {module for module, line in imported(path) if line not in for_types}


def lines_of(body):
    """Line numbers of the statements of a block."""
    return range(body[0].lineno, body[-1].end_lineno + 1)


def circle_of(files):
    """Names of modules that import each other in a circle, [] if there is none.

    Args:
        files: paths by the dotted name of the module.
    """
    arrows = {name: run_time_imports(path) for name, path in files.items()}
    # An imported name is a module, or an attribute of the module before it.
    graph = {
        name: {each if each in files else each.rpartition(".")[0] for each in found} & files.keys() - {name}
        for name, found in arrows.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def module_name(path):
    """Dotted name of a file of this repository."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


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


def test_files_of_laboratories_need_no_pictures():
    imports = {module for path in files_of("hoof_env/lab") for module, _ in imported(path)}
    assert "hoof_env/render" not in {*map(room_of, imports)}


@pytest.mark.parametrize("room", FLOOR)
def test_modules_of_a_room_import_each_other_in_no_circle(room):
    assert circle_of({module_name(path): path for path in files_of(room)}) == []


def test_every_file_has_its_room():
    tops = ("hoof_env", "docs/_manual", "agents", "benchmarks", "examples")
    files = {path for top in tops for path in (ROOT / top).rglob("*.py")}
    assert files == {path for room in FLOOR for path in files_of(room)} | {ROOT / PUBLIC}


def test_it_can_fail(tmp_path):
    path = tmp_path / "module.py"
    path.write_text(
        "def f():\n    from hoof_env.episodes.batch import EpisodeBatch\n    import agents.train\n"
    )
    assert list(wrong_imports(path, "hoof_env/ground")) == [
        "module.py:2 imports hoof_env.episodes.batch.EpisodeBatch",
        "module.py:3 imports agents.train",
    ]
    assert not list(wrong_imports(path, "agents"))


def test_circles_are_found_also_within_functions_but_not_for_types(tmp_path):
    one, other = tmp_path / "one.py", tmp_path / "other.py"
    one.write_text("from room.other import f\n")
    for text, circle in (
        ("def f():\n    import room.one\n", {"room.one", "room.other"}),
        ("from room import one\n", {"room.one", "room.other"}),
        ("if TYPE_CHECKING:\n    from room.one import A\n", set()),
    ):
        other.write_text(text)
        assert {*circle_of({"room.one": one, "room.other": other})} == circle
