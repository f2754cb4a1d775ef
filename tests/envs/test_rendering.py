"""The picture says what the trace says, needs no display, and a window survives what people do to it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from itertools import product

import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled, ResetNeeded

from hoof_env.dynamics.engine import LegEngine
from hoof_env.dynamics.trace import new_trace
from hoof_env.dynamics.trunk import Trunk
from hoof_env.envs.rendering import Renderer
from hoof_env.errors import ParameterError
from hoof_env.gait.parameters import LIMITS, load_gait
from hoof_env.ground.contact import Ground
from hoof_env.leg.geometry import load_geometry

pygame = pytest.importorskip("pygame")

GEOMETRY = load_geometry("first_fit")
SCENE = (slice(90, None), slice(0, 640))  # rows and columns of the scene, below its key and left of the panel
KEY = (slice(10, 31), slice(0, 64))  # of the key's arrow
VERMILION = (213, 94, 0)


def simulate(seconds: float, gait: str = "run", trunk: str = "suspended") -> list[np.ndarray]:
    """Traces of one reset and of every control step of 20 ms after it."""
    engine = LegEngine(GEOMETRY, Trunk(trunk, height=GEOMETRY.hip_height), Ground(), sim_dt=1e-3)
    parameters = load_gait(gait)
    traces = [engine.reset(parameters)]
    for _ in range(round(seconds / 0.02)):
        traces.append(new_trace(20))
        engine.advance(parameters.to_array(), traces[-1])
    return traces


@pytest.fixture(scope="module")
def run() -> list[np.ndarray]:
    return simulate(4.0)


def renderer(mode: str = "rgb_array", **options) -> Renderer:
    return Renderer(GEOMETRY, mode, 50, **options)


def draw(*traces: np.ndarray, **options) -> np.ndarray:
    """A frame of a fresh renderer that has seen `traces`."""
    picture = renderer(**options)
    for trace in traces:
        picture.add(trace)
    return picture.frame()


def loaded(run, normal: float, friction: float = 0.0) -> np.ndarray:
    """The trace of a reset, in flight, with a made-up force on the toe, 5 cm inside the ground."""
    trace = run[0].copy()
    trace["toe_normal"] = trace["normal"] = normal
    trace["toe_friction"] = trace["friction"] = friction
    trace["grf"] = np.hypot(normal, friction)
    trace["toe_penetration"], trace["cop_x"] = 0.05, trace["toe_x"]
    return trace


def vermilion(frame: np.ndarray, where: tuple[slice, slice] = SCENE) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the pixels in the force's colour."""
    rows, columns = np.nonzero((frame[where] == VERMILION).all(axis=-1))
    return rows + (where[0].start or 0), columns + (where[1].start or 0)


def test_a_frame_is_a_fresh_array_of_the_asked_size(run):
    picture = renderer(size=(640, 360), weight_n=856.0)
    picture.add(run[0])
    first = picture.frame()
    assert first.shape == (360, 640, 3)
    assert first.dtype == np.uint8
    assert first.flags.c_contiguous
    before = first.copy()
    first[:] = 0
    np.testing.assert_array_equal(picture.frame(), before)


def test_the_same_rows_give_the_same_frame_and_reset_forgets(run):
    again = renderer(weight_n=856.0)
    for trace in run[:60]:
        again.add(trace)
    again.frame()
    again.reset()
    for trace in run[60:80]:
        again.add(trace)
    np.testing.assert_array_equal(again.frame(), draw(*run[60:80], weight_n=856.0))
    assert (again.frame() != draw(*run[40:80], weight_n=856.0)).any()


def test_off_screen_frames_need_no_display(run):
    was_open = pygame.display.get_init()
    draw(*run[:2])
    assert pygame.display.get_init() == was_open
    code = (
        "import pygame, hoof_env.envs.rendering as r; from hoof_env.dynamics.trace import new_trace\n"
        "from hoof_env.leg.geometry import load_geometry\n"
        "picture = r.Renderer(load_geometry(), 'rgb_array', 50); picture.add(new_trace(3))\n"
        "print(picture.frame().shape, pygame.display.get_init())"
    )
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    env = {k: v for k, v in os.environ.items() if k not in hidden}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "(540, 960, 3) False"


def test_no_arrow_without_load(run):
    assert vermilion(draw(loaded(run, 0.0)))[0].size == 0


@pytest.mark.parametrize("normal", [600.0, 1500.0, 4000.0])
def test_the_arrow_is_as_long_as_its_key_says(run, normal):
    frame = draw(loaded(run, normal), weight_n=1000.0)  # full scale 5 kN, so the key's arrow is 1 kN
    key = np.ptp(vermilion(frame, KEY)[1]) + 1
    rows, columns = vermilion(frame)
    dot = 4.5  # radius of the point of application, below the tail
    assert np.ptp(rows) + 1 - dot == pytest.approx(key * normal / 1000, abs=3)
    assert np.ptp(columns) < 20  # upright


def test_the_arrow_leans_the_way_friction_acts(run):
    backward, forward = (vermilion(draw(loaded(run, 1000.0, f), weight_n=1000.0)) for f in (-400.0, 400.0))
    tip_of = [columns[np.argmin(rows)] for rows, columns in (backward, forward)]
    tail_of = [columns[np.argmax(rows)] for rows, columns in (backward, forward)]
    assert abs(tail_of[0] - tail_of[1]) <= 4
    assert tip_of[0] < tail_of[0] - 8
    assert tip_of[1] > tail_of[1] + 8


def test_the_ground_scrolls_under_the_trunk_by_its_ticks(run):
    def ticks(x: float) -> np.ndarray:
        trace = run[0].copy()
        trace["trunk_x"] += x
        frame = draw(trace)
        line = np.nonzero((frame[:, 0] == (112, 95, 66)).all(axis=-1))[
            0
        ].max()  # the ground line at the left edge
        return frame[line + 2]

    np.testing.assert_array_equal(ticks(60.0), ticks(0.0))
    assert (ticks(60.25) != ticks(0.0)).any()


PICTURES = [renderer(size=size) for size in ((600, 540), (960, 540), (1400, 540))]


@pytest.mark.parametrize("height", [0.5, 0.88, 1.0, 1.12, 2.1])
def test_the_leg_is_always_in_the_picture(height):
    row = new_trace(1)[0]
    row["trunk_x"], row["trunk_y"] = -37.3, height * GEOMETRY.hip_height
    for theta in np.linspace(0, 2 * np.pi, 36, endpoint=False):
        for offset, a, b in product(*list(LIMITS.values())[1:]):
            row["theta"], row["phi"] = theta, offset + a * np.sin(theta) + b * np.cos(theta)
            for picture in PICTURES:
                z = np.array(list(picture._scene.look_at(row).values()))
                assert ((z.real > 0) & (z.real < picture._panel._box.left)).all()
                assert ((z.imag > 0) & (z.imag < picture.size[1])).all()


def test_stance_peaks_are_the_highest_force_of_each_contact(run):
    picture = renderer()
    for trace in run:
        picture.add(trace)
    rows = np.concatenate(run)
    inside = (rows["toe_penetration"] > 0) | (rows["heel_penetration"] > 0)
    edges = np.flatnonzero(np.diff(inside.astype(int), prepend=0, append=0))
    peaks = []
    for first, end in edges.reshape(-1, 2):
        top = rows[first:end][np.argmax(rows["grf"][first:end])]
        if top["t"] >= rows["t"][-1] - 3:
            peaks.append((top["t"], top["grf"]))
    assert len(peaks) >= 3
    np.testing.assert_allclose(list(picture._panel.peaks), peaks)
    assert picture._panel.full_scale == 5000  # of 1, 2, 5 the first above 4.4 kN


def test_rows_that_are_not_finite_are_left_out(run):
    broken = run[1].copy()
    broken["theta"][-1] = np.nan
    broken["grf"][-2] = np.inf
    np.testing.assert_array_equal(draw(run[0], broken), draw(run[0], run[1][:-2]))


def test_a_window_shows_the_frame_at_its_pace_and_closes(run, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    window = renderer("human")
    try:
        started = time.perf_counter()
        for trace in run[:6]:
            window.add(trace)
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
    window.add(run[0])
    window.frame()
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    for trace in run[1:3]:
        window.add(trace)
        assert window.frame() is None
        assert not pygame.display.get_init()
    window.close()


def test_another_environment_may_quit_pygame(run, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    picture, window = renderer(), renderer("human")
    for one in (picture, window):
        one.add(run[0])
        one.frame()
    pygame.quit()
    for one in (picture, window):
        one.add(run[1])
        one.frame()
    np.testing.assert_array_equal(picture.frame(), draw(*run[:2]))
    window.close()


def test_bad_input_is_named():
    with pytest.raises(ParameterError, match=r"render_mode: expected one of human, rgb_array, got 'ansi'"):
        renderer("ansi")
    for size in ((960,), (100, 100), (960.5, 540), "wide", None):
        with pytest.raises(ParameterError, match="size: expected"):
            renderer(size=size)
    with pytest.raises(ParameterError, match="fps"):
        Renderer(GEOMETRY, "rgb_array", 0)
    with pytest.raises(ParameterError, match="weight_n"):
        renderer(weight_n=-1.0)
    with pytest.raises(ResetNeeded, match="reset"):
        renderer().frame()


def test_without_pygame_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(DependencyNotInstalled, match=r'pip install "hoof-env\[render\]"'):
        renderer()
