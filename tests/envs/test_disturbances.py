"""Noise, bias and pushes: what they are, that they have the same bits everywhere, and what is refused."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from family import HORSE, actions, make, same, steps

from hoof_env import Sb3VecEnv
from hoof_env.episodes.pushes import check_pushes
from hoof_env.errors import FixedSettingError, ParameterError
from hoof_env.simd import threads
from hoof_env.tasks.disturbances import ROUGH_PUSH, ROUGH_SLOPE, ROUGHNESS, rough_ground
from hoof_env.tasks.terrains import make_terrain

LEG, RAIL, FIXED = (f"hoof_env/HorseLeg{name}-v0" for name in ("", "Rail", "Fixed"))

NOISY = {"noise": {"gait": 0.03, "trunk": 0.05}, "bias": {"hoof": 0.04, "gait": 0.02}}
PUSHED = {"push_impulse": (-20.0, 30.0), "push_seconds": (0.04, 0.1)}
ALL = {**NOISY, **PUSHED, "strength": 0.7, "episode_seconds": 0.5}


def alone(env_id, seed, taken, **settings):
    """Results of a single environment that is started again after each episode."""
    env = make(env_id, **settings)
    found, over = [env.reset(seed=seed)[0]], False
    for action in taken:
        if over:
            found.append(env.reset()[0])
            over = False
            continue
        observation, reward, terminated, truncated, _ = env.step(action)
        found += [observation, reward, terminated, truncated]
        over = terminated or truncated
    return found


@pytest.mark.parametrize(
    ("env_id", "drive"),
    [(LEG, "prescribed"), (RAIL, "motor"), (HORSE, "prescribed"), (LEG, "motor"), (HORSE, "motor")],
)
def test_a_row_has_the_bits_of_one_environment_on_any_number_of_threads(env_id, drive, monkeypatch):
    monkeypatch.setattr(threads, "available", lambda: 8)
    n, count = 19, 60
    settings = {**ALL, "drive": drive}
    taken = actions(1, count, n, env_id=env_id)
    rollouts = []
    for num_threads in (1, 3):
        envs = make(env_id, n, num_threads=num_threads, **settings)
        rollouts.append([envs.reset(seed=5)[0], *(envs.step(each)[:4] for each in taken)])
    same(*rollouts)
    for row in (0, 7, 18):
        wanted = alone(env_id, 5 + row, taken[:, row], **settings)
        found = [rollouts[0][0][row]]
        over = False
        for observation, reward, terminated, truncated in rollouts[0][1:]:
            found += [observation[row]] if over else [part[row] for part in (observation, reward)]
            found += [] if over else [bool(terminated[row]), bool(truncated[row])]
            over = not over and (terminated[row] or truncated[row])
        same([np.asarray(x).tobytes() for x in found], [np.asarray(x).tobytes() for x in wanted])


def test_noise_and_bias_are_within_their_bounds_and_change_nothing_else():
    """Numbers that do not saturate differ by their error from an environment without noise, in which the
    episode is the same."""
    noise, bias = 0.03, 0.02
    n, count = 64, 40
    noisy = make(LEG, n, noise={"gait": noise}, bias={"gait": bias, "hoof": 0.1})
    plain = make(LEG, n)
    names = list(plain.observation_names)
    gait = [names.index(name) for name in names if name.startswith("swing")]
    seen, clean = noisy.reset(seed=3)[0], plain.reset(seed=3)[0]
    errors = [(seen - clean)[:, gait]]
    for taken in actions(2, count, n):
        one, other = noisy.step(taken), plain.step(taken)
        same(one[1:4], other[1:4])
        inside = np.abs(other[0][:, gait]) < 0.9
        errors.append(np.where(inside, (one[0] - other[0])[:, gait], np.nan))
        for name in ("forward speed", "sin(crank angle)"):
            assert np.array_equal(one[0][:, names.index(name)], other[0][:, names.index(name)])
        contact = names.index("toe contact")
        assert (np.abs(one[0] - other[0])[:, contact] <= 0.1 + 1e-6).all()
    errors = np.array(errors)
    assert np.nanmax(np.abs(errors)) <= noise + bias + 1e-6
    mean = np.nanmean(errors, axis=0)
    # The mean over time is the bias, up to what noise of so many steps leaves.
    assert np.nanmax(np.abs(mean)) <= bias + 5 * noise / np.sqrt(3 * count)
    assert bias / 2 < np.nanmax(np.abs(mean))
    around = errors - mean
    assert abs(np.nanstd(around) - noise / np.sqrt(3)) < 0.1 * noise
    same(noisy.raw_observation(), plain.raw_observation())


def test_strength_is_a_factor_and_zero_disturbs_nothing():
    none = make(LEG, **{**ALL, "strength": 0.0})
    plain = make(LEG, episode_seconds=0.5)
    same(none.reset(seed=2)[0], plain.reset(seed=2)[0])
    same(none.step(actions(0, 1)[0])[:4], plain.step(actions(0, 1)[0])[:4])
    half = make(LEG, **ALL)
    option = make(LEG, **{**ALL, "strength": 1.0})
    same(half.reset(seed=2)[0], option.reset(seed=2, options={"strength": 0.7})[0])
    same([s[:4] for s in steps(half, 20)], [s[:4] for s in steps(option, 20)])


@pytest.mark.parametrize(
    ("env_id", "drive"), [(LEG, "prescribed"), (LEG, "motor"), (RAIL, "prescribed"), (HORSE, "prescribed")]
)
def test_a_push_adds_its_impulse_to_the_momentum_and_turns_motors_alone(env_id, drive):
    env = make(env_id, 9, drive=drive)
    env.reset(seed=1)
    steps(env, 5)
    before, place = env.engine.state, env.engine.report
    upward = 0.0 if env_id == RAIL else 7.0
    env.push(20.0, upward, envs=[2, 5])
    after = env.engine.state
    changed = {name for name in before if not np.array_equal(before[name], after[name])}
    pushed = np.isin(np.arange(9), [2, 5])
    expected = {"momentum_x"} | ({"momentum_y"} if upward else set())
    if drive == "motor":
        expected.add("crank_angle_rate")
    if env_id == HORSE:
        expected.add("angular_momentum")
        # About the centre of mass of all, which is not the trunk's.
        off = [place[axis] - before[f"centre_{axis}"] for axis in "xy"]
        moment = off[0] * upward - off[1] * 20.0
        np.testing.assert_allclose(
            (after["angular_momentum"] - before["angular_momentum"])[pushed], moment[pushed], rtol=1e-9
        )
    assert changed == expected
    for name, impulse in (("momentum_x", 20.0), ("momentum_y", upward)):
        np.testing.assert_allclose((after[name] - before[name]), impulse * pushed, atol=1e-9)


@pytest.mark.parametrize("drive", ["prescribed", "motor"])
def test_an_impulse_is_the_limit_of_a_short_force(drive):
    """Independent of `push`: the same change as by a constant force, here a change of weight, over a time
    that goes to 0. The difference goes with the time."""
    impulse = 15.0
    errors = []
    for seconds in (4e-4, 2e-4):
        state = []
        for how in ("push", "force"):
            env = make(LEG, trunk_drag=0.0, sim_dt=1e-4, dt=0.02, drive=drive)
            env.reset(seed=4, options={"gait": "run", "height": 2.5, "speed": 1.0})
            engine = env.engine
            rows = engine._memory.trunk_settings
            support = rows[3].copy()
            engine.advance(None, 5)
            if how == "push":
                env.push(0.0, impulse)
            else:
                rows[3] += impulse / seconds
            engine.advance(None, round(seconds / 1e-4))
            rows[3] = support
            engine.advance(None, 0)
            state.append([engine.report["vy"][0], engine.state["crank_angle_rate"][0, 0]])
        errors.append(np.abs(np.subtract(*state)))
    assert (errors[1] < 0.6 * errors[0] + 1e-9).all()
    assert (errors[1] < 5e-3 * impulse / env.engine.total_mass).all()


def test_given_pushes_come_at_their_times():
    given = [[0.2, 10.0, -4.0], [0.1, 5.0, 0.0]]
    env, plain, option = make(LEG, pushes=given), make(LEG), make(LEG)
    for one in (env, plain):
        one.reset(seed=3)
    option.reset(seed=3, options={"pushes": given})
    for k, action in enumerate(actions(0, 14), 1):
        results = [one.step(action) for one in (env, option)]
        same(results[0][:4], results[1][:4])
        plain.step(action)
        difference = {
            n: env.engine.state[n][0] - plain.engine.state[n][0] for n in ("momentum_x", "momentum_y")
        }
        if k < 5:
            assert difference == {"momentum_x": 0.0, "momentum_y": 0.0}
        if k == 5:
            assert difference["momentum_x"] == pytest.approx(5.0)
            assert env.batch.rows.named.push_at[0] == 10
    assert np.isinf(env.batch.rows.named.push_at[0])
    env.reset(seed=3)
    option.reset(seed=3)
    assert env.batch.rows.named.push_at[0] == 5
    assert np.isinf(option.batch.rows.named.push_at[0]), "the option was for one episode"


def test_strength_is_a_factor_of_pushes():
    env, plain = make(LEG, pushes=[[0.06, 5.0, -2.0]], strength=3.0), make(LEG)
    for one in (env, plain):
        one.reset(seed=3)
        steps(one, 3)
    moved = [env.engine.state[name][0] - plain.engine.state[name][0] for name in ("momentum_x", "momentum_y")]
    assert moved == pytest.approx([15.0, -6.0])


def test_a_push_that_no_step_shows_stays_so_where_neighbours_start():
    """Starts evaluate all environments side by side again, which are pushed already."""
    n = 19
    envs = make(LEG, n, pushes=[[0.04, 30.0, 0.0]])
    envs.reset(seed=0)
    seen, *_, info = steps(envs, 2)[-1]
    mask = np.isin(np.arange(n), [1, 12])
    observations, started = envs.reset(options={"reset_mask": mask})
    same(observations[~mask], seen[~mask])
    same(started["measured"]["vx"][~mask], info["measured"]["vx"][~mask])
    assert not np.array_equal(observations[mask], seen[mask])


def test_states_between_pushes_are_observed_as_they_were():
    env, other = make(LEG, **PUSHED), make(LEG, **PUSHED)
    env.reset(seed=1)
    for action in actions(2, 12):
        seen = env.step(action)[0]
        same(other.set_state(env.get_state()), seen)


def test_rows_under_other_settings_have_the_bits_of_one_environment():
    """While some rows are under older disturbances, each has its own, those that are drawn later, too."""
    n = 11
    new = {"push_impulse": (60.0, 90.0), "push_seconds": (0.1, 0.2), "noise": {"hoof": 0.1}, "strength": 1.5}
    envs = make(LEG, n, **NOISY, **PUSHED)
    envs.reset(seed=5)
    began = np.isin(np.arange(n), [1, 2, 9])
    taken = actions(3, 28, n)
    for each in taken[:3]:
        envs.step(each)
    envs.change_settings(**new)
    envs.reset(options={"reset_mask": began})
    found = [envs.step(each)[:2] for each in taken[3:]]
    for row in (0, 1, 8, 9):
        env = make(LEG, **NOISY, **PUSHED)
        env.reset(seed=5 + row)
        for action in taken[:3, row]:
            env.step(action)
        if began[row]:
            env.change_settings(**new)
            env.reset()
        for action, (observations, rewards) in zip(taken[3:, row], found, strict=True):
            observation, reward, terminated, *_ = env.step(action)
            assert not terminated
            same(observation, observations[row])
            assert reward == rewards[row]


def test_a_copy_keeps_its_own_pushes():
    given = {"pushes": [[0.1, 5.0, 0.0], [0.2, 10.0, -4.0]]}
    env, wanted = make(LEG), make(LEG)
    for one in (env, wanted):
        one.reset(seed=3, options=given)
    twin = copy.deepcopy(env)
    env.reset(seed=4)
    same([s[:4] for s in steps(twin, 14)], [s[:4] for s in steps(wanted, 14)])


def test_records_follow_pushes():
    """Substeps that are run again for a record end where the step ended."""
    env = make(HORSE, **PUSHED)
    env.reset(seed=0)
    env.record()
    steps(env, 12)
    for action in actions(3, 6, env_id=HORSE):
        env.push(30.0)
        info = env.step(action)[-1]
        record = env.record()
        assert record["vx"][-1, 0] == info["measured"]["vx"]
        assert record["crank_angle"][-1, 2, 0] == info["measured"]["left_hind_crank_angle"]


def test_states_after_a_push_beyond_what_can_be_simulated_are_taken_again():
    given = {"drive": "motor", "pushes": [[0.04, 1e5, -1e5]]}
    env, envs = make(LEG, strength=10.0, **given), make(LEG, 3, autoreset_mode="DISABLED", **given)
    env.reset(seed=0)
    envs.reset(seed=0, options={"strength": 10.0})
    *_, (observation, _, terminated, _, info) = steps(env, 3)
    assert terminated
    assert "stopped being finite" in str(info["end"])
    same(env.set_state(env.get_state()), observation)
    seen = steps(envs, 3)[-1][0]
    assert np.isfinite(seen).all()
    same(envs.set_state(envs.get_state()), seen)


def test_infos_are_of_the_end_of_a_step_and_not_of_the_push_after_it():
    """A push changes the speed of a motor's crank at once, which a record of the step does not have."""
    given = {"drive": "motor", "push_impulse": [20.0, 40.0], "push_seconds": 0.04, "episode_seconds": 0.14}
    env, envs = make(LEG, **given), make(LEG, 3, autoreset_mode="SAME_STEP", **given)
    env.reset(seed=0)
    env.record()
    envs.reset(seed=0)
    changed = 0
    for action in actions(3, 24):
        _, _, terminated, truncated, info = env.step(action)
        infos = envs.step(np.repeat(action[None], 3, 0))[-1]
        rate = info["measured"]["crank_angle_rate"]
        assert rate == env.record()["crank_angle_rate"][-1, 0, 0]
        changed += rate != env.engine.state["crank_angle_rate"][0, 0]
        if terminated or truncated:
            same(infos["final_info"]["measured"][0], info["measured"])
            info = env.reset()[1]
        for name in ("measured", "gait", "crank_angle", "speed", "height"):
            same(infos[name][0], info[name])
    assert changed > 6


@pytest.mark.parametrize("env_id", [LEG, HORSE])
def test_states_pickles_and_copies_continue_with_the_same_bits(env_id):
    given = {**NOISY, "episode_seconds": 2.0}
    env, other = make(env_id, **given), make(env_id, **given)
    env.reset(seed=1, options={"pushes": [[0.1, 9.0, 0.0], [0.3, -9.0, 3.0]]})
    seen = steps(env, 7)[-1][0]
    state = env.get_state()
    other.reset(seed=9)
    same(other.set_state(state), seen)
    env.push(4.0)
    state = env.get_state()
    same(other.set_state(state), seen)
    many = make(env_id, 3, **given)
    same(many.set_state(state)[1], seen)
    twins = [other, copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    rolled = [s[:4] for s in steps(env, 20)]
    for twin in twins:
        same([s[:4] for s in steps(twin, 20)], rolled)
    taken = actions(5, 20, env_id=env_id)
    for action, step in zip(taken, rolled, strict=True):
        same(many.step(np.repeat(action[None], 3, 0))[0][2], step[0])


def test_an_end_has_its_reason_and_says_whether_it_was_a_success():
    env = make(LEG, episode_seconds=0.1)
    env.reset(seed=0, options={"gait": "run", "speed": 2.6})
    info = steps(env, 5)[-1][-1]
    assert (info["end"], info["is_success"]) == ({"time limit": True}, True)
    env.reset(seed=0, options={"gait": "run", "speed": 0.5})
    info = steps(env, 5)[-1][-1]
    assert (info["end"], info["is_success"]) == ({"time limit": True}, False)
    assert info["episode_summary"]["success"] == 0.0
    falls = {"trunk_share": 1.0, "trunk_stiffness": 0.0, "trunk_damping": 0.0}
    envs = make(LEG, 2, **falls)
    envs.reset(seed=0)
    *_, terminated, _, infos = next(step for step in steps(envs, 200) if step[2].any())
    row = int(np.argmax(terminated))
    (reason,) = (name for name in infos["end"] if not name.startswith("_"))
    assert "height" in reason
    same(infos["end"][reason], infos["end"][f"_{reason}"])
    same(infos["end"][reason], terminated)
    assert not infos["is_success"][row]
    learners = Sb3VecEnv(num_envs=2, episode_seconds=0.1)
    learners.reset()
    for _ in range(5):
        *_, infos = learners.step(np.zeros((2, 4), np.float32))
    assert {type(info["is_success"]) for info in infos} == {bool}
    assert [info["end"] for info in infos] == [{"time limit": True}] * 2


def test_calls_and_options_that_cannot_be_are_refused_and_change_nothing():
    fixed, rail, leg = make(FIXED), make(RAIL), make(LEG, 3)
    for env in (fixed, rail, leg):
        env.reset(seed=0)
    with pytest.raises(ParameterError, match=r"push: expected none .*fixed trunk"):
        fixed.push(1.0)
    with pytest.raises(ParameterError, match=r"push: expected no impulse upward .*rail"):
        rail.push(1.0, 1.0)
    before = leg.get_state()
    for bad in ((np.nan,), ("far",), (np.zeros(2),), (1.0, np.inf), (1.0, 0.0, [7])):
        with pytest.raises(ParameterError):
            leg.push(*bad)
    for options in (
        {"strength": -1.0},
        {"pushes": [[99.0, 1.0, 1.0]]},
        {"pushes": "often"},
        {"pushes": np.array(3.0)},
    ):
        with pytest.raises(ParameterError):
            leg.reset(options=options)
    with pytest.raises(ParameterError, match="fixed trunk"):
        fixed.reset(options={"pushes": [[0.2, 1.0, 0.0]]})
    same(leg.get_state(), before)
    with pytest.raises(FixedSettingError, match="change_settings"):
        leg.strength = 0.5
    broken = copy.deepcopy(before)
    broken["observations"] = np.full((3, leg.single_observation_space.shape[0]), np.nan)
    with pytest.raises(ParameterError, match=r"state\['observations'\]"):
        leg.set_state(broken)
    for plan in ([1], [(5, 2e5, 0.0)], [(5, 0.0, np.nan)]):
        with pytest.raises(ParameterError, match=r"state\['pushes'\]: expected .*up to 100000 N s"):
            leg.set_state({**before, "pushes": [plan] * 3})
    same(leg.get_state(), before)


def test_a_push_is_rounded_to_control_steps_and_sorted():
    assert check_pushes("pushes", [[0.051, 1, 0], [0.0, 2, 3]], 0.02, 10) == ((1, 2.0, 3.0), (3, 1.0, 0.0))


def test_pushes_of_one_step_add_up():
    given = [[0.06, 5.0, 0.0], [0.061, 1.0, 3.0], [0.02, 2.0, 0.0]]
    assert check_pushes("pushes", given, 0.02, 10) == ((1, 2.0, 0.0), (3, 6.0, 3.0))
    assert check_pushes("pushes", np.array(given), 0.02, 10) == ((1, 2.0, 0.0), (3, 6.0, 3.0))


def test_an_option_without_pushes_leaves_drawn_ones_out():
    """Also over a state, and for that episode only."""
    settings = {"push_impulse": [20.0, 30.0], "push_seconds": [0.04, 0.06]}
    env, plain = make(LEG, **settings), make(LEG)
    for given in ([], None):
        # The draws of the pushes are left out, too: the generator goes on as without pushes.
        same(env.reset(seed=3, options={"pushes": given})[0], plain.reset(seed=3)[0])
        taken = actions(0, 20)
        for action in taken[:10]:
            same(env.step(action)[0], plain.step(action)[0])
        state = env.get_state()
        env.reset(seed=8)
        env.set_state(state)
        for action in taken[10:]:
            same(env.step(action)[0], plain.step(action)[0])
    same(env.reset(seed=3)[0], plain.reset(seed=3)[0])
    assert not np.array_equal(env.step(taken[0])[0], env.step(taken[0])[0])
    ends = [(env.step(action)[0], plain.step(action)[0]) for action in taken]
    assert any(not np.array_equal(pushed, unpushed) for pushed, unpushed in ends)


@pytest.mark.parametrize("strength", [0.5, 1.0, 2.0])
def test_strengths_are_in_units(strength):
    """Slopes and bumps of the ground, and pushes over the mass, are those that the constants say."""
    settings = rough_ground(strength, 100.0)
    terrain = make_terrain(settings["terrain"])
    smooth = make_terrain({**settings["terrain"], "roughness": 0.0})
    bumps = [a - b for a, b in zip(terrain.height, smooth.height, strict=True)]
    assert 0.9 * ROUGHNESS * strength < max(map(abs, bumps)) <= ROUGHNESS * strength + 1e-12
    steps = [abs(b - a) / smooth.spacing for a, b in zip(smooth.height, smooth.height[1:], strict=False)]
    # The last piece of a hill is rounded to whole knots.
    assert 0.9 * ROUGH_SLOPE * strength < sorted(steps)[-20] <= 1.2 * ROUGH_SLOPE * strength
    low, high = settings["push_impulse"]
    assert settings["strength"] * high / 100.0 == pytest.approx(ROUGH_PUSH * strength)
    assert low == -high
