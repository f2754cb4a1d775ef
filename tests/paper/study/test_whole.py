"""The study with all its points, which `make test` leaves out: the tests beside this one take few of them."""

import pytest

from hoof_env.paper.study import numerics, page, sensitivity
from hoof_env.paper.study.findings import findings


@pytest.mark.slow
def test_every_point_of_every_sweep_has_its_numbers(reproduction, monkeypatch):
    monkeypatch.setattr(page, "reproduce", lambda tell, preset: reproduction)
    study = page.study()
    data = {name: section.data for name, section in study.sections.items()}
    assert data["numerics"]["beta_sweep"]["beta"] == numerics.BETA_SWEEP.tolist()
    assert len(data["sensitivity"]["level"]["rise_mm"]) == len(sensitivity.LEVELS)
    assert len(findings(reproduction, data)) == 7
