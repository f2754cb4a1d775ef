"""Pictures and records of the horse: four legs, their forces and the footfall are what the engine says."""

from __future__ import annotations

import itertools

import gymnasium as gym
import numpy as np
import pygame
import pytest

from hoof_env import records
from hoof_env.constants import GRAVITY
from hoof_env.envs.policies import make_policy
from hoof_env.film import frames
from hoof_env.record.instant import instants
from hoof_env.render.outline import EAR, FAR, TAIL
from hoof_env.render.renderer import Renderer
from hoof_env.tasks.horse_gaits import LEGS

HORSE = "hoof_env/Horse-v0"


@pytest.fixture(scope="module")
def played():
    """An environment, and the columns of two seconds of its reference gait."""
    env = gym.make(HORSE, target_speed=1.853)
    return env, list(records.episode(env, make_policy("reference", env), 1, 2.0))


def whole(parts):
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def test_the_forces_of_the_record_bear_the_animal(played):
    """Newton: the mean vertical force is the weight, but for the change of momentum."""
    env, parts = played
    record = whole(parts)
    upward = sum(record[f"{leg}_force_y"] for leg in LEGS)
    time = record["time"]
    mean = np.trapezoid(upward, time) / time[-1]
    weight = env.unwrapped.weight
    change = weight / GRAVITY * (record["vy"][-1] - record["vy"][0]) / time[-1]
    assert mean == pytest.approx(weight + change, rel=0.05)


def test_hips_stand_where_they_are_on_the_trunk(played):
    env, parts = played
    record = whole(parts)
    for prefix, (x, _) in env.unwrapped.body.hips.items():
        arm = (record[f"{prefix}x"] - record["x"]) + 1j * (record[f"{prefix}y"] - record["y"])
        np.testing.assert_allclose(arm, x * np.exp(1j * record["pitch"]), atol=1e-12)


def test_the_panel_counts_the_stances_that_the_forces_show(played):
    env, parts = played
    here = records.surroundings(env)
    renderer = Renderer(here)
    for part in parts:
        renderer.add(instants(part, here.hips))
    record = whole(parts)
    for k, leg in enumerate(LEGS):
        normal = record[f"{leg}_toe_normal"] + record[f"{leg}_heel_normal"]
        loaded = normal > here.lift_off_n
        begun = int(loaded[0]) + int((np.diff(loaded.astype(int)) == 1).sum())
        assert len(renderer._panel.each[k].peaks) == begun
        bars = renderer._panel._stances[k]
        assert sum(end - start for start, end in bars) == pytest.approx(loaded.sum() * 1e-3, abs=0.01)
        grf = np.hypot(record[f"{leg}_force_x"], record[f"{leg}_force_y"])
        assert renderer._panel.each[k].highest == pytest.approx(grf.max())


def test_one_sees_the_right_side_of_a_horse_that_heads_right():
    """Its left legs are behind its trunk."""
    assert EAR[0][0] > 0 > TAIL[0][0]
    assert [LEGS[i] for i in FAR] == [leg for leg in LEGS if leg.startswith("left")]


def test_films_show_a_horse_that_goes(played):
    env, parts = played
    pictures = list(frames(Renderer(records.surroundings(env)), parts, 25.0))
    assert len(pictures) == 51
    assert all(picture.shape == (540, 960, 3) and picture.dtype == np.uint8 for picture in pictures)
    assert all((one != other).any() for one, other in itertools.pairwise(pictures))


@pytest.mark.parametrize("size", [0.5, 2.0])
def test_arrows_are_as_long_for_animals_of_all_sizes(size):
    """In the key, and of a force on a hoof that is the same part of the full scale."""
    scenes = [Renderer(records.surroundings(gym.make(HORSE, size=each)))._scene for each in (1.0, size)]
    keys = [pygame.surfarray.array_alpha(scene._key(1000.0)) for scene in scenes]
    np.testing.assert_array_equal(*keys)
    assert scenes[1]._share * scenes[1]._scale == pytest.approx(scenes[0]._share * scenes[0]._scale)


def test_curves_leave_the_names_of_the_legs_alone(played):
    """Also for hoofs that bear the full scale from the first instant to the last."""
    env, parts = played
    renderer = Renderer(records.surroundings(env))
    panel = renderer._panel
    seen = instants(parts[0], renderer.here.hips)
    panel.add(seen)
    for curve in panel._curves:
        curve.clear(), curve.extend((t, panel.full_scale) for t in np.linspace(-3.0, 0.0, 50))
    bare, drawn = (pygame.Surface(renderer.size, 0, 32) for _ in range(2))
    bare.blit(panel._card(panel.full_scale), panel._box)
    panel.draw(drawn, seen[-1])
    found, expected = (pygame.surfarray.array3d(image).astype(int) for image in (drawn, bare))
    for plot in panel._plots:
        name = slice(plot.right - 60, plot.right + 1), slice(plot.top - 15, plot.top - 2)
        assert expected[name].min() < 200
        assert (found[name] == expected[name]).all()
        inside = slice(plot.left, plot.right - 1), slice(plot.top - 1, plot.top + 2)
        assert (found[inside] != expected[inside]).any()


@pytest.mark.parametrize("n", [0, 3])
def test_frames_of_one_and_of_many(n):
    if n:
        env = gym.make_vec(HORSE, num_envs=n, render_mode="rgb_array")
        env.reset(seed=0), env.step(np.zeros((n, 16), np.float32))
        pictures = env.render()
        assert len(pictures) == n
        assert (pictures[0] != pictures[1]).any()
    else:
        env = gym.make(HORSE, render_mode="rgb_array", size=0.7)
        env.reset(seed=0), env.step(np.zeros(16, np.float32))
        assert env.render().shape == (540, 960, 3)
    env.close()


def test_exports_name_every_limb(tmp_path, played):
    env, _ = played
    record = records.record_episode(env, make_policy("reference", env), 1, 0.1)
    about = records.describe(env)
    for suffix in (".csv", ".mot"):
        text = records.write(record, about, tmp_path / f"horse{suffix}").read_text()
        for leg in LEGS:
            assert f"{leg}_{'force_y [N]' if suffix == '.csv' else 'ground_force_vy'}" in text
    header, *rows = (tmp_path / "horse.csv").read_text().splitlines()
    assert len(header.split(",")) == len(rows[0].split(","))
    assert set(record) == set(about["units"]) | {"free_moment"} & set(record)
    lines = (tmp_path / "horse.mot").read_text().splitlines()
    assert f"nColumns={1 + 9 * 4}" in lines
