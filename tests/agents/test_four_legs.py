"""Gaits of a horse of four legs by CMA-ES."""

import json

import numpy as np
import pytest

from agents import four_legs, open_loop
from agents.four_legs import FALL, POPULATION, STARTS, Horse
from hoof_env.errors import DataFileError, ParameterError

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


def test_legs_are_apart_in_time_as_the_gait_says(horse):
    """However the cranks speed up and slow down: from one leg's angle half a stride leads to the other's."""
    x = np.random.default_rng(2).uniform(-0.8, 0.8, (8, horse.size))
    gaits, steps = horse.decode(x), 20_000
    phase = np.array([gaits["lead"], gaits["lead"] + 0.5, 0 * gaits["lead"], 0 * gaits["lead"] + 0.5])
    theta = horse.angles(gaits, phase)
    now, seconds = theta[[0, 2]], np.pi / gaits["rate"]
    for _ in range(steps):
        now = now + seconds / steps * horse.command(gaits, np.repeat(now, 2, axis=0))[[0, 2], 0]
    assert np.exp(1j * now) == pytest.approx(np.exp(1j * theta[[1, 3]]), abs=5e-3)


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
        for x in (np.zeros(horse.size), found["restarts"][0]["x"])
    )
    assert best < start
    assert len(found["gait"]["swing"]) == 2
    before = path.read_text()
    open_loop.main(arguments)  # nothing is left to search
    assert path.read_text() == before
    with pytest.raises(DataFileError, match=r"gait.json: expected searches with .*'spring': 20000.0"):
        open_loop.search_four_legs(
            open_loop.Args(family="four-legs", spring=2e4, episodes=6 * MANY, out=path, restarts=1)
        )


def test_what_does_not_fit_is_named():
    with pytest.raises(ParameterError, match=r"speed: expected .* got 0.0"):
        four_legs.asked(0.0, 2, 4e4, 2e6)
    with pytest.raises(ParameterError, match=r"harmonics: expected .* got 4"):
        four_legs.asked(1.0, 4, 4e4, 2e6)
    with pytest.raises(ParameterError, match=r"hoof_spring.stiffness: expected .* got 0.0"):
        four_legs.asked(1.0, 2, 0.0, 2e6)
    with pytest.raises(ParameterError, match=r"episodes: expected .* got 5"):
        four_legs.asked(1.0, 2, 4e4, 2e6, 5)
    with pytest.raises(ParameterError, match=r"froude: expected .* got 0.0"):
        four_legs.froude_speed(0.0)


@pytest.mark.parametrize(
    ("name", "value"), [("env_id", "other"), ("env_kwargs", ("trunk=rail",)), ("test_episodes", 7)]
)
def test_an_option_of_one_leg_is_refused(name, value):
    with pytest.raises(ParameterError, match=f"{name}: expected none of them with the family four-legs"):
        open_loop.search_four_legs(open_loop.Args(family="four-legs", **{name: value}))


def test_a_froude_number_asks_for_its_speed():
    assert four_legs.froude_speed(0.25) == pytest.approx(1.85, abs=0.01)
    assert four_legs.froude_speed(0.5) == pytest.approx(2.62, abs=0.01)
    with pytest.raises(ParameterError, match="speed, froude: expected one of them"):
        open_loop.search_four_legs(open_loop.Args(family="four-legs", speed=1.0, froude=0.25))


@pytest.mark.parametrize(("stop", "kept"), [(1, 0), (3, 2)])
def test_ctrl_c_keeps_what_was_found_and_says_so(monkeypatch, tmp_path, stop, kept):
    """Nothing before a generation is over; then the generations that there were."""
    play, calls, path = Horse.play, [], tmp_path / "gait.json"

    def interrupt(self, x, seed, *starts):
        calls.append(seed)
        if len(calls) == stop:
            raise KeyboardInterrupt
        return play(self, x, seed, *starts)

    monkeypatch.setattr(Horse, "play", interrupt)
    with pytest.raises(KeyboardInterrupt):
        open_loop.main(["--family", "four-legs", "--episodes", str(5 * MANY), "--out", str(path)])
    assert path.exists() == (kept > 0)
    if kept:
        found = json.loads(path.read_text())
        assert [(one["generations"], one["interrupted"]) for one in found["restarts"]] == [(kept, True)]
