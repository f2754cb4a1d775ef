"""On every id the reference gait beats the simplest policies, and no trick that was found beats it.

python tests/envs/test_rewards_of_tasks.py          prints the table of docs/evidence/policies.md
"""

import functools
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from family import running_peak_charge, together

from hoof_env._output import markdown_table
from hoof_env.envs.policies import heading_seen, make_policy, start_of, towards
from hoof_env.gait import FilterSettings
from hoof_env.tasks import registry as tasks
from hoof_env.tasks.leg_starts import MAX_HEIGHT, MIN_HEIGHT
from hoof_env.tasks.observation import HIGH, LOW
from hoof_env.tasks.one_leg import OneLeg
from hoof_env.tasks.reward import STEPPING, TERMS, check_weights

TASKS = {name: task for name, task in tasks.TASKS.items() if task.body is OneLeg and task.terms is TERMS}
"""Of one leg that does not fall; test_hop.py and test_balance.py have those that do."""

SEEDS = 40
MARGIN = dict.fromkeys(TASKS, 3.0) | {"rail": 15.0, "fixed": 0.25}
"""Return by which the reference gait is ahead over ten seconds, or the one of the paper's set-up, in the mean
of so many episodes."""

DT = 0.02
PACES = (3, 5, 6, 8, 10, 12, 18, 25, 50)
"""Control steps between two flips of a bang-bang policy."""

OLD_LOW, OLD_HIGH = np.array([[0, -0.1, -0.7, -0.7], [4 * np.pi, 1.2, 0.6, 0.6]])
"""The box of gaits in which actions were positions, when tricks were found first [rad/s, rad, rad, rad]."""

FILTERS = FilterSettings()
QUICK = {"crank_rate": FILTERS.crank_rate, "swing_rate": FILTERS.swing_rate}
"""The highest rates that can be set: those tricks go as fast as they did."""


def gait_of(position):
    """Of an action as it was, in [-1, 1]^4."""
    return OLD_LOW + (OLD_HIGH - OLD_LOW) * (np.clip(position, -1, 1) + 1) / 2


# A wild policy is a function of an environment of its id, which gives a function of observations, one row for
# each of `SEEDS` episodes, and time; that gives actions.


def gone_to(gait_at):
    """A policy that goes to the gait that a function of time gives."""
    return lambda env: towards(env, lambda seen, time: gait_at(time))


def scripted(name, each=True, resets=False):
    """A policy of `make_policy`: one for all episodes, or one each; its clock stands still if it `resets`."""

    def of(env):
        policies = [make_policy(name, env, seed) for seed in range(SEEDS if each else 1)]
        if not each:
            return lambda seen, time: policies[0].predict(seen, episode_start=resets)[0]
        return lambda seen, time: np.array(
            [policy.predict(one)[0] for policy, one in zip(policies, seen, strict=True)]
        )

    return of


def zero(env):
    """The gait that an episode starts in."""
    return lambda seen, time: np.zeros((SEEDS, 4))


def flips(pace, time, before=0):
    """-1 and 1 in turn, so many control steps each; the first as many less as were `before`."""
    return np.full((SEEDS, 4), 1.0 if (round(time / DT) + before) // pace % 2 else -1.0)


def shaken(pace):
    """Rates that flip about the gait that an episode starts in."""
    return lambda env: lambda seen, time: flips(pace, time, pace // 2)


def about_a_drawn_gait(actions_at):
    """Go to a gait from anywhere within the limits for a quarter of the episode, then do what a function of
    time says."""

    def of(env):
        drawn = np.random.default_rng(0).uniform(LOW, HIGH, (SEEDS, 4))
        goes, begins = towards(env, lambda seen, time: drawn), env.settings.episode_seconds / 4
        return lambda seen, time: goes(seen, time) if time < begins else actions_at(time)

    return of


def drawn_rates(time):
    """Random ones of a control step."""
    return np.random.default_rng(round(time / DT)).uniform(-1, 1, (SEEDS, 4))


def constant_rates(env):
    """The corners of the box of actions, and constant actions from inside it."""
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 4)).reshape(4, -1).T
    inside = np.random.default_rng(0).uniform(-1, 1, (SEEDS - len(corners), 4))
    actions = np.vstack([corners, inside])
    return lambda seen, time: actions


def shaking(crank_speed, frequencies):
    """A crank at a constant speed [rad/s], and rates of the swing that are waves of frequencies [Hz] within a
    range, of any size and phase."""

    def of(env):
        generator = np.random.default_rng(0)
        size, phase = generator.uniform(0, 1, (2, SEEDS, 4))
        pulse = 2 * np.pi * generator.uniform(*frequencies, (SEEDS, 1))
        at_speed = towards(
            env, lambda seen, time: heading_seen(env)(seen) * [0, 1, 1, 1] + [crank_speed, 0, 0, 0]
        )

        def act(seen, time):
            waves = size * np.sin(pulse * time + 2 * np.pi * phase)
            return np.column_stack([at_speed(seen, time)[:, 0], waves[:, 1:]])

        return act

    return of


def hop(env):
    """Waves of the swing with the crank stopped: as many as episodes at once, no one of them pays."""
    generator = np.random.default_rng(0)
    middle, size, phase = generator.uniform(-1, 1, (3, SEEDS, 4))
    pulse = 2 * np.pi * generator.uniform(0.2, 8.0, (SEEDS, 1))

    def wave(seen, time):
        position = middle + size * np.sin(pulse * time + np.pi * phase)
        position[:, 0] = -1.0
        return gait_of(position)

    return towards(env, wave)


def paddle(time):
    """A swing paddle at 3 Hz with the crank stopped and the hoof never out of the ground, found by a search
    for what pays where only the peaks of stances are charged and bearing is paid to a stopped crank."""
    turn = 2 * np.pi * 3.037 * time
    offset = 3.188 + 1.368 * np.sin(turn + 2.928 * np.sin(turn))
    wave = np.sin(turn - 0.909)
    return gait_of([-1.0, offset, 0.444 + 3.081 * wave, 5.326 + 1.529 * wave])


def ahead_of(env, target):
    """A function of observations: how far the crank must turn to an angle [rad], below 2 pi."""
    sine, cosine = (env.observation_names.index(f"{function}(crank angle)") for function in ("sin", "cos"))
    return lambda seen: (target - np.arctan2(seen[:, sine], seen[:, cosine])) % (2 * np.pi)


def tremble(env):
    """Found by a search: turn the crank to where the leg lifts the trunk against its spring, stop there, and
    tremble at 5.6 Hz. The leg bears twice the weight, so that the force hardly falls by half; were bearing
    paid to a stopped crank, the mean would be 74 where the run had 24."""
    ahead_in = ahead_of(env, 1.746)

    def gait_at(seen, time):
        ahead = ahead_in(seen)
        speed = np.where((ahead > 0.05) & (ahead < 1.5 * np.pi), np.minimum(2 * ahead, 2 * np.pi), 0.0)
        size = np.where(speed[:, None] == 0, [0.366, -0.534, 1.26], 0.0)
        swing = np.array([0.294, 0.079, 0.243]) + size * np.sin(2 * np.pi * 5.562 * time)
        return gait_of(np.column_stack([speed / (2 * np.pi) - 1, swing]))

    return towards(env, gait_at)


def crawl(speed, target, middle, size, phase, frequency, more=0.0, shift=0.0):
    """Turn the crank to an angle [rad] and go on from there at a slow speed [rad/s], while offset, sine and
    cosine of the swing are waves about a middle [rad] from then on. Numbers, or arrays for many episodes.

    Args:
        middle, size, phase: of the three [rad].
        frequency: [Hz].
        more, shift: a second harmonic, relative to the first one's size, and its phase [rad].
    """
    middle, size, phase = (np.asarray(values) for values in (middle, size, phase))
    frequency, more, shift = (np.reshape(value, (-1, 1)) for value in (frequency, more, shift))

    def of(env):
        ahead_in, since = ahead_of(env, target), []

        def gait_at(seen, time):
            if time == 0:
                since[:] = [np.full(len(seen), -1.0)]
            ahead, (on,) = ahead_in(seen), since
            on[(on < 0) & ((ahead < 0.25) | (ahead > 2 * np.pi - 0.05))] = 0.0
            turn = 2 * np.pi * frequency * np.maximum(on, 0.0)[:, None]
            wave = np.sin(turn + phase) + more * np.sin(2 * turn + shift)
            rate = np.where(on < 0, np.maximum(np.minimum(4 * ahead, 2 * np.pi), speed), speed)
            on[on >= 0] += DT
            return np.column_stack([rate, middle + size * wave])

        return towards(env, gait_at)

    return of


BEFORE = {
    **{f"bang-bang of positions, {pace * DT:g} s": gone_to(lambda time, pace=pace: gait_of(flips(pace, time)))
       for pace in PACES},
    "hopping on the swing": hop,
    "paddling": gone_to(lambda time: np.tile(paddle(time), (SEEDS, 1))),
    "trembling under pressure": tremble,
}  # fmt: skip
"""What was found while actions were positions."""

WILD = {
    "idle": scripted("idle", each=False),
    "airborne": scripted("airborne", each=False),
    "drag": scripted("drag", each=False),
    "standing": scripted("drag", each=False, resets=True),
    "constant rates": constant_rates,
    "random about any gait": about_a_drawn_gait(drawn_rates),
    **{f"bang-bang about any gait, {pace * DT:g} s": about_a_drawn_gait(partial(flips, pace))
       for pace in PACES},
    **{f"crank stopped, waves of {low:g} to {high:g} Hz": shaking(0.0, (low, high))
       for low, high in ((0.1, 0.5), (0.5, 1), (1, 2), (2, 4), (4, 8), (8, 12))},
    **{f"crank at {speed:g} rad/s, shaking": shaking(speed, (2, 8)) for speed in (0.3, 1.1 * STEPPING, 1, 2)},
    "crawling at 0.5 rad/s": crawl(
        0.5, 0.666, (0.151, 0.042, -0.418), (0.334, -0.029, -0.333), (0, -1.338, 0.019), 1.664, -0.048, -0.402
    ),
    "crawling at 1 rad/s": crawl(
        1.0, 1.316, (0.547, -1.602, -1.321), (-0.184, 0.24, -0.187), (0, 2.711, 4.404), 0.222, 0.096, 1.690
    ),
    **{name: of for name, of in BEFORE.items() if "positions" not in name},
}  # fmt: skip
"""Policies that must not pay, by name. Those that crawl are the best that a search (CMA-ES) found for a crank
of constant speed once it is where it begins; above 1 rad/s it finds gaits of long leaps that hardly swing,
which may be as good as they are. A bang-bang of positions at default rates is one of rates."""

SHAKEN = {
    "random rates": scripted("random"),
    **{f"bang-bang of rates, {pace * DT:g} s": shaken(pace) for pace in PACES},
}
"""Rates without a mean, which shake the gait that an episode starts in."""

SHAKEABLE = [task for task in TASKS if task not in ("fixed", "terrain", "safe")]
"""On level ground. The paper's set-up pays 0.3 for a second of the walk that it starts in, and up to 0.6 for
a gait near it, as half a flip may be; on hills a few hard impacts decide, with a shaken gait or without.
Where forces have a limit in place of a price, nothing in the return holds shaking back: it adds 8 to 96, at a
cost of 128 in place of 106, or 5 at a cost of 102."""


def rows(task, policies, **settings):
    """Returns of policies, each of `SEEDS` episodes side by side, by name."""
    names, count = list(policies), SEEDS * len(policies)
    envs = gym.make_vec(TASKS[task].id, num_envs=count, **settings).unwrapped
    observations, _ = envs.reset(seed=[*range(SEEDS)] * len(names))
    env = gym.make(TASKS[task].id, **settings).unwrapped
    acts = [of(env) for of in policies.values()]
    total = np.zeros(count)
    for step in range(round(envs.get_attr("settings")[0].episode_seconds / DT)):
        each = zip(acts, np.split(observations, len(names)), strict=True)
        actions = np.vstack([act(seen, step * DT) for act, seen in each])
        observations, rewards, _, truncated, _ = envs.step(np.clip(actions, -1, 1).astype(np.float32))
        total += rewards
    assert truncated.all()  # in good order, all at once
    return dict(zip(names, total.reshape(len(names), SEEDS), strict=True))


@functools.cache
def wild_returns(task):
    return rows(task, WILD)


@functools.cache
def quick_returns(task):
    return rows(task, BEFORE, **QUICK)


@functools.cache
def shaken_returns(task):
    return rows(task, {"zero": zero, **SHAKEN})


@functools.cache
def gait_rewards(task, name):
    """Of every step, shape (steps, SEEDS), of a gait that the episodes start in."""
    envs = gym.make_vec(TASKS[task].id, num_envs=SEEDS).unwrapped
    policy = make_policy(name, gym.make(TASKS[task].id))
    observations, _ = envs.reset(seed=0, options=start_of(policy))
    steps, truncated = [], np.zeros(SEEDS, bool)
    while not truncated.any():
        observations, rewards, _, truncated, _ = envs.step(policy.predict(observations)[0])
        steps.append(rewards)
    assert truncated.all()
    return np.array(steps)


def gait_returns(task, name):
    return gait_rewards(task, name).sum(0)


def bar(task):
    """What wild policies stay below."""
    return gait_returns(task, TASKS[task].reference).mean() - MARGIN[task]


@pytest.mark.parametrize("name", WILD)
@pytest.mark.parametrize("task", TASKS)
def test_wild_policies_stay_below_the_reference(task, name):
    assert wild_returns(task)[name].mean() < bar(task)


def is_trick(task, name):
    """Whether a policy of before is still what it was: flips of 0.06 s hardly move the gait that an episode
    starts in, and on the paper's set-up no flips of positions do more than shake it, see `SHAKEABLE`."""
    if "bang-bang" not in name:
        return True
    return task in ("leg", "speed") or (task != "fixed" and f" {PACES[0] * DT:g} s" not in name)


@pytest.mark.parametrize(
    ("task", "name"), [(task, name) for task in TASKS for name in BEFORE if is_trick(task, name)]
)
def test_tricks_of_before_do_not_pay_at_the_rates_of_before(task, name):
    assert quick_returns(task)[name].mean() < bar(task)


@pytest.mark.parametrize("name", SHAKEN)
@pytest.mark.parametrize("task", SHAKEABLE)
def test_shaking_a_gait_does_not_pay(task, name):
    """It may be a good gait that an episode starts in; as it is, it is better."""
    returns = shaken_returns(task)
    assert returns[name].mean() < returns["zero"].mean()


def test_no_random_wave_on_a_slow_crank_pays():
    """The best of 480, each from a start of its own: with the crank stopped, or at up to 1 rad/s."""
    generator, count = np.random.default_rng(0), 480
    each = generator.uniform(-1, 1, (3, count, 3))
    angle, pulse, more, shift = generator.uniform(-1, 1, (4, count))
    speed = np.where(np.arange(count) < count / 4, 0.0, generator.uniform(0, 1, count))
    middle, size = np.array([0.5, 0, 0]) + each[0] * [0.6, 0.5, 0.5], 0.3 * each[1]
    of = crawl(speed, np.pi * angle, middle, size, np.pi * each[2], 1.3 * 6**pulse, 0.5 * more, np.pi * shift)
    envs = gym.make_vec(TASKS["leg"].id, num_envs=count).unwrapped
    observations, _ = envs.reset(seed=0)
    act, total = of(gym.make(TASKS["leg"].id).unwrapped), np.zeros(count)
    for step in range(500):
        observations, rewards, _, truncated, _ = envs.step(act(observations, step * DT))
        total += rewards
    assert truncated.all()
    assert total.max() > 20  # it does find policies that make way
    assert total.max() < bar("leg")


STANDING = {
    "crank_angle": 2.356, "speed": 0.0,
    "gait": {"crank_speed": 0.0, "swing_offset": 0.8, "swing_sin": 0.0, "swing_cos": 0.0},
}  # fmt: skip
"""On a stopped crank in the posture of "drag": the hoof is down from the beginning and bears weight."""


def test_trembling_in_place_of_steps_does_not_pay():
    """The swing at 4 to 8 Hz, and the hoof never lifts: one stance an episode, whose peak would be charged
    once. Each rise to more than twice the force before it is, and the best of such policies stays below the
    run."""
    generator = np.random.default_rng(0)
    pulse, phase = 2 * np.pi * generator.uniform([4, 0], [8, 1], (SEEDS, 2)).T
    size = generator.uniform(0, 1, (SEEDS, 4)) * [0, 1, 1, 1] * (OLD_HIGH - OLD_LOW) / 2
    middle, weight = np.array(list(STANDING["gait"].values())), 0.001 * check_weights(None)["peak"]

    def wave(seen, time):
        return np.clip(middle + size * np.sin(pulse * time + phase)[:, None], OLD_LOW, OLD_HIGH)

    def played(recorded):
        """Returns, charges, summary and records of an episode, records of some rows alone."""
        envs = gym.make_vec(TASKS["leg"].id, num_envs=SEEDS, **QUICK).unwrapped
        observations, _ = envs.reset(seed=0, options=STANDING)
        act, total, charge = towards(envs, wave), np.zeros(SEEDS), np.zeros(SEEDS)
        records = {env: [envs.record(env)] for env in recorded}
        for step in range(500):
            observations, rewards, _, truncated, infos = envs.step(act(observations, step * DT))
            total, charge = total + rewards, charge - infos["reward_peak"]
            for env, record in records.items():
                record.append(envs.record(env))
        assert truncated.all()
        return total, charge, infos["episode_summary"], records

    total, charge, summary, _ = played([])
    never_lift = (summary["duty_factor"] > 0.99) & (summary["stances"] == 1)
    assert never_lift.sum() > SEEDS / 4
    again, _, _, records = played(np.flatnonzero(never_lift)[:6])
    np.testing.assert_array_equal(again, total)
    for env, record in records.items():
        forces = together(record[1:])["grf"]
        turns = forces[1:-1][np.diff(np.diff(forces) > 0)]
        troughs, crests = turns[:-1], turns[1:]
        assert charge[env] == pytest.approx(weight * running_peak_charge(forces), rel=1e-9)
        assert charge[env] >= weight * np.maximum(crests - 2 * troughs, 0.0).sum()
    assert charge[never_lift].mean() > 10 * weight * summary["stance_peak_sum_n"][never_lift].mean()
    assert total[never_lift].max() < bar("leg")


SUSPENDED = [task for task in TASKS if TASKS[task].settings({}).trunk == "suspended"]


@pytest.mark.parametrize("task", SUSPENDED)
def test_failing_is_out_of_reach_of_wild_feedback(task):
    """Some of 240 policies that switch between the highest rates go badly wrong, and of none the height comes
    half as far as that at which an episode fails: by no policy can the rest of an episode be spared."""
    generator, count = np.random.default_rng(0), 240
    envs = gym.make_vec(TASKS[task].id, num_envs=count, **QUICK).unwrapped
    observations, _ = envs.reset(seed=0)
    gain, bias = generator.normal(size=(count, 4, observations.shape[1])), generator.normal(size=(count, 4))
    gain[: count // 2, :, 2:] = 0.0  # half of them see the crank alone
    total, heights, truncated = np.zeros(count), [], np.zeros(1, bool)
    while not truncated.any():
        actions = np.sign(np.einsum("nij,nj->ni", gain, observations) + bias)
        observations, rewards, terminated, truncated, _ = envs.step(actions.astype(np.float32))
        assert not terminated.any()
        total += rewards
        heights.append(np.ravel(envs.engine.report["y"])[:count] / envs.body.height)
    assert truncated.all()
    assert total.min() < -30
    assert np.min(heights) > (1 + MIN_HEIGHT) / 2
    assert np.max(heights) < (1 + MAX_HEIGHT) / 2


@pytest.mark.parametrize("task", SUSPENDED)
def test_failing_at_the_end_does_not_pay(task):
    """What the run loses over the rest of an episode never exceeds the charge for failing instead, while
    there is time left for a free fall to where an episode fails."""
    env = gym.make(TASKS[task].id).unwrapped
    rewards = gait_rewards(task, "run")
    losses = -np.cumsum(rewards[::-1], axis=0)[::-1]
    left = DT * np.arange(len(rewards), 0, -1)
    fall = np.sqrt(2 * (1 - MIN_HEIGHT) * env.body.height / 9.81)
    spared = losses - env.weights["failure"] * left[:, None]
    assert 0.1 < fall < 1
    assert spared[left >= fall].max() < 0


def table():
    """Returns of all these policies on all ids: mean and the normal 95 % interval over episodes."""

    def cell(each):
        return f"{each.mean():.1f} ± {1.96 * each.std(ddof=1) / SEEDS**0.5:.1f}"

    def line(name, returns):
        return [name, *(cell(returns(task)) for task in TASKS)]

    lines = [line(name, lambda task, name=name: gait_returns(task, name)) for name in ("run", "walk")]
    lines.append(line("zero action", lambda task: shaken_returns(task)["zero"]))
    lines += [line(name, lambda task, name=name: shaken_returns(task)[name]) for name in SHAKEN]
    lines += [line(name, lambda task, name=name: wild_returns(task)[name]) for name in WILD]
    lines += [
        line(f"{name}, at the highest rates", lambda task, name=name: quick_returns(task)[name])
        for name in BEFORE
    ]
    return markdown_table(["policy", *(f"`{TASKS[task].id.partition('/')[2]}`" for task in TASKS)], lines)


if __name__ == "__main__":
    print(table())
