"""What `Horse-v0` pays and shows, from what it measures; that living pays; and the step of a fall."""

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE
from horses import die

from hoof_env.tasks.horse_gaits import LEGS
from hoof_env.tasks.horse_terms import HORSE_TERMS

DT, MANY, SPEEDS = 0.02, 32, (1.853, 2.620, 3.706)
WEIGHTS = {term.name: term.weight for term in HORSE_TERMS}


def make(**settings):
    return gym.make_vec(HORSE, num_envs=MANY, autoreset_mode="Disabled", **settings)


def noise(size, seed=0):
    rng = np.random.default_rng(seed)
    return lambda: np.clip(size * rng.normal(size=(MANY, 16)), -1, 1).astype(np.float32)


def slow():
    """All cranks as slow as actions make them."""
    action = np.zeros((MANY, 4, 4), np.float32)
    action[..., 0] = -1
    return action.reshape(MANY, 16)


def test_terms_are_what_the_measurements_say():
    envs = make(target_speed=1.0)
    _, infos = envs.reset(seed=0)
    take, before, weight = noise(0.3), infos["measured"]["x"], envs.unwrapped.weight
    slide = np.tile(die(None, 0.0), (MANY, 1)).astype(np.float32)
    asked, farthest = DT * 1.0, 0.0
    for _ in range(60):
        _, rewards, failed, _, infos = envs.step(slide + take())
        m, paid = infos["measured"], {name: infos[f"reward_{name}"] / WEIGHTS[name] for name in WEIGHTS}
        total = {
            name: sum(m[f"{leg}_{name}"] for leg in LEGS)
            for name in ("slip", "stances", "positive_work", "running_peak_increase")
        }
        expected = {
            "alive": np.full(MANY, DT),
            "tracking": DT * np.maximum(1 - 2 * np.abs(m["x"] - before - asked) / asked, -1),
            "slip": -DT * np.minimum(total["slip"] / asked, 1),
            "peak": -total["running_peak_increase"] / weight,
            "landing": -total["stances"],
            "work": -DT * total["positive_work"] / (weight * asked),
            "pitch": -DT * m["pitch"] ** 2,
        }
        for name, value in expected.items():
            np.testing.assert_allclose(paid[name], value, rtol=1e-9, atol=1e-12, err_msg=name)
        np.testing.assert_allclose(rewards, sum(infos[f"reward_{name}"] for name in WEIGHTS), rtol=1e-12)
        before, farthest = m["x"], max(farthest, (total["slip"] / asked).max())
        if failed.any():
            break
    assert farthest > 1  # so that the bound of the term is met


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("size", [0.03, 0.1, 0.37, "slow"])
def test_to_live_on_pays_in_early_play(speed, size):
    """While a horse has not fallen a second of noise about the reference gait, or of slow cranks, is paid."""
    envs, take = make(target_speed=speed), slow if size == "slow" else noise(size)
    envs.reset(seed=0)
    total = seconds = 0.0
    for _ in range(100):
        _, rewards, failed, _, _ = envs.step(take())
        total, seconds = total + rewards[~failed].sum(), seconds + DT * (~failed).sum()
        if failed.any():
            envs.reset(options={"reset_mask": failed})
    assert total / seconds > 0


def test_the_gait_is_observed_wherever_it_is():
    envs = make()
    envs.reset(seed=0)
    names, seen = envs.unwrapped.observation_names, []
    for _ in range(50):
        observation, *_ = envs.step(np.zeros((MANY, 16), np.float32))
        seen.append(observation)
    at_the_end = np.mean(np.abs(seen) >= 1, (0, 1))
    shown = {name: share for name, share in zip(names, at_the_end, strict=True) if "swing" in name}
    assert len(shown) == 4 * 6
    assert max(shown.values()) == 0


def test_the_height_counts_from_the_ground():
    envs = make(terrain={"kind": "slope", "angle": 0.1})
    envs.reset(seed=0, options={"x": 50.0})
    assert np.all(np.abs(envs.unwrapped.raw_observation()["height above the ground"] - 1.4) < 0.5)


def test_the_step_of_a_fall_happened():
    """It is paid, summed up and recorded; only the step of a simulation that broke is not."""
    env = gym.make(HORSE, target_speed=SPEEDS[0]).unwrapped
    _, begun = env.reset(seed=0, options={"pitch": 0.4})
    env.record()  # from now on substeps are kept
    failed, steps = False, 0
    take = noise(1.0, 3)
    x = begun["measured"]["x"]
    while not failed:
        _, _, failed, _, info = env.step(take()[0])
        m, steps = info["measured"], steps + 1
        moved, x = m["x"] - x, m["x"]
    assert m["result"] >= 5
    assert info["reward_alive"] > 0
    assert sum(m[f"{leg}_positive_work"] for leg in LEGS) > 0
    assert info["episode_summary"]["seconds"] == pytest.approx(steps * DT)
    assert info["episode_summary"]["distance_m"] == pytest.approx(x - begun["measured"]["x"])
    record = env.record()
    assert len(record["x"]) == 20
    np.testing.assert_allclose(record["x"][-1], x, atol=1e-12)
    assert abs(moved) > 1e-4
