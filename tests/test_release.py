"""What a release needs: one version everywhere, files that the forge reads, and what is to be filled in."""

import re
import subprocess
import sys
import tarfile
import tomllib
from pathlib import Path

import pytest
import yaml

import hoof_env

ROOT = Path(__file__).resolve().parent.parent
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_citation_is_of_this_version_and_licence():
    assert CITATION["version"] == hoof_env.__version__
    assert CITATION["license"] == PROJECT["license"]
    assert [one["name"] for one in CITATION["authors"]] == [one["name"] for one in PROJECT["authors"]]
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert all(one["doi"] in readme for one in CITATION["references"])


def test_the_changelog_begins_with_this_version():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.search(r"^## \[(.+?)\]", text, re.MULTILINE)[1] == hoof_env.__version__


def test_the_address_of_the_repository_is_filled_in_everywhere_or_nowhere():
    """Skipped, with the places named, as long as it is known nowhere."""
    places = {
        "pyproject.toml: [project.urls] Repository": PROJECT.get("urls", {}).get("Repository"),
        "CITATION.cff: repository-code": CITATION.get("repository-code"),
    }
    if not any(places.values()):
        pytest.skip("to fill in before a release: " + "; ".join(places))
    assert len(set(places.values())) == 1, f"expected one address in all places, got {places}"


def test_workflows_and_templates_are_whole():
    """Each job has steps, and runs make's targets, scripts and examples that exist."""
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for path in (ROOT / ".github" / "workflows").glob("*.yml"):
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        for name, job in content["jobs"].items():
            assert job["steps"], (path.name, name)
            for step in job["steps"]:
                command = step.get("run", "")
                assert set(re.findall(r"\bmake ([a-z-]+)", command)) <= targets, command
                assert all((ROOT / one).is_file() for one in re.findall(r"python (\S+\.py)", command)), (
                    command
                )
    tested = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8"))
    supported = {line.rsplit(" ", 1)[1] for line in PROJECT["classifiers"] if "Python :: 3." in line}
    assert set(tested["jobs"]["make"]["strategy"]["matrix"]["python"]) == supported
    for path in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"):
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        assert path.name == "config.yml" or {"name", "description", "body"} <= set(content)


def test_the_source_archive_holds_what_the_wheel_is_made_of(tmp_path):
    build = [sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as content:
        names = {name.partition("/")[2] for name in content.getnames()}
    sources = {path.relative_to(ROOT).as_posix() for path in (ROOT / "hoof_env").rglob("*.py")}
    assert sources <= names
    assert {
        "README.md",
        "LICENSE",
        "CHANGELOG.md",
        "CITATION.cff",
        "constraints.txt",
        "pyproject.toml",
    } <= names
    assert not any(name.startswith(("docs/", "tests/", "agents/")) for name in names)
    assert archive.stat().st_size < 1e6
