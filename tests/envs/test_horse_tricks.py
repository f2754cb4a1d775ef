"""Tricks, and what is no gait, return less than the reference gait of `Horse-v0`."""

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE
from horses import SEEDS, SPEEDS, die, played

from hoof_env.envs.policies import make_policy

MARGIN, IN_STEP = 15.0, 2.0
"""Return over ten seconds by which the reference gait is ahead, at least; less of legs that swing in step,
which the small offsets hardly change."""


def assert_below(reference, found, margin=MARGIN):
    """From the same starts, and by four standard errors of the differences."""
    lost = reference - found
    assert lost.mean() > max(margin, 4 * lost.std() / np.sqrt(SEEDS))


def bang_bang(pace):
    return lambda seen, time: np.full(16, 1.0 if round(time / 0.02) // pace % 2 else -1.0)


def hop(seen, time):
    """All cranks as slow as actions make them, all legs swung together."""
    action = np.zeros((4, 4))
    action[:, 0], action[:, 1] = -1.0, np.sin(2 * np.pi * 3 * time)
    return action.ravel()


def brake(seen, time):
    """The fore legs against the hind legs."""
    action = np.zeros((4, 4))
    action[:2, 1], action[2:, 1] = 1.0, -1.0
    return action.ravel()


def skate(seen, time):
    """Cranks slowed down, hooves dragged by the swing."""
    action = np.zeros((4, 4))
    action[:, 0] = -0.5
    action[::2, 1] = np.sin(2 * np.pi * time)
    action[1::2, 1] = -np.sin(2 * np.pi * time)
    return action.ravel()


TRICKS = {"hop": hop, "brake": brake, "skate": skate, "die": die} | {
    f"bang-bang {pace}": bang_bang(pace) for pace in (3, 6, 12, 25)
}


@pytest.fixture(scope="module")
def reference():
    return played(lambda seen, time: np.zeros(16))[0]


@pytest.mark.parametrize("name", TRICKS)
def test_tricks_stay_below_the_reference(reference, name):
    assert_below(reference, played(TRICKS[name])[0], IN_STEP if name == "hop" else MARGIN)


def terms_of(act):
    """Of the reward, by name, for a second of 40 horses that have not fallen."""
    envs = gym.make_vec(HORSE, num_envs=SEEDS, autoreset_mode="SAME_STEP", target_speed=SPEEDS[0])
    envs.reset(seed=0)
    standing, total, count = np.ones(SEEDS, bool), {}, 0
    for step in range(250):
        taken = np.broadcast_to(np.asarray(act(None, 0.02 * step), np.float32), (SEEDS, 16))
        _, _, failed, truncated, infos = envs.step(taken)
        standing &= ~(failed | truncated)
        count += standing.sum()
        for name in (name for name in infos if name.startswith("reward_")):
            total[name] = total.get(name, 0.0) + infos[name][standing].sum()
    return {name: 50 * value / count for name, value in total.items()}


@pytest.fixture(scope="module")
def own_terms():
    return terms_of(lambda seen, time: np.zeros(16))


@pytest.mark.parametrize(
    ("name", "term", "factor"),
    [
        ("hop", "slip", 1.03), ("skate", "slip", 2.2), ("brake", "slip", 2.2), ("brake", "peak", 1.4),
        ("bang-bang 3", "slip", 2), ("bang-bang 12", "peak", 1.5), ("bang-bang 25", "pitch", 4),
        ("die", "slip", 2.2),
    ],
)  # fmt: skip
def test_a_trick_is_charged_for_what_it_does(own_terms, name, term, factor):
    """So many times what the reference gait is charged for it."""
    charged, usual = terms_of(TRICKS[name])[f"reward_{term}"], own_terms[f"reward_{term}"]
    assert charged < factor * usual < 0


@pytest.mark.parametrize("name", ["random", "bang-bang"])
def test_simple_policies_stay_below_the_reference(reference, name):
    policy = make_policy(name, gym.make(HORSE))
    assert_below(reference, played(lambda seen, time: policy.predict(seen)[0])[0], 5.0)
