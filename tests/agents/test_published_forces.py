"""Forces of horses as published: what the made curve has, and that the page is written whole."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from agents import published_forces as forces
from agents.judges import read_judges
from agents.limb_names import LANDS
from hoof_env import cli
from hoof_env.lab.compare import compare
from hoof_env.lab.picture import report
from hoof_env.lab.read import read_record


@pytest.mark.parametrize(("kind", "speed"), [("walk", 1.6), ("trot", 3.6)])
def test_a_made_curve_has_the_published_peaks_and_duty_factor(kind, speed):
    time, of_pairs, _ = forces.published(kind, speed)
    judges = read_judges()
    for pair, of_pair in of_pairs.items():
        up = of_pair[:, 1]
        assert up.max() == pytest.approx(judges[kind][f"peak_{pair}"]["horse"], rel=1e-3)
        duty = 0.62 if kind == "walk" else 0.39
        assert (up > 0).mean() == pytest.approx(duty, abs=0.02)
    assert time[-1] * speed / 1.4 == pytest.approx(6 * (1.3 if kind == "walk" else 1.66), rel=0.01)


def test_a_horse_brakes_before_it_propels_and_a_walk_has_no_known_force_of_its_hind_limb():
    push = forces.fore_aft("trot", "hind", 1.0, 201)
    assert push[:100].min() == pytest.approx(-0.79, abs=1e-3)
    assert push[101:].max() == pytest.approx(1.17, abs=1e-3)
    assert (push[1:100] <= 0).all()
    assert (push[101:200] >= 0).all()
    assert np.isnan(forces.fore_aft("walk", "hind", 0.2, 201)).all()


def test_the_walk_bears_its_weight():
    """Peaks, shape and duty factor come from several sources; an animal bears its weight over a stride."""
    assert forces.published("walk", 1.6)[2] == pytest.approx(1, abs=0.05)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Folder with the page and its records."""
    out = tmp_path_factory.mktemp("page")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(forces, "SECONDS", 5.0)
        forces.main(["--out", str(out), "--records", str(out / "records")])
    return out


def test_the_page_has_both_gaits(written):
    text = (written / "horse_forces.md").read_text()
    assert "nan" not in text
    for kind in ("walk", "trot"):
        assert f"| {kind} | fore | vertical |" in text
        assert (written / "horse_forces" / f"{kind}.png").stat().st_size > 5000
    assert "| walk | hind | fore-aft |" not in text
    assert "| trot | hind | fore-aft |" in text


def test_the_commands_of_the_page_find_what_it_says(written, monkeypatch, capsys):
    """All of their figures, by the numbers of the table, and all of their warnings."""
    text = (written / "horse_forces.md").read_text()
    commands = re.findall("^hoof-env (.*)$", text, re.M)
    monkeypatch.chdir(written)
    assert len(commands) == 2
    for kind, command in zip(("walk", "trot"), commands, strict=True):
        capsys.readouterr()
        assert cli.main(shlex.split(command)) == 0
        said = capsys.readouterr().out
        warned = re.findall("^warning: (.*)$", said, re.M)
        assert re.findall(rf"^\* {kind}: (.*)$", text, re.M) == warned
        paths = [Path(word) for word in shlex.split(command)[1:3]]
        found = compare(*(read_record(path, mass=forces.MASS) for path in paths), units="BW")
        assert said.startswith(report(found))
        for row in forces.rows_of(kind, found):
            assert f"| {' | '.join(row)} |" in text
    assert "fore-aft forces point opposite ways" in text
    assert "scatter" not in text


@pytest.mark.parametrize("kind", ["walk", "trot"])
def test_the_left_fore_limb_of_a_horse_lands_as_the_judges_say(kind):
    """Their lag is within half a stride, since they do not know left from right."""
    time, of_pairs, _ = forces.published(kind, 1.6 if kind == "walk" else 3.6)
    first = {
        pair: time[1 + np.flatnonzero(np.diff((of[:, 1] > 0) * 1) == 1)] for pair, of in of_pairs.items()
    }
    stride = np.diff(first["hind"]).mean()
    lag = (first["fore"][-1] - first["hind"][-1]) / stride
    assert lag % 1 == pytest.approx(LANDS[kind], abs=0.01)
    assert (lag - read_judges()[kind]["lag"]["horse"] + 0.25) % 0.5 == pytest.approx(0.25, abs=0.01)
