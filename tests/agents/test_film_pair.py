"""Films of two policies in one episode: one above the other, and the shorter one waits."""

import numpy as np

from agents.film_pair import paired


def flat(value, count):
    """Pictures that are one colour each."""
    return [np.full((2, 3, 3), value + k, np.uint8) for k in range(count)]


def test_the_shorter_film_stays_at_its_last_picture():
    found = list(paired(flat(0, 2), flat(100, 4)))
    assert [(int(one[0, 0, 0]), int(one[-1, 0, 0])) for one in found] == [
        (0, 100), (1, 101), (1, 102), (1, 103),
    ]  # fmt: skip
    assert found[0].shape == (4, 3, 3)
