"""Links of a leg: what cannot move is one link, and hinges less closed loops leave the crank's freedom."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from hoof_env.leg.link_tree import link_tree
from hoof_env.leg.mechanism import FRAME_NAME
from hoof_env.leg.mechanism_list import PAPER, read_mechanism
from tests.legs import FOUR_BAR, MECHANISMS


@pytest.mark.parametrize("merge", [True, False], ids=["merged", "body for body"])
@pytest.mark.parametrize("mechanism", MECHANISMS.values(), ids=MECHANISMS)
def test_every_body_is_in_one_link_and_one_freedom_is_left(mechanism, merge):
    tree = link_tree(mechanism, merge)
    bodies = Counter(body for members in tree.links.values() for body in members)
    assert bodies == Counter(range(len(mechanism.bodies)))
    assert sorted(link for link, _, _ in tree.tree) == sorted(tree.links)
    # Every hinge is a freedom; a loop takes two, and a weld one
    assert len(tree.links) - 2 * len(tree.loops) - len(tree.locked) == 1
    known = {FRAME_NAME}
    for link, carrier, _ in tree.tree:
        assert carrier in known
        known.add(link)


def test_the_papers_leg_has_nine_links():
    tree = link_tree(PAPER)
    together = [members for members in tree.links.values() if len(members) > 1]
    assert together == [(2, 3, 4), (6, 9), (10, 12, 13)]
    assert (len(tree.links), len(tree.pins), len(tree.loops)) == (9, 13, 4)


@pytest.mark.parametrize("mechanism", MECHANISMS.values(), ids=MECHANISMS)
def test_forces_at_pins_are_sums_over_joints(mechanism):
    """Forces on bodies inside a link cancel, and forces between links add up."""
    rng = np.random.default_rng(0)
    joints = rng.normal(size=(len(mechanism.joints), 2))
    tree = link_tree(mechanism)
    forces = dict(zip(tree.pins, tree.pin_forces(joints), strict=True))
    on_link = {
        link: sum((joints[k] for k, joint in enumerate(mechanism.joints) if joint.i in members), np.zeros(2))
        - sum((joints[k] for k, joint in enumerate(mechanism.joints) if joint.j in members), np.zeros(2))
        for link, members in tree.links.items()
    }
    for link, total in on_link.items():
        mine = sum((force for (_, one, _), force in forces.items() if one == link), np.zeros(2))
        others = sum((force for (_, _, two), force in forces.items() if two == link), np.zeros(2))
        assert mine - others == pytest.approx(total, abs=1e-12)


def test_links_in_a_ring_at_one_point_are_not_held_twice():
    """At Q the first and the last rod of a chain of four are sides of one triangle, which is one link."""
    rods = ("OP", "CQ", "PQ", "OR", "QR", "CT", "QT")
    dyads = {"Q": ("C", "P"), "R": ("O", "Q"), "T": ("C", "Q")}
    mechanism = read_mechanism(
        {
            "fixed": ["O", "C"],
            "crank": {"point": "P", "length": "OP"},
            "points": [
                {"point": point, "dyad": [*ends], "lengths": [f"{end}{point}" for end in ends]}
                for point, ends in dyads.items()
            ],
            "bodies": [{"name": rod, "tail": rod[0], "head": rod[1]} for rod in rods],
            "joints": [
                *(["O", rod, "frame"] for rod in ("OP", "OR")),
                *(["C", rod, "frame"] for rod in ("CQ", "CT")),
                ["P", "OP", "PQ"],
                *(["Q", one, two] for one, two in pairwise(("CQ", "PQ", "QR", "QT"))),
                ["R", "OR", "QR"],
                ["T", "CT", "QT"],
            ],
            "feet": ["R"],
        }
    )
    tree = link_tree(mechanism)
    assert (1, 5, 6) in tree.links.values()
    assert len(tree.links) - 2 * len(tree.loops) == 1


@pytest.mark.parametrize("name", ["hoof", "crank", "trunk", "swing", "x", "world"])
def test_a_body_may_have_the_name_of_another_part(name):
    rods = [body | {"length": body["name"]} for body in FOUR_BAR["bodies"]]
    rods[2]["name"] = name
    joints = [[name if part == "BC" else part for part in joint] for joint in FOUR_BAR["joints"]]
    tree = link_tree(read_mechanism(FOUR_BAR | {"bodies": rods, "joints": joints}))
    assert tree.links == {"crank": (0,), "hoof": (1,), f"{name}_": (2,)}
