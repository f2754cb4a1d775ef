"""The game without a window, driven by names of keys; then with a window that nobody sees."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from hoof_env import cli
from hoof_env.errors import HoofEnvError, ParameterError
from hoof_env.gait import PARAMETERS
from hoof_env.play import HELD, HELP, Game, play
from hoof_env.records import make_env

pygame = pytest.importorskip("pygame")

LEG = "hoof_env/HorseLeg-v0"


@pytest.fixture
def env():
    with make_env(LEG, {"episode_seconds": 0.4}) as env:
        yield env


def spy_on(env):
    """The rewards of the steps from here on."""
    rewards, step = [], env.unwrapped.step
    env.unwrapped.step = lambda action: rewards.append((result := step(action))[1]) or result
    return rewards


def gait_of(env):
    """Gait parameters at present."""
    return np.array([env.unwrapped.engine.state[name].item() for name in PARAMETERS])


@pytest.mark.parametrize("key", HELD)
def test_a_held_key_moves_its_parameter_and_no_other(env, key):
    game, before = Game(env, seed=3), gait_of(env)
    entry, way = HELD[key]
    for _ in range(5):
        game.tick({key})
        np.testing.assert_array_equal(game.action, way * np.eye(4)[entry])
    moved = gait_of(env) - before
    assert way * moved[entry] > 0.01
    np.testing.assert_array_equal(np.delete(moved, entry), 0.0)
    commanded = [getattr(game.news[-1], f"command_{name}") for name in PARAMETERS]
    assert way * (commanded[entry] - gait_of(env)[entry]) > 0
    game.tick()  # a key that is let go of leaves the gait where it is
    np.testing.assert_array_equal(game.action, 0.0)


def test_keys_held_against_each_other_cancel():
    """The last one counts while both are held."""
    with make_env(LEG, {}) as env:
        game, before = Game(env), gait_of(env)
        for pair in (["left", "right"], ["right", "left"]) * 5:
            game.tick(pair)
            assert np.abs(game.action[1]) == 1.0
        assert abs(gait_of(env)[1] - before[1]) < 0.02
        game.tick(["nothing"])
        np.testing.assert_array_equal(game.action, 0.0)


@pytest.mark.parametrize("seed", range(3))
def test_the_leg_starts_in_its_gait_and_a_digit_goes_to_another(seed):
    with make_env(LEG, {}) as env:
        game = Game(env, seed=seed)
        first, before = game.news[0], gait_of(env)
        assert first.time == 0
        assert first.command_crank_speed == first.crank_angle_rate
        game.tick()
        np.testing.assert_array_equal(gait_of(env), before)
        for number, name in enumerate(game.gaits, 1):
            game.press(str(number))
            for _ in range(100):
                expected = env.unwrapped.action_for(name)
                game.tick()
                np.testing.assert_array_equal(game.action, expected)
            np.testing.assert_allclose(gait_of(env), env.unwrapped.gaits[name].to_array(), atol=1e-4)


def test_zero_stops_the_crank_and_keeps_the_swing():
    with make_env(LEG, {}) as env:
        game, before = Game(env, seed=4), gait_of(env)
        game.press("0")
        for key in ("9", "x", "f1", "²"):  # which mean nothing
            game.press(key)
        for _ in range(100):
            game.tick()
        np.testing.assert_allclose(gait_of(env), [0.0, *before[1:]], atol=1e-5)
        game.press("1")
        game.tick(["up"])  # who holds a key has it in hand
        game.tick()
        np.testing.assert_array_equal(game.action, 0.0)


def test_the_score_is_the_return_and_the_end_is_told(env):
    game, rewards = Game(env, seed=1), spy_on(env)
    for _ in range(30):
        game.tick(["up"])
    assert len(rewards) == 20  # 0.4 s
    assert game.score == pytest.approx(sum(rewards))
    assert game.ended
    assert game.status == "over: time is up; r starts again"
    assert game.news == []
    game.press("r")
    assert (game.ended, game.score, game.status) == (False, 0.0, "")
    game.tick()
    assert game.news[-1].time == pytest.approx(game.dt)


def test_a_pause_stops_the_clock(env):
    game = Game(env)
    game.tick()
    game.press("space")
    game.tick(["up"])
    assert (game.paused, game.news, game.status) == (True, [], "paused; space goes on")
    game.press("space")
    game.tick()
    assert game.news[-1].time == pytest.approx(2 * game.dt)
    game.press("q")
    assert game.quit


@pytest.mark.parametrize("env_id", ["hoof_env/HorseLegFixed-v0", LEG])
def test_a_new_episode_starts_in_the_gait_that_was_chosen_last(env_id):
    with make_env(env_id) as env:
        game = Game(env)
        game.press(str(game.gaits.index("run") + 1))
        game.tick()
        game.press("r")
        np.testing.assert_array_equal(game.action, 0)
        game.tick()
        np.testing.assert_array_equal(gait_of(env), env.unwrapped.gaits["run"].to_array())
        game.tick(["down"])
        assert game.news[-1].command_crank_speed < game.news[0].crank_angle_rate


def test_a_vector_reward_scores_by_its_sum():
    with make_env("hoof_env/HorseLegMO-v0", {"episode_seconds": 0.1}) as env:
        game, rewards = Game(env), spy_on(env)
        for _ in range(5):
            game.tick()
        assert game.score == pytest.approx(np.sum(rewards))
        assert game.ended


def test_every_key_is_explained():
    words = ", ".join(keys for column in HELP for keys, _ in column)
    assert all(key in words.split(", ") for key in HELD)


def shown(monkeypatch, keys_at: dict[int, int]):
    """Key events that arrive before the given frame, and a picture of every frame."""
    pictures = []
    flip = pygame.display.flip

    def watch():
        flip()
        pictures.append(pygame.surfarray.array3d(pygame.display.get_surface()).transpose(1, 0, 2))
        if len(pictures) in keys_at:
            pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=keys_at[len(pictures)]))

    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(pygame.display, "flip", watch)
    return pictures


def test_a_window_shows_leg_score_and_keys_until_it_is_left(monkeypatch):
    pictures = shown(monkeypatch, {3: pygame.K_SPACE, 6: pygame.K_SPACE, 8: pygame.K_r, 12: pygame.K_ESCAPE})
    game = play(LEG, slow=0.2, size=(640, 360), most_ticks=100)
    assert game.quit
    assert len(pictures) == 13
    assert pictures[0].shape == (360 + 64, 640, 3)
    strip = pictures[0][362:]
    assert (strip != 255).any(axis=-1).mean() > 0.02  # words
    assert (pictures[4] != pictures[2]).any()  # it says that it is paused,
    np.testing.assert_array_equal(pictures[4], pictures[5])  # and is
    assert not pygame.display.get_init()


def test_closing_the_window_leaves_the_game(monkeypatch):
    pictures = shown(monkeypatch, {})
    monkeypatch.setattr(pygame.event, "get", lambda: [pygame.event.Event(pygame.QUIT)])
    assert play(LEG, size=(640, 360), most_ticks=100).quit
    assert len(pictures) <= 1


def test_a_machine_without_a_display_gets_one_line():
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    code = f"import os\nfor name in {hidden}: os.environ.pop(name, None)\n"
    code += "import sys; from hoof_env import cli; sys.exit(cli.main(['play']))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    if done.returncode == 0:  # macOS and Windows always have one
        pytest.skip("this system has a display")
    assert done.returncode == 2
    errors = [line for line in done.stderr.splitlines() if line.startswith("hoof-env: error")]
    assert len(errors) == 1
    assert "a window needs a display" in errors[0]
    assert "Traceback" not in done.stderr


def test_bad_requests_are_refused(monkeypatch, capsys):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with pytest.raises(ParameterError, match="slow: expected"):
        play(LEG, slow=0.0)
    assert cli.main(["play", "--size", "10", "10"]) == 2
    assert "size: expected" in capsys.readouterr().err
    assert cli.main(["play", "--id", "CartPole-v1"]) == 2
    assert not pygame.display.get_init()
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(HoofEnvError, match=r'pip install "hoof-env\[render\]"'):
        play(LEG)
