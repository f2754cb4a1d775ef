"""A window survives what people do to it; a machine without a display or pygame is told; letters, and what
is drawn under either pygame."""

from __future__ import annotations

import sys
import time
import warnings

import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled, ResetNeeded

from hoof_env.errors import ParameterError
from hoof_env.render.brush import Brush
from tests.render.drawn import VERMILION, add, draw, renderer

pygame = pytest.importorskip("pygame")


def test_a_window_shows_the_frame_at_its_pace_and_closes(run, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    window = renderer("human")
    try:
        started = time.perf_counter()
        for step in run[:6]:
            add(window, step)
            assert window.frame() is None
        assert time.perf_counter() - started > 5 / 50 * 0.9
        shown = pygame.surfarray.array3d(pygame.display.get_surface()).transpose(1, 0, 2)
        np.testing.assert_array_equal(shown, draw(*run[:6]))
    finally:
        window.close()
    assert not pygame.display.get_init()
    window.close()
    assert window.frame() is None


def test_a_window_that_somebody_closed_stays_closed(run, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    window = renderer("human")
    add(window, run[0])
    window.frame()
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    for step in run[1:3]:
        add(window, step)
        assert window.frame() is None
        assert not pygame.display.get_init()
    window.close()


def test_another_environment_may_quit_pygame(run, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    picture, window = renderer(), renderer("human")
    for one in (picture, window):
        add(one, run[0])
        one.frame()
    pygame.quit()
    for one in (picture, window):
        add(one, run[1])
        one.frame()
    np.testing.assert_array_equal(picture.frame(), draw(*run[:2]))
    window.close()


def test_a_window_without_a_display_is_reported_not_drawn_unseen_in_silence(run, monkeypatch):
    """SDL falls back to a driver that shows nothing; only who asks for it gets it without a word. Gymnasium's
    checker tries every mode, so that on a machine without a display the mode warns and goes on."""
    words = r'a window needs a display.*render_mode="rgb_array".*xvfb-run'
    no_display(monkeypatch)
    window = renderer("human")
    add(window, run[0])
    no_display(monkeypatch)
    with pytest.warns(UserWarning, match=words):
        window.frame()
    window.close()
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    window = renderer("human")
    add(window, run[0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        window.frame()
    assert pygame.display.get_driver() == "dummy"
    window.close()


def no_display(monkeypatch):
    """Have pygame's display open on a driver that shows nothing, for which nobody asked."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame.display.init()
    monkeypatch.delenv("SDL_VIDEODRIVER")


ONLY_CE = {
    "": ("FRect", "Window", "Font", "Clock", "Event"),
    "draw": ("aacircle", "flood_fill"),
    "transform": ("box_blur", "gaussian_blur", "hsl", "invert", "pixelate", "solid_overlay"),
    "display": ("get_desktop_refresh_rates", "is_vsync", "message_box", "set_window_position"),
}
"""What pygame-ce has and pygame, which `gymnasium[classic-control]` installs, lacks."""


def test_nothing_is_drawn_with_what_only_pygame_ce_has(run, monkeypatch):
    expected = draw(*run[:80], weight_n=856.0)
    for module, names in ONLY_CE.items():
        for name in names:
            monkeypatch.delattr(getattr(pygame, module) if module else pygame, name, raising=False)
    np.testing.assert_array_equal(draw(*run[:80], weight_n=856.0), expected)


@pytest.mark.parametrize("text", ["forward speed", "1.23", "O"])
def test_letters_are_finer_ones_scaled_down(text):
    """`premul_alpha` of pygame, not of pygame-ce, takes the padding of a row of letters for pixels."""
    letters = Brush((960, 540))._paint_letters(text, 21, VERMILION)
    fine = pygame.font.Font(None, 42).render(text, True, VERMILION)
    expected = pygame.Surface(fine.get_size(), pygame.SRCALPHA, 32)
    alpha = pygame.surfarray.array_alpha(fine)
    pygame.surfarray.pixels_alpha(expected)[:] = alpha
    pygame.surfarray.pixels3d(expected)[:] = np.round(alpha[..., None] / 255 * VERMILION)
    expected = pygame.transform.smoothscale(expected, letters.get_size())
    for read in (pygame.surfarray.array3d, pygame.surfarray.array_alpha):
        np.testing.assert_allclose(read(letters).astype(int), read(expected).astype(int), atol=2)


@pytest.mark.parametrize("quit", [pygame.quit, pygame.font.quit, lambda: (pygame.quit(), pygame.font.init())])
def test_letters_survive_whoever_quits_pygame(quit):
    """A font of before crashes the whole process in pygame, and pygame-ce refuses it."""
    canvas = pygame.Surface((200, 50), 0, 32)
    brush = Brush((960, 540))
    for text in ("one", "two"):
        brush.write(canvas, text, (10, 10), 21, VERMILION, "topleft")
        quit()


def test_bad_input_is_named():
    with pytest.raises(ParameterError, match=r"render_mode: expected .*human, rgb_array, got 'ansi'"):
        renderer("ansi")
    for size in ((960,), (100, 100), (9000, 540), (960, 10**9), (960.5, 540), "wide", None):
        with pytest.raises(ParameterError, match="size: expected"):
            renderer(size=size)
    with pytest.raises(ParameterError, match="fps"):
        renderer(fps=0)
    with pytest.raises(ParameterError, match="weight_n"):
        renderer(weight_n=-1.0)
    with pytest.raises(ResetNeeded, match="reset"):
        renderer().frame()


def test_without_pygame_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(DependencyNotInstalled, match=r'pip install "hoof-env\[render\]"'):
        renderer()
