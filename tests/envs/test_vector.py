"""The native vector environment against Gymnasium's own over single environments, where `test_bits.py` does
not: seeds, masks, wrappers, frames, what it says of itself."""

from __future__ import annotations

import copy

import gymnasium as gym
import numpy as np
import pytest
from family import IDS, LEGS, MODES, actions, both, same, same_rows, steps
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import NormalizeReward, RecordEpisodeStatistics, RecordVideo

SHORT = {"episode_seconds": 0.3}


def check_step(ours, theirs, taken):
    one, two = ours.step(taken), theirs.step(taken)
    same_rows(one, two, ours.num_envs)
    return one


def test_seeds_one_each_and_going_on_without():
    ours, theirs = both(LEGS[-1], 4, **SHORT)
    for seed in ([5, 6, 5, 0], [None, 1, None, 2], None, 8, [None] * 4):
        one, two = ours.reset(seed=seed), theirs.reset(seed=seed)
        same_rows(one, two, 4)
        check_step(ours, theirs, actions(0, 4))
    start = ours.reset(seed=[3, 3, 4, 4])[0]
    same(start[0], start[1])
    assert (start[1] != start[2]).any()


def test_a_mask_starts_its_rows_alone():
    ours, theirs = both(IDS[0], 5)
    for env in (ours, theirs):
        env.reset(seed=1)
    mask = np.array([True, False, False, True, False])
    before, *_ = check_step(ours, theirs, actions(2, 5))
    given = {"reset_mask": mask, "gait": "walk"}
    (one, infos), (two, _) = ours.reset(options=given), theirs.reset(options=dict(given))
    same(one, two)
    assert list(given) == ["reset_mask", "gait"]  # what came is left alone
    same(one[~mask], before[~mask])
    same(infos["_x"], mask)
    for taken in actions(3, 20, 5):
        check_step(ours, theirs, taken)


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_every_call_returns_fresh_arrays(mode):
    env = gym.make_vec(IDS[0], num_envs=8, autoreset_mode=mode, episode_seconds=0.04)

    def arrays(value):
        if isinstance(value, dict):
            return [found for item in value.values() for found in arrays(item)]
        if isinstance(value, np.ndarray) and value.dtype.kind != "O":
            return [value]
        if value is None or isinstance(value, str):
            return []
        return [found for item in value for found in arrays(item)]

    seen = arrays(env.reset(seed=0))
    for k in range(5):
        if mode == AutoresetMode.DISABLED and k in (2, 4):
            seen += arrays(env.reset())
        seen += arrays(env.step(actions(k, 8)))
    copies = [array.copy() for array in seen]
    env.reset()
    env.step(actions(9, 8))
    for array, kept in zip(seen, copies, strict=True):
        same(array, kept)
    for i, one in enumerate(seen):
        assert not any(np.shares_memory(one, two) for two in seen[i + 1 :])


def test_gymnasium_finds_what_it_asks_for():
    for mode in MODES:
        for given in (mode, mode.value, mode.name):
            env = gym.make_vec(IDS[0], num_envs=8, autoreset_mode=given, dt=0.04, sim_dt=2e-3)
            assert env.metadata["autoreset_mode"] is env.unwrapped.autoreset_mode is mode
        assert env.metadata["render_fps"] == 25
        single = gym.make(IDS[0]).unwrapped
        assert env.single_observation_space == single.observation_space
        assert env.single_action_space == single.action_space
        assert env.observation_space.shape == (8, *single.observation_space.shape)
        assert env.action_space.shape == (8, 4)
        assert env.spec.id == IDS[0]
    assert type(env.unwrapped).metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP


def test_a_longer_time_limit_does_not_lengthen_episodes():
    with pytest.warns(UserWarning, match="expected at most 5, .*episode_seconds=12"):
        longer = gym.make_vec(IDS[0], num_envs=2, max_episode_steps=600, episode_seconds=0.1)
    longer.reset(seed=0)
    assert [longer.step(actions(k, 2))[3].all() for k in range(5)] == [False] * 4 + [True]


def test_frames_of_the_first_environments_and_two_closes():
    pytest.importorskip("pygame")
    env = gym.make_vec(IDS[0], num_envs=8, render_mode="rgb_array", rendered=2, **SHORT)
    env.reset(seed=0)
    steps(env, 17, seed=4)
    frames = env.render()
    assert [frame.shape for frame in frames] == [(540, 960, 3)] * 8
    assert [bool(frame.any()) for frame in frames] == [True] * 2 + [False] * 6
    single = gym.make(IDS[0], render_mode="rgb_array", **SHORT)
    twin = copy.deepcopy(env)
    steps(twin, 3)
    assert (twin.render()[0] != frames[0]).any()
    same(env.render()[0], frames[0])
    single.reset(seed=1)
    rows = actions(4, 17, 8)[:, 1]
    for k, taken in enumerate(rows):  # the 16th starts a new episode
        _ = single.reset() if k == 15 else single.step(taken)
    same(single.render(), frames[1])
    for one in (env, single):
        one.close()
        one.close()


@pytest.mark.parametrize("mode", MODES[:2], ids=lambda mode: mode.name)
def test_gymnasiums_wrappers_see_what_they_see_of_their_own(mode):
    """Returns and lengths of episodes, and rewards scaled by their running variance."""
    pair = [RecordEpisodeStatistics(NormalizeReward(env)) for env in both(IDS[0], 8, mode, **SHORT)]
    for env in pair:
        env.reset(seed=0)
    ends = 0
    for taken in actions(0, 50, 8):
        one, two = (env.step(taken) for env in pair)
        same(one[1], two[1])
        assert ("episode" in one[4]) == ("episode" in two[4])
        if "episode" in one[4]:
            ends += one[4]["_episode"].sum()
            for name in ("r", "l"):
                same(one[4]["episode"][name], two[4]["episode"][name])
    assert ends >= 16
    assert set(pair[0].length_queue) == {15}


def film(envs, folder, **arguments):
    """Width, height and frames of what Gymnasium's wrapper films of two episodes."""
    envs = RecordVideo(envs, str(folder), episode_trigger=lambda k: k == 0, **arguments)
    envs.reset(seed=0)
    for taken in actions(0, 6, envs.num_envs):
        envs.step(taken)
    envs.close()
    reader = pytest.importorskip("imageio").get_reader(folder / "rl-video-episode-0.mp4")
    width, height = reader.get_meta_data()["size"]
    return width, height, reader.count_frames()


@pytest.mark.filterwarnings("ignore:.*Overwriting existing videos")
@pytest.mark.parametrize(
    ("n", "made", "wrapped", "size"),
    [
        (3, {}, {}, (2880, 540)),
        (3, {"rendered": 1}, {}, (2880, 540)),
        (20, {"rendered": 1}, {"record_first_only": True}, (960, 540)),
    ],
    ids=["by default", "fewer", "the first of many"],
)
def test_gymnasiums_wrapper_films_them(tmp_path, n, made, wrapped, size):
    pytest.importorskip("pygame")
    pytest.importorskip("moviepy")
    envs = gym.make_vec(IDS[0], num_envs=n, render_mode="rgb_array", episode_seconds=0.06, **made)
    assert film(envs, tmp_path / "videos", **wrapped) == (*size, 4)  # of the start and of three steps
