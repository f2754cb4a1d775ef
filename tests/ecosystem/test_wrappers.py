"""Gymnasium's wrappers, single and vector, on every id: each makes what it should of what the environment
alone does with the same seeds and actions."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import gymnasium as gym
import numpy as np
import pytest
from alone import assert_filmed, skip_unless_native
from gymnasium import wrappers
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import vector

STEPS, EPISODES, ROWS = 10, 2, 2
ACTIONS = np.random.default_rng(0).integers(-8, 9, (ROWS, EPISODES, STEPS // 2, 4)) / np.float32(8)
"""Eighths, which scaling does not round; each is held for two steps."""
HELD = ACTIONS.repeat(2, axis=2)


@functools.cache
def short(env_id):
    """Arguments with which an episode has `STEPS` control steps."""
    return {"episode_seconds": STEPS * gym.make(env_id).unwrapped.dt}


def fit(env, actions):
    """Actions for each leg of an environment alike; a horse takes an eighth of them, so that it stays up."""
    legs = (getattr(env.unwrapped, "single_action_space", None) or env.unwrapped.action_space).shape[0] // 4
    return np.tile(actions, legs) / np.float32(1 if legs == 1 else 8)


@dataclass
class Episode:
    """Observations (steps + 1, ...) and rewards (steps,) of an episode."""

    observations: np.ndarray
    rewards: np.ndarray


def play(env, row=0, actions=HELD):
    """Two episodes of an environment, seeded as a row of a vector environment is."""
    episodes = []
    for seed, episode_actions in zip((row, None), fit(env, actions)[row], strict=True):
        observations, rewards = [np.array(env.reset(seed=seed)[0])], []
        for action in episode_actions:
            observation, reward, terminated, truncated, _ = env.step(action)
            observations.append(np.array(observation))
            rewards.append(reward)
            if terminated or truncated:
                break
        assert terminated or truncated
        episodes.append(Episode(np.array(observations), np.array(rewards)))
    return episodes


def play_rows(envs, actions=HELD):
    """The same of each row of a vector environment, whose episodes begin and end when they will."""
    same_step = envs.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
    observations, _ = envs.reset(seed=0)
    actions = fit(envs, actions)
    found = [[([np.array(observation)], [])] for observation in observations]
    over = np.zeros(envs.num_envs, bool)
    while min(map(len, found)) <= EPISODES:
        now = [
            actions[row, (len(episodes) - 1) % EPISODES, len(episodes[-1][1]) % STEPS]
            for row, episodes in enumerate(found)
        ]
        observations, rewards, terminated, truncated, infos = envs.step(np.array(now))
        ended = np.asarray(terminated) | np.asarray(truncated)
        for row, episodes in enumerate(found):
            if over[row]:  # the step that restarts
                episodes.append(([np.array(observations[row])], []))
                continue
            last = infos["final_obs"][row] if same_step and ended[row] else observations[row]
            episodes[-1][0].append(np.array(last))
            episodes[-1][1].append(float(rewards[row]))
            if same_step and ended[row]:
                episodes.append(([np.array(observations[row])], []))
        over = ended & (not same_step)
    return [[Episode(*map(np.array, one)) for one in episodes[:EPISODES]] for episodes in found]


def assert_same(found, plain, change):
    """Episodes are what `change` makes of the plain ones."""
    for one, alone in zip(found, plain, strict=True):
        wanted = change(alone)
        np.testing.assert_allclose(one.observations, wanted.observations, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(one.rewards, wanted.rewards, rtol=1e-6, atol=1e-7)


@functools.cache
def plain(env_id, row=0):
    """Episodes without wrappers."""
    return play(gym.make(env_id, **short(env_id)), row)


def seen(change):
    return lambda episode: Episode(change(episode.observations), episode.rewards)


def paid(change):
    return lambda episode: Episode(episode.observations, change(episode.rewards))


def delayed(observations):
    return np.concatenate([np.zeros_like(observations[:2]), observations[:-2]])


def stacked(observations):
    first = np.concatenate([observations[:1].repeat(2, axis=0), observations])
    return np.stack([first[i : i + len(observations)] for i in range(3)], axis=1)


def timed(observations):
    return np.column_stack([observations, np.arange(len(observations))])


def skipped(of_two):
    """Of every two steps what `of_two` makes of their observations, and the sum of their rewards."""

    def change(episode):
        pairs = episode.observations[1:].reshape(-1, 2, episode.observations.shape[1])
        observations = np.concatenate([episode.observations[:1], of_two(pairs)])
        return Episode(observations, episode.rewards.reshape(-1, 2).sum(1))

    return change


def same(episode):
    return episode


def twice(values):
    return 2 * values


def small(rewards):
    return rewards.clip(-0.01, 0.01)


def upright(observations):
    return observations[..., None]


def positive(observations):
    return (observations + 1) / 2


HALVES = {"func": lambda action: action / 2, "action_space": None}  # twice as wide, see `wrap`
BOUNDS = {"min_obs": np.float32(0), "max_obs": np.float32(1)}
TWO = {"min_action": np.float32(-2), "max_action": np.float32(2)}

# A wrapper, its arguments, the actions that it is given, and what it makes of an episode.
SINGLE = [
    (wrappers.Autoreset, {}, HELD, same),
    (wrappers.ClipAction, {}, HELD, same),
    (wrappers.ClipReward, {"min_reward": -0.01, "max_reward": 0.01}, HELD, paid(small)),
    (wrappers.DelayObservation, {"delay": 2}, HELD, seen(delayed)),
    (wrappers.DtypeObservation, {"dtype": np.float64}, HELD, same),
    (wrappers.FlattenObservation, {}, HELD, same),
    (wrappers.FrameStackObservation, {"stack_size": 3}, HELD, seen(stacked)),
    (wrappers.MaxAndSkipObservation, {"skip": 2}, ACTIONS, skipped(lambda pairs: pairs.max(1))),
    (wrappers.OrderEnforcing, {}, HELD, same),
    (wrappers.PassiveEnvChecker, {}, HELD, same),
    (wrappers.RecordEpisodeStatistics, {}, HELD, same),
    (wrappers.RepeatAction, {"num_repeats": 2}, ACTIONS, skipped(lambda pairs: pairs[:, 1])),
    (wrappers.RescaleAction, TWO, 2 * HELD, same),
    (wrappers.RescaleObservation, BOUNDS, HELD, seen(positive)),
    (wrappers.ReshapeObservation, {"shape": (-1, 1)}, HELD, seen(upright)),
    (wrappers.TimeAwareObservation, {}, HELD, seen(timed)),
    (wrappers.TimeLimit, {"max_episode_steps": STEPS}, HELD, same),
    (wrappers.TransformAction, HALVES, 2 * HELD, same),
    (wrappers.TransformObservation, {"func": twice, "observation_space": None}, HELD, seen(twice)),
    (wrappers.TransformReward, {"func": twice}, HELD, paid(twice)),
]
BOTH = (
    "ClipAction", "ClipReward", "DtypeObservation", "FlattenObservation", "RecordEpisodeStatistics",
    "RescaleAction", "RescaleObservation", "ReshapeObservation", "TransformReward",
)  # fmt: skip
"""Wrappers that are there for vector environments too, under the same names."""

VECTOR = [
    *((getattr(vector, case[0].__name__), *case[1:]) for case in SINGLE if case[0].__name__ in BOTH),
    (
        functools.partial(vector.VectorizeTransformAction, wrapper=wrappers.TransformAction),
        HALVES, 2 * HELD, same,
    ),
    (
        functools.partial(vector.VectorizeTransformObservation, wrapper=wrappers.TransformObservation),
        {"func": twice, "observation_space": None}, HELD, seen(twice),
    ),
]  # fmt: skip


def name_of(case):
    """Of the wrapper in an entry of the lists."""
    wrapper = case[0]
    return getattr(wrapper, "__name__", None) or wrapper.func.__name__


def wrap(env, wrapper, arguments):
    """With the shape in full: Gymnasium's `ReshapeObservation` does not take -1; and with a space of actions
    that is twice as wide where one is asked for."""
    if "action_space" in arguments:
        inner = getattr(env.unwrapped, "single_action_space", None) or env.unwrapped.action_space
        arguments = {**arguments, "action_space": gym.spaces.Box(-2.0, 2.0, inner.shape, np.float32)}
    if "shape" in arguments:
        space = getattr(env, "single_observation_space", env.observation_space)
        arguments = {"shape": (space.shape[0], 1)}
    return wrapper(env, **arguments)


def native(env_id, **settings):
    """The native vector environment of two rows, or the test is skipped."""
    skip_unless_native(env_id)
    return gym.make_vec(env_id, num_envs=ROWS, vectorization_mode="vector_entry_point", **settings)


@pytest.mark.parametrize("case", SINGLE, ids=name_of)
def test_single(env_id, case):
    """Single: each of 20 wrappers against the environment alone."""
    wrapper, arguments, actions, change = case
    env = wrap(gym.make(env_id, **short(env_id)), wrapper, arguments)
    assert_same(play(env, actions=actions), plain(env_id), change)


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP"])
@pytest.mark.parametrize("case", VECTOR, ids=name_of)
def test_vector(env_id, case, mode):
    """Native vector, restarting on the next or the same step: each of 11 wrappers, likewise."""
    wrapper, arguments, actions, change = case
    envs = native(env_id, autoreset_mode=mode, **short(env_id))
    if mode == "SAME_STEP" and "Observation" in name_of(case):
        with pytest.raises(ValueError, match="NEXT_STEP or DISABLED"):  # of any environment
            wrap(envs, wrapper, arguments)
        return
    for row, episodes in enumerate(play_rows(wrap(envs, wrapper, arguments), actions)):
        assert_same(episodes, plain(env_id, row), change)


def test_time_aware(env_id):
    """`TimeAwareObservation` by the limit of the spec: 1 when an episode is truncated."""
    env = wrappers.TimeAwareObservation(gym.make(env_id), normalize_time=True, flatten=False)
    assert env.reset(seed=0)[0]["time"] == 0
    truncated = terminated = False
    while not (truncated or terminated):
        observation, _, terminated, truncated, info = env.step(np.zeros(env.action_space.shape, np.float32))
    assert (observation["time"] == 1) == truncated
    assert observation in env.observation_space
    assert "episode_summary" in info


def test_sticky_action(env_id):
    """`StickyAction`: an action that always sticks is the first one."""
    env = wrappers.StickyAction(gym.make(env_id, **short(env_id)), 1 - 1e-12)
    held = HELD.copy()
    held[:] = HELD[0, 0, 0]
    assert_same(play(env)[:1], play(gym.make(env_id, **short(env_id)), actions=held)[:1], same)


def test_discretize(env_id):
    """`DiscretizeAction` and `DiscretizeObservation`: the bins of what the environment does."""
    env = wrappers.DiscretizeAction(gym.make(env_id), bins=3, multidiscrete=True)
    binned = wrappers.DiscretizeObservation(env, bins=3, multidiscrete=True)
    alone = gym.make(env_id)
    observation, wanted = binned.reset(seed=0)[0], alone.reset(seed=0)[0]
    env.action_space.seed(0)
    for _ in range(20):
        np.testing.assert_array_equal(observation, np.clip((wanted + 1) // (2 / 3), 0, 2))
        action = env.action_space.sample()
        observation, reward, ended, *_ = binned.step(action)
        wanted, alone_reward, *_ = alone.step((2 * (action - 1) / 3).astype(np.float32))
        assert reward == pytest.approx(alone_reward, abs=1e-4)
        if ended:
            break


@pytest.mark.parametrize("kind", ["single", "vector"])
def test_normalize_reward(env_id, kind):
    """`NormalizeReward`, single and native vector: signs kept, the discounted return's variance near 1."""
    if kind == "single":
        env = wrappers.NormalizeReward(wrappers.Autoreset(gym.make(env_id, **short(env_id))), gamma=0.9)
    else:
        env = vector.NormalizeReward(native(env_id, **short(env_id)), gamma=0.9)
    env.reset(seed=0)
    env.action_space.seed(0)
    rewards = np.array([env.step(env.action_space.sample())[1] for _ in range(300)])
    assert np.isfinite(rewards).all()
    assert 0.05 < np.abs(rewards[100:]).max() < 20


def test_renders(env_id):
    """`AddRenderObservation`, `RenderCollection` and `HumanRendering`: frames."""
    env = gym.make(env_id, render_mode="rgb_array", **short(env_id))
    pixels = wrappers.AddRenderObservation(env, render_only=True)
    observation, _ = pixels.reset(seed=0)
    np.testing.assert_array_equal(observation, env.render())
    assert observation in pixels.observation_space
    collected = wrappers.RenderCollection(env)
    collected.reset(seed=0)
    for action in fit(env, HELD)[0, 0, :3]:
        collected.step(action)
    frames = collected.render()
    assert len(frames) == 4
    assert np.ptp(np.array(frames)[..., 0].astype(float), axis=0).max() > 50


def test_human_rendering(env_id, monkeypatch):
    """`HumanRendering`: a window, here without a screen."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = wrappers.HumanRendering(gym.make(env_id, render_mode="rgb_array", **short(env_id)))
    env.reset(seed=0)
    env.step(fit(env, HELD)[0, 0, 0])
    assert env.window is not None
    env.close()


def test_dict_info_to_list(env_id):
    """`DictInfoToList` of a native vector environment: row by row the infos of the environment alone."""
    envs, alone = vector.DictInfoToList(native(env_id, **short(env_id))), gym.make(env_id, **short(env_id))
    told, (_, wanted) = envs.reset(seed=0)[1], alone.reset(seed=0)
    assert told[0].keys() == wanted.keys()
    assert told[0]["speed"] == wanted["speed"]
    for action in fit(alone, HELD)[0, 0]:
        told = envs.step(np.array([action, action]))[-1]
        *_, wanted = alone.step(action)
        assert told[0].keys() == wanted.keys()
        assert told[0]["reward_peak"] == wanted["reward_peak"]
    assert told[0]["episode_summary"] == pytest.approx(wanted["episode_summary"])


def test_record_video_vector(env_id, tmp_path):
    """`RecordVideo` of the native vector environment: frames of all, not all alike."""
    pytest.importorskip("moviepy", reason='pip install "hoof-env[record]"')
    envs = native(env_id, render_mode="rgb_array", **short(env_id))
    films = vector.RecordVideo(envs, str(tmp_path / "videos"), episode_trigger=lambda number: number == 0)
    films.reset(seed=0)
    for action in [*fit(envs, HELD)[0, 0], *fit(envs, HELD)[0, 1]]:
        films.step(np.array([action, action]))
    height, width, _ = envs.render()[0].shape
    films.close()
    frames = assert_filmed(tmp_path / "videos")
    assert frames.shape[1] * frames.shape[2] == pytest.approx(ROWS * height * width, rel=0.05)
