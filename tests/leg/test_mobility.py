"""A list whose bodies do not move as its points do, or with entries of any type, is refused with words."""

import copy

import pytest

from hoof_env.errors import GeometryError, ParameterError
from hoof_env.leg.geometry import Geometry, load_geometry
from hoof_env.leg.mechanism_list import PAPER, read_mechanism
from tests.legs import FOUR_BAR

VALUES = {
    "lengths": {"OA": 0.2, "BC": 0.6, "AC": 0.7, "CD": 0.5},
    "pivot": (0.6, 0.1),
    "assembly": {"C": 1},
    "toe": "D",
    "heel": None,
    "travel": 1,
    "hip_height": 1.0,
    "mechanism": FOUR_BAR,
}


def test_a_point_that_moves_on_a_body_is_none_of_it():
    mechanism = copy.deepcopy(FOUR_BAR)
    mechanism["bodies"][2]["points"] = ["D"]
    with pytest.raises(GeometryError, match=r"mechanism.bodies\[2\]: 'D' is no point of body 'BC', on which"):
        Geometry(**VALUES | {"mechanism": mechanism})


def test_a_point_that_keeps_its_place_is_a_point_however_it_is_found():
    rigid = copy.deepcopy(FOUR_BAR)
    rigid["points"].append({"point": "E", "dyad": ["A", "C"], "lengths": ["AE", "CE"]})
    rigid["bodies"][1]["points"] = ["D", "E"]
    lengths = VALUES["lengths"] | {"AE": 0.5, "CE": 0.4}
    assert Geometry(**VALUES | {"mechanism": rigid, "lengths": lengths, "assembly": {"C": 1, "E": -1}})


def test_as_many_rows_as_coordinates_may_leave_a_body_free():
    given = PAPER.to_mapping()
    given["joints"].remove(["B", "CB", "PB"])
    given["welds"] += [["BD", "PB"], ["DE", "BD"]]
    assert read_mechanism(given)
    with pytest.raises(GeometryError, match=r"mechanism.joints: .* while the crank stands: 'CB'; tie"):
        load_geometry().replace(mechanism=given)


@pytest.mark.parametrize("odd", [["AC"], {}, 3, None])
@pytest.mark.parametrize(
    ("part", "place", "words"),
    [
        ("points", {"point": "D", "body": None, "along": "CD"}, r"points\[0\]: expected 'dyad' with two"),
        ("joints", ["O", None, "frame"], r"joints\[0\]: expected \[point, body"),
        ("welds", [None, "AC"], r"welds\[0\]: expected two bodies of OA, AC, BC"),
    ],
)
def test_an_entry_of_another_type_is_named(part, place, words, odd):
    entry = place | {"body": odd} if isinstance(place, dict) else [odd if p is None else p for p in place]
    with pytest.raises(ParameterError, match=rf"^mechanism\.{words}"):
        read_mechanism(FOUR_BAR | {part: [entry]})


def test_solids_cannot_be_changed_from_outside():
    solids = {"AC": {"mass": 2.0, "centre": [0.1, 0.2]}}
    leg = Geometry(**VALUES | {"solids": solids})
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
    leg = Geometry(**VALUES | {"mechanism": listed(**solid)})
    assert leg == Geometry(**VALUES | {"solids": {"AC": solid}})
    assert leg.body_masses[1] == 2.0
    assert Geometry.from_dict(leg.to_dict()) == leg
    # a rod is uniform unless said
    assert Geometry(**VALUES | {"mechanism": listed(mass=2.0)}).body_centres[1] == 0.5


@pytest.mark.parametrize(
    ("numbers", "more", "words"),
    [
        ({"mass": -1}, {}, r"^mechanism\.bodies\[1\]\['mass'\]: expected a finite number in \(0, inf\]"),
        ({"centre": 3}, {}, r"^mechanism\.bodies\[1\]\['centre'\]: expected two numbers"),
        ({"colour": 3}, {}, r"^mechanism\.bodies\[1\]: expected exactly name, .*; unknown colour"),
        ({"mass": 1}, {"AC": {}}, r"^solids\['AC'\]: mechanism\.bodies\[1\] has numbers of 'AC', too"),
    ],
)
def test_wrong_numbers_in_the_list_are_named(numbers, more, words):
    with pytest.raises(ParameterError, match=words):
        Geometry(**VALUES | {"mechanism": listed(**numbers), "solids": more})


def test_a_structure_has_no_numbers():
    with pytest.raises(ParameterError, match=r"bodies\[1\]: a structure has no mass.*Geometry\(mechanism"):
        read_mechanism(listed(mass=2.0))


def test_roles_are_written_with_the_leg():
    given = PAPER.to_mapping()
    given["bodies"][0]["role"] = "driver"
    leg = load_geometry().replace(mechanism=given)
    assert leg == load_geometry()
    assert Geometry.from_dict(leg.to_dict()).mechanism.bodies[0].role == "driver"


def test_a_name_or_path_of_another_kind_is_refused():
    leg = load_geometry("klann")
    with pytest.raises(ParameterError, match=r"point: expected one of B, D, .*, O, P, got 'X'"):
        leg.pose(0.0).point("X")
    with pytest.raises(ParameterError, match=r"path: expected the path of a file .*, got 3"):
        leg.to_mjcf(3)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"solids": {"XX": {}}}, r"^solids: expected some of OA, AC, BC; unknown XX$"),
        ({"solids": None}, r"^solids: expected a mapping with OA, AC, BC, got None$"),
        ({"lengths": 3}, r"^lengths: expected a mapping with OA, AC, BC, CD, got 3$"),
        (
            {"mechanism": FOUR_BAR | {"fixed": ["O", "B", "Z"]}, "pivot": {"B": (0.6, 0.1), "Z": (0, "1")}},
            r"^pivot\['Z'\]\[1\]: expected a finite number",
        ),
    ],
)
def test_the_entry_is_named(changes, words):
    with pytest.raises(ParameterError, match=words):
        Geometry(**VALUES).replace(**changes)
