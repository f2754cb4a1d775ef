"""The force of the suspension obeys Newton's law, and the committed figures are today's."""

import json

import numpy as np
import pytest

from agents import leg_forces, runs
from hoof_env.errors import ParameterError
from hoof_env.evaluation.episodes import FINAL_SEEDS
from hoof_env.policies.find import find_policy

OTHER = {"trunk_share": 0.5, "trunk_stiffness": 8000.0, "trunk_damping": 600.0, "trunk_mass": 40.0}


def play(policy, **env_kwargs):
    """The environment, the record of a short episode, and the force of the suspension in it."""
    env = runs.make_env(leg_forces.ENV_ID, episode_seconds=3.0, **env_kwargs)
    record, _ = leg_forces.episode_of(env, find_policy(policy, env, leg_forces.ENV_ID), seed=0)
    return env.unwrapped, record, leg_forces.suspension(env, record["y"], record["vy"])[0]


@pytest.mark.parametrize(("policy", "env_kwargs"), [("run", {}), ("shipped", {}), ("run", OTHER)])
def test_suspension_and_ground_carry_and_accelerate_all_bodies(policy, env_kwargs):
    leg, record, force = play(policy, **env_kwargs)
    total = force + record["toe_normal"] + record["heel_normal"] - leg.weight
    # Mean of both ends of a substep, as the midpoint rule takes it
    mean = (total[1:] + total[:-1]) / 2
    off = np.diff(record["momentum_y"]) / leg.sim_dt - mean
    assert np.sqrt(np.mean(off**2)) < 0.01 * np.sqrt(np.mean(mean**2))


def test_a_trunk_without_a_constant_suspension_is_refused():
    for env_id, env_kwargs in (
        ("hoof_env/HorseLegRail-v0", {}),
        (leg_forces.ENV_ID, {"randomize": {"trunk_share": [0.5, 0.9]}}),
    ):
        with runs.make_env(env_id, **env_kwargs) as env, pytest.raises(ParameterError, match="suspended"):
            leg_forces.suspension(env, np.zeros(1), np.zeros(1))


def test_an_episode_that_ends_before_figures_count_has_only_its_return():
    with runs.make_env(leg_forces.ENV_ID, episode_seconds=1.0) as env:
        policy = find_policy("run", env, leg_forces.ENV_ID)
        assert set(leg_forces.figures_of(env, policy, 0)) == {"return", "failed"}


def test_a_spring_alone_pushes_by_its_length():
    with runs.make_env(leg_forces.ENV_ID, trunk_share=1.0, trunk_damping=0.0) as env:
        height = env.unwrapped.body.height
        force, damper = leg_forces.suspension(env, np.array([height - 0.1]), np.array([-1.0]))
    assert force == pytest.approx(0.1 * 12000)
    assert damper == 0.0


def test_the_committed_figures_are_measured_again(tmp_path, capsys):
    """Of few episodes: within four standard errors of the committed means."""
    committed = json.loads(leg_forces.OUT.read_text(encoding="utf-8"))
    assert committed["seeds"] == [FINAL_SEEDS.start, FINAL_SEEDS.stop]
    episodes = 4
    leg_forces.main(["shipped", "--episodes", str(episodes), "--out", str(tmp_path / "new.json")])
    new = json.loads((tmp_path / "new.json").read_text(encoding="utf-8"))
    assert new["settings"] == pytest.approx(committed["settings"])
    for name, old in committed["policies"]["shipped"].items():
        spread = (old.get("high", old["mean"]) - old.get("low", old["mean"])) / 2 / 1.96 * 10
        error = 4 * spread / episodes**0.5 + 0.01 * abs(old["mean"])
        assert abs(new["policies"]["shipped"][name]["mean"] - old["mean"]) <= error, name
