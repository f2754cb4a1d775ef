import copy
import dataclasses
import json
import re

import pytest

from hoof_env.errors import OutputError
from hoof_env.paper.study import page
from hoof_env.paper.study.findings import findings

PARTS = ["numerics", "laws", "sensitivity", "slips", "claims"]


@pytest.fixture(scope="module")
def result(reproduction, few_points):
    """The real study with few points, each figure replaced by one that is quick to draw."""
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure

    def quick():
        """A small figure."""
        return Figure(figsize=(1, 1))

    lines = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page, "reproduce", lambda tell, preset: reproduction)
        study = page.study(lines.append)
    assert len(lines) > len(PARTS)
    sections = {
        name: dataclasses.replace(section, figures=dict.fromkeys(section.figures, quick))
        for name, section in study.sections.items()
    }
    return page.Study(study.reproduction, sections)


@pytest.fixture(scope="module")
def written(result, tmp_path_factory):
    folder = tmp_path_factory.mktemp("docs")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("hoof_env.paper.figures.draw_all", _empty_figures)
        paths = page.write_study(result, folder, command="hoof-env reproduce --study --out docs")
    assert sorted(paths) == sorted(p for p in folder.rglob("*") if p.is_file())
    return folder


def _empty_figures(_, folder, *__):
    for name in page.FIGURES:
        for suffix in ("png", "svg"):
            (folder / f"{name}.{suffix}").write_bytes(b"")


@pytest.fixture(scope="module")
def text(written):
    return (written / "paper.md").read_text(encoding="utf-8")


def test_one_page_and_everything_else_in_the_folder_beside_it(written, result):
    assert {p.name for p in written.iterdir()} == {"paper.md", "paper"}
    names = {p.name for p in (written / "paper").iterdir()}
    assert {"study.json", "reproduction.json", "reproduction.md", "figure5.png", "figure5.svg"} <= names
    for section in result.sections.values():
        assert {f"{name}.{suffix}" for name in section.figures for suffix in ("png", "svg")} <= names


def test_every_link_leads_somewhere_and_every_figure_is_shown_once(written, text, result):
    targets = re.findall(r"\]\(([^)]+)\)", text)
    assert all((written / target).is_file() for target in targets)
    shown = re.findall(r"!\[[^\]]+\]\(paper/([\w-]+)\.png\)", text)
    expected = [name for section in result.sections.values() for name in section.figures]
    assert sorted(shown) == sorted([*expected, *page.FIGURES])


def test_the_page_names_leg_command_and_parts_in_order(text, result):
    assert f"preset `{result.reproduction.geometry.name}`" in text
    assert "identified leg" in text
    assert "`hoof-env reproduce --study --out docs`" in text
    assert list(result.sections) == PARTS
    heads = re.findall(r"^## (.+)$", text, re.M)
    assert heads[0] == "Findings"
    assert heads[1:6] == [f"{k}. {s.title}" for k, s in enumerate(result.sections.values(), 1)]


def test_the_numbers_are_kept(written, result):
    data = json.loads((written / "paper" / "study.json").read_text(encoding="utf-8"))
    assert list(data) == PARTS
    assert all(data[name]["title"] == section.title for name, section in result.sections.items())


def test_without_figures_the_page_links_to_none(result, tmp_path):
    page.write_study(result, tmp_path, figures=False)
    text = (tmp_path / "paper.md").read_text(encoding="utf-8")
    assert not {file.suffix for file in (tmp_path / "paper").iterdir()} & {".png", ".svg"}
    assert ".png" not in text
    assert all((tmp_path / target).is_file() for target in re.findall(r"\]\(([^)]+)\)", text))


def data_of(result):
    return {name: copy.deepcopy(section.data) for name, section in result.sections.items()}


def test_findings_count_what_the_parts_found(result):
    lines = findings(result.reproduction, data_of(result))
    assert len(lines) == 7
    claims, slips = (result.sections[name].data[name] for name in ("claims", "slips"))
    assert any(f"{len(slips)} slips" in line for line in lines)
    assert any(f"{len(claims)} claims" in line for line in lines)


def test_a_leg_without_a_feature_has_moved_where_only_one_solver_sees_it(result):
    data = data_of(result)
    rows = data["numerics"]["rows"]
    for values in rows.values():
        values["printed"] = values["probable"] = [values["exact"]] * 4
    rows["walk.angle_flat"] |= {"exact": None, "printed": [None] * 4}  # with the printed beta too
    rows["walk.angle_variation"] |= {"exact": None}  # this row has no bar
    assert "moves 0 rows (printed β) and 1 rows (probable β)" in findings(result.reproduction, data)[1]


def test_findings_turn_with_the_data(result):
    data = data_of(result)
    for values in data["numerics"]["rows"].values():
        values["printed"] = values["probable"] = [values["exact"]] * 4
    claim = next(claim for claim in data["claims"]["claims"] if claim["id"] == "reduction")
    assert claim["data"]["free_impact_ratio"] < 1
    claim["data"]["free_impact_ratio"] = 1.25
    text = "\n".join(findings(result.reproduction, data))
    assert "does not touch its numbers" in text
    assert "raises it by 25 %" in text
    assert "both agree" in text


@pytest.mark.parametrize("trouble", [RuntimeError, KeyboardInterrupt])
def test_trouble_while_writing_leaves_the_older_result_whole(monkeypatch, tmp_path, result, trouble):
    (tmp_path / "paper.md").write_text("older", encoding="utf-8")

    def fail(*_, **__):
        raise trouble

    monkeypatch.setattr(page, "markdown", fail)
    with pytest.raises(trouble):
        page.write_study(result, tmp_path, figures=False)
    assert [file.name for file in tmp_path.iterdir()] == ["paper.md"]
    assert (tmp_path / "paper.md").read_text(encoding="utf-8") == "older"


def test_a_file_in_the_way_is_one_clear_error(tmp_path, result):
    (tmp_path / "paper").write_text("mine", encoding="utf-8")
    with pytest.raises(OutputError, match="it is a file"):
        page.write_study(result, tmp_path, figures=False)
    assert (tmp_path / "paper").read_text(encoding="utf-8") == "mine"
