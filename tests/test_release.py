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
from scripts.check_release import unfilled

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


def release(root, urls="", email="", cited=""):
    """Files of a project with an address in `[project.urls]`, an e-mail and an address in CITATION.cff."""
    table = f'urls = {{ Repository = "{urls}" }}\n' if urls else ""
    author = f', email = "{email}"' if email else ""
    (root / "pyproject.toml").write_text(f'[project]\n{table}authors = [{{ name = "x"{author} }}]\n')
    (root / "CITATION.cff").write_text("title: x\n" + (f"repository-code: {cited}\n" if cited else ""))
    return root


def test_addresses_of_the_repository_agree():
    """pyproject.toml and CITATION.cff hold it both; nowhere is right until the first release."""
    assert not [place for place in unfilled() if place.startswith("one address")]


def test_all_that_a_release_needs_is_filled_in():
    """Skipped with the places named; the workflow that publishes fails instead."""
    if places := unfilled():
        pytest.skip("to fill in before a release: " + "; ".join(places))


def test_missing_facts_of_a_release_are_found(tmp_path):
    assert [place.split(":")[0] for place in unfilled(release(tmp_path))] == [
        "pyproject.toml", "CITATION.cff", "pyproject.toml",
    ]  # fmt: skip
    whole = {"urls": "https://x.org/a", "email": "a@x.org", "cited": "https://x.org/a"}
    assert unfilled(release(tmp_path, **whole)) == []
    assert unfilled(release(tmp_path, **whole | {"email": ""})) == [
        "pyproject.toml: [project] authors, e-mail"
    ]
    (unlike,) = unfilled(release(tmp_path, **whole | {"cited": "https://x.org/b"}))
    assert unlike.endswith("got https://x.org/a and https://x.org/b")


def test_publishing_checks_that_before_it_builds():
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "publish.yml").read_text(encoding="utf-8"))
    jobs = workflow["jobs"]
    steps = [step.get("run", "") for step in jobs["build"]["steps"]]
    assert steps.index("python scripts/check_release.py") < steps.index("python -m build")
    assert jobs["publish"]["needs"] == "build"
    script = [sys.executable, "scripts/check_release.py"]
    done = subprocess.run(script, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode == 0) == (unfilled() == [])
    assert len(done.stderr.splitlines()) == len(unfilled())


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
