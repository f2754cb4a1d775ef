"""On every id the reference gait beats the simplest policies, and no trick that was found beats it."""

import functools

import gymnasium as gym
import numpy as np
import pytest

from hoof_env.envs.policies import make_policy
from hoof_env.envs.reward import check_weights
from hoof_env.envs.tasks import TASKS

SEEDS = 40
MARGIN = dict.fromkeys(TASKS, 3.0) | {"fixed": 0.3}
"""Return by which the reference gait is ahead over ten seconds, or the one of the paper's set-up, in the mean
of so many episodes."""

DT = 0.02
PACES = (3, 5, 6, 8, 10, 12, 18, 25, 50)
"""Control steps between two flips of a bang-bang policy."""


def mean_return(task, act, options=None):
    """Of `SEEDS` episodes side by side; `act` maps observations and time to actions."""
    envs = gym.make_vec(TASKS[task].id, num_envs=SEEDS, autoreset_mode="DISABLED")
    observations, _ = envs.reset(seed=0, options=options)
    total, ended = np.zeros(SEEDS), np.zeros(SEEDS, bool)
    for step in range(500):
        actions = np.asarray(act(observations, step * DT), np.float32)
        observations, rewards, terminated, truncated, _ = envs.step(np.broadcast_to(actions, (SEEDS, 4)))
        total, ended = total + rewards, ended | terminated | truncated
        if ended.any():
            break
    assert truncated.all()  # in good order, all at once
    return total.mean()


def scripted(task, name, each):
    """A policy of `make_policy` for all environments: one command for all, or one policy each."""
    env = gym.make(TASKS[task].id)
    policies = [make_policy(name, env, seed) for seed in range(SEEDS if each else 1)]
    return lambda seen, _: np.array([p.predict(one)[0] for p, one in zip(policies, seen, strict=False)])


@functools.cache
def reference(task):
    return mean_return(task, scripted(task, TASKS[task].reference, each=False))


@pytest.mark.parametrize("name", ["idle", "airborne", "drag", "random"])
@pytest.mark.parametrize("task", TASKS)
def test_simple_policies_stay_below_the_reference(task, name):
    each = name != "idle"
    assert mean_return(task, scripted(task, name, each)) < reference(task) - MARGIN[task]


@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize("task", TASKS)
def test_bang_bang_of_any_pace_stays_below_the_reference(task, pace):
    flip = lambda _, time: np.full(4, 1.0 if round(time / DT) // pace % 2 else -1.0)  # noqa: E731
    assert mean_return(task, flip) < reference(task) - MARGIN[task]


@pytest.mark.parametrize("task", TASKS)
def test_hopping_on_the_swing_with_the_crank_stopped_stays_below_the_reference(task):
    """Waves of the swing: many at once, no one of them pays."""
    generator = np.random.default_rng(0)
    middle, size, phase = generator.uniform(-1, 1, (3, SEEDS, 4))
    pulse = 2 * np.pi * generator.uniform(0.2, 8.0, (SEEDS, 1))

    def wave(_, time):
        actions = np.clip(middle + size * np.sin(pulse * time + np.pi * phase), -1, 1)
        actions[:, 0] = -1.0
        return actions

    assert mean_return(task, wave) < reference(task) - MARGIN[task]


def test_paddling_under_one_held_peak_does_not_pay():
    """A swing paddle at 5 Hz with the crank stopped and the hoof never quite out of the ground, found by a
    search for forward progress in few stances. Were any contact stance, it would pay for 2 peaks in 10 s and
    return 32."""
    env = gym.make("hoof_env/HorseLeg-v0")
    env.reset(seed=0, options={"crank_angle": 1.202, "speed": 0.5, "gait": "run"})
    turn = 2 * np.pi * (0.3 + 4 * (np.tanh(0.189) + 1)) * 0.02 * np.arange(500)
    offset = -0.389 - 0.462 * np.sin(turn - 0.8 * 1.541 * np.sin(turn))
    wave = np.sin(turn + 3 * 1.669)
    actions = np.clip(
        np.stack([-1 + 0 * turn, offset, 1.727 + 0.509 * wave, 0.121 + 1.05 * wave], axis=1), -1, 1
    )
    steps = [env.step(action) for action in actions.astype(np.float32)]
    total, info = sum(step[1] for step in steps), steps[-1][4]
    assert info["episode_summary"]["duty_factor"] > 0.95
    assert info["episode_summary"]["distance_m"] > 30
    assert info["episode_summary"]["stances"] > 30
    assert total < reference("leg") - MARGIN["leg"]


def test_failing_never_pays_more_than_going_on_badly():
    """The charge for failing exceeds the worst loss over a whole episode among 60 wild feedback policies."""
    generator = np.random.default_rng(0)
    env, returns = gym.make(TASKS["leg"].id), []
    for seed in range(60):
        gain, bias = generator.normal(size=(4, 2)), generator.normal(size=4)
        (observation, _), total, done = env.reset(seed=seed), 0.0, False
        while not done:
            action = np.sign(gain @ observation[:2] + bias).astype(np.float32)
            observation, reward, terminated, truncated, _ = env.step(action)
            total, done = total + reward, terminated or truncated
        returns.append(total)
    assert min(returns) < -30  # the search did find policies that go badly wrong
    charge = check_weights(None)["failure"] * env.unwrapped.settings.episode_seconds
    assert charge > -1.5 * min(returns)
