"""The demonstration on tiny numbers: one page that needs nothing else, and an older one that survives."""

import base64
import json
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from agents import demo
from hoof_env.demo import demo as shared
from hoof_env.evaluation.scores import METRICS, evaluate
from hoof_env.paper import figures
from hoof_env.paper.reproduce import SOLVERS
from hoof_env.paper.rows import load_published

ROOT = Path(__file__).parents[2]


class Page(HTMLParser):
    """What a page links to, its ids, its text, and the rows of its tables by the table's id."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.text = ""
        self.tables: dict[str, list[list[str]]] = {}
        self.in_cell = False
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.tags.append(tag)
        self.ids += [attributes["id"]] if "id" in attributes else []
        self.links += [attributes[key] for key in ("src", "href", "poster", "data") if key in attributes]
        if tag == "table":
            self.rows = self.tables[attributes["id"]] = []
        elif tag == "tr":
            self.rows.append([])
        elif tag in ("td", "th"):
            self.rows[-1].append("")
            self.in_cell = True

    def handle_endtag(self, tag):
        if tag in ("td", "th"):
            self.in_cell = False

    def handle_data(self, data):
        self.text += data
        if self.in_cell:
            self.rows[-1][-1] += f" {data.strip()}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory, reproduction, drawn) -> Path:
    out = tmp_path_factory.mktemp("runs") / "demo"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shared, "reproduce", lambda say: reproduction)
        patch.setattr(figures, "draw_all", lambda _, stage: shutil.copytree(drawn, stage, dirs_exist_ok=True))
        assert demo.demo(demo.Args(out=out, quick=True)) == out / "report.html"
    return out


@pytest.fixture(scope="module")
def html(folder) -> str:
    return (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def report(html) -> Page:
    return Page(html)


def test_nothing_is_fetched_from_outside(html, report):
    assert "script" not in report.tags
    assert "link" not in report.tags
    assert report.links
    for link in report.links:
        kind, content = re.fullmatch(r"data:([a-z0-9/+]+);base64,(.+)", link).groups()
        decoded = base64.b64decode(content, validate=True)
        if kind == "image/svg+xml":  # a picture may not reach out either
            outside = re.findall(rb"(?:href|src)\s*=\s*[\"'](?!#|data:)([^\"']*)", decoded)
            assert not outside, outside
    assert not re.search(r"url\(|@import", html)
    assert "</html>" in html


def test_every_published_number_stands_beside_both_solvers(folder, report):
    published = load_published()
    entries = json.loads((folder / "reproduction.json").read_text())
    shown = {row[0].split()[-1]: row for row in report.tables["reproduction"] if len(row) == 2 + len(SOLVERS)}
    for row in published.rows:
        simulated = [e for e in entries if e["kind"] == "row" and e["id"] == row.id]
        assert [e["solver"] for e in simulated] == list(SOLVERS)
        _, printed, *cells = shown[row.id]
        assert float(printed.split()[0]) == pytest.approx(row.value, abs=0.051)
        assert row.bar_text in printed
        for cell, entry in zip(cells, simulated, strict=True):
            assert float(cell.split()[0]) == pytest.approx(entry["simulated"], abs=0.051)
            assert ("✓" in cell, "✗" in cell) == (entry["within_bar"] is True, entry["within_bar"] is False)
            assert ("†" in cell) is (entry["spared"] == "not determinable")
    for claim in published.claims:
        assert claim.id in report.ids


def test_scores_on_the_page_agree_with_the_file(folder, report):
    data = json.loads((folder / "scores.json").read_text())
    rows = {row[0].strip(): row[1:] for row in report.tables["scores"][1:]}
    assert set(rows) == set(data["policies"]) == {*demo.SCRIPTED, demo.TRAINED}
    for name, policy in data["policies"].items():
        for (key, mean), cell in zip(policy["mean"].items(), rows[name], strict=True):
            metric = METRICS[key]
            expected = "∞" if mean is None else f"{mean * metric.factor:.{metric.digits}f}"
            assert cell.split()[0] == expected


def test_pictures_films_and_versions_of_a_quick_run(report):
    assert "Quick run." in report.text
    packages = ("numpy", "gymnasium", "llvmlite", "stable-baselines3", "torch", "hoof-env")
    for word in ("python 3.", *(f"{package} " for package in packages)):
        assert word in report.text
    assert {"figure1", "figure3", "figure4", "figure5", "figure6", "curve"} <= set(report.ids)
    assert report.tags.count("video") == 5
    assert sum(link.startswith("data:video/mp4;base64,") for link in report.links) == 5


def test_the_agent_of_the_report_can_be_played(folder):
    found = evaluate([str(folder)], episodes=2, seed=demo.FIRST_SEED)
    (score,) = found.scores
    data = json.loads((folder / "scores.json").read_text())
    assert found.env_id == data["env_id"]
    shown = [episode["return"] for episode in data["policies"][demo.TRAINED]["episodes"]]
    np.testing.assert_allclose([episode["return"] for episode in score.episodes], shown, rtol=1e-6)


@pytest.mark.parametrize("failure", [KeyboardInterrupt(), RuntimeError("broken")])
def test_a_failed_run_leaves_the_older_report(folder, monkeypatch, failure):
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert not [name for name in before if name.startswith(".")]

    def fail(reproduction, stage, **_):
        (stage / "walk.mp4").touch()
        raise failure

    monkeypatch.setattr(shared, "reproduce", lambda say: None)
    monkeypatch.setattr(shared, "write_reproduction", fail)
    with pytest.raises(type(failure)):
        demo.demo(demo.Args(out=folder, quick=True))
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_interrupted_from_the_keyboard_says_one_line(tmp_path):
    """The signal comes while the first step is at work."""
    code = (
        "import os, signal, sys; from agents import command, demo; from hoof_env.demo import demo as shared;"
        "shared.reproduce = lambda say: os.kill(os.getpid(), signal.SIGINT);"
        "sys.argv = ['demo', '--out', sys.argv[1], '--quick']; command.run(demo.main)"
    )
    out = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    assert out.returncode == 130
    assert out.stderr.split() == ["interrupted"]
