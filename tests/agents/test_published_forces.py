"""Forces of horses as published: what the made curve has, and that the page is written whole."""

import numpy as np
import pytest

from agents import published_forces as forces
from agents.judges import read_judges


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


def test_the_page_has_both_gaits(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(forces, "SECONDS", 5.0)
    forces.main(["--out", str(tmp_path), "--records", str(tmp_path / "records")])
    text = (tmp_path / "horse_forces.md").read_text()
    assert "nan" not in text
    for kind in ("walk", "trot"):
        assert f"| {kind} | fore | vertical |" in text
        assert (tmp_path / "horse_forces" / f"{kind}.png").stat().st_size > 5000
    assert "| walk | hind | fore-aft |" not in text
    assert "| trot | hind | fore-aft |" in text
    capsys.readouterr()
