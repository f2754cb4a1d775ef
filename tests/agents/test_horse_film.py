"""Films of the horse's gaits: what they show is what was played, and it can be read."""

import numpy as np
import pytest

from agents import horse_film
from agents.gait_figures import froude_of
from hoof_env.tasks.horse_gaits import kinematic_speeds

WALK = "kinematic-walk"


@pytest.fixture(scope="module")
def filmed():
    return horse_film.play(WALK, 1.0, 0)


def test_the_strides_of_a_film_are_the_gait_s(filmed):
    assert filmed.speed == pytest.approx(kinematic_speeds()[WALK], rel=0.05)
    # The mean of the normal force over whole strides is the weight
    assert filmed.normal.sum(1).mean() == pytest.approx(9.81, rel=0.03)
    for leg in range(4):
        borne = sum(end - began for of_leg, began, end in filmed.stances if of_leg == leg)
        loaded = np.count_nonzero(filmed.normal[:, leg] > 0.05 * 9.81 / 4)
        assert borne == pytest.approx(loaded * np.diff(filmed.time).mean(), abs=0.05)


def test_a_pony_s_film_says_its_own_mass():
    pony = horse_film.play(WALK, 0.7, 0)
    assert pony.mass == pytest.approx(0.7**3 * 475, rel=1e-4)
    horse = kinematic_speeds()[WALK]
    assert froude_of(pony.speed, pony.height) == pytest.approx(froude_of(horse, 1.4), rel=0.1)
    figure, _ = horse_film.panel(pony, "walk")
    assert f"{pony.mass:.0f} kg" in " ".join(text.get_text() for text in figure.texts)


def test_letters_are_large_enough_for_a_front_page(filmed):
    figure, _ = horse_film.panel(filmed, "walk")
    assert figure.get_figwidth() * figure.dpi == pytest.approx(800)
    figure.draw_without_rendering()
    texts = figure.findobj(lambda one: hasattr(one, "get_fontsize") and one.get_text().strip())
    assert min(one.get_fontsize() for one in texts) * figure.dpi / 72 >= 12 - 1e-9


def test_frames_differ_in_the_animal_and_in_the_present_time(filmed):
    frames = horse_film.frames_of(filmed, "walk")
    first, second = next(frames), next(frames)
    assert first.shape == (horse_film.HEIGHT, horse_film.WIDTH, 3)
    wide, tall = horse_film.SCENE
    assert (first[:tall, :wide] != second[:tall, :wide]).any()
    assert (first[tall:] != second[tall:]).any()
    assert (first[tall:] == second[tall:]).mean() > 0.98
