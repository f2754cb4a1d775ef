"""Costs beside the reward: what they sum to, in every form of infos, and through states and copies."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from family import actions, same

import hoof_env
from hoof_env.dynamics.layout import TRUNK_STATE
from hoof_env.episodes.costs import COSTS
from hoof_env.errors import ParameterError

LEG, HORSE = "hoof_env/HorseLeg-v0", "hoof_env/Horse-v0"
LIMITS = {"peak": 900.0, "excess": 900.0, "indicator": 900.0, "loading": 2e4}
KEYS = {"cost", *(f"cost_{name}" for name in LIMITS)}


def played(env, steps=150, seed=0):
    """Infos of random actions."""
    generator = np.random.default_rng(seed)
    env.reset(seed=seed)
    infos = []
    for _ in range(steps):
        *_, terminated, truncated, info = env.step(
            generator.uniform(-1, 1, env.action_space.shape).astype(np.float32)
        )
        infos.append(info)
        if terminated or truncated:
            break
    return infos


@pytest.mark.parametrize("env_id", [LEG, HORSE, "hoof_env/HorseLegMO-v0"])
def test_costs_are_what_the_forces_of_all_substeps_say(env_id):
    """From the record of every substep, which kernels do not add up."""
    env = gym.make(env_id, cost=LIMITS)
    env.unwrapped.reset(seed=0)
    env.unwrapped.record()
    highest, total = 0.0, dict.fromkeys(LIMITS, 0.0)
    generator = np.random.default_rng(0)
    env.reset(seed=0)
    for _ in range(100):
        action = generator.uniform(-1, 1, env.action_space.shape).astype(np.float32)
        *_, terminated, truncated, info = env.step(action)
        record = env.unwrapped.record()
        if len(record["time"]) > 1:
            normal = record["toe_normal"] + record["heel_normal"]
            force = np.hypot(normal, record["toe_friction"] + record["heel_friction"])[..., 0]
            over = max(force.max() - 900.0, 0.0)
            assert info["cost_excess"] == pytest.approx(over, rel=0.02, abs=20.0)
            highest = max(highest, over)
        assert info["cost_indicator"] == (info["cost_excess"] > 0.0)
        assert info["cost"] == pytest.approx(sum(info[f"cost_{name}"] for name in LIMITS), rel=1e-12)
        for name in LIMITS:
            total[name] += info[f"cost_{name}"]
        if terminated or truncated:
            break
    summary = env.unwrapped.episode_summary()
    assert summary["cost_peak"] == max(summary["highest_grf_n"] - 900.0, 0.0) > 0.0
    for name in LIMITS:
        assert summary[f"cost_{name}"] == pytest.approx(total[name], rel=1e-9)
    assert summary["cost_peak"] == pytest.approx(highest, rel=0.02)


def test_loading_is_the_excess_of_each_stance():
    env = gym.make(LEG, cost={"loading": 0.0})
    rates = [0.0]
    for info in played(env, 400):
        if info["measured"]["stances"]:
            rates.append(0.0)
        rates[-1] += info["measured"]["loading_rate_increase"]
    assert len(rates) > 4
    assert env.unwrapped.episode_summary()["cost_loading"] == pytest.approx(sum(rates), rel=1e-9)
    limit = max(rates) / 2
    limited = gym.make(LEG, cost={"loading": limit})
    played(limited, 400)
    expected = sum(max(rate - limit, 0.0) for rate in rates)
    assert limited.unwrapped.episode_summary()["cost_loading"] == pytest.approx(expected, rel=1e-9)


def test_they_change_neither_reward_nor_motion():
    plain, limited = gym.make(LEG), gym.make(LEG, cost=LIMITS)
    for env in (plain, limited):
        env.reset(seed=3)
    action = np.full(4, 0.4, np.float32)
    for _ in range(60):
        one, other = plain.step(action), limited.step(action)
        for a, b in zip(one[:4], other[:4], strict=True):
            same(a, b)
        assert other[4].keys() - one[4].keys() == KEYS
        assert not KEYS & one[4].keys()


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP"])
@pytest.mark.parametrize("env_id", [LEG, HORSE])
def test_each_row_has_the_costs_of_its_environment(env_id, mode):
    arguments = {"cost": LIMITS, "episode_seconds": 0.4}
    envs = gym.make_vec(env_id, num_envs=3, autoreset_mode=mode, **arguments)
    _, infos = envs.reset(seed=5)
    assert all((infos[key] == 0.0).all() for key in KEYS)
    alone = [gym.make(env_id, **arguments) for _ in range(3)]
    for seed, env in enumerate(alone, 5):
        env.reset(seed=seed)
    over = [False] * 3
    actions = np.random.default_rng(0).uniform(-1, 1, (50, *envs.action_space.shape)).astype(np.float32)
    costs = 0.0
    for each in actions:
        *_, infos = envs.step(each)
        final = infos.get("final_info", {})
        for row, env in enumerate(alone):
            if over[row] and mode == "NEXT_STEP":
                env.reset()
                over[row] = False
                assert infos["cost"][row] == 0.0
                continue
            *_, terminated, truncated, info = env.step(each[row])
            over[row] = terminated or truncated
            there = final if over[row] and mode == "SAME_STEP" else infos
            for key in KEYS:
                assert there[key][row] == info[key]
            if over[row]:
                assert there["episode_summary"]["cost_peak"][row] == info["episode_summary"]["cost_peak"]
                if mode == "SAME_STEP":
                    env.reset()
            costs += info["cost"]
    assert costs > 0.0


def test_they_are_in_the_infos_of_stable_baselines():
    envs = hoof_env.Sb3VecEnv(LEG, num_envs=2, cost=LIMITS)
    envs.seed(1)
    envs.reset()
    single = gym.make(LEG, cost=LIMITS)
    single.reset(seed=1)
    action = np.full(4, 0.5, np.float32)
    for _ in range(40):
        infos = envs.step(np.tile(action, (2, 1)))[3]
        info = single.step(action)[4]
        assert {key: infos[0][key] for key in KEYS} == {key: info[key] for key in KEYS}
    assert info["cost_excess"] >= 0.0


def cost_sums(env):
    summary = env.episode_summary()
    return {name: summary[f"cost_{name}"] for name in LIMITS}


@pytest.mark.parametrize("through", ["state", "pickle", "deepcopy"])
def test_copies_go_on_with_their_costs(through):
    env = gym.make(LEG, cost=LIMITS).unwrapped
    played(env, 40)
    if through == "state":
        twin = gym.make(LEG, cost=LIMITS).unwrapped
        twin.set_state(env.get_state())
    else:
        twin = copy.deepcopy(env) if through == "deepcopy" else pickle.loads(pickle.dumps(env))
    assert cost_sums(twin) == cost_sums(env)
    action = np.full(4, -0.6, np.float32)
    for _ in range(40):
        one, other = (each.step(action)[4] for each in (env, twin))
        assert {key: one[key] for key in KEYS} == {key: other[key] for key in KEYS}
    many = gym.make_vec(LEG, num_envs=3, cost=LIMITS).unwrapped
    many.set_state(env.get_state())
    assert (many.episode_summary()["cost_peak"] == cost_sums(env)["peak"]).all()


def test_a_step_with_six_values():
    env = hoof_env.SeparateCost(gym.make(LEG, cost={"excess": 500.0}))
    env.reset(seed=0)
    found = [env.step(env.action_space.sample()) for _ in range(50)]
    assert all(len(step) == 6 for step in found)
    assert all(step[2] == step[5]["cost"] for step in found)
    assert sum(step[2] for step in found) > 0.0
    with pytest.raises(ParameterError, match=r"limits, as .*cost=.*got HorseLegEnv without cost"):
        hoof_env.SeparateCost(gym.make(LEG))


@pytest.mark.parametrize(
    ("cost", "message"),
    [
        ({"force": 1.0}, "cost: expected .*peak, excess, indicator, loading, leaning, got .*force"),
        ({"leaning": 1.2}, r"cost\['leaning'\]: expected .*\[0, 1\], got 1.2"),
        ({"peak": -1.0}, r"cost\['peak'\]: expected .*got -1"),
        ({"peak": "high"}, r"cost\['peak'\]: expected .*got 'high'"),
        (1500.0, "cost: expected a mapping .*got 1500"),
    ],
)
def test_refused_costs(cost, message):
    with pytest.raises(ParameterError, match=message):
        gym.make(LEG, cost=cost)
    assert set(COSTS) == {*LIMITS, "leaning"}


@pytest.mark.parametrize(("env_id", "trunk"), [("hoof_env/HorseLegFixed-v0", "fixed"), (HORSE, "free")])
def test_leaning_is_refused_where_nothing_can_be_leant_on(env_id, trunk):
    with pytest.raises(
        ParameterError, match=rf"cost\['leaning'\]: expected .*suspended or rail, got a {trunk}"
    ):
        gym.make(env_id, cost={"leaning": 0.5})


def test_leaning_counts_what_is_owed_beyond_a_second():
    """Before the first step beyond it, what a queue of such arrivals and departures holds (Lindley); over the
    episode, steps beyond it make up for what is missing in the sums of the whole episode."""
    share, env = 0.9, gym.make(LEG, cost={"leaning": 0.9})
    infos = played(env, 500, seed=3)
    weight, dt = env.unwrapped.weight, env.unwrapped.dt
    net = np.cumsum([share * dt - info["measured"]["normal_impulse"] / weight for info in infos])
    owed = net - np.minimum(np.minimum.accumulate(net), 0.0)
    found = np.array([info["cost_leaning"] for info in infos])
    first = np.flatnonzero(found)[0]
    assert first == np.flatnonzero(owed > share)[0]
    forgiven = net[-1] - share  # at least: what was owed at the end may be less than a second
    assert found.sum() * share * dt >= forgiven > 0.0
    assert 0 < found.sum() == env.unwrapped.episode_summary()["cost_leaning"] < 500


def test_a_gait_that_leans_on_the_suspension_breaks_that_limit_alone():
    """The paper's walk hangs on the suspension of the leg, the run carries itself."""
    found = {}
    for name in ("walk", "run"):
        env = gym.make("hoof_env/HorseLegSafe-v0")
        policy = hoof_env.make_policy(name, env)
        observation, _ = env.reset(seed=0, options=policy.start)
        over = False
        while not over:
            observation, _, _, over, info = env.step(policy.predict(observation)[0])
        found[name] = info["episode_summary"]
    assert found["walk"]["weight_share"] < 0.3 < 0.7 < found["run"]["weight_share"]
    assert found["walk"]["cost_indicator"] == 0.0 < 250.0 < found["walk"]["cost_leaning"]
    assert found["run"]["cost_leaning"] == 0.0 < 50.0 < found["run"]["cost_indicator"]


def test_leaning_by_its_definition_in_two_episodes():
    """A debt grows by the share that must be borne, is repaid by what is borne, and is never above a second
    of the share; an episode owes nothing at its start."""
    share = 0.9
    env = gym.make(LEG, cost={"leaning": share}, episode_seconds=4.0).unwrapped
    found, expected = [], []
    for _ in range(2):
        for info in played(env, 200, seed=3):
            if not len(found) % 200:
                debt = 0.0
            debt = max(debt + share * env.dt - info["measured"]["normal_impulse"] / env.weight, 0.0)
            expected.append(float(debt > share))
            debt = min(debt, share)
            found.append(info["cost_leaning"])
    assert found == expected
    assert 0.0 < sum(found) < len(found)
    assert debt > 0.0, "the first episode leaves something to forget"


def test_costs_of_an_episode_do_not_depend_on_the_episode_before():
    """Also after one that ends in the middle of a stance."""
    limits = {**LIMITS, "leaning": 0.9}
    start = {"height": 1.1, "speed": 1.0}  # with the hoof on the ground
    for steps in (15, 40, 65):
        env, fresh = gym.make(LEG, cost=limits), gym.make(LEG, cost=limits)
        played(env, steps, seed=3)
        for each in (env, fresh):
            each.reset(seed=7, options=start)
        for taken in actions(5, 60):
            one, other = env.step(taken)[4], fresh.step(taken)[4]
            assert {key: one[key] for key in one if "cost" in key} == {
                key: other[key] for key in other if "cost" in key
            }


def test_a_step_of_a_failed_simulation_costs_nothing():
    """It is taken back, so that its forces are of no motion."""
    limits = {"peak": 0.0, "excess": 0.0, "indicator": 0.0, "loading": 0.0, "leaning": 1.0}
    env = gym.make(LEG, cost=limits).unwrapped
    played(env, 60)
    sums = ("cost_sums", "debts", "stance_rises")
    before = {name: getattr(env.batch.rows, name).copy() for name in sums}
    state = env.get_state()
    state["engine"]["trunk"][TRUNK_STATE.index("momentum_x")] = 1e308
    env.set_state(state)
    _, _, terminated, _, info = env.step(np.zeros(4, np.float32))
    assert terminated
    assert [info["cost"], *(info[f"cost_{name}"] for name in limits)] == [0.0] * 6
    for name in limits:
        total = env.batch.rows.cost_sums[[*limits].index(name), 0]
        assert info["episode_summary"][f"cost_{name}"] == total
    for name in sums:
        same(getattr(env.batch.rows, name), before[name])


def hoof_speed(step, weight):
    """Return how fast the hoof slides while it is loaded, a cost."""
    return weight * abs(step.leg.report.toe.slide) * np.where(step.leg.strides.normal_force > 100.0, 1.0, 0.0)


SLIDING = hoof_env.Term("sliding", 2.0, "s/m", "speed of a loaded toe", hoof_speed, is_cost=True)


@pytest.fixture(scope="module")
def own_id():
    hoof_env.register("tests/Sliding-v0", terms=[SLIDING])
    return "tests/Sliding-v0"


def test_a_cost_of_ones_own_leaves_the_reward_alone(own_id):
    env, base, limited = gym.make(own_id), gym.make(LEG), gym.make(own_id, cost={"indicator": 700.0})
    for each in (env, base, limited):
        each.reset(seed=2)
    total = both = 0.0
    for taken in np.random.default_rng(0).uniform(-1, 1, (300, 4)).astype(np.float32):
        one, other, third = (each.step(taken) for each in (env, base, limited))
        assert one[1] == other[1] == third[1]
        info = one[4]
        measured = info["measured"]
        expected = 2.0 * abs(measured["toe_slide"]) * (measured["normal_force"] > 100.0)
        assert info["cost"] == info["cost_sliding"] == pytest.approx(expected, rel=1e-12)
        assert info["unweighted"]["sliding"] == pytest.approx(expected / 2.0, rel=1e-12)
        assert third[4]["cost"] == third[4]["cost_indicator"] + info["cost"]
        assert not {"reward_sliding", "cost_indicator"} & set(info)
        total, both = total + info["cost"], both + third[4]["cost"]
    assert 0.0 < total < both
    assert env.unwrapped.episode_summary()["cost_sliding"] == pytest.approx(total, rel=1e-9)
    assert env.unwrapped.costs == ("cost_sliding",)
    assert "cost_sliding" not in env.unwrapped.terms
    assert "sliding" not in env.unwrapped.weights
    assert len(hoof_env.SeparateCost(env).step(taken)) == 6


def test_a_cost_of_ones_own_in_every_form(own_id):
    settings = {"episode_seconds": 0.3, "cost": {"peak": 500.0}}
    many = gym.make_vec(own_id, num_envs=2, autoreset_mode="SAME_STEP", **settings)
    sb3, alone = hoof_env.Sb3VecEnv(own_id, num_envs=2, **settings), gym.make(own_id, **settings)
    many.reset(seed=1), sb3.seed(1), sb3.reset(), alone.reset(seed=1)
    twin = gym.make(own_id, **settings).unwrapped
    total = 0.0
    for k, taken in enumerate(np.random.default_rng(3).uniform(-1, 1, (45, 2, 4)).astype(np.float32)):
        *_, over, info = alone.step(taken[0])
        infos, (row, _) = many.step(taken)[4], sb3.step(taken)[3]
        there = infos["final_info"] if over else infos
        for key in ("cost", "cost_peak", "cost_sliding"):
            assert info[key] == there[key][0] == row[key]
        total += info["cost_sliding"]
        if k > 20:
            assert twin.step(taken[0])[4]["cost_sliding"] == info["cost_sliding"]
        if over:
            assert info["episode_summary"]["cost_sliding"] == row["episode_summary"]["cost_sliding"]
            alone.reset()
            twin.set_state(alone.unwrapped.get_state())
        elif k == 20:
            twin.set_state(alone.unwrapped.get_state())
    assert total > 0.0


def test_refusals_of_ones_own_costs(own_id):
    with pytest.raises(ParameterError, match=r"reward_weights: expected .*loading, got .*sliding"):
        gym.make(own_id, reward_weights={"sliding": 0.0})
    with pytest.raises(ParameterError, match="'sliding': objective: expected none of a cost, got 'energy'"):
        hoof_env.Term("sliding", 1.0, "-", "", hoof_speed, objective="energy", is_cost=True)
    with pytest.raises(ParameterError, match="'sliding': is_cost: expected True or False, got 'yes'"):
        hoof_env.Term("sliding", 1.0, "-", "", hoof_speed, is_cost="yes")
    peak = hoof_env.Term("peak", 1.0, "-", "", hoof_speed, is_cost=True)
    hoof_env.register("tests/Peak-v0", terms=[peak])
    with pytest.raises(ParameterError, match=r"cost: expected none of .*own costs, got peak"):
        gym.make("tests/Peak-v0", cost={"peak": 1.0})


def test_a_state_with_other_costs_is_refused():
    env = gym.make(LEG, cost=LIMITS).unwrapped
    env.reset(seed=0)
    state = env.get_state()
    for bad in (np.full((4, 1), -1.0), np.zeros((3, 1)), "none"):
        with pytest.raises(ParameterError, match=r"state.'cost_sums'.: expected numbers from 0"):
            env.set_state({**state, "cost_sums": bad})
    with pytest.raises(ParameterError, match=r"cost: .*peak"):
        gym.make(LEG).unwrapped.set_state(state)


def test_a_force_at_its_limit_is_no_violation():
    env = gym.make(LEG, cost={"excess": 0.0})
    forces = [info["cost_excess"] for info in played(env, 60)]
    k = int(np.argmax(forces))
    again = gym.make(LEG, cost={"indicator": forces[k]})
    assert forces[k] > 0.0
    assert played(again, 60)[k]["cost_indicator"] == 0.0
    below = gym.make(LEG, cost={"indicator": np.nextafter(forces[k], 0.0)})
    assert played(below, 60)[k]["cost_indicator"] == 1.0


def test_summaries_have_the_sum_of_all_costs():
    env = gym.make(LEG, cost=LIMITS, episode_seconds=1.0)
    infos = played(env)
    summary = env.unwrapped.episode_summary()
    assert summary["cost"] == pytest.approx(sum(info["cost"] for info in infos), rel=1e-12)
