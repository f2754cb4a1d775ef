"""The walk that carries: what is measured of a gait, what is asked of it, and the search."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from hoof_env import cli
from hoof_env.envs.horse_leg import HorseLegEnv
from hoof_env.envs.policies import make_policy, policy_names
from hoof_env.errors import DataFileError, ParameterError
from hoof_env.gait.parameters import LIMITS, PARAMETERS, GaitParameters, gait_names, load_gait
from hoof_env.identify import carry_report
from hoof_env.identify.carry import FALL, NAME, POPULATION, Found, cost, find_carrying_walk
from hoof_env.identify.carry_measure import DEMANDS, PHASES, STRIDES, Course, by_phase, missed
from hoof_env.leg.geometry import preset_names, read_preset

LEG = "first_fit"
CARRIES = GaitParameters(2 * np.pi, 0.7667442405531119, -0.09049199406524089, -0.3798289295389014)
"""What `hoof-env carry --preset first_fit` finds, seed 0."""


@pytest.fixture(scope="module")
def course():
    return Course(LEG, 3)


@pytest.fixture(scope="module")
def carriages(course):
    gaits = {"walk": load_gait("walk", LEG), "run": load_gait("run", LEG), NAME: CARRIES}
    return {name: course.measure(gait) for name, gait in gaits.items()}


@pytest.mark.parametrize("name", ["walk", "run", NAME])
def test_impulse_balance_of_a_steady_gait(course, carriages, name):
    """Momentum is the same after a stride, so the ground gives what weight, support and spring leave."""
    carriage, trunk = carriages[name], course.trunk
    assert carriage.unsteady_m < 1e-4
    spring = trunk.stiffness * carriage.rise_m
    assert carriage.load_share * course.load == pytest.approx(course.load + spring, abs=0.2)
    assert course.load == pytest.approx(0.8 * (80 + course.geometry.mass) * 9.81)


def test_the_papers_walk_does_not_carry_and_the_one_found_does(carriages):
    walk, found = carriages["walk"], carriages[NAME]
    assert len(missed(walk)) == 2
    assert missed(walk)[0].startswith("bears 0.45")
    assert walk.rise_m < -0.05
    assert walk.speed_m_s < 0
    assert missed(found) == []
    assert abs(found.rise_m) < 0.01
    assert 1.2 <= found.speed_m_s <= 1.8
    assert found.peak_share < carriages["run"].peak_share
    assert found.peak_share <= cost(found) < cost(carriages["run"]) < cost(walk)


def test_what_is_measured_is_what_an_episode_of_the_environment_gives(course, carriages):
    """The policy of the same name, through the environment's own account."""
    env = HorseLegEnv(preset=LEG)
    env.gaits[NAME] = CARRIES
    policy, forces, x = make_policy(NAME, env), [], []
    observation, _ = env.reset(seed=5)
    env.record()
    for step in range(500):
        observation, *_ = env.step(policy.predict(observation)[0])
        if step >= 400:
            record = env.record()
            forces.extend((record["toe_normal"] + record["heel_normal"]).ravel())
            x.append(record["x"][-1].item())
    carriage = carriages[NAME]
    assert np.mean(forces) / course.load == pytest.approx(carriage.load_share, rel=0.005)
    assert np.max(forces) / course.load == pytest.approx(carriage.peak_share, rel=0.01)
    assert np.mean(np.array(forces) > 0) == pytest.approx(carriage.duty_factor, abs=0.005)
    assert (x[-1] - x[0]) / 1.98 == pytest.approx(carriage.speed_m_s, rel=0.02)


def test_a_gait_more_leaves_the_starts_and_the_other_policies_as_they_were(tmp_path):
    preset = read_preset(LEG)
    preset["gaits"][NAME] = dict(zip(PARAMETERS, CARRIES.to_array().tolist(), strict=True))
    path = tmp_path / "more.json"
    path.write_text(json.dumps(preset))
    one, more = HorseLegEnv(preset=LEG), HorseLegEnv(preset=str(path))
    assert policy_names(more) == [NAME, *policy_names(one)]
    for seed in range(3):
        (seen, info), (seen_more, info_more) = one.reset(seed=seed), more.reset(seed=seed)
        assert info == info_more
        for name in ("idle", "walk", "drag"):
            actions = [make_policy(name, env).predict(seen)[0].tolist() for env in (one, more)]
            assert actions[0] == actions[1]
    assert np.array_equal(seen, seen_more)


@pytest.mark.parametrize("name", preset_names())
def test_a_carrying_walk_that_ships_carries(name):
    if NAME in gait_names(name):
        assert missed(Course(name, 3).measure(load_gait(NAME, name))) == []
        assert read_preset(name)["gait_provenance"][NAME].startswith("Found, not published")


def test_a_trunk_that_falls_is_graded_by_how_long_it_lasted(course, monkeypatch):
    monkeypatch.setattr(course, "count", 1)
    monkeypatch.setattr("hoof_env.identify.carry_measure.LOWEST", 0.97)
    early = course.measure(load_gait("walk", LEG))
    assert 0 < early.survived < 0.3
    assert math.isnan(early.load_share)
    assert missed(early) == ["loses its trunk"]
    assert FALL < cost(replace(early, survived=0.9)) < cost(early) < 2 * FALL


@pytest.mark.parametrize("demand", DEMANDS, ids=lambda demand: demand.quantity)
def test_each_demand_costs_more_the_more_it_is_missed(carriages, demand):
    good = carriages[NAME]
    edge = demand.high if math.isfinite(demand.high) else demand.low
    out = 1 if math.isfinite(demand.high) else -1
    costs = []
    for tolerances in (-0.03, -0.01, 0.5, 0.98, 10):
        bad = replace(good, **{demand.quantity: edge + out * tolerances * demand.tolerance})
        costs.append(cost(bad) - bad.peak_share)
        assert len(missed(bad)) == (tolerances > 0)
    assert costs == sorted(set(costs))  # the search keeps a little within the edge
    assert costs[0] == 0
    assert costs[3] == pytest.approx(10)


def test_strides_are_compared_at_the_same_crank_angles():
    theta = np.linspace(1.3, 1.3 + 2 * np.pi * (STRIDES + 1), 4001)
    values = by_phase(theta, np.sin(theta) + 0.01 * (theta > theta[-1] - 3))
    assert values.shape == (STRIDES, PHASES)
    angles = 2 * np.pi * np.arange(PHASES) / PHASES
    np.testing.assert_allclose(values[0], np.sin(angles), atol=1e-5)
    assert np.ptp(values, axis=0).max() == pytest.approx(0.01, abs=1e-4)


def test_a_search_repeats_itself_with_any_number_of_workers(monkeypatch):
    monkeypatch.setattr("hoof_env.identify.carry.SCREENED", POPULATION)
    monkeypatch.setattr("hoof_env.identify.carry.CANDIDATES", 1)
    seen = []
    tries = 3 * POPULATION
    first = find_carrying_walk(LEG, seed=3, evaluations=tries, progress=lambda *given: seen.append(given))
    again = find_carrying_walk(LEG, seed=3, evaluations=tries, workers=2)
    assert first == again
    counts, best = zip(*seen, strict=True)
    assert counts == (POPULATION, 2 * POPULATION, tries)
    assert list(best) == sorted(best, reverse=True)
    assert first.gait != find_carrying_walk(LEG, seed=4, evaluations=POPULATION).gait
    assert first.gait.crank_speed == load_gait("walk", LEG).crank_speed


def test_the_crank_is_searched_within_its_limits_if_it_is_free(tmp_path):
    preset = read_preset(LEG)
    preset["gaits"]["walk"]["crank_speed"] = fast = 0.99 * LIMITS["crank_speed"][1]
    path = tmp_path / "fast.json"
    path.write_text(json.dumps(preset))
    found = find_carrying_walk(path, evaluations=POPULATION, free_crank=True)
    assert found.gait.crank_speed != fast
    assert 0.5 * fast <= found.gait.crank_speed <= LIMITS["crank_speed"][1]


def given_found(monkeypatch, course, carriages, name):
    gait = CARRIES if name == NAME else load_gait(name, LEG)
    found = Found(gait, carriages[name], tuple(missed(carriages[name])), 0, 8)
    monkeypatch.setattr(carry_report, "find_carrying_walk", lambda *_, **__: found)
    monkeypatch.setattr(carry_report, "Course", lambda *_: course)


def test_the_command_adds_the_gait_and_leaves_the_rest(tmp_path, monkeypatch, course, carriages, capsys):
    given_found(monkeypatch, course, carriages, NAME)
    assert cli.main(["carry", "--preset", LEG, "--out", str(tmp_path)]) == 0
    path = tmp_path / f"{LEG}.json"
    assert load_gait(NAME, path) == CARRIES
    assert gait_names(path) == [NAME, "run", "walk"]
    written, given = read_preset(path), read_preset(LEG)
    assert str(tmp_path) not in written.pop("gait_provenance")[NAME]
    del written["gaits"][NAME]
    assert written == given
    table = capsys.readouterr().out
    assert "| walk | -1.73 | 0.45 |" in table
    assert table.count("| yes |") == 1
    assert (tmp_path / "carry.md").read_text(encoding="utf-8").count("| carrying_walk | ") == 1
    before = path.read_bytes()
    assert cli.main(["carry", "--preset", LEG, "--out", str(tmp_path)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert path.read_bytes() == before
    assert cli.main(["carry", "--preset", str(path), "--out", str(tmp_path)]) == 2  # would replace its input
    assert "expected a folder other than that of the preset" in capsys.readouterr().err


def test_a_gait_that_does_not_carry_is_not_written(tmp_path, monkeypatch, course, carriages, capsys):
    given_found(monkeypatch, course, carriages, "walk")
    assert cli.main(["carry", "--preset", LEG, "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert "no carrying walk found in 8 evaluations: the best bears 0.45 of its load" in error
    assert "--free-crank" in error
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"preset": "nobody"}, "preset: expected one of"),
        ({"seed": -1}, "seed: expected"),
        ({"evaluations": POPULATION - 1}, r"evaluations: expected a finite number in \[8, "),
        ({"workers": 0}, "workers: expected"),
    ],
)
def test_bad_input(change, message):
    with pytest.raises(ParameterError, match=message):
        find_carrying_walk(**{"preset": LEG, "evaluations": POPULATION, **change})


def test_a_preset_without_a_walk_or_with_one_that_stands_still(tmp_path, course):
    preset, path = read_preset(LEG), tmp_path / "leg.json"
    preset["gaits"]["walk"]["crank_speed"] = 0.0
    path.write_text(json.dumps(preset))
    with pytest.raises(ParameterError, match="the walk's crank_speed: expected"):
        find_carrying_walk(path)
    with pytest.raises(ParameterError, match="expected a gait whose crank turns"):
        course.measure(load_gait("walk", path))
    del preset["gaits"]["walk"]
    path.write_text(json.dumps(preset))
    with pytest.raises(ParameterError, match="gait: expected one of run, got 'walk'"):
        find_carrying_walk(path)
    path.write_text("{}")
    with pytest.raises(DataFileError, match="expected an object 'gaits'"):
        find_carrying_walk(path)
