"""Costs beside the reward: what they sum to, in every form of infos, and through states and copies."""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from family import same

import hoof_env
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
        ({"force": 1.0}, "cost: expected .*peak, excess, indicator, loading, got .*force"),
        ({"peak": -1.0}, r"cost\['peak'\]: expected .*got -1"),
        ({"peak": "high"}, r"cost\['peak'\]: expected .*got 'high'"),
        (1500.0, "cost: expected a mapping .*got 1500"),
    ],
)
def test_refused_costs(cost, message):
    with pytest.raises(ParameterError, match=message):
        gym.make(LEG, cost=cost)
    assert len(COSTS) == 4


def test_a_state_with_other_costs_is_refused():
    env = gym.make(LEG, cost=LIMITS).unwrapped
    env.reset(seed=0)
    state = env.get_state()
    for bad in (np.full((4, 1), -1.0), np.zeros((3, 1)), "none"):
        with pytest.raises(ParameterError, match=r"state.'cost_sums'.: expected numbers from 0"):
            env.set_state({**state, "cost_sums": bad})
    with pytest.raises(ParameterError, match=r"cost: .*peak"):
        gym.make(LEG).unwrapped.set_state(state)
