import pytest

from hoof_env.identify.plausibility import LEG_DEMANDS
from hoof_env.paper.published import CONDITIONS
from hoof_env.paper.reproduce import GAITS
from hoof_env.paper.spread_limits import DEMANDED, held_by_demands, one_sided


def test_quantities_named_are_demanded():
    assert set(DEMANDED) <= {demand.measured for demand in LEG_DEMANDS}


def test_a_value_at_a_bound_is_held_by_its_demand_and_one_inside_is_not():
    values = {"hip_height": [1.45, 1.5], "length.IJ": [0.051, 0.0512, 0.06]}
    (entry,) = held_by_demands(values)
    assert (entry["key"], entry["most"], entry["members"]) == ("length.IJ", False, 2)
    tall = held_by_demands({"hip_height": [1.45, 1.698], "length.IJ": [0.08]})
    assert [(entry["key"], entry["most"], entry["members"]) for entry in tall] == [("hip_height", True, 1)]


def test_rows_that_all_members_miss_on_one_side_are_named(reproduction):
    published = reproduction.published
    values = {
        f"{gait}.{condition}.{key}": [published.row(f"{gait}.{name}_{condition}").value] * 2
        for gait in GAITS
        for condition in CONDITIONS
        for name, key in (("peak", "peak"), ("mean", "impulse"))
    }
    assert one_sided(values, published) == []
    mean = published.row("run.mean_inelastic").value
    values["run.inelastic.impulse"] = [0.985 * mean, 0.98 * mean]
    values["walk.elastic.peak"] = [f * published.row("walk.peak_elastic").value for f in (0.985, 1.015)]
    (entry,) = one_sided(values, published)
    assert entry == {"row": "run.mean_inelastic", "low": pytest.approx(-2), "high": pytest.approx(-1.5)}
