"""Figures that the paper does not print, on cycles made by hand and on the identified leg."""

import math

import numpy as np
import pytest

from hoof_env.paper.details import UNITS, details
from hoof_env.paper.measure import POINTS
from hoof_env.paper.rows import EXACT


def test_figures_of_a_cycle_made_by_hand(cycle, bump):
    def friction(t):
        return 0.4 * bump((0.3, 0.5, 100.0))(t) * np.where(t < 0.35, -1, 1)

    columns = {"toe_normal": bump((0.3, 0.5, 100.0)), "toe_friction": friction, "toe_slide": -2.0}
    elastic = cycle((0.3, 0.5), None, hoof_angle=lambda t: np.radians(100 * (t - 0.3)), **columns)
    inelastic = cycle((0.3, 0.5), None, toe_normal=bump((0.2, 0.5, 100.0)))
    traces = {("walk", "elastic"): elastic, ("walk", "inelastic"): inelastic}
    found = {entry["id"].partition(".")[2]: entry for entry in details(traces)}
    assert found.keys() == UNITS.keys()
    value = {name: entry["value"] for name, entry in found.items()}
    assert value["depth"] == pytest.approx(10)
    assert value["sole_speed"] == 2
    assert value["first_peak"] == value["last_peak"] == pytest.approx(50)
    assert (value["least_angle"], value["most_angle"]) == pytest.approx((0, 20), abs=1e-6)
    assert value["middle_angle"] == pytest.approx(10)
    assert value["middle_force"] == pytest.approx(100)
    impulse = 0.4 * 100 * 0.2 * 2 / math.pi
    assert value["forward"] + value["backward"] == pytest.approx(impulse, rel=1e-3)
    assert value["backward"] == pytest.approx(impulse * (1 - math.cos(math.pi / 4)) / 2, rel=0.02)
    assert value["turn"] == pytest.approx(25, abs=1)
    assert value["direction"] == pytest.approx(math.degrees(math.atan(0.4)))
    assert value["full_slip"] == 100
    assert value["printed_grf"] == pytest.approx(math.sqrt(140))
    assert value["peak_delay"] == pytest.approx(50)


def test_the_running_hoof_ploughs_and_always_slips(reproduction):
    value = {entry["id"]: entry["value"] for entry in reproduction.details}
    trace = reproduction.traces["run", "elastic", EXACT]
    assert value["run.depth"] == 100 * max(trace[f"{name}_penetration"].max() for name in POINTS)
    assert value["run.depth"] > 20 > 5 > value["walk.depth"]
    assert value["run.sole_speed"] > 5
    for gait in ("walk", "run"):
        assert value[f"{gait}.direction"] == pytest.approx(math.degrees(math.atan(0.4)))
        assert value[f"{gait}.full_slip"] > 99
