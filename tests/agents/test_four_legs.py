"""Gaits of a horse of four legs by CMA-ES."""

import json

import numpy as np
import pytest

from agents import four_legs, open_loop
from agents.four_legs import FALL, POPULATION, STARTS, Horse
from hoof_env.errors import ParameterError

MANY = POPULATION * STARTS


@pytest.fixture(scope="module")
def horse():
    return Horse(MANY, speed=1.85)


def test_every_gait_of_the_box_is_one(horse):
    """Speeds that the crank has, left and right half a turn apart, turns that last as long as they say."""
    x = np.random.default_rng(0).uniform(-1, 1, (MANY, horse.size))
    gaits, theta = horse.decode(x), np.linspace(0, 2 * np.pi, MANY, endpoint=False)
    command = horse.command(gaits, np.tile(theta, (4, 1)))
    assert command.shape == (4, 6, MANY)
    assert (command[:, 0] >= 0.5).all()
    assert (command[:, 0] <= 4 * np.pi).all()
    assert (command[0, 1:] == command[1, 1:]).all()
    one = {name: values[:1].repeat(MANY, 0) for name, values in horse.decode(0.2 * x).items()}
    slowness = 1 / horse.command(one, np.tile(theta, (4, 1)))[:, 0]
    assert slowness.mean(1) == pytest.approx(np.full(4, 1 / one["rate"][0]))


def test_who_falls_pays_more_the_sooner(horse):
    x = np.random.default_rng(1).uniform(-1, 1, (MANY, horse.size))
    played = horse.play(x, 0)
    fell = played["fell"] == 1
    assert fell.sum() > 0
    assert (played["cost"][fell] >= FALL).all()
    assert (played["cost"][~fell] <= FALL).all()
    assert np.isfinite(played["cost"]).all()
    again = horse.play(x, 0)
    assert (again["cost"] == played["cost"]).all()


def test_a_short_search_finds_better_than_it_began_with_and_writes_it(tmp_path, capsys):
    path = tmp_path / "gait.json"
    arguments = ["--family", "four-legs", "--restarts", "1", "--episodes", str(6 * MANY), "--out", str(path)]
    open_loop.main(arguments)
    found = json.loads(path.read_text())
    assert f"written: {path}" in capsys.readouterr().out
    horse = Horse(MANY, found["speed"], found["harmonics"], found["spring"], found["stiffness"])
    start, best = (
        horse.play(np.tile(x, (MANY, 1)), 99)["cost"].mean()
        for x in (np.zeros(horse.size), found["searches"][0]["x"])
    )
    assert best < start
    assert len(found["gait"]["swing"]) == 2


def test_what_does_not_fit_is_named(tmp_path):
    with pytest.raises(ParameterError, match=r"speed: expected .* got 0.0"):
        four_legs.optimise(0.0, 2, 4e4, 2e6, 1)
    with pytest.raises(ParameterError, match=r"harmonics: expected .* got 4"):
        four_legs.optimise(1.0, 4, 4e4, 2e6, 1)
    with pytest.raises(ParameterError, match=r"hoof_spring.stiffness: expected .* got 0.0"):
        four_legs.optimise(1.0, 2, 0.0, 2e6, 1)
    with pytest.raises(ParameterError, match="expected none of them with the family four-legs"):
        open_loop.search_four_legs(open_loop.Args(family="four-legs", env_kwargs=("trunk=rail",)))
