"""Invalid lists of a mechanism, with the text of each error and its remedy."""

import copy

import numpy as np
import pytest

from hoof_env.errors import ParameterError
from hoof_env.leg.mechanism_list import PAPER, read_mechanism
from hoof_env.leg.presets import read_preset
from tests.leg.mechanisms import EVERYTHING
from tests.legs import FOUR_BAR

JANSEN = read_preset("jansen")["geometry"]["mechanism"]
CRANK, COUPLER, ROCKER = FOUR_BAR["bodies"]


def with_names(entry, place):
    """An entry with an array of names at a place."""
    odd = copy.copy(entry)
    odd[place] = np.array(["O", "A"])
    return odd


def changed(**changes):
    return copy.deepcopy(JANSEN) | changes


def without(part, *numbers):
    return changed(**{part: [entry for k, entry in enumerate(JANSEN[part]) if k not in numbers]})


WRONG = {
    "no list": ([], "mechanism: expected .*fixed, crank, points, bodies, joints, feet, got"),
    "no joints": (
        {name: part for name, part in JANSEN.items() if name != "joints"},
        "mechanism: expected exactly .*; missing joints",
    ),
    "unknown": (changed(springs=[]), "mechanism: .*; unknown springs"),
    "the order": (
        changed(points=[JANSEN["points"][k] for k in (2, 0, 1, 3, 4)]),
        r"mechanism.points\[0\]: 'D' lies .*length from 'B', .*found .*O,",
    ),
    "a point twice": (
        changed(points=[*JANSEN["points"], JANSEN["points"][0]]),
        r"mechanism.points\[5\]: point 'B' .*give .*name",
    ),
    "three lengths": (
        changed(points=[{"point": "B", "dyad": ["C", "P"], "lengths": ["CB", "PB", "CP"]}]),
        r"mechanism.points\[0\]: expected two points .*lengths",
    ),
    "a body that is not there": (
        changed(points=[{"point": "B", "body": "XY", "along": "XB"}]),
        r"mechanism.points\[0\]: expected 'dyad' .*points, or 'body' .*OP, PB, .*'XY'",
    ),
    "ends without a length": (
        changed(bodies=[*JANSEN["bodies"], {"name": "BE", "tail": "B", "head": "E"}]),
        r"mechanism.bodies\[11\]: 'BE' needs two ends whose distance is a length \(B-C, .*'B'",
    ),
    **{
        f"a name with {letter!r}": (
            changed(feet=[f"a{letter}b"]),
            r"mechanism.feet\[0\]: expected a printable name without commas, semicolons and quotes, got",
        )
        for letter in (",", ";", '"', "\t", "\n", "\x00")
    },
    "another length": (
        changed(bodies=[JANSEN["bodies"][0] | {"length": "PB"}, *JANSEN["bodies"][1:]]),
        r"mechanism.bodies\[0\]: the ends of 'OP' are 'OP' apart by the points.* give 'length': 'OP'",
    ),
    "a joint off its body": (
        changed(joints=[["E", "OP", "frame"], *JANSEN["joints"][1:]]),
        r"mechanism.joints\[0\]: expected a point of 'OP', .*O, P, got 'E'",
    ),
    "a joint of no body": (
        changed(joints=[["O", "XY", "frame"]]),
        r"mechanism.joints\[0\]: expected \[point, body, body or 'frame'\] with bodies .*\(OP, ",
    ),
    "two degrees of freedom": (
        without("joints", 15),
        "mechanism.joints: 11 bodies have 33 coordinates, and joints, welds and crank give 31 rows: 3 "
        "degrees of freedom; expected one degree of freedom, so add joints or welds",
    ),
    "too many rows": (
        changed(welds=[["EG", "DE"]]),
        "mechanism.joints: .*give 34 rows: 1 rows too many; .*leave out joints or welds",
    ),
    "bodies apart at a pin": (
        changed(joints=[j for j in JANSEN["joints"] if j != ["E", "EG", "DE"]] + [["D", "DE", "CD"]]),
        "mechanism.joints: at 'D' two joints tie .*bodies; leave .*out",
    ),
    "a foot that is no point": (
        changed(feet=["X"]),
        "mechanism.feet: 'X' .*moving point .*body; expected some of P, B, F, D, E, G",
    ),
    "a fixed foot": (changed(feet=["C"]), "mechanism.feet: 'C' is not a moving point of a body"),
    "three feet": (changed(feet=["G", "E", "F"]), "mechanism.feet: expected one point .*got "),
    "a driver that is no crank": (
        changed(crank={"point": "F", "length": "OF"}),
        "mechanism.points.*'B' lies .*length from 'P', .*found before it",
    ),
    "a crank that slides": (
        changed(joints=[["P", "OP", "PB"] if j[0] == "O" else j for j in JANSEN["joints"]]),
        "mechanism.crank: body 'OP' .*crank; expected one joint .*frame, at 'O', .*weld",
    ),
    "a crank of another body": (
        changed(bodies=[{"name": "OP", "tail": "P", "head": "O"}, *JANSEN["bodies"][1:]]),
        "mechanism.crank: the driver .*crank; expected one body .*tail 'O', a fixed point, and",
    ),
    "a dyad without a link": (
        changed(
            bodies=[b for b in JANSEN["bodies"] if b["name"] != "DE"],
            joints=[
                ["E", "EG", "EF"] if j[0] == "E" else j
                for j in JANSEN["joints"]
                if j not in (["D", "DE", "BD"], ["E", "EG", "DE"])
            ],
        ),
        "mechanism",
    ),
    "a weld of strangers": (
        changed(welds=[["EG", "CB"]]),
        "mechanism.welds: 'EG' and 'CB' need a joint between them",
    ),
    "a coordinate": (
        {**copy.deepcopy(EVERYTHING), "points": [*EVERYTHING["points"][:4], {"point": "G", "body": "ankle"}]},
        r"mechanism.points\[4\]: expected 'along' or 'across', else 'G' is 'A' itself",
    ),
    "a joint of the frame with itself": (
        FOUR_BAR | {"joints": [["O", "frame", "frame"], *FOUR_BAR["joints"][1:]]},
        r"mechanism.joints\[0\]: expected \[point, body, body or 'frame'\]",
    ),
    **{
        f"{part}, an array for {place!r}": (
            FOUR_BAR | {part: [with_names(entry, place)]},
            rf"mechanism.{part}\[0\].*: expected",
        )
        for part, place, entry in (
            ("points", "from", {"point": "D", "body": "OA", "along": "CD"}),
            ("points", "along", {"point": "D", "body": "OA"}),
            ("points", "across", {"point": "D", "body": "OA"}),
            ("points", "dyad", FOUR_BAR["points"][0]),
            ("points", "lengths", FOUR_BAR["points"][0]),
            ("bodies", "name", CRANK),
            ("bodies", "points", CRANK),
            ("bodies", "role", CRANK),
            *(("joints", k, ["O", "OA", "frame"]) for k in range(3)),
        )
    },
    "numbers of a body": (
        FOUR_BAR | {"bodies": [CRANK, COUPLER | {"mass": 2.0}, ROCKER]},
        r"bodies\[1\]: a structure has no mass.*Geometry\(mechanism",
    ),
    **{
        f"{part}, {odd}": (FOUR_BAR | {part: [entry(odd)]}, rf"^mechanism\.{words}")
        for odd in (["AC"], {}, 3, None)
        for part, entry, words in (
            (
                "points",
                lambda odd: {"point": "D", "body": odd, "along": "CD"},
                r"points\[0\]: expected 'dyad' with two",
            ),
            ("joints", lambda odd: ["O", odd, "frame"], r"joints\[0\]: expected \[point, body"),
            ("welds", lambda odd: [odd, "AC"], r"welds\[0\]: expected two bodies of OA, AC, BC"),
        )
    },
}
"""List, and words of the error, by what is wrong."""


@pytest.mark.parametrize("case", WRONG)
def test_lists(case):
    given, words = WRONG[case]
    with pytest.raises(ParameterError, match=words):
        read_mechanism(given)


@pytest.mark.parametrize("given", [JANSEN, EVERYTHING, PAPER.to_mapping()], ids=["jansen", "all", "paper"])
def test_a_right_list_is_read_and_written(given):
    mechanism = read_mechanism(copy.deepcopy(given))
    assert read_mechanism(mechanism.to_mapping()) == mechanism
    assert 3 * len(mechanism.bodies) == 2 * len(mechanism.joints) + len(mechanism.welds) + 1
