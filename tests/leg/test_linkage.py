"""The paper's list is the mechanism that the paper counts: 42 rows, one driver, no freedom left."""

from hoof_env.leg.mechanism_list import PAPER, read_mechanism
from tests.linkage import BODIES, BODY_LENGTHS, CONSTRUCTION, FRAME, JOINTS, LENGTHS, LOCK, POINTS, Dyad


def test_the_paper_counts_42_rows_and_nothing_is_left_free():
    assert len(BODIES) == 14
    assert 2 * len(JOINTS) + 1 + 1 == 3 * len(BODIES) == 42  # joints, lock and driver


def test_joints_tie_bodies_that_share_their_points_and_hold_every_body():
    for joint in JOINTS:
        for number in (joint.i, joint.j):
            if number == FRAME:
                assert joint.point in ("O", "C")
                continue
            ends = {BODIES[number].tail, BODIES[number].head}
            # A is the one joint that is not at the end of a link: a point of the rocker C-F
            assert joint.point in ends or (joint.point == "A" and ends == {"C", "F"})
    for number in range(len(BODIES)):  # two joints hold a body, or one and the lock
        points = {joint.point for joint in JOINTS if number in (joint.i, joint.j)}
        assert len(points) + (number in LOCK) >= 2


def test_the_construction_finds_each_point_from_points_known_before_it():
    known = ["O", "C", "P"]
    for step in CONSTRUCTION:
        ends = {step.first, step.second} if isinstance(step, Dyad) else {step.origin, step.toward}
        assert ends <= set(known)
        known.append(step.point)
    assert tuple(known) == POINTS
    assert set(BODY_LENGTHS) == set(LENGTHS) - {"CA"}  # A divides the rocker: no link of its own
    for body, name in zip(BODIES, BODY_LENGTHS, strict=True):
        assert {body.tail, body.head} == set(name)


def test_a_list_is_what_it_was_read_from():
    assert read_mechanism(PAPER.to_mapping()) == PAPER
    assert hash(read_mechanism(PAPER.to_mapping())) == hash(PAPER)
