"""Ctrl-C at any line of a step, a reset or a state: the environment then goes on to the same bits as if the
call had not been made, or had ended, or it says that it must be reset."""

from __future__ import annotations

import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from family import same
from gymnasium.error import ResetNeeded

import hoof_env

PACKAGE = str(Path(hoof_env.__file__).parent)
LEG = "hoof_env/HorseLegSpeed-v0"
BUSY = {
    "episode_seconds": 0.12,
    "target_seconds": [0.02, 0.04],
    "push_impulse": 5.0,
    "push_seconds": [0.02, 0.04],
    "randomize": {"friction": (0.3, 0.6)},
    "noise": {"gait": 0.05},
    "cost": {"peak": 1500.0},
}
"""Settings under which every step draws, pushes and counts costs."""


def interrupted_at(line, act):
    """Call a function, with KeyboardInterrupt at the n-th line of the package that it runs; return True if it
    ended before."""
    left = line

    def in_package(frame, event, _):
        nonlocal left
        if event == "line":
            left -= 1
            if left == 0:
                sys.settrace(None)
                raise KeyboardInterrupt
        return in_package

    def enter(frame, event, _):
        return in_package if frame.f_code.co_filename.startswith(PACKAGE) else None

    sys.settrace(enter)
    try:
        act()
        return True
    except KeyboardInterrupt:
        return False
    finally:
        sys.settrace(None)


def made(n, mode):
    if not n:
        return gym.make(LEG, **BUSY).unwrapped
    return gym.make_vec(LEG, n, autoreset_mode=mode, **BUSY).unwrapped


def play(env, shape, steps=3):
    """What steps return."""
    return [env.step(np.full(shape, 0.1 * k, np.float32)) for k in range(steps)]


CALLS = {
    "step": lambda env, shape, state: env.step(np.zeros(shape, np.float32)),
    "reset": lambda env, shape, state: env.reset(seed=7),
    "set_state": lambda env, shape, state: env.set_state(state),
}


@pytest.mark.parametrize(("n", "mode", "steps"), [(0, "", 1), (3, "NEXT_STEP", 6), (3, "SAME_STEP", 5)])
@pytest.mark.parametrize("call", CALLS)
def test_a_call_is_not_made_or_has_ended_or_asks_for_a_reset(call, n, mode, steps):
    """Vector environments start episodes in the step."""
    env = made(n, mode)
    shape = (n, 4) if n else (4,)
    env.reset(seed=1)
    later = env.get_state()
    env.reset(seed=0)
    play(env, shape, steps)
    before = env.get_state()
    same_as = []
    for act in (lambda: None, lambda: CALLS[call](env, shape, later)):
        env.set_state(before)
        act()
        same_as.append(play(env, shape))
    outcomes = set()
    for line in range(1, 10_000, 3 if call == "reset" else 1):
        env.set_state(before)
        if interrupted_at(line, lambda: CALLS[call](env, shape, later)):
            break
        try:
            found = play(env, shape)
        except ResetNeeded:
            with pytest.raises(ResetNeeded, match=r"get_state.* interrupted.*reset\(\)"):
                env.get_state()
            outcomes.add("refused")
            continue
        equal = [is_same(found, expected) for expected in same_as]
        assert any(equal), line
        outcomes.add("not made" if equal[0] else "ended")
    assert line > 20
    assert {"not made", "refused"} <= outcomes
    env.reset(seed=0)
    play(env, shape, steps)
    same(play(env, shape), same_as[0])


def is_same(one, two):
    try:
        same(one, two)
    except AssertionError:
        return False
    return True
