"""The measurements behind the default trunk."""

from __future__ import annotations

import numpy as np
import pytest

from hoof_env.envs import trunk_study
from hoof_env.envs.tasks import Settings
from hoof_env.envs.trunk_study import DEFAULT, TRUNKS, measure, study


def test_the_studied_default_is_the_environments_default():
    assert {name: getattr(Settings(), name) for name in DEFAULT} == DEFAULT


def test_steady_vertical_balance_of_the_suspension():
    """Over whole strides the leg bears its share of the weight less what the sagging spring carries."""
    m = measure("run", DEFAULT)
    weight = m["mean_force_n"] / m["weight_share"]
    expected = DEFAULT["trunk_share"] * weight - DEFAULT["trunk_stiffness"] * m["sinkage_m"]
    assert m["mean_force_n"] == pytest.approx(expected, rel=0.01)


def test_a_trunk_that_leaves_its_range_is_reported_as_such():
    assert np.isnan(list(measure("run", TRUNKS[-1]).values())).all()


def test_table_has_a_row_for_each_trunk_and_gait(monkeypatch):
    monkeypatch.setattr(trunk_study, "SETTLE", 0.2)
    monkeypatch.setattr(trunk_study, "WINDOW", 0.2)
    rows = study().splitlines()[2:]
    assert len(rows) == 2 * len(TRUNKS)
    assert sum("**80 kg" in row for row in rows) == 2
    assert len({row.count("|") for row in rows}) == 1
