"""Forces and energy over stiffness and damping: what must hold, the deleted tables, and the page."""

import json

import pytest

from benchmarks import parameters
from benchmarks.pages import filled
from benchmarks.prescribed import contact_on
from hoof_env.errors import ParameterError


@pytest.fixture(scope="module")
def data():
    return json.loads(parameters.DATA.read_text(encoding="utf-8"))


@pytest.mark.parametrize("gait", parameters.GAITS)
def test_under_a_fixed_trunk_every_force_is_proportional_to_the_stiffness(gait):
    one = parameters.rows_of(gait, {})
    three = parameters.rows_of(gait, {"stiffness": 3 * parameters.ground_of().stiffness})
    assert three.pop("change") == pytest.approx(one.pop("change"), rel=1e-9)
    assert three == pytest.approx({name: 3 * value for name, value in one.items()}, rel=1e-9)


@pytest.mark.parametrize("gait", parameters.GAITS)
def test_pace_changes_no_normal_force(gait):
    assert parameters.rows_of(gait, {}, speed=2.0) == pytest.approx(parameters.rows_of(gait, {}), rel=1e-9)


@pytest.mark.parametrize("gait", parameters.GAITS)
def test_elastic_ground_gives_back_all_work_and_stores_no_more(gait):
    ground = parameters.ground_of()
    contact = contact_on(gait, ground)
    given, back = contact.work()
    assert back == pytest.approx(given, rel=1e-5)
    assert contact.stored(ground) <= given
    damped = contact_on(gait, parameters.ground_of(restitution=0.0)).work()
    assert damped[0] > given
    assert damped[1] < back


def test_the_deleted_tables_come_out_again(data):
    now = parameters.today(data)
    assert now.keys() == parameters.DELETED.keys()
    for name, then in parameters.DELETED.items():
        digits = 0.5 * 10.0 ** -len(f"{then}".rstrip("0").partition(".")[2])
        assert now[name] == pytest.approx(then, abs=1.2 * digits), name


@pytest.mark.parametrize(("gait", "factor", "restitution"), [("run", 1.0, 1.0), ("walk", 4.0, 0.0)])
def test_the_energy_of_a_turn_adds_up_and_agrees_with_the_data(data, gait, factor, restitution):
    row = parameters.find(data["suspended"], gait=gait, factor=factor, restitution=restitution)
    ground = parameters.ground_of(
        restitution=restitution, stiffness=factor * parameters.ground_of().stiffness
    )
    found = parameters.turn(gait, ground)
    assert found == pytest.approx({name: row[name] for name in found}, rel=1e-6, abs=1e-9)
    losses = sum(found[name] for name in parameters.ACCOUNT if name.endswith("loss"))
    # The trunk's speed still creeps to the steady gait's
    assert losses == pytest.approx(found["crank_work"] + found["swing_work"], rel=0.05)


def test_the_page_has_the_tables_of_its_data(data):
    page = parameters.PAGE.read_text(encoding="utf-8")
    assert filled(page, parameters.tables(data)) == page


def test_a_page_without_marks_is_refused():
    with pytest.raises(ParameterError, match="expected <!-- table energy -->"):
        filled("# A page\n", {"energy": "| a |"})
