"""Delays, histories and true numbers: what is seen and what acts when, with the same bits everywhere."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from family import HORSE, actions, make, same, steps

from hoof_env.episodes.delays import Parts, parts_of

LEG, FIXED = "hoof_env/HorseLeg-v0", "hoof_env/HorseLegFixed-v0"

LATE = {
    "observation_delay": 1.25,
    "action_delay": 1.5,
    "observation_history": 2,
    "last_actions": 2,
    "privileged": ["trunk", "gait"],
    "noise": {"gait": 0.02},
    "episode_seconds": 0.5,
}
DRAWN = {**LATE, "observation_delay": (0, 2), "action_delay": (1, 3)}


@pytest.mark.parametrize(("seen", "acts"), [(0, 0), (2, 0), (0, 3), (1, 2)], ids=str)
@pytest.mark.parametrize("env_id", [LEG, HORSE])
def test_whole_delays_show_and_do_what_an_environment_without_them_did_before(env_id, seen, acts):
    env = make(
        env_id, observation_delay=seen, action_delay=acts, observation_history=2, last_actions=3,
        privileged=["trunk"],
    )  # fmt: skip
    plain = make(env_id)
    shown = [plain.reset(seed=1)[0]]
    observation = env.reset(seed=1)[0]
    size, width = len(shown[0]), len(env.action_names)
    names = plain.observation_names
    true = [
        names.index(name.removeprefix("true "))
        for name in env.observation_names[-len(names) :]
        if "true " in name
    ]
    past = [np.zeros(width, np.float32)] * 10
    for k, action in enumerate(actions(3, 25, env_id=env_id)):
        expected = [shown[max(k - seen - j, 0)] for j in (0, 1)] + past[:-4:-1] + [shown[-1][true]]
        same(observation, np.concatenate(expected))
        assert len(observation) == 2 * size + 3 * width + len(true)
        past.append(action)
        observation, *rest, _ = env.step(action)
        now, *others, _ = plain.step(past[-1 - acts])
        same(rest, others)
        shown.append(now)


def test_a_part_of_a_step_is_made_of_substeps():
    """Half a step late: as if the commands of an engine changed there."""
    env = make(LEG, action_delay=0.5, observation_delay=0.25)
    env.reset(seed=2)
    env.record()
    hand = copy.deepcopy(env)
    names = list(env.observation_names)
    for action in actions(1, 12):
        engine = copy.deepcopy(env.engine)
        observation = env.step(action)[0]
        engine.advance(None, 10)
        middle = copy.deepcopy(engine)
        command = np.array(env.engine._memory.command)
        middle.advance(command, 5)
        speed = np.tanh(middle.report["vx"][0] / 5)
        assert observation[names.index("forward speed")] == pytest.approx(speed, abs=1e-6)
        middle.advance(None, 5)
        np.testing.assert_allclose(env.engine.state["momentum_x"], middle.state["momentum_x"], rtol=1e-12)
        record = env.record()
        same(record["vx"][-1, 0], env.engine.report["vx"][0])
    # Sums of a step are the sums of its parts.
    whole = make(LEG, action_delay=1)
    parts = make(LEG, action_delay=1, observation_delay=0.5)
    for one in (whole, parts, hand):
        one.reset(seed=2)
    for one, other in zip(steps(whole, 60), steps(parts, 60), strict=True):
        a, b = one[-1]["measured"], other[-1]["measured"]
        for name in ("normal_impulse", "positive_work", "slip", "highest_grf", "stances", "loaded_time"):
            assert a[name] == pytest.approx(b[name], rel=1e-9, abs=1e-12)
        assert one[1] == pytest.approx(other[1], rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("given", [LATE, DRAWN], ids=["fractions", "drawn"])
@pytest.mark.parametrize("env_id", [LEG, HORSE])
def test_a_row_has_the_bits_of_one_environment(env_id, given):
    n, count = 11, 40
    envs = make(env_id, n, **given)
    taken = actions(1, count, n, env_id=env_id)
    found = [envs.reset(seed=5)[0]] + [envs.step(each)[:4] for each in taken]
    for row in (0, 9):
        env = make(env_id, **given)
        same(env.reset(seed=5 + row)[0], found[0][row])
        over = False
        for action, step in zip(taken[:, row], found[1:], strict=True):
            if over:
                same(env.reset()[0], step[0][row])
                over = False
                continue
            observation, reward, terminated, truncated, _ = env.step(action)
            same(observation, step[0][row])
            assert (reward, terminated, truncated) == (step[1][row], step[2][row], step[3][row])
            over = terminated or truncated


@pytest.mark.parametrize("given", [LATE, DRAWN], ids=["fractions", "drawn"])
def test_states_pickles_and_copies_continue_with_the_same_bits(given):
    env, other, many = make(LEG, **given), make(LEG, **given), make(LEG, 9, **given)
    env.reset(seed=1)
    seen = steps(env, 7)[-1][0]
    state = env.get_state()
    other.reset(seed=9)
    same(other.set_state(state), seen)
    same(many.set_state(state)[4], seen)
    twins = [other, copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    rolled = [s[:4] for s in steps(env, 12)]
    for twin in twins:
        same([s[:4] for s in steps(twin, 12)], rolled)
    for action, step in zip(actions(5, 12), rolled, strict=True):
        same(many.step(np.repeat(action[None], 9, 0))[0][8], step[0])


def test_delays_that_are_drawn_are_all_that_may_be():
    envs = make(LEG, 64, **DRAWN)
    envs.reset(seed=0)
    rows = envs.batch.rows.named
    assert set(rows.observation_delay[:64]) == {0.0, 1.0, 2.0}
    assert set(rows.action_delay[:64]) == {1.0, 2.0, 3.0}


def test_true_numbers_have_no_noise():
    privileged = ["trunk", "hoof"]
    noise = dict.fromkeys(privileged, 0.2)
    noisy, plain = make(LEG, noise=noise, bias=noise, privileged=privileged), make(LEG)
    true = [k for k, name in enumerate(noisy.observation_names) if name.startswith("true ")]
    same_names = [noisy.observation_names[k].removeprefix("true ") for k in true]
    of_plain = [plain.observation_names.index(name) for name in same_names]
    observed = [(noisy.reset(seed=1)[0], plain.reset(seed=1)[0])]
    observed += [(noisy.step(action)[0], plain.step(action)[0]) for action in actions(1, 12)]
    for one, other in observed:
        same(one[true], other[of_plain])
        assert not np.array_equal(one[of_plain], other[of_plain])


def test_the_paper_s_solver_takes_whole_steps():
    given = {"solver": "paper", "last_actions": 1}
    env, plain = make(FIXED, action_delay=1, **given), make(FIXED, solver="paper")
    env.reset(seed=0)
    plain.reset(seed=0)
    taken = actions(1, 6)
    for k in range(6):
        one = env.step(taken[k])
        other = plain.step(taken[k - 1] if k else np.zeros(4, np.float32))
        same(one[0][:-4], other[0])


@pytest.mark.parametrize(
    ("substeps", "acts", "seen", "parts"),
    [
        (20, 0, 0, Parts((20,), 0, -1)),
        (20, 10, 0, Parts((10, 10), 1, -1)),
        (20, 0, 5, Parts((15, 5), 0, 0)),
        (20, 10, 5, Parts((10, 5, 5), 1, 1)),
        (20, 15, 5, Parts((15, 5), 1, 0)),
        (20, 18, 5, Parts((15, 3, 2), 2, 0)),
    ],
)
def test_parts_of_a_step(substeps, acts, seen, parts):
    assert parts_of(substeps, acts, seen) == parts
    assert sum(parts.substeps) == substeps
