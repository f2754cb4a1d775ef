"""Numbers of bodies, the roles that they have and points on them, as a list of a mechanism may give them; and
when the motion of a leg is checked."""

import copy
from dataclasses import dataclass

import pytest

from hoof_env.errors import GeometryError
from hoof_env.leg import mobility
from hoof_env.leg.geometry import Geometry, load_geometry
from hoof_env.leg.mechanism_list import PAPER
from tests.legs import FOUR_BAR, FOUR_BAR_LEG


def test_a_point_that_keeps_its_place_is_a_point_however_it_is_found():
    rigid = copy.deepcopy(FOUR_BAR)
    rigid["points"].append({"point": "E", "dyad": ["A", "C"], "lengths": ["AE", "CE"]})
    rigid["bodies"][1]["points"] = ["D", "E"]
    lengths = FOUR_BAR_LEG["lengths"] | {"AE": 0.5, "CE": 0.4}
    assert Geometry(**FOUR_BAR_LEG | {"mechanism": rigid, "lengths": lengths, "assembly": {"C": 1, "E": -1}})


def test_solids_cannot_be_changed_from_outside():
    solids = {"AC": {"mass": 2.0, "centre": [0.1, 0.2]}}
    leg = Geometry(**FOUR_BAR_LEG | {"solids": solids})
    for given in (solids, leg.to_dict()["solids"]):
        given["AC"]["centre"][0] = 99.0
    assert leg.body_centres[1] == pytest.approx((0.1 + 0.2j) / 0.7)
    assert Geometry.from_dict(leg.to_dict()) == leg


def listed(**numbers):
    """The list, with numbers of the body AC in it."""
    mechanism = copy.deepcopy(FOUR_BAR)
    mechanism["bodies"][1] |= numbers
    return mechanism


def test_numbers_of_a_body_may_stand_in_the_list():
    solid = {"mass": 2.0, "centre": [0.1, 0.2], "inertia": 0.3}
    leg = Geometry(**FOUR_BAR_LEG | {"mechanism": listed(**solid)})
    assert leg == Geometry(**FOUR_BAR_LEG | {"solids": {"AC": solid}})
    assert leg.body_masses[1] == 2.0
    assert Geometry.from_dict(leg.to_dict()) == leg
    # a rod is uniform unless said
    assert Geometry(**FOUR_BAR_LEG | {"mechanism": listed(mass=2.0)}).body_centres[1] == 0.5


def test_roles_are_written_with_the_leg():
    given = PAPER.to_mapping()
    given["bodies"][0]["role"] = "driver"
    leg = load_geometry().replace(mechanism=given)
    assert leg == load_geometry()
    assert Geometry.from_dict(leg.to_dict()).mechanism.bodies[0].role == "driver"


def test_a_leg_that_locks_is_refused_each_time():
    lengths = FOUR_BAR_LEG["lengths"] | {"OA": 2.0}
    rocks = Geometry(**FOUR_BAR_LEG | {"lengths": lengths, "full_turn": False})
    for _ in range(2):
        with pytest.raises(GeometryError, match="does not close"):
            rocks.replace(full_turn=True)


def test_legs_that_move_alike_are_checked_once(monkeypatch):
    checked = []
    monkeypatch.setattr(mobility, "check_full_revolution", checked.append)
    mobility._check_once.cache_clear()
    for height in (0.8, 0.9):
        Geometry(**FOUR_BAR_LEG | {"hip_height": height})
    Geometry(**FOUR_BAR_LEG | {"mechanism": listed(mass=2.0)})
    assert len(checked) == 1
    Geometry(**FOUR_BAR_LEG | {"lengths": FOUR_BAR_LEG["lengths"] | {"CD": 0.6}})
    assert len(checked) == 2


@dataclass(frozen=True)
class Noted(Geometry):
    """A user's leg, which has no hash: the hash of a `Geometry` is not inherited."""

    note: str = ""


def test_a_class_of_ones_own_may_lack_a_hash():
    assert Noted(**FOUR_BAR_LEG, note="mine").note == "mine"
