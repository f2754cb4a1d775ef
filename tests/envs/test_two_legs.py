"""A body with a number of legs for which no kernel runs single environments: it runs side by side."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import ClassVar

import gymnasium as gym
import numpy as np
import pytest

from hoof_env import records
from hoof_env.envs import manual
from hoof_env.errors import ParameterError
from hoof_env.leg.geometry import load_geometry
from hoof_env.record.instant import BodyInstant, Instant, instants
from hoof_env.record.surroundings import Surroundings
from hoof_env.render.horse_scene import HorseScene
from hoof_env.render.picture import picture_of
from hoof_env.render.renderer import Renderer
from hoof_env.simd import block_at, maximum, minimum, read
from hoof_env.simd.math import clip
from hoof_env.tasks import registry
from hoof_env.tasks.body import BodyKernels
from hoof_env.tasks.episode import ACTIONS, Episode
from hoof_env.tasks.one_leg import OneLeg, keep_gait

ID = "own/TwoLegs-v0"


def command_both(task, actions, episode, first_leg, parameters, n, scratch):
    for i in range(2):
        leg = block_at(first_leg, i)
        for k in range(ACTIONS):
            action = clip(read(actions, (2 * n + i) * ACTIONS + k, 2 * ACTIONS, leg.lanes), 1.0)
            heading = leg.state.gait[k] + task.lead * leg.state.gait_rate[k]
            leg.command[k] = minimum(maximum(heading + task.reach[k] * action, task.low[k]), task.high[k])


class TwoLegs(OneLeg):
    """Two legs at the same place, half a turn of their cranks apart."""

    kernels = BodyKernels(2, Episode, (), 1, command_both, keep_gait)
    hips: ClassVar = {"near_": (0.0, 0.0), "off_": (0.0, 0.0)}
    picture = "legs"
    action_names = tuple(f"{leg}{name}" for leg in ("near_", "off_") for name in OneLeg.action_names)

    def parts(self, s):
        trunk, ground, (limb,) = super().parts(s)
        return trunk, ground, (limb, limb)

    def draw(self, options, generators, engine):
        start = super().draw(options, generators, engine)
        start.commands = np.repeat(start.commands, 2, axis=0)
        start.theta = np.concatenate([start.theta, start.theta + np.pi])
        return start


class Still:
    """Policy that keeps the gait of both legs."""

    def predict(self, observation, **_):
        return np.zeros(8, np.float32), None


def surroundings_of_legs(count, picture):
    """Surroundings of legs a step apart along the trunk."""
    hips = {f"leg{k}_": (0.2 * k, 0.0) for k in range(count)}
    return Surroundings(load_geometry("identified"), lift_off_n=50.0, hips=hips, picture=picture)


@pytest.mark.parametrize("picture", ["legs", "horse"])
@pytest.mark.parametrize("count", [2, 6, 9])
def test_pictures_have_room_for_legs(picture, count):
    """Curves, footfall and their words lie in the card, and hooves left of it."""
    here = surroundings_of_legs(count, picture)
    renderer = Renderer(here)
    nowhere = Instant(*[0.0] * len(Instant._fields))
    legs = tuple(nowhere._replace(x=0.2 * k, y=here.geometry.hip_height) for k in range(count))
    renderer.add([BodyInstant(0.0, 0.0, here.geometry.hip_height, 0.0, 0.0, 0.0, legs)])
    assert renderer.frame().std() > 0
    panel = renderer._panel
    boxes = [*panel._plots, *panel._rows]
    assert len(boxes) == 2 * count
    assert all(panel._box.contains(box) and box.height > 1 for box in boxes)
    assert all(one.bottom < other.top for one, other in itertools.pairwise(boxes))
    if isinstance(renderer._scene, HorseScene):
        return
    last = renderer._scene.look_at(renderer.latest)[-1]
    assert max(z.real for z in last.values()) < panel._box.left


def test_pictures_refuse_legs_that_they_cannot_show():
    for count, picture, words in (
        (2, "leg", "picture: expected 'legs' for 2 legs, got 'leg'"),
        (10, "legs", "picture: expected at most 9 legs, got 10"),
        (2, "cow", "picture: expected one of horse, leg, legs, got 'cow'"),
    ):
        with pytest.raises(ParameterError, match=words):
            Renderer(surroundings_of_legs(count, picture))
    with pytest.raises(ParameterError, match=r"expected a single one .*got HorseLegVectorEnv"):
        records.surroundings(gym.make_vec("hoof_env/HorseLeg-v0", 2))


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    """Register the body of two legs."""
    monkeypatch.delitem(gym.registry, ID, raising=False)
    task = replace(registry.TASKS["leg"], name=ID, body=TwoLegs)
    monkeypatch.setitem(registry._OWN, ID, task)
    registry._add_to_gymnasium(task)


def test_two_legs_have_the_same_bits_alone_and_in_rows():
    env, envs = gym.make(ID).unwrapped, gym.make_vec(ID, num_envs=3).unwrapped
    assert env.action_space.shape == (8,)
    first, _ = env.reset(seed=1)
    np.testing.assert_array_equal(envs.reset(seed=0)[0][1], first)
    rng = np.random.default_rng(0)
    for _ in range(10):
        actions = rng.uniform(-1, 1, (3, 8)).astype(np.float32)
        observation, reward, *_, info = env.step(actions[1])
        observations, rewards, *_, infos = envs.step(actions)
        np.testing.assert_array_equal(observations[1], observation)
        assert rewards[1] == reward
        np.testing.assert_array_equal(infos["measured"][1], info["measured"])
    near, off = (info["measured"][f"{leg}crank_angle"] for leg in TwoLegs.hips)
    assert abs(off - near - np.pi) < 2.0
    assert near != off - np.pi  # each has actions of its own


def test_pictures_and_records_have_both_legs():
    """They take legs and panel from the body, whatever it is."""
    pytest.importorskip("pygame")
    env = gym.make(ID, render_mode="rgb_array")
    assert "trunk" in manual.tables_of(ID)["Arguments"].rows[2]
    env.reset(seed=2)
    record = records.record_episode(env, Still(), 2, 0.4)
    assert abs(record["off_crank_angle"][0] - record["near_crank_angle"][0]) == pytest.approx(np.pi)
    assert {"time", "x", "near_toe_normal", "off_toe_normal"} < set(record)
    here = records.surroundings(env)
    renderer = Renderer(here)
    seen = instants(records.substeps(env), here.hips)[-1:]
    renderer.add(seen)
    dark = renderer.frame().max(axis=-1) < 100  # the rings of joints, and links
    near, off = renderer._scene.look_at(seen[0])
    assert abs(near["J"] - off["J"]) > 10  # pixels
    for pixels in (near, off):
        x, y = round(pixels["J"].real), round(pixels["J"].imag)
        assert dark[y - 4 : y + 5, x - 4 : x + 5].any()
    assert [one.highest for one in renderer._panel.each] == [leg.grf for leg in seen[0].legs]
    drawing = picture_of(here).drawing(here, 0)
    (arrows,) = (place for place in drawing.places if (place.source, place.column) == ("arrows", "xs"))
    assert arrows.pieces == 3 * 2
    assert len(drawing.row(seen[0], [])) == drawing.length
