"""The picture says what the trace says."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from itertools import product

import gymnasium as gym
import numpy as np
import pytest

from hoof_env.dynamics.engine import TrunkEngine
from hoof_env.dynamics.parts import Limb, Trunk
from hoof_env.envs.policies import make_policy
from hoof_env.gait import LIMITS, PARAMETERS, GaitParameters
from hoof_env.ground.contact import Ground
from hoof_env.ground.terrain import Terrain
from hoof_env.leg.geometry import load_geometry
from hoof_env.leg.mechanism_list import flesh_of
from hoof_env.record.columns import columns_of_engine
from hoof_env.record.instant import Instant, leg_instants
from hoof_env.record.surroundings import Surroundings
from hoof_env.render.brush import FINE, Brush
from hoof_env.render.colours import COAT, HOOF, LINK
from hoof_env.render.drawing import Drawing
from hoof_env.render.ground import footprint
from hoof_env.render.kinds import find_patches, kinds_of
from hoof_env.render.outline import TRUNK_M
from hoof_env.render.panel import Stances
from hoof_env.render.renderer import Renderer
from tests.leg.mechanisms import lambda_leg
from tests.render.drawn import (
    BLUE,
    GEOMETRY,
    KEY,
    LINE,
    PURPLE,
    VERMILION,
    add,
    body,
    draw,
    loaded,
    pixels,
    points,
    renderer,
    simulate,
)

pygame = pytest.importorskip("pygame")


def test_a_frame_is_a_fresh_array_of_the_asked_size(run):
    picture = renderer(size=(640, 360), weight_n=856.0)
    add(picture, run[0])
    first = picture.frame()
    assert first.shape == (360, 640, 3)
    assert first.dtype == np.uint8
    assert first.flags.c_contiguous
    before = first.copy()
    first[:] = 0
    np.testing.assert_array_equal(picture.frame(), before)


def test_the_same_rows_give_the_same_frame_and_reset_forgets(run):
    again = renderer(weight_n=856.0)
    for steps in (run[:60], run[60:80]):
        again.reset()
        for step in steps:
            add(again, step)
        again.frame()
    np.testing.assert_array_equal(again.frame(), draw(*run[60:80], weight_n=856.0))
    assert (again.frame() != draw(*run[40:80], weight_n=856.0)).any()


def test_off_screen_frames_need_no_display(run):
    was_open = pygame.display.get_init()
    draw(*run[:2])
    assert pygame.display.get_init() == was_open
    code = (
        "import pygame, gymnasium, hoof_env\n"
        "env = gymnasium.make('hoof_env/HorseLeg-v0', render_mode='rgb_array'); env.reset()\n"
        "print(env.render().shape, pygame.display.get_init())"
    )
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
    env = {k: v for k, v in os.environ.items() if k not in hidden}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "(540, 960, 3) False"


def test_no_arrow_without_load(run):
    for colour in (VERMILION, BLUE, PURPLE):
        assert pixels(draw(loaded(run, 0.0)), colour)[0].size == 0


@pytest.mark.parametrize("normal", [600.0, 1500.0, 4000.0])
def test_the_arrow_is_as_long_as_its_key_says(run, normal):
    frame = draw(loaded(run, normal), weight_n=1000.0)  # full scale 5 kN, so the key's arrow is 1 kN
    key = np.ptp(pixels(frame, VERMILION, KEY)[1]) + 1
    rows, columns = pixels(frame, BLUE)
    dot = 2.25  # radius of the point of application, below the tail
    assert np.ptp(rows) + 1 - dot == pytest.approx(key * normal / 1000, abs=3)
    assert np.ptp(columns) < 12  # upright
    assert pixels(frame, VERMILION)[0].size > rows.size / 2  # the whole hoof's arrow is behind it, wider


def test_the_arrow_leans_the_way_friction_acts(run):
    backward, forward = (pixels(draw(loaded(run, 1000.0, f), weight_n=1000.0), BLUE) for f in (-400.0, 400.0))
    tip_of = [columns[np.argmin(rows)] for rows, columns in (backward, forward)]
    tail_of = [columns[np.argmax(rows)] for rows, columns in (backward, forward)]
    assert abs(tail_of[0] - tail_of[1]) <= 4
    assert tip_of[0] < tail_of[0] - 8
    assert tip_of[1] > tail_of[1] + 8


def test_each_point_has_its_arrow_where_it_is(run):
    (now,) = loaded(run, 300.0, heel=600.0, heel_y=-0.04, heel_depth=0.04)
    frame = draw([now], weight_n=1000.0)
    (toe_rows, toe_columns), (heel_rows, heel_columns) = pixels(frame, BLUE), pixels(frame, PURPLE)
    assert np.ptp(heel_rows) > 1.6 * np.ptp(toe_rows)
    ahead = np.sign(now.toe_x - now.heel_x)
    assert ahead * (np.median(toe_columns) - np.median(heel_columns)) > 5


def test_the_ground_scrolls_under_the_trunk_by_its_ticks(run):
    def ticks(x: float) -> np.ndarray:
        now = run[0][0]
        frame = draw([now._replace(x=now.x + x)])
        line = np.nonzero((frame[:, 5] == LINE).all(axis=-1))[0].max()  # the ground at the left edge
        return frame[line + 4, :640]

    np.testing.assert_array_equal(ticks(60.0), ticks(0.0))
    assert (ticks(60.25) != ticks(0.0)).any()


def written(monkeypatch) -> list[tuple[str, float, float, int]]:
    """Return a list that gets, of each text, its left and right edge and the middle of its height."""
    found = []
    write = Brush.write

    def noted(self, canvas, text, at, size, colour, side="midleft"):
        image = self._letters(text, size, colour)
        place = image.get_rect(**{side: (round(at[0]), round(at[1]))})
        found.append((text, place.left, place.right, place.centery))
        write(self, canvas, text, at, size, colour, side)

    monkeypatch.setattr(Brush, "write", noted)
    return found


@pytest.mark.parametrize("size", [(960, 540), (480, 270)])
def test_labels_of_the_ruler_are_whole(run, monkeypatch, size):
    """Neither the panel nor an edge cuts one, wherever the trunk is."""
    found = written(monkeypatch)
    picture = renderer(size=size)
    (now,) = run[0]
    for x in np.arange(100.0, 102.0, 0.05):
        add(picture, [now._replace(x=x, toe_x=now.toe_x + x, heel_x=now.heel_x + x)])
        picture.frame()
    labels = [(left, right) for text, left, right, _ in found if text.endswith(" m")]
    assert len(labels) > 150
    assert min(left for left, _ in labels) >= 0
    assert max(right for _, right in labels) <= picture._panel._box.left


@pytest.mark.parametrize("env_id", ["hoof_env/HorseLeg-v0", "hoof_env/Horse-v0"])
@pytest.mark.parametrize(("size", "least"), [((480, 270), 10), ((640, 360), 12), ((960, 540), 12)])
def test_letters_are_readable_and_no_text_of_the_panel_lies_on_another(env_id, size, least, monkeypatch):
    places = []
    write = Brush.write

    def noted(self, canvas, text, at, letters, colour, side="midleft"):
        assert self._font(letters).get_height() >= pygame.font.Font(None, FINE * least).get_height()
        image = self._letters(text, letters, colour)
        places.append((text, image.get_rect(**{side: (round(at[0]), round(at[1]))})))
        write(self, canvas, text, at, letters, colour, side)

    monkeypatch.setattr(Brush, "write", noted)
    env = gym.make(env_id, render_mode="rgb_array", width=size[0], height=size[1])
    env.reset(seed=0)
    for _ in range(20):
        env.step(np.zeros(env.action_space.shape, np.float32))
    env.render()
    lines = [(text, place) for text, place in places if place.left > 0.66 * size[0]]
    assert {"time", "forward speed", "time before now, s"} <= {text for text, _ in lines}
    for k, (text, place) in enumerate(lines):
        assert place.right < size[0], text
        for other, beside in lines[:k]:
            assert not place.colliderect(beside), (text, other)


@pytest.mark.parametrize("friction", [-900.0, -400.0, 0.0, 400.0, 900.0])
def test_no_arrow_crosses_its_own_number(run, monkeypatch, friction):
    """It has the same pixels as the arrow of the same force without a number."""
    found = written(monkeypatch)
    step = loaded(run, 1000.0, friction)
    draw(step, weight_n=1000.0)
    ((left, right, middle),) = [place for text, *place in found if re.fullmatch(r"[\d.]+ kN", text)]
    box = slice(middle - 6, middle + 7), slice(left, right)
    monkeypatch.setattr(Brush, "write", lambda *_: None)
    bare = draw(step, weight_n=1000.0)
    for colour in (VERMILION, BLUE, PURPLE, (255, 255, 255)):
        assert not len(pixels(bare, colour, box)[0])


def test_a_rod_beyond_its_dyad_is_as_thick_as_a_link():
    """A coupler with its foot in a straight line: its plate has no area."""
    leg = lambda_leg()
    picture = Renderer(Surroundings(leg, trunk="fixed"))
    engine = TrunkEngine(Limb(leg), Trunk("fixed", height=leg.hip_height), Ground())
    engine.reset(GaitParameters(0.0, 0.0, 0.0, 0.0), 1.0)
    add(picture, leg_instants(columns_of_engine(engine.state | engine.report)))
    frame = picture.frame()
    at = picture._scene.look_at(picture.latest)[0]
    wide = {}
    for a, b in (("P", "B"), ("B", "F")):
        middle = 0.5 * (at[a] + at[b])
        across = 1j * (at[b] - at[a]) / abs(at[b] - at[a])
        places = [middle + d * across for d in np.arange(-6.0, 6.1, 0.25)]
        wide[a + b] = sum(tuple(frame[round(z.imag), round(z.real)]) == LINK for z in places)
    assert wide["BF"] == pytest.approx(wide["PB"], rel=0.3)
    assert wide["PB"] > 6


def test_a_page_draws_the_rod_of_a_foot_beyond_its_dyad():
    """A link of its row ends in the foot, as one ends in each other point."""
    leg = lambda_leg()
    drawing = Drawing(Surroundings(leg, trunk="fixed"), numbers=0)
    engine = TrunkEngine(Limb(leg), Trunk("fixed", height=leg.hip_height), Ground())
    engine.reset(GaitParameters(0.0, 0.0, 0.0, 0.0), 1.0)
    (now,) = leg_instants(columns_of_engine(engine.state | engine.report))
    row = drawing.row(body(now), [])
    assert len(row) == drawing.length
    x, y = (
        row[place.start : place.start + place.pieces * place.length]
        for place in drawing.places
        if place.source == "near_links"
    )
    ends = np.hypot(x - now.toe_x, y - now.toe_y)
    assert ends.min() < 1e-6


def surface(frame: np.ndarray, column: int) -> int:
    """Row of the ground's line in a column."""
    far = np.abs(frame[300:, column] - np.array(LINE)).sum(axis=-1)
    return 300 + int(np.nonzero(far < 90)[0][0])


def test_the_ground_is_as_high_as_the_terrain(run):
    """A rise of 0.2 m a metre ahead; the metre marks of level ground say how long a metre is."""
    level = draw(run[0])
    metre = renderer()._scene._scale  # pixels between two ticks, seen below
    row = surface(level, 5) + 8
    ticks = np.flatnonzero((level[row, :640] == LINE).all(axis=-1))
    assert np.diff(ticks)[np.diff(ticks) > 2] == pytest.approx(metre, abs=2)
    terrain = Terrain.through([-50.0, 1.0, 1.1, 50.0], [0.0, 0.0, 0.2, 0.2])
    frame = draw(run[0], terrain=terrain)
    assert surface(frame, 10) - surface(frame, 600) == pytest.approx(0.2 * metre, abs=2)
    assert surface(level, 10) == surface(level, 600)


def test_the_hoof_is_of_horn_and_the_leg_of_flesh(run):
    """Horn lies between toe and heel; below the trunk, which has the same coat, there is flesh."""
    frame = draw(run[0])
    now = run[0][0]
    metre = renderer()._scene._scale
    rows, columns = pixels(frame, HOOF)
    sole = abs(complex(now.toe_x - now.heel_x, now.toe_y - now.heel_y)) * metre
    assert len(rows) > 0.05 * sole**2
    assert 0.8 * sole < np.hypot(np.ptp(rows), np.ptp(columns)) < 1.5 * sole
    rows, columns = pixels(frame, COAT)
    below_trunk = rows > surface(frame, 10) - 0.8 * GEOMETRY.hip_height * metre
    assert below_trunk.sum() > 0.02 * metre**2


def test_limbs_are_as_thick_as_the_flesh_of_the_leg(run):
    """Across the middle of each part; a part that another one covers looks no thinner."""
    picture = renderer()
    scene = picture._scene
    places = points(picture, run[0][0])
    empty = (255, 0, 255)
    canvas = pygame.Surface(picture.size, 0, 32)
    canvas.fill(empty)
    scene._draw_leg(canvas, places, places, lettered=False)
    drawn = (pygame.surfarray.array3d(canvas) != empty).any(axis=-1)
    flesh = flesh_of(GEOMETRY.mechanism)
    assert flesh
    for tail, head, one, other in flesh:
        middle = (places[tail] + places[head]) / 2
        across = 1j * (places[head] - places[tail]) / abs(places[head] - places[tail])
        radius = (one + other) / 2 * scene._girth * scene._scale
        for side in (-1, 1):
            z = middle + side * 0.8 * radius * across
            assert drawn[round(z.real), round(z.imag)]
    # As much as its parts without overlaps have, at the most, and half of that at the least.
    parts = [
        (one + other) * scene._girth * scene._scale * abs(places[head] - places[tail])
        for tail, head, one, other in flesh
    ]
    assert 0.5 * sum(parts) < drawn.sum() < 2.5 * sum(parts)


def test_kinds_of_ground_differ_by_colour_and_are_named_in_the_key(run):
    plain = draw(run[0])
    for patch in ((-9, 9, 0.2, 1), (-9, 9, 5, 1), (-9, 9, 1, 0.2), (-9, 9, 1, 2)):
        frame = draw(run[0], terrain=Terrain.patches([patch]))
        assert (frame[:90, 320:500] != plain[:90, 320:500]).any()
        ground = surface(plain, 100)
        assert (frame[ground + 4, 80:120] != plain[ground + 4, 80:120]).any(axis=-1).mean() > 0.9


@pytest.mark.parametrize("preset", ["identified", "jansen", "klann", "fourbar"])
def test_the_key_has_every_kind_of_ground_under_every_leg(preset):
    """A leg of one foot has a shorter key: it left no room for the fourth kind, and its picture failed."""
    leg = load_geometry(preset)
    ground = Terrain.patches([(1, 2, 0.2, 1), (2, 3, 5, 1), (3, 4, 1, 0.2), (4, 5, 1, 2)])
    key = pygame.surfarray.array3d(Renderer(Surroundings(leg, ground))._scene._key(1000.0))
    kinds = kinds_of(ground)
    assert len(kinds) == 4
    for _, colour in kinds:
        assert (key == colour).all(axis=-1).sum() > 50


def test_patches_are_found_where_they_are():
    patches = find_patches(Terrain.patches([(0.5, 1.0, 0.25, 1.0), (1.0, 2.0, 1.0, 3.0)], spacing=0.01))
    assert [patch[2:] for patch in patches] == [(0.25, 1.0), (1.0, 3.0)]
    np.testing.assert_allclose([patch[:2] for patch in patches], [(0.5, 1.0), (1.0, 2.0)], atol=0.011)
    assert find_patches(Terrain.slope(0.1)) == []
    assert find_patches(Terrain((0.0,), 2.0))[0][:3] == (-np.inf, np.inf, 2.0)


def test_the_footprint_is_as_deep_as_the_sole_and_runs_out(run):
    (now,) = loaded(run, 900.0, toe_x=1.0, heel_x=0.8, heel_y=-0.02, heel_depth=0.02)
    depth = footprint(now, np.array([0.0, 0.8, 0.9, 1.0, 1.5]))
    np.testing.assert_allclose(depth, [0.0, 0.02, 0.035, 0.05, 0.0], atol=1e-9)


def test_the_ground_gives_way_under_the_hoof(run):
    """Where the leg is not in front of it: both points 0.8 m ahead of the trunk, 10 cm deep."""
    at = {"x": run[0][0].x + 1.2, "y": -0.1, "depth": 0.1}
    both = {f"{point}_{name}": value for point in ("toe", "heel") for name, value in at.items()}
    metre = renderer()._scene._scale
    column = 312 + round(1.2 * metre)
    beside = column + round(0.06 * metre)
    deep = 0.1 * metre * np.exp(-((0.06 / 0.09) ** 2))
    found = surface(draw(loaded(run, 900.0, **both)), beside) - surface(draw(run[0]), beside)
    assert found == pytest.approx(deep, abs=2.5)


def test_a_leg_of_one_foot_has_no_heel_in_the_picture():
    """Its engine has a heel at (0, 0): neither the key nor a print in the ground shows it."""
    leg = load_geometry("jansen")
    trunk = Trunk("fixed", height=leg.hip_height - 0.1)
    engine = TrunkEngine(Limb(leg), trunk, Ground())
    pictures = []
    for x in (0.0, 50.0):
        engine.reset(GaitParameters(0.0, 0.0, 0.0, 0.0), 1.5, x=x)
        assert engine.report["toe_normal"].item() > 0
        now = leg_instants(columns_of_engine(engine.state | engine.report))
        picture = Renderer(Surroundings(leg, trunk="fixed"))
        add(picture, now)
        pictures.append(picture.frame())
        assert now[0].cop_x == pytest.approx(now[0].toe_x)
        assert now[0].cop_y == pytest.approx(now[0].toe_y)
    near, far = pictures
    # after 50 m, from which the print would run back to the heel, the ground looks as at the start
    for column in (5, 45, 85, 540, 580, 620):
        assert surface(far, column) == pytest.approx(surface(near, column), abs=1)
    for frame in pictures:
        assert not len(pixels(frame, PURPLE, (slice(0, 110), slice(0, 300)))[0])
        assert len(pixels(frame, BLUE, (slice(0, 110), slice(0, 300)))[0])
    assert len(pixels(draw(*simulate(0.02)), PURPLE, (slice(0, 110), slice(0, 300)))[0])


def test_the_camera_follows_the_trunk_uphill(run):
    """Over ground that rises with the trunk, the leg stays where it is in the picture."""
    picture = renderer(terrain=Terrain.slope(0.2))
    (now,) = run[0]
    places = [points(picture, now._replace(x=x, y=now.y + x * np.tan(0.2)))["O"] for x in (0.0, 3.0, 40.0)]
    np.testing.assert_allclose(places, places[0])


def test_the_gait_shows_what_is_commanded_and_what_is_made(run):
    dark = (34, 43, 53)
    command, gait = np.array([9.0, 0.3, 0.2, 0.0]), np.array([6.0, 1.0, -0.4, -0.5])

    def marks(*given):
        """Columns of the commands' marks beside crank speed and swing offset."""
        picture = renderer()
        names = [*(f"command_{name}" for name in PARAMETERS), *PARAMETERS[1:]]
        add(picture, [run[0][0]._replace(**dict(zip(names, np.concatenate(given), strict=True)))])
        frame = picture.frame()
        return np.array([np.nonzero((frame[y, 760:880] == dark).all(-1))[0].mean() for y in (184, 208)])

    low, high = np.array(list(LIMITS.values()))[:2].T
    part = (command[:2] - low) / (high - low)
    left, right = 10.0, 112.0
    np.testing.assert_allclose(marks(command, gait[1:]), left + part * (right - left), atol=1.5)
    assert (marks(gait, gait[1:]) != marks(command, gait[1:])).all()


NOWHERE = Instant(*[0.0] * len(Instant._fields))
PICTURES = [renderer(size=size) for size in ((600, 540), (960, 540), (1400, 540))]


@pytest.mark.parametrize("height", [0.5, 0.88, 1.0, 1.12, 2.1])
def test_the_leg_is_always_in_the_picture(height):
    start = NOWHERE._replace(x=-37.3, y=height * GEOMETRY.hip_height)
    for theta in np.linspace(0, 2 * np.pi, 36, endpoint=False):
        for offset, a, b in product(*list(LIMITS.values())[1:]):
            phi = offset + a * np.sin(theta) + b * np.cos(theta)
            now = start._replace(crank_angle=theta, swing_angle=phi)
            for picture in PICTURES:
                z = np.array(list(points(picture, now).values()))
                assert ((z.real > 0) & (z.real < picture._panel._box.left)).all()
                assert ((z.imag > 0) & (z.imag < picture.size[1])).all()


@pytest.mark.parametrize("gait", ["run", "walk"])
def test_stances_and_peaks_agree_with_the_reward(gait):
    env = gym.make("hoof_env/HorseLeg-v0", render_mode="rgb_array", episode_seconds=4.0).unwrapped
    observation, _ = env.reset(seed=0, options={"gait": gait})
    policy, ended = make_policy(gait, env), False
    while not ended:
        observation, _, failed, truncated, info = env.step(policy.predict(observation)[0])
        ended = failed or truncated
    env.render()
    summary, stances = info["episode_summary"], env._watched[0].renderer.stances
    assert len(stances.peaks) == summary["stances"] > 2
    assert sum(peak.force for peak in stances.peaks) == pytest.approx(summary["stance_peak_sum_n"])
    assert stances.highest == pytest.approx(summary["highest_grf_n"])
    env.close()


def test_a_hoof_that_never_lifts_begins_a_stance_every_turn_of_the_crank(run):
    (now,) = loaded(run, 500.0)
    stances = Stances(40.0)
    for k in range(301):
        stances.add(now._replace(time=k / 100, crank_angle=2 * np.pi * k / 100, force_y=500.0 + k))
    assert [peak.force for peak in stances.peaks] == [599.0, 699.0, 799.0, 800.0]
    stances.add(now._replace(toe_normal=30.0, force_y=30.0))
    assert (stances.opened, stances.running_peak, stances.highest) == (None, 0.0, 800.0)


def test_a_trunk_that_pitches_turns_its_leg(run):
    (now,) = run[0]
    places = [points(renderer(), now._replace(pitch=pitch)) for pitch in (0.0, 0.3)]
    arms = [np.array([z[name] - z["O"] for name in ("C", "G", "J")]) for z in places]
    np.testing.assert_allclose(arms[1], arms[0] * np.exp(-0.3j))  # the picture's y points down
    level, pitched = (draw([now._replace(pitch=pitch)]) for pitch in (0.0, 0.3))
    assert (level != pitched)[100:220, 160:300].any()  # and the trunk with it


@pytest.mark.parametrize(
    ("trunk", "held"),
    [("suspended", [False, False, True]), ("rail", [True] * 3), ("fixed", [False, True, True])],
)
def test_a_trunk_is_drawn_as_it_is_held(run, trunk, held):
    """Above it: a spring in its middle, a rail across the whole picture, a plate as long as the trunk."""
    picture = renderer()
    top = round(points(picture, run[0][0])["O"].imag - TRUNK_M[1] * picture._scene._scale)
    rows = slice(top - 46, top)
    above = draw(run[0], trunk=trunk)[rows]
    sky = above[:, 2] if trunk != "rail" else draw(run[0], trunk="fixed")[rows, 2]
    assert [(above[:, column] != sky).any() for column in (5, 260, 312)] == held


def test_rows_that_are_not_finite_are_left_out(run):
    *good, one, other = run[1]
    broken = [*good, one._replace(force_y=np.inf), other._replace(crank_angle=np.nan)]
    np.testing.assert_array_equal(draw(run[0], broken), draw(run[0], good))


def test_surroundings_of_a_small_leg_are_as_small():
    """The trunk of a robot at 0.2 was as long as the whole leg's, over key and panel. The pictures agree up
    to the scale, so that the same leg, made smaller, is drawn as large."""
    from hoof_env.render.outline import USUAL_HIP_M
    from hoof_env.render.scene import LegScene

    size, right = (960, 540), 336
    usual = GEOMETRY.scaled(USUAL_HIP_M / GEOMETRY.hip_height)
    large, small = (
        LegScene(Brush(size), usual.scaled(factor), Terrain.flat(), size, right, "rail")
        for factor in (1.0, 0.2)
    )
    assert small._scale == pytest.approx(5 * large._scale)
    assert small._trunk._image.get_size() == large._trunk._image.get_size()
    assert small._level == pytest.approx(large._level)
    assert large._trunk._image.get_width() < size[0] - right


@pytest.mark.parametrize(("lift_off", "unit"), [(0.0, "kN"), (28.0, "kN"), (2.0, "N")])
def test_forces_on_a_light_leg_are_in_newtons(lift_off, unit):
    """40 N were 0.04 kN, with the two decimals of an animal of 500 kg."""
    shown = renderer(weight_n=20 * lift_off, lift_off_n=lift_off)
    assert shown._panel._force.name == shown._scene._unit == unit
    least = 10.0 if unit == "N" else 200.0
    assert least <= shown._panel.full_scale <= max(least, 10 * 20 * lift_off)
