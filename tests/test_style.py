"""How the code is written, counted: each count may fall and not rise.

A number in `MOST` is lowered in the commit that makes it smaller. `python tests/test_style.py` prints the
counts, `python tests/test_style.py packed` the places of one.
"""

import ast
import re
import sys
import tokenize
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("hoof_env", "agents")
LONGEST_FUNCTION, LONGEST_CLASS, LONGEST_FILE = 60, 250, 450
MOST_PARAMETERS, MOST_OF_KERNELS = 8, 12

MOST = {
    "packed": 25,
    "unformatted": 5,
    "fragments": 0,
    "people": 0,
    "long_functions": 0,
    "long_classes": 0,
    "long_files": 0,
    "many_parameters": 6,
    "leg_or_horse": 0,
}
"""Largest counts."""

LEAST_COMMENTS = 0.02
"""Least share of lines with a comment that is not for a tool."""

Place = tuple[Path, int, str]


@cache
def sources() -> dict[Path, str]:
    """The Python files of the packages."""
    files = [path for name in PACKAGES for path in sorted((ROOT / name).rglob("*.py"))]
    return {path: path.read_text(encoding="utf-8") for path in files}


@cache
def every_node() -> list[tuple[Path, ast.AST]]:
    """All nodes of all files."""
    return [(path, node) for path, text in sources().items() for node in ast.walk(ast.parse(text))]


def nodes(*kinds: type[ast.AST]) -> Iterator[tuple[Path, ast.AST]]:
    """Nodes of some kinds in all files."""
    yield from ((path, node) for path, node in every_node() if isinstance(node, kinds))


def packed() -> Iterator[Place]:
    """Tuples of expressions that are assigned to tuples; swaps and recurrences need one."""
    for path, node in nodes(ast.Assign):
        target, value = node.targets[0], node.value
        if not (isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple)):
            continue
        given = {ast.unparse(each) for each in target.elts}
        read = {ast.unparse(inner) for inner in ast.walk(value) if isinstance(inner, ast.expr)}
        if not given & read:
            yield path, node.lineno, ast.unparse(node)


def unformatted() -> Iterator[Place]:
    """Places where formatting is switched off."""
    for path, text in sources().items():
        for number, line in enumerate(text.splitlines(), 1):
            if re.search(r"# fmt: (skip|off)", line):
                yield path, number, line.strip()


def docstrings() -> Iterator[Place]:
    """All docstrings, those of constants and fields included."""
    for path, node in nodes(ast.Module, ast.ClassDef, ast.FunctionDef):
        for before, each in zip([None, *node.body], node.body, strict=False):
            is_text = isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant)
            if is_text and isinstance(each.value.value, str):
                is_first = before is None
                if is_first or isinstance(before, (ast.Assign, ast.AnnAssign)):
                    yield path, each.lineno, each.value.value.strip()


def fragments() -> Iterator[Place]:
    """Docstrings without a subject."""
    for path, line, text in docstrings():
        if re.match(r"(Of|What|Whether|Who|Which|Where|How)\b", text):
            yield path, line, text.splitlines()[0]


def people() -> Iterator[Place]:
    """Words for persons where the subject is a program, and other words that engineers do not use; a name in
    quotation marks is no word."""
    words = r"(?<![\"`])\b(who|nobody|somebody|whoever|heed|heeds|beside|hoofs)\b"
    for path, line, text in docstrings():
        for found in re.finditer(words, text):
            yield path, line, found[0]


def long_functions() -> Iterator[Place]:
    """Functions that are too long, their docstrings included."""
    for path, node in nodes(ast.FunctionDef):
        if lines_of(node) > LONGEST_FUNCTION:
            yield path, node.lineno, f"{node.name}: {lines_of(node)}"


def long_classes() -> Iterator[Place]:
    """Classes that are too long."""
    for path, node in nodes(ast.ClassDef):
        if lines_of(node) > LONGEST_CLASS:
            yield path, node.lineno, f"{node.name}: {lines_of(node)}"


def long_files() -> Iterator[Place]:
    """Files that are too long."""
    for path, text in sources().items():
        if len(text.splitlines()) > LONGEST_FILE:
            yield path, 1, f"{len(text.splitlines())}"


def lines_of(node: ast.FunctionDef | ast.ClassDef) -> int:
    """Lines from the first to the last."""
    return (node.end_lineno or node.lineno) - node.lineno + 1


def many_parameters() -> Iterator[Place]:
    """Functions with too many positional parameters; kernels may have more."""
    for path, node in nodes(ast.FunctionDef):
        arguments = node.args
        count = len(arguments.posonlyargs) + len(arguments.args)
        is_kernel = any("inline" in ast.unparse(each) for each in node.decorator_list)
        is_kernel |= "no-untyped-def" in sources()[path].splitlines()[node.lineno - 1]
        if count > (MOST_OF_KERNELS if is_kernel else MOST_PARAMETERS):
            yield path, node.lineno, f"{node.name}: {count}"


def leg_or_horse() -> Iterator[Place]:
    """Branches on whether a body is a leg or a horse."""
    pattern = r"is_horse|of_horse|\blegs (>|==|!=|<) 1\b|^(not )?(\(?\w+ := )?([\w()]+\.)*hips\)?$"
    for path, node in nodes(ast.If, ast.IfExp, ast.While):
        test = ast.unparse(node.test)
        if re.search(pattern, test):
            yield path, node.lineno, test


def comments() -> float:
    """The share of lines that have a comment for readers on a line of its own, or explain a statement."""
    count, lines = 0, 0
    for path, text in sources().items():
        lines += sum(bool(line.strip()) for line in text.splitlines())
        with path.open("rb") as file:
            for token in tokenize.tokenize(file.readline):
                is_for_tools = re.match(r"#\s*(type:|noqa|fmt:|pragma|mypy|ruff)", token.string)
                if token.type == tokenize.COMMENT and not is_for_tools and token.line.strip().startswith("#"):
                    count += 1
    return count / lines


COUNTS: dict[str, Callable[[], Iterator[Place]]] = {
    count.__name__: count
    for count in (
        packed,
        unformatted,
        fragments,
        people,
        long_functions,
        long_classes,
        long_files,
        many_parameters,
        leg_or_horse,
    )
}


@pytest.mark.parametrize("name", COUNTS)
def test_counts_only_fall(name):
    places = [f"{path.relative_to(ROOT)}:{line}: {text}" for path, line, text in COUNTS[name]()]
    assert len(places) <= MOST[name], "\n".join(places)


def test_comments_do_not_become_fewer():
    assert comments() >= LEAST_COMMENTS


if __name__ == "__main__":
    for name, count in COUNTS.items():
        if name in sys.argv[1:]:
            for path, line, text in count():
                print(f"{path.relative_to(ROOT)}:{line}: {text}")
        elif len(sys.argv) == 1:
            print(name, len(list(count())))
    print("comments", round(comments(), 4))
