"""Who carries the suspended trunk: steady scripted gaits, and the gait that was found to do it alone."""

import json

import numpy as np
import pytest
from family import substeps

from hoof_env.envs.horse_leg import HorseLegEnv
from hoof_env.envs.policies import make_policy, policy_names
from hoof_env.gait import gait_names, load_gait
from hoof_env.leg.presets import preset_names, read_preset

FOUND = "carrying_walk"
SETTLE, WINDOW = 10.0, 10.0
"""Seconds left out, and seconds that hold the whole strides that are measured."""


FOUND_ON = {
    "trunk_mass": 80.0, "trunk_stiffness": 4000.0, "trunk_damping": 1130.0, "stiffness": 2e4, "exponent": 1.5,
}  # fmt: skip
"""What was the default when the search for it ran: a heavier trunk, held more softly, on another ground."""


def steady(gait, **settings):
    """The environment, and its substeps by name over the last whole strides of an episode."""
    env = HorseLegEnv(episode_seconds=SETTLE + WINDOW, **settings)
    env.reset(seed=5, options={"gait": "walk", "crank_angle": 0.0, "speed": 0.0})
    trace = substeps(env, gait)
    assert env.episode_summary()["failed"] == 0.0
    stride = 2 * np.pi / load_gait(gait, env.settings.preset).crank_speed
    last = round(int(WINDOW / stride) * stride / env.sim_dt)
    return env, {name: values[-last:] for name, values in trace.items()}


@pytest.mark.parametrize("gait", ["walk", "run", FOUND])
@pytest.mark.parametrize("settings", [{}, FOUND_ON], ids=["default", "found on"])
def test_impulse_balance_of_a_steady_gait(gait, settings):
    """Momentum is the same after whole strides, so the ground gives what weight, support and spring leave."""
    env, record = steady(gait, **settings)
    trunk, settings = env.engine.trunk, env.settings
    sinkage = trunk.height - record["y"].mean()
    load = settings.trunk_share * env.weight - settings.trunk_stiffness * sinkage
    assert record["normal"].mean() == pytest.approx(load, rel=0.005)


@pytest.mark.parametrize("preset", [name for name in preset_names() if FOUND in gait_names(name)])
def test_a_carrying_walk_that_ships_carries(preset):
    """Beside the walk of the paper, which sinks and slides backward."""
    shares, speeds = [], []
    for gait in ("walk", FOUND):
        env, record = steady(gait, preset=preset, **FOUND_ON)
        shares.append(record["normal"].mean() / (env.settings.trunk_share * env.weight))
        speeds.append(record["vx"].mean())
    assert shares[0] < 0.6
    assert speeds[0] < 0
    assert 0.95 <= shares[1] <= 1.05
    assert 1.2 <= speeds[1] <= 1.8
    assert read_preset(preset)["gait_provenance"][FOUND].startswith("Found, not published")


def test_a_gait_more_leaves_the_starts_and_the_other_policies_as_they_were(tmp_path):
    preset = read_preset("identified")
    gait = preset["gaits"].pop(FOUND)
    one = HorseLegEnv(preset=preset)
    path = tmp_path / "more.json"
    path.write_text(json.dumps({**preset, "gaits": {**preset["gaits"], FOUND: gait}}))
    more = HorseLegEnv(preset=str(path))
    assert policy_names(more) == [FOUND, *policy_names(one)]
    for seed in range(3):
        (seen, info), (seen_more, info_more) = one.reset(seed=seed), more.reset(seed=seed)
        assert info == info_more
        assert np.array_equal(seen, seen_more)
        for name in ("idle", "walk", "drag"):
            actions = [make_policy(name, env).predict(seen)[0].tolist() for env in (one, more)]
            assert actions[0] == actions[1]
