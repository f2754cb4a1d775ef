"""Notebooks run from top to bottom, show what they end with, and are committed without results."""

import ast
import json
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
NEEDED = {"paper": ("bokeh", "matplotlib"), "train": ("bokeh", "matplotlib", "stable_baselines3")}


def cells(path):
    return json.loads(path.read_text(encoding="utf-8"))["cells"]


def test_there_are_two():
    assert {path.stem for path in NOTEBOOKS} == set(NEEDED)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_cleared_and_begins_with_its_installation(path):
    code = [cell for cell in cells(path) if cell["cell_type"] == "code"]
    assert not any(cell["outputs"] or cell["execution_count"] for cell in code)
    first = "".join(code[0]["source"])
    assert first.startswith('%pip install -q "hoof-env[')
    assert len(first.splitlines()) == 1


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_top_to_bottom(path, tmp_path, monkeypatch):
    for library in NEEDED[path.stem]:
        pytest.importorskip(library)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    names, shown = {}, []
    for cell in cells(path):
        source = "".join(cell["source"])
        if cell["cell_type"] != "code" or source.startswith("%"):
            continue
        tree = ast.parse(source)
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, path.name, "exec"), names)
        if last is not None:  # what a notebook shows below its cell
            shown.append(eval(compile(ast.Expression(last.value), path.name, "eval"), names))
    rich = [one for one in shown if hasattr(one, "_repr_html_")]
    assert any((one._repr_html_() or "").startswith("<iframe") for one in rich)
    assert not [one for one in shown if one is not None and " at 0x" in repr(one) and one not in rich]
