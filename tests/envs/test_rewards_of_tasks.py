"""On every id the reference gait beats the simplest policies, and no trick that was found beats it.

python tests/envs/test_rewards_of_tasks.py          prints the table of docs/evidence/policies.md
"""

import functools

import gymnasium as gym
import numpy as np
import pytest
from family import running_peak_charge, together

from hoof_env._output import markdown_table
from hoof_env.envs import tasks
from hoof_env.envs.policies import make_policy
from hoof_env.envs.reward import check_weights

TASKS = {name: task for name, task in tasks.TASKS.items() if not task.is_horse}
"""Of one leg; test_horse.py has the horse's."""

SEEDS = 40
MARGIN = dict.fromkeys(TASKS, 3.0) | {"fixed": 0.3}
"""Return by which the reference gait is ahead over ten seconds, or the one of the paper's set-up, in the mean
of so many episodes."""

DT = 0.02
PACES = (3, 5, 6, 8, 10, 12, 18, 25, 50)
"""Control steps between two flips of a bang-bang policy."""


def mean_return(task, act):
    return returns(task, act).mean()


def returns(task, act):
    """Of `SEEDS` episodes side by side; `act` maps observations and time to actions."""
    envs = gym.make_vec(TASKS[task].id, num_envs=SEEDS, autoreset_mode="DISABLED")
    observations, _ = envs.reset(seed=0)
    total, ended = np.zeros(SEEDS), np.zeros(SEEDS, bool)
    for step in range(500):
        actions = np.asarray(act(observations, step * DT), np.float32)
        observations, rewards, terminated, truncated, _ = envs.step(np.broadcast_to(actions, (SEEDS, 4)))
        total, ended = total + rewards, ended | terminated | truncated
        if ended.any():
            break
    assert truncated.all()  # in good order, all at once
    return total


def scripted(task, name, each):
    """A policy of `make_policy` for all environments: one command for all, or one policy each. "standing"
    drags without rubbing, for its clock stands still; "zero" is the action."""
    if name == "zero":
        return lambda seen, _: np.zeros(4)
    env, is_stopped = gym.make(TASKS[task].id), name == "standing"
    made = "drag" if is_stopped else name
    policies = [make_policy(made, env, seed) for seed in range(SEEDS if each else 1)]
    return lambda seen, _: np.array(
        [p.predict(one, episode_start=is_stopped)[0] for p, one in zip(policies, seen, strict=False)]
    )


@functools.cache
def reference(task):
    return mean_return(task, scripted(task, TASKS[task].reference, each=False))


@pytest.mark.parametrize("name", ["idle", "airborne", "drag", "standing", "random", "zero"])
@pytest.mark.parametrize("task", TASKS)
def test_simple_policies_stay_below_the_reference(task, name):
    if name == "zero" and TASKS[task].settings({}).gait == TASKS[task].reference:
        pytest.skip("actions are offsets to the reference gait: the zero action is that gait")
    each = name != "idle"
    assert mean_return(task, scripted(task, name, each)) < reference(task) - MARGIN[task]


def bang_bang(pace):
    """From one end of all ranges to the other."""
    return lambda _, time: np.full(4, 1.0 if round(time / DT) // pace % 2 else -1.0)


@pytest.mark.parametrize("pace", PACES)
@pytest.mark.parametrize("task", TASKS)
def test_bang_bang_of_any_pace_stays_below_the_reference(task, pace):
    assert mean_return(task, bang_bang(pace)) < reference(task) - MARGIN[task]


def hop():
    """Waves of the swing with the crank stopped: as many as episodes at once, no one of them pays."""
    generator = np.random.default_rng(0)
    middle, size, phase = generator.uniform(-1, 1, (3, SEEDS, 4))
    pulse = 2 * np.pi * generator.uniform(0.2, 8.0, (SEEDS, 1))

    def wave(_, time):
        actions = np.clip(middle + size * np.sin(pulse * time + np.pi * phase), -1, 1)
        actions[:, 0] = -1.0
        return actions

    return wave


@pytest.mark.parametrize("task", TASKS)
def test_hopping_on_the_swing_with_the_crank_stopped_stays_below_the_reference(task):
    assert mean_return(task, hop()) < reference(task) - MARGIN[task]


def paddle(_, time):
    """A swing paddle at 3 Hz with the crank stopped and the hoof never out of the ground, found by a search
    for what pays where only the peaks of stances are charged and bearing is paid to a stopped crank."""
    turn = 2 * np.pi * 3.037 * time
    offset = 3.188 + 1.368 * np.sin(turn + 2.928 * np.sin(turn))
    wave = np.sin(turn - 0.909)
    return np.clip([-1.0, offset, 0.444 + 3.081 * wave, 5.326 + 1.529 * wave], -1, 1)


def test_paddling_under_one_held_peak_does_not_pay():
    """From the start that it was found for it is faster than the run, in two stances. The peak is not held: a
    charge for the peaks of stances would be a tenth of this one."""
    env = gym.make("hoof_env/HorseLeg-v0").unwrapped
    env.reset(seed=0, options={"crank_angle": 7.835, "speed": 0.5, "gait": "run"})
    total, records = 0.0, [env.record()]
    for step in range(500):
        _, reward, _, _, info = env.step(paddle(None, step * DT).astype(np.float32))
        total += reward
        records.append(env.record())
    summary, forces = info["episode_summary"], together(records[1:])["grf"]
    assert summary["duty_factor"] > 0.95
    assert summary["distance_m"] > 25
    assert summary["stances"] <= 3
    assert running_peak_charge(forces) > 10 * summary["stance_peak_sum_n"]
    assert total < reference("leg") - MARGIN["leg"]


@pytest.mark.parametrize("task", TASKS)
def test_paddling_stays_below_the_reference(task):
    assert mean_return(task, paddle) < reference(task) - MARGIN[task]


STANDING = {
    "crank_angle": 2.356, "speed": 0.0,
    "gait": {"crank_speed": 0.0, "swing_offset": 0.8, "swing_sin": 0.0, "swing_cos": 0.0},
}  # fmt: skip
"""On a stopped crank in the posture of "drag": the hoof is down from the beginning and bears weight."""


def test_trembling_in_place_of_steps_does_not_pay():
    """The swing at 4 to 8 Hz, and the hoof never lifts: one stance an episode, whose peak would be charged
    once. Each rise to more than twice the force before it is, and the best of such policies stays below the
    run."""
    envs = gym.make_vec(TASKS["leg"].id, num_envs=SEEDS, autoreset_mode="DISABLED").unwrapped
    envs.reset(seed=0, options=STANDING)
    generator = np.random.default_rng(0)
    pulse, phase = 2 * np.pi * generator.uniform([4, 0], [8, 1], (SEEDS, 2)).T
    size = generator.uniform(0, 1, (SEEDS, 4)) * [0, 1, 1, 1]
    middle = envs.action_for(list(STANDING["gait"].values()))
    total, charge, records = np.zeros(SEEDS), np.zeros(SEEDS), [[envs.record(env)] for env in range(SEEDS)]
    for step in range(500):
        wave = np.sin(pulse * step * DT + phase)[:, None]
        _, rewards, _, truncated, infos = envs.step(np.clip(middle + size * wave, -1, 1).astype(np.float32))
        total, charge = total + rewards, charge - infos["reward_peak"]
        for env, recorded in enumerate(records):
            recorded.append(envs.record(env))
    assert truncated.all()
    summary = infos["episode_summary"]
    never_lift = (summary["duty_factor"] > 0.99) & (summary["stances"] == 1)
    assert never_lift.sum() > SEEDS / 4
    for env in np.flatnonzero(never_lift):
        forces = together(records[env][1:])["grf"]
        turns = forces[1:-1][np.diff(np.diff(forces) > 0)]
        troughs, crests = turns[:-1], turns[1:]
        assert charge[env] == pytest.approx(0.75e-3 * running_peak_charge(forces), rel=1e-9)
        assert charge[env] >= 0.75e-3 * np.maximum(crests - 2 * troughs, 0.0).sum()
    assert charge[never_lift].mean() > 10 * 0.75e-3 * summary["stance_peak_sum_n"][never_lift].mean()
    assert total[never_lift].max() < reference("leg") - MARGIN["leg"]


def tremble(task):
    """Found by a search: turn the crank to where the leg lifts the trunk against its spring, stop there, and
    tremble at 5.6 Hz. The leg bears twice the weight, so that the force hardly falls by half; were bearing
    paid to a stopped crank, the mean would be 74 where the run has 24."""
    names = gym.make(TASKS[task].id).unwrapped.observation_names
    sine, cosine = (names.index(f"{function}(crank angle)") for function in ("sin", "cos"))

    def act(seen, time):
        ahead = (1.746 - np.arctan2(seen[:, sine], seen[:, cosine])) % (2 * np.pi)
        speed = np.where((ahead > 0.05) & (ahead < 1.5 * np.pi), np.minimum(2 * ahead, 2 * np.pi), 0.0)
        size = np.where(speed[:, None] == 0, [0.366, -0.534, 1.26], 0.0)
        swing = np.array([0.294, 0.079, 0.243]) + size * np.sin(2 * np.pi * 5.562 * time)
        return np.clip(np.column_stack([speed / (2 * np.pi) - 1, swing]), -1, 1)

    return act


TREMBLING = [task for task in TASKS if task != "fixed"]
"""Where the trunk can be lifted."""


@pytest.mark.parametrize("task", TREMBLING)
def test_trembling_under_pressure_stays_below_the_reference(task):
    assert mean_return(task, tremble(task)) < reference(task) - MARGIN[task]


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


def table():
    """Returns of all these policies on all ids: mean and the normal 95 % interval over episodes."""

    def cell(task, act):
        each = returns(task, act)
        return f"{each.mean():.1f} ± {1.96 * each.std(ddof=1) / SEEDS**0.5:.1f}"

    named = {
        name: lambda task, name=name: scripted(task, name, each=name not in ("run", "walk", "idle"))
        for name in ("run", "walk", "idle", "zero", "airborne", "drag", "standing", "random")
    }
    named |= {f"bang-bang, {pace * DT:g} s": lambda _, pace=pace: bang_bang(pace) for pace in PACES}
    named |= {"hopping on the swing": lambda _: hop(), "paddling": lambda _: paddle}
    named |= {"trembling under pressure": tremble}
    lines = [
        [name, *("" if name.startswith("tremb") and t not in TREMBLING else cell(t, of(t)) for t in TASKS)]
        for name, of in named.items()
    ]
    return markdown_table(["policy", *(f"`{TASKS[task].id.partition('/')[2]}`" for task in TASKS)], lines)


if __name__ == "__main__":
    print(table())
