"""Forces as a sensor reads them: a threshold below which they are 0, and the centre of pressure."""

import gymnasium as gym
import numpy as np
import pytest
from family import HORSE, IDS, LEGS, actions, same

from hoof_env.episodes.scene import Slots
from hoof_env.errors import ParameterError
from hoof_env.tasks.horse_gaits import LEGS as OF_HORSE
from hoof_env.tasks.horse_terms import HORSE_ENTRIES
from hoof_env.tasks.observation import ENTRIES, PLAIN, Entry, tanh_of
from hoof_env.tasks.registry import TASKS

LEG = "hoof_env/HorseLeg-v0"
GROUPS = {
    task.id: [*dict.fromkeys((*task.settings({}).observation, "hoof")), "pressure"] for task in TASKS.values()
}
CUT = 100.0
NUMBERS = ("contact", "load")


def prefixes(env_id):
    """Prefixes of the names of each leg: in measurements, in observations."""
    pairs = [(f"{leg}_", f"{leg.replace('_', ' ')}: ") for leg in OF_HORSE]
    return [("", "")] if env_id in LEGS else pairs


def rolled(env_id, count=150, **settings):
    """Measurements and raw observations of random actions."""
    env = gym.make(env_id, **settings)
    env.reset(seed=1)
    for action in actions(2, count, env_id=env_id):
        *_, terminated, truncated, info = env.step(action)
        yield info["measured"], env.unwrapped.raw_observation()
        if terminated or truncated:
            env.reset()


@pytest.mark.parametrize("env_id", IDS)
def test_loads_below_the_threshold_and_their_contacts_are_not_read(env_id):
    groups = GROUPS[env_id]
    below = above = 0
    for (measured, plain), (_, cut) in zip(
        rolled(env_id, observation=groups),
        rolled(env_id, observation=groups, force_threshold=CUT),
        strict=True,
    ):
        for ours, theirs in prefixes(env_id):
            loads = [measured[f"{ours}{point}_normal"] for point in ("toe", "heel")]
            for point, load in zip(("toe", "heel"), loads, strict=True):
                for number in NUMBERS:
                    expected = plain[f"{theirs}{point} {number}"] if load >= CUT else 0.0
                    assert cut[f"{theirs}{point} {number}"] == expected
                below += 0 < load < CUT
                above += load >= CUT
            if "load" in groups:
                read = sum(load for load in loads if load >= CUT)
                assert cut[f"{theirs}load"] == pytest.approx(read, abs=1e-9)
            total = sum(loads)
            centre = (loads[0] - loads[1]) / total if total > 0 else 0.0
            assert plain[f"{theirs}centre of pressure"] == pytest.approx(centre, abs=1e-6)
            seen = centre if total >= CUT else 0.0
            assert cut[f"{theirs}centre of pressure"] == pytest.approx(seen, abs=1e-6)
    assert below > 0
    assert above > 20


@pytest.mark.parametrize("env_id", [LEG, HORSE])
def test_a_new_group_changes_no_other_number(env_id):
    """Its entries stand last, those before have their bits, with noise and in a batch, too."""
    usual = GROUPS[env_id][:-1]
    noise = {"noise": dict.fromkeys(usual, 0.05)}
    for rows in (1, 9):
        plain = gym.make_vec(env_id, rows, **noise)
        more = gym.make_vec(env_id, rows, observation=GROUPS[env_id], **noise)
        for env in (plain, more):
            env.reset(seed=3)
        for action in actions(1, 40, rows, env_id=env_id):
            one, other = plain.step(action)[0], more.step(action)[0]
            same(one, other[:, : one.shape[1]])
            assert other.shape[1] == one.shape[1] + len(prefixes(env_id))
            assert (np.abs(other[:, one.shape[1] :]) <= 1).all()


@pytest.mark.parametrize("entries", [ENTRIES, HORSE_ENTRIES], ids=["leg", "horse"])
@pytest.mark.parametrize("scale", [PLAIN, tanh_of(1.0)], ids=["linear", "saturating"])
def test_entries_of_users_keep_the_slots_that_they_had_before_these_groups(entries, scale):
    """Noise follows from the slot."""
    own = Entry("own", "own", "-", lambda scene: scene.episode.time, scale)
    before = [entry for entry in (*entries, own) if entry.group not in ("pressure", "context")]
    assert Slots.of((*entries, own)).places[-1] == Slots.of(tuple(before)).places[-1]


@pytest.mark.parametrize("value", [-1.0, np.nan, 1e9, "much"])
def test_a_bad_threshold_is_refused(value):
    with pytest.raises(ParameterError, match="force_threshold: expected"):
        gym.make(LEG, force_threshold=value)


def test_a_threshold_without_forces_is_refused():
    with pytest.raises(ParameterError, match=r"force_threshold.*hoof, pressure.*no effect, got.*crank"):
        gym.make(LEG, force_threshold=50.0, observation=["crank", "gait"])
    gym.make(LEG, force_threshold=50.0, observation=["crank", "gait"], privileged=["pressure"])
