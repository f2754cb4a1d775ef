"""Films of two policies in one episode: one above the other, and the shorter one waits."""

import numpy as np

from agents.film_pair import figures_of, paired


def flat(value, count):
    """Pictures that are one colour each."""
    return [np.full((2, 3, 3), value + k, np.uint8) for k in range(count)]


def test_the_shorter_film_stays_at_its_last_picture():
    found = list(paired(flat(0, 2), flat(100, 4)))
    assert [(int(one[0, 0, 0]), int(one[-1, 0, 0])) for one in found] == [
        (0, 100), (1, 101), (1, 102), (1, 103),
    ]  # fmt: skip
    assert found[0].shape == (4, 3, 3)


def test_figures_say_where_a_hoof_lands_and_leaves():
    """A leg of one hop a second, whose toe goes from 0.5 m ahead of the hip to 0.5 m behind it in a stance of
    a quarter of a second."""
    time = np.arange(0.0, 10.0, 0.005) + 0.0025
    phase = time % 1.0
    loaded = phase < 0.25
    columns = {name: np.zeros_like(time) for name in ("x", "heel_normal", "pitch")}
    columns |= {"time": time, "toe_x": np.where(loaded, 0.5 - 4 * phase, 0.0), "toe_normal": 1.0 * loaded}
    columns |= {"y": 1.5 + 0.1 * np.cos(2 * np.pi * time), "vx": np.full_like(time, 3.0)}
    text = figures_of([columns])
    assert text.startswith("10.0 s, pitch within 0 and 0 degrees")
    assert "1.0 hops a second, in the air for 0.75" in text
    assert "lands +0.49 m and leaves -0.49 m" in text
    assert "1.40 to 1.60 m high and goes at 3.0 to 3.0 m/s" in text


def test_of_a_horse_figures_say_how_long_it_stood():
    columns = {
        "time": np.array([0.5, 3.0]),
        "pitch": np.radians([-10.0, 5.0]),
        "left_fore_toe_x": np.zeros(2),
    }
    assert figures_of([columns]) == "3.0 s, pitch within -10 and 5 degrees"
